//! What lobes of a scene are like as a whole: how wide, and how bright those of its dielectrics.
//!
//! Where pixels say little, a lobe leans on what is believed of it. Believed for any scene, that is a width of 0.55 and a
//! dielectric's F0 of 0.05; where a scene has more of both, its lobes come out too narrow and too dull, and what they lack
//! is booked as diffuse reflectance. Means and spreads over all texels that were solved for, known well or not, are
//! believed instead: for the first maps those of the blocks of the rounds on the light, then those of the maps before. That
//! is a step of expectation maximisation each time that maps are made (Dempster, Laird and Rubin 1977).

use super::estimate::Estimate;
use super::lobe_prior::{LobeFamily, LobeKind, REACH};

/// Least standard deviation of the logarithm of the width over a scene. Maps that lean on what is believed differ too little.
const LEAST_WIDTH_SPREAD: f64 = 0.2;
/// A texel of a mean F0 below this counts as a dielectric. Glass has 0.04; the few that have more, as diamond with 0.17, are
/// no part of it, and metals have 0.4 and more.
const MOST_OF_DIELECTRIC: f64 = 0.15;
/// Least and most standard deviation of F0 among the dielectrics of a scene.
const DIELECTRIC_SPREAD: [f64; 2] = [0.015, 0.04];

/// Means and standard deviations over a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SceneLobes {
    /// Of the logarithm of the width.
    pub(super) log_width: (f64, f64),
    /// Of F0 among dielectrics, if there are any.
    pub(super) dielectric: Option<(f64, f64)>,
}

/// Sums of what texels have and of its squares, the latter with how far it may be off.
#[derive(Default)]
struct Moments {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn add(&mut self, value: f64, variance: f64) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value + variance;
    }

    /// Mean and variance. `None` of nothing.
    fn mean(&self) -> Option<(f64, f64)> {
        let mean = self.sum / self.count;
        (self.count > 0.0).then(|| (mean, self.squares / self.count - mean * mean))
    }
}

impl SceneLobes {
    /// Those of the texels that were solved for: when maps were made, or by blocks in rounds on the light, while there are no
    /// maps. `None` without any.
    pub(super) fn of(estimate: &Estimate) -> Option<Self> {
        let (mut widths, mut dielectrics) = (Moments::default(), Moments::default());
        for (texel, variance) in estimate.texels.iter().zip(&estimate.variances).filter(|(_, own)| own.is_solved()) {
            let variance = &variance.variance;
            widths.add(f64::from(texel.log_width), f64::from(variance.log_width));
            let mean = |[r, g, b]: [f32; 3]| f64::from(r + g + b) / 3.0;
            let specular = mean(texel.specular);
            if specular < MOST_OF_DIELECTRIC {
                dielectrics.add(specular, mean(variance.specular));
            }
        }
        let (mean, variance) = widths.mean()?;
        let (mean, deviation) = normal_with_moments_below_zero(mean, variance);
        let [least, most] = DIELECTRIC_SPREAD;
        let dielectric = dielectrics.mean().map(|(mean, variance)| (mean, variance.max(0.0).sqrt().clamp(least, most)));
        Some(SceneLobes { log_width: (mean, deviation.max(LEAST_WIDTH_SPREAD)), dielectric })
    }

    /// The same kinds of surface as those of `any`, with lobes as this scene has them. The kind of the least F0 is that of
    /// its dielectrics.
    pub(super) fn family(&self, any: &LobeFamily) -> LobeFamily {
        let mut kinds = any.kinds.clone();
        let of_kind = |kind: &LobeKind| kind.specular.0.iter().sum::<f64>();
        let least = kinds.iter_mut().min_by(|a, b| of_kind(a).total_cmp(&of_kind(b)));
        if let (Some(kind), Some((mean, deviation))) = (least, self.dielectric) {
            kind.specular = ([mean; 3], deviation, kind.specular.2);
        }
        LobeFamily { kinds, log_width: self.log_width, reach: REACH }
    }
}

/// Mean and standard deviation of the normal distribution whose part below zero has this mean and variance: no lobe is
/// wider than 1.
fn normal_with_moments_below_zero(mean: f64, variance: f64) -> (f64, f64) {
    // Logarithms of widths from minus this on are summed over.
    const SPAN: f64 = 5.0;
    const STEPS: usize = 500;
    const ROUNDS: usize = 50;
    // As narrow as the steps tell apart.
    const LEAST_VARIANCE: f64 = 1e-4;
    let variance = variance.max(LEAST_VARIANCE);
    let (mut own_mean, mut own_variance) = (mean, variance);
    for _ in 0..ROUNDS {
        let [mut total, mut sum, mut squares] = [0.0; 3];
        for step in 0..STEPS {
            let x = -SPAN * (step as f64 + 0.5) / STEPS as f64;
            let weight = (-0.5 * (x - own_mean).powi(2) / own_variance).exp();
            total += weight;
            sum += weight * x;
            squares += weight * x * x;
        }
        let below = sum / total;
        own_mean = (own_mean + mean - below).clamp(-SPAN, 0.0);
        let of_part = (squares / total - below * below).max(1e-9);
        own_variance = (own_variance * variance / of_part).clamp(LEAST_VARIANCE, 1.0);
    }
    (own_mean, own_variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::lobe_families::tests::estimate;
    use super::super::lobe_prior::LobePrior;
    use super::*;

    #[test]
    fn dielectrics_are_as_bright_as_the_scene_has_them_and_metals_are_left() {
        let mut estimate = estimate();
        let any = &LobePrior::default().families[0];
        let own = SceneLobes::of(&estimate).expect("maps were made").family(any);
        let (mean, common, apart) = own.kinds[0].specular;
        assert!((mean[0] - 0.05).abs() < 1e-3 && common == DIELECTRIC_SPREAD[0], "{own:?}");
        assert_eq!(apart, any.kinds[0].specular.2);
        assert_eq!(own.kinds[1..], any.kinds[1..]);
        // Twice as bright, and every second one by a half more.
        for (texel, own) in estimate.texels.iter_mut().enumerate().filter(|(texel, _)| matches!(texel % 4, 1 | 2)) {
            let times = if texel % 4 == 1 { 2.0 } else { 3.0 };
            // Some pass for no dielectric any more.
            own.specular = own.specular.map(|value| (value * times).min(0.145));
        }
        let (mean, deviation) = SceneLobes::of(&estimate).and_then(|own| own.dielectric).expect("half are dielectrics");
        assert!((mean - 0.1225).abs() < 5e-3 && (0.02..0.03).contains(&deviation), "{mean} {deviation}");
    }

    #[test]
    fn a_scene_of_metals_has_no_dielectrics_to_learn_from() {
        let mut estimate = estimate();
        estimate.texels.iter_mut().for_each(|own| own.specular = [0.6; 3]);
        let own = SceneLobes::of(&estimate).expect("maps were made");
        assert_eq!(own.dielectric, None);
        let any = &LobePrior::default().families[0];
        assert_eq!(own.family(any).kinds, any.kinds);
    }

    #[test]
    fn a_normal_distribution_is_known_by_its_part_below_zero() {
        // The part below zero of (-0.6, 0.5): by the density and the distribution at 1.2, phi / Phi = 0.21942.
        let ratio = 0.21942f64;
        let (mean, variance) = (-0.6 - 0.5 * ratio, 0.25 * (1.0 - 1.2 * ratio - ratio * ratio));
        let (own_mean, deviation) = normal_with_moments_below_zero(mean, variance);
        assert!((own_mean + 0.6).abs() < 2e-3 && (deviation - 0.5).abs() < 2e-3, "{own_mean} {deviation}");
        let (own_mean, deviation) = normal_with_moments_below_zero(-2.0, 0.04);
        assert!((own_mean + 2.0).abs() < 1e-3 && (deviation - 0.2).abs() < 1e-3, "{own_mean} {deviation}");
    }
}
