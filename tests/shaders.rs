//! Every pass compiles, every file of `shaders/` belongs to one, and Rust and WGSL agree on every shared struct.

use naga::{TypeInner, valid};
use shadowfit::render::gpu::{SHADERS, StructLayout, struct_layouts};
use std::collections::BTreeSet;

/// Parses and validates a module; the error names file lines of the joined source.
fn module(source: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
    valid::Validator::new(valid::ValidationFlags::all(), valid::Capabilities::empty())
        .validate(&module)
        .map_err(|error| error.emit_to_string(source))?;
    Ok(module)
}

/// What differs between a struct in Rust and in the module, if the module has it.
fn difference(module: &naga::Module, rust: &StructLayout) -> Option<Result<(), String>> {
    let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(rust.name))?;
    let TypeInner::Struct { members, span } = &ty.inner else { return None };
    let wgsl: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
    let array_stride = (*span as usize).next_multiple_of(16);
    if (array_stride, &wgsl) == (rust.size, &rust.members) {
        Some(Ok(()))
    } else {
        Some(Err(format!("{}: WGSL {span} bytes {wgsl:?}, Rust {} bytes {:?}", rust.name, rust.size, rust.members)))
    }
}

#[test]
fn every_pass_is_valid() {
    assert!(!SHADERS.is_empty(), "no shaders found");
    let failures: Vec<_> = SHADERS
        .iter()
        .filter_map(|shader| module(&shader.source()).err().map(|error| format!("{}:\n{error}", shader.name)))
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_file_belongs_to_a_pass() {
    let used: BTreeSet<String> = SHADERS.iter().flat_map(|s| s.parts).map(|(file, _)| file.to_string()).collect();
    let files: BTreeSet<String> = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders"))
        .expect("the folder shaders/ is there")
        .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
        .collect();
    assert!(!files.is_empty(), "no shaders found");
    assert_eq!(used, files);
    for shader in SHADERS {
        let pass = shader.parts.last().map(|(file, _)| *file);
        assert_eq!(pass, Some(format!("{}.wgsl", shader.name).as_str()), "a pass is called like its file");
    }
}

#[test]
fn rust_and_wgsl_lay_out_structs_alike() {
    let modules: Vec<_> = SHADERS.iter().filter_map(|shader| module(&shader.source()).ok()).collect();
    let mut failures = Vec::new();
    for rust in struct_layouts() {
        let compared: Vec<_> = modules.iter().filter_map(|module| difference(module, &rust)).collect();
        if compared.is_empty() {
            failures.push(format!("{}: no shader has it", rust.name));
        }
        failures.extend(compared.into_iter().filter_map(Result::err));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_struct_of_a_buffer_is_compared() {
    let known: BTreeSet<&str> = struct_layouts().iter().map(|layout| layout.name).collect();
    for shader in SHADERS {
        let module = module(&shader.source()).expect("valid");
        for (_, variable) in module.global_variables.iter() {
            let mut ty = &module.types[variable.ty];
            if let TypeInner::Array { base, .. } = ty.inner {
                ty = &module.types[base];
            }
            if let (TypeInner::Struct { .. }, Some(name)) = (&ty.inner, &ty.name) {
                assert!(known.contains(name.as_str()), "{}: {name} is not in struct_layouts()", shader.name);
            }
        }
    }
}
