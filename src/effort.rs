//! Presets: how much work a fit does.

use shadowfit_solver::{
    budget::{BudgetOptions, Sizing},
    lists::ListOptions,
    pair_table::SampleSize,
    search::SearchOptions,
    sections::TraceOptions,
};

/// How much work a fit does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Where the whole model is one section.
    pub whole: Plan,
    /// Where it is divided.
    pub divided: Plan,
}

/// All numbers of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Sections, 1 and up; every section must be able to pay for a plane.
    pub sections: usize,
    /// What decides planes and textures.
    pub trace: TraceOptions,
    /// Directions of the active lists; each is chosen by the lights nearest to it, five and more.
    pub directions: usize,
    /// How planes are searched in each section.
    pub search: SearchOptions,
    /// Share of all shadow that a plane must explain to be taken. Counted under lights that did not decide its texture.
    pub min_gain: f64,
    /// How textures and lists are decided in turn.
    pub lists: ListOptions,
    /// What the textures may cost.
    pub budget: BudgetOptions,
    /// What a ground gets, where there is one.
    pub ground: GroundPlan,
}

/// Numbers of a ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlan {
    /// Pairs, about.
    pub pairs: usize,
    /// How planes of its own are searched; without, those of the model serve it too.
    pub search: Option<SearchOptions>,
}

/// Bytes of all textures where the user names none.
const TEXTURE_BUDGET: usize = 2 << 20;

/// How planes of a section are searched by default.
const SECTION_SEARCH: SearchOptions = SearchOptions {
    max_planes: 16,
    proposals: 200,
    screening: SampleSize { lights: 512, pairs: 6_000 },
    screening_texels: 32,
    finalists: 8,
    refined: 2,
    scoring: SampleSize { lights: 2048, pairs: 24_000 },
    texels: 48,
    refine_steps: 4,
    replace_rounds: 0,
    seed: 0,
};

impl Effort {
    /// A first look.
    #[must_use]
    pub fn fast() -> Self {
        let Self { whole, divided } = Self::balanced();
        Self {
            whole: Plan {
                trace: TraceOptions { pairs: 1_000_000, lights: 512, exposure_rays: 16, ..whole.trace },
                directions: 64,
                search: SearchOptions {
                    proposals: 300,
                    screening: SampleSize { lights: 64, pairs: 20_000 },
                    screening_texels: 32,
                    finalists: 12,
                    refined: 2,
                    scoring: SampleSize { lights: 128, pairs: 60_000 },
                    texels: 48,
                    refine_steps: 4,
                    ..whole.search
                },
                lists: ListOptions { grid: 160, rounds: 2, ..whole.lists },
                ground: GroundPlan { pairs: 400_000, ..whole.ground },
                ..whole
            },
            divided: Plan {
                sections: 48,
                trace: TraceOptions { pairs: 4_000_000, lights: 1024, ..divided.trace },
                directions: 96,
                search: SearchOptions {
                    max_planes: 10,
                    scoring: SampleSize { lights: 512, pairs: 16_000 },
                    ..divided.search
                },
                ground: GroundPlan { pairs: 1_000_000, ..divided.ground },
                ..divided
            },
        }
    }

    /// The default.
    #[must_use]
    pub fn balanced() -> Self {
        let whole = Plan {
            sections: 1,
            trace: TraceOptions { pairs: 3_000_000, lights: 1024, stride: 4, exposure_rays: 24, seed: 0 },
            directions: 96,
            search: SearchOptions {
                max_planes: 12,
                proposals: 500,
                screening: SampleSize { lights: 64, pairs: 30_000 },
                screening_texels: 48,
                finalists: 24,
                refined: 3,
                scoring: SampleSize { lights: 256, pairs: 150_000 },
                texels: 64,
                refine_steps: 5,
                replace_rounds: 1,
                seed: 0,
            },
            min_gain: 0.002,
            lists: ListOptions { max_lookups: usize::MAX, grid: 255, rounds: 3, smoothing: 1 },
            budget: BudgetOptions {
                max_planes: usize::MAX,
                bytes: TEXTURE_BUDGET,
                texture_size: 128,
                sizing: Sizing::ByGain,
                encoding: None,
                byte_gain: 2e-8,
                smoothing: 1,
            },
            ground: GroundPlan { pairs: 1_000_000, search: None },
        };
        let divided = Plan {
            sections: 96,
            trace: TraceOptions { pairs: 8_000_000, lights: 2048, stride: 8, exposure_rays: 16, seed: 0 },
            directions: 192,
            search: SECTION_SEARCH,
            min_gain: 3e-6,
            lists: ListOptions { max_lookups: 4, grid: 200, rounds: 2, smoothing: 1 },
            budget: BudgetOptions { byte_gain: 5e-11, smoothing: 1, ..whole.budget },
            ground: GroundPlan {
                pairs: 2_000_000,
                search: Some(SearchOptions {
                    max_planes: 24,
                    finalists: 16,
                    scoring: SampleSize { lights: 1024, pairs: 100_000 },
                    texels: 64,
                    ..SECTION_SEARCH
                }),
            },
        };
        Self { whole, divided }
    }

    /// When it may take minutes.
    #[must_use]
    pub fn best() -> Self {
        let Self { whole, divided } = Self::balanced();
        Self {
            whole: Plan {
                trace: TraceOptions { pairs: 8_000_000, lights: 2048, ..whole.trace },
                search: SearchOptions {
                    proposals: 1600,
                    screening: SampleSize { lights: 128, pairs: 60_000 },
                    finalists: 48,
                    refined: 6,
                    scoring: SampleSize { lights: 512, pairs: 400_000 },
                    texels: 96,
                    replace_rounds: 2,
                    ..whole.search
                },
                ground: GroundPlan { pairs: 3_000_000, ..whole.ground },
                ..whole
            },
            divided: Plan {
                sections: 160,
                trace: TraceOptions { pairs: 48_000_000, lights: 4096, ..divided.trace },
                search: SearchOptions {
                    max_planes: 30,
                    proposals: 400,
                    refined: 3,
                    scoring: SampleSize { lights: 4096, pairs: 96_000 },
                    texels: 64,
                    ..divided.search
                },
                min_gain: 1e-6,
                lists: ListOptions { grid: 255, rounds: 3, ..divided.lists },
                budget: BudgetOptions { byte_gain: 2e-11, ..divided.budget },
                ground: GroundPlan { pairs: 8_000_000, ..divided.ground },
                ..divided
            },
        }
    }
}
