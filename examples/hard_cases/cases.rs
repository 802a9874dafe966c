//! The cases: a knot over a ground, and what is done to it.

use crate::scenes::{self, Triangles, cuboid, knot, mapped, quad, soup};
use glam::DVec3;
use shadowfit_solver::{
    mesh::{Sides, Soup},
    sampling::uniform,
};

/// The knot, its middle 2 m above the ground.
fn body() -> Triangles {
    knot(64, 10)
}

fn ground() -> Triangles {
    quad(DVec3::new(-5.0, -2.0, -5.0), DVec3::Z * 10.0, DVec3::X * 10.0)
}

/// What the other cases are compared with.
pub fn plain() -> Soup {
    with(&[])
}

/// The plain scene and single-sided parts.
fn with(parts: &[Triangles]) -> Soup {
    let (body, ground) = (body(), ground());
    let all: Vec<(&Triangles, Sides)> =
        [&body, &ground].into_iter().chain(parts).map(|part| (part, Sides::Front)).collect();
    soup(&all)
}

fn inside_out(triangles: &Triangles) -> Triangles {
    triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
}

/// A name, what it attacks, and the scene.
pub struct Case {
    pub name: &'static str,
    pub attacks: &'static str,
    pub soup: Soup,
}

fn case(name: &'static str, attacks: &'static str, soup: Soup) -> Case {
    Case { name, attacks, soup }
}

/// The plain scene mapped; turned inside out where the map mirrors.
fn placed(map: impl Fn(DVec3) -> DVec3) -> Soup {
    let mut soup = plain();
    let [x, y, z] = DVec3::AXES.map(|axis| map(axis) - map(DVec3::ZERO));
    let mirrors = x.cross(y).dot(z) < 0.0;
    for corners in &mut soup.corners_model {
        *corners = corners.map(&map);
        if mirrors {
            corners.swap(1, 2);
        }
    }
    soup
}

/// Every triangle shrunk towards its middle by this share.
fn cracked(share: f64) -> Soup {
    let mut soup = plain();
    for corners in &mut soup.corners_model {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        *corners = corners.map(|p| p.lerp(middle, share));
    }
    soup
}

/// Upright wires of so many metres around the knot; a texel of it is about 0.05 m.
fn wires(thickness: f64) -> Triangles {
    let wire = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / 16.0).sin_cos();
        let half = DVec3::new(0.5 * thickness, 1.8, 0.5 * thickness);
        cuboid(DVec3::new(4.0 * cos, -0.2, 4.0 * sin), half, 1)
    };
    (0..16).flat_map(wire).collect()
}

/// Triangles anywhere in a ball, edges shared by any number of them or none.
pub fn random_soup(count: u64) -> Soup {
    let point = |i: u64| scenes::unit_vector(91, i).as_dvec3() * uniform(92, i).cbrt();
    let around = |i: u64| [0, 1, 2].map(|k| point(i) + 0.25 * scenes::unit_vector(93, 3 * i + k).as_dvec3());
    let mut triangles: Triangles = (0..count).map(around).collect();
    // Fans: three and more triangles on one edge.
    for i in 0..count / 4 {
        let [a, b, _] = triangles[i as usize];
        triangles.push([a, b, point(i + 7)]);
    }
    soup(&[(&triangles, Sides::Both)])
}

pub fn one_triangle() -> Soup {
    soup(&[(&vec![[DVec3::ZERO, DVec3::X, DVec3::Y]], Sides::Both)])
}

/// A ground under a roof that is drawn from below only: from above, all that is drawn is in shadow.
pub fn all_in_shadow() -> Soup {
    let ground = quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0);
    let roof = inside_out(&quad(DVec3::new(-3.0, 1.0, -3.0), DVec3::Z * 6.0, DVec3::X * 6.0));
    soup(&[(&ground, Sides::Front), (&roof, Sides::Front)])
}

/// Cases that should leave the error of the plain scene about as it is.
pub fn like_plain() -> Vec<Case> {
    let overlay = quad(DVec3::new(-3.0, -2.0, -2.0), DVec3::new(1.0, 0.0, 5.0), DVec3::new(4.0, 0.0, -0.5));
    let thinner = mapped(&body(), |p| {
        let t = (0..192).map(|i| f64::from(i) / 192.0).map(scenes::knot_centre);
        let near = t.min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p)));
        p.lerp(near.expect("the knot has a centre line"), 0.4)
    });
    let skin = mapped(&body(), |p| p * (1.0 + 1e-6));
    vec![
        case("co-planar plates", "rays that start on a second surface", with(&[overlay])),
        case("doubled shell", "the same surface inside out", with(&[inside_out(&body())])),
        case("second skin", "a copy 1e-6 of the size outside", with(&[skin])),
        case("cracks", "gaps of 1e-4 of an edge between all triangles", cracked(1e-4)),
        case("interior", "a hidden tube inside the knot", with(&[thinner])),
        case("wires", "16 wires of 5 mm, a tenth of a texel", with(&[wires(0.005)])),
        case("huge", "coordinates times 1e6", placed(|p| p * 1e6)),
        case("small", "coordinates times 1e-6", placed(|p| p * 1e-6)),
        case("offset", "1e5 m away", placed(|p| p + DVec3::new(1e5, -1e5, 1e5))),
        case("mirrored", "x mirrored", placed(|p| DVec3::new(-p.x, p.y, p.z))),
    ]
}
