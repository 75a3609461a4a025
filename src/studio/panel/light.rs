//! The fitted environment: as a map of all directions and as two balls, beside the truth where one is known.

mod known;

use super::empty;
use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use crate::light::Environment;
use crate::light::ball::{matte_ball, mirror_ball};
use crate::math::sphere::direction_of_angles;
use crate::studio::model::Model;
use crate::studio::model::lights::LightName;
use crate::studio::picture::{self, Compare, Comparison, Overlay, PictureView, Place, Source};
use egui::{Align, Layout, RichText, Ui, vec2};
use std::sync::Arc;

/// Side of a ball in pixels.
const BALL_SIDE: usize = 128;

/// What the panel keeps.
#[derive(Default)]
pub struct LightMemory {
    view: PictureView,
    ball_views: [PictureView; 2],
    against_truth: bool,
    wipe: Option<f32>,
    balls: Option<(Arc<Environment>, [Arc<RgbImage>; 2])>,
    picture: Option<(Arc<Environment>, Arc<RgbImage>)>,
    truth: Option<(Arc<Environment>, Arc<RgbImage>)>,
    shows_known: bool,
    known: known::KnownMemory,
}

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut LightMemory) {
    let Some(environment) = model.project.as_ref().and_then(|project| project.environment.clone()) else {
        return empty(ui, "No environment yet", "The estimated environment appears with the first steps of the fit");
    };
    ui.horizontal(|ui| {
        ui.selectable_value(&mut memory.shows_known, false, "Radiance")
            .on_hover_text("Radiance of the estimated environment");
        ui.selectable_value(&mut memory.shows_known, true, "Evidence").on_hover_text(
            "What constrains each direction: highlights, background, diffuse shading, or the prior alone",
        );
    });
    if memory.shows_known {
        return known::show(ui, model, &mut memory.known);
    }
    let truth = model.shelf.find(&LightName::Truth).map(|light| Arc::clone(&light.environment));
    let display = model.edits.display;
    draw(ui, model, memory, "Environment map", &environment, truth, &display);
}

/// Draws an environment under a label in a display of its own, beside a truth where one is known.
pub fn draw(
    ui: &mut Ui,
    model: &mut Model,
    memory: &mut LightMemory,
    label: &str,
    environment: &Arc<Environment>,
    truth: Option<Arc<Environment>>,
    display: &DisplaySettings,
) {
    ui.horizontal_wrapped(|ui| {
        if truth.is_some() {
            ui.checkbox(&mut memory.against_truth, "Against ground truth")
                .on_hover_text("Estimated left, ground truth right; drag the divider");
        }
        let mean = environment.mean_radiance();
        ui.label(
            RichText::new(format!(
                "{} x {} texels, mean radiance {:.3} {:.3} {:.3}",
                environment.width(),
                environment.height(),
                mean.x,
                mean.y,
                mean.z
            ))
            .weak(),
        );
    });
    let source = Source::from(kept(&mut memory.picture, environment));
    let comparison = truth.filter(|_| memory.against_truth).map(|truth| Comparison {
        other: Source::from(kept(&mut memory.truth, &truth)),
        mode: Compare::Wipe(memory.wipe.unwrap_or(0.5)),
        names: ["Estimated".into(), "Ground truth".into()],
    });
    let overlay = Overlay { comparison, badge: "up", ..Overlay::default() };
    let width = ui.available_width();
    let height = (width / 2.0).min(ui.available_height() * 0.62).max(60.0);
    ui.allocate_ui(vec2(width, height), |ui| {
        let response = picture::show(ui, label, &source, display, &mut memory.view, &overlay);
        memory.wipe = response.wipe.or(memory.wipe);
        if let Some(place) = response.hovered {
            let named = place_words(place, (environment.width(), environment.height()));
            model.hovered_value = picture::describe(place, response.value, &named);
        }
    });
    balls(ui, display, memory, environment);
}

/// Azimuth and elevation in degrees of a place on a map of all directions, with their names.
fn place_words(place: Place, size: (usize, usize)) -> [(&'static str, f32); 2] {
    let direction = direction_of_angles(
        place.column / size.0 as f32 * std::f32::consts::TAU,
        place.row / size.1 as f32 * std::f32::consts::PI,
    );
    let azimuth = direction.x.atan2(-direction.z).to_degrees().rem_euclid(360.0);
    [("azimuth", azimuth), ("elevation", direction.y.clamp(-1.0, 1.0).asin().to_degrees())]
}

/// The pixels of a light behind a pointer that stays while the light does.
fn kept(slot: &mut Option<(Arc<Environment>, Arc<RgbImage>)>, environment: &Arc<Environment>) -> Arc<RgbImage> {
    if let Some((own, picture)) = slot
        && Arc::ptr_eq(own, environment)
    {
        return Arc::clone(picture);
    }
    let picture = Arc::new(environment.radiance.clone());
    *slot = Some((Arc::clone(environment), Arc::clone(&picture)));
    picture
}

fn balls(ui: &mut Ui, display: &DisplaySettings, memory: &mut LightMemory, environment: &Arc<Environment>) {
    if memory.balls.as_ref().is_none_or(|(own, _)| !Arc::ptr_eq(own, environment)) {
        let pose = glam::Quat::IDENTITY;
        let mirror = Arc::new(mirror_ball(environment, BALL_SIDE, pose));
        let matte = Arc::new(matte_ball(environment, BALL_SIDE, pose));
        memory.balls = Some((Arc::clone(environment), [mirror, matte]));
    }
    let Some((_, pictures)) = &memory.balls else { return };
    let side = (ui.available_height() - 26.0).min(ui.available_width() / 2.0 - 12.0).clamp(40.0, 220.0);
    ui.with_layout(Layout::left_to_right(Align::Min), |ui| {
        for ((picture, view), (name, label)) in pictures
            .iter()
            .zip(&mut memory.ball_views)
            .zip([("Mirror ball", "Reflection"), ("Grey ball", "Diffuse shading")])
        {
            ui.allocate_ui(vec2(side, side + 20.0), |ui| {
                ui.vertical(|ui| {
                    ui.allocate_ui(vec2(side, side), |ui| {
                        let source = Source::from(Arc::clone(picture));
                        let overlay = Overlay { without_numbers: true, ..Overlay::default() };
                        picture::show(ui, name, &source, display, view, &overlay);
                    });
                    ui.label(RichText::new(label).small().weak());
                });
            });
        }
    });
}
