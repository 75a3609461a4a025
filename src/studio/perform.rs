//! What acts do.

use super::act::Act;
use super::act::availability::availability;
use super::layout::Layout;
use super::model::edits::PhotoLook;
use super::model::lights::LightName;
use super::model::log::Log;
use super::model::tasks::TaskKind;
use super::model::{Dialog, Model, PickFor, SaveWhat};
use super::stage::Layer;
use super::workspace::{Panel, Workspace};
use crate::error::{Error, ErrorKind, Place};
use crate::image::display::{DisplaySettings, ToneCurve};
use crate::job::Command;
use egui::{Context, ViewportCommand};
use std::path::Path;

/// Degrees by which a key rotates the environment.
const TURN_DEGREES: f32 = 15.0;

/// Does an act; one that cannot be done now says why instead. `layout` is that of the workspace that is shown.
pub fn perform(act: Act, model: &mut Model, layout: &mut Layout, context: &Context) {
    if let Err(why) = availability(act, model) {
        model.log.note(format!("{}: {why}", act.bare_name()));
        return;
    }
    let ask = |purpose| Dialog::Path { purpose, text: String::new() };
    match act {
        Act::OpenFolder => model.dialog = ask(PickFor::Open),
        Act::QueueScene => model.dialog = ask(PickFor::Queue),
        Act::Import => model.ask_to_import(None),
        Act::AddLightFolder => model.dialog = ask(PickFor::LightFolder),
        Act::AddLight => model.dialog = ask(PickFor::Light),
        Act::OpenDemo => model.open_demo(),
        Act::CloseProject => model.close(),
        Act::Export => model.ask_to_export(),
        Act::SavePicture => model.ask_to_save(SaveWhat::Picture),
        Act::SaveTurntable => model.ask_to_save(SaveWhat::Turntable),
        Act::SaveFitFilm => model.ask_to_save(SaveWhat::FitFilm),
        Act::SaveLightStrip => model.ask_to_save(SaveWhat::Strip),
        Act::OpenReport => {
            if let Some(folder) = &model.fit.folder {
                open_file(&folder.report_html_path(), &mut model.log, context);
            }
        }
        Act::OpenRunFolder => {
            if let Some(folder) = &model.fit.folder {
                open_file(folder.path(), &mut model.log, context);
            }
        }
        Act::Quit => context.send_viewport_cmd(ViewportCommand::Close),
        Act::Undo => model.history.undo(&mut model.edits),
        Act::Redo => model.history.redo(&mut model.edits),

        Act::Start => model.start_fit(),
        Act::PauseOrGoOn => model.fit.pause_or_go_on(),
        Act::Stop => model.stop_fit(),
        Act::StepOnce => model.fit.send(Command::StepOnce),
        Act::Checkpoint => model.fit.send(Command::Checkpoint),

        Act::FitView => model.frame_scene(),
        Act::NavigatePatina | Act::NavigateBlender | Act::NavigateMaya => {
            model.preferences.navigation = act.navigation().unwrap_or_default();
        }
        Act::LookThrough => model.look_through(!model.switches.looking_through),
        Act::NextView => choose_next(model, 1),
        Act::PreviousView => choose_next(model, -1),
        Act::LeaveOut => toggle_excluded(model),
        Act::ShowPhoto => {
            // Beside a line it is seen in part: now the whole of it is wanted.
            let is_shown = matches!(model.edits.photo, PhotoLook::Over(_));
            show_photo(model, if is_shown { PhotoLook::Off } else { PhotoLook::Over(1.0) });
        }
        Act::WipePhoto => {
            let is_wiped = matches!(model.edits.photo, PhotoLook::Wipe(_));
            show_photo(model, if is_wiped { PhotoLook::Off } else { PhotoLook::Wipe(0.5) });
        }
        Act::CompareRun => model.dialog = ask(PickFor::OtherRun),
        Act::ErrorOverlay if model.edits.layer == Layer::PhotoError => model.edits.layer = Layer::Lit,
        Act::ErrorOverlay | Act::LayerPhotoError => show_computed(model, Layer::PhotoError),
        Act::LayerCoverage => show_computed(model, Layer::Coverage),
        Act::LayerDisagreement => show_computed(model, Layer::Disagreement),
        Act::LayerTimesSeen => show_computed(model, Layer::TimesSeen),
        Act::LayerPhotos => model.edits.layer = Layer::Photos,
        Act::LayerCrossfade => model.edits.layer = Layer::Crossfade,
        Act::LayerLit => model.edits.layer = Layer::Lit,
        Act::LayerDiffuse => model.edits.layer = Layer::Diffuse,
        Act::LayerSpecular => model.edits.layer = Layer::Specular,
        Act::LayerRoughness => model.edits.layer = Layer::Roughness,
        Act::LayerNormal => model.edits.layer = Layer::Normal,
        Act::LayerDiffuseDeviation => model.edits.layer = Layer::DiffuseDeviation,
        Act::LayerSpecularDeviation => model.edits.layer = Layer::SpecularDeviation,
        Act::LayerRoughnessDeviation => model.edits.layer = Layer::RoughnessDeviation,
        Act::LayerLobeSharing => model.edits.layer = Layer::LobeSharing,
        Act::LayerChoice => model.edits.layer = Layer::Choice,
        Act::SurfaceLayers => model.measure_layers(),
        Act::Traced => {
            model.switches.traced = !model.switches.traced;
            match model.switches.traced {
                true => model.cache_transport(),
                // The raster preview needs none.
                false => model.tasks.stop(&TaskKind::CachingTransport),
            }
        }
        Act::Frustums => model.switches.frustums = !model.switches.frustums,
        Act::Thumbnails => model.switches.thumbnails = !model.switches.thumbnails,
        Act::ChartBorders => model.switches.chart_borders = !model.switches.chart_borders,

        Act::ExposureUp => expose(model, 0.25),
        Act::ExposureDown => expose(model, -0.25),
        Act::ExposureAuto => model.measure_exposure(),
        Act::ResetDisplay => model.edits.display = DisplaySettings::default(),
        Act::NextCurve => {
            let curves = ToneCurve::NAMED;
            let curve = &mut model.edits.display.curve;
            let place = curves.iter().position(|(own, _)| own == curve).unwrap_or(0);
            *curve = curves[(place + 1) % curves.len()].0;
        }
        Act::FalseColour => model.edits.display.false_colour = !model.edits.display.false_colour,
        Act::Stripes => model.edits.display.stripes = !model.edits.display.stripes,

        Act::NextLight => step_environment(model, 1),
        Act::PreviousLight => step_environment(model, -1),
        Act::FittedLight => {
            let relight = &mut model.edits.relight;
            relight.first = LightName::Fitted;
            (relight.turn_degrees, relight.strength_stops) = (0.0, 0.0);
        }
        Act::SecondLight => {
            let relight = &mut model.edits.relight;
            relight.second = match &relight.second {
                Some(_) => None,
                None => model.shelf.step(&relight.first, 1),
            };
            model.show_light();
        }
        Act::TurnLightLeft => turn_environment(model, TURN_DEGREES),
        Act::TurnLightRight => turn_environment(model, -TURN_DEGREES),
        Act::LightStrip => {
            model.show_strip();
            model.activate = Some(Panel::Relight);
        }
        Act::LightBackground => model.edits.relight.as_background = !model.edits.relight.as_background,

        Act::SceneWorkspace => model.workspace = Workspace::Scene,
        Act::ObjectWorkspace => {
            model.workspace = Workspace::Object;
            model.switches.alone = false;
        }
        Act::OpenPhoto => {
            model.workspace = Workspace::Object;
            model.dialog = ask(PickFor::ObjectPhoto);
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
        Act::ObjectSave => model.dialog = ask(PickFor::ObjectResult),
        Act::ObjectReport => {
            if let Some(folder) = model.object.outcome.as_ref().and_then(|outcome| outcome.folder.as_ref()) {
                open_file(&folder.join("report.html"), &mut model.log, context);
            }
        }
        Act::OpenMaterial => {
            model.workspace = Workspace::Object;
            model.dialog = ask(PickFor::Material);
        }
        Act::NextMaterial => model.step_material(1),
        Act::PreviousMaterial => model.step_material(-1),

        Act::Palette => model.dialog = Dialog::Palette(String::new()),
        Act::Help => model.dialog = Dialog::Help,
        Act::Guide => model.guide = !model.guide,
        Act::NextTheme => model.preferences.theme = model.preferences.theme.next(),
        Act::ZoomIn => context.set_zoom_factor((context.zoom_factor() + 0.1).min(3.0)),
        Act::ZoomOut => context.set_zoom_factor((context.zoom_factor() - 0.1).max(0.6)),
        Act::ZoomReset => context.set_zoom_factor(1.0),
        Act::HideInterface => model.switches.alone = !model.switches.alone,
        Act::ResetLayout => *layout = Layout::of(model.workspace),

        Act::PanelObject
        | Act::PanelObjectPicture
        | Act::PanelReflectance
        | Act::PanelObjectLight
        | Act::PanelRelit
        | Act::PanelObjective
        | Act::PanelStarts
        | Act::PanelMaterials
        | Act::PanelMaterialMap
        | Act::PanelMaterial
        | Act::PanelFit
        | Act::PanelViews
        | Act::PanelStage
        | Act::PanelPhoto
        | Act::PanelMaps
        | Act::PanelLight
        | Act::PanelRelight
        | Act::PanelRecord
        | Act::PanelCurves
        | Act::PanelMessages
        | Act::PanelScores => show_panel(act, model),
    }
}

fn show_panel(act: Act, model: &mut Model) {
    let Some(panel) = Panel::of(act) else { return };
    model.switches.alone = false;
    model.workspace = panel.workspace(model.workspace);
    model.activate = Some(panel);
}

/// Opens a file or folder with whatever the system shows it by; says so when it is gone.
pub(super) fn open_file(path: &Path, log: &mut Log, context: &Context) {
    if !path.exists() {
        let error = Error::new(ErrorKind::Missing, "this is no longer on disk").at(Place::File(path.into()));
        return log.error(&error.remedy("look whether the folder was moved, and open it again from there"));
    }
    context.open_url(egui::OpenUrl::new_tab(file_url(path)));
}

/// The address of a file: bytes that an address cannot hold are escaped (RFC 3986, section 2.1).
fn file_url(path: &Path) -> String {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let text = path.to_string_lossy().replace('\\', "/");
    let mut url = String::from(if text.starts_with('/') { "file://" } else { "file:///" });
    for byte in text.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'~' | b'/' | b':' => url.push(byte.into()),
            _ => url += &format!("%{byte:02X}"),
        }
    }
    url
}

fn choose_next(model: &mut Model, places: isize) {
    if let Some(project) = &mut model.project {
        project.choose_next(places);
    }
}

fn toggle_excluded(model: &mut Model) {
    let Some(name) = model.project.as_ref().and_then(|project| project.chosen_name()) else { return };
    let name = name.to_owned();
    let excluded = &mut model.edits.fit.exclude;
    match excluded.iter().position(|other| *other == name) {
        Some(place) => {
            excluded.remove(place);
        }
        None => excluded.push(name),
    }
}

fn show_photo(model: &mut Model, look: PhotoLook) {
    model.edits.photo = look;
    model.look_through(look != PhotoLook::Off || model.switches.looking_through);
}

/// Shows a layer that is computed from the photos, and computes it where it is not there. A run that was opened brings
/// some of them.
fn show_computed(model: &mut Model, layer: Layer) {
    model.edits.layer = layer;
    let is_there = model.project.as_ref().is_none_or(|project| match layer {
        Layer::TimesSeen => project.times_seen.is_some(),
        _ => project.photo_error.is_some(),
    });
    if !is_there {
        model.measure_layers();
    }
}

fn expose(model: &mut Model, stops: f32) {
    let exposure = &mut model.edits.display.exposure_stops;
    *exposure = (*exposure + stops).clamp(-20.0, 20.0);
}

fn step_environment(model: &mut Model, places: isize) {
    if let Some(name) = model.shelf.step(&model.edits.relight.first, places) {
        model.choose_light(name);
    }
}

fn turn_environment(model: &mut Model, degrees: f32) {
    let turn = &mut model.edits.relight.turn_degrees;
    *turn = (*turn + degrees).rem_euclid(360.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn addresses_of_files_escape_blanks_and_what_is_not_ascii() {
        assert_eq!(file_url(Path::new("/runs/My scene-1/report.html")), "file:///runs/My%20scene-1/report.html");
        assert_eq!(file_url(Path::new("/a/50%#?/ü")), "file:///a/50%25%23%3F/%C3%BC");
    }
}
