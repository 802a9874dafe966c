//! Assets of several sections: labels are written into the model, and the scene comes back to the last bit.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

#[path = "scene/build.rs"]
#[allow(dead_code, reason = "each test binary uses its part")]
mod build;
#[path = "sections/labels.rs"]
mod labels;
#[path = "sections/measured.rs"]
mod measured;
#[path = "sections/meshes.rs"]
mod meshes;
#[path = "sections/round_trip.rs"]
mod round_trip;

use glam::{DVec3, Vec3};
use serde_json::Value;
use shadowfit::{
    asset::{AssetError, AssetRequest, Bounds, Written, read, write},
    gltf_file::container,
    scene::{Origin, Scene, load},
};
use shadowfit_solver::{
    mesh::Frame,
    plane::{ActiveLists, BakedPlane, BakedSet, Encoding, OPAQUE, OccluderTexture, ShadowPlane, Side},
    sampling::uniform,
};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Where unit space lies.
pub const FRAME: Frame = Frame { centre_model: DVec3::new(0.1, -2.7, 1.0 / 3.0), radius: 3.3 };

/// A plane with a texture of its own, of either encoding.
fn plane(seed: u64) -> BakedPlane {
    let number = |i: u64| uniform(seed, i) as f32;
    let (width, height) = (4 + (seed % 5) as usize, 3 + (seed % 7) as usize);
    let encoding = if seed.is_multiple_of(2) { Encoding::Sdf } else { Encoding::Coverage };
    let ring = if encoding == Encoding::Sdf { 127 } else { 0 };
    let inside = |x: usize, y: usize| (1..width - 1).contains(&x) && (1..height - 1).contains(&y);
    let texel = |i: usize| if inside(i % width, i / width) { (40 * i % 256) as u8 } else { ring };
    BakedPlane {
        plane: ShadowPlane {
            origin: Vec3::new(number(1), number(2), number(3)),
            u: Vec3::new(1.0, number(4), 0.0),
            v: Vec3::new(0.0, 1.0, number(5)),
        },
        texture: OccluderTexture { width, height, encoding, texels: (0..width * height).map(texel).collect() },
        tint: OPAQUE,
        side: Side::Both,
        bias: 1e-3,
    }
}

/// Three planes a section, two of them shared with the next one; per direction some of them.
pub fn set(sections: u32) -> BakedSet {
    let count = sections + 2;
    let whole: Vec<Vec<u32>> = (0..sections).map(|section| vec![section, section + 1, section + 2]).collect();
    let unit = |i: u64| shadowfit_solver::lights::direction(i as f32 * 0.7, (i as f32 * 0.31).sin());
    let some = |i: u64| {
        let part =
            |list: &Vec<u32>| list.iter().copied().filter(|plane| (u64::from(*plane) + i).is_multiple_of(2)).collect();
        whole.iter().map(part).collect()
    };
    let active = ActiveLists { directions: (0..7).map(unit).collect(), lists: (0..7).map(some).collect() };
    BakedSet {
        planes: (0..count).map(|i| plane(u64::from(i))).collect(),
        sections: whole,
        active: Some(active),
        ground: None,
    }
}

/// Where files for the Khronos validator go: `tests/khronos/validate.mjs` is run on them by the test script.
pub fn for_validator(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("khronos").join(format!("sections-{name}"))
}

/// Writes a set of `count` sections.
pub fn write_sections(
    (input, out_dir): (&Path, &Path),
    scene: &Scene,
    (count, section_of): (u32, &[u32]),
) -> Result<Written, AssetError> {
    let bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
    let set = &set(count);
    write(&AssetRequest { input, out_dir, stem: "m", frame: &FRAME, bounds, set, origins: &scene.origins, section_of })
}

/// A model before and after.
pub struct RoundTrip {
    /// JSON of the input.
    pub before: Value,
    /// JSON of the output.
    pub after: Value,
    /// Binary chunk of the output.
    pub bin: Vec<u8>,
    /// What the output shows.
    pub scene: Scene,
    /// Files of the output.
    pub written: Written,
}

/// Writes sections into a model and checks that everything comes back.
pub fn round_trip(input: &Path, out_dir: &Path, count: u32, section: impl Fn(Origin) -> u32) -> RoundTrip {
    let scene = load(input).unwrap_or_else(|error| panic!("{error}"));
    let section_of: Vec<u32> = scene.origins.iter().map(|origin| section(*origin)).collect();
    let written = write_sections((input, out_dir), &scene, (count, &section_of)).unwrap();
    let back = load(&written.model).unwrap_or_else(|error| panic!("{error}"));
    same_scene(&scene, &back);
    assert_eq!(back.section_of, section_of);
    for path in [&written.model, &written.sidecar] {
        let (set, found) = (set(count), read(path).unwrap().in_unit_space(&FRAME));
        assert_eq!((&found.sections, &found.active), (&set.sections, &set.active), "{}", path.display());
        assert!(found.planes.iter().zip(&set.planes).all(|(a, b)| a.texture == b.texture && a.side == b.side));
    }
    let ((before, old), (after, bin)) = (parts(input), parts(&written.model));
    assert!(bin.starts_with(&old), "the binary chunk changed");
    kept(&before, &after);
    RoundTrip { before, after, bin, scene: back, written }
}

/// JSON and binary chunk of a GLB or a glTF.
fn parts(path: &Path) -> (Value, Vec<u8>) {
    let bytes = fs::read(path).unwrap();
    match container::split(&bytes) {
        Ok(chunks) => (serde_json::from_str(chunks.json).unwrap(), chunks.bin.unwrap_or_default().to_vec()),
        Err(_) => (serde_json::from_slice(&bytes).unwrap(), Vec::new()),
    }
}

/// Every triangle to the last bit, and all that is drawn with it.
fn same_scene(a: &Scene, b: &Scene) {
    let bits = |scene: &Scene| -> Vec<u64> {
        let corners = scene.soup.corners_model.iter().flatten().flat_map(|p| p.to_array()).map(f64::to_bits);
        let normals = scene.normals.iter().flatten().flat_map(|n| n.to_array());
        let uvs = scene.uvs.iter().flatten().flat_map(|uv| uv.to_array());
        corners.chain(normals.chain(uvs).map(|x| u64::from(x.to_bits()))).collect()
    };
    assert!(bits(a) == bits(b), "triangles changed");
    assert_eq!((&a.soup.sides, &a.soup.cutout), (&b.soup.sides, &b.soup.cutout));
    assert_eq!((&a.material_of, &a.origins, &a.skipped), (&b.material_of, &b.origins, &b.skipped));
}

/// The records of the input are there, but for those of primitives; nothing is drawn more often.
fn kept(before: &Value, after: &Value) {
    let list = |value: &Value, key: &str| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    for key in ["accessors", "bufferViews", "nodes", "materials", "textures", "images", "skins"] {
        let (old, new) = (list(before, key), list(after, key));
        assert!(new.starts_with(&old), "{key} changed");
    }
    let primitives = |value: &Value| -> Vec<usize> {
        list(value, "meshes").iter().map(|mesh| list(mesh, "primitives").len()).collect()
    };
    assert_eq!(primitives(before), primitives(after), "the number of draws changed");
}
