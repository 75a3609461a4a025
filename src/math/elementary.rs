//! Elementary functions in `f32` that are inlined where they are called.
//!
//! A path asks for half a dozen angles, logarithms and sines at each surface hit. Those of the C library are functions
//! apart, some of them tens of nanoseconds long, which costs as much as the rays do. These are short polynomials, good
//! to a few units in the last place; the tests hold them against `f64`.

use std::f32::consts::{FRAC_PI_2, LN_2, PI};

/// The angle of `(x, y)` in `[-pi, pi]`, 0 for both 0; absolute error below 4e-7. Neither number may be infinite.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (x_size, y_size) = (x.abs(), y.abs());
    let (short, long) = if y_size > x_size { (x_size, y_size) } else { (y_size, x_size) };
    // Written so that a NaN stays one.
    let t = short / if long < f32::MIN_POSITIVE { f32::MIN_POSITIVE } else { long };
    // (atan t / t - 1) / t^2 on [0, 1], least largest error; summed in pairs, so that few sums wait for each other.
    let s = t * t;
    let s2 = s * s;
    let s4 = s2 * s2;
    let low = (-0.333_331_53 + 0.199_937_73 * s) + (-0.142_110_55 + 0.106_660_03 * s) * s2;
    let high = (-0.075_522_11 + 0.043_211_815 * s) + (-0.016_367_898 + 0.002_920_684_5 * s) * s2;
    let angle = t + t * s * (low + high * s4);
    let angle = if y_size > x_size { FRAC_PI_2 - angle } else { angle };
    let angle = if x.is_sign_negative() { PI - angle } else { angle };
    angle.copysign(y)
}

/// Sine and cosine of an angle in turns, a number from -1e6 to 1e6; absolute error below 2e-7.
#[inline(always)]
pub fn sin_cos_of_turns(turns: f32) -> (f32, f32) {
    // Quarter turns, and what is left of one, in [-1/2, 1/2]: exact, since powers of two are.
    let quarters = 4.0 * turns;
    let whole = (quarters + ROUNDING) - ROUNDING;
    let x = quarters - whole;
    let s = x * x;
    let sin = x * ((FRAC_PI_2 - 0.645_963_46 * s) + (0.079_680_03 - 0.004_601_658 * s) * (s * s));
    let cos = 1.0 + s * ((-1.233_700_6 + 0.253_669_25 * s) + (-0.020_860_29 + 0.000_904_021_6 * s) * (s * s));
    let quarter = whole as i32;
    let (sin, cos) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    let negative = |bit: i32| ((bit & 2) as u32) << 30;
    let with_sign = |value: f32, bit: i32| f32::from_bits(value.to_bits() ^ negative(bit));
    (with_sign(sin, quarter), with_sign(cos, quarter + 1))
}

/// `ln(1 - x)` for `x` in `[0, 1)`; relative error below 4e-7, however small `x` is.
#[inline(always)]
pub fn ln_one_minus(x: f32) -> f32 {
    // 1 - x = 2^exponent (1 + f) with 1 + f from sqrt(1/2) to sqrt(2). Without an exponent f is -x itself, which keeps
    // the digits that 1 - x has lost.
    let rest = 1.0 - x;
    let shifted = rest.to_bits().wrapping_sub(std::f32::consts::FRAC_1_SQRT_2.to_bits());
    let exponent = (shifted as i32) >> 23;
    let scaled = f32::from_bits(rest.to_bits().wrapping_sub((exponent << 23) as u32)) - 1.0;
    let f = if exponent == 0 { -x } else { scaled };
    // ln(1 + f) = 2 artanh(f / (2 + f)).
    let r = f / (2.0 + f);
    let r2 = r * r;
    let series = (2.0 / 3.0 + 2.0 / 5.0 * r2) + (2.0 / 7.0 + 2.0 / 9.0 * r2) * (r2 * r2);
    exponent as f32 * LN_2 + (2.0 * r + r * r2 * series)
}

/// `1 - e^x` for `x <= 0`; relative error below 4e-7, however near to 0 `x` is.
#[inline(always)]
pub fn one_minus_exp(x: f32) -> f32 {
    if x < -0.3 {
        return 1.0 - x.exp();
    }
    let x2 = x * x;
    let series = (1.0 / 2.0 + x * (1.0 / 6.0)) + (1.0 / 24.0 + x * (1.0 / 120.0)) * x2 + (1.0 / 720.0) * (x2 * x2);
    -(x + x2 * series)
}

/// The largest whole number that is not above `x`, for magnitudes below 2^31; 0 for NaN.
#[inline(always)]
pub fn floor(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(towards_zero as f32 > x)
}

/// 1.5 * 2^23: added and taken off again it leaves the nearest whole number of numbers below 2^22.
const ROUNDING: f32 = 12_582_912.0;

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn angles_are_those_of_double_precision() {
        let mut largest = 0.0f64;
        for step in 0..20_000 {
            let turn = (step as f64 + 0.37) / 20_000.0 * TAU;
            for length in [1e-12, 1.0, 1e12] {
                let (y, x) = ((length * turn.sin()) as f32, (length * turn.cos()) as f32);
                let error = f64::from(atan2(y, x)) - f64::from(y).atan2(f64::from(x));
                largest = largest.max(error.abs());
            }
        }
        assert!(largest < 4e-7, "{largest:e}");
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert_eq!(atan2(0.0, -1.0), PI);
        assert_eq!(atan2(-0.0, -1.0), -PI);
        assert_eq!((atan2(1.0, 0.0), atan2(-1.0, 0.0)), (FRAC_PI_2, -FRAC_PI_2));
        assert!(atan2(f32::NAN, 1.0).is_nan() && atan2(1.0, f32::NAN).is_nan(), "what is no number stays none");
        // Small angles keep their digits.
        assert!((atan2(1e-20, 1.0) / 1e-20 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn sines_and_cosines_of_turns() {
        let mut largest = 0.0f64;
        for step in -30_000..30_000 {
            let turns = step as f32 / 10_007.0;
            let (sin, cos) = sin_cos_of_turns(turns);
            let angle = TAU * f64::from(turns);
            largest = largest.max((f64::from(sin) - angle.sin()).abs()).max((f64::from(cos) - angle.cos()).abs());
        }
        assert!(largest < 2e-7, "{largest:e}");
        let quarters = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)];
        for (quarter, expected) in quarters.into_iter().enumerate() {
            assert_eq!(sin_cos_of_turns(0.25 * quarter as f32), expected, "{quarter} quarter turns");
        }
        assert!(sin_cos_of_turns(f32::NAN).0.is_nan());
    }

    #[test]
    fn floors_of_either_sign() {
        for (x, below) in [(0.0, 0), (-0.5, -1), (0.999_999_94, 0), (-1.0, -1), (7.5, 7), (-2.0001, -3), (f32::NAN, 0)]
        {
            assert_eq!(floor(x), below, "{x}");
        }
    }

    #[test]
    fn logarithms_and_exponentials_near_one_keep_their_digits() {
        let mut largest = [0.0f64; 2];
        for step in 0..40_000 {
            // From 1e-14 to 1, evenly in the logarithm.
            let x = 10f64.powf(-14.0 * step as f64 / 40_000.0) as f32 * 0.999_999_9;
            let exact = [(-f64::from(x)).ln_1p(), -(-30.0 * f64::from(x)).exp_m1()];
            let found = [ln_one_minus(x), one_minus_exp(-30.0 * x)];
            for k in 0..2 {
                // The argument of the exponential is rounded itself.
                largest[k] = largest[k].max((f64::from(found[k]) / exact[k] - 1.0).abs());
            }
        }
        assert!(largest[0] < 4e-7 && largest[1] < 4e-7, "{largest:?}");
        assert_eq!((ln_one_minus(0.0), one_minus_exp(0.0)), (0.0, 0.0));
        assert_eq!(one_minus_exp(-200.0), 1.0);
        assert!(one_minus_exp(f32::NAN).is_nan());
    }
}
