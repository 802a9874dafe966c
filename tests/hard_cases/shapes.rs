//! Triangles to build hard cases from, written as GLB and fitted.

use crate::{
    build::{self, Model},
    fits,
};
use glam::DVec3;
use serde_json::{Value, json};
use shadowfit::{asset::ShadowSet, effort::Effort, pipeline::FitError, report::Report, scene};
use shadowfit_solver::lights::LightDomain;
use std::fs;

pub type Triangles = Vec<[DVec3; 3]>;

/// A scene in the making.
#[derive(Clone)]
pub struct Case {
    pub triangles: Triangles,
    pub double_sided: bool,
    /// Members of the node that draws it: `translation`, `scale`, ...
    pub node: Value,
    pub lights: LightDomain,
    pub max_planes: Option<usize>,
    /// `--planes`: the text of the file.
    pub planes: Option<String>,
    pub effort: Effort,
}

impl Case {
    pub fn new(triangles: Triangles) -> Self {
        let node = json!({});
        let (lights, effort) = (LightDomain::Sphere, fits::least());
        Self { triangles, double_sided: false, node, lights, max_planes: None, planes: None, effort }
    }

    pub fn double_sided(self) -> Self {
        Self { double_sided: true, ..self }
    }

    /// The GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut model = Model::empty();
        let points = self.triangles.as_flattened();
        let floats: Vec<f32> = points.iter().flat_map(|p| p.as_vec3().to_array()).collect();
        let position = model.floats("VEC3", &floats);
        let (low, high) = points.iter().fold((glam::Vec3::INFINITY, glam::Vec3::NEG_INFINITY), |(low, high), p| {
            (low.min(p.as_vec3()), high.max(p.as_vec3()))
        });
        model.json["accessors"][position]["min"] = json!(low.to_array());
        model.json["accessors"][position]["max"] = json!(high.to_array());
        model.mesh(json!({"POSITION": position}));
        let material = model.push("materials", json!({"doubleSided": self.double_sided}));
        model.primitive()["material"] = json!(material);
        let mut node = self.node.clone();
        node["mesh"] = json!(0);
        model.push("nodes", node);
        model.json["scene"] = json!(0);
        model.push("scenes", json!({"nodes": [0]}));
        model.glb()
    }

    pub fn try_fit(&self) -> Result<(Report, ShadowSet), FitError> {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("case.glb");
        fs::write(&input, self.glb()).unwrap();
        let mut request = fits::request(&input, &folder.path().join("out"), self.effort);
        (request.domain, request.max_planes) = (self.lights, self.max_planes);
        request.planes = self.planes.as_ref().map(|text| {
            let path = folder.path().join("planes.json");
            fs::write(&path, text).unwrap();
            path
        });
        fits::fit(&request)
    }

    #[track_caller]
    pub fn fit(&self) -> (Report, ShadowSet) {
        self.try_fit().unwrap_or_else(|error| panic!("{error}"))
    }

    /// The fit must be refused; the exit code and the message.
    #[track_caller]
    pub fn refusal(&self) -> (u8, String) {
        match self.try_fit() {
            Ok((report, _)) => panic!("was fitted: {report}"),
            Err(error) => (error.exit_code(), error.to_string()),
        }
    }
}

/// The triangles of a model of the repository.
pub fn triangles_of(name: &str) -> Triangles {
    scene::load(&fits::model(name)).unwrap().soup.corners_model
}

pub fn moved(triangles: &Triangles, to: impl Fn(DVec3) -> DVec3) -> Triangles {
    triangles.iter().map(|corners| corners.map(&to)).collect()
}

/// The same surface seen from its other side.
pub fn reversed(triangles: &Triangles) -> Triangles {
    triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
}

/// A horizontal square around (0, `height`, 0) that faces up.
pub fn square(half: f64, height: f64) -> Triangles {
    let corner = |x: f64, z: f64| DVec3::new(half * x, height, half * z);
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    vec![[a, b, c], [a, c, d]]
}

/// A GLB without any triangle: only nodes.
pub fn empty() -> Vec<u8> {
    let mut model = build::Model::empty();
    model.push("nodes", json!({"name": "nothing"}));
    model.glb()
}
