//! Small models, planes and checks that the asset tests share.

use glam::{DVec3, Vec3};
use serde_json::Value;
use shadowfit::{
    asset::{AssetError, AssetRequest, Bounds, Written, write},
    gltf_file::container::{self, Chunks},
};
use shadowfit_solver::{
    mesh::Frame,
    plane::{ActiveLists, BakedPlane, BakedSet, Encoding, OPAQUE, OccluderTexture, ShadowPlane, Side},
};
use std::path::{Path, PathBuf};

/// Centre and radius with no short binary fraction.
pub const FRAME: Frame = Frame { centre_model: DVec3::new(0.1, -2.7, 1.0 / 3.0), radius: 3.3 };

pub const BOUNDS: Bounds = Bounds { min: DVec3::new(-1.0, 0.0, -1.5), max: DVec3::new(1.0, 2.0, 1e-7) };

/// The binary chunk of every model here: one triangle.
pub fn triangle() -> Vec<u8> {
    [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A valid document for [`triangle`]. `buffer` is the start of buffer 0, `more` follows at the end of the root.
pub fn document(buffer: &str, more: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
"bufferViews":[{{"buffer":0,"byteLength":36,"target":34962}}],"buffers":[{{{buffer}"byteLength":36}}]{more}}}"#
    )
}

pub fn glb(json: &str, bin: Option<&[u8]>) -> Vec<u8> {
    container::join(&Chunks { json, bin, others: vec![] }).unwrap()
}

/// Numbers that look random: a linear congruential generator.
pub struct Numbers(pub u64);

impl Numbers {
    /// From 0 to `limit - 1`.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    /// From -1 to 1.
    pub fn signed(&mut self) -> f32 {
        self.below(1 << 24) as f32 / (1 << 23) as f32 - 1.0
    }
}

/// A texture with an open ring and noise inside.
pub fn texture(width: usize, height: usize, numbers: &mut Numbers) -> OccluderTexture {
    let mut texels = vec![0; width * height];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            texels[y * width + x] = numbers.below(256) as u8;
        }
    }
    OccluderTexture { width, height, encoding: Encoding::Coverage, texels }
}

pub fn planes(count: usize) -> Vec<BakedPlane> {
    let mut numbers = Numbers(count as u64);
    let mut plane = |i: usize| {
        let mut vector = || Vec3::new(numbers.signed(), numbers.signed(), numbers.signed());
        let (origin, u, v) = (vector(), vector() + Vec3::X, vector() + 3.0 * Vec3::Y);
        let (width, height) = (3 + numbers.below(40) as usize, 3 + numbers.below(40) as usize);
        BakedPlane {
            plane: ShadowPlane { origin, u, v },
            texture: texture(width, height, &mut numbers),
            tint: [OPAQUE, [255, 0, 51], [128, 200, 254]][i % 3],
            side: [Side::Both, Side::Front, Side::Back][i % 3],
            bias: 1e-3 * i as f32,
        }
    };
    (0..count).map(&mut plane).collect()
}

/// A fresh folder with `in/` and a path for `out/`.
pub struct Folders {
    pub root: tempfile::TempDir,
}

impl Folders {
    pub fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("in")).unwrap();
        Self { root }
    }

    pub fn input(&self, name: &str, contents: &[u8]) -> PathBuf {
        let path = self.root.path().join("in").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, contents).unwrap();
        path
    }

    pub fn out(&self) -> PathBuf {
        self.root.path().join("out")
    }

    pub fn write(&self, input: &Path, planes: &[BakedPlane]) -> Result<Written, AssetError> {
        write_to(input, &self.out(), planes)
    }

    /// Names in `out/`, sorted.
    pub fn listing(&self) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(self.out()) else { return vec![] };
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

pub fn write_to(input: &Path, out_dir: &Path, planes: &[BakedPlane]) -> Result<Written, AssetError> {
    let set = BakedSet::one_section(planes.to_vec());
    write(&request(input, out_dir, &set))
}

/// One section with active lists of two directions.
pub fn active_set(planes: Vec<BakedPlane>) -> BakedSet {
    let directions = vec![Vec3::new(0.1, 0.7, -0.3).normalize(), Vec3::new(-0.2, -0.4, 0.9).normalize()];
    let lists = vec![vec![vec![0, 2]], vec![vec![1]]];
    BakedSet { active: Some(ActiveLists { directions, lists }), ..BakedSet::one_section(planes) }
}

/// A request without labels.
pub fn request<'a>(input: &'a Path, out_dir: &'a Path, set: &'a BakedSet) -> AssetRequest<'a> {
    AssetRequest { input, out_dir, stem: "m", frame: &FRAME, bounds: BOUNDS, set, origins: &[], section_of: &[] }
}

/// JSON text and binary chunk of a GLB file.
pub fn open(path: &Path) -> (String, Option<Vec<u8>>) {
    let bytes = std::fs::read(path).unwrap();
    let chunks = container::split(&bytes).unwrap();
    (chunks.json.to_owned(), chunks.bin.map(<[u8]>::to_vec))
}

pub fn parse(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}
