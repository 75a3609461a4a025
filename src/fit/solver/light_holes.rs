//! Holes in what photos show of the light: texels that none looks at, between texels that some do.
//!
//! While light and maps are found together, what no photo shows is rather dark than bright, since a light in few texels
//! finds maps nearer to the truth. Views that took no part look into such holes all the same. So before maps are made
//! under the light, a hole takes the radiance of its rim where that is brighter.

use super::scene::{BackgroundPixel, SolverScene};

/// A texel is shown where background pixels look at it with weights of this together.
const LEAST_SHOWN: f32 = 1.0;
/// The rim of a hole is at most this share of the light's rows away, to both sides: 34 degrees.
const MOST_TO_RIM: f64 = 3.0 / 16.0;

impl SolverScene {
    /// Fills the holes of a light that is not given.
    pub(in crate::fit) fn fill_holes(&self, light: &mut [[f32; 3]]) {
        if !self.settings.fixed_light {
            fill_holes(light, self.settings.light_size, &self.shown_by_background(|_| 1.0));
        }
    }

    /// How much background pixels look at each texel of the light: the sum of their weights, times what each pixel counts.
    pub(super) fn shown_by_background(&self, counts: impl Fn(&BackgroundPixel) -> f32) -> Vec<f32> {
        let mut shown = vec![0.0; self.transport.basis.count()];
        for pixel in &self.background {
            let counts = counts(pixel);
            for (&texel, &weight) in pixel.tap.index.iter().zip(&pixel.tap.weight) {
                shown[texel as usize] += counts * weight;
            }
        }
        shown
    }
}

/// Raises texels that are not shown, between two of the same row or column that are, to what those have between them.
fn fill_holes(light: &mut [[f32; 3]], (width, height): (usize, usize), shown: &[f32]) {
    let found = light.to_vec();
    let most = ((height as f64 * MOST_TO_RIM) as usize).max(1);
    let is_shown = |texel: usize| shown[texel] >= LEAST_SHOWN;
    for (texel, radiance) in light.iter_mut().enumerate() {
        if is_shown(texel) {
            continue;
        }
        let (row, column) = (texel / width, texel % width);
        // `step` is at most the number of columns back or on, rows end at the poles.
        let in_row = |step: isize| Some(row * width + (width + column).wrapping_add_signed(step) % width);
        let in_column =
            |step: isize| row.checked_add_signed(step).filter(|&row| row < height).map(|row| row * width + column);
        let rims = [rims(in_row, most, is_shown), rims(in_column, most, is_shown)];
        for (c, value) in radiance.iter_mut().enumerate() {
            let filled =
                rims.iter().flatten().map(|rims| between(rims.map(|(rim, distance)| (found[rim][c], distance))));
            // Of two ways the darker one: a hole beside a sun is sky.
            *value = value.max(filled.reduce(f32::min).unwrap_or(0.0));
        }
    }
}

/// The nearest texels to either side that are shown, with their distances; `None` unless both are near.
fn rims(
    at: impl Fn(isize) -> Option<usize>,
    most: usize,
    is_shown: impl Fn(usize) -> bool,
) -> Option<[(usize, f32); 2]> {
    let nearest = |sign: isize| {
        (1..=most).find_map(|distance| {
            at(sign * distance as isize).filter(|&texel| is_shown(texel)).map(|texel| (texel, distance as f32))
        })
    };
    Some([nearest(-1)?, nearest(1)?])
}

/// Radiance between two places, by their radiances and distances. It is the harmonic mean, which is hardly more than the
/// darker one of a sky and a sun.
fn between(rims: [(f32, f32); 2]) -> f32 {
    let [(a, to_a), (b, to_b)] = rims.map(|(radiance, distance)| (radiance.max(1e-9), distance));
    (to_a + to_b) / (to_b / a + to_a / b)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (32, 16);

    /// A sky that is brighter to the right, seen whole but for some texels, which are black.
    fn sky_with_holes(holes: &[usize]) -> (Vec<[f32; 3]>, Vec<f32>) {
        let of = |texel: usize| if holes.contains(&texel) { 0.0 } else { 1.0 + 0.01 * (texel % SIZE.0) as f32 };
        let texels = 0..SIZE.0 * SIZE.1;
        let light = texels.clone().map(|texel| [of(texel), 2.0 * of(texel), 0.5 * of(texel)]).collect();
        (light, texels.map(|texel| if holes.contains(&texel) { 0.2 } else { 3.0 }).collect())
    }

    #[test]
    fn a_hole_lies_between_its_rims_and_what_is_shown_stays() {
        let holes = [8 * 32 + 10, 8 * 32 + 11, 3 * 32];
        let (mut light, shown) = sky_with_holes(&holes);
        let before = light.clone();
        fill_holes(&mut light, SIZE, &shown);
        for texel in 0..light.len() {
            if holes.contains(&texel) {
                // In the first column the neighbour to the left is the last one, of 1.31.
                let expected = if texel == 3 * 32 { 1.0 } else { 1.0 + 0.01 * (texel % 32) as f32 };
                assert!((light[texel][0] - expected).abs() < 0.011, "{texel}: {:?}", light[texel]);
                assert!((light[texel][1] / light[texel][0] - 2.0).abs() < 1e-5);
            } else {
                assert_eq!(light[texel], before[texel]);
            }
        }
    }

    #[test]
    fn suns_do_not_flow_into_holes_nor_out_of_them() {
        let hole = 8 * 32 + 10;
        let (mut light, shown) = sky_with_holes(&[hole]);
        light[hole - 1] = [1e5; 3];
        fill_holes(&mut light, SIZE, &shown);
        assert!((light[hole][0] - 1.1).abs() < 0.01, "{:?}", light[hole]);
        // With nothing above and below there is only the sun to one side.
        let (mut light, mut shown) = sky_with_holes(&[hole]);
        light[hole - 1] = [1e5; 3];
        (0..16).for_each(|row| shown[row * 32 + 10] = 0.0);
        fill_holes(&mut light, SIZE, &shown);
        assert!((2.0..2.3).contains(&light[hole][0]), "{:?}", light[hole]);
        // A sun that surfaces tell of stays.
        let (mut light, shown) = sky_with_holes(&[hole]);
        light[hole] = [50.0; 3];
        fill_holes(&mut light, SIZE, &shown);
        assert_eq!(light[hole], [50.0; 3]);
    }

    #[test]
    fn what_is_beyond_all_photos_is_no_hole() {
        // Only the rows from 6 to 9 are shown: above and below them nothing is told.
        let (mut light, mut shown) = sky_with_holes(&[]);
        for texel in (0..light.len()).filter(|texel| !(6..10).contains(&(texel / 32))) {
            (light[texel], shown[texel]) = ([0.1; 3], 0.0);
        }
        let before = light.clone();
        fill_holes(&mut light, SIZE, &shown);
        assert_eq!(light, before);
        // Nor is a gap wider than its limit, at its middle.
        let (mut light, mut shown) = sky_with_holes(&[]);
        for texel in (0..light.len()).filter(|texel| (8..16).contains(&(texel % 32))) {
            (light[texel], shown[texel]) = ([0.1; 3], 0.0);
        }
        let before = light.clone();
        fill_holes(&mut light, SIZE, &shown);
        assert_eq!(light, before);
    }
}
