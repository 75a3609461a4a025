//! What is drawn over the pixels of a panel: grid, numbers, crosses, the handle of a wipe, badges.

use super::overlay::{Compare, Mark, Overlay};
use super::source::{Place, Source, Value};
use super::view::Frame;
use crate::math::luminance;
use eframe::egui::{self, Align2, Color32, ColorImage, FontId, Painter, Pos2, Rect, Stroke, StrokeKind, pos2, vec2};
use glam::Vec2;

/// Points a texel must take for numbers on it.
pub const POINTS_FOR_NUMBERS: f32 = 48.0;
/// Points a texel must take for a grid.
const POINTS_FOR_GRID: f32 = 16.0;

/// Where a frame lies on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnScreen {
    pub frame: Frame,
    /// Upper left corner of the panel in points.
    pub corner: Pos2,
    pub pixels_per_point: f32,
}

impl OnScreen {
    /// A point of the panel in screen pixels, in points of the interface.
    pub fn position(&self, pixel: Vec2) -> Pos2 {
        self.corner + vec2(pixel.x, pixel.y) / self.pixels_per_point
    }

    /// The opposite of [`OnScreen::position`].
    pub fn pixel(&self, position: Pos2) -> Vec2 {
        let offset = (position - self.corner) * self.pixels_per_point;
        Vec2::new(offset.x, offset.y)
    }

    /// The visible part of the picture.
    pub fn visible(&self) -> Rect {
        let visible = self.frame.visible();
        let corner = |x: usize, y: usize| self.position(Vec2::new(x as f32, y as f32));
        Rect::from_min_max(
            corner(visible.left, visible.top),
            corner(visible.left + visible.width, visible.top + visible.height),
        )
    }

    fn points_per_texel(&self) -> f32 {
        self.frame.zoom / self.pixels_per_point
    }
}

/// Lines between texels, when they are large.
pub(super) fn grid(painter: &Painter, on_screen: &OnScreen) {
    if on_screen.points_per_texel() < POINTS_FOR_GRID {
        return;
    }
    let visible = on_screen.visible();
    let stroke = Stroke::new(1.0 / on_screen.pixels_per_point, Color32::from_rgba_unmultiplied(128, 128, 128, 70));
    let at = |row: usize, column: usize| {
        let pixel = on_screen.frame.pixel_of(Place { row: row as f32, column: column as f32 }).floor();
        on_screen.position(pixel + Vec2::splat(0.5))
    };
    let (rows, columns) = on_screen.frame.visible_texels();
    for column in columns.clone().skip(1) {
        painter.vline(at(0, column).x, visible.y_range(), stroke);
    }
    for row in rows.skip(1) {
        painter.hline(visible.x_range(), at(row, 0).y, stroke);
    }
}

/// The values of texels in the colour that stands out against them, when there is room.
pub(super) fn numbers(
    painter: &Painter,
    on_screen: &OnScreen,
    pixels: &ColorImage,
    source: &Source,
    overlay: &Overlay,
) {
    let room = on_screen.points_per_texel();
    if room < POINTS_FOR_NUMBERS {
        return;
    }
    let font = FontId::monospace((room / 5.2).clamp(9.0, 15.0));
    let visible = on_screen.frame.visible();
    let (rows, columns) = on_screen.frame.visible_texels();
    for row in rows {
        for column in columns.clone() {
            let centre = Place { row: row as f32 + 0.5, column: column as f32 + 0.5 };
            let pixel = on_screen.frame.pixel_of(centre);
            let part = (pixel.x - visible.left as f32) / visible.width.max(1) as f32;
            let Some(value) = shown_value(source, overlay, row, column, part).filter(|value| !value.is_unseen()) else {
                continue;
            };
            let colour = contrast(pixels, pixel - Vec2::new(visible.left as f32, visible.top as f32));
            let job = egui::text::LayoutJob {
                halign: egui::Align::Center,
                ..egui::text::LayoutJob::simple(value.lines(), font.clone(), colour, f32::INFINITY)
            };
            let galley = painter.layout_job(job);
            let top = on_screen.position(pixel) - vec2(0.0, galley.size().y / 2.0);
            painter.galley(top, galley, colour);
        }
    }
}

/// What a texel shows, given where across the visible part it lies.
fn shown_value(source: &Source, overlay: &Overlay, row: usize, column: usize, part: f32) -> Option<Value> {
    let first = source.value(row, column);
    let Some(comparison) = &overlay.comparison else { return first };
    // Texels of another size have no numbers here.
    let second = (comparison.other.size() == source.size()).then(|| comparison.other.value(row, column)).flatten();
    match comparison.mode {
        Compare::Wipe(place) => {
            if part < place {
                first
            } else {
                second
            }
        }
        Compare::Flip(showing_second) => {
            if showing_second {
                second
            } else {
                first
            }
        }
        Compare::Blend(opacity) => {
            if opacity < 0.5 {
                first
            } else {
                second
            }
        }
        Compare::Difference { signed, .. } => {
            let (first, second) = (first?, second?);
            let difference = first.rgb() - second.rgb();
            Some(match (first, second) {
                (Value::Number(_), Value::Number(_)) if signed => Value::Number(difference.x),
                (Value::Number(_), Value::Number(_)) => Value::Number(difference.x.abs()),
                _ if signed => Value::Number(luminance(difference)),
                _ => Value::Colour(difference.abs()),
            })
        }
    }
}

/// Black or white, whichever stands out against a pixel.
fn contrast(pixels: &ColorImage, pixel: Vec2) -> Color32 {
    let [width, height] = pixels.size;
    let inside = |place: f32, count: usize| (place.max(0.0) as usize).min(count.saturating_sub(1));
    let index = inside(pixel.y, height) * width + inside(pixel.x, width);
    let under = pixels.pixels.get(index).copied().unwrap_or(Color32::BLACK);
    let linear = crate::image::transfer::linear_from_srgb8([under.r(), under.g(), under.b()]);
    // Both contrast ratios of WCAG 2 are equal at this luminance.
    if luminance(linear) > 0.179 { Color32::BLACK } else { Color32::WHITE }
}

/// A cross with a gap in its middle, and its label; seen on any ground by its dark rim.
pub(super) fn mark(painter: &Painter, on_screen: &OnScreen, mark: &Mark) {
    let centre = on_screen.position(on_screen.frame.pixel_of(mark.place));
    if !centre.x.is_finite() || !centre.y.is_finite() {
        return;
    }
    for (width, colour) in [(4.0, Color32::from_black_alpha(200)), (2.0, mark.colour)] {
        for direction in [vec2(1.0, 0.0), vec2(-1.0, 0.0), vec2(0.0, 1.0), vec2(0.0, -1.0)] {
            painter.line_segment([centre + 4.0 * direction, centre + 11.0 * direction], Stroke::new(width, colour));
        }
    }
    if !mark.label.is_empty() {
        badge(painter, centre + vec2(9.0, -9.0), Align2::LEFT_BOTTOM, &mark.label);
    }
}

/// Words on a dark ground, readable on any picture.
pub(super) fn badge(painter: &Painter, position: Pos2, anchor: Align2, words: &str) {
    let galley = painter.layout_no_wrap(words.to_owned(), FontId::proportional(12.0), Color32::WHITE);
    let padding = vec2(6.0, 3.0);
    let rect = anchor.anchor_size(position, galley.size() + 2.0 * padding);
    painter.rect_filled(rect, 4.0, Color32::from_black_alpha(175));
    painter.galley(rect.min + padding, galley, Color32::WHITE);
}

/// The divider of a wipe with its handle.
pub(super) fn divider(painter: &Painter, x: f32, visible: Rect, is_active: bool) {
    let centre = pos2(x, visible.center().y);
    painter.vline(x, visible.y_range(), Stroke::new(3.0, Color32::from_black_alpha(140)));
    painter.vline(x, visible.y_range(), Stroke::new(1.0, Color32::WHITE));
    let radius = if is_active { 12.0 } else { 10.0 };
    painter.circle(centre, radius, Color32::WHITE, Stroke::new(1.5, Color32::from_gray(40)));
    for side in [-1.0, 1.0] {
        let tip = centre + vec2(side * (radius - 3.0), 0.0);
        let back = vec2(-side * 4.5, 4.5);
        let points = vec![tip, tip + back, tip + vec2(back.x, -back.y)];
        painter.add(egui::Shape::convex_polygon(points, Color32::from_gray(40), Stroke::NONE));
    }
}

/// The border of a panel that has the keyboard.
pub(super) fn focus(painter: &Painter, rect: Rect, stroke: Stroke) {
    painter.rect_stroke(rect, 0.0, stroke, StrokeKind::Inside);
}
