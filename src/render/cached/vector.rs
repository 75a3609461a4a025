//! Eight numbers at a time: the few operations the cached sums need, once in portable Rust, once with AVX2 and FMA.
//!
//! A kernel is written once, generic over [`Eight`], and compiled twice. Which one runs is decided at run time by
//! [`has_avx2`]; tests compare the two.

/// Numbers a vector holds.
pub const LANES: usize = 8;

/// Eight `f32`.
pub trait Eight: Copy {
    /// The same number eight times.
    fn splat(value: f32) -> Self;
    /// The first eight numbers of a slice, which must be that long.
    fn load(values: &[f32]) -> Self;
    /// Eight bytes as numbers from 0 to 255; the slice must be that long.
    fn load_bytes(values: &[u8]) -> Self;
    /// Writes eight numbers to the start of a slice, which must be that long.
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
    /// Whether any number is above zero.
    fn any_positive(self) -> bool;
    /// Exponent `e` and mantissa `m` in `[1, 2)` of positive normal numbers.
    fn split(self) -> (Self, Self);
    /// `2^i` for whole numbers `i` in [-126, 127].
    fn power_of_two(self) -> Self;
    /// The whole number nearest to each, for magnitudes below 2^22.
    fn round(self) -> Self;

    /// Sum of the eight, pair by pair: the same order in every version.
    #[inline(always)]
    fn sum(self) -> f32 {
        let mut v = [0.0; LANES];
        self.store(&mut v);
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
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
        let t = x.sub(whole).mul(Self::splat(std::f32::consts::LN_2));
        let series = Self::splat(1.0 / 720.0)
            .mul_add(t, Self::splat(1.0 / 120.0))
            .mul_add(t, Self::splat(1.0 / 24.0))
            .mul_add(t, Self::splat(1.0 / 6.0))
            .mul_add(t, Self::splat(0.5))
            .mul_add(t, Self::splat(1.0))
            .mul_add(t, Self::splat(1.0));
        series.mul(whole.power_of_two())
    }
}

/// Portable Rust.
#[derive(Clone, Copy, Debug)]
pub struct Plain([f32; LANES]);

/// 1.5 * 2^23: adding it leaves the nearest whole number in the low bits.
const MAGIC: f32 = 12_582_912.0;

impl Eight for Plain {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Plain([value; LANES])
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
    fn store(self, values: &mut [f32]) {
        values[..LANES].copy_from_slice(&self.0);
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

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Eight, LANES, MAGIC};
    use std::arch::x86_64::*;

    /// AVX2 with FMA. Only code that runs behind [`super::has_avx2`] makes one.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(__m256);

    // SAFETY of every block below: values of this type exist only in functions compiled for AVX2 and FMA and called
    // after `has_avx2`, into which these methods are inlined; lengths of slices are checked before they are read.
    impl Eight for Avx2 {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            Avx2(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn load(values: &[f32]) -> Self {
            let values = &values[..LANES];
            Avx2(unsafe { _mm256_loadu_ps(values.as_ptr()) })
        }
        #[inline(always)]
        fn load_bytes(values: &[u8]) -> Self {
            let values = &values[..LANES];
            Avx2(unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(values.as_ptr().cast()))) })
        }
        #[inline(always)]
        fn store(self, values: &mut [f32]) {
            let values = &mut values[..LANES];
            unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_add_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul_add(self, factor: Self, term: Self) -> Self {
            Avx2(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Avx2(unsafe { _mm256_sqrt_ps(self.0) })
        }
        #[inline(always)]
        fn any_positive(self) -> bool {
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, _mm256_setzero_ps())) != 0 }
        }
        #[inline(always)]
        fn split(self) -> (Self, Self) {
            unsafe {
                let bits = _mm256_castps_si256(self.0);
                let exponent = _mm256_cvtepi32_ps(_mm256_srli_epi32::<23>(bits));
                let exponent = _mm256_sub_ps(exponent, _mm256_set1_ps(127.0));
                let mantissa = _mm256_and_si256(bits, _mm256_set1_epi32(0x007f_ffff));
                let mantissa = _mm256_or_si256(mantissa, _mm256_set1_epi32(0x3f80_0000));
                (Avx2(exponent), Avx2(_mm256_castsi256_ps(mantissa)))
            }
        }
        #[inline(always)]
        fn power_of_two(self) -> Self {
            unsafe {
                let whole = _mm256_cvtps_epi32(_mm256_add_ps(self.0, _mm256_set1_ps(127.0)));
                Avx2(_mm256_castsi256_ps(_mm256_slli_epi32::<23>(whole)))
            }
        }
        #[inline(always)]
        fn round(self) -> Self {
            unsafe {
                let magic = _mm256_set1_ps(MAGIC);
                Avx2(_mm256_sub_ps(_mm256_add_ps(self.0, magic), magic))
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;

/// Whether this machine has AVX2 and FMA.
#[inline]
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_and_powers_keep_their_digits() {
        for step in 1..4000 {
            let x = step as f32 / 4000.0;
            let mut out = [0.0; LANES];
            Plain::splat(x).log2().store(&mut out);
            let truth = f64::from(x).log2();
            assert!((f64::from(out[3]) - truth).abs() < 3e-7 * (1.0 + truth.abs()), "{x}: {} {truth}", out[3]);
            let y = -130.0 * x;
            Plain::splat(y).exp2().store(&mut out);
            let truth = f64::from(y.max(-126.0)).exp2();
            assert!((f64::from(out[5]) / truth - 1.0).abs() < 1e-6, "{y}: {} {truth}", out[5]);
        }
        // Just below 1, where a sharp lobe lives.
        let mut out = [0.0; LANES];
        Plain::splat(1.0 - 1e-6).log2().store(&mut out);
        let truth = f64::from(1.0f32 - 1e-6).log2();
        assert!((f64::from(out[0]) / truth - 1.0).abs() < 1e-5);
    }
}
