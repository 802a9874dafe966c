//! The run-time formula in f64: what rounding costs.

use glam::{DVec3, Vec3};
use shadowfit_solver::{
    plane::{BakedPlane, BakedSet, Encoding, OccluderTexture, SDF_BORDER, Side},
    shade::{EDGE_ON, set_rows, visibility},
    visibility::Pairs,
};

fn sample(texture: &OccluderTexture, a: f64, b: f64) -> f64 {
    let (w, h) = (texture.width, texture.height);
    let x = (a * w as f64 - 0.5).clamp(0.0, (w - 1) as f64);
    let y = (b * h as f64 - 0.5).clamp(0.0, (h - 1) as f64);
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let tap = |x: usize, y: usize| f64::from(texture.texels[y * w + x]);
    let row = |y: usize| tap(x0, y) + (x - x0 as f64) * (tap(x1, y) - tap(x0, y));
    let value = (row(y0) + (y - y0 as f64) * (row(y1) - row(y0))) / 255.0;
    match texture.encoding {
        Encoding::Coverage => value,
        Encoding::Sdf => f64::from(u8::from(value >= f64::from(SDF_BORDER))),
    }
}

/// What one plane lets through.
fn through(baked: &BakedPlane, l: DVec3, p: DVec3) -> f64 {
    let [o, u, v] = [baked.plane.origin, baked.plane.u, baked.plane.v].map(|x| x.as_dvec3());
    let big = u.cross(v);
    let (n, inv) = (big.normalize_or_zero(), 1.0 / big.length_squared());
    let n_dot_l = n.dot(l);
    let served = match baked.side {
        Side::Both => true,
        Side::Front => n_dot_l < 0.0,
        Side::Back => n_dot_l > 0.0,
    };
    if !(served && n_dot_l.abs() >= f64::from(EDGE_ON)) {
        return 1.0;
    }
    let s = n.dot(o - p) / n_dot_l;
    let q = p + l * s - o;
    let (a, b) = (q.dot(v.cross(big)) * inv, q.dot(big.cross(u)) * inv);
    let inside = s > f64::from(baked.bias) && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
    if inside { 1.0 - sample(&baked.texture, a, b) } else { 1.0 }
}

/// Share of the light for which f32 and f64 differ.
pub fn difference(set: &BakedSet, pairs: &Pairs, section_of: &[u32]) -> f64 {
    let mut different = 0.0;
    for light in &pairs.lights {
        let (rows, lists) = (set_rows(set, light.light), set.lists(light.light));
        let exact = |list: &[u32], p: Vec3| -> f64 {
            list.iter().map(|&k| through(&set.planes[k as usize], light.light.as_dvec3(), p.as_dvec3())).product()
        };
        for i in 0..light.len() {
            let (list, p) = (&lists[section_of[light.receiver[i] as usize] as usize], light.point(i));
            let single = f64::from(visibility(&set.planes, &rows, list, p).x);
            different += f64::from(light.vote[i].abs()) * (single - exact(list, p)).abs();
        }
    }
    different / pairs.total_weight.max(f64::MIN_POSITIVE)
}
