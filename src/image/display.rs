//! From linear radiance to the colours of a screen: exposure, tone curve, false colour, clipping stripes.
//!
//! One definition for every picture that is shown or saved; the shader of the studio's stage repeats it, and a test
//! compares the two.

use super::transfer::srgb_from_linear;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// How values above what a screen can show are brought down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ToneCurve {
    /// Cut at 1, then sRGB: what an 8-bit photograph stores.
    #[default]
    Srgb,
    /// A filmic shoulder that keeps highlights apart (Narkowicz 2015, rational fit of the ACES curve), then sRGB.
    Filmic,
    /// Cut at 1, no curve: bytes in proportion to radiance.
    Linear,
}

impl ToneCurve {
    /// All curves with their names on screen.
    pub const NAMED: [(ToneCurve, &str); 3] =
        [(ToneCurve::Srgb, "sRGB"), (ToneCurve::Filmic, "Filmic"), (ToneCurve::Linear, "Linear")];

    /// Encodes an exposed linear value to [0, 1].
    pub fn encode(self, value: f32) -> f32 {
        let value = if value.is_finite() { value.max(0.0) } else { 0.0 };
        match self {
            ToneCurve::Srgb => srgb_from_linear(value.min(1.0)),
            ToneCurve::Filmic => {
                let value = value.min(1e4);
                let shoulder = value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14);
                srgb_from_linear(shoulder.clamp(0.0, 1.0))
            }
            ToneCurve::Linear => value.min(1.0),
        }
    }
}

/// How a linear picture is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct DisplaySettings {
    /// Radiance is scaled by two to this power.
    pub exposure_stops: f32,
    /// The tone curve.
    pub curve: ToneCurve,
    /// Shows luminance by a colour scale instead of colours.
    pub false_colour: bool,
    /// Marks clipped pixels: red stripes where a channel exceeds 1 after exposure, blue where all are 0 or below.
    pub stripes: bool,
}

/// Width of a clipping stripe and of the gap beside it, in pixels of the screen.
pub const STRIPE_PIXELS: u32 = 4;
/// Colour of the stripes on pixels that are too bright, sRGB in [0, 1].
pub const TOO_BRIGHT: Vec3 = Vec3::new(0.95, 0.15, 0.15);
/// Colour of the stripes on pixels that are black or below, sRGB in [0, 1].
pub const TOO_DARK: Vec3 = Vec3::new(0.2, 0.35, 1.0);
/// Colour of numbers that are not finite, sRGB in [0, 1].
pub const NOT_FINITE: Vec3 = Vec3::new(1.0, 0.0, 1.0);

/// Colour scale of false colours from 0 to 1: rises evenly in lightness, readable without seeing red or green
/// (values of the viridis scale, Smith and van der Walt 2015, at nine even places), sRGB in [0, 1].
pub const SCALE: [Vec3; 9] = [
    Vec3::new(0.267, 0.005, 0.329),
    Vec3::new(0.278, 0.175, 0.483),
    Vec3::new(0.230, 0.322, 0.546),
    Vec3::new(0.173, 0.449, 0.558),
    Vec3::new(0.128, 0.567, 0.551),
    Vec3::new(0.158, 0.684, 0.502),
    Vec3::new(0.369, 0.789, 0.383),
    Vec3::new(0.678, 0.864, 0.190),
    Vec3::new(0.993, 0.906, 0.144),
];

/// Colour of a value in [0, 1] on [`SCALE`]; values outside are clamped, NaN is [`NOT_FINITE`].
pub fn scale_colour(value: f32) -> Vec3 {
    if value.is_nan() {
        return NOT_FINITE;
    }
    let place = value.clamp(0.0, 1.0) * (SCALE.len() - 1) as f32;
    let below = (place as usize).min(SCALE.len() - 2);
    SCALE[below].lerp(SCALE[below + 1], place - below as f32)
}

impl DisplaySettings {
    /// Colour of a linear value at a pixel of the screen, sRGB in [0, 1].
    pub fn colour(&self, radiance: Vec3, screen_row: u32, screen_column: u32) -> Vec3 {
        if !radiance.is_finite() {
            return NOT_FINITE;
        }
        let exposed = radiance * self.exposure_stops.exp2();
        if self.stripes && (screen_row + screen_column) / STRIPE_PIXELS % 2 == 0 {
            if exposed.max_element() > 1.0 {
                return TOO_BRIGHT;
            }
            if exposed.max_element() <= 0.0 {
                return TOO_DARK;
            }
        }
        if self.false_colour {
            return scale_colour(crate::math::luminance(exposed));
        }
        Vec3::new(self.curve.encode(exposed.x), self.curve.encode(exposed.y), self.curve.encode(exposed.z))
    }

    /// [`DisplaySettings::colour`] in bytes.
    pub fn bytes(&self, radiance: Vec3, screen_row: u32, screen_column: u32) -> [u8; 3] {
        (self.colour(radiance, screen_row, screen_column) * 255.0 + 0.5).to_array().map(|value| value as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_anything_special_a_picture_is_its_srgb_bytes() {
        let display = DisplaySettings::default();
        for byte in 0..=255u8 {
            let linear = crate::image::transfer::linear_from_srgb8([byte; 3]);
            assert_eq!(display.bytes(linear, 3, 5), [byte; 3]);
        }
        assert_eq!(display.bytes(Vec3::splat(7.0), 0, 0), [255; 3]);
    }

    #[test]
    fn curves_rise_stay_in_range_and_bear_any_number() {
        for (curve, name) in ToneCurve::NAMED {
            let mut before = -1.0;
            for step in 0..400 {
                let value = curve.encode(10f32.powf(step as f32 / 40.0 - 5.0));
                assert!((0.0..=1.0).contains(&value) && value >= before, "{name}");
                before = value;
            }
            for hard in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX, f32::MIN_POSITIVE] {
                assert!((0.0..=1.0).contains(&curve.encode(hard)), "{name} {hard}");
            }
        }
    }

    #[test]
    fn one_stop_doubles_and_stripes_mark_what_is_cut() {
        let one_stop = DisplaySettings { exposure_stops: 1.0, curve: ToneCurve::Linear, ..Default::default() };
        assert_eq!(one_stop.colour(Vec3::splat(0.25), 0, 0), Vec3::splat(0.5));
        let stripes = DisplaySettings { stripes: true, ..Default::default() };
        assert_eq!(stripes.colour(Vec3::new(2.0, 0.1, 0.1), 0, 0), TOO_BRIGHT);
        assert_eq!(stripes.colour(Vec3::ZERO, 0, 0), TOO_DARK);
        assert_ne!(stripes.colour(Vec3::ZERO, 0, STRIPE_PIXELS), TOO_DARK);
        assert_eq!(stripes.colour(Vec3::NAN, 0, 0), NOT_FINITE);
    }

    #[test]
    fn the_colour_scale_rises_in_lightness_and_ends_where_it_should() {
        assert_eq!(scale_colour(-3.0), SCALE[0]);
        assert_eq!(scale_colour(9.0), SCALE[8]);
        assert_eq!(scale_colour(f32::NAN), NOT_FINITE);
        let lightness = |value: f32| crate::math::luminance(scale_colour(value));
        assert!((0..100).all(|step| lightness(step as f32 / 100.0) < lightness((step + 1) as f32 / 100.0)));
    }
}
