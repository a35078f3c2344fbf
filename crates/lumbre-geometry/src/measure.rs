//! Areas without an elementary closed form: quadrature, and Carlson's symmetric integrals.

use lumbre_math::{DMat3, DVec3, Elementary, Transform};

/// How a linear map stretches area elements: with the cofactor matrix C = det(L) L⁻ᵀ, an area element with
/// normal `n` grows by |C n|.
pub(crate) fn area_stretch(world_from_object: &Transform) -> DMat3 {
    let l = world_from_object.linear();
    DMat3::from_cols(l.y_axis.cross(l.z_axis), l.z_axis.cross(l.x_axis), l.x_axis.cross(l.y_axis))
}

/// The factor by which a similarity scales lengths; `None` for other maps.
pub(crate) fn similarity_factor(world_from_object: &Transform) -> Option<f64> {
    let l = world_from_object.linear();
    let (x, y, z) = (l.x_axis.length_squared(), l.y_axis.length_squared(), l.z_axis.length_squared());
    let tolerance = 8.0 * f64::EPSILON * x;
    let skew =
        l.x_axis.dot(l.y_axis).abs().max(l.y_axis.dot(l.z_axis).abs()).max(l.z_axis.dot(l.x_axis).abs());
    let similar = (x - y).abs() <= tolerance && (x - z).abs() <= tolerance && skew <= tolerance;
    similar.then(|| ((x + y + z) / 3.0).sqrt())
}

/// The integral of `f` from `a` to `b` to about twelve digits: 16-point Gauss–Legendre, doubling the number of
/// panels until the result converges.
pub(crate) fn integrate(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let rule = gauss_legendre();
    let on_panels = |panels: u32| {
        let width = (b - a) / f64::from(panels);
        let panel = |i: u32| {
            let left = a + f64::from(i) * width;
            rule.iter().map(|&(x, weight)| weight * f(left + x * width)).sum::<f64>() * width
        };
        (0..panels).map(panel).sum::<f64>()
    };
    settle(on_panels, 4096)
}

/// The integral of `f(x, y)` over a rectangle, to about eleven digits.
pub(crate) fn integrate_2d(x: (f64, f64), y: (f64, f64), f: impl Fn(f64, f64) -> f64) -> f64 {
    let rule = gauss_legendre();
    let on_panels = |panels: u32| {
        let (width, height) = ((x.1 - x.0) / f64::from(panels), (y.1 - y.0) / f64::from(panels));
        let mut sum = 0.0;
        for i in 0..panels {
            for j in 0..panels {
                let (left, bottom) = (x.0 + f64::from(i) * width, y.0 + f64::from(j) * height);
                for &(s, ws) in &rule {
                    let row = |&(t, wt): &(f64, f64)| wt * f(left + s * width, bottom + t * height);
                    sum += ws * rule.iter().map(row).sum::<f64>();
                }
            }
        }
        sum * width * height
    };
    settle(on_panels, 64)
}

/// Doubles the number of panels until two results agree, up to `most`.
fn settle(on_panels: impl Fn(u32) -> f64, most: u32) -> f64 {
    let mut panels = 2;
    let mut previous = on_panels(1);
    loop {
        let refined = on_panels(panels);
        let settled = (refined - previous).abs() <= 1e-13 * refined.abs();
        if settled || panels >= most || refined.is_nan() {
            return refined;
        }
        previous = refined;
        panels *= 2;
    }
}

/// The nodes and weights of the 16-point Gauss–Legendre rule on [0, 1], by Newton's method on the Legendre polynomial.
pub(crate) fn gauss_legendre() -> [(f64, f64); 16] {
    const N: usize = 16;
    std::array::from_fn(|i| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5)).cosine();
        let mut slope = 0.0;
        for _ in 0..8 {
            let (mut before, mut value) = (1.0, x);
            for k in 2..=N {
                let k = k as f64;
                (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
            }
            slope = N as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

/// The area of the image of a sphere of `radius` under a linear map.
///
/// With C the cofactor matrix and q the eigenvalues of CᵀC, it is 4π r² R_G(q): NIST Digital Library of Mathematical
/// Functions, 19.33.1.
pub(crate) fn ellipsoid_area(radius: f64, world_from_object: &Transform) -> f64 {
    let stretch = area_stretch(world_from_object);
    let scale = stretch.to_cols_array().into_iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let unit = stretch * (1.0 / scale);
    let [x, y, z] = symmetric_eigenvalues(unit.transpose() * unit);
    4.0 * std::f64::consts::PI * radius * radius * scale * carlson_rg(x, y, z)
}

/// The eigenvalues of a symmetric matrix by cyclic Jacobi rotations; negative ones, which are rounding errors
/// here, become 0.
fn symmetric_eigenvalues(m: DMat3) -> [f64; 3] {
    let mut a = m.to_cols_array_2d();
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypotenuse(1.0));
            let c = 1.0 / t.hypotenuse(1.0);
            let s = t * c;
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            let (row_p, row_q) = (DVec3::from_array(a[p]), DVec3::from_array(a[q]));
            (a[p], a[q]) = ((c * row_p - s * row_q).to_array(), (s * row_p + c * row_q).to_array());
        }
    }
    [a[0][0].max(0.0), a[1][1].max(0.0), a[2][2].max(0.0)]
}

/// Carlson's symmetric integral of the second kind R_G(x, y, z), for arguments ≥ 0, at most one of them 0.
///
/// B. C. Carlson, "Numerical computation of real or complex elliptic integrals", Numerical Algorithms, 1995.
fn carlson_rg(x: f64, y: f64, z: f64) -> f64 {
    let mut sorted = [x, y, z];
    sorted.sort_by(f64::total_cmp);
    // With z between the others no term is negative, and nothing cancels.
    let [x, z, y] = sorted;
    if z == 0.0 {
        return 0.5 * y.sqrt();
    }
    let (rf, rd) = carlson_rf_rd(x, y, z);
    0.5 * (z * rf - (x - z) * (y - z) * rd / 3.0 + (x * y / z).sqrt())
}

/// R_F(x, y, z) and R_D(x, y, z) by duplication.
fn carlson_rf_rd(x: f64, y: f64, z: f64) -> (f64, f64) {
    let (mut x, mut y, mut z) = (x, y, z);
    let (mut sum, mut factor) = (0.0, 1.0);
    // Each iteration brings the arguments four times closer; 30 suffice for any two doubles.
    for _ in 0..60 {
        let mean = (x + y + z) / 3.0;
        let spread = (x - mean).abs().max((y - mean).abs()).max((z - mean).abs());
        if spread <= 1e-4 * mean {
            break;
        }
        let (sx, sy, sz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = sx * sy + sy * sz + sz * sx;
        sum += factor / (sz * (z + lambda));
        factor *= 0.25;
        (x, y, z) = (0.25 * (x + lambda), 0.25 * (y + lambda), 0.25 * (z + lambda));
    }
    let rf = {
        let a = (x + y + z) / 3.0;
        let (dx, dy) = (1.0 - x / a, 1.0 - y / a);
        let dz = -(dx + dy);
        let (e2, e3) = (dx * dy - dz * dz, dx * dy * dz);
        (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / a.sqrt()
    };
    let rd = {
        let a = (x + y + 3.0 * z) / 5.0;
        let (dx, dy) = (1.0 - x / a, 1.0 - y / a);
        let dz = -(dx + dy) / 3.0;
        let (e2, e3) = (dx * dy - 6.0 * dz * dz, (3.0 * dx * dy - 8.0 * dz * dz) * dz);
        let (e4, e5) = (3.0 * (dx * dy - dz * dz) * dz * dz, dx * dy * dz * dz * dz);
        let series =
            1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0
                + 3.0 * e5 / 26.0;
        factor * series / (a * a.sqrt()) + 3.0 * sum
    };
    (rf, rd)
}

/// The area of a patch under a linear map, from ∂p/∂u × ∂p/∂v over the unit square, to about eleven digits.
pub(crate) fn patch_area(world_from_object: &Transform, cross: impl Fn(f64, f64) -> DVec3) -> f64 {
    let stretch = area_stretch(world_from_object);
    integrate_2d((0.0, 1.0), (0.0, 1.0), |u, v| (stretch * cross(u, v)).length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_of_smooth_functions_is_exact_to_rounding() {
        assert!((integrate(2.0, 5.0, |x| x.powi(7)) - (5f64.powi(8) - 2f64.powi(8)) / 8.0).abs() < 1e-9);
        let volume = integrate_2d((1.0, 3.0), (-2.0, 0.5), |x, y| x.exp() * y.sin());
        let exact = (3f64.exp() - 1f64.exp()) * (2f64.cos() - 0.5f64.cos());
        assert!((volume - exact).abs() < 1e-12 * exact.abs());
    }

    #[test]
    fn the_area_of_a_spheroid_agrees_with_its_elementary_formula() {
        for (a, c) in [(2.0_f64, 5.0_f64), (3.0, 0.25), (1.5, 1e6), (40.0, 1e-5)] {
            let scale = Transform::scale(DVec3::new(a, a, c)).unwrap();
            let turned = Transform::rotate(DVec3::new(2.0, -3.0, 7.0), 31.0).unwrap() * scale;
            let exact = if c > a {
                let e = ((c - a) * (c + a)).sqrt() / c;
                std::f64::consts::TAU * (a * a + a * c / e * e.asin())
            } else {
                let e = ((a - c) * (a + c)).sqrt() / a;
                std::f64::consts::TAU * a * a
                    + std::f64::consts::PI * c * c / e * ((1.0 + e) / (1.0 - e)).ln()
            };
            let exact = exact * 2.25;
            for map in [scale, turned] {
                let area = ellipsoid_area(1.5, &map);
                assert!((area / exact - 1.0).abs() < 1e-11, "{area} {exact}");
            }
        }
    }
}
