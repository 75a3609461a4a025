//! What acts do.

use super::act::availability::availability;
use super::act::{Act, Group, LIST};
use super::layout::{Layout, Panel};
use super::model::edits::PhotoLook;
use super::model::lights::LightName;
use super::model::{Dialog, Model, PickFor, SaveWhat, Workspace};
use super::stage::Layer;
use crate::image::display::{DisplaySettings, ToneCurve};
use egui::{Context, ViewportCommand};

/// Degrees by which a key turns the light.
const TURN_DEGREES: f32 = 15.0;

/// Does an act; one that cannot be done now says why instead. `layout` is that of the workspace that is shown.
pub fn perform(act: Act, model: &mut Model, layout: &mut Layout, context: &Context) {
    if let Err(why) = availability(act, model) {
        model.log.note(format!("{}: {why}", act.bare_name()));
        return;
    }
    if let Some(panel) = Panel::of(act) {
        model.switches.alone = false;
        model.workspace = panel.workspace(model.workspace);
        model.activate = Some(panel);
        return;
    }
    match act {
        Act::OpenFolder => model.dialog = Dialog::Path { purpose: PickFor::Open, text: String::new() },
        Act::AddLight => model.dialog = Dialog::Path { purpose: PickFor::Light, text: String::new() },
        Act::OpenDemo => model.open_demo(),
        Act::CloseProject => model.close(),
        Act::SavePicture => model.ask_to_save(SaveWhat::Picture),
        Act::SaveTurntable => model.ask_to_save(SaveWhat::Turntable),
        Act::SaveLightStrip => model.ask_to_save(SaveWhat::Strip),
        Act::OpenReport => {
            if let Some(folder) = &model.fit.folder {
                let url = format!("file://{}", folder.report_html_path().display());
                context.open_url(egui::OpenUrl::new_tab(url));
            }
        }
        Act::Quit => context.send_viewport_cmd(ViewportCommand::Close),
        Act::Undo => model.history.undo(&mut model.edits),
        Act::Redo => model.history.redo(&mut model.edits),
        Act::Palette => model.dialog = Dialog::Palette(String::new()),
        Act::Help => model.dialog = Dialog::Help,
        Act::NextTheme => model.preferences.theme = model.preferences.theme.next(),
        Act::ZoomIn => context.set_zoom_factor((context.zoom_factor() + 0.1).min(3.0)),
        Act::ZoomOut => context.set_zoom_factor((context.zoom_factor() - 0.1).max(0.6)),
        Act::ZoomReset => context.set_zoom_factor(1.0),
        Act::HideInterface => model.switches.alone = !model.switches.alone,
        Act::ResetLayout => *layout = Layout::of(model.workspace),
        Act::Start
        | Act::PauseOrGoOn
        | Act::Stop
        | Act::StepOnce
        | Act::Checkpoint
        | Act::LeaveOut
        | Act::SurfaceLayers => perform_on_fit(act, model),
        _ if act.info().group == Group::Object => perform_on_object(act, model, context),
        _ => perform_on_view(act, model),
    }
}

fn perform_on_object(act: Act, model: &mut Model, context: &Context) {
    match act {
        Act::SceneWorkspace => model.workspace = Workspace::Scene,
        Act::ObjectWorkspace => {
            model.workspace = Workspace::Object;
            model.switches.alone = false;
        }
        Act::OpenPhoto => {
            model.workspace = Workspace::Object;
            model.dialog = Dialog::Path { purpose: PickFor::ObjectPhoto, text: String::new() };
        }
        Act::ObjectStart => {
            model.workspace = Workspace::Object;
            model.start_object();
        }
        Act::ObjectStop => model.object.stop(),
        Act::ObjectRelight => {
            model.relight_object();
            model.activate = Some(Panel::Relit);
        }
        Act::ObjectSave => model.dialog = Dialog::Path { purpose: PickFor::ObjectResult, text: String::new() },
        Act::ObjectReport => {
            if let Some(folder) = model.object.outcome.as_ref().and_then(|outcome| outcome.folder.as_ref()) {
                let url = format!("file://{}", folder.join("report.html").display());
                context.open_url(egui::OpenUrl::new_tab(url));
            }
        }
        Act::OpenMaterial => {
            model.workspace = Workspace::Object;
            model.dialog = Dialog::Path { purpose: PickFor::Material, text: String::new() };
        }
        Act::NextMaterial => model.step_material(1),
        Act::PreviousMaterial => model.step_material(-1),
        _ => {}
    }
}

fn perform_on_fit(act: Act, model: &mut Model) {
    use crate::job::Command;
    match act {
        Act::Start => model.start_fit(),
        Act::PauseOrGoOn => model.fit.pause_or_go_on(),
        Act::Stop => model.fit.stop(),
        Act::StepOnce => model.fit.send(Command::StepOnce),
        Act::Checkpoint => model.fit.send(Command::Checkpoint),
        Act::LeaveOut => {
            let Some(name) = model.project.as_ref().and_then(|project| project.chosen_name()) else { return };
            let name = name.to_owned();
            let left_out = &mut model.edits.fit.exclude;
            match left_out.iter().position(|other| *other == name) {
                Some(place) => {
                    left_out.remove(place);
                }
                None => left_out.push(name),
            }
        }
        Act::SurfaceLayers => model.measure_layers(),
        _ => {}
    }
}

fn perform_on_view(act: Act, model: &mut Model) {
    let edits = &mut model.edits;
    match act {
        Act::FitView => model.frame_scene(),
        Act::LookThrough => model.look_through(!model.switches.looking_through),
        Act::NextView | Act::PreviousView => {
            if let Some(project) = &mut model.project {
                project.choose_next(if act == Act::NextView { 1 } else { -1 });
            }
        }
        Act::ShowPhoto => {
            edits.photo = if edits.photo == PhotoLook::Off { PhotoLook::Over(1.0) } else { PhotoLook::Off };
            let on = edits.photo != PhotoLook::Off;
            model.look_through(on || model.switches.looking_through);
        }
        Act::WipePhoto => {
            edits.photo = if matches!(edits.photo, PhotoLook::Wipe(_)) { PhotoLook::Off } else { PhotoLook::Wipe(0.5) };
            let on = edits.photo != PhotoLook::Off;
            model.look_through(on || model.switches.looking_through);
        }
        Act::ErrorOverlay => {
            let on = edits.layer == Layer::PhotoError;
            edits.layer = if on { Layer::Lit } else { Layer::PhotoError };
            if !on && model.project.as_ref().is_some_and(|project| project.photo_error.is_none()) {
                model.measure_layers();
            }
        }
        Act::Traced => model.switches.traced = !model.switches.traced,
        Act::Frustums => model.switches.frustums = !model.switches.frustums,
        Act::Thumbnails => model.switches.thumbnails = !model.switches.thumbnails,
        Act::ChartBorders => model.switches.chart_borders = !model.switches.chart_borders,
        Act::LayerLit => edits.layer = Layer::Lit,
        Act::LayerDiffuse => edits.layer = Layer::Diffuse,
        Act::LayerSpecular => edits.layer = Layer::Specular,
        Act::LayerRoughness => edits.layer = Layer::Roughness,
        Act::LayerNormal => edits.layer = Layer::Normal,
        Act::LayerTimesSeen => {
            edits.layer = Layer::TimesSeen;
            // A run that was opened brings its own.
            if model.project.as_ref().is_some_and(|project| project.times_seen.is_none()) {
                model.measure_layers();
            }
        }
        Act::LayerDiffuseDeviation => edits.layer = Layer::DiffuseDeviation,
        Act::LayerSpecularDeviation => edits.layer = Layer::SpecularDeviation,
        Act::LayerRoughnessDeviation => edits.layer = Layer::RoughnessDeviation,
        Act::LayerLobeSharing => edits.layer = Layer::LobeSharing,
        Act::LayerChoice => edits.layer = Layer::Choice,
        Act::LayerPhotoError | Act::LayerCoverage | Act::LayerDisagreement => {
            edits.layer = match act {
                Act::LayerPhotoError => Layer::PhotoError,
                Act::LayerCoverage => Layer::Coverage,
                _ => Layer::Disagreement,
            };
            if model.project.as_ref().is_some_and(|project| project.photo_error.is_none()) {
                model.measure_layers();
            }
        }
        Act::ExposureUp => edits.display.exposure_stops = (edits.display.exposure_stops + 0.25).min(20.0),
        Act::ExposureDown => edits.display.exposure_stops = (edits.display.exposure_stops - 0.25).max(-20.0),
        Act::ExposureAuto => model.measure_exposure(),
        Act::ResetDisplay => edits.display = DisplaySettings::default(),
        Act::NextCurve => {
            let curves = ToneCurve::NAMED;
            let place = curves.iter().position(|(curve, _)| *curve == edits.display.curve).unwrap_or(0);
            edits.display.curve = curves[(place + 1) % curves.len()].0;
        }
        Act::FalseColour => edits.display.false_colour = !edits.display.false_colour,
        Act::Stripes => edits.display.stripes = !edits.display.stripes,
        Act::NextLight | Act::PreviousLight => {
            let places = if act == Act::NextLight { 1 } else { -1 };
            if let Some(name) = model.shelf.step(&edits.relight.first, places) {
                edits.relight.first = name;
                edits.layer = Layer::Lit;
            }
        }
        Act::FittedLight => {
            edits.relight.first = LightName::Fitted;
            edits.relight.turn_degrees = 0.0;
            edits.relight.strength_stops = 0.0;
        }
        Act::SecondLight => {
            edits.relight.second = match &edits.relight.second {
                Some(_) => None,
                None => model.shelf.step(&edits.relight.first, 1),
            };
            edits.layer = Layer::Lit;
        }
        Act::TurnLightLeft | Act::TurnLightRight => {
            let turn = if act == Act::TurnLightLeft { TURN_DEGREES } else { -TURN_DEGREES };
            edits.relight.turn_degrees = (edits.relight.turn_degrees + turn).rem_euclid(360.0);
        }
        Act::LightStrip => {
            model.show_strip();
            model.activate = Some(Panel::Relight);
        }
        Act::LightBackground => edits.relight.as_background = !edits.relight.as_background,
        _ => debug_assert!(LIST.iter().any(|info| info.act == act), "{act:?} is not in the list"),
    }
}
