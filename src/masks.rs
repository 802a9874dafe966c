//! Masks of two renderers, pixel by pixel: how much shadow one lacks and has too much, and pictures of that.
//!
//! In: frames of [`Mode::Mask`](crate::render::Mode::Mask) of the same view and light, the first from the reference.

use image::{Rgba, RgbaImage};
use rayon::prelude::*;

/// Mean FLIP is computed for a screen seen at 67 pixels per degree: 0.7 m away, 0.7 m and 3840 pixels wide, the
/// default of Andersson et al., "FLIP: A Difference Evaluator for Alternating Images" (2020).
#[cfg(feature = "flip")]
const FLIP_PIXELS_PER_DEGREE: f32 = 67.0;

/// Sums over the pixels that both masks cover.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaskErrors {
    /// Pixels.
    pub covered: f64,
    /// Light drawn where there is shadow, in pixels.
    pub missed: f64,
    /// Shadow drawn where there is light, in pixels.
    pub false_: f64,
}

impl MaskErrors {
    /// Missed and false shadow of `drawn`.
    #[must_use]
    pub fn between(traced: &RgbaImage, drawn: &RgbaImage) -> Self {
        Self::where_seen(traced, drawn, |_| true)
    }

    /// The same over the pixels (counted row by row) for which `counts` says so.
    #[must_use]
    pub fn where_seen(traced: &RgbaImage, drawn: &RgbaImage, counts: impl Fn(usize) -> bool + Sync) -> Self {
        // Few enough pixels for an even load, enough for the sums to be cheap; fixed, so that the result is.
        const CHUNK: usize = 1024;
        let pixel = |(i, (t, d)): (usize, (&[u8], &[u8]))| {
            let covered = t[2] == 255 && d[2] == 255 && counts(i);
            let facing = covered && t[1] == 255 && d[1] == 255;
            let wrong = if facing { (f64::from(d[0]) - f64::from(t[0])) / 255.0 } else { 0.0 };
            Self { covered: f64::from(u8::from(covered)), missed: wrong.max(0.0), false_: (-wrong).max(0.0) }
        };
        let rows = traced.as_raw().par_chunks(4 * CHUNK).zip(drawn.as_raw().par_chunks(4 * CHUNK)).enumerate();
        let sums: Vec<Self> = rows
            .map(|(row, (t, d))| {
                let pixels = (CHUNK * row..).zip(t.chunks_exact(4).zip(d.chunks_exact(4)));
                pixels.map(pixel).fold(Self::default(), Self::plus)
            })
            .collect();
        sums.into_iter().fold(Self::default(), Self::plus)
    }

    /// Sums.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            covered: self.covered + other.covered,
            missed: self.missed + other.missed,
            false_: self.false_ + other.false_,
        }
    }

    /// Wrong pixels.
    #[must_use]
    pub fn wrong(&self) -> f64 {
        self.missed + self.false_
    }

    /// `pixels` as a share of the covered ones; 0 where nothing is covered.
    #[must_use]
    pub fn share(&self, pixels: f64) -> f64 {
        if self.covered > 0.0 { pixels / self.covered } else { 0.0 }
    }
}

/// Grey where right, orange where shadow is missing, blue where it is too much (Okabe and Ito's safe colours).
#[must_use]
pub fn difference(traced: &RgbaImage, drawn: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(traced.width(), traced.height(), |x, y| {
        let (t, d) = (traced.get_pixel(x, y).0, drawn.get_pixel(x, y).0);
        if t[2] == 0 || d[2] == 0 {
            return Rgba([255, 255, 255, 255]);
        }
        let grey = 90.0 + f32::from(t[0]) / 255.0 * 120.0;
        let wrong = if t[1] == 255 && d[1] == 255 { (f32::from(d[0]) - f32::from(t[0])) / 255.0 } else { 0.0 };
        let tint = if wrong > 0.0 { [213.0, 94.0, 0.0] } else { [0.0, 114.0, 178.0] };
        let mixed = tint.map(|c| (grey + (c - grey) * wrong.abs()).round() as u8);
        Rgba([mixed[0], mixed[1], mixed[2], 255])
    })
}

/// One picture of several of one height, from left to right.
#[must_use]
pub fn side_by_side(pictures: &[&RgbaImage]) -> RgbaImage {
    let width: u32 = pictures.iter().map(|p| p.width()).sum();
    let mut out = RgbaImage::new(width, pictures[0].height());
    let mut left = 0;
    for picture in pictures {
        image::imageops::replace(&mut out, *picture, left, 0);
        left += i64::from(picture.width());
    }
    out
}

/// Mean FLIP difference, or `None` where the feature is off.
#[cfg(feature = "flip")]
#[must_use]
pub fn mean_flip(reference: &RgbaImage, picture: &RgbaImage) -> Option<f64> {
    let image = |rgba: &RgbaImage| {
        let rgb: Vec<u8> = rgba.pixels().flat_map(|p| [p.0[0], p.0[1], p.0[2]]).collect();
        nv_flip::FlipImageRgb8::with_data(rgba.width(), rgba.height(), &rgb)
    };
    let map = nv_flip::flip(image(reference), image(picture), FLIP_PIXELS_PER_DEGREE);
    Some(f64::from(nv_flip::FlipPool::from_image(&map).mean()))
}

/// Mean FLIP difference, or `None` where the feature is off.
#[cfg(not(feature = "flip"))]
#[must_use]
pub fn mean_flip(_: &RgbaImage, _: &RgbaImage) -> Option<f64> {
    None
}
