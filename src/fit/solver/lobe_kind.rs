//! How likely a group's pixels are at one width if it is of one kind of surface ([`super::lobe_prior`]).
//!
//! Diffuse reflectance and F0 are normal before looking, so that both are integrated in closed form; F0 of the three
//! channels has a part in common, which makes it one system of three unknowns.

use super::cell_sums::System;
use super::lobe_prior::LobeKind;

/// A kind of surface, ready to be asked. The inverse covariance of F0 has one number on its diagonal and one beside it.
pub(super) struct KindEvidence {
    diagonal: f64,
    beside: f64,
    /// Inverse covariance times the mean of F0, and once more by the mean.
    side: [f64; 3],
    cost: f64,
    /// Determinant of the covariance of F0, times the variance of diffuse reflectance of each channel.
    volume: f64,
    log_share: f64,
    /// What is believed of diffuse reflectance, as sums over pixels.
    ee: f64,
    ey: [f64; 3],
    yy: [f64; 3],
}

impl KindEvidence {
    /// For groups among texels whose mean diffuse reflectance is `around`.
    pub(super) fn new(kind: &LobeKind, around: [f64; 3]) -> Self {
        let (mean, common, own) = (kind.specular.0, kind.specular.1.powi(2), kind.specular.2.powi(2));
        let share = common / (own + 3.0 * common);
        let (diagonal, beside) = ((1.0 - share) / own, -share / own);
        let sum: f64 = mean.iter().sum();
        let side = mean.map(|value| (diagonal - beside) * value + beside * sum);
        let variance = kind.diffuse.1.powi(2);
        let diffuse = kind.diffuse.0.unwrap_or(around);
        KindEvidence {
            diagonal,
            beside,
            side,
            cost: (0..3).map(|c| side[c] * mean[c]).sum(),
            volume: own * own * (own + 3.0 * common) * variance.powi(3),
            log_share: kind.share.ln(),
            ee: 1.0 / variance,
            ey: diffuse.map(|value| value / variance),
            yy: diffuse.map(|value| value * value / variance),
        }
    }

    /// The evidence at one width, with mean and variance of F0 per channel: the logarithm of one factor, and the square of
    /// what it is divided by, whose logarithm kinds need not take one by one.
    ///
    /// Diffuse reflectance is integrated out, and it is at least zero: in a channel where it would be less at the best
    /// F0 it is held at zero, and F0 found anew. Without that, wide and strong lobes over what they outshine, made up
    /// for by less than black below, took over photographs (`saharov_bmvs`: RMSE of the maps .0446, with it .0367).
    pub(super) fn at_width(&self, sums: &[System; 3]) -> (f64, f64, [(f64, f64); 3]) {
        let all: [System; 3] = std::array::from_fn(|c| System {
            ee: sums[c].ee + self.ee,
            ey: sums[c].ey + self.ey[c],
            yy: sums[c].yy + self.yy[c],
            ..sums[c]
        });
        let volume = self.volume * all[0].ee * all[1].ee * all[2].ee;
        let mut held = [false; 3];
        loop {
            let (mut own, mut side, mut cost) = ([self.diagonal; 3], self.side, self.cost);
            for (c, &System { ee, es, ss, ey, sy, yy }) in all.iter().enumerate() {
                let keep = if held[c] { 0.0 } else { 1.0 / ee };
                own[c] += ss - es * es * keep;
                side[c] += sy - es * ey * keep;
                cost += yy - ey * ey * keep;
            }
            // The matrix has `own` on its diagonal and one number beside it: its inverse by cofactors.
            let ([a, b, c], q) = (own, self.beside);
            let cofactors = [b * c - q * q, a * c - q * q, a * b - q * q];
            let [across_ab, across_ac, across_bc] = [c, b, a].map(|other| q * q - q * other);
            let determinant = a * cofactors[0] + q * (across_ab + across_ac);
            let best = [
                (cofactors[0] * side[0] + across_ab * side[1] + across_ac * side[2]) / determinant,
                (across_ab * side[0] + cofactors[1] * side[1] + across_bc * side[2]) / determinant,
                (across_ac * side[0] + across_bc * side[1] + cofactors[2] * side[2]) / determinant,
            ];
            let below = [0, 1, 2].map(|c| !held[c] && all[c].ey < all[c].es * best[c]);
            if below == [false; 3] {
                let explained: f64 = (0..3).map(|c| side[c] * best[c]).sum();
                let log = self.log_share - 0.5 * (cost - explained);
                let variance = |c: usize| (cofactors[c] / determinant).max(0.0);
                return (log, determinant * volume, [0, 1, 2].map(|c| (best[c].clamp(0.0, 1.0), variance(c))));
            }
            held = [0, 1, 2].map(|c| held[c] || below[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lobe_prior::LobePrior;
    use super::*;
    use crate::math::random::SequentialRandom;
    use glam::{DMat3, DVec3};

    /// Sums of pixels that show a surface of F0 `.3` over a diffuse reflectance of `.2`, and some noise.
    fn pixels(count: usize) -> [System; 3] {
        let mut random = SequentialRandom::new(3);
        let mut sums = [System::default(); 3];
        for _ in 0..count {
            for sums in &mut sums {
                let [e, s, noise] = [(); 3].map(|()| f64::from(random.next_number()));
                sums.observe(40.0, 0.5 + e, s, 0.2 * (0.5 + e) + 0.3 * s + 0.02 * noise);
            }
        }
        sums
    }

    #[test]
    fn a_width_is_judged_as_by_whole_matrices() {
        for kind in &LobePrior::default().families[0].kinds {
            for count in [0, 1, 30] {
                let (around, sums) = ([0.3, 0.25, 0.2], pixels(count));
                let (log, divisor_squared, of_channels) = KindEvidence::new(kind, around).at_width(&sums);
                let log = log - 0.5 * divisor_squared.ln();
                // F0 of all channels together: normal before looking, diffuse reflectance eliminated channel by channel.
                let (common, own) = (kind.specular.1.powi(2), kind.specular.2.powi(2));
                let covariance = DMat3::from_diagonal(DVec3::splat(own)) + DMat3::from_cols_array(&[common; 9]);
                let (mut total, mean) = (covariance.inverse(), DVec3::from_array(kind.specular.0));
                let mut side = total * mean;
                let (mut cost, mut volume) = (mean.dot(side), covariance.determinant());
                for c in 0..3 {
                    let mut all = sums[c];
                    all.observe(kind.diffuse.1.powi(-2), 1.0, 0.0, kind.diffuse.0.unwrap_or(around)[c]);
                    total.col_mut(c)[c] += all.ss - all.es * all.es / all.ee;
                    side[c] += all.sy - all.es * all.ey / all.ee;
                    cost += all.yy - all.ey * all.ey / all.ee;
                    volume *= all.ee * kind.diffuse.1.powi(2);
                }
                let best = total.inverse() * side;
                assert!((0..3).all(|c| sums[c].ey + 1e-9 >= sums[c].es * best[c]), "no channel is held");
                let expected = kind.share.ln() - 0.5 * (cost - side.dot(best) + (total.determinant() * volume).ln());
                assert!((log - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{log} {expected}");
                for (c, (mean, variance)) in of_channels.into_iter().enumerate() {
                    assert!((mean - best[c]).abs() < 1e-8, "{mean} {best}");
                    assert!((variance / total.inverse().col(c)[c] - 1.0).abs() < 1e-8);
                }
            }
        }
    }
}
