//! Figures of error between a reflectance and a measured table: one rule for all models.
//!
//! The main figure is that of the code released with iBRDF (Chen, Nobuhara and Nishino 2020), which the paper does not
//! write down: `sqrt(mean((ln(m + 1e-6) - ln(t + 1e-6))^2))` over all three channels of the cells that count, in stored
//! (raw) units, natural logarithm. A cell is one entry, whatever solid angle it stands for.

use super::coordinates::HalfDifference;
use super::grid;
use super::model::ReflectanceModel;
use super::table::{CHANNEL_SCALE, MeasuredBrdf};
use crate::error::{Error, ErrorKind, Result};
use crate::math::parallel;

/// What is added to a stored value before its logarithm is taken.
pub const LOG_FLOOR: f64 = 1e-6;
/// What is added to a reflectance before its decimal logarithm is taken.
pub const LOG10_FLOOR: f64 = 1e-18;

/// Cells of one part of a sum: fixed, so that the bits do not depend on the number of threads.
const CHUNK: usize = 8192;

/// How far a reflectance is from a measured one.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TableError {
    /// Root of the mean squared difference of `ln(raw + 1e-6)`: the main figure.
    pub log_rmse: f64,
    /// Root of the mean squared difference of `log10(f + 1e-18)`, f in 1/sr, over entries where the measured one is
    /// above 0: the variant without a floor that matters.
    pub log10_rmse: f64,
    /// Root of the mean squared difference of `ln(1 + f cos)`, `cos` that of the incident direction: tame, close to
    /// what is seen.
    pub cosine_rmse: f64,
    /// Mean absolute difference of `ln(1 + f cos)`.
    pub cosine_mean: f64,
    /// Cells that count.
    pub cells: usize,
}

/// The error of a table against a measured one, over the cells of the measured one that count. An invalid cell of the
/// estimate counts as 0. Error: no cell counts.
pub fn table_error(estimate: &MeasuredBrdf, truth: &MeasuredBrdf) -> Result<TableError> {
    error_over(truth, |cells, values| {
        for (value, &cell) in values.iter_mut().zip(cells) {
            *value = estimate.value(cell as usize);
        }
    })
}

/// The error of a model against a measured table, over the cells that count. Error: no cell counts.
pub fn model_error(model: &dyn ReflectanceModel, parameters: &[f64], truth: &MeasuredBrdf) -> Result<TableError> {
    error_over(truth, |cells, values| {
        let at: Vec<HalfDifference> = cells.iter().map(|&cell| grid::coordinates_of_cell(cell as usize)).collect();
        model.evaluate(parameters, &at, values);
    })
}

/// Logarithm of the stored value that belongs to a reflectance in 1/sr. What is not a number counts as 0.
#[inline]
pub fn log_raw(value: f64, channel: usize) -> f64 {
    (value.max(0.0) / CHANNEL_SCALE[channel] + LOG_FLOOR).ln()
}

/// The sums of one part.
#[derive(Clone, Copy, Default)]
struct Sums {
    natural: f64,
    decimal: f64,
    decimal_count: usize,
    cosine_square: f64,
    cosine_absolute: f64,
}

fn error_over(truth: &MeasuredBrdf, fill: impl Fn(&[u32], &mut [[f64; 3]]) + Sync) -> Result<TableError> {
    let cells = truth.counted_cells();
    if cells.is_empty() {
        return Err(Error::new(ErrorKind::NonFinite, "no cell of the table counts: its red is 0 everywhere"));
    }
    let parts: Vec<Sums> = parallel::map_chunks(&cells, CHUNK, |_, cells| {
        let mut values = vec![[0.0; 3]; cells.len()];
        fill(cells, &mut values);
        let mut sums = Sums::default();
        for (&cell, value) in cells.iter().zip(&values) {
            let truth = truth.value(cell as usize);
            let [cosine, _] = grid::cosines(grid::coordinates_of_cell(cell as usize));
            for channel in 0..3 {
                // `max` turns what is not a number into 0.
                let (value, truth) = (value[channel].max(0.0), truth[channel]);
                sums.natural += (log_raw(value, channel) - log_raw(truth, channel)).powi(2);
                if truth > 0.0 {
                    sums.decimal += ((value + LOG10_FLOOR).log10() - (truth + LOG10_FLOOR).log10()).powi(2);
                    sums.decimal_count += 1;
                }
                let difference = (value * cosine.max(0.0)).ln_1p() - (truth * cosine.max(0.0)).ln_1p();
                sums.cosine_square += difference * difference;
                sums.cosine_absolute += difference.abs();
            }
        }
        sums
    });
    let mut total = Sums::default();
    for part in &parts {
        total.natural += part.natural;
        total.decimal += part.decimal;
        total.decimal_count += part.decimal_count;
        total.cosine_square += part.cosine_square;
        total.cosine_absolute += part.cosine_absolute;
    }
    let count = 3.0 * cells.len() as f64;
    Ok(TableError {
        log_rmse: (total.natural / count).sqrt(),
        log10_rmse: (total.decimal / total.decimal_count.max(1) as f64).sqrt(),
        cosine_rmse: (total.cosine_square / count).sqrt(),
        cosine_mean: total.cosine_absolute / count,
        cells: cells.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measured::grid::CELL_COUNT;
    use crate::measured::table::INVALID;

    #[test]
    fn the_figure_is_that_of_the_released_code() {
        let truth = MeasuredBrdf::from_fn(|at| [0.1 + at.theta_half, 0.2, 0.3]);
        assert!(table_error(&truth, &truth).unwrap().log_rmse == 0.0);
        // A factor of 2 everywhere is ln 2, the floor being far below.
        let twice = MeasuredBrdf::from_fn(|at| [0.2 + 2.0 * at.theta_half, 0.4, 0.6]);
        let error = table_error(&twice, &truth).unwrap();
        assert!((error.log_rmse - 2f64.ln()).abs() < 1e-6 && (error.log10_rmse - 2f64.log10()).abs() < 1e-9);
        assert_eq!(error.cells, truth.counted_cells().len());
    }

    #[test]
    fn only_cells_with_red_count_and_zeros_meet_the_floor() {
        let mut raw = vec![INVALID; 3 * CELL_COUNT];
        // One cell with red, one with red 0 and much blue, which must not count.
        for (cell, value) in [(0, [1.0, 0.0, 2.0]), (1, [0.0, 5.0, 5.0])] {
            (0..3).for_each(|channel| raw[channel * CELL_COUNT + cell] = value[channel]);
        }
        let truth = MeasuredBrdf::from_raw(raw.clone()).unwrap();
        raw[CELL_COUNT] = 1.0;
        let estimate = MeasuredBrdf::from_raw(raw).unwrap();
        let error = table_error(&estimate, &truth).unwrap();
        let expected = ((1.0 + 1e-6f64).ln() - 1e-6f64.ln()).powi(2) / 3.0;
        assert_eq!(error.cells, 1);
        assert!((error.log_rmse - expected.sqrt()).abs() < 1e-12);
        assert!(error.log10_rmse < 1e-12, "the entry that was measured as 0 is left out");
        let mut raw = vec![0.0; 3 * CELL_COUNT];
        raw[CELL_COUNT] = 1.0;
        assert!(table_error(&truth, &MeasuredBrdf::from_raw(raw).unwrap()).is_err(), "red is 0 everywhere");
    }
}
