//! The widget: input to a view, a view to pixels, pixels to the screen.

use super::cache::painted;
use super::marks::{self, OnScreen};
use super::overlay::{Compare, Comparison, Overlay};
use super::paint::{Inks, divider};
use super::source::{Place, Source, Value, describe};
use super::view::{Frame, PictureView};
use crate::image::display::DisplaySettings;
use eframe::egui::emath::GuiRounding;
use eframe::egui::{
    self, Align2, Color32, CursorIcon, Key, PointerButton, Pos2, Rect, Response, Role, Sense, Ui, WidgetInfo, vec2,
};

/// Points that double the size of a picture when scrolled by; a notch of most wheels is 40 to 60.
const POINTS_PER_DOUBLING: f32 = 140.0;
/// Half the width of what can be grabbed of a divider, in points.
const HANDLE_REACH: f32 = 8.0;

/// What happened to a picture and what is under the pointer.
#[derive(Clone, Debug)]
pub struct PictureResponse {
    /// Where the picture lies.
    pub frame: Frame,
    /// The place under the pointer.
    pub hovered: Option<Place>,
    /// The value there.
    pub value: Option<Value>,
    /// The value there of the picture that is compared with.
    pub other_value: Option<Value>,
    /// The place that was clicked.
    pub clicked: Option<Place>,
    /// A drag with the primary button that is left to the caller: where it began and where it is, maybe outside of the
    /// picture.
    pub drag: Option<(Place, Place)>,
    /// The divider was moved here: put it into the next [`Compare::Wipe`].
    pub wipe: Option<f32>,
    /// Whether the pixels were computed anew; an unchanged panel reuses them.
    pub repainted: bool,
    on_screen: OnScreen,
}

impl PictureResponse {
    /// The position of a place in points, for drawing over the picture.
    pub fn position_of(&self, place: Place) -> Pos2 {
        self.on_screen.position(self.frame.pixel_of(place))
    }

    /// [`describe`] of what is under the pointer.
    pub fn description(&self) -> Option<String> {
        Some(describe(self.hovered?, self.value, &[]))
    }
}

/// Shows a picture in all the room there is. The wheel and pinching zoom about the pointer, dragging moves the picture.
///
/// `label` is its name for readers of the screen and for tests; two pictures in one `Ui` need two labels.
pub fn show(
    ui: &mut Ui,
    label: &str,
    source: &Source,
    display: &DisplaySettings,
    view: &mut PictureView,
    overlay: &Overlay,
) -> PictureResponse {
    let picture = source.size();
    let room = ui.available_size();
    // In a scrolling panel there is no end of room in one direction.
    let side = |side: f32| if side.is_finite() { side.max(16.0) } else { 400.0 };
    let (_, rect) = ui.allocate_space(vec2(side(room.x), side(room.y)));
    let response = ui.interact(rect, ui.scope_id().with(label), Sense::click_and_drag());
    let pixels_per_point = ui.ctx().pixels_per_point();
    let rect = rect.round_to_pixels(pixels_per_point);
    let pixels = rect.size() * pixels_per_point;
    let panel = (pixels.x.round() as usize, pixels.y.round() as usize);
    let before = OnScreen { frame: view.frame(picture, panel), corner: rect.min, pixels_per_point };
    let handle =
        overlay.comparison.as_ref().and_then(|comparison| wipe_handle(ui, &response, label, comparison, &before));
    let moved = handle.as_ref().and_then(|(response, place)| wiped(ui, response, *place, &before));
    if picture.0 > 0 && picture.1 > 0 {
        navigate(ui, &response, view, &before, overlay.own_drag);
    }
    let on_screen = OnScreen { frame: view.frame(picture, panel), ..before };

    // The divider follows the hand at once, not one frame later.
    let moved_overlay = moved.map(|place| with_wipe(overlay, place));
    let overlay = moved_overlay.as_ref().unwrap_or(overlay);
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 0.0, ui.visuals().extreme_bg_color);
    let inks = inks(ui, pixels_per_point);
    let painted = painted(ui.ctx(), response.id, source, display, overlay, on_screen.frame, inks);
    let visible = on_screen.visible();
    if let Some(texture) = &painted.texture {
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        painter.image(texture.id(), visible, whole, Color32::WHITE);
        if !overlay.without_numbers {
            let painter = painter.with_clip_rect(visible.intersect(painter.clip_rect()));
            marks::grid(&painter, &on_screen);
            marks::numbers(&painter, &on_screen, &painted.pixels, source, overlay);
        }
    } else {
        painter.text(
            rect.center(),
            Align2::CENTER_CENTER,
            if picture.0 * picture.1 == 0 { "Nothing to show" } else { "" },
            egui::FontId::proportional(14.0),
            ui.visuals().weak_text_color(),
        );
    }
    if let Some((handle, _)) = &handle
        && let Some(Comparison { mode: Compare::Wipe(place), .. }) = overlay.comparison
    {
        let column = divider(place, on_screen.frame.visible());
        let x = on_screen.position(glam::Vec2::new(column as f32, 0.0)).x;
        marks::divider(&painter, x, visible, handle.hovered() || handle.dragged() || handle.has_focus());
    }
    names(&painter, rect, overlay);
    overlay.marks.iter().for_each(|mark| marks::mark(&painter, &on_screen, mark));
    if response.has_focus() {
        marks::focus(&painter, rect, ui.visuals().selection.stroke);
    }
    answer(ui, response, label, source, overlay, on_screen, moved, painted.is_new)
}

/// Wheel, pinch and drag into the view.
fn navigate(ui: &Ui, response: &Response, view: &mut PictureView, before: &OnScreen, own_drag: bool) {
    let Frame { picture, panel, .. } = before.frame;
    if response.contains_pointer()
        && let Some(pointer) = ui.input(|input| input.pointer.hover_pos())
    {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta(), input.zoom_delta()));
        let factor = pinch * (scroll.y / POINTS_PER_DOUBLING).exp2();
        if factor != 1.0 && factor.is_finite() {
            view.zoom_about(factor, before.pixel(pointer), picture, panel);
        }
        if scroll.x != 0.0 {
            view.pan(glam::Vec2::new(scroll.x, 0.0) * before.pixels_per_point, picture, panel);
        }
        if scroll != egui::Vec2::ZERO {
            // A panel around this one does not scroll as well.
            ui.input_mut(|input| input.smooth_scroll_delta = egui::Vec2::ZERO);
        }
    }
    let moves = response.dragged_by(PointerButton::Middle) || response.dragged_by(PointerButton::Primary) && !own_drag;
    let delta = response.drag_delta() * before.pixels_per_point;
    if moves && delta != egui::Vec2::ZERO {
        view.pan(glam::Vec2::new(delta.x, delta.y), picture, panel);
    }
    if moves {
        ui.ctx().set_cursor_icon(CursorIcon::Grabbing);
    } else if response.hovered() {
        ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
    }
}

/// What can be grabbed of a wipe's divider, with the divider's place.
fn wipe_handle(
    ui: &Ui,
    response: &Response,
    label: &str,
    comparison: &Comparison,
    on_screen: &OnScreen,
) -> Option<(Response, f32)> {
    let Compare::Wipe(place) = comparison.mode else { return None };
    let visible = on_screen.visible();
    if !visible.is_positive() {
        return None;
    }
    let column = divider(place, on_screen.frame.visible());
    let x = on_screen.position(glam::Vec2::new(column as f32, 0.0)).x;
    let grip = Rect::from_x_y_ranges(x - HANDLE_REACH..=x + HANDLE_REACH, visible.y_range());
    let handle = ui.interact(grip, response.id.with("wipe"), Sense::click_and_drag());
    handle.widget_info(|| WidgetInfo::slider(true, f64::from(place), format!("{label} divider")));
    Some((handle.on_hover_and_drag_cursor(CursorIcon::ResizeHorizontal), place))
}

/// Where a drag or an arrow key moves the divider.
fn wiped(ui: &Ui, handle: &Response, place: f32, on_screen: &OnScreen) -> Option<f32> {
    let visible = on_screen.visible();
    if handle.dragged() {
        let pointer = handle.interact_pointer_pos()?;
        return Some(((pointer.x - visible.left()) / visible.width()).clamp(0.0, 1.0));
    }
    if !handle.has_focus() {
        return None;
    }
    let filter = egui::EventFilter { horizontal_arrows: true, ..Default::default() };
    ui.memory_mut(|memory| memory.set_focus_lock_filter(handle.id, filter));
    let step = ui.input(|input| {
        f32::from(u8::from(input.key_pressed(Key::ArrowRight))) - f32::from(u8::from(input.key_pressed(Key::ArrowLeft)))
    });
    (step != 0.0).then(|| (place + 0.02 * step).clamp(0.0, 1.0))
}

fn with_wipe<'a>(overlay: &Overlay<'a>, place: f32) -> Overlay<'a> {
    let mut overlay = overlay.clone();
    if let Some(comparison) = &mut overlay.comparison {
        comparison.mode = Compare::Wipe(place);
    }
    overlay
}

/// Quiet greys between the ground and the words of the theme.
fn inks(ui: &Ui, pixels_per_point: f32) -> Inks {
    let (ground, words) = (ui.visuals().extreme_bg_color, ui.visuals().text_color());
    Inks {
        ground: ground.lerp_to_gamma(words, 0.10),
        hatch: ground.lerp_to_gamma(words, 0.28),
        mask: Color32::from_rgb(255, 176, 0),
        period: (8.0 * pixels_per_point).round() as u32,
        line: pixels_per_point.round().max(1.0) as u32,
    }
}

/// The badge, and what the compared pictures are called.
fn names(painter: &egui::Painter, rect: Rect, overlay: &Overlay) {
    let inset = rect.shrink(8.0);
    let mut below = inset.left_top();
    if !overlay.badge.is_empty() {
        marks::badge(painter, below, Align2::LEFT_TOP, overlay.badge);
        below.y += 26.0;
    }
    let Some(Comparison { mode, names: [first, second], .. }) = &overlay.comparison else { return };
    match mode {
        Compare::Wipe(_) => {
            marks::badge(painter, below, Align2::LEFT_TOP, first);
            marks::badge(painter, inset.right_top(), Align2::RIGHT_TOP, second);
        }
        Compare::Flip(showing_second) => {
            marks::badge(painter, below, Align2::LEFT_TOP, if *showing_second { second } else { first });
        }
        Compare::Blend(opacity) => {
            let words = format!("{second} over {first}, {:.0} %", 100.0 * opacity);
            marks::badge(painter, below, Align2::LEFT_TOP, &words);
        }
        Compare::Difference { signed, gain_stops } => {
            let kind = if *signed { "signed luminance" } else { "absolute" };
            let words = format!("{first} - {second}, {kind}, {gain_stops:+.1} stops");
            marks::badge(painter, below, Align2::LEFT_TOP, &words);
        }
    }
}

fn answer(
    ui: &Ui,
    response: Response,
    label: &str,
    source: &Source,
    overlay: &Overlay,
    on_screen: OnScreen,
    wipe: Option<f32>,
    repainted: bool,
) -> PictureResponse {
    let frame = on_screen.frame;
    let pointer = ui.input(|input| input.pointer.hover_pos()).filter(|_| response.contains_pointer());
    let hovered = pointer.and_then(|pointer| frame.place_at(on_screen.pixel(pointer)));
    let value = hovered.and_then(|place| source.value_at(place));
    let other_value = overlay.comparison.as_ref().zip(hovered).and_then(|(comparison, place)| {
        let (width, height) = comparison.other.size();
        let (columns, rows) = (frame.picture.0 as f32, frame.picture.1 as f32);
        let place = Place { row: place.row * height as f32 / rows, column: place.column * width as f32 / columns };
        comparison.other.value_at(place)
    });
    let under = |is_so: bool| {
        let position = response.interact_pointer_pos().filter(|_| is_so)?;
        frame.place_at(on_screen.pixel(position))
    };
    let drag = ui.input(|input| input.pointer.press_origin()).zip(response.interact_pointer_pos());
    let drag = drag.filter(|_| overlay.own_drag && response.dragged_by(PointerButton::Primary)).map(|(from, to)| {
        let place = |position: Pos2| {
            let texels = (on_screen.pixel(position) - frame.origin) / frame.zoom;
            Place { row: texels.y, column: texels.x }
        };
        (place(from), place(to))
    });
    let clicked = under(response.clicked());
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::Image, true, label);
        info.current_text_value = Some(match hovered {
            Some(place) => describe(place, value, &[]),
            None => format!("{} x {} texels", frame.picture.0, frame.picture.1),
        });
        info
    });
    PictureResponse { frame, hovered, value, other_value, clicked, drag, wipe, repainted, on_screen }
}
