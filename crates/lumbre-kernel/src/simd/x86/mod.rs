//! Vectors of AVX2 and AVX-512.

/// An operator that is an instruction.
macro_rules! operator {
    ($name:ty $(, $level:ident)?; $trait:ident $method:ident $instruction:ident) => {
        impl $(<const $level: bool>)? $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the type.
                unsafe { Self($instruction(self.0, other.0)) }
            }
        }
    };
}

/// A method that is an instruction.
macro_rules! by_one {
    ($name:ident($($other:ident),*) $instruction:ident) => {
        #[inline(always)]
        fn $name(self $(, $other: Self)*) -> Self {
            // SAFETY: see the type.
            unsafe { Self($instruction(self.0 $(, $other.0)*)) }
        }
    };
}

mod avx2;
mod avx512;
mod eight;

pub(crate) use self::avx2::Avx2;
pub(crate) use self::avx512::Avx512;
pub(crate) use self::eight::Eight256;
