//! Light that reaches a place through what is clear.

use lumbre_geometry::Ray;
use lumbre_scene::{Footprint, Interaction, LightSample, Scene};
use lumbre_shading::spectrum::Wavelengths;
use lumbre_shading::{Material, Scatter, ShadingNormals, Spectrum};

use crate::transport::direct::Vertex;
use crate::transport::interior::MediumStack;
use crate::transport::{Record, SampleNumbers};

/// Surfaces at most that light goes through or is reflected by inside a solid.
const MAX_SURFACES: u32 = 16;
/// Surfaces at most that light goes straight on through.
const MAX_PANES: u32 = 256;
/// A part of a pane's mixture that has less of it than this is not taken apart.
const MIN_PART: f32 = 1.0 / 256.0;
/// How far the product of the indices along a path may be from 1 by rounding.
const INDEX_ERROR: f32 = 1e-4;

/// The way from a ray's origin to what it met; its direction is unit.
pub(crate) fn ray_length(ray: &Ray, here: &Interaction) -> f64 {
    (here.surface.point - ray.origin).length()
}

/// The throughput of the hero wavelength, which goes on in place of all of them.
pub(crate) fn hero_alone(throughput: Spectrum) -> Spectrum {
    Spectrum::new(Wavelengths::COUNT as f32 * throughput.r, 0.0, 0.0)
}

/// An estimate of the light at infinity that comes back along a ray which meets something first: refracted, spread by what is
/// rough, and reflected inside solids, but not by their outer sides. Black where the ray meets nothing, or what is not clear.
///
/// What solids scatter inside is not followed. The draw's vertices from `first` on choose the way.
pub(crate) fn light_through(
    scene: &Scene,
    mut ray: Ray,
    draw: &SampleNumbers,
    first: u32,
    record: &mut Record,
) -> Spectrum {
    let mut throughput = Spectrum::WHITE;
    let mut interiors = MediumStack::default();
    // Index of refraction where the path is, over that where it began.
    let mut index = 1.0_f32;
    for surface in 0..MAX_SURFACES {
        record.counts.bounce += 1;
        let Some(hit) = scene.closest(&ray) else {
            let is_open = surface == 0;
            return if is_open {
                Spectrum::BLACK
            } else {
                throughput * scene.background(&ray).sum::<Spectrum>()
            };
        };
        let here = scene.interaction(&ray, &hit, &Footprint::Point);
        interiors.arrive(&here, here.resolved());
        if interiors.medium().is_some() {
            return Spectrum::BLACK;
        }
        throughput *= interiors.transmittance(ray_length(&ray, &here));
        let Some(vertex) = Vertex::new(scene, &here, &interiors, ShadingNormals::Lumbre) else {
            return Spectrum::BLACK;
        };
        let Some(bounce) = vertex.sample(draw.lobe(first + surface), draw.direction(first + surface)) else {
            return Spectrum::BLACK;
        };
        let is_inside = (index - 1.0).abs() > INDEX_ERROR;
        if !bounce.transmitted && !is_inside {
            return Spectrum::BLACK;
        }
        throughput *= bounce.weight;
        if throughput.is_black() {
            return Spectrum::BLACK;
        }
        if bounce.transmitted {
            index *= bounce.eta;
            interiors.cross(vertex.material, here.front);
        }
        ray = vertex.leave(&bounce);
    }
    Spectrum::BLACK
}

/// Whether a light's sample is to be followed through panes by [`straight_on`], where paths find all other light behind them: that of
/// points and in one direction, which no path finds by chance, so that nothing counts twice.
pub(crate) fn goes_straight_on(scene: &Scene, sample: &LightSample) -> bool {
    sample.scatter == Scatter::Delta && scene.has_delta_transmission()
}

/// What is left of a light's sample where `shadow_ray` starts, inside of `interiors`: the product of what all that it goes
/// straight on through leaves of it ([`lumbre_shading::Bsdf::straight_on`], that of regularized BSDFs where the path's are), and
/// of what solids on the way take. Black behind anything else, and behind more than [`MAX_PANES`] surfaces.
///
/// Only for light that is not also found by rays which go through the pane themselves, or it would count twice: of paths, see
/// [`goes_straight_on`]. What bends or spreads light stands in its way here: what is rough is lit itself, and paths find it; what
/// is smooth and bends light would have to send a path to such a light by chance, and never does.
pub(crate) fn straight_on<'s>(
    scene: &'s Scene,
    shadow_ray: Ray,
    sample: &LightSample,
    mut interiors: MediumStack<'s>,
    regularize: bool,
    mut is_alone: bool,
    record: &mut Record,
) -> Spectrum {
    let mut left = Spectrum::WHITE;
    let mut ray = shadow_ray;
    for _ in 0..MAX_PANES {
        record.counts.shadow += 1;
        let Some(hit) = scene.closest(&ray) else {
            // Light from infinitely far away was not inside anything.
            let last = sample.end.map(|end| interiors.transmittance((end.point - ray.origin).length()));
            return left * last.unwrap_or(Spectrum::WHITE);
        };
        if !scene.is_pane(&hit) {
            return Spectrum::BLACK;
        }
        let mut pane = scene.interaction(&ray, &hit, &Footprint::Point);
        pane.at.spectral = interiors.spectral();
        let material = pane.resolved();
        interiors.arrive(&pane, material);
        left *= interiors.transmittance(ray_length(&ray, &pane));
        left *= Vertex::parts(scene, &pane, MIN_PART, &interiors, ShadingNormals::Lumbre)
            .map(|(share, mut vertex)| {
                if regularize {
                    vertex.bsdf = vertex.bsdf.regularized();
                }
                vertex.straight_on() * share
            })
            .sum::<Spectrum>();
        if left.is_black() {
            return Spectrum::BLACK;
        }
        if !is_alone && pane.at.spectral.is_some() && material.is_some_and(Material::disperses) {
            is_alone = true;
            left = hero_alone(left);
        }
        if let Some(material) = material {
            interiors.cross(material, pane.front);
        }
        ray = pane.shadow_ray(sample);
    }
    Spectrum::BLACK
}
