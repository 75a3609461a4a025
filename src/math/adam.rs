//! What every user of Adam (Kingma and Ba 2015) shares: running means of a gradient and of its square.
//!
//! The two users differ in the rest: maps count the updates of each texel and share second moments, weights of a network
//! step all together. Each keeps its own decay and its own bias correction.

/// A gradient counts as not finite from here on: its square would be infinite, and an infinite second moment would hold
/// its number still for ever.
pub const LARGEST_GRADIENT: f32 = 1e18;

/// By which factors the moments forget, algorithm 1 of the paper: `beta_1` and `beta_2`, each in [0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decay {
    /// Of the mean gradient.
    pub first: f32,
    /// Of the mean squared gradient.
    pub second: f32,
}

impl Decay {
    /// Takes a gradient into both moments.
    #[inline(always)]
    pub fn accumulate(self, gradient: f32, first: &mut f32, second: &mut f32) {
        *first = self.first * *first + (1.0 - self.first) * gradient;
        *second = self.second * *second + (1.0 - self.second) * gradient * gradient;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_of_a_constant_gradient_approach_it_and_its_square() {
        let decay = Decay { first: 0.9, second: 0.99 };
        let (mut first, mut second) = (0.0, 0.0);
        decay.accumulate(-3.0, &mut first, &mut second);
        assert!((first + 0.3).abs() < 1e-6 && (second - 0.09).abs() < 1e-6, "{first} {second}");
        (0..2000).for_each(|_| decay.accumulate(-3.0, &mut first, &mut second));
        assert!((first + 3.0).abs() < 1e-4 && (second - 9.0).abs() < 1e-3, "{first} {second}");
    }
}
