//! The parts of `examples/scaling` that compute something.

#[path = "../../examples/scaling/model.rs"]
mod model;
#[path = "../../examples/scaling/plot.rs"]
mod plot;

use model::Model;
use plot::{Panel, slope, svg};
use shadowfit_solver::mesh::Mesh;
use std::collections::HashMap;

#[test]
fn slope_is_the_exponent_of_a_power_law() {
    let law = |exponent: f64| (1..9).map(|i| (f64::from(i), 3.0 * f64::from(i).powf(exponent))).collect::<Vec<_>>();
    for exponent in [0.0, 0.5, 1.0, 1.7] {
        let found = slope(&law(exponent)).expect("eight points");
        assert!((found - exponent).abs() < 1e-9, "{found} instead of {exponent}");
    }
    assert_eq!(slope(&[(2.0, 1.0), (0.0, 5.0), (4.0, 0.0)]), None, "only one point has a logarithm");
}

#[test]
fn a_line_of_exponent_one_is_parallel_to_the_guide() {
    let points = vec![(1e3, 0.2), (1e4, 2.0), (1e5, 20.0)];
    let picture = svg(&[Panel { title: "triangles", lines: vec![("search", points)] }]);
    let direction = |start: &str| {
        let path = picture.split(start).nth(1).and_then(|rest| rest.split('"').next()).expect("a path");
        let numbers: Vec<f64> = path.split([' ', 'L']).map(|n| n.parse().expect("a number")).collect();
        let end = numbers.len() - 2;
        (numbers[end + 1] - numbers[1]) / (numbers[end] - numbers[0])
    };
    let (guide, line) = (direction("class=\"guide\" d=\"M"), direction("class=\"line\" d=\"M"));
    assert!((guide - line).abs() < 2e-3, "guide {guide}, line {line}");
}

#[test]
fn the_knot_is_closed_and_the_count_is_met() {
    for wanted in [1_000, 16_000] {
        let model = Model::with_triangles(wanted);
        let count = model.triangles.len();
        assert!(count.abs_diff(wanted) * 10 < wanted, "{count} instead of {wanted}");
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for [a, b, c] in &model.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((*from.min(to), *from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        // Every edge is run along both ways, but for the border of the ground.
        let open = edges.values().filter(|turns| **turns != 0).count();
        let border = 4.0 * (0.25 * 0.5 * wanted as f64).sqrt().round();
        assert_eq!(open, border as usize);
        let mesh = Mesh::new(&model.to_soup()).expect("a mesh");
        assert_eq!((mesh.triangle_count(), mesh.zero_area, mesh.duplicates), (count, 0, 0));
    }
}
