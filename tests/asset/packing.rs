//! The atlas: no texture overlaps another, whatever the sizes.

use crate::fixtures::{self, FRAME, Folders, Numbers, document, glb, request, texture, triangle};
use glam::Vec3;
use serde_json::Value;
use shadowfit::asset::{
    AssetRequest,
    atlas::{self, Layout, pack},
    read, write,
};
use shadowfit_solver::{
    halves::unfolded,
    plane::{BakedSet, Encoding, OccluderTexture},
    symmetry::Mirror,
};

fn assert_disjoint(sizes: &[[u32; 2]], layout: &Layout) {
    assert_eq!(layout.placements.len(), sizes.len());
    for (i, (a, [aw, ah])) in layout.placements.iter().zip(sizes).enumerate() {
        let [width, height] = layout.atlases[a.atlas];
        assert!(a.x + aw <= width && a.y + ah <= height, "texture {i} sticks out");
        for (b, [bw, bh]) in layout.placements[..i].iter().zip(sizes) {
            let apart = a.x + aw <= b.x || b.x + bw <= a.x || a.y + ah <= b.y || b.y + bh <= a.y;
            assert!(apart || (a.atlas, a.channel) != (b.atlas, b.channel), "texture {i} overlaps {b:?}");
        }
    }
}

#[test]
fn textures_of_any_size_never_overlap() {
    let mut numbers = Numbers(7);
    let (mut texels, mut bytes) = (0, 0);
    for round in 0..60 {
        let count = 1 + numbers.below(40);
        let sizes: Vec<[u32; 2]> =
            (0..count).map(|_| [3 + numbers.below(298) as u32, 3 + numbers.below(298) as u32]).collect();
        let layout = pack(&sizes).unwrap();
        assert_disjoint(&sizes, &layout);
        assert_eq!(layout, pack(&sizes).unwrap(), "round {round}");
        texels += sizes.iter().map(|[w, h]| u64::from(w * h)).sum::<u64>();
        bytes += layout.texture_bytes();
    }
    // Measured: 84 % full, rounds of one to five textures included. Without the third channel it would be 56 %.
    assert!(texels as f64 > 0.8 * bytes as f64, "{texels} texels in {bytes} bytes");
}

#[test]
fn many_equal_textures_leave_little_room() {
    let sizes = vec![[128, 128]; 96];
    let layout = pack(&sizes).unwrap();
    assert_disjoint(&sizes, &layout);
    assert!(layout.texture_bytes() <= 96 * 128 * 128 * 11 / 10, "{:?}", layout.atlases);
}

#[test]
fn large_sets_use_several_atlases() {
    let sizes = vec![[1500, 1400]; 20];
    let layout = pack(&sizes).unwrap();
    assert_disjoint(&sizes, &layout);
    assert_eq!(layout.atlases.len(), 2);
    assert!(layout.atlases.iter().flatten().all(|&side| side <= atlas::MAX_SIDE_PX));
}

/// Hundreds of small textures, as sections have them: the rest of a row hardly counts.
#[test]
fn many_small_textures_fill_the_atlas() {
    let mut numbers = Numbers(11);
    for count in [300, 2000] {
        let sizes: Vec<[u32; 2]> =
            (0..count).map(|_| [10 + numbers.below(51) as u32, 10 + numbers.below(51) as u32]).collect();
        let start = std::time::Instant::now();
        let layout = pack(&sizes).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        assert_disjoint(&sizes, &layout);
        let texels: u64 = sizes.iter().map(|[w, h]| u64::from(w * h)).sum();
        let fill = texels as f64 / layout.texture_bytes() as f64;
        println!("{count} textures: {:?}, {:.1} % full, {seconds:.3} s", layout.atlases, 100.0 * fill);
        assert!(fill >= 0.9, "{count} textures: {fill}");
    }
}

#[test]
fn equal_textures_share_a_region() {
    let mut numbers = Numbers(5);
    let (a, b) = (texture(20, 9, &mut numbers), texture(5, 30, &mut numbers));
    let mut field = a.clone();
    field.encoding = Encoding::Sdf;
    field.texels.iter_mut().for_each(|texel| *texel /= 3);
    // The same bytes read in another way, and the same bytes in another shape, are other textures.
    let mut flat = field.clone();
    flat.encoding = Encoding::Coverage;
    let wide = OccluderTexture { width: 30, height: 5, encoding: Encoding::Coverage, texels: vec![0; 150] };
    let tall = OccluderTexture { width: 5, height: 30, ..wide.clone() };
    let list = [&a, &b, &a.clone(), &field, &flat, &b, &wide, &tall, &wide];
    let (layout, atlases) = atlas::build(&list).unwrap();
    let place = &layout.placements;
    assert_eq!([place[2], place[5], place[8]], [place[0], place[1], place[6]]);
    let places: std::collections::BTreeSet<_> = place.iter().map(|p| (p.atlas, p.channel as usize, p.x, p.y)).collect();
    assert_eq!((places.len(), atlases.len()), (6, 1));
}

/// Both halves of a mirrored set name the same regions, and only one half's texels are stored.
#[test]
fn mirrored_planes_share_their_regions_in_the_files() {
    let half = fixtures::active_set(fixtures::planes(3));
    let set = unfolded(half.clone(), &Mirror::new(Vec3::X, 0.0));
    assert_eq!((set.planes.len(), set.sections.len(), set.texture_bytes()), (6, 2, half.texture_bytes()));
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let out = folders.out();
    let origins = shadowfit::scene::load(&input).unwrap().origins;
    let request =
        AssetRequest { origins: &origins, section_of: &vec![1; origins.len()], ..request(&input, &out, &set) };
    let written = write(&request).unwrap();
    assert_eq!(written.texture_bytes, atlas_bytes(&half));
    let sidecar: Value = serde_json::from_slice(&std::fs::read(&written.sidecar).unwrap()).unwrap();
    let planes = sidecar["sets"][0]["planes"].as_array().unwrap();
    for (near, far) in planes[..3].iter().zip(&planes[3..]) {
        for member in ["occluderTexture", "region", "channel", "encoding", "bias"] {
            assert_eq!(near[member], far[member], "{member}");
        }
        assert_ne!(near["origin"], far["origin"]);
    }
    for path in [&written.model, &written.sidecar] {
        let back = read(path).unwrap().in_unit_space(&FRAME);
        assert_eq!((&back.sections, &back.active), (&set.sections, &set.active));
        for (a, b) in back.planes.iter().zip(&set.planes) {
            assert_eq!((&a.texture, a.side), (&b.texture, b.side));
            assert!(a.plane.origin.distance(b.plane.origin) < 1e-6 && a.plane.u.distance(b.plane.u) < 1e-6);
        }
    }
}

fn atlas_bytes(set: &BakedSet) -> u64 {
    atlas::build(&set.planes.iter().map(|baked| &baked.texture).collect::<Vec<_>>()).unwrap().0.texture_bytes()
}

#[test]
fn atlases_are_plain_rgb_png_files() {
    let mut numbers = Numbers(3);
    let textures = [texture(20, 9, &mut numbers), texture(5, 30, &mut numbers)];
    let (_, atlases) = atlas::build(&textures.iter().collect::<Vec<_>>()).unwrap();
    let png = &atlases[0].png;
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    // Depth 8, colour type 2 (RGB), and no chunk but the three that must be there.
    assert_eq!(png[24..26], [8, 2]);
    let mut names = vec![];
    let mut at = 8;
    while at < png.len() {
        names.push(std::str::from_utf8(&png[at + 4..at + 8]).unwrap());
        at += 12 + u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
    }
    names.dedup();
    assert_eq!(names, ["IHDR", "IDAT", "IEND"]);
}

#[test]
fn textures_that_would_bleed_or_break_are_refused() {
    let mut numbers = Numbers(3);
    let good = texture(8, 6, &mut numbers);
    for (i, at) in [(0, "(0, 0)"), (7, "(7, 0)"), (40, "(0, 5)"), (23, "(7, 2)")] {
        let mut bad = good.clone();
        bad.texels[i] = 1;
        let error = atlas::build(&[&good, &bad]).unwrap_err();
        assert!(error.to_string().contains("shadow plane 1") && error.to_string().contains(at), "{error}");
        assert_eq!(error.exit_code(), 4);
    }
    let mut short = good.clone();
    short.texels.pop();
    assert!(atlas::build(&[&short]).is_err());
    let thin = OccluderTexture { width: 2, height: 5, encoding: Encoding::Coverage, texels: vec![0; 10] };
    assert!(atlas::build(&[&thin]).is_err());
}
