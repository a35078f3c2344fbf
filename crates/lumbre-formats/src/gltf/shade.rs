//! From glTF materials to ours. Unsupported parameters are ignored and listed in a warning.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_math::glam::Affine2;
use lumbre_scene::{AreaLightDesc, MaterialId, NamedMaterial, TextureListing};
use lumbre_shading::{
    FURTHER_SETS, FloatTexture, ImageTexture, Material, MaterialKind, PrincipledParams, SpectrumTexture,
    Texture, VolumeParams,
};

use super::file::{File, List};
use super::json::Read;
use super::material::{AlphaMode, GltfMaterial, TextureRef};
use super::texture::{Textures, UvSets, ours};
use crate::thin::INK;
use crate::unseen::is_unseen;

/// Everything that a material contributes to a shape.
#[derive(Clone, Debug)]
pub(super) struct Dressing {
    /// The material.
    pub material: MaterialId,
    /// The alpha.
    pub alpha: Option<Arc<FloatTexture>>,
    /// The emission.
    pub area_light: Option<AreaLightDesc>,
    /// The uv sets that it uses; `None` without textures.
    pub sets: Option<UvSets>,
    /// The uv set for tangents, if it needs tangents.
    pub tangents: Option<usize>,
}

/// The index in the file, whether vertices have colours, and whether it is [`INK`].
type MaterialKey = (Option<usize>, bool, bool);

/// The materials of a file, converted on first use.
pub(super) struct Materials<'f> {
    file: &'f File<'f>,
    textures: Textures<'f>,
    made: RefCell<HashMap<MaterialKey, Arc<Dressing>>>,
    list: RefCell<Vec<NamedMaterial>>,
}

impl<'f> Materials<'f> {
    pub(super) fn new(file: &'f File<'f>) -> Self {
        Self { file, textures: Textures::new(file), made: RefCell::default(), list: RefCell::default() }
    }

    /// The material at an index in the file, or glTF's default, for a mesh with or without vertex colours.
    /// Points and lines without colours have a default of their own: [`INK`].
    pub(super) fn dressing(
        &self,
        index: Option<usize>,
        has_colours: bool,
        is_surface: bool,
    ) -> Read<Arc<Dressing>> {
        let is_inked = index.is_none() && !is_surface && !has_colours;
        let key = (index, has_colours, is_inked);
        if let Some(made) = self.made.borrow().get(&key) {
            return Ok(made.clone());
        }
        let parameters = match index {
            None if is_inked => GltfMaterial { base_colour: INK, metallic: 0.0, ..GltfMaterial::default() },
            None => GltfMaterial::default(),
            Some(index) => GltfMaterial::read(self.file, self.file.list(List::Materials)[index])?,
        };
        let sets = self.sets(&parameters, index);
        let seam =
            Seam { materials: self, parameters: &parameters, has_colours, sets: sets.unwrap_or_default() };
        let alpha = seam.coverage()?;
        let dressing = Arc::new(Dressing {
            material: MaterialId(self.list.borrow().len() as u32),
            area_light: if is_unseen(alpha.as_deref()) { None } else { seam.light()? },
            alpha,
            sets,
            tangents: tangent_set(&parameters),
        });
        // It stays among the parameters of others, and makes most of its textures itself.
        let each = size_of::<GltfMaterial>()
            + size_of::<Dressing>()
            + size_of::<NamedMaterial>()
            + size_of::<Material>()
            + size_of::<PrincipledParams>()
            + 16 * size_of::<SpectrumTexture>();
        self.file.budget.bytes(each as u64, "materials")?;
        let one_sided = !parameters.double_sided && !seam.is_clear();
        let material = Arc::new(Material { one_sided, ..seam.material()? });
        self.list.borrow_mut().push(NamedMaterial { name: parameters.name.clone(), material });
        self.made.borrow_mut().insert(key, dressing.clone());
        Ok(dressing)
    }

    /// The uv sets that a material uses.
    fn sets(&self, parameters: &GltfMaterial, index: Option<usize>) -> Option<UvSets> {
        let (light, texture) = shining(parameters);
        let of_light = texture.filter(|_| !light.is_black());
        let first = of_light.or(parameters.base_colour_texture).or(parameters.textures().next())?.uv_set;
        let baked = of_light.map_or(Affine2::IDENTITY, ours);
        // A map that is nearly singular, such as a scale of zero, cannot be undone.
        let is_first_lost = baked.matrix2.determinant().abs() <= 1e-12;
        let mut others: Vec<usize> =
            parameters.textures().map(|t| t.uv_set).filter(|&set| set != first || is_first_lost).collect();
        others.sort_unstable();
        others.dedup();
        if others.len() > FURTHER_SETS
            && let Some(index) = index
        {
            let message = "textures on a fifth set of texture coordinates are left out";
            self.file.warn(self.file.list(List::Materials)[index], message);
        }
        let further = std::array::from_fn(|i| others.get(i).copied());
        Some(UvSets { first, further, baked, is_first_lost })
    }

    /// All materials that were used.
    pub(super) fn into_lists(self) -> (Vec<NamedMaterial>, Vec<TextureListing>) {
        (self.list.into_inner(), self.textures.into_listing())
    }
}

/// The uv set for tangents.
fn tangent_set(m: &GltfMaterial) -> Option<usize> {
    let maps = m.normal_texture.or(m.clearcoat.normal_texture);
    let stretched = m.anisotropy.strength > 0.0;
    let set = maps.or(m.anisotropy.texture.filter(|_| stretched)).map(|texture| texture.uv_set);
    set.or(stretched.then_some(0)).filter(|_| !m.unlit)
}

/// The emission of a material, and the texture that multiplies it.
fn shining(parameters: &GltfMaterial) -> (Rgb, Option<TextureRef>) {
    if parameters.unlit {
        (parameters.base_colour, parameters.base_colour_texture)
    } else {
        (parameters.emissive, parameters.emissive_texture)
    }
}

/// The conversion of one material.
struct Seam<'s, 'f> {
    materials: &'s Materials<'f>,
    parameters: &'s GltfMaterial,
    has_colours: bool,
    sets: UvSets,
}

impl<'f> Seam<'_, 'f> {
    fn textures(&self) -> &Textures<'f> {
        &self.materials.textures
    }

    /// Whether light is transmitted: then the back is visible through the front.
    fn is_clear(&self) -> bool {
        self.parameters.transmission > 0.0 || self.parameters.diffuse_transmission.factor > 0.0
    }

    /// A colour multiplied by a texture.
    fn colour(&self, factor: Rgb, texture: Option<TextureRef>) -> Read<Arc<SpectrumTexture>> {
        let image = texture.map(|t| self.textures().colour(t, self.sets)).transpose()?.flatten();
        Ok(product(factor, Rgb::WHITE, image))
    }

    /// A number multiplied by a channel of a texture.
    fn number(&self, factor: f32, texture: Option<TextureRef>, channel: usize) -> Read<Arc<FloatTexture>> {
        let image = texture.map(|t| self.textures().channel(t, channel, self.sets)).transpose()?.flatten();
        Ok(product(factor, 1.0, image))
    }

    fn base_colour(&self) -> Read<Arc<SpectrumTexture>> {
        let colour = self.colour(self.parameters.base_colour, self.parameters.base_colour_texture)?;
        Ok(if self.has_colours {
            Arc::new(Texture::Product([colour, Arc::new(Texture::Vertices)]))
        } else {
            colour
        })
    }

    /// A normal map.
    fn normals(&self, texture: Option<TextureRef>, scale: f32) -> Read<Option<ImageTexture>> {
        Ok(texture.map(|t| self.textures().normals(t, scale, self.sets)).transpose()?.flatten())
    }

    fn material(&self) -> Read<Material> {
        let m = self.parameters;
        if m.unlit {
            let reflectance = Arc::new(Texture::Constant(Rgb::BLACK));
            return Ok(Material::new(MaterialKind::Diffuse { reflectance }));
        }
        let kind = MaterialKind::Principled(Box::new(self.principled()?));
        let normal_map = self.normals(m.normal_texture, m.normal_scale)?;
        Ok(Material { normal_map, ..Material::new(kind) })
    }

    fn principled(&self) -> Read<PrincipledParams> {
        let m = self.parameters;
        let base_color = self.base_colour()?;
        let core = match m.specular_glossiness {
            Some(s) => PrincipledParams::from_specular_glossiness(
                base_color,
                self.colour(s.specular, s.texture)?,
                self.number(s.glossiness, s.texture, 3)?,
            ),
            None => PrincipledParams {
                base_color,
                metallic: self.number(m.metallic, m.metallic_roughness_texture, 2)?,
                roughness: self.number(m.roughness, m.metallic_roughness_texture, 1)?,
                ior: m.ior,
                specular: self.number(m.specular, m.specular_texture, 3)?,
                specular_color: self.colour(m.specular_colour, m.specular_colour_texture)?,
                ..PrincipledParams::default()
            },
        };
        let directions = m.anisotropy.texture.map(|t| self.textures().directions(t, self.sets));
        let film = &m.iridescence;
        let iridescence_thickness = match film.thickness_texture {
            None => Arc::new(Texture::Constant(film.thickness_maximum)),
            Some(texture) => {
                let ends = [film.thickness_minimum, film.thickness_maximum];
                let textures = ends.map(|thickness| Arc::new(Texture::Constant(thickness)));
                Arc::new(Texture::Mix { textures, amount: self.number(1.0, Some(texture), 1)? })
            }
        };
        let volume = VolumeParams {
            attenuation_color: m.volume.attenuation_colour,
            attenuation_distance: m.volume.attenuation_distance,
            scatter_color: m.volume.multiscatter_colour,
            scatter_anisotropy: m.volume.scatter_anisotropy,
        };
        Ok(PrincipledParams {
            anisotropy: self.number(m.anisotropy.strength, None, 0)?,
            anisotropy_rotation: m.anisotropy.rotation,
            anisotropy_texture: directions.transpose()?.flatten(),
            transmission: self.number(m.transmission, m.transmission_texture, 0)?,
            dispersion: m.dispersion,
            volume: (m.volume.thickness > 0.0).then_some(volume),
            diffuse_transmission: self.number(
                m.diffuse_transmission.factor,
                m.diffuse_transmission.texture,
                3,
            )?,
            diffuse_transmission_color: self
                .colour(m.diffuse_transmission.colour, m.diffuse_transmission.colour_texture)?,
            clearcoat: self.number(m.clearcoat.factor, m.clearcoat.texture, 0)?,
            clearcoat_roughness: self.number(m.clearcoat.roughness, m.clearcoat.roughness_texture, 1)?,
            clearcoat_normal: self.normals(m.clearcoat.normal_texture, m.clearcoat.normal_scale)?,
            sheen_color: self.colour(m.sheen.colour, m.sheen.colour_texture)?,
            sheen_roughness: self.number(m.sheen.roughness, m.sheen.roughness_texture, 3)?,
            iridescence: self.number(film.factor, film.texture, 0)?,
            iridescence_ior: film.ior,
            iridescence_thickness,
            ..core
        })
    }

    fn light(&self) -> Read<Option<AreaLightDesc>> {
        let (radiance, texture) = shining(self.parameters);
        if radiance.is_black() {
            return Ok(None);
        }
        let image = texture.map(|t| self.textures().colour_map(t.texture)).transpose()?.flatten();
        // Unlit surfaces are drawings, visible from both sides.
        let two_sided = self.parameters.double_sided || self.parameters.unlit;
        // Vertex colours multiply the base colour, which an unlit surface shows.
        let by_vertices = self.has_colours && self.parameters.unlit;
        Ok(Some(AreaLightDesc { radiance, image, by_vertices, two_sided, power: None, spectrum: None }))
    }

    fn coverage(&self) -> Read<Option<Arc<FloatTexture>>> {
        let m = self.parameters;
        if m.alpha_mode == AlphaMode::Opaque {
            return Ok(None);
        }
        let mut alpha = self.number(m.base_alpha, m.base_colour_texture, 3)?;
        if self.has_colours {
            alpha = Arc::new(Texture::Product([alpha, Arc::new(Texture::Vertices)]));
        }
        let AlphaMode::Mask { cutoff } = m.alpha_mode else {
            return Ok(if matches!(*alpha, Texture::Constant(1.0)) { None } else { Some(alpha) });
        };
        Ok(match *alpha {
            Texture::Constant(value) if value >= cutoff => None,
            Texture::Constant(_) => Some(Arc::new(Texture::Constant(0.0))),
            _ => Some(Arc::new(Texture::Step { input: alpha, edge: cutoff, values: [0.0, 1.0] })),
        })
    }
}

/// A factor on an image; `one` changes nothing.
fn product<T: lumbre_shading::TextureValue + PartialEq>(
    factor: T,
    one: T,
    image: Option<Arc<Texture<T>>>,
) -> Arc<Texture<T>> {
    match image {
        None => Arc::new(Texture::Constant(factor)),
        Some(image) if factor == one => image,
        Some(image) => Arc::new(Texture::Product([image, Arc::new(Texture::Constant(factor))])),
    }
}
