//! The grid of MERL tables: 90 x 90 x 180 nodes over half and difference angles (Matusik et al. 2003).
//!
//! Node (i, j, k) lies at `theta_half = (i/90)^2 pi/2`, `theta_difference = (j/90) pi/2`, `phi_difference = (k/180) pi`:
//! the square packs nodes towards the mirror direction. Its cell index is `k + 180 (j + 90 i)`.
//!
//! A file does not say whether a value belongs to the lower corner of its bin or to the middle. Here it belongs to the
//! lower corner, as in the published neural fits and their tools: `theta_half = 0` is then a node, and so is the plane
//! `phi_difference = 0`.

use super::coordinates::HalfDifference;
use std::f64::consts::{FRAC_PI_2, PI};

/// Nodes over `theta_half`.
pub const THETA_HALF_COUNT: usize = 90;
/// Nodes over `theta_difference`.
pub const THETA_DIFFERENCE_COUNT: usize = 90;
/// Nodes over `phi_difference`, which wraps.
pub const PHI_DIFFERENCE_COUNT: usize = 180;
/// Nodes of a table.
pub const CELL_COUNT: usize = THETA_HALF_COUNT * THETA_DIFFERENCE_COUNT * PHI_DIFFERENCE_COUNT;
/// Nodes that share one `theta_half`.
pub const SLAB: usize = THETA_DIFFERENCE_COUNT * PHI_DIFFERENCE_COUNT;

/// Cell of the indices over `theta_half`, `theta_difference` and `phi_difference`, each below its count.
#[inline]
pub fn cell_of_indices(theta_half: usize, theta_difference: usize, phi_difference: usize) -> usize {
    phi_difference + PHI_DIFFERENCE_COUNT * (theta_difference + THETA_DIFFERENCE_COUNT * theta_half)
}

/// Indices over `theta_half`, `theta_difference` and `phi_difference` of a cell: the inverse of [`cell_of_indices`].
#[inline]
pub fn indices_of_cell(cell: usize) -> [usize; 3] {
    let rest = cell / PHI_DIFFERENCE_COUNT;
    [rest / THETA_DIFFERENCE_COUNT, rest % THETA_DIFFERENCE_COUNT, cell % PHI_DIFFERENCE_COUNT]
}

/// `theta_half` of an index, in radians.
pub fn theta_half_of_index(index: usize) -> f64 {
    let fraction = index as f64 / THETA_HALF_COUNT as f64;
    fraction * fraction * FRAC_PI_2
}

/// The angles of a cell's node.
pub fn coordinates_of_cell(cell: usize) -> HalfDifference {
    let [theta_half, theta_difference, phi_difference] = indices_of_cell(cell);
    HalfDifference {
        theta_half: theta_half_of_index(theta_half),
        theta_difference: theta_difference as f64 * (FRAC_PI_2 / THETA_DIFFERENCE_COUNT as f64),
        phi_difference: phi_difference as f64 * (PI / PHI_DIFFERENCE_COUNT as f64),
    }
}

/// The cell whose bin holds these angles: the rule by which MERL's own reader looks up (it rounds down).
pub fn cell_of_coordinates(at: HalfDifference) -> usize {
    let down = |x: f64, count: usize| (x.max(0.0) as usize).min(count - 1);
    let [x, y, z] = grid_coordinates(at);
    cell_of_indices(
        down(x, THETA_HALF_COUNT),
        down(y, THETA_DIFFERENCE_COUNT),
        down(z.rem_euclid(PHI_DIFFERENCE_COUNT as f64), PHI_DIFFERENCE_COUNT),
    )
}

/// Whether both directions of these angles are above the horizon.
pub fn is_above_horizon(at: HalfDifference) -> bool {
    let [light, eye] = cosines(at);
    light > 0.0 && eye > 0.0
}

/// `n.i` and `n.o`, the cosines to the normal of the directions to light and eye; negative below the horizon.
#[inline]
pub fn cosines(at: HalfDifference) -> [f64; 2] {
    let straight = at.theta_half.cos() * at.theta_difference.cos();
    let aside = at.theta_half.sin() * at.theta_difference.sin() * at.phi_difference.cos();
    [straight - aside, straight + aside]
}

/// Eight cells around a place and their trilinear weights, which sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TableTap {
    /// Cells of a table.
    pub cell: [u32; 8],
    /// Weights in [0, 1].
    pub weight: [f64; 8],
}

/// The tap of any angles: linear between nodes in `sqrt(theta_half)`, `theta_difference` and `phi_difference`. It wraps
/// in the last, and holds the outermost node beyond it in the others. An angle that is not a number counts as 0.
pub fn tap(at: HalfDifference) -> TableTap {
    let [x, y, z] = grid_coordinates(at);
    let (x_low, x_fraction) = held(x, THETA_HALF_COUNT);
    let (y_low, y_fraction) = held(y, THETA_DIFFERENCE_COUNT);
    let z = if z.is_finite() { z.rem_euclid(PHI_DIFFERENCE_COUNT as f64) } else { 0.0 };
    let z_floor = z.floor();
    let z_fraction = z - z_floor;
    let z_low = z_floor as usize % PHI_DIFFERENCE_COUNT;
    let z_high = (z_low + 1) % PHI_DIFFERENCE_COUNT;
    let mut tap = TableTap::default();
    for corner in 0..8 {
        let (i, j, k) = (corner & 1, corner >> 1 & 1, corner >> 2);
        let z_index = if k == 0 { z_low } else { z_high };
        tap.cell[corner] = cell_of_indices(x_low + i, y_low + j, z_index) as u32;
        let part = |upper: usize, fraction: f64| if upper == 1 { fraction } else { 1.0 - fraction };
        tap.weight[corner] = part(i, x_fraction) * part(j, y_fraction) * part(k, z_fraction);
    }
    tap
}

/// The angles in units of nodes.
fn grid_coordinates(at: HalfDifference) -> [f64; 3] {
    [
        (at.theta_half / FRAC_PI_2).max(0.0).sqrt() * THETA_HALF_COUNT as f64,
        at.theta_difference * (THETA_DIFFERENCE_COUNT as f64 / FRAC_PI_2),
        at.phi_difference * (PHI_DIFFERENCE_COUNT as f64 / PI),
    ]
}

/// Lower node and fraction of a coordinate that is held at both ends.
fn held(x: f64, count: usize) -> (usize, f64) {
    // `max` first: it turns what is not a number into 0.
    let x = x.max(0.0).min((count - 1) as f64);
    let low = (x as usize).min(count - 2);
    (low, x - low as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_follow_the_layout_of_merl() {
        assert_eq!(cell_of_indices(1, 2, 3), 3 + 180 * (2 + 90));
        assert_eq!(cell_of_indices(89, 89, 179), CELL_COUNT - 1);
        for cell in (0..CELL_COUNT).step_by(977) {
            let [i, j, k] = indices_of_cell(cell);
            assert_eq!(cell_of_indices(i, j, k), cell);
            let at = coordinates_of_cell(cell);
            // A hair above the node: rounding down must not fall into the bin below.
            let inside = HalfDifference {
                theta_half: at.theta_half + 1e-9,
                theta_difference: at.theta_difference + 1e-9,
                phi_difference: at.phi_difference + 1e-9,
            };
            assert_eq!(cell_of_coordinates(inside), cell);
            let tap = tap(at);
            let own: f64 = (0..8).filter(|&c| tap.cell[c] as usize == cell).map(|c| tap.weight[c]).sum();
            assert!(own > 1.0 - 1e-6, "cell {cell}: {own}");
        }
        // Bin 30 of theta_half starts at (30/90)^2 of 90 degrees = 10 degrees.
        assert!((theta_half_of_index(30).to_degrees() - 10.0).abs() < 1e-12);
    }

    #[test]
    fn cosines_are_those_of_the_directions() {
        for cell in (0..CELL_COUNT).step_by(1009) {
            let at = coordinates_of_cell(cell);
            let (light, eye) = at.directions();
            let [cos_light, cos_eye] = cosines(at);
            assert!((light.z - cos_light).abs() < 1e-12 && (eye.z - cos_eye).abs() < 1e-12);
        }
    }

    #[test]
    fn odd_angles_still_give_a_tap_inside_the_table() {
        for odd in [f64::NAN, f64::INFINITY, -1.0, 1e300, 10.0] {
            for at in [
                HalfDifference { theta_half: odd, ..Default::default() },
                HalfDifference { theta_difference: odd, ..Default::default() },
                HalfDifference { phi_difference: odd, ..Default::default() },
            ] {
                let tap = tap(at);
                assert!(tap.cell.iter().all(|&cell| (cell as usize) < CELL_COUNT), "{odd}");
                assert!((tap.weight.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{odd}");
                assert!(cell_of_coordinates(at) < CELL_COUNT);
            }
        }
    }
}
