//! The light, given the surface's rows: non-negative least squares with a weak wish for a smooth sky.

use super::light_shape::LightShape;
use super::non_negative::solve_non_negative;
use super::normal_equations::NormalEquations;
use crate::math::sphere::solid_angle_of_texel;
use crate::math::statistics::median;
use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};

/// The usual radiance of a sky is at least this share of its mean: half of it may be black.
const LEAST_USUAL: f64 = 0.3;
/// Share of the hold on suns that all narrow hats have, so that none of them is free.
const LEAST_HOLD: f64 = 1e-6;
/// By which power of the scale of a texel it may differ from its neighbours: suns more than they may shine. With 1 a
/// strong sun is smeared, with 2 holes between what photos show stay dark.
const NEIGHBOUR_POWER: f64 = 1.25;

/// What is believed of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPrior {
    /// By how much neighbouring wide hats differ, relative to their radiance.
    pub variation: f64,
    /// Factor on the evidence of the rows.
    pub independence: f64,
    /// By how much the mean light on the surface may differ from the gauge's, relative.
    pub gauge_slack: f64,
}

/// What fixes the scale between reflectance and light in one channel: the mean light on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gauge<'a> {
    /// Row over texels whose product with the light is the mean arriving light (irradiance over pi).
    pub row: &'a [f32],
    /// What that mean is held to.
    pub mean: f64,
}

/// What a channel's solution leaves beside the light.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelKnown {
    /// Diagonal of what is believed of the light, the gauge left out, in the units of the rows times `independence`.
    pub belief: Vec<f64>,
    /// Standard deviation, relative, of the mean light on the surface by rows and belief, the gauge left out; infinite
    /// where they leave it open.
    pub scale_deviation: f64,
}

/// Adds what is believed of texels with narrow hats. Sky is about as bright as what is beside it, so that a hole in what
/// photos show takes the radiance of its rim. What may be a sun, by its scale, is hardly held to its neighbours; its
/// narrow hat rather is zero, which keeps light in few texels.
fn believe_narrow(matrix: &mut [f64], shape: &LightShape, narrow: &[f64], usual: f64) {
    let count = shape.count();
    let coarse = shape.coarse.0 * shape.coarse.1;
    let mut scales = vec![1.0f64; shape.size.0 * shape.size.1];
    for (place, (&scale, &texel)) in narrow.iter().zip(&shape.fine).enumerate() {
        scales[texel as usize] = scale;
        let is_sun = 1.0 - 1.0 / scale + LEAST_HOLD;
        matrix[(coarse + place) * (count + 1)] += is_sun / (scale * usual).powi(2);
    }
    for (a, b) in shape.neighbours_of_fine() {
        let weight = 1.0 / (usual * scales[a].max(scales[b]).powf(NEIGHBOUR_POWER)).powi(2);
        add_square(matrix, count, &shape.reduce_sparse(&[(a as u32, 1.0), (b as u32, -1.0)]), weight);
    }
}

/// Adds the square of a row of few entries (coefficient, value), times a weight, to a whole matrix.
fn add_square(matrix: &mut [f64], count: usize, entries: &[(u32, f64)], weight: f64) {
    for &(row, value) in entries {
        for &(column, other) in entries {
            matrix[row as usize * count + column as usize] += weight * value * other;
        }
    }
}

/// The radiance of most of a sky, by its wide hats; the mean may be that of a sun.
pub(super) fn usual_radiance(shape: &LightShape, x: &[f32]) -> f64 {
    let mut wide = x[..shape.coarse.0 * shape.coarse.1].to_vec();
    median(&mut wide).max(LEAST_USUAL * mean_radiance(shape, x))
}

/// The mean radiance over the sphere, more than zero.
fn mean_radiance(shape: &LightShape, x: &[f32]) -> f64 {
    let sum: f64 = mean_weights(shape).iter().zip(x).map(|(weight, &value)| weight * f64::from(value)).sum();
    sum.max(1e-9)
}

/// Solves one channel: coefficients start at `x` and end there. `narrow` are [`super::light_suns::narrow_scales`].
pub fn solve_channel(
    equations: &NormalEquations,
    shape: &LightShape,
    prior: &LightPrior,
    gauge: &Gauge,
    narrow: &[f64],
    x: &mut [f32],
) -> ChannelKnown {
    let count = equations.count;
    let mut matrix = vec![0.0f64; count * count];
    for row in 0..count {
        for column in 0..=row {
            let value = equations.matrix[row * count + column] * prior.independence;
            matrix[row * count + column] = value;
            matrix[column * count + row] = value;
        }
    }
    let mut right: Vec<f64> = equations.right.iter().map(|value| value * prior.independence).collect();
    let (mean, usual) = (mean_radiance(shape, x), usual_radiance(shape, x));
    // Relative differences: scales are those of the light before the step, and bright places are not held down.
    for (a, b) in shape.neighbours() {
        let scale = 0.5 * f64::from(x[a] + x[b]) + 0.3 * mean;
        let weight = 1.0 / (prior.variation * scale).powi(2);
        add_square(&mut matrix, count, &[(a as u32, 1.0), (b as u32, -1.0)], weight);
    }
    believe_narrow(&mut matrix, shape, narrow, usual);
    let belief = (0..count)
        .map(|row| matrix[row * count + row] - equations.matrix[row * count + row] * prior.independence)
        .collect();
    // The freedom between reflectance and light is held by the mean light on the surface.
    let mut held = vec![0.0f32; count];
    shape.reduce(gauge.row, &mut held);
    let open = standard_deviation(&matrix, &held);
    let weight = 1.0 / (prior.gauge_slack * gauge.mean.max(1e-9)).powi(2);
    for row in 0..count {
        let own = weight * f64::from(held[row]);
        for column in 0..count {
            matrix[row * count + column] += own * f64::from(held[column]);
        }
        right[row] += own * gauge.mean;
    }
    let mut solution: Vec<f64> = x.iter().map(|&value| f64::from(value)).collect();
    solve_non_negative(&matrix, &right, &mut solution, 300, 1e-5);
    for (x, value) in x.iter_mut().zip(solution) {
        *x = value as f32;
    }
    let mean: f64 = held.iter().zip(x.iter()).map(|(held, x)| f64::from(held * x)).sum();
    let scale_deviation = if mean > 0.0 { open / mean } else { f64::INFINITY };
    ChannelKnown { belief, scale_deviation }
}

/// Standard deviation of a weighted sum of numbers that are known by this precision matrix; infinite where it leaves the
/// sum open.
fn standard_deviation(precision: &[f64], weights: &[f32]) -> f64 {
    let count = weights.len();
    let Ok(factor) = MatRef::from_row_major_slice(precision, count, count).llt(Side::Lower) else {
        return f64::INFINITY;
    };
    let side = Mat::from_fn(count, 1, |row, _| f64::from(weights[row]));
    let solved = factor.solve(&side);
    let variance: f64 = (0..count).map(|row| side[(row, 0)] * solved[(row, 0)]).sum();
    if variance >= 0.0 { variance.sqrt() } else { f64::INFINITY }
}

/// Weights with which coefficients make up the mean radiance over the sphere.
fn mean_weights(shape: &LightShape) -> Vec<f64> {
    let (width, height) = shape.size;
    let solid: Vec<f32> = (0..width * height)
        .map(|texel| (solid_angle_of_texel(texel / width, width, height) / (4.0 * std::f64::consts::PI)) as f32)
        .collect();
    let mut reduced = vec![0.0; shape.count()];
    shape.reduce(&solid, &mut reduced);
    reduced.into_iter().map(f64::from).collect()
}

#[cfg(test)]
mod tests {
    use super::super::light_suns::narrow_scales;
    use super::*;

    #[test]
    fn suns_shine_in_all_channels_and_what_shines_in_one_is_held_as_sky() {
        let (sun, blue, sky) = (40, 44, 72);
        let shape = LightShape::new((16, 8), vec![sun, blue, sky]);
        let mut light = vec![[1.0f32, 1.0, 2.0]; 128];
        light[sun as usize] = [1000.0, 800.0, 500.0];
        light[blue as usize][2] = 100.0;
        let coefficients = shape.coefficients_of_channels(&light);
        let scales = narrow_scales(&shape, &light, &coefficients, 10.0);
        assert!(scales[0] > 100.0 && scales[1..] == [1.0, 1.0], "{scales:?}");

        // A doubtful row, 40 +- 20, moves a texel of the sky by little, and the sun stays.
        let mut equations = NormalEquations::new(shape.count());
        for (texel, radiance) in light.iter().enumerate() {
            let said = if texel == blue as usize { 40.0 } else { f64::from(radiance[0]) };
            let error = if texel == blue as usize { 20.0 } else { 0.01 * said };
            let entries = shape.reduce_sparse(&[(texel as u32, 1.0)]);
            let scaled: Vec<(u32, f64)> = entries.iter().map(|&(index, value)| (index, value / error)).collect();
            equations.add_sparse(&scaled, said / error);
        }
        let prior = LightPrior { variation: 0.7, independence: 1.0, gauge_slack: 1.0 };
        let row = vec![1.0 / 128.0; 128];
        let [mut x, _, _] = coefficients;
        solve_channel(&equations, &shape, &prior, &Gauge { row: &row, mean: 8.8 }, &scales, &mut x);
        let found = shape.expand(&x);
        assert!((found[sun as usize] - 1000.0).abs() < 20.0, "{}", found[sun as usize]);
        assert!(found[blue as usize] < 4.0, "{}", found[blue as usize]);
    }

    #[test]
    fn a_hole_in_what_photos_show_takes_the_radiance_of_its_rim() {
        // A bright band that begins at the horizon, as a ground does; a column of it is in no photo.
        let (width, height) = (32, 16);
        let is_bright = |texel: usize| (8..12).contains(&(texel / width));
        let is_hidden = |texel: usize| texel % width == 11 && (8..11).contains(&(texel / width));
        let texels = 0..width * height;
        let fine: Vec<u32> = texels.clone().filter(|&texel| is_bright(texel)).map(|texel| texel as u32).collect();
        let shape = LightShape::new((width, height), fine);
        let truth = |texel: usize| if is_bright(texel) { 0.9f32 } else { 0.7 };
        let mut equations = NormalEquations::new(shape.count());
        for texel in texels.clone().filter(|&texel| !is_hidden(texel)) {
            let entries = shape.reduce_sparse(&[(texel as u32, 100.0)]);
            equations.add_sparse(&entries, 100.0 * f64::from(truth(texel)));
        }
        let light: Vec<[f32; 3]> = texels.map(|texel| [truth(texel); 3]).collect();
        let coefficients = shape.coefficients_of_channels(&light);
        let scales = narrow_scales(&shape, &light, &coefficients, 10.0);
        let prior = LightPrior { variation: 0.7, independence: 1.0, gauge_slack: 1.0 };
        let row = vec![1.0 / (width * height) as f32; width * height];
        let mut x = vec![0.7; shape.count()];
        solve_channel(&equations, &shape, &prior, &Gauge { row: &row, mean: 0.75 }, &scales, &mut x);
        let hidden = shape.expand(&x)[9 * width + 11];
        assert!((0.78..0.95).contains(&hidden), "{hidden}");
    }

    #[test]
    fn a_sum_is_as_sure_as_its_least_sure_part() {
        // Two numbers of which the sum is known to 0.1 and the difference hardly.
        let (sure, hardly) = (100.0, 1e-6);
        let matrix = [sure + hardly, sure - hardly, sure - hardly, sure + hardly];
        assert!((standard_deviation(&matrix, &[1.0, 1.0]) - 0.1).abs() < 1e-6);
        assert!(standard_deviation(&matrix, &[1.0, -1.0]) > 500.0);
        let alone = [4.0, 0.0, 0.0, 0.0];
        assert!(standard_deviation(&alone, &[1.0, 0.0]).is_infinite());
        assert!((standard_deviation(&[4.0], &[3.0]) - 1.5).abs() < 1e-12);
    }
}
