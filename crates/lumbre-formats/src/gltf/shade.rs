//! From the materials of a glTF to ours. What ours cannot say is approximated, and a warning lists it.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_math::glam::Affine2;
use lumbre_scene::{AreaLightDesc, MaterialId, NamedMaterial};
use lumbre_shading::{FloatTexture, Material, MaterialKind, Roughness, SpectrumTexture, Texture};

use super::file::{File, List};
use super::json::Read;
use super::material::{AlphaMode, GltfMaterial, TextureRef};
use super::texture::{Textures, UvSets, ours};
use crate::diagnostic::Diagnostic;

/// All that a material gives to a shape.
#[derive(Clone, Debug)]
pub(super) struct Dressing {
    /// What it is made of.
    pub material: MaterialId,
    /// How much of it covers what is behind.
    pub alpha: Option<Arc<FloatTexture>>,
    /// The light that it gives.
    pub area_light: Option<AreaLightDesc>,
    /// The texture coordinates that it wants; `None` when it has no textures.
    pub sets: Option<UvSets>,
}

type MaterialKey = (Option<usize>, bool);

/// The materials of a file, each made when it is first asked for.
pub(super) struct Materials<'f> {
    file: &'f File<'f>,
    textures: Textures<'f>,
    /// By position in the file and whether vertices have colours.
    made: RefCell<HashMap<MaterialKey, Arc<Dressing>>>,
    list: RefCell<Vec<NamedMaterial>>,
    /// What was approximated.
    approximated: RefCell<BTreeSet<&'static str>>,
}

impl<'f> Materials<'f> {
    pub fn new(file: &'f File<'f>) -> Self {
        Self {
            file,
            textures: Textures::new(file),
            made: RefCell::default(),
            list: RefCell::default(),
            approximated: RefCell::default(),
        }
    }

    /// The material at a position in the file, or glTF's default, for a mesh with or without colours at its vertices.
    pub fn dressing(&self, index: Option<usize>, has_colours: bool) -> Read<Arc<Dressing>> {
        if let Some(made) = self.made.borrow().get(&(index, has_colours)) {
            return Ok(made.clone());
        }
        let parameters = match index {
            None => GltfMaterial::default(),
            Some(index) => GltfMaterial::read(self.file, self.file.list(List::Materials)[index])?,
        };
        let sets = self.sets(&parameters, index);
        let seam =
            Seam { materials: self, parameters: &parameters, has_colours, sets: sets.unwrap_or_default() };
        let dressing = Arc::new(Dressing {
            material: MaterialId(self.list.borrow().len() as u32),
            alpha: seam.coverage()?,
            area_light: seam.light()?,
            sets,
        });
        let material = Arc::new(seam.material()?);
        self.list.borrow_mut().push(NamedMaterial { name: parameters.name.clone(), material });
        self.made.borrow_mut().insert((index, has_colours), dressing.clone());
        Ok(dressing)
    }

    /// Which texture coordinates a material wants.
    fn sets(&self, parameters: &GltfMaterial, index: Option<usize>) -> Option<UvSets> {
        let (light, texture) = shining(parameters);
        let of_light = texture.filter(|_| !light.is_black());
        let first = of_light.or(parameters.base_colour_texture).or(parameters.textures().next())?.uv_set;
        let mut others: Vec<usize> =
            parameters.textures().map(|t| t.uv_set).filter(|&set| set != first).collect();
        others.sort_unstable();
        others.dedup();
        if others.len() > 1
            && let Some(index) = index
        {
            let message = "textures on a third set of texture coordinates were left out";
            self.file.warn(self.file.list(List::Materials)[index], message);
        }
        let baked = of_light.map_or(Affine2::IDENTITY, ours);
        let is_invertible = baked.matrix2.determinant().abs() > 1e-12;
        let baked = if is_invertible { baked } else { Affine2::IDENTITY };
        Some(UvSets { first, second: others.first().copied(), baked })
    }

    /// All materials that were asked for, after a warning of what was approximated.
    pub fn into_list(self) -> Vec<NamedMaterial> {
        let approximated = self.approximated.into_inner();
        if !approximated.is_empty() {
            let list: Vec<&str> = approximated.into_iter().collect();
            let warning =
                Diagnostic::warning("parameters of materials are approximated").at(self.file.whole());
            self.file.push(warning.found(list.join(", ")));
        }
        self.list.into_inner()
    }
}

/// The light that a material gives, and the texture that is a factor on it.
fn shining(parameters: &GltfMaterial) -> (Rgb, Option<TextureRef>) {
    if parameters.unlit {
        (parameters.base_colour, parameters.base_colour_texture)
    } else {
        (parameters.emissive, parameters.emissive_texture)
    }
}

/// One material on its way from glTF's parameters to ours.
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

    fn approximate(&self, what: &'static str) {
        self.materials.approximated.borrow_mut().insert(what);
    }

    /// A colour with the texture that is a factor on it.
    fn colour(&self, factor: Rgb, texture: Option<TextureRef>) -> Read<Arc<SpectrumTexture>> {
        let image = texture.map(|t| self.textures().colour(t, self.sets)).transpose()?.flatten();
        Ok(product(factor, Rgb::WHITE, image))
    }

    /// A number with the channel of a texture that is a factor on it.
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

    fn roughness(&self) -> Read<Roughness> {
        let m = self.parameters;
        let (factor, texture, channel, glossiness) = match m.specular_glossiness {
            Some(s) => (s.glossiness, s.texture, 3, true),
            None => (m.roughness, m.metallic_roughness_texture, 1, false),
        };
        let image = texture.map(|t| self.textures().alpha(t, channel, factor, glossiness, self.sets));
        let texture = image.transpose()?.flatten().unwrap_or_else(|| {
            let roughness = if glossiness { 1.0 - factor } else { factor };
            Arc::new(Texture::Constant(roughness * roughness))
        });
        Ok(Roughness { u: texture.clone(), v: texture, remap: false })
    }

    fn material(&self) -> Read<Material> {
        let m = self.parameters;
        if m.unlit {
            if self.has_colours {
                self.approximate("vertex colours of unlit materials");
            }
            let reflectance = Arc::new(Texture::Constant(Rgb::BLACK));
            return Ok(Material::new(MaterialKind::Diffuse { reflectance }));
        }
        let mut kind = self.opaque()?;
        if m.diffuse_transmission.factor > 0.0 {
            let d = &m.diffuse_transmission;
            if d.texture.is_some() || m.metallic > 0.0 {
                self.approximate("diffuse transmission");
            }
            // Both share the light that reaches the inside.
            let base = self.base_colour()?;
            kind = MaterialKind::DiffuseTransmission {
                reflectance: scaled(base, 1.0 - d.factor),
                transmittance: scaled(self.colour(d.colour, d.colour_texture)?, d.factor),
                scale: 1.0,
            };
        }
        if m.transmission > 0.0 {
            let clear = self.clear()?;
            // Metals let nothing through.
            let amount = match m.metallic_roughness_texture {
                None => self.number(m.transmission * (1.0 - m.metallic), m.transmission_texture, 0)?,
                Some(_) => self.number(m.transmission, m.transmission_texture, 0)?,
            };
            kind = mix(kind, clear, amount);
        }
        self.list_what_is_left_out();
        let normals = m.normal_texture.map(|t| self.textures().normals(t, m.normal_scale, self.sets));
        let normal_map = normals.transpose()?.flatten();
        Ok(with_normals(kind, normal_map))
    }

    /// The surface of a dielectric over what is diffuse, and of a metal.
    fn opaque(&self) -> Read<MaterialKind> {
        let m = self.parameters;
        let roughness = self.roughness()?;
        let reflectance = self.base_colour()?;
        // Reflectance at normal incidence.
        let index = if m.ior == 0.0 { 1.5 } else { m.ior };
        let mut f0 =
            ((index - 1.0) / (index + 1.0)).powi(2) * m.specular * m.specular_colour.average().min(1.0);
        if let Some(s) = m.specular_glossiness {
            let strongest = s.specular.max_component();
            if strongest > 0.2 {
                self.approximate("metals by specular and glossiness");
                let metal = MaterialKind::ConductorReflectance {
                    reflectance: self.colour(s.specular, s.texture)?,
                    roughness: roughness.clone(),
                };
                let plain = dielectric(reflectance, roughness, 0.04);
                let amount = Arc::new(Texture::Constant(((strongest - 0.04) / 0.96).clamp(0.0, 1.0)));
                return Ok(mix(plain, metal, amount));
            }
            f0 = s.specular.average();
        }
        if m.specular_texture.is_some()
            || m.specular_colour_texture.is_some()
            || m.specular_colour != Rgb::WHITE
        {
            self.approximate("specular colour");
        }
        let plain = dielectric(reflectance.clone(), roughness.clone(), f0);
        if m.specular_glossiness.is_some() || m.metallic == 0.0 {
            return Ok(plain);
        }
        let metal = MaterialKind::ConductorReflectance { reflectance, roughness };
        Ok(mix(plain, metal, self.number(m.metallic, m.metallic_roughness_texture, 2)?))
    }

    /// What lets light through.
    fn clear(&self) -> Read<MaterialKind> {
        let m = self.parameters;
        let eta = if m.ior == 0.0 { 1.5 } else { m.ior };
        if m.base_colour != Rgb::WHITE || m.base_colour_texture.is_some() || self.has_colours {
            self.approximate("colour of transmitted light");
        }
        if m.volume.thickness > 0.0 {
            return Ok(MaterialKind::Dielectric { eta, roughness: self.roughness()? });
        }
        if m.roughness > 0.0 {
            self.approximate("roughness of thin transmission");
        }
        Ok(MaterialKind::ThinDielectric { eta })
    }

    fn list_what_is_left_out(&self) {
        let m = self.parameters;
        let left_out = [
            (m.clearcoat.factor > 0.0, "clearcoat"),
            (!m.sheen.colour.is_black(), "sheen"),
            (m.iridescence.factor > 0.0, "iridescence"),
            (m.anisotropy.strength > 0.0, "anisotropy"),
            (m.transmission > 0.0 && m.dispersion > 0.0, "dispersion"),
            (
                m.volume.thickness > 0.0 && m.volume.attenuation_distance.is_finite(),
                "attenuation inside volumes",
            ),
            (!m.volume.multiscatter_colour.is_black(), "scattering inside volumes"),
        ];
        left_out.into_iter().filter(|(used, _)| *used).for_each(|(_, what)| self.approximate(what));
    }

    fn light(&self) -> Read<Option<AreaLightDesc>> {
        let (radiance, texture) = shining(self.parameters);
        if radiance.is_black() {
            return Ok(None);
        }
        let image = texture.map(|t| self.textures().colour_map(t.texture)).transpose()?.flatten();
        // Unlit surfaces are drawings, which are to be seen from both sides.
        let two_sided = self.parameters.double_sided || self.parameters.unlit;
        Ok(Some(AreaLightDesc { radiance, image, two_sided, power: None }))
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

/// A factor on an image, of which `one` changes nothing.
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

fn scaled(texture: Arc<SpectrumTexture>, scale: f32) -> Arc<SpectrumTexture> {
    Arc::new(Texture::Scale { texture, scale: Arc::new(Texture::Constant(scale)) })
}

/// What is diffuse under a surface that reflects `f0` of what falls on it head-on.
fn dielectric(reflectance: Arc<SpectrumTexture>, roughness: Roughness, f0: f32) -> MaterialKind {
    if f0 < 1e-4 {
        return MaterialKind::Diffuse { reflectance };
    }
    let root = f0.min(0.9).sqrt();
    MaterialKind::CoatedDiffuse {
        reflectance,
        roughness,
        thickness: Arc::new(Texture::Constant(0.01)),
        eta: (1.0 + root) / (1.0 - root),
        g: Arc::new(Texture::Constant(0.0)),
        albedo: Arc::new(Texture::Constant(Rgb::BLACK)),
        max_depth: 10,
        samples: 1,
    }
}

fn mix(first: MaterialKind, second: MaterialKind, amount: Arc<FloatTexture>) -> MaterialKind {
    match *amount {
        Texture::Constant(amount) if amount <= 0.0 => first,
        Texture::Constant(amount) if amount >= 1.0 => second,
        _ => {
            MaterialKind::Mix { materials: [first, second].map(|kind| Arc::new(Material::new(kind))), amount }
        }
    }
}

/// The material of a kind with a normal map: on the parts of a mixture, as those are what is shaded.
fn with_normals(kind: MaterialKind, normal_map: Option<lumbre_shading::ImageTexture>) -> Material {
    let kind = match kind {
        MaterialKind::Mix { materials, amount } => {
            let dressed = |material: Arc<Material>| match &material.kind {
                // Mixtures are two levels deep at most: metal in opaque in clear.
                MaterialKind::Mix { .. } => Arc::new(with_normals(material.kind.clone(), normal_map.clone())),
                kind => Arc::new(Material { normal_map: normal_map.clone(), ..Material::new(kind.clone()) }),
            };
            MaterialKind::Mix { materials: materials.map(dressed), amount }
        }
        kind => kind,
    };
    Material { normal_map, ..Material::new(kind) }
}
