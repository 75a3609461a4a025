//! Numbers the reflection lobe and the path sums can run in.
//!
//! `f32` is what renders and fits. `f64` audits gradients by finite differences without rounding in the way.
//! [`Dual`] carries a derivative along one direction: run through a reverse pass it yields a Hessian-vector product
//! (forward over reverse), which the exact gradient of the consistency loss needs.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A number with the few operations that shading needs.
pub trait Real:
    Copy
    + Debug
    + Default
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// The number nearest to an `f32`, without derivative.
    fn from_f32(value: f32) -> Self;
    /// The number nearest to an `f64`, without derivative.
    fn from_f64(value: f64) -> Self;
    /// The value, without derivative, rounded to `f32`.
    fn to_f32(self) -> f32;
    /// The exponential.
    fn exp(self) -> Self;
    /// The square root of a positive number.
    fn sqrt(self) -> Self;
    /// Whether value and derivative are finite.
    fn is_finite(self) -> bool;
    /// Zero.
    fn zero() -> Self {
        Self::default()
    }
    /// Whether the value, without its derivative, is exactly zero: a test for skipping work, never for branching.
    fn is_zero(self) -> bool;
}

macro_rules! impl_real_for_float {
    ($float:ty) => {
        impl Real for $float {
            #[inline(always)]
            fn from_f32(value: f32) -> Self {
                value as $float
            }
            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $float
            }
            #[inline(always)]
            fn to_f32(self) -> f32 {
                self as f32
            }
            #[inline(always)]
            fn exp(self) -> Self {
                <$float>::exp(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$float>::sqrt(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$float>::is_finite(self)
            }
            #[inline(always)]
            fn is_zero(self) -> bool {
                self == 0.0
            }
        }
    };
}

impl_real_for_float!(f32);
impl_real_for_float!(f64);

/// A value and its derivative along one direction of parameter space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<T> {
    /// The value.
    pub value: T,
    /// The derivative along the chosen direction.
    pub tangent: T,
}

impl<T: Real> Dual<T> {
    /// A value that moves with `tangent` along the direction.
    pub fn new(value: T, tangent: T) -> Self {
        Dual { value, tangent }
    }
}

impl<T: Real> Add for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Dual::new(self.value + other.value, self.tangent + other.tangent)
    }
}

impl<T: Real> Sub for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Dual::new(self.value - other.value, self.tangent - other.tangent)
    }
}

impl<T: Real> Mul for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Dual::new(self.value * other.value, self.tangent * other.value + self.value * other.tangent)
    }
}

impl<T: Real> Div for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        Dual::new(quotient, (self.tangent - quotient * other.tangent) / other.value)
    }
}

impl<T: Real> Neg for Dual<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual::new(-self.value, -self.tangent)
    }
}

impl<T: Real> AddAssign for Dual<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Real> Real for Dual<T> {
    #[inline(always)]
    fn from_f32(value: f32) -> Self {
        Dual::new(T::from_f32(value), T::zero())
    }
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Dual::new(T::from_f64(value), T::zero())
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self.value.to_f32()
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        Dual::new(value, value * self.tangent)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Dual::new(value, self.tangent / (value + value))
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.tangent.is_finite()
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.value.is_zero() && self.tangent.is_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dual_numbers_agree_with_central_differences() {
        fn curve<T: Real>(x: T) -> T {
            (x * x + T::from_f64(0.5)).exp() / (x + T::from_f64(2.0)).sqrt() - x
        }
        for x in [-1.5f64, -0.1, 0.0, 0.7, 1.3] {
            let step = 1e-5;
            let difference = (curve(x + step) - curve(x - step)) / (2.0 * step);
            let dual = curve(Dual::new(x, 1.0));
            assert!((dual.tangent - difference).abs() < 1e-8 * (1.0 + difference.abs()));
            assert_eq!(dual.value, curve(x));
        }
    }
}
