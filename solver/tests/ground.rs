//! The ground below a model: where its receivers are and what they weigh, planes for both, and shadows against closed
//! forms.

#![allow(clippy::unwrap_used, reason = "clippy sees only #[test] functions as tests, not what they call")]

mod scenes;

use glam::{DQuat, DVec3, Vec3};
use scenes::{FitOptions, Sampling, Triangles, closed, cuboid, fit_options, mapped, pairs, receivers};
use shadowfit_solver::{
    fit::bake,
    ground::{HALF_EXTENT, SHARE, apart, balanced, together},
    halves::{folded, folded_by_light, unfolded},
    lights::LightDomain,
    lists::assign,
    mesh::Mesh,
    metrics::measure,
    pair_table::{PairTable, nearest},
    plane::{BakedSet, Ground},
    receivers::ReceiverOptions,
    sampling::r2,
    search::{Selection, Verdict, search},
    sections::{self, TraceOptions},
    shade::{set_rows, visibility},
    symmetry::{Mirror, find},
    visibility::trace,
};

const SPHERE: LightDomain = LightDomain::Sphere;

const TRACE: TraceOptions = TraceOptions { pairs: 150_000, lights: 128, stride: 4, exposure_rays: 16, seed: 3 };

/// Half of a plate's side and its height above the ground, metres.
const PLATE: (f64, f64) = (1.0, 0.8);

/// A plate without thickness over a speck that says where the ground is.
fn plate() -> Mesh {
    let (half, height) = PLATE;
    let speck = cuboid(DVec3::Y * 1e-3, DVec3::splat(1e-3), 1);
    let plate = scenes::quad(DVec3::new(-half, height, -half), DVec3::Z * 2.0 * half, DVec3::X * 2.0 * half);
    closed(&[plate, speck].concat())
}

/// A box on legs, its own image in x = 0.
fn table() -> Triangles {
    let leg = |x: f64, z: f64| cuboid(DVec3::new(x, 0.5, z), DVec3::new(0.08, 0.5, 0.08), 1);
    let top = cuboid(DVec3::new(0.0, 1.1, 0.0), DVec3::new(1.0, 0.1, 0.6), 2);
    [top, leg(-0.8, -0.4), leg(0.8, -0.4), leg(-0.8, 0.3), leg(0.8, 0.3)].concat()
}

fn sampled(mesh: &Mesh, count: usize) -> (Ground, shadowfit_solver::receivers::Receivers) {
    let ground = Ground::below(mesh);
    (ground, ground.sample(mesh, &ReceiverOptions { count, exposure_rays: 32, seed: 5 }))
}

/// The tables of a model of one section and of its ground.
fn tables(mesh: &Mesh, directions: &[Vec3]) -> [PairTable; 2] {
    let model = sections::trace(mesh, &vec![0; mesh.triangle_count()], directions, SPHERE, &TRACE).remove(0);
    let shadow = model.weights().0;
    let ground = Ground::below(mesh).trace(mesh, directions, SPHERE, &TRACE);
    [model, balanced(ground, shadow)]
}

/// Planes for both.
fn fitted(mesh: &Mesh, options: &FitOptions) -> BakedSet {
    let directions = scenes::list_directions(options);
    let [model, ground] = tables(mesh, &directions);
    let table = together(&model, &ground);
    let shadow = ground.weights().0;
    let Selection { planes, .. } =
        search(mesh, &table, &options.search, options.min_gain * shadow, &mut |_| Verdict::Continue);
    let fits = [assign(&table, &planes, &options.lists)];
    apart(bake(&fits, &directions.repeat(2), shadow, &options.budget), Ground::below(mesh))
}

/// Held-out error on the ground.
fn ground_error(mesh: &Mesh, set: &BakedSet) -> f64 {
    let (ground, section) = set.ground_section().unwrap();
    let receivers = ground.sample(mesh, &ReceiverOptions { count: 8_000, exposure_rays: 16, seed: 99 });
    let pairs = trace(mesh, &receivers, &SPHERE.directions(90, 98), SPHERE.solid_angle());
    measure(set, &pairs, &vec![section; pairs.receivers]).shadow_error
}

#[test]
fn receivers_lie_on_the_square_and_not_under_feet() {
    let mesh = closed(&mapped(&cuboid(DVec3::ZERO, DVec3::new(0.6, 0.2, 0.3), 1), |p| p + DVec3::new(40.0, 7.0, -3.0)));
    let (ground, receivers) = sampled(&mesh, 4_000);
    let half = (Vec3::new(0.6, 0.2, 0.3).as_dvec3() / mesh.frame.radius).as_vec3();
    assert!((ground.height + half.y).abs() < 1e-6 && ground.half_extent == HALF_EXTENT);
    let side = 2.0 * HALF_EXTENT;
    for (p, n) in receivers.points.iter().zip(&receivers.normals) {
        assert_eq!((p.y, *n), (ground.height, Vec3::Y));
        assert!(p.x.abs() <= HALF_EXTENT && p.z.abs() <= HALF_EXTENT);
        assert!(p.x.abs() > half.x || p.z.abs() > half.z, "{p} lies under the box");
    }
    // All others are there, and evenly: the share of each quarter is its area's.
    let footprint = 4.0 * half.x * half.z / (side * side);
    let expected = 4_000.0 * (1.0 - footprint);
    assert!((receivers.points.len() as f32 - expected).abs() < 10.0, "{} of {expected}", receivers.points.len());
    for quarter in 0..4 {
        let inside = |p: &&Vec3| (p.x > 0.0) == (quarter & 1 == 0) && (p.z > 0.0) == (quarter & 2 == 0);
        let share = receivers.points.iter().filter(inside).count() as f32 / expected;
        assert!((share - 0.25).abs() < 0.01, "{share} in quarter {quarter}");
    }
    // Open ground weighs its area; beside the wall half of the sky is hidden.
    let area = side * side / 4_000.0;
    let at = |far: bool| {
        let is_there =
            |p: &&Vec3| if far { p.length() > 1.9 } else { p.x.abs() < half.x && p.z - half.z < 0.02 && p.z > 0.0 };
        let found: Vec<f32> = (0..)
            .zip(&receivers.points)
            .filter(|(_, p)| is_there(p))
            .map(|(i, _)| receivers.weights[i as usize])
            .collect();
        found.iter().sum::<f32>() / found.len() as f32 / area
    };
    assert!(at(true) > 0.97 && at(true) <= 1.0 && (0.4..0.7).contains(&at(false)), "{} {}", at(true), at(false));
}

#[test]
fn shadow_on_the_ground_weighs_its_share() {
    let mesh = closed(&table());
    let directions = SPHERE.directions(16, 1);
    let [model, ground] = tables(&mesh, &directions);
    let [a, b] = [&model, &ground].map(|table| table.weights().0);
    assert!(a > 0.0 && (SHARE * a / b - 1.0).abs() < 1e-4, "{a} {b}");
    // Lights are the same; those below the ground have no pairs there.
    assert_eq!(model.lights.len(), ground.lights.len());
    for (model, ground) in model.lights.iter().zip(&ground.lights) {
        assert_eq!((model.light, model.direction), (ground.light, ground.direction));
        assert_eq!(ground.start == ground.end, ground.light.y <= 0.0, "{}", ground.light);
    }
    let both = together(&model, &ground);
    assert_eq!(both.len(), model.len() + ground.len());
    assert_eq!((both.directions, both.receivers), (32, model.receivers + ground.receivers));
    let of_ground = both.lights.iter().filter(|rows| rows.direction >= 16);
    let height = Ground::below(&mesh).height;
    assert!(of_ground.clone().count() > 40, "no lights above the ground");
    assert!(of_ground.flat_map(|rows| rows.start..rows.end).all(|i| both.y[i] == height));
    // A convex body has no shadow of its own: the ground's is all there is.
    let ball = closed(&scenes::sphere(2));
    let [model, ground] = tables(&ball, &directions);
    assert!(model.weights().0 < 1e-6 && ground.weights().0 > 0.1);
}

/// The plate's shadow under a light is the plate moved by -h (l.x, l.z) / l.y.
#[test]
fn one_plane_casts_the_shadow_of_a_plate_on_the_ground() {
    let mesh = plate();
    let set = fitted(&mesh, &fit_options(SPHERE, 1, 1));
    assert_eq!((set.planes.len(), set.sections.len(), set.model_sections()), (1, 2, 1));
    let (ground, section) = set.ground_section().unwrap();
    let error = ground_error(&mesh, &set);
    // Measured: 0.024, from 150,000 pairs.
    assert!(error < 0.04, "{error}");
    let (half, height) = PLATE;
    let [half, height] = [half, height].map(|x| (x / mesh.frame.radius) as f32);
    let middle = mesh.frame.unit_from_model(DVec3::ZERO);
    assert!((middle.y - ground.height).abs() < 1e-6);
    for light in [Vec3::Y, Vec3::new(0.5, 1.0, 0.2), Vec3::new(-0.4, 0.6, 0.5), Vec3::new(0.3, 1.0, -0.9)] {
        let l = light.normalize();
        let (rows, list) = (set_rows(&set, l), &set.lists(l)[section as usize]);
        let (mut wrong, mut dark) = (0, 0);
        for i in 0..20_000 {
            let at = (r2(1, i) - 0.5) * 2.0 * ground.half_extent;
            let p = Vec3::new(at.x, ground.height, at.y);
            let over = p - middle + l * (height / l.y);
            let blocked = over.x.abs().max(over.z.abs()) < half;
            dark += usize::from(blocked);
            wrong += usize::from((visibility(&set.planes, &rows, list, p).x < 0.5) != blocked);
        }
        assert!(dark > 1_000 && wrong * 25 < dark, "{l}: {wrong} of {dark} wrong");
    }
    // From below nothing falls on the ground.
    assert!(set.lists(Vec3::NEG_Y)[section as usize].is_empty());
}

#[test]
fn planes_for_both_serve_both() {
    let mesh = closed(&table());
    let options = fit_options(SPHERE, 6, 1);
    let set = fitted(&mesh, &options);
    let held_out = Sampling { domain: SPHERE, receivers: 4_000, lights: 90, seed: 77 };
    let on_model = measure(&set, &pairs(&mesh, &held_out), &vec![0; receivers(&mesh, 4_000, 77).points.len()]);
    let on_ground = ground_error(&mesh, &set);
    // Measured: 0.11 and 0.05; a plane each for the top and the legs would do.
    assert!(on_model.shadow_error < 0.25 && on_ground < 0.12, "{} {on_ground}", on_model.shadow_error);
    // Planes of the model alone, read for the ground, do not know its side of the outlines.
    let (_, alone) = scenes::fit(&mesh, &pairs(&mesh, &Sampling { seed: 3, ..held_out }), &options);
    let ground = Some(Ground::below(&mesh));
    let alone =
        BakedSet { sections: [alone.sections.clone(), alone.sections.clone()].concat(), active: None, ground, ..alone };
    assert!(ground_error(&mesh, &alone) > 1.5 * on_ground, "{}", ground_error(&mesh, &alone));
}

#[test]
fn the_sections_of_both_are_what_their_lists_read() {
    let set = fitted(&closed(&table()), &fit_options(SPHERE, 4, 2));
    let active = set.active.as_ref().unwrap();
    assert_eq!((active.directions.len(), active.lists.len()), (32, 32));
    for (section, planes) in set.sections.iter().enumerate() {
        let is_read = |plane: &u32| active.lists.iter().any(|lists| lists[section].contains(plane));
        assert!((0..set.planes.len() as u32).all(|plane| planes.contains(&plane) == is_read(&plane)));
    }
    assert!(active.lists.iter().all(|lists| lists.len() == 2));
}

#[test]
fn a_mirror_serves_a_ground_only_if_it_stands_upright() {
    let found = |triangles: &Triangles, with_ground: bool| {
        let mesh = closed(triangles);
        let pilot = Sampling { domain: SPHERE, receivers: 4_000, lights: 48, seed: 9 };
        let ground = with_ground.then(|| Ground::below(&mesh));
        find(&mesh, (&receivers(&mesh, 4_000, 9), &pairs(&mesh, &pilot)), SPHERE, ground.as_ref())
    };
    let upright = table();
    assert_eq!(found(&upright, true), Some(Mirror::new(Vec3::X, 0.0)));
    let lying = mapped(&upright, |p| DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2) * p);
    assert_eq!(found(&lying, false).map(|mirror| mirror.normal()), Some(Vec3::Y));
    assert_eq!(found(&lying, true), None);
}

/// Lights are folded in the place of receivers: under a light and its image the ground shows each other's image.
#[test]
fn a_mirrored_ground_stays_one_section() {
    let mesh = closed(&table());
    let mirror = Mirror::new(Vec3::X, 0.0);
    let directions = mirror.closed(&SPHERE.directions(32, 1), SPHERE.solid_angle());
    let units: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
    let pilot = Sampling { domain: SPHERE, receivers: 4_000, lights: 48, seed: 9 };
    let pilot = (&receivers(&mesh, 4_000, 9), &pairs(&mesh, &pilot));
    let section_of = sections::divide(&mesh, &units, pilot, 2, Some(&mirror));
    let tables = sections::trace(&mesh, &section_of, &directions, SPHERE, &TRACE);
    let ground = Ground::below(&mesh).trace(&mesh, &directions, SPHERE, &TRACE);
    let total = ground.weights();
    let mut tables = folded(tables, &mirror, &directions);
    tables.push(folded_by_light(ground, &mirror, &directions));
    let [model, ground] = &tables[..] else { panic!("{} tables", tables.len()) };
    // No pair is lost, and lights stand in the same rows as those of the model.
    assert!(
        (ground.weights().0 - total.0).abs() < 1e-6 * total.0 && (ground.weights().1 - total.1).abs() < 1e-6 * total.1
    );
    assert_eq!(model.lights.len(), ground.lights.len());
    assert!(model.lights.iter().zip(&ground.lights).all(|(a, b)| a.light == b.light));
    let folded_away = |rows: &&shadowfit_solver::pair_table::LightRows| rows.light.x < -0.3 && rows.end > rows.start;
    assert_eq!(ground.lights.iter().filter(folded_away).count(), 0);

    let mut options = fit_options(SPHERE, 4, 1);
    options.search.replace_rounds = 0;
    let fit = |table: &PairTable| {
        let found = search(&mesh, table, &options.search, 0.005 * total.0, &mut |_| Verdict::Continue);
        assign(table, &found.planes, &options.lists)
    };
    let fits: Vec<_> = tables.iter().map(fit).collect();
    let half = BakedSet { ground: Some(Ground::below(&mesh)), ..bake(&fits, &directions, total.0, &options.budget) };
    let set = unfolded(half.clone(), &mirror);
    assert_eq!((half.model_sections(), set.model_sections(), set.sections.len()), (1, 2, 3));
    let of_ground = &set.sections[2];
    assert_eq!(of_ground.len(), 2 * half.sections[1].len());
    for i in 0..200 {
        let at = (r2(7, i) - 0.5) * 2.0;
        let l = Vec3::new(at.x, 0.5, at.y).normalize();
        let image = mirror.vector(l);
        let in_the_plane = |l: Vec3| directions[nearest(&directions, l)].x == 0.0;
        if in_the_plane(l) || in_the_plane(image) {
            continue;
        }
        let shadow = |l: Vec3, p: Vec3| visibility(&set.planes, &set_rows(&set, l), &set.lists(l)[2], p).x;
        let at = (r2(8, i) - 0.5) * 3.0;
        let p = Vec3::new(at.x, Ground::below(&mesh).height, at.y);
        assert_eq!(shadow(l, p), shadow(image, mirror.point(p)), "{p} under {l}");
    }
    let error = ground_error(&mesh, &set);
    assert!(error < 0.2, "{error}");
}

#[test]
fn a_fit_for_both_depends_on_nothing_but_the_scene() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&closed(&table()), &fit_options(SPHERE, 2, 4)))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn a_domain_is_seen_from_the_ground_if_it_rises_above_it() {
    for (text, expected) in [
        ("sphere", true),
        ("hemisphere", true),
        ("cone:0,-30,40", true),
        ("cone:0,-30,30", false),
        ("cone:90,-90,60", false),
    ] {
        assert_eq!(text.parse::<LightDomain>().unwrap().is_seen_from_ground(), expected, "{text}");
    }
}
