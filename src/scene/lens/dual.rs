//! Numbers that carry their derivatives, so that a formula of a lens is written once and gives its Jacobian too.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What a formula of a lens is written in: `f64`, or [`Dual`] for the value with its derivatives.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// The value alone.
    fn value(self) -> f64;
    /// Square root; of 0 the derivative counts as 0.
    fn sqrt(self) -> Self;
    /// Arc tangent of `self / right`, right of the branch cut.
    fn atan2(self, right: Self) -> Self;
    /// Sine.
    fn sin(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
}

impl Real for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn atan2(self, right: Self) -> Self {
        f64::atan2(self, right)
    }
    fn sin(self) -> Self {
        f64::sin(self)
    }
    fn cos(self) -> Self {
        f64::cos(self)
    }
}

/// A value and its derivatives by two variables (forward-mode differentiation).
#[derive(Clone, Copy, Debug)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Derivatives by the first and the second variable.
    pub by: [f64; 2],
}

impl Dual {
    /// The first variable.
    pub fn first(value: f64) -> Self {
        Dual { value, by: [1.0, 0.0] }
    }

    /// The second variable.
    pub fn second(value: f64) -> Self {
        Dual { value, by: [0.0, 1.0] }
    }

    fn chained(self, value: f64, slope: f64) -> Self {
        Dual { value, by: self.by.map(|by| by * slope) }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Dual { value: self.value + other.value, by: [self.by[0] + other.by[0], self.by[1] + other.by[1]] }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

// Derivatives of a product and a quotient are sums.
#[allow(clippy::suspicious_arithmetic_impl)]
impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let by = [0, 1].map(|i| self.by[i] * other.value + self.value * other.by[i]);
        Dual { value: self.value * other.value, by }
    }
}

// Derivatives of a product and a quotient are sums.
#[allow(clippy::suspicious_arithmetic_impl)]
impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Dual { value, by: [0, 1].map(|i| (self.by[i] - value * other.by[i]) / other.value) }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Dual { value: -self.value, by: self.by.map(|by| -by) }
    }
}

impl Real for Dual {
    fn constant(value: f64) -> Self {
        Dual { value, by: [0.0; 2] }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chained(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }
    fn atan2(self, right: Self) -> Self {
        let squared = self.value * self.value + right.value * right.value;
        let by = [0, 1].map(|i| (self.by[i] * right.value - self.value * right.by[i]) / squared);
        Dual { value: self.value.atan2(right.value), by }
    }
    fn sin(self) -> Self {
        self.chained(self.value.sin(), self.value.cos())
    }
    fn cos(self) -> Self {
        self.chained(self.value.cos(), -self.value.sin())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        fn formula<T: Real>(x: T, y: T) -> T {
            ((x * x + y).sqrt() / (y - T::constant(3.0))).sin() * x.atan2(y) - (x * y).cos()
        }
        let (x, y, step) = (0.7, 1.3, 1e-6);
        let exact = formula(Dual::first(x), Dual::second(y));
        assert_eq!(exact.value, formula(x, y));
        let by_x = (formula(x + step, y) - formula(x - step, y)) / (2.0 * step);
        let by_y = (formula(x, y + step) - formula(x, y - step)) / (2.0 * step);
        assert!((exact.by[0] - by_x).abs() < 1e-8 && (exact.by[1] - by_y).abs() < 1e-8);
    }
}
