//! Closed-form scenes on a stage, drawn by a technique and traced, and the errors between.

use crate::pictures;
use glam::{DVec3, Vec2, Vec3};
use shadowfit::{
    masks::MaskErrors,
    render::{
        Antialias, Camera, FrameOptions, FrameRequest, Light, Mode,
        gpu::Gpu,
        ray_traced::RayTraced,
        receiver::Receiver,
        stage::{Placement, Stage},
        technique::Technique,
    },
    scene::{Material, Scene},
};
use shadowfit_solver::mesh::{Frame, Mesh, Sides};
use std::sync::LazyLock;

pub const SIZE_PX: [u32; 2] = [256, 256];

/// World space is model space.
pub const WORLD: Frame = Frame { centre_model: DVec3::ZERO, radius: 1.0 };

/// The adapter of all tests; without one they FAIL: the software one of mesa-vulkan-drivers will do.
pub fn gpu() -> &'static Gpu {
    static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::new().expect("these tests need a graphics adapter"));
    &GPU
}

/// A scene, on the device and traced; world space is the scene's model space.
pub struct Case {
    pub stage: Stage,
    pub traced: RayTraced,
    /// Where world space lies in model space.
    pub world: Frame,
}

impl Case {
    pub fn new(scene: Scene) -> Self {
        Self::in_world(scene, WORLD)
    }

    /// A committed model on a ground of half extent 2; world space is the model's unit space.
    pub fn on_ground(model: &str) -> Self {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(model);
        let mut scene = shadowfit::scene::load(&path).expect("a model");
        let world = Mesh::new(&scene.soup).expect("triangles").frame;
        scene.stand_on_ground(&world, 2.0);
        Self::in_world(scene, world)
    }

    fn in_world(scene: Scene, world: Frame) -> Self {
        let stage = Stage::new(gpu(), &scene, &world, &[Placement::IDENTITY]).expect("the scene fits");
        Self { stage, traced: RayTraced::new(scene, &world).expect("a model"), world }
    }

    /// The traced mask and the drawn one.
    pub fn masks(&mut self, technique: &mut dyn Technique, request: &FrameRequest) -> [image::RgbaImage; 2] {
        let view = self.traced.look(request).expect("traced");
        let traced = self.traced.picture(&view).expect("traced");
        [traced, self.stage.render(technique, request).expect("drawn")]
    }

    /// A box on a ground that receives and does not cast.
    pub fn of_box_on_its_ground() -> Self {
        Self::new(Scene { ground_triangles: 2, ..box_on_ground() })
    }

    /// For each pixel: does the camera see the ground?
    pub fn ground_seen(&self, request: &FrameRequest) -> Vec<bool> {
        self.traced.ground_seen(&self.traced.look(request).expect("traced"))
    }

    /// The flat receiver that the ground is.
    pub fn receiver(&self) -> Receiver {
        Receiver::of_ground(self.traced.scene(), &self.world).expect("a ground")
    }

    /// Missed and false shadow, shares of the covered pixels. Keeps both masks for people.
    pub fn errors(&mut self, technique: &mut dyn Technique, request: &FrameRequest) -> [f64; 2] {
        let [traced, drawn] = self.masks(technique, request);
        keep(&drawn, &format!("{}.png", technique.name()));
        keep(&shadowfit::masks::difference(&traced, &drawn), &format!("{}.difference.png", technique.name()));
        let errors = MaskErrors::between(&traced, &drawn);
        assert!(errors.covered > 1000.0, "the camera sees next to nothing");
        [errors.share(errors.missed), errors.share(errors.false_)]
    }
}

/// Missed and false shadow, shares of the covered pixels of the ground.
pub fn ground_errors([traced, drawn]: &[image::RgbaImage; 2], ground: &[bool]) -> [f64; 2] {
    let errors = MaskErrors::where_seen(traced, drawn, |pixel| ground[pixel]);
    assert!(errors.covered > 1000.0, "the camera sees next to no ground");
    [errors.share(errors.missed), errors.share(errors.false_)]
}

/// Pixels of the ground that are wrong though no pixel around them differs from them in the traced mask: wrong not just
/// because a border runs through them.
pub fn wrong_off_borders([traced, drawn]: &[image::RgbaImage; 2], ground: &[bool]) -> usize {
    let [width, height] = [traced.width(), traced.height()];
    let around = |x: u32, y: u32| {
        (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| (i, j)))
    };
    let is_wrong = |&(x, y): &(u32, u32)| {
        let here = traced.get_pixel(x, y);
        here != drawn.get_pixel(x, y) && around(x, y).all(|(i, j)| traced.get_pixel(i, j) == here)
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.filter(|&(x, y)| ground[(y * width + x) as usize]).filter(is_wrong).count()
}

/// A mask from `eye`, looking at `target`.
pub fn mask(eye: Vec3, target: Vec3, light: Light) -> FrameRequest {
    let reach = eye.distance(target);
    let camera = Camera::looking(eye, target, 0.9, [0.02 * reach, 4.0 * reach]);
    FrameRequest {
        camera,
        light,
        options: FrameOptions { size_px: SIZE_PX, mode: Mode::Mask, antialias: Antialias::Off },
    }
}

pub fn directional(x: f32, y: f32, z: f32) -> Light {
    Light::Directional { to_light: Vec3::new(x, y, z).normalize() }
}

/// The golden picture of a technique: its mask of a scene, in tests/golden/techniques. `none` alone may lack shadow.
pub fn golden(case: &mut Case, technique: &mut dyn Technique, request: &FrameRequest) {
    let options = FrameOptions { size_px: pictures::SIZE_PX, ..request.options };
    let frame = case.stage.render(technique, &FrameRequest { options, ..*request }).expect("drawn");
    let words: Vec<String> = technique.name().split_whitespace().map(|word| word.replace(',', "")).collect();
    assert!(words == ["none"] || !pictures::shows_too_little_shadow(&frame), "choose another view or light");
    pictures::check(&format!("techniques/{}", words.join("-")), &frame)
        .unwrap_or_else(|difference| panic!("{difference}"));
}

/// Writes a picture that a person may look at to `target/tmp/techniques/`.
pub fn keep(picture: &image::RgbaImage, name: &str) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("techniques");
    std::fs::create_dir_all(&folder).expect("writable");
    picture.save(folder.join(name)).expect("writable");
}

/// An empty scene with one white material.
pub fn empty() -> Scene {
    let white =
        Material { base_color: [1.0; 4], image: None, repeat: [false; 2], alpha_cutoff: None, transmittance: None };
    Scene { materials: vec![white], ..Scene::default() }
}

/// Adds a parallelogram, seen from both sides; `u` x `v` is its normal.
pub fn quad(scene: &mut Scene, corner: Vec3, u: Vec3, v: Vec3) {
    let [a, b, c, d] = [corner, corner + u, corner + u + v, corner + v];
    for triangle in [[a, b, c], [a, c, d]] {
        push(scene, triangle);
    }
}

/// Adds a box by its centre and half extents.
pub fn cuboid(scene: &mut Scene, centre: Vec3, half: Vec3) {
    for axis in 0..3 {
        let (mut n, mut u, mut v) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        n[axis] = half[axis];
        u[(axis + 1) % 3] = half[(axis + 1) % 3];
        v[(axis + 2) % 3] = half[(axis + 2) % 3];
        quad(scene, centre + n - u - v, 2.0 * u, 2.0 * v);
        quad(scene, centre - n - u - v, 2.0 * v, 2.0 * u);
    }
}

/// Adds a triangle, seen from both sides.
pub fn push(scene: &mut Scene, corners: [Vec3; 3]) {
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    scene.soup.corners_model.push(corners.map(Vec3::as_dvec3));
    scene.soup.sides.push(Sides::Both);
    scene.soup.cutout.push(None);
    scene.soup.cutout_uv.push([Vec2::ZERO; 3]);
    scene.normals.push([normal; 3]);
    scene.uvs.push([Vec2::ZERO; 3]);
    scene.material_of.push(0);
    scene.section_of.push(0);
    scene.origins.push(shadowfit::scene::Origin { mesh: 0, primitive: 0, triangle: scene.origins.len() as u32 });
}

/// Adds a level ground from `low` to `high` (x, z) at height 0, behind all else: it receives and does not cast.
pub fn ground(scene: &mut Scene, low: Vec2, high: Vec2) {
    let corner = Vec3::new(low.x, 0.0, high.y);
    quad(scene, corner, Vec3::X * (high.x - low.x), Vec3::NEG_Z * (high.y - low.y));
    scene.ground_triangles = 2;
}

/// Level plates (centre, half side) over a ground of side 3.
pub fn plates_over_ground(plates: &[(Vec3, f32)]) -> Scene {
    let mut scene = empty();
    for &(centre, half) in plates {
        quad(&mut scene, centre + Vec3::new(-half, 0.0, half), Vec3::X * 2.0 * half, Vec3::NEG_Z * 2.0 * half);
    }
    ground(&mut scene, Vec2::splat(-1.5), Vec2::splat(1.5));
    scene
}

/// A square plate of side 0.8 at height 0.5 over a ground of side 3 at height 0.
pub fn plate_over_ground() -> Scene {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-0.4, 0.5, 0.4), Vec3::X * 0.8, Vec3::Z * -0.8);
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    scene
}

/// A box of side 0.5 that stands on a ground of side 3.
pub fn box_on_ground() -> Scene {
    let mut scene = empty();
    cuboid(&mut scene, Vec3::new(0.0, 0.25, 0.0), Vec3::splat(0.25));
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    scene
}
