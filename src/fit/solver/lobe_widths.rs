//! Widths at which lobes are weighed: those that were integrated, and halves between wide ones.
//!
//! From one integrated width to the next a lobe's peak halves, so both may fit far worse than what lies between, with an
//! F0 that is off by half: weighed at integrated widths alone, metals come out too dull by as much. Integrals are smooth in
//! the logarithm of the width, so those between follow from four neighbours (Lagrange).

use std::ops::Range;

/// Most widths that are looked at.
pub const MOST_NODES: usize = 10;
/// Widths that are looked at: evenly in the logarithm, closer where lobes are wide.
pub const WIDTHS: [f32; MOST_NODES] = [0.02, 0.04, 0.075, 0.12, 0.18, 0.26, 0.37, 0.52, 0.73, 1.0];
/// First integrated width after which there are halves; below, lobes are narrow and few pixels see them.
const FIRST_HALVED: usize = 4;
/// Number of widths at which lobes are weighed.
pub const LOBE_WIDTHS: usize = 2 * MOST_NODES - 1 - FIRST_HALVED;

/// Logarithms of [`WIDTHS`].
pub fn log_widths() -> [f64; MOST_NODES] {
    WIDTHS.map(|width| f64::from(width).ln())
}

/// Integrated widths and weights that make up the integral at another: four in a row, or as many as are known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WidthStencil {
    /// The first integrated width.
    first: usize,
    /// Number of integrated widths.
    count: usize,
    /// Their weights, which sum to 1.
    weights: [f32; 4],
}

impl WidthStencil {
    /// That of a width, where integrals are known at `nodes[known]` (logarithms, rising); a width beyond them is the
    /// nearest of them.
    pub fn new(nodes: &[f64], log_width: f64, known: Range<usize>) -> Self {
        let (least, most) = (nodes[known.start], nodes[known.end - 1]);
        let x = log_width.clamp(least, most);
        let above = nodes[known.clone()].partition_point(|&node| node < x) + known.start;
        let count = known.len().min(4);
        let first = above.saturating_sub(2).clamp(known.start, known.end - count);
        let mut stencil = WidthStencil { first, count, weights: [0.0; 4] };
        for own in 0..count {
            let others = (0..count).filter(|&other| other != own);
            let ratio = |other: usize| (x - nodes[first + other]) / (nodes[first + own] - nodes[first + other]);
            stencil.weights[own] = others.map(ratio).product::<f64>() as f32;
        }
        stencil
    }

    /// The integrated widths it takes, and what each counts.
    pub(super) fn weights(&self) -> impl Iterator<Item = (usize, f32)> {
        (self.first..self.first + self.count).zip(self.weights)
    }

    /// The value at the width, of values at all integrated widths; not below zero, which no integral of a lobe is.
    pub fn of(&self, values: &[[f32; 3]; MOST_NODES], channel: usize) -> f32 {
        let known = &values[self.first..self.first + self.count];
        let sum: f32 = known.iter().zip(&self.weights).map(|(value, weight)| weight * value[channel]).sum();
        sum.max(0.0)
    }
}

/// The stencil of one width, kept for as long as the same integrals are known.
#[derive(Clone, Copy, Debug, Default)]
pub struct KeptStencil {
    known: (usize, usize),
    stencil: WidthStencil,
}

impl KeptStencil {
    /// As [`WidthStencil::new`]; the width has to be the same each time.
    pub fn of(&mut self, nodes: &[f64], log_width: f64, known: Range<usize>) -> WidthStencil {
        if self.known != (known.start, known.end) {
            self.known = (known.start, known.end);
            self.stencil = WidthStencil::new(nodes, log_width, known);
        }
        self.stencil
    }
}

/// Logarithms of the widths at which lobes are weighed, in rising order.
pub fn weighed_log_widths() -> [f64; LOBE_WIDTHS] {
    let nodes = log_widths();
    std::array::from_fn(|index| match index.checked_sub(FIRST_HALVED) {
        None => nodes[index],
        Some(halves) if halves % 2 == 0 => nodes[FIRST_HALVED + halves / 2],
        Some(halves) => 0.5 * (nodes[FIRST_HALVED + halves / 2] + nodes[FIRST_HALVED + halves / 2 + 1]),
    })
}

/// Stencils of all widths that are weighed, by the first integrated width that is known.
pub fn weighed_stencils() -> [[WidthStencil; LOBE_WIDTHS]; MOST_NODES] {
    let (nodes, widths) = (log_widths(), weighed_log_widths());
    std::array::from_fn(|first| widths.map(|width| WidthStencil::new(&nodes, width, first..MOST_NODES)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_integral_is_met_between_widths() {
        // A lobe that falls off with a width, seen at several angles: within 0.8 % of its peak, 1.3 % beyond 0.73.
        for angle in [0.0f64, 0.3, 0.6, 1.0] {
            let lobe = |log_width: f64| {
                let width = log_width.exp();
                (-(angle / width).powi(2)).exp() / (width * width)
            };
            let known = log_widths().map(|width| [lobe(width) as f32; 3]);
            for log_width in weighed_log_widths().into_iter().skip(FIRST_HALVED + 2) {
                let found = f64::from(WidthStencil::new(&log_widths(), log_width, 0..MOST_NODES).of(&known, 1));
                let peak = (-2.0 * log_width).exp();
                assert!((found - lobe(log_width)).abs() < 0.013 * peak, "{angle} {log_width}: {found}");
            }
        }
    }

    #[test]
    fn integrated_widths_are_themselves_and_none_is_used_that_is_not_known() {
        let stencils = weighed_stencils();
        for (first, stencils) in stencils.iter().enumerate() {
            for (stencil, width) in stencils.iter().zip(weighed_log_widths()) {
                assert!(stencil.first >= first && stencil.first + stencil.count <= MOST_NODES, "{stencil:?}");
                assert!((stencil.weights.iter().sum::<f32>() - 1.0).abs() < 1e-4, "{stencil:?}");
                let node = log_widths().iter().position(|&node| node == width.max(log_widths()[first]));
                if let Some(node) = node {
                    let values = std::array::from_fn(|index| [if index == node { 1.0 } else { 0.0 }; 3]);
                    assert!((stencil.of(&values, 0) - 1.0).abs() < 1e-5, "{first} {width} {stencil:?}");
                }
            }
        }
        assert!(weighed_log_widths().windows(2).all(|pair| pair[0] < pair[1]));
    }
}
