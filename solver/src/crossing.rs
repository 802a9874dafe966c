//! Crossing: the texel of a plane that each pair's ray goes through; the search's inner loop.
//!
//! In: a pair table and a plane. Out: a texel index a pair. Method: the three affine rows of `shade`, first of sixteen
//! lights at once, then applied to sixteen pairs at once. A sample has some ten pairs a light, so that making the rows
//! one light after the other took longer than applying them.
//!
//! The rows are computed in the order of `shade::CastingPlane::rows`, operation for operation.

use crate::{
    pair_table::{LANES, LightRows, MAX_TEXELS, PairTable, SPARE},
    plane::{PlacedPlane, Side},
    shade::{CastingPlane, EDGE_ON},
};
use glam::Vec3;
use pulp::{Arch, Simd, WithSimd};
use std::array::from_fn;

type Lane = [f32; LANES];

/// 2^23: added to a float of 0..2^23 it leaves the integer part, rounded to nearest, in the low 23 bits. A plain `as`
/// conversion saturates, which no vector instruction does.
const TO_INTEGER: f32 = 8_388_608.0;

/// What rounding may add to a bound, as a share of the terms it is summed from.
const BOUND_ERROR: f32 = 1e-6;

/// A plane's map from receivers to texels under each light of a table.
#[derive(Clone, Debug, Default)]
pub struct Casts {
    lanes: Vec<CastLanes>,
    bias: f32,
    width: usize,
    height: usize,
}

/// The map under sixteen lights.
#[derive(Clone, Copy, Debug)]
struct CastLanes {
    /// Column, row and distance: x, y, z, 1.
    rows: [[Lane; 4]; 3],
    /// 1 where a receiver may cross the rectangle.
    crosses: [u8; LANES],
}

impl Casts {
    /// The map of a plane with a grid of `width` x `height`.
    ///
    /// # Panics
    /// The grid has more than [`MAX_TEXELS`].
    #[must_use]
    pub fn new(table: &PairTable, placed: &PlacedPlane, size: (usize, usize)) -> Self {
        let mut casts = Self::default();
        casts.renew(table, placed, size);
        casts
    }

    /// As [`Casts::new`], in the memory of this one.
    ///
    /// # Panics
    /// As above.
    pub fn renew(&mut self, table: &PairTable, placed: &PlacedPlane, (width, height): (usize, usize)) {
        assert!(width * height <= MAX_TEXELS, "{width} x {height} texels");
        self.lanes.clear();
        (self.bias, self.width, self.height) = (placed.bias, width, height);
        let casting = CastingPlane::new(&placed.plane, placed.side);
        let [low, high] = table.bounds;
        let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let size = [width as f32, height as f32];
        let of_lanes = LanesOf { casting, bias: placed.bias, centre, half, size };
        Arch::new().dispatch(RowsOfLights { of_lanes, lights: &table.light_lanes, out: &mut self.lanes });
    }

    /// Writes the texel of each pair of the light number `light`; `width * height` and up: none. False: none crosses,
    /// and `out` is as it was.
    #[must_use]
    pub fn of_light(&self, table: &PairTable, light: usize, out: &mut [u16]) -> bool {
        let (lanes, i) = (&self.lanes[light / LANES], light % LANES);
        if lanes.crosses[i] == 0 {
            return false;
        }
        let LightRows { start, end, .. } = table.lights[light];
        let [(x, _), (y, _), (z, _)] = [&table.x, &table.y, &table.z].map(|column| column[start..end].as_chunks());
        // By index: `map` would copy the rows of all sixteen lights.
        let [a, b, s]: [[f32; 4]; 3] = from_fn(|row| from_fn(|c| lanes.rows[row][c][i]));
        let outside = (self.width * self.height) as u32;
        let (width, height) = (self.width as f32, self.height as f32);
        let texel = Texel { a, b, s, bias: self.bias, width, height, outside };
        Arch::new().dispatch(TexelsOfPairs { texel, x, y, z, out: out.as_chunks_mut().0 });
        true
    }
}

impl PairTable {
    /// The texel of each pair's crossing on a grid of `width` x `height` over a plane; `width * height` and up: none.
    ///
    /// # Panics
    /// The grid has more than [`MAX_TEXELS`].
    pub fn crossings(&self, placed: &PlacedPlane, (width, height): (usize, usize), out: &mut Vec<u16>) {
        out.resize(self.len(), 0);
        let casts = Casts::new(self, placed, (width, height));
        for (light, rows) in self.lights.iter().enumerate() {
            let out = &mut out[rows.start..rows.end];
            if !casts.of_light(self, light, out) {
                out.fill((width * height) as u16);
            }
        }
    }
}

/// Rows of many lights. A closure in the place of this would be compiled for any x86-64: its adapter is not inlined into
/// the function that has the vectors.
struct RowsOfLights<'a> {
    of_lanes: LanesOf,
    lights: &'a [[Lane; 3]],
    out: &'a mut Vec<CastLanes>,
}

impl WithSimd for RowsOfLights<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { of_lanes, lights, out } = self;
        out.extend(lights.iter().map(
            #[inline(always)]
            |light| of_lanes.of_lights(light),
        ));
    }
}

/// What the rows of all lights have in common.
struct LanesOf {
    casting: CastingPlane,
    bias: f32,
    /// The middle of the receivers' box, and half its size.
    centre: Vec3,
    half: Vec3,
    /// Texels along u and v.
    size: [f32; 2],
}

impl LanesOf {
    #[inline(always)]
    fn of_lights(&self, [lx, ly, lz]: &[Lane; 3]) -> CastLanes {
        let CastingPlane { side, normal, duals, origin } = self.casting;
        let mut out = CastLanes { rows: [[[0.0; LANES]; 4]; 3], crosses: [0; LANES] };
        let (any_front, any_back) = (side != Side::Front, side != Side::Back);
        for i in 0..LANES {
            let l = Vec3::new(lx[i], ly[i], lz[i]);
            let n_dot_l = normal.dot(l);
            let served = (any_front | (n_dot_l < 0.0)) & (any_back | (n_dot_l > 0.0));
            let to_plane = -normal / n_dot_l;
            let s = [to_plane.x, to_plane.y, to_plane.z, origin[0] / n_dot_l];
            let mut crosses = served & (n_dot_l.abs() >= EDGE_ON);
            crosses &= self.range(s)[1] > self.bias;
            for (k, (dual, dual_dot_o)) in duals.into_iter().zip([origin[1], origin[2]]).enumerate() {
                let along = l.dot(dual);
                let start = [dual.x, dual.y, dual.z, -dual_dot_o];
                let row = from_fn(
                    #[inline(always)]
                    |c| start[c] + s[c] * along,
                );
                let [low, high] = self.range(row);
                crosses &= (high >= 0.0) & (low < 1.0);
                for (lane, x) in out.rows[k].iter_mut().zip(row) {
                    lane[i] = x * self.size[k];
                }
            }
            for (lane, x) in out.rows[2].iter_mut().zip(s) {
                lane[i] = x;
            }
            out.crosses[i] = u8::from(crosses);
        }
        out
    }

    /// What a row is at least and at most in the receivers' box.
    #[inline(always)]
    fn range(&self, row: [f32; 4]) -> [f32; 2] {
        let (along, c, h) = (Vec3::new(row[0], row[1], row[2]), self.centre, self.half);
        let middle = along.dot(c) + row[3];
        let error = BOUND_ERROR * (along.abs().dot(c.abs()) + row[3].abs());
        let reach = along.abs().dot(h) + error;
        [middle - reach, middle + reach]
    }
}

/// The map under one light.
struct Texel {
    a: [f32; 4],
    b: [f32; 4],
    s: [f32; 4],
    bias: f32,
    width: f32,
    height: f32,
    outside: u32,
}

/// Texels of the pairs of one light.
struct TexelsOfPairs<'a> {
    texel: Texel,
    x: &'a [Lane],
    y: &'a [Lane],
    z: &'a [Lane],
    out: &'a mut [[u16; LANES]],
}

impl WithSimd for TexelsOfPairs<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (((out, x), y), z) in self.out.iter_mut().zip(self.x).zip(self.y).zip(self.z) {
            *out = self.texel.of_lanes(x, y, z);
        }
    }
}

impl Texel {
    #[inline(always)]
    fn of_lanes(&self, x: &Lane, y: &Lane, z: &Lane) -> [u16; LANES] {
        let Self { a: ra, b: rb, s: rs, bias, width: w, height: h, outside } = *self;
        let mut out = [0; LANES];
        for i in 0..LANES {
            let (x, y, z) = (x[i], y[i], z[i]);
            let a = ra[0] * x + ra[1] * y + ra[2] * z + ra[3];
            let b = rb[0] * x + rb[1] * y + rb[2] * z + rb[3];
            let s = rs[0] * x + rs[1] * y + rs[2] * z + rs[3];
            let inside = (s > bias) & (a >= 0.0) & (a < w) & (b >= 0.0) & (b < h);
            // Column and row as whole floats, the index exact in them up to 2^23 texels.
            let column = (a - 0.5).max(0.0) + TO_INTEGER - TO_INTEGER;
            let row = (b - 0.5).max(0.0) + TO_INTEGER - TO_INTEGER;
            let index = (row * w + column + TO_INTEGER).to_bits() & 0x007f_ffff;
            let spare = outside + (i % SPARE) as u32;
            out[i] = if inside { index } else { spare } as u16;
        }
        out
    }
}
