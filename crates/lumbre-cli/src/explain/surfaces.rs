//! The surfaces along a ray, and how their hits are found.

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use lumbre::description::Footprint;
use lumbre::geometry::{Curves, Remark, Shape, Surface, Triangle};
use lumbre::kernel::{Hit, Target, TargetShape};
use lumbre::math::Elementary;
use lumbre::math::glam::{DMat3, DMat4};
use lumbre::math::matrix::affine4;
use lumbre::{DVec3, Ray, Scene, Transform};

use super::document::{Item, Section, Value};
use super::figure::{self, Met, Subject};
use super::formula::{Scope, with_primes};
use super::misses::{self, Missed, Nearest};
use super::numbers::exact;
use super::shape;
use super::sketch::bare_line;
use super::texts::Texts;
use super::things::{Face, SceneNames};
use crate::failure::Failure;
use crate::language::filled;

/// Maximum hits that are shown.
const MAX_HITS: usize = 64;
/// Maximum missed shapes that are shown if the ray hits nothing.
const MAX_MISSES: usize = 3;
/// Parts that the axis of a curve is drawn in.
const AXIS_PARTS: u32 = 24;
/// Columns of a matrix are at right angles where their cosines are less than this.
const RIGHT_ANGLE: f64 = 1e-12;

/// Which shapes are told of.
#[derive(Clone, Debug)]
pub(super) enum Chosen {
    All,
    /// By number, kind, or the name of the material.
    Called(String),
}

/// What to show of the surfaces along a ray.
pub(super) struct Wanted<'a> {
    /// Whether to show only the visible surface.
    pub(super) nearest: bool,
    /// For a camera ray, what decides about the surfaces that cover it.
    pub(super) from_camera: Option<[f32; 2]>,
    /// The shapes to show, hit or not; `None` for those that the ray hits, or else those that it passes nearest.
    pub(super) shapes: Option<&'a Chosen>,
    /// What is up in the world.
    pub(super) up: DVec3,
    /// The vertices of the path, for the figure of what is seen.
    pub(super) path: &'a [DVec3],
}

/// Writes the sections on everything along a ray, and on missed shapes if requested or if nothing is hit.
///
/// # Errors
/// [`Failure::Usage`] if no shape has the requested name.
pub(super) fn surfaces(
    scene: &Scene,
    ray: &Ray,
    things: &SceneNames,
    wanted: &Wanted<'_>,
    texts: &'static Texts,
) -> Result<Section, Failure> {
    let resolved = scene.resolved();
    let is_wanted = |shape: u32| match wanted.shapes {
        Some(Chosen::Called(name)) => things.is_called(shape, name, texts.kind_of),
        Some(Chosen::All) | None => true,
    };
    let mut section = Section::new("surfaces", texts.surfaces);
    let first = match wanted.from_camera {
        Some(numbers) => resolved.closest_seen(ray, numbers),
        None => resolved.closest(ray),
    };
    let mut hits: Vec<Hit> = Vec::new();
    let mut are_more = false;
    if wanted.nearest && wanted.shapes.is_none() {
        hits.extend(first.clone());
    } else {
        resolved.accel().all(ray, |hit| {
            are_more = hits.len() == MAX_HITS;
            if are_more {
                return ControlFlow::Break(());
            }
            if is_wanted(resolved.shape_index(hit)) {
                hits.push(hit.clone());
            }
            ControlFlow::Continue(())
        });
    }
    let met: BTreeSet<u32> = hits.iter().map(|hit| resolved.shape_index(hit)).collect();
    let most = match wanted.shapes {
        Some(_) => MAX_HITS,
        None if hits.is_empty() && wanted.from_camera.is_some() => MAX_MISSES,
        None => 0,
    };
    let missed = match most {
        0 => Vec::new(),
        _ => misses::nearest(scene, ray, most, |shape| is_wanted(shape) && !met.contains(&shape)),
    };
    if let (true, true, Some(Chosen::Called(name))) = (hits.is_empty(), missed.is_empty(), wanted.shapes) {
        let names = Vec::from_iter(things.names(texts.kind_of)).join(", ");
        return Err(Failure::Usage(filled(texts.no_such_shape, &[name, &names])));
    }
    if first.is_none() {
        section.text(texts.nothing_met);
    }
    // All crossings of one primitive are found together.
    let mut groups: Vec<Vec<&Hit>> = Vec::new();
    for hit in &hits {
        let is_same = |group: &&mut Vec<&Hit>| {
            (group[0].geometry, group[0].primitive, &group[0].instances)
                == (hit.geometry, hit.primitive, &hit.instances)
        };
        match groups.iter_mut().find(is_same) {
            Some(group) => group.push(hit),
            None => groups.push(vec![hit]),
        }
    }
    for group in groups {
        let thing = Thing { hit: group[0], hits: &group, nearest: None };
        section.sections.push(tell(scene, ray, &thing, first.as_ref(), things, wanted, texts));
    }
    if are_more {
        section.remark(filled(texts.more_hits, &[&MAX_HITS.to_string()]));
    }
    if !missed.is_empty() {
        section.text(if wanted.shapes.is_none() { texts.missed_nearest } else { texts.missed });
    }
    for Missed { hit, nearest } in &missed {
        let thing = Thing { hit, hits: &[], nearest: *nearest };
        section.sections.push(tell(scene, ray, &thing, first.as_ref(), things, wanted, texts));
    }
    Ok(section)
}

/// A primitive, and its hits.
struct Thing<'a> {
    /// One of its hits, or a hit without a crossing.
    hit: &'a Hit,
    hits: &'a [&'a Hit],
    /// The nearest point of the ray, if it misses the primitive.
    nearest: Option<Nearest>,
}

/// That a ray misses a shape, and by how much; or that it lies in the surface, touches it or runs inside of it.
fn why_no_hit(object: &Object, nearest: Option<Nearest>, texts: &Texts) -> Vec<String> {
    let explanation = object.shape.as_ref().map(|shape| shape.explain(&object.ray));
    let has = |wanted: &[Remark]| {
        let steps = explanation.iter().flat_map(|explanation| &explanation.steps);
        steps.flat_map(|step| &step.remarks).any(|remark| wanted.contains(remark))
    };
    if has(&[Remark::InsideThroughout]) {
        return vec![texts.runs_inside.to_owned()];
    }
    let Some(Nearest { distance, t, in_object }) = nearest else { return vec![texts.is_missed.to_owned()] };
    let (place, shown) = (object.ray.at(t), Value::from(t).in_short());
    if distance > 1e-14 * (1.0 + place.abs().max_element()) {
        let text = if in_object { texts.passes_in_object } else { texts.passes };
        return vec![texts.is_missed.to_owned(), filled(text, &[&exact(distance), &shown])];
    }
    let lies = [Remark::InSurface, Remark::InPlane, Remark::EdgeOn, Remark::EveryRuling, Remark::AlongRuling];
    vec![filled(if has(&lies) { texts.lies_in_it } else { texts.meets_it }, &[&shown])]
}

fn tell(
    scene: &Scene,
    ray: &Ray,
    &Thing { hit, hits, nearest }: &Thing<'_>,
    first: Option<&Hit>,
    things: &SceneNames,
    wanted: &Wanted<'_>,
    texts: &'static Texts,
) -> Section {
    let resolved = scene.resolved();
    let index = resolved.shape_index(hit);
    let Target { placements, shape } = resolved.accel().target(ray, hit);
    // Numbers and materials belong to the leaves of a CSG tree.
    let kind = match &shape {
        TargetShape::Exact(placed) if matches!(placed.shape(), Shape::Csg(_)) => {
            format!("{} ({})", (texts.kind_of)(things.kind(index)), (texts.kind_of)(placed.shape().name()))
        }
        _ => (texts.kind_of)(things.kind(index)).to_owned(),
    };
    let title = filled(texts.shape, &[&index.to_string(), &kind]);
    let mut section = Section::new(format!("shape {index}"), title);
    section.fact(texts.material, material_of(things, index, texts));
    let is_triangle = matches!(shape, TargetShape::Triangle(_));
    // The same steps as the search takes, for the same bits.
    let inner = placements.iter().fold(*ray, |ray, map| ray.into_object(map));
    let (shape, own, object_ray) = match &shape {
        TargetShape::Exact(placed) => {
            let own = Some(placed.world_from_object()).filter(|map| !map.is_identity());
            (Some(placed.shape().clone()), own, placed.object_ray(&inner))
        }
        TargetShape::Triangle([a, b, c]) => (Triangle::new(*a, *b, *c).ok().map(Shape::from), None, inner),
        TargetShape::Custom => match resolved.curves_at(hit) {
            Some((_, map)) => (None, Some(*map).filter(|map| !map.is_identity()), inner.into_object(map)),
            None => (None, None, inner),
        },
    };
    let mut scope = Scope::default();
    let chain: Vec<Transform> = placements.into_iter().chain(own).collect();
    let whole = chain.iter().copied().fold(Transform::IDENTITY, |outer, inner| outer * inner);
    let object = Object { ray: object_ray, shape, chain, whole };
    if hits.is_empty() {
        for text in why_no_hit(&object, nearest, texts) {
            section.text(text);
        }
    }
    if let Some(&instance) = hit.instances.first() {
        section.fact(texts.instance, f64::from(instance));
    }
    if is_triangle {
        section.fact(texts.triangle, f64::from(resolved.primitive_index(hit)));
    }
    if object.is_placed() {
        section.sections.push(transforms(&object, ray, &mut scope, texts));
    } else {
        scope.set_ray(["O", "D"], &object.ray);
    }
    let rename = |formula: &str| {
        if object.is_placed() { with_primes(formula, &["O", "D", "P", "N"]) } else { formula.to_owned() }
    };
    let told = match &object.shape {
        Some(Shape::Triangle(triangle)) => triangle.corners().to_vec(),
        Some(Shape::BilinearPatch(patch)) => patch.corners().to_vec(),
        _ => Vec::new(),
    };
    let told: Vec<DVec3> = told.iter().map(|p| own.map_or(*p, |own| own.point(*p))).collect();
    if !told.is_empty()
        && let Some(face) = things.face(index, resolved.primitive_index(hit), &told)
    {
        section.sections.push(in_file(&face, told.len(), texts));
    }
    let is_seen = first.is_some_and(|first| hits.contains(&first));
    let path = if is_seen { wanted.path } else { &[] };
    let (drawn, marked);
    match &object.shape {
        Some(exact) => {
            let mut equation = Section::new("equation", texts.equation);
            let explanation = exact.explain(&object.ray);
            let met = hits.iter().map(|hit| Met {
                t: hit.root.t,
                normal: resolved.accel().surface(ray, hit).normal,
                local_normal: exact.surface(&object.ray, &hit.root).normal,
            });
            let subject = Subject {
                shape: exact,
                map: &object.whole,
                is_placed: object.is_placed(),
                explanation: &explanation,
                ray,
                object_ray: &object.ray,
                hits: &met.collect::<Vec<_>>(),
                nearest,
                up: wanted.up,
                path,
            };
            (drawn, marked) = subject.figure(texts);
            shape::tell(&mut equation, (exact.name(), &explanation), &object.ray, &mut scope, &rename, texts);
            section.sections.push(equation);
        }
        None => {
            let mut axis = Vec::new();
            match resolved.curves_at(hit) {
                Some((curves, _)) => {
                    let points = curves.control_points(hit.primitive);
                    let places =
                        (0..=AXIS_PARTS).map(|i| cubic(&points, f64::from(i) / f64::from(AXIS_PARTS)));
                    axis.push(bare_line(places.map(|p| object.whole.point(p))));
                    section.sections.push(curve(curves, hits, &object.ray, texts));
                }
                None => section.text(texts.custom),
            }
            let met = hits.iter().map(|hit| {
                let Surface { normal, .. } = resolved.accel().surface(ray, hit);
                Met { t: hit.root.t, normal, local_normal: normal }
            });
            (drawn, marked) = figure::of_hits(axis, ray, &met.collect::<Vec<_>>(), wanted.up, path, texts);
        }
    }
    section.marked = marked;
    let normal = if object.is_placed() { "N′" } else { "N" };
    for &hit in hits {
        let is_first = first.is_some_and(|first| first == hit);
        let mut told = at_hit(scene, ray, hit, is_first, &object, texts);
        told.marked = drawn.marked_at(hit.root.t, normal);
        // The normal in the world is drawn there, too.
        told.marked.extend(drawn.marked_at(hit.root.t, "N"));
        section.sections.push(told);
    }
    section.items.push(Item::Figure(Box::new(drawn)));
    section
}

/// A face as in its file; it is tested as a face with `told` corners under its map.
fn in_file(face: &Face, told: usize, texts: &Texts) -> Section {
    let mut section = Section::new("mesh", texts.in_file);
    let mut scope = Scope::default();
    // Not those of the equation, to which the map leads.
    let names = ["F₀", "F₁", "F₂", "F₃"];
    for (name, corner) in names.into_iter().zip(&face.corners) {
        section.quantity(&mut scope, name, "", "", *corner);
    }
    for (name, uv) in names.into_iter().zip(face.uvs.iter().flatten()) {
        section.fact(format!("u, v ({name})"), Value::Numbers(vec![uv.x, uv.y]));
    }
    if !face.map.is_identity() {
        section.fact("M", DMat4::from(*face.map.affine()));
        section.text(texts.baked);
        if face.map.is_mirror() {
            section.text(texts.mirrored);
        }
    }
    if told < face.corners.len() {
        section.text(texts.split);
    }
    section
}

/// The material of a shape: its name and its kind.
pub(super) fn material_of(things: &SceneNames, shape: u32, texts: &Texts) -> String {
    let Some(material) = things.material(shape) else { return texts.no_material.to_owned() };
    let kind = (texts.kind_of)(material.kind);
    material.name.as_ref().map_or_else(|| kind.to_owned(), |name| format!("{name} ({kind})"))
}

/// A segment of curves, and the nearest point of a ray, both in the space of the curves.
fn curve(curves: &Curves, hits: &[&Hit], ray: &Ray, texts: &Texts) -> Section {
    let primitive = hits[0].primitive;
    let mut section = Section::new("equation", texts.equation);
    section.text(texts.curve);
    section.fact(texts.curve_segment, f64::from(curves.segment_of(primitive)));
    let points = curves.control_points(primitive);
    for (name, point) in ["P₀", "P₁", "P₂", "P₃"].into_iter().zip(points) {
        section.fact(name, point);
    }
    for hit in hits {
        let u = hit.root.local.x;
        let mut scope = Scope::default();
        section.quantity(&mut scope, "t", texts.t_of_search, "", hit.root.t);
        section.quantity(&mut scope, "u", "", "", u);
        section.quantity(&mut scope, "b", texts.curve_width, "", curves.width(hit.primitive, u));
        let formula = "(1−u)³·P₀ + 3u(1−u)²·P₁ + 3u²(1−u)·P₂ + u³·P₃";
        let axis = cubic(&points, u);
        section.fact(format!("C = {formula}: {}", texts.curve_axis), axis);
        section.fact(texts.curve_distance, (axis - ray.at(hit.root.t)).length());
    }
    section
}

/// The point at a parameter of the cubic with these control points.
fn cubic(points: &[DVec3; 4], u: f64) -> DVec3 {
    let v = 1.0 - u;
    let weights = [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u];
    weights.into_iter().zip(points).map(|(weight, point)| weight * *point).sum()
}

/// A thing in its own space.
struct Object {
    /// The ray there.
    ray: Ray,
    /// The shape; `None` for custom geometry.
    shape: Option<Shape>,
    /// The maps from there to the world, the outermost first.
    chain: Vec<Transform>,
    /// Their product.
    whole: Transform,
}

impl Object {
    /// Whether its own space differs from the world.
    fn is_placed(&self) -> bool {
        !self.chain.is_empty()
    }
}

/// The chain of maps from the object to the world, and the ray in the object's space.
fn transforms(object: &Object, ray: &Ray, scope: &mut Scope, texts: &Texts) -> Section {
    let Object { ray: object_ray, chain, whole, .. } = object;
    let mut section = Section::new("transform", texts.transform);
    if chain.len() > 1 {
        section.text(texts.chain);
    }
    for (i, map) in chain.iter().enumerate() {
        let name = match chain.len() {
            1 => "M".to_owned(),
            _ => format!("M{}", "₁₂₃₄₅₆₇₈₉".chars().nth(i).unwrap_or('ₙ')),
        };
        let mut one = Section::new(format!("transform {i}"), name);
        one.fact("M", DMat4::from(*map.affine()));
        match decomposed(map) {
            Some(Parts { scale, angles, offset, is_at_pole }) => {
                one.text(texts.decomposes);
                one.fact(texts.scale, scale);
                one.fact(texts.rotations, angles);
                if is_at_pole {
                    one.text(if angles.y > 0.0 { texts.north_pole } else { texts.south_pole });
                }
                one.fact(texts.translation, offset);
            }
            None => one.text(texts.sheared),
        }
        section.sections.push(one);
    }
    if chain.len() > 1 {
        section.fact("M", DMat4::from(*whole.affine()));
    }
    section.fact("M⁻¹", DMat4::from(*whole.inverse_affine()));
    scope.set_ray(["O", "D"], ray);
    section.quantity(scope, "O′", texts.as_point, "M⁻¹ O", object_ray.origin);
    section.quantity(scope, "D′", texts.as_direction, "M⁻¹ D", object_ray.direction);
    section.quantity(scope, "|D′|", "", "√(D′·D′)", object_ray.direction.length());
    section.text(texts.t_is_kept);
    section
}

/// A map as a scale, rotations about x, y and z in this order, and a translation.
struct Parts {
    scale: DVec3,
    /// Degrees about x, y and z.
    angles: DVec3,
    offset: DVec3,
    /// Whether the rotation about y is a right angle, so that those about x and z are about the same axis.
    is_at_pole: bool,
}

/// The parts of a map `T · Rz · Ry · Rx · S`; `None` if it shears.
fn decomposed(map: &Transform) -> Option<Parts> {
    let linear = map.linear();
    let axes = [linear.x_axis, linear.y_axis, linear.z_axis];
    let lengths = axes.map(DVec3::length);
    let is_right = |i: usize, j: usize| axes[i].dot(axes[j]).abs() <= RIGHT_ANGLE * lengths[i] * lengths[j];
    if !(is_right(0, 1) && is_right(1, 2) && is_right(2, 0)) {
        return None;
    }
    let with_signs = |signs: DVec3| {
        let scale = DVec3::from_array(lengths) * signs;
        let rotation = DMat3::from_cols(axes[0] / scale.x, axes[1] / scale.y, axes[2] / scale.z);
        let (angles, is_at_pole) = turns(&rotation);
        Parts { scale, angles, offset: map.affine().translation, is_at_pole }
    };
    if !map.is_mirror() {
        return Some(with_signs(DVec3::ONE));
    }
    // A mirror is described along the axis that leaves the smallest rotation, as it was most likely written.
    let signs = [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]];
    let all = signs.map(|signs| with_signs(DVec3::from_array(signs)));
    let turn = |parts: &Parts| parts.angles.abs().dot(DVec3::ONE);
    all.into_iter().min_by(|a, b| turn(a).total_cmp(&turn(b)))
}

/// The angles of a rotation about x, y and z, in this order, in degrees, and whether it is at a pole: only the sum or
/// the difference of the angles about x and z matters there, and the one about z is 0.
fn turns(rotation: &DMat3) -> (DVec3, bool) {
    let at = |row: usize, column: usize| rotation.col(column)[row];
    let rest = at(0, 0).hypotenuse(at(1, 0));
    let is_at_pole = rest <= 1e-12;
    let y = (-at(2, 0)).angle_from(rest);
    let (x, z) = if is_at_pole {
        // Rz Ry Rx with y = ±90°: a rotation by x ∓ z.
        let sign = y.signum();
        ((sign * at(0, 1)).angle_from(at(1, 1)), 0.0)
    } else {
        (at(2, 1).angle_from(at(2, 2)), at(1, 0).angle_from(at(0, 0)))
    };
    let tidy = |radians: f64| {
        let degrees = radians.to_degrees();
        // Hides rounding errors of whole degrees.
        if (degrees - degrees.rounded()).abs() < 1e-9 { degrees.rounded() } else { degrees }
    };
    (DVec3::new(tidy(x), tidy(y), tidy(z)), is_at_pole)
}

/// The surface at one crossing.
fn at_hit(scene: &Scene, ray: &Ray, hit: &Hit, is_first: bool, object: &Object, texts: &Texts) -> Section {
    let is_triangle = matches!(object.shape, Some(Shape::Triangle(_)));
    let surface = scene.resolved().accel().surface(ray, hit);
    let mut scope = Scope::default();
    scope.set_ray(["O", "D"], ray);
    let title = filled(texts.hit, &[&exact(hit.root.t)]);
    let mut section = Section::new("hit", title);
    section.quantity(&mut scope, "t", texts.t_of_search, "", hit.root.t);
    if is_first {
        section.text(texts.is_seen);
    }
    section.quantity(&mut scope, "P", texts.point, "O + t·D", surface.point);
    let deviation = (surface.point - ray.at(hit.root.t)).length();
    if deviation > 0.0 {
        section.remark(filled(texts.reprojected, &[&format!("{deviation:.1e}")]));
    }
    if let (Some(shape), true) = (&object.shape, object.is_placed()) {
        let local = shape.surface(&object.ray, &hit.root);
        let whole = &object.whole;
        section.quantity(&mut scope, "N′", texts.normal_in_object, "", local.normal);
        section.fact("M⁻ᵀ", affine4(whole.inverse_affine().matrix3.transpose(), DVec3::ZERO));
        section.quantity(&mut scope, "N₀", texts.by_inverse_transpose, "M⁻ᵀ N′", whole.normal(local.normal));
        section.quantity(&mut scope, "N", texts.normal, "N₀/|N₀|", surface.normal);
    } else {
        section.quantity(&mut scope, "N", texts.normal, "", surface.normal);
    }
    let along = surface.normal.dot(ray.direction);
    section.quantity(&mut scope, "N·D", "", "N·D", along);
    section.text(if along < 0.0 {
        texts.front
    } else if along > 0.0 {
        texts.back
    } else {
        texts.grazing
    });
    let here = scene.resolved().interaction(ray, hit, &Footprint::Point);
    if is_triangle {
        section.fact(texts.barycentrics, Value::Numbers(vec![surface.uv.x, surface.uv.y]));
    }
    section.fact("u, v", Value::Numbers(vec![here.surface.uv.x, here.surface.uv.y]));
    section
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_told_as_it_was_written() {
        let scale = |x: f64, y: f64, z: f64| Transform::scale(DVec3::new(x, y, z)).expect("not singular");
        let turn = |axis: DVec3, degrees: f64| Transform::rotate(axis, degrees).expect("an axis");
        for (map, sizes, angles) in [
            (scale(-1.0, 2.0, 3.0), [-1.0, 2.0, 3.0], [0.0; 3]),
            (scale(1.0, -2.0, 3.0), [1.0, -2.0, 3.0], [0.0; 3]),
            (scale(1.0, 2.0, -3.0), [1.0, 2.0, -3.0], [0.0; 3]),
            (scale(-1.0, -2.0, -3.0), [-1.0, -2.0, -3.0], [0.0; 3]),
            (turn(DVec3::Z, 30.0) * scale(-1.0, 2.0, 3.0), [-1.0, 2.0, 3.0], [0.0, 0.0, 30.0]),
            (turn(DVec3::Z, 180.0), [1.0; 3], [0.0, 0.0, 180.0]),
            (
                turn(DVec3::Z, 20.0) * turn(DVec3::Y, -40.0) * turn(DVec3::X, 70.0),
                [1.0; 3],
                [70.0, -40.0, 20.0],
            ),
            // At the poles only x ∓ z matters.
            (turn(DVec3::Z, 20.0) * turn(DVec3::Y, 90.0) * turn(DVec3::X, 70.0), [1.0; 3], [50.0, 90.0, 0.0]),
            (
                turn(DVec3::Z, 20.0) * turn(DVec3::Y, -90.0) * turn(DVec3::X, 70.0),
                [1.0; 3],
                [90.0, -90.0, 0.0],
            ),
        ] {
            let parts = decomposed(&map).expect("no shear");
            assert!(
                (parts.scale - DVec3::from_array(sizes)).length() < 1e-12,
                "{} for {sizes:?}",
                parts.scale
            );
            assert!(
                (parts.angles - DVec3::from_array(angles)).length() < 1e-9,
                "{} for {angles:?}",
                parts.angles
            );
            assert_eq!(parts.is_at_pole, parts.angles.y.abs() == 90.0);
            // The parts make up the map.
            let again = [(DVec3::X, parts.angles.x), (DVec3::Y, parts.angles.y), (DVec3::Z, parts.angles.z)]
                .into_iter()
                .fold(Transform::scale(parts.scale).expect("not singular"), |inner, (axis, angle)| {
                    turn(axis, angle) * inner
                });
            let off = (again.linear() - map.linear()).to_cols_array();
            assert!(off.iter().all(|entry| entry.abs() < 1e-12), "{off:?}");
        }
        let sheared = Transform::shear(0.5, 0.0, 0.0, 0.0, 0.0, 0.0).expect("not singular");
        assert!(decomposed(&sheared).is_none());
    }
}
