//! How likely pixels are if they share one lobe, whatever its F0 and width, and what is then believed of both.
//!
//! Diffuse reflectance and F0 are integrated in closed form at each width, for each kind of surface (`lobe_kind`); widths
//! are summed over. A tile asks this of some thousand groups of texels, so what no group changes is made once
//! ([`Evidence::new`]).

use super::lobe_kind::KindEvidence;
use super::lobe_prior::{LobeFamily, LobePrior};
use super::lobe_sums::{FOURS, LobeSumsOfGroup};
use super::lobe_widths::LOBE_WIDTHS;
use crate::math::vector::doubles::{DOUBLES, Doubles, versions_of_doubles};

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
            return lobe(family, sums);
        }
        let families: Vec<(f64, LobeBelief)> = self.families.iter().map(|family| lobe(family, sums)).collect();
        let total = log_sum(families.iter().map(|family| family.0));
        let mut belief = LobeBelief::default();
        for (log, own) in &families {
            belief.mix(own, (log - total).exp());
        }
        (total, belief)
    }
}

/// Points from one width to the next, the next not among them, where the posterior is looked at.
const POINTS: usize = DOUBLES;

/// Logarithm of the weight, relative to the best, below which points count for nothing.
const NEGLIGIBLE: f64 = -40.0;

/// From one width to the next: the points between.
#[derive(Clone, Copy)]
struct Interval {
    log_widths: Doubles,
    /// Distances from the width before, and from the one behind (below zero).
    from_left: Doubles,
    from_right: Doubles,
    /// Logarithms of what is believed of the width before looking, times the step from point to point; nothing where there
    /// is no point.
    log_prior: Doubles,
}

/// A family, ready to be asked.
struct FamilyEvidence {
    kinds: Vec<KindEvidence>,
    /// The widths that are looked at.
    first: usize,
    last: usize,
    /// From each width to the next, and the last width by itself.
    intervals: [Interval; LOBE_WIDTHS],
    /// One over the distances from each width to the next, and to the one after that.
    per_step: [f64; LOBE_WIDTHS],
    per_two_steps: [f64; LOBE_WIDTHS],
}

/// A number for each width, the last of them for none.
type Widths = [f64; FOURS * DOUBLES];

impl FamilyEvidence {
    fn new(family: &LobeFamily, around: [f64; 3], log_widths: &[f64; LOBE_WIDTHS]) -> Self {
        let (centre, deviation) = family.log_width;
        let reach = family.reach * deviation;
        // Three widths at least: the curvature between them is asked for.
        let first = log_widths.partition_point(|&x| x < centre - reach).clamp(1, LOBE_WIDTHS - 2) - 1;
        let last = log_widths.partition_point(|&x| x <= centre + reach).clamp(first + 2, LOBE_WIDTHS - 1);
        let log_norm = (deviation * (2.0 * std::f64::consts::PI).sqrt()).ln();
        let interval = |width: usize| {
            let is_last = width >= last;
            let left = log_widths[width];
            let right = log_widths[(width + 1).min(LOBE_WIDTHS - 1)];
            // The last width stands for as much as the points before it.
            let whole = if is_last { left - log_widths[width - 1] } else { right - left };
            let step = whole / POINTS as f64;
            let place = |k: usize| if is_last { left } else { left + (right - left) * k as f64 / POINTS as f64 };
            let log_widths: [f64; POINTS] = std::array::from_fn(place);
            let log_prior = std::array::from_fn(|k| match is_last && k > 0 {
                true => f64::NEG_INFINITY,
                false => step.ln() - 0.5 * ((log_widths[k] - centre) / deviation).powi(2) - log_norm,
            });
            Interval {
                log_widths: Doubles(log_widths),
                from_left: Doubles(log_widths.map(|x| x - left)),
                from_right: Doubles(log_widths.map(|x| x - right)),
                log_prior: Doubles(log_prior),
            }
        };
        let per = |width: usize, steps: usize| match log_widths.get(width + steps) {
            Some(other) => 1.0 / (other - log_widths[width]),
            None => 0.0,
        };
        FamilyEvidence {
            kinds: family.kinds.iter().map(|kind| KindEvidence::new(kind, around)).collect(),
            first,
            last,
            intervals: std::array::from_fn(interval),
            per_step: std::array::from_fn(|width| per(width, 1)),
            per_two_steps: std::array::from_fn(|width| per(width, 2)),
        }
    }
}

versions_of_doubles! {
    /// Logarithm of the evidence of all kinds together, with their shares, and what is believed if it is one of them.
    fn lobe(family: &FamilyEvidence, sums: &LobeSumsOfGroup) -> (f64, LobeBelief) = lobe_in;
}

#[inline(always)]
fn lobe_in(family: &FamilyEvidence, sums: &LobeSumsOfGroup) -> (f64, LobeBelief) {
    let &FamilyEvidence { first, last, .. } = family;
    let (log_at, moments) = at_widths(family, sums);
    // Between widths the logarithm of the evidence is a parabola, as that of a normal distribution is.
    let bends = bends(family, &log_at);
    let mut logs = [Doubles::splat(f64::NEG_INFINITY); LOBE_WIDTHS];
    let mut largest = Doubles::splat(f64::NEG_INFINITY);
    for width in first..=last {
        let Interval { from_left, from_right, log_prior, .. } = family.intervals[width];
        let (slope, bent) = bends[width];
        let rise = Doubles::splat(slope) + Doubles::splat(bent) * from_right;
        logs[width] = Doubles::splat(log_at[width]) + from_left * rise + log_prior;
        largest = largest.max(logs[width]);
    }
    let largest = largest.largest();
    let mut belief = LobeBelief::default();
    if !largest.is_finite() {
        return (largest, belief);
    }
    let mut ways = [0.0; POINTS];
    for (k, way) in ways.iter_mut().enumerate() {
        *way = k as f64 / POINTS as f64;
    }
    // Moments are straight between widths: what points weigh is shared among both.
    let mut weights: Widths = [0.0; FOURS * DOUBLES];
    let (mut total, mut of_width) = (Doubles::default(), [Doubles::default(); 2]);
    for width in first..=last {
        let relative = logs[width] - Doubles::splat(largest);
        if relative.largest() < NEGLIGIBLE {
            continue;
        }
        let weight = relative.exp();
        let log_widths = family.intervals[width].log_widths;
        total += weight;
        of_width[0] += weight * log_widths;
        of_width[1] += weight * log_widths * log_widths;
        let (all, of_next) = (weight.sum(), (weight * Doubles(ways)).sum());
        weights[width] += all - of_next;
        if width < last {
            weights[width + 1] += of_next;
        }
    }
    let total = total.sum();
    for (block, moments) in moments.iter().enumerate() {
        let mut four = Doubles::default();
        four.0.copy_from_slice(&weights[block * DOUBLES..][..DOUBLES]);
        for (c, moments) in moments.iter().enumerate() {
            belief.mean[c] += (four * moments[0]).sum();
            belief.square[c] += (four * moments[1]).sum();
        }
    }
    (belief.mean[3], belief.square[3]) = (of_width[0].sum(), of_width[1].sum());
    for (mean, square) in belief.mean.iter_mut().zip(&mut belief.square) {
        (*mean, *square) = (*mean / total, *square / total);
    }
    (largest + total.ln(), belief)
}

/// Per width, of all kinds together: logarithm of the evidence, and, four by four, means of F0 and of its square per channel.
#[inline(always)]
fn at_widths(family: &FamilyEvidence, sums: &LobeSumsOfGroup) -> (Widths, [[[Doubles; 2]; 3]; FOURS]) {
    let fours = family.first / DOUBLES..family.last / DOUBLES + 1;
    let [a, b, c] = &sums.channels;
    let ee = [a.ee, b.ee, c.ee];
    // Factors relative to the largest so far.
    let mut largest = [Doubles::splat(f64::NEG_INFINITY); FOURS];
    let (mut total, mut moments) = ([Doubles::default(); FOURS], [[[Doubles::default(); 2]; 3]; FOURS]);
    for (index, kind) in family.kinds.iter().enumerate() {
        let is_first = index == 0;
        let of_diffuse = kind.of_diffuse(ee);
        for four in fours.clone() {
            let own = kind.at_widths(of_diffuse, [&a.at[four], &b.at[four], &c.at[four]]);
            let inverse = Doubles::splat(1.0) / own.divisor_squared.sqrt();
            let top = own.log.max(largest[four]);
            // One kind alone asks for no exponentials.
            let (keep, weight) = match is_first {
                true => (Doubles::splat(0.0), inverse),
                false => ((largest[four] - top).exp(), (own.log - top).exp() * inverse),
            };
            largest[four] = top;
            total[four] = total[four] * keep + weight;
            for c in 0..3 {
                let [mean, square] = &mut moments[four][c];
                *mean = *mean * keep + weight * own.mean[c];
                *square = *square * keep + weight * (own.variance[c] + own.mean[c] * own.mean[c]);
            }
        }
    }
    let mut logs: Widths = [f64::NEG_INFINITY; FOURS * DOUBLES];
    for four in fours {
        let log = largest[four] + total[four].ln();
        logs[four * DOUBLES..][..DOUBLES].copy_from_slice(&log.0);
        let inverse = Doubles::splat(1.0) / total[four];
        for c in 0..3 {
            for k in 0..2 {
                moments[four][c][k] = moments[four][c][k] * inverse;
            }
        }
    }
    (logs, moments)
}

/// For each interval: the straight line's slope, and the smaller of the curvatures at both ends where they have one sign.
/// For a parabola that is the parabola; beside a kink it does not overshoot.
#[inline(always)]
fn bends(family: &FamilyEvidence, y: &Widths) -> [(f64, f64); LOBE_WIDTHS] {
    let &FamilyEvidence { first, last, .. } = family;
    let mut slopes = [0.0f64; LOBE_WIDTHS];
    let mut curvatures = [0.0f64; LOBE_WIDTHS];
    for k in first..last {
        slopes[k] = (y[k + 1] - y[k]) * family.per_step[k];
    }
    for middle in first + 1..last {
        curvatures[middle] = (slopes[middle] - slopes[middle - 1]) * family.per_two_steps[middle - 1];
    }
    let mut made = [(0.0, 0.0); LOBE_WIDTHS];
    for width in first..last {
        let [left, right] = [curvatures[width.max(first + 1)], curvatures[(width + 1).min(last - 1)]];
        let bent = if left * right <= 0.0 { 0.0 } else { left.signum() * left.abs().min(right.abs()) };
        made[width] = (slopes[width], bent);
    }
    made
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
mod tests;
