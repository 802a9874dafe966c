//! Every byte of the input's JSON and buffers is in the output.

use crate::fixtures::{Folders, document, glb, open, parse, planes, triangle};
use serde_json::{Value, json};
use shadowfit::asset::{EXTENSION, read, splice::Spot};
use std::ops::Range;

/// Takes out of `output` what the writer adds, by its place at the end of arrays and objects, guided by `input`.
fn without_additions(input: &str, output: &str) -> String {
    let (root, old) = (Spot::root(output).unwrap(), Spot::root(input).unwrap());
    let mut cuts: Vec<(Range<usize>, String)> = vec![];
    cut_members(&root, &old, &mut cuts);
    for key in ["nodes", "textures", "images", "samplers", "bufferViews", "extensionsUsed"] {
        if let (Some(new), Some(old)) = (root.member(key).unwrap(), old.member(key).unwrap()) {
            cut(&new, new.elements().unwrap(), old.elements().unwrap().len(), &mut cuts);
        }
    }
    if let (Some(new), Some(old)) = (root.member("extensions").unwrap(), old.member("extensions").unwrap()) {
        cut_members(&new, &old, &mut cuts);
    }
    if let (Some(new), Some(old)) = (root.member("scenes").unwrap(), old.member("scenes").unwrap()) {
        for (new, old) in new.elements().unwrap().iter().zip(old.elements().unwrap()) {
            match (new.member("nodes").unwrap(), old.member("nodes").unwrap()) {
                (Some(nodes), Some(old)) => {
                    cut(&nodes, nodes.elements().unwrap(), old.elements().unwrap().len(), &mut cuts)
                }
                _ => cut_members(new, &old, &mut cuts),
            }
        }
    }
    let length = |root: &Spot<'_>| -> Option<(Range<usize>, String)> {
        let buffer = root.member("buffers").unwrap()?.elements().unwrap().into_iter().next()?;
        buffer.member("byteLength").unwrap().map(|spot| (spot.span(), spot.slice().to_owned()))
    };
    if let (Some((span, _)), Some((_, text))) = (length(&root), length(&old)) {
        cuts.push((span, text));
    }
    cuts.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    let mut text = output.to_owned();
    for (span, replacement) in cuts {
        text.replace_range(span, &replacement);
    }
    text
}

fn cut_members(new: &Spot<'_>, old: &Spot<'_>, cuts: &mut Vec<(Range<usize>, String)>) {
    let members: Vec<Spot<'_>> = new.members().unwrap().into_iter().map(|(_, spot)| spot).collect();
    cut(new, members, old.members().unwrap().len(), cuts);
}

/// Cuts the children from `kept` on.
fn cut(parent: &Spot<'_>, children: Vec<Spot<'_>>, kept: usize, cuts: &mut Vec<(Range<usize>, String)>) {
    if children.len() > kept {
        let start = if kept == 0 { parent.span().start + 1 } else { children[kept - 1].span().end };
        cuts.push((start..children[children.len() - 1].span().end, String::new()));
    }
}

/// Writes `count` planes into a GLB of this JSON, checks that all survived, and returns the output's JSON.
fn check(json: &str, bin: Option<&[u8]>, count: usize) -> Value {
    let folders = Folders::new();
    let input = folders.input("m.glb", &glb(json, bin));
    let written = folders.write(&input, &planes(count)).unwrap();
    let (output, new_bin) = open(&written.model);
    assert_eq!(without_additions(json, &output), json.trim_end_matches(' '));
    match (bin, new_bin) {
        (Some(old), Some(new)) => assert!(new.starts_with(old)),
        (old, new) => assert_eq!((old, new), (None, None)),
    }
    assert_eq!(read(&written.model).unwrap().planes.len(), count);
    let value = parse(&output);
    assert!(value["extensionsUsed"].as_array().unwrap().contains(&json!(EXTENSION)));
    assert!(!value["extensionsRequired"].to_string().contains(EXTENSION));
    value
}

#[test]
fn odd_spelling_survives() {
    let plain = document("", "");
    let pretty = format!("{:#}", parse(&plain));
    let crlf = pretty.replace('\n', "\r\n\t");
    let numbers = document("", r#", "extras" : {"a":1.0e-7,"b":1.00,"c":-0,"d":1E+2,"e":12345678901234567890123} "#);
    let escapes = document("", r#","extras":{"\u00e9\n\/":"日本\ud83d\ude00 \"quoted\" ]}","nodes":[1,2]}"#);
    let escaped_key = plain.replace("\"nodes\":[{", "\"n\\u006fdes\" : [ {");
    for json in [plain, pretty, crlf, numbers, escapes, escaped_key] {
        let value = check(&json, Some(&triangle()), 4);
        assert_eq!(value["nodes"].as_array().unwrap().len(), 2, "{json}");
        assert_eq!(value["scenes"][0]["nodes"], json!([0, 1]));
    }
}

#[test]
fn one_document_as_a_whole() {
    let json = "{ \"asset\": {\"version\": \"2.0\"}, \"nodes\": [ {} ], \"scenes\": [{ }], \"extensions\": { } } ";
    let folders = Folders::new();
    let written = folders.write(&folders.input("m.glb", &glb(json, None)), &[]).unwrap();
    let expected = concat!(
        r#"{ "asset": {"version": "2.0"}, "#,
        r#""nodes": [ {},{"name":"shadow planes","extensions":{"SHADOWFIT_node_shadow_planes":{"set":0}}} ], "#,
        r#""scenes": [{"nodes":[1] }], "extensions": {"SHADOWFIT_node_shadow_planes":{"sets":[{"bounds":"#,
        r#"{"min":[-1.0,0.0,-1.5],"max":[1.0,2.0,1e-7]},"planes":[],"sections":[[]]}]} },"#,
        r#""extensionsUsed":["SHADOWFIT_node_shadow_planes"] }"#,
    );
    assert_eq!(open(&written.model), (expected.to_owned(), None));
}

#[test]
fn arrays_and_scenes_that_are_missing_are_made() {
    // No scenes at all: the node is there, in no scene.
    let value = check(r#"{"asset":{"version":"2.0"}}"#, None, 2);
    assert_eq!(value["nodes"].as_array().unwrap().len(), 1);
    assert_eq!(value.get("scenes"), None);
    // Two scenes: the default one gets the node; without a default the first.
    let two = r#"{"scenes":[{"name":"a"},{"nodes":[0]}],"nodes":[{}],"asset":{"version":"2.0"}}"#;
    let value = check(two, None, 2);
    assert_eq!(value["scenes"], json!([{"name":"a","nodes":[1]},{"nodes":[0]}]));
    let value = check(&two.replace("\"nodes\":[{}]", "\"nodes\":[{}],\"scene\":1"), None, 2);
    assert_eq!(value["scenes"], json!([{"name":"a"},{"nodes":[0,1]}]));
    check(r#"{"asset":{"version":"2.0"},"scenes":[],"extensions":{},"textures":[]}"#, None, 2);
}

#[test]
fn textures_and_extensions_that_are_there_stay() {
    let more = r#","images":[{"uri":"data:image/png;base64,AAAA"}],"samplers":[{}],"textures":[{"sampler":0,"source":0}],
"extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[]}}"#;
    let value = check(&document("", more), Some(&triangle()), 3);
    assert_eq!(value["textures"][1], json!({"name":"shadow atlas 0","sampler":1,"source":1}));
    assert_eq!(value["samplers"][1], json!({"magFilter":9729,"minFilter":9729,"wrapS":33071,"wrapT":33071}));
    assert_eq!(value["extensions"][EXTENSION]["sets"][0]["planes"][0]["occluderTexture"], json!({"index":1}));
    assert_eq!(value["bufferViews"][1]["byteOffset"], json!(36));
    // Declared but not used: not declared twice.
    let declared = document("", &format!(",\"extensionsUsed\":[\"{EXTENSION}\"]"));
    assert_eq!(check(&declared, Some(&triangle()), 1)["extensionsUsed"].as_array().unwrap().len(), 1);
}

#[test]
fn a_padded_binary_chunk_keeps_its_padding() {
    let json = document("", "").replace("{\"byteLength\":36}", "{\"byteLength\":34}");
    let value = check(&json, Some(&[triangle(), vec![1, 2, 3, 4]].concat()), 3);
    assert_eq!(value["bufferViews"][1]["byteOffset"], json!(40));
    let png = value["bufferViews"][1]["byteLength"].as_u64().unwrap();
    assert_eq!(value["buffers"][0]["byteLength"].as_u64().unwrap(), 40 + png);
}
