//! What there is to see while photos of a finer level are being traced: the maps by then, with the detail of the photos so
//! far.
//!
//! Four texels that lie side by side are lit alike, so that what photos show of them differs as their diffuse reflectances
//! do. They keep the mean they had, and take that difference: each its share of the radiance that pixels show of the four.
//! It is only looked at; the steps of the level begin from the maps as they were.

use super::observations::Observation;
use crate::material::Material;
use rayon::prelude::*;

/// Sum of the radiance of a texel's pixels, and their number.
type Shown = [f32; 4];

/// Maps with the detail of the photos that were traced so far.
pub struct FirstLook {
    texels: Vec<Material<f32>>,
    map_size: usize,
    shown: Vec<Shown>,
}

impl FirstLook {
    /// Square maps that no photo has been laid on. The last row and column of an odd number stay as they are.
    pub fn at(texels: Vec<Material<f32>>, map_size: usize) -> Self {
        FirstLook { shown: vec![Shown::default(); texels.len()], texels, map_size }
    }

    /// Lays the pixels of a photo on them, which has this gain.
    pub fn add(&mut self, pixels: &[Observation], gain: f32) {
        for pixel in pixels {
            let [r, g, b] = pixel.radiance.map(|radiance| radiance.max(0.0) / gain);
            let sums = &mut self.shown[pixel.texel as usize];
            sums.iter_mut().zip([r, g, b, 1.0]).for_each(|(sum, value)| *sum += value);
        }
    }

    /// The texels by now. Those of which no pixel was seen yet are as they were.
    pub fn texels(&self) -> Vec<Material<f32>> {
        let mut texels = self.texels.clone();
        texels.par_chunks_exact_mut(2 * self.map_size).enumerate().for_each(|(pair_of_rows, rows)| {
            let first = pair_of_rows * 2 * self.map_size;
            for column in (1..self.map_size).step_by(2).map(|odd| odd - 1) {
                let four = [column, column + 1, column + self.map_size, column + self.map_size + 1];
                detail(rows, four, four.map(|at| self.shown[first + at]));
            }
        });
        texels
    }
}

/// Gives those of four texels that pixels show their share of what pixels show of all.
fn detail(texels: &mut [Material<f32>], four: [usize; 4], shown: [Shown; 4]) {
    let seen = || four.into_iter().zip(shown).filter(|(_, sums)| sums[3] > 0.0);
    let count = seen().count() as f32;
    for c in 0..3 {
        let radiance: f32 = seen().map(|(_, sums)| sums[c] / sums[3]).sum();
        let diffuse: f32 = seen().map(|(at, _)| texels[at].diffuse[c]).sum();
        if radiance > 0.0 {
            for (at, sums) in seen() {
                texels[at].diffuse[c] = (diffuse / count * (count * sums[c] / sums[3] / radiance)).min(1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(texel: u32, radiance: f32) -> Observation {
        Observation { view: 0, point: 0, texel, radiance: [radiance, 2.0 * radiance, 0.0], clipped: false }
    }

    #[test]
    fn texels_differ_as_their_pixels_do_and_keep_their_mean() {
        let grey = |diffuse: f32| Material { diffuse: [diffuse; 3], specular: [0.04; 3], log_width: -1.0 };
        // Two squares of four texels, of which one was seen.
        let mut look = FirstLook::at([0.5, 0.5, 0.3, 0.3].repeat(2).into_iter().map(grey).collect(), 4);
        // Exposures differ, and a texel is seen more often than others.
        look.add(&[pixel(0, 2.0), pixel(1, 4.0), pixel(4, 4.0)], 2.0);
        look.add(&[pixel(1, 1.0), pixel(5, 3.0), pixel(1, 3.0)], 1.0);
        let texels = look.texels();
        for (at, expected) in [(0, 0.25), (1, 0.5), (4, 0.5), (5, 0.75)] {
            let [r, g, b] = texels[at].diffuse;
            assert!((r - expected).abs() < 1e-6 && (g - r).abs() < 1e-6, "{at}: {r} {g}");
            // No pixel has any blue, which says nothing of how it is spread.
            assert_eq!((b, texels[at].specular), (0.5, [0.04; 3]));
        }
        for at in [2, 3, 6, 7] {
            assert_eq!(texels[at], grey(0.3));
        }
    }

    #[test]
    fn a_texel_that_alone_was_seen_and_black_pixels_change_nothing() {
        let grey = Material { diffuse: [0.9; 3], specular: [0.04; 3], log_width: 0.0 };
        let mut look = FirstLook::at(vec![grey; 4], 2);
        look.add(&[pixel(3, 7.0)], 1.0);
        assert_eq!(look.texels(), vec![grey; 4]);
        let mut look = FirstLook::at(vec![grey; 4], 2);
        look.add(&[pixel(0, 0.0), pixel(1, -1.0), pixel(2, 0.0), pixel(3, 0.0)], 1.0);
        assert_eq!(look.texels(), vec![grey; 4]);
        // None becomes more than white.
        look.add(&[pixel(0, 9.0)], 1.0);
        assert_eq!(look.texels()[0].diffuse[..2], [1.0, 1.0]);
    }
}
