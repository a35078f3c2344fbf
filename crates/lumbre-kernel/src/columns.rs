//! Rays of a picture and their hits, in columns.

use std::ops::Range;

use lumbre_geometry::{Ray, Root};
use lumbre_math::{DVec3, Vec3};

use crate::intersect::filter_start::FilterStart;
use crate::intersect::watertight::root;
use crate::trace::Winner;
use crate::trace::picture::Crossing;
use crate::tree::node::{ROUNDOFF, round_up};
use crate::{Accel, Geometry, GeometryKind, Hit, InstancePath, Placement, Ray32};

/// Rays of a picture, in columns of equal length: `t` starts at 0.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    /// Where `t` is 0: x, y and z.
    pub origin: [&'a [f64]; 3],
    /// Where `t` grows to, of any length but zero.
    pub direction: [&'a [f32]; 3],
    /// The largest `t` that counts, itself included; `None` where all are infinite.
    pub t_max: Option<&'a [f32]>,
    /// The time of each, in the unit of the keys of what moves; `None` where all are 0.
    pub time: Option<&'a [f64]>,
}

impl RayColumns<'_> {
    /// How many rays there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.origin[0].len()
    }

    /// Whether there are none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them, in double precision.
    ///
    /// # Panics
    /// When `i` is out of range.
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

    /// Some of them.
    pub(crate) fn slice(&self, range: Range<usize>) -> Self {
        let RayColumns { origin, direction, t_max, time } = *self;
        Self {
            origin: origin.map(|column| &column[range.clone()]),
            direction: direction.map(|column| &column[range.clone()]),
            t_max: t_max.map(|column| &column[range.clone()]),
            time: time.map(|column| &column[range]),
        }
    }

    /// # Panics
    /// When the columns differ in length.
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
    /// The id of the geometry; [`HitColumns::MISS`] where nothing is hit, and the other columns mean nothing.
    pub id: Vec<u32>,
    /// The triangle of a mesh, the sphere of a cloud, the primitive of a custom geometry, else 0.
    pub primitive: Vec<u32>,
    /// Of a triangle, the barycentrics of its second and third corner.
    pub local: [Vec<f32>; 2],
    /// Where along the ray.
    pub t: Vec<f32>,
    /// The position of the geometry in the list of the tree; with the bit [`WHOLE`], that of the hit among `whole`.
    geometry: Vec<u32>,
    /// Hits that the columns do not hold whole.
    whole: Vec<WholeHit>,
}

/// A hit in an instance of an instance, or any other.
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

/// Marks a place among whole hits; with the other, one of a triangle of a mesh in the tree itself.
const WHOLE: u32 = 1 << 31;
const PLAIN: u32 = 1 << 30;

impl HitColumns {
    /// The id where nothing is hit: no geometry may have it.
    pub const MISS: u32 = u32::MAX;

    /// How many rays they answer.
    #[inline]
    pub fn len(&self) -> usize {
        self.id.len()
    }

    /// Whether they answer none.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.id.is_empty()
    }

    /// Whether a ray hits a triangle of a [`TriangleMesh`](crate::TriangleMesh) that stands in the tree itself, in no instance: the
    /// columns then say all.
    #[inline]
    pub fn is_plain(&self, i: usize) -> bool {
        self.id[i] != Self::MISS && (self.geometry[i] & WHOLE == 0 || self.geometry[i] & PLAIN != 0)
    }

    /// The whole hit of a ray, as [`Accel::surface`] and its like take it.
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

    /// Makes room for the hits of so many rays, which are all misses until they are put.
    pub(crate) fn clear(&mut self, len: usize) {
        let Self { id, primitive, local: [u, v], t, geometry, whole } = self;
        whole.clear();
        id.clear();
        id.resize(len, Self::MISS);
        // What stands there means nothing.
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

    /// A hit of a triangle in single precision, or of anything.
    #[inline(always)]
    pub(crate) fn put_crossing(&mut self, i: usize, accel: &Accel, crossing: Crossing) {
        let Winner { root, geometry, primitive } = crossing.winner;
        if crossing.is_plain(accel) {
            let id = accel.geometries[geometry as usize].id;
            let local = [root.local.x as f32, root.local.y as f32];
            self.put_plain(i, (id, primitive, geometry), root.t as f32, local);
            return;
        }
        match crossing.placed(accel) {
            Some((id, instance)) => self.put_near(i, crossing.winner, id, instance, false),
            None => self.put_hit(i, accel, crossing.into_hit(accel)),
        }
    }

    /// A hit in double precision, outside of instances.
    #[inline(always)]
    pub(crate) fn put_winner(&mut self, i: usize, accel: &Accel, winner: Winner) {
        let geometry = &accel.geometries[winner.geometry as usize];
        self.put_near(i, winner, geometry.id, None, matches!(geometry.kind, GeometryKind::Mesh(_)));
    }

    /// A hit in double precision.
    pub(crate) fn put_hit(&mut self, i: usize, accel: &Accel, hit: Hit) {
        let Hit { root, id, primitive, geometry, .. } = hit;
        if hit.route.is_empty() {
            return self.put_winner(i, accel, Winner { root, geometry, primitive });
        }
        self.put_rounded(i, (id, primitive), &root, 0);
        self.whole.push(WholeHit::Nested(Box::new(hit)));
    }

    #[inline(always)]
    fn put_near(&mut self, i: usize, winner: Winner, id: u32, instance: Option<(u32, u32)>, is_plain: bool) {
        self.put_rounded(i, (id, winner.primitive), &winner.root, if is_plain { PLAIN } else { 0 });
        self.whole.push(WholeHit::Near { winner, id, instance });
    }

    /// What the columns hold of the whole hit that is pushed next.
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

/// By how much rays of a picture are rounded, and triangles with them: see [`Accel::picture_rounding`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureRounding {
    /// What rays in single precision start relative to.
    pub origin: DVec3,
    /// How far a ray's start moves on each axis, by its distance from the origin there.
    pub relative: f64,
    /// How far a triangle seems to be from where it is, by the size of the tree.
    pub absolute: f64,
}

impl PictureRounding {
    /// What [`Surface::point_error`](lumbre_geometry::Surface::point_error) is to grow by, axis by axis, for a point on a triangle of a
    /// mesh that stands in the tree itself, so that the rays that leave it do not hit the triangle.
    #[inline]
    pub fn error(&self, point: DVec3) -> DVec3 {
        (point - self.origin).abs() * self.relative + self.absolute
    }
}

/// What rays of a picture need to start in single precision: relative to the mesh.
#[derive(Clone, Debug)]
pub(crate) struct PictureStart {
    /// For rays that start relative to the mesh.
    pub(crate) start: FilterStart,
    pub(crate) rounding: PictureRounding,
    /// How far a hit in the tree may be from its triangle, on each axis, as seen from a ray that comes to it as to an instance, and that
    /// was not rounded: see `trace::picture`.
    deviation: f64,
    /// Whether there are triangles in single precision in the tree, or in its instances.
    has_triangles: bool,
}

impl PictureStart {
    /// That of a tree in which single precision is of use.
    #[inline]
    pub(crate) fn of(accel: &Accel) -> Option<&Self> {
        accel.picture.as_ref().filter(|picture| picture.has_triangles)
    }

    /// Of a tree that has this start; `None` where pictures take double precision: also where instances move.
    pub(crate) fn new(geometries: &[Geometry], start: Option<&FilterStart>) -> Option<Self> {
        let start = start?;
        let (mut within, mut has_triangles) = (0.0f64, false);
        for geometry in geometries {
            has_triangles |= matches!(geometry.kind, GeometryKind::Mesh(_));
            let GeometryKind::Instance(instance) = &geometry.kind else { continue };
            let Placement::Still(map) = &instance.world_from_object else { return None };
            if let Some(picture) = &instance.accel.picture {
                let linear = map.affine().matrix3;
                let size = linear.x_axis.abs() + linear.y_axis.abs() + linear.z_axis.abs();
                within = within.max(size.max_element() * picture.deviation);
                has_triangles |= picture.has_triangles;
            }
        }
        let shift = start.shift.iter().fold(0.0f32, |most, shift| most.max(shift.abs()));
        let own = ROUNDOFF * (128.0 + 2.0 * f64::from(shift)) / start.scale;
        let rounding = PictureRounding {
            origin: DVec3::from_slice(&start.mesh_origin),
            relative: RELATIVE * ROUNDOFF,
            absolute: ABSOLUTE * ROUNDOFF / start.scale,
        };
        let room = within * start.scale;
        // Also where that is no number.
        (room <= MOST_ROOM).then(|| Self {
            start: start.relative_to_mesh(round_up(room)),
            rounding,
            deviation: own.max(within),
            has_triangles,
        })
    }

    /// Where a ray starts, as single precision knows it.
    #[inline(always)]
    pub(crate) fn local(&self, columns: &RayColumns, i: usize) -> Ray32 {
        let origin = DVec3::from_array(columns.origin.map(|column| column[i])) - self.rounding.origin;
        Ray32 {
            origin: origin.as_vec3(),
            t_min: 0.0,
            direction: Vec3::from_array(columns.direction.map(|column| column[i])),
            t_max: columns.t_max.map_or(f32::INFINITY, |column| column[i]),
        }
    }

    /// Adds rays, rounded, relative to the mesh.
    pub(crate) fn push_rays(&self, columns: &RayColumns, range: Range<usize>, rays: &mut Vec<Ray32>) {
        let columns = columns.slice(range);
        rays.extend((0..columns.len()).map(|i| self.local(&columns, i)));
    }
}

/// See [`Accel::picture_rounding`].
const RELATIVE: f64 = 2.0;
const ABSOLUTE: f64 = 20.0;
/// By no more than this, in tree units, boxes may be moved for what is in instances.
const MOST_ROOM: f64 = 1.0 / 1024.0;
