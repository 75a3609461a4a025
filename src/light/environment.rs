//! A latitude-longitude map of radiance, and what can be asked of it.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::{Image, RgbImage, file};
use crate::math::luminance;
use crate::math::sphere::{self, BilinearTap};
use glam::{DVec3, Vec3};
use std::path::Path;

/// A latitude-longitude map of radiance, in the conventions of the crate's front page.
///
/// Radiance in a direction is bilinear between texel centres. Sums over texels ([`Environment::power`],
/// [`Environment::mean_radiance`]) take each texel as constant over its exact solid angle: they are what files and
/// resampling keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Linear RGB radiance, row 0 up; at least one texel, all values finite and at least 0.
    pub radiance: RgbImage,
}

impl Environment {
    /// An environment of one radiance; sides of 0 count as 1.
    pub fn constant(width: usize, height: usize, radiance: Vec3) -> Self {
        Environment { radiance: Image::filled(width.max(1), height.max(1), radiance) }
    }

    /// An environment from any image: what is not a radiance is replaced, counted and told.
    ///
    /// A negative channel becomes 0; an infinite one (a sun beyond the range of its file) the largest finite value of
    /// the image; a NaN the mean of its finite neighbours. Error: an image without pixels, or without a finite value.
    pub fn from_image(mut radiance: RgbImage) -> Result<(Self, Vec<Finding>)> {
        if radiance.pixels().is_empty() {
            return Err(Error::new(ErrorKind::Malformed, "an environment needs at least one texel")
                .remedy("give a latitude-longitude image"));
        }
        let findings = repair(&mut radiance)?;
        Ok((Environment { radiance }, findings))
    }

    /// Reads a latitude-longitude map of any size: HDR, EXR and PFM as stored, PNG and JPEG decoded from sRGB.
    ///
    /// Values that are not a radiance are repaired as in [`Environment::from_image`]; an image of eight bits, or one
    /// that is not about twice as wide as high, is told by a finding. Errors as [`file::read_rgb`].
    pub fn read(path: &Path) -> Result<(Self, Vec<Finding>)> {
        let header = file::read_header(path)?;
        let image = file::read_rgb(path)?;
        let here = || Place::File(path.into());
        let (environment, mut findings) = Self::from_image(image).map_err(|error| error.at(here()))?;
        if !header.is_linear {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "environment-low-range",
                    "an environment in sRGB cannot hold a light brighter than white: the sun is missing",
                )
                .remedy("give an HDR or EXR environment"),
            );
        }
        let aspect = header.width as f64 / header.height as f64;
        if !(1.8..=2.2).contains(&aspect) && header.width * header.height > 1 {
            let message = format!("{} x {} is not the 2:1 of a full sphere", header.width, header.height);
            findings.push(
                Finding::new(Severity::Warning, "environment-aspect", message)
                    .remedy("give a latitude-longitude map of the whole sphere"),
            );
        }
        for finding in &mut findings {
            let inner = std::mem::take(&mut finding.place);
            let separator = if inner.is_empty() { "" } else { ", " };
            finding.place = format!("{}{separator}{inner}", here());
        }
        Ok((environment, findings))
    }

    /// Writes the map as OpenEXR.
    pub fn write(&self, path: &Path) -> Result<()> {
        file::write_exr_rgb(path, &self.radiance)
    }

    /// Width in texels.
    pub fn width(&self) -> usize {
        self.radiance.width()
    }

    /// Height in texels.
    pub fn height(&self) -> usize {
        self.radiance.height()
    }

    /// The four texels and weights that make up the radiance in a direction, whose length is from 1e-15 to 1e15.
    pub fn tap(&self, direction: Vec3) -> BilinearTap {
        sphere::tap_of_direction(direction, self.width(), self.height())
    }

    /// Radiance that arrives from a direction, see [`Environment::tap`], bilinear in (phi, theta).
    pub fn radiance_towards(&self, direction: Vec3) -> Vec3 {
        radiance_of_tap(self.radiance.pixels(), &self.tap(direction))
    }

    /// Sum over texels of radiance times exact solid angle, per channel.
    pub fn power(&self) -> DVec3 {
        let (width, height) = (self.width(), self.height());
        let rows = self.radiance.pixels().chunks_exact(width).enumerate();
        rows.map(|(row, texels)| {
            let sum: DVec3 = texels.iter().map(|rgb| rgb.as_dvec3()).sum();
            sum * sphere::solid_angle_of_texel(row, width, height)
        })
        .sum()
    }

    /// Mean radiance over the sphere, per channel: [`Environment::power`] over 4 pi.
    pub fn mean_radiance(&self) -> Vec3 {
        (self.power() / (4.0 * std::f64::consts::PI)).as_vec3()
    }

    /// Direction of the texel with the highest luminance; `None` for a black map.
    pub fn brightest_direction(&self) -> Option<Vec3> {
        brightest_direction(self.radiance.pixels().iter().copied(), self.width(), self.height())
    }

    /// Irradiance of a surface with this unit normal: the integral of the bilinear radiance times the cosine over the
    /// hemisphere, by the midpoint rule on at least 256 rows (error below 1e-3 of the largest part, measured).
    pub fn irradiance(&self, normal: Vec3) -> DVec3 {
        let split = 256usize.div_ceil(self.height());
        let (width, height) = (self.width() * split, self.height() * split);
        let mut sum = DVec3::ZERO;
        for row in 0..height {
            let mut row_sum = DVec3::ZERO;
            for column in 0..width {
                let direction = sphere::direction_of_texel(row, column, width, height);
                let cosine = direction.dot(normal);
                if cosine > 0.0 {
                    row_sum += self.radiance_towards(direction).as_dvec3() * f64::from(cosine);
                }
            }
            sum += row_sum * sphere::solid_angle_of_texel(row, width, height);
        }
        sum
    }
}

/// Direction of the texel with the highest luminance among row-major texels of an environment of this size; `None` where all
/// are black.
pub fn brightest_direction(texels: impl Iterator<Item = Vec3>, width: usize, height: usize) -> Option<Vec3> {
    let lit = texels.map(luminance).enumerate().filter(|(_, own)| *own > 0.0);
    let (index, _) = lit.reduce(|best, next| if next.1 > best.1 { next } else { best })?;
    Some(sphere::direction_of_texel(index / width, index % width, width, height))
}

/// Radiance of a tap into row-major texels.
#[inline]
pub fn radiance_of_tap(texels: &[Vec3], tap: &BilinearTap) -> Vec3 {
    (0..4).map(|corner| texels[tap.index[corner] as usize] * tap.weight[corner]).sum()
}

/// The transpose of [`radiance_of_tap`]: adds the derivative by the radiance to those by its four texels.
#[inline]
pub fn radiance_backward(d_texels: &mut [Vec3], tap: &BilinearTap, d_radiance: Vec3) {
    for corner in 0..4 {
        d_texels[tap.index[corner] as usize] += d_radiance * tap.weight[corner];
    }
}

/// Replaces what is not a radiance; one finding per kind, with the number of texels and the first place.
fn repair(radiance: &mut RgbImage) -> Result<Vec<Finding>> {
    let finite = |value: f32| value.is_finite();
    let channels = || radiance.pixels().iter().flat_map(|rgb| rgb.to_array());
    if !channels().any(finite) {
        return Err(Error::new(ErrorKind::NonFinite, "no texel of the environment is finite")
            .remedy("export the environment again"));
    }
    let largest = channels().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let original = radiance.clone();
    let mut kinds = [
        Repair::new("environment-nan", "is not a number", "replaced by the mean of its neighbours"),
        Repair::new("environment-infinite", "is infinite", "replaced by the largest finite value of the map"),
        Repair::new("environment-negative", "is negative", "replaced by 0"),
    ];
    for row in 0..original.height() {
        for column in 0..original.width() {
            for channel in 0..3 {
                let value = original[(row, column)][channel];
                let (kind, replacement) = if value.is_nan() {
                    (0, finite_neighbours(&original, row, column, channel))
                } else if value == f32::INFINITY {
                    (1, largest)
                } else if value < 0.0 {
                    (2, 0.0)
                } else {
                    continue;
                };
                kinds[kind].note(row, column);
                radiance[(row, column)][channel] = replacement;
            }
        }
    }
    Ok(kinds.into_iter().filter_map(Repair::finding).collect())
}

/// Mean of the finite, non-negative values around a texel: it wraps in phi and stops at the poles. 0 without any.
fn finite_neighbours(image: &RgbImage, row: usize, column: usize, channel: usize) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0u32);
    for near_row in row.saturating_sub(1)..(row + 2).min(image.height()) {
        for step in [image.width() - 1, 0, 1] {
            let value = image[(near_row, (column + step) % image.width())][channel];
            if value.is_finite() && value >= 0.0 {
                sum += f64::from(value);
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { (sum / f64::from(count)) as f32 }
}

/// One kind of repair: how many texels, and the first of them.
struct Repair {
    code: &'static str,
    wrong: &'static str,
    done: &'static str,
    texels: usize,
    first: Option<(usize, usize)>,
    last: (usize, usize),
}

impl Repair {
    fn new(code: &'static str, wrong: &'static str, done: &'static str) -> Self {
        Repair { code, wrong, done, texels: 0, first: None, last: (0, 0) }
    }

    fn note(&mut self, row: usize, column: usize) {
        // Several channels of one texel count once.
        if self.first.is_none() || self.last != (row, column) {
            self.texels += 1;
        }
        self.first.get_or_insert((row, column));
        self.last = (row, column);
    }

    fn finding(self) -> Option<Finding> {
        let (row, column) = self.first?;
        let message = format!("radiance {} in {} texels; {}", self.wrong, self.texels, self.done);
        Some(Finding::new(Severity::Warning, self.code, message).at(Place::Texel {
            map: "environment".into(),
            row,
            column,
        }))
    }
}
