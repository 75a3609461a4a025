//! Directions towards the light, drawn in proportion to how bright it is there.
//!
//! Radiance is bilinear between texel centres, so texels are the wrong cells: the density is built on a grid twice as
//! fine, whose corners are texel centres and the places halfway between. Inside such a cell radiance is one bilinear
//! patch, and at the corners the density is exactly luminance times a constant. Within a cell the density is bilinear
//! in phi and in the cosine of theta, in which equal lengths are equal solid angles: density per steradian is then
//! continuous over the sphere, normalised without quadrature, and sampled in closed form. It differs from luminance
//! only by the bend of the cosine within half a texel, at most 1.5 times next to a pole.
//!
//! A small part is spent evenly on the whole sphere, so that no place with light, however dim or blue beside a sun,
//! has a density of nearly 0.

use super::environment::Environment;
use super::inversion::InversionTable;
use crate::image::Image;
use crate::math::{luminance, sphere};
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// The part of the samples that is spread evenly over the sphere.
const UNIFORM_SHARE: f64 = 1.0 / 64.0;

/// Draws directions in proportion to the luminance of an environment as it was when the sampler was made.
#[derive(Clone, Debug)]
pub struct EnvironmentSampler {
    tables: Option<Tables>,
}

#[derive(Clone, Debug)]
struct Tables {
    /// Density per steradian at the corners of cells: one row more than cells, and as many columns, which wrap.
    density: Image<f32>,
    /// The row of a cell.
    rows: InversionTable,
    /// The column of a cell in a row; all rows have light, because of the uniform share.
    columns: Vec<InversionTable>,
    /// Cosine of theta at the upper edge of each row of cells, and at the lower edge of the last.
    cosines: Vec<f64>,
}

impl EnvironmentSampler {
    /// A sampler for an environment. Radiance that is negative or not finite counts as 0.
    pub fn new(environment: &Environment) -> Self {
        EnvironmentSampler { tables: Tables::new(environment) }
    }

    /// A unit direction towards the light and its density per steradian (above 0), from two numbers uniform in
    /// [0, 1). Nothing when the environment is black.
    pub fn sample(&self, u: [f32; 2]) -> Option<(Vec3, f32)> {
        self.tables.as_ref().map(|tables| tables.sample(u))
    }

    /// The density per steradian with which [`EnvironmentSampler::sample`] draws a direction; 0 when the environment
    /// is black.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let (phi, theta) = sphere::angles_of_direction(direction);
        self.pdf_at_angles(phi, theta)
    }

    /// [`EnvironmentSampler::pdf`] of a direction by its angles, see [`sphere::angles_of_direction`].
    pub fn pdf_at_angles(&self, phi: f32, theta: f32) -> f32 {
        self.tables.as_ref().map_or(0.0, |tables| tables.pdf(phi, theta))
    }

    /// Whether there is no light at all.
    pub fn is_black(&self) -> bool {
        self.tables.is_none()
    }
}

impl Tables {
    fn new(environment: &Environment) -> Option<Self> {
        let (width, height) = (2 * environment.width(), 2 * environment.height());
        let corners = corner_luminance(environment);
        let cell_mean = |corners: &Image<f64>, row: usize, column: usize| {
            let right = (column + 1) % width;
            0.25 * (corners[(row, column)]
                + corners[(row, right)]
                + corners[(row + 1, column)]
                + corners[(row + 1, right)])
        };
        let mut power = 0.0;
        for row in 0..height {
            let row_sum: f64 = (0..width).map(|column| cell_mean(&corners, row, column)).sum();
            power += row_sum * sphere::solid_angle_of_texel(row, width, height);
        }
        if power <= 0.0 || !power.is_finite() {
            return None;
        }
        let uniform = UNIFORM_SHARE / (2.0 * TAU);
        let density = corners.map(|luminance| luminance / power * (1.0 - UNIFORM_SHARE) + uniform);
        let mut row_weights = Vec::with_capacity(height);
        let mut columns = Vec::with_capacity(height);
        for row in 0..height {
            let weights: Vec<f64> = (0..width).map(|column| cell_mean(&density, row, column)).collect();
            row_weights.push(weights.iter().sum::<f64>() * sphere::solid_angle_of_texel(row, width, height));
            columns.push(InversionTable::new(&weights)?);
        }
        let cosines = (0..=height).map(|row| (PI * row as f64 / height as f64).cos()).collect();
        Some(Tables {
            density: density.map(|&value| value as f32),
            rows: InversionTable::new(&row_weights)?,
            columns,
            cosines,
        })
    }

    /// Densities at the corners of a cell: upper left, upper right, lower left, lower right.
    fn corners(&self, row: usize, column: usize) -> [f32; 4] {
        let right = if column + 1 == self.density.width() { 0 } else { column + 1 };
        let density = &self.density;
        [density[(row, column)], density[(row, right)], density[(row + 1, column)], density[(row + 1, right)]]
    }

    fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        let (row, rest_down) = self.rows.sample(u[1]);
        let (column, rest_across) = self.columns[row].sample(u[0]);
        let [upper_left, upper_right, lower_left, lower_right] = self.corners(row, column);
        let down = sample_linear(rest_down, upper_left + upper_right, lower_left + lower_right);
        let (left, right) = (lerp(upper_left, lower_left, down), lerp(upper_right, lower_right, down));
        let across = sample_linear(rest_across, left, right);
        // Near a pole 1 - cos(theta) is tiny: f64 keeps its digits.
        let (top, bottom) = (self.cosines[row], self.cosines[row + 1]);
        let cosine = top + (bottom - top) * f64::from(down);
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt() as f32;
        let phi = (TAU * (column as f64 + f64::from(across)) / self.density.width() as f64) as f32;
        let (sin_phi, cos_phi) = phi.sin_cos();
        (Vec3::new(sine * sin_phi, cosine as f32, -sine * cos_phi), lerp(left, right, across))
    }

    fn pdf(&self, phi: f32, theta: f32) -> f32 {
        let (width, height) = (self.density.width(), self.density.height() - 1);
        let x = f64::from(phi) / TAU * width as f64;
        let y = f64::from(theta) / PI * height as f64;
        let (column, row) = ((x as usize).min(width - 1), (y as usize).min(height - 1));
        let across = ((x - column as f64) as f32).clamp(0.0, 1.0);
        let (top, bottom) = (self.cosines[row], self.cosines[row + 1]);
        let down = (((top - f64::from(theta).cos()) / (top - bottom)) as f32).clamp(0.0, 1.0);
        let [upper_left, upper_right, lower_left, lower_right] = self.corners(row, column);
        lerp(lerp(upper_left, lower_left, down), lerp(upper_right, lower_right, down), across)
    }
}

/// Luminance at the corners of the twice finer grid: there bilinear radiance is a texel or a mean of neighbours.
fn corner_luminance(environment: &Environment) -> Image<f64> {
    let (width, height) = (environment.width(), environment.height());
    let texels = environment.radiance.map(|rgb| {
        let clean = |value: f32| if value.is_finite() && value > 0.0 { value } else { 0.0 };
        f64::from(luminance(Vec3::from_array(rgb.to_array().map(clean))))
    });
    // Corner `index` lies at texel coordinate (index - 1)/2: an odd one on a centre, an even one between two.
    Image::from_fn(2 * width, 2 * height + 1, |row, column| {
        let rows = [row.saturating_sub(1) / 2, (row / 2).min(height - 1)];
        let columns = [(column + 2 * width - 1) / 2 % width, column / 2 % width];
        let sum: f64 = rows.iter().flat_map(|&row| columns.map(|column| texels[(row, column)])).sum();
        0.25 * sum
    })
}

/// A number in [0, 1] with a density linear from `first` to `last`, which are not both 0.
///
/// Pharr, Jakob and Humphreys 2023, "Physically Based Rendering" 4th edition, section 2.3.2.
fn sample_linear(u: f32, first: f32, last: f32) -> f32 {
    let root = lerp(first * first, last * last, u).sqrt();
    (u * (first + last) / (first + root)).clamp(0.0, 1.0)
}

fn lerp(first: f32, last: f32, fraction: f32) -> f32 {
    first * (1.0 - fraction) + last * fraction
}
