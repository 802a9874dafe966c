//! Materials: sides, base colour, cut-outs, and where the texture coordinates come from.
//!
//! In: a material's index. Out: a [`Surface`]. Materials are prepared on first use, so a texture that nothing
//! draws is never decoded. An image that cannot be had (missing, damaged, a format other than PNG and JPEG) is no
//! reason to refuse an opaque model: the shadows do not depend on it, and it is drawn with the factor. For a
//! cut-out it is one: without the alpha the shape is unknown.

use super::{
    Fault, Material, Notices,
    accessor::Data,
    document::{self, Listed, TextureInfo, TextureTransform, record},
};
use crate::{
    gltf_file::{GltfFile, UriError},
    render::linear_from_srgb,
};
use glam::{DAffine2, DVec2};
use gltf::json::{material::AlphaMode, texture::WrappingMode};
use image::{ImageFormat, ImageReader, Limits, RgbaImage};
use shadowfit_solver::mesh::{Cutout, Sides};
use std::{collections::HashMap, io::Cursor, sync::Arc};

/// Largest image, texels: 8192 x 8192 is the largest texture every GPU takes; a PNG of 70 kB can claim it.
pub const MAX_IMAGE_TEXELS: u64 = 1 << 26;

/// Texels of all images and cut-outs together: 1 GiB decoded. Sixteen textures of 4096 x 4096 fit.
pub const MAX_TEXELS: u64 = 1 << 28;

/// What the triangles of a material need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Index into the scene's materials.
    pub material: u32,
    /// Drawn sides.
    pub sides: Sides,
    /// Index of the cut-out.
    pub cutout: Option<u32>,
    /// False where the whole material is below its alpha cutoff.
    pub is_visible: bool,
    /// Texture coordinates, where there is a base colour texture.
    pub uv: Option<UvSource>,
}

/// Where texture coordinates come from.
#[derive(Clone, Copy, Debug)]
pub(super) struct UvSource {
    /// The `n` of TEXCOORD_n.
    pub set: usize,
    /// `KHR_texture_transform`.
    pub texture_from_mesh: DAffine2,
}

/// The materials of a document, prepared on demand.
pub(super) struct Surfaces<'a> {
    file: &'a GltfFile<'a>,
    data: &'a Data<'a>,
    prepared: Vec<Option<Surface>>,
    image_of: HashMap<usize, Result<usize, Fault>>,
    texels: u64,
    /// One a material of the document, after the default.
    pub materials: Vec<Material>,
    /// Decoded images.
    pub images: Vec<Arc<RgbaImage>>,
    /// Cut-outs.
    pub cutouts: Vec<Arc<Cutout>>,
}

/// Why a texture has no image.
enum NoImage {
    /// The file is broken or reaches where a model must not: no reason to draw without.
    Refused(Fault),
    /// The image is missing, damaged or of another format.
    Missing(Fault),
}

impl<'a> Surfaces<'a> {
    /// All materials with their factors, none of them prepared.
    pub(super) fn new(file: &'a GltfFile<'a>, data: &'a Data<'a>) -> Self {
        let mut materials = vec![plain(&document::Material::default())];
        materials.extend(data.document.materials.iter().map(plain));
        let prepared = vec![None; materials.len()];
        let (image_of, texels) = (HashMap::new(), 0);
        Self { file, data, prepared, image_of, texels, materials, images: Vec::new(), cutouts: Vec::new() }
    }

    /// The surface of material `index`, which `user` (a JSON pointer) refers to; of the default without one.
    ///
    /// # Errors
    /// An index or mode that does not exist, a forbidden URI, or a cut-out without its image.
    pub(super) fn surface(
        &mut self,
        index: Option<usize>,
        user: &str,
        notices: &mut Notices,
    ) -> Result<Surface, Fault> {
        let slot = index.map_or(0, |index| index.saturating_add(1));
        match self.prepared.get(slot) {
            Some(Some(surface)) => return Ok(*surface),
            Some(None) => {}
            None => return Err(Fault::index(user, slot - 1, "materials", self.prepared.len() - 1)),
        }
        let default = document::Material::default();
        let record = index.and_then(|index| self.data.document.materials.get(index)).unwrap_or(&default);
        let surface = self.prepare(record, slot, notices)?;
        self.prepared[slot] = Some(surface);
        Ok(surface)
    }

    fn prepare(&mut self, record: &document::Material, slot: usize, notices: &mut Notices) -> Result<Surface, Fault> {
        let pointer = format!("/materials/{}", slot.saturating_sub(1));
        let mode = match &record.alpha_mode {
            Some(mode) => mode.get(&format!("{pointer}/alphaMode"))?,
            None => AlphaMode::Opaque,
        };
        if mode == AlphaMode::Blend {
            let why = "alphaMode BLEND: drawn as opaque; its shadow has one tint, the mean over the texture";
            notices.add("blended materials", 1, why);
        }
        let info = record.pbr_metallic_roughness.base_color_texture.as_ref();
        let info_pointer = format!("{pointer}/pbrMetallicRoughness/baseColorTexture");
        let uv = info.map(|info| uv_source(info, &info_pointer)).transpose()?;
        if let Some(info) = info {
            match self.texture(info, &info_pointer, slot, notices) {
                Ok(image) => self.materials[slot].image = Some(image),
                Err(NoImage::Refused(fault)) => return Err(fault),
                Err(NoImage::Missing(fault)) if mode == AlphaMode::Mask => return Err(fault),
                Err(NoImage::Missing(fault)) => {
                    let why = format!("drawn with the base colour factor alone; the first: {fault}");
                    notices.add("base colour textures", 1, &why);
                }
            }
        }
        if mode == AlphaMode::Blend {
            let material = &self.materials[slot];
            let image = material.image.map(|image| &*self.images[image]);
            // Exporters write BLEND for surfaces without any transparency too.
            let transmittance = transmittance(material.base_color, image);
            self.materials[slot].transmittance = (transmittance != [0.0; 3]).then_some(transmittance);
        }
        let sides = if record.double_sided { Sides::Both } else { Sides::Front };
        let mut surface = Surface { material: slot as u32, sides, cutout: None, is_visible: true, uv };
        if let Some(cutoff) = self.materials[slot].alpha_cutoff {
            let factor = self.materials[slot].base_color[3];
            match self.materials[slot].image {
                Some(image) => surface.cutout = Some(self.cutout(slot, image, factor, &pointer)?),
                None => surface.is_visible = factor >= cutoff,
            }
        }
        Ok(surface)
    }

    /// The image of a texture, and its wrapping noted in the material.
    fn texture(
        &mut self,
        info: &TextureInfo,
        pointer: &str,
        slot: usize,
        notices: &mut Notices,
    ) -> Result<usize, NoImage> {
        let document = self.data.document;
        let Some(texture) = document.textures.get(info.index) else {
            let fault = Fault::index(&format!("{pointer}/index"), info.index, "textures", document.textures.len());
            return Err(NoImage::Refused(fault));
        };
        let at = format!("/textures/{}", info.index);
        if let Some(index) = texture.sampler {
            let Some(sampler) = document.samplers.get(index) else {
                let fault = Fault::index(&format!("{at}/sampler"), index, "samplers", document.samplers.len());
                return Err(NoImage::Refused(fault));
            };
            let wraps = [&sampler.wrap_s, &sampler.wrap_t].map(|wrap| wrap.as_ref().and_then(Listed::known));
            self.materials[slot].repeat = wraps.map(|wrap| wrap != Some(WrappingMode::ClampToEdge));
            if wraps.contains(&Some(WrappingMode::MirroredRepeat)) {
                notices.add("mirrored textures", 1, "MIRRORED_REPEAT: taken as REPEAT");
            }
        }
        let Some(source) = texture.source else {
            let fault = match texture.extensions.keys().next() {
                Some(name) => image_format(name),
                None => Fault::new(format!("{at}/source"), "missing: the texture has no image"),
            };
            return Err(NoImage::Missing(fault));
        };
        if source >= document.images.len() {
            let fault = Fault::index(&format!("{at}/source"), source, "images", document.images.len());
            return Err(NoImage::Refused(fault));
        }
        if let Some(known) = self.image_of.get(&source) {
            return known.clone().map_err(NoImage::Missing);
        }
        match self.decode(source) {
            Ok(image) => {
                self.images.push(Arc::new(image));
                self.image_of.insert(source, Ok(self.images.len() - 1));
                Ok(self.images.len() - 1)
            }
            Err(NoImage::Missing(fault)) => {
                self.image_of.insert(source, Err(fault.clone()));
                Err(NoImage::Missing(fault))
            }
            Err(refused) => Err(refused),
        }
    }

    /// Decodes image `index`.
    fn decode(&mut self, index: usize) -> Result<RgbaImage, NoImage> {
        let pointer = format!("/images/{index}");
        let broken = |reason: String| NoImage::Missing(Fault::new(pointer.as_str(), reason));
        let record = &self.data.document.images[index];
        let fetched;
        let bytes: &[u8] = match (&record.uri, record.buffer_view) {
            (Some(uri), _) => {
                fetched = self.file.fetch(uri).map_err(|error| {
                    let fault = Fault::new(format!("{pointer}/uri"), error.to_string());
                    if matches!(error, UriError::Forbidden(_)) {
                        NoImage::Refused(fault)
                    } else {
                        NoImage::Missing(fault)
                    }
                })?;
                &fetched
            }
            (None, Some(view)) => self.data.view(view, &format!("{pointer}/bufferView")).map_err(NoImage::Refused)?,
            (None, None) => return Err(broken("has neither uri nor bufferView".to_owned())),
        };
        let format = image::guess_format(bytes).map_err(|error| broken(error.to_string()))?;
        if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg) {
            return Err(NoImage::Missing(image_format(&format!("the image format {format:?}"))));
        }
        let mut limits = Limits::default();
        limits.max_alloc = Some(8 * MAX_IMAGE_TEXELS);
        let reader = || {
            let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
            reader.limits(limits.clone());
            reader
        };
        // The claimed size first: the decoder would allocate it.
        let (width, height) = reader().into_dimensions().map_err(|error| broken(error.to_string()))?;
        let texels = u64::from(width) * u64::from(height);
        if texels > MAX_IMAGE_TEXELS || texels + self.texels > MAX_TEXELS {
            return Err(broken(format!(
                "{width} x {height} texels are more than MAX_IMAGE_TEXELS = {MAX_IMAGE_TEXELS}, or with the others \
                 more than MAX_TEXELS = {MAX_TEXELS}"
            )));
        }
        let image = reader().decode().map_err(|error| broken(error.to_string()))?;
        self.texels += texels;
        Ok(image.into_rgba8())
    }

    /// Adds the cut-out of material `slot` and returns its index.
    fn cutout(&mut self, slot: usize, image: usize, factor: f32, pointer: &str) -> Result<u32, Fault> {
        let pixels = &self.images[image];
        let material = &self.materials[slot];
        self.texels += u64::from(pixels.width()) * u64::from(pixels.height());
        if self.texels > MAX_TEXELS {
            return Err(Fault::new(pointer, format!("images and cut-outs exceed MAX_TEXELS = {MAX_TEXELS}")));
        }
        self.cutouts.push(Arc::new(Cutout {
            width: pixels.width() as usize,
            height: pixels.height() as usize,
            alpha: pixels.pixels().map(|p| (f32::from(p.0[3]) * factor).round() as u8).collect(),
            cutoff: material.alpha_cutoff.unwrap_or_default() * 255.0,
            repeat: material.repeat,
        }));
        Ok(self.cutouts.len() as u32 - 1)
    }
}

/// The factors of a material, without its texture.
fn plain(record: &document::Material) -> Material {
    let factor = record.pbr_metallic_roughness.base_color_factor.unwrap_or([1.0; 4]);
    let is_mask = record.alpha_mode.as_ref().and_then(Listed::known) == Some(AlphaMode::Mask);
    Material {
        base_color: factor.map(|x| x.clamp(0.0, 1.0) as f32),
        image: None,
        repeat: [true; 2],
        alpha_cutoff: is_mask.then(|| record.alpha_cutoff.unwrap_or(0.5) as f32),
        transmittance: None,
    }
}

/// `Material::transmittance` of a factor and an image.
fn transmittance(factor: [f32; 4], image: Option<&RgbaImage>) -> [f32; 3] {
    let linear: Vec<f32> = (0..=255).map(linear_from_srgb).collect();
    let of_texel = |texel: &image::Rgba<u8>| {
        let a = factor[3] * f32::from(texel.0[3]) / 255.0;
        [0, 1, 2].map(|k| {
            let c = factor[k] * linear[usize::from(texel.0[k])];
            f64::from((1.0 - a) * (1.0 - a * (1.0 - c)))
        })
    };
    let white = RgbaImage::from_pixel(1, 1, image::Rgba([255; 4]));
    let image = image.unwrap_or(&white);
    let sum = image.pixels().map(of_texel).fold([0.0; 3], |sum, t| [0, 1, 2].map(|k| sum[k] + t[k]));
    sum.map(|sum| (sum / (f64::from(image.width()) * f64::from(image.height()))) as f32)
}

fn image_format(name: &str) -> Fault {
    let remedy = "save the texture as PNG or JPEG".to_owned();
    Fault::Unsupported { features: vec![name.to_owned()], remedy }
}

/// The coordinate set and transform of a texture reference.
///
/// Positive rotations turn (u, v) clockwise where v points up: the direction of the sample model and of every
/// viewer, against the extension's first GLSL listing (KhronosGroup/glTF issue 1563).
fn uv_source(info: &TextureInfo, pointer: &str) -> Result<UvSource, Fault> {
    let transform: TextureTransform = match info.extensions.get("KHR_texture_transform") {
        Some(value) => record(value, &format!("{pointer}/extensions/KHR_texture_transform"))?,
        None => TextureTransform::default(),
    };
    let texture_from_mesh = DAffine2::from_scale_angle_translation(
        DVec2::from(transform.scale.unwrap_or([1.0; 2])),
        -transform.rotation,
        DVec2::from(transform.offset.unwrap_or([0.0; 2])),
    );
    Ok(UvSource { set: transform.tex_coord.unwrap_or(info.tex_coord), texture_from_mesh })
}
