//! How likely pixels are if they share one lobe, whatever its F0 and width, and what is then believed of both.
//!
//! A surface is a dielectric, a metal, or neither: kinds that differ in F0 and in what lies under the lobe. A metal has
//! next to no diffuse reflectance; F0 of all others is grey. Without that knowledge a wide lobe of a high F0 stands in
//! for diffuse reflectance wherever the light is a little wrong, in the complementary colour where it is too much.
//! The logarithm of the width is normal. Kinds that have the same belief of it make a family: one of them holds for any
//! scene, others may come from what the scene has shown elsewhere ([`super::lobe_families`]).

use super::cell_sums::System;
use super::lobe_widths::LOBE_WIDTHS;
use glam::{DMat3, DVec3};

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
}

/// What is believed of a kind of surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeKind {
    /// Mean of F0 per channel, standard deviation of what its channels have in common, and of what they do not.
    pub specular: ([f64; 3], f64, f64),
    /// Mean per channel and standard deviation of a group's diffuse reflectance; `None` for the mean of what lies around.
    pub diffuse: (Option<[f64; 3]>, f64),
    /// Share of all surface.
    pub share: f64,
}

impl LobeKind {
    /// The channels' sums with what is believed of the group's diffuse reflectance.
    fn with_belief(&self, sums: &[System; 3], around: [f64; 3]) -> [System; 3] {
        let mean = self.diffuse.0.unwrap_or(around);
        let mut all = *sums;
        for (sums, mean) in all.iter_mut().zip(mean) {
            sums.observe(self.diffuse.1.powi(-2), 1.0, 0.0, mean);
        }
        all
    }

    /// Logarithm of the evidence at one width, with mean and variance of F0 per channel; given what
    /// [`LobeKind::precision`] says.
    ///
    /// Diffuse reflectance is integrated out, and it is at least zero: in a channel where it would be less at the best
    /// F0 it is held at zero, and F0 found anew. Without that, wide and strong lobes over what they outshine, made up
    /// for by less than black below, took over photographs (`saharov_bmvs`: RMSE of the maps .0446, with it .0367).
    fn at_width(
        &self,
        (precision, log_determinant): (DMat3, f64),
        sums: &[System; 3],
        around: [f64; 3],
    ) -> (f64, [(f64, f64); 3]) {
        let all = self.with_belief(sums, around);
        let mean = DVec3::from_array(self.specular.0);
        let log_volume =
            log_determinant + all.iter().map(|all| (all.ee * self.diffuse.1 * self.diffuse.1).ln()).sum::<f64>();
        let mut held = [false; 3];
        loop {
            let (mut total, mut side) = (precision, precision * mean);
            let mut cost = mean.dot(side);
            for (channel, &System { ee, es, ss, ey, sy, yy }) in all.iter().enumerate() {
                let keep = if held[channel] { 0.0 } else { 1.0 / ee };
                total.col_mut(channel)[channel] += ss - es * es * keep;
                side[channel] += sy - es * ey * keep;
                cost += yy - ey * ey * keep;
            }
            let inverse = total.inverse();
            let best = inverse * side;
            let is_below = |c: usize| !held[c] && all[c].ey < all[c].es * best[c];
            let below = [0, 1, 2].map(is_below);
            if below == [false; 3] {
                let log = self.share.ln() - 0.5 * (cost - side.dot(best) + total.determinant().ln() + log_volume);
                return (log, [0, 1, 2].map(|c| (best[c].clamp(0.0, 1.0), inverse.col(c)[c].max(0.0))));
            }
            held = [0, 1, 2].map(|c| held[c] || below[c]);
        }
    }

    /// Inverse covariance of F0, and the logarithm of the covariance's determinant.
    fn precision(&self) -> (DMat3, f64) {
        let (common, own) = (self.specular.1.powi(2), self.specular.2.powi(2));
        let share = common / (own + 3.0 * common);
        let precision = (DMat3::IDENTITY - DMat3::from_cols_array(&[share; 9])) * (1.0 / own);
        (precision, 2.0 * own.ln() + (own + 3.0 * common).ln())
    }
}

/// Kinds of surface whose widths are believed to be alike.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeFamily {
    /// The kinds.
    pub kinds: Vec<LobeKind>,
    /// Mean and standard deviation of the logarithm of the width.
    pub log_width: (f64, f64),
    /// Standard deviations from the mean within which widths are looked at; beyond, another family has to hold.
    pub reach: f64,
}

/// What is believed of lobes before looking.
#[derive(Clone, Debug, PartialEq)]
pub struct LobePrior {
    /// All kinds of surface; their shares sum to 1.
    pub families: Vec<LobeFamily>,
    /// Probability that a group that could be cut shares one lobe.
    pub keep: f64,
}

impl Default for LobePrior {
    /// Dielectrics, metals, and what is neither.
    fn default() -> Self {
        let grey = |value: f64| [value; 3];
        let dielectric = LobeKind { specular: (grey(0.05), 0.025, 0.005), diffuse: (None, 0.35), share: 0.8 };
        let metal = LobeKind { specular: (grey(0.55), 0.2, 0.15), diffuse: (Some(grey(0.05)), 0.1), share: 0.17 };
        let other = LobeKind { specular: (grey(0.12), 0.08, 0.01), diffuse: (None, 0.35), share: 0.03 };
        let any = LobeFamily { kinds: vec![dielectric, metal, other], log_width: (-0.6, 0.5), reach: f64::INFINITY };
        LobePrior { families: vec![any], keep: 0.5 }
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

/// Logarithm of the evidence that a group shares one lobe, and what is then believed of it.
/// `around` is the mean diffuse reflectance of what lies around.
pub fn shared_lobe(
    sums: &LobeSumsOfGroup,
    around: [f64; 3],
    log_widths: &[f64; LOBE_WIDTHS],
    prior: &LobePrior,
) -> (f64, LobeBelief) {
    let of = |family: &LobeFamily| family.lobe(sums, around, log_widths);
    if let [family] = prior.families.as_slice() {
        return of(family);
    }
    let families: Vec<(f64, LobeBelief)> = prior.families.iter().map(of).collect();
    let total = log_sum(families.iter().map(|family| family.0));
    let mut belief = LobeBelief::default();
    for (log, own) in &families {
        belief.mix(own, (log - total).exp());
    }
    (total, belief)
}

impl LobeFamily {
    /// Logarithm of the evidence of all kinds together, with their shares, and what is believed if it is one of them.
    fn lobe(&self, sums: &LobeSumsOfGroup, around: [f64; 3], log_widths: &[f64; LOBE_WIDTHS]) -> (f64, LobeBelief) {
        let (centre, deviation) = self.log_width;
        // Three widths at least: the curvature between them is asked for.
        let first = log_widths.partition_point(|&x| x < centre - self.reach * deviation).clamp(1, LOBE_WIDTHS - 2) - 1;
        let last =
            log_widths.partition_point(|&x| x <= centre + self.reach * deviation).clamp(first + 2, LOBE_WIDTHS - 1);
        // Per width: logarithm of the evidence, mean and square of F0.
        let mut log_at = [0.0f64; LOBE_WIDTHS];
        let mut specular = [[[0.0f64; 2]; 3]; LOBE_WIDTHS];
        let precisions: Vec<_> = self.kinds.iter().map(LobeKind::precision).collect();
        let mut of_kinds = Vec::with_capacity(self.kinds.len());
        for node in first..=last {
            of_kinds.clear();
            let prepared = self.kinds.iter().zip(&precisions);
            of_kinds.extend(prepared.map(|(kind, &precision)| kind.at_width(precision, &sums.0[node], around)));
            log_at[node] = log_sum(of_kinds.iter().map(|kind| kind.0));
            for (log_kind, of_channels) in &of_kinds {
                let weight = (log_kind - log_at[node]).exp();
                for (channel, (mean, variance)) in of_channels.iter().enumerate() {
                    specular[node][channel][0] += weight * mean;
                    specular[node][channel][1] += weight * (variance + mean * mean);
                }
            }
        }
        // Between widths the logarithm of the evidence is a parabola, as that of a normal distribution is.
        let mut points = [(0.0f64, 0usize, 0.0f64, 0.0f64); (LOBE_WIDTHS - 1) * FINE + 1];
        let points = &mut points[..(last - first) * FINE + 1];
        for (index, point) in points.iter_mut().enumerate() {
            let node = (first + index / FINE).min(last - 1);
            let share = (index - (node - first) * FINE) as f64 / FINE as f64;
            let x = log_widths[node] * (1.0 - share) + log_widths[node + 1] * share;
            let step = (log_widths[node + 1] - log_widths[node]) / FINE as f64;
            let log = between(&log_widths[first..=last], &log_at[first..=last], node - first, x)
                - 0.5 * ((x - centre) / deviation).powi(2);
            *point = (log + step.ln(), node, share, x);
        }
        let norm = (deviation * (2.0 * std::f64::consts::PI).sqrt()).ln();
        let total = log_sum(points.iter().map(|point| point.0));
        let mut belief = LobeBelief::default();
        for &(log, node, share, x) in points.iter() {
            let weight = (log - total).exp();
            if weight < 1e-9 {
                continue;
            }
            for c in 0..3 {
                let mixed = |k: usize| specular[node][c][k] * (1.0 - share) + specular[node + 1][c][k] * share;
                belief.mean[c] += weight * mixed(0);
                belief.square[c] += weight * mixed(1);
            }
            belief.mean[3] += weight * x;
            belief.square[3] += weight * x * x;
        }
        (total - norm, belief)
    }
}

/// Between two nodes: the straight line, and the smaller of the curvatures at both ends where they have one sign. For a
/// parabola that is the parabola; beside a kink it does not overshoot.
fn between(x: &[f64], y: &[f64], node: usize, at: f64) -> f64 {
    let slope = |k: usize| (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
    let curvature = |middle: usize| {
        let middle = middle.clamp(1, x.len() - 2);
        (slope(middle) - slope(middle - 1)) / (x[middle + 1] - x[middle - 1])
    };
    let (left, right) = (curvature(node), curvature(node + 1));
    let bent = if left * right <= 0.0 { 0.0 } else { left.signum() * left.abs().min(right.abs()) };
    y[node] + (at - x[node]) * (slope(node) + bent * (at - x[node + 1]))
}

/// Logarithm of a sum of exponentials.
pub fn log_sum(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return largest;
    }
    largest + logs.map(|log| (log - largest).exp()).sum::<f64>().ln()
}
