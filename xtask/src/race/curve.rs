//! Error against time, and the time to an error.

/// One render, or the mean of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Samples a pixel.
    pub(crate) spp: u32,
    /// Seconds of rendering.
    pub(crate) seconds: f64,
    /// Relative mean squared error.
    pub(crate) error: f64,
}

/// The time to an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimeToError {
    pub(crate) seconds: f64,
    /// Whether the error lies between two that were measured.
    pub(crate) measured: bool,
}

/// How long it takes to come to this error: between the points along the line that joins them on logarithmic axes,
/// beyond them along the line by which independent samples go, half the error in twice the time. The points are in the
/// order of their samples. `None` without points, or where one is not above zero.
pub(crate) fn time_to_error(points: &[Point], error: f64) -> Option<TimeToError> {
    let all_positive = points.iter().all(|p| p.seconds > 0.0 && p.error > 0.0) && error > 0.0;
    let (first, last) = (points.first()?, points.last()?);
    if !all_positive {
        return None;
    }
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if a.error >= error && error >= b.error && a.error > b.error {
            let part = (a.error / error).ln() / (a.error / b.error).ln();
            return Some(TimeToError {
                seconds: a.seconds * (b.seconds / a.seconds).powf(part),
                measured: true,
            });
        }
    }
    let nearest = if error > first.error { first } else { last };
    Some(TimeToError { seconds: nearest.seconds * nearest.error / error, measured: nearest.error == error })
}

/// The geometric mean; `None` of nothing.
pub(crate) fn geometric_mean(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().map(|x| x.ln()).sum();
    (!values.is_empty()).then(|| (sum / values.len() as f64).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(seconds: f64, error: f64) -> Point {
        Point { spp: 7, seconds, error }
    }

    #[test]
    fn time_to_an_error_is_interpolated_logarithmically() {
        // From (2, 0.9) to (32, 0.09): a tenth of the error in sixteen times the time.
        let points = [point(0.5, 4.0), point(2.0, 0.9), point(32.0, 0.09)];
        let middle = time_to_error(&points, 0.9 / 10.0_f64.sqrt()).unwrap();
        assert!((middle.seconds - 8.0).abs() < 1e-9 && middle.measured, "{middle:?}");
        assert_eq!(time_to_error(&points, 0.9), Some(TimeToError { seconds: 2.0, measured: true }));
    }

    #[test]
    fn beyond_what_was_measured_half_the_error_takes_twice_the_time() {
        let points = [point(0.5, 4.0), point(2.0, 0.9)];
        let better = time_to_error(&points, 0.3).unwrap();
        assert!((better.seconds - 6.0).abs() < 1e-9 && !better.measured, "{better:?}");
        let worse = time_to_error(&points, 8.0).unwrap();
        assert!((worse.seconds - 0.25).abs() < 1e-9 && !worse.measured, "{worse:?}");
        assert_eq!(time_to_error(&[], 0.3), None);
        assert_eq!(time_to_error(&[point(0.0, 0.2)], 0.3), None);
    }

    #[test]
    fn the_geometric_mean_of_a_half_and_eight_is_two() {
        assert!((geometric_mean(&[0.5, 8.0]).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(geometric_mean(&[]), None);
    }
}
