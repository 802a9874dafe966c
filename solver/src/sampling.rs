//! Low-discrepancy points and seeded numbers; everything random in this crate comes from here.
//!
//! R2: Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018). Hash: SplitMix64, Steele, Lea,
//! Flood, "Fast Splittable Pseudorandom Number Generators" (2014).

use glam::{Vec2, Vec3};

/// 1/g and 1/g^2, with g the plastic number (g^3 = g + 1): the two strides of the R2 sequence.
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// A number that depends on `seed` and `index` only.
#[must_use]
pub fn hash(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(index.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Uniform in `0..1`.
#[must_use]
pub fn uniform(seed: u64, index: u64) -> f64 {
    (hash(seed, index) >> 11) as f64 / (1u64 << 53) as f64
}

/// Point `index` of the R2 sequence shifted by `seed`, in the unit square.
#[must_use]
pub fn r2(seed: u64, index: u64) -> Vec2 {
    let axis = |a: usize| ((uniform(seed, a as u64) + R2[a] * (index + 1) as f64).fract()) as f32;
    Vec2::new(axis(0), axis(1)).min(Vec2::splat(1.0 - f32::EPSILON))
}

/// Corner weights of a point of a triangle, uniform by area for a uniform `square`: the square is folded along its
/// diagonal (Turk, "Generating Random Points in Triangles", 1990).
#[must_use]
pub fn barycentric(square: Vec2) -> Vec3 {
    let p = if square.x + square.y > 1.0 { Vec2::ONE - square } else { square };
    Vec3::new(1.0 - p.x - p.y, p.x, p.y)
}

/// Direction around `normal` with density cosine / pi for a uniform `square` (Malley's method).
#[must_use]
pub fn cosine_hemisphere(normal: Vec3, square: Vec2) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * square.x).sin_cos();
    let r = square.y.sqrt();
    let (t, b) = normal.any_orthonormal_pair();
    (t * (r * cos) + b * (r * sin) + normal * (1.0 - square.y).max(0.0).sqrt()).normalize()
}
