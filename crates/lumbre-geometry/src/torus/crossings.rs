//! The crossings of a line, in order: the first one by descent, all of them by monotone pieces of the quartic.

use lumbre_math::roots::{DepressedCubic, bracketed_root};

use super::Torus;
use super::line::Line;
use super::quartic::Quartic;

/// The state of the first crossing.
enum FirstCrossing {
    /// The descent has not been tried.
    NotSearched,
    /// The descent found it, and it was emitted.
    Emitted,
    /// The descent did not find it.
    NotFound,
}

/// The monotone pieces of the quartic, visited in order.
struct Pieces<'a, F> {
    torus: &'a Torus,
    line: &'a Line,
    quartic: Quartic,
    t_min: f64,
    first: FirstCrossing,
    emit: F,
    // The last point with a certain sign: its place, its sign, and the quartic there.
    left: (f64, f64, f64),
    // The splits since then at which the quartic vanishes: the first, the last, and their number.
    zeros: Option<(f64, f64, u8)>,
}

impl<F: FnMut(f64, u8) -> bool> Pieces<'_, F> {
    /// Advances to a root of the derivative; `None` when no more crossings are wanted.
    #[inline]
    fn advance_to_split(&mut self, split: f64) -> Option<()> {
        let split = if self.torus.is_thin() { self.torus.nearest_to_circle(self.line, split) } else { split };
        let is_within = self.line.low < split && split < self.line.high;
        if !is_within {
            return Some(());
        }
        let (sign, quartic) = self.torus.sign_and_quartic(self.line, split);
        if sign == 0.0 {
            self.zeros = Some(self.zeros.map_or((split, split, 1), |(first, _, n)| (first, split, n + 1)));
            return Some(());
        }
        self.advance_to(split, sign, quartic)
    }

    /// Advances to a point where the sign of the quartic is certain.
    #[inline]
    fn advance_to(&mut self, s: f64, sign: f64, quartic: f64) -> Option<()> {
        let left = std::mem::replace(&mut self.left, (s, sign, quartic));
        let first = if sign == left.1 {
            FirstCrossing::NotFound
        } else {
            std::mem::replace(&mut self.first, FirstCrossing::NotFound)
        };
        if let FirstCrossing::Emitted = first {
            return Some(());
        }
        let (root, multiplicity) = if let Some((first, last, n)) = self.zeros.take() {
            let middle = 0.5 * (first + last);
            let size = self.torus.major + self.torus.minor;
            let is_flat = self.quartic.curvature(middle).abs() <= 1e-7 * size * size;
            let multiplicity = match (sign == left.1, n) {
                (true, 1 | 2) if !is_flat => 2,
                (true, _) => 4,
                (false, 2) => 3,
                (false, _) => 1,
            };
            (middle, multiplicity)
        } else if sign != left.1 && self.line.t(s) >= self.t_min {
            // The negative end is a minimum of the quartic, whose osculating parabola gives a good initial
            // guess.
            let (minimum, depth, outwards) =
                if sign < 0.0 { (s, quartic, -1.0) } else { (left.0, left.2, 1.0) };
            let half_width = (-2.0 * depth / self.quartic.curvature(minimum)).sqrt();
            let by_descent = match first {
                FirstCrossing::NotSearched => self.torus.descend(self.line, &self.quartic),
                FirstCrossing::Emitted | FirstCrossing::NotFound => None,
            };
            let guess = minimum + outwards * half_width;
            (by_descent.unwrap_or_else(|| self.root(left.0, s, guess, sign > 0.0)), 1)
        } else {
            return Some(());
        };
        (self.emit)(root, multiplicity).then_some(())
    }

    /// The root in a monotone piece: Newton's method on the quartic, then on the torus's own equation.
    #[inline]
    fn root(&self, low: f64, high: f64, guess: f64, rising: bool) -> f64 {
        let mut s = guess;
        let steps = if self.torus.is_thin() { 0 } else { 8 };
        for _ in 0..steps {
            let (value, slope) = self.quartic.at(s);
            let next = s - value / slope;
            // False for a NaN, too.
            let is_within = low < next && next < high;
            if !is_within {
                break;
            }
            let step = (next - s).abs();
            s = next;
            if step <= 1e-6 * self.torus.minor {
                break;
            }
        }
        if self.torus.is_thin()
            && let Some(root) = self.thin_root(low, high, s)
        {
            return root;
        }
        if low < s && s < high {
            let (value, slope) = self.torus.value_and_slope(self.line, s);
            let step = value / slope;
            let next = s - step;
            // Newton's method leaves an error of step² f''/f'.
            let residual = step * step * self.quartic.curvature(s) / self.quartic.at(s).1;
            if low < next && next < high && residual.abs() <= 0.25 * f64::EPSILON * self.torus.minor {
                return next;
            }
        }
        bracketed_root(low, high, s, rising, |s| self.torus.value_and_slope(self.line, s))
    }
}

impl<F> Pieces<'_, F> {
    /// The root in a monotone piece of a thin ring by Newton's method on the torus's own equation, for the quartic has
    /// no digits there; `None` where it does not converge.
    fn thin_root(&self, low: f64, high: f64, guess: f64) -> Option<f64> {
        let (mut s, mut last_step) = (guess, f64::INFINITY);
        for _ in 0..12 {
            let (value, slope) = self.torus.value_and_slope(self.line, s);
            let next = s - value / slope;
            let step = (next - s).abs();
            // False for a NaN.
            let converges = low < next && next < high && step < last_step;
            if !converges {
                break;
            }
            (s, last_step) = (next, step);
        }
        let reach = self.torus.major + self.torus.minor;
        (low < s && s < high && last_step <= 8.0 * f64::EPSILON * reach).then_some(s)
    }
}

impl Torus {
    /// Where the line comes nearest to the circle in the middle of the tube, from a place close by: the quartic's
    /// derivative tells it to ten digits of the circle's size, a thin tube needs it to some of its own.
    #[cold]
    fn nearest_to_circle(&self, line: &Line, mut s: f64) -> f64 {
        let reach = self.major + self.minor;
        for _ in 0..40 {
            let p = line.p + s * line.u;
            let rho = (p.x * p.x + p.y * p.y).sqrt();
            let from_circle = rho - self.major;
            let growth = (p.x * line.u.x + p.y * line.u.y) / rho;
            let across = line.u.x * line.u.x + line.u.y * line.u.y - growth * growth;
            // Half the first and the second derivative of the squared distance.
            let slope = from_circle * growth + p.z * line.u.z;
            let curvature = growth * growth + line.u.z * line.u.z + from_circle * across / rho;
            let step = slope / curvature;
            // Elsewhere it is a greatest distance, which the quartic gives well enough. False for a NaN.
            let is_near = curvature > 0.0 && step.abs() <= 1e-3 * reach;
            if !is_near {
                break;
            }
            s -= step;
            if step.abs() <= 1e-6 * self.minor {
                break;
            }
        }
        s
    }

    /// Calls `emit(s, multiplicity)` with every crossing of the whole line in order, until it returns false.
    /// Crossings before `t_min` may be left out.
    #[inline]
    pub(crate) fn crossings(&self, line: &Line, t_min: f64, mut emit: impl FnMut(f64, u8) -> bool) {
        let quartic = Quartic::new(self, line);
        let mut first = FirstCrossing::NotSearched;
        if line.t(line.low) >= t_min {
            first = match self.descend(line, &quartic) {
                Some(s) if !emit(s, 1) => return,
                Some(_) => FirstCrossing::Emitted,
                None => FirstCrossing::NotFound,
            };
        }
        self.crossings_by_pieces(line, quartic, t_min, first, emit);
    }

    /// Descends along the quartic to the first crossing of a ring; `None` where the line may merely touch it,
    /// or where the descent is not certain to end at the first crossing.
    ///
    /// On an interval where the quartic falls and has no inflection, the result is its only zero; where it
    /// falls from a positive value and is convex, the first.
    #[inline]
    pub(crate) fn descend(&self, line: &Line, quartic: &Quartic) -> Option<f64> {
        if !self.is_ring() || self.is_thin() {
            return None;
        }
        let &Line { low, high, .. } = line;
        if quartic.p >= 0.0 {
            return self.halley_descent(line, quartic, low, [low, high]);
        }
        // The quartic is convex up to the first inflection, concave up to the second, and convex again.
        let inflection = (quartic.p * (-1.0 / 6.0)).sqrt();
        let mut from = low;
        if low < -inflection {
            let (value, slope) = quartic.at(-inflection);
            if slope >= 0.0 {
                return self.halley_descent(line, quartic, low, [low, -inflection]);
            }
            if value < 0.0 {
                return self.halley_descent(
                    line,
                    quartic,
                    low.max(-inflection - value / slope),
                    [low, -inflection],
                );
            }
            if value <= self.uncertainty() {
                return None;
            }
            from = -inflection;
        }
        if inflection <= from {
            return self.halley_descent(line, quartic, from, [from, high]);
        }
        let (value, slope) = quartic.at(inflection);
        if value < 0.0 {
            return self.halley_descent(line, quartic, inflection - value / slope, [from, inflection]);
        }
        if value <= self.uncertainty() || slope >= 0.0 || inflection >= high {
            return None;
        }
        self.halley_descent(line, quartic, inflection - value / slope, [inflection, high])
    }

    /// Below this, the sign of the quartic is uncertain: far more than its rounding error.
    #[inline]
    fn uncertainty(&self) -> f64 {
        let size = self.major + self.minor;
        1e-10 * (size * size) * (size * size)
    }

    /// A zero of the quartic in an interval, by E. Halley's method ("Methodus nova accurata & facilis
    /// inveniendi radices", 1694) and a last step of Newton's on the ring's own equation; `None` unless the
    /// quartic falls steeply all the way from `from`.
    #[inline]
    fn halley_descent(
        &self,
        line: &Line,
        quartic: &Quartic,
        from: f64,
        [low, high]: [f64; 2],
    ) -> Option<f64> {
        let uncertainty = self.uncertainty();
        let (mut s, mut last_step) = (from, f64::INFINITY);
        for _ in 0..8 {
            let (value, slope) = quartic.at(s);
            let (curvature, squared) = (quartic.curvature(s), slope * slope);
            // At a zero of a parabola, slope² = 2 depth curvature. False for a NaN.
            let falls = low <= s && s <= high && slope < 0.0 && squared > uncertainty * curvature.abs();
            if !falls {
                break;
            }
            if last_step <= 1e-3 * self.minor {
                let root = s - self.newton_step(line, s, slope);
                let residual = (s - root) * (s - root) * curvature / slope;
                let is_exact = residual.abs() <= 0.25 * f64::EPSILON * self.minor;
                if is_exact && line.low < root && root < line.high {
                    return Some(root);
                }
                break;
            }
            let step = value * slope / (squared - 0.5 * value * curvature).max(0.5 * squared);
            last_step = step.abs();
            s -= step;
        }
        None
    }

    /// A step of Newton's method on the ring's own equation, near a zero of the quartic where its slope is
    /// `slope`.
    #[inline]
    fn newton_step(&self, line: &Line, s: f64, slope: f64) -> f64 {
        let p = line.p + s * line.u;
        let (outer, inner) = self.factors((p.x * p.x + p.y * p.y).sqrt(), p.z);
        outer * inner / slope
    }

    /// The crossings by monotone pieces, without the first if it was emitted.
    ///
    /// The quartic s⁴ + p s² + q s + w is monotone between the roots of its derivative. A piece whose ends
    /// differ in sign has one root; where the quartic vanishes at an end, the line touches.
    #[inline]
    fn crossings_by_pieces(
        &self,
        line: &Line,
        quartic: Quartic,
        t_min: f64,
        first: FirstCrossing,
        emit: impl FnMut(f64, u8) -> bool,
    ) {
        let left = (line.low, 1.0, 0.0);
        let mut pieces = Pieces { torus: self, line, quartic, t_min, first, emit, left, zeros: None };
        let _: Option<()> = (|| {
            match DepressedCubic::new(0.5 * quartic.p, 0.25 * quartic.q) {
                DepressedCubic::OneRoot(split) => pieces.advance_to_split(split)?,
                DepressedCubic::ThreeRoots(three) => {
                    let left = three.left();
                    pieces.advance_to_split(left)?;
                    let (middle, right) = three.others(left);
                    pieces.advance_to_split(middle)?;
                    pieces.advance_to_split(right)?;
                }
            }
            pieces.advance_to(line.high, 1.0, 0.0)
        })();
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::DVec3;
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::{Ray, Roots};

    /// Random lines near a ring, from near and far, steep and shallow; many almost touch it.
    fn lines(count: u32) -> impl Iterator<Item = Ray> {
        let mut random = RandomStream::new(33);
        let mut next = move || 2.0 * random.next_f64() - 1.0;
        (0..count).map(move |i| {
            let through = 1.3 * DVec3::new(next(), next(), 0.4 * next());
            let direction = DVec3::new(next(), next(), next() * 0.5f64.powi(i as i32 % 12));
            Ray::new(through - 10f64.powi(i as i32 % 4) * direction, direction)
        })
    }

    #[test]
    fn the_descent_to_the_first_crossing_ends_in_time() {
        let (mut found, mut all) = (0, 0);
        for minor in [0.02, 0.25, 0.6, 0.95] {
            let ring = Torus::new(DVec3::ZERO, DVec3::Z, 1.0, minor).unwrap();
            for ray in lines(if cfg!(miri) { 200 } else { 20_000 }) {
                let Some(line) = ring.line(&ray) else { continue };
                let quartic = Quartic::new(&ring, &line);
                let mut by_pieces = Vec::new();
                ring.crossings_by_pieces(
                    &line,
                    quartic,
                    f64::NEG_INFINITY,
                    FirstCrossing::NotFound,
                    |s, n| {
                        by_pieces.push((line.t(s), n));
                        true
                    },
                );
                all += 1;
                let mut by_both = Vec::new();
                ring.crossings(&line, f64::NEG_INFINITY, |s, n| {
                    by_both.push((line.t(s), n));
                    true
                });
                assert_eq!(by_both.len(), by_pieces.len(), "{ray:?}");
                let Some(s) = ring.descend(&line, &quartic) else {
                    assert_eq!(by_both, by_pieces);
                    continue;
                };
                found += 1;
                let &[(t, multiplicity), ref behind @ ..] = &by_pieces[..] else { panic!("{ray:?}") };
                // The position is as accurate as the rounded equation.
                let steepness = (ring.value_and_slope(&line, s).1 / minor).abs().min(1.0);
                let rounding = 1e-14 + 2.0 * f64::EPSILON * line.start.abs() * line.speed;
                assert!((line.t(s) - t).abs() * line.speed * steepness <= rounding, "{ray:?} {s} {t}");
                assert_eq!(multiplicity, 1, "{ray:?}");
                assert_eq!(by_both[0], (line.t(s), 1));
                assert_eq!(by_both[1..], *behind);
                // A ray finds the same crossings as the line, wherever it begins.
                for t_min in by_both.iter().map(|(t, _)| *t).chain([line.t(line.low), line.t(line.high)]) {
                    let mut ahead = Roots::new();
                    ring.roots(&ray.with_range(t_min, f64::INFINITY), &mut ahead);
                    let ahead: Vec<_> = ahead.iter().map(|root| (root.t, root.multiplicity)).collect();
                    let expected: Vec<_> = by_both.iter().copied().filter(|(t, _)| *t >= t_min).collect();
                    assert_eq!(ahead, expected, "{ray:?}");
                }
            }
        }
        assert!(10 * found > 9 * all, "{found} of {all}");
    }
}
