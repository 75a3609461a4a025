//! The environment as other programs read it: turned and sampled so that each texel lands where it was.
//!
//! | reader | left border | centre | rows |
//! |---|---|---|---|
//! | Patina, USD dome light, OpenEXR's latitude-longitude | -z | +z | centres of texels |
//! | Mitsuba `envmap` | -z | +z | nodes, the poles included |
//! | three.js, Blender after import of glTF | -x | +x | centres of texels |

use crate::error::Result;
use crate::image::{Image, file};
use crate::light::Environment;
use crate::math::sphere::direction_of_texel;
use std::path::Path;

/// An environment of fewer rows is sampled finer before it is written: readers differ in how they interpolate between
/// texels and at the poles, and on a fine map that makes no difference.
const FEWEST_ROWS: usize = 256;

/// The environment with at least 256 rows, as bilinear interpolation reads it.
pub fn smooth(environment: &Environment) -> Environment {
    if environment.height() >= FEWEST_ROWS {
        return environment.clone();
    }
    let factor = FEWEST_ROWS.div_ceil(environment.height());
    let (width, height) = (environment.width() * factor, environment.height() * factor);
    let radiance = Image::from_fn(width, height, |row, column| {
        environment.radiance_towards(direction_of_texel(row, column, width, height))
    });
    Environment { radiance }
}

/// [`smooth`], moved a quarter of its width to the right: +x in the centre, as three.js and Blender have it.
pub fn with_x_in_the_centre(environment: &Environment) -> Environment {
    // Longitude phi stands at phi / (2 pi) + 1/4; a width that is no multiple of four is turned by interpolation.
    smooth(environment).rotated_about_up(-std::f32::consts::FRAC_PI_2)
}

/// The environment on nodes, `2 rows + 1` of them from pole to pole: rows of texels at odd places, means of neighbours
/// between, so that linear interpolation between nodes is Patina's between centres, exactly.
pub fn on_nodes(environment: &Environment) -> Environment {
    let rows = environment.height();
    let radiance = Image::from_fn(environment.width(), 2 * rows + 1, |row, column| {
        let above = (row.max(1) - 1) / 2;
        let below = (row / 2).min(rows - 1);
        0.5 * (environment.radiance[(above, column)] + environment.radiance[(below, column)])
    });
    Environment { radiance }
}

/// Writes an environment as OpenEXR and as Radiance HDR beside it, `stem.exr` and `stem.hdr`.
pub fn write_both(environment: &Environment, folder: &Path, stem: &str) -> Result<()> {
    file::write_exr_rgb(&folder.join(format!("{stem}.exr")), &environment.radiance)?;
    file::write_hdr(&folder.join(format!("{stem}.hdr")), &environment.radiance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sphere::angles_of_direction;
    use glam::Vec3;
    use std::f32::consts::{PI, TAU};

    fn one_bright_texel() -> Environment {
        let mut light = Environment::constant(64, 32, Vec3::splat(0.1));
        light.radiance[(9, 11)] = Vec3::new(40.0, 20.0, 10.0);
        light
    }

    #[test]
    fn x_is_in_the_centre() {
        let light = with_x_in_the_centre(&one_bright_texel());
        for direction in [Vec3::X, Vec3::new(0.3, 0.4, -0.8), Vec3::new(-0.5, -0.2, 0.6), Vec3::new(0.9, 0.6, -0.4)] {
            let direction = direction.normalize();
            // As three.js reads it: u = atan2(z, x) / (2 pi) + 1/2, v from the top = acos(y) / pi.
            let u = direction.z.atan2(direction.x) / TAU + 0.5;
            let v = direction.y.acos() / PI;
            let column = (u * light.width() as f32) as usize % light.width();
            let row = (v * light.height() as f32) as usize;
            let (read, own) = (light.radiance[(row, column)], one_bright_texel().radiance_towards(direction));
            assert!((read - own).length() < 0.06 * own.length() + 0.6, "{direction}: {read} {own}");
        }
        let brightest = (0..light.width() * light.height())
            .max_by(|&a, &b| light.radiance.pixels()[a].x.total_cmp(&light.radiance.pixels()[b].x));
        let index = brightest.unwrap();
        let (u, v) = ((index % light.width()) as f32 + 0.5, (index / light.width()) as f32 + 0.5);
        let u = u / light.width() as f32;
        let expected = (11.5f32 / 64.0 + 0.25, 9.5 / 32.0);
        assert!((u - expected.0).abs() < 0.01 && (v / light.height() as f32 - expected.1).abs() < 0.01, "{u} {v}");
    }

    #[test]
    fn interpolation_between_nodes_is_that_between_centres() {
        let light = one_bright_texel();
        let nodes = on_nodes(&light);
        let (width, height) = (nodes.width(), nodes.height());
        for step in 0..400 {
            let t = step as f32 / 400.0;
            let direction = Vec3::new((37.0 * t).sin(), 1.6 * t - 0.8, (37.0 * t).cos()).normalize();
            let (phi, theta) = angles_of_direction(direction);
            let (x, y) = (phi / TAU * width as f32 - 0.5, theta / PI * (height - 1) as f32);
            let (column, row) = (x.floor(), y.floor().min((height - 2) as f32));
            let (across, down) = (x - column, y - row);
            let at = |row: usize, column: f32| nodes.radiance[(row, column.rem_euclid(width as f32) as usize)];
            let line = |row: usize| at(row, column) * (1.0 - across) + at(row, column + 1.0) * across;
            let read = line(row as usize) * (1.0 - down) + line(row as usize + 1) * down;
            let own = light.radiance_towards(direction);
            assert!((read - own).length() < 1e-3 * (1.0 + own.length()), "{direction}: {read} {own}");
        }
    }
}
