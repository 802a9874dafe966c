//! Light domains and their directions.
//!
//! Directions form a spherical Fibonacci lattice (Keinert et al., "Spherical Fibonacci Mapping", 2015): equal solid
//! angles, so every light of a set weighs the same. Another seed turns and shifts the lattice: no direction of one
//! seed is a direction of another.

use crate::sampling::uniform;
use glam::{Quat, Vec3};

/// The golden ratio's fractional part: the lattice's turn from one direction to the next.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The set of light directions that a fit must serve. Directions point from the surface towards the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightDomain {
    /// Every direction.
    Sphere,
    /// Those above the horizon (+Y).
    Hemisphere,
    /// Those within `half_angle_rad` of `axis`.
    Cone {
        /// Unit vector towards the middle of the domain.
        axis: Vec3,
        /// 0 to pi, exclusive of 0.
        half_angle_rad: f32,
    },
}

/// A text that is not a light domain.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a light domain: use sphere, hemisphere or cone:AZIMUTH,ELEVATION,HALF_ANGLE (degrees)")]
pub struct ParseDomainError(String);

/// The unit vector at an azimuth (0 = +Z, 90 degrees = +X) and an elevation (90 degrees = +Y), in radians.
#[must_use]
pub fn direction(azimuth_rad: f32, elevation_rad: f32) -> Vec3 {
    let (sin_az, cos_az) = azimuth_rad.sin_cos();
    let (sin_el, cos_el) = elevation_rad.sin_cos();
    Vec3::new(sin_az * cos_el, sin_el, cos_az * cos_el)
}

/// Azimuth and elevation of a unit vector, in radians: the inverse of [`direction`].
#[must_use]
pub fn angles(direction: Vec3) -> (f32, f32) {
    (direction.x.atan2(direction.z), direction.y.clamp(-1.0, 1.0).asin())
}

impl std::str::FromStr for LightDomain {
    type Err = ParseDomainError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let bad = || ParseDomainError(text.to_string());
        match text {
            "sphere" => return Ok(Self::Sphere),
            "hemisphere" => return Ok(Self::Hemisphere),
            _ => {}
        }
        let numbers = text.strip_prefix("cone:").ok_or_else(bad)?.split(',').map(|n| n.trim().parse::<f32>());
        let numbers: Vec<f32> = numbers.collect::<Result<_, _>>().map_err(|_| bad())?;
        match numbers[..] {
            [az, el, half] if az.is_finite() && el.abs() <= 90.0 && half > 0.0 && half <= 180.0 => {
                Ok(Self::Cone { axis: direction(az.to_radians(), el.to_radians()), half_angle_rad: half.to_radians() })
            }
            _ => Err(bad()),
        }
    }
}

impl LightDomain {
    fn axis_and_cos(self) -> (Vec3, f64) {
        match self {
            Self::Sphere => (Vec3::Y, -1.0),
            Self::Hemisphere => (Vec3::Y, 0.0),
            Self::Cone { axis, half_angle_rad } => (axis, f64::from(half_angle_rad).cos()),
        }
    }

    /// Is there a direction above the horizon (+Y)?
    #[must_use]
    pub fn is_seen_from_ground(self) -> bool {
        match self {
            Self::Sphere | Self::Hemisphere => true,
            Self::Cone { axis, half_angle_rad } => angles(axis).1 + half_angle_rad > 0.0,
        }
    }

    /// Solid angle in steradians.
    #[must_use]
    pub fn solid_angle(self) -> f64 {
        std::f64::consts::TAU * (1.0 - self.axis_and_cos().1)
    }

    /// `count` unit directions of equal solid angle.
    #[must_use]
    pub fn directions(self, count: usize, seed: u64) -> Vec<Vec3> {
        let (axis, cos_half) = self.axis_and_cos();
        let (turn, shift) = (uniform(seed, 0), uniform(seed, 1));
        let mut to_domain = Quat::from_rotation_arc(Vec3::Y, axis);
        if self == Self::Sphere {
            // The whole sphere has no pole of its own: turn the lattice anywhere.
            let pole = direction(
                (uniform(seed, 2) as f32) * std::f32::consts::TAU,
                (2.0 * uniform(seed, 3) as f32 - 1.0).asin(),
            );
            to_domain = Quat::from_rotation_arc(Vec3::Y, pole);
        }
        (0..count)
            .map(|i| {
                let y = 1.0 - (1.0 - cos_half) * ((i as f64 + shift) / count as f64);
                let r = (1.0 - y * y).max(0.0).sqrt();
                let (sin, cos) = (std::f64::consts::TAU * (turn + GOLDEN * i as f64).fract()).sin_cos();
                let local = Vec3::new((r * sin) as f32, y as f32, (r * cos) as f32);
                (to_domain * local).normalize() + Vec3::ZERO
            })
            .collect()
    }
}
