//! Lights and planes in the positions where a division by zero waits.

use crate::shapes::{Case, square};
use glam::{DVec3, Vec3};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Mesh, Sides, Soup},
    metrics::measure,
    plane::{BakedPlane, BakedSet, Encoding, OPAQUE, OccluderTexture, ShadowPlane, Side},
    receivers::{ReceiverOptions, sample},
    visibility::trace,
};

/// A ground of 4 m and a plate of 1 m above it, and the plate's plane as a plane file.
fn plate_over_ground() -> Case {
    let planes = r#"{"planes":[{"origin":[-0.55,0.5,-0.55],"uAxis":[1.1,0,0],"vAxis":[0,0,1.1]}]}"#.to_owned();
    Case { planes: Some(planes), ..Case::new([square(2.0, 0.0), square(0.5, 0.5)].concat()) }
}

#[test]
fn a_plate_in_its_own_plane_does_not_shadow_itself() {
    let overhead = LightDomain::Cone { axis: Vec3::Y, half_angle_rad: 0.2 };
    // Not double-sided under all lights: the ground would shadow the plate's underside, which no plane up there can.
    for (double_sided, lights) in
        [(false, LightDomain::Sphere), (false, overhead), (true, LightDomain::Hemisphere), (true, overhead)]
    {
        let (report, set) = Case { double_sided, lights, ..plate_over_ground() }.fit();
        assert_eq!(set.planes.len(), 1);
        let held_out = &report.held_out;
        // The exact plane; what is left are the texels on the outline, 1/64 of 1.1 m wide: under 5 % of the shadow.
        // A plate that shadowed itself would add its own area, as much again as the shadow.
        assert!(held_out.shadow_error < 0.06, "{double_sided} {lights:?}: {held_out:?}");
    }
}

/// All lights are nearly one: every receiver votes for one texel only, over and over.
#[test]
fn a_single_light_leaves_no_holes_in_the_texture() {
    let lights = LightDomain::Cone { axis: Vec3::Y, half_angle_rad: 1e-3 };
    for double_sided in [false, true] {
        let (report, _) = Case { double_sided, lights, ..plate_over_ground() }.fit();
        let held_out = &report.held_out;
        // As above: the outline. With `double_sided` there are half as many receivers in the shadow, about 240, for
        // 3,400 texels; the texels between them are as closed as their neighbours.
        assert!(held_out.shadow_error < 0.06, "{double_sided}: {held_out:?}");
    }
}

#[test]
fn lights_that_graze_the_plane_cost_nothing() {
    for axis in [Vec3::X, Vec3::Z, Vec3::NEG_X] {
        // All lights within 0.06 degrees of the horizontal plane.
        let lights = LightDomain::Cone { axis, half_angle_rad: 1e-3 };
        let (report, _) = Case { lights, ..plate_over_ground() }.fit();
        let held_out = &report.held_out;
        // What the plate blocks leaves the ground beyond its edge; no light, no shadow worth speaking of.
        assert!(held_out.shadow_error <= 1.0 && held_out.light_error <= 0.01, "{axis}: {held_out:?}");
    }
}

/// A wall on the ground and a plane through the wall, under lights that lie in that plane to the last bit.
#[test]
fn lights_exactly_in_a_plane_neither_shadow_nor_break() {
    let upright = |p: DVec3| DVec3::new(p.x, p.z + 1.0, 0.0);
    let wall = crate::shapes::moved(&square(1.0, 0.0), upright);
    let corners_model = [square(2.0, 0.0), wall].concat();
    let count = corners_model.len();
    let soup = Soup {
        corners_model,
        sides: vec![Sides::Both; count],
        cutout: vec![None; count],
        cutout_uv: vec![[glam::Vec2::ZERO; 3]; count],
        cutouts: vec![],
    };
    let mesh = Mesh::new(&soup).unwrap();
    let receivers = sample(&mesh, &ReceiverOptions { count: 4000, exposure_rays: 16, seed: 1 });
    let corner = |p: DVec3| mesh.frame.unit_from_model(p);
    let [origin, along_u, along_v] = [[-1.0, 0.0], [1.0, 0.0], [-1.0, 2.0]].map(|[x, y]| corner(DVec3::new(x, y, 0.0)));
    let plane = ShadowPlane { origin, u: along_u - origin, v: along_v - origin };
    let texture = OccluderTexture { width: 8, height: 8, encoding: Encoding::Coverage, texels: vec![255; 64] };
    let lights = [[0.0, 1.0], [1.0, 0.0], [0.6, 0.8], [-0.8, 0.6], [-0.6, -0.8], [0.0, -1.0]]
        .map(|[x, y]| Vec3::new(x, y, 0.0).normalize());
    let pairs = trace(&mesh, &receivers, &lights, 1.0);
    assert!(pairs.lights.iter().any(|light| !light.is_empty()), "nothing is lit");
    for side in [Side::Both, Side::Front, Side::Back] {
        let baked = BakedPlane { plane, texture: texture.clone(), tint: OPAQUE, side, bias: 0.0 };
        let measured = |planes| measure(&BakedSet::one_section(planes), &pairs, &vec![0; pairs.receivers]);
        let [with, without] = [measured(vec![baked]), measured(vec![])];
        assert!(with.shadow_error.is_finite() && with.false_ == 0.0, "{with:?}");
        assert_eq!(with, without, "an edge-on plane casts nothing");
    }
}

#[test]
fn a_ground_that_is_all_in_shadow_is_all_dark() {
    // The roof faces down: under a light from above it takes none, and every pair on the ground is blocked.
    let roof = crate::shapes::reversed(&square(3.0, 1.0));
    let lights = LightDomain::Cone { axis: Vec3::Y, half_angle_rad: 0.2 };
    let (report, set) = Case { lights, ..Case::new([square(1.0, 0.0), roof].concat()) }.fit();
    assert_eq!(set.planes.len(), 1, "{report}");
    // All that the model shows is in shadow: light that comes through is the only error there can be. One closed
    // texture lets in what its crop cuts off, 0.05 % of the votes at each of four sides.
    assert_eq!(report.held_out.false_, 0.0);
    assert!(report.held_out.shadow_error < 2e-3, "{:?}", report.held_out);
    assert!((report.held_out.light_error - report.held_out.shadow_error).abs() < 1e-12, "{:?}", report.held_out);
}
