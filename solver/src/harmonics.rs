//! Real spherical harmonics of the bands 0 to 3: a function of direction as 16 numbers.
//!
//! In: a unit direction. Out: the 16 functions there, orthonormal over the sphere, at index l(l+1)+m, without the
//! Condon-Shortley phase: order and signs of Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance
//! Environment Maps" (2001), polynomials of Sloan, "Stupid Spherical Harmonics (SH) Tricks" (2008).
//!
//! Not guaranteed: anything for a direction that is not a unit vector; the polynomials are not homogeneous.

use glam::Vec3;

/// Functions of the bands 0 to 3, "order 4".
pub const COUNT: usize = 16;

/// The first function, the same in every direction: 1 / sqrt(4 pi).
pub const CONSTANT: f32 = 0.282_094_8;

/// The functions in a direction (unit). Twin: `harmonics` in `shaders/vertex_visibility.wgsl`.
#[must_use]
pub fn harmonics(direction: Vec3) -> [f32; COUNT] {
    let Vec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        CONSTANT,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * zz - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (xx - yy),
        0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        0.457_045_8 * y * (5.0 * zz - 1.0),
        0.373_176_33 * z * (5.0 * zz - 3.0),
        0.457_045_8 * x * (5.0 * zz - 1.0),
        1.445_305_7 * z * (xx - yy),
        0.590_043_6 * x * (xx - 3.0 * yy),
    ]
}
