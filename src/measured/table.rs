//! A measured reflectance: a table over the grid of MERL, as stored.

use super::coordinates::HalfDifference;
use super::grid::{self, CELL_COUNT, SLAB};
use super::model::ReflectanceModel;
use crate::error::{Error, ErrorKind, Result};
use crate::math::parallel;
use glam::DVec3;

/// Reflectance in 1/sr over stored value, per channel (the factors of MERL's reader).
pub const CHANNEL_SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// What is stored where nothing was measured.
pub const INVALID: f64 = -1.0;

/// Isotropic reflectance measured on the grid of MERL: 90 x 90 x 180 cells, linear RGB.
///
/// Stored ("raw") values are kept bit for bit, as a file has them: reflectance is raw times [`CHANNEL_SCALE`], in 1/sr
/// without the cosine. Two masks are told apart:
/// * a cell is **valid** when all three channels are finite and not negative: lookups use valid cells only;
/// * a cell **counts** in figures of error when it is valid and its red is above 0, which is the rule of the code
///   released with iBRDF (Chen, Nobuhara and Nishino 2020: entries with red not 0, after negatives became 0).
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredBrdf {
    /// Channel after channel, each in the order of [`grid::cell_of_indices`].
    raw: Vec<f64>,
}

impl MeasuredBrdf {
    /// A table of stored values: all red, all green, all blue, each [`CELL_COUNT`] long.
    ///
    /// Errors: another length, or no valid cell at all.
    pub fn from_raw(raw: Vec<f64>) -> Result<Self> {
        if raw.len() != 3 * CELL_COUNT {
            return Err(Error::new(
                ErrorKind::Malformed,
                format!("a table needs {} values, not {}", 3 * CELL_COUNT, raw.len()),
            ));
        }
        let table = MeasuredBrdf { raw };
        if !(0..CELL_COUNT).any(|cell| table.is_valid(cell)) {
            return Err(Error::new(ErrorKind::NonFinite, "no cell of the table holds a reflectance")
                .remedy("check that the file is a MERL table; negative values mark what was not measured"));
        }
        Ok(table)
    }

    /// The table of a function of many points at once, which writes reflectance in 1/sr; it is called once for each
    /// `theta_half`, from several threads. Cells below the horizon become invalid, and so do values that are not finite
    /// or negative.
    pub fn from_batches(fill: impl Fn(&[HalfDifference], &mut [[f64; 3]]) + Sync) -> Self {
        let mut values = vec![[0.0; 3]; CELL_COUNT];
        parallel::each_chunk(&mut values, SLAB, &|slab, values| {
            let cells = slab * SLAB..(slab + 1) * SLAB;
            let above: Vec<bool> =
                cells.clone().map(|cell| grid::is_above_horizon(grid::coordinates_of_cell(cell))).collect();
            let at: Vec<HalfDifference> = cells
                .zip(&above)
                .filter(|(_, above)| **above)
                .map(|(cell, _)| grid::coordinates_of_cell(cell))
                .collect();
            let mut found = vec![[0.0; 3]; at.len()];
            fill(&at, &mut found);
            let mut found = found.into_iter();
            for (value, above) in values.iter_mut().zip(above) {
                let filled = if above { found.next() } else { None };
                *value = filled.filter(|value| value.iter().all(|v| v.is_finite() && *v >= 0.0)).unwrap_or([-1.0; 3]);
            }
        });
        let mut raw = vec![INVALID; 3 * CELL_COUNT];
        parallel::each_chunk(&mut raw, CELL_COUNT, &|channel, raw| {
            for (raw, value) in raw.iter_mut().zip(&values) {
                if value[channel] >= 0.0 {
                    *raw = value[channel] / CHANNEL_SCALE[channel];
                }
            }
        });
        MeasuredBrdf { raw }
    }

    /// The table of a function that gives reflectance in 1/sr; see [`Self::from_batches`].
    pub fn from_fn(value: impl Fn(HalfDifference) -> [f64; 3] + Sync) -> Self {
        Self::from_batches(|at, values| {
            for (value_here, at) in values.iter_mut().zip(at) {
                *value_here = value(*at);
            }
        })
    }

    /// The table of a model with these parameters; see [`Self::from_batches`].
    pub fn from_model(model: &dyn ReflectanceModel, parameters: &[f64]) -> Self {
        Self::from_batches(|at, values| model.evaluate(parameters, at, values))
    }

    /// All stored values: red, green, blue, each [`CELL_COUNT`] long.
    pub fn raw(&self) -> &[f64] {
        &self.raw
    }

    /// Stored values of a cell below [`CELL_COUNT`].
    #[inline]
    pub fn raw_value(&self, cell: usize) -> [f64; 3] {
        [self.raw[cell], self.raw[CELL_COUNT + cell], self.raw[2 * CELL_COUNT + cell]]
    }

    /// Reflectance of a cell below [`CELL_COUNT`], in 1/sr; 0 where it is invalid.
    #[inline]
    pub fn value(&self, cell: usize) -> [f64; 3] {
        if !self.is_valid(cell) {
            return [0.0; 3];
        }
        let raw = self.raw_value(cell);
        std::array::from_fn(|channel| raw[channel] * CHANNEL_SCALE[channel])
    }

    /// Whether a cell was measured.
    #[inline]
    pub fn is_valid(&self, cell: usize) -> bool {
        self.raw_value(cell).iter().all(|value| value.is_finite() && *value >= 0.0)
    }

    /// Whether a cell counts in figures of error.
    #[inline]
    pub fn counts(&self, cell: usize) -> bool {
        self.raw[cell] > 0.0 && self.is_valid(cell)
    }

    /// Cells that count in figures of error, ascending.
    pub fn counted_cells(&self) -> Vec<u32> {
        (0..CELL_COUNT).filter(|&cell| self.counts(cell)).map(|cell| cell as u32).collect()
    }

    /// Reflectance in 1/sr by trilinear interpolation over the valid ones of the eight cells around, their weights
    /// scaled to sum to 1; `None` where none of them is valid. Periodic in `phi_difference`, hence reciprocal.
    pub fn lookup(&self, at: HalfDifference) -> Option<[f64; 3]> {
        let tap = grid::tap(at);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for (&cell, &weight) in tap.cell.iter().zip(&tap.weight) {
            if weight > 0.0 && self.is_valid(cell as usize) {
                let raw = self.raw_value(cell as usize);
                for channel in 0..3 {
                    sum[channel] += weight * raw[channel];
                }
                total += weight;
            }
        }
        (total > 0.0).then(|| std::array::from_fn(|channel| sum[channel] / total * CHANNEL_SCALE[channel]))
    }

    /// Reflectance in 1/sr for two directions of any length that leave the surface, in a frame whose z axis is the
    /// normal; 0 where one of them is not above the horizon, and where nothing was measured.
    pub fn evaluate(&self, to_light: DVec3, to_eye: DVec3) -> [f64; 3] {
        let (Some(to_light), Some(to_eye)) = (to_light.try_normalize(), to_eye.try_normalize()) else {
            return [0.0; 3];
        };
        if !(to_light.z > 0.0 && to_eye.z > 0.0) {
            return [0.0; 3];
        }
        self.lookup(HalfDifference::from_directions(to_light, to_eye)).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use std::f64::consts::PI;

    /// Smooth, periodic in phi, different in each channel.
    fn smooth(at: HalfDifference) -> [f64; 3] {
        let base = 0.2 + (-3.0 * at.theta_half).exp() + 0.1 * at.theta_difference;
        [base, base * (1.5 + 0.3 * (2.0 * at.phi_difference).cos()), 0.05]
    }

    fn above(random: &mut SequentialRandom) -> DVec3 {
        let mut next = || f64::from(random.next_number());
        DVec3::new(2.0 * next() - 1.0, 2.0 * next() - 1.0, 0.1 + next()).try_normalize().unwrap()
    }

    #[test]
    fn lookup_meets_nodes_and_interpolates_a_smooth_function_between_them() {
        let table = MeasuredBrdf::from_fn(smooth);
        let mut random = SequentialRandom::new(4);
        for _ in 0..2000 {
            let (light, eye) = (above(&mut random), above(&mut random));
            let at = HalfDifference::from_directions(light, eye);
            let (found, truth) = (table.evaluate(light, eye), smooth(at));
            for channel in 0..3 {
                let error = (found[channel] / truth[channel] - 1.0).abs();
                assert!(error < 5e-3, "{at:?} channel {channel}: {error}");
            }
        }
        for cell in (0..CELL_COUNT).step_by(3001).filter(|&cell| table.is_valid(cell)) {
            let (value, truth) = (table.value(cell), smooth(grid::coordinates_of_cell(cell)));
            assert!((0..3).all(|c| (value[c] - truth[c]).abs() < 1e-12));
        }
    }

    #[test]
    fn it_is_reciprocal_and_has_no_seam() {
        let table = MeasuredBrdf::from_fn(smooth);
        let mut random = SequentialRandom::new(5);
        for _ in 0..2000 {
            let (light, eye) = (above(&mut random), above(&mut random));
            let (forth, back) = (table.evaluate(light, eye), table.evaluate(eye, light));
            assert!((0..3).all(|c| (forth[c] - back[c]).abs() < 1e-9), "{light} {eye}");
        }
        let here = |phi_difference| {
            table.lookup(HalfDifference { theta_half: 0.3, theta_difference: 0.4, phi_difference }).unwrap()
        };
        for (one, other) in [(0.0, PI), (1e-9, PI - 1e-9), (0.01, PI + 0.01)] {
            assert!((0..3).all(|c| (here(one)[c] - here(other)[c]).abs() < 1e-7), "{one} {other}");
        }
        // On the axis of the half vector every azimuth is the same place.
        let top = table.evaluate(DVec3::Z, DVec3::Z);
        assert!((0..3).all(|c| (top[c] - smooth(HalfDifference::default())[c]).abs() < 1e-12));
    }

    #[test]
    fn below_the_horizon_is_invalid_and_lookups_beside_it_use_what_is_valid() {
        let table = MeasuredBrdf::from_fn(|_| [0.25; 3]);
        for cell in (0..CELL_COUNT).step_by(101) {
            assert_eq!(table.is_valid(cell), grid::is_above_horizon(grid::coordinates_of_cell(cell)));
        }
        let mut random = SequentialRandom::new(6);
        let mut grazing = 0;
        for _ in 0..20_000 {
            let mut light = above(&mut random);
            light.z = 0.02;
            let found = table.evaluate(light, above(&mut random));
            assert!((0..3).all(|c| (found[c] - 0.25).abs() < 1e-12 || found[c] == 0.0));
            grazing += usize::from(found[0] > 0.0);
        }
        assert!(grazing > 19_000, "only {grazing} of 20000 grazing pairs found a valid cell");
        assert_eq!(table.evaluate(DVec3::new(0.1, 0.0, -0.5), DVec3::Z), [0.0; 3]);
        assert_eq!(table.evaluate(DVec3::ZERO, DVec3::Z), [0.0; 3]);
        assert_eq!(table.evaluate(DVec3::NAN, DVec3::Z), [0.0; 3]);
    }

    #[test]
    fn a_table_of_three_cells_works_and_one_of_none_is_refused() {
        let mut raw = vec![INVALID; 3 * CELL_COUNT];
        for cell in [0, 7, 180] {
            for channel in 0..3 {
                raw[channel * CELL_COUNT + cell] = 1500.0;
            }
        }
        let table = MeasuredBrdf::from_raw(raw).unwrap();
        assert_eq!(table.counted_cells(), [0, 7, 180]);
        assert!((table.evaluate(DVec3::Z, DVec3::Z)[2] - 1.66).abs() < 1e-12);
        assert_eq!(table.lookup(HalfDifference { theta_half: 1.0, ..Default::default() }), None);
        for bad in [vec![INVALID; 3 * CELL_COUNT], vec![f64::NAN; 3 * CELL_COUNT], vec![1.0; 5], vec![]] {
            assert!(MeasuredBrdf::from_raw(bad).is_err());
        }
    }
}
