//! Soft edges: a straight border under a disc of light, whose answer is an integral in closed form.

use glam::Vec3;
use shadowfit_solver::{
    field::{VoteGrid, VotedShape},
    plane::{BakedPlane, Encoding, OPAQUE, SDF_TEXELS, ShadowPlane, Side},
    shade::{PlaneRows, horizon, plane_rows, softening, visibility, visibility_soft},
};
use std::f32::consts::{FRAC_1_SQRT_2, PI};

const TEXELS: usize = 32;

/// A square of side 1 at y = 0 that blocks where x < 0, baked as a fit bakes.
fn half_plane(encoding: Encoding) -> BakedPlane {
    baked(encoding, |x| x < 0.0)
}

fn baked(encoding: Encoding, blocks: impl Fn(f32) -> bool) -> BakedPlane {
    let cells = 8 * TEXELS;
    let x = |column: usize| (column as f32 + 0.5) / cells as f32 - 0.5;
    let votes: Vec<f32> = (0..cells * cells).map(|i| if blocks(x(i % cells)) { 1.0 } else { -1.0 }).collect();
    let grid = VoteGrid { votes: &votes, width: cells, height: cells };
    let texture = VotedShape::new(grid, 0).texture(encoding, (TEXELS, TEXELS));
    let plane = ShadowPlane { origin: Vec3::new(-0.5, 0.0, -0.5), u: Vec3::X, v: Vec3::Z };
    BakedPlane { plane, texture, tint: OPAQUE, side: Side::Both, bias: 1e-4 }
}

/// Share of a disc of radius 1 beyond a line at distance `d` from its middle.
fn disc_beyond(d: f32) -> f32 {
    let d = d.clamp(-1.0, 1.0);
    0.5 - (d.asin() + d * (1.0 - d * d).sqrt()) / PI
}

struct Lit {
    baked: BakedPlane,
    rows: Option<PlaneRows>,
    softening: f32,
    l: Vec3,
}

impl Lit {
    fn new(baked: BakedPlane, l: Vec3, radius_rad: f32) -> Self {
        let rows = plane_rows(&baked.plane, baked.side, l);
        Self { softening: softening(&baked, l, radius_rad), rows, baked, l }
    }

    /// Visibility of the receiver at distance `s` whose ray crosses the plane at (x, z).
    fn at(&self, x: f32, z: f32, s: f32) -> f32 {
        let p = Vec3::new(x, 0.0, z) - s * self.l;
        visibility_soft(std::slice::from_ref(&self.baked), (&[self.rows], &[self.softening]), &[0], p).x
    }

    fn hard(&self, x: f32, z: f32, s: f32) -> f32 {
        let p = Vec3::new(x, 0.0, z) - s * self.l;
        visibility(std::slice::from_ref(&self.baked), &[self.rows], &[0], p).x
    }

    /// From where a tenth of the light is seen to where nine tenths are.
    fn width(&self, s: f32) -> f32 {
        let at = |share: f32| (-2000..2000).map(|i| f32::from(i as i16) * 1e-4).find(|x| self.at(*x, 0.0, s) >= share);
        at(0.9).expect("lit on one side") - at(0.1).expect("dark on the other")
    }
}

/// A smooth step is within 0.04 of the disc's integral, a byte of the field is 1/64 of a texel, and the descent that
/// fits fields to votes leaves a straight border straight.
#[test]
fn a_straight_border_is_as_soft_as_the_disc_makes_it() {
    let lit = Lit::new(half_plane(Encoding::Sdf), Vec3::Y, 2f32.to_radians());
    for s in [0.2f32, 0.5, 1.0, 1.5] {
        let radius = s * 2f32.to_radians().tan();
        for i in -20..=20 {
            let x = f32::from(i as i8) * 0.005;
            let expected = 1.0 - disc_beyond(x / radius);
            let found = lit.at(x, 0.013, s);
            assert!((found - expected).abs() < 0.06, "s {s}, x {x}: {found}, expected {expected}");
        }
    }
}

/// The rectangle ends a texel beyond the border, the penumbra does not: the field falls on.
#[test]
fn penumbrae_reach_beyond_the_rectangle() {
    let (border, s) = (-0.5 + 1.0 / TEXELS as f32, 1.0);
    let radius = s * 3f32.to_radians().tan();
    let lit = Lit::new(baked(Encoding::Sdf, |x| x > border), Vec3::Y, 3f32.to_radians());
    let mut outside = 0;
    for i in -20..=20 {
        let x = border + f32::from(i as i8) * 0.003;
        let expected = disc_beyond((x - border) / radius);
        let found = lit.at(x, 0.013, s);
        assert!((found - expected).abs() < 0.06, "x {x}: {found}, expected {expected}");
        outside += usize::from(x < -0.5 && expected < 0.95);
    }
    assert!(outside > 3);
    assert_eq!(lit.at(-0.6, 0.0, s), 1.0);
}

#[test]
fn penumbrae_widen_with_the_distance_until_the_field_ends() {
    let radius = 1f32.to_radians();
    let lit = Lit::new(half_plane(Encoding::Sdf), Vec3::Y, radius);
    let [near, far] = [0.5, 1.5].map(|s| lit.width(s));
    assert!((far / near - 3.0).abs() < 0.15, "{near} {far}");
    // Lit or dark beyond two texels, whatever the distance: a wide light gets no wider penumbra.
    let wide = Lit::new(half_plane(Encoding::Sdf), Vec3::Y, 0.3);
    let reach = 1.05 * SDF_TEXELS / TEXELS as f32;
    assert!(wide.at(reach, 0.0, 1.0) > 0.99 && wide.at(-reach, 0.0, 1.0) < 0.01);
    assert!(wide.width(1.0) < 2.0 * reach && (wide.width(1.0) - wide.width(0.7)).abs() < 2e-3);
}

/// Slanted by 45 degrees along the border, the ellipse is as wide across it as the disc; along the light it is wider by
/// sqrt 2. The circle of equal area lies between.
#[test]
fn a_slanted_light_softens_by_the_circle_of_equal_area() {
    let (radius, s) = (1f32.to_radians(), 0.8);
    let across = Lit::new(half_plane(Encoding::Sdf), Vec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0), radius);
    let along = Lit::new(half_plane(Encoding::Sdf), Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2), radius);
    let straight = Lit::new(half_plane(Encoding::Sdf), Vec3::Y, radius);
    for slanted in [across, along] {
        let ratio = slanted.width(s) / straight.width(s);
        assert!((ratio - 2f32.powf(0.25)).abs() < 0.05, "{ratio}");
    }
}

#[test]
fn a_light_without_size_has_hard_edges_and_coverage_keeps_its_own() {
    for encoding in [Encoding::Sdf, Encoding::Coverage] {
        let radius = if encoding == Encoding::Sdf { 0.0 } else { 0.1 };
        let lit = Lit::new(half_plane(encoding), Vec3::new(0.3, 0.9, 0.1).normalize(), radius);
        for i in (-40..=40).filter(|i| *i != 0) {
            let x = f32::from(i as i8) * 0.008 + 0.001;
            assert_eq!(lit.at(x, 0.2, 0.7), lit.hard(x, 0.2, 0.7), "{encoding:?} {x}");
        }
    }
}

#[test]
fn the_horizon_cuts_the_light_in_half() {
    let sine = 0.1f32;
    for (n_dot_l, share) in [(-0.2, 0.0), (-0.1, 0.0), (0.0, 0.5), (0.1, 1.0), (0.5, 1.0)] {
        assert_eq!(horizon(n_dot_l, sine), share);
    }
    for i in -10..=10i8 {
        let x = f32::from(i) / 10.0;
        assert!((horizon(sine * x, sine) - (1.0 - disc_beyond(x))).abs() < 0.041, "{x}");
    }
}
