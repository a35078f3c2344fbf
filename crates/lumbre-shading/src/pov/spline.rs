//! Splines of a scene: values by a number, interpolated.

/// How values between entries are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplineKind {
    /// Straight lines.
    #[default]
    Linear,
    /// Parabolas through three entries.
    Quadratic,
    /// Catmull–Rom with unequal spacing; constant before the second and after the last but one entry.
    Cubic,
    /// Twice continuously differentiable cubics, straight at the ends.
    Natural,
}

/// A spline.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    kind: SplineKind,
    size: usize,
    entries: Vec<(f64, [f64; 5])>,
    // The second derivatives of a natural spline at its entries.
    bends: Vec<[f64; 5]>,
}

type Values = [f64; 5];

fn combined(weights: &[(f64, &Values)]) -> Values {
    std::array::from_fn(|i| weights.iter().map(|(w, v)| w * v[i]).sum())
}

impl Spline {
    /// A spline through entries of this many components, in any order; of two with the same number the last counts.
    pub fn new(kind: SplineKind, size: usize, mut entries: Vec<(f64, Values)>) -> Self {
        entries.reverse();
        entries.sort_by(|a, b| a.0.total_cmp(&b.0));
        entries.dedup_by(|a, b| a.0 == b.0);
        let bends = if kind == SplineKind::Natural { bends(&entries) } else { Vec::new() };
        Self { kind, size, entries, bends }
    }

    /// The same entries in another way.
    #[must_use]
    pub fn with_kind(&self, kind: SplineKind) -> Self {
        Self::new(kind, self.size, self.entries.clone())
    }

    /// How many components its values have.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Its kind.
    pub fn kind(&self) -> SplineKind {
        self.kind
    }

    /// The value at a number.
    pub fn at(&self, t: f64) -> Values {
        let entries = &self.entries;
        let (Some(first), Some(last)) = (entries.first(), entries.last()) else { return [0.0; 5] };
        if entries.len() == 1 || t <= first.0 && self.kind != SplineKind::Cubic {
            return first.1;
        }
        if t >= last.0 && self.kind != SplineKind::Cubic {
            return last.1;
        }
        let i = entries.partition_point(|entry| entry.0 <= t).clamp(1, entries.len() - 1) - 1;
        match self.kind {
            SplineKind::Linear => self.linear(i, t),
            SplineKind::Quadratic if entries.len() >= 3 => self.quadratic(i, t),
            SplineKind::Cubic if entries.len() >= 4 => self.cubic(t),
            SplineKind::Natural => self.natural(i, t),
            SplineKind::Quadratic | SplineKind::Cubic => self.linear(i, t.clamp(first.0, last.0)),
        }
    }

    fn linear(&self, i: usize, t: f64) -> Values {
        let [(t0, v0), (t1, v1)] = [&self.entries[i], &self.entries[i + 1]];
        let x = (t - t0) / (t1 - t0);
        combined(&[(1.0 - x, v0), (x, v1)])
    }

    fn quadratic(&self, i: usize, t: f64) -> Values {
        let i = i.saturating_sub(1).min(self.entries.len() - 3);
        let [(t0, v0), (t1, v1), (t2, v2)] = [&self.entries[i], &self.entries[i + 1], &self.entries[i + 2]];
        combined(&[
            ((t - t1) * (t - t2) / ((t0 - t1) * (t0 - t2)), v0),
            ((t - t0) * (t - t2) / ((t1 - t0) * (t1 - t2)), v1),
            ((t - t0) * (t - t1) / ((t2 - t0) * (t2 - t1)), v2),
        ])
    }

    fn cubic(&self, t: f64) -> Values {
        let entries = &self.entries;
        let last = entries.len() - 2;
        if t <= entries[1].0 {
            return entries[1].1;
        }
        if t >= entries[last].0 {
            return entries[last].1;
        }
        let i = entries.partition_point(|entry| entry.0 <= t).clamp(2, last) - 1;
        let secant =
            |j: usize, c: usize| (entries[j + 1].1[c] - entries[j].1[c]) / (entries[j + 1].0 - entries[j].0);
        let slope = |j: usize, c: usize| 0.5 * (secant(j - 1, c) + secant(j, c));
        let width = entries[i + 1].0 - entries[i].0;
        let x = (t - entries[i].0) / width;
        let (x2, x3) = (x * x, x * x * x);
        std::array::from_fn(|c| {
            (2.0 * x3 - 3.0 * x2 + 1.0) * entries[i].1[c]
                + (3.0 * x2 - 2.0 * x3) * entries[i + 1].1[c]
                + width * ((x3 - 2.0 * x2 + x) * slope(i, c) + (x3 - x2) * slope(i + 1, c))
        })
    }

    fn natural(&self, i: usize, t: f64) -> Values {
        let [(t0, v0), (t1, v1)] = [&self.entries[i], &self.entries[i + 1]];
        let width = t1 - t0;
        let (a, b) = ((t1 - t) / width, (t - t0) / width);
        let bend = width * width / 6.0;
        combined(&[
            (a, v0),
            (b, v1),
            ((a * a * a - a) * bend, &self.bends[i]),
            ((b * b * b - b) * bend, &self.bends[i + 1]),
        ])
    }
}

/// The second derivatives of a natural spline, by the tridiagonal system that makes slopes agree.
#[expect(clippy::needless_range_loop, reason = "a component of several lists at once")]
fn bends(entries: &[(f64, Values)]) -> Vec<Values> {
    let n = entries.len();
    let mut bends = vec![[0.0; 5]; n];
    if n < 3 {
        return bends;
    }
    for c in 0..5 {
        let (mut upper, mut right) = (vec![0.0; n], vec![0.0; n]);
        for i in 1..n - 1 {
            let before = entries[i].0 - entries[i - 1].0;
            let after = entries[i + 1].0 - entries[i].0;
            let turn = (entries[i + 1].1[c] - entries[i].1[c]) / after
                - (entries[i].1[c] - entries[i - 1].1[c]) / before;
            let pivot = 2.0 * (before + after) - before * upper[i - 1];
            upper[i] = after / pivot;
            right[i] = (6.0 * turn - before * right[i - 1]) / pivot;
        }
        for i in (1..n - 1).rev() {
            bends[i][c] = right[i] - upper[i] * bends[i + 1][c];
        }
    }
    bends
}
