//! From numbers to colours and back to words: ranges, colour scales, ticks, three digits.

use super::display::{NOT_FINITE, scale_colour};
use super::raster::GreyImage;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The range of numbers that a colour scale spans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValueScale {
    /// The number at the low end.
    pub low: f32,
    /// The number at the high end.
    pub high: f32,
    /// Equal factors take equal lengths, instead of equal differences; needs numbers above 0 at both ends.
    pub logarithmic: bool,
}

impl Default for ValueScale {
    fn default() -> Self {
        ValueScale::linear(0.0, 1.0)
    }
}

impl ValueScale {
    /// Equal differences from `low` to `high`.
    pub const fn linear(low: f32, high: f32) -> Self {
        ValueScale { low, high, logarithmic: false }
    }

    /// Equal factors from `low` to `high`, both above 0.
    pub const fn logarithmic(low: f32, high: f32) -> Self {
        ValueScale { low, high, logarithmic: true }
    }

    /// From the smallest to the largest finite number of an image; 0 to 1 when it has none.
    pub fn of(image: &GreyImage) -> Self {
        let finite = || image.pixels().iter().copied().filter(|value| value.is_finite());
        let (low, high) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
        if low <= high { ValueScale::linear(low, high) } else { ValueScale::default() }
    }

    /// Whether lengths go by factors: asked for, and possible.
    fn by_factors(&self) -> bool {
        self.logarithmic && self.low > 0.0 && self.high > 0.0
    }

    /// Where a number lies: 0 at the low end, 1 at the high end, beyond them outside. NaN stays NaN; everything else
    /// lies at one half of a range without length.
    pub fn place(&self, value: f32) -> f32 {
        if value.is_nan() {
            return value;
        }
        let (value, low, high) = (f64::from(value), f64::from(self.low), f64::from(self.high));
        let place = match self.by_factors() {
            true if value <= 0.0 => f64::NEG_INFINITY,
            true => (value / low).ln() / (high / low).ln(),
            false => (value - low) / (high - low),
        };
        if place.is_nan() || low == high { 0.5 } else { place as f32 }
    }

    /// The number at a place in [0, 1].
    pub fn value_at(&self, place: f32) -> f32 {
        let (low, high) = (f64::from(self.low), f64::from(self.high));
        let place = f64::from(place);
        (if self.by_factors() { low * (high / low).powf(place) } else { low + (high - low) * place }) as f32
    }

    /// Round numbers within the range with their words, at most `most` of them, in rising order.
    pub fn ticks(&self, most: usize) -> Vec<(f32, String)> {
        let (low, high) = (f64::from(self.low.min(self.high)), f64::from(self.low.max(self.high)));
        if most == 0 || !self.low.is_finite() || !self.high.is_finite() {
            return Vec::new();
        }
        if low == high {
            return vec![(self.low, three_digits(self.low))];
        }
        let ticks = if self.by_factors() { ticks_by_factors(low, high, most) } else { Vec::new() };
        // A short range by factors has no two round factors in it.
        if ticks.len() >= 2 { ticks } else { ticks_by_differences(low, high, most) }
    }
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten.
fn ticks_by_differences(low: f64, high: f64, most: usize) -> Vec<(f32, String)> {
    let power = ((high - low) / most as f64).log10().floor() as i32;
    let steps = (power..power + 3).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| (digit * 10f64.powi(power), power)));
    let inside = |step: f64| ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    for (step, power) in steps {
        let (first, last) = inside(step);
        if !(last - first + 1.0 <= most as f64) {
            continue;
        }
        let word = |value: f64| match power {
            -6..=5 => format!("{value:.*}", (-power).max(0) as usize),
            _ => three_digits(value as f32),
        };
        let count = (last - first + 1.0).max(0.0) as usize;
        // Adding 0 turns a negative zero into zero.
        let values = (0..count).map(|index| (first + index as f64) * step + 0.0);
        return values.map(|value| (value as f32, word(value))).collect();
    }
    Vec::new()
}

/// Ticks at powers of ten, with 2 and 5 between them where there is room, or only every few powers.
fn ticks_by_factors(low: f64, high: f64, most: usize) -> Vec<(f32, String)> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let sets: [(&[f64], usize); 7] =
        [(&[1.0, 2.0, 5.0], 1), (&[1.0, 3.0], 1), (&[1.0], 1), (&[1.0], 2), (&[1.0], 3), (&[1.0], 6), (&[1.0], 12)];
    for (digits, every) in sets {
        let powers = (first..=last).filter(|power| power.rem_euclid(every as i32) == 0);
        let values = powers.flat_map(|power| digits.iter().map(move |digit| digit * 10f64.powi(power)));
        let ticks: Vec<f64> =
            values.filter(|value| (low * (1.0 - 1e-6)..=high * (1.0 + 1e-6)).contains(value)).collect();
        if ticks.len() <= most {
            return ticks.into_iter().map(|value| (value as f32, plain(value as f32))).collect();
        }
    }
    Vec::new()
}

/// A round number without trailing zeros.
fn plain(value: f32) -> String {
    if (1e-3..1e5).contains(&value) { format!("{value}") } else { format!("{value:e}") }
}

/// A number in three significant digits and at most eight characters: `0.0123`, `1.23`, `123`, `1.23e5`, `inf`.
pub fn three_digits(value: f32) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    if value.is_nan() {
        return "nan".into();
    }
    if size.is_infinite() {
        return if value > 0.0 { "inf" } else { "-inf" }.into();
    }
    if !(1e-3..99_950.0).contains(&size) {
        return format!("{value:.2e}");
    }
    // Rounding may add a digit before the point: 0.9996 is 1.00.
    let rounded: f32 = format!("{size:.2e}").parse().unwrap_or(size);
    let decimals = (2 - rounded.log10().floor() as i32).max(0) as usize;
    if decimals == 0 { format!("{:.0}", rounded.copysign(value)) } else { format!("{value:.decimals$}") }
}

/// Which colours a scale runs through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Palette {
    /// The colour scale of false colours, [`super::display::SCALE`].
    #[default]
    Scale,
    /// Black to white, bytes in proportion.
    Grey,
    /// Blue over light grey to red: for numbers with a meaning in the middle of the range.
    Diverging,
}

impl Palette {
    /// sRGB colour in [0, 1] of a place in [0, 1]; places outside are clamped, NaN is [`NOT_FINITE`].
    pub fn colour(self, place: f32) -> Vec3 {
        if place.is_nan() {
            return NOT_FINITE;
        }
        let place = place.clamp(0.0, 1.0);
        match self {
            Palette::Scale => scale_colour(place),
            Palette::Grey => Vec3::splat(place),
            Palette::Diverging => {
                let (cold, middle, warm) =
                    (Vec3::new(0.13, 0.33, 0.67), Vec3::splat(0.90), Vec3::new(0.72, 0.16, 0.12));
                if place < 0.5 { cold.lerp(middle, 2.0 * place) } else { middle.lerp(warm, 2.0 * place - 1.0) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_values_invert_on_both_scales() {
        for scale in [ValueScale::linear(-2.0, 6.0), ValueScale::logarithmic(1e-3, 1e2), ValueScale::linear(3.0, 1.0)] {
            for step in 0..=10 {
                let place = step as f32 / 10.0;
                assert!((scale.place(scale.value_at(place)) - place).abs() < 1e-5, "{scale:?} {place}");
            }
        }
        let log = ValueScale::logarithmic(0.1, 10.0);
        assert!(log.place(-1.0) < 0.0 && log.place(f32::INFINITY) > 1.0 && log.place(f32::NAN).is_nan());
        assert_eq!(ValueScale::linear(2.0, 2.0).place(5.0), 0.5);
        // Asked for factors of a range with zero, it goes by differences.
        assert_eq!(ValueScale::logarithmic(0.0, 2.0).place(1.0), 0.5);
        let image = GreyImage::from_pixels(4, 1, vec![f32::NAN, 3.0, -1.0, f32::INFINITY]);
        assert_eq!(ValueScale::of(&image), ValueScale::linear(-1.0, 3.0));
    }

    #[test]
    fn ticks_are_round_within_the_range_and_few() {
        let words = |scale: ValueScale, most| {
            let ticks = scale.ticks(most);
            assert!(ticks.len() <= most && ticks.windows(2).all(|pair| pair[0].0 < pair[1].0), "{ticks:?}");
            ticks.into_iter().map(|(_, word)| word).collect::<Vec<_>>()
        };
        assert_eq!(words(ValueScale::linear(0.0, 1.0), 6), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(words(ValueScale::linear(-1.0, 1.0), 5), ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(words(ValueScale::linear(0.0, 300.0), 4), ["0", "100", "200", "300"]);
        assert_eq!(words(ValueScale::logarithmic(0.001, 10.0), 5), ["0.001", "0.01", "0.1", "1", "10"]);
        assert_eq!(words(ValueScale::logarithmic(1.0, 10.0), 5), ["1", "2", "5", "10"]);
        assert!(words(ValueScale::logarithmic(1e-20, 1e20), 5).len() >= 2);
        assert_eq!(words(ValueScale::linear(5.0, 5.0), 5), ["5.00"]);
        assert!(words(ValueScale::linear(f32::NAN, 1.0), 5).is_empty());
        assert!(words(ValueScale::linear(0.0, f32::INFINITY), 5).is_empty());
        for most in 0..20 {
            words(ValueScale::linear(f32::MIN, f32::MAX), most);
            words(ValueScale::linear(0.3, 0.300_01), most);
        }
    }

    #[test]
    fn numbers_take_three_digits_and_little_room() {
        for (value, word) in [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (-1.234, "-1.23"),
            (0.999_6, "1.00"),
            (9.996, "10.0"),
            (123.4, "123"),
            (12_345.0, "12300"),
            (123_456.0, "1.23e5"),
            (0.000_123, "1.23e-4"),
            (f32::INFINITY, "inf"),
            (f32::NEG_INFINITY, "-inf"),
            (f32::NAN, "nan"),
        ] {
            assert_eq!(three_digits(value), word);
        }
        for exponent in -45..39 {
            assert!(three_digits(-9.876 * 10f32.powi(exponent)).len() <= 9);
        }
    }

    #[test]
    fn every_palette_stays_in_range_and_marks_what_is_no_number() {
        for palette in [Palette::Scale, Palette::Grey, Palette::Diverging] {
            for place in [-1.0, 0.0, 0.3, 0.5, 1.0, 7.0, f32::INFINITY] {
                let colour = palette.colour(place);
                assert!(colour.min_element() >= 0.0 && colour.max_element() <= 1.0);
            }
            assert_eq!(palette.colour(f32::NAN), NOT_FINITE);
        }
    }
}
