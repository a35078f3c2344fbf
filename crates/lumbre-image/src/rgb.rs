//! Linear colour.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Index, Mul, MulAssign, Neg, Sub};

use bytemuck::{Pod, Zeroable};

/// A linear colour on the Rec. 709 primaries with a D65 white, unbounded.
///
/// Light transport carries radiance and reflectance in these channels, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// Zero in every channel.
    pub const BLACK: Self = Self::splat(0.0);
    /// One in every channel.
    pub const WHITE: Self = Self::splat(1.0);

    /// A colour by its channels.
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// The same value in every channel.
    #[inline]
    pub const fn splat(v: f32) -> Self {
        Self { r: v, g: v, b: v }
    }

    /// Relative luminance Y of Rec. 709 (CIE 1931), 1 for white.
    #[inline]
    pub fn luminance(self) -> f32 {
        0.212_639 * self.r + 0.715_168_7 * self.g + 0.072_192_32 * self.b
    }

    /// The mean of the channels.
    #[inline]
    pub fn average(self) -> f32 {
        (self.r + self.g + self.b) / 3.0
    }

    /// The largest channel.
    #[inline]
    pub fn max_component(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The smallest channel.
    #[inline]
    pub fn min_component(self) -> f32 {
        self.r.min(self.g).min(self.b)
    }

    /// Whether every channel is exactly zero.
    #[inline]
    pub fn is_black(self) -> bool {
        self == Self::BLACK
    }

    /// Whether every channel is finite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }

    /// Maps each channel by `f`.
    #[must_use]
    #[inline]
    pub fn map(self, mut f: impl FnMut(f32) -> f32) -> Self {
        Self::new(f(self.r), f(self.g), f(self.b))
    }

    /// Combines the channels pairwise by `f`.
    #[must_use]
    #[inline]
    pub fn zip(self, other: Self, mut f: impl FnMut(f32, f32) -> f32) -> Self {
        Self::new(f(self.r, other.r), f(self.g, other.g), f(self.b, other.b))
    }

    /// Clamps each channel to `[low, high]`.
    #[must_use]
    #[inline]
    pub fn clamp(self, low: f32, high: f32) -> Self {
        self.map(|c| c.clamp(low, high))
    }

    /// `(1 - amount) * self + amount * other`.
    #[must_use]
    #[inline]
    pub fn lerp(self, other: Self, amount: f32) -> Self {
        self * (1.0 - amount) + other * amount
    }

    /// The channels in order.
    #[inline]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }
}

impl From<[f32; 3]> for Rgb {
    #[inline]
    fn from([r, g, b]: [f32; 3]) -> Self {
        Self::new(r, g, b)
    }
}

impl Index<usize> for Rgb {
    type Output = f32;

    #[inline]
    fn index(&self, channel: usize) -> &f32 {
        match channel {
            0 => &self.r,
            1 => &self.g,
            2 => &self.b,
            _ => panic!("a colour has three channels, not {}", channel + 1),
        }
    }
}

macro_rules! channelwise {
    ($($Op:ident $op:ident $sign:tt;)*) => {$(
        impl $Op for Rgb {
            type Output = Self;
            #[inline]
            fn $op(self, o: Self) -> Self {
                Self::new(self.r $sign o.r, self.g $sign o.g, self.b $sign o.b)
            }
        }
    )*};
}

channelwise! { Add add +; Sub sub -; Mul mul *; Div div /; }

impl Mul<f32> for Rgb {
    type Output = Self;
    #[inline]
    fn mul(self, s: f32) -> Self {
        self.map(|c| c * s)
    }
}

impl Mul<Rgb> for f32 {
    type Output = Rgb;
    #[inline]
    fn mul(self, c: Rgb) -> Rgb {
        c * self
    }
}

impl Div<f32> for Rgb {
    type Output = Self;
    #[inline]
    fn div(self, s: f32) -> Self {
        self.map(|c| c / s)
    }
}

impl Neg for Rgb {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.map(|c| -c)
    }
}

impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl MulAssign for Rgb {
    #[inline]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl MulAssign<f32> for Rgb {
    #[inline]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

impl Sum for Rgb {
    #[inline]
    fn sum<I: Iterator<Item = Self>>(colours: I) -> Self {
        colours.fold(Self::BLACK, |a, b| a + b)
    }
}
