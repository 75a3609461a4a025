//! What neighbouring texels are believed to have in common, and lobes with common dielectrics.
//!
//! Materials change at few places: differences of logarithms between neighbours have Cauchy's distribution, a small scale
//! with heavy tails. What no pixel tells apart is smooth then, and edges stay. Its negative logarithm is replaced by the
//! parabola that touches it from above (majorisation; Hunter and Lange 2004), so that a step that makes the parabola less
//! makes the objective less.

use super::light_scale::{OF_DIELECTRICS, PLAIN_SPECULAR, is_dielectric};
use super::pixel_system::{CHUNK, Lanes};
use crate::material::Material;
use crate::math::parallel;
use rayon::prelude::*;

/// Scale of the differences of neighbours' F0, by their logarithms, and of the logarithms of their widths.
const OF_LOBES: f32 = 0.1;
/// Lanes that differ together: diffuse reflectance, F0, logarithm of the width.
const GROUPS: [std::ops::Range<usize>; 3] = [0..3, 3..6, 6..7];

/// What is believed of the texels of square maps.
pub struct Neighbours {
    size: usize,
    /// Texels that pixels show: the others are not solved for.
    shown: Vec<bool>,
    /// Scale of the differences of neighbours, group by group, of logarithms.
    scales: [f32; 3],
    /// What is added to reflectances under the logarithm, diffuse and specular: darker than this all is equally dark.
    dark: [f32; 2],
    /// Texels whose F0 is believed to be that of common dielectrics; empty until that is known.
    dielectric: Vec<bool>,
}

/// The parabola that touches the beliefs from above.
pub struct Parabola<'a> {
    of: &'a Neighbours,
    /// Slope at the place it touches.
    slope: Vec<Lanes>,
    /// What a step in each lane is in logarithms.
    relative: Vec<Lanes>,
    /// Weight of the difference to the right and to the lower neighbour, group by group; 0 where there is none.
    weights: Vec<[[f32; 3]; 2]>,
}

impl Neighbours {
    /// Beliefs about texels around `start`, of which pixels show those; the logarithms of neighbours' diffuse reflectances
    /// differ by `texture_scale`.
    pub fn new(size: usize, start: &[Material<f32>], shown: Vec<bool>, texture_scale: f32) -> Self {
        let seen = start.iter().zip(&shown).filter(|(_, shown)| **shown);
        let (mut sum, mut count) = (0.0f64, 0.0f64);
        for (texel, _) in seen {
            sum += f64::from(texel.diffuse.iter().sum::<f32>()) / 3.0;
            count += 1.0;
        }
        let mean = (sum / f64::max(count, 1.0)) as f32;
        let dark = [(DARK[0] * mean).max(1e-6), DARK[1]];
        Neighbours { size, shown, scales: [texture_scale, OF_LOBES, OF_LOBES], dark, dielectric: Vec::new() }
    }

    /// Which texels pixels show.
    pub fn shown(&self) -> &[bool] {
        &self.shown
    }

    /// From now on F0 of what is no metal among these texels is believed to be that of common dielectrics. Not before the
    /// scale of the light is told: that is told by it.
    pub fn know_dielectrics(&mut self, texels: &[Material<f32>]) {
        self.dielectric = texels.iter().map(|own| is_dielectric(own.specular)).collect();
    }

    /// Precision of what is believed of a texel's F0.
    #[inline]
    fn precision_of_specular(&self, texel: usize) -> f32 {
        let is_known = self.dielectric.get(texel) == Some(&true);
        if is_known { (OF_DIELECTRICS as f32 * PLAIN_SPECULAR).powi(-2) } else { 0.0 }
    }

    /// The texel to the right and the one below, where pixels show both.
    fn pairs_of(&self, texel: usize) -> [Option<usize>; 2] {
        let (row, column) = (texel / self.size, texel % self.size);
        let both = |other: usize| self.shown[texel] && self.shown[other];
        [
            (column + 1 < self.size).then_some(texel + 1).filter(|&other| both(other)),
            (row + 1 < self.size).then_some(texel + self.size).filter(|&other| both(other)),
        ]
    }

    /// Numbers that are compared: logarithms.
    #[inline]
    fn logarithms(&self, texel: &Material<f32>) -> [f32; 7] {
        let mut made = texel.to_array();
        for (lane, value) in made.iter_mut().enumerate().take(6) {
            *value = (*value + self.dark[lane / 3]).max(1e-9).ln();
        }
        made
    }

    /// Squares of differences over the squares of scales, group by group.
    #[inline]
    fn squares(&self, one: &[f32; 7], other: &[f32; 7]) -> [f32; 3] {
        std::array::from_fn(|group| {
            let square: f32 = GROUPS[group].clone().map(|lane| (one[lane] - other[lane]).powi(2)).sum();
            square / (self.scales[group] * self.scales[group])
        })
    }

    /// Negative logarithm of the densities, constants left out: of differences between neighbours, and of
    /// dielectrics. In nats.
    pub fn energies(&self, texels: &[Material<f32>]) -> [f64; 2] {
        let logarithms: Vec<[f32; 7]> = texels.par_iter().map(|texel| self.logarithms(texel)).collect();
        let of_chunk = |which: usize, chunk: &[Material<f32>]| {
            let mut sums = [0.0f64; 2];
            for (offset, texel) in chunk.iter().enumerate() {
                let own = which * CHUNK + offset;
                if !self.shown[own] {
                    continue;
                }
                for other in self.pairs_of(own).into_iter().flatten() {
                    let squares = self.squares(&logarithms[own], &logarithms[other]);
                    sums[0] += squares
                        .iter()
                        .zip(DIMENSIONS)
                        .map(|(square, n)| power(n) * f64::from(square.ln_1p()))
                        .sum::<f64>();
                }
                let square: f32 = away_from_plain(texel).iter().map(|away| away * away).sum();
                sums[1] += 0.5 * f64::from(self.precision_of_specular(own) * square);
            }
            sums
        };
        let of_chunks = parallel::map_chunks(texels, CHUNK, of_chunk);
        of_chunks.iter().fold([0.0; 2], |total, own| [total[0] + own[0], total[1] + own[1]])
    }

    /// The parabola that touches at these texels.
    pub fn parabola(&self, texels: &[Material<f32>]) -> Parabola<'_> {
        let logarithms: Vec<[f32; 7]> = texels.par_iter().map(|texel| self.logarithms(texel)).collect();
        let relative: Vec<Lanes> = texels
            .par_iter()
            .map(|texel| {
                let own = texel.to_array();
                std::array::from_fn(|lane| match lane {
                    0..6 => 1.0 / (own[lane] + self.dark[lane / 3]).max(1e-9),
                    6 => 1.0,
                    _ => 0.0,
                })
            })
            .collect();
        let weights: Vec<[[f32; 3]; 2]> = (0..texels.len())
            .into_par_iter()
            .map(|own| {
                self.pairs_of(own).map(|other| {
                    let Some(other) = other else { return [0.0; 3] };
                    let squares = self.squares(&logarithms[own], &logarithms[other]);
                    std::array::from_fn(|group| {
                        let weight = 2.0 * power(DIMENSIONS[group]) as f32 / (1.0 + squares[group]);
                        weight / (self.scales[group] * self.scales[group])
                    })
                })
            })
            .collect();
        let mut made = Parabola { of: self, slope: Vec::new(), relative, weights };
        let mut slope = vec![[0.0f32; 8]; texels.len()];
        let lanes = |texel: usize| std::array::from_fn(|lane| *logarithms[texel].get(lane).unwrap_or(&0.0));
        made.add_to(&mut slope, lanes, |texel| away_from_plain(&texels[texel]));
        made.slope = slope;
        made
    }
}

/// How far F0 is from that of common dielectrics.
fn away_from_plain(texel: &Material<f32>) -> [f32; 3] {
    texel.specular.map(|specular| specular - PLAIN_SPECULAR)
}

/// Shares of the mean diffuse reflectance, and F0, below which all is equally dark.
const DARK: [f32; 2] = [0.05, 0.02];
/// Lanes of each group.
const DIMENSIONS: [f64; 3] = [3.0, 3.0, 1.0];

/// Cauchy's power in so many dimensions.
fn power(dimensions: f64) -> f64 {
    0.5 * (1.0 + dimensions)
}

impl Parabola<'_> {
    /// Slope at the place it touches.
    pub fn slope(&self) -> &[Lanes] {
        &self.slope
    }

    /// Adds the curvature times a step.
    pub fn add_product(&self, step: &[Lanes], product: &mut [Lanes]) {
        let logarithm = |texel: usize| std::array::from_fn(|lane| self.relative[texel][lane] * step[texel][lane]);
        self.add_to(product, logarithm, |texel| [3, 4, 5].map(|lane| step[texel][lane]));
    }

    /// Adds, to each texel, weights times differences of `value` to its four neighbours, times what a step is in logarithms,
    /// and the precision of its F0 times `away`.
    fn add_to(
        &self,
        sums: &mut [Lanes],
        value: impl Fn(usize) -> Lanes + Sync,
        away: impl Fn(usize) -> [f32; 3] + Sync,
    ) {
        parallel::each_chunk(sums, CHUNK, &|chunk, sums| {
            let texels = (chunk * CHUNK..).zip(sums).filter(|(texel, _)| self.of.shown[*texel]);
            for (texel, sum) in texels {
                let (relative, own) = (&self.relative[texel], value(texel));
                self.for_neighbours(texel, self.of.size, |other, &[diffuse, specular, width]| {
                    let weights = [diffuse, diffuse, diffuse, specular, specular, specular, width, 0.0];
                    let other = value(other);
                    for lane in 0..8 {
                        sum[lane] += relative[lane] * weights[lane] * (own[lane] - other[lane]);
                    }
                });
                let (away, precision) = (away(texel), self.of.precision_of_specular(texel));
                (0..3).for_each(|channel| sum[3 + channel] += away[channel] * precision);
            }
        });
    }

    /// The four neighbours of a texel with the weights of their differences.
    #[inline]
    fn for_neighbours(&self, texel: usize, size: usize, mut visit: impl FnMut(usize, &[f32; 3])) {
        let [right, below] = &self.weights[texel];
        let known = [
            (right[0] > 0.0).then(|| (texel + 1, right)),
            (below[0] > 0.0).then(|| (texel + size, below)),
            (!texel.is_multiple_of(size)).then(|| (texel - 1, &self.weights[texel - 1][0])),
            (texel >= size).then(|| (texel - size, &self.weights[texel - size][1])),
        ];
        for (other, weights) in known.into_iter().flatten().filter(|(_, weights)| weights[0] > 0.0) {
            visit(other, weights);
        }
    }

    /// Diagonal of the curvature of a texel.
    pub fn diagonal(&self, texel: usize) -> Lanes {
        let mut sum = [0.0f32; 3];
        self.for_neighbours(texel, self.of.size, |_, weights| (0..3).for_each(|group| sum[group] += weights[group]));
        let relative = &self.relative[texel];
        std::array::from_fn(|lane| {
            let own = if (3..6).contains(&lane) { self.of.precision_of_specular(texel) } else { 0.0 };
            if lane < 7 { sum[lane / 3] * relative[lane] * relative[lane] + own } else { 0.0 }
        })
    }
}

#[cfg(test)]
mod tests;
