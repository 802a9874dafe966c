//! Shadow rays a second, and Embree on the same triangles and rays.

use crate::{Counter, best_seconds, model::Model};
use glam::Vec3;
use shadowfit_solver::{
    lights::LightDomain,
    mesh::Mesh,
    receivers::{ReceiverOptions, Receivers, sample},
};
use std::{error::Error, fs, hint::black_box, path::Path, process::Command};

const TRIANGLES: [usize; 3] = [6_000, 64_000, 1_000_000];
const RECEIVERS: usize = 16_384;
const LIGHTS: usize = 64;
const PASSES: usize = 5;

/// Origin and direction.
type ShadowRay = (Vec3, Vec3);

/// One line a model and order of rays.
pub fn counters(python: Option<&Path>) -> Result<Vec<Counter>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("rays");
    let mut out = Vec::new();
    for triangles in TRIANGLES {
        let mesh = Mesh::new(&Model::with_triangles(triangles).to_soup())?;
        let receivers = sample(&mesh, &ReceiverOptions { count: RECEIVERS, exposure_rays: 4, seed: 1 });
        for (order, rays) in orders(&receivers) {
            let name = format!("shadow rays {order} against {} triangles", mesh.triangle_count());
            let mut blocked = Vec::new();
            let seconds = best_seconds(PASSES, || {
                blocked.clear();
                blocked.extend(rays.iter().map(|&(origin, light)| mesh.is_blocked(black_box(origin), light)));
            })?;
            let rate = rays.len() as f64 / seconds;
            let (mut limit, mut agreeing) = (None, None);
            if let Some(python) = python {
                fs::write(&file, dump(&mesh, &rays, &blocked))?;
                let (rate, share) = embree(python, &file)?;
                (limit, agreeing) = (Some((rate, "robust Embree 4".to_string())), Some(share));
            }
            out.push(Counter { name, rate, limit, agreeing });
        }
    }
    Ok(out)
}

/// The rays of all receivers and lights, light by light as a fit traces them, and receiver by receiver.
fn orders(receivers: &Receivers) -> [(&'static str, Vec<ShadowRay>); 2] {
    let lights = LightDomain::Sphere.directions(LIGHTS, 1);
    let ray = |&(receiver, light): &(usize, usize)| {
        let (normal, light): (Vec3, Vec3) = (receivers.normals[receiver], lights[light]);
        (normal.dot(light) > 0.0).then_some((receivers.origins[receiver], light))
    };
    let count = receivers.points.len();
    let by_light: Vec<_> = (0..LIGHTS).flat_map(|light| (0..count).map(move |receiver| (receiver, light))).collect();
    let by_receiver: Vec<_> = (0..count).flat_map(|receiver| (0..LIGHTS).map(move |light| (receiver, light))).collect();
    [("by light", by_light), ("by receiver", by_receiver)]
        .map(|(name, order)| (name, order.iter().filter_map(ray).collect()))
}

/// See `solver/benches/embree.py`.
fn dump(mesh: &Mesh, rays: &[ShadowRay], blocked: &[bool]) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend((mesh.triangle_count() as u32).to_le_bytes());
    out.extend((rays.len() as u32).to_le_bytes());
    let mut add = |p: Vec3| out.extend(p.to_array().into_iter().flat_map(f32::to_le_bytes));
    mesh.corners.iter().flatten().for_each(|corner| add(*corner));
    rays.iter().for_each(|(origin, direction)| [origin, direction].into_iter().for_each(|p| add(*p)));
    out.extend(blocked.iter().map(|blocked| u8::from(*blocked)));
    out
}

/// Rays a second, and the share of equal answers.
fn embree(python: &Path, file: &Path) -> Result<(f64, f64), Box<dyn Error>> {
    let output = Command::new(python).arg("solver/benches/embree.py").arg(file).output()?;
    if !output.status.success() {
        return Err(format!("{}: {}", python.display(), String::from_utf8_lossy(&output.stderr)).into());
    }
    let answer = String::from_utf8(output.stdout)?;
    let numbers: Vec<f64> = answer.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    let &[rays, seconds, same] = numbers.as_slice() else { return Err(format!("'{answer}'").into()) };
    Ok((rays / seconds, same / rays))
}
