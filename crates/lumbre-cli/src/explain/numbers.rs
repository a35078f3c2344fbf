//! Numbers as they are written: in full, or short.

use crate::units::number;

/// The shortest text that is read back as the same number; infinity has its sign.
pub(super) fn exact(x: f64) -> String {
    if x.is_finite() || x.is_nan() {
        return number(x);
    }
    if x > 0.0 { "∞".to_owned() } else { "-∞".to_owned() }
}

/// With six digits, for what stands in formulas.
pub(super) fn short(x: f64) -> String {
    exact(rounded(x, 6))
}

/// The number of at most this many digits that is nearest.
pub(super) fn rounded(x: f64, digits: usize) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    format!("{x:.0$e}", digits.saturating_sub(1)).parse().unwrap_or(x)
}

/// With four digits, for a label.
pub(super) fn label(x: f64) -> String {
    exact(rounded(x, 4))
}
