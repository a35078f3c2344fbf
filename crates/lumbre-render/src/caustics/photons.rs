//! Photons in k-d trees: caustic light at its first non-specular surface.

use lumbre_math::{DVec3, Vec3};
use lumbre_shading::Spectrum;
use lumbre_shading::spectrum::Wavelengths;

/// Light that falls on a surface, or passes a point of a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Photon {
    /// The place.
    pub(crate) point: DVec3,
    /// The unit direction that it came from.
    pub(crate) towards: Vec3,
    /// The unit geometric normal on that side; zero in a medium.
    pub(crate) normal: Vec3,
    /// The medium that contains it, as [`crate::wave::paths::to_column`] writes it; undefined on a surface.
    pub(crate) medium: u32,
    /// Its power on a surface; in a medium, its power over the density of its position along the segment.
    pub(crate) flux: Spectrum,
    /// The density with which light paths start at the specular surface next to the light and choose that light: per
    /// unit of area and solid angle, per line. Infinite for light that no camera path finds.
    pub(crate) density: f32,
    /// Approximate solid angle of the lamp, seen over the specular surfaces; 0 for point lights and lights in one
    /// direction.
    pub(crate) lamp: f32,
    /// Specular bounces on its way.
    pub(crate) bounces: u32,
    /// Whether its flux is that of the hero wavelength, which stands for all.
    pub(crate) is_alone: bool,
}

impl Photon {
    /// Its flux for a path; `is_alone` says whether the hero wavelength stands for all of the path's, too.
    pub(crate) fn flux_for(&self, is_alone: bool) -> Spectrum {
        // Both have the factor for the missing wavelengths, which counts once.
        if is_alone && self.is_alone { self.flux / Wavelengths::COUNT as f32 } else { self.flux }
    }
}

/// The photons of a pass.
#[derive(Debug, Default)]
pub(crate) struct Photons {
    /// Those on surfaces.
    pub(crate) surfaces: PhotonMap,
    /// Those in media.
    pub(crate) media: PhotonMap,
}

impl Photons {
    /// All photons of a pass.
    pub(crate) fn new(photons: Vec<Photon>) -> Self {
        let (media, surfaces) = photons.into_iter().partition(|photon| photon.normal == Vec3::ZERO);
        Self { surfaces: PhotonMap::new(surfaces), media: PhotonMap::new(media) }
    }
}

/// Photons in a k-d tree: the middle of a range splits it, along the axis stored for its node (J. L. Bentley,
/// "Multidimensional Binary Search Trees Used for Associative Searching", 1975).
///
/// The tree and the order of a search depend only on the photons and their order.
#[derive(Debug, Default)]
pub(crate) struct PhotonMap {
    photons: Vec<Photon>,
    /// The split axis of each photon.
    axes: Vec<u8>,
}

impl PhotonMap {
    /// A map of photons.
    pub(crate) fn new(photons: Vec<Photon>) -> Self {
        let mut numbered: Vec<(u32, Photon)> = (0..).zip(photons).collect();
        let mut axes = vec![0; numbered.len()];
        let mut ranges = Vec::new();
        ranges.push(0..numbered.len());
        while let Some(range) = ranges.pop() {
            if range.is_empty() {
                continue;
            }
            let part = &mut numbered[range.clone()];
            let axis = longest_axis(part);
            let middle = part.len() / 2;
            // Indices make the order total, so that the halves do not depend on the algorithm.
            part.select_nth_unstable_by(middle, |(i, a), (j, b)| {
                a.point[axis].total_cmp(&b.point[axis]).then(i.cmp(j))
            });
            let at = range.start + middle;
            axes[at] = axis as u8;
            ranges.extend([range.start..at, at + 1..range.end]);
        }
        Self { photons: numbered.into_iter().map(|(_, photon)| photon).collect(), axes }
    }

    /// Visits all photons within `radius` of a point, always in the same order.
    pub(crate) fn within(&self, center: DVec3, radius: f64, mut visit: impl FnMut(&Photon)) {
        // A tree of 2³² photons has depth 32.
        let mut open = [(0, 0); 33];
        open[0] = (0, self.photons.len());
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (mut start, mut end) = open[count];
            while start < end {
                let middle = start + (end - start) / 2;
                let photon = &self.photons[middle];
                let axis = usize::from(self.axes[middle]);
                let beyond = center[axis] - photon.point[axis];
                if photon.point.distance_squared(center) <= radius * radius {
                    visit(photon);
                }
                let (near, far) = if beyond < 0.0 {
                    ((start, middle), (middle + 1, end))
                } else {
                    ((middle + 1, end), (start, middle))
                };
                if beyond.abs() <= radius {
                    open[count] = far;
                    count += 1;
                }
                (start, end) = near;
            }
        }
    }
}

/// The axis of the photons' largest extent.
fn longest_axis(photons: &[(u32, Photon)]) -> usize {
    let first = photons[0].1.point;
    let (min, max) = photons
        .iter()
        .fold((first, first), |(min, max), (_, photon)| (min.min(photon.point), max.max(photon.point)));
    let size = max - min;
    (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::{combine, uniform_f64};

    use super::*;

    fn photons(count: u64) -> Vec<Photon> {
        let number = |i, axis| uniform_f64(combine(i, axis));
        let at = |i| DVec3::new(number(i, 0), number(i, 1), 0.1 * number(i, 2));
        (0..count)
            .map(|i| Photon {
                point: at(i),
                towards: Vec3::Z,
                normal: Vec3::Z,
                medium: 0,
                flux: Spectrum::splat(i as f32),
                density: 1.0,
                lamp: 0.0,
                bounces: 1,
                is_alone: false,
            })
            .collect()
    }

    #[test]
    fn a_search_finds_what_a_look_at_every_photon_finds() {
        for count in [0, 1, 2, 3, 100, 2000] {
            let all = photons(count);
            let map = PhotonMap::new(all.clone());
            for query in 0..50 {
                let center =
                    all.get(query).map_or(DVec3::splat(0.3), |photon| photon.point + DVec3::splat(0.01));
                let radius = 0.004 * query as f64;
                let mut found = Vec::new();
                map.within(center, radius, |photon| found.push(photon.flux.r as u64));
                found.sort_unstable();
                let is_near = |photon: &&Photon| photon.point.distance_squared(center) <= radius * radius;
                let expected: Vec<u64> =
                    all.iter().filter(is_near).map(|photon| photon.flux.r as u64).collect();
                assert_eq!(found, expected, "{count} photons, query {query}");
            }
        }
    }

    #[test]
    fn photons_in_one_place_are_all_found() {
        let all = vec![Photon { point: DVec3::ONE, ..photons(1)[0] }; 1000];
        let mut found = 0;
        PhotonMap::new(all).within(DVec3::ONE, 0.0, |_| found += 1);
        assert_eq!(found, 1000);
    }
}
