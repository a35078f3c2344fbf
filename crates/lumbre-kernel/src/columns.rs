//! Picture rays and their hits, in columns.

use std::ops::Range;

use lumbre_geometry::{Ray, Root};
use lumbre_math::{DVec3, Vec3};

use crate::hit::{Hit, InstancePath};
use crate::intersect::watertight::root;
use crate::ray32::Ray32;
use crate::trace::Winner;
use crate::trace::picture::Crossing;
use crate::tree::picture_start::PictureStart;
use crate::tree::{GeometryKind, Tree};

/// Picture rays, in columns of equal length: `t` starts at 0.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    /// The point at `t` = 0: x, y and z.
    pub origin: [&'a [f64]; 3],
    /// The direction of increasing `t`, of any length but zero.
    pub direction: [&'a [f32]; 3],
    /// The largest `t`, inclusive; `None` if all are infinite.
    pub t_max: Option<&'a [f32]>,
    /// The time of each ray, in the unit of motion keys; `None` if all are 0.
    pub time: Option<&'a [f64]>,
}

impl RayColumns<'_> {
    /// Number of rays.
    #[inline]
    pub fn len(&self) -> usize {
        self.origin[0].len()
    }

    /// Whether there are no rays.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A ray, in double precision.
    ///
    /// # Panics
    /// If `i` is out of range.
    #[inline]
    pub fn ray(&self, i: usize) -> Ray {
        let [x, y, z] = self.direction.map(|column| f64::from(column[i]));
        Ray {
            origin: DVec3::from_array(self.origin.map(|column| column[i])),
            direction: DVec3::new(x, y, z),
            t_min: 0.0,
            t_max: self.t_max.map_or(f64::INFINITY, |column| f64::from(column[i])),
            time: self.time.map_or(0.0, |column| column[i]),
        }
    }

    /// A range of the rays.
    pub(crate) fn slice(&self, range: Range<usize>) -> Self {
        let RayColumns { origin, direction, t_max, time } = *self;
        Self {
            origin: origin.map(|column| &column[range.clone()]),
            direction: direction.map(|column| &column[range.clone()]),
            t_max: t_max.map(|column| &column[range.clone()]),
            time: time.map(|column| &column[range]),
        }
    }

    /// The start of a ray in single precision.
    #[inline(always)]
    pub(crate) fn local(&self, picture: &PictureStart, i: usize) -> Ray32 {
        let origin = DVec3::from_array(self.origin.map(|column| column[i])) - picture.rounding.origin;
        Ray32 {
            origin: origin.as_vec3(),
            t_min: 0.0,
            direction: Vec3::from_array(self.direction.map(|column| column[i])),
            t_max: self.t_max.map_or(f32::INFINITY, |column| column[i]),
        }
    }

    /// Appends a range of the rays, rounded, relative to the mesh.
    pub(crate) fn push_local(&self, picture: &PictureStart, range: Range<usize>, rays: &mut Vec<Ray32>) {
        rays.extend(range.map(|i| self.local(picture, i)));
    }

    /// # Panics
    /// If the columns differ in length.
    pub(crate) fn check(&self) {
        let len = self.len();
        let are_equal = self.origin.iter().all(|column| column.len() == len)
            && self.direction.iter().all(|column| column.len() == len)
            && self.t_max.is_none_or(|column| column.len() == len)
            && self.time.is_none_or(|column| column.len() == len);
        assert!(are_equal, "columns of equal length");
    }
}

/// The closest hits of rays, in columns. The vectors keep their memory from one search to the next.
#[derive(Clone, Debug, Default)]
pub struct HitColumns {
    /// The id of the geometry; [`HitColumns::MISS`] if nothing is hit, and then the other columns are undefined.
    pub id: Vec<u32>,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, otherwise 0.
    pub primitive: Vec<u32>,
    /// For a triangle, the barycentrics of its second and third corner.
    pub local: [Vec<f32>; 2],
    /// The position along the ray.
    pub t: Vec<f32>,
    /// The position of the geometry in the list of the tree; with the bit [`WHOLE`], the index of the hit in `whole`.
    geometry: Vec<u32>,
    /// Hits that do not fit the columns.
    whole: Vec<WholeHit>,
}

/// A hit in a nested instance, or any other hit.
#[derive(Clone, Debug)]
enum WholeHit {
    /// With the position and the id of the instance.
    Near {
        winner: Winner,
        id: u32,
        instance: Option<(u32, u32)>,
    },
    Nested(Box<Hit>),
}

/// Marks an index into `whole`; without it, the hit is on a triangle of a mesh in the tree itself.
const WHOLE: u32 = 1 << 31;
const PLAIN: u32 = 1 << 30;

impl HitColumns {
    /// The id if nothing is hit: no geometry may have it.
    pub const MISS: u32 = u32::MAX;

    /// Number of rays that they answer.
    #[inline]
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// Whether they answer no rays.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// Whether a ray hits a triangle of a [`TriangleMesh`](crate::TriangleMesh) in the tree itself, outside of
    /// instances: the columns then hold the complete hit.
    #[inline]
    pub fn is_plain(&self, i: usize) -> bool {
        self.id[i] != Self::MISS && (self.geometry[i] & WHOLE == 0 || self.geometry[i] & PLAIN != 0)
    }

    /// The position of the instance around a hit, if there is exactly one: see [`Hit::only_instance`].
    #[inline]
    pub fn only_instance(&self, i: usize) -> Option<u32> {
        if self.id[i] == Self::MISS || self.geometry[i] & WHOLE == 0 {
            return None;
        }
        match &self.whole[(self.geometry[i] & !(WHOLE | PLAIN)) as usize] {
            WholeHit::Near { instance, .. } => instance.map(|(position, _)| position),
            WholeHit::Nested(hit) => hit.only_instance(),
        }
    }

    /// The complete hit of a ray, for [`Accel::surface`](crate::Accel::surface) and similar methods.
    pub fn to_hit(&self, i: usize) -> Option<Hit> {
        let (id, geometry) = (self.id[i], self.geometry[i]);
        if id == Self::MISS {
            return None;
        }
        if geometry & WHOLE != 0 {
            return Some(match &self.whole[(geometry & !(WHOLE | PLAIN)) as usize] {
                WholeHit::Nested(hit) => (**hit).clone(),
                &WholeHit::Near { winner, id, instance } => hit(winner, id, instance),
            });
        }
        let local = [self.local[0][i], self.local[1][i]].map(f64::from);
        let root = root(self.t[i].into(), local.into());
        Some(hit(Winner { root, geometry, primitive: self.primitive[i] }, id, None))
    }

    /// Resizes the columns for this many rays, which are misses until they are set.
    pub(crate) fn clear(&mut self, len: usize) {
        let Self { id, primitive, local: [u, v], t, geometry, whole } = self;
        whole.clear();
        id.clear();
        id.resize(len, Self::MISS);
        // Existing values are overwritten.
        primitive.resize(len, 0);
        geometry.resize(len, 0);
        for column in [u, v, t] {
            column.resize(len, 0.0);
        }
    }

    /// A triangle of a mesh in the tree itself.
    #[inline(always)]
    pub(crate) fn put_plain(
        &mut self,
        i: usize,
        (id, primitive, geometry): (u32, u32, u32),
        t: f32,
        local: [f32; 2],
    ) {
        self.id[i] = id;
        self.primitive[i] = primitive;
        self.geometry[i] = geometry;
        (self.local[0][i], self.local[1][i]) = (local[0], local[1]);
        self.t[i] = t;
    }

    /// A hit on a triangle in single precision, or on any primitive.
    #[inline(always)]
    pub(crate) fn put_crossing(&mut self, i: usize, tree: &Tree, crossing: Crossing) {
        let Winner { root, geometry, primitive } = crossing.winner;
        if crossing.is_plain(tree) {
            let id = tree.geometries[geometry as usize].id;
            let local = [root.local.x as f32, root.local.y as f32];
            self.put_plain(i, (id, primitive, geometry), root.t as f32, local);
            return;
        }
        match crossing.placed(tree) {
            Some((id, instance)) => self.put_near(i, crossing.winner, id, instance, false),
            None => self.put_hit(i, tree, crossing.into_hit(tree)),
        }
    }

    /// A hit in double precision, outside of instances.
    #[inline(always)]
    pub(crate) fn put_winner(&mut self, i: usize, tree: &Tree, winner: Winner) {
        let geometry = &tree.geometries[winner.geometry as usize];
        self.put_near(i, winner, geometry.id, None, matches!(geometry.kind, GeometryKind::Mesh(_)));
    }

    /// A hit in double precision.
    pub(crate) fn put_hit(&mut self, i: usize, tree: &Tree, hit: Hit) {
        let Hit { root, id, primitive, geometry, .. } = hit;
        if hit.route.is_empty() {
            return self.put_winner(i, tree, Winner { root, geometry, primitive });
        }
        self.put_rounded(i, (id, primitive), &root, 0);
        self.whole.push(WholeHit::Nested(Box::new(hit)));
    }

    #[inline(always)]
    fn put_near(&mut self, i: usize, winner: Winner, id: u32, instance: Option<(u32, u32)>, is_plain: bool) {
        self.put_rounded(i, (id, winner.primitive), &winner.root, if is_plain { PLAIN } else { 0 });
        self.whole.push(WholeHit::Near { winner, id, instance });
    }

    /// The column values of the hit that is pushed to `whole` next.
    #[inline(always)]
    fn put_rounded(&mut self, i: usize, (id, primitive): (u32, u32), root: &Root, mark: u32) {
        let place = self.whole.len() as u32 | WHOLE | mark;
        let local = [root.local.x as f32, root.local.y as f32];
        self.put_plain(i, (id, primitive, place), root.t as f32, local);
    }
}

/// A hit in no instance, or in one: by position and id.
fn hit(Winner { root, geometry, primitive }: Winner, id: u32, instance: Option<(u32, u32)>) -> Hit {
    let (mut instances, mut route) = (InstancePath::new(), InstancePath::new());
    if let Some((position, id)) = instance {
        route.push(position);
        instances.push(id);
    }
    Hit { root, id, primitive, geometry, instances, route }
}
