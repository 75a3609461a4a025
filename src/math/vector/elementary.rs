//! Angles, sines, logarithms and exponentials of several numbers, good to a few units in the last place.

use super::Vector;
use std::f32::consts::{FRAC_PI_2, LN_2, LOG2_E, PI, TAU};

/// Angle of (x, y) in (-pi, pi], to 5e-7: Abramowitz and Stegun 1964, 4.4.49.
#[inline(always)]
pub fn angle<V: Vector>(y: V, x: V) -> V {
    let zero = V::splat(0.0);
    let (x_size, y_size) = (x.max(zero.sub(x)), y.max(zero.sub(y)));
    let t = x_size.min(y_size).div(x_size.max(y_size).max(V::splat(1e-30)));
    let t2 = t.mul(t);
    let series = V::splat(0.002_866_225_7)
        .mul_add(t2, V::splat(-0.016_165_737))
        .mul_add(t2, V::splat(0.042_909_614))
        .mul_add(t2, V::splat(-0.075_289_64))
        .mul_add(t2, V::splat(0.106_562_64))
        .mul_add(t2, V::splat(-0.142_089))
        .mul_add(t2, V::splat(0.199_935_51))
        .mul_add(t2, V::splat(-0.333_331_45));
    let angle = series.mul(t2).mul_add(t, t);
    let angle = y_size.sub(x_size).where_positive(V::splat(FRAC_PI_2).sub(angle), angle);
    let angle = zero.sub(x).where_positive(V::splat(PI).sub(angle), angle);
    zero.sub(y).where_positive(zero.sub(angle), angle)
}

/// `e^x - 1` for `x` in [-4, 0], with relative error below 1e-6.
#[inline(always)]
pub fn exp_minus_one<V: Vector>(x: V) -> V {
    // e^2x - 1 = (e^x - 1) (e^x - 1 + 2), three times.
    let t = x.mul(V::splat(0.125));
    let series = V::splat(1.0 / 5040.0)
        .mul_add(t, V::splat(1.0 / 720.0))
        .mul_add(t, V::splat(1.0 / 120.0))
        .mul_add(t, V::splat(1.0 / 24.0))
        .mul_add(t, V::splat(1.0 / 6.0))
        .mul_add(t, V::splat(0.5))
        .mul_add(t, V::splat(1.0));
    let eighth = series.mul(t);
    let two = V::splat(2.0);
    let quarter = eighth.mul(eighth.add(two));
    let half = quarter.mul(quarter.add(two));
    half.mul(half.add(two))
}

/// `1 - e^x` for `x` in [-80, 0], with relative error below 1e-6.
#[inline(always)]
pub fn one_minus_exp<V: Vector>(x: V) -> V {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let near = zero.sub(exp_minus_one(x.max(V::splat(-1.0))));
    let far = one.sub(x.mul(V::splat(LOG2_E)).exp2());
    x.add(one).where_positive(near, far)
}

/// `ln(1 - x)` for `x` in [0, 1), with relative error below 1e-6, however small `x` is.
#[inline(always)]
pub fn ln_one_minus<V: Vector>(x: V) -> V {
    let (zero, two) = (V::splat(0.0), V::splat(2.0));
    // Near 1 as 2 artanh of -x / (2 - x), which takes x as it is.
    let bound = V::splat(0.3);
    let near = x.min(bound);
    let r = zero.sub(near).div(two.sub(near));
    let r2 = r.mul(r);
    let series = V::splat(2.0 / 9.0)
        .mul_add(r2, V::splat(2.0 / 7.0))
        .mul_add(r2, V::splat(2.0 / 5.0))
        .mul_add(r2, V::splat(2.0 / 3.0))
        .mul_add(r2, two);
    let far = V::splat(1.0).sub(x.max(bound)).log2().mul(V::splat(LN_2));
    bound.sub(x).where_positive(series.mul(r), far)
}

/// Sine of an angle in turns, from -1/4 to 1/4; absolute error below 2e-7.
#[inline(always)]
pub fn sine_of_turns<V: Vector>(turns: V) -> V {
    // Odd, with the least largest relative error.
    let t2 = turns.mul(turns);
    V::splat(39.710_913)
        .mul_add(t2, V::splat(-76.574_99))
        .mul_add(t2, V::splat(81.602_23))
        .mul_add(t2, V::splat(-41.341_68))
        .mul_add(t2, V::splat(TAU))
        .mul(turns)
}

/// Sine and cosine of angles in [0, 1] turns.
#[inline(always)]
pub fn sine_and_cosine_of_turns<V: Vector>(turns: V) -> (V, V) {
    let (zero, quarter, half) = (V::splat(0.0), V::splat(0.25), V::splat(0.5));
    // Half a turn back both change their sign, and what is left lies half a turn to either side.
    let x = turns.sub(half);
    let size = x.max(zero.sub(x));
    let sine = sine_of_turns(size.min(half.sub(size)));
    (x.where_positive(zero.sub(sine), sine), sine_of_turns(size.sub(quarter)))
}

#[cfg(test)]
mod tests {
    use super::super::{Plain, WIDEST};
    use super::*;

    /// A function of one number, by way of a vector.
    fn of(function: fn(Plain) -> Plain, x: f32) -> f64 {
        let mut found = [0.0; WIDEST];
        function(Plain::splat(x)).store(&mut found);
        f64::from(found[0])
    }

    #[test]
    fn exponentials_near_zero_keep_their_digits() {
        for step in 0..4000 {
            let x = -4.0 * (step as f32 / 4000.0).powi(4) - 1e-9;
            let (found, exact) = (of(exp_minus_one, x), f64::from(x).exp_m1());
            assert!((found / exact - 1.0).abs() < 1e-6, "{x}: {found} {exact}");
        }
    }

    #[test]
    fn logarithms_and_exponentials_keep_their_digits_from_one_end_to_the_other() {
        let mut largest = [0.0f64; 2];
        for step in 0..40_000 {
            let x = 10f64.powf(-14.0 * step as f64 / 40_000.0) as f32 * 0.999_999_9;
            let logarithm = of(ln_one_minus, x) / (-f64::from(x)).ln_1p();
            let argument = -60.0 * x;
            let exponential = of(one_minus_exp, argument) / -f64::from(argument).exp_m1();
            for (largest, ratio) in largest.iter_mut().zip([logarithm, exponential]) {
                *largest = largest.max((ratio - 1.0).abs());
            }
        }
        assert!(largest[0] < 1e-6 && largest[1] < 1e-6, "{largest:?}");
        assert_eq!((of(ln_one_minus, 0.0), of(one_minus_exp, 0.0)), (0.0, 0.0));
    }

    #[test]
    fn angles_are_those_of_double_precision() {
        for step in 0..20_000 {
            let (sine, cosine) = (std::f64::consts::TAU * (step as f64 + 0.37) / 20_000.0).sin_cos();
            for length in [1e-12, 1.0, 1e12] {
                let (y, x) = ((length * sine) as f32, (length * cosine) as f32);
                let mut found = [0.0; WIDEST];
                angle(Plain::splat(y), Plain::splat(x)).store(&mut found);
                let exact = f64::from(y).atan2(f64::from(x));
                assert!((f64::from(found[0]) - exact).abs() < 5e-7, "{y} {x}: {} {exact}", found[0]);
            }
        }
    }

    #[test]
    fn sines_of_turns() {
        for step in -1000..=1000 {
            let turns = step as f32 / 4000.0;
            let exact = (std::f64::consts::TAU * f64::from(turns)).sin();
            assert!((of(sine_of_turns, turns) - exact).abs() < 2e-7, "{turns}");
        }
        for step in 0..=4000 {
            let turns = step as f32 / 4000.0;
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(turns)).sin_cos();
            let off = [
                of(|turns| sine_and_cosine_of_turns(turns).0, turns) - sine,
                of(|turns| sine_and_cosine_of_turns(turns).1, turns) - cosine,
            ];
            assert!(off[0].abs() < 4e-7 && off[1].abs() < 4e-7, "{turns}: {off:?}");
        }
    }
}
