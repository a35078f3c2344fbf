//! Eigenvalues of real matrices, from the characteristic polynomial in exact arithmetic.
//!
//! The polynomial is split into factors whose roots are simple (by greatest common divisors, so that multiplicities are
//! exact), and their roots are found with values that are exact at each double. So every eigenvalue has nearly all
//! digits of a double, however close it is to another one.

use super::{Exact, Rows, exact_rows, expanded, times_power};
use crate::Elementary;

/// The eigenvalues of a real matrix, each as often as it is a root of the characteristic polynomial.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Eigenvalues {
    /// The real ones, in ascending order.
    pub real: Vec<f64>,
    /// The others come in pairs `a ± b i`: `[a, b]` with `b > 0`, in ascending order.
    pub pairs: Vec<[f64; 2]>,
}

/// Coefficients, that of the constant first; the last one is not 0.
type Polynomial = Vec<Exact>;

/// A complex number: real and imaginary part.
type Complex = [f64; 2];

/// The eigenvalues of a matrix that is given by its rows. `None` where an entry is not finite.
pub fn eigenvalues<const N: usize>(rows: &[[f64; N]; N]) -> Option<Eigenvalues> {
    let mut m = exact_rows(rows)?;
    // The largest entry is near 1, so that no coefficient leaves the range of doubles.
    let power = m.iter().flatten().filter(|x| !x.is_zero()).map(|x| x.scientific().1).max().unwrap_or(0);
    m.iter_mut().flatten().filter(|x| !x.is_zero()).for_each(|x| x.exponent -= power);
    let mut all = Eigenvalues::default();
    for (factor, times) in simple_factors(characteristic(&m)) {
        let found = simple_roots(factor);
        for _ in 0..times {
            all.real.extend(found.real.iter().map(|x| times_power(*x, power)));
            all.pairs.extend(found.pairs.iter().map(|pair| pair.map(|x| times_power(x, power))));
        }
    }
    all.real.sort_by(f64::total_cmp);
    all.pairs.sort_by(|p, q| p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])));
    Some(all)
}

/// The coefficients of `det(λ I - M)`, that of the highest power (1) first: exact sums of minors, each rounded once.
/// `None` where an entry is not finite.
pub fn characteristic_polynomial<const N: usize>(rows: &[[f64; N]; N]) -> Option<Vec<f64>> {
    let exact = characteristic(&exact_rows(rows)?);
    Some(exact.iter().rev().map(Exact::rounded).collect())
}

/// Of `λ^(n-k)` it is the sum of all principal minors of size k, times `(-1)^k`.
fn characteristic(m: &Rows) -> Polynomial {
    let n = m.len();
    let mut coefficients = vec![Exact::ZERO; n + 1];
    for set in 0_u32..1 << n {
        let has = |i: usize| set >> i & 1 == 1;
        let kept = (0..n).filter(|&i| has(i));
        let minor = kept.map(|i| (0..n).filter(|&j| has(j)).map(|j| m[i][j].clone()).collect()).collect();
        let minor = expanded(&minor);
        let k = set.count_ones() as usize;
        coefficients[n - k] =
            coefficients[n - k].plus(&if k.is_multiple_of(2) { minor } else { minor.negated() });
    }
    coefficients
}

fn derivative(p: &Polynomial) -> Polynomial {
    p.iter().enumerate().skip(1).map(|(i, c)| c.times(&Exact::from(i as f64))).collect()
}

/// Quotient and rest of `c a` by `b`, for some number c that is not 0.
fn divided(a: &Polynomial, b: &Polynomial) -> (Polynomial, Polynomial) {
    let mut rest = a.clone();
    let mut quotient = vec![Exact::ZERO; (a.len() + 1).saturating_sub(b.len())];
    let Some(divisor) = b.last() else { return (quotient, rest) };
    while rest.len() >= b.len() {
        let shift = rest.len() - b.len();
        let Some(factor) = rest.last().cloned() else { break };
        quotient.iter_mut().for_each(|c| *c = c.times(divisor));
        quotient[shift] = quotient[shift].plus(&factor);
        let minus = factor.negated();
        for (i, c) in rest.iter_mut().enumerate() {
            *c = c.times(divisor);
            if i >= shift {
                *c = c.plus(&b[i - shift].times(&minus));
            }
        }
        while rest.last().is_some_and(Exact::is_zero) {
            rest.pop();
        }
    }
    (quotient, rest)
}

/// The greatest common divisor, up to a factor.
fn common(a: &Polynomial, b: &Polynomial) -> Polynomial {
    let (mut a, mut b) = (a.clone(), b.clone());
    while !b.is_empty() {
        let (_, rest) = divided(&a, &b);
        (a, b) = (b, rest);
    }
    a
}

/// Factors without a multiple root, each with how often its roots are those of `p`.
fn simple_factors(p: Polynomial) -> Vec<(Polynomial, usize)> {
    if p.len() < 2 {
        return Vec::new();
    }
    // Each root once less.
    let fewer = common(&p, &derivative(&p));
    if fewer.len() == 1 {
        return vec![(p, 1)];
    }
    let (distinct, _) = divided(&p, &fewer);
    let (simple, _) = divided(&distinct, &common(&distinct, &fewer));
    let single = (simple.len() > 1).then_some((simple, 1));
    let multiple = simple_factors(fewer).into_iter().map(|(factor, times)| (factor, times + 1));
    single.into_iter().chain(multiple).collect()
}

/// The roots of a polynomial whose roots are simple.
fn simple_roots(mut p: Polynomial) -> Eigenvalues {
    let mut found = Eigenvalues::default();
    if p.first().is_some_and(Exact::is_zero) {
        found.real.push(0.0);
        p.remove(0);
    }
    let mut others = Eigenvalues::default();
    match &p[..] {
        [c, b] => others.real.push(-c.over(b)),
        [c, b, a] => quadratic_roots([a, b, c], &mut others),
        [_, _, _, _, ..] => higher_roots(&p, &mut others),
        _ => {}
    }
    // A last step with exact values, where the quotients above are off by a unit in the last place.
    found.real.extend(others.real.iter().map(|&x| minus([x, 0.0], newton_step(&p, [x, 0.0]))[0]));
    found.pairs.extend(others.pairs.iter().map(|&pair| minus(pair, newton_step(&p, pair))));
    found
}

/// Of `a x² + b x + c`, with an exact discriminant.
fn quadratic_roots([a, b, c]: [&Exact; 3], found: &mut Eigenvalues) {
    let twice = a.plus(a);
    let discriminant = b.times(b).plus(&twice.plus(&twice).times(c).negated());
    let (middle, square) = (-b.over(&twice), discriminant.over(&twice.times(&twice)));
    if square < 0.0 {
        found.pairs.push([middle, (-square).sqrt()]);
        return;
    }
    // The root on the side of the middle, where nothing cancels, and the other one by the product of both.
    let far = middle + square.sqrt().copysign(middle);
    found.real.extend([far, c.over(a) / far]);
}

/// Of degree 3 and more: all at once, by O. Aberth, "Iteration methods for finding all zeros of a polynomial
/// simultaneously", Mathematics of Computation, 1973.
fn higher_roots(p: &Polynomial, found: &mut Eigenvalues) {
    let degree = p.len() - 1;
    let lead = &p[degree];
    let bound = |(i, c): (usize, &Exact)| c.over(lead).abs().power(1.0 / (degree - i) as f64);
    let radius = p[..degree].iter().enumerate().map(bound).fold(0.0, f64::max);
    let start = |k: usize| {
        let (sin, cos) = crate::transform::sin_cos_degrees(20.0 + 360.0 * k as f64 / degree as f64);
        [radius * cos, radius * sin]
    };
    let mut roots: Vec<Complex> = (0..degree).map(start).collect();
    for _ in 0..200 {
        let mut is_done = true;
        for k in 0..degree {
            let step = newton_step(p, roots[k]);
            let others = (0..degree).filter(|&j| j != k).map(|j| minus(roots[k], roots[j]));
            let pull = others.fold([0.0; 2], |sum, gap| plus(sum, over([1.0, 0.0], gap)));
            let step = over(step, minus([1.0, 0.0], times(step, pull)));
            if !step[0].is_finite() || !step[1].is_finite() {
                // Two in one place, or a place without slope: anywhere else will do.
                roots[k] = plus(roots[k], [0.01 * radius, 0.013 * radius]);
                is_done = false;
                continue;
            }
            roots[k] = minus(roots[k], step);
            is_done &= size(step) <= 2.0 * f64::EPSILON * size(roots[k]);
        }
        if is_done {
            break;
        }
    }
    for (k, &root) in roots.iter().enumerate() {
        let mirrored = [root[0], -root[1]];
        let own = size(minus(root, mirrored));
        let is_one_of_two = (0..degree).any(|j| j != k && size(minus(roots[j], mirrored)) < own);
        if !is_one_of_two {
            found.real.push(root[0]);
        } else if root[1] > 0.0 {
            found.pairs.push(root);
        }
    }
}

/// `p(z) / p'(z)`, each of them exact.
fn newton_step(p: &Polynomial, z: Complex) -> Complex {
    let z = z.map(|part| if part.is_finite() { Exact::from(part) } else { Exact::ZERO });
    let product = |[a, b]: &[Exact; 2]| {
        [a.times(&z[0]).plus(&b.times(&z[1]).negated()), a.times(&z[1]).plus(&b.times(&z[0]))]
    };
    let (mut value, mut slope) = ([Exact::ZERO, Exact::ZERO], [Exact::ZERO, Exact::ZERO]);
    for c in p.iter().rev() {
        let raised = product(&slope);
        slope = [raised[0].plus(&value[0]), raised[1].plus(&value[1])];
        let raised = product(&value);
        value = [raised[0].plus(c), raised[1].clone()];
    }
    let square = slope[0].times(&slope[0]).plus(&slope[1].times(&slope[1]));
    if square.is_zero() {
        return [f64::NAN; 2];
    }
    let real = value[0].times(&slope[0]).plus(&value[1].times(&slope[1]));
    let imaginary = value[1].times(&slope[0]).plus(&value[0].times(&slope[1]).negated());
    [real.over(&square), imaginary.over(&square)]
}

fn plus(a: Complex, b: Complex) -> Complex {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: Complex, b: Complex) -> Complex {
    [a[0] - b[0], a[1] - b[1]]
}

fn times(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn over(a: Complex, b: Complex) -> Complex {
    let square = b[0] * b[0] + b[1] * b[1];
    [(a[0] * b[0] + a[1] * b[1]) / square, (a[1] * b[0] - a[0] * b[1]) / square]
}

fn size(a: Complex) -> f64 {
    a[0].hypotenuse(a[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    fn of<const N: usize>(rows: [[f64; N]; N]) -> Eigenvalues {
        eigenvalues(&rows).unwrap()
    }

    #[test]
    fn eigenvalues_of_schoolbook_matrices_are_exact() {
        let real = |values: &[f64]| Eigenvalues { real: values.to_vec(), pairs: vec![] };
        assert_eq!(of([[-7.5]]), real(&[-7.5]));
        assert_eq!(of([[2.0, 1.0], [1.0, 2.0]]), real(&[1.0, 3.0]));
        assert_eq!(of([[1.0, 1.0], [0.0, 1.0]]), real(&[1.0, 1.0]));
        assert_eq!(of([[1.0, 2.0], [2.0, 4.0]]), real(&[0.0, 5.0]));
        assert_eq!(of([[2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 2.0]]), real(&[1.0, 1.0, 4.0]));
        // A Jordan block has one eigenvalue three times.
        assert_eq!(of([[0.1, 1.0, 0.0], [0.0, 0.1, 1.0], [0.0, 0.0, 0.1]]), real(&[0.1; 3]));
        assert_eq!(of([[0.0; 4]; 4]), real(&[0.0; 4]));
        let quarter_turn = of([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(quarter_turn, Eigenvalues { real: vec![1.0], pairs: vec![[0.0, 1.0]] });
        // The companion matrix of (λ² + 4)².
        let twice =
            of([[0.0, 0.0, 0.0, -16.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -8.0], [0.0, 0.0, 1.0, 0.0]]);
        assert_eq!(twice, Eigenvalues { real: vec![], pairs: vec![[0.0, 2.0]; 2] });
        assert_eq!(eigenvalues(&[[f64::INFINITY]]), None);
        assert_eq!(characteristic_polynomial(&[[2.0, 1.0], [1.0, 2.0]]), Some(vec![1.0, -4.0, 3.0]));
    }

    #[test]
    fn close_eigenvalues_and_those_of_any_size_keep_their_digits() {
        // (λ - 1)(λ - 1 - tiny)(λ + 3)(λ - 8), by the companion matrix of each factor and a change of basis.
        for k in [4, 20, 40, 50] {
            let tiny = f64::from_bits((1023 - k) << 52);
            let m = [
                [1.0, 5.0, -2.0, 7.0],
                [0.0, 1.0 + tiny, 3.0, 1.0],
                [0.0, 0.0, -3.0, 0.5],
                [0.0, 0.0, 0.0, 8.0],
            ];
            assert_eq!(of(m).real, [-3.0, 1.0, 1.0 + tiny, 8.0], "{k}");
        }
        for size in [1e-200, 1e200] {
            let found = of([[2.0 * size, size], [size, 2.0 * size]]).real;
            assert!(
                found.iter().zip([1.0, 3.0]).all(|(x, e)| (x / size / e - 1.0).abs() < 1e-15),
                "{found:?}"
            );
        }
        // The Hilbert matrix of 4, to 17 digits (by arithmetic with 60 digits).
        let hilbert = std::array::from_fn(|i| std::array::from_fn(|j| 1.0 / (1 + i + j) as f64));
        let found = of::<4>(hilbert).real;
        let sum: f64 = found.iter().sum();
        assert!((sum - (1.0 + 1.0 / 3.0 + 0.2 + 1.0 / 7.0)).abs() < 1e-15);
        let product: f64 = found.iter().product();
        assert!((product / super::super::determinant(&hilbert) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn integer_matrices_have_the_eigenvalues_they_are_made_of() {
        let mut random = RandomStream::new(7);
        let (mut multiple, mut complex) = (0, 0);
        for _ in 0..400 {
            let mut whole = |most: usize| random.next_below(2 * most + 1) as f64 - most as f64;
            // Blocks on the diagonal: two numbers, or a ± b i.
            let [a, b, c, d] = [whole(3), whole(3), whole(3), whole(3)];
            let has_pair = whole(1) > 0.0 && b != 0.0;
            let first = if has_pair { [[a, -b], [b, a]] } else { [[a, whole(2)], [0.0, b]] };
            let mut m = [[0.0; 4]; 4];
            m[0][..2].copy_from_slice(&first[0]);
            m[1][..2].copy_from_slice(&first[1]);
            (m[2][2], m[2][3], m[3][3]) = (c, whole(2), d);
            // Steps that keep the eigenvalues and whole numbers: row i plus f times row j, column j minus f times i.
            for _ in 0..5 {
                let (i, f) = (random.next_below(4), random.next_below(5) as f64 - 2.0);
                let j = (i + 1 + random.next_below(3)) % 4;
                let added = m[j];
                for (x, y) in m[i].iter_mut().zip(added) {
                    *x += f * y;
                }
                for row in &mut m {
                    row[j] -= f * row[i];
                }
            }
            let mut expected = if has_pair { vec![c, d] } else { vec![a, b, c, d] };
            expected.sort_by(f64::total_cmp);
            let found = of(m);
            assert_eq!(found.real.len(), expected.len(), "{m:?}: {found:?}");
            for (x, e) in found.real.iter().zip(&expected) {
                assert!((x - e).abs() <= 2e-15 * e.abs().max(1.0), "{m:?}: {found:?}, not {expected:?}");
            }
            if has_pair {
                let [[x, y]] = found.pairs[..] else { panic!("{m:?}: {found:?}") };
                assert!((x - a).abs() < 1e-14 && (y - b.abs()).abs() < 1e-14, "{m:?}: {found:?}");
            }
            complex += usize::from(has_pair);
            multiple += usize::from(expected.windows(2).any(|pair| pair[0] == pair[1]));
        }
        assert!(multiple > 100 && complex > 80, "{multiple} {complex}");
    }
}
