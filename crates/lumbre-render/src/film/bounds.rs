//! A rectangle of pixels.

/// Maximum number of pixels.
pub(crate) const MAX_PIXELS: u64 = 1 << 30;

/// The pixels `x0 <= x < x1`, `y0 <= y < y1`, from the upper left of the whole picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelBounds {
    /// The first column.
    pub x0: u32,
    /// The first row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl PixelBounds {
    /// A whole picture.
    pub fn whole(width: u32, height: u32) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Number of pixels.
    pub fn area(&self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// Whether it is empty.
    pub fn is_empty(&self) -> bool {
        self.area() == 0
    }

    /// The intersection.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }

    /// The smallest rectangle that contains both.
    #[must_use]
    pub fn hull(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if self.is_empty() { *other } else { *self };
        }
        Self {
            x0: self.x0.min(other.x0),
            y0: self.y0.min(other.y0),
            x1: self.x1.max(other.x1),
            y1: self.y1.max(other.y1),
        }
    }

    /// Squares of `side` pixels that cover it, row by row; those at the right and below may be smaller.
    pub fn tiles(&self, side: u32) -> Vec<Self> {
        let side = side.max(1) as usize;
        let rows = (self.y0..self.y1).step_by(side);
        let whole = *self;
        rows.flat_map(|y0| {
            (whole.x0..whole.x1).step_by(side).map(move |x0| Self {
                x0,
                y0,
                x1: x0.saturating_add(side as u32).min(whole.x1),
                y1: y0.saturating_add(side as u32).min(whole.y1),
            })
        })
        .collect()
    }

    /// The index of a pixel among all of its pixels, row by row.
    pub fn position(&self, x: u32, y: u32) -> usize {
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }

    /// Every pixel, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let whole = *self;
        (whole.y0..whole.y1).flat_map(move |y| (whole.x0..whole.x1).map(move |x| (x, y)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_hold_every_pixel_once() {
        let whole = PixelBounds { x0: 5, y0: 3, x1: 42, y1: 70 };
        let mut pixels: Vec<_> = whole.tiles(16).iter().flat_map(PixelBounds::pixels).collect();
        pixels.sort_unstable_by_key(|&(x, y)| (y, x));
        assert_eq!(pixels, whole.pixels().collect::<Vec<_>>());
        assert_eq!(pixels.len() as u64, whole.area());
        assert_eq!(whole.area(), 37 * 67);
    }

    #[test]
    fn bounds_that_do_not_meet_hold_nothing() {
        let a = PixelBounds { x0: 2, y0: 2, x1: 9, y1: 9 };
        let b = PixelBounds { x0: 12, y0: 3, x1: 20, y1: 5 };
        assert!(a.intersection(&b).is_empty());
        assert_eq!(a.intersection(&PixelBounds::whole(5, 30)).area(), 21);
    }
}
