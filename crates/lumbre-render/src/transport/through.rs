//! Light that reaches a point through clear surfaces.

use lumbre_geometry::Ray;
use lumbre_scene::{Footprint, Interaction, LightSample, Scene};
use lumbre_shading::spectrum::Wavelengths;
use lumbre_shading::{Material, Scatter, ShadingNormals, Spectrum};

use crate::transport::direct::Vertex;
use crate::transport::interior::{MediumStack, Solid};
use crate::transport::{Record, SampleNumbers};

/// Maximum surfaces that refract or reflect light inside a solid.
const MAX_SURFACES: u32 = 16;
/// Maximum surfaces that light passes straight through.
const MAX_PANES: u32 = 256;
/// A smaller part of a pane's mixture is not followed separately.
const MIN_PART: f32 = 1.0 / 256.0;
/// Maximum rounding error of the product of the indices along a path.
const INDEX_ERROR: f32 = 1e-4;

/// The distance from a ray's origin to its hit; its direction is unit.
pub(crate) fn ray_length(ray: &Ray, here: &Interaction) -> f64 {
    (here.surface.point - ray.origin).length()
}

/// The throughput of the hero wavelength, which replaces all of them.
pub(crate) fn hero_alone(throughput: Spectrum) -> Spectrum {
    Spectrum::new(Wavelengths::COUNT as f32 * throughput.r, 0.0, 0.0)
}

/// An estimate of the light at infinity that comes back along a ray which meets something first: refracted, spread by
/// rough surfaces, and reflected inside solids, but not by their outer sides. Black if the ray meets nothing, or
/// something that is not clear.
///
/// Scattering inside solids is not followed. The random numbers of vertices from `first` on choose the light's path.
pub(crate) fn light_through(
    scene: &Scene,
    mut ray: Ray,
    numbers: &SampleNumbers,
    first: u32,
    record: &mut Record,
) -> Spectrum {
    let mut throughput = Spectrum::WHITE;
    let mut interiors = MediumStack::default();
    // Index of refraction at the path's point, relative to that at its start.
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
        let Some(bounce) = vertex.sample(numbers.lobe(first + surface), numbers.direction(first + surface))
        else {
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
            interiors.cross(vertex.solid(), here.front);
        }
        ray = vertex.leave(&bounce);
    }
    Spectrum::BLACK
}

/// Whether [`straight_on`] follows a light sample through panes although paths find all other light behind them: for
/// point lights and lights in one direction, which no path finds by chance, so that nothing counts twice.
pub(crate) fn goes_straight_on(scene: &Scene, sample: &LightSample) -> bool {
    sample.scatter == Scatter::Delta && scene.has_delta_transmission()
}

/// The share of a light sample that arrives where `shadow_ray` starts, inside of `interiors`: the product of the
/// straight transmission of all surfaces on the way ([`lumbre_shading::Bsdf::straight_on`], of regularized BSDFs if the
/// path's are) and of the transmittance of solids. Black behind anything else, and behind more than [`MAX_PANES`]
/// surfaces.
///
/// Only for light that rays through the pane itself do not find too, or it would count twice: for paths, see
/// [`goes_straight_on`]. Refracting or rough surfaces block this light. Paths find the light on rough ones. Smooth
/// refracting ones would have to send a path to such a light by chance, which never happens.
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
            // Light from infinity was not inside any solid.
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
            interiors.cross(Solid::new(&pane, material), pane.front);
        }
        ray = pane.shadow_ray(sample);
    }
    Spectrum::BLACK
}
