//! One block of surface under a known light: closed form in the reflectances, a global search in the width.
//!
//! The block shares F0 and the lobe's width; diffuse reflectance is one number for the block plus a deviation for each
//! of its cells. With `S(a)` the lobe's integral and `E` the arriving light, a pixel is
//! `y = (rho + delta_cell) E + F0 S(a) + S5(a)`.
//! Deviations have a normal prior of variance tau^2, so they can be eliminated in closed form: what remains of a cell is
//! six sums, and cells add up. At each width a bounded 2 x 2 system per channel gives rho and F0; the width is one for
//! all channels, found by looking at all nodes, then halfway beside the best ([`super::lobe_widths`]), then by a parabola.

use super::cell_sums::{System, ridge, system};
use super::lobe_widths::WidthStencil;
use super::pixel_terms::{BlockPrior, PixelTerms};

/// What was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockSolution {
    /// F0 per channel.
    pub specular: [f32; 3],
    /// Logarithm of the width.
    pub log_width: f32,
    /// How the lobe's integral at that width follows from those that were integrated.
    pub stencil: WidthStencil,
    /// Diffuse reflectance of the block.
    pub diffuse: [f32; 3],
    /// Diffuse reflectance of its cells.
    pub cells: Vec<[f32; 3]>,
    /// Root mean square of the residuals over observations that count and channels.
    pub residual: f32,
    /// Index of the best width among the nodes.
    pub best_node: usize,
}

/// Solves a block over nodes `log_widths[range]`; terms outside the range may be unset.
///
/// `None` when nothing has weight.
pub fn solve_block(
    terms: &[PixelTerms],
    cell_count: usize,
    log_widths: &[f64],
    range: std::ops::Range<usize>,
    prior: &BlockPrior,
) -> Option<BlockSolution> {
    let weight: f64 = terms.iter().map(|term| f64::from(term.weight)).sum();
    if weight <= 0.0 {
        return None;
    }
    let mut scratch = vec![System::default(); cell_count];
    let mut cost_at = |log_width: f64| -> f64 {
        let stencil = WidthStencil::new(log_widths, log_width, range.clone());
        let of_channels = (0..3).map(|channel| {
            let at = |term: &PixelTerms| (stencil.of(&term.base, channel), stencil.of(&term.grazing, channel));
            system(terms, channel, at, prior, &mut scratch).solve().1
        });
        let misfit = of_channels.sum::<f64>() / (prior.noise * prior.noise);
        misfit + ((log_width - prior.log_width.0) / prior.log_width.1).powi(2)
    };
    let least = |costs: &[(f64, f64)]| {
        let better = |best: usize, index: usize| if costs[index].1 < costs[best].1 { index } else { best };
        (0..costs.len()).fold(0, better)
    };
    let costs: Vec<(f64, f64)> = log_widths[range.clone()].iter().map(|&x| (x, cost_at(x))).collect();
    let best = least(&costs);
    let best_node = range.start + best;
    // Halfway to the neighbours: from one width to the next the cost is no parabola yet.
    let mut near = vec![costs[best]];
    if best > 0 {
        let x = 0.5 * (costs[best - 1].0 + costs[best].0);
        near.splice(0..0, [costs[best - 1], (x, cost_at(x))]);
    }
    if best + 1 < costs.len() {
        let x = 0.5 * (costs[best].0 + costs[best + 1].0);
        near.extend([(x, cost_at(x)), costs[best + 1]]);
    }
    let best = least(&near);
    let mut log_width = near[best].0;
    if best > 0 && best + 1 < near.len() {
        let [(x0, c0), (x1, c1), (x2, c2)] = [near[best - 1], near[best], near[best + 1]];
        let (d0, d2) = ((c0 - c1) / (x0 - x1), (c2 - c1) / (x2 - x1));
        let curvature = 2.0 * (d2 - d0) / (x2 - x0);
        if curvature > 0.0 {
            let slope = (d0 * (x2 - x1) + d2 * (x1 - x0)) / (x2 - x0);
            log_width = (x1 - slope / curvature).clamp(x0, x2);
        }
    }
    let stencil = WidthStencil::new(log_widths, log_width, range);
    let mut solution = BlockSolution {
        log_width: log_width as f32,
        stencil,
        cells: vec![[0.0; 3]; cell_count],
        best_node,
        ..BlockSolution::default()
    };
    let mut squared = 0.0;
    for channel in 0..3 {
        let at = |term: &PixelTerms| (stencil.of(&term.base, channel), stencil.of(&term.grazing, channel));
        let ([rho, specular], _) = system(terms, channel, at, prior, &mut scratch).solve();
        solution.diffuse[channel] = rho as f32;
        solution.specular[channel] = specular as f32;
        let ridge = ridge(prior);
        for (cell, sums) in solution.cells.iter_mut().zip(&scratch) {
            // The deviation that is best given rho and F0.
            let deviation = (sums.ey - rho * sums.ee - specular * sums.es) / (ridge + sums.ee);
            let deviation = if deviation.is_finite() { deviation } else { 0.0 };
            cell[channel] = (rho + deviation).clamp(0.0, 1.0) as f32;
        }
        for term in terms {
            let (base, grazing) = at(term);
            let model = solution.cells[usize::from(term.cell)][channel] * term.arriving[channel]
                + specular as f32 * base
                + grazing;
            squared += f64::from(term.weight) * f64::from(term.radiance[channel] - model).powi(2);
        }
    }
    solution.residual = (squared / (3.0 * weight)).sqrt() as f32;
    Some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Made-up pixels: a lobe that falls off with a width, some cells.
    fn pixels(log_widths: &[f64], truth: ([f32; 3], [f32; 3], f64), noise: f32) -> Vec<PixelTerms> {
        let mut random = SequentialRandom::new(11);
        let lobe = |angle: f32, log_width: f64| {
            let width = log_width.exp() as f32;
            0.3 / (width * width) * (-(angle * angle) / (width * width)).exp()
        };
        (0..240)
            .map(|index| {
                let angle = 1.2 * random.next_number();
                let cell = (index % 6) as u16;
                let mut term = PixelTerms { cell, weight: 1.0, ..PixelTerms::default() };
                for channel in 0..3 {
                    term.arriving[channel] = 0.6 + 0.8 * random.next_number();
                    for (node, &log_width) in log_widths.iter().enumerate() {
                        term.base[node][channel] = lobe(angle, log_width);
                        term.grazing[node][channel] = 0.01 * lobe(angle, log_width);
                    }
                    let own = truth.0[channel] + 0.02 * (f32::from(cell) - 2.5);
                    term.radiance[channel] = own * term.arriving[channel]
                        + (truth.1[channel] + 0.01) * lobe(angle, truth.2)
                        + noise * (random.next_number() - 0.5);
                }
                term
            })
            .collect()
    }

    fn prior() -> BlockPrior {
        BlockPrior { specular: ([0.1; 3], 10.0), log_width: (-1.0, 10.0), noise: 0.01, spread: 0.1 }
    }

    #[test]
    fn a_block_is_recovered_with_its_cells() {
        let log_widths: Vec<f64> = (0..8).map(|node| -2.8 + 0.4 * f64::from(node)).collect();
        let truth = ([0.3, 0.5, 0.2], [0.05, 0.2, 0.6], -1.1);
        let found = solve_block(&pixels(&log_widths, truth, 0.01), 6, &log_widths, 0..8, &prior()).unwrap();
        assert!((f64::from(found.log_width) + 1.1).abs() < 0.05, "{found:?}");
        for channel in 0..3 {
            assert!((found.specular[channel] - truth.1[channel]).abs() < 0.03, "{found:?}");
            for (cell, value) in found.cells.iter().enumerate() {
                let own = truth.0[channel] + 0.02 * (cell as f32 - 2.5);
                assert!((value[channel] - own).abs() < 0.01, "{found:?}");
            }
        }
    }

    #[test]
    fn eliminated_cells_give_the_dense_least_squares_solution() {
        let log_widths = [-1.2, -0.8];
        let truth = ([0.3, 0.5, 0.2], [0.05, 0.2, 0.6], -1.0);
        let terms = pixels(&log_widths, truth, 0.05);
        let prior = prior();
        let mut cells = vec![System::default(); 6];
        for channel in 0..3 {
            let at = |term: &PixelTerms| (term.base[1][channel], term.grazing[1][channel]);
            let ([rho, specular], _) = system(&terms, channel, at, &prior, &mut cells).solve();
            // Dense: unknowns rho, F0 and six deviations with their prior as rows, by normal equations and elimination.
            let mut matrix = [[0.0f64; 9]; 8];
            let mut add = |row: [f64; 8], y: f64| {
                for i in 0..8 {
                    for k in 0..8 {
                        matrix[i][k] += row[i] * row[k];
                    }
                    matrix[i][8] += row[i] * y;
                }
            };
            for term in &terms {
                let mut row = [0.0; 8];
                row[0] = f64::from(term.arriving[channel]);
                row[1] = f64::from(term.base[1][channel]);
                row[2 + usize::from(term.cell)] = row[0];
                add(row, f64::from(term.radiance[channel] - term.grazing[1][channel]));
            }
            for cell in 0..6 {
                let mut row = [0.0; 8];
                row[2 + cell] = prior.noise / prior.spread;
                add(row, 0.0);
            }
            let mut row = [0.0; 8];
            row[1] = prior.noise / prior.specular.1;
            add(row, row[1] * prior.specular.0[channel]);
            for pivot in 0..8 {
                for other in 0..8 {
                    if other != pivot {
                        let factor = matrix[other][pivot] / matrix[pivot][pivot];
                        for k in 0..9 {
                            matrix[other][k] -= factor * matrix[pivot][k];
                        }
                    }
                }
            }
            let dense = [0, 1].map(|k| matrix[k][8] / matrix[k][k]);
            assert!((rho - dense[0]).abs() < 1e-8 && (specular - dense[1]).abs() < 1e-8, "{rho} {specular} {dense:?}");
        }
    }

    #[test]
    fn bounds_hold_and_nothing_is_found_in_nothing() {
        let log_widths = [-1.2, -0.8];
        let mut terms = pixels(&log_widths, ([0.9; 3], [0.9; 3], -1.0), 0.0);
        for term in &mut terms {
            term.radiance = term.radiance.map(|value| 3.0 * value);
        }
        let found = solve_block(&terms, 6, &log_widths, 0..2, &prior()).unwrap();
        assert!(found.specular.iter().chain(&found.diffuse).all(|value| (0.0..=1.0).contains(value)));
        for term in &mut terms {
            term.weight = 0.0;
        }
        assert_eq!(solve_block(&terms, 6, &log_widths, 0..2, &prior()), None);
    }
}
