//! Pair tables: what a sample stands for, where rays cross, and that a gain is the drop of the error.

mod scenes;

use glam::Vec3;
use scenes::{Sampling, fit_options, knot, list_directions, pairs, soup, unit_vector};
use shadowfit_solver::{
    lights::LightDomain,
    mesh::{Mesh, Sides},
    pair_table::{MAX_TEXELS, PairTable, SPARE, SampleSize, nearest},
    plane::{PlacedPlane, ShadowPlane, Side},
    receivers::{ReceiverOptions, sample},
    sampling::uniform,
    search::{Verdict, place, search},
    sections::{self, TraceOptions},
    shade::{crossing, plane_rows},
    smoothing::smoothed,
    visibility::{LightPairs, Pairs, trace},
};

const SAMPLING: Sampling = Sampling { domain: LightDomain::Sphere, receivers: 2_000, lights: 96, seed: 1 };

/// Everything: a sample of this size is the table itself.
const ALL: SampleSize = SampleSize { lights: usize::MAX, pairs: usize::MAX / 4096 };

fn knot_mesh() -> Mesh {
    Mesh::new(&soup(&[(&knot(64, 10), Sides::Front)])).expect("the knot has triangles")
}

#[test]
fn the_nearest_direction_is_the_one_with_the_largest_dot_product() {
    let directions: Vec<Vec3> = (0..50).map(|i| unit_vector(3, i)).collect();
    for i in 0..1_000 {
        let light = unit_vector(4, i);
        let found = nearest(&directions, light);
        assert!(directions.iter().all(|d| d.dot(light) <= directions[found].dot(light)), "{light}");
    }
    // Of equal ones the first; where there is nothing to choose, or no number to choose by, the first too.
    assert_eq!(nearest(&[Vec3::X, Vec3::Y, Vec3::Y, Vec3::X], Vec3::Y), 1);
    assert_eq!(nearest(&[Vec3::X, Vec3::NEG_X], Vec3::Y), 0);
    assert_eq!(nearest(&[], Vec3::Y), 0);
    assert_eq!(nearest(&[Vec3::X, Vec3::Y], Vec3::NAN), 0);
}

#[test]
fn tables_hold_all_pairs_by_direction() {
    let all = pairs(&knot_mesh(), &SAMPLING);
    let directions = LightDomain::Sphere.directions(12, 5);
    let table = PairTable::new(&all, &directions);
    let pairs = table.vote.iter().filter(|vote| **vote != 0.0).count();
    assert_eq!((pairs, table.lights.len(), table.receivers), (all.len(), all.lights.len(), all.receivers));
    let (shadow, total) = table.weights();
    assert!((shadow / all.shadow_weight - 1.0).abs() < 1e-9 && (total / all.total_weight - 1.0).abs() < 1e-9);
    for (k, rows) in table.lights.iter().enumerate() {
        assert_eq!((rows.direction, rows.fold), (nearest(&directions, rows.light), k % 2));
        let light = all.lights.iter().find(|light| light.light == rows.light).unwrap();
        // Behind the light's own pairs come some without a vote, up to whole vector lanes.
        let end = rows.start + light.len();
        assert_eq!(&table.vote[rows.start..end], &light.vote[..]);
        assert!(table.vote[end..rows.end].iter().all(|vote| *vote == 0.0) && rows.end.next_multiple_of(16) - end < 16);
        assert!((rows.start..end).zip(0..).all(|(i, k)| table.point(i) == light.point(k)));
    }
    assert!(table.lights.windows(2).all(|l| l[0].direction <= l[1].direction && l[0].end == l[1].start));
}

#[test]
fn a_sample_stands_for_the_whole() {
    let table = PairTable::new(&pairs(&knot_mesh(), &SAMPLING), &LightDomain::Sphere.directions(12, 5));
    let (shadow, total) = table.weights();
    let everything = table.sample(ALL, 1);
    assert_eq!((&everything.vote, &everything.x), (&table.vote, &table.x));
    let (mut shadows, mut totals) = (0.0, 0.0);
    let seeds = 64;
    for seed in 0..seeds {
        let sample = table.sample(SampleSize { lights: 32, pairs: 6_000 }, seed);
        assert!((3_000..9_000).contains(&sample.len()), "{} pairs for 6000", sample.len());
        assert!([0, 1].iter().all(|fold| sample.lights.iter().any(|rows| rows.fold == *fold)), "one fold only");
        let (s, t) = sample.weights();
        (shadows, totals) = (shadows + s / f64::from(seeds as u32), totals + t / f64::from(seeds as u32));
    }
    // Which third of the lights was drawn is what is left: a few per cent each, a few tenths in the mean of 64.
    assert!((shadows / shadow - 1.0).abs() < 0.03, "{}", shadows / shadow);
    assert!((totals / total - 1.0).abs() < 0.03, "{}", totals / total);
    // Degenerate sizes are no division by zero.
    for size in [SampleSize { lights: 0, pairs: 0 }, SampleSize { lights: 1, pairs: 1 }] {
        assert!(table.sample(size, 1).vote.iter().all(|vote| vote.is_finite()));
    }
    assert!(PairTable::default().sample(ALL, 1).is_empty());
}

fn random_plane(i: u64) -> PlacedPlane {
    let normal = unit_vector(6, i);
    let (u, v) = normal.any_orthonormal_pair();
    let [width, height] = [0, 1].map(|k| 0.5 + 1.5 * uniform(7, 2 * i + k) as f32);
    let middle = normal * (0.6 * uniform(8, i) as f32 - 0.3);
    let plane = ShadowPlane { origin: middle - 0.5 * (u * width + v * height), u: u * width, v: v * height };
    let side = [Side::Both, Side::Front, Side::Back][i as usize % 3];
    PlacedPlane { plane, side, bias: 0.01 }
}

#[test]
fn crossings_are_where_the_shader_looks() {
    let table = PairTable::new(&pairs(&knot_mesh(), &SAMPLING), &[Vec3::Y]);
    let mut texels = Vec::new();
    let (mut inside, mut different) = (0, 0);
    for i in 0..12 {
        let placed = random_plane(i);
        // The largest grid as well: an index and its spares fill 16 bits.
        for (w, h) in [(32, 24), (1, 1), (255, 257 - SPARE)] {
            assert!(w * h <= MAX_TEXELS);
            table.crossings(&placed, (w, h), &mut texels);
            for rows in &table.lights {
                let affine = plane_rows(&placed.plane, placed.side, rows.light);
                for (k, &texel) in (rows.start..rows.end).zip(&texels[rows.start..rows.end]) {
                    let at = affine.and_then(|rows| crossing(&rows, placed.bias, table.point(k)));
                    let expected = at.map(|(a, b)| {
                        let [x, y] = [(a, w), (b, h)].map(|(a, n)| ((a * n as f32) as usize).min(n - 1));
                        y * w + x
                    });
                    inside += usize::from(expected.is_some());
                    let found = Some(usize::from(texel)).filter(|texel| *texel < w * h);
                    different += usize::from(found != expected);
                }
            }
        }
    }
    // A crossing within rounding of a texel's border may be counted to the next one.
    assert!(inside > 100_000 && different * 500 < inside, "{different} of {inside} differ");
}

#[test]
#[should_panic(expected = "texels")]
fn a_grid_beyond_16_bits_is_a_bug() {
    let table = PairTable::new(&pairs(&knot_mesh(), &SAMPLING), &[Vec3::Y]);
    table.crossings(&random_plane(0), (256, 256), &mut Vec::new());
}

/// All lights twice in a row: both folds are the same.
fn doubled(pairs: &Pairs) -> Pairs {
    let lights: Vec<LightPairs> = pairs.lights.iter().flat_map(|light| [light.clone(), light.clone()]).collect();
    let (shadow_weight, total_weight) = (2.0 * pairs.shadow_weight, 2.0 * pairs.total_weight);
    Pairs { lights, shadow_weight, total_weight, receivers: pairs.receivers }
}

/// Drop of the error by the best texture of a plane, counted pair by pair: what it blocks of shadow less what of light.
fn drop_of(table: &PairTable, placed: &PlacedPlane, n: usize) -> f64 {
    let mut texels = Vec::new();
    table.crossings(placed, (n, n), &mut texels);
    let mut votes = vec![0.0f32; n * n];
    let inside = |i: &usize| usize::from(texels[*i]) < n * n;
    (0..table.len()).filter(inside).for_each(|i| votes[usize::from(texels[i])] += table.vote[i]);
    let blocked: Vec<bool> = smoothed(&votes, n).into_iter().map(|vote| vote > 0.0).collect();
    let covers = |i: &usize| inside(i) && blocked[usize::from(texels[*i])];
    (0..table.len()).filter(covers).map(|i| f64::from(table.vote[i])).sum()
}

#[test]
fn a_gain_is_the_drop_of_the_error_where_both_folds_agree() {
    let mesh = knot_mesh();
    let table = PairTable::new(&doubled(&pairs(&mesh, &SAMPLING)), &[Vec3::Y]);
    let mut options = fit_options(SAMPLING.domain, 1, 1).search;
    (options.scoring, options.texels) = (ALL, 48);
    let shadow = table.weights().0;
    let rectangles: Vec<_> = (0..24).map(|i| (random_plane(i).plane, Side::Both)).collect();
    let mut found = place(&mesh, &table, &rectangles, &options);
    (options.proposals, options.refine_steps) = (100, 3);
    found.extend(search(&mesh, &table, &options, 0.0, &mut |_| Verdict::Continue).planes);
    let mut worthwhile = 0;
    for found in &found {
        // One window for all lights: a plane that only harms is not read at all.
        let drop = drop_of(&table, &found.placed, options.texels).max(0.0);
        // Sums of some 100,000 votes in f32, in another order; texels that come out at zero count for nothing.
        let tolerance = 1e-4 * found.gain.abs() + 1e-5 * shadow;
        assert!((found.gain - drop).abs() < tolerance, "{found:?}: drop {drop}");
        worthwhile += usize::from(drop > 0.01 * shadow);
    }
    assert!(worthwhile > 5 && found.len() == 25, "only {worthwhile} of {} planes gain anything", found.len());
}

/// Pairs of one light whose rays cross the plane y = 0 at (x, 0).
fn crossing_at(light: Vec3, pairs: &[(f32, f32)]) -> LightPairs {
    let (x, vote): (Vec<f32>, Vec<f32>) = pairs.iter().copied().unzip();
    let n = x.len();
    LightPairs {
        light,
        x,
        y: vec![-0.5 * light.y; n],
        z: vec![0.0; n],
        receiver: vec![0; n],
        vote,
        arrives: Vec::new(),
    }
}

#[test]
fn gains_are_counted_under_other_lights_and_where_they_are_gains() {
    let mesh = knot_mesh();
    let plane = ShadowPlane { origin: Vec3::new(-1.0, 0.0, -1.0), u: Vec3::Z * 2.0, v: Vec3::X * 2.0 };
    let mut options = fit_options(SAMPLING.domain, 1, 1).search;
    options.scoring = ALL;
    let gain = |lights: Vec<LightPairs>| {
        let pairs = Pairs { lights, shadow_weight: 1.0, total_weight: 1.0, receivers: 1 };
        let table = PairTable::new(&pairs, &[Vec3::Y, Vec3::NEG_Y]);
        place(&mesh, &table, &[(plane, Side::Both)], &options)[0].gain
    };
    let above = |votes: &[(f32, f32)]| crossing_at(Vec3::Y, votes);
    let below = |votes: &[(f32, f32)]| crossing_at(Vec3::NEG_Y, votes);
    // Each light lets the other's vote in.
    assert_eq!(gain(vec![above(&[(0.3, 1.0)]), above(&[(0.3, 2.0)])]), 3.0);
    // Lit pairs from below: the plane is not read there, and loses nothing.
    let lit = [(0.3, -1.0)];
    assert_eq!(gain(vec![above(&[(0.3, 2.0)]), above(&[(0.3, 3.0)]), below(&lit), below(&lit)]), 5.0);
    // Lights that disagree: what one would block the other wants lit, a loss, so the plane is left out.
    assert_eq!(gain(vec![above(&[(-0.3, 1.0), (0.3, -5.0)]), above(&[(-0.3, -2.0), (0.3, 1.0)])]), 0.0);
    // One light alone decides nothing that could be counted.
    assert_eq!(gain(vec![above(&[(0.3, 1.0)])]), 0.0);
}

#[test]
fn sections_get_pairs_of_their_own_surface_under_the_same_lights() {
    let mesh = knot_mesh();
    let receivers = sample(&mesh, &ReceiverOptions { count: 2_000, exposure_rays: 16, seed: 2 });
    let domain = LightDomain::Sphere;
    let pilot = trace(&mesh, &receivers, &domain.directions(32, 2), domain.solid_angle());
    // Triangles 2k and 2k+1 are copies of each other in the file.
    let units: Vec<u32> = (0..mesh.triangle_count() as u32).map(|i| i / 2).collect();
    let directions = list_directions(&fit_options(domain, 1, 1));
    for count in [1, 2, 7, 40] {
        let section_of = sections::divide(&mesh, &units, (&receivers, &pilot), count, None);
        assert_eq!(section_of.len(), mesh.triangle_count());
        assert!(section_of.chunks(2).all(|copies| copies[0] == copies[1]), "copies lie in two sections");
        assert!(section_of.iter().all(|section| (*section as usize) < count));
        let options = TraceOptions { pairs: 200_000, lights: 64, stride: 2, exposure_rays: 16, seed: 4 };
        let tables = sections::trace(&mesh, &section_of, &directions, domain, &options);
        assert_eq!(tables.len(), *section_of.iter().max().unwrap() as usize + 1);
        let total: usize = tables.iter().map(PairTable::len).sum();
        assert!((120_000..300_000).contains(&total), "{total} pairs for 200,000 in {count} sections");
        for (section, table) in tables.iter().enumerate() {
            assert!(table.lights.iter().zip(&tables[0].lights).all(|(a, b)| a.light == b.light));
            assert!(table.len() * tables.len() > total / 2, "section {section} has {} of {total} pairs", table.len());
            let corners = (0..).zip(&section_of).filter(|(_, s)| **s as usize == section);
            let corners = corners.flat_map(|(i, _): (usize, _)| mesh.corners[i]);
            let (low, high) =
                corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            let beside = |i: usize| {
                let p = table.point(i);
                (p - p.clamp(low, high)).length() > 1e-5
            };
            assert!(!(0..table.len()).any(beside), "a receiver beside section {section}");
        }
    }
}

/// A sparse trace has the weight of the whole one.
#[test]
fn weights_do_not_depend_on_the_stride() {
    let mesh = knot_mesh();
    let section_of = vec![0; mesh.triangle_count()];
    let weights = |stride| {
        let options = TraceOptions { pairs: 200_000, lights: 96, stride, exposure_rays: 16, seed: 4 };
        let tables = sections::trace(&mesh, &section_of, &[Vec3::Y], LightDomain::Sphere, &options);
        tables[0].weights()
    };
    let (every, fourth) = (weights(1), weights(4));
    // 200,000 draws: 0.3 %, and another sample of receivers.
    assert!((fourth.0 / every.0 - 1.0).abs() < 0.03 && (fourth.1 / every.1 - 1.0).abs() < 0.02, "{every:?} {fourth:?}");
}
