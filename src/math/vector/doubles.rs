//! Four `f64` side by side, in plain loops: what evidence is weighed with, where `f32` has too few digits.
//!
//! Compilers turn such loops into the vectors of what they compile for; the macro `versions_of_doubles` makes the function
//! that has a kernel compiled for AVX2 as well and decides at run time. Nothing is rounded otherwise in one than in another.

use std::f64::consts::{LOG2_E, SQRT_2};
use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// How many they are.
pub const DOUBLES: usize = 4;

/// Four numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Doubles(pub [f64; DOUBLES]);

/// 1.5 * 2^52: adding it leaves the nearest whole number in the low bits.
const MAGIC: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts: the first has so few digits that a whole number of them is exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Bits of a number's mantissa, and of the exponent of 1.
const MANTISSA: u64 = 0x000f_ffff_ffff_ffff;
const ONE: u64 = 0x3ff0_0000_0000_0000;
/// 2^52, whose low bits a number of 52 bits may take: that number more.
const HIGH: u64 = 0x4330_0000_0000_0000;

macro_rules! operator {
    ($($of:ident $name:ident $assign:tt)*) => {$(
        impl $of for Doubles {
            type Output = Doubles;
            #[inline(always)]
            fn $name(mut self, other: Doubles) -> Doubles {
                for k in 0..DOUBLES {
                    self.0[k] $assign other.0[k];
                }
                self
            }
        }
    )*};
}
operator! { Add add += Sub sub -= Mul mul *= Div div /= }

impl AddAssign for Doubles {
    #[inline(always)]
    fn add_assign(&mut self, other: Doubles) {
        *self = *self + other;
    }
}

impl Doubles {
    /// The same number four times.
    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        Doubles([value; DOUBLES])
    }

    /// Sum of all, half onto half.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (a + c) + (b + d)
    }

    /// The largest of all.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        let [a, b, c, d] = self.0;
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        larger(larger(a, c), larger(b, d))
    }

    /// The larger of two, number by number; the other's where one is not a number.
    #[inline(always)]
    pub fn max(mut self, other: Doubles) -> Self {
        for k in 0..DOUBLES {
            self.0[k] = if self.0[k] > other.0[k] { self.0[k] } else { other.0[k] };
        }
        self
    }

    /// The smaller of two, number by number; the other's where one is not a number.
    #[inline(always)]
    pub fn min(mut self, other: Doubles) -> Self {
        for k in 0..DOUBLES {
            self.0[k] = if self.0[k] < other.0[k] { self.0[k] } else { other.0[k] };
        }
        self
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(mut self) -> Self {
        for value in &mut self.0 {
            *value = value.sqrt();
        }
        self
    }

    /// `e^x` for `x` in [-700, 700], beyond which it stays what it is there. Relative error below 1e-15.
    #[inline(always)]
    pub fn exp(self) -> Self {
        let x = self.max(Doubles::splat(-700.0)).min(Doubles::splat(700.0));
        let shifted = x * Doubles::splat(LOG2_E) + Doubles::splat(MAGIC);
        let whole = shifted - Doubles::splat(MAGIC);
        let t = x - whole * Doubles::splat(LN_2_HIGH) - whole * Doubles::splat(LN_2_LOW);
        // Taylor: |t| is 0.35 at most.
        let mut series = Doubles::splat(1.0 / 479_001_600.0);
        for factor in [39_916_800.0, 3_628_800.0, 362_880.0, 40_320.0, 5_040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0]
        {
            series = series * t + Doubles::splat(1.0 / factor);
        }
        let mut power = Doubles::default();
        for k in 0..DOUBLES {
            power.0[k] = f64::from_bits(shifted.0[k].to_bits().wrapping_add(1023) << 52);
        }
        series * power
    }

    /// Natural logarithm of positive normal numbers. Absolute error below 1e-15 of the larger of 1 and the logarithm.
    #[inline(always)]
    pub fn ln(self) -> Self {
        let (mut exponent, mut mantissa) = (Doubles::default(), Doubles::default());
        for k in 0..DOUBLES {
            let bits = self.0[k].to_bits();
            let (above, whole) = (f64::from_bits(bits & MANTISSA | ONE), f64::from_bits(bits >> 52 | HIGH));
            let halved = above > SQRT_2;
            mantissa.0[k] = if halved { 0.5 * above } else { above };
            exponent.0[k] = whole - f64::from_bits(HIGH) - if halved { 1022.0 } else { 1023.0 };
        }
        // ln m = 2 artanh s, |s| is 0.172 at most.
        let s = (mantissa - Doubles::splat(1.0)) / (mantissa + Doubles::splat(1.0));
        let s2 = s * s;
        let mut series = Doubles::splat(2.0 / 21.0);
        for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
            series = series * s2 + Doubles::splat(2.0 / odd);
        }
        exponent * Doubles::splat(LN_2_HIGH) + (series * s + exponent * Doubles::splat(LN_2_LOW))
    }
}

/// A function that runs a kernel of [`Doubles`] as it was compiled for the vectors of the machine:
/// `versions_of_doubles! { fn name(argument: Type) -> Type = kernel; }`. The kernel and all it calls have to be inlined.
macro_rules! versions_of_doubles {
    ($($(#[$about:meta])* $visibility:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?
        = $kernel:ident;)*) => {$(
        $(#[$about])*
        #[inline]
        $visibility fn $name($($argument: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($argument: $type),*) $(-> $result)? {
                    $kernel($($argument),*)
                }
                if $crate::math::vector::has_avx2() {
                    // SAFETY: the processor has what the function is compiled for.
                    return unsafe { avx2($($argument),*) };
                }
            }
            $kernel($($argument),*)
        }
    )*};
}
pub(crate) use versions_of_doubles;

#[cfg(test)]
mod tests {
    use super::*;

    versions_of_doubles! {
        fn exponentials(x: Doubles) -> Doubles = exponentials_in;
        fn logarithms(x: Doubles) -> Doubles = logarithms_in;
    }

    #[inline(always)]
    fn exponentials_in(x: Doubles) -> Doubles {
        x.exp()
    }

    #[inline(always)]
    fn logarithms_in(x: Doubles) -> Doubles {
        x.ln()
    }

    #[test]
    fn exponentials_and_logarithms_are_the_standard_librarys_in_all_versions() {
        for step in 0..50_000 {
            let x = 1400.0 * (f64::from(step) + 0.31) / 50_000.0 - 700.0;
            let numbers = Doubles([x, 0.01 * x, 1e-9 * x, -x]);
            assert_eq!(exponentials(numbers), numbers.exp());
            for (found, own) in numbers.exp().0.into_iter().zip(numbers.0) {
                assert!((found / own.exp() - 1.0).abs() < 1e-15 * (1.0 + own.abs()), "e^{own}: {found}");
            }
            let numbers = Doubles(numbers.exp().0.map(|value| value.max(f64::MIN_POSITIVE)));
            assert_eq!(logarithms(numbers), numbers.ln());
            for (found, own) in numbers.ln().0.into_iter().zip(numbers.0) {
                assert!((found - own.ln()).abs() < 1e-15 * own.ln().abs().max(1.0), "ln {own}: {found} {}", own.ln());
            }
        }
    }

    #[test]
    fn beyond_its_reach_an_exponential_stays_and_is_a_number() {
        let least = (-700.0f64).exp();
        let Doubles([infinite, below, not_a_number, above]) =
            Doubles([f64::NEG_INFINITY, -1e9, f64::NAN, f64::INFINITY]).exp();
        for found in [infinite, below, not_a_number] {
            assert!((found / least - 1.0).abs() < 1e-12, "{found}");
        }
        assert!((above.ln() - 700.0).abs() < 1e-12);
        assert_eq!(Doubles([1.0, 2.0, 4.0, 8.0]).sum(), 15.0);
    }
}
