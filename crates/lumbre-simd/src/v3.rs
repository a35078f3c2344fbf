//! Vectors of three components, each of any kind of lanes.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::{Double, Real};

/// Three components: of [`Real`], of [`Double`], or of plain numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V3<T> {
    /// The first.
    pub x: T,
    /// The second.
    pub y: T,
    /// The third.
    pub z: T,
}

impl<T: Add<Output = T>> Add for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<T: Sub<Output = T>> Sub for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

/// By components.
impl<T: Mul<Output = T>> Mul for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }
}

impl<T: Mul<Output = T> + Copy> Mul<T> for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: T) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

/// By components.
impl<T: Div<Output = T>> Div for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self { x: self.x / other.x, y: self.y / other.y, z: self.z / other.z }
    }
}

impl<T: Div<Output = T> + Copy> Div<T> for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, divisor: T) -> Self {
        Self { x: self.x / divisor, y: self.y / divisor, z: self.z / divisor }
    }
}

impl<T: Neg<Output = T>> Neg for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<T> V3<T> {
    /// The vector (x, y, z).
    #[inline(always)]
    pub const fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }
}

impl<T: Copy> V3<T> {
    /// The vector with three equal components.
    #[inline(always)]
    pub fn splat(x: T) -> Self {
        Self { x, y: x, z: x }
    }
}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T>> V3<T> {
    /// The dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> T {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The cross product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// The square of the length.
    #[inline(always)]
    pub fn length_squared(self) -> T {
        self.dot(self)
    }
}

/// The methods of both precisions.
macro_rules! by_component {
    ($($method:ident = $of:ident($($other:ident)?) $doc:literal),*) => {
        $(
            #[doc = $doc]
            #[inline(always)]
            pub fn $method(self $(, $other: Self)?) -> Self {
                Self {
                    x: self.x.$of($($other.x)?),
                    y: self.y.$of($($other.y)?),
                    z: self.z.$of($($other.z)?),
                }
            }
        )*
    };
}

impl<R: Real> V3<R> {
    /// The same vector in all lanes.
    #[inline(always)]
    pub fn constant(v: [f32; 3]) -> Self {
        Self { x: R::splat(v[0]), y: R::splat(v[1]), z: R::splat(v[2]) }
    }

    /// The vector of length 1 in this direction; NaN for the zero vector.
    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * self.length_squared().sqrt().recip()
    }

    /// The length.
    #[inline(always)]
    pub fn length(self) -> R {
        self.length_squared().sqrt()
    }

    /// `a` where the mask is true, else `b`.
    #[inline(always)]
    pub fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Self { x: R::select(mask, a.x, b.x), y: R::select(mask, a.y, b.y), z: R::select(mask, a.z, b.z) }
    }

    /// The vector where the mask is true, else zero.
    #[inline(always)]
    pub fn or_zero(self, mask: R::Mask) -> Self {
        Self { x: self.x.or_zero(mask), y: self.y.or_zero(mask), z: self.z.or_zero(mask) }
    }

    /// The largest component.
    #[inline(always)]
    pub fn max_component(self) -> R {
        self.x.simd_max(self.y).simd_max(self.z)
    }

    by_component!(
        min = simd_min(other) "[`Real::simd_min`] by components.",
        max = simd_max(other) "[`Real::simd_max`] by components.",
        abs = abs() "The absolute values of the components."
    );

    /// The same vector in double precision.
    #[inline(always)]
    pub fn to_double(self) -> V3<R::Double> {
        V3 {
            x: R::Double::from_single(self.x),
            y: R::Double::from_single(self.y),
            z: R::Double::from_single(self.z),
        }
    }
}

/// Of double precision. The methods have other names than those of single precision, since a type could be both to the
/// compiler.
impl<D: Double> V3<D> {
    /// The same vector in all lanes.
    #[inline(always)]
    pub fn constant_f64(v: [f64; 3]) -> Self {
        Self { x: D::splat(v[0]), y: D::splat(v[1]), z: D::splat(v[2]) }
    }

    /// Rounded to single precision.
    #[inline(always)]
    pub fn to_single(self) -> V3<D::Single> {
        V3 { x: self.x.to_single(), y: self.y.to_single(), z: self.z.to_single() }
    }

    /// The vector of length 1 in this direction; NaN for the zero vector.
    #[inline(always)]
    pub fn normalize_f64(self) -> Self {
        self * (D::splat(1.0) / self.length_squared().sqrt())
    }

    /// `a` where the mask is true, else `b`.
    #[inline(always)]
    pub fn select_f64(mask: D::Mask, a: Self, b: Self) -> Self {
        Self { x: D::select(mask, a.x, b.x), y: D::select(mask, a.y, b.y), z: D::select(mask, a.z, b.z) }
    }

    /// The largest component.
    #[inline(always)]
    pub fn max_component_f64(self) -> D {
        self.x.simd_max(self.y).simd_max(self.z)
    }

    by_component!(
        min_f64 = simd_min(other) "[`Double::simd_min`] by components.",
        max_f64 = simd_max(other) "[`Double::simd_max`] by components.",
        abs_f64 = abs() "The absolute values of the components.",
        next_towards_sign = next_towards_sign(along) "[`Double::next_towards_sign`] by components."
    );
}
