//! The wgpu renderer against its CPU twin and against closed-form shadows. Without an adapter these tests FAIL: the
//! software one of mesa-vulkan-drivers will do.

mod procedural;

use glam::Vec3;
use image::RgbaImage;
use shadowfit::{
    render::{Antialias, Camera, FrameOptions, FrameRequest, Light, Mode, RenderError, cpu, gpu::Gpu, turntable},
    scene::Scene,
};
use shadowfit_solver::{
    mesh::{Mesh, Sides},
    plane::{ActiveLists, BakedPlane, BakedSet, Encoding, OPAQUE, OccluderTexture, ShadowPlane, Side},
    shade::EDGE_ON,
};
use std::sync::LazyLock;

const SIZE_PX: [u32; 2] = [320, 320];

/// Both renderers with the same scene and planes.
struct Twins<'a> {
    gpu: turntable::Turntable,
    cpu: cpu::Turntable<'a>,
}

impl<'a> Twins<'a> {
    /// All planes in one section.
    fn new(scene: &'a Scene, mesh: &'a Mesh, planes: &[BakedPlane]) -> Self {
        Self::with(scene, mesh, &BakedSet::one_section(planes.to_vec()))
    }

    fn with(scene: &'a Scene, mesh: &'a Mesh, set: &BakedSet) -> Self {
        static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::new().expect("these tests need a graphics adapter"));
        let mut gpu = turntable::Turntable::new(&GPU, scene, &mesh.frame).expect("the scene fits");
        gpu.set_planes(set).expect("the planes fit");
        let mut cpu = cpu::Turntable::new(scene, mesh);
        cpu.set_planes(set);
        Self { gpu, cpu }
    }

    /// The frame by wgpu and by the CPU.
    fn render(&mut self, request: &FrameRequest) -> [RgbaImage; 2] {
        [self.gpu.render(request).expect("drawn"), self.cpu.render(request).expect("drawn")]
    }
}

fn mesh_of(scene: &Scene) -> Mesh {
    Mesh::new(&scene.soup).expect("a model")
}

fn directional(x: f32, y: f32, z: f32) -> Light {
    Light::Directional { to_light: Vec3::new(x, y, z).normalize() }
}

fn request(camera: Camera, light: Light, mode: Mode) -> FrameRequest {
    FrameRequest { camera, light, options: FrameOptions { size_px: SIZE_PX, mode, antialias: Antialias::Off } }
}

/// Six views around the scene.
fn views() -> Vec<Camera> {
    (0..6u8).map(|i| Camera::turntable(f32::from(i) * 1.05 + 0.2, [0.5, 0.15, -0.3][usize::from(i) % 3])).collect()
}

/// Ordinary lights, an axis, lights in and just off the first two planes, lights outside and inside the model.
fn lights(planes: &[BakedPlane]) -> Vec<Light> {
    let in_plane = planes[0].plane.u.normalize();
    let grazing = planes[1].plane.u.normalize() + 1.5 * EDGE_ON * planes[1].plane.normal();
    vec![
        directional(0.4, 0.8, 0.5),
        directional(-0.7, 0.3, 0.2),
        directional(0.1, 0.5, -0.9),
        Light::Directional { to_light: Vec3::Y },
        Light::Directional { to_light: in_plane },
        Light::Directional { to_light: grazing.normalize() },
        Light::Point { position: Vec3::new(0.9, 1.4, 0.8) },
        Light::Point { position: Vec3::new(-0.1, 0.3, 0.1) },
    ]
}

/// How two masks differ.
#[derive(Debug)]
struct Difference {
    covered: usize,
    /// Pixels that only one of the two covers, share of `covered`.
    silhouette: f64,
    /// Share of the pixels covered by both where only one of the two is in shadow.
    shadow: f64,
    /// Share of them where only one faces the light.
    facing: f64,
    /// Mean absolute difference of R over them, 0..255.
    mean: f64,
}

fn compare([a, b]: &[RgbaImage; 2]) -> Difference {
    let (mut covered, mut silhouette, mut shadow, mut facing, mut sum) = (0, 0, 0, 0, 0.0);
    for (p, q) in a.pixels().zip(b.pixels()) {
        let ([pr, pg, pb, _], [qr, qg, qb, _]) = (p.0, q.0);
        silhouette += usize::from(pb != qb);
        if pb == 255 && qb == 255 {
            covered += 1;
            shadow += usize::from((pr >= 128) != (qr >= 128));
            facing += usize::from(pg != qg);
            sum += f64::from(pr.abs_diff(qr));
        }
    }
    let share = |count: usize| count as f64 / covered.max(1) as f64;
    let (silhouette, shadow, facing) = (share(silhouette), share(shadow), share(facing));
    Difference { covered, silhouette, shadow, facing, mean: sum / covered.max(1) as f64 }
}

/// Writes a picture that a person may look at to `target/tmp/render/`.
fn keep(picture: &RgbaImage, name: &str) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("render");
    std::fs::create_dir_all(&folder).expect("writable");
    picture.save(folder.join(name)).expect("writable");
}

/// The twins round p, the silhouette and the filter's weights differently, and nothing else: one pixel in a thousand
/// over all frames, three in a frame that is mostly edge.
#[test]
fn masks_agree_under_all_lights() {
    let (scene, planes) = (procedural::scene(), procedural::planes());
    let mesh = mesh_of(&scene);
    let mut twins = Twins::new(&scene, &mesh, &planes);
    let (mut differences, mut shadowed) = (Vec::new(), 0);
    for camera in views() {
        for light in lights(&planes) {
            let frames = twins.render(&request(camera, light, Mode::Mask));
            shadowed += frames[0].pixels().filter(|p| p.0[0] < 128 && p.0[1] == 255).count();
            let difference = compare(&frames);
            assert!(difference.covered > 5_000, "{light:?}: {difference:?}");
            assert!(difference.shadow <= 0.003 && difference.facing <= 0.003, "{light:?}: {difference:?}");
            assert!(difference.silhouette <= 0.01, "{light:?}: {difference:?}");
            differences.push(difference);
        }
    }
    let mean = |of: fn(&Difference) -> f64| differences.iter().map(of).sum::<f64>() / differences.len() as f64;
    let (shadow, facing, mean_r) = (mean(|d| d.shadow), mean(|d| d.facing), mean(|d| d.mean));
    println!("shadow {shadow:.6}, facing {facing:.6}, silhouette {:.6}, mean R {mean_r:.4}", mean(|d| d.silhouette));
    assert!(shadow <= 0.001 && facing <= 0.001 && mean_r <= 0.5, "{shadow} {facing} {mean_r}");
    assert!(shadowed > 100_000, "the planes cast too little to test anything: {shadowed}");
}

/// Seven sections in stripes and one triangle in eight in none; every other plane as a distance field; four directions
/// that pick the lists.
fn sectioned(scene: &mut Scene) -> BakedSet {
    let count = scene.section_of.len();
    scene.section_of = (0..count as u32).map(|triangle| triangle / 16 % 8).collect();
    let mut planes = procedural::planes();
    for baked in planes.iter_mut().step_by(2) {
        // A step of the coverage's bytes is the field's border; below it the field is open, as at the ring.
        baked.texture.encoding = Encoding::Sdf;
    }
    let list =
        |section: u32, step: u32| (0..7).filter(|plane| (plane + section).is_multiple_of(step)).collect::<Vec<u32>>();
    let sections: Vec<Vec<u32>> = (0..7).map(|section| list(section, 1)).collect();
    let directions = vec![Vec3::Y, Vec3::X, Vec3::NEG_X, Vec3::Z];
    let of = |direction: u32| (0..7).map(|section| list(section, 2 + direction)).collect();
    BakedSet {
        planes,
        sections,
        active: Some(ActiveLists { directions, lists: (0..4).map(of).collect() }),
        ground: None,
    }
}

/// Each section has its shadows, and those of the list that the light picks. A distance field has no grey, so the twins
/// may differ by all of the light where its border runs through a pixel's centre; that is as rare as at other edges.
#[test]
fn sections_agree_under_all_lights() {
    let mut scene = procedural::scene();
    let set = sectioned(&mut scene);
    let mesh = mesh_of(&scene);
    let all = BakedSet { active: None, ..set.clone() };
    let mut twins = Twins::with(&scene, &mesh, &set);
    let mut without_lists = Twins::with(&scene, &mesh, &all);
    let (mut shadow, mut frames, mut changed) = (0.0, 0, 0);
    for camera in views() {
        for light in lights(&set.planes) {
            let request = request(camera, light, Mode::Mask);
            let pair = twins.render(&request);
            let difference = compare(&pair);
            assert!(difference.shadow <= 0.003, "{light:?}: {difference:?}");
            (shadow, frames) = (shadow + difference.shadow, frames + 1);
            let whole = without_lists.gpu.render(&request).expect("drawn");
            changed += pair[0].pixels().zip(whole.pixels()).filter(|(p, q)| p != q).count();
        }
    }
    println!("shadow {:.6}, {changed} pixels changed by the lists", shadow / f64::from(frames));
    assert!(shadow / f64::from(frames) <= 0.001, "{shadow} over {frames} frames");
    assert!(changed > 10_000, "the lists change too little to test anything: {changed}");
}

/// Planes that take a part of each colour: frames agree in all of them, and differ from those of opaque planes.
#[test]
fn tints_agree_under_all_lights() {
    let (scene, opaque) = (procedural::scene(), procedural::planes());
    let mesh = mesh_of(&scene);
    let mut planes = opaque.clone();
    for (i, baked) in (0u8..).zip(&mut planes) {
        baked.tint = [255 - 30 * i, 40 * i, 200];
    }
    let mut twins = Twins::new(&scene, &mesh, &planes);
    let mut walls = Twins::new(&scene, &mesh, &opaque);
    let mut changed = 0;
    for light in lights(&planes) {
        let [camera, _, soft, ..] = views()[..] else { unreachable!("six views") };
        for camera in [camera, soft] {
            let request = request(camera, light, Mode::Shaded);
            let [gpu, cpu] = twins.render(&request);
            let steps: u64 = gpu.iter().zip(cpu.iter()).map(|(x, y)| u64::from(x.abs_diff(*y))).sum();
            let mean = steps as f64 / gpu.len() as f64;
            assert!(mean < 0.5, "{light:?}: mean difference {mean}");
            let wall = walls.gpu.render(&request).expect("drawn");
            changed += gpu.pixels().zip(wall.pixels()).filter(|(p, q)| p != q).count();
        }
    }
    assert!(changed > 3_000, "the tints change too little to test anything: {changed}");
    keep(&twins.gpu.render(&request(views()[0], lights(&planes)[0], Mode::Shaded)).expect("drawn"), "tints.png");
}

/// Under lights of some size values between light and shadow are many: their mean counts. Point lights stay hard.
#[test]
fn soft_edges_agree_under_all_lights() {
    let mut scene = procedural::scene();
    let set = sectioned(&mut scene);
    let mesh = mesh_of(&scene);
    let mut twins = Twins::with(&scene, &mesh, &set);
    let hard: Vec<RgbaImage> = lights(&set.planes)
        .into_iter()
        .map(|light| twins.gpu.render(&request(views()[1], light, Mode::Mask)).expect("drawn"))
        .collect();
    let light_radius_rad = 0.05;
    twins.gpu.set_soft_planes(&set, light_radius_rad).expect("the planes fit");
    twins.cpu.set_soft_planes(&set, light_radius_rad);
    for (light, hard) in lights(&set.planes).into_iter().zip(hard) {
        let frames = twins.render(&request(views()[1], light, Mode::Mask));
        let difference = compare(&frames);
        assert!(difference.shadow <= 0.003 && difference.mean <= 0.5, "{light:?}: {difference:?}");
        let changed = frames[0].pixels().zip(hard.pixels()).filter(|(p, q)| p != q).count();
        match light {
            Light::Directional { .. } => assert!(changed > 300, "{light:?}: {changed}"),
            Light::Point { .. } => assert_eq!(changed, 0),
        }
    }
}

/// Shadow where the section has the plane, none where it has another or the triangle has no section.
#[test]
fn a_triangle_reads_the_list_of_its_section() {
    let lists = |a: u32, b: u32| vec![vec![a], vec![b], vec![]];
    let planes = vec![plate(0.3, 2.0, Side::Both), plate(-0.3, 2.0, Side::Both)];
    let directions = vec![Vec3::Y, Vec3::NEG_Y, Vec3::X];
    let active = ActiveLists { directions, lists: vec![lists(0, 1), lists(1, 0), lists(1, 1)] };
    let sections = vec![vec![0, 1], vec![1, 0], vec![]];
    let set = BakedSet { planes, sections, active: Some(active), ground: None };
    let high = Light::Point { position: Vec3::new(0.1, 0.9, 0.0) };
    for (section, light, is_lit) in [
        (0, directional(0.1, 1.0, 0.0), false),
        (1, directional(0.1, 1.0, 0.0), true),
        (2, directional(0.1, 1.0, 0.0), true),
        (3, directional(0.1, 1.0, 0.0), true),
        (u32::MAX, directional(0.1, 1.0, 0.0), true),
        (0, directional(0.9, 0.4, 0.0), true),
        (0, high, false),
        (1, high, true),
        (3, high, true),
    ] {
        let mut scene = procedural::ground(Sides::Front);
        scene.section_of.fill(section);
        let mesh = mesh_of(&scene);
        let camera = Camera::orthographic(0.0, std::f32::consts::FRAC_PI_2);
        for frame in Twins::with(&scene, &mesh, &set).render(&request(camera, light, Mode::Mask)) {
            let lit = frame.get_pixel(SIZE_PX[0] / 2, SIZE_PX[1] / 2).0[0];
            assert_eq!(lit >= 128, is_lit, "section {section} under {light:?}: {lit}");
        }
    }
}

/// As many planes and sections as a large model has; each section its own.
#[test]
fn thousands_of_planes_and_sections_are_drawn() {
    let (planes, sections) = (16_384, 4_096);
    let mut scene = procedural::scene();
    let count = scene.section_of.len() as u32;
    scene.section_of = (0..count).map(|triangle| triangle * 7 % sections).collect();
    let mesh = mesh_of(&scene);
    let some = procedural::planes();
    let planes: Vec<BakedPlane> = (0..planes).map(|i| some[i % some.len()].clone()).collect();
    let sections = (0..sections).map(|section| (4 * section..4 * section + 4).collect()).collect();
    let mut twins = Twins::with(&scene, &mesh, &BakedSet { planes, sections, active: None, ground: None });
    let difference = compare(&twins.render(&request(views()[0], directional(0.4, 0.8, 0.5), Mode::Mask)));
    assert!(difference.shadow <= 0.003 && difference.covered > 5_000, "{difference:?}");
}

/// Colours differ by rounding (sRGB encoding, texture filter) but at silhouettes, where a pixel may show another
/// surface: few, so the mean stays below one step.
#[test]
fn shaded_frames_agree() {
    let (scene, planes) = (procedural::scene(), procedural::planes());
    let mesh = mesh_of(&scene);
    let mut twins = Twins::new(&scene, &mesh, &planes);
    for (i, antialias) in [Antialias::Off, Antialias::Msaa4].into_iter().enumerate() {
        let mut request = request(views()[i], lights(&planes)[i], Mode::Shaded);
        request.options.antialias = antialias;
        let [a, b] = twins.render(&request);
        keep(&a, &format!("shaded-{i}-wgpu.png"));
        keep(&b, &format!("shaded-{i}-cpu.png"));
        let steps: u64 = a.iter().zip(b.iter()).map(|(x, y)| u64::from(x.abs_diff(*y))).sum();
        let mean = steps as f64 / a.len() as f64;
        assert!(mean < 0.5, "{antialias:?}: mean difference {mean}");
    }
}

#[test]
fn the_same_request_gives_the_same_bytes() {
    let (scene, planes) = (procedural::scene(), procedural::planes());
    let mesh = mesh_of(&scene);
    let (mut first, mut second) = (Twins::new(&scene, &mesh, &planes), Twins::new(&scene, &mesh, &planes));
    for mode in [Mode::Mask, Mode::Shaded] {
        let wanted = request(views()[0], lights(&planes)[0], mode);
        let expected = first.render(&wanted);
        // Another frame between: nothing of it may stay.
        first.render(&request(views()[3], lights(&planes)[6], Mode::Shaded));
        assert!(first.render(&wanted) == expected && second.render(&wanted) == expected, "{mode:?}");
    }
}

#[test]
fn planes_are_drawn_through_the_model() {
    let (scene, planes) = (procedural::scene(), procedural::planes());
    let mesh = mesh_of(&scene);
    let mut twins = Twins::new(&scene, &mesh, &planes[..3]);
    let mut wanted = request(views()[0], lights(&planes)[0], Mode::Planes);
    wanted.options = FrameOptions { size_px: [640, 480], mode: Mode::Planes, antialias: Antialias::Msaa4 };
    let with = twins.gpu.render(&wanted).expect("drawn");
    keep(&with, "planes.png");
    assert_eq!(twins.cpu.render(&wanted), Err(RenderError::NeedsAdapter(Mode::Planes)));
    wanted.options.mode = Mode::Shaded;
    let without = twins.gpu.render(&wanted).expect("drawn");
    let changed = with.pixels().zip(without.pixels()).filter(|(p, q)| p != q).count();
    assert!(changed > with.pixels().len() / 10, "only {changed} pixels show planes");
    // Hundreds of them.
    let many = (0..50).flat_map(|_| planes.clone()).collect();
    let mut twins = Twins::with(&scene, &mesh, &BakedSet::one_section(many));
    wanted.options.mode = Mode::Planes;
    let crowded = twins.gpu.render(&wanted).expect("drawn");
    assert!(crowded.pixels().zip(with.pixels()).any(|(p, q)| p != q));
}

/// A horizontal square of half-width `half` around the y axis at height `y` (unit space) that blocks everywhere but
/// on a border of one texel in ten. Its normal u x v points down, so receivers below are in front of it.
fn plate(y: f32, half: f32, side: Side) -> BakedPlane {
    let inside = |i: usize| (1..9).contains(&i);
    let texels = (0..100).map(|i| if inside(i % 10) && inside(i / 10) { 255 } else { 0 }).collect();
    let origin = Vec3::new(-half, y, -half);
    let plane = ShadowPlane { origin, u: Vec3::X * 2.0 * half, v: Vec3::Z * 2.0 * half };
    let texture = OccluderTexture { width: 10, height: 10, encoding: Encoding::Coverage, texels };
    BakedPlane { plane, texture, tint: OPAQUE, side, bias: 1e-4 }
}

/// Is `q`, a point of the plate, in its blocking part? The filter crosses one half at the edge of a texel; but for
/// its rounded corners, where this says `None`.
fn blocks(q: Vec3, half: f32) -> Option<bool> {
    let edge = 0.8 * half;
    let near_corner = (q.x.abs() - edge).abs() < 0.1 * half && (q.z.abs() - edge).abs() < 0.1 * half;
    (!near_corner).then_some(q.x.abs() < edge && q.z.abs() < edge)
}

/// Compares the mask of the ground, seen from above without perspective, with `lit(p)`, pixel by pixel.
fn check_ground(planes: &[BakedPlane], light: Light, lit: impl Fn(Vec3) -> Option<bool>) {
    let scene = procedural::ground(Sides::Front);
    let mesh = mesh_of(&scene);
    let mut twins = Twins::new(&scene, &mesh, planes);
    let camera = Camera::orthographic(0.0, std::f32::consts::FRAC_PI_2);
    let frames = twins.render(&request(camera, light, Mode::Mask));
    for (frame, name) in frames.iter().zip(["wgpu", "cpu"]) {
        let mut checked = 0;
        for (x, y, pixel) in frame.enumerate_pixels() {
            let (origin, _) = camera.ray(x as f32 + 0.5, y as f32 + 0.5, SIZE_PX);
            let p = Vec3::new(origin.x, 0.0, origin.z);
            let covered = p.abs().max_element() < std::f32::consts::FRAC_1_SQRT_2;
            assert_eq!(pixel.0[2] == 255, covered, "{name}: coverage at {x}, {y}");
            if let (true, Some(lit)) = (covered, lit(p)) {
                assert_eq!(pixel.0[0] >= 128, lit, "{name}: light at {x}, {y} is {:?}", pixel.0);
                checked += 1;
            }
        }
        assert!(checked > 30_000, "{name}: {checked} pixels checked");
    }
}

#[test]
fn a_plate_shades_exactly_the_ground_below_it() {
    for to_light in [Vec3::Y, Vec3::new(0.3, 0.9, -0.2).normalize(), Vec3::new(-0.8, 0.5, 0.1).normalize()] {
        let lit = |p: Vec3| blocks(p + to_light * (0.3 / to_light.y), 0.311).map(|blocked| !blocked);
        check_ground(&[plate(0.3, 0.311, Side::Both)], Light::Directional { to_light }, lit);
    }
}

#[test]
fn a_plate_under_a_point_light_casts_a_larger_shadow() {
    let c = Vec3::new(0.1, 0.9, -0.05);
    let lit = |p: Vec3| blocks(p + (c - p) * (0.3 / 0.9), 0.2113).map(|blocked| !blocked);
    check_ground(&[plate(0.3, 0.2113, Side::Both)], Light::Point { position: c }, lit);
}

#[test]
fn planes_cast_only_between_receiver_and_light() {
    let point = Light::Point { position: Vec3::new(0.0, 0.5, 0.0) };
    let all_lit = |_| Some(true);
    // Behind the receiver; beyond a point light; nearer than the bias.
    check_ground(&[plate(-0.2, 0.3, Side::Both)], directional(0.1, 1.0, 0.2), all_lit);
    check_ground(&[plate(-0.2, 0.3, Side::Both)], point, all_lit);
    check_ground(&[plate(0.7, 0.3, Side::Both)], point, all_lit);
    let near = BakedPlane { bias: 0.05, ..plate(0.04, 0.3, Side::Both) };
    check_ground(std::slice::from_ref(&near), Light::Directional { to_light: Vec3::Y }, all_lit);
    // The rays of this shadow reach the plate within 8 % of at most 0.62.
    check_ground(&[near], point, all_lit);
}

#[test]
fn light_from_behind_the_surface_does_not_reach_it() {
    for light in [directional(0.1, -1.0, 0.0), Light::Point { position: Vec3::new(0.2, -0.5, 0.0) }] {
        check_ground(&[plate(0.3, 0.3, Side::Both)], light, |_| Some(false));
    }
}

#[test]
fn a_plane_serves_the_side_it_is_made_for() {
    let shadow = |p: Vec3| blocks(p, 0.311).map(|blocked| !blocked);
    let sun = Light::Directional { to_light: Vec3::Y };
    check_ground(&[plate(0.3, 0.311, Side::Front)], sun, shadow);
    check_ground(&[plate(0.3, 0.311, Side::Back)], sun, |_| Some(true));
    let c = Vec3::new(0.0, 1.2, 0.0);
    let lamp = Light::Point { position: c };
    check_ground(&[plate(0.3, 0.311, Side::Front)], lamp, |p| shadow(p + (c - p) * 0.25));
    check_ground(&[plate(0.3, 0.311, Side::Back)], lamp, |_| Some(true));
}

#[test]
fn broken_planes_and_no_planes_cast_nothing() {
    let sun = directional(0.1, 1.0, 0.2);
    let flat = |u: Vec3| {
        let good = plate(0.3, 0.3, Side::Both);
        BakedPlane { plane: ShadowPlane { u, ..good.plane }, ..good }
    };
    let broken = [flat(Vec3::ZERO), flat(Vec3::Z), flat(Vec3::splat(f32::NAN)), flat(Vec3::X * 1e-30)];
    for light in [sun, Light::Point { position: Vec3::new(0.1, 0.9, 0.1) }] {
        check_ground(&[], light, |_| Some(true));
        check_ground(&broken, light, |_| Some(true));
    }
}

#[test]
fn backs_are_drawn_of_double_sided_triangles_only() {
    let below = Camera::orthographic(0.3, -1.2);
    for (sides, light, expected) in [
        (Sides::Front, directional(0.1, -1.0, 0.0), [0, 0, 0]),
        (Sides::Both, directional(0.1, -1.0, 0.0), [255, 255, 255]),
        (Sides::Both, directional(0.1, 1.0, 0.0), [0, 0, 255]),
    ] {
        let scene = procedural::ground(sides);
        let mesh = mesh_of(&scene);
        for frame in Twins::new(&scene, &mesh, &[]).render(&request(below, light, Mode::Mask)) {
            assert_eq!(frame.get_pixel(SIZE_PX[0] / 2, SIZE_PX[1] / 2).0[..3], expected, "{sides:?} {light:?}");
        }
    }
}

#[test]
fn a_frame_without_pixels_is_an_error() {
    let scene = procedural::ground(Sides::Front);
    let mesh = mesh_of(&scene);
    let mut twins = Twins::new(&scene, &mesh, &[]);
    let mut wanted = request(views()[0], directional(0.0, 1.0, 0.0), Mode::Mask);
    for size_px in [[0, 64], [64, 0], [1 << 20, 64]] {
        wanted.options.size_px = size_px;
        assert!(matches!(twins.gpu.render(&wanted), Err(RenderError::FrameSize { .. })));
        assert!(matches!(twins.cpu.render(&wanted), Err(RenderError::FrameSize { .. })));
    }
    // Rows that are not a multiple of the copy's alignment.
    wanted.options.size_px = [67, 31];
    let [a, b] = twins.render(&wanted);
    assert!(a.dimensions() == (67, 31) && compare(&[a, b]).silhouette < 0.02);
}
