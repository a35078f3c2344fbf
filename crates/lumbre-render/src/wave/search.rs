//! The closest hits of all rays of a wave.

use std::borrow::Cow;

use lumbre_geometry::{Ray, Surface};
use lumbre_kernel::{Hit, HitColumns, RayColumns};
use lumbre_scene::{Footprint, Interaction, Scene};

use crate::wave::paths::{Paths, Slots};

/// The hits of a wave's rays.
#[derive(Debug, Default)]
pub(crate) struct Hits {
    columns: HitColumns,
    /// Hits in double precision; used unless `is_single` says otherwise.
    double: Vec<Option<Hit>>,
    is_single: bool,
    /// The index in the columns of each ray's hit; empty if the hit of ray i is in column i.
    kept: Vec<u32>,
    /// The hits behind what rays pass through, by ascending index in the columns.
    behind: Vec<(u32, Option<Hit>)>,
    rays: Vec<Ray>,
    times: Vec<f64>,
}

/// A triangle of a mesh that a ray met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MetTriangle {
    /// The id of its geometry.
    pub(crate) id: u32,
    pub(crate) triangle: u32,
    /// The barycentrics of its second and third corner.
    pub(crate) local: [f32; 2],
}

impl MetTriangle {
    /// That of a hit in the columns.
    #[inline]
    fn in_column(columns: &HitColumns, column: usize) -> Self {
        Self {
            id: columns.id[column],
            triangle: columns.primitive[column],
            local: columns.local.each_ref().map(|local| local[column]),
        }
    }

    /// That of a whole hit.
    fn of(hit: &Hit) -> Self {
        Self { id: hit.id, triangle: hit.primitive, local: hit.root.local.as_vec2().to_array() }
    }
}

/// The precision of a wave's rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Precision {
    /// Rounded once, relative to the origin of the meshes; exact shapes are met in double precision.
    Single,
    /// In double precision throughout.
    Double,
}

impl Precision {
    /// Single precision, unless double was requested or the scene has no tree for it.
    pub(crate) fn of(scene: &Scene, asks_for_double: bool) -> Self {
        let is_single = !asks_for_double && scene.accel().picture_rounding().is_some();
        if is_single { Self::Single } else { Self::Double }
    }
}

impl Hits {
    /// Finds the closest hits of all rays; for camera rays, what they see.
    pub(crate) fn search(
        &mut self,
        scene: &Scene,
        paths: &Paths,
        slots: &Slots<'_>,
        precision: Precision,
        is_seen: bool,
    ) {
        let len = paths.len;
        self.is_single = precision == Precision::Single;
        self.kept.clear();
        self.behind.clear();
        let time = |path: usize| slots.time[paths.slot[path] as usize];
        if !self.is_single {
            self.rays.clear();
            self.rays.extend((0..len).map(|path| paths.ray(path, time(path))));
            self.double.resize(len, None);
            if is_seen {
                let numbers = |path: usize| slots.numbers(paths.slot[path] as usize).coverage();
                scene.closest_seen_batch(&self.rays, numbers, &mut self.double[..len]);
            } else {
                scene.closest_batch(&self.rays, &mut self.double[..len]);
            }
            return;
        }
        self.times.clear();
        if scene.moves() {
            self.times.extend((0..len).map(time));
        }
        let rays = RayColumns {
            origin: paths.origin.each_ref().map(|column| &column[..len]),
            direction: paths.direction.each_ref().map(|column| &column[..len]),
            t_max: None,
            time: scene.moves().then_some(&self.times),
        };
        scene.accel().closest_columns(&rays, false, &mut self.columns);
        if scene.has_cutouts() || is_seen && scene.has_one_sided() {
            self.pass_through(scene, paths, slots, is_seen);
        }
    }

    /// Records the hits behind cut-outs, and for camera rays those behind the backs of one-sided surfaces. Only the
    /// rays that pass through something are traced again, in double precision.
    fn pass_through(&mut self, scene: &Scene, paths: &Paths, slots: &Slots<'_>, is_seen: bool) {
        for path in 0..paths.len {
            let id = self.columns.id[path];
            if id == HitColumns::MISS || !(scene.may_be_cutout(id) || is_seen && scene.may_be_one_sided(id)) {
                continue;
            }
            let slot = paths.slot[path] as usize;
            let ray = paths.ray(path, slots.time[slot]);
            let Some(hit) = self.columns.to_hit(path) else { continue };
            if is_seen {
                let numbers = slots.numbers(slot).coverage();
                let is_met =
                    !scene.is_back_of_one_sided(&ray, &hit) && numbers[0] < scene.coverage(&ray, &hit);
                if !is_met {
                    self.behind.push((path as u32, scene.closest_seen(&ray, numbers)));
                }
            } else if !scene.is_solid(&ray, &hit) {
                self.behind.push((path as u32, scene.closest(&ray)));
            }
        }
    }

    /// Keeps the hits of the rays at these ascending indices.
    pub(crate) fn keep(&mut self, positions: &[u32]) {
        if self.is_single {
            self.kept.clear();
            self.kept.extend(positions);
            return;
        }
        for (to, &from) in positions.iter().enumerate() {
            self.double.swap(to, from as usize);
        }
    }

    /// The index in the columns of a ray's hit.
    #[inline]
    fn column(&self, path: usize) -> usize {
        self.kept.get(path).map_or(path, |&at| at as usize)
    }

    /// The hit behind the one at this index in the columns; `None` if the ray does not pass through that.
    #[inline]
    fn hit_behind(&self, column: usize) -> Option<&Option<Hit>> {
        if self.behind.is_empty() {
            return None;
        }
        let at = self.behind.binary_search_by_key(&(column as u32), |&(at, _)| at).ok()?;
        Some(&self.behind[at].1)
    }

    /// The hit of a ray.
    fn hit(&self, path: usize) -> Option<Cow<'_, Hit>> {
        if !self.is_single {
            return self.double[path].as_ref().map(Cow::Borrowed);
        }
        let column = self.column(path);
        match self.hit_behind(column) {
            Some(hit) => hit.as_ref().map(Cow::Borrowed),
            None => self.columns.to_hit(column).map(Cow::Owned),
        }
    }

    /// Whether a ray met nothing.
    pub(crate) fn is_miss(&self, path: usize) -> bool {
        if !self.is_single {
            return self.double[path].is_none();
        }
        let column = self.column(path);
        self.hit_behind(column).map_or(self.columns.id[column] == HitColumns::MISS, Option::is_none)
    }

    /// The top-level triangle that a ray met.
    #[inline]
    pub(crate) fn triangle(&self, path: usize) -> Option<MetTriangle> {
        let column = self.column(path);
        if self.is_single && self.hit_behind(column).is_none() {
            return self.columns.is_plain(column).then(|| MetTriangle::in_column(&self.columns, column));
        }
        self.hit(path).filter(|hit| hit.instances.is_empty()).map(|hit| MetTriangle::of(&hit))
    }

    /// The triangle that a ray met in a top-level instance, and the position of that in the tree.
    #[inline]
    pub(crate) fn triangle_in_instance(&self, path: usize) -> Option<(MetTriangle, u32)> {
        let column = self.column(path);
        if self.is_single && self.hit_behind(column).is_none() {
            let instance = self.columns.only_instance(column)?;
            return Some((MetTriangle::in_column(&self.columns, column), instance));
        }
        let hit = self.hit(path)?;
        Some((MetTriangle::of(&hit), hit.only_instance()?))
    }

    /// The length of a ray up to its hit.
    #[inline]
    pub(crate) fn distance(&self, path: usize) -> f32 {
        let column = self.column(path);
        if self.is_single && self.hit_behind(column).is_none() {
            return self.columns.t[column];
        }
        self.hit(path).map_or(0.0, |hit| hit.root.t as f32)
    }

    /// The length of a ray up to its hit; infinite without one.
    pub(crate) fn distance_f64(&self, path: usize) -> f64 {
        self.hit(path).map_or(f64::INFINITY, |hit| hit.root.t)
    }

    /// The full interaction at a ray's hit.
    pub(crate) fn interaction<'s>(
        &self,
        scene: &'s Scene,
        path: usize,
        ray: &Ray,
        footprint: &Footprint,
    ) -> Option<Interaction<'s>> {
        let hit = self.hit(path)?;
        Some(if self.is_single {
            scene.picture_interaction(ray, &hit, footprint)
        } else {
            scene.interaction(ray, &hit, footprint)
        })
    }

    /// Whether the rays that leave the hits are rounded to single precision.
    pub(crate) fn is_single(&self) -> bool {
        self.is_single
    }

    /// Whether a ray met the ground.
    pub(crate) fn is_ground(&self, scene: &Scene, path: usize) -> bool {
        let column = self.column(path);
        if self.is_single && self.hit_behind(column).is_none() {
            let id = self.columns.id[column];
            return id != HitColumns::MISS && scene.is_ground(id);
        }
        self.hit(path).is_some_and(|hit| scene.is_ground(hit.id))
    }

    /// The geometric surface that a ray met.
    pub(crate) fn surface(&self, scene: &Scene, path: usize, ray: &Ray) -> Option<Surface> {
        let hit = self.hit(path)?;
        let accel = scene.accel();
        Some(if self.is_single { accel.picture_surface(ray, &hit) } else { accel.surface(ray, &hit) })
    }
}
