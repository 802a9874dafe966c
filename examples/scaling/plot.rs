//! Log-log plots as plain SVG: one panel an axis that grows, one line a stage, and a dashed guide of slope 1.

use std::fmt::Write as _;

/// One panel: what grows, and what it costs.
pub struct Panel<'a> {
    /// What the horizontal axis counts.
    pub title: &'a str,
    /// Name and points of each line; points that are not positive are left out.
    pub lines: Vec<(&'a str, Vec<(f64, f64)>)>,
}

/// Width and height of a panel, and the room around its axes, px.
const PANEL: [f64; 2] = [430.0, 420.0];
const MARGIN: [f64; 4] = [60.0, 30.0, 110.0, 45.0];

/// Smallest vertical distance of two labels, px.
const LABEL_STEP: f64 = 13.0;

const COLOURS: [&str; 8] = ["#1b1b1b", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#888888"];

/// Exponent of the power law through the points (least squares of the logarithms); `None` with fewer than two.
pub fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> =
        points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let product: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    (logs.len() > 1 && spread > 0.0).then(|| product / spread)
}

/// The panels side by side.
pub fn svg(panels: &[Panel<'_>]) -> String {
    let (width, height) = (PANEL[0] * panels.len() as f64, PANEL[1]);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (i, panel) in panels.iter().enumerate() {
        let _ = writeln!(out, "<g transform=\"translate({} 0)\">", PANEL[0] * i as f64);
        draw(&mut out, panel);
        out.push_str("</g>\n");
    }
    out + "</svg>\n"
}

/// From data to px, both axes in decades.
struct Axes {
    low: [f64; 2],
    high: [f64; 2],
}

impl Axes {
    fn around(panel: &Panel<'_>) -> Option<Self> {
        let points = || panel.lines.iter().flat_map(|(_, points)| points).filter(|(x, y)| *x > 0.0 && *y > 0.0);
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for (x, y) in points() {
            for (k, value) in [x.log10(), y.log10()].into_iter().enumerate() {
                (low[k], high[k]) = (low[k].min(value.floor()), high[k].max(value.ceil()));
            }
        }
        (low[0] < high[0] && low[1] < high[1]).then_some(Self { low, high })
    }

    fn px(&self, x: f64, y: f64) -> [f64; 2] {
        let share = |k: usize, value: f64| (value.log10() - self.low[k]) / (self.high[k] - self.low[k]);
        let [left, top, right, bottom] = MARGIN;
        [left + share(0, x) * (PANEL[0] - left - right), PANEL[1] - bottom - share(1, y) * (PANEL[1] - top - bottom)]
    }
}

fn draw(out: &mut String, panel: &Panel<'_>) {
    let Some(axes) = Axes::around(panel) else { return };
    draw_grid(out, &axes, panel.title);
    // The guide runs through the corner where it is longest.
    let decades = (axes.high[0] - axes.low[0]).min(axes.high[1] - axes.low[1]);
    let [x0, y0] = axes.px(10f64.powf(axes.high[0] - decades), 10f64.powf(axes.high[1] - decades));
    let [x1, y1] = axes.px(10f64.powf(axes.high[0]), 10f64.powf(axes.high[1]));
    let _ = writeln!(
        out,
        "<path class=\"guide\" d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\" stroke=\"#999\" stroke-dasharray=\"5 4\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" fill=\"#777\">slope 1</text>",
        x1 + 4.0,
        y1 + 4.0
    );
    let mut labels = Vec::new();
    for (i, (name, points)) in panel.lines.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let px: Vec<[f64; 2]> =
            points.iter().filter(|(x, y)| *x > 0.0 && *y > 0.0).map(|&(x, y)| axes.px(x, y)).collect();
        let Some(&[end_x, end_y]) = px.last() else { continue };
        let path: Vec<String> = px.iter().map(|[x, y]| format!("{x:.1} {y:.1}")).collect();
        let _ = writeln!(
            out,
            "<path class=\"line\" d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
            path.join("L")
        );
        labels.push((end_y, end_x, *name, colour));
    }
    // Labels at the ends of the lines, moved apart from above.
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = f64::MIN;
    for (y, x, name, colour) in labels {
        let y = y.max(free);
        free = y + LABEL_STEP;
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{name}</text>", x + 4.0, y + 4.0);
    }
}

fn draw_grid(out: &mut String, axes: &Axes, title: &str) {
    let [left, top, right, bottom] = MARGIN;
    let (end_x, end_y) = (PANEL[0] - right, PANEL[1] - bottom);
    for decade in axes.low[0] as i32..=axes.high[0] as i32 {
        let [x, _] = axes.px(10f64.powi(decade), 1.0);
        let _ = writeln!(
            out,
            "<path d=\"M{x:.1} {top}V{end_y}\" stroke=\"#ddd\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">1e{decade}</text>",
            end_y + 15.0
        );
    }
    for decade in axes.low[1] as i32..=axes.high[1] as i32 {
        let [_, y] = axes.px(1.0, 10f64.powi(decade));
        let _ = writeln!(
            out,
            "<path d=\"M{left} {y:.1}H{end_x}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade} s</text>",
            left - 5.0,
            y + 4.0
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"13\">{title}</text>",
        0.5 * (left + end_x),
        PANEL[1] - 8.0
    );
}
