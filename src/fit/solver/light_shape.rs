//! What the light is made of while it is solved: wide hats everywhere, narrow ones where it is bright.
//!
//! Most of a sky is smooth; a sun is not. Hats of twice the texel's size over the whole sphere and hats of a texel around
//! the brightest places leave a third of the unknowns, and the normal matrix costs a tenth. All coefficients are at least
//! zero, so the light is too.

use crate::math::sphere::{direction_of_texel, tap_of_direction};

/// Coefficients of a light and the texels they stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct LightShape {
    /// Width and height of the light in texels.
    pub size: (usize, usize),
    /// Width and height of the grid of wide hats.
    pub coarse: (usize, usize),
    /// Texels with a narrow hat of their own, after the wide ones.
    pub fine: Vec<u32>,
    /// Per texel, where its entries begin in `entries`.
    offsets: Vec<u32>,
    /// (coefficient, weight).
    entries: Vec<(u32, f32)>,
}

impl LightShape {
    /// Numbers of wide hats along and across a light of this size: half of its texels, or all of them where it has an odd
    /// side or is too small to halve.
    pub fn wide_hats((width, height): (usize, usize)) -> (usize, usize) {
        let is_halved = width.is_multiple_of(2) && height.is_multiple_of(2) && height >= 8;
        if is_halved { (width / 2, height / 2) } else { (width, height) }
    }

    /// Wide hats over the sphere ([`Self::wide_hats`]), and narrow hats at these texels.
    pub fn new(size: (usize, usize), fine: Vec<u32>) -> Self {
        let (width, height) = size;
        let coarse = Self::wide_hats(size);
        let mut offsets = vec![0];
        let mut entries = Vec::new();
        for texel in 0..width * height {
            let direction = direction_of_texel(texel / width, texel % width, width, height);
            let tap = tap_of_direction(direction, coarse.0, coarse.1);
            for k in 0..4 {
                if tap.weight[k] > 1e-6 {
                    entries.push((tap.index[k], tap.weight[k]));
                }
            }
            if let Some(place) = fine.iter().position(|&own| own as usize == texel) {
                entries.push(((coarse.0 * coarse.1 + place) as u32, 1.0));
            }
            offsets.push(entries.len() as u32);
        }
        LightShape { size, coarse, fine, offsets, entries }
    }

    /// Number of coefficients.
    pub fn count(&self) -> usize {
        self.coarse.0 * self.coarse.1 + self.fine.len()
    }

    /// The light of coefficients, one channel.
    pub fn expand(&self, coefficients: &[f32]) -> Vec<f32> {
        (0..self.size.0 * self.size.1).map(|texel| self.expand_at(texel, coefficients)).collect()
    }

    /// The light of coefficients at one texel.
    pub fn expand_at(&self, texel: usize, coefficients: &[f32]) -> f32 {
        self.entries[self.offsets[texel] as usize..self.offsets[texel + 1] as usize]
            .iter()
            .map(|&(coefficient, weight)| coefficients[coefficient as usize] * weight)
            .sum()
    }

    /// A row over few texels as a row over few coefficients, each named once.
    pub fn reduce_sparse(&self, row: &[(u32, f32)]) -> Vec<(u32, f64)> {
        let mut reduced: Vec<(u32, f64)> = Vec::with_capacity(16);
        for &(texel, value) in row {
            for &(coefficient, weight) in
                &self.entries[self.offsets[texel as usize] as usize..self.offsets[texel as usize + 1] as usize]
            {
                let value = f64::from(value * weight);
                match reduced.iter_mut().find(|(known, _)| *known == coefficient) {
                    Some((_, sum)) => *sum += value,
                    None => reduced.push((coefficient, value)),
                }
            }
        }
        reduced
    }

    /// A row over texels as a row over coefficients: the transpose of [`LightShape::expand`]. Adds to `reduced`.
    pub fn reduce(&self, row: &[f32], reduced: &mut [f32]) {
        for texel in 0..self.size.0 * self.size.1 {
            let value = row[texel];
            if value != 0.0 {
                for &(coefficient, weight) in
                    &self.entries[self.offsets[texel] as usize..self.offsets[texel + 1] as usize]
                {
                    reduced[coefficient as usize] += value * weight;
                }
            }
        }
    }

    /// Coefficients that give about this light: the wide hats take what is smooth, the narrow ones the rest.
    pub fn coefficients_of(&self, light: &[f32]) -> Vec<f32> {
        let (width, height) = self.size;
        let coarse_count = self.coarse.0 * self.coarse.1;
        let mut coefficients = vec![0.0; self.count()];
        let is_fine = |texel: usize| self.fine.contains(&(texel as u32));
        let mut weights = vec![0.0f32; coarse_count];
        for pass in 0..2 {
            for texel in 0..width * height {
                // Bright places are left to the narrow hats, unless a wide one has nothing else.
                if pass == 0 && is_fine(texel) {
                    continue;
                }
                for &(coefficient, weight) in
                    &self.entries[self.offsets[texel] as usize..self.offsets[texel + 1] as usize]
                {
                    let place = coefficient as usize;
                    if place < coarse_count && (pass == 0 || weights[place] < 0.0) {
                        coefficients[place] += weight * light[texel];
                        weights[place] += weight;
                    }
                }
            }
            for place in 0..coarse_count {
                if weights[place] > 0.0 {
                    coefficients[place] /= weights[place];
                    weights[place] = 0.0;
                } else if pass == 0 {
                    weights[place] = -1e-6;
                }
            }
        }
        let smooth = self.expand(&coefficients);
        for (place, &texel) in self.fine.iter().enumerate() {
            coefficients[coarse_count + place] = (light[texel as usize] - smooth[texel as usize]).max(0.0);
        }
        coefficients
    }

    /// [`LightShape::coefficients_of`] for each channel of a light.
    pub fn coefficients_of_channels(&self, light: &[[f32; 3]]) -> [Vec<f32>; 3] {
        [0, 1, 2].map(|c| self.coefficients_of(&light.iter().map(|radiance| radiance[c]).collect::<Vec<f32>>()))
    }

    /// Neighbours among the wide hats.
    pub fn neighbours(&self) -> Vec<(usize, usize)> {
        neighbours(self.coarse)
    }

    /// Neighbours among the texels, one of which at least has a narrow hat.
    pub fn neighbours_of_fine(&self) -> Vec<(usize, usize)> {
        let mut is_fine = vec![false; self.size.0 * self.size.1];
        self.fine.iter().for_each(|&texel| is_fine[texel as usize] = true);
        let mut pairs = neighbours(self.size);
        pairs.retain(|&(a, b)| is_fine[a] || is_fine[b]);
        pairs
    }
}

/// Pairs of neighbours on the sphere, from each place to the right, wrapping in phi, and down.
fn neighbours((width, height): (usize, usize)) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for row in 0..height {
        for column in 0..width {
            pairs.push((row * width + column, row * width + (column + 1) % width));
            if row + 1 < height {
                pairs.push((row * width + column, (row + 1) * width + column));
            }
        }
    }
    pairs
}

/// The texels that deserve a narrow hat: those of the most radiance times solid angle, with their neighbours.
pub fn bright_texels(light: &[[f32; 3]], (width, height): (usize, usize), most: usize) -> Vec<u32> {
    let power = |texel: usize| {
        let sine = (std::f32::consts::PI * (texel / width) as f32 / height as f32).sin().max(0.02);
        light[texel].iter().sum::<f32>() * sine
    };
    let mut order: Vec<u32> = (0..(width * height) as u32).collect();
    order.sort_by(|&a, &b| power(b as usize).total_cmp(&power(a as usize)).then(a.cmp(&b)));
    let mut chosen = vec![false; width * height];
    let mut count = 0;
    for &texel in &order {
        let (row, column) = (texel as usize / width, texel as usize % width);
        for near_row in row.saturating_sub(1)..(row + 2).min(height) {
            for step in [width - 1, 0, 1] {
                let near = near_row * width + (column + step) % width;
                if count < most && !chosen[near] {
                    chosen[near] = true;
                    count += 1;
                }
            }
        }
    }
    (0..(width * height) as u32).filter(|&texel| chosen[texel as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reducing_is_the_transpose_of_expanding_and_lights_round_trip() {
        let shape = LightShape::new((16, 8), vec![20, 21, 37]);
        assert_eq!(shape.count(), 8 * 4 + 3);
        let coefficients: Vec<f32> = (0..shape.count()).map(|k| (k % 7) as f32 + 0.5).collect();
        let row: Vec<f32> = (0..128).map(|k| ((k * 5) % 11) as f32 - 4.0).collect();
        let expanded = shape.expand(&coefficients);
        let forward: f32 = expanded.iter().zip(&row).map(|(a, b)| a * b).sum();
        let mut reduced = vec![0.0; shape.count()];
        shape.reduce(&row, &mut reduced);
        let backward: f32 = reduced.iter().zip(&coefficients).map(|(a, b)| a * b).sum();
        assert!((forward - backward).abs() < 1e-4 * forward.abs().max(1.0), "{forward} {backward}");

        let mut light = vec![1.0f32; 128];
        light[21] = 50.0;
        let again = shape.expand(&shape.coefficients_of(&light));
        assert!(again.iter().zip(&light).all(|(a, b)| (a - b).abs() < 1e-4), "{again:?}");
    }
}
