//! What a path tracer takes a POV-Ray material for: lobes side by side.

use std::sync::Arc;

use lumbre_math::{DVec3, Elementary, Vec3};
use smallvec::SmallVec;

use super::texture::{Asked, LayerAt, PovMaterial, Stacks, Texture, TextureKind};
use super::{Eye, Pigment, PigmentKind, Reflection};
use crate::material::albedo;
use crate::microfacet::Microfacets;
use crate::uber::Uber;
use crate::{Spectrum, TextureContext, fresnel};

/// An index of refraction at which a dielectric mirrors all light: for lobes whose strength is given.
const MIRROR_ETA: f32 = 1e6;

impl PovMaterial {
    /// What the surface looks like at a place, towards a viewer on the side of the normal: the stacks of its texture.
    pub fn stacks(&self, p: DVec3, eye: &Eye, front: bool, asked: Asked) -> Stacks<'_> {
        let mut stacks = Stacks::new();
        self.side(front).stacks(p, eye, 1.0, asked, &mut stacks);
        stacks
    }

    fn eye(&self, at: &TextureContext, normal: Vec3) -> Eye {
        let normal = normal.as_dvec3();
        Eye { normal, direction: normal, uv: self.surface_uv(at.point, at.uv.as_dvec2()) }
    }

    /// The unit normal that the top layer of most weight tilts a unit normal to.
    pub(crate) fn tilted(&self, at: &TextureContext, normal: Vec3) -> Vec3 {
        let eye = self.eye(at, normal);
        let stacks = self.stacks(at.point, &eye, true, Asked::Normals);
        let most = stacks.iter().max_by(|a, b| a.0.total_cmp(&b.0));
        most.and_then(|(_, layers)| layers.last()).map_or(normal, |layer| layer.normal.as_vec3())
    }

    /// Scattering at a place: the layers from the top, each by its opacity; a diffuse lobe, facets for highlights, a
    /// mirror, and what passes, straight on or refracted. A share above 1 is cut off.
    pub(crate) fn bsdf(&self, at: &TextureContext) -> Uber {
        let eye = self.eye(at, at.normal);
        let mut sum = Lobes::default();
        for (share, layers) in &self.stacks(at.point, &eye, true, Asked::Normals) {
            sum.add(self, *share, layers);
        }
        let passes = !sum.passed.is_black();
        let is_refracted = passes && self.interior.ior != 1.0;
        let eta = if is_refracted { self.interior.ior.max(0.01) } else { MIRROR_ETA };
        // Where light is refracted, lobes are dielectric facets: their strengths are those head on.
        let head_on = fresnel::dielectric(1.0, eta).max(1e-3);
        let alpha = (sum.alpha / sum.glossy_weight.max(1e-6)).clamp(Microfacets::SMOOTH_BELOW, 1.0);
        let mirror = albedo(sum.mirror * (1.0 / head_on));
        let rest = albedo(Spectrum::WHITE - albedo(sum.mirror));
        Uber {
            diffuse: albedo(sum.diffuse) * rest,
            glossy: albedo(sum.glossy * (1.0 / head_on)),
            mirror,
            refracted: if is_refracted { albedo(sum.passed) } else { Spectrum::BLACK },
            passed: if is_refracted { Spectrum::BLACK } else { albedo(sum.passed) * rest },
            eta,
            facets: Microfacets::new(alpha, alpha),
        }
    }

    /// Whether it stops all light that would pass to the other side, wherever that meets it; false when in doubt.
    pub fn stops_light(&self) -> bool {
        !self.visibility.no_shadow
            && !may_pass(&self.texture)
            && !self.interior_texture.as_ref().is_some_and(|texture| may_pass(texture))
    }

    /// Whether light may pass to the other side.
    pub(crate) fn is_transmissive(&self) -> bool {
        may_pass(&self.texture)
    }

    /// Whether it may mirror, or light may pass.
    pub(crate) fn may_be_specular(&self) -> bool {
        may_pass(&self.texture) || may_mirror(&self.texture)
    }

    /// Whether light may pass to the other side unbent.
    pub(crate) fn has_delta_transmission(&self) -> bool {
        self.interior.ior == 1.0 && may_pass(&self.texture)
    }
}

/// Whether a layer of a texture has a mirror.
fn may_mirror(texture: &Texture) -> bool {
    match &texture.kind {
        TextureKind::Plain(layer) => layer.finish.reflection != Reflection::NONE,
        TextureKind::Layers(textures) => textures.iter().any(|texture| may_mirror(texture)),
        TextureKind::Map(_, map) => map.iter().any(|(_, texture)| may_mirror(texture)),
        TextureKind::Blocks(_, textures) => textures.iter().any(|texture| may_mirror(texture)),
        TextureKind::Average(textures) => textures.iter().any(|(_, texture)| may_mirror(texture)),
    }
}

/// Whether a texture may let light pass; true when in doubt.
fn may_pass(texture: &Texture) -> bool {
    match &texture.kind {
        TextureKind::Plain(layer) => pigment_may_pass(&layer.pigment),
        TextureKind::Layers(textures) => textures.iter().all(|texture| may_pass(texture)),
        TextureKind::Map(_, map) => map.iter().any(|(_, texture)| may_pass(texture)),
        TextureKind::Blocks(_, textures) => textures.iter().any(|texture| may_pass(texture)),
        TextureKind::Average(textures) => textures.iter().any(|(_, texture)| may_pass(texture)),
    }
}

fn pigment_may_pass(pigment: &Pigment) -> bool {
    match &pigment.kind {
        // A filter that is black passes light where it is blended with another colour.
        PigmentKind::Colour(colour) => colour.is_clear(),
        PigmentKind::Map(_, map) => map.may_pass(),
        PigmentKind::Pigments(_, map) => map.iter().any(|(_, pigment)| pigment_may_pass(pigment)),
        PigmentKind::Blocks(_, pigments) => {
            pigments.iter().any(|pigment: &Arc<Pigment>| pigment_may_pass(pigment))
        }
        PigmentKind::Average(pigments) => pigments.iter().any(|(_, pigment)| pigment_may_pass(pigment)),
        PigmentKind::Image(_) => true,
    }
}

#[derive(Default)]
struct Lobes {
    diffuse: Spectrum,
    glossy: Spectrum,
    glossy_weight: f32,
    alpha: f32,
    mirror: Spectrum,
    passed: Spectrum,
}

impl Lobes {
    fn add(&mut self, material: &PovMaterial, share: f32, layers: &SmallVec<[LayerAt<'_>; 2]>) {
        let linear = |c: Spectrum| c.map(|c| c.max(0.0).power(material.gamma));
        let mut left = Spectrum::splat(share);
        for layer in layers.iter().rev() {
            let (colour, finish) = (layer.colour, layer.finish);
            let tint = linear(colour.rgb);
            self.diffuse += left * tint * (material.opacity(colour).max(0.0) * finish.diffuse);
            // The albedo of a highlight, and the roughness by the exponent of the half vector, which for phong is four
            // times as large.
            let mut highlight = |strength: f32, exponent: f32, albedo: f32| {
                if strength <= 0.0 {
                    return;
                }
                let metallic = Spectrum::WHITE + (tint - Spectrum::WHITE) * finish.metallic;
                let glossy = left * metallic * albedo;
                self.glossy += glossy;
                let weight = glossy.average();
                self.glossy_weight += weight;
                self.alpha += weight * (2.0 / (exponent + 2.0)).sqrt();
            };
            let phong = if finish.phong_albedo { 1.0 } else { 2.0 / (finish.phong_size + 1.0) };
            highlight(finish.phong, 4.0 * finish.phong_size, finish.phong * phong);
            let exponent = 1.0 / finish.roughness.max(1e-6);
            let specular = if finish.specular_albedo { 1.0 } else { 8.0 / (exponent + 8.0) };
            highlight(finish.specular, exponent, finish.specular * specular);
            // Head on, mirrors of metal have the whole tint.
            let metal = Spectrum::WHITE + (tint - Spectrum::WHITE) * finish.reflection.metallic;
            self.mirror += linear(finish.reflection.at(1.0, material.interior.ior)) * metal * share;
            left = left * linear(colour.rgb) * colour.filter + left * colour.transmit;
        }
        self.passed += left;
    }
}
