//! The small linear systems of a channel: sums over pixels of what multiplies (rho, F0), and both from them.
//!
//! Of a cell, a texel, a block or a group of texels. The deviation of a part from its whole is eliminated before parts are
//! added up.

use super::pixel_terms::{BlockPrior, PixelTerms};

/// A 2 x 2 system in (rho, F0) and its constant: the six sums of a channel.
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
    /// Adds an observation `y = rho e + F0 s`.
    pub(super) fn observe(&mut self, weight: f64, e: f64, s: f64, y: f64) {
        self.ee += weight * e * e;
        self.es += weight * e * s;
        self.ss += weight * s * s;
        self.ey += weight * e * y;
        self.sy += weight * s * y;
        self.yy += weight * y * y;
    }

    /// What is left of a part's sums once the deviation of its rho from that of the whole is eliminated; `ridge` is the
    /// variance of the noise over that of deviations, infinite where there are none.
    pub(super) fn without_deviation(&self, ridge: f64) -> System {
        if !ridge.is_finite() {
            return *self;
        }
        let System { ee, es, ss, ey, sy, yy } = *self;
        let keep = 1.0 / (ridge + ee);
        let left = ridge * keep;
        System {
            ee: ee * left,
            es: es * left,
            ss: ss - es * es * keep,
            ey: ey * left,
            sy: sy - es * ey * keep,
            yy: yy - ey * ey * keep,
        }
    }

    /// Adds another's.
    pub(super) fn add(&mut self, other: &System) {
        self.ee += other.ee;
        self.es += other.es;
        self.ss += other.ss;
        self.ey += other.ey;
        self.sy += other.sy;
        self.yy += other.yy;
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
        cells[usize::from(term.cell)].observe(weight, e, s, y);
    }
    let ridge = ridge(prior);
    let mut system = System::default();
    for cell in cells.iter() {
        system.add(&cell.without_deviation(ridge));
    }
    // The prior, as an observation in units of the noise.
    let variance = prior.noise * prior.noise;
    let (mean, deviation) = prior.specular;
    let precision = variance / (deviation * deviation);
    system.observe(precision, 0.0, 1.0, mean[channel]);
    system
}
