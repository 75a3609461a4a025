//! A light on two balls: a mirror shows where it comes from, a matte one what it does.
//!
//! The balls are seen from far along +z with +y up, then turned with `world_from_ball`. Outside a ball the picture is
//! black; its rim is smoothed by samples.

use super::environment::Environment;
use crate::image::{Image, RgbImage};
use crate::math::parallel;
use crate::math::sphere;
use glam::{Quat, Vec3};

/// Samples a pixel along each side.
const SAMPLES: usize = 3;
/// Most rows of the light behind a matte ball; each cell is a source of light with a direction of its own.
const CELL_ROWS: usize = 16;

/// The environment reflected by a mirror ball, `size x size`, linear radiance: its middle shows what is behind the
/// viewer, its rim what is behind the ball.
pub fn mirror_ball(environment: &Environment, size: usize, world_from_ball: Quat) -> RgbImage {
    // What is finer than the picture would be hit or missed by chance; resampling keeps its energy.
    let rows = environment.height().min(2 * size.max(1));
    let columns = environment.width().min(4 * size.max(1));
    let light = environment.resampled(columns, rows);
    ball(size, |normal| {
        let towards_viewer = Vec3::Z;
        let reflected = 2.0 * normal.dot(towards_viewer) * normal - towards_viewer;
        light.radiance_towards(world_from_ball * reflected)
    })
}

/// A white matte ball under the environment, `size x size`, linear radiance: irradiance over pi, without shadows.
///
/// The light is summed in cells; within a cell every direction keeps its own cosine, only those that the horizon
/// crosses are cut as a whole (error below 2 % of the brightest value, measured).
pub fn matte_ball(environment: &Environment, size: usize, world_from_ball: Quat) -> RgbImage {
    let cells = cells(environment);
    ball(size, |normal| {
        let normal = world_from_ball * normal;
        let irradiance: Vec3 = cells.iter().map(|cell| cell.irradiance(normal)).sum();
        irradiance * std::f32::consts::FRAC_1_PI
    })
}

/// The picture of `radiance(normal)` on a ball that fills it.
fn ball(size: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> RgbImage {
    let mut picture = Image::filled(size, size, Vec3::ZERO);
    parallel::each_chunk(picture.pixels_mut(), size.max(1), &|row, pixels| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            let mut sum = Vec3::ZERO;
            for sample in 0..SAMPLES * SAMPLES {
                let offset = |index: usize| (index as f32 + 0.5) / SAMPLES as f32;
                let x = 2.0 * (column as f32 + offset(sample % SAMPLES)) / size as f32 - 1.0;
                let y = 1.0 - 2.0 * (row as f32 + offset(sample / SAMPLES)) / size as f32;
                let squared_depth = 1.0 - x * x - y * y;
                if squared_depth > 0.0 {
                    sum += radiance(Vec3::new(x, y, squared_depth.sqrt()));
                }
            }
            *pixel = sum / (SAMPLES * SAMPLES) as f32;
        }
    });
    picture
}

/// Part of the sphere: the sum of radiance times solid angle times direction, per channel.
#[derive(Clone, Copy, Default)]
struct Cell {
    red: Vec3,
    green: Vec3,
    blue: Vec3,
}

impl Cell {
    fn irradiance(&self, normal: Vec3) -> Vec3 {
        Vec3::new(self.red.dot(normal), self.green.dot(normal), self.blue.dot(normal)).max(Vec3::ZERO)
    }
}

fn cells(environment: &Environment) -> Vec<Cell> {
    let (width, height) = (environment.width(), environment.height());
    // A light of few texels is split first, so that its cells are small as well.
    let split = CELL_ROWS.div_ceil(height).max((2 * CELL_ROWS).div_ceil(width));
    let (fine_width, fine_height) = (width * split, height * split);
    let mut cells = vec![Cell::default(); 2 * CELL_ROWS * CELL_ROWS];
    for row in 0..fine_height {
        let solid_angle = sphere::solid_angle_of_texel(row, fine_width, fine_height) as f32;
        for column in 0..fine_width {
            let direction = sphere::direction_of_texel(row, column, fine_width, fine_height);
            let radiance = match split {
                1 => environment.radiance[(row, column)],
                _ => environment.radiance_towards(direction),
            };
            let cell = row * CELL_ROWS / fine_height * 2 * CELL_ROWS + column * 2 * CELL_ROWS / fine_width;
            let power = radiance * solid_angle;
            cells[cell].red += direction * power.x;
            cells[cell].green += direction * power.y;
            cells[cell].blue += direction * power.z;
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dim sky with a small sun towards `direction`.
    fn sun_towards(direction: Vec3) -> Environment {
        let mut environment = Environment::constant(64, 32, Vec3::new(0.2, 0.3, 0.4));
        let tap = environment.tap(direction);
        environment.radiance.pixels_mut()[tap.index[0] as usize] = Vec3::splat(500.0);
        environment
    }

    #[test]
    fn a_mirror_shows_the_light_where_it_is() {
        let environment = Environment {
            radiance: Image::from_fn(64, 32, |row, column| {
                sphere::direction_of_texel(row, column, 64, 32) * 0.5 + Vec3::splat(0.5)
            }),
        };
        let picture = mirror_ball(&environment, 65, Quat::IDENTITY);
        let seen = |row: usize, column: usize| picture[(row, column)] * 2.0 - Vec3::ONE;
        // The middle reflects +z; at a slope of 45 degrees upwards, it reflects +y; on the right +x.
        let slope = (32.0 * std::f32::consts::FRAC_1_SQRT_2).round() as usize;
        assert!(seen(32, 32).abs_diff_eq(Vec3::Z, 0.05), "{}", seen(32, 32));
        assert!(seen(32 - slope, 32).abs_diff_eq(Vec3::Y, 0.08), "{}", seen(32 - slope, 32));
        assert!(seen(32, 32 + slope).abs_diff_eq(Vec3::X, 0.08), "{}", seen(32, 32 + slope));
        assert_eq!(picture[(0, 0)], Vec3::ZERO);
        // Turned a quarter about +y, the middle reflects what is at +x.
        let turned = mirror_ball(&environment, 65, Quat::from_rotation_y(std::f32::consts::FRAC_PI_2));
        assert!((turned[(32, 32)] * 2.0 - Vec3::ONE).abs_diff_eq(Vec3::X, 0.05));
    }

    #[test]
    fn a_matte_ball_has_the_exact_irradiance() {
        let size = 33;
        for direction in [Vec3::Y, Vec3::new(1.0, 0.4, 0.8), Vec3::new(-0.3, -0.2, 0.1)] {
            let environment = sun_towards(direction);
            let picture = matte_ball(&environment, size, Quat::IDENTITY);
            let brightest = picture.pixels().iter().fold(0.0f32, |most, pixel| most.max(pixel.max_element()));
            for (row, column) in [(16, 16), (8, 16), (16, 26), (24, 10), (10, 10)] {
                let x = 2.0 * (column as f32 + 0.5) / size as f32 - 1.0;
                let y = 1.0 - 2.0 * (row as f32 + 0.5) / size as f32;
                let normal = Vec3::new(x, y, (1.0 - x * x - y * y).sqrt());
                let exact = environment.irradiance(normal).as_vec3() / std::f32::consts::PI;
                let error = (picture[(row, column)] - exact).abs().max_element();
                assert!(error < 0.02 * brightest, "{direction} at {row} {column}: {error} of {brightest}");
            }
        }
    }

    #[test]
    fn under_an_even_light_both_balls_have_its_radiance() {
        for (width, height) in [(1, 1), (7, 3), (64, 32)] {
            let environment = Environment::constant(width, height, Vec3::new(0.5, 1.0, 2.0));
            for picture in [mirror_ball(&environment, 16, Quat::IDENTITY), matte_ball(&environment, 16, Quat::IDENTITY)]
            {
                assert!(picture[(8, 8)].abs_diff_eq(Vec3::new(0.5, 1.0, 2.0), 0.02), "{}", picture[(8, 8)]);
            }
        }
        assert_eq!(mirror_ball(&Environment::constant(1, 1, Vec3::ONE), 0, Quat::IDENTITY).pixels().len(), 0);
    }
}
