//! The chosen photo, or the render of another run, beside its render by the fit: overlay, wipe, difference, blink, and the
//! linked cursor.

mod render;

use super::stage::cursor_in_view;
use super::{act_button_named, empty};
use crate::image::RgbImage;
use crate::insight::cursor::point_of_pixel;
use crate::scene::PixelState;
use crate::studio::act::Act;
use crate::studio::model::{Cursor, Model};
use crate::studio::picture::{self, Compare, Comparison, Mark, Overlay, PictureView, Place, Source};
use crate::studio::theme;
use crate::studio::workspace::Panel;
use egui::{ComboBox, RichText, Ui};
use glam::Vec2;
use render::{Rendering, Whose};
use std::sync::Arc;

/// How photo and render are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Show {
    #[default]
    Photo,
    Render,
    Overlay,
    Wipe,
    Difference,
    Blink,
}

/// What the panel keeps.
#[derive(Default)]
pub struct PhotoMemory {
    show: Show,
    masked: bool,
    wipe: Option<f32>,
    opacity: Opacity,
    view: PictureView,
    photo: Option<(usize, usize, Arc<RgbImage>)>,
    hatched: Option<(usize, usize, Arc<crate::image::Image<bool>>)>,
    render: Rendering,
    /// The same view of the other run.
    other: Rendering,
    /// Whether the other run stands in the photo's place.
    against_run: bool,
}

/// How opaque the render lies over the photo; half at first.
struct Opacity(f32);

impl Default for Opacity {
    fn default() -> Self {
        Opacity(0.5)
    }
}

/// Seconds that photo and render are each shown when they blink.
const BLINK_SECONDS: f64 = 0.6;

/// Whether the render is shown now, of photo and render in turn; asks for the next turn.
fn blink(ui: &Ui) -> bool {
    let turns = ui.input(|input| input.time) / BLINK_SECONDS;
    let left = (1.0 - turns.fract()) * BLINK_SECONDS;
    ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(left.max(0.01)));
    turns as u64 % 2 == 1
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut PhotoMemory) {
    let Some((scene, view)) = model.project.as_ref().and_then(|project| {
        let scene = Arc::clone(project.scene.as_ref()?);
        (project.chosen_view < scene.views.len()).then_some((scene, project.chosen_view))
    }) else {
        return empty(ui, "No photo", "Open a scene; a run whose scene has moved has no photos");
    };
    let key = Arc::as_ptr(&scene) as usize;
    if memory.photo.as_ref().is_none_or(|(own, index, _)| (*own, *index) != (key, view)) {
        memory.photo = Some((key, view, Arc::new(scene.views[view].photo.to_linear())));
        let hatched = scene.views[view].states.map(|state| *state == PixelState::Ignored);
        memory.hatched = Some((key, view, Arc::new(hatched)));
        memory.render.forget();
        memory.other.forget();
    }
    let name = scene.views[view].name.clone();
    controls(ui, model, memory, &name);
    memory.against_run &= model.other_run.is_some();
    if memory.show != Show::Photo {
        memory.render.update(model, view, Whose::Own);
    }
    if memory.against_run {
        memory.other.update(model, view, Whose::Other);
    }
    let Some((.., photo)) = memory.photo.clone() else { return };
    let reference = match (memory.against_run, &model.other_run) {
        (true, Some(other)) => memory.other.picture(view).map(|picture| (picture, other.name.clone())),
        _ => Some((photo, "Photo".to_owned())),
    };
    let Some((reference, reference_name)) = reference else {
        ui.label("Rendering the other run…");
        return;
    };
    let own = Source::from(reference);
    // The render of another run may be smaller than the photo.
    let (camera, (width, height)) = (&scene.views[view].camera, own.size());
    let photo_per_own = Vec2::new(camera.width as f32 / width as f32, camera.height as f32 / height as f32);
    let rendered = memory.render.picture(view).map(Source::from);
    let names = [reference_name.clone(), "Render".to_owned()];
    let compared = |mode| rendered.clone().map(|other| Comparison { other, mode, names: names.clone() });
    let comparison = match memory.show {
        Show::Photo => None,
        Show::Render => compared(Compare::Flip(true)),
        Show::Overlay => compared(Compare::Blend(memory.opacity.0)),
        Show::Blink => compared(Compare::Flip(blink(ui))),
        Show::Wipe => compared(Compare::Wipe(memory.wipe.unwrap_or(0.5))),
        Show::Difference => compared(Compare::Difference { signed: true, gain_stops: 2.0 }),
    };
    let badge = match (memory.show, &comparison) {
        (Show::Photo, _) => name.clone(),
        (_, None) => format!("{name}: rendering"),
        (Show::Render | Show::Overlay | Show::Blink, _) => name.clone(),
        (Show::Wipe, _) => format!("{name}: {} left, render right", reference_name.to_lowercase()),
        (Show::Difference, _) => {
            format!("{name}: green where {} is brighter, red where the render is, x 4", reference_name.to_lowercase())
        }
    };
    let colours = theme::palette(ui.visuals());
    let marks: Vec<Mark> = cursor_in_view(model, view)
        .map(|place| place / photo_per_own)
        .map(|place| Mark {
            place: Place { row: place.y, column: place.x },
            label: String::new(),
            colour: colours.accent,
        })
        .into_iter()
        .collect();
    let mask = memory.hatched.as_ref().filter(|_| memory.masked).map(|(.., mask)| Arc::clone(mask));
    go_to_pixel(model, memory, &name);
    let overlay = Overlay { comparison, mask, marks: &marks, badge: &badge, ..Overlay::default() };
    let response = picture::show(ui, "Photo", &own, &model.edits.display, &mut memory.view, &overlay);
    memory.wipe = response.wipe.or(memory.wipe);
    if let Some(place) = response.hovered {
        let in_photo = Place { row: place.row * photo_per_own.y, column: place.column * photo_per_own.x };
        let cursor = cursor_at(model, &scene, view, in_photo);
        if response.clicked.is_some() {
            model.cursor = cursor.map(|cursor| Cursor { pinned: true, ..cursor });
        } else {
            model.move_cursor(cursor);
        }
        model.hovered_value = picture::describe(place, response.value, &[]);
    }
}

fn controls(ui: &mut Ui, model: &mut Model, memory: &mut PhotoMemory, name: &str) {
    ui.horizontal_wrapped(|ui| {
        act_button_named(ui, model, Act::PreviousView, "Previous");
        act_button_named(ui, model, Act::NextView, "Next");
        ui.separator();
        let has_maps =
            model.project.as_ref().is_some_and(|project| project.maps.is_some() && project.surface.is_some());
        for (show, label, help) in [
            (Show::Photo, "Photo only", "The photo as it was read, linear; of a run that is compared, its render"),
            (
                Show::Render,
                "Render",
                "The same view, path traced with the estimated maps and environment, in the photo's exposure",
            ),
            (Show::Overlay, "Overlay", "Render over the photo, as opaque as the slider says"),
            (Show::Wipe, "Wipe", "Photo left, render right; drag the divider"),
            (Show::Difference, "Difference", "Luminance of photo minus render"),
            (Show::Blink, "Blink", "Photo and render in turn: what differs seems to move"),
        ] {
            let enabled = show == Show::Photo || has_maps;
            let button = egui::Button::selectable(memory.show == show, label);
            let response = ui.add_enabled(enabled, button).on_hover_text(help);
            if response.on_disabled_hover_text("No maps yet. Start a fit first.").clicked() {
                memory.show = show;
            }
        }
        if memory.show == Show::Overlay {
            ui.add(egui::Slider::new(&mut memory.opacity.0, 0.0..=1.0).show_value(false))
                .accessible_name("Opacity of the render")
                .on_hover_text("Opacity of the render over the photo");
        }
        ui.separator();
        against(ui, model, memory);
        ui.checkbox(&mut memory.masked, "Excluded pixels")
            .on_hover_text("Hatch pixels that are not used: masked or damaged");
        if ui.button("Fit view").on_hover_text("Show the whole photo").clicked() {
            memory.view.fit();
        }
        let project = model.project.as_ref();
        let error = project.and_then(|project| project.view_errors.get(project.chosen_view).copied().flatten());
        if let Some(error) = error {
            ui.label(RichText::new(format!("{name}: RMSE {error:.4}")).weak());
        }
    });
}

/// What the render is held against: the photo, or the render of another run.
fn against(ui: &mut Ui, model: &mut Model, memory: &mut PhotoMemory) {
    let Some(other) = model.other_run.clone() else {
        act_button_named(ui, model, Act::CompareRun, "Compare run…");
        return;
    };
    let label = ui.label("Against");
    let chosen = if memory.against_run { other.name.clone() } else { "Photo".to_owned() };
    let list = ComboBox::from_id_salt("reference").selected_text(chosen).show_ui(ui, |ui| {
        ui.selectable_value(&mut memory.against_run, false, "Photo");
        ui.selectable_value(&mut memory.against_run, true, &other.name);
        act_button_named(ui, model, Act::CompareRun, "Compare run…");
    });
    list.response.labelled_by(label.id).on_hover_text("What the render is held against");
}

/// The surface under a place of the photo.
fn cursor_at(model: &Model, scene: &crate::scene::Scene, view: usize, place: Place) -> Option<Cursor> {
    let surface = model.project.as_ref()?.surface.as_ref()?;
    let point = point_of_pixel(scene, surface, view, Vec2::new(place.column, place.row))?;
    let (position, normal, uv) = (point.position, point.shading_normal, point.uv);
    Some(Cursor { over: Panel::Photo, position, normal, uv, pinned: false })
}

/// Follows a finding to its pixel.
fn go_to_pixel(model: &mut Model, memory: &mut PhotoMemory, name: &str) {
    let Some(crate::error::Place::Pixel { view, row, column }) = &model.go_to else { return };
    if view != name {
        return;
    }
    memory.view.set_zoom(12.0);
    memory.view.centre_on(Place { row: *row as f32 + 0.5, column: *column as f32 + 0.5 });
    model.go_to = None;
}
