//! Triangles, by the watertight test of the search and, for comparison, by two others.

use lumbre_math::quadratic::dop;
use lumbre_math::{DVec3, exact};

use super::notes::{Notes, out_of_range};
use super::{Fate, Remark, Step, Topic};
use crate::{Ray, Triangle, TriangleHit, WatertightRay, moller_trumbore, plane_and_sides};

/// The names of the components of sheared corners.
pub(super) const CORNER: [[&str; 3]; 4] =
    [["x₀", "y₀", "z₀"], ["x₁", "y₁", "z₁"], ["x₂", "y₂", "z₂"], ["x₃", "y₃", "z₃"]];

/// Explains the shear of a ray, and of the sheared `corners` of points with names.
pub(super) fn tell_shear(
    notes: &mut Notes,
    sheared: &WatertightRay,
    points: &[(&'static str, DVec3)],
    corners: &[DVec3],
) {
    let step = notes.step(Topic::Shear);
    for (name, axis) in ["i₁", "i₂", "i₃"].into_iter().zip(sheared.axes()) {
        step.vector(name, "", axis);
    }
    let shear = sheared.shear();
    step.number("σ₁", "(D·i₁)/(D·i₃)", shear.x).number("σ₂", "(D·i₂)/(D·i₃)", shear.y);
    step.number("σ₃", "1/(D·i₃)", shear.z);
    for (((name, _), corner), [x, y, z]) in points.iter().zip(corners).zip(CORNER) {
        step.number(z, format!("({name} − O)·i₃"), corner.z);
        step.number(x, format!("({name} − O)·i₁ − σ₁·{z}"), corner.x);
        step.number(y, format!("({name} − O)·i₂ − σ₂·{z}"), corner.y);
    }
}

/// Says of edges between sheared points where two products are the same number: the rounding errors of both decide, or
/// the line meets the edge.
pub(super) fn tell_edges<const N: usize>(step: &mut Step, edges: [[DVec3; 2]; N]) {
    let mut equal = edges.iter().filter(|[p, q]| p.x * q.y == p.y * q.x);
    let is_on = |[p, q]: &&[DVec3; 2]| dop(p.x, q.y, p.y, q.x) == 0.0;
    if equal.clone().any(|edge| !is_on(&edge)) {
        step.remark(Remark::EdgeByRoundingErrors);
    }
    if equal.any(|edge| is_on(&edge)) {
        step.remark(Remark::OnEdge);
    }
}

impl Triangle {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let corners = self.corners();
        let [p0, p1, p2] = corners;
        let named = [("P₀", p0), ("P₁", p1), ("P₂", p2)];
        let step = notes.step(Topic::Parameters);
        for (name, point) in named {
            step.vector(name, "", point);
        }
        if self.is_flat {
            step.remark(Remark::Flat);
        }
        let sheared = WatertightRay::new(ray.origin, ray.direction);
        let edges = sheared.edges(corners);
        tell_shear(notes, &sheared, &named, &edges.corners);

        let step = notes.step(Topic::EdgeFunctions);
        step.number("U", "x₂·y₁ − y₂·x₁", edges.u);
        step.number("V", "x₀·y₂ − y₀·x₂", edges.v);
        step.number("W", "x₁·y₀ − y₁·x₀", edges.w);
        let [a, b, c] = edges.corners;
        tell_edges(step, [[c, b], [a, c], [b, a]]);
        let is_inside = edges.are_passed_inside();
        let is_in_plane = exact::is_singular(&[p0, p1, p2, ray.origin].map(|p| [p.x, p.y, p.z, 1.0]));
        let crossing = edges.crossing(sheared.shear().z);
        match crossing {
            Some(hit) => {
                step.number("det", "U + V + W", hit.determinant);
                step.number("t", "σ₃·(U·z₀ + V·z₁ + W·z₂)/det", hit.t);
                step.number("b₁", "V/det", hit.b1).number("b₂", "W/det", hit.b2);
                let weights = [1.0 - hit.b1 - hit.b2, hit.b1, hit.b2];
                let fate = if !is_inside {
                    Fate::OutsideEdges { weights: [edges.u / hit.determinant, hit.b1, hit.b2] }
                } else if self.is_flat {
                    Fate::Flat
                } else {
                    out_of_range(ray, hit.t).unwrap_or(Fate::Hit)
                };
                debug_assert!(!is_inside || weights.iter().all(|weight| *weight > -1e-9));
                notes.candidate(hit.t, 0, fate);
            }
            None => {
                step.remark(if is_in_plane { Remark::InPlane } else { Remark::Parallel });
            }
        }
        if !is_inside && (crossing.is_some() || !is_in_plane) {
            notes.remark_last(Remark::Misses);
        }
        let is_met = is_inside && crossing.is_some() && !self.is_flat;
        tell_moller_trumbore(notes, ray, corners, is_met);
        tell_plane_and_sides(notes, ray, corners, is_met);
    }
}

/// Says so where another test disagrees with the search about whether the line meets the triangle.
fn compare(notes: &mut Notes, other: Option<TriangleHit>, is_met: bool) {
    if other.is_some() != is_met {
        notes.remark_last(Remark::Disagrees);
    }
}

fn tell_moller_trumbore(notes: &mut Notes, ray: &Ray, [p0, p1, p2]: [DVec3; 3], is_met: bool) {
    let &Ray { origin, direction, .. } = ray;
    let (edge1, edge2, s) = (p1 - p0, p2 - p0, origin - p0);
    let (s1, s2) = (direction.cross(edge2), s.cross(edge1));
    let determinant = s1.dot(edge1);
    let inverse = determinant.recip();
    let step = notes.step(Topic::MollerTrumbore);
    step.vector("E₁", "P₁ − P₀", edge1).vector("E₂", "P₂ − P₀", edge2).vector("S₀", "O − P₀", s);
    step.vector("S₁", "D×E₂", s1).vector("S₂", "S₀×E₁", s2);
    step.number("det", "S₁·E₁", determinant);
    if determinant == 0.0 {
        step.remark(Remark::Parallel);
    } else {
        step.number("t", "S₂·E₂/det", s2.dot(edge2) * inverse);
        step.number("b₁", "S₁·S₀/det", s1.dot(s) * inverse);
        step.number("b₂", "S₂·D/det", s2.dot(direction) * inverse);
    }
    compare(notes, moller_trumbore(origin, direction, p0, p1, p2), is_met);
}

fn tell_plane_and_sides(notes: &mut Notes, ray: &Ray, [p0, p1, p2]: [DVec3; 3], is_met: bool) {
    let &Ray { origin, direction, .. } = ray;
    let normal = (p1 - p0).cross(p2 - p0);
    let facing = direction.dot(normal);
    let step = notes.step(Topic::PlaneAndSides);
    step.vector("n", "(P₁ − P₀)×(P₂ − P₀)", normal).number("μ", "D·n", facing);
    if facing == 0.0 {
        step.remark(Remark::Parallel);
    } else {
        let t = (p0 - origin).dot(normal) / facing;
        let p = origin + t * direction;
        let side = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal);
        step.number("t", "((P₀ − O)·n)/μ", t).vector("P", "O + t·D", p);
        step.number("a₂", "((P₁ − P₀)×(P − P₀))·n", side(p0, p1));
        step.number("a₀", "((P₂ − P₁)×(P − P₁))·n", side(p1, p2));
        step.number("a₁", "((P₀ − P₂)×(P − P₂))·n", side(p2, p0));
        step.number("b₁", "a₁/(n·n)", side(p2, p0) / normal.length_squared());
        step.number("b₂", "a₂/(n·n)", side(p0, p1) / normal.length_squared());
    }
    compare(notes, plane_and_sides(origin, direction, p0, p1, p2), is_met);
}
