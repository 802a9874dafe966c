//! The ground in the files: written, read back, moved with the model, refused where it is broken.

use crate::fixtures::{FRAME, Folders, active_set, document, glb, open, parse, planes, request, triangle};
use serde_json::{Value, json};
use shadowfit::{
    asset::{ModelGround, Written, read, write},
    scene::load,
};
use shadowfit_solver::plane::{ActiveLists, BakedSet, Ground};
use std::{
    f64::consts::FRAC_1_SQRT_2,
    path::{Path, PathBuf},
};

const GROUND: Ground = Ground { height: -0.37, half_extent: 1.7 };

/// A model of one section and a ground.
fn grounded() -> BakedSet {
    let set = active_set(planes(3));
    let of_ground = [vec![2], vec![]];
    let active = set.active.map(|ActiveLists { directions, lists }| {
        let lists = lists.into_iter().zip(of_ground).map(|(model, ground)| [model, vec![ground]].concat());
        ActiveLists { directions, lists: lists.collect() }
    });
    BakedSet { sections: vec![vec![0, 1, 2], vec![2]], active, ground: Some(GROUND), ..set }
}

fn written(folders: &Folders) -> Written {
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    write(&request(&input, &folders.out(), &grounded())).unwrap()
}

/// The model with other text in its JSON.
fn changed(folders: &Folders, model: &Path, change: impl Fn(&mut Value)) -> PathBuf {
    let (json, bin) = open(model);
    let mut document = parse(&json);
    change(&mut document);
    folders.input("changed.glb", &glb(&document.to_string(), bin.as_deref()))
}

#[test]
fn a_written_ground_reads_back() {
    let folders = Folders::new();
    let written = written(&folders);
    for path in [&written.model, &written.sidecar] {
        let set = read(path).unwrap();
        assert_eq!(set.ground, Some(ModelGround::from_unit_space(&GROUND, &FRAME)), "{}", path.display());
        let back = set.in_unit_space(&FRAME);
        assert_eq!((back.ground, &back.sections), (Some(GROUND), &grounded().sections));
        assert_eq!((&back.active, back.model_sections()), (&grounded().active, 1));
    }
    let height = FRAME.centre_model.y - 0.37_f32 as f64 * FRAME.radius;
    let ground = read(&written.model).unwrap().ground.unwrap();
    assert!((ground.height - height).abs() < 1e-12 && (ground.half_extent - 1.7 * FRAME.radius).abs() < 1e-6);
    // The model's one section needs no label, and a label cannot name the ground's.
    assert_eq!(load(&written.model).unwrap().section_of, [0]);
}

#[test]
fn no_primitive_belongs_to_the_ground() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let scene = load(&input).unwrap();
    let two = BakedSet { sections: vec![vec![0], vec![1], vec![2]], active: None, ..grounded() };
    let out = folders.out();
    let request = |section_of| shadowfit::asset::AssetRequest {
        origins: &scene.origins,
        section_of,
        ..request(&input, &out, &two)
    };
    let error = write(&request(&[2])).unwrap_err();
    assert!(error.to_string().contains("triangle 0 is in section 2, but there are 2"), "{error}");
    let written = write(&request(&[1])).unwrap();
    assert_eq!(load(&written.model).unwrap().section_of, [1]);
    let label = "/meshes/0/primitives/0/extensions/SHADOWFIT_node_shadow_planes";
    let stray =
        changed(&folders, &written.model, |document| document.pointer_mut(label).unwrap()["section"] = json!(2));
    let error = load(&stray).unwrap_err();
    assert!(error.to_string().contains("section: 2, but there are 2 sections"), "{error}");
    // Without a label it belongs to none, which is not the ground's.
    let bare = changed(&folders, &written.model, |document| {
        drop(document.pointer_mut("/meshes/0/primitives/0").unwrap().as_object_mut().unwrap().remove("extensions"));
    });
    assert_eq!(load(&bare).unwrap().section_of, [3]);
}

#[test]
fn a_moved_frame_node_moves_the_ground() {
    let folders = Folders::new();
    let written = written(&folders);
    let before = read(&written.model).unwrap().ground.unwrap();
    let moved = |members: Value| {
        changed(&folders, &written.model, |document| {
            let node = document["nodes"][1].as_object_mut().unwrap();
            node.extend(members.as_object().unwrap().clone());
        })
    };
    // A quarter turn around y.
    let turned =
        moved(json!({"rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2], "scale": [2, 3, 8], "translation": [1, 5, 0]}));
    let after = read(&turned).unwrap().ground.unwrap();
    assert!((after.height - (3.0 * before.height + 5.0)).abs() < 1e-12, "{after:?}");
    assert!((after.half_extent - 4.0 * before.half_extent).abs() < 1e-12, "{after:?}");
    // Tilted, or upside down.
    for rotation in [json!([0.01, 0, 0, 0.99995]), json!([1, 0, 0, 0])] {
        let error = read(&moved(json!({ "rotation": rotation }))).unwrap_err();
        assert!(error.to_string().contains("sets/0/ground: not level"), "{error}");
        assert_eq!(error.exit_code(), 3);
    }
}

#[test]
fn a_broken_ground_is_refused_with_its_place() {
    let folders = Folders::new();
    let written = written(&folders);
    let cases = [
        ("section", json!(0), "ground/section: 0, but the ground's is the last of 2"),
        ("section", json!(2), "ground/section: 2, but the ground's is the last of 2"),
        ("section", json!(u64::MAX), "ground/section"),
        ("section", json!(-1), "ground/section"),
        ("section", Value::Null, "ground/section"),
        ("height", json!("low"), "ground/height"),
        ("height", Value::Null, "ground/height"),
        ("halfExtent", json!(0), "ground/halfExtent: not a finite number above 0"),
        ("halfExtent", json!(-2.5), "ground/halfExtent: not a finite number above 0"),
        ("halfExtent", json!([1]), "ground/halfExtent"),
    ];
    for (member, value, expected) in cases {
        let broken = changed(&folders, &written.model, |document| {
            let pointer = "/extensions/SHADOWFIT_node_shadow_planes/sets/0/ground";
            document.pointer_mut(pointer).unwrap()[member] = value.clone();
        });
        let error = read(&broken).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
        assert_eq!(error.exit_code(), 3, "{error}");
    }
}

#[test]
fn a_ground_that_no_file_can_hold_is_refused() {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(&document("", ""), Some(&triangle())));
    let refused = |change: &dyn Fn(&mut BakedSet), expected: &str| {
        let (mut set, out) = (grounded(), folders.out());
        change(&mut set);
        let error = write(&request(&input, &out, &set)).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}\nshould contain {expected}");
        assert_eq!((error.exit_code(), folders.listing().len()), (4, 0));
    };
    let with = |ground: Ground| move |set: &mut BakedSet| set.ground = Some(ground);
    refused(&with(Ground { height: f32::NAN, ..GROUND }), "ground: height: not a finite number");
    refused(&with(Ground { half_extent: 0.0, ..GROUND }), "ground: halfExtent: not a finite number above 0");
    let alone = |set: &mut BakedSet| (set.sections, set.active) = (vec![vec![0]], None);
    refused(&alone, "ground: it has the only section");
}
