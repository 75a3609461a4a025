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
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    const SIZE: usize = 8;

    fn made_up() -> (Vec<Material<f32>>, Neighbours) {
        let mut random = SequentialRandom::new(3);
        let mut texel = || {
            Material::from_array(std::array::from_fn(|lane| {
                let value = random.next_number();
                if lane < 6 { 0.05 + 0.6 * value } else { -value }
            }))
        };
        let (texels, start): (Vec<_>, Vec<_>) = (0..SIZE * SIZE).map(|_| (texel(), texel())).unzip();
        let shown = (0..SIZE * SIZE).map(|texel| texel % 11 != 5).collect();
        (texels, Neighbours { scales: [0.5, 0.2, 0.3], ..Neighbours::new(SIZE, &start, shown, 1.0) })
    }

    /// The same texels with half of them dielectrics, of which it is known.
    fn made_up_of_dielectrics() -> (Vec<Material<f32>>, Neighbours) {
        let (mut texels, mut beliefs) = made_up();
        texels.iter_mut().step_by(2).for_each(|own| own.specular = own.specular.map(|specular| 0.2 * specular));
        beliefs.know_dielectrics(&texels);
        (texels, beliefs)
    }

    #[test]
    fn a_dielectric_is_drawn_to_the_common_one_and_a_metal_is_not() {
        let (texels, beliefs) = made_up_of_dielectrics();
        let is_known = |texel: &usize| beliefs.precision_of_specular(*texel) > 0.0;
        let metals: Vec<usize> = (0..texels.len()).filter(|&texel| !is_dielectric(texels[texel].specular)).collect();
        assert!(metals.len() > 8 && !metals.iter().any(is_known), "{metals:?}");
        let dielectrics: Vec<usize> = (0..texels.len()).filter(is_known).collect();
        assert_eq!(dielectrics.len() + metals.len(), texels.len());
        let energy = |specular: f32| {
            let mut texels = texels.clone();
            dielectrics.iter().for_each(|&texel| texels[texel].specular = [specular; 3]);
            beliefs.energies(&texels)[1]
        };
        assert_eq!(energy(PLAIN_SPECULAR), 0.0);
        assert!(energy(0.03) > 0.0 && energy(0.02) > energy(0.03) && energy(0.06) > energy(0.05));
    }

    fn total(beliefs: &Neighbours, texels: &[Material<f32>]) -> f64 {
        beliefs.energies(texels).iter().sum()
    }

    #[test]
    fn the_slope_is_that_of_the_energies() {
        [made_up(), made_up_of_dielectrics()]
            .iter()
            .for_each(|(texels, beliefs)| slope_is_of_energies(texels, beliefs));
    }

    fn slope_is_of_energies(texels: &[Material<f32>], beliefs: &Neighbours) {
        let parabola = beliefs.parabola(texels);
        for texel in (0..SIZE * SIZE).step_by(5) {
            for lane in 0..7 {
                let at = |step: f32| {
                    let mut moved = texels.to_vec();
                    let mut own = moved[texel].to_array();
                    own[lane] += step;
                    moved[texel] = Material::from_array(own);
                    total(beliefs, &moved)
                };
                let slope = (at(1e-3) - at(-1e-3)) / 2e-3;
                let found = f64::from(parabola.slope()[texel][lane]);
                assert!((found - slope).abs() < 0.02 * (slope.abs() + 1.0), "{texel} {lane}: {found} {slope}");
            }
        }
    }

    /// In logarithms of reflectances and widths, which the curvature is of.
    #[test]
    fn the_parabola_touches_and_lies_above() {
        [made_up(), made_up_of_dielectrics()].iter().for_each(|(texels, beliefs)| parabola_lies_above(texels, beliefs));
    }

    fn parabola_lies_above(texels: &[Material<f32>], beliefs: &Neighbours) {
        let parabola = beliefs.parabola(texels);
        let here = total(beliefs, texels);
        let mut random = SequentialRandom::new(8);
        for _ in 0..40 {
            let reach = 0.05 * random.next_number();
            let steps: Vec<Lanes> = texels
                .iter()
                .map(|_| std::array::from_fn(|lane| if lane < 7 { reach * (random.next_number() - 0.5) } else { 0.0 }))
                .collect();
            let moved: Vec<Material<f32>> = texels
                .iter()
                .zip(&steps)
                .map(|(texel, step)| {
                    let own = texel.to_array();
                    Material::from_array(std::array::from_fn(|lane| own[lane] + step[lane]))
                })
                .collect();
            let mut product = vec![[0.0; 8]; texels.len()];
            parabola.add_product(&steps, &mut product);
            let along = |of: &[Lanes]| -> f64 {
                steps.iter().flatten().zip(of.iter().flatten()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
            };
            let above = here + along(parabola.slope()) + 0.5 * along(&product);
            let there = total(beliefs, &moved);
            // The logarithm's own bend is small beside the parabola's.
            assert!(there < above + 0.02 * (above - here).abs() + 1e-3, "{there} {above} {here}");
            let curvature: f64 = steps
                .iter()
                .enumerate()
                .map(|(texel, step)| -> f64 {
                    let diagonal = parabola.diagonal(texel);
                    (0..7).map(|lane| f64::from(diagonal[lane] * step[lane] * step[lane])).sum()
                })
                .sum();
            assert!(along(&product) <= 2.0 * curvature, "{} {curvature}", along(&product));
        }
    }

    #[test]
    fn edges_between_materials_cost_little_more_when_they_are_sharper() {
        let (mut texels, _) = made_up();
        let flat = Material { diffuse: [0.3; 3], specular: [0.04; 3], log_width: -0.5 };
        texels.fill(flat);
        let beliefs = Neighbours { scales: [0.1; 3], ..Neighbours::new(SIZE, &texels, vec![true; SIZE * SIZE], 1.0) };
        let step = |ratio: f32| {
            let mut texels = texels.clone();
            texels[..SIZE * SIZE / 2].iter_mut().for_each(|texel| texel.diffuse = [0.3 * ratio; 3]);
            total(&beliefs, &texels)
        };
        assert_eq!(step(1.0), 0.0);
        assert!(step(1.1) > 0.0 && step(4.0) < 2.0 * step(2.0), "{} {} {}", step(1.1), step(2.0), step(4.0));
    }
}
