//! Eleven planes for the teapot, placed by hand as its published fit describes them: for the lid's knob two crossing
//! profiles and one across its widest part; for the spout its side profile, its width profile and a cap; for the handle
//! five solid segments end to end. All numbers follow from the patches in `teapot.rs`.
//!
//! The text leaves two choices open; they were made by shadow_error over a sphere of lights, with textures of 64^2:
//! - The segments are ribbons square to the symmetry plane: 0.51. Lying in the symmetry plane: 0.61.
//! - The cap also closes the pot, whose rim is as high as the spout's mouth: 0.51. Over the mouth alone: 0.65.
//!
//! Source of the layout: Chris Coleman, "Fast Self-Shadowing Using Occluder Textures", Texas A&M University, 2006.

use glam::{DVec2, DVec3};

use super::planes::{PlaneFile, Rectangle};
use super::teapot::{
    HANDLE, KNOB, METRES_PER_UNIT, RIM, SPOUT, TUBE_SEGMENTS, TubeSection, bezier, model_from_newell, tube_section,
};

/// Border around a part, in Newell's units: 1.5 mm.
const MARGIN: f64 = 0.03;
/// Samples along a curve when its extent is searched.
const CURVE_SAMPLES: usize = 200;
/// Segments of the handle.
const HANDLE_PIECES: usize = 5;
/// Where the handle leaves the body at its upper end, and comes back to it at its lower end, as the x of its centre
/// line in Newell's units: what lies nearer to the axis is inside the body.
const HANDLE_VISIBLE_X: [f64; 2] = [-1.58, -2.0];
/// The same for the spout's centre line.
const SPOUT_VISIBLE_X: f64 = 1.9;

/// The plane file.
pub fn file() -> PlaneFile {
    let mut planes = knob();
    planes.extend(spout());
    planes.extend(handle());
    PlaneFile {
        comment: "Placed by hand after Coleman, \"Fast Self-Shadowing Using Occluder Textures\", 2006: \
                  knob 3, spout 3, handle 5; each grown by a margin of 1.5 mm."
            .to_owned(),
        planes,
    }
}

/// A rectangle from Newell's units.
fn rectangle(name: &str, middle: DVec3, half_u: DVec3, half_v: DVec3) -> Rectangle {
    let [middle, half_u, half_v] = [middle, half_u, half_v].map(model_from_newell);
    Rectangle::centred(name, middle, half_u, half_v, MARGIN * METRES_PER_UNIT)
}

/// Two crossing vertical profiles, one horizontal plane where the knob is widest.
fn knob() -> Vec<Rectangle> {
    let profile = KNOB.map(|[radius, _, height]| DVec3::new(radius, 0.0, height));
    let points = (0..=CURVE_SAMPLES).map(|i| bezier(profile, i as f64 / CURVE_SAMPLES as f64));
    let widest = points.fold(DVec3::ZERO, |best, p| if p.x > best.x { p } else { best });
    let (top, foot) = (profile[0].z, profile[3].z);
    let middle = DVec3::Z * ((top + foot) / 2.0);
    let (along, across, up) = (DVec3::X * widest.x, DVec3::Y * widest.x, DVec3::Z * ((top - foot) / 2.0));
    vec![
        rectangle("knob, side profile", middle, along, up),
        rectangle("knob, front profile", middle, across, up),
        rectangle("knob, widest", DVec3::Z * widest.z, along, across),
    ]
}

/// Sections along a tube from its first row to its last.
fn sections(tube: &[[f64; 5]; 7]) -> Vec<TubeSection> {
    let parameter = |i: usize| i as f64 / CURVE_SAMPLES as f64;
    let segment = |first_row: usize| (0..=CURVE_SAMPLES).map(move |i| (first_row, parameter(i)));
    TUBE_SEGMENTS.into_iter().flat_map(segment).map(|(first_row, t)| tube_section(tube, first_row, t)).collect()
}

fn centre(section: &TubeSection) -> DVec2 {
    (section.inner + section.outer) / 2.0
}

/// A point of the symmetry plane in Newell's space.
fn in_symmetry_plane(p: DVec2) -> DVec3 {
    DVec3::new(p.x, 0.0, p.y)
}

/// The smallest interval that holds all values: its middle and half length.
fn interval(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    ((min + max) / 2.0, (max - min) / 2.0)
}

/// Side profile in the symmetry plane, width profile along the axis, cap over the mouth and the pot.
fn spout() -> Vec<Rectangle> {
    let outside: Vec<TubeSection> = sections(&SPOUT).into_iter().filter(|s| centre(s).x > SPOUT_VISIBLE_X).collect();
    let rim = |s: &TubeSection| [s.inner, s.outer];
    let (x, half_x) = interval(outside.iter().flat_map(rim).map(|p| p.x));
    let (z, half_z) = interval(outside.iter().flat_map(rim).map(|p| p.y));
    let half_width = outside.iter().map(|s| s.half_width).fold(0.0, f64::max);
    let side = rectangle("spout, side profile", DVec3::new(x, 0.0, z), DVec3::X * half_x, DVec3::Z * half_z);

    // The axis goes from where the spout leaves the body to the middle of its lip.
    let lip = sections(&SPOUT).swap_remove(CURVE_SAMPLES);
    let axis = (centre(&lip) - centre(&outside[0])).normalize_or_zero();
    let (along, half_along) = interval(outside.iter().map(|s| (centre(s) - centre(&outside[0])).dot(axis)));
    let middle = in_symmetry_plane(centre(&outside[0]) + axis * along);
    let width = rectangle("spout, width profile", middle, in_symmetry_plane(axis) * half_along, DVec3::Y * half_width);

    // As high as the mouth, from the far side of the rim to the lip's point.
    let [rim_radius, _, _] = RIM[3];
    let mouth_height = SPOUT[6][1];
    let (cap_x, half_cap) = interval([-rim_radius, x + half_x].into_iter());
    let cap_middle = DVec3::new(cap_x, 0.0, mouth_height);
    let cap = rectangle("spout, cap", cap_middle, DVec3::X * half_cap, DVec3::Y * rim_radius);
    vec![side, width, cap]
}

/// Five ribbons along the centre line, as wide as the handle, square to the symmetry plane.
fn handle() -> Vec<Rectangle> {
    let all = sections(&HANDLE);
    let half_width = all[0].half_width;
    let first = all.iter().position(|s| centre(s).x < HANDLE_VISIBLE_X[0]).unwrap_or(0);
    let last = all.iter().rposition(|s| centre(s).x < HANDLE_VISIBLE_X[1]).unwrap_or(all.len() - 1);
    let line: Vec<DVec2> = all[first..=last].iter().map(centre).collect();
    let joints = equal_pieces(&line, HANDLE_PIECES);
    let piece = |(i, ends): (usize, &[DVec2])| {
        let middle = in_symmetry_plane((ends[0] + ends[1]) / 2.0);
        let half_along = in_symmetry_plane((ends[1] - ends[0]) / 2.0);
        rectangle(&format!("handle, segment {}", i + 1), middle, half_along, DVec3::Y * half_width)
    };
    joints.windows(2).enumerate().map(piece).collect()
}

/// Points that divide a polyline into pieces of equal length, both ends included.
fn equal_pieces(line: &[DVec2], pieces: usize) -> Vec<DVec2> {
    let mut lengths = vec![0.0];
    for pair in line.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let total = lengths[lengths.len() - 1];
    let at = |piece: usize| {
        let wanted = total * piece as f64 / pieces as f64;
        line[lengths.partition_point(|&length| length < wanted).min(line.len() - 1)]
    };
    (0..=pieces).map(at).collect()
}
