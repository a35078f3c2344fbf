//! Shapes of pbrt-v3: `heightfield` and `nurbs`, as triangles.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, DVec4, Vec2};
use lumbre_scene::{GeometryDesc, MeshDesc};

use super::convert::Converter;
use super::params::{Param, Params, Type};
use super::source::{AtSpot, Result};
use crate::Diagnostic;
use crate::diagnostic::number;
use crate::origin::{Spread, relative};

/// Points of a NURBS surface along each side, as pbrt-v3 has them.
const DICED: usize = 30;

impl Converter<'_, '_> {
    /// Heights over the unit square.
    pub fn heightfield(&mut self, params: &Params) -> Result<(GeometryDesc, DVec3)> {
        let [width, height] = [self.sizes(params, "nu", 2)?, self.sizes(params, "nv", 2)?];
        let Some(heights) = params.typed("Pz", &[Type::Float])? else {
            return Err(params.spot.error("a heightfield has no \"float Pz\""));
        };
        let numbers = heights.numbers()?;
        if width.checked_mul(height) != Some(numbers.len()) {
            return Err(heights.refuse(&format!("a number for each of {width} × {height} points")));
        }
        self.room_for(params, width, height)?;
        let points = numbers.iter().enumerate().map(|(i, &z)| {
            let place = |i: usize, n: usize| i as f64 / (n - 1) as f64;
            let uv = DVec2::new(place(i % width, width), place(i / width, height));
            (uv.extend(z), uv)
        });
        self.grid(heights, width, points.collect(), None)
    }

    /// A rational B-spline surface.
    pub fn nurbs(&mut self, params: &Params) -> Result<(GeometryDesc, DVec3)> {
        let sides = [("nu", "uorder", "uknots", "u0", "u1"), ("nv", "vorder", "vknots", "v0", "v1")];
        let mut bases = Vec::with_capacity(2);
        for (count, order, knots, from, to) in sides {
            bases.push(self.basis(params, [count, order, knots, from, to])?);
        }
        let [across, up] = [&bases[0], &bases[1]];
        let (points, each) = match params.typed("P", &[Type::Point3])? {
            Some(points) => (points, 3),
            None => match params.typed("Pw", &[Type::Float])? {
                Some(points) => (points, 4),
                None => return Err(params.spot.error("a nurbs has neither \"point3 P\" nor \"float Pw\"")),
            },
        };
        let numbers = points.numbers()?;
        if across.count.checked_mul(up.count).and_then(|n| n.checked_mul(each)) != Some(numbers.len()) {
            let (u, v) = (across.count, up.count);
            return Err(points.refuse(&format!("{each} numbers for each of {u} × {v} points")));
        }
        self.room_for(params, DICED, DICED)?;
        let control = |u: usize, v: usize| {
            let at = &numbers[(v * across.count + u) * each..][..each];
            DVec4::new(at[0], at[1], at[2], if each == 4 { at[3] } else { 1.0 })
        };
        let mut diced = Vec::with_capacity(DICED * DICED);
        let mut normals = Vec::with_capacity(DICED * DICED);
        for (v, of_v) in &up.values {
            for (u, of_u) in &across.values {
                let (mut sum, mut by_u, mut by_v) = (DVec4::ZERO, DVec4::ZERO, DVec4::ZERO);
                for &(j, vertical, slope_v) in of_v {
                    for &(i, horizontal, slope_u) in of_u {
                        let point = control(i, j);
                        sum += horizontal * vertical * point;
                        by_u += slope_u * vertical * point;
                        by_v += horizontal * slope_v * point;
                    }
                }
                let point = sum.truncate() / sum.w;
                // The derivative of a quotient.
                let along = |by: DVec4| (by.truncate() - point * by.w) / sum.w;
                if !point.is_finite() {
                    let wrong = Diagnostic::error("a nurbs has a point at infinity");
                    let found = format!("u = {}, v = {}", number(*u), number(*v));
                    return Err(points.spot.wrong(wrong.found(found).expected("weights of one sign")));
                }
                diced.push((point, DVec2::new(*u, *v)));
                normals.push(along(by_u).cross(along(by_v)).normalize_or_zero());
            }
        }
        self.grid(points, DICED, diced, Some(normals))
    }

    fn sizes(&mut self, params: &Params, name: &'static str, least: u32) -> Result<usize> {
        if !params.has(name) {
            let wrong = Diagnostic::error(format!("{} has no \"integer {name}\"", params.owner));
            return Err(params.spot.wrong(wrong));
        }
        Ok(params.count(name, least, least)? as usize)
    }

    fn room_for(&self, params: &Params, width: usize, height: usize) -> Result<()> {
        let faces = 2 * (width - 1) as u64 * (height - 1) as u64;
        self.budget.elements(faces, "faces").at(params.spot)?;
        self.budget.bytes(faces * 12 + (width * height) as u64 * 64, "faces").at(params.spot)
    }

    /// Triangles between points in rows.
    fn grid(
        &mut self,
        given: &Param,
        width: usize,
        points: Vec<(DVec3, DVec2)>,
        normals: Option<Vec<DVec3>>,
    ) -> Result<(GeometryDesc, DVec3)> {
        let height = points.len() / width;
        let origin = points.iter().map(|point| point.0).fold(Spread::NOTHING, Spread::with).origin();
        let vertex = |x: usize, y: usize| (y * width + x) as u32;
        let mut triangles = Vec::with_capacity(2 * (width - 1) * (height - 1));
        for y in 0..height - 1 {
            for x in 0..width - 1 {
                let [a, b] = [vertex(x, y), vertex(x + 1, y)];
                let [c, d] = [vertex(x + 1, y + 1), vertex(x, y + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        if points.iter().any(|(point, _)| !(*point - origin).as_vec3().is_finite()) {
            return Err(given.refuse("numbers of single precision"));
        }
        let positions: Vec<_> = points.iter().map(|&(point, _)| relative(point, origin)).collect();
        let uvs: Vec<Vec2> = points.iter().map(|point| point.1.as_vec2()).collect();
        let normals = normals.map(|list| list.iter().map(|normal| normal.as_vec3()).collect());
        let mesh = MeshDesc { positions, triangles, normals, uvs: Some(uvs), ..MeshDesc::default() };
        Ok((GeometryDesc::Mesh(Arc::new(mesh)), origin))
    }

    /// The B-spline functions of one parameter at the places where a surface is diced.
    fn basis(
        &mut self,
        params: &Params,
        [count, order, knots, from, to]: [&'static str; 5],
    ) -> Result<Basis> {
        let (n, p) = (self.sizes(params, count, 1)?, self.sizes(params, order, 2)?);
        let Some(list) = params.typed(knots, &[Type::Float])? else {
            let wrong = Diagnostic::error(format!("a nurbs has no \"float {knots}\""));
            return Err(params.spot.wrong(wrong));
        };
        let numbers = list.numbers()?;
        let expected = n + p;
        if numbers.len() != expected {
            return Err(list.refuse(&format!("{expected} knots, {count} and {order} together")));
        }
        let ascends = numbers.windows(2).all(|pair| pair[0] <= pair[1]);
        let has_span = n >= p && numbers[p - 1] < numbers[n];
        if !ascends || !has_span {
            return Err(list.refuse("knots that do not descend, with a surface between them"));
        }
        let (first, last) = (numbers[p - 1], numbers[n]);
        let (start, end) = (params.float(from, first)?, params.float(to, last)?);
        for (name, value) in [(from, start), (to, end)] {
            if !(first..=last).contains(&value) {
                let expected = format!("{} to {}", number(first), number(last));
                return params.out_of_range(name, value, &expected);
            }
        }
        let values = (0..DICED).map(|i| {
            let t = i as f64 / (DICED - 1) as f64;
            let t = start * (1.0 - t) + end * t;
            (t, functions(numbers, n, p, t))
        });
        Ok(Basis { count: n, values: values.collect() })
    }
}

/// Numbers of functions, with values and derivatives.
type Row = Vec<(usize, f64, f64)>;

/// The functions of one parameter.
struct Basis {
    count: usize,
    /// For each place its parameter, and the functions that are not 0 there: their numbers, values and derivatives.
    values: Vec<(f64, Row)>,
}

/// The B-splines of an order that are not 0 at a place, by the recursion of Cox and de Boor.
fn functions(knots: &[f64], count: usize, order: usize, t: f64) -> Row {
    // The last span that is not empty holds its upper end, too.
    let mut span = knots[..=count].partition_point(|&knot| knot <= t).clamp(order, count) - 1;
    while span + 1 > order && knots[span] == knots[span + 1] {
        span -= 1;
    }
    let ratio = |a: f64, b: f64| if b == 0.0 { 0.0 } else { a / b };
    // Of the previous order, from span − k + 1 to span.
    let mut lower = vec![1.0];
    let mut values = vec![1.0];
    for k in 1..order {
        lower.clone_from(&values);
        let mut next = vec![0.0; k + 1];
        for (i, &value) in values.iter().enumerate() {
            let begin = span + 1 + i - k;
            let share = ratio(t - knots[begin], knots[begin + k] - knots[begin]);
            next[i + 1] += share * value;
            next[i] += (1.0 - share) * value;
        }
        values = next;
    }
    let degree = (order - 1) as f64;
    let first = span + 1 - order;
    let slope = |i: usize| {
        let at = first + i;
        let below = if i > 0 { ratio(lower[i - 1], knots[at + order - 1] - knots[at]) } else { 0.0 };
        let above = if i < order - 1 { ratio(lower[i], knots[at + order] - knots[at + 1]) } else { 0.0 };
        degree * (below - above)
    };
    (0..order).map(|i| (first + i, values[i], slope(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one_and_their_slopes_are_differences() {
        // With a double knot inside.
        let knots = [0.0, 0.0, 0.0, 0.0, 1.0, 2.5, 2.5, 4.0, 4.0, 4.0, 4.0];
        let (count, order) = (7, 4);
        for t in [0.0, 0.3, 1.0, 1.7, 2.5, 3.2, 3.999, 4.0] {
            let here = functions(&knots, count, order, t);
            assert!((here.iter().map(|f| f.1).sum::<f64>() - 1.0).abs() < 1e-12, "{t}");
            assert!(here.iter().all(|f| f.1 >= 0.0 && f.0 < count), "{t}: {here:?}");
            assert!(here.iter().map(|f| f.2).sum::<f64>().abs() < 1e-12, "{t}");
            let step = 1e-6;
            if t > 0.0 && t < 4.0 - 1e-3 && t != 1.0 && t != 2.5 {
                let (before, after) =
                    (functions(&knots, count, order, t - step), functions(&knots, count, order, t + step));
                for ((a, b), f) in before.iter().zip(&after).zip(&here) {
                    assert!(((b.1 - a.1) / (2.0 * step) - f.2).abs() < 1e-6, "{t}: {f:?}");
                }
            }
        }
        // The ends are at the first and the last point.
        assert!((functions(&knots, count, order, 0.0)[0].1 - 1.0).abs() < 1e-12);
        let end = functions(&knots, count, order, 4.0);
        assert!(end[3].0 == 6 && (end[3].1 - 1.0).abs() < 1e-12, "{end:?}");
    }
}
