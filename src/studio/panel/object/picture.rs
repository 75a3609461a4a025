//! Photo and re-render: beside each other, wiped, and the logarithm of their ratio.

use crate::image::value_scale::{Palette, ValueScale};
use crate::image::{GreyImage, Image, RgbImage};
use crate::job::object::PhotoSeen;
use crate::studio::model::Model;
use crate::studio::panel::empty;
use crate::studio::picture::scale_bar::scale_bar;
use crate::studio::picture::{self, Compare, Comparison, Overlay, PictureView, Source};
use crate::studio::workspace::Workspace;
use egui::{ComboBox, RichText, Ui, vec2};
use std::sync::Arc;

/// Largest logarithm of the error's colour scale: a factor of about 1.65.
const ERROR_REACH: f32 = 0.5;

/// How photo and re-render are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Show {
    #[default]
    Beside,
    Wipe,
    Difference,
    LogError,
}

/// The pixels of an object, and those beside it.
type Hatched = (Arc<Image<bool>>, Arc<Image<bool>>);

/// What the panel keeps.
#[derive(Default)]
pub struct PictureMemory {
    show: Show,
    masked: bool,
    wipe: Option<f32>,
    view: PictureView,
    error_view: PictureView,
    hatched: Option<Hatched>,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut PictureMemory) {
    debug_assert_eq!(model.workspace, Workspace::Object);
    let count = model.object.photos.len();
    model.object.chosen_photo = model.object.chosen_photo.min(count.saturating_sub(1));
    let Some(photo) = model.object.photos.get(model.object.chosen_photo).cloned() else {
        return empty(
            ui,
            "No photo yet",
            "Drop a photo of a sphere, or of an object with its mesh and camera, then start the estimation",
        );
    };
    controls(ui, model, memory, &photo);
    let rendered = model.object.pictures();
    match (memory.show, rendered) {
        (Show::Beside, rendered) => beside(ui, model, memory, &photo, rendered.map(|(picture, _)| picture)),
        (Show::LogError, Some((_, error))) => log_error(ui, model, memory, error),
        (show, Some((picture, _))) => compared(ui, model, memory, &photo, picture, show),
        (_, None) => empty(ui, "No re-render yet", "It appears after the first round"),
    }
}

fn controls(ui: &mut Ui, model: &mut Model, memory: &mut PictureMemory, photo: &PhotoSeen) {
    ui.horizontal_wrapped(|ui| {
        for (show, label, help) in [
            (Show::Beside, "Beside each other", "Photo left, re-render right"),
            (Show::Wipe, "Wipe", "Photo left of a line, re-render right of it; drag the line"),
            (Show::Difference, "Difference", "Green where the photo is brighter, red where the re-render is, x 4"),
            (Show::LogError, "Log error", "Natural logarithm of re-render over photo, of luminance"),
        ] {
            let button = ui.add(egui::Button::selectable(memory.show == show, label));
            if button.on_hover_text(help).clicked() {
                memory.show = show;
            }
        }
        ui.separator();
        ui.checkbox(&mut memory.masked, "Mask").on_hover_text("Hatches pixels that do not show the object");
        if ui.button("Fit view").on_hover_text("Show the whole photo").clicked() {
            memory.view.fit();
            memory.error_view.fit();
        }
        if model.object.photos.len() > 1 {
            let chosen = &mut model.object.chosen_photo;
            let list = ComboBox::from_id_salt("photo of the object").selected_text(&photo.name).show_ui(ui, |ui| {
                for (index, other) in model.object.photos.iter().enumerate() {
                    ui.selectable_value(chosen, index, &other.name);
                }
            });
            list.response.accessible_name("Photo of the object");
        }
        let error = match (&model.object.outcome, &model.object.look) {
            (Some(outcome), _) => Some(outcome.parts.estimate.picture_log_rmse),
            (None, Some(look)) => Some(look.log_rmse),
            (None, None) => None,
        };
        if let Some(error) = error {
            ui.label(RichText::new(format!("log RMSE {error:.3}")).weak())
                .on_hover_text("Root mean square of the logarithm of re-render over photo");
        }
    });
}

/// Pixels that do not show the object, made once a photo.
fn hatched(memory: &mut PictureMemory, photo: &PhotoSeen) -> Option<Arc<Image<bool>>> {
    if !memory.masked {
        return None;
    }
    if memory.hatched.as_ref().is_none_or(|(own, _)| !Arc::ptr_eq(own, &photo.is_object)) {
        let inverse = photo.is_object.map(|inside| !inside);
        memory.hatched = Some((Arc::clone(&photo.is_object), Arc::new(inverse)));
    }
    memory.hatched.as_ref().map(|(_, mask)| Arc::clone(mask))
}

fn beside(
    ui: &mut Ui,
    model: &mut Model,
    memory: &mut PictureMemory,
    photo: &PhotoSeen,
    rendered: Option<Arc<RgbImage>>,
) {
    let mask = hatched(memory, photo);
    let size = vec2((ui.available_width() - 8.0) / 2.0, ui.available_height());
    let own = Source::from(Arc::clone(&photo.radiance));
    let display = model.edits.display;
    ui.horizontal_top(|ui| {
        ui.spacing_mut().item_spacing.x = 8.0;
        let (view, badge) = (&mut memory.view, format!("photo {}", photo.name));
        let mut column = |ui: &mut Ui, label: &str, source: &Source, badge: &str, mask| {
            ui.allocate_ui(size, |ui| {
                let overlay = Overlay { mask, badge, ..Overlay::default() };
                let response = picture::show(ui, label, source, &display, view, &overlay);
                if let Some(words) = response.description() {
                    model.hovered_value = words;
                }
            });
        };
        column(ui, "Photo of the object", &own, &badge, mask);
        match rendered {
            Some(picture) => column(ui, "Re-render of the object", &Source::from(picture), "re-render", None),
            None => {
                ui.vertical_centered(|ui| empty(ui, "No re-render yet", "It appears after the first round"));
            }
        }
    });
}

fn compared(
    ui: &mut Ui,
    model: &mut Model,
    memory: &mut PictureMemory,
    photo: &PhotoSeen,
    picture: Arc<RgbImage>,
    show: Show,
) {
    let mask = hatched(memory, photo);
    let mode = match show {
        Show::Difference => Compare::Difference { signed: true, gain_stops: 2.0 },
        _ => Compare::Wipe(memory.wipe.unwrap_or(0.5)),
    };
    let names = ["Photo".to_owned(), "Re-render".to_owned()];
    let comparison = Some(Comparison { other: Source::from(picture), mode, names });
    let overlay = Overlay { comparison, mask, ..Overlay::default() };
    let own = Source::from(Arc::clone(&photo.radiance));
    let label = "Photo and re-render";
    let response = picture::show(ui, label, &own, &model.edits.display, &mut memory.view, &overlay);
    memory.wipe = response.wipe.or(memory.wipe);
    if let Some(words) = response.description() {
        model.hovered_value = words;
    }
}

fn log_error(ui: &mut Ui, model: &mut Model, memory: &mut PictureMemory, image: Arc<GreyImage>) {
    let scale = ValueScale::linear(-ERROR_REACH, ERROR_REACH);
    scale_bar(ui, "Log error scale", &scale, Palette::Diverging, "ln(re-render / photo)");
    let source = Source::Numbers { image, scale, palette: Palette::Diverging };
    let overlay = Overlay { badge: "log error", ..Overlay::default() };
    let view = &mut memory.error_view;
    let response = picture::show(ui, "Log error of the re-render", &source, &model.edits.display, view, &overlay);
    if let Some(words) = response.description() {
        model.hovered_value = words;
    }
}
