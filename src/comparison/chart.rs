//! Speed against error, each technique a series: an SVG.

use super::{
    Comparison,
    bench::World,
    catalogue::{Against, Family},
};
use kuva::{
    backend::svg::SvgBackend,
    plot::{ScatterPlot, scatter::MarkerShape},
    render::{layout::Layout, plots::Plot, render::render_multiple},
};

/// Okabe and Ito, "Color Universal Design" (2008), for series in turn; shapes tell those apart that share one.
const COLORS: [&str; 7] = ["#000000", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// Where the axis of frame times starts: nothing is cheaper than no shadow, but for noise.
const CHEAPEST: f64 = 0.7;

/// The chart of hard self-shadows under a moving light; none where no technique is ever wrong (a convex body).
pub(super) fn svg(comparison: &Comparison) -> Option<String> {
    let mut families: Vec<Family> = comparison.rows.iter().map(|row| row.family).collect();
    families.dedup();
    let mut plots = Vec::new();
    for (i, family) in families.into_iter().enumerate() {
        let rows = || {
            let shown = |world: World, against| !world.counts_ground() && against == Against::Hard;
            comparison
                .rows
                .iter()
                .filter(move |row| row.family == family && shown(row.world, row.against) && row.errors.mask_error > 0.0)
        };
        if rows().next().is_none() {
            continue;
        }
        let shapes = [MarkerShape::Circle, MarkerShape::Square, MarkerShape::Triangle];
        let names: Vec<&str> = rows().map(|row| &*row.technique).collect();
        let common = common_words(&names);
        let series = ScatterPlot::new()
            .with_data(rows().map(|row| (row.times.moving, row.errors.mask_error)))
            .with_labels(names.iter().map(|name| name[common.len()..].trim_start_matches([' ', ','])))
            .with_repel_labels()
            .with_legend(common.trim_end_matches(','))
            .with_color(COLORS[i % COLORS.len()])
            .with_marker(shapes[i / COLORS.len() % shapes.len()])
            .with_size(5.0);
        plots.push(Plot::Scatter(series));
    }
    let (low, high) = decades(comparison)?;
    let layout = Layout::auto_from_plots(&plots)
        .with_title(format!("{}: speed against error", comparison.model))
        .with_x_label("frame time under a moving light, against no shadows")
        .with_y_label("wrong share of the pixels")
        .with_width(1100.0)
        .with_height(760.0)
        .with_log_scale()
        .with_x_axis_min(CHEAPEST)
        .with_y_axis_min(low)
        .with_y_axis_max(high);
    Some(SvgBackend.render_scene(&render_multiple(plots, layout)))
}

/// The words that all names start with; all of a single name.
fn common_words<'a>(names: &[&'a str]) -> &'a str {
    let Some((first, others)) = names.split_first() else { return "" };
    let ends = first.match_indices(' ').map(|(at, _)| at).chain([first.len()]);
    let is_common = |end: &usize| {
        others.iter().all(|name| {
            name.starts_with(&first[..*end]) && name[*end..].chars().next().is_none_or(|c| c == ' ' || c == ',')
        })
    };
    ends.filter(is_common).max().map_or("", |end| &first[..end])
}

/// The powers of ten around all errors.
fn decades(comparison: &Comparison) -> Option<(f64, f64)> {
    let errors = comparison.rows.iter().map(|row| row.errors.mask_error).filter(|error| *error > 0.0);
    let logs: Vec<f64> = errors.map(f64::log10).collect();
    let low = logs.iter().copied().reduce(f64::min)?.floor();
    let high = logs.iter().copied().reduce(f64::max)?.ceil().max(low + 1.0);
    Some((10f64.powf(low), 10f64.powf(high)))
}
