//! Shadows of transparent casters: products of what they let pass, to the last step of a byte.

use crate::stages::{Case, SIZE_PX, WORLD, directional, empty, gpu, keep, mask, push, quad};
use glam::Vec3;
use image::RgbaImage;
use shadowfit::{
    render::{
        Antialias, FrameOptions, FrameRequest, Light, Mode, RenderError,
        stage::{Placement, Stage},
        transparent::{Accumulation, TransparentVolumes},
    },
    scene::{Material, Scene},
};

const ADDED: Accumulation = Accumulation::Logarithms;
const MULTIPLIED: Accumulation = Accumulation::Products;

/// A material that lets light pass as glTF's BLEND with white base colour and `1 - share` would, if share were grey.
fn glass(scene: &mut Scene, share: Vec3) -> u32 {
    let white = scene.materials[0].clone();
    let transmittance = Some(share.to_array());
    scene.materials.push(Material { base_color: [1.0, 1.0, 1.0, 0.5], transmittance, ..white });
    scene.materials.len() as u32 - 1
}

/// Makes the last `count` triangles of that material.
fn paint(scene: &mut Scene, count: usize, material: u32) {
    let first = scene.material_of.len() - count;
    scene.material_of[first..].fill(material);
}

/// Where layer i begins; all end at x = 1.
fn begin(layer: usize) -> f32 {
    -0.18 + 0.045 * layer as f32
}

/// Layers over a ground, at the heights that `order` says. Each is cut in two at x = 0.5; all left parts come before all
/// right ones, so that the sides on one border of all layers are drawn before those on the other.
fn layers(shares: &[Vec3], order: impl Fn(usize) -> usize) -> Scene {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    let materials: Vec<u32> = shares.iter().map(|&share| glass(&mut scene, share)).collect();
    for is_right in [false, true] {
        for (i, &material) in materials.iter().enumerate() {
            let [from, to] = if is_right { [0.5, 1.0] } else { [begin(i), 0.5] };
            let corner = |x, z| Vec3::new(x, 0.5 + 0.05 * order(i) as f32, z);
            let [a, b, c, d] = [corner(from, 0.5), corner(to, 0.5), corner(to, -0.5), corner(from, -0.5)];
            push(&mut scene, [a, b, c]);
            push(&mut scene, [a, c, d]);
            paint(&mut scene, 2, material);
        }
    }
    scene
}

/// Below the layers and beside them, the ground alone in view: behind its lit part lie all volumes.
fn under_the_layers(mode: Mode) -> FrameRequest {
    let request = mask(Vec3::new(-0.35, 0.3, 0.02), Vec3::new(0.0, 0.0, 0.01), directional(0.0, 1.0, 0.0));
    FrameRequest { options: FrameOptions { mode, ..request.options }, ..request }
}

fn draw(scene: &Scene, accumulation: Accumulation, request: &FrameRequest) -> RgbaImage {
    let mut stage = Stage::new(gpu(), scene, &WORLD, &[Placement::IDENTITY]).expect("it fits");
    let mut technique = TransparentVolumes::new(&stage, scene, &WORLD, accumulation).expect("it fits");
    stage.render(&mut technique, request).expect("drawn")
}

/// How many layers are over the ground that a pixel's middle shows; `None` within a pixel of a border or beyond them all.
fn layers_over(request: &FrameRequest, count: usize, (x, y): (u32, u32)) -> Option<usize> {
    let over = |dx: f32, dy: f32| {
        let (origin, direction) = request.camera.ray(x as f32 + dx, y as f32 + dy, SIZE_PX);
        let p = origin - direction * (origin.y / direction.y);
        (direction.y < 0.0 && p.x.abs() < 0.99 && p.z.abs() < 0.49)
            .then(|| (0..count).filter(|i| p.x > begin(*i)).count())
    };
    let at = over(0.5, 0.5)?;
    [(-0.5, 0.5), (1.5, 0.5), (0.5, -0.5), (0.5, 1.5)].iter().all(|&(dx, dy)| over(dx, dy) == Some(at)).then_some(at)
}

/// The largest difference of a picture from the analytic product, in bytes, and how many pixels each number of layers has.
fn against_products(
    picture: &RgbaImage,
    request: &FrameRequest,
    shares: &[Vec3],
    byte: impl Fn(Vec3) -> [f32; 3],
) -> (f32, Vec<usize>) {
    let (mut worst, mut pixels) = (0.0f32, vec![0; shares.len() + 1]);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let Some(over) = layers_over(request, shares.len(), (x, y)) else { continue };
        let expected = byte(shares[..over].iter().product());
        pixels[over] += 1;
        for (drawn, expected) in pixel.0.iter().zip(expected) {
            worst = worst.max((f32::from(*drawn) - expected).abs());
        }
    }
    (worst, pixels)
}

/// The bytes of [`Mode::Mask`] where a surface faces the light.
fn mask_bytes(share: Vec3) -> [f32; 3] {
    [255.0 * share.element_sum() / 3.0, 255.0, 255.0]
}

/// sRGB bytes of a white ground at right angles to the light.
fn shaded_bytes(share: Vec3) -> [f32; 3] {
    (0.25 + 0.75 * share).to_array().map(srgb)
}

fn srgb(linear: f32) -> f32 {
    255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055)
}

/// Grey, coloured and dark layers.
fn all_shares() -> [Vec<Vec3>; 3] {
    let color = |i: usize| [Vec3::new(0.9, 0.6, 0.7), Vec3::new(0.5, 0.95, 0.8), Vec3::new(0.8, 0.7, 0.4)][i % 3];
    [vec![Vec3::splat(0.8); 8], (0..8).map(color).collect(), vec![Vec3::splat(0.2); 8]]
}

#[test]
fn the_light_through_1_to_8_layers_is_the_product() {
    for shares in all_shares() {
        for count in 1..=8 {
            let shares = &shares[..count];
            let scene = layers(shares, |i| i);
            let request = under_the_layers(Mode::Mask);
            let (worst, pixels) = against_products(&draw(&scene, ADDED, &request), &request, shares, mask_bytes);
            assert!(worst <= 1.0, "{count} of {:?}: {worst}", shares[0]);
            assert!(pixels.iter().all(|pixels| *pixels > 300), "{pixels:?}");
        }
        let request = under_the_layers(Mode::Shaded);
        let picture = draw(&layers(&shares, |i| i), ADDED, &request);
        keep(&picture, &format!("transparent layers {}.png", shares[0]));
        let (worst, _) = against_products(&picture, &request, &shares, shaded_bytes);
        assert!(worst <= 1.0, "{:?}, each colour: {worst}", shares[0]);
    }
}

#[test]
fn the_order_of_layers_does_not_matter() {
    let [_, shares, _] = all_shares();
    let request = under_the_layers(Mode::Shaded);
    for order in [[7, 6, 5, 4, 3, 2, 1, 0], [3, 0, 6, 1, 7, 2, 5, 4]] {
        let picture = draw(&layers(&shares, |i| order[i]), ADDED, &request);
        let (worst, _) = against_products(&picture, &request, &shares, shaded_bytes);
        assert!(worst <= 1.0, "{order:?}: {worst}");
    }
}

#[test]
fn products_in_16_bits_are_wrong_where_sums_are_right() {
    let request = under_the_layers(Mode::Mask);
    let errors = [0.9, 0.3, 0.1].map(|share| {
        let shares = [Vec3::splat(share); 8];
        let scene = layers(&shares, |i| i);
        [ADDED, MULTIPLIED].map(|accumulation| {
            let picture = draw(&scene, accumulation, &request);
            keep(&picture, &format!("transparent {accumulation:?} {share}.png"));
            against_products(&picture, &request, &shares, mask_bytes).0
        })
    });
    assert!(errors.iter().all(|[added, _]| *added <= 0.51), "{errors:?}");
    // Each factor rounds to 11 bits: sixteen of them show. 0.1^8 is less than the format's least, 6e-8, and does not come
    // back: where all layers lie behind lit ground, the light is lost.
    let [light, _, dark] = errors.map(|[_, multiplied]| multiplied);
    assert!(light > 1.0 && dark > 250.0, "{errors:?}");
}

/// A cage of coloured plates that cross and hang over each other, an opaque one among them.
fn glasshouse() -> Scene {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    let colors = [Vec3::new(0.9, 0.3, 0.2), Vec3::new(0.2, 0.8, 0.4), Vec3::new(0.3, 0.4, 0.9)];
    let materials = colors.map(|share| glass(&mut scene, share));
    let plates = [
        (Vec3::new(-0.4, 0.0, 0.1), Vec3::X * 0.8, Vec3::Y * 0.6),
        (Vec3::new(-0.4, 0.6, 0.1), Vec3::X * 0.8, Vec3::new(0.0, 0.2, 0.5)),
        (Vec3::new(-0.4, 0.6, 0.1), Vec3::new(0.0, 0.2, -0.5), Vec3::X * 0.8),
        (Vec3::new(0.1, 0.2, -0.4), Vec3::new(0.1, 0.5, 0.0), Vec3::new(0.0, 0.3, 0.9)),
        (Vec3::new(-0.7, 0.3, 0.4), Vec3::new(0.5, 0.1, 0.0), Vec3::new(0.1, 0.3, -0.6)),
    ];
    for (i, (corner, u, v)) in plates.into_iter().enumerate() {
        quad(&mut scene, corner, u, v);
        if i > 0 {
            paint(&mut scene, 2, materials[i % 3]);
        }
    }
    scene
}

#[test]
fn shadows_of_and_on_transparent_surfaces_are_as_traced() {
    let scene = glasshouse();
    let mut case = Case::new(scene.clone());
    let mut technique = TransparentVolumes::new(&case.stage, &scene, &WORLD, ADDED).expect("it fits");
    let point = Light::Point { position: Vec3::new(0.4, 1.3, 0.5) };
    let lights = [directional(0.3, 1.0, 0.2), directional(-0.7, 0.6, 0.4), directional(0.2, 0.5, -1.0), point];
    for (i, light) in lights.into_iter().enumerate() {
        let request = mask(Vec3::new(1.3, 2.0, 1.9), Vec3::new(0.0, 0.2, 0.0), light);
        let traced = case.traced.transmitted_picture(&case.traced.look(&request).expect("traced")).expect("traced");
        let drawn = case.stage.render(&mut technique, &request).expect("drawn");
        keep(&drawn, &format!("glasshouse {i} drawn.png"));
        keep(&traced, &format!("glasshouse {i} traced.png"));
        let pairs = || traced.pixels().zip(drawn.pixels()).filter(|(t, d)| t.0[2] == 255 && d.0[2] == 255);
        let wrong = pairs().filter(|(t, d)| t.0[0].abs_diff(d.0[0]) > 1).count();
        let partly = pairs().filter(|(t, _)| (1..255).contains(&t.0[0])).count();
        let share = wrong as f64 / pairs().count() as f64;
        // Borders inside of shadows are borders too, and there are many.
        assert!(share < 0.001 && partly > 1000, "{light:?}: {share} wrong, {partly} partly lit");
        let shaded = FrameRequest { options: FrameOptions { mode: Mode::Shaded, ..request.options }, ..request };
        keep(&case.stage.render(&mut technique, &shaded).expect("drawn"), &format!("glasshouse {i} shaded.png"));
    }
}

#[test]
fn the_nearest_transparent_surface_is_blended_over_the_opaque_ones() {
    let mut scene = empty();
    quad(&mut scene, Vec3::new(-1.5, 0.0, 1.5), Vec3::X * 3.0, Vec3::Z * -3.0);
    let material = glass(&mut scene, Vec3::splat(0.5));
    quad(&mut scene, Vec3::new(-0.4, 0.5, 0.4), Vec3::X * 0.8, Vec3::Z * -0.8);
    paint(&mut scene, 2, material);
    let request = mask(Vec3::new(0.01, 3.0, 0.02), Vec3::ZERO, directional(0.0, 1.0, 0.0));
    let request = FrameRequest { options: FrameOptions { mode: Mode::Shaded, ..request.options }, ..request };
    let middle = draw(&scene, ADDED, &request).get_pixel(SIZE_PX[0] / 2, SIZE_PX[1] / 2).0;
    // Half the white plate in full light, half the white ground in half the light.
    let expected = srgb(0.5 * 1.0 + 0.5 * (0.25 + 0.75 * 0.5));
    assert!(middle[..3].iter().all(|byte| (f32::from(*byte) - expected).abs() <= 1.0), "{middle:?} {expected}");
}

#[test]
fn antialiasing_is_refused() {
    let scene = layers(&[Vec3::splat(0.5)], |i| i);
    let mut stage = Stage::new(gpu(), &scene, &WORLD, &[Placement::IDENTITY]).expect("it fits");
    let mut technique = TransparentVolumes::new(&stage, &scene, &WORLD, ADDED).expect("it fits");
    let request = under_the_layers(Mode::Mask);
    let options = FrameOptions { antialias: Antialias::Msaa4, ..request.options };
    let refused = stage.render(&mut technique, &FrameRequest { options, ..request });
    assert!(matches!(refused, Err(RenderError::Unsupported { .. })), "{refused:?}");
}
