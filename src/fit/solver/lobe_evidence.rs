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
mod tests {
    use super::super::cell_sums::System;
    use super::super::lobe_sums::tests::of_systems;
    use super::super::lobe_widths::weighed_log_widths;
    use super::*;
    use crate::math::random::SequentialRandom;

    #[test]
    fn a_parabola_is_met_between_widths() {
        let x: [f64; LOBE_WIDTHS] = std::array::from_fn(|k| (k as f64 * 0.7).powf(1.1));
        let parabola = |x: f64| 2.0 - 3.0 * (x - 1.7).powi(2);
        let family = FamilyEvidence::new(&LobePrior::default().families[0], [0.3; 3], &x);
        let mut y = [0.0; FOURS * DOUBLES];
        y.iter_mut().zip(x).for_each(|(y, x)| *y = parabola(x));
        for (node, (slope, bent)) in bends(&family, &y).into_iter().take(LOBE_WIDTHS - 1).enumerate() {
            let at = 0.3 * x[node] + 0.7 * x[node + 1];
            let found = y[node] + (at - x[node]) * (slope + bent * (at - x[node + 1]));
            assert!((found - parabola(at)).abs() < 1e-9, "{node}: {found}");
        }
    }

    /// Sums of pixels that show a lobe of this F0, better the nearer the width is to that of `-1.2`.
    fn group(specular: f64, seed: u64) -> LobeSumsOfGroup {
        let mut random = SequentialRandom::new(seed);
        let mut number = || f64::from(random.next_number());
        let mut systems = [[System::default(); 3]; LOBE_WIDTHS];
        for _ in 0..12 {
            let (e, s, noise) = (0.5 + number(), 2.0 * number(), 0.1 * (number() - 0.5));
            for (systems, width) in systems.iter_mut().zip(weighed_log_widths()) {
                for system in systems {
                    let y = 0.3 * e + specular * s + noise;
                    system.observe(3.0, e, s * (1.0 + 0.3 * (width + 1.2)), y);
                }
            }
        }
        of_systems(&systems)
    }

    /// Families of all kinds and of one, that look at all widths and at some.
    fn families() -> Vec<LobeFamily> {
        let any = LobePrior::default().families.remove(0);
        let metal = LobeFamily { kinds: vec![any.kinds[1]], log_width: (-0.9, 0.15), reach: 3.0 };
        vec![any, metal]
    }

    #[test]
    fn a_group_is_judged_alike_by_all_versions_and_point_by_point() {
        let widths = weighed_log_widths();
        for own in families() {
            let family = FamilyEvidence::new(&own, [0.3; 3], &widths);
            for (index, specular) in [0.0, 0.05, 0.4, 0.9].into_iter().enumerate() {
                let sums = group(specular, index as u64);
                let (log, belief) = lobe(&family, &sums);
                assert_eq!((log, belief), lobe_in(&family, &sums));
                // Point by point, with moments that are straight between widths.
                let (log_at, moments) = at_widths(&family, &sums);
                let bends = bends(&family, &log_at);
                let (centre, deviation) = own.log_width;
                let mut points = Vec::new();
                for width in family.first..family.last {
                    let (left, right) = (widths[width], widths[width + 1]);
                    let ends = if width + 1 == family.last { POINTS + 1 } else { POINTS };
                    for k in 0..ends {
                        let way = k as f64 / POINTS as f64;
                        let x = left * (1.0 - way) + right * way;
                        let likely = (-0.5 * ((x - centre) / deviation).powi(2)).exp()
                            / (deviation * (2.0 * std::f64::consts::PI).sqrt());
                        let (slope, bent) = bends[width];
                        let rise = (x - left) * (slope + bent * (x - right));
                        let log = log_at[width] + rise + (likely * (right - left) / POINTS as f64).ln();
                        let of = |width: usize, k: usize| moments[width / DOUBLES][1][k].0[width % DOUBLES];
                        let mixed = |k: usize| of(width, k) * (1.0 - way) + of(width + 1, k) * way;
                        points.push((log, [mixed(0), mixed(1), x, x * x]));
                    }
                }
                let total = log_sum(points.iter().map(|point| point.0));
                let mean = |k: usize| points.iter().map(|(log, values)| (log - total).exp() * values[k]).sum::<f64>();
                let expected = [0, 1, 2, 3].map(mean);
                let found = [belief.mean[1], belief.square[1], belief.mean[3], belief.square[3]];
                assert!((log - total).abs() < 1e-9 * (1.0 + total.abs()), "{log} {total}");
                assert!((0..4).all(|k| (found[k] - expected[k]).abs() < 1e-9), "{found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn bright_lobes_are_found_where_pixels_show_them() {
        let evidence = Evidence::new([0.3; 3], &weighed_log_widths(), &LobePrior::default());
        let dull = evidence.shared_lobe(&group(0.04, 1)).1.mean[1];
        let bright = evidence.shared_lobe(&group(0.5, 1)).1.mean[1];
        assert!(dull < 0.1 && (bright - 0.5).abs() < 0.15, "{dull} {bright}");
    }
}
