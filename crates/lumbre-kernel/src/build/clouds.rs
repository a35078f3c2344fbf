//! Checks, measures and boxes clouds of spheres for the build.

use lumbre_geometry::Aabb;
use lumbre_math::DVec3;
use rayon::prelude::*;

use crate::build::error::BuildError;
use crate::build::primitive::{Bounds, Primitive};
use crate::tree::geometry::SphereCloud;
use crate::tree::node::TreeSpace;
use crate::tree::sphere_block::{ExactSphere, has_radius};

/// Spheres per task.
const CHUNK: usize = 1 << 13;

/// What the build knows of a cloud.
pub(crate) struct CloudSurvey {
    pub(crate) geometry: u32,
    /// Number of spheres with a radius.
    pub(crate) spheres: usize,
    pub(crate) bounds: Aabb,
    /// The largest coordinate of a centre, relative to the cloud's origin, plus the largest radius.
    pub(crate) reach: f64,
    // Spheres with a radius in each `CHUNK`.
    chunks: Vec<u32>,
}

/// The largest values of some spheres, and the box around their centres.
#[derive(Clone, Copy)]
struct Seen {
    low: DVec3,
    high: DVec3,
    radius: f64,
    count: u32,
}

impl Seen {
    const NOTHING: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, radius: 0.0, count: 0 };

    fn join(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            radius: self.radius.max(other.radius),
            count: self.count + other.count,
        }
    }
}

impl CloudSurvey {
    /// Checks a cloud, and finds the box around its spheres that have a radius.
    pub(crate) fn of(position: usize, cloud: &SphereCloud) -> Result<Self, BuildError> {
        let not_finite = |element| BuildError::NotFinite { geometry: position, element };
        if !cloud.origin.is_finite() {
            return Err(not_finite(0));
        }
        let is_broken = |sphere: &[f32; 4]| !sphere.iter().all(|x| x.is_finite());
        let survey_chunk = |chunk: &[[f32; 4]]| {
            // The sum of x * 0 is zero only if every x is finite.
            let sum = chunk.iter().flatten().fold(0.0, |sum: f32, x| sum + x * 0.0);
            sum.is_finite().then(|| {
                chunk.iter().filter(|sphere| has_radius(sphere)).fold(Seen::NOTHING, |seen, sphere| {
                    let radius = f64::from(sphere[3]);
                    let center = DVec3::new(sphere[0].into(), sphere[1].into(), sphere[2].into());
                    seen.join(Seen { low: center - radius, high: center + radius, radius, count: 1 })
                })
            })
        };
        let seen: Option<Vec<Seen>> = cloud.spheres.par_chunks(CHUNK).map(survey_chunk).collect();
        let Some(seen) = seen else {
            return Err(not_finite(cloud.spheres.iter().position(is_broken).unwrap_or_default()));
        };
        let chunks = seen.iter().map(|seen| seen.count).collect();
        let all = seen.into_iter().fold(Seen::NOTHING, Seen::join);
        let (mut bounds, mut reach) = (Aabb::EMPTY, 0.0);
        if all.count > 0 {
            // Rounded once more here and when a sphere gets its centre.
            bounds = Aabb { min: cloud.origin + all.low, max: cloud.origin + all.high }.outward(3);
            reach = all.low.abs().max(all.high.abs()).max_element() + all.radius;
        }
        Ok(Self { geometry: position as u32, spheres: all.count as usize, bounds, reach, chunks })
    }

    /// Writes the boxes of the spheres that have a radius.
    pub(crate) fn put_boxes(
        &self,
        cloud: &SphereCloud,
        tree_space: &TreeSpace,
        mut places: &mut [Primitive],
    ) {
        let chunks: Vec<(usize, &mut [Primitive])> = self
            .chunks
            .iter()
            .enumerate()
            .map(|(chunk, &count)| {
                (chunk, places.split_off_mut(..count as usize).expect("they were counted"))
            })
            .collect();
        chunks.into_par_iter().for_each(|(chunk, places)| {
            let first = chunk * CHUNK;
            let spheres = cloud.spheres[first..].iter().take(CHUNK).enumerate();
            let there = spheres.filter(|(_, sphere)| has_radius(sphere));
            for (place, (i, _)) in places.iter_mut().zip(there) {
                let primitive = (first + i) as u32;
                *place = box_of(cloud, primitive, tree_space).with_ids(self.geometry, primitive);
            }
        });
    }
}

/// The box around a sphere in tree units, without ids.
#[inline(always)]
pub(crate) fn box_of(cloud: &SphereCloud, primitive: u32, tree_space: &TreeSpace) -> Bounds {
    let ExactSphere { center, radius } = ExactSphere::of(cloud, primitive);
    Bounds::near(tree_space, &Aabb { min: center - radius, max: center + radius }, 0, 0)
}
