//! Elementary functions in `f32` that are inlined where they are called.
//!
//! Where a direction reads the environment asks for two angles, and a texture for two floors, several times a path. Those
//! of the C library are functions apart, tens of nanoseconds long; these are a short polynomial, good to a few units in the
//! last place, and a cast. What paths ask for side by side is in `vector::elementary`.

use std::f32::consts::{FRAC_PI_2, PI};

/// The angle of `(x, y)` in `[-pi, pi]`, for both 0 that of the sign of `x`: 0, or pi for -0. Absolute error below
/// 4e-7. Neither number may be infinite.
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

/// The largest whole number that is not above `x`, for magnitudes below 2^31; 0 for NaN.
#[inline(always)]
pub fn floor(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(towards_zero as f32 > x)
}

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
    fn floors_of_either_sign() {
        for (x, below) in [(0.0, 0), (-0.5, -1), (0.999_999_94, 0), (-1.0, -1), (7.5, 7), (-2.0001, -3), (f32::NAN, 0)]
        {
            assert_eq!(floor(x), below, "{x}");
        }
    }
}
