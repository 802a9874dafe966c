//! What a written asset is worth: the same as the set that it was written from.

use crate::set;
use glam::{DVec3, Vec3};
use shadowfit::{
    asset::{AssetRequest, Bounds, read, write},
    pipeline::receiver_sections,
    report::Lookups,
    scene::load,
};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::Mesh,
    metrics::measure,
    plane::{ActiveLists, BakedSet},
    receivers::{ReceiverOptions, sample},
    visibility::trace,
};
use std::path::Path;

/// Sections by chance on a model with shadow: error and lookups of the files are those of what was written.
#[test]
fn a_written_asset_measures_as_the_set_does() {
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/t_shape.glb");
    let scene = load(&input).unwrap();
    let mesh = Mesh::new(&scene.soup).unwrap();
    let receivers = sample(&mesh, &ReceiverOptions { count: 4_000, exposure_rays: 16, seed: 1 });
    let domain = LightDomain::Sphere;
    let pairs = trace(&mesh, &receivers, &domain.directions(64, 1), domain.solid_angle());
    let set = set(5);
    let section_of: Vec<u32> = scene.origins.iter().map(|origin| origin.triangle * 3 % 5).collect();
    let of_receivers = receiver_sections(&mesh, &receivers, &section_of);
    assert!((0..5).all(|section| of_receivers.contains(&section)));
    let folder = tempfile::tempdir().unwrap();
    let bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };
    let (frame, origins) = (&mesh.frame, &scene.origins[..]);
    let request = AssetRequest {
        input: &input,
        out_dir: folder.path(),
        stem: "m",
        frame,
        bounds,
        set: &set,
        origins,
        section_of: &section_of,
    };
    let written = write(&request).unwrap();
    let (back, loaded) = (read(&written.model).unwrap().in_unit_space(frame), load(&written.model).unwrap());
    let loaded = receiver_sections(&mesh, &receivers, &loaded.section_of);
    let (before, after) = (measure(&set, &pairs, &of_receivers), measure(&back, &pairs, &loaded));
    // Positions are rounded to f32 once more: a pair in a thousand may cross a texel's border.
    assert!((before.shadow_error - after.shadow_error).abs() < 1e-3, "{before:?} {after:?}");
    assert!(before.false_ > 0.01, "the planes cast nothing: {before:?}");
    assert_eq!(Lookups::measure(&set, &pairs, &of_receivers), Lookups::measure(&back, &pairs, &loaded));
}

/// Two lights, two sections, counted by hand.
#[test]
fn lookups_count_what_can_cast_in_the_active_list() {
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/box.glb");
    let mesh = Mesh::new(&load(&input).unwrap().soup).unwrap();
    let receivers = sample(&mesh, &ReceiverOptions { count: 600, exposure_rays: 4, seed: 1 });
    // Both lights see one side only, so each receiver is in one pair at most.
    let pairs = trace(&mesh, &receivers, &[Vec3::Y, Vec3::NEG_Y], 1.0);
    let mut set = BakedSet { sections: vec![vec![0, 1, 2], vec![2]], ..set(2) };
    set.planes.truncate(3);
    for (baked, u) in set.planes.iter_mut().zip([Vec3::X, Vec3::X, Vec3::Y]) {
        // Two level planes, and an upright one, which under these lights is edge-on and not counted.
        (baked.plane.u, baked.plane.v) = (u, Vec3::Z);
    }
    let lists = vec![vec![vec![0, 1, 2], vec![2]], vec![vec![1], vec![2]]];
    set.active = Some(ActiveLists { directions: vec![Vec3::Y, Vec3::NEG_Y], lists });
    let section_of: Vec<u32> = receivers.points.iter().map(|p| u32::from(p.x > 0.0)).collect();
    let weight = |light: usize, section: Option<u32>| -> f64 {
        let light = &pairs.lights[light];
        let counts = |i: &usize| section.is_none_or(|section| section_of[light.receiver[*i] as usize] == section);
        (0..light.len()).filter(counts).map(|i| f64::from(light.vote[i].abs())).sum()
    };
    let total = weight(0, None) + weight(1, None);
    let expected = (2.0 * weight(0, Some(0)) + weight(1, Some(0))) / total;
    let found = Lookups::measure(&set, &pairs, &section_of);
    assert!((found.mean - expected).abs() < 1e-9 && expected > 0.5, "{found:?}, not {expected}");
    assert_eq!(found.max, 2);
}
