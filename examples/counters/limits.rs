//! What the machine can do at best, in the vector width that the solver uses.

use crate::best_seconds;
use pulp::{Arch, Simd, WithSimd};
use std::{error::Error, hint::black_box};

/// Independent vectors: more than the latency of a multiply-add (4 cycles) times the units that do it (2).
const CHAINS: usize = 10;

/// Floats of a block that is summed: whole vectors, of whatever width.
const BLOCK: usize = 128;

/// So many chains of so many multiply-adds; gives their number.
struct MultiplyAdds(usize);

impl WithSimd for MultiplyAdds {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let (factor, term) = (simd.splat_f32s(black_box(0.999)), simd.splat_f32s(black_box(0.001)));
        let mut chains = [simd.splat_f32s(1.0); CHAINS];
        for _ in 0..self.0 {
            for chain in &mut chains {
                *chain = simd.mul_add_f32s(*chain, factor, term);
            }
        }
        black_box(chains);
        self.0 * CHAINS * S::F32_LANES
    }
}

/// Fused multiply-adds a second, each lane of a vector one.
pub fn fused_multiply_adds() -> Result<f64, Box<dyn Error>> {
    const STEPS: usize = 100_000_000;
    let mut count = 0;
    let seconds = best_seconds(5, || count = Arch::new().dispatch(MultiplyAdds(STEPS)))?;
    Ok(count as f64 / seconds)
}

/// Floats read a second when columns are summed, each from its first to its last.
pub fn floats_read(columns: &[&[f32]], repeats: usize) -> Result<f64, Box<dyn Error>> {
    let count: usize = columns.iter().map(|column| column.len()).sum();
    let seconds = best_seconds(5, || {
        for _ in 0..repeats {
            for column in columns {
                black_box(sum(black_box(column)));
            }
        }
    })?;
    Ok((count * repeats) as f64 / seconds)
}

fn sum(column: &[f32]) -> [f32; BLOCK] {
    let (blocks, _) = column.as_chunks::<BLOCK>();
    let mut sums = [0.0f32; BLOCK];
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for block in blocks {
                for (sum, value) in sums.iter_mut().zip(block) {
                    *sum += value;
                }
            }
        },
    );
    sums
}
