//! Elementary functions that give the same bits on every machine.

use glam::DVec2;

/// Sines, exponentials and their like, computed by the same operations everywhere; and what only some libraries round
/// correctly.
///
/// The methods of the standard library with the shorter names call the system's own, whose last digits differ from one
/// library to the next, and with the instruction set of the processor. Pictures are to have the same bytes on every
/// machine, so nothing that reaches a pixel calls those. Errors are below one unit in the last place for most
/// arguments, and nowhere above two.
pub trait Elementary: Copy {
    /// The sine of an angle in radians.
    fn sine(self) -> Self;
    /// The cosine of an angle in radians.
    fn cosine(self) -> Self;
    /// Both.
    fn sine_cosine(self) -> (Self, Self);
    /// The tangent of an angle in radians.
    fn tangent(self) -> Self;
    /// The angle in [-π/2, π/2] with this sine; NaN for arguments outside of [-1, 1].
    fn arc_sine(self) -> Self;
    /// The angle in [0, π] with this cosine; NaN for arguments outside of [-1, 1].
    fn arc_cosine(self) -> Self;
    /// The angle in [-π/2, π/2] with this tangent.
    fn arc_tangent(self) -> Self;
    /// The angle in [-π, π] from the positive x axis to the point (x, self).
    fn angle_from(self, x: Self) -> Self;
    /// e to this power.
    fn exponential(self) -> Self;
    /// `self.exponential() - 1`, also where that is small.
    fn exponential_minus_1(self) -> Self;
    /// 2 to this power.
    fn exponential_2(self) -> Self;
    /// The natural logarithm.
    fn logarithm(self) -> Self;
    /// The logarithm to base 2.
    fn logarithm_2(self) -> Self;
    /// The logarithm to base 10.
    fn logarithm_10(self) -> Self;
    /// This to a power.
    fn power(self, exponent: Self) -> Self;
    /// The cube root.
    fn cube_root(self) -> Self;
    /// The length of the vector (self, other), without overflow on the way.
    fn hypotenuse(self, other: Self) -> Self;
    /// The hyperbolic tangent.
    fn hyperbolic_tangent(self) -> Self;
    /// The number with this hyperbolic sine.
    fn inverse_hyperbolic_sine(self) -> Self;
    /// `self * factor + summand`, rounded once. MinGW's library rounds it twice.
    fn multiply_add(self, factor: Self, summand: Self) -> Self;
    /// The nearest whole number; halves go away from 0. MinGW's library takes the number below 1/2 to 1.
    fn rounded(self) -> Self;
}

/// The unit vector at an angle in radians from the x axis towards the y axis.
#[inline]
pub fn direction_at(angle: f64) -> DVec2 {
    let (sine, cosine) = angle.sine_cosine();
    DVec2::new(cosine, sine)
}

macro_rules! elementary {
    ($scalar:ident: $($method:ident = $function:ident($($argument:ident),*)),+; $both:ident) => {
        impl Elementary for $scalar {
            $(
                #[inline]
                fn $method(self $(, $argument: Self)*) -> Self {
                    libm::$function(self $(, $argument)*)
                }
            )*
            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                libm::$both(self)
            }
        }
    };
}

elementary! { f32:
    sine = sinf(), cosine = cosf(), tangent = tanf(), arc_sine = asinf(), arc_cosine = acosf(), arc_tangent = atanf(),
    angle_from = atan2f(x), exponential = expf(), exponential_minus_1 = expm1f(), exponential_2 = exp2f(),
    logarithm = logf(), logarithm_2 = log2f(), logarithm_10 = log10f(), power = powf(exponent), cube_root = cbrtf(),
    hypotenuse = hypotf(other), hyperbolic_tangent = tanhf(),
    inverse_hyperbolic_sine = asinhf(), multiply_add = fmaf(factor, summand), rounded = roundf(); sincosf
}

elementary! { f64:
    sine = sin(), cosine = cos(), tangent = tan(), arc_sine = asin(), arc_cosine = acos(), arc_tangent = atan(),
    angle_from = atan2(x), exponential = exp(), exponential_minus_1 = expm1(), exponential_2 = exp2(),
    logarithm = log(), logarithm_2 = log2(), logarithm_10 = log10(), power = pow(exponent), cube_root = cbrt(),
    hypotenuse = hypot(other), hyperbolic_tangent = tanh(),
    inverse_hyperbolic_sine = asinh(), multiply_add = fma(factor, summand), rounded = round(); sincos
}

#[cfg(test)]
mod tests {
    use super::Elementary;
    use crate::random::RandomStream;

    /// What the functions of arguments all over their ranges are, as one hash: another system, processor or compiler
    /// gives the same.
    #[test]
    fn the_bits_are_those_of_every_machine() {
        let mut random = RandomStream::new(11);
        let mut hash = 0;
        for _ in 0..20_000 {
            let unit = 2.0 * random.next_f64() - 1.0;
            let wide = unit * 40.0;
            let positive = (wide + 40.5).max(1e-3);
            let (sine, cosine) = wide.sine_cosine();
            assert_eq!((sine, cosine), (wide.sine(), wide.cosine()));
            let doubles = [
                sine,
                cosine,
                wide.tangent(),
                unit.arc_sine(),
                unit.arc_cosine(),
                wide.arc_tangent(),
                wide.angle_from(unit),
                wide.exponential(),
                unit.exponential_minus_1(),
                wide.exponential_2(),
                positive.logarithm(),
                positive.logarithm_2(),
                positive.logarithm_10(),
                positive.power(unit),
                wide.cube_root(),
                wide.hypotenuse(unit),
                unit.hyperbolic_tangent(),
            ];
            hash = crate::random::combine(hash, crate::random::hash_f64s(&doubles));
            let (unit, wide, positive) = (unit as f32, wide as f32, positive as f32);
            let singles = [
                wide.sine(),
                wide.cosine(),
                unit.arc_sine(),
                wide.angle_from(unit),
                wide.exponential(),
                positive.logarithm(),
                positive.power(unit),
            ];
            hash = crate::random::combine(hash, crate::random::hash_f32s(&singles));
        }
        assert_eq!(hash, 16_064_976_216_142_360_282);
    }

    #[test]
    fn products_and_sums_are_rounded_once() {
        // 1 + 2⁻⁵³ + 2⁻⁸⁰: the bits of a long double end in between, and the rest is a tie.
        assert_eq!((0.5_f64.powi(53)).multiply_add(1.0 + 0.5_f64.powi(27), 1.0), 1.0 + f64::EPSILON);
        assert_eq!((0.5_f32.powi(24)).multiply_add(1.0 + 0.5_f32.powi(20), 1.0), 1.0 + f32::EPSILON);
        // Sums of halves and these are not what they seem.
        assert_eq!(
            [0.5_f64.next_down().rounded(), 0.5_f64.rounded(), (-2.5_f64).rounded()],
            [0.0, 1.0, -3.0]
        );
        assert_eq!(
            [0.5_f32.next_down().rounded(), 0.5_f32.rounded(), (-2.5_f32).rounded()],
            [0.0, 1.0, -3.0]
        );
        assert_eq!((f64::EPSILON.recip() + 1.0).rounded(), f64::EPSILON.recip() + 1.0);
    }

    #[test]
    fn elementary_functions_match_the_standard_library() {
        let mut random = RandomStream::new(12);
        for _ in 0..20_000 {
            let unit = 2.0 * random.next_f64() - 1.0;
            let wide = unit * 40.0;
            let positive = (wide + 40.5).max(1e-3);
            for (ours, theirs) in [
                (wide.sine(), wide.sin()),
                (wide.cosine(), wide.cos()),
                (wide.tangent(), wide.tan()),
                (unit.arc_sine(), unit.asin()),
                (unit.arc_cosine(), unit.acos()),
                (wide.arc_tangent(), wide.atan()),
                (wide.angle_from(unit), wide.atan2(unit)),
                (wide.exponential(), wide.exp()),
                (unit.exponential_minus_1(), unit.exp_m1()),
                (wide.exponential_2(), wide.exp2()),
                (positive.logarithm(), positive.ln()),
                (positive.logarithm_2(), positive.log2()),
                (positive.logarithm_10(), positive.log10()),
                (positive.power(unit), positive.powf(unit)),
                (wide.cube_root(), wide.cbrt()),
                (wide.hypotenuse(unit), wide.hypot(unit)),
                (unit.hyperbolic_tangent(), unit.tanh()),
            ] {
                assert!(
                    (ours - theirs).abs() <= 4.0 * f64::EPSILON * theirs.abs(),
                    "{wide} {unit}: {ours} {theirs}"
                );
            }
        }
    }
}
