//! The map of the materials' codes: a click on a material shows it, a click between shows what lies there.

use super::materials::{MaterialsMemory, is_ready};
use crate::image::display::DisplaySettings;
use crate::measured::Category;
use crate::neural::between::{MaterialMap, MaterialPlace};
use crate::studio::act::Act;
use crate::studio::model::Model;
use crate::studio::model::materials::Choice;
use crate::studio::panel::act_button_named;
use crate::studio::theme;
use crate::studio::workspace::Panel;
use egui::{Align2, FontId, Pos2, Rect, RichText, Sense, Stroke, Ui, pos2, remap, vec2};

/// Side of a sphere on the map in points.
const SIDE: f32 = 34.0;
/// Room between the outermost materials and the border, in points.
const MARGIN: f32 = 26.0;

/// From the two directions of the map to the screen, and back.
struct Screen {
    rect: Rect,
    low: [f64; 2],
    high: [f64; 2],
}

impl Screen {
    fn new(map: &MaterialMap, rect: Rect) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for place in &map.places {
            for axis in 0..2 {
                low[axis] = low[axis].min(place.at[axis]);
                high[axis] = high[axis].max(place.at[axis]).max(low[axis] + 1e-9);
            }
        }
        Screen { rect: rect.shrink(MARGIN), low, high }
    }

    fn position(&self, at: [f64; 2]) -> Pos2 {
        let part = |axis: usize| ((at[axis] - self.low[axis]) / (self.high[axis] - self.low[axis])) as f32;
        pos2(
            egui::lerp(self.rect.left()..=self.rect.right(), part(0)),
            egui::lerp(self.rect.bottom()..=self.rect.top(), part(1)),
        )
    }

    fn place(&self, position: Pos2) -> [f64; 2] {
        let across = remap(position.x, self.rect.left()..=self.rect.right(), 0.0..=1.0);
        let up = remap(position.y, self.rect.bottom()..=self.rect.top(), 0.0..=1.0);
        [across, up].iter().zip(0..2).fold([0.0; 2], |mut at, (part, axis)| {
            at[axis] = self.low[axis] + f64::from(*part) * (self.high[axis] - self.low[axis]);
            at
        })
    }
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut MaterialsMemory) {
    if !is_ready(ui, model) {
        return;
    }
    memory.fill(model);
    let Some(library) = model.materials.library.clone() else { return };
    ui.horizontal_wrapped(|ui| {
        let mut pictures = !memory.without_pictures;
        ui.checkbox(&mut pictures, "Pictures").on_hover_text("Spheres instead of dots");
        memory.without_pictures = !pictures;
        act_button_named(ui, model, Act::PreviousMaterial, "Before");
        act_button_named(ui, model, Act::NextMaterial, "After");
        let [first, second] = library.map.explained;
        ui.label(RichText::new(format!("{:.0} % of the codes' variance", 100.0 * (first + second))).weak())
            .on_hover_text("The two main directions of sixteen; each place is the mean of a material's three channels");
        ui.label(RichText::new("Click between materials to interpolate").weak());
    });
    let (rect, response) = ui.allocate_exact_size(ui.available_size().max(vec2(120.0, 120.0)), Sense::click());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Map of the latent codes"));
    ui.painter().rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    let screen = Screen::new(&library.map, rect);
    let mut clicked = response.interact_pointer_pos().filter(|_| response.clicked()).map(|at| screen.place(at));
    for (index, place) in library.map.places.iter().enumerate() {
        if let Some(at) = material(ui, memory, &screen, index, place) {
            clicked = Some(at);
        }
    }
    let colours = theme::palette(ui.visuals());
    if let Some(Choice::Place { at, parts, .. }) = &model.materials.choice {
        let at = screen.position(*at);
        let painter = ui.painter_at(rect);
        painter.circle_stroke(at, 0.5 * SIDE + 2.0, Stroke::new(2.5, colours.accent));
        for part in parts.iter().filter(|_| parts.len() > 1) {
            if let Some(other) = library.map.places.iter().find(|place| place.name == part.name) {
                let width = 0.5 + 3.0 * part.share as f32;
                painter.line_segment([at, screen.position(other.at)], Stroke::new(width, colours.accent));
            }
        }
        if parts.len() > 1 {
            painter.circle_filled(at, 5.0, colours.accent);
        }
    }
    legend(ui, rect);
    if let Some(at) = clicked {
        model.choose_material(at);
        model.activate = Some(Panel::Material);
    }
}

/// A material on the map; its place when it was clicked.
fn material(
    ui: &mut Ui,
    memory: &mut MaterialsMemory,
    screen: &Screen,
    index: usize,
    place: &MaterialPlace,
) -> Option<[f64; 2]> {
    let at = screen.position(place.at);
    let reach = if memory.without_pictures { 12.0 } else { 0.7 * SIDE };
    let response = ui.interact(
        Rect::from_center_size(at, vec2(reach, reach)),
        ui.scope_id().with(("material", index)),
        Sense::click(),
    );
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, format!("code of {}", place.name)));
    let texture = match memory.without_pictures {
        true => None,
        false => memory.thumbnails.texture(ui.ctx(), &place.name, &DisplaySettings::default()),
    };
    let colour = theme::kind_colour(place.category);
    match texture {
        Some(texture) => {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            let ball = egui::Shape::from(egui::epaint::RectShape {
                corner_radius: egui::CornerRadius::same((0.5 * SIDE) as u8),
                brush: Some(std::sync::Arc::new(egui::epaint::Brush { fill_texture_id: texture.id(), uv: whole })),
                ..egui::epaint::RectShape::filled(
                    Rect::from_center_size(at, vec2(SIDE, SIDE)),
                    egui::CornerRadius::same((0.5 * SIDE) as u8),
                    egui::Color32::WHITE,
                )
            });
            ui.painter().add(ball);
            ui.painter().circle_stroke(at, 0.5 * SIDE, Stroke::new(1.5, colour));
        }
        None => {
            ui.painter().circle_filled(at, 5.0, colour);
        }
    }
    if response.hovered() {
        ui.painter().circle_stroke(at, 0.5 * SIDE + 2.0, Stroke::new(1.5, ui.visuals().text_color()));
    }
    let about = format!(
        "{}\n{}; {:.0} % of its nearest codes are of its kind",
        place.name,
        place.category.label(),
        100.0 * place.purity
    );
    response.on_hover_text(about).clicked().then_some(place.at)
}

/// The colours of the kinds, in the corner.
fn legend(ui: &Ui, rect: Rect) {
    let painter = ui.painter_at(rect);
    let mut at = rect.left_top() + vec2(12.0, 14.0);
    for kind in Category::ALL {
        painter.circle_filled(at, 4.0, theme::kind_colour(kind));
        let words = at + vec2(9.0, 0.0);
        let ink = ui.visuals().weak_text_color();
        painter.text(words, Align2::LEFT_CENTER, kind.label(), FontId::proportional(11.0), ink);
        at.y += 15.0;
    }
}
