//! Certificate: how far from the best possible are the planes that were found?
//!
//! In: pairs, a pool of planes with texel grids, and which of them were found. Out: the training error of the found
//! planes with exactly re-baked binary textures, and a proven lower bound on that of *any* as many planes of the pool,
//! at most one of each family, with *any* binary textures on their grids (see `relaxation` for the proof). Both are
//! on the same pairs and grids, so the bound is never above the error.
//!
//! Each plane is read for every receiver under every light. A set with active lists does not read its planes where
//! they do harm, and can have a smaller error than the bound.
//!
//! What it does not say: a plane outside the pool is not covered, nor is a set with two variants of one family, nor a
//! finer texture. Pairs may be a sample of all (`PairTable::sample`); the statement is then about that sample. Bilinear
//! filtering, smoothing and held-out pairs are no part of it.

use crate::{
    pair_table::PairTable,
    pool::{Instance, PoolPlane},
    relaxation::{Multipliers, Saddle},
};

/// How hard to try.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CertificateOptions {
    /// At most this many iterations, 1 and up; every bound on the way is valid, the best is kept. The cost of one
    /// grows with pairs x planes.
    pub iterations: usize,
    /// Stop when 20 iterations raise the bound by less than this share of it; 0 never stops early.
    pub settled: f64,
    /// Rounds of re-baking of the found planes, 1 and up; they end by themselves when nothing changes.
    pub rebake_rounds: usize,
}

/// The bound is computed after this many iterations: it costs about as much as one.
const CHECK_EVERY: usize = 20;

impl Default for CertificateOptions {
    fn default() -> Self {
        Self { iterations: 300, settled: 5e-4, rebake_rounds: 20 }
    }
}

/// What is proven.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Certificate {
    /// No choice from the pool has a smaller training error, as `shadow_error`.
    pub lower_bound: f64,
    /// Training error of the planes found.
    pub found: f64,
    /// `found - lower_bound`.
    pub gap: f64,
    /// Planes that may be chosen: as many as were found.
    pub planes: usize,
    /// Planes in the pool.
    pub pool: usize,
    /// Pairs that all this is about.
    pub pairs: usize,
    /// Iterations spent.
    pub iterations: usize,
    /// Did the search for further planes that the prices call for find none? See `columns`.
    pub settled: bool,
}

/// Certifies the planes `found` (indices into `pool`).
///
/// # Panics
/// An index is outside the pool, or two found planes belong to one family.
#[must_use]
pub fn certify(pairs: &PairTable, pool: &[PoolPlane], found: &[usize], options: &CertificateOptions) -> Certificate {
    prove(pairs, pool, found, options).0
}

/// The certificate with the multipliers that prove it, and the values of the families at these.
pub(crate) fn prove(
    pairs: &PairTable,
    pool: &[PoolPlane],
    found: &[usize],
    options: &CertificateOptions,
) -> (Certificate, Multipliers, Vec<f64>) {
    for (k, plane) in found.iter().enumerate() {
        let alone = found[..k].iter().all(|other| pool[*other].family != pool[*plane].family);
        assert!(alone, "two found planes belong to family {}", pool[*plane].family);
    }
    let instance = Instance::new(pairs, pool);
    let mut certificate = Certificate {
        found: instance.rebaked_error(found, options.rebake_rounds),
        planes: found.len(),
        pool: pool.len(),
        pairs: pairs.len(),
        ..Certificate::default()
    };
    let mut saddle = Saddle::new(&instance, found.len());
    let mut best = (saddle.bound(), saddle.multipliers().clone());
    while certificate.iterations < options.iterations {
        let before = best.0.lower_bound;
        for _ in 0..CHECK_EVERY.min(options.iterations - certificate.iterations) {
            saddle.advance();
            certificate.iterations += 1;
        }
        let bound = saddle.bound();
        if bound.lower_bound > best.0.lower_bound {
            best = (bound, saddle.multipliers().clone());
        }
        let reached = best.0.lower_bound;
        let settled = reached > 0.0 && reached - before < options.settled * reached;
        if settled || certificate.found - reached <= options.settled * certificate.found {
            break;
        }
    }
    certificate.lower_bound = best.0.lower_bound;
    certificate.gap = certificate.found - certificate.lower_bound;
    (certificate, best.1, best.0.values)
}
