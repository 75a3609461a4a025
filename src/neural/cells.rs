//! The cells of a table that count, and how a step of training draws from them.

use super::warp::{AZIMUTH, DIFFERENCE, HALF, to_cube};
use crate::math::random::SequentialRandom;
use crate::measured::grid::{
    PHI_DIFFERENCE_COUNT, THETA_DIFFERENCE_COUNT, THETA_HALF_COUNT, cell_of_indices, coordinates_of_cell,
};
use crate::measured::metrics::LOG_FLOOR;
use crate::measured::table::MeasuredBrdf;

/// The cells of a column that count, with their places in the cube, by rising `theta_half`.
pub(crate) fn counted_in_column(
    table: &MeasuredBrdf,
    difference: usize,
    azimuth: usize,
) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
    (0..THETA_HALF_COUNT)
        .map(move |half| cell_of_indices(half, difference, azimuth))
        .filter(|&cell| table.counts(cell))
        .filter_map(|cell| to_cube(coordinates_of_cell(cell)).map(|point| (cell, point)))
}

/// `ln(stored + 1e-6)` of a cell.
pub(crate) fn log_stored(table: &MeasuredBrdf, cell: usize) -> [f64; 3] {
    table.raw_value(cell).map(|raw| (raw.max(0.0) + LOG_FLOOR).ln())
}

/// The cells of a table that count, column by column.
pub(crate) struct CountedColumns {
    /// `theta_difference` and `phi_difference` in the cube.
    pub at: Vec<[f64; 2]>,
    /// Where the cells of each column begin; one more entry at the end.
    from: Vec<usize>,
    /// `theta_half` in the cube.
    pub half: Vec<f32>,
    /// `ln(stored + 1e-6)`.
    pub log_stored: Vec<[f32; 3]>,
}

/// Cells of one step.
pub(crate) struct Batch {
    /// Which columns.
    pub columns: Vec<usize>,
    /// Which cells, the same number for each column.
    pub cells: Vec<usize>,
}

impl CountedColumns {
    /// Of a table.
    pub fn of(table: &MeasuredBrdf) -> Self {
        let mut columns = CountedColumns { at: Vec::new(), from: vec![0], half: Vec::new(), log_stored: Vec::new() };
        for difference in 0..THETA_DIFFERENCE_COUNT {
            for azimuth in 0..PHI_DIFFERENCE_COUNT {
                let mut place = None;
                for (cell, point) in counted_in_column(table, difference, azimuth) {
                    place = Some([point[DIFFERENCE], point[AZIMUTH]]);
                    columns.half.push(point[HALF] as f32);
                    columns.log_stored.push(log_stored(table, cell).map(|value| value as f32));
                }
                if let Some(place) = place {
                    columns.at.push(place);
                    columns.from.push(columns.half.len());
                }
            }
        }
        columns
    }

    /// Whether no cell counts.
    pub fn is_empty(&self) -> bool {
        self.half.is_empty()
    }

    /// Draws columns with a chance in proportion to their cells, and cells evenly over each: every cell has the same
    /// chance.
    pub fn draw(&self, wanted: usize, per_column: usize, key: u64) -> Batch {
        let mut random = SequentialRandom::new(key);
        let total = self.half.len();
        let (wanted, per_column) = (wanted.max(1), per_column.max(1));
        let mut batch = Batch { columns: Vec::with_capacity(wanted), cells: Vec::with_capacity(wanted * per_column) };
        for stratum in 0..wanted {
            let place = ((stratum as f64 + f64::from(random.next_number())) / wanted as f64 * total as f64) as usize;
            let column = self.from.partition_point(|&from| from <= place.min(total - 1)) - 1;
            let (from, end) = (self.from[column], self.from[column + 1]);
            let shift = f64::from(random.next_number());
            batch.columns.push(column);
            batch.cells.extend((0..per_column).map(|part| {
                let share = (part as f64 + shift) / per_column as f64;
                (from + (share * (end - from) as f64) as usize).min(end - 1)
            }));
        }
        batch
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_that_counts_has_the_same_chance() {
        // Red only where the half vector is high: columns of different length.
        let table = MeasuredBrdf::from_fn(|at| {
            let red = if at.theta_half < 0.2 + 0.5 * at.theta_difference { 0.5 } else { 0.0 };
            [red, 0.1, 0.1]
        });
        let columns = CountedColumns::of(&table);
        assert_eq!(columns.half.len(), table.counted_cells().len());
        let mut seen = [0usize; 4];
        for key in 0..200 {
            let batch = columns.draw(50, 8, key);
            assert_eq!((batch.columns.len(), batch.cells.len()), (50, 400));
            for (part, &cell) in batch.cells.iter().enumerate() {
                let column = batch.columns[part / 8];
                assert!((columns.from[column]..columns.from[column + 1]).contains(&cell));
                seen[4 * cell / columns.half.len()] += 1;
            }
        }
        assert!(seen.iter().all(|&count| (19_000..21_000).contains(&count)), "{seen:?}");
    }
}
