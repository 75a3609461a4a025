//! The grid of nodes between which a decoded flow is read.

use super::lobes::CubeColumns;
use super::warp::{AZIMUTH, DIFFERENCE, HALF, to_cube};
use crate::measured::coordinates::HalfDifference;

/// Nodes of the grid along `theta_half`, `theta_difference` and `phi_difference`; the last wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridShape {
    /// From the mirror direction to the horizon, both ends included; even in the square root of the angle.
    pub halves: usize,
    /// From 0 to a right angle, both ends included.
    pub differences: usize,
    /// Around half a turn.
    pub azimuths: usize,
}

impl Default for GridShape {
    fn default() -> Self {
        GridShape { halves: 41, differences: 31, azimuths: 18 }
    }
}

/// Eight nodes around a point, with weights that sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeTap {
    /// Indices of nodes.
    pub node: [u32; 8],
    /// Weight of each.
    pub weight: [f32; 8],
}

impl GridShape {
    /// How many nodes there are.
    pub fn count(self) -> usize {
        self.halves * self.differences * self.azimuths
    }

    /// The nodes around angles; `None` below the horizon. Node index: `theta_half` fastest, then `theta_difference`.
    pub fn tap(self, at: HalfDifference) -> Option<NodeTap> {
        let point = to_cube(at)?;
        let split = |u: f64, count: usize| {
            let place = u * (count - 1) as f64;
            let low = (place as usize).min(count - 2);
            (low, (place - low as f64) as f32)
        };
        let (half, half_part) = split(point[HALF], self.halves);
        let (difference, difference_part) = split(point[DIFFERENCE], self.differences);
        let turn = point[AZIMUTH] * self.azimuths as f64;
        let azimuth = (turn as usize).min(self.azimuths - 1);
        let azimuth_part = (turn - azimuth as f64) as f32;
        let mut tap = NodeTap::default();
        for corner in 0..8 {
            let (i, j, k) = (corner & 1, corner >> 1 & 1, corner >> 2);
            let slab = (azimuth + k) % self.azimuths;
            tap.node[corner] = ((slab * self.differences + difference + j) * self.halves + half + i) as u32;
            let part = |upper: usize, part: f32| if upper == 1 { part } else { 1.0 - part };
            tap.weight[corner] = part(i, half_part) * part(j, difference_part) * part(k, azimuth_part);
        }
        Some(tap)
    }

    /// The nodes as columns of the cube, all or those named.
    pub(super) fn columns(self, named: &[usize]) -> CubeColumns {
        let at = named
            .iter()
            .map(|&column| {
                let (azimuth, difference) = (column / self.differences, column % self.differences);
                [difference as f64 / (self.differences - 1) as f64, azimuth as f64 / self.azimuths as f64]
            })
            .collect();
        let halves: Vec<f64> = (0..self.halves).map(|half| half as f64 / (self.halves - 1) as f64).collect();
        CubeColumns { at, halves: halves.repeat(named.len()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neural::warp::from_cube;

    #[test]
    fn taps_give_coordinates_back_and_wrap() {
        let shape = GridShape { halves: 5, differences: 4, azimuths: 6 };
        let columns = shape.columns(&(0..24).collect::<Vec<_>>());
        let mut random = crate::math::random::SequentialRandom::new(1);
        for _ in 0..200 {
            let point = [0; 3].map(|_| 0.01 + 0.8 * f64::from(random.next_number()));
            let tap = shape.tap(from_cube(point)).unwrap();
            let mean = |value: &dyn Fn(usize) -> f64| -> f64 {
                tap.node.iter().zip(&tap.weight).map(|(&node, &weight)| f64::from(weight) * value(node as usize)).sum()
            };
            assert!((mean(&|node| columns.halves[node]) - point[HALF]).abs() < 1e-5);
            assert!((mean(&|node| columns.at[node / 5][0]) - point[DIFFERENCE]).abs() < 1e-5);
            assert!((mean(&|node| columns.at[node / 5][1]) - point[AZIMUTH]).abs() < 1e-5);
        }
        let last = shape.tap(from_cube([0.5, 0.5, 0.99])).unwrap();
        assert!(last.node[4] < 20, "the node after the last is the first");
    }
}
