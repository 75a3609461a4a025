//! From linear radiance to the colours of a screen: exposure, tone curve, false colour, clipping stripes.
//!
//! One definition for every picture that is shown or saved; the shader of the studio's stage repeats it, and a test
//! compares the two. [`DisplaySettings::colour`] says what a pixel looks like; [`PreparedDisplay`] gives the same bytes
//! for millions of them, by table.

use super::transfer::srgb_from_linear;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// How values above what a screen can show are brought down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
        // NaN becomes 0; what overflowed by its exposure stays bright.
        let value = value.max(0.0);
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
        self.marked(exposed, screen_row, screen_column).unwrap_or_else(|| {
            Vec3::new(self.curve.encode(exposed.x), self.curve.encode(exposed.y), self.curve.encode(exposed.z))
        })
    }

    /// The colour of an exposed value that is not shown by the tone curve: a stripe or a false colour.
    #[inline]
    fn marked(&self, exposed: Vec3, screen_row: u32, screen_column: u32) -> Option<Vec3> {
        if self.stripes && ((screen_row + screen_column) / STRIPE_PIXELS).is_multiple_of(2) {
            if exposed.max_element() > 1.0 {
                return Some(TOO_BRIGHT);
            }
            if exposed.max_element() <= 0.0 {
                return Some(TOO_DARK);
            }
        }
        self.false_colour.then(|| scale_colour(crate::math::luminance(exposed)))
    }

    /// [`DisplaySettings::colour`] in bytes.
    pub fn bytes(&self, radiance: Vec3, screen_row: u32, screen_column: u32) -> [u8; 3] {
        bytes_of_colour(self.colour(radiance, screen_row, screen_column))
    }

    /// The same display, ready for millions of pixels.
    pub fn prepared(&self) -> PreparedDisplay {
        PreparedDisplay {
            settings: *self,
            gain: self.exposure_stops.exp2(),
            table: ByteTable::of(self.curve),
            linear: ByteTable::of(ToneCurve::Srgb),
        }
    }
}

/// The bytes nearest to an sRGB colour in [0, 1].
#[inline]
pub fn bytes_of_colour(colour: Vec3) -> [u8; 3] {
    (colour * 255.0 + 0.5).to_array().map(|value| value as u8)
}

/// [`DisplaySettings`] with its curve as a table: the bytes of [`DisplaySettings::bytes`] without a power per channel.
#[derive(Clone, Copy, Debug)]
pub struct PreparedDisplay {
    settings: DisplaySettings,
    gain: f32,
    table: &'static ByteTable,
    linear: &'static ByteTable,
}

impl PreparedDisplay {
    /// The bytes of a linear value at a pixel of the screen, as [`DisplaySettings::bytes`].
    #[inline]
    pub fn bytes(&self, radiance: Vec3, screen_row: u32, screen_column: u32) -> [u8; 3] {
        if !radiance.is_finite() {
            return bytes_of_colour(NOT_FINITE);
        }
        let exposed = radiance * self.gain;
        match self.settings.marked(exposed, screen_row, screen_column) {
            Some(colour) => bytes_of_colour(colour),
            None => exposed.to_array().map(|value| self.table.byte(value)),
        }
    }

    /// The bytes of a difference of luminances: green where it is positive, red where it is negative, black at 0,
    /// brightness by exposure and the sRGB curve.
    #[inline]
    pub fn signed_bytes(&self, difference: f32) -> [u8; 3] {
        if difference.is_nan() {
            return bytes_of_colour(NOT_FINITE);
        }
        let strength = self.linear.byte(difference.abs() * self.gain);
        match difference > 0.0 {
            true => [strength / 8, strength, strength / 3],
            false => [strength, strength / 5, strength / 8],
        }
    }
}

/// Lowest value in the table; every curve shows it as black.
const TABLE_LOW: f32 = 1.0 / 8192.0;
/// From here on every curve is white.
const TABLE_HIGH: f32 = 8.0;
/// Bits of a mantissa that are dropped: 256 buckets a stop, of which each holds the threshold of one byte at most.
const BUCKET_SHIFT: u32 = 15;

/// From linear values to bytes: the values at which the byte steps up, and where to look among them.
#[derive(Debug)]
struct ByteTable {
    /// The smallest value of each byte; that of byte 0 is unused, the last is infinite.
    threshold: [f32; 257],
    /// The byte at the lower edge of each bucket.
    first: Vec<u8>,
}

impl ByteTable {
    fn of(curve: ToneCurve) -> &'static ByteTable {
        static TABLES: std::sync::LazyLock<[ByteTable; 3]> =
            std::sync::LazyLock::new(|| ToneCurve::NAMED.map(|(curve, _)| ByteTable::new(curve)));
        &TABLES[match curve {
            ToneCurve::Srgb => 0,
            ToneCurve::Filmic => 1,
            ToneCurve::Linear => 2,
        }]
    }

    fn new(curve: ToneCurve) -> Self {
        let exact = |value: f32| (curve.encode(value) * 255.0 + 0.5) as u8;
        let mut threshold = [f32::INFINITY; 257];
        for byte in 1..=255u8 {
            // Positive floats are ordered as their bits are.
            let (mut below, mut above) = (0, TABLE_HIGH.to_bits());
            while above - below > 1 {
                let middle = below + (above - below) / 2;
                if exact(f32::from_bits(middle)) >= byte { above = middle } else { below = middle }
            }
            threshold[byte as usize] = f32::from_bits(above);
        }
        let buckets = (TABLE_HIGH.to_bits() - TABLE_LOW.to_bits()) >> BUCKET_SHIFT;
        let edge = |bucket: u32| f32::from_bits(TABLE_LOW.to_bits() + (bucket << BUCKET_SHIFT));
        ByteTable { threshold, first: (0..buckets).map(|bucket| exact(edge(bucket))).collect() }
    }

    #[inline]
    fn byte(&self, value: f32) -> u8 {
        // NaN is not above anything either.
        if !(value >= TABLE_LOW) {
            return 0;
        }
        if value >= TABLE_HIGH {
            return 255;
        }
        let first = self.first[((value.to_bits() - TABLE_LOW.to_bits()) >> BUCKET_SHIFT) as usize];
        first + u8::from(value >= self.threshold[first as usize + 1])
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
    fn the_table_gives_the_bytes_of_the_exact_curve() {
        for (curve, name) in ToneCurve::NAMED {
            for exposure_stops in [0.0, -3.0, 2.5] {
                let display = DisplaySettings { exposure_stops, curve, ..Default::default() };
                let prepared = display.prepared();
                for step in 0..60_000u32 {
                    let value = 2f32.powf(step as f32 / 2500.0 - 16.0);
                    let exact = display.colour(Vec3::splat(value), 0, 0).x * 255.0;
                    let [byte, ..] = prepared.bytes(Vec3::splat(value), 0, 0);
                    assert!((f32::from(byte) - exact).abs() <= 0.5 + 1e-3, "{name} {value}: {byte} {exact}");
                }
                for hard in [0.0, -1.0, 1.0, 8.0, f32::MIN_POSITIVE, f32::MAX, f32::NAN, f32::INFINITY] {
                    let rgb = Vec3::new(hard, 0.3, 0.1);
                    assert_eq!(prepared.bytes(rgb, 0, 0), display.bytes(rgb, 0, 0), "{name} {hard}");
                }
            }
        }
        let marked = DisplaySettings { stripes: true, false_colour: true, ..Default::default() };
        for (step, rgb) in [Vec3::ZERO, Vec3::splat(0.4), Vec3::splat(3.0), Vec3::NAN].into_iter().enumerate() {
            for column in 0..9 {
                let place = (step as u32, column);
                assert_eq!(marked.prepared().bytes(rgb, place.0, place.1), marked.bytes(rgb, place.0, place.1));
            }
        }
    }

    #[test]
    fn what_overflows_is_white_and_differences_have_a_sign() {
        let bright = DisplaySettings { exposure_stops: 20.0, ..Default::default() };
        assert_eq!(bright.bytes(Vec3::splat(1e38), 0, 0), [255; 3]);
        let display = DisplaySettings::default().prepared();
        let [red, green, _] = display.signed_bytes(0.5);
        assert!(green > 100 && green > 2 * red);
        let [red, green, _] = display.signed_bytes(-0.5);
        assert!(red > 100 && red > 2 * green);
        assert_eq!(display.signed_bytes(0.0), [0; 3]);
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
