//! Determinants, inverses and linear equations in exact arithmetic: a matrix is singular where its determinant is 0,
//! and nowhere else.
//!
//! Every double is a whole number times a power of two, and so are their sums and products. Such numbers are kept here
//! in full; only a result is rounded. That costs microseconds, which is fine for a single matrix: what renders uses
//! [`Transform`](crate::Transform).

mod eigen;

pub use eigen::{Eigenvalues, characteristic_polynomial, eigenvalues};

/// A whole number times a power of two.
#[derive(Clone, Debug, PartialEq)]
struct Exact {
    is_negative: bool,
    /// Digits of 32 bits, the least first, without zeros at the end; none for 0.
    digits: Vec<u32>,
    /// The power of two that the digits are multiplied by.
    exponent: i64,
}

impl Exact {
    const ZERO: Self = Self { is_negative: false, digits: Vec::new(), exponent: 0 };

    fn one() -> Self {
        Self::from(1.0)
    }

    fn is_zero(&self) -> bool {
        self.digits.is_empty()
    }

    fn negated(mut self) -> Self {
        self.is_negative = !self.is_negative;
        self
    }

    fn times(&self, other: &Self) -> Self {
        let mut digits = vec![0_u32; self.digits.len() + other.digits.len()];
        for (i, x) in self.digits.iter().enumerate() {
            let mut carry = 0_u64;
            for (j, y) in other.digits.iter().enumerate() {
                let sum = u64::from(*x) * u64::from(*y) + u64::from(digits[i + j]) + carry;
                digits[i + j] = sum as u32;
                carry = sum >> 32;
            }
            digits[i + other.digits.len()] = carry as u32;
        }
        let exponent = self.exponent + other.exponent;
        Self { is_negative: self.is_negative != other.is_negative, digits, exponent }.trimmed()
    }

    fn plus(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() { other.clone() } else { self.clone() };
        }
        let exponent = self.exponent.min(other.exponent);
        let (a, b) = (self.raised(exponent), other.raised(exponent));
        if self.is_negative == other.is_negative {
            return Self { is_negative: self.is_negative, digits: sum(&a, &b), exponent }.trimmed();
        }
        let (larger, smaller, is_negative) =
            if is_less(&a, &b) { (b, a, other.is_negative) } else { (a, b, self.is_negative) };
        Self { is_negative, digits: difference(&larger, &smaller), exponent }.trimmed()
    }

    /// The digits for a smaller exponent.
    fn raised(&self, exponent: i64) -> Vec<u32> {
        let by = (self.exponent - exponent) as usize;
        let (whole, bits) = (by / 32, by % 32);
        let mut digits = vec![0; whole];
        let mut carry = 0_u64;
        for digit in &self.digits {
            let shifted = u64::from(*digit) << bits | carry;
            digits.push(shifted as u32);
            carry = shifted >> 32;
        }
        digits.push(carry as u32);
        digits
    }

    fn trimmed(mut self) -> Self {
        while self.digits.last() == Some(&0) {
            self.digits.pop();
        }
        // Whole digits of zeros below are an exponent.
        let zeros = self.digits.iter().take_while(|digit| **digit == 0).count();
        self.digits.drain(..zeros);
        self.exponent = if self.digits.is_empty() { 0 } else { self.exponent + 32 * zeros as i64 };
        self.is_negative &= !self.digits.is_empty();
        self
    }

    /// The number as `m · 2^e` with `|m|` rounded to nearest, in [1, 2], or 0.
    fn scientific(&self) -> (f64, i64) {
        let Some(top) = self.digits.last() else { return (0.0, 0) };
        let bits = 32 * self.digits.len() as i64 - i64::from(top.leading_zeros());
        // The first 64 bits; whether anything but zeros follows decides a tie.
        let at = |bit: i64| bit >= 0 && self.digits[(bit / 32) as usize] >> (bit % 32) & 1 == 1;
        let mut leading = (0..64).fold(0_u64, |leading, i| leading << 1 | u64::from(at(bits - 1 - i)));
        if (0..(bits - 64).max(0)).any(at) {
            leading |= 1;
        }
        // 64 bits to 53, once.
        let size = leading as f64 * f64::from_bits((1023 - 63) << 52);
        (if self.is_negative { -size } else { size }, self.exponent + bits - 1)
    }

    fn rounded(&self) -> f64 {
        let (m, e) = self.scientific();
        times_power(m, e)
    }

    /// The quotient, to 1.5 units in the last place, where the divisor is not 0.
    fn over(&self, divisor: &Self) -> f64 {
        let ((m, e), (n, f)) = (self.scientific(), divisor.scientific());
        times_power(m / n, e - f)
    }
}

impl From<f64> for Exact {
    /// Of a finite number.
    fn from(x: f64) -> Self {
        let bits = x.to_bits();
        let biased = (bits >> 52 & 0x7ff) as i64;
        let fraction = bits & ((1 << 52) - 1);
        let (whole, exponent) =
            if biased == 0 { (fraction, -1074) } else { (fraction | 1 << 52, biased - 1075) };
        Self { is_negative: x < 0.0, digits: vec![whole as u32, (whole >> 32) as u32], exponent }.trimmed()
    }
}

fn is_less(a: &[u32], b: &[u32]) -> bool {
    let at = |digits: &[u32], i: usize| digits.get(i).copied().unwrap_or(0);
    let first = (0..a.len().max(b.len())).rev().find(|&i| at(a, i) != at(b, i));
    first.is_some_and(|i| at(a, i) < at(b, i))
}

fn sum(a: &[u32], b: &[u32]) -> Vec<u32> {
    let at = |digits: &[u32], i: usize| u64::from(digits.get(i).copied().unwrap_or(0));
    let mut carry = 0;
    let mut digits: Vec<u32> = Vec::with_capacity(a.len().max(b.len()) + 1);
    for i in 0..a.len().max(b.len()) {
        let sum = at(a, i) + at(b, i) + carry;
        digits.push(sum as u32);
        carry = sum >> 32;
    }
    digits.push(carry as u32);
    digits
}

/// `a - b`, where `a` is not less.
fn difference(a: &[u32], b: &[u32]) -> Vec<u32> {
    let mut is_borrowed = false;
    let subtract = |(i, digit): (usize, &u32)| {
        let (once, first) = digit.overflowing_sub(b.get(i).copied().unwrap_or(0));
        let (twice, second) = once.overflowing_sub(u32::from(is_borrowed));
        is_borrowed = first || second;
        twice
    };
    a.iter().enumerate().map(subtract).collect()
}

/// `m · 2^e`, rounded.
fn times_power(m: f64, e: i64) -> f64 {
    let power = |e: i64| f64::from_bits(((e + 1023) as u64) << 52);
    let e = e.clamp(-2200, 2200);
    // All steps but the last are exact for a subnormal result, since the factor of the last is the least.
    if e > 1000 {
        m * power(1000) * power((e - 1000).min(1000)) * power((e - 2000).max(0))
    } else if e < -1000 {
        let half = (e + 1000) / 2;
        m * power(half) * power(e + 1000 - half) * power(-1000)
    } else {
        m * power(e)
    }
}

type Rows = Vec<Vec<Exact>>;

fn exact_rows<const N: usize>(rows: &[[f64; N]]) -> Option<Rows> {
    let is_finite = rows.iter().flatten().all(|x| x.is_finite());
    is_finite.then(|| rows.iter().map(|row| row.iter().map(|x| Exact::from(*x)).collect()).collect())
}

/// By the entries of the first row, each with the determinant of what is left without its row and column.
fn expanded(m: &Rows) -> Exact {
    let Some(first) = m.first() else { return Exact::one() };
    first.iter().enumerate().fold(Exact::ZERO, |sum, (j, entry)| {
        if entry.is_zero() {
            return sum;
        }
        let part = entry.times(&expanded(&without(m, 0, j)));
        sum.plus(&if j % 2 == 0 { part } else { part.negated() })
    })
}

/// The matrix without a row and a column.
fn without(m: &Rows, row: usize, column: usize) -> Rows {
    let rest = m.iter().enumerate().filter(|(i, _)| *i != row);
    rest.map(|(_, entries)| {
        let kept = entries.iter().enumerate().filter(|(j, _)| *j != column);
        kept.map(|(_, entry)| entry.clone()).collect()
    })
    .collect()
}

fn cofactor(m: &Rows, row: usize, column: usize) -> Exact {
    let minor = expanded(&without(m, row, column));
    if (row + column).is_multiple_of(2) { minor } else { minor.negated() }
}

/// The determinant of a matrix given by its rows: exact, rounded once. It is 0 only if the matrix is singular, or if
/// the determinant is less than the least double. NaN where an entry is not finite, infinite where it is beyond all
/// doubles.
pub fn determinant<const N: usize>(rows: &[[f64; N]; N]) -> f64 {
    exact_rows(rows).map_or(f64::NAN, |m| expanded(&m).rounded())
}

/// Whether the determinant is 0, exactly.
pub fn is_singular<const N: usize>(rows: &[[f64; N]; N]) -> bool {
    exact_rows(rows).is_none_or(|m| expanded(&m).is_zero())
}

/// The cofactors: `C[i][j]` is `(-1)^(i+j)` times the determinant without row i and column j, exact and rounded once.
/// `None` where an entry is not finite.
pub fn cofactors<const N: usize>(rows: &[[f64; N]; N]) -> Option<[[f64; N]; N]> {
    let m = exact_rows(rows)?;
    Some(std::array::from_fn(|i| std::array::from_fn(|j| cofactor(&m, i, j).rounded())))
}

/// The inverse, `Cᵀ / det` with the cofactors `C`: each entry is within 1.5 units in its last place, however nearly the
/// matrix is singular. `None` for a singular matrix, and where anything is not finite.
pub fn inverse<const N: usize>(rows: &[[f64; N]; N]) -> Option<[[f64; N]; N]> {
    let m = exact_rows(rows)?;
    let whole = expanded(&m);
    if whole.is_zero() {
        return None;
    }
    let inverse: [[f64; N]; N] =
        std::array::from_fn(|i| std::array::from_fn(|j| cofactor(&m, j, i).over(&whole)));
    inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
}

/// What solves the equations `M x = b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solutions<const N: usize> {
    /// One x, each component within 1.5 units in its last place.
    One([f64; N]),
    /// None: the equations contradict one another.
    None,
    /// More than one: the equations do not say enough.
    Many,
    /// Something in it is not finite, or would not be.
    NotFinite,
}

/// Solves `M x = b` for a matrix that is given by its rows, by Cramer's rule in exact arithmetic: each component is the
/// determinant with that column replaced by `b`, over that of `M`.
pub fn solve<const N: usize>(rows: &[[f64; N]; N], b: &[f64; N]) -> Solutions<N> {
    let (Some(m), Some(right)) = (exact_rows(rows), exact_rows(&[*b])) else { return Solutions::NotFinite };
    let replaced = |column: usize| -> Rows {
        let mut replaced = m.clone();
        replaced.iter_mut().zip(&right[0]).for_each(|(row, entry)| row[column] = entry.clone());
        replaced
    };
    let whole = expanded(&m);
    if !whole.is_zero() {
        let x: [f64; N] = std::array::from_fn(|i| expanded(&replaced(i)).over(&whole));
        return if x.iter().all(|x| x.is_finite()) { Solutions::One(x) } else { Solutions::NotFinite };
    }
    let mut extended = m.clone();
    extended.iter_mut().zip(&right[0]).for_each(|(row, entry)| row.push(entry.clone()));
    if exact_rank(extended) > exact_rank(m) { Solutions::None } else { Solutions::Many }
}

/// The determinants of `M` with each column in turn replaced by `b`, exact and rounded once: the numerators of Cramer's
/// rule. `None` where anything is not finite.
pub fn numerators<const N: usize>(rows: &[[f64; N]; N], b: &[f64; N]) -> Option<[f64; N]> {
    let is_finite = rows.iter().flatten().chain(b).all(|x| x.is_finite());
    is_finite.then(|| {
        std::array::from_fn(|column| {
            let mut replaced = *rows;
            replaced.iter_mut().zip(b).for_each(|(row, entry)| row[column] = *entry);
            determinant(&replaced)
        })
    })
}

/// How many rows, and how many columns, are independent. 0 where an entry is not finite.
pub fn rank<const R: usize, const C: usize>(rows: &[[f64; C]; R]) -> usize {
    exact_rows(rows).map_or(0, exact_rank)
}

/// By elimination without quotients.
fn exact_rank(mut m: Rows) -> usize {
    let columns = m.first().map_or(0, Vec::len);
    let mut rank = 0;
    for column in 0..columns {
        let Some(pivot) = (rank..m.len()).find(|&i| !m[i][column].is_zero()) else { continue };
        m.swap(rank, pivot);
        let top = m[rank].clone();
        for row in &mut m[rank + 1..] {
            let factor = row[column].clone().negated();
            for (entry, above) in row.iter_mut().zip(&top) {
                *entry = entry.times(&top[column]).plus(&above.times(&factor));
            }
        }
        rank += 1;
    }
    rank
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;

    /// A determinant in whole numbers, another way: Bareiss' elimination.
    fn whole<const N: usize>(rows: &[[i64; N]; N]) -> i128 {
        let mut m = rows.map(|row| row.map(i128::from));
        let (mut sign, mut last) = (1, 1);
        for k in 0..N - 1 {
            let Some(pivot) = (k..N).find(|&i| m[i][k] != 0) else { return 0 };
            if pivot != k {
                m.swap(pivot, k);
                sign = -sign;
            }
            for i in k + 1..N {
                for j in k + 1..N {
                    m[i][j] = (m[i][j] * m[k][k] - m[i][k] * m[k][j]) / last;
                }
            }
            last = m[k][k];
        }
        sign * m[N - 1][N - 1]
    }

    #[test]
    fn numbers_are_kept_in_full() {
        let mut random = RandomStream::new(4);
        for _ in 0..2_000 {
            let mut number = || {
                let size = times_power(1.0, (random.next_below(1900) as i64) - 950);
                (2.0 * random.next_f64() - 1.0) * size
            };
            let (a, b) = (number(), number());
            assert_eq!(Exact::from(a).rounded(), a);
            assert_eq!(Exact::from(a).plus(&Exact::from(b)).rounded(), a + b);
            let product = Exact::from(a).times(&Exact::from(b));
            assert_eq!(product.rounded(), a * b);
            assert!(product.plus(&Exact::from(-a).times(&Exact::from(b))).is_zero());
            assert!((product.over(&Exact::from(b)) / a - 1.0).abs() <= 2.0 * f64::EPSILON);
        }
        for x in [5e-324, -3e-320, f64::MAX, f64::MIN_POSITIVE, 0.0] {
            assert_eq!(Exact::from(x).rounded(), x);
        }
        assert_eq!(Exact::from(f64::MAX).times(&Exact::from(2.0)).rounded(), f64::INFINITY);
        assert_eq!(Exact::from(5e-324).times(&Exact::from(0.25)).rounded(), 0.0);
    }

    #[test]
    fn integer_matrices_match_exact_fractions() {
        let mut random = RandomStream::new(9);
        let (mut singular, mut none, mut many) = (0, 0, 0);
        for i in 0..3_000 {
            let most = [3, 1000, 1 << 20][i % 3];
            let mut number = || random.next_below(2 * most + 1) as i64 - most as i64;
            let mut m: [[i64; 4]; 4] = std::array::from_fn(|_| std::array::from_fn(|_| number()));
            if i % 4 == 0 {
                // The last row is a sum of others, so that nothing but exact sums sees that it is singular.
                let (p, q) = (number() % 3, number() % 3);
                m[3] = std::array::from_fn(|j| p * m[0][j] + q * m[1][j]);
            }
            let b: [i64; 4] = std::array::from_fn(|_| number());
            let expected = whole(&m);
            let (rows, right) = (m.map(|row| row.map(|x| x as f64)), b.map(|x| x as f64));
            let found = determinant(&rows);
            assert_eq!(found, expected as f64, "{m:?}");
            assert_eq!(is_singular(&rows), expected == 0);
            if expected == 0 {
                singular += 1;
                assert_eq!(inverse(&rows), None);
                match solve(&rows, &right) {
                    Solutions::None => none += 1,
                    Solutions::Many => many += 1,
                    other => panic!("{m:?}: {other:?}"),
                }
                // A multiple of a column is reached.
                assert_eq!(solve(&rows, &std::array::from_fn(|j| -2.0 * rows[j][1])), Solutions::Many);
                continue;
            }
            let Solutions::One(x) = solve(&rows, &right) else { panic!("{m:?}") };
            let inverse = inverse(&rows).unwrap();
            for column in 0..4 {
                let mut replaced = m;
                replaced.iter_mut().zip(b).for_each(|(row, entry)| row[column] = entry);
                let quotient = whole(&replaced) as f64 / expected as f64;
                assert!((x[column] - quotient).abs() <= 2.0 * f64::EPSILON * quotient.abs());
                let mut unit = m;
                unit.iter_mut().enumerate().for_each(|(i, row)| row[column] = i64::from(i == 2));
                let quotient = whole(&unit) as f64 / expected as f64;
                assert!((inverse[column][2] - quotient).abs() <= 2.0 * f64::EPSILON * quotient.abs());
            }
        }
        assert!(singular > 700 && none > 500 && many > 5, "{singular} {none} {many}");
    }

    #[test]
    fn ranks_are_those_of_sums_of_rows() {
        assert_eq!(rank(&[[0.0; 3]; 2]), 0);
        assert_eq!(rank(&[[0.1, 0.2, 0.3, 0.4], [0.2, 0.4, 0.6, 0.8]]), 1);
        assert_eq!(rank(&[[0.0, -0.3, 0.2], [0.3, 0.0, -0.1], [-0.2, 0.1, 0.0]]), 2);
        assert_eq!(rank(&[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), 2);
        assert_eq!(rank(&[[1e-300, 0.0], [0.0, 1e300]]), 2);
        assert_eq!(rank(&[[f64::NAN]]), 0);
    }

    #[test]
    fn nearly_singular_matrices_keep_every_digit() {
        for k in 1..52 {
            let tiny = f64::from_bits((1023 - k) << 52);
            let m = [[1.0, 1.0, 0.0], [1.0, 1.0 + tiny, 0.0], [0.25, -8.0, 3.0]];
            assert_eq!(determinant(&m), 3.0 * tiny);
            assert_eq!(solve(&m, &[2.0, 2.0 + tiny, -4.75]), Solutions::One([1.0, 1.0, 1.0]));
            assert_eq!(inverse(&m).unwrap()[0][0], (1.0 + tiny) / tiny);
        }
        // The cross product with a vector is singular, whatever its digits.
        let a = [0.1, 0.2, 0.3];
        let m = [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]];
        assert_eq!((determinant(&m), solve(&m, &[1.0, 2.0, 3.0])), (0.0, Solutions::None));
        assert_eq!(solve(&m, &[0.0; 3]), Solutions::Many);
        // Neither overflow nor underflow of the products.
        let m = [[1e200, 0.0], [0.0, 1e200]];
        assert_eq!(inverse(&m), Some([[1e-200, 0.0], [0.0, 1e-200]]));
        assert_eq!(solve(&m, &[1e200, 3e200]), Solutions::One([1.0, 3.0]));
        assert_eq!(determinant(&m), f64::INFINITY);
        assert!(!is_singular(&[[1e-200, 0.0], [0.0, 1e-200]]));
        assert_eq!(solve(&[[f64::NAN]], &[1.0]), Solutions::NotFinite);
        assert_eq!(solve(&[[-4.0]], &[2.0]), Solutions::One([-0.5]));
    }
}
