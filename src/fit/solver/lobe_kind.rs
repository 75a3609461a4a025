//! How likely a group's pixels are at some widths if it is of one kind of surface ([`super::lobe_prior`]).
//!
//! Diffuse reflectance and F0 are normal before looking, so that both are integrated in closed form; F0 of the three
//! channels has a part in common, which makes it one system of three unknowns. Four widths are looked at side by side.

use super::lobe_prior::LobeKind;
use super::lobe_sums::FourWidths;
use crate::math::vector::doubles::{DOUBLES, Doubles};

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

    /// One over the sum of `e e` of each channel with what is believed of diffuse reflectance, and what evidence is divided
    /// by for the three together, squared. No width changes them.
    #[inline(always)]
    pub(super) fn of_diffuse(&self, ee: [f64; 3]) -> ([f64; 3], f64) {
        let [a, b, c] = [ee[0] + self.ee, ee[1] + self.ee, ee[2] + self.ee];
        ([1.0 / a, 1.0 / b, 1.0 / c], self.volume * a * b * c)
    }

    /// The evidence at four widths.
    ///
    /// Diffuse reflectance is integrated out, and it is at least zero: in a channel where it would be less at the best
    /// F0 it is held at zero, and F0 found anew. Without that, wide and strong lobes over what they outshine, made up
    /// for by less than black below, take over photographs.
    #[inline(always)]
    pub(super) fn at_widths(&self, (inverse_ee, volume): ([f64; 3], f64), sums: [&FourWidths; 3]) -> KindAtWidths {
        // Array by array, loop by loop: closures are compiled for any processor.
        let mut keep = [Doubles::default(); 3];
        let mut ey = [Doubles::default(); 3];
        for c in 0..3 {
            keep[c] = Doubles::splat(inverse_ee[c]);
            ey[c] = sums[c].ey + Doubles::splat(self.ey[c]);
        }
        let q = Doubles::splat(self.beside);
        // No channel is held twice, so that this ends.
        loop {
            let (mut own, mut side) = ([Doubles::default(); 3], [Doubles::default(); 3]);
            let mut cost = Doubles::splat(self.cost);
            for c in 0..3 {
                let FourWidths { es, ss, sy, yy, .. } = *sums[c];
                own[c] = Doubles::splat(self.diagonal) + (ss - es * es * keep[c]);
                side[c] = Doubles::splat(self.side[c]) + (sy - es * ey[c] * keep[c]);
                cost += yy + Doubles::splat(self.yy[c]) - ey[c] * ey[c] * keep[c];
            }
            // The matrix has `own` on its diagonal and one number beside it: its inverse by cofactors.
            let ([a, b, c], qq) = (own, q * q);
            let cofactors = [b * c - qq, a * c - qq, a * b - qq];
            let [ab, ac, bc] = [qq - q * c, qq - q * b, qq - q * a];
            let determinant = a * cofactors[0] + q * (ab + ac);
            let inverse = Doubles::splat(1.0) / determinant;
            let best = [
                (cofactors[0] * side[0] + ab * side[1] + ac * side[2]) * inverse,
                (ab * side[0] + cofactors[1] * side[1] + bc * side[2]) * inverse,
                (ac * side[0] + bc * side[1] + cofactors[2] * side[2]) * inverse,
            ];
            let mut any_below = false;
            for c in 0..3 {
                let needed = sums[c].es * best[c];
                for k in 0..DOUBLES {
                    let below = keep[c].0[k] > 0.0 && ey[c].0[k] < needed.0[k];
                    keep[c].0[k] = if below { 0.0 } else { keep[c].0[k] };
                    any_below |= below;
                }
            }
            if !any_below {
                let (zero, one, half) = (Doubles::splat(0.0), Doubles::splat(1.0), Doubles::splat(0.5));
                let explained = side[0] * best[0] + side[1] * best[1] + side[2] * best[2];
                let mut made = KindAtWidths {
                    log: Doubles::splat(self.log_share) - half * (cost - explained),
                    divisor_squared: determinant * Doubles::splat(volume),
                    ..KindAtWidths::default()
                };
                for c in 0..3 {
                    made.mean[c] = best[c].max(zero).min(one);
                    made.variance[c] = (cofactors[c] * inverse).max(zero);
                }
                return made;
            }
        }
    }
}

/// What a kind says of four widths.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KindAtWidths {
    /// Logarithm of one factor of the evidence,
    pub(super) log: Doubles,
    /// and the square of what that is divided by, whose logarithm kinds need not take one by one.
    pub(super) divisor_squared: Doubles,
    /// Mean of F0 per channel.
    pub(super) mean: [Doubles; 3],
    /// Variance of F0 per channel.
    pub(super) variance: [Doubles; 3],
}

#[cfg(test)]
mod tests {
    use super::super::cell_sums::System;
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

    /// What a kind says where pixels say this at one width, and what `beside` say at the others.
    fn at(kind: &KindEvidence, sums: &[System; 3], beside: &[System; 3]) -> KindAtWidths {
        let four = |c: usize| {
            let place = |own: f64, other: f64| Doubles([other, own, other, other]);
            let (own, other) = (&sums[c], &beside[c]);
            FourWidths {
                es: place(own.es, other.es),
                ss: place(own.ss, other.ss),
                ey: place(own.ey, other.ey),
                sy: place(own.sy, other.sy),
                yy: place(own.yy, other.yy),
            }
        };
        let of_diffuse = kind.of_diffuse([0, 1, 2].map(|c| sums[c].ee));
        kind.at_widths(of_diffuse, [&four(0), &four(1), &four(2)])
    }

    #[test]
    fn a_width_is_judged_as_by_whole_matrices() {
        for kind in &LobePrior::default().families[0].kinds {
            for count in [0, 1, 30] {
                let (around, sums) = ([0.3, 0.25, 0.2], pixels(count));
                let made = at(&KindEvidence::new(kind, around), &sums, &[System::default(); 3]);
                let log = made.log.0[1] - 0.5 * made.divisor_squared.0[1].ln();
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
                for c in 0..3 {
                    let (mean, variance) = (made.mean[c].0[1], made.variance[c].0[1]);
                    assert!((mean - best[c]).abs() < 1e-8, "{mean} {best}");
                    assert!((variance / total.inverse().col(c)[c] - 1.0).abs() < 1e-8);
                }
            }
        }
    }

    /// Pixels whose diffuse light is nothing beside their lobes hold diffuse reflectance at zero; other widths, where they
    /// do not, are judged as before.
    #[test]
    fn what_is_held_at_one_width_is_not_at_another() {
        let kind = KindEvidence::new(&LobePrior::default().families[0].kinds[1], [0.05; 3]);
        let plain = pixels(30);
        let mut outshone = plain;
        for sums in &mut outshone {
            (sums.es, sums.ss, sums.ey) = (40.0 * sums.es, 1600.0 * sums.ss, 0.01 * sums.ey);
        }
        let (alone, both) = (at(&kind, &plain, &plain), at(&kind, &outshone, &plain));
        for k in [0, 2, 3] {
            assert_eq!(alone.log.0[k], both.log.0[k]);
            assert_eq!(alone.mean[1].0[k], both.mean[1].0[k]);
        }
        assert_ne!(alone.mean[1].0[1], both.mean[1].0[1]);
        // Held in all channels, F0 is what lobes alone say.
        let own = &outshone[1];
        let alone = own.sy / own.ss;
        assert!((both.mean[1].0[1] - alone).abs() < 0.02 + 0.1 * alone, "{} {alone}", both.mean[1].0[1]);
    }
}
