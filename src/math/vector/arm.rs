//! [`Vector`] with NEON, which every 64-bit Arm processor has.

use super::Vector;
use std::arch::aarch64::*;

/// NEON, four numbers.
#[derive(Clone, Copy, Debug)]
pub struct Neon(float32x4_t);

// SAFETY of every block below: NEON is part of the architecture; lengths of slices are checked before they are read or
// written.
impl Vector for Neon {
    const LANES: usize = 4;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Neon(unsafe { vdupq_n_f32(value) })
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..4];
        Neon(unsafe { vld1q_f32(values.as_ptr()) })
    }
    #[inline(always)]
    fn load_bytes(values: &[u8]) -> Self {
        let four = u32::from_le_bytes([values[0], values[1], values[2], values[3]]);
        Neon(unsafe { vcvtq_f32_u32(vmovl_u16(vget_low_u16(vmovl_u8(vcreate_u8(u64::from(four)))))) })
    }
    #[inline(always)]
    fn load_upper_halves(values: &[u16]) -> Self {
        let values = &values[..4];
        Neon(unsafe { vreinterpretq_f32_u32(vshlq_n_u32::<16>(vmovl_u16(vld1_u16(values.as_ptr())))) })
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..4];
        unsafe { vst1q_f32(values.as_mut_ptr(), self.0) }
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Neon(unsafe { vaddq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Neon(unsafe { vsubq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Neon(unsafe { vmulq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Neon(unsafe { vdivq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Neon(unsafe { vfmaq_f32(term.0, self.0, factor.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Neon(unsafe { vmaxq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Neon(unsafe { vminq_f32(self.0, other.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Neon(unsafe { vsqrtq_f32(self.0) })
    }
    #[inline(always)]
    fn where_positive(self, above: Self, other: Self) -> Self {
        Neon(unsafe { vbslq_f32(vcgtq_f32(self.0, vdupq_n_f32(0.0)), above.0, other.0) })
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        unsafe { vmaxvq_f32(self.0) > 0.0 }
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        unsafe {
            let bits = vreinterpretq_u32_f32(self.0);
            let exponent = vsubq_f32(vcvtq_f32_u32(vshrq_n_u32::<23>(bits)), vdupq_n_f32(127.0));
            let mantissa = vorrq_u32(vandq_u32(bits, vdupq_n_u32(0x007f_ffff)), vdupq_n_u32(0x3f80_0000));
            (Neon(exponent), Neon(vreinterpretq_f32_u32(mantissa)))
        }
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        unsafe {
            let biased = vcvtq_u32_f32(vaddq_f32(self.0, vdupq_n_f32(127.0)));
            Neon(vreinterpretq_f32_u32(vshlq_n_u32::<23>(biased)))
        }
    }
    #[inline(always)]
    fn round(self) -> Self {
        Neon(unsafe { vrndnq_f32(self.0) })
    }
}
