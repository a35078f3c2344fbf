//! glTF materials: every parameter of the core and of the extensions, uninterpreted.

use lumbre_image::Rgb;
use lumbre_math::{Elementary, Vec2};

use super::file::{File, List};
use super::json::{Read, Value};
use crate::diagnostic::{Diagnostic, quoted};

/// A reference to a texture, with its mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The index of the texture in the file.
    pub texture: usize,
    /// The uv set.
    pub uv_set: usize,
    /// The transform from the set to the texture's coordinates (`KHR_texture_transform`).
    pub transform: UvTransform,
}

/// A transform of texture coordinates (`KHR_texture_transform`): `offset + rotate(rotation) * (scale * uv)`,
/// where v counts downwards from the upper edge of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// Added last, in units of the image.
    pub offset: Vec2,
    /// In radians, counter-clockwise about the origin as the image is seen.
    pub rotation: f32,
    /// Factors, applied first.
    pub scale: Vec2,
}

impl UvTransform {
    /// The identity.
    pub const IDENTITY: Self = Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE };

    /// The images of the vectors (1, 0) and (0, 1), and of the origin.
    pub fn axes(&self) -> ([Vec2; 2], Vec2) {
        let (sin, cos) = self.rotation.sine_cosine();
        ([Vec2::new(cos, -sin) * self.scale.x, Vec2::new(sin, cos) * self.scale.y], self.offset)
    }
}

/// How alpha is interpreted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    #[default]
    Opaque,
    /// Visible where alpha is at least `cutoff`.
    Mask {
        /// The threshold.
        cutoff: f32,
    },
    /// Blended over the background.
    Blend,
}

/// A clear coat (`KHR_materials_clearcoat`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clearcoat {
    /// Its share, in [0, 1]; multiplied by the red of its texture.
    pub factor: f32,
    /// A factor, red.
    pub texture: Option<TextureRef>,
    /// Its roughness in [0, 1]; α is the square.
    pub roughness: f32,
    /// A factor, green.
    pub roughness_texture: Option<TextureRef>,
    /// Its own normal map; without one, the geometry's normals.
    pub normal_texture: Option<TextureRef>,
    /// Factor on x and y of those normals.
    pub normal_scale: f32,
}

/// Sheen (`KHR_materials_sheen`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sheen {
    /// Linear colour of the reflection in [0, 1]; black is none.
    pub colour: Rgb,
    /// A factor, sRGB.
    pub colour_texture: Option<TextureRef>,
    /// In [0, 1]; α is the square.
    pub roughness: f32,
    /// A factor, in the texture's alpha.
    pub roughness_texture: Option<TextureRef>,
}

/// A thin film (`KHR_materials_iridescence`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iridescence {
    /// Its share, in [0, 1].
    pub factor: f32,
    /// A factor, red.
    pub texture: Option<TextureRef>,
    /// Index of refraction of the film.
    pub ior: f32,
    /// Thickness in nanometres where the texture's green is 0.
    pub thickness_minimum: f32,
    /// Thickness in nanometres where it is 1, and without a texture.
    pub thickness_maximum: f32,
    /// Interpolates between the two, green.
    pub thickness_texture: Option<TextureRef>,
}

impl Default for Iridescence {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            ior: 1.3,
            thickness_minimum: 100.0,
            thickness_maximum: 400.0,
            thickness_texture: None,
        }
    }
}

/// Anisotropic reflections (`KHR_materials_anisotropy`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Anisotropy {
    /// In [0, 1]; the roughness along its direction rises from the material's to 1 with its square.
    pub strength: f32,
    /// Radians from the tangent, counter-clockwise.
    pub rotation: f32,
    /// Red and green: a direction in [-1, 1]², rotated by `rotation`; blue: a factor on the strength.
    pub texture: Option<TextureRef>,
}

/// The interior of a closed surface (`KHR_materials_volume`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Thickness beneath the surface in mesh space; 0 is a thin wall without an interior.
    pub thickness: f32,
    /// A factor, green.
    pub thickness_texture: Option<TextureRef>,
    /// The distance in the world after which white light has `attenuation_colour`; infinite for none.
    pub attenuation_distance: f32,
    /// Linear colour in [0, 1].
    pub attenuation_colour: Rgb,
    /// Linear multiple-scattering colour of the interior, in [0, 1] (`KHR_materials_volume_scatter`).
    pub multiscatter_colour: Rgb,
    /// Henyey–Greenstein asymmetry of that scattering, in (-1, 1).
    pub scatter_anisotropy: f32,
}

impl Default for Volume {
    fn default() -> Self {
        Self {
            thickness: 0.0,
            thickness_texture: None,
            attenuation_distance: f32::INFINITY,
            attenuation_colour: Rgb::WHITE,
            multiscatter_colour: Rgb::BLACK,
            scatter_anisotropy: 0.0,
        }
    }
}

/// Diffuse transmission (`KHR_materials_diffuse_transmission`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission {
    /// The share of diffuse light that is transmitted, in [0, 1].
    pub factor: f32,
    /// A factor, in the texture's alpha.
    pub texture: Option<TextureRef>,
    /// Linear colour of the transmission.
    pub colour: Rgb,
    /// A factor, sRGB.
    pub colour_texture: Option<TextureRef>,
}

impl Default for DiffuseTransmission {
    fn default() -> Self {
        Self { factor: 0.0, texture: None, colour: Rgb::WHITE, colour_texture: None }
    }
}

/// The specular-glossiness model (`KHR_materials_pbrSpecularGlossiness`), which replaces metalness and
/// roughness; its diffuse colour is then the material's base colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularGlossiness {
    /// Linear reflectance at normal incidence.
    pub specular: Rgb,
    /// 1 minus the roughness.
    pub glossiness: f32,
    /// Factors: sRGB colour on `specular`, alpha on `glossiness`.
    pub texture: Option<TextureRef>,
}

/// A glTF 2.0 material with its extensions. Colours are linear; factors multiply the textures.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfMaterial {
    /// Its name.
    pub name: Option<String>,
    /// Diffuse albedo of dielectrics, reflectance at normal incidence of metals.
    pub base_colour: Rgb,
    /// Alpha, by `alpha_mode`.
    pub base_alpha: f32,
    /// A factor on both: sRGB colour, and alpha.
    pub base_colour_texture: Option<TextureRef>,
    /// From 0, a dielectric, to 1, a metal.
    pub metallic: f32,
    /// In [0, 1]; α is the square.
    pub roughness: f32,
    /// Factors: green on `roughness`, blue on `metallic`.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// The alternative to metalness and roughness.
    pub specular_glossiness: Option<SpecularGlossiness>,
    /// Tangent-space normal map.
    pub normal_texture: Option<TextureRef>,
    /// Factor on x and y of those normals.
    pub normal_scale: f32,
    /// Radiance in nits: the factor times the strength of `KHR_materials_emissive_strength`.
    pub emissive: Rgb,
    /// A factor, sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is interpreted.
    pub alpha_mode: AlphaMode,
    /// Whether the back is visible.
    pub double_sided: bool,
    /// Whether the base colour is shown regardless of lighting (`KHR_materials_unlit`).
    pub unlit: bool,
    /// Index of refraction (`KHR_materials_ior`); 0 means a reflectance of 1 at every angle.
    pub ior: f32,
    /// Strength of the dielectric reflection in [0, 1] (`KHR_materials_specular`).
    pub specular: f32,
    /// A factor, in the texture's alpha.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric reflection at normal incidence, 0 or more.
    pub specular_colour: Rgb,
    /// A factor, sRGB.
    pub specular_colour_texture: Option<TextureRef>,
    /// The share of light that is transmitted instead of diffused (`KHR_materials_transmission`).
    pub transmission: f32,
    /// A factor, red.
    pub transmission_texture: Option<TextureRef>,
    /// 20 over the Abbe number (`KHR_materials_dispersion`); 0 is none.
    pub dispersion: f32,
    /// The interior.
    pub volume: Volume,
    /// The clear coat.
    pub clearcoat: Clearcoat,
    /// Sheen.
    pub sheen: Sheen,
    /// A thin film.
    pub iridescence: Iridescence,
    /// Anisotropic reflections.
    pub anisotropy: Anisotropy,
    /// Diffuse transmission.
    pub diffuse_transmission: DiffuseTransmission,
}

impl Default for GltfMaterial {
    fn default() -> Self {
        Self {
            name: None,
            base_colour: Rgb::WHITE,
            base_alpha: 1.0,
            base_colour_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            specular_glossiness: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: Rgb::BLACK,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_colour: Rgb::WHITE,
            specular_colour_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            dispersion: 0.0,
            volume: Volume::default(),
            clearcoat: Clearcoat::default(),
            sheen: Sheen::default(),
            iridescence: Iridescence::default(),
            anisotropy: Anisotropy::default(),
            diffuse_transmission: DiffuseTransmission::default(),
        }
    }
}

const UNIT: std::ops::RangeInclusive<f64> = 0.0..=1.0;
const POSITIVE: std::ops::RangeInclusive<f64> = 0.0..=f64::INFINITY;
const ANY: std::ops::RangeInclusive<f64> = f64::NEG_INFINITY..=f64::INFINITY;

impl GltfMaterial {
    /// Reads an element of `/materials`.
    pub(super) fn read(file: &File<'_>, value: Value<'_>) -> Read<Self> {
        let mut material = Self { name: value.string_at("name")?.map(Into::into), ..Self::default() };
        let m = &mut material;
        if let Some(pbr) = value.get("pbrMetallicRoughness")? {
            let [r, g, b, a] = numbers(pbr, "baseColorFactor", [1.0; 4], UNIT)?;
            (m.base_colour, m.base_alpha) = (Rgb::new(r, g, b), a);
            m.base_colour_texture = texture(file, pbr, "baseColorTexture")?;
            m.metallic = number(pbr, "metallicFactor", 1.0, UNIT)?;
            m.roughness = number(pbr, "roughnessFactor", 1.0, UNIT)?;
            m.metallic_roughness_texture = texture(file, pbr, "metallicRoughnessTexture")?;
        }
        (m.normal_texture, m.normal_scale) = normal_map(file, value, "normalTexture")?;
        if let Some(occlusion) = value.get("occlusionTexture")? {
            // Occlusion is what a renderer computes.
            texture_ref(file, occlusion)?;
            occlusion.number_or("strength", 1.0, UNIT)?;
        }
        m.emissive = colour(value, "emissiveFactor", Rgb::BLACK, POSITIVE)?;
        m.emissive_texture = texture(file, value, "emissiveTexture")?;
        m.double_sided = value.bool_or("doubleSided", false)?;
        m.alpha_mode = match value.get("alphaMode")? {
            None => AlphaMode::Opaque,
            Some(mode) => match &*mode.string()? {
                "OPAQUE" => AlphaMode::Opaque,
                "MASK" => AlphaMode::Mask { cutoff: number(value, "alphaCutoff", 0.5, POSITIVE)? },
                "BLEND" => AlphaMode::Blend,
                other => {
                    let wrong = mode.wrong("unknown alpha mode").found(quoted(other));
                    return Err(wrong.suggest(other, ["OPAQUE", "MASK", "BLEND"]).into());
                }
            },
        };
        m.extensions(file, value)?;
        Ok(material)
    }

    fn extensions(&mut self, file: &File<'_>, value: Value<'_>) -> Read<()> {
        let ext = |name: &str| value.extension(&format!("KHR_materials_{name}"));
        if let Some(e) = ext("pbrSpecularGlossiness")? {
            let [r, g, b, a] = numbers(e, "diffuseFactor", [1.0; 4], UNIT)?;
            (self.base_colour, self.base_alpha) = (Rgb::new(r, g, b), a);
            self.base_colour_texture = texture(file, e, "diffuseTexture")?;
            self.metallic_roughness_texture = None;
            self.specular_glossiness = Some(SpecularGlossiness {
                specular: colour(e, "specularFactor", Rgb::WHITE, UNIT)?,
                glossiness: number(e, "glossinessFactor", 1.0, UNIT)?,
                texture: texture(file, e, "specularGlossinessTexture")?,
            });
        }
        self.unlit = ext("unlit")?.is_some();
        if let Some(e) = ext("emissive_strength")? {
            self.emissive *= number(e, "emissiveStrength", 1.0, POSITIVE)?;
        }
        if let Some(e) = ext("ior")? {
            self.ior = number(e, "ior", 1.5, POSITIVE)?;
            if 0.0 < self.ior && self.ior < 1.0 {
                return Err(e.need("ior")?.unexpected("number out of range", "0, or 1 or more"));
            }
        }
        if let Some(e) = ext("specular")? {
            self.specular = number(e, "specularFactor", 1.0, UNIT)?;
            self.specular_texture = texture(file, e, "specularTexture")?;
            self.specular_colour = colour(e, "specularColorFactor", Rgb::WHITE, POSITIVE)?;
            self.specular_colour_texture = texture(file, e, "specularColorTexture")?;
        }
        if let Some(e) = ext("transmission")? {
            self.transmission = number(e, "transmissionFactor", 0.0, UNIT)?;
            self.transmission_texture = texture(file, e, "transmissionTexture")?;
        }
        if let Some(e) = ext("dispersion")? {
            self.dispersion = number(e, "dispersion", 0.0, POSITIVE)?;
        }
        if let Some(e) = ext("volume")? {
            self.volume.thickness = number(e, "thicknessFactor", 0.0, POSITIVE)?;
            self.volume.thickness_texture = texture(file, e, "thicknessTexture")?;
            self.volume.attenuation_distance = number(e, "attenuationDistance", f64::INFINITY, POSITIVE)?;
            self.volume.attenuation_colour = colour(e, "attenuationColor", Rgb::WHITE, UNIT)?;
        }
        if let Some(e) = ext("volume_scatter")? {
            self.volume.multiscatter_colour = colour(e, "multiscatterColor", Rgb::BLACK, UNIT)?;
            self.volume.scatter_anisotropy = number(e, "scatterAnisotropy", 0.0, -1.0..=1.0)?;
        }
        if let Some(e) = ext("clearcoat")? {
            let (normal_texture, normal_scale) = normal_map(file, e, "clearcoatNormalTexture")?;
            self.clearcoat = Clearcoat {
                factor: number(e, "clearcoatFactor", 0.0, UNIT)?,
                texture: texture(file, e, "clearcoatTexture")?,
                roughness: number(e, "clearcoatRoughnessFactor", 0.0, UNIT)?,
                roughness_texture: texture(file, e, "clearcoatRoughnessTexture")?,
                normal_texture,
                normal_scale,
            };
        }
        if let Some(e) = ext("sheen")? {
            self.sheen = Sheen {
                colour: colour(e, "sheenColorFactor", Rgb::BLACK, UNIT)?,
                colour_texture: texture(file, e, "sheenColorTexture")?,
                roughness: number(e, "sheenRoughnessFactor", 0.0, UNIT)?,
                roughness_texture: texture(file, e, "sheenRoughnessTexture")?,
            };
        }
        if let Some(e) = ext("iridescence")? {
            self.iridescence = Iridescence {
                factor: number(e, "iridescenceFactor", 0.0, UNIT)?,
                texture: texture(file, e, "iridescenceTexture")?,
                ior: number(e, "iridescenceIor", 1.3, 1.0..=f64::INFINITY)?,
                thickness_minimum: number(e, "iridescenceThicknessMinimum", 100.0, POSITIVE)?,
                thickness_maximum: number(e, "iridescenceThicknessMaximum", 400.0, POSITIVE)?,
                thickness_texture: texture(file, e, "iridescenceThicknessTexture")?,
            };
        }
        if let Some(e) = ext("anisotropy")? {
            self.anisotropy = Anisotropy {
                strength: number(e, "anisotropyStrength", 0.0, UNIT)?,
                rotation: number(e, "anisotropyRotation", 0.0, ANY)?,
                texture: texture(file, e, "anisotropyTexture")?,
            };
        }
        if let Some(e) = ext("diffuse_transmission")? {
            self.diffuse_transmission = DiffuseTransmission {
                factor: number(e, "diffuseTransmissionFactor", 0.0, UNIT)?,
                texture: texture(file, e, "diffuseTransmissionTexture")?,
                colour: colour(e, "diffuseTransmissionColorFactor", Rgb::WHITE, UNIT)?,
                colour_texture: texture(file, e, "diffuseTransmissionColorTexture")?,
            };
        }
        Ok(())
    }

    /// Every texture reference.
    pub fn textures(&self) -> impl Iterator<Item = TextureRef> {
        [
            self.base_colour_texture,
            self.metallic_roughness_texture,
            self.specular_glossiness.and_then(|s| s.texture),
            self.normal_texture,
            self.emissive_texture,
            self.specular_texture,
            self.specular_colour_texture,
            self.transmission_texture,
            self.volume.thickness_texture,
            self.clearcoat.texture,
            self.clearcoat.roughness_texture,
            self.clearcoat.normal_texture,
            self.sheen.colour_texture,
            self.sheen.roughness_texture,
            self.iridescence.texture,
            self.iridescence.thickness_texture,
            self.anisotropy.texture,
            self.diffuse_transmission.texture,
            self.diffuse_transmission.colour_texture,
        ]
        .into_iter()
        .flatten()
    }
}

fn number(value: Value<'_>, name: &str, default: f64, range: std::ops::RangeInclusive<f64>) -> Read<f32> {
    value.number_or(name, default, range).map(|n| n as f32)
}

fn numbers<const N: usize>(
    value: Value<'_>,
    name: &str,
    default: [f64; N],
    range: std::ops::RangeInclusive<f64>,
) -> Read<[f32; N]> {
    value.numbers_or(name, default, range).map(|n| n.map(|n| n as f32))
}

fn colour(value: Value<'_>, name: &str, default: Rgb, range: std::ops::RangeInclusive<f64>) -> Read<Rgb> {
    let [r, g, b] = numbers(value, name, default.to_array().map(f64::from), range)?;
    Ok(Rgb::new(r, g, b))
}

fn texture(file: &File<'_>, value: Value<'_>, name: &str) -> Read<Option<TextureRef>> {
    value.get(name)?.map(|value| texture_ref(file, value)).transpose()
}

fn normal_map(file: &File<'_>, value: Value<'_>, name: &str) -> Read<(Option<TextureRef>, f32)> {
    let Some(value) = value.get(name)? else { return Ok((None, 1.0)) };
    Ok((Some(texture_ref(file, value)?), number(value, "scale", 1.0, ANY)?))
}

fn texture_ref(file: &File<'_>, value: Value<'_>) -> Read<TextureRef> {
    let (texture, _) = file.at(List::Textures, value.need("index")?)?;
    let mut uv_set = value.get("texCoord")?.map_or(Ok(0), |set| set.whole(0))?;
    let mut transform = UvTransform::IDENTITY;
    if let Some(e) = value.extension("KHR_texture_transform")? {
        transform = UvTransform {
            offset: Vec2::from_array(numbers(e, "offset", [0.0; 2], ANY)?),
            rotation: number(e, "rotation", 0.0, ANY)?,
            scale: Vec2::from_array(numbers(e, "scale", [1.0; 2], ANY)?),
        };
        if let Some(set) = e.get("texCoord")? {
            uv_set = set.whole(0)?;
        }
    }
    if uv_set >= 16 {
        let warning =
            Diagnostic::warning("texture on a set of coordinates beyond the sixteenth").at(value.place());
        file.push(warning.found(uv_set));
    }
    Ok(TextureRef { texture, uv_set: uv_set.min(u64::from(u32::MAX)) as usize, transform })
}
