//! Surfaces of polynomials in x, y and z.

use std::sync::Arc;

use lumbre_geometry::{Ray, Root, Roots};
use lumbre_math::DVec3;
use lumbre_math::roots::roots_between;

/// The highest degree.
pub(super) const MAX_DEGREE: u32 = 15;

/// Where a polynomial is not above 0.
#[derive(Clone, Debug)]
pub(super) struct Algebraic {
    degree: u32,
    /// Terms in falling powers of x, then y, then z.
    terms: Arc<[f64]>,
}

/// A polynomial times o + d t, plus another.
fn grown<const N: usize>(c: &mut [f64; N], [o, d]: [f64; 2], plus: &[f64; N]) {
    let mut lower = 0.0;
    for (c, plus) in c.iter_mut().zip(plus) {
        let own = *c;
        *c = own * o + lower * d + plus;
        lower = own;
    }
}

impl Algebraic {
    /// A polynomial of a degree up to [`MAX_DEGREE`], with all its terms.
    pub(super) fn new(degree: u32, terms: Arc<[f64]>) -> Self {
        Self { degree, terms }
    }

    /// The first powers of the polynomial along a line, by Horner's rule.
    fn along<const N: usize>(&self, o: DVec3, d: DVec3) -> [f64; N] {
        let constant = |x: f64| {
            let mut c = [0.0; N];
            c[0] = x;
            c
        };
        let mut terms = self.terms.iter().copied();
        let mut in_x = constant(0.0);
        for i in (0..=self.degree).rev() {
            let mut in_y = constant(0.0);
            for j in (0..=self.degree - i).rev() {
                let mut in_z = constant(0.0);
                for _ in (0..=self.degree - i - j).rev() {
                    grown(&mut in_z, [o.z, d.z], &constant(terms.next().unwrap_or(0.0)));
                }
                grown(&mut in_y, [o.y, d.y], &in_z);
            }
            grown(&mut in_x, [o.x, d.x], &in_y);
        }
        in_x
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        self.along::<1>(p, DVec3::ZERO)[0] <= 0.0
    }

    /// The gradient.
    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        let slope = |axis: DVec3| self.along::<2>(p, axis)[1];
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        match self.degree {
            2 => self.push_roots::<3>(ray, out),
            3 => self.push_roots::<4>(ray, out),
            4 => self.push_roots::<5>(ray, out),
            5..=7 => self.push_roots::<8>(ray, out),
            _ => self.push_roots::<{ MAX_DEGREE as usize + 1 }>(ray, out),
        }
    }

    /// The roots, for a degree below `N`.
    fn push_roots<const N: usize>(&self, ray: &Ray, out: &mut Roots) {
        // From the nearest point to the origin, where the coefficients are least.
        let dd = ray.direction.length_squared();
        let shift = -ray.origin.dot(ray.direction) / dd;
        let c = self.along::<N>(ray.at(shift), ray.direction);
        let roots = roots_between(&c, ray.t_min - shift, ray.t_max - shift);
        out.extend(roots.iter().map(|s| shift + s).filter(|t| ray.contains(*t)).map(Root::at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadric_and_a_quartic_are_met_where_their_formulas_say() {
        // A ball of radius 1.5, and a torus about z of radii 2 and 0.5.
        let ball = Algebraic::new(2, Arc::from([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -2.25]));
        let ray = Ray::new(DVec3::new(0.3, -0.4, -7.0), DVec3::new(0.0, 0.0, 2.0));
        let mut roots = Roots::new();
        ball.roots(&ray, &mut roots);
        let half = 2.0_f64.sqrt();
        let found: Vec<f64> = roots.iter().map(|root| root.t).collect();
        for (found, expected) in found.iter().zip([(7.0 - half) / 2.0, (7.0 + half) / 2.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(found.len(), 2);
        let p = ray.at(found[0]);
        assert!((ball.normal(p) - 2.0 * p).length() < 1e-9);
        assert!(ball.contains(DVec3::splat(0.8)) && !ball.contains(DVec3::splat(0.9)));
        let mut terms = [0.0; 35];
        // (x² + y² + z² + 3.75)² − 16 (x² + y²).
        for (at, value) in [
            (0, 1.0),
            (4, 2.0),
            (7, 2.0),
            (9, -8.5),
            (20, 1.0),
            (25, 2.0),
            (29, -8.5),
            (30, 1.0),
            (32, 7.5),
            (34, 14.0625),
        ] {
            terms[at] = value;
        }
        let torus = Algebraic::new(4, Arc::from(terms));
        let ray = Ray::new(DVec3::new(-9.0, 0.0, 0.1), DVec3::X);
        let mut roots = Roots::new();
        torus.roots(&ray, &mut roots);
        let reach = (0.25_f64 - 0.01).sqrt();
        let expected = [7.0 - reach, 7.0 + reach, 11.0 - reach, 11.0 + reach];
        assert_eq!(roots.len(), 4, "{roots:?}");
        for (root, expected) in roots.iter().zip(expected) {
            assert!((root.t - expected).abs() < 1e-9, "{roots:?}");
        }
    }
}
