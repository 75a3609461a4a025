//! The colours of numbers with their values.

use crate::image::display::bytes_of_colour;
use crate::image::value_scale::{Palette, ValueScale, three_digits};
use eframe::egui::{
    self, Align2, Color32, FontId, Mesh, Pos2, Rect, Response, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2,
};

/// Columns of even colour between which it is interpolated.
const COLUMNS: usize = 64;
/// Height of the colours in points.
const HEIGHT: f32 = 12.0;
/// Size of the words in points.
const WORDS: f32 = 11.0;

/// Draws a scale over the width there is: colours, ticks at round numbers, the unit (may be empty) behind them.
pub fn scale_bar(ui: &mut Ui, label: &str, scale: &ValueScale, palette: Palette, unit: &str) -> Response {
    let width = ui.available_width();
    let width = if width.is_finite() { width.max(60.0) } else { 240.0 };
    let (rect, response) = ui.allocate_exact_size(vec2(width, HEIGHT + WORDS + 7.0), Sense::hover());
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::Image, true, label);
        let kind = if scale.logarithmic { ", logarithmic" } else { "" };
        info.current_text_value =
            Some(format!("{} to {} {unit}{kind}", three_digits(scale.low), three_digits(scale.high)));
        info
    });
    let font = FontId::proportional(WORDS);
    let (ink, weak) = (ui.visuals().text_color(), ui.visuals().weak_text_color());
    let painter = ui.painter_at(rect);
    let unit_rect =
        painter.text(rect.right_top() + vec2(0.0, HEIGHT / 2.0), Align2::RIGHT_CENTER, unit, font.clone(), weak);
    let room = if unit.is_empty() { 0.0 } else { unit_rect.width() + 6.0 };
    // Words of the ticks at the ends reach over them.
    let bar = Rect::from_min_max(rect.min + vec2(14.0, 0.0), pos2(rect.right() - room - 14.0, rect.top() + HEIGHT));
    let x_of = |place: f32| egui::lerp(bar.left()..=bar.right(), place);
    let mut mesh = Mesh::default();
    for column in 0..=COLUMNS {
        let place = column as f32 / COLUMNS as f32;
        let [red, green, blue] = bytes_of_colour(palette.colour(place));
        for y in [bar.top(), bar.bottom()] {
            mesh.colored_vertex(Pos2::new(x_of(place), y), Color32::from_rgb(red, green, blue));
        }
        if column > 0 {
            let first = 2 * (column as u32 - 1);
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first + 1, first + 2, first + 3);
        }
    }
    painter.add(Shape::mesh(mesh));
    // As many ticks as their words leave room for.
    let fitting = (2..=9).rev().map(|most| scale.ticks(most)).find(|ticks| {
        let words: f32 = ticks.iter().map(|(_, word)| word.len() as f32 * 6.2 + 10.0).sum();
        words <= bar.width() + 28.0
    });
    for (value, word) in fitting.unwrap_or_else(|| scale.ticks(1)) {
        let x = x_of(scale.place(value).clamp(0.0, 1.0));
        painter.vline(x, bar.bottom()..=bar.bottom() + 3.0, Stroke::new(1.0, weak));
        painter.text(pos2(x, bar.bottom() + 3.0), Align2::CENTER_TOP, word, font.clone(), ink);
    }
    response
}
