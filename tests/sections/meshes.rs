//! Meshes of the kinds that glTF has, valid ones.

use crate::build::{BYTE, FLOAT, Model, SHORT, UBYTE, USHORT};
use serde_json::{Value, json};

/// Cells along a side of the grid.
pub const CELLS: usize = 6;

/// Vertices of the grid.
pub const VERTICES: usize = (CELLS + 1) * (CELLS + 1);

/// A hilly grid, its vertices row by row.
pub fn hills() -> Vec<[f32; 3]> {
    let height = |x: usize, z: usize| 0.1 * ((3 * x + 5 * z) % 7) as f32;
    (0..VERTICES).map(|i| (i % (CELLS + 1), i / (CELLS + 1))).map(|(x, z)| [x as f32, height(x, z), z as f32]).collect()
}

/// Two triangles a cell.
pub fn triangles() -> Vec<u16> {
    let corner = |x: usize, z: usize| (z * (CELLS + 1) + x) as u16;
    let cell = |i: usize| {
        let (x, z) = (i % CELLS, i / CELLS);
        let [a, b, c, d] = [corner(x, z), corner(x, z + 1), corner(x + 1, z), corner(x + 1, z + 1)];
        [a, b, c, c, b, d]
    };
    (0..CELLS * CELLS).flat_map(cell).collect()
}

/// Adds `min` and `max` to an accessor of three components.
pub fn bounded(model: &mut Model, accessor: usize, values: &[[f64; 3]]) -> usize {
    let of = |fold: fn(f64, f64) -> f64| [0, 1, 2].map(|c| values.iter().map(|v| v[c]).reduce(fold).unwrap());
    let is_float = model.json["accessors"][accessor]["componentType"] == json!(FLOAT);
    let spelled = |values: [f64; 3]| values.map(|x| if is_float { json!(x) } else { json!(x as i64) });
    model.json["accessors"][accessor]["min"] = json!(spelled(of(f64::min)));
    model.json["accessors"][accessor]["max"] = json!(spelled(of(f64::max)));
    accessor
}

/// An accessor of points in a view for vertices.
pub fn points(model: &mut Model, values: &[[f32; 3]]) -> usize {
    let accessor = model.floats("VEC3", values.as_flattened());
    bounded(model, accessor, &values.iter().map(|v| v.map(f64::from)).collect::<Vec<_>>())
}

/// An indexed grid with normals, colours of normalised bytes and a number of the application; drawn by node 0.
pub fn grid() -> Model {
    let mut model = Model::empty();
    let position = points(&mut model, &hills());
    let normals: Vec<f32> = (0..VERTICES)
        .flat_map(|i| glam::Vec3::new((i as f32).sin(), 3.0, (i as f32).cos()).normalize().to_array())
        .collect();
    let normal = model.floats("VEC3", &normals);
    let colours: Vec<u8> = (0..4 * VERTICES).map(|i| (i * 7 % 256) as u8).collect();
    let colour = model.accessor(UBYTE, "VEC4", VERTICES, &colours);
    model.json["accessors"][colour]["normalized"] = json!(true);
    let number = model.floats("SCALAR", &(0..VERTICES).map(|i| i as f32).collect::<Vec<_>>());
    model.mesh(json!({"POSITION": position, "NORMAL": normal, "COLOR_0": colour, "_NUMBER": number}));
    let triangles = triangles();
    let indices = model.shorts(USHORT, "SCALAR", triangles.len(), &triangles);
    model.primitive()["indices"] = json!(indices);
    model.push("nodes", json!({"mesh": 0}));
    scene(&mut model);
    model
}

/// A scene of all nodes that are there.
pub fn scene(model: &mut Model) {
    let count = model.json["nodes"].as_array().unwrap().len();
    model.json["scenes"] = json!([{"nodes": (0..count).collect::<Vec<_>>()}]);
    model.json["scene"] = json!(0);
}

/// A wavy band of so many vertices as a strip (5) or fan (6), indexed or not.
pub fn band(mode: u32, vertices: usize, indexed: bool) -> Model {
    let mut model = Model::empty();
    let point = |i: usize| {
        let angle = i as f32 * 0.37;
        if mode == 6 { [angle.cos(), 0.3 * angle.sin(), angle.sin()] } else { [i as f32, (i % 2) as f32, angle.sin()] }
    };
    let position = points(&mut model, &(0..vertices).map(point).collect::<Vec<_>>());
    model.mesh(json!({"POSITION": position}));
    model.primitive()["mode"] = json!(mode);
    if indexed {
        let order: Vec<u8> = (0..vertices as u8).rev().collect();
        let indices = model.accessor(UBYTE, "SCALAR", vertices, &order);
        model.primitive()["indices"] = json!(indices);
    }
    model.push("nodes", json!({"mesh": 0}));
    scene(&mut model);
    model
}

/// Loose triangles.
pub fn loose(count: usize) -> Model {
    let mut model = Model::empty();
    let values: Vec<[f32; 3]> =
        (0..3 * count).map(|i| [(i / 3) as f32, (i % 3 % 2) as f32, (i % 3 / 2) as f32]).collect();
    let position = points(&mut model, &values);
    model.mesh(json!({"POSITION": position}));
    model.push("nodes", json!({"mesh": 0}));
    scene(&mut model);
    model
}

/// The grid's upper and lower half as two primitives that share all vertices.
pub fn halves() -> Model {
    let mut model = grid();
    let triangles = triangles();
    let (first, second) = triangles.split_at(triangles.len() / 2);
    let [first, second] = [first, second].map(|half| model.shorts(USHORT, "SCALAR", half.len(), half));
    let mut lower = model.primitive().clone();
    lower["indices"] = json!(second);
    model.primitive()["indices"] = json!(first);
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(lower);
    model
}

/// The grid with two morph targets: full positions, and sparse ones over nothing.
pub fn morphed() -> Model {
    let mut model = grid();
    let up: Vec<[f32; 3]> = (0..VERTICES).map(|i| [0.0, i as f32 * 0.01, 0.0]).collect();
    let up = points(&mut model, &up);
    let sparse = sparse(&mut model, &[3, 17, 30], &[[1.0, 0.5, 0.0], [0.0, 0.25, 0.0], [-1.0, 0.0, 2.0]]);
    let over_zeros = model.push(
        "accessors",
        json!({"componentType": FLOAT, "type": "VEC3", "count": VERTICES, "sparse": sparse, "min": [-1.0, 0.0, 0.0],
            "max": [1.0, 0.5, 2.0]}),
    );
    model.primitive()["targets"] = json!([{"POSITION": up}, {"POSITION": over_zeros}]);
    model.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    model
}

/// Sparse positions over the grid's own.
pub fn moved() -> Model {
    let mut model = grid();
    let values = [[0.5, 2.0, 0.5], [3.0, 4.0, 3.5]];
    let sparse = sparse(&mut model, &[9, 24], &values);
    let mut points: Vec<[f64; 3]> = hills().iter().map(|p| p.map(f64::from)).collect();
    for (at, value) in [9, 24].into_iter().zip(values) {
        points[at] = value.map(f64::from);
    }
    model.json["accessors"][0]["sparse"] = sparse;
    bounded(&mut model, 0, &points);
    model
}

fn sparse(model: &mut Model, at: &[u16], values: &[[f32; 3]]) -> Value {
    let indices = model.view(bytemuck::cast_slice(at));
    let view = model.view(bytemuck::cast_slice(values.as_flattened()));
    json!({"count": at.len(), "indices": {"bufferView": indices, "componentType": USHORT},
        "values": {"bufferView": view}})
}

/// The grid with 16-bit positions and 8-bit normals, each padded to four bytes, in one view a kind.
pub fn quantised() -> Model {
    let mut model = Model::empty();
    let positions: Vec<[i16; 3]> = hills().iter().map(|p| p.map(|x| (x * 1000.0) as i16 - 3000)).collect();
    let padded: Vec<i16> = positions.iter().flat_map(|p| [p[0], p[1], p[2], 77]).collect();
    let position = model.accessor(SHORT, "VEC3", VERTICES, bytemuck::cast_slice(&padded));
    bounded(&mut model, position, &positions.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>());
    let normals: Vec<i8> = (0..VERTICES).flat_map(|i| [(i % 5) as i8, 127, -(i as i8 % 9), 55]).collect();
    let normal = model.accessor(BYTE, "VEC3", VERTICES, bytemuck::cast_slice(&normals));
    model.json["accessors"][normal]["normalized"] = json!(true);
    model.json["accessors"][position]["normalized"] = json!(true);
    for (accessor, stride) in [(position, 8), (normal, 4)] {
        let view = model.json["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        model.json["bufferViews"][view]["byteStride"] = json!(stride);
    }
    model.mesh(json!({"POSITION": position, "NORMAL": normal}));
    let triangles = triangles();
    let indices = model.shorts(USHORT, "SCALAR", triangles.len(), &triangles);
    model.primitive()["indices"] = json!(indices);
    model.push("nodes", json!({"mesh": 0, "scale": [30, 30, 30]}));
    scene(&mut model);
    model.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    model
}

/// The grid three times: at two nodes, one of them mirrored, and two copies at a third.
pub fn copies() -> Model {
    let mut model = grid();
    model.push("nodes", json!({"mesh": 0, "scale": [-1, 1, 1]}));
    let at = model.floats("VEC3", &[0.0, 5.0, 0.0, 0.0, 9.0, 0.0]);
    let attributes = json!({"TRANSLATION": at});
    let extension = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    model.push("nodes", json!({"mesh": 0, "extensions": extension}));
    model.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    scene(&mut model);
    model
}

/// The grid on two joints.
pub fn skinned() -> Model {
    let mut model = grid();
    let joints: Vec<u8> = (0..VERTICES).flat_map(|i| [(i % 2) as u8, 0, 0, 0]).collect();
    let weights: Vec<f32> = (0..VERTICES).flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
    let joints = model.accessor(UBYTE, "VEC4", VERTICES, &joints);
    let weights = model.floats("VEC4", &weights);
    model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    model.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    model.json["skins"] = json!([{"joints": [1, 2]}]);
    model.json["nodes"] = json!([{"mesh": 0, "skin": 0}, {"translation": [0, 1, 0], "children": [2]},
        {"rotation": [0, 0.6, 0, 0.8]}]);
    model.json["scenes"] = json!([{"nodes": [0, 1]}]);
    model
}
