//! The geometry of objects: their surfaces, and what is inside of them.

use std::sync::Arc;

use lumbre_geometry::{
    Aabb, Cone, Cuboid, Cylinder, Disk, ImplicitSurface, PlacedShape, Plane, Ray, Root, Roots, Shape,
    ShapeError, Sphere, Surface, Torus, Triangle,
};
use lumbre_kernel::CustomGeometry;
use lumbre_math::interval::{Dual, Interval};
use lumbre_math::{DVec2, DVec3, Transform};

use super::algebraic::Algebraic;
use super::blob::Blob;
use super::heights::Heights;
use super::iso::Iso;
use super::julia::Julia;
use super::mesh_tree::{MeshBody, MeshTrees, mesh_hit};
use super::objects::{Form, Object, Operation};
use super::sweep::Sweep;
use super::swept::Swept;

/// A surface in the world, with what is inside of it.
#[derive(Clone, Debug)]
pub(super) enum Solid {
    /// The surface, and where it is open the same one closed.
    Exact {
        surface: PlacedShape,
        closed: Option<PlacedShape>,
    },
    Implicit {
        surface: ImplicitSurface,
        world_from_object: Transform,
    },
    Body {
        body: Body,
        world_from_object: Transform,
    },
}

/// A solid that says itself where rays cross it, in its own space.
#[derive(Clone, Debug)]
pub(super) enum Body {
    Swept(Arc<Swept>),
    Iso(Arc<Iso>),
    Sweep(Arc<Sweep>),
    Julia(Arc<Julia>),
    Algebraic(Arc<Algebraic>),
    Blob(Arc<Blob>),
    Heights(Arc<Heights>),
    Mesh(Arc<MeshBody>),
}

impl Body {
    fn roots(&self, ray: &Ray, out: &mut Roots) {
        match self {
            Self::Swept(swept) => swept.roots(ray, out),
            Self::Iso(iso) => iso.roots(ray, out),
            Self::Sweep(sweep) => sweep.roots(ray, out),
            Self::Julia(julia) => julia.roots(ray, out),
            Self::Algebraic(poly) => poly.roots(ray, out),
            Self::Blob(blob) => blob.roots(ray, out),
            Self::Heights(heights) => heights.roots(ray, out),
            Self::Mesh(mesh) => mesh.roots(ray, out),
        }
    }

    fn normal(&self, p: DVec3, root: &Root) -> DVec3 {
        match self {
            Self::Swept(swept) => swept.normal(p, root),
            Self::Iso(iso) => iso.normal(p, root),
            Self::Sweep(sweep) => sweep.normal(p, root),
            Self::Julia(julia) => julia.normal(p),
            Self::Algebraic(poly) => poly.normal(p),
            Self::Blob(blob) => blob.normal(p),
            Self::Heights(heights) => heights.normal(p),
            Self::Mesh(mesh) => mesh.normal(root),
        }
    }

    /// The coordinates on the surface.
    fn uv(&self, p: DVec3, root: &Root) -> DVec2 {
        match self {
            Self::Swept(swept) => swept.uv(p, root),
            Self::Heights(_) => DVec2::new(p.x, p.z),
            Self::Mesh(mesh) => mesh.uv(root),
            _ => root.local,
        }
    }

    fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Swept(swept) => swept.contains(p),
            Self::Iso(iso) => iso.contains(p),
            Self::Sweep(sweep) => sweep.contains(p),
            Self::Julia(julia) => julia.contains(p),
            Self::Algebraic(poly) => poly.contains(p),
            Self::Blob(blob) => blob.contains(p),
            Self::Heights(heights) => heights.contains(p),
            Self::Mesh(mesh) => mesh.contains(p),
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(match self {
            Self::Swept(swept) => swept.bounds(),
            Self::Iso(iso) => iso.bounds(),
            Self::Sweep(sweep) => sweep.bounds(),
            Self::Julia(julia) => julia.bounds(),
            Self::Algebraic(_) => return None,
            Self::Blob(blob) => blob.bounds(),
            Self::Heights(heights) => heights.bounds(),
            Self::Mesh(mesh) => mesh.bounds(),
        })
    }
}

impl Solid {
    /// The solid of a form; `None` for those that are none by themselves.
    pub(super) fn new(form: &Form, map: &Transform) -> Result<Option<Self>, ShapeError> {
        let exact = |shape: Shape| Self::Exact { surface: PlacedShape::new(shape, *map), closed: None };
        let implicit = |surface| Self::Implicit { surface, world_from_object: *map };
        Ok(Some(match form {
            Form::Sphere(center, radius) => exact(Sphere::new(*center, radius.abs())?.into()),
            Form::Cuboid(low, high) => exact(Cuboid::new(low.min(*high), low.max(*high))?.into()),
            Form::Cone { ends: [a, b], radii: [r, s], open } => {
                let shape = |caps: bool| -> Result<Shape, ShapeError> {
                    Ok(if r == s {
                        Cylinder::new(*a, *b, r.abs(), caps)?.into()
                    } else {
                        Cone::new(*a, *b, r.abs(), s.abs(), caps)?.into()
                    })
                };
                let place = |shape| PlacedShape::new(shape, *map);
                let closed = if *open { Some(place(shape(true)?)) } else { None };
                Self::Exact { surface: place(shape(!open)?), closed }
            }
            Form::Torus(major, minor) => {
                exact(Torus::new(DVec3::ZERO, DVec3::Y, *major, minor.abs())?.into())
            }
            Form::Plane(normal, distance) => exact(Plane::new(*normal * *distance, *normal)?.into()),
            Form::Disc { center, normal, radius, hole } => {
                // Inside is the whole half-space behind it.
                let behind = PlacedShape::new(Plane::new(*center, *normal)?.into(), *map);
                let disc = Disk::new(*center, *normal, *radius, *hole)?;
                Self::Exact { surface: PlacedShape::new(disc.into(), *map), closed: Some(behind) }
            }
            Form::Triangle([a, b, c]) => exact(Triangle::new(*a, *b, *c)?.into()),
            Form::Superellipsoid(e, n) => {
                let unit = Aabb { min: DVec3::splat(-1.0), max: DVec3::splat(1.0) };
                let (e, n) = (*e, *n);
                implicit(ImplicitSurface::new(unit, move |[x, y, z]| {
                    let across = power(x.abs(), 2.0 / e) + power(y.abs(), 2.0 / e);
                    power(across, e / n) + power(z.abs(), 2.0 / n) - 1.0
                })?)
            }
            Form::Poly(poly) => {
                Self::Body { body: Body::Algebraic(Arc::clone(poly)), world_from_object: *map }
            }
            Form::Blob(blob) => Self::Body { body: Body::Blob(Arc::clone(blob)), world_from_object: *map },
            Form::Heights(heights) => {
                Self::Body { body: Body::Heights(Arc::clone(heights)), world_from_object: *map }
            }
            Form::Swept(swept) => {
                Self::Body { body: Body::Swept(Arc::clone(swept)), world_from_object: *map }
            }
            Form::Iso(iso) => Self::Body { body: Body::Iso(Arc::clone(iso)), world_from_object: *map },
            Form::Sweep(sweep) => {
                Self::Body { body: Body::Sweep(Arc::clone(sweep)), world_from_object: *map }
            }
            Form::Julia(julia) => {
                Self::Body { body: Body::Julia(Arc::clone(julia)), world_from_object: *map }
            }
            Form::Mesh(mesh, enclosure) => {
                let body = Body::Mesh(Arc::new(MeshBody::new(mesh, enclosure.as_ref())));
                Self::Body { body, world_from_object: *map }
            }
            Form::Group(..) | Form::Light(_) | Form::LightGroup(..) | Form::Nothing => {
                return Ok(None);
            }
        }))
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        match self {
            Self::Exact { surface, .. } => surface.roots(ray, out),
            Self::Implicit { surface, world_from_object } => {
                out.extend(surface.roots(&ray.into_object(world_from_object)));
            }
            Self::Body { body, world_from_object } => body.roots(&ray.into_object(world_from_object), out),
        }
    }

    /// Visits roots from the nearest on, while that returns true.
    fn each_root(&self, ray: &Ray, visit: &mut dyn FnMut(Root) -> bool) {
        if let Self::Body { body: Body::Iso(iso), world_from_object } = self {
            iso.each_root(&ray.into_object(world_from_object), visit);
            return;
        }
        let mut roots = Roots::new();
        self.roots(ray, &mut roots);
        for root in roots {
            if !visit(root) {
                return;
            }
        }
    }

    pub(super) fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        match self {
            Self::Exact { surface, .. } => surface.surface(ray, root),
            Self::Implicit { surface, world_from_object: map } => {
                let inner = surface.surface(&ray.into_object(map), root);
                let point = map.point(inner.point);
                let normal = map.normal(inner.normal).normalize_or(DVec3::Y);
                let (dpdu, dpdv) = normal.any_orthonormal_pair();
                let point_error = map.point_error(inner.point, inner.point_error);
                Surface { point, point_error, normal, dpdu, dpdv, ..inner }
            }
            Self::Body { body, world_from_object: map } => {
                let inner = ray.into_object(map).at(root.t);
                let normal = map.normal(body.normal(inner, root)).normalize_or(DVec3::Y);
                let (dpdu, dpdv) = normal.any_orthonormal_pair();
                let size = (ray.origin.abs() + (ray.direction * root.t).abs()).max_element();
                Surface {
                    point: ray.at(root.t),
                    // Roots of polynomials are right to some of their last digits.
                    point_error: DVec3::splat(1e-10 * size),
                    normal,
                    uv: body.uv(inner, root),
                    dpdu,
                    dpdv,
                    dndu: DVec3::ZERO,
                    dndv: DVec3::ZERO,
                }
            }
        }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Body { body, world_from_object } => body.contains(world_from_object.inverse_point(p)),
            Self::Exact { surface, closed } => {
                let shape = closed.as_ref().unwrap_or(surface);
                shape.shape().contains(shape.world_from_object().inverse_point(p))
            }
            Self::Implicit { surface, world_from_object } => {
                surface.contains(world_from_object.inverse_point(p))
            }
        }
    }

    pub(super) fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Exact { surface, .. } => surface.shape().bounds(&surface.world_from_object()),
            Self::Implicit { surface, world_from_object } => {
                Some(moved(&surface.bounds(), world_from_object))
            }
            Self::Body { body, world_from_object } => Some(moved(&body.bounds()?, world_from_object)),
        }
    }
}

/// A box around a box that was moved.
fn moved(&Aabb { min, max }: &Aabb, map: &Transform) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
        map.point(DVec3::new(pick(0), pick(1), pick(2)))
    };
    Aabb::around((0..8).map(corner))
}

/// A part of space.
#[derive(Clone, Debug)]
pub(super) enum Region {
    Solid(Arc<Solid>),
    Not(Arc<Region>),
    All(Vec<Arc<Region>>),
    Any(Vec<Arc<Region>>),
    /// Where the surface of one of the parts of a group is seen, by what the others are.
    Others {
        operation: Operation,
        parts: Arc<[Arc<Region>]>,
        except: usize,
    },
}

impl Region {
    /// What is inside of an object.
    pub(super) fn of(object: &Object, parent: &Transform) -> Arc<Self> {
        let map = *parent * object.transform;
        let mut region = match &object.form {
            Form::Group(operation, parts) => {
                let parts: Vec<Arc<Self>> =
                    parts.iter().filter(|part| has_inside(part)).map(|part| Self::of(part, &map)).collect();
                match operation {
                    Operation::Union | Operation::Merge => Self::Any(parts),
                    Operation::Intersection => Self::All(parts),
                    Operation::Difference => {
                        let mut parts = parts.into_iter();
                        let first = parts.next();
                        Self::All(
                            first.into_iter().chain(parts.map(|part| Arc::new(Self::Not(part)))).collect(),
                        )
                    }
                }
            }
            form => match Solid::new(form, &map) {
                Ok(Some(solid)) => Self::Solid(Arc::new(solid)),
                _ => Self::Any(Vec::new()),
            },
        };
        if object.inverse {
            region = Self::Not(Arc::new(region));
        }
        if !object.clipped_by.is_empty() {
            let mut all = vec![Arc::new(region)];
            all.extend(object.clipped_by.iter().map(|clip| Self::of(clip, &map)));
            region = Self::All(all);
        }
        Arc::new(region)
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Solid(solid) => solid.contains(p),
            Self::Not(region) => !region.contains(p),
            Self::All(regions) => regions.iter().all(|region| region.contains(p)),
            Self::Any(regions) => regions.iter().any(|region| region.contains(p)),
            Self::Others { operation, parts, except } => {
                let mut others = parts.iter().enumerate().filter(|(j, _)| j != except);
                others.all(|(j, part)| part.contains(p) == is_inside_of(*operation, j))
            }
        }
    }

    /// A box around it; `None` if it is not bounded.
    fn bounds(&self) -> Option<Aabb> {
        match self {
            Self::Solid(solid) => solid.bounds(),
            Self::Not(_) => None,
            Self::All(regions) => {
                regions.iter().filter_map(|region| region.bounds()).reduce(|a, b| common(&a, &b))
            }
            Self::Any(regions) => {
                let mut all: Option<Aabb> = None;
                for region in regions {
                    let bounds = region.bounds()?;
                    all = Some(match all {
                        Some(all) => Aabb { min: all.min.min(bounds.min), max: all.max.max(bounds.max) },
                        None => bounds,
                    });
                }
                all
            }
            Self::Others { operation, parts, except } => {
                // Of very many parts a box would take longer than it saves.
                let others = parts.iter().enumerate().take(MAX_BOUNDED).filter(|(j, _)| j != except);
                let around = others.filter(|(j, _)| is_inside_of(*operation, *j));
                around.filter_map(|(_, part)| part.bounds()).reduce(|a, b| common(&a, &b))
            }
        }
    }
}

/// The boxes of at most this many parts of an intersection are considered.
const MAX_BOUNDED: usize = 64;

/// Whether the surfaces of a group are inside of its part of a number, or outside.
fn is_inside_of(operation: Operation, part: usize) -> bool {
    match operation {
        Operation::Union | Operation::Merge => false,
        Operation::Intersection => true,
        Operation::Difference => part == 0,
    }
}

fn has_inside(object: &Object) -> bool {
    !matches!(object.form, Form::Light(_) | Form::Nothing)
}

/// What is in both boxes; a point where that is nothing.
fn common(a: &Aabb, b: &Aabb) -> Aabb {
    let (min, max) = (a.min.max(b.min), a.max.min(b.max));
    Aabb { min: min.min(max), max: max.max(min) }
}

/// The part of a surface that lies in some regions.
#[derive(Clone, Debug)]
pub(super) struct Clipped {
    pub solid: Arc<Solid>,
    pub regions: Vec<Arc<Region>>,
    /// Whether its inside is outside.
    pub is_flipped: bool,
    bounds: Option<Aabb>,
}

impl Clipped {
    pub(super) fn new(solid: Arc<Solid>, regions: Vec<Arc<Region>>, is_flipped: bool) -> Self {
        let all = regions.iter().filter_map(|region| region.bounds()).chain(solid.bounds());
        // Wider than it is by rounding.
        let bounds = all.reduce(|a, b| common(&a, &b)).map(|b| {
            let margin = DVec3::splat(
                1e-9 * (b.max - b.min)
                    .max_element()
                    .max(b.max.abs().max_element())
                    .max(b.min.abs().max_element()),
            );
            Aabb { min: b.min - margin, max: b.max + margin }
        });
        Self { solid, regions, is_flipped, bounds }
    }

    fn each(&self, ray: &Ray, mut visit: impl FnMut(Root) -> bool) {
        self.solid.each_root(ray, &mut |root| {
            let p = ray.at(root.t);
            !self.regions.iter().all(|region| region.contains(p)) || visit(root)
        });
    }
}

impl CustomGeometry for Clipped {
    fn primitive_count(&self) -> u32 {
        1
    }

    fn bounds(&self, _: u32) -> Option<Aabb> {
        self.bounds
    }

    fn closest(&self, _: u32, ray: &Ray) -> Option<Root> {
        let mut first = None;
        self.each(ray, |root| {
            first = Some(root);
            false
        });
        first
    }

    fn roots(&self, _: u32, ray: &Ray, out: &mut Roots) {
        self.each(ray, |root| {
            out.push(root);
            true
        });
    }

    fn surface(&self, _: u32, ray: &Ray, root: &Root) -> Surface {
        let surface = self.solid.surface(ray, root);
        if !self.is_flipped {
            return surface;
        }
        Surface { normal: -surface.normal, dndu: -surface.dndu, dndv: -surface.dndv, ..surface }
    }
}

/// A surface of an object, and which of it is seen.
pub(super) struct Leaf<'o> {
    pub object: &'o Object,
    pub map: Transform,
    pub regions: Vec<Arc<Region>>,
    pub is_flipped: bool,
}

/// The surfaces of an object. `visit` has each, with the objects around it, the outermost first.
pub(super) fn leaves<'o>(
    object: &'o Object,
    parent: &Transform,
    regions: &[Arc<Region>],
    is_flipped: bool,
    around: &mut Vec<&'o Object>,
    visit: &mut dyn FnMut(Leaf<'o>, &[&'o Object]),
) {
    let map = *parent * object.transform;
    let mut regions = regions.to_vec();
    regions.extend(object.clipped_by.iter().map(|clip| Region::of(clip, &map)));
    let is_flipped = is_flipped ^ object.inverse;
    let Form::Group(operation, parts) = &object.form else {
        visit(Leaf { object, map, regions, is_flipped }, around);
        return;
    };
    around.push(object);
    // What has no inside is shown as far as the others let it be seen, and lets all be seen of them.
    let nothing = || {
        Arc::new(if *operation == Operation::Intersection {
            Region::All(Vec::new())
        } else {
            Region::Any(Vec::new())
        })
    };
    let insides: Arc<[Arc<Region>]> = match operation {
        Operation::Union if !object.inverse => Arc::from([]),
        _ => parts
            .iter()
            .map(|part| if has_inside(part) { Region::of(part, &map) } else { nothing() })
            .collect(),
    };
    for (i, part) in parts.iter().enumerate() {
        let mut within = regions.clone();
        if has_inside(part) && insides.len() > 1 {
            within.push(Arc::new(Region::Others {
                operation: *operation,
                parts: Arc::clone(&insides),
                except: i,
            }));
        }
        let is_cut = *operation == Operation::Difference && i > 0;
        leaves(part, &map, &within, is_flipped ^ is_cut, around, visit);
    }
    around.pop();
}

/// Whether an object contains a point.
pub(super) fn contains(object: &Object, p: DVec3) -> bool {
    Region::of(object, &Transform::IDENTITY).contains(p)
}

/// The first point of an object along a ray, and the unit normal there.
pub(super) fn trace(
    trees: &mut MeshTrees,
    object: &Object,
    from: DVec3,
    direction: DVec3,
) -> Option<(DVec3, DVec3)> {
    let ray = Ray::new(from, direction).with_range(1e-9, f64::INFINITY);
    let mut best: Option<(f64, DVec3, DVec3)> = None;
    leaves(object, &Transform::IDENTITY, &[], false, &mut Vec::new(), &mut |leaf, _| {
        if let Form::Mesh(mesh, _) = &leaf.object.form
            && leaf.regions.is_empty()
        {
            if let Some((t, normal)) = mesh_hit(trees, mesh, &leaf.map, &ray)
                && best.is_none_or(|(best, ..)| t < best)
            {
                best = Some((t, ray.at(t), normal));
            }
            return;
        }
        let Ok(Some(solid)) = Solid::new(&leaf.object.form, &leaf.map) else { return };
        let clipped = Clipped::new(Arc::new(solid), leaf.regions, leaf.is_flipped);
        if let Some(root) = clipped.closest(0, &ray)
            && best.is_none_or(|(t, ..)| root.t < t)
        {
            let surface = clipped.surface(0, &ray, &root);
            best = Some((root.t, ray.at(root.t), surface.normal));
        }
    });
    best.map(|(_, point, normal)| (point, normal))
}

/// A box around an object; `None` if it is not bounded.
pub(super) fn bounds(object: &Object) -> Option<Aabb> {
    let mut all: Option<Aabb> = None;
    let mut is_bounded = true;
    leaves(object, &Transform::IDENTITY, &[], false, &mut Vec::new(), &mut |leaf, _| {
        let bounds = match (&leaf.object.form, Solid::new(&leaf.object.form, &leaf.map)) {
            (Form::Mesh(mesh, _), _) => {
                Some(Aabb::around(mesh.positions.iter().map(|p| leaf.map.point(p.as_dvec3()))))
            }
            (_, Ok(Some(solid))) => Clipped::new(Arc::new(solid), leaf.regions, false).bounds,
            _ => return,
        };
        match (bounds, &mut all) {
            (None, _) => is_bounded = false,
            (Some(bounds), Some(all)) => {
                *all = Aabb { min: all.min.min(bounds.min), max: all.max.max(bounds.max) };
            }
            (Some(bounds), none) => *none = Some(bounds),
        }
    });
    all.filter(|_| is_bounded)
}

/// A power of a number that is not negative.
fn power(x: Dual, exponent: f64) -> Dual {
    use lumbre_math::Elementary;
    if exponent == 1.0 {
        return x;
    }
    if exponent == 2.0 {
        return x.square();
    }
    let margin = 8.0 * f64::EPSILON;
    let (low, high) = (x.value.low.max(0.0), x.value.high.max(0.0));
    let value =
        Interval { low: low.power(exponent) * (1.0 - margin), high: high.power(exponent) * (1.0 + margin) };
    // e·x^(e−1), which grows or falls throughout.
    let at = |x: f64| exponent * x.power(exponent - 1.0);
    let ends = [at(low), at(high)];
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let factor = if low.is_finite() && high.is_finite() {
        Interval { low: low * (1.0 - margin), high: high * (1.0 + margin) }
    } else {
        Interval::WHOLE
    };
    Dual { value, slope: factor * x.slope }
}

/// Closed loops of a plane as triangles, by trapezoids between the heights of their corners: inside by the even–odd
/// rule.
pub(super) fn triangulated(points: &[DVec2]) -> Vec<[DVec2; 3]> {
    // The edge that leads from the end of a loop to the next loop is none.
    let mut closed: Vec<[DVec2; 2]> = Vec::new();
    let mut first = 0;
    for i in 0..points.len() {
        let is_end = i > first && points[i] == points[first];
        let is_last = i + 1 == points.len();
        if i > first {
            closed.push([points[i - 1], points[i]]);
        }
        if is_end {
            first = i + 1;
        } else if is_last {
            closed.push([points[i], points[first]]);
        }
    }
    let mut heights: Vec<f64> = points.iter().map(|p| p.y).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let mut triangles = Vec::new();
    for pair in heights.windows(2) {
        let [low, high] = [pair[0], pair[1]];
        let middle = 0.5 * (low + high);
        let at = |[a, b]: &[DVec2; 2], y: f64| a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
        let mut across: Vec<&[DVec2; 2]> =
            closed.iter().filter(|[a, b]| a.y.min(b.y) < middle && middle < a.y.max(b.y)).collect();
        across.sort_by(|a, b| at(a, middle).total_cmp(&at(b, middle)));
        for sides in across.chunks_exact(2) {
            let corner = |side: &[DVec2; 2], y: f64| DVec2::new(at(side, y), y);
            let [a, b] = [corner(sides[0], low), corner(sides[1], low)];
            let [c, d] = [corner(sides[1], high), corner(sides[0], high)];
            if a != b {
                triangles.push([a, b, c]);
            }
            if c != d {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}
