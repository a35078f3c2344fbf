//! Textures and materials where colours are looked up at wavelengths.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, PixelData};
use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_shading::spectrum::{SpectralLookup, Wavelengths};
use lumbre_shading::{
    Bsdf, ImageFilter, ImageTexture, LocalDir, Mapping2d, Material, MaterialKind, MipMap, MipMapOptions,
    NamedSpectrum, PrincipledParams, Roughness, Spectrum, SpectrumTexture, SpectrumValue, Texture,
    TextureContext, VertexData, VolumeParams, Wrap,
};

fn at(spectral: Option<SpectralLookup>) -> TextureContext {
    TextureContext {
        point: DVec3::new(2.0, 3.0, 4.0),
        normal: Vec3::Z,
        uv: Vec2::new(0.3, 0.6),
        dpdx: Vec3::ZERO,
        dpdy: Vec3::ZERO,
        duv_dx: Vec2::ZERO,
        duv_dy: Vec2::ZERO,
        vertex: VertexData::NONE,
        spectral,
    }
}

fn lookup(u: f32) -> (Wavelengths, TextureContext) {
    let wavelengths = Wavelengths::visible(u);
    (wavelengths, at(Some(SpectralLookup { wavelengths, is_unbounded: false })))
}

fn named(name: &str) -> SpectrumValue {
    SpectrumValue::Named(NamedSpectrum::from_name(name).unwrap())
}

fn near(found: Spectrum, wanted: Spectrum, tolerance: f32) {
    for (found, wanted) in found.to_array().into_iter().zip(wanted.to_array()) {
        assert!((found - wanted).abs() <= tolerance, "{found} for {wanted}");
    }
}

#[test]
fn textures_have_a_spectrum_or_a_colour() {
    let colour = Spectrum::new(0.7, 0.4, 0.2);
    let data = PixelData::F32(colour.to_array().repeat(4));
    let bitmap = Bitmap::new(2, 2, Channels::Rgb, data, Encoding::Linear).unwrap();
    let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Bilinear };
    let image = Arc::new(MipMap::new(Arc::new(bitmap), options));
    let image = ImageTexture { mapping: Mapping2d::IDENTITY, image, scale: 1.0, invert: false };
    let image = SpectrumTexture::Image(image);
    let constant = SpectrumTexture::Constant(colour);
    let ramp = SpectrumValue::Sampled(vec![(400.0, 0.25), (700.0, 4.0)]);
    let spectrum = SpectrumTexture::Spectrum { value: colour, spectrum: Arc::new(ramp.clone()) };
    let half = Texture::Scale {
        texture: Arc::new(SpectrumTexture::Constant(colour)),
        scale: Arc::new(Texture::Constant(0.5)),
    };
    for texture in [&image, &constant, &spectrum] {
        near(texture.evaluate(&at(None)), colour, 1e-6);
        assert_eq!(texture.evaluate(&at(None)), texture.evaluate_unbounded(&at(None)));
    }
    for u in [0.0, 0.21, 0.5, 0.77] {
        let (wavelengths, here) = lookup(u);
        let smooth = wavelengths.reflectance(colour);
        near(constant.evaluate(&here), smooth, 0.0);
        near(half.evaluate(&here), smooth * 0.5, 0.0);
        near(image.evaluate(&here), smooth, 6e-3);
        near(constant.evaluate_unbounded(&here), wavelengths.coefficient(colour), 0.0);
        let values = wavelengths.values(&ramp).unwrap();
        near(spectrum.evaluate(&here), values.map(|v| v.min(1.0)), 0.0);
        near(spectrum.evaluate_unbounded(&here), values, 0.0);
        // Numbers are numbers.
        assert_eq!(Texture::Constant(0.3_f32).evaluate(&here), 0.3);
    }
}

#[test]
fn metals_reflect_each_wavelength_by_their_tables() {
    let [eta, k] = ["metal-Cu-eta", "metal-Cu-k"].map(named);
    let texture = |spectrum: &SpectrumValue| {
        Arc::new(SpectrumTexture::Spectrum { value: Spectrum::WHITE, spectrum: Arc::new(spectrum.clone()) })
    };
    let copper = Material::new(MaterialKind::Conductor {
        eta: texture(&eta),
        k: texture(&k),
        roughness: Roughness::smooth(),
    });
    for u in [0.1, 0.4, 0.9] {
        let (wavelengths, here) = lookup(u);
        let sample =
            copper.bsdf(&here).unwrap().sample(LocalDir::new(Vec3::Z), 0.5, Vec2::splat(0.5)).unwrap();
        let reflected = wavelengths.nm().map(|nm| {
            let (eta, k) = (eta.at(nm.into()).unwrap(), k.at(nm.into()).unwrap());
            (((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k)) as f32
        });
        near(sample.weight, Spectrum::from(reflected), 1e-4);
    }
}

#[test]
fn glass_has_the_index_of_the_first_wavelength() {
    let index = named("glass-BK7");
    let mut glass = Material::new(MaterialKind::Dielectric { eta: 1.5168, roughness: Roughness::smooth() });
    assert!(!glass.disperses());
    glass.dispersion = Some(Arc::new(index.clone()));
    assert!(glass.disperses() && glass.has_dispersion());
    let eta = |material: &Material, at: &TextureContext| match material.bsdf(at).unwrap() {
        Bsdf::Dielectric(glass) => glass.eta,
        Bsdf::Principled(solid) => solid.eta,
        other => panic!("{other:?}"),
    };
    assert_eq!(eta(&glass, &at(None)), 1.5168);
    // The same glass by its Abbe number, 64.17, is near by Cauchy's formula.
    let solid = Material::new(MaterialKind::Principled(Box::new(PrincipledParams {
        transmission: Arc::new(Texture::Constant(1.0)),
        ior: 1.5168,
        dispersion: 20.0 / 64.17,
        volume: Some(VolumeParams::default()),
        ..PrincipledParams::default()
    })));
    assert!(solid.disperses());
    for u in [0.05, 0.3, 0.6, 0.95] {
        let (wavelengths, here) = lookup(u);
        let expected = index.at(wavelengths.nm()[0].into()).unwrap() as f32;
        assert!((eta(&glass, &here) - expected).abs() < 1e-6, "{u}");
        assert!((eta(&solid, &here) - expected).abs() < 2.5e-3, "{u}: {} {expected}", eta(&solid, &here));
    }
}
