//! The fit: what is open, presets, settings, where the run goes.

use super::{act_button, act_button_named, form, heading, queue, reading};
use crate::error::Place;
use crate::fit::{FitSettings, Method, Preset};
use crate::insight::report::number;
use crate::studio::act::Act;
use crate::studio::act::availability::availability;
use crate::studio::model::store::Follow;
use crate::studio::model::{Model, Phase, PickFor};
use crate::studio::theme;
use egui::{ComboBox, RichText, ScrollArea, Ui};

/// Draws the panel.
pub fn show(ui: &mut Ui, model: &mut Model, memory: &mut form::FormMemory, reading: &mut reading::ReadingMemory) {
    if let Some(Place::Setting(name)) = &model.go_to {
        memory.sought = Some(name.clone());
        model.go_to = None;
    }
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        facts(ui, model);
        controls(ui, model);
        presets(ui, model);
        heading(ui, "Settings");
        let live = model.fit.status.is_live();
        form::show(ui, &mut model.edits.fit, live, memory);
        if let Err(error) = model.edits.fit.validate() {
            ui.label(RichText::new(error.to_string()).color(theme::palette(ui.visuals()).error));
        }
        run_folder(ui, model);
        queue::show(ui, model);
        ui.add_space(6.0);
        reading::show(ui, model, reading);
    });
}

fn facts(ui: &mut Ui, model: &Model) {
    let Some(project) = &model.project else { return };
    ui.label(RichText::new(&project.title).strong().size(16.0));
    let views = project.view_count();
    let held_out = project.scene.as_ref().map_or(0, |scene| scene.views.iter().filter(|view| view.held_out).count());
    let triangles = number::whole(project.mesh.triangles.len() as u64);
    ui.label(RichText::new(format!("{triangles} triangles · {views} photos ({held_out} held out)")).weak());
    if model.edits.fit.method != Method::Adam {
        // The figure is Adam's: the solver keeps other things.
        return;
    }
    let size = model.edits.fit.map_size as u64;
    // Texels, their gradient and two moments, of 32 bytes each, with a third more for the mip chain.
    let bytes = size * size * 32 * 4 * 4 / 3;
    ui.label(
        RichText::new(format!("Maps of {size} x {size} need about {} while fitting", number::memory(bytes))).weak(),
    )
    .on_hover_text("Texels, gradient and both moments of Adam, with their mip chains");
}

fn controls(ui: &mut Ui, model: &mut Model) {
    ui.add_space(6.0);
    ui.horizontal_wrapped(|ui| match model.phase() {
        Phase::Fitting => {
            act_button_named(ui, model, Act::PauseOrGoOn, "Pause fit");
            act_button_named(ui, model, Act::Checkpoint, "Checkpoint");
        }
        Phase::Paused => {
            act_button_named(ui, model, Act::PauseOrGoOn, "Resume fit");
            act_button(ui, model, Act::StepOnce);
            act_button_named(ui, model, Act::Checkpoint, "Checkpoint");
        }
        phase @ (Phase::Pausing | Phase::Stopping | Phase::Finishing(_) | Phase::Queued | Phase::Starting) => {
            ui.label(phase.words());
        }
        Phase::Finished => {
            act_button(ui, model, Act::Export);
            act_button(ui, model, Act::OpenReport);
            act_button(ui, model, Act::OpenRunFolder);
            act_button(ui, model, Act::SavePicture);
            act_button_named(ui, model, Act::Start, "Fit again");
        }
        Phase::Closed
        | Phase::Opening
        | Phase::Preparing
        | Phase::Unprepared
        | Phase::Ready
        | Phase::Stopped
        | Phase::Failed(_) => {
            let can_resume = model.can_resume();
            let label = if can_resume { "Resume from checkpoint" } else { "Start fit" };
            act_button_named(ui, model, Act::Start, label);
            if can_resume {
                start_anew(ui, model);
            }
        }
    });
    if let Some(then) = model.fit.last_checkpoint {
        let ago = number::duration(then.elapsed().as_secs_f64());
        ui.label(RichText::new(format!("Last checkpoint {ago} ago")).weak());
    }
}

/// A checkpoint takes only what may change while a fit runs; a new run takes every setting.
fn start_anew(ui: &mut Ui, model: &mut Model) {
    let available = availability(Act::Start, model);
    let button = ui
        .add_enabled(available.is_ok(), egui::Button::new("Restart"))
        .on_hover_text("Start a new run with the current settings; this run and its checkpoint stay on disk");
    let button = match available {
        Ok(()) => button,
        Err(why) => button.on_disabled_hover_text(format!("Not now: {why}")),
    };
    if button.clicked() {
        model.start_anew();
    }
}

fn presets(ui: &mut Ui, model: &mut Model) {
    heading(ui, "Preset");
    let live = model.fit.status.is_live();
    let own = model.edits.fit.clone();
    let for_scene = |preset| {
        let mut settings = FitSettings::preset(preset);
        match model.project.as_ref().and_then(|project| project.suited.as_ref()) {
            Some(suited) => settings = suited.resolve(&settings, &[]),
            None => settings.solve_as(&own),
        }
        settings
    };
    // A scene made in code brings settings that suit it: they are its standard.
    let made_for = model.project.as_ref().and_then(|project| project.default_fit.clone());
    let usual = made_for.unwrap_or_else(|| for_scene(Preset::Balanced));
    let presets = Preset::ALL.map(|preset| match preset {
        Preset::Balanced => (preset, usual.clone()),
        _ => (preset, for_scene(preset)),
    });
    ui.add_enabled_ui(!live, |ui| {
        ui.horizontal(|ui| {
            for (preset, settings) in presets {
                let differences = settings.differences(&usual);
                let mut text = match differences.is_empty() {
                    true => "Default settings".to_owned(),
                    false => "Changed from the default".to_owned(),
                };
                for (name, value, usual) in differences {
                    text +=
                        &format!("\n{}: {value} instead of {usual}", crate::studio::model::words::of_setting(&name));
                }
                let settings =
                    FitSettings { exclude: own.exclude.clone(), seed: own.seed, method: own.method, ..settings };
                let response = ui.selectable_label(own == settings, preset.label()).on_hover_text(text);
                if response.clicked() {
                    model.edits.fit = settings;
                }
            }
        });
    });
    let changed = own.differences(&usual);
    if !changed.is_empty() {
        let names: Vec<String> = changed.iter().map(|(name, value, _)| format!("{name} {value}")).collect();
        ui.horizontal_wrapped(|ui| {
            ui.label(RichText::new(format!("Changed from preset: {}", names.join(", "))).weak());
            let reset = ui.add_enabled(!live, egui::Button::new("Reset settings").small());
            if reset.on_hover_text("Restore the Standard preset for this scene").clicked() {
                model.edits.fit = FitSettings { exclude: own.exclude.clone(), seed: own.seed, ..usual.clone() };
            }
        });
    }
}

fn run_folder(ui: &mut Ui, model: &mut Model) {
    heading(ui, "Output folder");
    if let Some(folder) = &model.fit.folder {
        ui.label(RichText::new(folder.path().display().to_string()).weak()).on_hover_text("The folder of this run");
    }
    let folder = model.runs_folder();
    ui.horizontal_wrapped(|ui| {
        ui.label(RichText::new(format!("{}", folder.display())).weak());
        if ui.button("Browse…").on_hover_text("Choose the output folder for new runs").clicked() {
            model.pick(PickFor::RunsFolder);
        }
    });
    ui.horizontal(|ui| {
        let label = ui.label("Live update").on_hover_text("How often viewport, maps and curves update during a fit");
        let follow = &mut model.preferences.follow;
        let names = [(Follow::Live, "On"), (Follow::Seldom, "Every 5 s"), (Follow::Off, "Off")];
        let chosen = names.iter().find(|(own, _)| own == follow).map_or("", |(_, name)| name);
        ComboBox::from_id_salt("follow")
            .selected_text(chosen)
            .show_ui(ui, |ui| {
                for (own, name) in names {
                    ui.selectable_value(follow, own, name);
                }
            })
            .response
            .labelled_by(label.id);
    });
}
