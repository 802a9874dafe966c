//! A model as binary glTF: one mesh with positions and indices only.

use crate::model::Model;

/// The file's bytes (Khronos, "glTF 2.0 Specification", 2021, section 4.4).
pub fn glb(model: &Model) -> Vec<u8> {
    let (vertices, indices) = (model.positions.len(), 3 * model.triangles.len());
    let (low, high) = model.positions.iter().fold(([f32::MAX; 3], [f32::MIN; 3]), |(low, high), p| {
        (std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k])))
    });
    let (points_bytes, bytes) = (12 * vertices, 12 * vertices + 4 * indices);
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":{low:?},"max":{high:?}}},{{"bufferView":1,"componentType":5125,"count":{indices},"type":"SCALAR"}}],"bufferViews":[{{"buffer":0,"byteLength":{points_bytes}}},{{"buffer":0,"byteOffset":{points_bytes},"byteLength":{}}}],"buffers":[{{"byteLength":{bytes}}}]}}"#,
        4 * indices
    );
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
    let mut out = Vec::with_capacity(28 + json.len() + bytes);
    let word = |value: u32| value.to_le_bytes();
    out.extend(b"glTF");
    out.extend(word(2));
    out.extend(word((28 + json.len() + bytes) as u32));
    out.extend(word(json.len() as u32));
    out.extend(b"JSON");
    out.extend(json.as_bytes());
    out.extend(word(bytes as u32));
    out.extend(b"BIN\0");
    out.extend(model.positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    out.extend(model.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
    out
}
