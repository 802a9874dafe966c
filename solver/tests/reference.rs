//! `Mesh::is_blocked` and `nearest` against loops over all triangles in f64.

mod scenes;

use glam::{DVec3, Vec3};
use scenes::{
    KNOT_TUBE, closed, cuboid, knot, knot_centre, mapped, soup, sphere, terrain, terrain_height, unit_vector,
};
use shadowfit_solver::{
    mesh::{Mesh, Sides},
    sampling::uniform,
};

/// Rays nearer to an outline than this (unit space) may be decided either way. The f32 test rounds about ten times
/// numbers up to 2.5 (origins reach 1.5 from the centre): 10 x 2.5 x 6e-8 = 1.5e-6.
const MARGIN: f64 = 4e-6;

/// Triangles that the ray meets at a smaller |cosine| are edge-on: their distance is not worth comparing.
const EDGE_ON_COSINE: f64 = 1e-4;

/// What a loop over all triangles says about a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Truth {
    /// Nearest hit at least [`MARGIN`] inside an outline: there is certainly something there.
    certain: f64,
    /// Nearest possible hit: nothing may be found before.
    possible: f64,
}

/// Adds one triangle: by the distances of the ray from the lines through its edges (signed volumes).
fn meet(truth: &mut Truth, corners: &[Vec3; 3], origin: DVec3, direction: DVec3) {
    let [a, b, c] = corners.map(|p| p.as_dvec3() - origin);
    let normal = (b - a).cross(c - a);
    let facing = direction.dot(normal);
    let cosine = facing.abs() / normal.length();
    if cosine < EDGE_ON_COSINE {
        let centre = (a + b + c) / 3.0;
        let reach = a.distance(centre).max(b.distance(centre)).max(c.distance(centre)) + MARGIN;
        if centre.reject_from(direction).length() < reach {
            truth.possible = truth.possible.min((centre.dot(direction) - reach).max(0.0));
        }
        return;
    }
    let inside = |p: DVec3, q: DVec3| direction.dot(p.cross(q)) * facing.signum() / (q - p).cross(direction).length();
    let margin = inside(a, b).min(inside(b, c)).min(inside(c, a));
    let (distance, tolerance) = (a.dot(normal) / facing, MARGIN / cosine);
    if margin > MARGIN && distance > tolerance {
        truth.certain = truth.certain.min(distance + tolerance);
    }
    if margin > -MARGIN && distance > -tolerance {
        truth.possible = truth.possible.min(distance - tolerance);
    }
}

fn truth(mesh: &Mesh, origin: Vec3, direction: Vec3, drawn: impl Fn(usize, bool) -> bool) -> Truth {
    let mut truth = Truth { certain: f64::INFINITY, possible: f64::INFINITY };
    for (i, corners) in mesh.corners.iter().enumerate() {
        if drawn(i, mesh.normals[i].dot(direction) < 0.0) {
            meet(&mut truth, corners, origin.as_dvec3(), direction.as_dvec3());
        }
    }
    truth
}

/// Compares `count` rays; returns how many of them were too close to an outline to be decided.
fn compare(mesh: &Mesh, count: u64, ray: impl Fn(u64) -> (Vec3, Vec3)) -> usize {
    let mut undecided = 0;
    for i in 0..count {
        let (origin, direction) = ray(i);
        let any = truth(mesh, origin, direction, |_, _| true);
        if any.certain.is_finite() || any.possible.is_infinite() {
            let blocked = any.certain.is_finite();
            assert_eq!(mesh.is_blocked(origin, direction), blocked, "ray {i}: {origin} {direction} {any:?}");
        } else {
            undecided += 1;
        }
        // Front sides of even triangles and back sides of odd ones.
        let drawn = |triangle: usize, front: bool| front == triangle.is_multiple_of(2);
        let some = truth(mesh, origin, direction, drawn);
        let hit = mesh.nearest(origin, direction, |t, front| drawn(t as usize, front));
        let distance = hit.map_or(f64::INFINITY, |h| f64::from(h.distance));
        assert!(distance >= some.possible && distance <= some.certain, "ray {i}: {hit:?} {some:?}");
        if let Some(hit) = hit {
            let back = mesh.point(hit.triangle, hit.barycentric);
            let along = origin + direction * hit.distance;
            assert!(back.distance(along) < 1e-5 * (1.0 + hit.distance), "ray {i}: {back} is not {along}");
        }
    }
    undecided
}

/// Rays from anywhere in and around the model, half of them towards it.
fn any_ray(i: u64) -> (Vec3, Vec3) {
    let origin = unit_vector(1, i) * (1.5 * uniform(2, i) as f32);
    let target = unit_vector(3, i) * uniform(4, i) as f32;
    let direction = if i.is_multiple_of(2) { unit_vector(5, i) } else { (target - origin).normalize() };
    (origin, direction)
}

fn bodies() -> [(&'static str, Mesh); 4] {
    [
        ("sphere", closed(&sphere(3))),
        ("box", closed(&cuboid(DVec3::ZERO, DVec3::new(1.0, 0.6, 0.3), 8))),
        ("knot", closed(&knot(96, 12))),
        ("terrain", closed(&terrain(20))),
    ]
}

#[test]
fn random_rays_agree_with_the_loop() {
    for (name, mesh) in bodies() {
        let undecided = compare(&mesh, 4_000, any_ray);
        // An outline is a line: a band of 2 x 4e-6 around 3000 edges of length 0.1 covers 0.2 % of the silhouette.
        assert!(undecided < 40, "{name}: {undecided} of 4000 rays were undecided");
    }
    let planted = Mesh::new(&scenes::planted()).unwrap();
    assert!(compare(&planted, 4_000, any_ray) < 40);
}

#[test]
fn tiny_huge_and_far_models_give_the_same_answers() {
    let body = knot(48, 8);
    let home = closed(&body);
    let far = DVec3::new(1e5, -2e5, 3e5);
    for (name, moved) in [
        ("small", mapped(&body, |p| p * 1e-4)),
        ("large", mapped(&body, |p| p * 1e5)),
        ("far", mapped(&body, |p| p + far)),
        ("small and far", mapped(&body, |p| p * 1e-4 + far * 1e-3)),
    ] {
        let mesh = closed(&moved);
        assert_eq!((mesh.zero_area, mesh.duplicates, mesh.triangle_count()), (0, 0, body.len()), "{name}");
        assert!(compare(&mesh, 1_000, any_ray) < 10, "{name}");
        for corners in &moved {
            let p = corners[0];
            let back = mesh.frame.model_from_unit(mesh.frame.unit_from_model(p));
            // One f32 rounding a component in unit space.
            assert!(back.distance(p) < 1.1e-7 * mesh.frame.radius, "{name}: {p} came back as {back}");
        }
        let differing = (0..20_000)
            .filter(|&i| {
                let (origin, direction) = any_ray(i);
                mesh.is_blocked(origin, direction) != home.is_blocked(origin, direction)
            })
            .count();
        // Only rays within rounding (about 1e-7) of the outline may differ.
        assert!(differing <= 2, "{name}: {differing} of 20000 rays differ");
    }
}

/// A random point inside each of the bodies, unit space.
fn inside(name: &str, mesh: &Mesh, i: u64) -> Vec3 {
    let random = [uniform(11, i), uniform(12, i), uniform(13, i)];
    let p = match name {
        "sphere" => unit_vector(14, i).as_dvec3() * (0.95 * random[0]),
        "box" => (2.0 * DVec3::from(random) - 1.0) * DVec3::new(0.99, 0.59, 0.29),
        // The ring's polygon stays outside 0.8 of the tube; 0.3 leaves room for the chords of the centre line.
        "knot" => knot_centre(random[0]) + unit_vector(14, i).as_dvec3() * (0.3 * KNOT_TUBE * random[1]),
        _ => {
            let (x, z) = (1.9 * random[0] - 0.95, 1.9 * random[1] - 0.95);
            // The hills' triangles cut at most 0.05 off the analytic surface.
            DVec3::new(x, -0.59 + (terrain_height(x, z) + 0.54) * random[2], z)
        }
    };
    mesh.frame.unit_from_model(p)
}

#[test]
fn no_ray_leaves_a_closed_body_through_edges_or_vertices() {
    for (name, mesh) in bodies() {
        let mut leaks = Vec::new();
        for i in 0..100_000u64 {
            let origin = inside(name, &mesh, i);
            let triangle = (uniform(21, i) * mesh.triangle_count() as f64) as usize;
            let [a, b, _] = mesh.corners[triangle];
            let target = if i % 3 == 0 { a } else { a.lerp(b, uniform(22, i) as f32) };
            let direction = (target - origin).normalize();
            if !mesh.is_blocked(origin, direction) || mesh.nearest(origin, direction, |_, _| true).is_none() {
                leaks.push((origin, direction));
            }
        }
        assert!(leaks.is_empty(), "{name}: {} rays leaked, first {:?}", leaks.len(), leaks[0]);
    }
}

/// Boxes at multiples of 1/4 and tips at distance 1 on the axes, so that unit space is model space exactly.
fn lattice() -> Mesh {
    let mut triangles = Vec::new();
    for i in 0..27 {
        let at = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) - 1.0;
        triangles.extend(cuboid(at / 4.0, DVec3::splat(1.0 / 16.0), 2));
    }
    for (axis, side) in [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)] {
        for sign in [-1.0, 1.0] {
            let base = axis * (sign * 63.0 / 64.0);
            triangles.push([axis * sign, base + side / 128.0, base - side / 128.0]);
        }
    }
    let mesh = closed(&triangles);
    assert_eq!((mesh.frame.centre_model, mesh.frame.radius), (DVec3::ZERO, 1.0));
    mesh
}

/// Nearest hit, edges included, faces seen edge-on not: exact in f64 for coordinates that are multiples of 1/128.
fn exact_nearest(mesh: &Mesh, origin: Vec3, direction: Vec3) -> Option<f64> {
    let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
    let hit = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|p| p.as_dvec3() - o);
        let volumes = [d.dot(a.cross(b)), d.dot(b.cross(c)), d.dot(c.cross(a))];
        let normal = (b - a).cross(c - a);
        let same_turn = volumes.iter().all(|v| *v >= 0.0) || volumes.iter().all(|v| *v <= 0.0);
        let t = a.dot(normal) / d.dot(normal);
        (same_turn && d.dot(normal) != 0.0 && t > 0.0).then_some(t)
    };
    mesh.corners.iter().filter_map(hit).min_by(f64::total_cmp)
}

#[test]
fn axis_aligned_rays_on_a_lattice_of_boxes_are_exact() {
    let mesh = lattice();
    let mut blocked = [0usize; 2];
    for i in 0..17 * 17 * 17 {
        // Faces lie on multiples of 1/16 and cell edges too: most of these rays run in faces or through edges.
        let origin = (Vec3::new((i % 17) as f32, (i / 17 % 17) as f32, (i / 289) as f32) - 8.0) / 16.0;
        for k in 0..12 {
            let zero = if k < 6 { 0.0 } else { -0.0 };
            let mut direction = Vec3::splat(zero);
            direction[k % 3] = if k % 6 < 3 { 1.0 } else { -1.0 };
            let expected = exact_nearest(&mesh, origin, direction);
            let found = mesh.nearest(origin, direction, |_, _| true).map(|h| f64::from(h.distance));
            assert_eq!(found, expected, "{origin} {direction}");
            assert_eq!(mesh.is_blocked(origin, direction), expected.is_some(), "{origin} {direction}");
            blocked[usize::from(expected.is_some())] += 1;
        }
    }
    // Both answers must occur, or the scene tests nothing.
    assert!(blocked[0] > 1_000 && blocked[1] > 1_000, "{blocked:?}");
}

#[test]
fn axis_aligned_and_negated_directions_agree_with_the_loop() {
    for (name, mesh) in bodies() {
        let undecided = compare(&mesh, 3_000, |i| {
            let origin = any_ray(i).0;
            let mut direction = Vec3::ZERO;
            match i % 4 {
                // Along an axis, or at right angles to one; half of them negated, which makes components of -0.0.
                0 | 1 => direction[(i / 4 % 3) as usize] = 1.0,
                _ => {
                    direction = unit_vector(31, i);
                    direction[(i / 4 % 3) as usize] = 0.0;
                    direction = direction.normalize();
                }
            }
            (origin, if i % 2 == 0 { direction } else { -direction })
        });
        // Faces of the box and walls of the terrain are edge-on for these directions, and so never decided where
        // they are the only candidates; everything else must be.
        assert!(undecided < 600, "{name}: {undecided} of 3000 undecided");
    }
}

#[test]
fn the_transmitted_share_is_the_product_over_all_surfaces_up_to_the_light() {
    // Plates 0 to 7 upon each other, the upper ones smaller; every transmittance is a power of two, so that the
    // product is exact.
    let plate = |i: u32| {
        let half = 1.0 - 0.1 * f64::from(i);
        scenes::quad(DVec3::new(-half, 0.1 * f64::from(i), -half), DVec3::Z * 2.0 * half, DVec3::X * 2.0 * half)
    };
    let plates: Vec<_> = (0..8).map(plate).collect();
    let parts: Vec<_> = plates.iter().map(|plate| (plate, Sides::Front)).collect();
    let of_plate = |plate: u32| match plate {
        7 => Vec3::new(0.5, 0.25, 0.0),
        even if even % 2 == 0 => Vec3::new(1.0, 0.5, 0.5),
        _ => Vec3::new(0.25, 0.125, 0.125),
    };
    let mesh = Mesh::new(&soup(&parts)).unwrap().with_transmittance(|triangle| of_plate(triangle as u32 / 2));
    for i in 0..2_000 {
        let x = 0.95 * (2.0 * uniform(61, i) - 1.0);
        let z = 0.95 * (2.0 * uniform(62, i) - 1.0);
        let p = mesh.frame.unit_from_model(DVec3::new(x, -0.05, z));
        let reach = (1.5 * uniform(63, i) / mesh.frame.radius) as f32;
        for (direction, reach) in [(Vec3::Y, reach), (Vec3::Y, f32::INFINITY), (Vec3::NEG_Y, reach)] {
            let end = f64::from(reach) * mesh.frame.radius - 0.05;
            let is_met = |plate: &u32| {
                let height = 0.1 * f64::from(*plate);
                direction.y > 0.0 && height < end && x.abs().max(z.abs()) < 1.0 - height
            };
            let expected: Vec3 = (0..8).filter(is_met).map(of_plate).product();
            assert_eq!(mesh.transmitted(p, direction, reach), expected, "({x}, {z}) up to {reach}");
        }
    }
}

#[test]
fn small_features_on_a_large_model_are_hit() {
    // A box of 1e-4 of the model's radius on a floor; the loop's margin is 4 % of the box.
    let floor = scenes::quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let centre = DVec3::new(0.61, 1e-4, -0.37);
    let mesh =
        Mesh::new(&soup(&[(&floor, Sides::Front), (&cuboid(centre, DVec3::splat(1e-4), 1), Sides::Front)])).unwrap();
    let middle = mesh.frame.unit_from_model(centre);
    let mut blocked = 0;
    let undecided = compare(&mesh, 20_000, |i| {
        let direction = unit_vector(41, i);
        // Aimed within three sizes of the box, from near and far.
        let target = middle + unit_vector(42, i) * (3e-4 * uniform(43, i) as f32);
        (target - direction * (1e-3 + uniform(44, i) as f32), direction)
    });
    for i in 0..2_000 {
        let direction = unit_vector(45, i);
        blocked += usize::from(mesh.is_blocked(middle - direction * 0.5, direction));
    }
    assert_eq!(blocked, 2_000, "rays through the middle of the small box");
    // A band of 2 x 4e-6 around the outline, some 8e-4 long, among rays spread over a disc of 3e-4: 2 %; most of
    // them have the floor behind.
    assert!(undecided < 400, "{undecided} of 20000 undecided");
}

#[test]
fn long_thin_triangles_are_hit_along_their_whole_length() {
    // 2 units long, 2e-5 wide (1e5 : 1), in a direction that f32 does not represent exactly.
    let along = DVec3::new(0.6, 0.33, -0.72).normalize();
    let (side, up) = along.any_orthonormal_pair();
    let needle = vec![[along + side * 1e-5, along - side * 1e-5, -along]];
    let mesh = closed(&needle);
    for i in 0..20_000u64 {
        let t = uniform(51, i);
        let half_width = 1e-5 * t;
        let base = -along + 2.0 * along * t;
        let tilt = up + along * (uniform(52, i) - 0.5) + side * 0.2 * (uniform(53, i) - 0.5);
        let direction = tilt.normalize().as_vec3();
        let aimed_at = |p: DVec3| mesh.is_blocked(mesh.frame.unit_from_model(p) - direction * 0.7, direction);
        // Origin and needle are f32 points: 2e-6 off at most, which the tip does not have to spare.
        if half_width > 2e-6 {
            assert!(aimed_at(base), "ray {i} through the middle at {t}");
        }
        assert!(!aimed_at(base + side * (half_width + 4e-6)), "ray {i} beside the needle at {t}");
    }
}
