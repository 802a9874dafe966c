//! Occluder textures -> layers of one texture array, a texture a channel (R, G, B, A).
//!
//! Shelf packing (J. Jylanki, "A Thousand Ways to Pack the Bin", 2010, SHELF-NF by falling height): textures fill
//! rows, rows fill a channel, channels fill layers. Regions touch: taps are clamped to the region, so no texel of
//! a neighbour is read. Equal textures share a slot.

use super::RenderError;
use shadowfit_solver::plane::{Encoding, OccluderTexture, distinct};

/// Where one texture lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Slot {
    /// Left upper corner, texels.
    pub corner: [u32; 2],
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Layer of the array.
    pub layer: u32,
    /// 0 to 3.
    pub channel: u32,
    /// What a texel means.
    pub encoding: Encoding,
}

/// All textures of a list of planes.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// Width and height of a layer.
    pub side: u32,
    /// Layers; wgpu's GL backend takes 1 for no array and multiples of 6 for cube maps, so neither occurs.
    pub layers: u32,
    /// RGBA, `[layer][row][column]`.
    pub rgba: Vec<u8>,
    /// One a texture, in their order.
    pub slots: Vec<Slot>,
}

impl Atlas {
    /// Packs `textures` into layers of at most `max_side` texels, at most `max_layers` of them.
    ///
    /// # Errors
    /// [`RenderError::TooLarge`] where they do not fit.
    pub fn pack(textures: &[&OccluderTexture], max_side: u32, max_layers: u32) -> Result<Self, RenderError> {
        let (stored, number_of) = distinct(textures.iter().copied());
        let side = layer_side(&stored);
        if side > max_side {
            return Err(RenderError::TooLarge {
                what: "the sides of occluder textures",
                needed: u64::from(side),
                limit: u64::from(max_side),
            });
        }
        let slots = shelve(&stored, side);
        let used = slots.iter().map(|slot| slot.layer + 1).max().unwrap_or(1);
        let layers = if used == 1 || used % 6 == 0 { used + 1 } else { used };
        if layers > max_layers {
            return Err(RenderError::TooLarge {
                what: "occluder atlas layers",
                needed: u64::from(layers),
                limit: u64::from(max_layers),
            });
        }
        let mut rgba = vec![0; 4 * side as usize * side as usize * layers as usize];
        for (texture, slot) in stored.iter().zip(&slots) {
            copy(texture, slot, side as usize, &mut rgba);
        }
        let slots = number_of.into_iter().map(|number| slots[number]).collect();
        Ok(Self { side, layers, rgba, slots })
    }
}

/// The largest texture's side, or the side of a square whose four channels hold all texels: few layers, little
/// waste.
fn layer_side(textures: &[&OccluderTexture]) -> u32 {
    let largest = textures.iter().map(|t| t.width.max(t.height)).max().unwrap_or(1);
    let texels: usize = textures.iter().map(|t| t.width * t.height).sum();
    // At most 1024 for the sake of sharing: more texels make more layers, not wider ones.
    let shared = ((texels as f64 / 4.0).sqrt().ceil() as usize).min(1024);
    largest.max(shared) as u32
}

fn shelve(textures: &[&OccluderTexture], side: u32) -> Vec<Slot> {
    let mut order: Vec<usize> = (0..textures.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse((textures[i].height, textures[i].width)), i));
    let mut slots = vec![Slot::default(); textures.len()];
    // The next free corner, the height of the present row, and the present channel counted over all layers.
    let (mut x, mut y, mut row_height, mut page) = (0, 0, 0, 0);
    for i in order {
        let size = [textures[i].width as u32, textures[i].height as u32];
        if x + size[0] > side {
            (x, y, row_height) = (0, y + row_height, 0);
        }
        if y + size[1] > side {
            (x, y, row_height, page) = (0, 0, 0, page + 1);
        }
        let encoding = textures[i].encoding;
        slots[i] = Slot { corner: [x, y], size, layer: page / 4, channel: page % 4, encoding };
        (x, row_height) = (x + size[0], row_height.max(size[1]));
    }
    slots
}

fn copy(texture: &OccluderTexture, slot: &Slot, side: usize, rgba: &mut [u8]) {
    let [left, top] = slot.corner.map(|n| n as usize);
    for (row, texels) in texture.texels.chunks_exact(texture.width).enumerate() {
        let first = ((slot.layer as usize * side + top + row) * side + left) * 4 + slot.channel as usize;
        for (column, &texel) in texels.iter().enumerate() {
            rgba[first + 4 * column] = texel;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(width: usize, height: usize, texel: u8) -> OccluderTexture {
        OccluderTexture { width, height, encoding: Encoding::Coverage, texels: vec![texel; width * height] }
    }

    #[test]
    fn every_texture_keeps_its_texels() {
        let sizes = [(3, 5), (64, 64), (17, 80), (80, 3), (64, 64), (5, 5), (33, 21), (80, 80), (80, 79), (9, 70)];
        let textures: Vec<_> = sizes.iter().enumerate().map(|(i, s)| texture(s.0, s.1, i as u8 + 1)).collect();
        let atlas = Atlas::pack(&textures.iter().collect::<Vec<_>>(), 4096, 256).unwrap();
        for (texture, slot) in textures.iter().zip(&atlas.slots) {
            for y in slot.corner[1]..slot.corner[1] + slot.size[1] {
                for x in slot.corner[0]..slot.corner[0] + slot.size[0] {
                    let texel = ((slot.layer * atlas.side + y) * atlas.side + x) * 4 + slot.channel;
                    assert_eq!(atlas.rgba[texel as usize], texture.texels[0]);
                }
            }
        }
        let written: usize = textures.iter().map(|t| t.texels.len()).sum();
        assert_eq!(atlas.rgba.iter().filter(|&&byte| byte != 0).count(), written, "regions overlap");
    }

    #[test]
    fn no_textures_make_one_texel_a_layer() {
        let atlas = Atlas::pack(&[], 4096, 256).unwrap();
        assert_eq!((atlas.side, atlas.layers, atlas.rgba.len()), (1, 2, 8));
    }

    #[test]
    fn a_texture_above_the_limit_is_an_error() {
        assert!(matches!(Atlas::pack(&[&texture(65, 3, 1)], 64, 4), Err(RenderError::TooLarge { .. })));
        let full: Vec<_> = (1..=17).map(|texel| texture(64, 64, texel)).collect();
        assert!(matches!(Atlas::pack(&full.iter().collect::<Vec<_>>(), 64, 4), Err(RenderError::TooLarge { .. })));
    }

    #[test]
    fn equal_textures_share_a_slot() {
        let [a, b] = [1, 2].map(|texel| texture(64, 64, texel));
        let atlas = Atlas::pack(&[&a, &b, &a, &a.clone(), &b], 64, 4).unwrap();
        assert_eq!(atlas.slots[0], atlas.slots[2]);
        assert_eq!(atlas.slots[0], atlas.slots[3]);
        assert_eq!(atlas.slots[1], atlas.slots[4]);
        assert_ne!(atlas.slots[0], atlas.slots[1]);
        assert_eq!(atlas.rgba.iter().filter(|&&byte| byte != 0).count(), 2 * 64 * 64);
    }
}
