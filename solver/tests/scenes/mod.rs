//! Scenes built in code, and the options that the tests search with.
#![allow(dead_code, reason = "each test binary uses some of the builders")]

use glam::{DVec3, Vec2, Vec3};
use shadowfit_solver::{
    budget::{BudgetOptions, Sizing},
    fit::bake,
    lights::LightDomain,
    lists::{ListOptions, assign},
    mesh::{Mesh, Sides, Soup},
    metrics::{Metrics, measure},
    pair_table::{PairTable, SampleSize},
    plane::{BakedSet, Encoding},
    receivers::{ReceiverOptions, Receivers, sample},
    sampling::uniform,
    search::{Found, SearchOptions, Selection, Verdict, search},
    visibility::{Pairs, trace},
};
use std::f64::consts::TAU;

/// Corners of triangles, metres.
pub type Triangles = Vec<[DVec3; 3]>;

/// How hard the tests search and bake.
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// What the directions of the lists are drawn from, and how many.
    pub domain: LightDomain,
    pub directions: usize,
    pub search: SearchOptions,
    /// Share of all shadow that a plane must explain.
    pub min_gain: f64,
    pub lists: ListOptions,
    pub budget: BudgetOptions,
}

/// The one place where tests and benches choose the options of a search.
pub fn fit_options(domain: LightDomain, max_planes: usize, seed: u64) -> FitOptions {
    FitOptions {
        domain,
        directions: 32,
        search: SearchOptions {
            max_planes,
            proposals: 300,
            screening: SampleSize { lights: 64, pairs: 8_000 },
            screening_texels: 32,
            finalists: 10,
            refined: 2,
            scoring: SampleSize { lights: 192, pairs: 60_000 },
            texels: 64,
            refine_steps: 5,
            replace_rounds: 1,
            seed,
        },
        min_gain: 0.005,
        lists: ListOptions { max_lookups: usize::MAX, grid: 255, rounds: 3, smoothing: 2 },
        budget: BudgetOptions {
            encoding: Some(Encoding::Sdf),
            sizing: Sizing::ByGain,
            max_planes: usize::MAX,
            bytes: 1 << 20,
            texture_size: 128,
            byte_gain: 2e-8,
            smoothing: 2,
        },
    }
}

/// How many receivers and lights, and which.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    pub domain: LightDomain,
    pub receivers: usize,
    pub lights: usize,
    pub seed: u64,
}

/// Receivers with enough exposure rays that only surface nobody can see is dropped.
pub fn receivers(mesh: &Mesh, count: usize, seed: u64) -> Receivers {
    sample(mesh, &ReceiverOptions { count, exposure_rays: 32, seed })
}

/// Traced pairs.
pub fn pairs(mesh: &Mesh, sampling: &Sampling) -> Pairs {
    let Sampling { domain, receivers: count, lights, seed } = *sampling;
    trace(mesh, &receivers(mesh, count, seed), &domain.directions(lights, seed), domain.solid_angle())
}

/// Searches planes for `pairs` and bakes them with the same pairs, the whole model one section.
pub fn fit(mesh: &Mesh, pairs: &Pairs, options: &FitOptions) -> (Selection, BakedSet) {
    let table = PairTable::new(pairs, &list_directions(options));
    let min_gain = options.min_gain * pairs.shadow_weight;
    let selection = search(mesh, &table, &options.search, min_gain, &mut |_| Verdict::Continue);
    let set = baked(&table, &selection.planes, options);
    (selection, set)
}

/// The directions of the lists.
pub fn list_directions(options: &FitOptions) -> Vec<Vec3> {
    options.domain.directions(options.directions, options.search.seed)
}

/// Lists and textures of given planes, the whole model one section.
pub fn baked(table: &PairTable, planes: &[Found], options: &FitOptions) -> BakedSet {
    let fits = [assign(table, planes, &options.lists)];
    bake(&fits, &list_directions(options), table.weights().0, &options.budget)
}

/// The error of a set whose first section every receiver belongs to.
pub fn measured(set: &BakedSet, pairs: &Pairs) -> Metrics {
    measure(set, pairs, &vec![0; pairs.receivers])
}

/// A soup without cut-outs.
pub fn soup(parts: &[(&Triangles, Sides)]) -> Soup {
    let mut out = Soup::default();
    for (triangles, sides) in parts {
        out.corners_model.extend_from_slice(triangles);
        out.sides.extend(vec![*sides; triangles.len()]);
    }
    out.cutout = vec![None; out.sides.len()];
    out.cutout_uv = vec![[Vec2::ZERO; 3]; out.sides.len()];
    out
}

/// The mesh of a closed body.
pub fn closed(triangles: &Triangles) -> Mesh {
    Mesh::new(&soup(&[(triangles, Sides::Front)])).expect("the scene has triangles")
}

/// Every corner mapped by `f`.
pub fn mapped(triangles: &Triangles, f: impl Fn(DVec3) -> DVec3) -> Triangles {
    triangles.iter().map(|corners| corners.map(&f)).collect()
}

/// A grid of `n` x `m` cells; the front is the side of `df/di x df/dj`.
pub fn patch(n: usize, m: usize, f: impl Fn(usize, usize) -> DVec3) -> Triangles {
    let cell = |i: usize, j: usize| {
        let [a, b, c, d] = [f(i, j), f(i + 1, j), f(i + 1, j + 1), f(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..n).flat_map(|i| (0..m).flat_map(move |j| [(i, j)])).flat_map(|(i, j)| cell(i, j)).collect()
}

/// A parallelogram from `corner`, front towards `u x v`.
pub fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Triangles {
    patch(1, 1, |i, j| corner + u * i as f64 + v * j as f64)
}

/// A closed box with `cells` x `cells` cells a face; neighbouring faces share the bits of their edges.
pub fn cuboid(centre: DVec3, half: DVec3, cells: usize) -> Triangles {
    let mut out = Vec::new();
    let at = |i: usize| 2.0 * i as f64 / cells as f64 - 1.0;
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            out.extend(patch(cells, cells, |i, j| {
                let mut p = DVec3::ZERO;
                p[axis] = sign;
                // The order of the other two axes turns the front outwards.
                let (first, second) = if sign > 0.0 { (1, 2) } else { (2, 1) };
                (p[(axis + first) % 3], p[(axis + second) % 3]) = (at(i), at(j));
                centre + p * half
            }));
        }
    }
    out
}

/// A unit sphere: an octahedron whose triangles are split in four `levels` times.
pub fn sphere(levels: usize) -> Triangles {
    let mut triangles = Vec::new();
    for octant in 0..8 {
        let sign = |bit: usize| if octant & bit == 0 { 1.0 } else { -1.0 };
        let (x, y, z) = (DVec3::X * sign(1), DVec3::Y * sign(2), DVec3::Z * sign(4));
        triangles.push(if sign(1) * sign(2) * sign(4) > 0.0 { [x, y, z] } else { [x, z, y] });
    }
    for _ in 0..levels {
        let split = |[a, b, c]: [DVec3; 3]| {
            let middle = |p: DVec3, q: DVec3| (p + q).normalize();
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    triangles
}

/// Tube radius of [`knot`], metres.
pub const KNOT_TUBE: f64 = 0.45;

/// The centre line of the trefoil [`knot`] at `t` in 0..1.
pub fn knot_centre(t: f64) -> DVec3 {
    let (a, b) = (2.0 * TAU * t, 3.0 * TAU * t);
    DVec3::new((2.0 + b.cos()) * a.cos(), b.sin(), (2.0 + b.cos()) * a.sin())
}

/// A closed trefoil knot with `segments` rings of `sides` corners.
pub fn knot(segments: usize, sides: usize) -> Triangles {
    patch(sides, segments, |j, i| {
        let t = (i % segments) as f64 / segments as f64;
        let (before, here, after) = (knot_centre(t - 1e-3), knot_centre(t), knot_centre(t + 1e-3));
        let tangent = (after - before).normalize();
        let normal = (after + before - 2.0 * here).reject_from(tangent).normalize();
        let (sin, cos) = (TAU * (j % sides) as f64 / sides as f64).sin_cos();
        here + (normal * cos + tangent.cross(normal) * sin) * KNOT_TUBE
    })
}

/// Height of [`terrain`] over -1..1 squared.
pub fn terrain_height(x: f64, z: f64) -> f64 {
    0.2 * (3.1 * x + 0.4).sin() * (2.3 * z - 0.2).cos() + 0.08 * (9.7 * x - 5.3 * z).sin()
}

/// A closed block of land on -1..1 squared: hills above, walls and a floor at -0.6.
pub fn terrain(n: usize) -> Triangles {
    let at = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
    let point = move |i: usize, j: usize, top: usize| {
        let (x, z) = (at(i), at(j));
        DVec3::new(x, if top == 1 { terrain_height(x, z) } else { -0.6 }, z)
    };
    let mut out = patch(n, n, |j, i| point(i, j, 1));
    out.extend(patch(n, n, |i, j| point(i, j, 0)));
    out.extend(patch(1, n, |k, j| point(n, j, k)));
    out.extend(patch(n, 1, |j, k| point(0, j, k)));
    out.extend(patch(n, 1, |i, k| point(i, n, k)));
    out.extend(patch(1, n, |k, i| point(i, 0, k)));
    out
}

/// Half sizes and height of [`plate_over_ground`], metres: ground half size, plate half size, plate height.
pub const PLATE_SCENE: [f64; 3] = [2.0, 0.5, 0.5];

/// A square plate, both sides drawn, over square ground drawn from above.
pub fn plate_over_ground() -> Soup {
    let [ground, plate, height] = PLATE_SCENE;
    let square = |half: f64, y: f64| quad(DVec3::new(-half, y, -half), DVec3::Z * 2.0 * half, DVec3::X * 2.0 * half);
    soup(&[(&square(ground, 0.0), Sides::Front), (&square(plate, height), Sides::Both)])
}

/// A flat plate in the air, as planted in a scene: middle, unit normal, half size.
#[derive(Clone, Copy, Debug)]
pub struct Plate {
    pub middle: DVec3,
    pub normal: DVec3,
    pub half: f64,
}

/// Four plates of different attitudes, well apart.
pub fn planted_plates() -> [Plate; 4] {
    let plate = |x: f64, y: f64, z: f64, normal: DVec3, half: f64| Plate {
        middle: DVec3::new(x, y, z),
        normal: normal.normalize(),
        half,
    };
    [
        plate(-1.0, 0.9, -1.0, DVec3::new(0.3, 1.0, 0.1), 0.55),
        plate(1.1, 0.8, -0.9, DVec3::new(-0.6, 0.7, 0.4), 0.5),
        plate(-0.9, 0.7, 1.0, DVec3::new(1.0, 0.2, 0.5), 0.5),
        plate(1.0, 0.75, 1.1, DVec3::new(0.1, 0.5, -1.0), 0.55),
    ]
}

/// The planted plates, both sides drawn, over ground drawn from above.
pub fn planted() -> Soup {
    let ground = quad(DVec3::new(-2.5, 0.0, -2.5), DVec3::Z * 5.0, DVec3::X * 5.0);
    let mut plates = Vec::new();
    for Plate { middle, normal, half } in planted_plates() {
        let (u, v) = normal.any_orthonormal_pair();
        plates.extend(quad(middle - (u + v) * half, u * 2.0 * half, v * 2.0 * half));
    }
    soup(&[(&ground, Sides::Front), (&plates, Sides::Both)])
}

/// Unit vector number `index` of a seeded sequence, uniform on the sphere.
pub fn unit_vector(seed: u64, index: u64) -> Vec3 {
    let y = 2.0 * uniform(seed, 2 * index) - 1.0;
    let (sin, cos) = (TAU * uniform(seed, 2 * index + 1)).sin_cos();
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * cos, y, r * sin).as_vec3().normalize()
}
