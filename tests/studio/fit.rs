//! A fit from its start to its end, by buttons and keys.

use super::support::{Key, Modifiers, TestStudio};
use eframe::egui::OutputCommand;
use patina::fit::{FitSettings, Method, Preset};
use patina::studio::model::FitStatus;
use patina::studio::workspace::Panel;
use std::sync::Arc;

#[test]
fn a_fit_is_started_paused_stepped_continued_and_stopped_by_hand() {
    let mut studio = TestStudio::with_running_fit();
    assert!(studio.says("RMSE 0."), "the curve grows");
    assert!(studio.model().window_title().contains("fitting"), "{}", studio.model().window_title());
    studio.click("Pause fit");
    studio.wait("the pause", |model| model.fit.status == FitStatus::Paused);
    let held_at = studio.steps_done();
    studio.frames(20);
    assert_eq!(studio.steps_done(), held_at, "it holds");

    studio.click("Single step");
    studio.wait_for_step(held_at + 1);
    studio.frames(20);
    assert_eq!(studio.steps_done(), held_at + 1);
    assert_eq!(studio.model().fit.status, FitStatus::Paused);

    studio.click("Resume fit");
    studio.wait_for_step(held_at + 3);
    let written = studio.model().fit.last_checkpoint;
    studio.click("Checkpoint");
    studio.wait("the checkpoint", move |model| model.fit.last_checkpoint != written);
    assert!(studio.says("Last checkpoint") && studio.run_folder().join("checkpoint").is_file());
    // The button that was clicked does not keep the key.
    studio.press(Modifiers::NONE, Key::Space);
    studio.wait("the pause", |model| model.fit.status == FitStatus::Paused);
    studio.press(Modifiers::NONE, Key::Space);
    studio.wait("going on", |model| model.fit.status == FitStatus::Running);

    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    assert!(studio.log().contains("the checkpoint keeps them"), "{}", studio.log());
    studio.control("Resume from checkpoint");
    studio.control("Resume");
}

#[test]
fn a_fit_that_ends_leaves_scores_maps_and_a_report() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("Start");
    studio.wait("the end", |model| model.fit.status == FitStatus::Finished);
    for file in ["report.html", "diffuse.exr", "env.exr", "settings.toml"] {
        assert!(studio.run_folder().join(file).is_file(), "{file}");
    }
    studio.click("Scores");
    for words in ["PSNR, dB", "Against ground truth", "Diffuse, RMSE", "Scale-aligned"] {
        assert!(studio.says(words), "{words}");
    }
    let score = studio.model().fit.report.clone().unwrap().aggregates[0].score.raw.psnr_srgb_db;
    assert!(studio.says(&format!("{score:.2} (")), "the score itself");

    studio.controls("Open report")[0].click();
    studio.harness.step();
    let commands = &studio.harness.output().platform_output.commands;
    let opened = commands.iter().any(|command| match command {
        OutputCommand::OpenUrl(open) => open.url.ends_with("report.html") && open.url.starts_with("file://"),
        _ => false,
    });
    assert!(opened, "{commands:?}");
    assert!(studio.log().contains("Fit finished. Results:"), "{}", studio.log());
}

#[test]
fn a_stopped_run_is_opened_again_and_goes_on_where_it_stopped() {
    let mut studio = TestStudio::with_running_fit();
    studio.press(Modifiers::COMMAND, Key::Period);
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    let (run, stopped_at) = (studio.run_folder(), studio.steps_done());
    studio.press(Modifiers::COMMAND, Key::W);
    assert!(studio.model().project.is_none(), "back on the first page");

    studio.click(&run.file_name().unwrap().to_string_lossy());
    studio.wait("the run", |model| model.project.is_some());
    assert!(studio.log().contains("Start resumes it from its checkpoint"), "{}", studio.log());
    assert_eq!(studio.steps_done(), stopped_at, "the curve is there before it goes on");
    assert!(studio.says("Stopped") && !studio.says("Not started"), "one state, whatever tells it");
    studio.click("Resume from checkpoint");
    studio.wait_for_step(stopped_at + 2);
    assert!(studio.log().contains(&format!("resumed after step {stopped_at}")), "{}", studio.log());
    assert_eq!(studio.run_folder(), run);
    let steps: Vec<usize> = studio.model().fit.losses.iter().map(|row| row.step).collect();
    assert!(steps.windows(2).all(|pair| pair[0] < pair[1]) && steps[0] == 1, "{steps:?}");
}

#[test]
fn a_fit_goes_on_after_a_stop_with_settings_changed_in_between() {
    let mut studio = TestStudio::with_running_fit();
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    let stopped_at = studio.steps_done();
    studio.type_number("Samples", "4");
    studio.press(Modifiers::COMMAND, Key::Enter);
    studio.wait_for_step(stopped_at + 1);
    assert!(studio.settings_on_disk().contains("samples = 4"), "{}", studio.settings_on_disk());
}

#[test]
fn after_a_stop_a_new_run_takes_the_settings_that_a_checkpoint_does_not() {
    let mut studio = TestStudio::with_running_fit();
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    let stopped = studio.run_folder();
    studio.click("Map size");
    studio.click("128 x 128");
    studio.click("Restart");
    let before = stopped.clone();
    studio.wait("the new run", move |model| model.fit.folder.as_ref().is_some_and(|own| own.path() != before));
    studio.wait_for_step(1);
    assert_eq!(studio.log().matches("Fit started").count(), 2, "{}", studio.log());
    assert_eq!(studio.model().project.as_ref().unwrap().settings.fit.map_size, 128);
    assert!(stopped.join("checkpoint").is_file(), "the run before stays");
}

#[test]
fn a_setting_changes_while_the_fit_runs_and_what_cannot_change_is_grey() {
    let mut studio = TestStudio::with_running_fit();
    for fixed in ["Map size", "Draft", "Standard", "High quality"] {
        assert!(studio.is_grey(fixed), "{fixed}");
    }
    assert!(!studio.is_grey("Samples") && !studio.is_grey("Max bounces"));
    studio.type_number("Samples", "4");
    studio.wait_for_word("continues with the changed settings");
    assert!(studio.settings_on_disk().contains("samples = 4"), "{}", studio.settings_on_disk());
    assert_eq!(studio.number("Samples"), 4.0);

    // Out of range: not taken, the field shows what is in force.
    studio.type_number("Max bounces", "99");
    assert_eq!((studio.number("Max bounces"), studio.model().edits.fit.bounces), (2.0, 2));

    // In range but less than what is done: the worker refuses, the field goes back.
    studio.wait_for_step(10);
    studio.type_number("Steps diffuse", "1");
    studio.wait("the refusal", |model| model.edits.fit.steps_diffuse != 1);
    assert_eq!(studio.number("Steps diffuse"), super::support::ENDLESS as f64, "{}", studio.log());
    assert_eq!(studio.model().fit.status, FitStatus::Running);
    assert!(studio.says("warning"), "a refusal is a warning to look at");
}

#[test]
fn a_photo_is_left_out_and_taken_in_again_while_the_fit_runs() {
    let mut studio = TestStudio::with_running_fit();
    studio.click("Photos");
    let name = studio.model().project.as_ref().unwrap().chosen_name().unwrap().to_owned();
    studio.press(Modifiers::NONE, Key::X);
    studio.wait_for_word("continues with the changed settings");
    assert!(studio.settings_on_disk().contains(&format!("exclude = [\"{name}\"]")), "{}", studio.settings_on_disk());
    assert!(studio.says("Excluded"));
    studio.model().log.clear();
    studio.click("Include");
    studio.wait_for_word("continues with the changed settings");
    assert!(studio.settings_on_disk().contains("exclude = []"), "{}", studio.settings_on_disk());
    assert!(!studio.says("Excluded"));
    studio.control("Exclude");
}

#[test]
fn a_preset_sets_the_form_and_undo_brings_the_own_settings_back() {
    let mut studio = TestStudio::with_small_scene();
    let own = studio.model().edits.fit.clone();
    assert!(studio.says("Changed from preset"));
    studio.click("Draft");
    // The photos are small, and so are the maps that suit them.
    assert_eq!(
        studio.model().edits.fit,
        FitSettings { method: Method::Adam, map_size: 256, ..FitSettings::preset(Preset::Quick) }
    );
    studio.click("Standard");
    assert!(studio.says("Changed from preset: method adam"), "the method is no matter of presets");
    assert!(!studio.says("method adam,"), "all else of the balanced preset is the usual");
    studio.frames(4);
    studio.press(Modifiers::COMMAND, Key::Z);
    studio.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(studio.model().edits.fit, own);
    assert!(studio.says("Changed from preset"));
}

#[test]
fn every_setting_of_the_command_line_is_in_the_form_and_can_be_sought() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("All settings");
    for name in ["Rate light", "Environment height", "Held out interval", "Pixel filter", "Lobe ramp"] {
        assert!(!studio.controls(name).is_empty(), "{name}");
    }
    studio.harness.check_accessibility();
    studio.replace_text("Find a setting", "smooth");
    assert!(!studio.controls("Light smoothness").is_empty() && studio.controls("Rate diffuse").is_empty());
    studio.replace_text("Find a setting", "xyzzy");
    assert!(studio.says("No matching setting"));
}

#[test]
fn another_size_of_the_maps_makes_another_atlas_and_fits() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("Map size");
    studio.click("128 x 128");
    assert_eq!(studio.model().edits.fit.map_size, 128);
    studio.start_endless_fit();
    let project = studio.model().project.as_ref().unwrap();
    assert_eq!(project.settings.fit.map_size, 128);
    // Until there are maps, the photos are shown on the mesh.
    studio.wait("maps", |model| model.project.as_ref().unwrap().maps.is_some());
    studio.show(Panel::Maps);
    studio.control("Map");
}

#[test]
fn the_timeline_shows_the_fit_as_it_was_while_it_goes_on() {
    let mut studio = TestStudio::with_running_fit();
    studio.show(Panel::Curves);
    studio.wait("three states", |model| model.timeline.states().len() >= 3);
    studio.move_slider("Timeline", 0.0);
    assert_eq!(studio.model().timeline.shown(), Some(0));
    let first = Arc::clone(&studio.model().timeline.states()[0].maps);
    let count = studio.model().timeline.states().len();
    studio.wait("newer states", move |model| model.timeline.states().len() > count);
    let shown = studio.model().project.as_ref().unwrap().maps.clone().unwrap();
    assert!(Arc::ptr_eq(&shown, &first), "what is looked at stays");
    studio.click("Latest");
    studio.frames(2);
    let newest = Arc::clone(&studio.model().timeline.states().last().unwrap().maps);
    let shown = studio.model().project.as_ref().unwrap().maps.clone().unwrap();
    assert!(studio.model().timeline.shown().is_none() && !Arc::ptr_eq(&shown, &first));
    assert!(Arc::ptr_eq(&shown, &newest) || studio.model().timeline.states().len() > count + 1);
    studio.model().close();
    assert!(studio.model().timeline.states().is_empty());
}

#[test]
#[ignore = "slow: light transport is traced for it"]
fn a_fit_is_saved_as_a_film_while_it_goes_on() {
    let mut studio = TestStudio::with_running_fit();
    studio.show(Panel::Curves);
    studio.wait("two states", |model| model.timeline.states().len() >= 2);
    let folder = tempfile::tempdir().unwrap();
    studio.click("Film…");
    studio.harness.check_accessibility();
    studio.replace_text("Image folder", &folder.path().display().to_string());
    for (field, number) in [("Width", "32"), ("Height", "24"), ("Images", "4")] {
        studio.type_number(field, number);
    }
    studio.click("Save");
    studio.wait_for_word("Saved 5 images");
    let files: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    let is_film = |path: &&std::path::PathBuf| path.file_stem().is_some_and(|stem| stem == "fit");
    assert_eq!((files.len(), files.iter().filter(is_film).count()), (5, 1), "{files:?}");
}
