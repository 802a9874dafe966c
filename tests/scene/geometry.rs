//! Triangles, transforms and attributes of valid files, against numbers worked out by hand.

use super::build::{BYTE, FLOAT, Model, SHORT, UBYTE, UINT, USHORT, skipped};
use glam::{DVec3, Vec3, dvec3, vec3};
use serde_json::json;
use shadowfit::scene::Scene;
use shadowfit_solver::mesh::Mesh;

fn corners(scene: &Scene) -> &[[DVec3; 3]] {
    &scene.soup.corners_model
}

fn close(a: DVec3, b: DVec3) {
    assert!(a.distance(b) < 1e-6, "{a} is not {b}");
}

/// A square of four vertices: (0,0), (1,0), (0,1), (1,1).
fn square(mode: u32) -> Model {
    let mut model = Model::empty();
    let position = model.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]);
    model.mesh(json!({"POSITION": position}));
    model.primitive()["mode"] = json!(mode);
    model.push("nodes", json!({"mesh": 0}));
    model
}

#[test]
fn a_triangle_has_all_its_entries() {
    let scene = Model::triangle().scene();
    assert_eq!(corners(&scene), [[DVec3::ZERO, DVec3::X, DVec3::Y]]);
    assert_eq!(scene.normals, [[Vec3::Z; 3]]);
    assert_eq!(scene.uvs.len(), 1);
    assert_eq!(scene.material_of, [0]);
    assert_eq!(scene.materials[0].base_color, [1.0; 4]);
    assert_eq!((scene.soup.sides.len(), scene.soup.cutout.len(), scene.soup.cutout_uv.len()), (1, 1, 1));
    assert!(scene.skipped.is_empty(), "{:?}", scene.skipped);
    assert_eq!(Mesh::new(&scene.soup).unwrap().triangle_count(), 1);
}

#[test]
fn strips_and_fans_keep_the_winding() {
    let [o, x, y, xy] = [DVec3::ZERO, DVec3::X, DVec3::Y, dvec3(1.0, 1.0, 0.0)];
    assert_eq!(corners(&square(5).scene()), [[o, x, y], [x, xy, y]]);
    assert_eq!(corners(&square(6).scene()), [[x, y, o], [y, xy, o]]);
    let scene = square(5).scene();
    assert_eq!(scene.normals, [[Vec3::Z; 3]; 2]);
}

#[test]
fn indices_of_every_width() {
    let wanted = [[DVec3::ZERO, DVec3::X, DVec3::Y], [DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y]];
    let indices = [0_u32, 1, 2, 1, 3, 2];
    for component in [UBYTE, USHORT, UINT] {
        let mut model = square(4);
        let bytes: Vec<u8> = match component {
            UBYTE => indices.iter().map(|i| *i as u8).collect(),
            USHORT => indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|i| i.to_le_bytes()).collect(),
        };
        let accessor = model.accessor(component, "SCALAR", 6, &bytes);
        model.primitive()["indices"] = json!(accessor);
        assert_eq!(corners(&model.scene()), wanted, "component {component}");
    }
}

#[test]
fn points_lines_and_small_primitives_are_counted() {
    let mut model = square(4);
    for mode in [0, 1, 2, 3] {
        model.json["meshes"][0]["primitives"]
            .as_array_mut()
            .unwrap()
            .push(json!({"attributes": {"POSITION": 0}, "mode": mode}));
    }
    let two = model.floats("VEC3", &[0.0; 6]);
    for mode in [4, 5, 6] {
        let primitive = json!({"attributes": {"POSITION": two}, "mode": mode});
        model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({"attributes": {}}));
    let scene = model.scene();
    assert_eq!(corners(&scene).len(), 1);
    assert_eq!(skipped(&scene, "points"), 1);
    assert_eq!(skipped(&scene, "lines"), 3);
    assert_eq!(skipped(&scene, "primitives with less than three corners"), 3);
    assert_eq!(skipped(&scene, "primitives without POSITION"), 1);
    assert_eq!(skipped(&scene, "incomplete triangles"), 1);
}

#[test]
fn transforms_compose_in_f64() {
    let mut model = Model::triangle();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Ten million metres away plus a tenth: f32 would lose the tenth.
    model.json["nodes"] = json!([
        {"children": [1], "translation": [10_000_000.1, 0, 0]},
        {"children": [2], "rotation": [0, 0, half, half]},
        {"mesh": 0, "matrix": [2,0,0,0, 0,2,0,0, 0,0,2,0, 1,0,0,1]}
    ]);
    let scene = model.scene();
    let [a, b, c] = corners(&scene)[0];
    let far = dvec3(10_000_000.1, 0.0, 0.0);
    close(a - far, dvec3(0.0, 1.0, 0.0));
    close(b - far, dvec3(0.0, 3.0, 0.0));
    close(c - far, dvec3(-2.0, 1.0, 0.0));
}

#[test]
fn a_mirror_flips_the_winding_and_keeps_the_normal_outside() {
    let mut model = Model::triangle();
    let normal = model.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    model.primitive()["attributes"]["NORMAL"] = json!(normal);
    model.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let scene = model.scene();
    assert_eq!(corners(&scene), [[DVec3::ZERO, DVec3::Y, -DVec3::X]]);
    assert_eq!(scene.normals, [[Vec3::Z; 3]]);
    let [a, b, c] = corners(&scene)[0];
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn normals_follow_the_inverse_transpose() {
    let mut model = Model::triangle();
    // The third normal has no length: the geometric one stands in.
    let normal = model.floats("VEC3", &[1., 1., 0., 0., 2., 0., 0., 0., 0.]);
    model.primitive()["attributes"]["NORMAL"] = json!(normal);
    model.json["nodes"][0]["scale"] = json!([2, 1, 1]);
    let normals = model.scene().normals[0];
    assert!(normals[0].distance(vec3(0.5, 1.0, 0.0).normalize()) < 1e-6, "{normals:?}");
    assert_eq!(normals[1], Vec3::Y);
    assert_eq!(normals[2], Vec3::Z);
    // A scale so small that the cofactors would vanish in f64.
    model.json["nodes"][0]["scale"] = json!([1e-170, 1e-170, 1e-170]);
    assert_eq!(model.scene().normals[0][1], Vec3::Y);
}

#[test]
fn quantised_positions() {
    for (component, normalized, wanted) in
        [(SHORT, true, 1.0), (SHORT, false, 32767.0), (USHORT, true, 32767.0 / 65535.0), (USHORT, false, 32767.0)]
    {
        let mut model = Model::empty();
        // Three elements of six bytes in a stride of eight.
        let position = model.shorts(component, "VEC3", 3, &[0, 0, 0, 9, 32767, 0, 0, 9, 0, 32767, 0, 9]);
        model.json["bufferViews"][0]["byteStride"] = json!(8);
        model.json["accessors"][0]["normalized"] = json!(normalized);
        model.mesh(json!({"POSITION": position}));
        model.push("nodes", json!({"mesh": 0}));
        model.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        model.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let scene = model.scene();
        close(corners(&scene)[0][1], wanted * DVec3::X);
        close(corners(&scene)[0][2], wanted * DVec3::Y);
    }
    let mut model = Model::empty();
    let bytes = [-128_i8, 0, 0, 127, 0, 0, 0, -127, 0].map(|x| x as u8);
    let position = model.accessor(BYTE, "VEC3", 3, &bytes);
    model.json["accessors"][0]["normalized"] = json!(true);
    model.mesh(json!({"POSITION": position}));
    model.push("nodes", json!({"mesh": 0}));
    assert_eq!(corners(&model.scene()), [[-DVec3::X, DVec3::X, -DVec3::Y]]);
}

#[test]
fn sparse_accessors_and_accessors_without_a_view() {
    // Zeros, of which elements 1 and 2 are replaced.
    let mut model = Model::triangle();
    let indices = model.view(&[1, 2]);
    let values = model.view(bytemuck::cast_slice(&[3.0_f32, 0., 0., 0., 4., 0.]));
    let sparse = json!({
        "count": 2,
        "indices": {"bufferView": indices, "componentType": UBYTE},
        "values": {"bufferView": values}
    });
    let zeros = json!({"componentType": FLOAT, "type": "VEC3", "count": 3, "sparse": sparse});
    let accessor = model.push("accessors", zeros);
    model.primitive()["attributes"]["POSITION"] = json!(accessor);
    assert_eq!(corners(&model.scene()), [[DVec3::ZERO, 3.0 * DVec3::X, 4.0 * DVec3::Y]]);
    // The same over a view.
    model.json["accessors"][0]["sparse"] = sparse;
    model.json["accessors"][0]["sparse"]["indices"]["byteOffset"] = json!(1);
    model.json["accessors"][0]["sparse"]["values"]["byteOffset"] = json!(12);
    model.json["accessors"][0]["sparse"]["count"] = json!(1);
    model.primitive()["attributes"]["POSITION"] = json!(0);
    assert_eq!(corners(&model.scene()), [[DVec3::ZERO, DVec3::X, 4.0 * DVec3::Y]]);
}

#[test]
fn morph_targets_take_their_default_weights() {
    let mut model = Model::triangle();
    let delta = model.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let normal = model.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let tilt = model.floats("VEC3", &[2., 0., 0., 2., 0., 0., 2., 0., 0.]);
    model.primitive()["attributes"]["NORMAL"] = json!(normal);
    model.primitive()["targets"] = json!([{"POSITION": delta}, {"NORMAL": tilt}]);
    model.json["meshes"][0]["weights"] = json!([0.25, 0.5]);
    let scene = model.scene();
    assert_eq!(corners(&scene)[0][1], dvec3(1.0, 0.0, 0.25));
    assert!(scene.normals[0][0].distance(vec3(1.0, 0.0, 1.0).normalize()) < 1e-6);
    assert_eq!(skipped(&scene, "morph targets"), 1);
    // The node's weights win; missing ones are zero.
    model.json["nodes"][0]["weights"] = json!([2.0]);
    let scene = model.scene();
    assert_eq!(corners(&scene)[0][1], dvec3(1.0, 0.0, 2.0));
    assert_eq!(scene.normals[0][0], Vec3::Z);
}

#[test]
fn a_skin_stands_in_its_static_pose() {
    let mut model = Model::triangle();
    let joints = model.accessor(UBYTE, "VEC4", 3, &[0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0]);
    let weights = model.floats("VEC4", &[1., 0., 0., 0., 0.5, 0.5, 0., 0., 1., 0., 0., 0.]);
    let mut binds = vec![0.0_f32; 32];
    for i in 0..4 {
        (binds[5 * i], binds[16 + 5 * i]) = (1.0, 1.0);
    }
    binds[28] = -1.0;
    let binds = model.floats("MAT4", &binds);
    model.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    model.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    model.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": binds}]);
    model.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 100, 100]},
        {"translation": [0, 0, 2], "children": [2]},
        {"translation": [1, 0, 2]}
    ]);
    let scene = model.scene();
    // Joint 0 moves by z 2; joint 1 by z 4 (x + 1 - 1). The node's own translation does not count.
    assert_eq!(corners(&scene)[0], [dvec3(0., 0., 2.), dvec3(1., 0., 3.), dvec3(0., 1., 4.)]);
    assert_eq!(skipped(&scene, "skin"), 1);
}

#[test]
fn gpu_instances_are_copied() {
    let mut model = Model::triangle();
    let translation = model.floats("VEC3", &[0., 0., 1., 0., 0., 2.]);
    let scale = model.floats("VEC3", &[1., 1., 1., -2., 2., 2.]);
    let attributes = json!({"TRANSLATION": translation, "SCALE": scale});
    model.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    model.json["nodes"][0]["translation"] = json!([5, 0, 0]);
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = model.scene();
    assert_eq!(
        corners(&scene),
        [
            [dvec3(5., 0., 1.), dvec3(6., 0., 1.), dvec3(5., 1., 1.)],
            [dvec3(5., 0., 2.), dvec3(5., 2., 2.), dvec3(3., 0., 2.)]
        ]
    );
}

#[test]
fn scenes_choose_the_roots() {
    let mut model = Model::triangle();
    model.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}, {"children": [1]}]);
    // Without scenes: every node without a parent.
    assert_eq!(corners(&model.scene()).len(), 2);
    model.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [2]}, {}]);
    assert_eq!(corners(&model.scene())[0][0], DVec3::ZERO);
    model.json["scene"] = json!(1);
    let scene = model.scene();
    assert_eq!(corners(&scene)[0][0], DVec3::Z);
    assert_eq!(skipped(&scene, "other scenes"), 2);
    // An empty scene is legal, but shows nothing.
    model.json["scene"] = json!(2);
    assert!(model.load().unwrap_err().to_string().contains("no triangles"));
}

#[test]
fn a_chain_of_nodes_needs_no_stack() {
    let mut model = Model::triangle();
    let n = 50_000;
    let mut nodes: Vec<_> = (0..n).map(|i| json!({"children": [i + 1], "translation": [0, 0, 1]})).collect();
    nodes.push(json!({"mesh": 0}));
    model.json["nodes"] = json!(nodes);
    assert_eq!(corners(&model.scene())[0][0].z, f64::from(n));
}

#[test]
fn animations_and_unknown_extensions_are_counted() {
    let mut model = Model::triangle();
    model.json["animations"] = json!([{"channels": "nonsense"}, {}]);
    model.json["extensionsUsed"] = json!(["VENDOR_thing", "KHR_materials_ior", "SHADOWFIT_node_shadow_planes"]);
    model.json["extensionsRequired"] = json!(["KHR_materials_ior", "KHR_lights_punctual"]);
    let scene = model.scene();
    assert_eq!(skipped(&scene, "animations"), 2);
    assert_eq!(skipped(&scene, "VENDOR_thing"), 1);
    assert_eq!(scene.skipped.len(), 2);
}

#[test]
fn two_reads_are_equal() {
    let model = square(5);
    assert_eq!(format!("{:?}", model.scene()), format!("{:?}", model.scene()));
}

/// The `gltf` crate reads the same triangles from a file that it can read.
#[test]
fn the_gltf_crate_agrees() {
    let mut model = square(4);
    let indices = model.accessor(UBYTE, "SCALAR", 6, &[0, 1, 2, 1, 3, 2]);
    model.primitive()["indices"] = json!(indices);
    model.json["nodes"] = json!([{"mesh": 0, "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1, 2, 3],
        "translation": [4, 5, 6]}]);
    let gltf = gltf::Gltf::from_slice_without_validation(&model.glb()).unwrap();
    let node = gltf.nodes().next().unwrap();
    let matrix = glam::Mat4::from_cols_array_2d(&node.transform().matrix());
    let mesh = node.mesh().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(&model.bin));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    let points = reader.read_indices().unwrap().into_u32().map(|i| {
        let p = matrix.transform_point3(Vec3::from(positions[i as usize]));
        p.as_dvec3()
    });
    let ours = model.scene();
    for (a, b) in ours.soup.corners_model.as_flattened().iter().zip(points) {
        close(*a, b);
    }
}
