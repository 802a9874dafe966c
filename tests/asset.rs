//! Assets written and read back: nothing of the input is lost, nothing is overwritten, nothing wrong is accepted.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[path = "asset/broken.rs"]
mod broken;
#[path = "asset/fixtures.rs"]
mod fixtures;
#[path = "asset/ground.rs"]
mod ground;
#[path = "asset/packing.rs"]
mod packing;
#[path = "asset/survival.rs"]
mod survival;
#[path = "asset/writing.rs"]
mod writing;

use fixtures::{BOUNDS, FRAME, Folders, document, glb, planes, triangle, write_to};
use glam::{DVec3, Vec3};
use shadowfit::asset::{AssetRequest, Bounds, ShadowSet, read, write};
use shadowfit_solver::{
    mesh::Frame,
    plane::{BakedPlane, BakedSet, Side},
    shade::{set_rows, visibility},
};

fn assert_same(planes: &[BakedPlane], set: &ShadowSet, frame: &Frame) {
    let back = set.in_unit_space(frame);
    assert_eq!(back.planes.len(), planes.len());
    for (i, (a, b)) in planes.iter().zip(&back.planes).enumerate() {
        assert_eq!(a.texture, b.texture, "plane {i}");
        assert_eq!(a.side, b.side, "plane {i}");
        // f64 in the file: what remains is one rounding to f32.
        let pairs = [(a.plane.origin, b.plane.origin), (a.plane.u, b.plane.u), (a.plane.v, b.plane.v)];
        for (p, q) in pairs {
            assert!(p.distance(q) <= 2.0 * f32::EPSILON * (1.0 + p.length()), "plane {i}: {p} became {q}");
        }
        assert!((a.bias - b.bias).abs() <= f32::EPSILON * a.bias, "plane {i}");
    }
    assert_eq!((&back.sections, &back.active), (&vec![(0..planes.len() as u32).collect()], &None));
}

#[test]
fn written_planes_read_back_from_the_model_and_from_the_sidecar() {
    for count in [1, 2, 3, 11, 40] {
        let folders = Folders::new();
        let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
        let planes = planes(count);
        let written = folders.write(&input, &planes).unwrap();
        for path in [&written.model, &written.sidecar] {
            let set = read(path).unwrap();
            assert_same(&planes, &set, &FRAME);
            assert_eq!(set.bounds, BOUNDS);
        }
        let texels: usize = planes.iter().map(|p| p.texture.texels.len()).sum();
        assert!(written.texture_bytes >= texels as u64);
        assert_eq!(written.planes, count);
        assert!(written.to_string().contains(&format!("planes: {count}")));
    }
}

#[test]
fn a_model_without_shadow_gets_an_empty_set() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let written = folders.write(&input, &[]).unwrap();
    assert_eq!(folders.listing(), ["m.shadow.glb", "m.shadow.json"]);
    assert!(written.to_string().contains("no self-shadow"), "{written}");
    assert_eq!((written.texture_bytes, written.png_bytes()), (0, 0));
    for path in [&written.model, &written.sidecar] {
        assert_eq!(
            read(path).unwrap(),
            ShadowSet { bounds: BOUNDS, planes: vec![], sections: vec![vec![]], active: None, ground: None }
        );
    }
    let (json, bin) = fixtures::open(&written.model);
    assert_eq!(bin, Some(triangle()));
    assert!(!json.contains("textures") && !json.contains("images"), "{json}");
}

#[test]
fn planes_stay_exact_far_from_the_origin_and_at_any_scale() {
    for (centre, radius) in [(1e5, 1.7), (-1e5, 0.01), (0.0, 1e-6), (1e7, 1e6)] {
        let frame = Frame { centre_model: DVec3::new(centre, centre / 3.0, -centre), radius };
        let folders = Folders::new();
        let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
        let set = BakedSet::one_section(planes(5));
        let bounds = Bounds { min: frame.centre_model - radius, max: frame.centre_model + radius };
        let out_dir = &folders.out();
        let request = AssetRequest { frame: &frame, bounds, ..fixtures::request(&input, out_dir, &set) };
        let back = read(&write(&request).unwrap().sidecar).unwrap();
        assert_same(&set.planes, &back, &frame);
        assert_eq!(back.bounds, bounds);
    }
}

#[test]
fn the_same_request_gives_the_same_bytes() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let planes = planes(9);
    let (a, b) = (folders.root.path().join("a"), folders.root.path().join("b"));
    write_to(&input, &a, &planes).unwrap();
    write_to(&input, &b, &planes).unwrap();
    for name in ["m.shadow.glb", "m.shadow.json", "m.atlas-0.png"] {
        assert_eq!(std::fs::read(a.join(name)).unwrap(), std::fs::read(b.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn a_moved_frame_node_moves_its_planes() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let planes = planes(3);
    let written = folders.write(&input, &planes).unwrap();
    let (json, bin) = fixtures::open(&written.model);
    // A parent that doubles, and a mirror with an offset on the frame node itself.
    let moved = json
        .replace("\"name\":\"shadow planes\"", "\"scale\":[-1,1,1],\"translation\":[0,0,5],\"name\":\"shadow planes\"")
        .replace("{\"mesh\":0}", "{\"mesh\":0,\"scale\":[2,2,2],\"children\":[1]}")
        .replace("\"nodes\":[0,1]", "\"nodes\":[0]");
    let path = folders.input("moved.glb", &glb(&moved, bin.as_deref()));
    let (before, after) = (read(&written.model).unwrap(), read(&path).unwrap());
    let mirror = DVec3::new(-2.0, 2.0, 2.0);
    for (a, b) in before.planes.iter().zip(&after.planes) {
        let origin = a.rectangle.origin * mirror + DVec3::new(0.0, 0.0, 10.0);
        assert!(b.rectangle.origin.distance(origin) < 1e-12);
        assert!(b.rectangle.u_axis.distance(a.rectangle.u_axis * mirror) < 1e-12);
        assert!((b.bias - 2.0 * a.bias).abs() < 1e-12);
    }
    let sides: Vec<Side> = after.planes.iter().map(|p| p.side).collect();
    assert_eq!(sides, [Side::Both, Side::Back, Side::Front], "a mirror swaps front and back");
    assert_eq!(after.bounds, Bounds { min: DVec3::new(-2.0, 0.0, 7.0), max: DVec3::new(2.0, 4.0, 10.0 + 2e-7) });
}

/// A direction towards the light turns with the model like any vector, also under a scale that differs by axis.
#[test]
fn a_moved_frame_node_turns_the_directions() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let (set, out) = (fixtures::active_set(planes(3)), folders.out());
    let written = write(&fixtures::request(&input, &out, &set)).unwrap();
    let before = set.active.unwrap();
    assert_eq!(read(&written.model).unwrap().active.as_ref(), Some(&before), "not to the last bit");
    assert_eq!(read(&written.sidecar).unwrap().active.as_ref(), Some(&before), "not to the last bit");
    let (json, bin) = fixtures::open(&written.model);
    // A quarter turn around y after a scale: (x, y, z) becomes (z, 3 y, -2 x).
    let turned = json.replace(
        "\"name\":\"shadow planes\"",
        "\"rotation\":[0,0.7071067811865476,0,0.7071067811865476],\"scale\":[2,3,1],\"name\":\"shadow planes\"",
    );
    let path = folders.input("turned.glb", &glb(&turned, bin.as_deref()));
    let after = read(&path).unwrap().active.unwrap();
    assert_eq!(after.lists, before.lists);
    for (a, b) in before.directions.iter().zip(&after.directions) {
        let expected = Vec3::new(a.z, 3.0 * a.y, -2.0 * a.x).normalize();
        assert!(b.distance(expected) < 1e-6 && (b.length() - 1.0).abs() < 1e-6, "{a} became {b}, not {expected}");
    }
}

#[test]
fn unit_space_planes_cast_the_same_shadow() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let planes = planes(6);
    let back = read(&folders.write(&input, &planes).unwrap().model).unwrap().in_unit_space(&FRAME);
    let l = Vec3::new(0.3, 0.8, 0.5).normalize();
    let shadow = |set: &BakedSet, p: Vec3| visibility(&set.planes, &set_rows(set, l), &set.lists(l)[0], p).x;
    let planes = BakedSet::one_section(planes);
    let mut numbers = fixtures::Numbers(1);
    for _ in 0..200 {
        let p = Vec3::new(numbers.signed(), numbers.signed(), numbers.signed());
        let difference = (shadow(&planes, p) - shadow(&back, p)).abs();
        // Noise textures change by 1 over a texel of 1/40: 1e-6 in position is 1e-4 in coverage.
        assert!(difference < 1e-3, "{p}: {difference}");
    }
}
