//! Pictures of measured reflectance: spheres under lamps, labelled sheets of them, lobes as curves.

use super::label;
use super::plot::{LinePlot, Scale, Series, standalone};
use super::report::number::short;
use crate::image::{Image, RgbImage, file};
use crate::measured::coordinates::HalfDifference;
use crate::measured::sphere::{self, DistantLamp, EnvironmentLevels};
use std::f64::consts::FRAC_PI_2;

/// Reflectance in 1/sr of any angles.
pub type Reflectance<'a> = &'a dyn Fn(HalfDifference) -> [f64; 3];

/// Margin around spheres and labels, in pixels.
const MARGIN: usize = 8;
/// What is behind the spheres.
const PAPER: [u8; 3] = [34, 36, 40];
const INK: [u8; 3] = [226, 228, 230];
/// Difference angles at which lobes are drawn, in degrees.
pub const DIFFERENCES: [f64; 3] = [5.0, 45.0, 75.0];
/// Points of a curve.
const POINTS: usize = 181;

/// A picture of a sphere as displayed, after the exposure of [`sphere::display_exposure`], beside it paper.
pub fn shown_sphere(radiance: &RgbImage) -> Image<[u8; 3]> {
    let mask = sphere::sphere_mask(radiance.width());
    shown_sphere_at(radiance, sphere::display_exposure(radiance, &mask))
}

/// A picture of a sphere as displayed, times a factor, beside it paper.
pub fn shown_sphere_at(radiance: &RgbImage, exposure: f32) -> Image<[u8; 3]> {
    let mask = sphere::sphere_mask(radiance.width());
    let mut shown = file::srgb8_from_linear(radiance, exposure.max(f32::MIN_POSITIVE).log2());
    for (pixel, inside) in shown.pixels_mut().iter_mut().zip(mask.pixels()) {
        if !inside {
            *pixel = PAPER;
        }
    }
    shown
}

/// Pictures of one size in rows, each with its name below, so that the sheet is about as wide as high.
pub fn sheet(tiles: &[(String, Image<[u8; 3]>)], columns: Option<usize>) -> Image<[u8; 3]> {
    let side = tiles.iter().map(|(_, tile)| tile.width().max(tile.height())).max().unwrap_or(0);
    let longest = tiles.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let width = side.max(longest * label::ADVANCE) + MARGIN;
    let height = side + label::HEIGHT + 2 * MARGIN;
    let square = ((tiles.len() * height) as f64 / width.max(1) as f64).sqrt().ceil() as usize;
    let columns = columns.unwrap_or(square).clamp(1, tiles.len().max(1));
    let rows = tiles.len().div_ceil(columns);
    let mut picture = Image::filled(columns * width + MARGIN, rows * height + MARGIN, PAPER);
    for (index, (name, tile)) in tiles.iter().enumerate() {
        let (top, left) = (MARGIN + index / columns * height, MARGIN + index % columns * width);
        let inset = (width - MARGIN - tile.width()) / 2;
        for row in 0..tile.height() {
            for column in 0..tile.width() {
                picture[(top + row, left + inset + column)] = tile[(row, column)];
            }
        }
        let inset = (width - MARGIN).saturating_sub(name.chars().count() * label::ADVANCE) / 2;
        label::draw(&mut picture, top + side + MARGIN / 2, left + inset, name, INK);
    }
    picture
}

/// What lights a sphere in a picture.
#[derive(Clone, Debug)]
pub enum ShowLight {
    /// Lamps, and the exposure of [`sphere::SHOWING_EXPOSURE`], halved or doubled at most towards the picture's own: a
    /// black cloth stays black beside a white one.
    Lamps(Vec<DistantLamp>),
    /// An environment, and the exposure that suits the picture.
    Environment(EnvironmentLevels),
}

/// The sphere of a material under a light, as displayed.
pub fn sphere_of(
    reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync),
    size: usize,
    light: &ShowLight,
) -> Image<[u8; 3]> {
    match light {
        ShowLight::Environment(levels) => shown_sphere(&sphere::render_sphere_in(size, reflectance, levels)),
        ShowLight::Lamps(lamps) => {
            let radiance = sphere::render_sphere(size, reflectance, lamps);
            let own = sphere::display_exposure(&radiance, &sphere::sphere_mask(size));
            let base = sphere::SHOWING_EXPOSURE;
            shown_sphere_at(&radiance, own.clamp(0.5 * base, 2.0 * base))
        }
    }
}

/// Lobes over the half angle at three difference angles as an SVG file, a curve a channel and material.
///
/// `phi_difference` is 90 degrees, where the whole lobe is above the horizon.
pub fn lobes_svg(materials: &[(&str, Reflectance<'_>)]) -> String {
    let channels = ["red", "green", "blue"];
    let plots: Vec<String> = DIFFERENCES
        .iter()
        .filter_map(|degrees| {
            let mut series = Vec::new();
            for (name, reflectance) in materials {
                let points = sphere::slice(reflectance, degrees.to_radians(), FRAC_PI_2, POINTS);
                for (channel, colour) in channels.iter().enumerate() {
                    // With several materials the legend has room for initials only.
                    let initial = colour.chars().take(1).collect::<String>().to_uppercase();
                    series.push(Series {
                        name: match materials.len() {
                            1 => (*colour).into(),
                            _ => format!("{initial} {name}").trim().into(),
                        },
                        points: points.iter().map(|(theta, value)| (theta.to_degrees(), value[channel])).collect(),
                        marked: false,
                    });
                }
            }
            LinePlot {
                x_label: format!("half angle, degrees (difference angle {} degrees)", short(*degrees)),
                y_label: "reflectance, 1/sr".into(),
                x_scale: Scale::Linear,
                y_scale: Scale::Logarithmic,
                series,
                marks: Vec::new(),
            }
            .svg()
        })
        .collect();
    standalone(&plots)
}

/// The curves of [`lobes_svg`] for one material as CSV.
pub fn lobes_csv(reflectance: Reflectance<'_>) -> String {
    let mut text = "theta_difference_degrees,theta_half_degrees,red,green,blue\n".to_string();
    for degrees in DIFFERENCES {
        for (theta, [red, green, blue]) in sphere::slice(reflectance, degrees.to_radians(), FRAC_PI_2, POINTS) {
            text += &format!("{degrees},{},{red},{green},{blue}\n", theta.to_degrees());
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_holds_every_tile_and_its_name() {
        let tile = Image::filled(10, 10, [255u8, 0, 0]);
        let tiles: Vec<(String, Image<[u8; 3]>)> =
            (0..5).map(|index| (format!("tile-{index}"), tile.clone())).collect();
        let sheet = sheet(&tiles, None);
        let red = sheet.pixels().iter().filter(|pixel| **pixel == [255, 0, 0]).count();
        assert_eq!(red, 500);
        assert!(sheet.pixels().contains(&INK));
        assert_eq!(super::sheet(&[], None).width(), 2 * MARGIN);
    }

    #[test]
    fn lobes_are_drawn_and_listed() {
        let lobe = |at: HalfDifference| [0.1 + (-at.theta_half * 9.0).exp(), 0.2, 0.0];
        let svg = lobes_svg(&[("one", &lobe)]);
        // Blue is black, and black has no place on a logarithmic axis.
        assert!(svg.contains("red") && svg.matches("<polyline").count() == 6, "{}", svg.matches("<polyline").count());
        let csv = lobes_csv(&lobe);
        assert!(csv.lines().count() > 3 * 150 && !csv.contains("NaN"));
    }
}
