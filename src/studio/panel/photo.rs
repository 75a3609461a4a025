//! The chosen photo beside its render by the fit: wipe, difference, and the linked cursor.

use super::stage::cursor_in_view;
use super::{act_button_named, empty};
use crate::image::RgbImage;
use crate::insight::cursor::point_of_pixel;
use crate::job::preview::{Preview, PreviewRequest};
use crate::material::MaterialMaps;
use crate::scene::PixelState;
use crate::studio::act::Act;
use crate::studio::layout::Panel;
use crate::studio::model::{Cursor, FitStatus, Model};
use crate::studio::picture::{self, Compare, Comparison, Mark, Overlay, PictureView, Place, Source};
use crate::studio::theme;
use egui::{RichText, Ui};
use glam::Vec2;
use std::sync::Arc;
use std::time::Instant;

/// Paths a pixel of the render.
const SAMPLES: usize = 64;
/// Pixels of the render, at most.
const MOST_PIXELS: usize = 300_000;
/// Seconds between two renders of a photo while a fit runs.
const RENDER_INTERVAL: f32 = 8.0;

/// How photo and render are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Show {
    #[default]
    Photo,
    Render,
    Wipe,
    Difference,
}

/// What the panel keeps.
#[derive(Default)]
pub struct PhotoMemory {
    show: Show,
    masked: bool,
    wipe: Option<f32>,
    view: PictureView,
    photo: Option<(usize, usize, Arc<RgbImage>)>,
    hatched: Option<(usize, usize, Arc<crate::image::Image<bool>>)>,
    preview: Option<Preview>,
    asked: Option<(Arc<MaterialMaps>, usize, Instant)>,
    key: u64,
    render: Option<(usize, Arc<RgbImage>)>,
    seen: u64,
    failures: u64,
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
        memory.render = None;
        memory.asked = None;
    }
    let name = scene.views[view].name.clone();
    controls(ui, model, memory, &name);
    if memory.show != Show::Photo {
        render(model, memory, view);
    }
    let Some((.., photo)) = memory.photo.clone() else { return };
    let own = Source::from(photo);
    let rendered = memory
        .render
        .as_ref()
        .filter(|(index, _)| *index == view)
        .map(|(_, picture)| Source::from(Arc::clone(picture)));
    let names = ["Photo".to_owned(), "Render".to_owned()];
    let compared = |mode| rendered.clone().map(|other| Comparison { other, mode, names: names.clone() });
    let comparison = match memory.show {
        Show::Photo => None,
        Show::Render => compared(Compare::Flip(true)),
        Show::Wipe => compared(Compare::Wipe(memory.wipe.unwrap_or(0.5))),
        Show::Difference => compared(Compare::Difference { signed: true, gain_stops: 2.0 }),
    };
    let badge = match (memory.show, &comparison) {
        (Show::Photo, _) => name.clone(),
        (_, None) => format!("{name}: rendering"),
        (Show::Render, _) => format!("{name}: render"),
        (Show::Wipe, _) => format!("{name}: photo left, render right"),
        (Show::Difference, _) => format!("{name}: green where the photo is brighter, red where the render is, x 4"),
    };
    let colours = theme::palette(ui.visuals());
    let marks: Vec<Mark> = cursor_in_view(model, view)
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
        let cursor = cursor_at(model, &scene, view, place);
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
            (Show::Photo, "Photo only", "The photo as it was read, linear"),
            (
                Show::Render,
                "Render",
                "The same view, path traced with the estimated maps and environment, in the photo's exposure",
            ),
            (Show::Wipe, "Wipe", "Photo left, render right; drag the divider"),
            (Show::Difference, "Difference", "Luminance of photo minus render"),
        ] {
            let enabled = show == Show::Photo || has_maps;
            let button = egui::Button::selectable(memory.show == show, label);
            let response = ui.add_enabled(enabled, button).on_hover_text(help);
            if response.on_disabled_hover_text("No maps yet. Start a fit first.").clicked() {
                memory.show = show;
            }
        }
        ui.separator();
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

/// Asks for the render of the view when maps or view changed, and takes in what is there.
fn render(model: &mut Model, memory: &mut PhotoMemory, view: usize) {
    let Some(project) = &model.project else { return };
    let (Some(scene), Some(surface), Some(maps)) = (&project.scene, &project.surface, &project.maps) else { return };
    let running = matches!(model.fit.status, FitStatus::Running | FitStatus::Pausing | FitStatus::Finishing(_));
    let due = match &memory.asked {
        None => true,
        Some((own, index, then)) => {
            *index != view || (!Arc::ptr_eq(own, maps) && (!running || then.elapsed().as_secs_f32() > RENDER_INTERVAL))
        }
    };
    if due {
        if memory.preview.is_none() {
            match Preview::start(1, Some(Arc::clone(&model.wake))) {
                Ok(preview) => memory.preview = Some(preview),
                Err(error) => return model.log.error(&error),
            }
        }
        let camera = &scene.views[view].camera;
        let camera = camera.shrunk(1 << camera.level_within(MOST_PIXELS));
        let Some(parameters) = model.run_parameters() else { return };
        memory.key += 1;
        let request = PreviewRequest {
            surface: Arc::clone(surface),
            parameters: Arc::new(parameters),
            camera,
            settings: crate::render::picture::PictureSettings {
                background_visible: scene.background == crate::scene::Background::Environment,
                max_bounces: model.edits.fit.bounces,
                ..model.picture_settings(1)
            },
            samples_target: if running { SAMPLES / 4 } else { SAMPLES },
            coarse_first: true,
            key: memory.key,
        };
        memory.asked = Some((Arc::clone(maps), view, Instant::now()));
        if let Some(preview) = &memory.preview {
            // A fit keeps its pace: a picture beside it may take its time.
            preview.set_share(if running { 0.1 } else { 1.0 });
            preview.request(request);
        }
    }
    if let Some(preview) = &memory.preview
        && let Some((number, picture)) = preview.pictures.newest()
        && number > memory.seen
    {
        memory.seen = number;
        if picture.key == memory.key {
            // What the fit takes for the photo's exposure is no difference between the two.
            let gain = model.gains().get(view).copied().unwrap_or(1.0);
            memory.render = Some((view, Arc::new(picture.picture.map(|radiance| *radiance * gain))));
        }
    }
    if let Some(preview) = &memory.preview
        && let Some((number, failure)) = preview.failures.newest()
        && number > memory.failures
    {
        memory.failures = number;
        model.log.error(&failure.error);
    }
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
