//! The seven unknowns of one texel: diffuse reflectance and F0 of each channel, and the width that all channels share.
//!
//! With the width as it is a channel is a system of two. What the width changes ties the three together, as the last row
//! and column of an arrow: the six reflectances are eliminated, one number is left.

use super::cell_sums::System;

/// What multiplies a texel's unknowns in one channel of a pixel: diffuse reflectance, F0, and the change of the logarithm
/// of the width.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TexelTerms {
    pub(super) arriving: f64,
    pub(super) base: f64,
    pub(super) slope: f64,
}

/// Part of a pixel that one texel is: the pixel, and what multiplies the texel's unknowns per channel.
pub(super) struct Part {
    pub(super) pixel: u32,
    pub(super) arriving: [f32; 3],
    pub(super) base: [f32; 3],
    pub(super) slope: [f32; 3],
}

impl Part {
    pub(super) fn terms(&self, c: usize) -> TexelTerms {
        let [arriving, base, slope] = [self.arriving[c], self.base[c], self.slope[c]].map(f64::from);
        TexelTerms { arriving, base, slope }
    }
}

/// Sums over the pixels that show a texel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TexelSystem {
    /// Of each channel's two reflectances.
    pub(super) channels: [System; 3],
    /// Products of what multiplies a channel's reflectances and the width.
    ties: [[f64; 2]; 3],
    /// The width's own square, and its product with what is observed.
    width_width: f64,
    width_y: f64,
}

impl TexelSystem {
    /// Adds an observation `y = rho e + F0 s + change d` of a channel.
    pub(super) fn observe(&mut self, weight: f64, channel: usize, terms: TexelTerms, y: f64) {
        let TexelTerms { arriving, base, slope } = terms;
        self.channels[channel].observe(weight, arriving, base, y);
        self.ties[channel][0] += weight * arriving * slope;
        self.ties[channel][1] += weight * base * slope;
        self.width_width += weight * slope * slope;
        self.width_y += weight * slope * y;
    }

    /// Adds what is believed of a channel's reflectances: their means, and one over their variances.
    pub(super) fn believe_reflectances(&mut self, channel: usize, precisions: [f64; 2], [rho, specular]: [f64; 2]) {
        self.channels[channel].observe(precisions[0], 1.0, 0.0, rho);
        self.channels[channel].observe(precisions[1], 0.0, 1.0, specular);
    }

    /// Adds what is believed of the change of the width: its mean, and one over its variance.
    pub(super) fn believe_width(&mut self, precision: f64, mean: f64) {
        self.width_width += precision;
        self.width_y += precision * mean;
    }

    /// The best change of the logarithm of the width, whatever the reflectances are then, and how precisely it is known, in
    /// one over its variance. Reflectances may leave the unit square meanwhile. No change where nothing tells it.
    pub(super) fn width(&self) -> (f64, f64) {
        let (mut precision, mut pull) = (self.width_width, self.width_y);
        for (sums, [with_rho, with_specular]) in self.channels.iter().zip(self.ties) {
            let System { ee, es, ss, ey, sy, .. } = *sums;
            let determinant = ee * ss - es * es;
            let [rho, specular] = if determinant > 1e-12 * ee * ss {
                [(ss * with_rho - es * with_specular) / determinant, (ee * with_specular - es * with_rho) / determinant]
            } else {
                // Where nothing tells them apart one stands for both.
                let over = |tie: f64, square: f64| if square > 0.0 { tie / square } else { 0.0 };
                if ee > 0.0 { [over(with_rho, ee), 0.0] } else { [0.0, over(with_specular, ss)] }
            };
            precision -= with_rho * rho + with_specular * specular;
            pull -= ey * rho + sy * specular;
        }
        if precision > 1e-9 * self.width_width { (pull / precision, precision) } else { (0.0, 0.0) }
    }

    /// The best reflectances of a channel in the unit square once the width has changed.
    pub(super) fn reflectances(&self, channel: usize, change: f64) -> [f64; 2] {
        let mut sums = self.channels[channel];
        sums.ey -= self.ties[channel][0] * change;
        sums.sy -= self.ties[channel][1] * change;
        sums.solve().0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Pixels of three channels that follow these unknowns but for noise: channel, terms, and what is observed.
    fn pixels(truth: [f64; 7], noise: f64) -> Vec<(usize, TexelTerms, f64)> {
        let mut random = SequentialRandom::new(8);
        let mut number = || f64::from(random.next_number());
        (0..90)
            .map(|index| {
                let channel = index % 3;
                let terms = TexelTerms { arriving: 0.5 + number(), base: 3.0 * number(), slope: 2.0 * number() - 1.0 };
                let y = truth[channel] * terms.arriving + truth[3 + channel] * terms.base + truth[6] * terms.slope;
                (channel, terms, y + noise * (number() - 0.5))
            })
            .collect()
    }

    fn summed(pixels: &[(usize, TexelTerms, f64)]) -> TexelSystem {
        let mut sums = TexelSystem::default();
        for &(channel, terms, y) in pixels {
            sums.observe(1.0 + channel as f64, channel, terms, y);
        }
        sums
    }

    #[test]
    fn exact_pixels_give_back_all_seven() {
        let truth = [0.2, 0.4, 0.3, 0.05, 0.9, 0.5, -0.13];
        let sums = summed(&pixels(truth, 0.0));
        let (change, precision) = sums.width();
        assert!((change - truth[6]).abs() < 1e-10 && precision > 1.0, "{change} {precision}");
        for channel in 0..3 {
            let [rho, specular] = sums.reflectances(channel, change);
            assert!((rho - truth[channel]).abs() < 1e-10 && (specular - truth[3 + channel]).abs() < 1e-10);
        }
    }

    /// The eliminated system against the dense one: what is found has no slope in any of the seven unknowns, and the
    /// precision is how fast the cost rises once all others follow.
    #[test]
    fn what_is_found_is_least_squares_of_all_seven() {
        let noisy = pixels([0.2, 0.4, 0.3, 0.3, 0.6, 0.5, 0.1], 0.2);
        let mut sums = summed(&noisy);
        sums.believe_width(7.0, 0.02);
        let (change, precision) = sums.width();
        let at = |change: f64| {
            let of = [0, 1, 2].map(|channel| sums.reflectances(channel, change));
            [of[0][0], of[1][0], of[2][0], of[0][1], of[1][1], of[2][1], change]
        };
        let cost = |x: [f64; 7]| {
            let of_pixel = |&(c, terms, y): &(usize, TexelTerms, f64)| {
                let left = y - x[c] * terms.arriving - x[3 + c] * terms.base - x[6] * terms.slope;
                (1.0 + c as f64) * left * left
            };
            noisy.iter().map(of_pixel).sum::<f64>() + 7.0 * (x[6] - 0.02) * (x[6] - 0.02)
        };
        let best = at(change);
        for unknown in 0..7 {
            let moved = |by: f64| {
                let mut x = best;
                x[unknown] += by;
                cost(x)
            };
            let slope = (moved(1e-4) - moved(-1e-4)) / 2e-4;
            assert!(slope.abs() < 1e-6, "{unknown}: {slope}");
        }
        let rise = cost(at(change + 0.01)) - cost(best);
        assert!((rise / (precision * 1e-4) - 1.0).abs() < 1e-6, "{rise} {precision}");
    }

    #[test]
    fn what_no_pixel_tells_stays() {
        assert_eq!(TexelSystem::default().width(), (0.0, 0.0));
        // One pixel, whose reflectances cannot be told apart, and explain whatever the width would.
        let mut sums = TexelSystem::default();
        sums.observe(1.0, 0, TexelTerms { arriving: 1.0, base: 0.5, slope: 0.25 }, 0.75);
        assert_eq!(sums.width(), (0.0, 0.0));
        sums.believe_reflectances(0, [1e-3; 2], [0.1, 0.04]);
        sums.believe_width(100.0, 0.0);
        let (change, precision) = sums.width();
        assert!(change.abs() < 1e-4 && (precision / 100.0 - 1.0).abs() < 1e-3, "{change} {precision}");
    }
}
