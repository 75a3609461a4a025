//! A small histogram of luminance in stops, with what the screen cuts off.

use crate::image::display::{DisplaySettings, TOO_BRIGHT, TOO_DARK, bytes_of_colour};
use crate::image::histogram::Histogram;
use eframe::egui::{
    self, Align2, Color32, FontId, Rect, Response, Role, Sense, Stroke, Ui, Vec2, WidgetInfo, pos2, vec2,
};
use glam::Vec3;

/// Linear value below which a byte is black: half of the first step of sRGB.
const BLACK: f32 = 0.5 / 255.0 / 12.92;
/// Room for the numbers under the bars, in points.
const FOOT: f32 = 14.0;

/// Draws a histogram at this size; what is above white or below black at this exposure stands on coloured ground.
pub fn show(ui: &mut Ui, label: &str, histogram: &Histogram, display: &DisplaySettings, size: Vec2) -> Response {
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    let white_stop = -display.exposure_stops;
    let black_stop = BLACK.log2() - display.exposure_stops;
    let above = histogram.share_from(white_stop);
    let total = histogram.total.max(1) as f32;
    let finite = 1.0 - histogram.not_finite as f32 / total;
    let below = (finite - histogram.share_from(black_stop)).max(0.0);
    let sentence = format!("{:.1} % above white, {:.1} % at or below black", 100.0 * above, 100.0 * below);
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::Image, true, label);
        info.current_text_value = Some(sentence.clone());
        info
    });

    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    // From one stop below the darkest to one above the brightest, with the range of the screen in it.
    let (first, last) = histogram.extent().unwrap_or((0, 0));
    let low = Histogram::stop_of(first).min(black_stop).clamp(-24.0, 24.0) - 1.0;
    let high = Histogram::stop_of(last + 1).max(white_stop).clamp(-24.0, 24.0) + 1.0;
    let bars = Rect::from_min_max(rect.min, pos2(rect.right(), rect.bottom() - FOOT)).shrink2(vec2(4.0, 2.0));
    let x_of = |stop: f32| egui::remap(stop, low..=high.max(low + 1.0), bars.left()..=bars.right());
    let ground = |from: f32, to: f32, colour: Vec3| {
        let [red, green, blue] = bytes_of_colour(colour);
        let rect = Rect::from_x_y_ranges(from..=to, bars.y_range());
        painter.rect_filled(rect, 0.0, Color32::from_rgba_unmultiplied(red, green, blue, 60));
    };
    ground(x_of(white_stop).clamp(bars.left(), bars.right()), bars.right(), TOO_BRIGHT);
    ground(bars.left(), x_of(black_stop).clamp(bars.left(), bars.right()), TOO_DARK);

    let most = histogram.counts.iter().copied().max().unwrap_or(0).max(1) as f32;
    let ink = ui.visuals().text_color();
    for (bin, &count) in histogram.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let (left, right) = (x_of(Histogram::stop_of(bin)), x_of(Histogram::stop_of(bin + 1)));
        // A root shows rare bright pixels, which matter most.
        let height = (bars.height() * (count as f32 / most).sqrt()).max(1.0);
        let bar =
            Rect::from_min_max(pos2(left, bars.bottom() - height), pos2((right - 0.5).max(left + 0.5), bars.bottom()));
        painter.rect_filled(bar, 0.0, ink.gamma_multiply(0.8));
    }
    painter.vline(x_of(white_stop), bars.y_range(), Stroke::new(1.0, ink));
    let every = if (high - low) * 22.0 / 4.0 > bars.width() { 8 } else { 4 };
    for stop in (low.ceil() as i32..=high.floor() as i32).filter(|stop| stop.rem_euclid(every) == 0) {
        let x = x_of(stop as f32);
        painter.vline(x, bars.bottom()..=bars.bottom() + 2.0, Stroke::new(1.0, ui.visuals().weak_text_color()));
        let font = FontId::proportional(9.5);
        let words = format!("{stop:+}");
        painter.text(pos2(x, rect.bottom() - 1.0), Align2::CENTER_BOTTOM, words, font, ui.visuals().weak_text_color());
    }
    response.on_hover_text(format!("Pixels by luminance in stops, heights by square root\n{sentence}"))
}
