//! How surfaces look: materials, and arrays as textures on them. Each is checked when it is made.

use std::sync::Arc;

use lumbre::image::{Bitmap, Channels, Encoding, PixelData};
use lumbre::math::Vec2;
use lumbre::shading::hair::{HairColour, HairParams};
use lumbre::shading::{
    AxisWrap, FloatTexture, ImageFilter, ImageTexture, Mapping2d, Material as MaterialDesc, MaterialKind,
    MipMap, MipMapOptions, PrincipledParams, Roughness, Spectrum, SpectrumTexture, Texture as TextureDesc,
    VolumeParams, Wrap,
};
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::{invalid, list, unknown};

/// An image on a surface.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Texture(ImageTexture);

#[pymethods]
impl Texture {
    /// An array of (h, w, 1 to 4), the first row at the top, of bytes, 16-bit integers or single precision.
    #[new]
    fn new(
        texels: &Bound<'_, PyAny>,
        is_srgb: bool,
        wrap: &str,
        filter: &str,
        scale: [f32; 2],
        offset: [f32; 2],
    ) -> PyResult<Self> {
        let ([height, width, channels], data) = if let Ok(bytes) = texels.extract() {
            read(&bytes, PixelData::U8)?
        } else if let Ok(numbers) = texels.extract() {
            read(&numbers, PixelData::U16)?
        } else {
            read(&texels.extract()?, PixelData::F32)?
        };
        let encoding = if is_srgb { Encoding::Srgb } else { Encoding::Linear };
        let bitmap = Channels::from_count(channels)
            .and_then(|channels| Bitmap::new(width as u32, height as u32, channels, data, encoding));
        let bitmap = bitmap.ok_or_else(|| {
            invalid(format!(
                "a texture has the wrong shape (found ({height}, {width}, {channels}); expected (h, w) or (h, w, 1 to 4))"
            ))
        })?;
        let wrap = match wrap {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            "black" => Wrap::Black,
            "mirror" => Wrap::Axes([AxisWrap::Mirror; 2]),
            _ => return Err(unknown("wrap", wrap, &["repeat", "clamp", "black", "mirror"])),
        };
        let filter = match filter {
            "nearest" => ImageFilter::Point,
            "bilinear" => ImageFilter::Bilinear,
            "trilinear" => ImageFilter::Trilinear,
            "ewa" => ImageFilter::Ewa(8.0),
            _ => return Err(unknown("filter", filter, &["nearest", "bilinear", "trilinear", "ewa"])),
        };
        let image = Arc::new(MipMap::new(Arc::new(bitmap), MipMapOptions { wrap, filter }));
        let mapping = Mapping2d::Uv { scale: Vec2::from(scale), delta: Vec2::from(offset) };
        Ok(Self(ImageTexture { mapping, image, scale: 1.0, invert: false }))
    }
}

fn read<T: numpy::Element + Copy>(
    texels: &PyReadonlyArray3<'_, T>,
    of: fn(Vec<T>) -> PixelData,
) -> PyResult<([usize; 3], PixelData)> {
    let &[height, width, channels] = texels.shape() else { return Ok(([0; 3], of(Vec::new()))) };
    let mut numbers = list(height * width * channels)?;
    numbers.extend(texels.as_array().iter().copied());
    Ok(([height, width, channels], of(numbers)))
}

/// A colour, or one for each place.
#[derive(FromPyObject)]
enum Colour<'py> {
    Texture(Bound<'py, Texture>),
    Rgb([f32; 3]),
}

impl Colour<'_> {
    fn texture(self, name: &str) -> PyResult<Arc<SpectrumTexture>> {
        Ok(Arc::new(match self {
            Self::Texture(texture) => TextureDesc::Image(texture.get().0.clone()),
            Self::Rgb(rgb) => TextureDesc::Constant(colour(name, rgb)?),
        }))
    }
}

/// A number, or one for each place.
#[derive(FromPyObject)]
enum Number<'py> {
    Texture(Bound<'py, Texture>),
    Value(f32),
}

impl Number<'_> {
    /// In [0, 1].
    fn share(self, name: &str) -> PyResult<Arc<FloatTexture>> {
        match self {
            Self::Value(found) if !(0.0..=1.0).contains(&found) => {
                Err(invalid(format!("{name} is out of range (found {found}; expected 0 to 1)")))
            }
            Self::Value(found) => Ok(Arc::new(TextureDesc::Constant(found))),
            Self::Texture(texture) => Ok(Arc::new(TextureDesc::Image(texture.get().0.clone()))),
        }
    }

    /// In both directions.
    fn roughness(self) -> PyResult<Roughness> {
        let alpha = self.share("roughness")?;
        Ok(Roughness { u: Arc::clone(&alpha), v: alpha, remap: false })
    }
}

/// A colour of light, or of what is left of it.
pub(crate) fn colour(name: &str, [r, g, b]: [f32; 3]) -> PyResult<Spectrum> {
    let is_light = |x: f32| x >= 0.0 && x.is_finite();
    if is_light(r) && is_light(g) && is_light(b) {
        return Ok(Spectrum::new(r, g, b));
    }
    Err(invalid(format!("{name} is no colour (found {r}, {g}, {b}; expected finite numbers, 0 or greater)")))
}

/// The colour of a name, or of hexadecimal digits in sRGB, in linear light.
///
/// # Errors
/// Says which names there are.
#[pyfunction]
pub(crate) fn named_colour(text: &str) -> PyResult<[f32; 3]> {
    if let Some(found) = lumbre::colour(text) {
        return Ok(found.to_array());
    }
    if text.starts_with('#') {
        return Err(invalid(format!(
            "\"{text}\" is no colour (expected three or six hexadecimal digits, as #fa0 or #e8e0d8)"
        )));
    }
    let names: Vec<&str> = lumbre::colour_names().collect();
    Err(unknown("colour", text, &names))
}

fn index(ior: f32) -> PyResult<f32> {
    if ior > 0.0 && ior.is_finite() {
        return Ok(ior);
    }
    Err(invalid(format!("ior is out of range (found {ior}; expected a number above 0)")))
}

/// The appearance of a surface. What is made of it shares it.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Material {
    pub(crate) desc: Arc<MaterialDesc>,
    /// Mixtures in mixtures.
    depth: usize,
}

/// As deep as in a scene file: dropping and drawing them takes steps of each.
const MAX_MIXTURES: usize = 64;

fn made(kind: MaterialKind) -> PyResult<Material> {
    Ok(Material { desc: MaterialDesc::new(kind).into(), depth: 0 })
}

#[pymethods]
impl Material {
    #[staticmethod]
    fn diffuse(reflectance: Colour<'_>) -> PyResult<Self> {
        made(MaterialKind::Diffuse { reflectance: reflectance.texture("reflectance")? })
    }

    #[staticmethod]
    fn metal(reflectance: Colour<'_>, roughness: Number<'_>) -> PyResult<Self> {
        let roughness = roughness.roughness()?;
        made(MaterialKind::ConductorReflectance {
            reflectance: reflectance.texture("reflectance")?,
            roughness,
        })
    }

    #[staticmethod]
    fn glass(eta: f32, roughness: Number<'_>) -> PyResult<Self> {
        made(MaterialKind::Dielectric { eta: index(eta)?, roughness: roughness.roughness()? })
    }

    #[staticmethod]
    fn pane(eta: f32) -> PyResult<Self> {
        made(MaterialKind::ThinDielectric { eta: index(eta)? })
    }

    /// A matt base under a clear coat, with the defaults of the scene language.
    #[staticmethod]
    fn coated(reflectance: Colour<'_>, roughness: Number<'_>, eta: f32) -> PyResult<Self> {
        let number = |x: f32| Arc::new(FloatTexture::Constant(x));
        made(MaterialKind::CoatedDiffuse {
            reflectance: reflectance.texture("reflectance")?,
            roughness: roughness.roughness()?,
            thickness: number(0.01),
            eta: index(eta)?,
            g: number(0.0),
            albedo: Arc::new(SpectrumTexture::Constant(Spectrum::BLACK)),
            max_depth: 10,
            samples: 1,
        })
    }

    #[staticmethod]
    fn translucent(reflectance: Colour<'_>, transmittance: Colour<'_>) -> PyResult<Self> {
        made(MaterialKind::DiffuseTransmission {
            reflectance: reflectance.texture("reflectance")?,
            transmittance: transmittance.texture("transmittance")?,
            scale: 1.0,
        })
    }

    /// Hair by its pigments, or by the colour of a mass of it.
    #[staticmethod]
    fn hair(
        melanin: [f32; 2],
        color: Option<Colour<'_>>,
        roughness: Number<'_>,
        azimuthal_roughness: Number<'_>,
        tilt: f32,
        ior: f32,
    ) -> PyResult<Self> {
        let number = |x: f32| Arc::new(FloatTexture::Constant(x));
        if let Some(found) = melanin.into_iter().find(|x| !(*x >= 0.0 && x.is_finite())) {
            return Err(invalid(format!("melanin is out of range (found {found}; expected 0 or more)")));
        }
        if !tilt.is_finite() {
            return Err(invalid(format!("tilt is not finite (found {tilt})")));
        }
        let colour = match color {
            Some(color) => HairColour::Reflectance(color.texture("color")?),
            None => HairColour::Melanin { eumelanin: number(melanin[0]), pheomelanin: number(melanin[1]) },
        };
        made(MaterialKind::Hair(Box::new(HairParams {
            colour,
            eta: number(index(ior)?),
            beta_m: roughness.share("roughness")?,
            beta_n: azimuthal_roughness.share("azimuthal_roughness")?,
            alpha: number(tilt),
        })))
    }

    #[staticmethod]
    fn mix(first: &Bound<'_, Self>, second: &Bound<'_, Self>, amount: Number<'_>) -> PyResult<Self> {
        let depth = 1 + first.get().depth.max(second.get().depth);
        if depth > MAX_MIXTURES {
            return Err(invalid(format!("mixtures stand in each other more than {MAX_MIXTURES} deep")));
        }
        let materials = [first, second].map(|material| Arc::clone(&material.get().desc));
        let mixture = made(MaterialKind::Mix { materials, amount: amount.share("amount")? })?;
        Ok(Self { depth, ..mixture })
    }

    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "one call of the package's own")]
    fn principled(
        base_color: Colour<'_>,
        metallic: Number<'_>,
        roughness: Number<'_>,
        transmission: Number<'_>,
        clearcoat: Number<'_>,
        clearcoat_roughness: Number<'_>,
        sheen_color: Colour<'_>,
        sheen_roughness: Number<'_>,
        specular: Number<'_>,
        specular_color: Colour<'_>,
        ior: f32,
        attenuation: Option<([f32; 3], f32)>,
    ) -> PyResult<Self> {
        if !(ior >= 1.0 && ior.is_finite()) {
            return Err(invalid(format!("ior is out of range (found {ior}; expected 1 or more)")));
        }
        let volume = match attenuation {
            None => None,
            Some((_, distance)) if distance.is_nan() || distance <= 0.0 => {
                return Err(invalid(format!(
                    "attenuation_distance is out of range (found {distance}; expected a number above 0)"
                )));
            }
            Some((left, distance)) => Some(VolumeParams {
                attenuation_color: colour("attenuation_color", left)?,
                attenuation_distance: distance,
                ..VolumeParams::default()
            }),
        };
        let params = PrincipledParams {
            base_color: base_color.texture("base_color")?,
            metallic: metallic.share("metallic")?,
            roughness: roughness.share("roughness")?,
            transmission: transmission.share("transmission")?,
            clearcoat: clearcoat.share("clearcoat")?,
            clearcoat_roughness: clearcoat_roughness.share("clearcoat_roughness")?,
            sheen_color: sheen_color.texture("sheen_color")?,
            sheen_roughness: sheen_roughness.share("sheen_roughness")?,
            specular: specular.share("specular")?,
            specular_color: specular_color.texture("specular_color")?,
            ior,
            volume,
            ..PrincipledParams::default()
        };
        made(MaterialKind::Principled(Box::new(params)))
    }

    /// The same with maps that tilt its normals: one of normals in tangent space, and one of heights.
    fn tilted(
        &self,
        normal_map: Option<&Bound<'_, Texture>>,
        bump_map: Option<&Bound<'_, Texture>>,
    ) -> PyResult<Self> {
        let mut material = MaterialDesc::clone(&self.desc);
        if matches!(material.kind, MaterialKind::Mix { .. }) && (normal_map.is_some() || bump_map.is_some()) {
            return Err(invalid("a mixture has no maps of its own (expected them on its materials)"));
        }
        material.normal_map = normal_map.map(|map| map.get().0.clone());
        material.displacement = bump_map.map(|map| Arc::new(FloatTexture::Image(map.get().0.clone())));
        Ok(Self { desc: material.into(), depth: self.depth })
    }
}
