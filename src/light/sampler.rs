//! Directions towards the light, drawn in proportion to how much brighter than its mean it is there.
//!
//! The mean is left to directions drawn from the lobe, which are joined with these by multiple importance sampling: they
//! find an even light as well, and what they would find need not be looked for twice (Karlik, Sik, Vevoda, Skrivan and
//! Krivanek 2019, "MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling"). Pictures
//! scatter less than with directions in proportion to luminance itself, under skies, indoor lights and a sun.
//!
//! Radiance is bilinear between texel centres, so texels are the wrong cells: the density is built on a grid twice as
//! fine, whose corners are texel centres and the places halfway between. Inside such a cell radiance is one bilinear
//! patch, and at the corners the density is what is above the mean, times a constant, and an even part (see below).
//! Within a cell the density is bilinear in phi and in the cosine of theta, in which equal lengths are equal solid
//! angles: density per steradian is then continuous over the sphere, normalised without quadrature, and sampled in
//! closed form. Between corners it differs from what is above the mean by the bend of the cosine within half a texel, at
//! most 1.5 times next to a pole, and by the kink where luminance crosses the mean. A light with next to nothing above
//! its mean is drawn by its luminance.
//!
//! A small part is spent evenly on the whole sphere, so that no place with light, however dim or blue beside a sun,
//! has a density of nearly 0.

use super::environment::Environment;
use super::inversion::InversionTables;
use crate::image::Image;
use crate::math::{luminance, sphere};
use glam::Vec3;
use std::f64::consts::{PI, TAU};

/// The part of the samples that is spread evenly over the sphere.
const UNIFORM_SHARE: f64 = 1.0 / 64.0;

/// A light of which a smaller share of the power lies above the mean is even: it is drawn as it is.
const EVEN: f64 = 0.01;

/// Draws directions in proportion to the luminance of an environment above its mean, as it was when the sampler was made.
#[derive(Clone, Debug)]
pub struct EnvironmentSampler {
    tables: Option<Tables>,
}

/// A direction towards the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// The unit direction.
    pub direction: Vec3,
    /// Its density per steradian, above 0.
    pub density: f32,
}

/// What directions are looked up in.
#[derive(Clone, Debug)]
pub(crate) struct Tables {
    /// Density per steradian at the corners of cells: one row more than cells, and as many columns, which wrap.
    density: Image<f32>,
    /// The row of a cell: one table.
    rows: InversionTables,
    /// The column of a cell, a table for each row; all rows have light, because of the uniform share.
    columns: InversionTables,
    /// Where each row of cells lies.
    rings: Vec<Ring>,
}

/// Where a row of cells lies, told from the nearer pole: there the cosine of theta has lost the digits that its distance
/// from 1 still has.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ring {
    /// 1 for the upper pole, -1 for the lower: the cosine of theta there.
    pub pole: f32,
    /// How far the cosine lies from that at the upper edge, and what is to be added to reach the lower edge.
    pub from_pole: [f32; 2],
}

impl Ring {
    /// Row `row` of `height`, an even number.
    fn new(row: usize, height: usize) -> Self {
        let is_upper = row < height / 2;
        let from_pole = |edge: usize| {
            let half_angle = 0.5 * PI * if is_upper { edge } else { height - edge } as f64 / height as f64;
            2.0 * half_angle.sin().powi(2)
        };
        let top = from_pole(row);
        Ring { pole: if is_upper { 1.0 } else { -1.0 }, from_pole: [top as f32, (from_pole(row + 1) - top) as f32] }
    }
}

/// A cell of the table, and where in it a direction is drawn.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LightCell {
    /// Its column.
    pub column: usize,
    /// Numbers that are left to place the direction by, uniform in [0, 1): along phi, along theta.
    pub rest: [f32; 2],
    /// Density per steradian at its corners: upper left, upper right, lower left, lower right.
    pub corners: [f32; 4],
    /// Its row.
    pub ring: Ring,
}

impl EnvironmentSampler {
    /// A sampler for an environment. Radiance that is negative or not finite counts as 0.
    pub fn new(environment: &Environment) -> Self {
        EnvironmentSampler { tables: Tables::new(environment) }
    }

    /// A direction towards the light, from two numbers uniform in [0, 1). Nothing when the environment is black.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        self.tables.as_ref().map(|tables| tables.sample(u))
    }

    /// The density per steradian with which [`EnvironmentSampler::sample`] draws a unit direction; 0 when the
    /// environment is black.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        self.pdf_at_angles(direction, sphere::angles_of_direction(direction))
    }

    /// [`EnvironmentSampler::pdf`] of a unit direction whose angles are known, see [`sphere::angles_of_direction`].
    #[inline]
    pub fn pdf_at_angles(&self, direction: Vec3, angles: (f32, f32)) -> f32 {
        self.tables.as_ref().map_or(0.0, |tables| tables.pdf(direction, angles))
    }

    /// What directions are looked up in; nothing when the environment is black.
    pub(crate) fn tables(&self) -> Option<&Tables> {
        self.tables.as_ref()
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
        let whole = power(&corners);
        if whole <= 0.0 || !whole.is_finite() {
            return None;
        }
        let mean = whole / (2.0 * TAU);
        let above_mean = corners.map(|luminance| (luminance - mean).max(0.0));
        let power_above = power(&above_mean);
        // Of an even light only rounding would be left.
        let (corners, power) = if power_above > EVEN * whole { (above_mean, power_above) } else { (corners, whole) };
        let uniform = UNIFORM_SHARE / (2.0 * TAU);
        let density = corners.map(|luminance| luminance / power * (1.0 - UNIFORM_SHARE) + uniform);
        let mut row_weights = Vec::with_capacity(height);
        let mut columns = InversionTables::new(width);
        for row in 0..height {
            let weights: Vec<f64> = (0..width).map(|column| cell_mean(&density, row, column)).collect();
            row_weights.push(weights.iter().sum::<f64>() * sphere::solid_angle_of_texel(row, width, height));
            columns.push(&weights)?;
        }
        let mut rows = InversionTables::new(height);
        rows.push(&row_weights)?;
        let rings = (0..height).map(|row| Ring::new(row, height)).collect();
        Some(Tables { density: density.map(|&value| value as f32), rows, columns, rings })
    }

    /// Densities at the corners of a cell: upper left, upper right, lower left, lower right.
    fn corners(&self, row: usize, column: usize) -> [f32; 4] {
        let right = if column + 1 == self.density.width() { 0 } else { column + 1 };
        let density = &self.density;
        [density[(row, column)], density[(row, right)], density[(row + 1, column)], density[(row + 1, right)]]
    }

    /// Columns of cells.
    pub(crate) fn columns(&self) -> usize {
        self.density.width()
    }

    /// The cell that two numbers uniform in [0, 1) fall into.
    #[inline]
    pub(crate) fn cell(&self, u: [f32; 2]) -> LightCell {
        let (row, down) = self.rows.sample(0, u[1]);
        let (column, across) = self.columns.sample(row, u[0]);
        LightCell { column, rest: [across, down], corners: self.corners(row, column), ring: self.rings[row] }
    }

    fn sample(&self, u: [f32; 2]) -> LightSample {
        let LightCell { column, rest: [rest_across, rest_down], corners, ring } = self.cell(u);
        let [upper_left, upper_right, lower_left, lower_right] = corners;
        let down = sample_linear(rest_down, upper_left + upper_right, lower_left + lower_right);
        let (left, right) = (lerp(upper_left, lower_left, down), lerp(upper_right, lower_right, down));
        let across = sample_linear(rest_across, left, right);
        let from_pole = ring.from_pole[0] + ring.from_pole[1] * down;
        let sine = (from_pole * (2.0 - from_pole)).max(0.0).sqrt();
        let cosine = ring.pole * (1.0 - from_pole);
        let turns = (column as f32 + across) / self.density.width() as f32;
        let (sin_phi, cos_phi) = (std::f32::consts::TAU * turns).sin_cos();
        LightSample {
            direction: Vec3::new(sine * sin_phi, cosine, -sine * cos_phi),
            density: lerp(left, right, across),
        }
    }

    fn pdf(&self, direction: Vec3, (phi, theta): (f32, f32)) -> f32 {
        let (width, height) = (self.density.width(), self.density.height() - 1);
        let x = phi * (width as f32 / std::f32::consts::TAU);
        let y = theta * (height as f32 / std::f32::consts::PI);
        let (column, row) = ((x as usize).min(width - 1), (y as usize).min(height - 1));
        let across = (x - column as f32).clamp(0.0, 1.0);
        // The distance of the cosine from 1 or -1 is found from the sine, which has its digits there.
        let Ring { pole, from_pole: [top, difference] } = self.rings[row];
        let sine_squared = direction.x * direction.x + direction.z * direction.z;
        let down = ((sine_squared / (1.0 + pole * direction.y) - top) / difference).clamp(0.0, 1.0);
        let [upper_left, upper_right, lower_left, lower_right] = self.corners(row, column);
        lerp(lerp(upper_left, lower_left, down), lerp(upper_right, lower_right, down), across)
    }
}

/// Mean of a cell's corners; the columns of corners wrap.
fn cell_mean(corners: &Image<f64>, row: usize, column: usize) -> f64 {
    let right = (column + 1) % corners.width();
    0.25 * (corners[(row, column)] + corners[(row, right)] + corners[(row + 1, column)] + corners[(row + 1, right)])
}

/// Integral over the sphere of what lies at the corners of cells.
fn power(corners: &Image<f64>) -> f64 {
    let (width, height) = (corners.width(), corners.height() - 1);
    let of_row = |row: usize| {
        let sum: f64 = (0..width).map(|column| cell_mean(corners, row, column)).sum();
        sum * sphere::solid_angle_of_texel(row, width, height)
    };
    (0..height).map(of_row).sum()
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
