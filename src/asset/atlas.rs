//! Packs occluder textures into atlases, three planes to an RGB texel.
//!
//! In: textures of any size up to [`MAX_SIDE_PX`]. Out: RGB8 pictures, and for each texture its place: atlas,
//! channel, region. Each channel of each atlas is a sheet of its own that textures fill independently.
//!
//! Method: skyline bottom-left (Jylänki, "A Thousand Ways to Pack the Bin", 2010) on the three sheets at once,
//! tallest texture first; every texture goes where its upper edge ends lowest, which also levels the channels.
//! Many atlas widths are tried and the smallest area kept. Deterministic; no rotation; sides are not rounded up
//! to powers of two: occluder textures have no mip maps, and rounding costs up to 3/4 of the bytes.
//! Textures that are equal share a region.
//! Guaranteed: regions of one channel never overlap but where they are the same. Not guaranteed: the smallest atlas there is.

use super::AssetError;
use image::{ExtendedColorType, ImageEncoder, codecs::png};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shadowfit_solver::plane::{OccluderTexture, distinct};
use std::cmp::Reverse;

/// Longest side of an atlas: every WebGL2 and WebGPU device takes 4096 or more in practice (2048 and 8192 are
/// the specified minima).
pub const MAX_SIDE_PX: u32 = 4096;

/// Atlas widths tried between the two bounds of [`candidate_widths`]. Random sides of 3 to 300 fill 79 % of the
/// atlas with 11 textures, 90 % with 40, 95 % with 384 (27 ms). 16 widths lose up to 2 %; 256 widths, or sorting
/// by area or by the longest side as well, win less than 1 %.
const WIDTHS: u32 = 64;

/// The colour channel that holds a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
}

const CHANNELS: [Channel; 3] = [Channel::R, Channel::G, Channel::B];

/// Where a texture lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Index of the atlas.
    pub atlas: usize,
    /// Its channel.
    pub channel: Channel,
    /// Left edge, texels.
    pub x: u32,
    /// Upper edge, texels.
    pub y: u32,
}

/// Sizes of the atlases and the place of every texture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// `[width, height]` of each atlas, texels.
    pub atlases: Vec<[u32; 2]>,
    /// One a texture, in the order given.
    pub placements: Vec<Placement>,
}

impl Layout {
    /// Bytes of the atlases on the GPU: three channels of one byte.
    #[must_use]
    pub fn texture_bytes(&self) -> u64 {
        self.atlases.iter().map(|[w, h]| 3 * u64::from(*w) * u64::from(*h)).sum()
    }
}

/// Finds a place for textures of the given `[width, height]`. `None` where one is empty or longer than
/// [`MAX_SIDE_PX`].
#[must_use]
pub fn pack(sizes: &[[u32; 2]]) -> Option<Layout> {
    if sizes.iter().flatten().any(|&side| side == 0 || side > MAX_SIDE_PX) {
        return None;
    }
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&i| (Reverse(sizes[i][1]), Reverse(sizes[i][0]), i));
    let mut layout = Layout::default();
    let mut places = vec![None; sizes.len()];
    while !order.is_empty() {
        // The smallest atlas that takes all, or a full one and the rest in the next.
        let widths = candidate_widths(sizes, &order);
        let trials: Vec<Trial> = widths.into_par_iter().map(|width| Trial::new(sizes, &order, width)).collect();
        let complete = trials.into_iter().filter(|trial| trial.left_over.is_empty());
        let best = complete.min_by_key(Trial::cost).unwrap_or_else(|| Trial::new(sizes, &order, MAX_SIDE_PX));
        for &(i, channel, [x, y]) in &best.placed {
            places[i] = Some(Placement { atlas: layout.atlases.len(), channel: CHANNELS[channel], x, y });
        }
        layout.atlases.push([best.width, best.height]);
        order = best.left_over;
    }
    layout.placements = places.into_iter().collect::<Option<_>>()?;
    Some(layout)
}

/// Widths around the side of the square that a third of the area fills, never narrower than a texture.
fn candidate_widths(sizes: &[[u32; 2]], order: &[usize]) -> Vec<u32> {
    let area: f64 = order.iter().map(|&i| f64::from(sizes[i][0]) * f64::from(sizes[i][1])).sum();
    let widest = order.iter().map(|&i| sizes[i][0]).max().unwrap_or(1);
    let square = (area / 3.0).sqrt();
    let low = ((0.7 * square) as u32).clamp(widest, MAX_SIDE_PX);
    let high = ((1.6 * square) as u32).clamp(low, MAX_SIDE_PX);
    let mut widths: Vec<u32> = (0..=WIDTHS).map(|step| low + (high - low) * step / WIDTHS).collect();
    widths.push(MAX_SIDE_PX);
    widths.dedup();
    widths
}

/// One atlas filled at a given width.
struct Trial {
    width: u32,
    height: u32,
    /// (texture, channel, [x, y]).
    placed: Vec<(usize, usize, [u32; 2])>,
    left_over: Vec<usize>,
}

impl Trial {
    fn new(sizes: &[[u32; 2]], order: &[usize], width: u32) -> Self {
        let mut sheets = [Skyline::new(width), Skyline::new(width), Skyline::new(width)];
        let mut trial = Self { width, height: 0, placed: Vec::new(), left_over: Vec::new() };
        for &i in order {
            let [w, h] = sizes[i];
            let spots = sheets.iter().enumerate().filter_map(|(c, sheet)| sheet.lowest(w).map(|(x, y)| (y, c, x)));
            match spots.min() {
                Some((y, channel, x)) if y + h <= MAX_SIDE_PX => {
                    sheets[channel].cover(x, w, y + h);
                    trial.height = trial.height.max(y + h);
                    trial.placed.push((i, channel, [x, y]));
                }
                _ => trial.left_over.push(i),
            }
        }
        // Textures may leave the right edge unused.
        trial.width = trial.placed.iter().map(|&(i, _, [x, _])| x + sizes[i][0]).max().unwrap_or(1);
        trial
    }

    /// Area first, then the squarer one.
    fn cost(&self) -> (u64, u32) {
        (u64::from(self.width) * u64::from(self.height), self.width.abs_diff(self.height))
    }
}

/// The lower limit of free space on a sheet: steps `(x, y, width)` from left to right.
struct Skyline(Vec<(u32, u32, u32)>);

impl Skyline {
    fn new(width: u32) -> Self {
        Self(vec![(0, 0, width)])
    }

    /// The spot `(x, y)` for something `width` wide with the smallest y, then the smallest x.
    fn lowest(&self, width: u32) -> Option<(u32, u32)> {
        let right = self.0.last().map_or(0, |&(x, _, w)| x + w);
        let fits = self.0.iter().enumerate().filter(|(_, step)| step.0 + width <= right);
        let spots = fits.map(|(i, &(x, ..))| {
            let under = self.0[i..].iter().take_while(|step| step.0 < x + width);
            (under.map(|step| step.1).max().unwrap_or(0), x)
        });
        spots.min().map(|(y, x)| (x, y))
    }

    /// Raises the limit to `top` from `x` to `x + width`.
    fn cover(&mut self, x: u32, width: u32, top: u32) {
        let mut steps = Vec::with_capacity(self.0.len() + 2);
        for &(sx, sy, sw) in &self.0 {
            let (left, right) = (x.clamp(sx, sx + sw), (x + width).clamp(sx, sx + sw));
            steps.extend((left > sx).then_some((sx, sy, left - sx)));
            steps.extend((sx..sx + sw).contains(&x).then_some((x, top, width)));
            steps.extend((sx + sw > right).then_some((right, sy, sx + sw - right)));
        }
        // Neighbours of one height are one step.
        steps.dedup_by(|b, a| {
            let joins = a.1 == b.1;
            a.2 += if joins { b.2 } else { 0 };
            joins
        });
        self.0 = steps;
    }
}

/// An atlas as a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Atlas {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// PNG, RGB8 without colour space chunks: the texels are data, not colour.
    pub png: Vec<u8>,
}

/// Checks, packs and encodes textures. The layout has a place for each of them, the same for equal ones.
///
/// # Errors
/// A texture whose size does not fit its texels, that is smaller than 3 x 3 or larger than [`MAX_SIDE_PX`], or
/// whose outermost ring is not open.
pub fn build(textures: &[&OccluderTexture]) -> Result<(Layout, Vec<Atlas>), AssetError> {
    for (plane, texture) in textures.iter().enumerate() {
        checked_size(texture).map_err(|why| AssetError::Plane { plane, why })?;
    }
    let (stored, number_of) = distinct(textures.iter().copied());
    let sizes: Vec<[u32; 2]> = stored.iter().map(|texture| [texture.width as u32, texture.height as u32]).collect();
    let mut layout = pack(&sizes).ok_or(AssetError::Plane { plane: 0, why: "the textures cannot be packed".into() })?;
    let mut pixels: Vec<Vec<u8>> = layout.atlases.iter().map(|[w, h]| vec![0; 3 * *w as usize * *h as usize]).collect();
    for (texture, place) in stored.iter().zip(&layout.placements) {
        let width = layout.atlases[place.atlas][0] as usize;
        for (row, texels) in texture.texels.chunks_exact(texture.width).enumerate() {
            let start = (place.y as usize + row) * width + place.x as usize;
            for (column, &texel) in texels.iter().enumerate() {
                pixels[place.atlas][3 * (start + column) + place.channel as usize] = texel;
            }
        }
    }
    layout.placements = number_of.iter().map(|&number| layout.placements[number]).collect();
    let encoded = layout
        .atlases
        .iter()
        .zip(&pixels)
        .map(|(&[width, height], pixels)| Ok(Atlas { width, height, png: encode(width, height, pixels)? }));
    let atlases = encoded.collect::<Result<_, _>>()?;
    Ok((layout, atlases))
}

/// `[width, height]` of a texture that can be packed, or what is wrong with it.
pub(super) fn checked_size(texture: &OccluderTexture) -> Result<[u32; 2], String> {
    let (w, h) = (texture.width, texture.height);
    let sides = 3..=MAX_SIDE_PX as usize;
    if !sides.contains(&w) || !sides.contains(&h) {
        return Err(format!("the texture is {w} x {h} texels, sides of 3 to {MAX_SIDE_PX} can be stored"));
    }
    if texture.texels.len() != w * h {
        return Err(format!("the texture has {} texels for {w} x {h}", texture.texels.len()));
    }
    let on_ring = |i: usize| i < w || i >= w * (h - 1) || [0, w - 1].contains(&(i % w));
    match texture.texels.iter().enumerate().find(|&(i, &texel)| on_ring(i) && !texture.is_open(texel)) {
        Some((i, _)) => Err(format!("the outermost ring of texels must be open, ({}, {}) is not", i % w, i / w)),
        None => Ok([w as u32, h as u32]),
    }
}

/// PNG bytes, the shorter of two encodings. Coverage is flat: on 256 and 1024 texel blobs no filter gives 5.0, 10.0 and
/// 63.6 kB, the best of the others 6.0, 12.4 and 73.1 kB, an adaptive choice 6.0, 14.1 and 77.1 kB. Distance fields are
/// slopes: 300 and 2000 small ones take 238 and 1575 kB without a filter, 140 and 920 kB with Paeth's, which an adaptive
/// choice betters by less than 1 %.
fn encode(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, AssetError> {
    let with = |filter| {
        let mut png = Vec::new();
        let encoder = png::PngEncoder::new_with_quality(&mut png, png::CompressionType::Best, filter);
        encoder.write_image(pixels, width, height, ExtendedColorType::Rgb8).map_err(AssetError::Encode)?;
        Ok(png)
    };
    let (flat, sloped) = rayon::join(|| with(png::FilterType::NoFilter), || with(png::FilterType::Paeth));
    let (flat, sloped) = (flat?, sloped?);
    Ok(if sloped.len() < flat.len() { sloped } else { flat })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_equal_textures_share_their_texels() {
        let layout = pack(&[[64, 32]; 3]).unwrap();
        assert_eq!(layout.atlases, [[64, 32]]);
        let channels: Vec<Channel> = layout.placements.iter().map(|p| p.channel).collect();
        assert_eq!(channels, CHANNELS);
    }

    #[test]
    fn what_does_not_fit_goes_to_another_atlas() {
        let layout = pack(&[[4096, 4096]; 4]).unwrap();
        assert_eq!(layout.atlases, [[4096, 4096]; 2]);
        assert_eq!(layout.placements[3], Placement { atlas: 1, channel: Channel::R, x: 0, y: 0 });
        assert_eq!(pack(&[[4097, 3]]), None);
        assert_eq!(pack(&[]), Some(Layout::default()));
    }

    #[test]
    fn a_covered_step_is_cut_in_three_and_joined_again() {
        let mut skyline = Skyline::new(10);
        skyline.cover(3, 4, 5);
        assert_eq!(skyline.0, [(0, 0, 3), (3, 5, 4), (7, 0, 3)]);
        assert_eq!(skyline.lowest(3), Some((0, 0)));
        assert_eq!(skyline.lowest(4), Some((0, 5)));
        assert_eq!(skyline.lowest(11), None);
        skyline.cover(0, 3, 5);
        assert_eq!(skyline.0, [(0, 5, 7), (7, 0, 3)]);
        skyline.cover(5, 5, 9);
        assert_eq!(skyline.0, [(0, 5, 5), (5, 9, 5)]);
    }
}
