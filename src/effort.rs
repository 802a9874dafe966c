//! Presets: how much work a fit does.

use shadowfit_solver::{candidates::CandidateOptions, selection::SelectionOptions};

/// How much work a fit does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Receivers that decide planes and textures.
    pub receivers: usize,
    /// Light directions that decide planes and textures; memory is about 10 bytes x receivers x lights.
    pub lights: usize,
    /// Where the search starts.
    pub candidates: CandidateOptions,
    /// How it goes on.
    pub selection: SelectionOptions,
    /// Texels along the longer side of each plane, where the user names none.
    pub texture_size: usize,
}

impl Effort {
    /// A first look: about five seconds for a model of some thousand triangles on two cores.
    #[must_use]
    pub fn fast() -> Self {
        let base = Self::balanced();
        Self {
            receivers: 24_576,
            lights: 160,
            selection: SelectionOptions {
                texels: 64,
                scoring_pairs: [60_000, 120_000],
                screening_pairs: 30_000,
                finalists: 48,
                refined: 3,
                replace_rounds: 0,
                ..base.selection
            },
            texture_size: 128,
            ..base
        }
    }

    /// The default.
    #[must_use]
    pub fn balanced() -> Self {
        Self {
            receivers: 65_536,
            lights: 256,
            candidates: CandidateOptions { directions: 150, offsets: 12, surface_points: 400, seed: 0 },
            selection: SelectionOptions {
                max_planes: 12,
                min_gain: 0.002,
                scoring_pairs: [150_000, 250_000],
                texels: 96,
                screening_pairs: 50_000,
                finalists: 96,
                refined: 4,
                polished: 2,
                refine_steps: 5,
                replace_rounds: 1,
            },
            texture_size: 256,
        }
    }

    /// When it may take minutes.
    #[must_use]
    pub fn best() -> Self {
        let base = Self::balanced();
        Self {
            receivers: 98_304,
            lights: 384,
            candidates: CandidateOptions { directions: 300, offsets: 20, surface_points: 1000, ..base.candidates },
            selection: SelectionOptions {
                scoring_pairs: [400_000, 600_000],
                refined: 8,
                refine_steps: 6,
                replace_rounds: 4,
                ..base.selection
            },
            ..base
        }
    }
}
