//! Quadratic equations without cancellation.

/// `a * b - c * d` with a relative error of at most 2⁻⁵², however nearly the products cancel; its sign is
/// always right.
///
/// The exact rounding errors of both products are added to the difference of the rounded products: the method
/// of Cornea, Harrison and Tang, with the bound of C.-P. Jeannerod, "A radix-independent error analysis of the
/// Cornea–Harrison–Tang method", ACM Transactions on Mathematical Software, 2016. Kahan's better known form is
/// slightly cheaper, but needs a fused multiply-add; this one returns the same bits with and without.
#[inline]
pub fn dop(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let (ab, ab_error) = two_product(a, b);
    let (cd, cd_error) = two_product(c, d);
    let refined = (ab - cd) + (ab_error - cd_error);
    // Splitting overflows slightly before the product does.
    if refined.is_finite() { refined } else { a * b - c * d }
}

/// `a * b` rounded, and the rounding error; their sum is exact barring overflow and underflow.
///
/// T. J. Dekker, "A floating-point technique for extending the available precision", Numerische Mathematik, 1971.
#[inline]
#[allow(clippy::disallowed_methods, reason = "only where it is an instruction")]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    #[cfg(target_feature = "fma")]
    {
        (product, a.mul_add(b, -product))
    }
    #[cfg(not(target_feature = "fma"))]
    {
        let (a_high, a_low) = split(a);
        let (b_high, b_low) = split(b);
        let error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low);
        (product, error)
    }
}

/// Halves of the significand, which multiply without rounding.
#[cfg(not(target_feature = "fma"))]
#[inline]
fn split(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// The roots of `a t² + 2 h t + c = 0` in ascending order, given `delta = h² - a c` in a form free of
/// cancellation.
///
/// `None` when `delta` is negative or anything is NaN, or when `a` and `h` are both zero. As `a` goes to zero
/// one root goes to ±∞ and the other to `-c / 2h`, without a special case. A double root comes twice.
///
/// The only subtraction of nearly equal numbers is inside `delta`, which callers compute accurately: see W. H.
/// Press et al., "Numerical Recipes", section 5.6.
#[inline(always)]
pub fn quadratic(a: f64, h: f64, c: f64, delta: f64) -> Option<(f64, f64)> {
    if delta.is_nan() || delta < 0.0 {
        return None;
    }
    if delta == 0.0 {
        // Both roots are their mean; c, which may carry rounding errors, is not used.
        let double = -h / a;
        return double.is_finite().then_some((double, double));
    }
    let q = -(h + delta.sqrt().copysign(h));
    let (first, second) = (q / a, c / q);
    if first.is_nan() || second.is_nan() {
        return None;
    }
    Some(if first <= second { (first, second) } else { (second, first) })
}

/// The real roots of `a t² + b t + c = 0` in ascending order, a double root twice; none where there is none, or where
/// all of `t` are. With `a` zero, the root of the linear equation comes alone.
///
/// The discriminant `b² - 4 a c` is computed to all of its digits ([`dop`]), so that nearly equal roots are
/// distinguished and the number of roots is right.
pub fn roots_of(a: f64, b: f64, c: f64) -> Vec<f64> {
    if a == 0.0 {
        let root = -c / b;
        return root.is_finite().then_some(root).into_iter().collect();
    }
    let h = 0.5 * b;
    match quadratic(a, h, c, dop(h, h, a, c)) {
        Some((first, second)) => [first, second].into_iter().filter(|root| root.is_finite()).collect(),
        None => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_of_nearly_equal_products_keeps_its_digits() {
        let (a, b) = (1.0 + f64::EPSILON, 1.0 - f64::EPSILON);
        assert_eq!(a * b - 1.0, 0.0);
        assert_eq!(dop(a, b, 1.0, 1.0), -f64::EPSILON * f64::EPSILON);
        assert_eq!(dop(3e200, 7e200, 1e200, 1e-199), f64::INFINITY);
        let huge = 2f64.powi(1015);
        assert_eq!(dop(huge, 5.0, huge, 3.0), 2.0 * huge);
    }

    #[test]
    fn roots_of_very_different_size_both_come_out() {
        // (t - 1e-9)(t - 1e9)
        let (a, h, c) = (1.0, -0.5 * (1e9 + 1e-9), 1.0);
        let (low, high) = quadratic(a, h, c, dop(h, h, a, c)).unwrap();
        assert!((low - 1e-9).abs() < 1e-24 && (high - 1e9).abs() < 1e-6);
    }

    #[test]
    fn a_vanishing_leading_coefficient_sends_one_root_to_infinity() {
        let (low, high) = quadratic(0.0, -2.0, 12.0, 4.0).unwrap();
        assert_eq!((low, high), (3.0, f64::INFINITY));
        assert_eq!(quadratic(0.0, 0.0, 5.0, 0.0), None);
    }

    #[test]
    fn a_double_root_comes_twice_and_a_complex_pair_not_at_all() {
        assert_eq!(quadratic(2.0, -6.0, 18.0, 0.0), Some((3.0, 3.0)));
        assert_eq!(quadratic(2.0, 0.0, 0.0, 0.0), Some((0.0, 0.0)));
        assert_eq!(quadratic(1.0, 0.0, 3.0, -3.0), None);
        assert_eq!(quadratic(1.0, f64::NAN, 3.0, f64::NAN), None);
    }

    #[test]
    fn an_equation_has_the_roots_that_its_coefficients_say() {
        let roots = roots_of;
        assert_eq!(roots(2.0, -14.0, 24.0), [3.0, 4.0]);
        assert_eq!(roots(-3.0, 0.0, 12.0), [-2.0, 2.0]);
        assert_eq!(roots(4.0, -12.0, 9.0), [1.5, 1.5]);
        assert_eq!(roots(0.0, -4.0, 10.0), [2.5]);
        assert_eq!(roots(5.0, 0.0, 0.0), [0.0, 0.0]);
        assert!(roots(1.0, 2.0, 3.0).is_empty());
        assert!(roots(0.0, 0.0, 7.0).is_empty() && roots(0.0, 0.0, 0.0).is_empty());
        assert!(roots(f64::NAN, 1.0, 1.0).is_empty());
        // Roots that differ in the last digits only.
        let [first, second] = roots(1.0, -(2.0 + 2f64.powi(-26)), 1.0 + 2f64.powi(-26))[..] else { panic!() };
        assert_eq!((first, second), (1.0, 1.0 + 2f64.powi(-26)));
    }
}
