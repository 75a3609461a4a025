//! Bars as a picture, for where an SVG cannot be shown.

use crate::image::Image;
use crate::insight::label::{self, ADVANCE, HEIGHT};

/// Each pixel of labels and bars becomes so many a side.
const ENLARGED: usize = 2;
/// Pixels from one bar to the next, before they are enlarged.
const PITCH: usize = 14;
/// Pixels of the longest bar.
const LONGEST: usize = 220;
/// Pixels around everything.
const MARGIN: usize = 8;

const GROUND: [u8; 3] = [252, 252, 250];
const INK: [u8; 3] = [35, 39, 43];
const BAR: [u8; 3] = [92, 138, 168];
const MARK: [u8; 3] = [176, 74, 42];

/// One bar.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureBar {
    /// Text at its left; letters become capitals.
    pub label: String,
    /// Its length, at least 0.
    pub value: f64,
    /// Where a tick stands.
    pub mark: Option<f64>,
}

/// Horizontal bars from 0, one below the other, each with its label and its value. Values that are not finite have no
/// bar, and say so.
pub fn bars(title: &str, bars: &[PictureBar]) -> Image<[u8; 3]> {
    let longest_label = bars.iter().map(|bar| bar.label.chars().count()).max().unwrap_or(0);
    let finite = |value: f64| Some(value).filter(|value| value.is_finite() && *value >= 0.0);
    let values = bars.iter().flat_map(|bar| [finite(bar.value), bar.mark.and_then(finite)]).flatten();
    let largest = values.fold(0.0, f64::max).max(1e-300);
    let left = MARGIN + longest_label * ADVANCE + 4;
    let width = (left + LONGEST + 10 * ADVANCE + MARGIN).max(2 * MARGIN + title.chars().count() * ADVANCE);
    let top = MARGIN + PITCH;
    let mut picture = Image::filled(width, top + bars.len() * PITCH + MARGIN, GROUND);
    label::draw(&mut picture, MARGIN, MARGIN, title, INK);
    let place = |value: f64| (value / largest * LONGEST as f64).round() as usize;
    for (index, bar) in bars.iter().enumerate() {
        let row = top + index * PITCH;
        let own = bar.label.chars().count() * ADVANCE;
        label::draw(&mut picture, row + 1, left - 4 - own, &bar.label, INK);
        let length = finite(bar.value).map_or(0, place);
        for y in row..row + HEIGHT + 2 {
            (left..left + length).for_each(|x| picture[(y, x)] = BAR);
        }
        if let Some(mark) = bar.mark.and_then(finite) {
            for y in row - 1..row + HEIGHT + 3 {
                picture[(y, left + place(mark))] = MARK;
            }
        }
        let end = length.max(bar.mark.and_then(finite).map_or(0, place));
        let text = if bar.value.is_finite() { format!("{:.3}", bar.value) } else { "NONE".into() };
        label::draw(&mut picture, row + 1, left + end + 5, &text, INK);
    }
    Image::from_fn(picture.width() * ENLARGED, picture.height() * ENLARGED, |row, column| {
        picture[(row / ENLARGED, column / ENLARGED)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_their_values() {
        let bar = |value: f64| PictureBar { label: "A".into(), value, mark: Some(0.5 * value) };
        let picture = bars("T", &[bar(1.0), bar(0.25), bar(f64::NAN)]);
        let painted = |index: usize| {
            let row = ENLARGED * (MARGIN + PITCH + index * PITCH);
            (0..picture.width()).filter(|&column| [BAR, MARK].contains(&picture[(row, column)])).count()
        };
        assert_eq!([painted(0), painted(1), painted(2)], [ENLARGED * LONGEST, ENLARGED * LONGEST / 4, 0]);
    }
}
