//! Technique: a perspective shadow map (M. Stamminger, G. Drettakis, "Perspective Shadow Maps", 2002; S. Kozlov,
//! "Perspective Shadow Maps: Care and Feeding", 2004), in its light-space variant (M. Wimmer, D. Scherzer, W. Purgathofer,
//! "Light Space Perspective Shadow Maps", 2004): a [`ShadowMap`] whose matrix is warped so that what is near the camera
//! gets more texels.
//!
//! The warp is a perspective projection whose rays lie in the light's plane, along the camera's view: the light's rays stay
//! parallel, so no caster lies behind a point at infinity, as it may in the original. It is fitted to the *body*: what the
//! camera sees of each instance's box, ground included, where the light finds casters before or behind it. Its centre lies
//! n = (z_n + sqrt(z_n z_f)) / sin(gamma) before the body, z_n and z_f the body's nearest and farthest depth in the view,
//! gamma the angle between the view and the light. As the light comes to face the viewer or to stand behind them, n grows
//! without bound and the map becomes the plain one: there is nothing left to gain.
//!
//! On the field of 200 instances the wrong share of the covered pixels at 1024 texels falls to 0.66 of the shadow map's
//! under light from above and to 0.73 from the side; under light within three degrees of facing the viewer it is 1.11, and
//! 1.07 from behind them: what is left is how the texels happen to lie.
//!
//! The bias is that of the shadow map, for the slopes in the warped space. A point light has the shadow map's six faces.
//! Not guaranteed: still shadow borders; they crawl as the camera moves.

use super::{
    Camera, FrameRequest, Light, RenderError,
    light_view::{BULGE, axes, extremes, parallel, views},
    shadow_map::{ShadowMap, ShadowMapOptions},
    stage::{Placement, Stage, Targets},
    technique::{Cost, Technique},
};
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3};

/// The smallest sine of the angle between view and light that counts. There the centre of projection is a thousand depths
/// of the body away and the texels' density varies by a thousandth: no gain, while the direction of the view across the
/// light is still far from f32's rounding, 1e-7.
const LEAST_SINE: f64 = 1e-3;

/// Draws the model with a perspective shadow map.
#[derive(Debug)]
pub struct PerspectiveShadowMap {
    map: ShadowMap,
}

impl PerspectiveShadowMap {
    /// For frames of `stage`.
    ///
    /// # Errors
    /// A size beyond the adapter's limits.
    pub fn new(stage: &Stage, options: ShadowMapOptions) -> Result<Self, RenderError> {
        Ok(Self { map: ShadowMap::new(stage, options)? })
    }
}

impl Technique for PerspectiveShadowMap {
    fn name(&self) -> String {
        format!("perspective {}", self.map.name())
    }

    fn depends_on_camera(&self) -> bool {
        true
    }

    fn update(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        let extent @ (size_texels, reach_texels) = self.map.extent_texels();
        let room = reach_texels / size_texels as f32;
        let seen = (&request.camera, request.options.size_px);
        let views = match request.light {
            Light::Directional { to_light } => {
                vec![warped(stage, -to_light, seen, room).unwrap_or_else(|| parallel(extremes(stage), -to_light, room))]
            }
            Light::Point { .. } => views(stage, &request.light, extent),
        };
        self.map.redraw(stage, &views, encoder);
        Ok(())
    }

    fn draw(
        &mut self,
        stage: &Stage,
        request: &FrameRequest,
        targets: &Targets,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        self.map.draw(stage, request, targets, encoder)
    }

    fn cost(&self, stage: &Stage) -> Cost {
        let on_light_change = "all casters drawn into the map again, for a new camera too".to_string();
        Cost { on_light_change, ..self.map.cost(stage) }
    }
}

/// Clip space from world space for a light along `forward`, warped for the camera; `None` where the camera sees nothing that
/// a shadow could fall on.
fn warped(stage: &Stage, forward: Vec3, (camera, size_px): (&Camera, [u32; 2]), room: f32) -> Option<Mat4> {
    let light = LightSpace::new(forward, camera);
    let (low, high) = light.bounds(extremes(stage));
    let clip_from_light = camera.clip_from_world(size_px).as_dmat4() * light.from_world.inverse();
    let body = body(stage, &light, (low, high), &clip_from_light);
    let (near, far) = range(body.iter().map(|p| (clip_from_light * p.extend(1.0)).w))?;
    let (y_near, _) = range(body.iter().map(|p| p.y))?;
    let n = (near + (near * far).sqrt()) / light.sine.max(LEAST_SINE);
    // x / q, -n / q and z / q, where q is the distance from the centre of projection along y, of n.
    let q = DVec4::new(0.0, 1.0, 0.0, n - y_near) / n;
    let fit = |row: DVec4| {
        let (low, high) = range(body.iter().map(|p| row.dot(p.extend(1.0)) / q.dot(p.extend(1.0))))?;
        let half = 0.5 * (high - low).max(1e-6) * f64::from(1.0 + 2.0 * room);
        Some((row - 0.5 * (low + high) * q) / half)
    };
    let (x, y) = (fit(DVec4::new(1.0, 0.0, 0.0, -light.eye.x))?, fit(DVec4::new(0.0, 0.0, 0.0, -n))?);
    let z = DVec4::new(0.0, 0.0, 1.0, -low.z) / (high.z - low.z);
    let clip_from_light = DMat4::from_cols(x, y, z, q).transpose();
    Some((clip_from_light * light.from_world).as_mat4())
}

/// Points, in light space, whose hull holds all that the camera sees within the columns of the light's rays that cross the
/// casters' box.
fn body(stage: &Stage, light: &LightSpace, (low, high): (DVec3, DVec3), clip_from_light: &DMat4) -> Vec<DVec3> {
    let [x, y, z, w] = [0, 1, 2, 3].map(|i| clip_from_light.row(i));
    let [right, up] = [DVec3::X, DVec3::Y].map(|axis| [axis.extend(-axis.dot(low)), (-axis).extend(axis.dot(high))]);
    let planes = [w + x, w - x, w + y, w - y, z, w - z, right[0], right[1], up[0], up[1]];
    let [low, high] = stage.model.bounds.map(|p| p.as_dvec3());
    let corner = |i: usize| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), high, low);
    let of_instance = |placement: &Placement| {
        let light_from_unit = light.from_world * placement.world_from_unit().as_dmat4();
        let corners: [DVec3; 8] = std::array::from_fn(|i| light_from_unit.transform_point3(corner(i)));
        let faces = FACES.iter().map(|face| face.map(|i| corners[i]).to_vec()).collect();
        planes.iter().fold(faces, |faces, &plane| cut(faces, plane)).into_iter().flatten()
    };
    stage.placements().iter().flat_map(of_instance).collect()
}

/// World space turned: z along the light, y along what is left of the view, all with the world's origin.
struct LightSpace {
    from_world: DMat4,
    eye: DVec3,
    /// Of the angle between view and light.
    sine: f64,
}

impl LightSpace {
    fn new(forward: Vec3, camera: &Camera) -> Self {
        let (z, view) = (forward.as_dvec3().normalize(), camera.forward().as_dvec3());
        let across = view - z * view.dot(z);
        let y = if across.length() > LEAST_SINE { across.normalize() } else { axes(forward).1.as_dvec3() };
        let x = y.cross(z).normalize();
        let from_world = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec4::W).transpose();
        Self { from_world, eye: from_world.transform_point3(camera.eye().as_dvec3()), sine: across.length() }
    }

    /// The box around points and what bulges between them.
    fn bounds(&self, points: impl Iterator<Item = Vec3>) -> (DVec3, DVec3) {
        let seen = points.map(|p| self.from_world.transform_point3(p.as_dvec3()));
        let (low, high) = seen.fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)));
        let bulge = 0.5 * f64::from(BULGE) * (high - low).max(DVec3::splat(1e-6));
        (low - bulge, high + bulge)
    }
}

/// Corners around each face of a box; bit i of a corner's number says which end of axis i it is at.
const FACES: [[usize; 4]; 6] = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// The faces of the part of a convex solid where `plane` (dot with (p, 1)) is not negative.
fn cut(faces: Vec<Vec<DVec3>>, plane: DVec4) -> Vec<Vec<DVec3>> {
    let height = |p: DVec3| plane.dot(p.extend(1.0));
    if faces.iter().flatten().all(|&p| height(p) >= 0.0) {
        return faces;
    }
    let mut cap = Vec::new();
    let mut kept: Vec<_> = faces.iter().map(|face| cut_face(face, height, &mut cap)).collect();
    // The new face: its corners in turn around their middle.
    let middle = cap.iter().sum::<DVec3>() / cap.len().max(1) as f64;
    let (u, v) = plane.truncate().normalize_or(DVec3::Z).any_orthonormal_pair();
    let angle = |p: &DVec3| (*p - middle).dot(v).atan2((*p - middle).dot(u));
    cap.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    kept.push(cap);
    kept.retain(|face| face.len() > 2);
    kept
}

/// A convex polygon where `height` is not negative (I. Sutherland, G. Hodgman, "Reentrant Polygon Clipping", 1974); the
/// points at which it was cut are added to `cap`.
fn cut_face(polygon: &[DVec3], height: impl Fn(DVec3) -> f64, cap: &mut Vec<DVec3>) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let next = polygon[(i + 1) % polygon.len()];
        let (at_p, at_next) = (height(p), height(next));
        if at_p >= 0.0 {
            out.push(p);
        }
        if (at_p < 0.0) != (at_next < 0.0) {
            let between = p + (next - p) * (at_p / (at_p - at_next));
            out.push(between);
            cap.push(between);
        }
    }
    out
}

/// The least and the greatest of some numbers.
fn range(numbers: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    numbers.map(|x| (x, x)).reduce(|(low, high), (x, _)| (low.min(x), high.max(x)))
}
