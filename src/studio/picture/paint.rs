//! The pixels of a panel, made on the CPU at the resolution of the screen.
//!
//! Enlarged, a pixel shows the texel under its centre; made smaller, the mean of linear values over the area it
//! covers. Only the visible part is computed. A texel without a value is hatched.

use super::levels::Levels;
use super::lines;
use super::overlay::{Compare, Lines};
use super::rows::{Layer, Mask, Row};
use super::source::{Source, Value};
use super::view::{Frame, PixelRect};
use crate::image::Image;
use crate::image::display::{DisplaySettings, PreparedDisplay, bytes_of_colour};
use crate::math::{luminance, parallel};
use eframe::egui::{Color32, ColorImage};
use glam::Vec3;
use std::sync::Arc;

/// Colours of the hatch over texels without a value, and of masks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inks {
    /// Ground of what has no value.
    pub ground: Color32,
    /// Hatch lines of what has no value.
    pub hatch: Color32,
    /// Hatch lines of masks.
    pub mask: Color32,
    /// Distance of hatch lines in screen pixels, at least 4.
    pub period: u32,
    /// Width of hatch lines in screen pixels, at least 1; lines over the picture are half as wide again.
    pub line: u32,
}

/// What is to be painted.
#[derive(Clone, Debug)]
pub struct Painting<'a> {
    /// The picture and its levels.
    pub source: (&'a Source, &'a Levels),
    /// The picture to compare with, and how.
    pub other: Option<(&'a Source, &'a Levels, Compare)>,
    /// Texels to hatch.
    pub mask: Option<&'a Image<bool>>,
    /// Lines to draw.
    pub lines: &'a [Lines],
    /// Where the picture lies.
    pub frame: Frame,
    /// How values become colours.
    pub display: DisplaySettings,
    /// Colours of hatches.
    pub inks: Inks,
}

impl Painting<'_> {
    /// The pixels of the visible part of the frame.
    pub fn pixels(&self) -> ColorImage {
        let visible = self.frame.visible();
        let mut image = ColorImage::filled([visible.width, visible.height], Color32::BLACK);
        if visible.width == 0 || visible.height == 0 {
            return image;
        }
        let first = Layer::new(self.source.0, self.source.1, &self.frame);
        let second = self.other.as_ref().map(|(other, levels, _)| Layer::new(other, levels, &self.frame));
        let compare = self.other.as_ref().map(|(_, _, compare)| *compare);
        let (mode, split) = match compare {
            None | Some(Compare::Flip(false)) => (Mode::First, 0),
            Some(Compare::Flip(true)) => (Mode::Second, 0),
            Some(Compare::Blend(opacity)) => (Mode::Blend { opacity: opacity.clamp(0.0, 1.0) }, 0),
            Some(Compare::Wipe(place)) => (Mode::Wipe, divider(place, visible) - visible.left),
            Some(Compare::Difference { signed, .. }) => (Mode::Difference { signed }, 0),
        };
        let mut display = self.display;
        if let Some(Compare::Difference { gain_stops, .. }) = compare {
            display = DisplaySettings { exposure_stops: display.exposure_stops + gain_stops, ..display };
        }
        let shade = Shade { display: display.prepared(), inks: self.inks, visible };
        let mask = self.mask.filter(|mask| !mask.pixels().is_empty()).map(|mask| Mask::new(mask, &self.frame));
        parallel::each_chunk(&mut image.pixels, visible.width, &|y, pixels| {
            let first = first.row(y);
            let second = second.as_ref().map(|second| second.row(y));
            for (x, pixel) in pixels.iter_mut().enumerate() {
                *pixel = match (&mode, &second) {
                    (Mode::Second, Some(second)) => shade.value(second, y, x),
                    (Mode::Blend { opacity }, Some(second)) => {
                        shade.value(&first, y, x).lerp_to_gamma(shade.value(second, y, x), *opacity)
                    }
                    (Mode::Wipe, Some(second)) if x >= split => shade.value(second, y, x),
                    (Mode::Difference { signed }, Some(second)) => shade.difference(&first, second, *signed, y, x),
                    _ => shade.value(&first, y, x),
                };
            }
            if let Some(mask) = &mask {
                for (x, pixel) in pixels.iter_mut().enumerate().filter(|(x, _)| mask.at(y, *x)) {
                    *pixel = shade.masked(*pixel, y, x);
                }
            }
        });
        lines::draw(&mut image, self.lines, &self.frame, 1.5 * self.inks.line as f32);
        image
    }
}

/// The first screen column of the panel right of a divider at a place in [0, 1] of the visible part.
pub fn divider(place: f32, visible: PixelRect) -> usize {
    let place = if place.is_finite() { place.clamp(0.0, 1.0) } else { 0.5 };
    visible.left + (place * visible.width as f32).round() as usize
}

enum Mode {
    First,
    Second,
    Blend { opacity: f32 },
    Wipe,
    Difference { signed: bool },
}

struct Shade {
    display: PreparedDisplay,
    inks: Inks,
    visible: PixelRect,
}

impl Shade {
    /// Row and column on the panel: stripes and hatches stay where they are while a picture moves under them.
    fn on_panel(&self, y: usize, x: usize) -> (u32, u32) {
        ((y + self.visible.top) as u32, (x + self.visible.left) as u32)
    }

    #[inline]
    fn value(&self, values: &Row, y: usize, x: usize) -> Color32 {
        let value = values.at(x);
        let (row, column) = self.on_panel(y, x);
        let [red, green, blue] = match (value, values) {
            (value, _) if value.is_unseen() => return self.unseen(row, column),
            (Value::Number(number), Row::Numbers(_, Source::Numbers { scale, palette, .. })) => {
                bytes_of_colour(palette.colour(scale.place(number)))
            }
            (value, _) => self.display.bytes(value.rgb(), row, column),
        };
        Color32::from_rgb(red, green, blue)
    }

    #[inline]
    fn difference(&self, first: &Row, second: &Row, signed: bool, y: usize, x: usize) -> Color32 {
        let difference = first.at(x).rgb() - second.at(x).rgb();
        let (row, column) = self.on_panel(y, x);
        if difference.is_nan() {
            return self.unseen(row, column);
        }
        let [red, green, blue] = match signed {
            true => self.display.signed_bytes(luminance(difference)),
            false => self.display.bytes(difference.abs(), row, column),
        };
        Color32::from_rgb(red, green, blue)
    }

    fn unseen(&self, row: u32, column: u32) -> Color32 {
        let period = self.inks.period.max(4);
        if (row + column) % period < self.inks.line.max(1) { self.inks.hatch } else { self.inks.ground }
    }

    fn masked(&self, colour: Color32, y: usize, x: usize) -> Color32 {
        let (row, column) = self.on_panel(y, x);
        let period = self.inks.period.max(4);
        // Leaning the other way than the hatch of what has no value.
        let on_line = (row + period - column % period) % period < 2 * self.inks.line.max(1);
        if on_line { colour.lerp_to_gamma(self.inks.mask, 0.8) } else { colour.lerp_to_gamma(self.inks.mask, 0.15) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::view::PictureView;
    use super::*;
    use crate::image::value_scale::ValueScale;

    const INKS: Inks = Inks {
        ground: Color32::from_rgb(10, 20, 30),
        hatch: Color32::from_rgb(40, 50, 60),
        mask: Color32::from_rgb(250, 180, 0),
        period: 8,
        line: 1,
    };

    fn picture(width: usize, height: usize, pixel: impl FnMut(usize, usize) -> Vec3) -> Source {
        Source::Colour(Arc::new(Image::from_fn(width, height, pixel)))
    }

    fn paint(source: &Source, panel: (usize, usize), other: Option<(&Source, Compare)>) -> ColorImage {
        let levels = Levels::of(source);
        let other_levels = other.map(|(other, _)| Levels::of(other));
        let other = other.zip(other_levels.as_ref()).map(|((other, compare), levels)| (other, levels, compare));
        let frame = PictureView::default().frame(source.size(), panel);
        let display = DisplaySettings::default();
        Painting { source: (source, &levels), other, mask: None, lines: &[], frame, display, inks: INKS }.pixels()
    }

    #[test]
    fn enlarged_texels_are_sharp_and_small_ones_are_means_of_light() {
        let checker = picture(4, 4, |row, column| Vec3::splat(((row + column) % 2) as f32));
        let large = paint(&checker, (32, 32), None);
        for (index, pixel) in large.pixels.iter().enumerate() {
            let expected = if (index / 32 / 8 + index % 32 / 8) % 2 == 1 { 255 } else { 0 };
            assert_eq!(*pixel, Color32::from_gray(expected));
        }
        // One half of linear light is byte 188.
        let small = paint(&checker, (2, 2), None);
        assert!(small.pixels.iter().all(|&pixel| pixel == Color32::from_gray(188)), "{:?}", small.pixels);
        let odd = picture(30, 30, |row, column| Vec3::splat(((row + column) % 2) as f32));
        let odd = paint(&odd, (7, 7), None);
        assert!(odd.pixels.iter().all(|pixel| pixel.r().abs_diff(188) < 12), "{:?}", odd.pixels);
    }

    #[test]
    fn a_texel_without_a_value_is_hatched_and_darkens_no_neighbour() {
        let holes = picture(8, 8, |_, column| if column < 4 { Vec3::NAN } else { Vec3::splat(0.5) });
        let grey = Color32::from_gray(188);
        for panel in [(8, 8), (64, 64), (4, 4), (3, 3)] {
            let image = paint(&holes, panel, None);
            let width = image.size[0];
            for (index, pixel) in image.pixels.iter().enumerate() {
                let left = (index % width + 1) * 8 <= 4 * width;
                let expected = if left { [INKS.ground, INKS.hatch] } else { [grey, grey] };
                assert!(expected.contains(pixel), "{panel:?} {index}: {pixel:?}");
            }
        }
    }

    #[test]
    fn comparisons_show_what_they_promise() {
        let (first, second) = (picture(10, 4, |_, _| Vec3::splat(0.5)), picture(20, 8, |_, _| Vec3::splat(0.2)));
        let bytes = |compare| paint(&first, (100, 40), Some((&second, compare))).pixels;
        let byte = |value: f32| crate::image::transfer::srgb8_from_linear_value(value);
        let wipe = bytes(Compare::Wipe(0.25));
        assert_eq!([wipe[24].r(), wipe[25].r()], [byte(0.5), byte(0.2)]);
        assert!(bytes(Compare::Flip(true)).iter().all(|pixel| pixel.r() == byte(0.2)));
        assert_eq!(bytes(Compare::Blend(0.0)), bytes(Compare::Flip(false)));
        assert_eq!(bytes(Compare::Blend(1.0)), bytes(Compare::Flip(true)));
        let half = bytes(Compare::Blend(0.5))[0].r();
        assert!((byte(0.2)..byte(0.5)).contains(&half) && half > byte(0.2), "{half}");
        assert!(bytes(Compare::Flip(false)).iter().all(|pixel| pixel.r() == byte(0.5)));
        let difference = bytes(Compare::Difference { signed: false, gain_stops: 1.0 });
        assert!(difference.iter().all(|pixel| pixel.r().abs_diff(byte(0.6)) <= 1));
        let signed = bytes(Compare::Difference { signed: true, gain_stops: 0.0 });
        assert!(signed.iter().all(|pixel| pixel.g().abs_diff(byte(0.3)) <= 1 && pixel.r() < pixel.g() / 2));
        for place in [f32::NAN, -3.0, 9.0] {
            bytes(Compare::Wipe(place));
        }
    }

    #[test]
    fn numbers_take_their_colours_whatever_the_exposure() {
        let image = Arc::new(Image::from_pixels(3, 1, vec![0.0, 5.0, f32::INFINITY]));
        let source = Source::numbers(image, ValueScale::linear(0.0, 10.0));
        let pixels = paint(&source, (3, 1), None).pixels;
        let expected = [0.0, 0.5, 1.0].map(|place| bytes_of_colour(crate::image::display::scale_colour(place)));
        assert_eq!(pixels, expected.map(|[red, green, blue]| Color32::from_rgb(red, green, blue)));
    }

    #[test]
    fn a_mask_is_hatched_where_it_is_true() {
        let source = picture(8, 8, |_, _| Vec3::splat(0.5));
        let levels = Levels::of(&source);
        let mask = Image::from_fn(4, 4, |_, column| column < 2);
        let frame = PictureView::default().frame((8, 8), (64, 64));
        let display = DisplaySettings::default();
        let painting = Painting {
            source: (&source, &levels),
            other: None,
            mask: Some(&mask),
            lines: &[],
            frame,
            display,
            inks: INKS,
        };
        let image = painting.pixels();
        let plain = Color32::from_gray(188);
        assert!((0..64).all(|y| image.pixels[y * 64 + 31] != plain && image.pixels[y * 64 + 32] == plain));
    }

    #[test]
    fn hard_pictures_paint() {
        let hard = [0.0, -1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, 1e-40];
        let sizes = [(0, 0), (1, 1), (8192, 16), (16, 8192), (0, 3), (37, 51)];
        for (width, height) in sizes {
            let source = picture(width, height, |row, column| Vec3::splat(hard[(row * 3 + column) % hard.len()]));
            for panel in [(0, 0), (1, 1), (33, 20), (200, 100)] {
                paint(&source, panel, None);
                for (width, height) in sizes {
                    let other = picture(width, height, |_, _| Vec3::ONE);
                    paint(&source, panel, Some((&other, Compare::Difference { signed: true, gain_stops: 200.0 })));
                }
            }
        }
    }

    #[test]
    fn the_time_a_panel_takes_is_told() {
        for (width, height, what) in [(4000, 3200, "smaller"), (1000, 800, "1:1"), (100, 80, "larger")] {
            let source = picture(width, height, |row, column| Vec3::new(row as f32, column as f32, 99.0) / 400.0);
            let levels = Levels::of(&source);
            let frame = PictureView::default().frame(source.size(), (1000, 800));
            let display = DisplaySettings::default();
            for round in ["first", "again"] {
                let began = std::time::Instant::now();
                let painting = Painting {
                    source: (&source, &levels),
                    other: None,
                    mask: None,
                    lines: &[],
                    frame,
                    display,
                    inks: INKS,
                };
                assert_eq!(painting.pixels().pixels.len(), 800_000);
                println!("{what}, {round}: {:.1} ms", 1e3 * began.elapsed().as_secs_f64());
            }
        }
    }
}
