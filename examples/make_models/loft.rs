//! Closed skins: lofts through rings of points, rounded cross-sections, and wings with a symmetric aerofoil.
//!
//! Every function returns one closed 2-manifold, snapped and welded, with its outside outside.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::mesh::{MICROMETRE, Mesh, settled};

/// How a loft is closed at one end.
#[derive(Clone, Copy)]
pub enum End {
    /// A fan to the ring's own middle.
    Flat,
    /// A fan to this point.
    Point(DVec3),
}

/// A cross-section normal to the y axis, metres: [y, middle x, half width, middle z, top z, bottom z, squareness].
///
/// Its outline is `|x/w|^q + |z/h|^q = 1` above and below the middle z (Lame's curve) with q the squareness:
/// below 2 the sides come to an edge, 2 is an ellipse, above 2 it nears a rectangle.
pub type Section = [f64; 7];

/// The section's outline, counter-clockwise seen from -y.
pub fn ring(section: Section, points: usize) -> Vec<DVec3> {
    let [y, middle_x, half_width, middle_z, top, bottom, squareness] = section;
    let power = 2.0 / squareness;
    let rounded = |c: f64| c.signum() * settled(settled(c).abs().powf(power));
    let point = |i: usize| {
        let (sin, cos) = (TAU * i as f64 / points as f64).sin_cos();
        let height = if sin > 0.0 { top - middle_z } else { middle_z - bottom };
        DVec3::new(middle_x + half_width * rounded(cos), y, middle_z + height * rounded(sin))
    };
    (0..points).map(point).collect()
}

/// A smooth curve through all sections, `steps` pieces between neighbours (Catmull and Rom, "A Class of Local
/// Interpolating Splines", 1974).
pub fn smoothed(sections: &[Section], steps: usize) -> Vec<Section> {
    let last = sections.len() - 1;
    let mut out = Vec::with_capacity(last * steps + 1);
    for i in 0..last {
        let [p0, p1, p2, p3] = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(|k| sections[k]);
        for step in 0..steps {
            let t = step as f64 / steps as f64;
            let value = |c: usize| {
                let (m1, m2) = ((p2[c] - p0[c]) / 2.0, (p3[c] - p1[c]) / 2.0);
                let (d, e) = (2.0 * (p1[c] - p2[c]) + m1 + m2, 3.0 * (p2[c] - p1[c]) - 2.0 * m1 - m2);
                ((d * t + e) * t + m1) * t + p1[c]
            };
            out.push(std::array::from_fn(value));
        }
    }
    out.push(sections[last]);
    out
}

/// The skin through rings of equally many points. Where the path of rings turns back it makes a recess.
pub fn loft(rings: &[Vec<DVec3>], start: End, end: End) -> Mesh {
    let mut mesh = Mesh::default();
    for pair in rings.windows(2) {
        let points = pair[0].len();
        for i in 0..points {
            let j = (i + 1) % points;
            mesh.push_fan(&[pair[0][i], pair[0][j], pair[1][j], pair[1][i]]);
        }
    }
    if let (Some(first), Some(last)) = (rings.first(), rings.last()) {
        push_cap(&mut mesh, first.iter().rev().copied().collect(), start);
        push_cap(&mut mesh, last.clone(), end);
    }
    mesh.welded(MICROMETRE).turned_outward()
}

/// Closes a ring that is counter-clockwise seen from outside.
fn push_cap(mesh: &mut Mesh, ring: Vec<DVec3>, end: End) {
    let apex = match end {
        End::Flat => ring.iter().sum::<DVec3>() / ring.len() as f64,
        End::Point(apex) => apex,
    };
    for i in 0..ring.len() {
        mesh.push_fan(&[apex, ring[i], ring[(i + 1) % ring.len()]]);
    }
}

/// The plane in which a wing lies: a point of it and two unit vectors. The aerofoil is symmetric about this plane.
pub struct WingPlane {
    pub origin: DVec3,
    /// Forwards.
    pub chord: DVec3,
    /// Towards the tip.
    pub span: DVec3,
}

/// A wing's chord at one distance along the span, metres: [span, leading edge, trailing edge, half thickness].
pub type WingSection = [f64; 4];

/// Panels between two sections of a wing, so that its triangles are not too long.
const SPAN_STEPS: usize = 3;
/// Panels along each side of the aerofoil.
const CHORD_STEPS: usize = 8;

/// A wing through its sections, closed flat at root and tip.
pub fn wing(plane: &WingPlane, sections: &[WingSection]) -> Mesh {
    let mut rings = Vec::new();
    for pair in sections.windows(2) {
        for step in 0..SPAN_STEPS {
            let t = step as f64 / SPAN_STEPS as f64;
            rings.push(wing_ring(plane, std::array::from_fn(|c| pair[0][c] + (pair[1][c] - pair[0][c]) * t)));
        }
    }
    rings.extend(sections.last().map(|&tip| wing_ring(plane, tip)));
    loft(&rings, End::Flat, End::Flat)
}

/// Leading edge, one side, trailing edge, other side.
fn wing_ring(plane: &WingPlane, [span, leading, trailing, half_thickness]: WingSection) -> Vec<DVec3> {
    let normal = plane.chord.cross(plane.span);
    let point = |k: usize, side: f64| {
        let fraction = (1.0 - settled((PI * k as f64 / CHORD_STEPS as f64).cos())) / 2.0;
        let along = leading + (trailing - leading) * fraction;
        let across = side * half_thickness * aerofoil(fraction);
        plane.origin + plane.chord * along + plane.span * span + normal * across
    };
    let upper = (0..=CHORD_STEPS).map(|k| point(k, 1.0));
    upper.chain((1..CHORD_STEPS).rev().map(|k| point(k, -1.0))).collect()
}

/// Half thickness at a fraction of the chord, 1 at its thickest and 0 at both ends (NACA four-digit series, Jacobs,
/// Ward and Pinkerton, NACA report 460, 1933, with the last coefficient changed to close the trailing edge).
fn aerofoil(x: f64) -> f64 {
    let half_thickness_per_chord = 0.2969 * x.sqrt() + x * (-0.1260 + x * (-0.3516 + x * (0.2843 - x * 0.1036)));
    half_thickness_per_chord.max(0.0) * 10.0
}
