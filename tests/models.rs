//! The committed models and plane files: that they are what `cargo run --example make_models` writes, that they are
//! closed and sound, and that they are the shapes whose answers `models/README.md` promises.

#[path = "../examples/make_models/catalogue.rs"]
mod catalogue;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use catalogue::{
    aircraft, analytic,
    glb::Model,
    mesh::Mesh,
    planes::{PlaneFile, Rectangle},
    planted, teapot, teapot_planes,
};
use glam::DVec3;

/// Below this a triangle counts as degenerate: a hair of 1 um times 0.2 mm.
const MIN_AREA_M2: f64 = 2e-10;
/// Planes and vertices are rounded to micrometres.
const ROUNDING_M: f64 = 2e-6;

/// All triangles of a model.
fn whole(model: &Model) -> Mesh {
    let mut mesh = Mesh::default();
    for part in &model.parts {
        mesh.append(&part.mesh);
    }
    mesh
}

/// Unit normal `u x v`.
fn normal(plane: &Rectangle) -> DVec3 {
    plane.u_axis.cross(plane.v_axis).normalize()
}

/// Texture coordinates (a, b) of the point's foot on the plane, and its signed distance in metres.
fn coordinates(plane: &Rectangle, p: DVec3) -> (f64, f64, f64) {
    let d = p - plane.origin;
    let along = |axis: DVec3| d.dot(axis) / axis.length_squared();
    (along(plane.u_axis), along(plane.v_axis), d.dot(normal(plane)))
}

/// Connected components, by shared vertices.
fn components(mesh: &Mesh) -> Vec<Mesh> {
    let mut parent: Vec<usize> = (0..mesh.positions.len()).collect();
    fn root(parent: &mut [usize], mut v: usize) -> usize {
        while parent[v] != v {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        v
    }
    for &[a, b, c] in &mesh.triangles {
        for other in [b, c] {
            let (x, y) = (root(&mut parent, a), root(&mut parent, other));
            parent[x] = y;
        }
    }
    let mut triangles_of_root: BTreeMap<usize, Vec<[usize; 3]>> = BTreeMap::new();
    for &t in &mesh.triangles {
        triangles_of_root.entry(root(&mut parent, t[0])).or_default().push(t);
    }
    triangles_of_root.into_values().map(|triangles| Mesh { positions: mesh.positions.clone(), triangles }).collect()
}

/// Directed edges that do not have exactly one partner in the opposite direction.
fn unpaired_edges(mesh: &Mesh) -> usize {
    let mut count: BTreeMap<(usize, usize), i32> = BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            *count.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
        }
    }
    count.iter().filter(|((a, b), n)| **n != 1 || count.get(&(*b, *a)) != Some(&1)).count()
}

fn assert_closed(name: &str, mesh: &Mesh) {
    for (i, component) in components(mesh).iter().enumerate() {
        assert_eq!(unpaired_edges(component), 0, "{name}: component {i} is not a closed 2-manifold");
        assert!(component.signed_volume() > 0.0, "{name}: component {i} faces inwards");
    }
}

fn all_models() -> Vec<Model> {
    vec![
        teapot::model(),
        aircraft::model(),
        analytic::plate_over_ground(),
        analytic::sphere(),
        analytic::cuboid(),
        analytic::t_shape(),
        planted::model(),
    ]
}

#[test]
fn committed_files_are_what_the_generator_writes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let differs = |f: &&catalogue::GeneratedFile| std::fs::read(folder.join(f.path)).ok().as_ref() != Some(&f.bytes);
    let files = catalogue::all_files();
    let stale: Vec<_> = files.iter().filter(differs).map(|f| f.path).collect();
    assert!(stale.is_empty(), "{stale:?} in models/ are missing or stale: run `cargo run --example make_models`");
}

#[test]
fn models_load_as_gltf_with_all_their_triangles() {
    for model in all_models() {
        let document = gltf::Gltf::from_slice(&model.to_glb()).unwrap();
        let primitives = document.meshes().flat_map(|m| m.primitives().collect::<Vec<_>>());
        let indices: usize = primitives.map(|p| p.indices().unwrap().count()).sum();
        assert_eq!(indices, 3 * whole(&model).triangles.len(), "{}", model.name);
    }
}

#[test]
fn no_triangle_is_degenerate() {
    for model in all_models() {
        let mesh = whole(&model);
        let smallest = mesh.triangles.iter().map(|&t| mesh.area_normal(t).length() / 2.0).fold(f64::INFINITY, f64::min);
        assert!(smallest > MIN_AREA_M2, "{}: a triangle of {smallest:e} m2", model.name);
    }
}

#[test]
fn triangle_counts_are_as_documented() {
    let expected =
        [("teapot", 6436), ("aircraft", 7504), ("plate_over_ground", 4), ("sphere", 980), ("box", 12), ("t_shape", 28)];
    let counts: BTreeMap<_, _> = all_models().iter().map(|m| (m.name, whole(m).triangles.len())).collect();
    for (name, triangles) in expected {
        assert_eq!(counts[name], triangles, "{name}");
    }
}

#[test]
fn solids_are_closed_and_face_outwards() {
    for model in [analytic::sphere(), analytic::cuboid(), analytic::t_shape()] {
        let mesh = whole(&model);
        assert_eq!(components(&mesh).len(), 1, "{}", model.name);
        assert_closed(model.name, &mesh);
    }
}

#[test]
fn teapot_is_a_closed_pot_with_two_tubes() {
    let mut parts = components(&whole(&teapot::model()));
    parts.sort_by_key(|p| p.triangles.len());
    assert_eq!(parts.len(), 3, "handle, spout, pot");
    assert_closed("teapot's pot", &parts[2]);
    // The handle is open at both ends (two rings of 20 edges), the spout at its root only.
    assert_eq!(unpaired_edges(&parts[0]), 40);
    assert_eq!(unpaired_edges(&parts[1]), 20);
    assert!(parts.iter().all(|p| p.signed_volume() > 0.0), "a tube faces inwards");
}

#[test]
fn hand_placed_planes_cut_the_teapot() {
    let planes = teapot_planes::file().planes;
    assert_eq!(planes.len(), 11);
    let mesh = whole(&teapot::model());
    let crosses = |plane: &Rectangle, t: &[usize; 3]| {
        let at = t.map(|v| coordinates(plane, mesh.positions[v]));
        let inside = at.iter().all(|(a, b, _)| (0.0..1.0).contains(a) && (0.0..1.0).contains(b));
        let (min, max) = at.iter().fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(c.2), h.max(c.2)));
        inside && min <= ROUNDING_M && max >= -ROUNDING_M
    };
    for plane in &planes {
        let crossed = mesh.triangles.iter().filter(|t| crosses(plane, t)).count();
        assert!(crossed >= 4, "{} crosses {crossed} triangles inside its rectangle", plane.name);
    }
}

#[test]
fn handle_planes_follow_each_other() {
    let planes = teapot_planes::file().planes;
    let handle: Vec<_> = planes.iter().filter(|p| p.name.starts_with("handle")).collect();
    assert_eq!(handle.len(), 5);
    for pair in handle.windows(2) {
        // Both end at the same joint but for their margins of 1.5 mm.
        let gap = (pair[0].origin + pair[0].u_axis).distance(pair[1].origin);
        assert!(gap < 4e-3, "{} ends {gap} m from {}", pair[0].name, pair[1].name);
    }
}

#[test]
fn teapot_has_newells_proportions() {
    let mesh = whole(&teapot::model());
    let min = mesh.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min) / teapot::METRES_PER_UNIT;
    let max = mesh.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) / teapot::METRES_PER_UNIT;
    // The spout's lip bulges between control points, so its x is only bounded by them.
    assert!((min - DVec3::new(-3.0, 0.0, -2.0)).abs().max_element() < 1e-3, "{min}");
    assert!((max.y - 3.15).abs() < 1e-3 && (max.z - 2.0).abs() < 1e-3 && (3.4..3.525).contains(&max.x), "{max}");
}

#[test]
fn aircraft_is_made_of_closed_pieces() {
    let mesh = whole(&aircraft::model());
    // Body, spine, canopy, nozzle, and on each side intake, boom, wing, stabiliser, fin.
    assert_eq!(components(&mesh).len(), 14);
    assert_closed("aircraft", &mesh);
}

#[test]
fn aircraft_is_mirror_symmetric() {
    // The nose apex and the rings lie on x = 0 or in pairs, so the mirror image has the same set of vertices.
    let key = |p: DVec3| (p * 1e6).round().to_array().map(|c| c as i64);
    let mesh = whole(&aircraft::model());
    let vertices: BTreeSet<_> = mesh.positions.iter().map(|&p| key(p)).collect();
    let lonely = mesh.positions.iter().filter(|p| !vertices.contains(&key(DVec3::new(-p.x, p.y, p.z))));
    assert_eq!(lonely.count(), 0);
}

/// Every vertex of the mesh must have a mirror image in the plane, within a millimetre.
fn assert_symmetric_about(plane: &Rectangle, points: &[DVec3]) {
    let normal = normal(plane);
    for &p in points {
        let image = p - normal * 2.0 * coordinates(plane, p).2;
        let gap = points.iter().map(|q| q.distance(image)).fold(f64::INFINITY, f64::min);
        assert!(gap < 1e-3, "{}: {p} has its nearest mirror image {gap} m off", plane.name);
    }
}

#[test]
fn fins_lie_in_the_published_planes() {
    let planes = aircraft::plane_file().planes;
    let published = DVec3::new(-0.917594, 0.0, 0.397518);
    let normal = normal(&planes[1]);
    assert!(normal.abs_diff_eq(aircraft::model_from_aircraft(published), 1e-6), "{normal}");
    let right = aircraft::right_fin();
    for (plane, fin) in [(&planes[1], right.clone()), (&planes[2], right.mirrored_x())] {
        let points = fin.mapped(aircraft::model_from_aircraft).positions;
        assert_symmetric_about(plane, &points);
        for &p in &points {
            let (a, b, distance) = coordinates(plane, p);
            assert!((0.0..1.0).contains(&a) && (0.0..1.0).contains(&b), "{}: {p} at ({a}, {b})", plane.name);
            assert!(distance.abs() <= 0.1001, "{}: {p} lies {distance} m off the plane", plane.name);
        }
    }
}

#[test]
fn horizontal_plane_holds_the_whole_plan_view() {
    let plane = &aircraft::plane_file().planes[0];
    let mesh = whole(&aircraft::model());
    assert!(mesh.positions.iter().map(|&p| coordinates(plane, p)).all(|(a, b, _)| a.min(b) > 0.0 && a.max(b) < 1.0));
    // Of each side's pieces, wing and stabiliser are the two that reach farthest out.
    let reach = |m: &Mesh| m.triangles.iter().flatten().map(|&v| m.positions[v].x).fold(f64::NEG_INFINITY, f64::max);
    let mut pieces = components(&mesh);
    pieces.sort_by(|a, b| reach(b).total_cmp(&reach(a)));
    for piece in &pieces[..2] {
        let used: BTreeSet<usize> = piece.triangles.iter().flatten().copied().collect();
        assert_symmetric_about(plane, &used.iter().map(|&v| piece.positions[v]).collect::<Vec<_>>());
    }
    assert!((5.3..5.4).contains(&reach(&pieces[0])), "half span {}", reach(&pieces[0]));
}

#[test]
fn sphere_is_convex_and_round() {
    let model = analytic::sphere();
    let mesh = &model.parts[0].mesh;
    for p in &mesh.positions {
        let radius = p.as_vec3().as_dvec3().length();
        assert!((radius - analytic::SPHERE_RADIUS_M).abs() < f64::from(f32::EPSILON), "{radius}");
    }
    for &t in &mesh.triangles {
        let normal = mesh.area_normal(t).normalize();
        let height = |p: &DVec3| normal.dot(*p - mesh.positions[t[0]]);
        assert!(mesh.positions.iter().map(height).fold(0.0, f64::max) < 1e-7, "a vertex in front of a face");
    }
}

/// Every corner must lie on the plane and at least `margin_m` inside the rectangle.
fn assert_inside(plane: &Rectangle, corners: &[DVec3], margin_m: f64) {
    assert!(plane.u_axis.dot(plane.v_axis).abs() < ROUNDING_M, "{}: edges are not perpendicular", plane.name);
    let (slack_a, slack_b) = (margin_m / plane.u_axis.length(), margin_m / plane.v_axis.length());
    for &corner in corners {
        let (a, b, distance) = coordinates(plane, corner);
        assert!(distance.abs() < ROUNDING_M, "{}: {corner} lies {distance} m off the plane", plane.name);
        let inside = (slack_a..=1.0 - slack_a).contains(&a) && (slack_b..=1.0 - slack_b).contains(&b);
        assert!(inside, "{}: {corner} at ({a}, {b})", plane.name);
    }
}

#[test]
fn plate_plane_holds_the_plate() {
    let plate = &analytic::plate_over_ground().parts[1].mesh;
    assert!(plate.triangles.iter().all(|&t| plate.area_normal(t).normalize().abs_diff_eq(DVec3::Y, 1e-12)));
    assert_inside(&analytic::plate_planes().planes[0], &plate.positions, 0.02);
}

#[test]
fn planted_planes_hold_their_plates() {
    let (plates, file) = (planted::plates(), planted::plane_file());
    assert_eq!((plates.len(), file.planes.len()), (4, 4));
    for (plate, plane) in plates.iter().zip(&file.planes) {
        assert_eq!(plate.name, plane.name);
        assert_inside(plane, &plate.corners_model(), 0.02);
    }
}

/// Points spread over a mesh, both corners and interior.
fn spread_points(mesh: &Mesh) -> Vec<DVec3> {
    const STEPS: usize = 24;
    let mut points = Vec::new();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v]);
        for i in 0..=STEPS {
            points.extend(
                (0..=STEPS - i).map(|j| a + (b - a) * (i as f64 / STEPS as f64) + (c - a) * (j as f64 / STEPS as f64)),
            );
        }
    }
    points
}

#[test]
fn planted_plates_keep_apart_and_differ_in_direction() {
    let (model, file) = (planted::model(), planted::plane_file());
    let clouds: Vec<_> = model.parts.iter().map(|part| spread_points(&part.mesh)).collect();
    for i in 0..clouds.len() {
        for j in i + 1..clouds.len() {
            let nearest = clouds[i]
                .iter()
                .flat_map(|p| clouds[j].iter().map(move |q| p.distance(*q)))
                .fold(f64::INFINITY, f64::min);
            let pair = format!("{} and {}", file.planes[i].name, file.planes[j].name);
            assert!((0.05..0.5).contains(&nearest), "{pair}: {nearest} m apart");
            let cosine = normal(&file.planes[i]).dot(normal(&file.planes[j])).abs();
            assert!(cosine < 0.9, "{pair} are nearly parallel: cosine {cosine}");
        }
    }
}

#[test]
fn plane_files_parse_and_keep_their_numbers() {
    let check = |file: PlaneFile| {
        let json: serde_json::Value = serde_json::from_slice(&file.to_json()).unwrap();
        let planes = json["planes"].as_array().unwrap();
        assert_eq!(planes.len(), file.planes.len());
        for (written, plane) in planes.iter().zip(&file.planes) {
            for (key, value) in [("origin", plane.origin), ("uAxis", plane.u_axis), ("vAxis", plane.v_axis)] {
                let read: [f64; 3] = serde_json::from_value(written[key].clone()).unwrap();
                assert!(DVec3::from_array(read).abs_diff_eq(value, ROUNDING_M), "{} {key}", plane.name);
            }
        }
    };
    [analytic::plate_planes(), planted::plane_file(), aircraft::plane_file(), teapot_planes::file()]
        .into_iter()
        .for_each(check);
}
