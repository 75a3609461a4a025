//! Several numbers at a time: the few operations that light is summed and paths are drawn with, in portable Rust, with
//! AVX2 and FMA, with AVX-512, and with NEON.
//!
//! A kernel is written once, generic over [`Vector`], and compiled for each. The macro `versions` makes the function that
//! decides at run time which one runs; tests compare them.
//!
//! Where `f32` has too few digits there are [`doubles`].
//!
//! A kernel must not pass vectors through closures of `array::map` and the like: those are compiled for any processor,
//! and take them through memory.

#[cfg(target_arch = "aarch64")]
mod arm;
pub mod doubles;
pub mod elementary;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "aarch64")]
pub use arm::Neon;
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

/// Numbers that the widest vector holds: slices are padded to whole ones.
pub const WIDEST: usize = 16;

/// Some `f32`, a power of two of them.
pub trait Vector: Copy {
    /// How many; at most [`WIDEST`].
    const LANES: usize;
    /// The same number in each place.
    fn splat(value: f32) -> Self;
    /// The first numbers of a slice, which must be that long.
    fn load(values: &[f32]) -> Self;
    /// As many bytes as numbers from 0 to 255; the slice must be that long.
    fn load_bytes(values: &[u8]) -> Self;
    /// As many numbers by the upper halves of their bits (bfloat16); the slice must be that long.
    fn load_upper_halves(values: &[u16]) -> Self;
    /// Writes its numbers to the start of a slice, which must be that long.
    fn store(self, values: &mut [f32]);
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Quotient.
    fn div(self, other: Self) -> Self;
    /// `self * factor + term`, rounded once where the machine can.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// The larger of two, number by number.
    fn max(self, other: Self) -> Self;
    /// The smaller of two, number by number.
    fn min(self, other: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Where a number is above zero the one of `above`, elsewhere the one of `other`.
    fn where_positive(self, above: Self, other: Self) -> Self;
    /// Whether any number is above zero.
    fn any_positive(self) -> bool;
    /// Exponent `e` and mantissa `m` in `[1, 2)` of positive normal numbers.
    fn split(self) -> (Self, Self);
    /// `2^i` for whole numbers `i` in [-126, 127].
    fn power_of_two(self) -> Self;
    /// The whole number nearest to each, for magnitudes below 2^22.
    fn round(self) -> Self;

    /// Sum of all, half onto half.
    #[inline(always)]
    fn sum(self) -> f32 {
        let mut values = [0.0; WIDEST];
        self.store(&mut values);
        let mut half = Self::LANES / 2;
        while half > 0 {
            for k in 0..half {
                values[k] += values[k + half];
            }
            half /= 2;
        }
        values[0]
    }

    /// Logarithm to base 2 of positive normal numbers; absolute error below 3e-7, relative to the distance from 1 near 1.
    #[inline(always)]
    fn log2(self) -> Self {
        // Mantissas from sqrt(1/2) to sqrt(2), so that numbers just below 1 lose no digits: those above are halved. The
        // step is 0 or 1, because neighbouring mantissas lie more than 1e-8 apart.
        let (exponent, mantissa) = self.split();
        let above = mantissa.sub(Self::splat(std::f32::consts::SQRT_2)).mul(Self::splat(1e8));
        let step = above.max(Self::splat(0.0)).min(Self::splat(1.0));
        let exponent = exponent.add(step);
        let m = mantissa.mul(Self::splat(1.0).sub(step.mul(Self::splat(0.5))));
        // ln m = 2 artanh s.
        let s = m.sub(Self::splat(1.0)).div(m.add(Self::splat(1.0)));
        let s2 = s.mul(s);
        let scale = 2.0 * std::f32::consts::LOG2_E;
        let series = Self::splat(scale / 7.0)
            .mul_add(s2, Self::splat(scale / 5.0))
            .mul_add(s2, Self::splat(scale / 3.0))
            .mul_add(s2, Self::splat(scale));
        series.mul_add(s, exponent)
    }

    /// `2^x` for `x` up to 127; below -126 it is `2^-126`. Relative error below 3e-7.
    #[inline(always)]
    fn exp2(self) -> Self {
        let x = self.max(Self::splat(-126.0));
        let whole = x.round();
        let t = x.sub(whole);
        // The polynomial of least largest relative error among those that begin as the series does.
        let series = Self::splat(0.001_330_026_4)
            .mul_add(t, Self::splat(0.009_669_708))
            .mul_add(t, Self::splat(0.055_505_6))
            .mul_add(t, Self::splat(0.240_222_81))
            .mul_add(t, Self::splat(std::f32::consts::LN_2))
            .mul_add(t, Self::splat(1.0));
        series.mul(whole.power_of_two())
    }
}

/// Dot products of vectors in space.
#[inline(always)]
pub fn dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul(b[2])))
}

/// Portable Rust, eight numbers.
#[derive(Clone, Copy, Debug)]
pub struct Plain([f32; 8]);

/// 1.5 * 2^23: adding it leaves the nearest whole number in the low bits.
pub(super) const MAGIC: f32 = 12_582_912.0;

impl Vector for Plain {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Plain([value; 8])
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        Plain(std::array::from_fn(|k| values[k]))
    }
    #[inline(always)]
    fn load_bytes(values: &[u8]) -> Self {
        Plain(std::array::from_fn(|k| f32::from(values[k])))
    }
    #[inline(always)]
    fn load_upper_halves(values: &[u16]) -> Self {
        Plain(std::array::from_fn(|k| f32::from_bits(u32::from(values[k]) << 16)))
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        values[..8].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] * other.0[k]))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] / other.0[k]))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] * factor.0[k] + term.0[k]))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k].max(other.0[k])))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k].min(other.0[k])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Plain(self.0.map(f32::sqrt))
    }
    #[inline(always)]
    fn where_positive(self, above: Self, other: Self) -> Self {
        Plain(std::array::from_fn(|k| if self.0[k] > 0.0 { above.0[k] } else { other.0[k] }))
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        self.0.iter().any(|&value| value > 0.0)
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let bits = self.0.map(f32::to_bits);
        let exponent = bits.map(|bits| (bits >> 23) as f32 - 127.0);
        let mantissa = bits.map(|bits| f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000));
        (Plain(exponent), Plain(mantissa))
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        Plain(self.0.map(|whole| f32::from_bits(((whole + 127.0) as u32) << 23)))
    }
    #[inline(always)]
    fn round(self) -> Self {
        Plain(self.0.map(|value| (value + MAGIC) - MAGIC))
    }
}

/// Whether this machine has AVX2 and FMA.
#[cfg(target_arch = "x86_64")]
#[inline]
pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Whether this machine has AVX-512F.
#[cfg(target_arch = "x86_64")]
#[inline]
pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
}

/// A function that runs a kernel, generic over [`Vector`], with the widest vectors of the machine:
/// `versions! { fn name(argument: Type) -> Type = kernel; }`. What stands in brackets behind the kernel is its second
/// generic argument.
macro_rules! versions {
    ($($(#[$about:meta])* $visibility:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?
        = $kernel:ident $([$constant:expr])?;)*) => {$(
        $(#[$about])*
        #[inline]
        $visibility fn $name($($argument: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f")]
                fn avx512($($argument: $type),*) $(-> $result)? {
                    $kernel::<$crate::math::vector::Avx512 $(, $constant)?>($($argument),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($argument: $type),*) $(-> $result)? {
                    $kernel::<$crate::math::vector::Avx2 $(, $constant)?>($($argument),*)
                }
                if $crate::math::vector::has_avx512() {
                    // SAFETY: the processor has what the function is compiled for.
                    return unsafe { avx512($($argument),*) };
                }
                if $crate::math::vector::has_avx2() {
                    // SAFETY: as above.
                    return unsafe { avx2($($argument),*) };
                }
                $kernel::<$crate::math::vector::Plain $(, $constant)?>($($argument),*)
            }
            // Every processor of this kind has NEON.
            #[cfg(target_arch = "aarch64")]
            {
                $kernel::<$crate::math::vector::Neon $(, $constant)?>($($argument),*)
            }
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            {
                $kernel::<$crate::math::vector::Plain $(, $constant)?>($($argument),*)
            }
        }
    )*};
}
pub(crate) use versions;

#[cfg(test)]
mod tests;
