//! The small linear systems of a block: sums of its cells, and (rho, F0) from them.
//!
//! A deviation of a cell from its block is eliminated before cells are added up.

use super::block::{BlockPrior, PixelTerms};

/// A 2 x 2 system in (rho, F0) and its constant: the six sums of a channel, of a cell or of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct System {
    pub(super) ee: f64,
    pub(super) es: f64,
    pub(super) ss: f64,
    pub(super) ey: f64,
    pub(super) sy: f64,
    pub(super) yy: f64,
}

impl System {
    /// Adds a cell with its deviation eliminated; `ridge` is the variance of the noise over that of deviations.
    fn add(&mut self, cell: &System, ridge: f64) {
        let keep = if ridge.is_finite() { 1.0 / (ridge + cell.ee) } else { 0.0 };
        self.ee += cell.ee - cell.ee * cell.ee * keep;
        self.es += cell.es - cell.es * cell.ee * keep;
        self.ss += cell.ss - cell.es * cell.es * keep;
        self.ey += cell.ey - cell.ey * cell.ee * keep;
        self.sy += cell.sy - cell.es * cell.ey * keep;
        self.yy += cell.yy - cell.ey * cell.ey * keep;
    }

    /// The best (rho, F0) in the unit square, and the value there.
    pub(super) fn solve(&self) -> ([f64; 2], f64) {
        let value = |x: f64, z: f64| {
            self.yy - 2.0 * (x * self.ey + z * self.sy) + x * x * self.ee + 2.0 * x * z * self.es + z * z * self.ss
        };
        let clamp = |value: f64| if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 };
        let determinant = self.ee * self.ss - self.es * self.es;
        if determinant > 1e-12 * self.ee * self.ss {
            let x = (self.ey * self.ss - self.sy * self.es) / determinant;
            let z = (self.sy * self.ee - self.ey * self.es) / determinant;
            if (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&z) {
                return ([x, z], value(x, z));
            }
        }
        // The best point lies on an edge of the square.
        let mut best = ([0.0, 0.0], f64::INFINITY);
        for bound in [0.0, 1.0] {
            let z = clamp((self.sy - bound * self.es) / self.ss);
            let x = clamp((self.ey - bound * self.es) / self.ee);
            for (x, z) in [(bound, z), (x, bound)] {
                let value = value(x, z);
                if value < best.1 {
                    best = ([x, z], value);
                }
            }
        }
        best
    }
}

/// The variance of the noise over that of deviations.
pub(super) fn ridge(prior: &BlockPrior) -> f64 {
    (prior.noise * prior.noise) / (prior.spread * prior.spread)
}

/// The system of a channel; `at` gives what multiplies F0 and what is there whatever F0. Leaves the cells' sums.
pub(super) fn system(
    terms: &[PixelTerms],
    channel: usize,
    at: impl Fn(&PixelTerms) -> (f32, f32),
    prior: &BlockPrior,
    cells: &mut [System],
) -> System {
    cells.fill(System::default());
    for term in terms {
        let (base, grazing) = at(term);
        let weight = f64::from(term.weight);
        let e = f64::from(term.arriving[channel]);
        let s = f64::from(base);
        let y = f64::from(term.radiance[channel] - grazing);
        let cell = &mut cells[usize::from(term.cell)];
        cell.ee += weight * e * e;
        cell.es += weight * e * s;
        cell.ss += weight * s * s;
        cell.ey += weight * e * y;
        cell.sy += weight * s * y;
        cell.yy += weight * y * y;
    }
    let ridge = ridge(prior);
    let mut system = System::default();
    for cell in cells.iter() {
        system.add(cell, ridge);
    }
    // Priors, as observations in units of the noise.
    let variance = prior.noise * prior.noise;
    let (mean, deviation) = prior.specular;
    let precision = variance / (deviation * deviation);
    system.ss += precision;
    system.sy += precision * mean[channel];
    system.yy += precision * mean[channel] * mean[channel];
    let (mean, deviation) = prior.diffuse;
    let precision = if deviation.is_finite() { variance / (deviation * deviation) } else { 0.0 };
    system.ee += precision;
    system.ey += precision * mean[channel];
    system.yy += precision * mean[channel] * mean[channel];
    system
}
