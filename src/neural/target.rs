//! The densities that a flow learns: `log(1 + stored value)` over the unit cube, one per material and colour channel.
//!
//! "Stored value" is the number in a MERL file, 1500 times the reflectance for red, a little less for green and blue;
//! the paper's code learns from the same. A grid of the cube holds it, evened out by linear interpolation.

use super::warp::{AZIMUTH, DIFFERENCE, HALF, from_cube};
use crate::math::parallel;
use crate::measured::coordinates::HalfDifference;
use crate::measured::grid::THETA_DIFFERENCE_COUNT;
use crate::measured::table::CHANNEL_SCALE;

/// Nodes along `theta_half`, in the middle of as many parts.
pub const HALVES: usize = 64;
/// Nodes along `theta_difference`, likewise.
pub const DIFFERENCES: usize = 64;
/// Nodes along `phi_difference`, likewise; it wraps.
pub const AZIMUTHS: usize = 36;

/// One density on the grid.
#[derive(Clone, Debug)]
pub struct TargetGrid {
    /// `log(1 + stored value)`, `theta_half` fastest, then `theta_difference`.
    values: Vec<f32>,
    /// Mean over the cube: the density is the value over it.
    mean: f64,
}

/// A column of `theta_half` between four columns of the grid.
#[derive(Clone, Debug)]
pub struct TargetColumn([f32; HALVES]);

impl TargetGrid {
    /// The three densities of a function that writes reflectance in 1/sr at many points (from several threads).
    /// Negative values and such that are not finite count as zero.
    pub fn of_reflectance(fill: impl Fn(&[HalfDifference], &mut [[f64; 3]]) + Sync) -> [TargetGrid; 3] {
        // What a table of MERL's cannot hold, beyond its last node, is held at that node.
        let last_node = (THETA_DIFFERENCE_COUNT - 1) as f64 / THETA_DIFFERENCE_COUNT as f64;
        let slabs = parallel::map(AZIMUTHS, |azimuth| {
            let mut at = Vec::with_capacity(HALVES * DIFFERENCES);
            for difference in 0..DIFFERENCES {
                for half in 0..HALVES {
                    let mut point = [0.0; 3];
                    point[HALF] = (half as f64 + 0.5) / HALVES as f64;
                    point[DIFFERENCE] = ((difference as f64 + 0.5) / DIFFERENCES as f64).min(last_node);
                    point[AZIMUTH] = (azimuth as f64 + 0.5) / AZIMUTHS as f64;
                    at.push(from_cube(point));
                }
            }
            let mut values = vec![[0.0; 3]; at.len()];
            fill(&at, &mut values);
            values
        });
        [0, 1, 2].map(|channel| {
            let values: Vec<f32> = slabs
                .iter()
                .flatten()
                .map(|value| {
                    let stored = value[channel] / CHANNEL_SCALE[channel];
                    if stored.is_finite() { stored.clamp(0.0, 1e30).ln_1p() as f32 } else { 0.0 }
                })
                .collect();
            let sum: f64 = values.iter().map(|&value| f64::from(value)).sum();
            TargetGrid { mean: (sum / values.len() as f64).max(1e-9), values }
        })
    }

    /// The mean of `log(1 + stored value)` over the cube; its logarithm is the colour of the density's lobe.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// The column at coordinates in [0, 1].
    pub fn column(&self, difference: f64, azimuth: f64) -> TargetColumn {
        let (row, row_part) = held(difference, DIFFERENCES);
        let turn = azimuth * AZIMUTHS as f64 - 0.5;
        let slab = (turn.floor() as isize).rem_euclid(AZIMUTHS as isize) as usize;
        let slab_part = (turn - turn.floor()) as f32;
        let part = |slab: usize, row: usize| {
            let from = (slab % AZIMUTHS * DIFFERENCES + row) * HALVES;
            &self.values[from..from + HALVES]
        };
        let corners = [part(slab, row), part(slab, row + 1), part(slab + 1, row), part(slab + 1, row + 1)];
        TargetColumn(std::array::from_fn(|half| {
            let low = corners[0][half] + row_part * (corners[1][half] - corners[0][half]);
            let high = corners[2][half] + row_part * (corners[3][half] - corners[2][half]);
            low + slab_part * (high - low)
        }))
    }
}

impl TargetColumn {
    /// The value at a coordinate in [0, 1]; over the mean of its grid it is the density.
    pub fn at(&self, half: f64) -> f64 {
        let (index, part) = held(half, HALVES);
        f64::from(self.0[index] + part * (self.0[index + 1] - self.0[index]))
    }
}

/// Lower node and fraction of a coordinate among nodes in the middle of `count` parts, held beyond the outermost ones.
fn held(u: f64, count: usize) -> (usize, f32) {
    let place = (u * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
    let low = (place as usize).min(count - 2);
    (low, (place - low as f64) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neural::warp::to_cube;

    #[test]
    fn a_smooth_reflectance_is_read_back_between_nodes() {
        let value = |at: &HalfDifference| 0.01 * (1.0 + at.theta_half.cos() * (2.0 * at.phi_difference).cos().powi(2));
        let [red, ..] = TargetGrid::of_reflectance(|at, values| {
            at.iter().zip(values).for_each(|(at, slot)| *slot = [value(at), 0.0, f64::NAN]);
        });
        let (mut sum, mut off) = (0.0, 0.0);
        for index in 0..500 {
            let u = [0.377, 0.618, 0.821].map(|step: f64| (step * f64::from(index)).fract() * 0.97);
            let expected = (value(&from_cube(u)) * 1500.0).ln_1p();
            let found = red.column(u[DIFFERENCE], u[AZIMUTH]).at(u[HALF]);
            // At right angles in azimuth the horizon has a kink, which the grid rounds: single points may be off.
            assert!((found - expected).abs() < 0.1, "{found} {expected}");
            off += (found - expected).abs() / 500.0;
            assert!(to_cube(from_cube(u)).is_some());
            sum += found / 500.0;
        }
        assert!((sum / red.mean() - 1.0).abs() < 0.05);
        assert!(off < 3e-3, "{off}");
        let ends = [red.column(0.5, 1e-9).at(0.5), red.column(0.5, 1.0 - 1e-9).at(0.5)];
        assert!((ends[0] - ends[1]).abs() < 1e-5, "no seam: {ends:?}");
    }
}
