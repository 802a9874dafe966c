//! The triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", 2013. No ray slips through an edge
//! or vertex that two triangles share.

use glam::{Mat3A, Vec3, Vec3A};

/// A ray prepared for the test: axes permuted so that the direction is largest in z, and sheared so that it runs along
/// +z.
pub(super) struct WatertightRay {
    origin: Vec3,
    direction: Vec3,
    /// Sheared space from unit space, both around the origin. One entry is 1 and one 0 in the rows of x and y, two are 0
    /// in that of z, so that it rounds as the paper's formulas do.
    sheared_from_unit: Mat3A,
}

impl WatertightRay {
    #[inline(always)]
    pub(super) fn new(origin: Vec3, direction: Vec3) -> Self {
        let kz = direction.abs().max_position();
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if direction[kz] < 0.0 {
            std::mem::swap(&mut kx, &mut ky);
        }
        let inv = 1.0 / direction[kz];
        let mut rows = [[0.0; 3]; 3];
        (rows[0][kx], rows[1][ky]) = (1.0, 1.0);
        (rows[0][kz], rows[1][kz], rows[2][kz]) = (-(direction[kx] * inv), -(direction[ky] * inv), inv);
        Self { origin, direction, sheared_from_unit: Mat3A::from_cols_array_2d(&rows).transpose() }
    }

    /// Distance and corner weights where the ray meets the triangle in front of its origin; edges count as hits.
    #[inline(always)]
    pub(super) fn intersect(&self, corners: &[Vec3; 3]) -> Option<(f32, Vec3)> {
        let [a, b, c] = corners.map(|corner| self.sheared_from_unit * Vec3A::from(corner - self.origin));
        // Scaled weights: signed areas of the three sub-triangles; exact in f64 where f32 says zero.
        let mut e = Vec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        if e.x == 0.0 || e.y == 0.0 || e.z == 0.0 {
            let area = |p: Vec3A, q: Vec3A| (f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)) as f32;
            e = Vec3::new(area(c, b), area(a, c), area(b, a));
        }
        if (e.x < 0.0 || e.y < 0.0 || e.z < 0.0) && (e.x > 0.0 || e.y > 0.0 || e.z > 0.0) {
            return None;
        }
        let det = e.x + e.y + e.z;
        if det == 0.0 {
            return None;
        }
        let weights = e / det;
        let t = self.distance(corners).unwrap_or_else(|| weights.dot(Vec3::new(a.z, b.z, c.z)));
        (t > 0.0).then_some((t, weights))
    }

    /// Distance to the triangle's plane in f64, `None` where it is edge-on. Interpolating it with the f32 weights is
    /// wrong by 1e-4 on slivers, enough to put a surface that the ray has just left in front of it.
    fn distance(&self, corners: &[Vec3; 3]) -> Option<f32> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let facing = self.direction.as_dvec3().dot(normal);
        (facing != 0.0).then(|| ((a - self.origin.as_dvec3()).dot(normal) / facing) as f32)
    }
}
