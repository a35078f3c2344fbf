//! Real roots of polynomials in an interval, by monotone pieces.
//!
//! The real roots of p' cut the interval into pieces on which p is monotone. A piece has a root exactly when
//! the signs at its ends differ; Newton's method with a fallback to bisection finds it. Applied from degree 2
//! upwards this always converges, finds every crossing, and never a complex root: C. Yuksel, "High-performance
//! polynomial root finding for graphics", Proceedings of the ACM on Computer Graphics and Interactive
//! Techniques, 2022. Unlike there, the recursion starts from the closed form of the quadratic, and a piece's
//! end where p vanishes is itself a root.

use std::ops::Deref;

use crate::Elementary;
use crate::quadratic::{dop, quadratic};

/// Real roots in ascending order, at most `N` of them; a slice of `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealRoots<const N: usize> {
    // Only the first `count` are valid.
    roots: [f64; N],
    count: usize,
}

impl<const N: usize> RealRoots<N> {
    const NONE: Self = Self { roots: [0.0; N], count: 0 };

    fn push(&mut self, root: f64) {
        let repeated = self.last() == Some(&root);
        if self.count < N && !repeated {
            self.roots[self.count] = root;
            self.count += 1;
        }
    }
}

impl<const N: usize> Deref for RealRoots<N> {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.roots[..self.count]
    }
}

/// The distinct real roots in `[low, high]` of `c[0] + c[1] x + … + c[N-1] x^(N-1)`, in ascending order.
///
/// A root of odd multiplicity is always found. One of even multiplicity is found where the polynomial evaluates
/// to exactly zero at the computed root of its derivative; otherwise it comes out as two close roots or as
/// none. Leading coefficients may be zero. An infinite end stands for Cauchy's bound on the roots. Empty when
/// the interval is empty, when anything is NaN, and for the zero polynomial.
///
/// Nothing is allocated. `examples/roots_speed.rs` compares its speed with other crates.
pub fn roots_between<const N: usize>(c: &[f64; N], low: f64, high: f64) -> RealRoots<N> {
    let Some((low, high)) = finite_interval(c, low, high) else {
        return RealRoots::NONE;
    };
    if N < 2 || c.iter().all(|&x| x == 0.0) {
        return RealRoots::NONE;
    }
    if N == 2 {
        let mut roots = RealRoots::NONE;
        let root = -c[0] / c[1];
        if low <= root && root <= high {
            roots.push(root);
        }
        return roots;
    }
    // taylor[k] = p^(m)(x)/m! has the coefficients binomial(k + m, m) c[k + m]: no factorials, no overflow.
    let mut derivatives = [[0.0; N]; N];
    derivatives[0] = *c;
    for m in 1..N {
        for k in 0..N - m {
            derivatives[m][k] = derivatives[m - 1][k + 1] * (k + 1) as f64 / m as f64;
        }
    }
    let mut roots = RealRoots::NONE;
    let mut solved = N - 1;
    if N >= 5
        && let Some(cubic) = cubic_roots_between::<N>(&derivatives[N - 4], low, high)
    {
        (roots, solved) = (cubic, N - 4);
    } else if N >= 3 {
        let q = &derivatives[N - 3];
        let (c0, h, c2) = (q[0], 0.5 * q[1], q[2]);
        if let Some((first, second)) = quadratic(c2, h, c0, dop(h, h, c2, c0)) {
            for root in [first, second] {
                if low <= root && root <= high {
                    roots.push(root);
                }
            }
        }
        solved = N - 3;
    }
    for m in (0..solved).rev() {
        let degree = N - 1 - m;
        let p = &derivatives[m][..=degree];
        roots = roots_from_splits(p, low, high, &roots);
    }
    roots
}

/// Whether a polynomial certainly has no root in [0, 1]: all its Bernstein coefficients, between which its values lie,
/// have the same sign, by more than their rounding.
#[inline]
pub fn keeps_sign<const N: usize>(c: &[f64; N]) -> bool {
    // c[i] over the binomial coefficient (N - 1, i); the sums of Pascal's triangle are the coefficients.
    let mut b = *c;
    let mut choices = 1.0;
    for (i, b) in b.iter_mut().enumerate().skip(1) {
        choices *= (N - i) as f64 / i as f64;
        *b /= choices;
    }
    let size = b.iter().map(|x| x.abs()).sum::<f64>() * (1 << N) as f64;
    for k in 1..N {
        for i in (k..N).rev() {
            b[i] += b[i - 1];
        }
    }
    let margin = 1e-14 * size;
    b.iter().all(|&x| x > margin) || b.iter().all(|&x| x < -margin)
}

/// The distinct real roots in `[low, high]` of the quartic `c[0] + c[1] x + … + c[4] x⁴`, in ascending order:
/// as [`roots_between`], but with the split points from the closed form of the cubic.
pub fn quartic_roots_between(c: &[f64; 5], low: f64, high: f64) -> RealRoots<5> {
    let Some((low, high)) = finite_interval(c, low, high) else {
        return RealRoots::NONE;
    };
    let derivative = [0.25 * c[1], 0.5 * c[2], 0.75 * c[3], c[4]];
    match cubic_roots_between(&derivative, low, high) {
        Some(splits) => roots_from_splits(c, low, high, &splits),
        None => roots_between(c, low, high),
    }
}

/// The roots in `[low, high]` of a cubic, by its depressed form; `None` when its leading coefficient is so
/// small that the shift would lose the digits.
fn cubic_roots_between<const N: usize>(c: &[f64], low: f64, high: f64) -> Option<RealRoots<N>> {
    let (b, d, e) = (c[2] / c[3], c[1] / c[3], c[0] / c[3]);
    let third = b / 3.0;
    let far = third.abs() > 1e3 * low.abs().max(high.abs());
    if far || !(d.abs() < 1e60 && e.abs() < 1e60) {
        return None;
    }
    let mut roots = RealRoots::NONE;
    for &shifted in depressed_cubic_roots(d - b * third, (2.0 * third * third - d) * third + e).iter() {
        // A Newton step removes the rounding error of the shift.
        let x = shifted - third;
        let (value, slope) = (((x + b) * x + d) * x + e, (3.0 * x + 2.0 * b) * x + d);
        let polished = x - value / slope;
        let root = if (polished - x).abs() <= 1e-6 * (x.abs() + third.abs()) { polished } else { x };
        if low <= root && root <= high {
            roots.push(root);
        }
    }
    Some(roots)
}

/// All real roots of `x³ + a x + b`, in ascending order: one or three, a double one counted twice up to rounding.
pub fn depressed_cubic_roots(a: f64, b: f64) -> RealRoots<3> {
    match DepressedCubic::new(a, b) {
        DepressedCubic::OneRoot(root) => RealRoots { roots: [root, 0.0, 0.0], count: 1 },
        DepressedCubic::ThreeRoots(three) => {
            let left = three.left();
            let (middle, right) = three.others(left);
            // A final Newton step, which fails only where a root is double anyway.
            let polish = |x: f64| {
                let polished = x - ((x * x + a) * x + b) / (3.0 * x * x + a);
                if (polished - x).abs() <= 1e-7 * three.e { polished } else { x }
            };
            RealRoots { roots: [polish(left), polish(middle), polish(right)], count: 3 }
        }
    }
}

/// The real roots of `x³ + a x + b`, computed on demand and to about ten digits.
///
/// Viète's trigonometric form, with a polynomial and a Newton step in place of the cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepressedCubic {
    /// The only real root.
    OneRoot(f64),
    /// Three; two may be equal.
    ThreeRoots(ThreeRoots),
}

/// The three real roots of a depressed cubic: see [`DepressedCubic`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreeRoots {
    // In units of `e` the cubic is x³ - 3x + 2h, with |h| <= 1.
    e: f64,
    h: f64,
}

impl DepressedCubic {
    /// Determines the number of roots, and the root if there is only one.
    #[inline]
    pub fn new(a: f64, b: f64) -> Self {
        let e = (-a / 3.0).max(0.0).sqrt();
        let h = 0.5 * b / (e * e * e);
        if h.abs() <= 1.0 { Self::ThreeRoots(ThreeRoots { e, h }) } else { Self::OneRoot(only_root(a, b)) }
    }
}

impl ThreeRoots {
    /// The least root, to about ten digits.
    #[inline]
    pub fn left(&self) -> f64 {
        -self.e * Self::outer(self.h)
    }

    /// The middle and the greatest root, given the least, to about ten digits.
    #[inline]
    pub fn others(&self, left: f64) -> (f64, f64) {
        let right = Self::outer(-self.h);
        let left = left / self.e;
        let x = -(left + right);
        let slope = 3.0 * (x - 1.0) * (x + 1.0);
        let polished = x - ((x * x - 3.0) * x + 2.0 * self.h) / slope;
        let middle = if (polished - x).abs() <= 1e-6 { polished.max(left).min(right) } else { x };
        (self.e * middle, self.e * right)
    }

    /// 2 cos(acos(h)/3), the root of x³ - 3x - 2h from 1 to 2, to about 1e-10.
    #[inline]
    fn outer(h: f64) -> f64 {
        // (x - 1)/c is smooth in c = cos(acos(h)/2): a polynomial through its values, to 6e-6 and exact at both
        // ends.
        let c = (0.5 * (1.0 + h)).sqrt();
        let high = 0.105_781_913 + c * (-0.058_513_870 + c * (0.026_063_998 - c * 0.005_843_958));
        let x = 1.0 + c * (1.154_700_538 + c * (-0.222_188_622 + c * high));
        // At the double root, x = 1, there is nothing to improve.
        if c < 1e-6 { x } else { x - ((x * x - 3.0) * x - 2.0 * h) / (3.0 * (x - 1.0) * (x + 1.0)) }
    }
}

/// The real root of `x³ + a x + b` when there is only one.
///
/// With the sign of b factored out, the root of x³ + a x = |b| is to the right of every turning point, where
/// the cubic is convex: Newton's method descends to it from any point beyond.
#[inline]
fn only_root(a: f64, b: f64) -> f64 {
    let goal = b.abs();
    if goal == 0.0 {
        return 0.0;
    }
    let mut x =
        if a > 0.0 { goal.cube_root().min(goal / a) } else { goal.cube_root() + (-a).max(0.0).sqrt() };
    for _ in 0..60 {
        let next = x - ((x * x + a) * x - goal) / (3.0 * x * x + a);
        if next.is_nan() || next >= x {
            break;
        }
        // Convergence is quadratic: one more step would be below rounding.
        let done = x - next <= 1e-8 * x;
        x = next;
        if done {
            break;
        }
    }
    -x.copysign(b)
}

/// The root of a function that is monotone between `low` and `high` and has different signs there: Newton's
/// method from `guess`, with bisection whenever a step would leave the bracket or shrinks too slowly.
///
/// `at` returns value and slope; `rising` is whether the function is positive at `high`. The result lies in
/// `[low, high]` for any function.
#[inline]
pub fn bracketed_root(low: f64, high: f64, guess: f64, rising: bool, at: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high) = (low, high);
    let scale = low.abs().max(high.abs());
    let mut x = if low < guess && guess < high { guess } else { 0.5 * (low + high) };
    let mut previous = high - low;
    // The last step, if it was a Newton step.
    let mut newtons = 0.0;
    for _ in 0..200 {
        let (value, slope) = at(x);
        if value == 0.0 {
            return x;
        }
        if (value > 0.0) == rising {
            high = x;
        } else {
            low = x;
        }
        let newton = x - value / slope;
        let step = (newton - x).abs();
        // Newton's steps shrink quadratically, so this predicts the next one. They end in rounding noise, where
        // bisection would only lose accuracy.
        let negligible = step * step * step <= 0.25 * f64::EPSILON * x.abs() * newtons * newtons;
        let done = negligible && step <= 0.1 * newtons;
        if done || step <= f64::EPSILON * x.abs() || (step <= 1e-13 * scale && step >= 0.25 * previous) {
            return newton.max(low).min(high);
        }
        let is_newton = low < newton && newton < high && step <= 0.5 * previous;
        let next = if is_newton { newton } else { 0.5 * (low + high) };
        if next <= low || next >= high {
            return x;
        }
        previous = (next - x).abs();
        newtons = if is_newton { previous } else { 0.0 };
        x = next;
    }
    x
}

/// The roots of `p` between `low` and `high`, given those of its derivative there.
fn roots_from_splits<const N: usize>(p: &[f64], low: f64, high: f64, splits: &RealRoots<N>) -> RealRoots<N> {
    let mut roots = RealRoots::NONE;
    let mut left = low;
    let mut at_left = value(p, low);
    if at_left == 0.0 {
        roots.push(low);
    }
    for &right in splits.iter().chain(std::iter::once(&high)) {
        let at_right = value(p, right);
        if at_right == 0.0 {
            roots.push(right);
        } else if at_left != 0.0 && (at_left > 0.0) != (at_right > 0.0) {
            let rising = at_right > 0.0;
            // The root of the secant is at least as good a guess as the middle, except at the foot of a steep
            // flank.
            let secant = left - at_left * (right - left) / (at_right - at_left);
            let middle = 0.5 * (left + right);
            let guess = 0.5 * (middle + secant);
            roots.push(bracketed_root(left, right, guess, rising, |x| value_and_slope(p, x)));
        }
        (left, at_left) = (right, at_right);
    }
    roots
}

/// `low` and `high` clamped to Cauchy's bound; `None` when the interval is empty or anything is NaN.
fn finite_interval(c: &[f64], low: f64, high: f64) -> Option<(f64, f64)> {
    if !c.iter().all(|x| x.is_finite()) || low.is_nan() || high.is_nan() || low > high {
        return None;
    }
    if low.is_finite() && high.is_finite() {
        return Some((low, high));
    }
    let degree = c.iter().rposition(|&x| x != 0.0)?;
    let largest = c[..degree].iter().fold(0.0_f64, |m, x| m.max((x / c[degree]).abs()));
    let bound = (1.0 + largest).min(1e30);
    let (low, high) = (low.max(-bound), high.min(bound));
    (low <= high).then_some((low, high))
}

/// Horner's rule.
#[inline]
fn value(p: &[f64], x: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[inline]
fn value_and_slope(p: &[f64], x: f64) -> (f64, f64) {
    p.iter().rev().fold((0.0, 0.0), |(sum, slope), c| (sum * x + c, slope * x + sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform numbers in [0, 1) from a counter (an increment and a finaliser of the splitmix family).
    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The coefficients of `lead (x - r0)(x - r1)…`, and of `x² + 1` as often as it fits.
    fn from_roots<const N: usize>(lead: f64, real: &[f64]) -> [f64; N] {
        let mut c = [0.0; N];
        c[0] = lead;
        let mut degree = 0;
        for r in real {
            for k in (0..=degree).rev() {
                c[k + 1] += c[k];
                c[k] *= -r;
            }
            degree += 1;
        }
        while degree + 2 < N {
            for k in (0..=degree).rev() {
                c[k + 2] += c[k];
            }
            degree += 2;
        }
        c
    }

    fn every_known_root_is_found<const N: usize>(seed: u64) {
        let mut state = seed;
        let mut found_in_all = 0;
        for _ in 0..20_000 {
            let real = N - 1 - 2 * (uniform(&mut state) * ((N - 1) / 2 + 1) as f64) as usize;
            let mut known: Vec<f64> = (0..real).map(|_| 6.0 * uniform(&mut state) - 2.5).collect();
            known.sort_by(f64::total_cmp);
            // Roots closer than this are a double root to the coefficients' own rounding.
            if known.windows(2).any(|w| w[1] - w[0] < 0.03) {
                continue;
            }
            let c = from_roots::<N>(2.0 - 5.0 * uniform(&mut state), &known);
            let found = roots_between(&c, -3.0, 4.0);
            assert_eq!(found.len(), known.len(), "{known:?} {found:?}");
            for (f, k) in found.iter().zip(&known) {
                assert!((f - k).abs() < 1e-5, "{known:?} {found:?}");
            }
            let right = roots_between(&c, 0.5, f64::INFINITY);
            assert_eq!(right.len(), known.iter().filter(|k| **k >= 0.5).count());
            found_in_all += found.len();
        }
        assert!(found_in_all > 10_000);
    }

    #[test]
    fn polynomials_up_to_degree_eight_give_back_their_roots() {
        every_known_root_is_found::<3>(1);
        every_known_root_is_found::<4>(2);
        every_known_root_is_found::<5>(3);
        every_known_root_is_found::<6>(4);
        every_known_root_is_found::<7>(5);
        every_known_root_is_found::<9>(6);
    }

    #[test]
    fn the_quartic_solver_agrees_with_the_general_one() {
        let mut state = 7;
        let mut count = 0;
        for _ in 0..50_000 {
            let c: [f64; 5] = std::array::from_fn(|_| 2.0 * uniform(&mut state) - 1.0);
            let (one, other) = (quartic_roots_between(&c, -4.0, 5.0), roots_between(&c, -4.0, 5.0));
            assert_eq!(one.len(), other.len(), "{c:?} {one:?} {other:?}");
            for (a, b) in one.iter().zip(other.iter()) {
                // Two roots that almost meet are known to half the digits only.
                assert!((a - b).abs() < 1e-7 * (1.0 + a.abs()), "{c:?} {a} {b}");
            }
            count += one.len();
        }
        assert!(count > 50_000);
    }

    #[test]
    fn a_depressed_cubic_has_one_or_three_roots_and_they_solve_it() {
        let mut state = 11;
        let mut threes = 0;
        for i in 0..100_000 {
            let scale = 10f64.powi(i % 9 - 4);
            let a = (2.0 * uniform(&mut state) - 1.5) * scale * scale;
            let b = (2.0 * uniform(&mut state) - 1.0) * scale * scale * scale;
            let roots = depressed_cubic_roots(a, b);
            let three = -4.0 * a * a * a - 27.0 * b * b > 0.0;
            assert_eq!(roots.len(), if three { 3 } else { 1 }, "{a} {b}");
            threes += usize::from(three);
            for &x in roots.iter() {
                let size = x.abs().powi(3) + (a * x).abs() + b.abs();
                assert!(((x * x + a) * x + b).abs() < 1e-14 * size, "{a} {b} {x}");
            }
            assert!(roots.windows(2).all(|w| w[0] <= w[1]));
        }
        assert!(threes > 20_000);
    }

    #[test]
    fn special_depressed_cubics_are_solved() {
        assert_eq!(&*depressed_cubic_roots(0.0, 0.0), &[0.0]);
        assert_eq!(&*depressed_cubic_roots(5.0, 0.0), &[0.0]);
        assert_eq!(&*depressed_cubic_roots(-4.0, 0.0), &[-2.0, 0.0, 2.0]);
        let cube = depressed_cubic_roots(0.0, -27.0);
        assert!((cube[0] - 3.0).abs() < 1e-15 && cube.len() == 1);
        // (x - 1)²(x + 2)
        let double = depressed_cubic_roots(-3.0, 2.0);
        assert!((double[0] + 2.0).abs() < 1e-15);
        assert!(double[1..].iter().all(|x| (x - 1.0).abs() < 1e-7));
        assert!((depressed_cubic_roots(1e-20, 5e-30)[0] + 5e-10).abs() < 1e-9);
    }

    #[test]
    fn a_polynomial_that_keeps_its_sign_has_no_root() {
        fn check<const N: usize>(seed: u64) -> [u32; 2] {
            let mut state = seed;
            let mut counts = [0; 2];
            for _ in 0..4000 {
                let mut c: [f64; N] = std::array::from_fn(|_| 2.0 * uniform(&mut state) - 1.0);
                c[0] *= 4.0;
                let count = roots_between(&c, 0.0, 1.0).len();
                if keeps_sign(&c) {
                    assert_eq!(count, 0, "{c:?}");
                    counts[0] += 1;
                } else if count == 0 {
                    counts[1] += 1;
                }
            }
            counts
        }
        for [kept, missed] in [check::<4>(5), check::<7>(6)] {
            assert!(kept > 1500 && missed < kept / 5, "{kept} {missed}");
        }
        // x - 0, 1 - x and x² - x touch zero at an end.
        for c in [[0.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, -1.0, 1.0], [f64::NAN, 1.0, 1.0]] {
            assert!(!keeps_sign(&c), "{c:?}");
        }
    }

    #[test]
    fn odd_inputs_have_no_roots_and_no_panic() {
        assert!(roots_between(&[0.0; 5], -2.0, 3.0).is_empty());
        assert!(roots_between(&[1.0, f64::NAN, 2.0], -2.0, 3.0).is_empty());
        assert!(roots_between(&[1.0, 2.0, 3.0, 4.0], 3.0, -2.0).is_empty());
        assert!(roots_between(&[1.0, 2.0, 3.0, 4.0], f64::NAN, 2.0).is_empty());
        assert!(roots_between(&[7.0], -2.0, 3.0).is_empty());
        assert_eq!(&*roots_between(&[6.0, -3.0], -5.0, 5.0), &[2.0]);
        assert_eq!(&*roots_between(&[6.0, -3.0, 0.0, 0.0, 0.0], f64::NEG_INFINITY, f64::INFINITY), &[2.0]);
        assert!(quartic_roots_between(&[3.0, 0.0, 0.0, 0.0, 0.0], -5.0, 5.0).is_empty());
        assert_eq!(&*quartic_roots_between(&[6.0, -3.0, 0.0, 0.0, 0.0], -5.0, 5.0), &[2.0]);
    }

    #[test]
    fn touching_roots_with_exact_arithmetic_are_reported_once() {
        // (x² - 4)², and (x - 2)⁴
        assert_eq!(&*quartic_roots_between(&[16.0, 0.0, -8.0, 0.0, 1.0], -5.0, 5.0), &[-2.0, 2.0]);
        assert_eq!(&*roots_between(&[16.0, 0.0, -8.0, 0.0, 1.0], -5.0, 5.0), &[-2.0, 2.0]);
        assert_eq!(&*quartic_roots_between(&[16.0, -32.0, 24.0, -8.0, 1.0], -5.0, 5.0), &[2.0]);
    }

    #[test]
    fn the_ends_of_the_interval_belong_to_it() {
        let c = from_roots::<5>(3.0, &[-1.5, 0.5, 2.0, 2.5]);
        assert_eq!(&*roots_between(&c, -1.5, 2.0), &[-1.5, 0.5, 2.0]);
    }

    #[test]
    fn a_bracketed_root_is_found_even_with_a_useless_slope() {
        let cube_root = bracketed_root(-3.0, 7.0, 6.0, true, |x| (x * x * x - 5.0, 1e-30));
        assert!((cube_root - 5f64.cbrt()).abs() < 1e-14);
        let falling = bracketed_root(-3.0, 7.0, f64::NAN, false, |x| (2.5 - x, f64::NAN));
        assert!((falling - 2.5).abs() < 1e-14);
    }
}
