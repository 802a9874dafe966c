//! Materials, textures and cut-outs of valid files.

use super::build::{Model, UBYTE, load_in, skipped};
use glam::{Vec2, vec2};
use image::{Rgba, RgbaImage};
use serde_json::{Value, json};
use shadowfit_solver::mesh::Sides;

/// Two texels: opaque red, half transparent green.
fn two_texels() -> RgbaImage {
    RgbaImage::from_fn(2, 1, |x, _| if x == 0 { Rgba([255, 0, 0, 255]) } else { Rgba([0, 255, 0, 128]) })
}

fn textured(material: Value) -> Model {
    let mut model = Model::triangle();
    let texture = model.texture(&two_texels());
    model.textured(texture, material);
    model
}

#[test]
fn factor_texture_and_sides() {
    let mut model = textured(json!({
        "doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0, 1]}
    }));
    let sampler = model.push("samplers", json!({"wrapS": 33071, "wrapT": 33648}));
    model.json["textures"][0]["sampler"] = json!(sampler);
    let scene = model.scene();
    assert_eq!(scene.material_of, [1]);
    let material = &scene.materials[1];
    assert_eq!(material.base_color, [0.5, 0.25, 0.0, 1.0]);
    assert_eq!((material.image, material.repeat, material.alpha_cutoff), (Some(0), [false, true], None));
    assert_eq!(*scene.images[0], two_texels());
    assert_eq!(scene.soup.sides, [Sides::Both]);
    assert_eq!(scene.uvs, [[Vec2::ZERO, Vec2::X, Vec2::Y]]);
    assert_eq!(skipped(&scene, "mirrored textures"), 1);
    assert!(scene.soup.cutouts.is_empty());
}

#[test]
fn the_texture_chooses_its_coordinates_and_transform() {
    let mut model = textured(json!({}));
    let second = model.floats("VEC2", &[0.5, 0.5, 1., 0., 0., 1.]);
    model.primitive()["attributes"]["TEXCOORD_2"] = json!(second);
    let info = |model: &mut Model, value: Value| {
        model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = value;
        model.scene().uvs[0]
    };
    assert_eq!(info(&mut model, json!({"index": 0, "texCoord": 2}))[0], vec2(0.5, 0.5));
    // A quarter turn takes v to u (clockwise with v up), after the scale and before the offset.
    let transform = json!({"offset": [10, 20], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3]});
    let uvs = info(&mut model, json!({"index": 0, "extensions": {"KHR_texture_transform": transform}}));
    for (uv, wanted) in uvs.iter().zip([vec2(10., 20.), vec2(10., 18.), vec2(13., 20.)]) {
        assert!(uv.distance(wanted) < 1e-5, "{uv} is not {wanted}");
    }
    let transform = json!({"texCoord": 2});
    let uvs = info(&mut model, json!({"index": 0, "extensions": {"KHR_texture_transform": transform}}));
    assert_eq!(uvs[0], vec2(0.5, 0.5));
}

#[test]
fn quantised_coordinates() {
    let mut model = textured(json!({}));
    let uv = model.accessor(UBYTE, "VEC2", 3, &[0, 255, 255, 0, 51, 0]);
    model.json["accessors"][uv]["normalized"] = json!(true);
    model.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    assert_eq!(model.scene().uvs, [[Vec2::Y, Vec2::X, vec2(0.2, 0.0)]]);
}

#[test]
fn masks_become_cutouts() {
    let material = json!({
        "alphaMode": "MASK", "alphaCutoff": 0.4, "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}
    });
    let scene = textured(material).scene();
    assert_eq!(scene.materials[1].alpha_cutoff, Some(0.4));
    assert_eq!(scene.soup.cutout, [Some(0)]);
    assert_eq!(scene.soup.cutout_uv, scene.uvs);
    let cutout = &scene.soup.cutouts[0];
    assert_eq!((cutout.width, cutout.height, cutout.alpha.as_slice()), (2, 1, [128, 64].as_slice()));
    assert_eq!((cutout.cutoff, cutout.repeat), (0.4 * 255.0, [true; 2]));
    assert!(cutout.is_solid(vec2(0.25, 0.5)) && !cutout.is_solid(vec2(0.75, 0.5)));
    // The default cutoff is one half.
    assert_eq!(textured(json!({"alphaMode": "MASK"})).scene().soup.cutouts[0].cutoff, 127.5);
}

#[test]
fn without_a_texture_the_factor_decides() {
    for (alpha, triangles) in [(0.3, 0), (0.5, 1), (0.9, 1)] {
        let mut model = Model::triangle();
        let factor = json!({"baseColorFactor": [1, 1, 1, alpha]});
        model.push("materials", json!({"alphaMode": "MASK", "pbrMetallicRoughness": factor}));
        model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(json!({"attributes": {"POSITION": 0}}));
        model.primitive()["material"] = json!(0);
        let scene = model.scene();
        assert_eq!(scene.soup.corners_model.len(), 1 + triangles, "alpha {alpha}");
        assert_eq!(skipped(&scene, "invisible triangles"), 1 - triangles);
    }
}

#[test]
fn blend_is_opaque_and_counted() {
    let scene = textured(json!({"alphaMode": "BLEND"})).scene();
    assert_eq!(skipped(&scene, "blended materials"), 1);
    assert_eq!((scene.soup.cutout[0], scene.materials[1].alpha_cutoff), (None, None));
    // What passes: nothing through the opaque red texel; half through the green one, green tinted.
    let a = 128.0 / 255.0;
    let expected = [0.5 * (1.0 - a) * (1.0 - a), 0.5 * (1.0 - a), 0.5 * (1.0 - a) * (1.0 - a)];
    let passes = scene.materials[1].transmittance.unwrap();
    assert!(passes.iter().zip(expected).all(|(t, e)| (t - e).abs() < 1e-6), "{passes:?} {expected:?}");
    // Without an image the factor says all, and alpha 1 lets nothing pass.
    for (factor, expected) in [([1.0, 0.5, 0.0, 0.5], Some([0.5, 0.375, 0.25])), ([1.0; 4], None)] {
        let mut model = Model::triangle();
        let factor = json!({"baseColorFactor": factor});
        model.push("materials", json!({"alphaMode": "BLEND", "pbrMetallicRoughness": factor}));
        model.primitive()["material"] = json!(0);
        assert_eq!(model.scene().materials[1].transmittance, expected);
    }
    assert_eq!(textured(json!({})).scene().materials[1].transmittance, None);
}

/// Name, change of the file, exit code where the material is a cut-out.
type BadImage = (&'static str, fn(&mut Model), u8);

#[test]
fn images_that_cannot_be_had() {
    let cases: [BadImage; 7] = [
        ("missing file", |m| m.json["images"][0] = json!({"uri": "nothing.png"}), 3),
        ("damaged", |m| m.json["images"][0]["bufferView"] = json!(0), 3),
        ("no source", |m| m.json["images"][0] = json!({}), 3),
        ("bad base64", |m| m.json["images"][0] = json!({"uri": "data:image/png;base64,@@"}), 3),
        ("webp", |m| m.json["images"][0] = json!({"uri": "data:image/webp;base64,UklGRgAAAABXRUJQ"}), 5),
        (
            "basisu",
            |m| {
                m.json["textures"][0] = json!({"extensions": {"KHR_texture_basisu": {"source": 0}}});
                m.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
            },
            5,
        ),
        (
            "too many texels",
            |m| {
                let mut png = super::build::png(&two_texels());
                // Width and height of the header, then its checksum.
                png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
                let view = m.view(&png);
                m.json["images"][0]["bufferView"] = json!(view);
            },
            3,
        ),
    ];
    for (name, change, exit_code) in cases {
        let mut model = textured(json!({}));
        change(&mut model);
        let scene = model.scene();
        assert_eq!(skipped(&scene, "base colour textures"), 1, "{name}");
        assert_eq!((scene.materials[1].image, scene.images.len()), (None, 0), "{name}");
        model.json["materials"][0]["alphaMode"] = json!("MASK");
        let error = model.load().unwrap_err();
        assert_eq!(error.exit_code(), exit_code, "{name}: {error}");
    }
}

#[test]
fn an_image_is_decoded_once_and_only_if_drawn() {
    let mut model = textured(json!({}));
    let info = json!({"baseColorTexture": {"index": 0}});
    model.push("materials", json!({"pbrMetallicRoughness": info}));
    model.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 77}}}));
    let mut second = model.primitive().clone();
    second["material"] = json!(1);
    model.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    let scene = model.scene();
    assert_eq!((scene.images.len(), scene.materials.len()), (1, 4));
    assert_eq!(scene.material_of, [1, 2]);
    assert_eq!(scene.materials[2].image, Some(0));
}

#[test]
fn coordinates_that_are_missing_or_not_numbers() {
    let mut model = textured(json!({}));
    let uv = model.floats("VEC2", &[f32::NAN, 0., 1., f32::INFINITY, 0.5, 0.5]);
    model.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    let scene = model.scene();
    assert_eq!(scene.uvs, [[Vec2::ZERO, Vec2::ZERO, vec2(0.5, 0.5)]]);
    assert_eq!(skipped(&scene, "texture coordinates"), 2);
    model.primitive()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    assert_eq!(skipped(&model.scene(), "textured primitives without coordinates"), 1);
}

#[test]
fn vertex_colours_are_counted() {
    let mut model = Model::triangle();
    let colour = model.floats("VEC3", &[1.0; 9]);
    model.primitive()["attributes"]["COLOR_0"] = json!(colour);
    assert_eq!(skipped(&model.scene(), "vertex colours"), 1);
}

#[test]
fn a_jpeg_beside_the_model() {
    let folder = tempfile::TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("my textures")).unwrap();
    let grey = image::RgbImage::from_pixel(8, 8, image::Rgb([128; 3]));
    grey.save(folder.path().join("my textures/grey.jpg")).unwrap();
    let mut model = textured(json!({}));
    model.json["images"][0] = json!({"uri": "my%20textures/grey.jpg"});
    let scene = load_in(folder.path(), "model.glb", &model.glb()).unwrap();
    assert_eq!(scene.images[0].dimensions(), (8, 8));
}
