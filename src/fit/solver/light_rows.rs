//! What a solved block says of the light, as rows.

use super::eliminate::BlockRows;
use super::light_reach::LightReach;
use super::light_shape::LightShape;
use super::plan::Block;
use super::round::{BlockWork, LEAST_WEIGHT, Round};

impl Round<'_> {
    /// The rows of a solved block over the light, with the block's unknowns eliminated, for each channel. Rows are in
    /// units of the block's noise.
    pub fn rows(&self, block: &Block, work: &BlockWork, shape: &LightShape, made: &mut [BlockRows; 3]) {
        let Some(prior) = work.prior else { return };
        let used: Vec<usize> = (0..work.used.len()).filter(|&index| work.terms[index].weight > LEAST_WEIGHT).collect();
        let cells = block.cell_count;
        let unknowns = cells + 3;
        let count = shape.count();
        for rows in made.iter_mut() {
            rows.reset(count, used.len(), unknowns);
        }
        let solution = &work.solution;
        let width = solution.log_width.exp();
        let mut reach = LightReach::new(self, shape);
        let row_of = |index: usize| used.partition_point(|&other| other < index);
        for index in self.by_lobe_point(work, used.clone()) {
            let (row, term) = (row_of(index), &work.terms[index]);
            let observation = &self.observations.list[work.used[index] as usize];
            reach.look(self, observation, width, shape);
            let LightReach { rows: reduced, sums, of_surface, direct, .. } = &reach;
            let scale = f64::from(term.weight.sqrt()) / prior.noise;
            for (c, rows) in made.iter_mut().enumerate() {
                let rho = solution.cells[usize::from(term.cell)][c];
                let specular = solution.specular[c];
                let d_width = specular * sums.d_base[c] + sums.d_grazing[c];
                let known = rho * (term.arriving[c] - direct[c]) + specular * of_surface[0][c] + of_surface[1][c];
                rows.right[row] = scale * f64::from(term.radiance[c] - known);
                let scale32 = scale as f32;
                let lobe = reduced[1].iter().zip(&reduced[2]).map(|(&b, &g)| scale32 * (specular * b + g));
                rows.set_row(row, lobe, reduced[0].iter().map(|&d| scale32 * rho * d));
                let arriving = f64::from(term.arriving[c]);
                rows.set_unknown(row, 2 + cells, scale * arriving);
                rows.set_unknown(row, usize::from(term.cell), scale * arriving);
                rows.set_unknown(row, cells, scale * f64::from(sums.base[c]));
                rows.set_unknown(row, 1 + cells, scale * f64::from(d_width));
            }
        }
        for (c, rows) in made.iter_mut().enumerate() {
            for (cell, value) in solution.cells.iter().enumerate() {
                rows.set_prior(cell, 1.0 / prior.spread, -f64::from(value[c] - solution.diffuse[c]));
            }
            let (mean, deviation) = prior.specular;
            rows.set_prior(cells, 1.0 / deviation, mean[c] - f64::from(solution.specular[c]));
            let (mean, deviation) = prior.log_width;
            rows.set_prior(1 + cells, 1.0 / deviation, mean - f64::from(solution.log_width));
            rows.eliminate();
            rows.kept.value = f64::from(solution.diffuse[c]);
        }
    }
}
