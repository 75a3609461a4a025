//! From linear pixels to bytes on a screen: shrinking, tone mapping, false colour, embedding.

use super::number::escaped;
use crate::error::Result;
use crate::image::transfer::srgb_from_linear;
use crate::image::{GreyImage, Image, RgbImage, file};
use crate::math::{luminance, sphere, statistics};
use base64::Engine;
use glam::Vec3;

/// Bytes of sRGB-encoded pixels.
pub type ScreenImage = Image<[u8; 3]>;

/// The colour of pixels that are not finite: nothing else on the page has it.
pub const NOT_FINITE: [u8; 3] = [255, 0, 255];
/// The colour of pixels that do not count.
pub const NOT_COUNTED: [u8; 3] = [96, 104, 112];

/// The image with at most `most_width` columns, averaged over areas. Values that are not finite spread.
pub fn shrunk(image: &RgbImage, most_width: usize) -> RgbImage {
    let (width, height) = (image.width(), image.height());
    if width <= most_width || most_width == 0 {
        return image.clone();
    }
    let new_width = most_width;
    let new_height = (height * new_width).div_ceil(width).max(1);
    Image::from_fn(new_width, new_height, |row, column| {
        let rows = row * height / new_height..((row + 1) * height).div_ceil(new_height);
        let columns = column * width / new_width..((column + 1) * width).div_ceil(new_width);
        let count = (rows.len() * columns.len()).max(1) as f32;
        let line = |row: usize| &image.pixels()[row * width + columns.start..row * width + columns.end];
        rows.map(|row| line(row).iter().sum::<Vec3>()).sum::<Vec3>() / count
    })
}

/// A place is true where at least half of the area it covers is, at the size of [`shrunk`].
pub fn shrunk_mask(mask: &Image<bool>, most_width: usize) -> Image<bool> {
    shrunk(&mask.map(|&counted| Vec3::splat(f32::from(u8::from(counted)))), most_width).map(|share| share.x >= 0.5)
}

/// sRGB-encoded bytes of linear values times `2^stops`.
pub fn screen_of_linear(image: &RgbImage, stops: f32) -> ScreenImage {
    let gain = stops.exp2();
    image.map(|&pixel| encoded_or_marked(pixel, |value| srgb_from_linear(value * gain)))
}

/// Bytes of values in [0, 1] without a curve.
pub fn screen_of_values(image: &GreyImage) -> ScreenImage {
    image.map(|&value| encoded_or_marked(Vec3::splat(value), |value| value.clamp(0.0, 1.0)))
}

/// sRGB-encoded bytes of a light times `2^stops`, compressed by `x / (1 + x)` (Reinhard et al. 2002, eq. 3).
pub fn screen_of_light(image: &RgbImage, stops: f32) -> ScreenImage {
    let gain = stops.exp2();
    image.map(|&pixel| {
        encoded_or_marked(pixel, |value| {
            let value = (value * gain).max(0.0);
            srgb_from_linear(value / (1.0 + value))
        })
    })
}

fn encoded_or_marked(pixel: Vec3, encode: impl Fn(f32) -> f32) -> [u8; 3] {
    if !pixel.is_finite() {
        return NOT_FINITE;
    }
    pixel.to_array().map(|value| (encode(value) * 255.0 + 0.5) as u8)
}

/// Stops that bring the mean luminance of a light over the sphere to 0.5; 0 for a black one.
pub fn stops_of_light(light: &RgbImage) -> f32 {
    let (width, height) = (light.width(), light.height());
    let sum: f64 = light
        .pixels()
        .iter()
        .enumerate()
        .filter(|(_, pixel)| pixel.is_finite())
        .map(|(index, &pixel)| sphere::solid_angle_of_texel(index / width, width, height) * f64::from(luminance(pixel)))
        .sum();
    stops_to(0.5, sum / (4.0 * std::f64::consts::PI))
}

/// Stops that bring the 95th percentile of the luminance of some pictures to 0.8; black pixels are left out.
pub fn stops_of_pictures<'a>(pictures: impl IntoIterator<Item = &'a RgbImage>) -> f32 {
    let values: Vec<f64> = pictures
        .into_iter()
        .flat_map(|picture| shrunk(picture, 160).into_pixels())
        .map(|pixel| f64::from(luminance(pixel)))
        .filter(|value| value.is_finite() && *value > 0.0)
        .collect();
    stops_to(0.8, statistics::quantile(&values, 0.95))
}

fn stops_to(goal: f64, value: f64) -> f32 {
    let stops = (goal / value).log2();
    if stops.is_finite() { stops.clamp(-40.0, 40.0) as f32 } else { 0.0 }
}

/// Mean over the channels of the difference of sRGB-encoded values in [0, 1]; NaN where a side is not finite.
pub fn encoded_difference(photo: &RgbImage, fit: &RgbImage, stops: f32) -> GreyImage {
    let gain = stops.exp2();
    let encoded = |pixel: Vec3| Vec3::from_array((pixel * gain).to_array().map(srgb_from_linear));
    let (width, height) = (photo.width().min(fit.width()), photo.height().min(fit.height()));
    Image::from_fn(width, height, |row, column| {
        let (photo, fit) = (photo[(row, column)], fit[(row, column)]);
        if photo.is_finite() && fit.is_finite() {
            (encoded(photo) - encoded(fit)).abs().element_sum() / 3.0
        } else {
            f32::NAN
        }
    })
}

/// False colour from black over violet and orange to pale yellow, dark to light so that it also reads in grey:
/// eight places of the map `inferno` (van der Walt and Smith 2015), joined by straight lines.
pub const RAMP: [[u8; 3]; 8] = [
    [0, 0, 4],
    [40, 11, 84],
    [101, 21, 110],
    [159, 42, 99],
    [212, 72, 66],
    [245, 125, 21],
    [250, 193, 39],
    [252, 255, 164],
];

/// The colour of a fraction in [0, 1] of the scale; larger ones take the last colour.
pub fn false_colour(fraction: f32) -> [u8; 3] {
    if fraction.is_nan() {
        return NOT_FINITE;
    }
    let place = fraction.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let low = (place as usize).min(RAMP.len() - 2);
    let part = place - low as f32;
    std::array::from_fn(|c| {
        let (from, to) = (f32::from(RAMP[low][c]), f32::from(RAMP[low + 1][c]));
        (from + (to - from) * part + 0.5) as u8
    })
}

/// The difference in false colour from 0 to `full_scale`; what does not count is grey.
pub fn screen_of_difference(difference: &GreyImage, counted: Option<&Image<bool>>, full_scale: f32) -> ScreenImage {
    Image::from_fn(difference.width(), difference.height(), |row, column| {
        let counts = counted.is_none_or(|mask| row < mask.height() && column < mask.width() && mask[(row, column)]);
        if counts { false_colour(difference[(row, column)] / full_scale) } else { NOT_COUNTED }
    })
}

/// A round end of scale that at least 98 % of the values stay below.
pub fn round_full_scale(values: &[f64]) -> f32 {
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let high = statistics::quantile(&finite, 0.98);
    [0.01f32, 0.02, 0.05, 0.1, 0.2, 0.5].into_iter().find(|&end| f64::from(end) >= high).unwrap_or(1.0)
}

/// An `<img>` element with the picture inside, as JPEG. An empty picture gives a note instead.
pub fn embedded_jpeg(image: &ScreenImage, quality: u8, alt: &str) -> String {
    embedded(image, "jpeg", || file::encode_jpeg(image, quality), alt, "")
}

/// An `<img>` element with the picture inside, as PNG; small pictures keep their hard texel borders.
pub fn embedded_png(image: &ScreenImage, alt: &str) -> String {
    let class = if image.width() <= 256 { " class=texels" } else { "" };
    embedded(image, "png", || file::encode_png_srgb8(image), alt, class)
}

fn embedded(
    image: &ScreenImage,
    kind: &str,
    encode: impl FnOnce() -> Result<Vec<u8>>,
    alt: &str,
    class: &str,
) -> String {
    match encode() {
        Ok(bytes) => format!(
            "<img{class} width={} height={} alt=\"{}\" src=\"data:image/{kind};base64,{}\">",
            image.width(),
            image.height(),
            escaped(alt),
            base64::engine::general_purpose::STANDARD.encode(bytes)
        ),
        // A picture that cannot be shown is no reason to lose the report.
        Err(error) => format!("<p class=empty>{}: {}</p>", escaped(alt), escaped(error.message())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinking_keeps_the_mean_and_the_shape() {
        let image = Image::from_fn(60, 40, |row, column| Vec3::new(row as f32, column as f32, 1.0));
        let small = shrunk(&image, 30);
        assert_eq!((small.width(), small.height()), (30, 20));
        let mean = |image: &RgbImage| image.pixels().iter().sum::<Vec3>() / image.pixels().len() as f32;
        assert!((mean(&image) - mean(&small)).length() < 1e-3);
        assert_eq!(shrunk(&image, 100), image);
        assert_eq!(shrunk(&Image::filled(1000, 1, Vec3::ONE), 10).height(), 1);
        assert_eq!(shrunk(&Image::filled(0, 0, Vec3::ONE), 10).width(), 0);
    }

    #[test]
    fn pixels_that_are_not_finite_are_marked_not_hidden() {
        let image = Image::from_pixels(3, 1, vec![Vec3::ONE, Vec3::NAN, Vec3::splat(f32::INFINITY)]);
        for screen in [screen_of_linear(&image, 0.0), screen_of_light(&image, 1.0)] {
            assert_eq!(&screen.pixels()[1..], &[NOT_FINITE, NOT_FINITE]);
        }
        let difference = encoded_difference(&image, &image, 0.0);
        let screen = screen_of_difference(&difference, None, 0.1);
        assert_eq!(screen.pixels(), &[RAMP[0], NOT_FINITE, NOT_FINITE]);
        assert_eq!(
            (stops_of_light(&image.map(|_| Vec3::ZERO)), stops_of_pictures([&image.map(|_| Vec3::NAN)])),
            (0.0, 0.0)
        );
    }

    #[test]
    fn exposure_brings_a_light_to_the_middle_and_the_ramp_grows_lighter() {
        let light = Image::filled(8, 4, Vec3::splat(4.0));
        assert!((stops_of_light(&light) + 3.0).abs() < 1e-4);
        assert_eq!(round_full_scale(&[0.03, f64::NAN]), 0.05);
        assert_eq!(round_full_scale(&[]), 1.0);
        let lightness = |colour: [u8; 3]| luminance(crate::image::transfer::linear_from_srgb8(colour));
        let steps: Vec<f32> = (0..=70).map(|i| lightness(false_colour(i as f32 / 70.0))).collect();
        assert!(steps.windows(2).all(|pair| pair[1] >= pair[0] - 1e-4), "{steps:?}");
    }
}
