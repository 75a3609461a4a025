//! How likely pixels are if they share one lobe, whatever its F0 and width, and what is then believed of both.
//!
//! Diffuse reflectance and F0 are integrated in closed form at each width, for each kind of surface (`lobe_kind`); widths
//! are summed over. A tile asks this of some thousand groups of texels, so what no group changes is made once
//! ([`Evidence::new`]).

use super::cell_sums::System;
use super::lobe_kind::KindEvidence;
use super::lobe_prior::{LobeFamily, LobePrior};
use super::lobe_widths::LOBE_WIDTHS;

/// Sums of a texel, or of a group, per width and channel, in units of the noise, with each texel's deviation from its
/// group's diffuse reflectance eliminated.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeSumsOfGroup(pub(super) [[System; 3]; LOBE_WIDTHS]);

impl Default for LobeSumsOfGroup {
    fn default() -> Self {
        LobeSumsOfGroup([[System::default(); 3]; LOBE_WIDTHS])
    }
}

impl LobeSumsOfGroup {
    /// Those of one texel. `ridge` is the inverse variance of its deviation; `worse` is added to the cost of each width.
    pub(super) fn of_texel(raw: &[[System; 3]; LOBE_WIDTHS], ridge: f64, worse: &[f64; LOBE_WIDTHS]) -> Self {
        let mut made = LobeSumsOfGroup(raw.map(|channels| channels.map(|sums| sums.without_deviation(ridge))));
        for (channels, worse) in made.0.iter_mut().zip(worse) {
            channels.iter_mut().for_each(|sums| sums.yy += worse / 3.0);
        }
        made
    }

    /// Adds another's.
    pub fn add(&mut self, other: &LobeSumsOfGroup) {
        let others = other.0.iter().flatten();
        self.0.iter_mut().flatten().zip(others).for_each(|(own, other)| own.add(other));
    }

    /// Whether no pixel is in it: it says nothing, and adds nothing to others.
    pub fn is_empty(&self) -> bool {
        self.0.iter().flatten().all(|sums| *sums == System::default())
    }
}

/// Means and variances of F0 and the logarithm of the width.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeBelief {
    /// Mean of F0 per channel, of the logarithm of the width last.
    pub mean: [f64; 4],
    /// Second moments about zero while beliefs are mixed, variances at the end.
    pub square: [f64; 4],
    /// Mean number of texels that share the lobe.
    pub shared: f64,
}

impl LobeBelief {
    /// Adds another's moments with a weight.
    pub fn mix(&mut self, other: &LobeBelief, weight: f64) {
        for k in 0..4 {
            self.mean[k] += weight * other.mean[k];
            self.square[k] += weight * other.square[k];
        }
    }
}

/// Points between two widths where the posterior is looked at.
const FINE: usize = 4;
/// Logarithm of the weight, relative to the best, below which a point or a kind counts for nothing.
const NEGLIGIBLE: f64 = -21.0;
/// The same of the one factor of a kind's evidence; the others differ by less than what is between these.
const NEGLIGIBLE_FACTOR: f64 = -60.0;

/// Asks groups of texels for the evidence that they share one lobe.
pub struct Evidence {
    families: Vec<FamilyEvidence>,
}

impl Evidence {
    /// For groups among texels whose mean diffuse reflectance is `around`, at these widths, with what is believed before.
    pub fn new(around: [f64; 3], log_widths: &[f64; LOBE_WIDTHS], prior: &LobePrior) -> Self {
        Evidence { families: prior.families.iter().map(|own| FamilyEvidence::new(own, around, log_widths)).collect() }
    }

    /// Logarithm of the evidence that a group shares one lobe, and what is then believed of it.
    pub fn shared_lobe(&self, sums: &LobeSumsOfGroup) -> (f64, LobeBelief) {
        if let [family] = self.families.as_slice() {
            return family.lobe(sums);
        }
        let families: Vec<(f64, LobeBelief)> = self.families.iter().map(|family| family.lobe(sums)).collect();
        let total = log_sum(families.iter().map(|family| family.0));
        let mut belief = LobeBelief::default();
        for (log, own) in &families {
            belief.mix(own, (log - total).exp());
        }
        (total, belief)
    }
}

/// A place between two widths.
struct Point {
    /// The narrower of the two, of those that are looked at.
    node: usize,
    /// Of the way to the wider.
    share: f64,
    log_width: f64,
    /// Logarithm of what is believed of the width before looking, times the step from point to point.
    log_prior: f64,
}

/// A family, ready to be asked.
struct FamilyEvidence {
    kinds: Vec<KindEvidence>,
    /// The first width that is looked at.
    first: usize,
    /// Logarithms of all that are.
    log_widths: Vec<f64>,
    points: Vec<Point>,
}

impl FamilyEvidence {
    fn new(family: &LobeFamily, around: [f64; 3], log_widths: &[f64; LOBE_WIDTHS]) -> Self {
        let (centre, deviation) = family.log_width;
        let reach = family.reach * deviation;
        // Three widths at least: the curvature between them is asked for.
        let first = log_widths.partition_point(|&x| x < centre - reach).clamp(1, LOBE_WIDTHS - 2) - 1;
        let last = log_widths.partition_point(|&x| x <= centre + reach).clamp(first + 2, LOBE_WIDTHS - 1);
        let own = log_widths[first..=last].to_vec();
        let log_norm = (deviation * (2.0 * std::f64::consts::PI).sqrt()).ln();
        let point = |index: usize| {
            let node = (index / FINE).min(own.len() - 2);
            let share = (index - node * FINE) as f64 / FINE as f64;
            let log_width = own[node] * (1.0 - share) + own[node + 1] * share;
            let step = (own[node + 1] - own[node]) / FINE as f64;
            let log_prior = step.ln() - 0.5 * ((log_width - centre) / deviation).powi(2) - log_norm;
            Point { node, share, log_width, log_prior }
        };
        let points = (0..=(own.len() - 1) * FINE).map(point).collect();
        let kinds = family.kinds.iter().map(|kind| KindEvidence::new(kind, around)).collect();
        FamilyEvidence { kinds, first, log_widths: own, points }
    }

    /// Logarithm of the evidence of all kinds together, with their shares, and what is believed if it is one of them.
    fn lobe(&self, sums: &LobeSumsOfGroup) -> (f64, LobeBelief) {
        let count = self.log_widths.len();
        // Per width: logarithm of the evidence, mean and square of F0.
        let mut log_at = [0.0f64; LOBE_WIDTHS];
        let mut specular = [[[0.0f64; 2]; 3]; LOBE_WIDTHS];
        for node in 0..count {
            (log_at[node], specular[node]) = self.at_width(&sums.0[self.first + node]);
        }
        let log_at = &log_at[..count];
        // Between widths the logarithm of the evidence is a parabola, as that of a normal distribution is.
        let bends = bends(&self.log_widths, log_at);
        let log_of = |point: &Point| {
            let Point { node, log_width, log_prior, .. } = *point;
            let (slope, bent) = bends[node];
            let rise = slope + bent * (log_width - self.log_widths[node + 1]);
            log_at[node] + (log_width - self.log_widths[node]) * rise + log_prior
        };
        let mut logs = [0.0f64; (LOBE_WIDTHS - 1) * FINE + 1];
        let mut largest = f64::NEG_INFINITY;
        for (log, point) in logs.iter_mut().zip(&self.points) {
            *log = log_of(point);
            largest = largest.max(*log);
        }
        let mut belief = LobeBelief::default();
        if !largest.is_finite() {
            return (largest, belief);
        }
        let mut total = 0.0;
        for (log, &Point { node, share, log_width, .. }) in logs.iter().zip(&self.points) {
            if log - largest < NEGLIGIBLE {
                continue;
            }
            let weight = (log - largest).exp();
            total += weight;
            for c in 0..3 {
                let mixed = |k: usize| specular[node][c][k] * (1.0 - share) + specular[node + 1][c][k] * share;
                belief.mean[c] += weight * mixed(0);
                belief.square[c] += weight * mixed(1);
            }
            belief.mean[3] += weight * log_width;
            belief.square[3] += weight * log_width * log_width;
        }
        belief.mean = belief.mean.map(|value| value / total);
        belief.square = belief.square.map(|value| value / total);
        (largest + total.ln(), belief)
    }

    /// Logarithm of the evidence at a width, and mean and square of F0 per channel, of all kinds together.
    fn at_width(&self, sums: &[System; 3]) -> (f64, [[f64; 2]; 3]) {
        // Factors relative to the largest so far.
        let mut largest = f64::NEG_INFINITY;
        let (mut total, mut sum) = (0.0, [[0.0; 2]; 3]);
        for kind in &self.kinds {
            let (log, divisor_squared, of_channels) = kind.at_width(sums);
            if log - largest < NEGLIGIBLE_FACTOR {
                continue;
            }
            if log > largest {
                let keep = (largest - log).exp();
                largest = log;
                total *= keep;
                sum = sum.map(|own| own.map(|value| keep * value));
            }
            let weight = (log - largest).exp() / divisor_squared.sqrt();
            total += weight;
            for (sum, (mean, variance)) in sum.iter_mut().zip(of_channels) {
                sum[0] += weight * mean;
                sum[1] += weight * (variance + mean * mean);
            }
        }
        (largest + total.ln(), sum.map(|own| own.map(|value| value / total)))
    }
}

/// For each interval: the straight line's slope, and the smaller of the curvatures at both ends where they have one sign.
/// For a parabola that is the parabola; beside a kink it does not overshoot.
fn bends(x: &[f64], y: &[f64]) -> [(f64, f64); LOBE_WIDTHS] {
    let count = x.len();
    let mut slopes = [0.0f64; LOBE_WIDTHS];
    let mut curvatures = [0.0f64; LOBE_WIDTHS];
    for k in 0..count - 1 {
        slopes[k] = (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    }
    for middle in 1..count - 1 {
        curvatures[middle] = (slopes[middle] - slopes[middle - 1]) / (x[middle + 1] - x[middle - 1]);
    }
    std::array::from_fn(|node| {
        let [left, right] = [node, node + 1].map(|middle| curvatures[middle.clamp(1, count - 2)]);
        let bent = if left * right <= 0.0 { 0.0 } else { left.signum() * left.abs().min(right.abs()) };
        (slopes[node], bent)
    })
}

/// Logarithm of a sum of exponentials.
pub fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return largest;
    }
    largest + logs.map(|log| (log - largest).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_met_between_widths_and_nothing_is_asked_of_what_is_empty() {
        let x: Vec<f64> = (0..LOBE_WIDTHS).map(|k| (k as f64 * 0.7).powf(1.1)).collect();
        let parabola = |x: f64| 2.0 - 3.0 * (x - 1.7).powi(2);
        let y: Vec<f64> = x.iter().map(|&x| parabola(x)).collect();
        for (node, (slope, bent)) in bends(&x, &y).into_iter().take(LOBE_WIDTHS - 1).enumerate() {
            let at = 0.3 * x[node] + 0.7 * x[node + 1];
            let found = y[node] + (at - x[node]) * (slope + bent * (at - x[node + 1]));
            assert!((found - parabola(at)).abs() < 1e-9, "{node}: {found}");
        }
        let mut sums = LobeSumsOfGroup::default();
        assert!(sums.is_empty());
        sums.0[3][1].observe(40.0, 0.5, 0.3, 0.2);
        assert!(!sums.is_empty());
    }
}
