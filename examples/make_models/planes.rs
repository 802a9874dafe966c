//! Plane files for `shadowfit fit --planes FILE`: rectangles in model space, metres, Y up.

use glam::DVec3;
use serde_json::json;

/// Numbers in plane files are rounded to micrometres.
const STEPS_PER_METRE: f64 = 1e6;

/// A shadow plane: the rectangle `origin + a uAxis + b vAxis` with a and b in 0..1.
pub struct Rectangle {
    pub name: String,
    /// The corner with texture coordinates (0, 0).
    pub origin: DVec3,
    /// Full edge vectors, perpendicular to each other.
    pub u_axis: DVec3,
    pub v_axis: DVec3,
}

/// A plane file: what it is, and its planes in order.
pub struct PlaneFile {
    pub comment: String,
    pub planes: Vec<Rectangle>,
}

impl Rectangle {
    /// From the middle and the half edge vectors, each grown by `margin_m` metres at both ends.
    pub fn centred(name: &str, middle: DVec3, half_u: DVec3, half_v: DVec3, margin_m: f64) -> Rectangle {
        let grown = |half: DVec3| half + half.normalize_or_zero() * margin_m;
        let (half_u, half_v) = (grown(half_u), grown(half_v));
        Rectangle {
            name: name.to_owned(),
            origin: middle - half_u - half_v,
            u_axis: 2.0 * half_u,
            v_axis: 2.0 * half_v,
        }
    }
}

impl PlaneFile {
    /// JSON text with one plane a line.
    pub fn to_json(&self) -> Vec<u8> {
        let numbers = |v: DVec3| v.to_array().map(rounded);
        let lines: Vec<String> = self
            .planes
            .iter()
            .map(|p| {
                let plane = json!({"name": p.name, "origin": numbers(p.origin), "uAxis": numbers(p.u_axis), "vAxis": numbers(p.v_axis), "side": "both"});
                format!("    {plane}")
            })
            .collect();
        let comment = json!(self.comment);
        format!("{{\n  \"comment\": {comment},\n  \"planes\": [\n{}\n  ]\n}}\n", lines.join(",\n")).into_bytes()
    }
}

/// The double nearest to the rounded decimal, so that it prints without a tail of nines; never -0.
fn rounded(metres: f64) -> f64 {
    (metres * STEPS_PER_METRE).round() / STEPS_PER_METRE + 0.0
}
