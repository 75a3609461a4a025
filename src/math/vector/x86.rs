//! [`Vector`] with AVX2 and FMA, and with AVX-512.

use super::{MAGIC, Vector};
use std::arch::x86_64::*;

/// AVX2 with FMA. Only code that runs behind [`has_avx2`](super::has_avx2) makes one.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(__m256);

// SAFETY of every block below: values of this type exist only in functions compiled for AVX2 and FMA and called
// after `has_avx2`, into which these methods are inlined; lengths of slices are checked before they are read.
impl Vector for Avx2 {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Avx2(unsafe { _mm256_set1_ps(value) })
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..8];
        Avx2(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn load_bytes(values: &[u8]) -> Self {
        let values = &values[..8];
        Avx2(unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(values.as_ptr().cast()))) })
    }
    #[inline(always)]
    fn load_upper_halves(values: &[u16]) -> Self {
        let values = &values[..8];
        Avx2(unsafe {
            let whole = _mm256_cvtepu16_epi32(_mm_loadu_si128(values.as_ptr().cast()));
            _mm256_castsi256_ps(_mm256_slli_epi32::<16>(whole))
        })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..8];
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
    fn where_positive(self, above: Self, other: Self) -> Self {
        Avx2(unsafe {
            let is_positive = _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, _mm256_setzero_ps());
            _mm256_blendv_ps(other.0, above.0, is_positive)
        })
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

/// AVX-512F. Only code that runs behind [`has_avx512`](super::has_avx512) makes one.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(__m512);

// SAFETY of every block below: values of this type exist only in functions compiled for AVX-512F and called
// after `has_avx512`, into which these methods are inlined; lengths of slices are checked before they are read.
impl Vector for Avx512 {
    const LANES: usize = 16;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Avx512(unsafe { _mm512_set1_ps(value) })
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..16];
        Avx512(unsafe { _mm512_loadu_ps(values.as_ptr()) })
    }
    #[inline(always)]
    fn load_bytes(values: &[u8]) -> Self {
        let values = &values[..16];
        Avx512(unsafe { _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(values.as_ptr().cast()))) })
    }
    #[inline(always)]
    fn load_upper_halves(values: &[u16]) -> Self {
        let values = &values[..16];
        Avx512(unsafe {
            let whole = _mm512_cvtepu16_epi32(_mm256_loadu_si256(values.as_ptr().cast()));
            _mm512_castsi512_ps(_mm512_slli_epi32::<16>(whole))
        })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..16];
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_add_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_sub_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_mul_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_div_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Avx512(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_max_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Avx512(unsafe { _mm512_min_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Avx512(unsafe { _mm512_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn where_positive(self, above: Self, other: Self) -> Self {
        Avx512(unsafe {
            let is_positive = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_ps());
            _mm512_mask_blend_ps(is_positive, other.0, above.0)
        })
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, _mm512_setzero_ps()) != 0 }
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        unsafe {
            let mantissa = _mm512_getmant_ps::<_MM_MANT_NORM_1_2, _MM_MANT_SIGN_ZERO>(self.0);
            (Avx512(_mm512_getexp_ps(self.0)), Avx512(mantissa))
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        Avx512(unsafe { _mm512_scalef_ps(_mm512_set1_ps(1.0), self.0) })
    }
    #[inline(always)]
    fn round(self) -> Self {
        unsafe {
            let magic = _mm512_set1_ps(MAGIC);
            Avx512(_mm512_sub_ps(_mm512_add_ps(self.0, magic), magic))
        }
    }
}
