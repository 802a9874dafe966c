//! Fits through the library, for tests that look at results rather than at the program.

pub use shadowfit::pipeline::FitRequest;
use shadowfit::{
    asset::{ShadowSet, read},
    effort::{Effort, GroundPlan, Plan},
    pipeline::{FitError, run},
    report::Report,
};
use shadowfit_solver::{
    lights::LightDomain, lists::ListOptions, pair_table::SampleSize, search::SearchOptions, sections::TraceOptions,
};
use std::path::{Path, PathBuf};

/// A file of `models/`.
pub fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(name)
}

/// A fit of `model` into `out_dir`, without frames.
pub fn request(model: &Path, out_dir: &Path, effort: Effort) -> FitRequest {
    FitRequest {
        model: model.to_owned(),
        out_dir: out_dir.to_owned(),
        effort,
        max_planes: None,
        max_lookups: None,
        sections: None,
        texture_budget: None,
        ground: false,
        max_error: None,
        texture_size: None,
        domain: LightDomain::Sphere,
        domain_text: "sphere".to_owned(),
        planes: None,
        validation: None,
        certificate: None,
        seed: 1,
        command: String::new(),
    }
}

/// The least that still fits planes: for models of some dozen triangles, and where only the outcome counts.
pub fn least() -> Effort {
    let Effort { whole, divided } = Effort::fast();
    let search = SearchOptions {
        proposals: 240,
        screening: SampleSize { lights: 64, pairs: 8_000 },
        screening_texels: 32,
        finalists: 8,
        refined: 2,
        scoring: SampleSize { lights: 128, pairs: 30_000 },
        texels: 48,
        refine_steps: 4,
        ..whole.search
    };
    let trace = TraceOptions { pairs: 600_000, lights: 384, stride: 4, exposure_rays: 16, seed: 0 };
    let lists = ListOptions { grid: 128, ..whole.lists };
    Effort {
        whole: Plan { trace, directions: 48, search, lists, ..whole },
        divided: Plan {
            sections: 12,
            trace: TraceOptions { pairs: 1_200_000, ..trace },
            directions: 48,
            search: SearchOptions { max_planes: 6, ..search },
            ground: GroundPlan {
                pairs: 300_000,
                search: Some(SearchOptions { max_planes: 12, replace_rounds: 0, ..search }),
            },
            ..divided
        },
    }
}

/// Runs a fit; what it wrote must read back.
pub fn fit(request: &FitRequest) -> Result<(Report, ShadowSet), FitError> {
    let report = run(request, &mut |_| ())?;
    let stem = request.model.file_stem().unwrap().to_str().unwrap();
    let [model, sidecar] = ["glb", "json"].map(|kind| request.out_dir.join(format!("{stem}.shadow.{kind}")));
    let set = read(&model).unwrap();
    assert_eq!(read(&sidecar).unwrap(), set, "{}", model.display());
    assert_eq!(set.planes.len(), report.planes);
    assert_finite(&serde_json::to_value(&report).unwrap(), &set);
    Ok((report, set))
}

/// JSON has no NaN: serde writes `null` in its place, which only these members may be.
fn assert_finite(report: &serde_json::Value, set: &ShadowSet) {
    const MAY_BE_NULL: [&str; 5] = ["image", "certificate", "ground", "peak_memory_bytes", "max_error"];
    let mut open = vec![(String::new(), report)];
    while let Some((name, value)) = open.pop() {
        match value {
            serde_json::Value::Null => assert!(MAY_BE_NULL.contains(&name.as_str()), "{name} is no number"),
            serde_json::Value::Array(list) => open.extend(list.iter().map(|value| (name.clone(), value))),
            serde_json::Value::Object(members) => {
                open.extend(members.iter().map(|(name, value)| (name.clone(), value)));
            }
            _ => {}
        }
    }
    assert!(set.bounds.min.is_finite() && set.bounds.max.is_finite(), "{:?}", set.bounds);
    for plane in &set.planes {
        let rectangle = &plane.rectangle;
        let vectors = [rectangle.origin, rectangle.u_axis, rectangle.v_axis];
        assert!(vectors.iter().all(|v| v.is_finite()) && plane.bias.is_finite(), "{rectangle:?}");
    }
}
