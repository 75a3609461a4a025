//! Which part of a picture is on the screen, and how large.
//!
//! A view is kept in parts of the picture and in pixels of the screen for the whole width, so that it means the same
//! for a picture at half the resolution: a preview, a coarser level, the photograph beside it. The screen is counted in
//! its own pixels, not in points: 1:1 is sharp at any scale of the interface.

use super::source::Place;
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// Largest number of screen pixels a texel may take.
pub const MOST_ZOOM: f32 = 256.0;
/// Smallest width of a picture on the screen, in pixels.
const LEAST_WIDTH: f32 = 8.0;

/// The part of a picture that is shown. The default fits the whole picture into its panel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PictureView {
    /// The place in the middle of the panel, in parts of width and height from the upper left, in [0, 1].
    pub centre: Vec2,
    /// Screen pixels that the width of the whole picture takes; `None` fits it into the panel.
    pub width_on_screen: Option<f32>,
    /// What was shown last; zooming by keys starts from it.
    #[serde(skip)]
    pub(super) last: Option<Frame>,
}

impl Default for PictureView {
    fn default() -> Self {
        PictureView { centre: Vec2::splat(0.5), width_on_screen: None, last: None }
    }
}

impl PictureView {
    /// Shows the whole picture.
    pub fn fit(&mut self) {
        (self.centre, self.width_on_screen) = (Vec2::splat(0.5), None);
    }

    /// One texel a screen pixel, about the middle of what is shown.
    pub fn actual_size(&mut self) {
        self.set_zoom(1.0);
    }

    /// Screen pixels a texel, as it was last shown; 1 before it was.
    pub fn zoom(&self) -> f32 {
        self.last.map_or(1.0, |frame| frame.zoom)
    }

    /// So many screen pixels a texel of the picture last shown, about the middle.
    pub fn set_zoom(&mut self, zoom: f32) {
        if let Some(frame) = self.last {
            self.width_on_screen = Some(frame.picture.0 as f32 * zoom);
        }
    }

    /// To the next larger power of two of screen pixels a texel.
    pub fn zoom_in(&mut self) {
        self.set_zoom((self.zoom().log2() + 0.01).floor().exp2() * 2.0);
    }

    /// To the next smaller power of two of screen pixels a texel.
    pub fn zoom_out(&mut self) {
        self.set_zoom((self.zoom().log2() - 0.01).ceil().exp2() / 2.0);
    }

    /// Brings a place of the picture last shown into the middle of the panel.
    pub fn centre_on(&mut self, place: Place) {
        let Some(frame) = self.last else { return };
        self.width_on_screen.get_or_insert(frame.zoom * frame.picture.0 as f32);
        let size = Vec2::new(frame.picture.0 as f32, frame.picture.1 as f32).max(Vec2::ONE);
        self.centre = Vec2::new(place.column, place.row) / size;
    }

    /// Moves the picture by so many screen pixels.
    pub(super) fn pan(&mut self, pixels: Vec2, picture: (usize, usize), panel: (usize, usize)) {
        let width = self.width(picture, panel);
        self.width_on_screen = Some(width);
        self.centre -= pixels / size_on_screen(width, picture).max(Vec2::ONE);
    }

    /// Zooms so that the place under the pointer stays there; `pointer` in screen pixels from the panel's corner.
    pub(super) fn zoom_about(&mut self, factor: f32, pointer: Vec2, picture: (usize, usize), panel: (usize, usize)) {
        let before = self.width(picture, panel);
        self.width_on_screen = Some(before * factor);
        let after = self.width(picture, panel);
        let from_middle = pointer - Vec2::new(panel.0 as f32, panel.1 as f32) / 2.0;
        let part = |width: f32| from_middle / size_on_screen(width, picture).max(Vec2::splat(1e-3));
        self.centre += part(before) - part(after);
    }

    /// The width of the picture on the screen, within what is allowed.
    fn width(&self, picture: (usize, usize), panel: (usize, usize)) -> f32 {
        let (columns, rows) = (picture.0.max(1) as f32, picture.1.max(1) as f32);
        let fit = (panel.0 as f32).min(panel.1 as f32 * columns / rows).max(1.0);
        let wanted = self.width_on_screen.filter(|width| width.is_finite()).unwrap_or(fit);
        wanted.clamp(LEAST_WIDTH.min(fit).min(columns), MOST_ZOOM * columns)
    }

    /// Where the picture lies in a panel of so many screen pixels; pulls the view back into what is allowed.
    pub(super) fn frame(&mut self, picture: (usize, usize), panel: (usize, usize)) -> Frame {
        let width = self.width(picture, panel);
        if !self.centre.is_finite() {
            self.centre = Vec2::splat(0.5);
        }
        self.centre = self.centre.clamp(Vec2::ZERO, Vec2::ONE);
        self.width_on_screen = self.width_on_screen.map(|_| width);
        let middle = Vec2::new(panel.0 as f32, panel.1 as f32) / 2.0;
        // On whole pixels, so that texels of whole pixels have sharp borders.
        let origin = (middle - self.centre * size_on_screen(width, picture)).round();
        let frame = Frame { panel, picture, origin, zoom: width / picture.0.max(1) as f32 };
        self.last = Some(frame);
        frame
    }
}

fn size_on_screen(width: f32, picture: (usize, usize)) -> Vec2 {
    Vec2::new(width, width * picture.1 as f32 / picture.0.max(1) as f32)
}

/// Where a picture lies on its panel, in screen pixels from the panel's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Width and height of the panel.
    pub panel: (usize, usize),
    /// Width and height of the picture in texels.
    pub picture: (usize, usize),
    /// The picture's upper left corner, whole numbers.
    pub origin: Vec2,
    /// Screen pixels a texel.
    pub zoom: f32,
}

/// A rectangle of whole screen pixels on a panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Frame {
    /// The part of the panel that the picture covers; empty when the picture is, or lies outside.
    pub fn visible(&self) -> PixelRect {
        let along = |origin: f32, texels: usize, panel: usize| {
            if texels == 0 {
                return (0, 0);
            }
            let end = (origin + (texels as f32 * self.zoom).round().max(1.0)).clamp(0.0, panel as f32) as usize;
            let start = origin.clamp(0.0, panel as f32) as usize;
            (start, end.saturating_sub(start))
        };
        let (left, width) = along(self.origin.x, self.picture.0, self.panel.0);
        let (top, height) = along(self.origin.y, self.picture.1, self.panel.1);
        if width == 0 || height == 0 { PixelRect::default() } else { PixelRect { left, top, width, height } }
    }

    /// The place under a point of the panel; `None` outside the picture.
    pub fn place_at(&self, pixel: Vec2) -> Option<Place> {
        let place = (pixel - self.origin) / self.zoom;
        let inside =
            place.cmpge(Vec2::ZERO).all() && place.cmplt(Vec2::new(self.picture.0 as f32, self.picture.1 as f32)).all();
        inside.then_some(Place { row: place.y, column: place.x })
    }

    /// The point of the panel over a place, which may lie outside of both.
    pub fn pixel_of(&self, place: Place) -> Vec2 {
        self.origin + Vec2::new(place.column, place.row) * self.zoom
    }

    /// First and last-but-one texel (rows, columns) that are visible.
    pub fn visible_texels(&self) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let visible = self.visible();
        let along = |origin: f32, start: usize, length: usize, texels: usize| {
            let first = ((start as f32 - origin) / self.zoom).floor().max(0.0) as usize;
            let last = (((start + length) as f32 - origin) / self.zoom).ceil().max(0.0) as usize;
            if length == 0 { 0..0 } else { first.min(texels)..last.min(texels) }
        };
        (
            along(self.origin.y, visible.top, visible.height, self.picture.1),
            along(self.origin.x, visible.left, visible.width, self.picture.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PICTURE: (usize, usize) = (400, 200);
    const PANEL: (usize, usize) = (800, 600);

    #[test]
    fn a_fit_shows_all_and_keys_step_by_powers_of_two() {
        let mut view = PictureView::default();
        let frame = view.frame(PICTURE, PANEL);
        assert_eq!((frame.zoom, frame.visible()), (2.0, PixelRect { left: 0, top: 100, width: 800, height: 400 }));
        view.zoom_in();
        assert_eq!(view.frame(PICTURE, PANEL).zoom, 4.0);
        view.actual_size();
        assert_eq!(view.frame(PICTURE, PANEL).zoom, 1.0);
        view.zoom_out();
        assert_eq!(view.frame(PICTURE, PANEL).zoom, 0.5);
        (0..40).for_each(|_| {
            view.zoom_in();
            view.frame(PICTURE, PANEL);
        });
        assert_eq!(view.zoom(), MOST_ZOOM);
        view.fit();
        assert_eq!(view.frame(PICTURE, PANEL), frame);
    }

    #[test]
    fn zooming_keeps_the_place_under_the_pointer_without_drift() {
        let mut view = PictureView::default();
        let pointer = Vec2::new(613.0, 231.0);
        let before = view.frame(PICTURE, PANEL).place_at(pointer).unwrap();
        for step in 0..60 {
            view.zoom_about(if step % 2 == 0 { 1.37 } else { 1.0 / 1.3 }, pointer, PICTURE, PANEL);
            let frame = view.frame(PICTURE, PANEL);
            let after = frame.place_at(pointer).unwrap();
            let drift = (after.row - before.row).abs().max((after.column - before.column).abs());
            // The corner is rounded to whole pixels of the screen.
            assert!(drift * frame.zoom < 0.51 + 1e-3, "step {step}: {drift} texels at zoom {}", frame.zoom);
        }
    }

    #[test]
    fn a_coarser_picture_shows_the_same_part() {
        let mut view = PictureView::default();
        view.frame(PICTURE, PANEL);
        view.zoom_about(5.0, Vec2::new(200.0, 300.0), PICTURE, PANEL);
        let (fine, coarse) = (view.frame(PICTURE, PANEL), view.frame((100, 50), PANEL));
        let (fine, coarse) = (fine.place_at(Vec2::splat(300.0)).unwrap(), coarse.place_at(Vec2::splat(300.0)).unwrap());
        assert!((fine.row / 4.0 - coarse.row).abs() < 0.1 && (fine.column / 4.0 - coarse.column).abs() < 0.1);
    }

    #[test]
    fn no_size_and_no_number_makes_a_bad_frame() {
        for picture in [(0, 0), (1, 1), (8192, 16), (16, 8192), (0, 5), (5, 0)] {
            for panel in [(1, 1), (1000, 800), (0, 0)] {
                for width in [None, Some(f32::NAN), Some(f32::INFINITY), Some(-5.0), Some(0.0), Some(1e30)] {
                    let mut view = PictureView { width_on_screen: width, centre: Vec2::NAN, ..Default::default() };
                    view.zoom_about(1e-9, Vec2::splat(3.0), picture, panel);
                    let frame = view.frame(picture, panel);
                    let visible = frame.visible();
                    assert!(visible.left + visible.width <= panel.0 && visible.top + visible.height <= panel.1);
                    assert!(frame.zoom > 0.0 && frame.zoom <= MOST_ZOOM && frame.origin.is_finite());
                    let (rows, columns) = frame.visible_texels();
                    assert!(rows.end <= picture.1 && columns.end <= picture.0);
                }
            }
        }
    }

    #[test]
    fn a_view_survives_being_saved() {
        let mut view = PictureView { centre: Vec2::new(0.25, 0.75), width_on_screen: Some(123.0), last: None };
        let text = serde_json::to_string(&view).unwrap();
        assert_eq!(serde_json::from_str::<PictureView>(&text).unwrap(), view);
        view.frame(PICTURE, PANEL);
        assert_eq!(serde_json::from_str::<PictureView>("{}").unwrap(), PictureView::default());
    }
}
