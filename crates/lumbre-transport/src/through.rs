//! Light that reaches a place through what is clear.

use lumbre_geometry::Ray;
use lumbre_scene::{Footprint, Interaction, LightSample, Scene};
use lumbre_shading::Spectrum;

use crate::direct::Vertex;
use crate::interior::Interiors;
use crate::path::ray_length;
use crate::{Draw, RayCounts};

/// Surfaces at most that light goes through or is reflected by inside a solid.
const MOST_SURFACES: u32 = 16;
/// How far the product of the indices along a path may be from 1 by rounding.
const INDEX_ERROR: f32 = 1e-4;

/// An estimate of the light at infinity that comes back along a ray which meets something first: refracted, spread by what is
/// rough, and reflected inside solids, but not by their outer sides. Black where the ray meets nothing, or what is not clear.
///
/// What solids scatter inside is not followed. The draw's vertices from `first` on choose the way.
pub(crate) fn light_through(
    scene: &Scene,
    mut ray: Ray,
    draw: &Draw,
    first: u32,
    rays: &mut RayCounts,
) -> Spectrum {
    let mut throughput = Spectrum::WHITE;
    let mut interiors = Interiors::default();
    // Index of refraction where the path is, over that where it began.
    let mut index = 1.0_f32;
    for surface in 0..MOST_SURFACES {
        rays.bounce += 1;
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
        let Some(vertex) = Vertex::new(scene, &here, &interiors) else { return Spectrum::BLACK };
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

/// What is left of the light of a sample after all the panes between a place and the light; black where there is anything else,
/// and where there is nothing at all.
///
/// Panes without thickness that are smooth are what light goes straight through. What bends it would have to be found by
/// chance, and light from a point or from one direction never is.
pub(crate) fn share_through_panes(
    scene: &Scene,
    from: &Interaction<'_>,
    sample: &LightSample,
    rays: &mut RayCounts,
) -> Spectrum {
    let mut share = Spectrum::WHITE;
    let mut ray = from.shadow_ray(sample);
    for surface in 0..MOST_SURFACES {
        rays.shadow += 1;
        let Some(hit) = scene.closest(&ray) else {
            let is_open = surface == 0;
            return if is_open { Spectrum::BLACK } else { share };
        };
        let pane = scene.interaction(&ray, &hit, &Footprint::Point);
        let Some(vertex) = Vertex::new(scene, &pane, &Interiors::default()) else { return Spectrum::BLACK };
        let straight = vertex.specular().filter(|bounce| bounce.transmitted && bounce.eta == 1.0);
        share *= straight.map(|bounce| bounce.weight).sum::<Spectrum>();
        if share.is_black() {
            return Spectrum::BLACK;
        }
        ray = pane.shadow_ray(sample);
    }
    Spectrum::BLACK
}
