//! A gain for each photo: cameras choose exposures, and a light that had to explain them would be wrong.
//!
//! How much brighter a photo is than the model is told by the blocks of surface that it shows, as a median. A highlight
//! that the model does not have yet is brighter than it in a few blocks; where a ratio of sums went with the squares of
//! what is bright, each such view of a glossy thing would be given a gain in place of its highlights.
//!
//! The background does not take part. The light is fitted to it under the gains as they are, so that it asks for no others:
//! with it, where exposures do differ, gains are not found in as many rounds as there are.
//!
//! What EXIF says of the exposures is believed before looking: gains start there, and stay there as far as blocks say nothing.
//! It is believed no more than that exposures are equal where EXIF is silent, since cameras and editors brighten photos after
//! the exposure.

use super::round::{BlockWork, Round};

/// What is believed of a gain before looking: standard deviation of its logarithm, a stop.
const BELIEVED: f64 = 0.7;
/// What all blocks of a view can have in common that is no exposure (their gloss, a light that is not found yet), as a
/// standard deviation of the logarithm.
const IN_COMMON: f64 = 0.1;
/// Blocks darker than this, relative to the mean of the photos, say nothing.
const LEAST_RADIANCE: f64 = 0.02;

/// Logarithms of a photo's radiance over the model's, one a block that it shows, with a weight each.
type Ratios = Vec<(f64, f64)>;

/// Logarithms of the gains of all views, with mean zero, after a round that has solved blocks. `independence` is the share
/// of evidence that counts as independent, `foretold` what is believed before looking.
pub(super) fn gains_after(round: &Round, done: &[(usize, BlockWork)], foretold: &[f32], independence: f64) -> Vec<f32> {
    let least = LEAST_RADIANCE * f64::from(round.observations.mean);
    let mut views: Vec<Ratios> = vec![Vec::new(); round.log_gains.len()];
    let mut sums = vec![[0.0f64; 3]; views.len()];
    for (_, work) in done {
        for (term, &used) in work.terms.iter().zip(&work.used) {
            let model = round.model(work, term);
            let [weight, photo, shown] = &mut sums[round.observations.list[used as usize].view as usize];
            *weight += f64::from(term.weight);
            *photo += f64::from(term.weight * term.radiance.iter().sum::<f32>());
            *shown += f64::from(term.weight * model.iter().sum::<f32>());
        }
        for (ratios, sums) in views.iter_mut().zip(&mut sums) {
            let [weight, photo, shown] = std::mem::take(sums);
            if weight > 0.0 && photo.min(shown) > 3.0 * least * weight {
                ratios.push(((photo / shown).ln(), weight));
            }
        }
    }
    moved(round.log_gains, &views, foretold, independence)
}

/// The gains that views' ratios ask for, beside those they have and those that are foretold.
fn moved(log_gains: &[f32], views: &[Ratios], foretold: &[f32], independence: f64) -> Vec<f32> {
    let found: Vec<f64> = log_gains
        .iter()
        .zip(views)
        .zip(foretold)
        .map(|((&now, ratios), &foretold)| {
            let (change, precision) = told_by(ratios, independence);
            let belief = BELIEVED.powi(-2);
            (precision * (f64::from(now) + change) + belief * f64::from(foretold)) / (precision + belief)
        })
        .collect();
    // A common gain belongs to the light.
    let mean = found.iter().sum::<f64>() / found.len().max(1) as f64;
    found.iter().map(|log_gain| (log_gain - mean) as f32).collect()
}

/// The weighted median of ratios, and its precision: by their spread around it, by how many of them are independent, and
/// by what they may have in common. Precision 0 where there are none.
fn told_by(ratios: &Ratios, independence: f64) -> (f64, f64) {
    let (sum, squares) = ratios.iter().fold((0.0, 0.0), |(sum, squares), (_, w)| (sum + w, squares + w * w));
    if squares <= 0.0 {
        return (0.0, 0.0);
    }
    let middle = weighted_median(ratios.clone());
    let off = ratios.iter().map(|(ratio, weight)| ((ratio - middle).abs(), *weight)).collect();
    // Of normal numbers, from the median of how far they are off.
    let spread = 1.4826 * weighted_median(off);
    let independent = (independence * sum * sum / squares).max(1.0);
    (middle, 1.0 / (spread * spread / independent + IN_COMMON * IN_COMMON))
}

/// The value below which half of the weight lies; 0 when empty.
fn weighted_median(mut values: Ratios) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    let middle = values.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    middle.or(values.last()).map_or(0.0, |(value, _)| *value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gain of a view with these ratios beside one with none off, which has mean zero with it.
    fn gain_of(ratios: &[f64], now: f32) -> f32 {
        let of = |ratios: &[f64]| ratios.iter().map(|ratio| (*ratio, 1.0)).collect::<Ratios>();
        let gains = moved(&[now, 0.0], &[of(ratios), of(&[0.0; 40])], &[0.0; 2], 0.05);
        assert!((gains[0] + gains[1]).abs() < 1e-6, "{gains:?}");
        gains[0] - gains[1]
    }

    #[test]
    fn a_photo_that_is_brighter_all_over_gets_its_gain_and_keeps_it() {
        // A fiftieth of it is left to what is believed.
        let gain = gain_of(&[0.3; 40], 0.0);
        assert!((gain - 0.3 / 1.0204).abs() < 1e-3, "{gain}");
        let gain = gain_of(&[0.3 - gain; 40].map(f64::from), gain);
        assert!((gain - 0.3 / 1.0204).abs() < 1e-3, "{gain}");
    }

    #[test]
    fn highlights_that_the_model_lacks_are_no_exposure() {
        let mut ratios = [0.0; 40];
        ratios[..15].fill(1.5);
        assert!(gain_of(&ratios, 0.0).abs() < 1e-6);
    }

    #[test]
    fn blocks_that_contradict_each_other_are_believed_less() {
        let of_spread = |spread: f64| gain_of(&[0.4 - spread, 0.4, 0.4 + spread].repeat(13), 0.0);
        let gains = [0.0, 0.3, 1.0].map(of_spread);
        assert!(gains[0] > 0.38 && gains[0] > gains[1] && gains[1] > gains[2] && gains[2] > 0.05, "{gains:?}");
    }

    #[test]
    fn views_that_show_nothing_keep_the_middle() {
        assert_eq!(moved(&[0.0; 2], &[Ratios::new(), Ratios::new()], &[0.0; 2], 0.05), [0.0; 2]);
        assert_eq!(moved(&[], &[], &[], 0.05), Vec::<f32>::new());
        let foretold = moved(&[0.0; 2], &[Ratios::new(), Ratios::new()], &[0.5, -0.5], 0.05);
        assert_eq!(foretold, [0.5, -0.5], "what EXIF says stays where blocks say nothing");
        assert_eq!(weighted_median(vec![(3.0, 1.0), (1.0, 1.0), (2.0, 5.0)]), 2.0);
        assert_eq!(weighted_median(Ratios::new()), 0.0);
    }
}
