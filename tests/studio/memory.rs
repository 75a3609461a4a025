//! What is remembered from one start to the next.

use super::support::{Key, Modifiers, TestStudio, finished_run, small_scene};
use patina::studio::model::store::ThemeChoice;
use patina::studio::workspace::Panel;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[test]
fn theme_size_layout_display_and_recents_survive_a_restart() {
    let mut studio = TestStudio::with_finished_run();
    studio.model().preferences.theme = ThemeChoice::Light;
    studio.press(Modifiers::COMMAND, Key::Plus);
    studio.press(Modifiers::COMMAND, Key::Plus);
    studio.show(Panel::Scores);
    studio.press(Modifiers::NONE, Key::E);
    studio.press(Modifiers::NONE, Key::E);
    let folder = studio.close();

    let mut again = TestStudio::in_folder(folder, Some(finished_run().into()));
    again.wait("the run", |model| model.project.is_some());
    assert_eq!(again.model().preferences.theme, ThemeChoice::Light);
    assert!(again.harness.ctx.global_style().visuals.panel_fill.r() > 200, "the theme is in force");
    assert!((again.harness.ctx.zoom_factor() - 1.2).abs() < 1e-4, "{}", again.harness.ctx.zoom_factor());
    assert!(again.harness.state().layout.visible().contains(&Panel::Scores));
    assert_eq!(again.model().edits.display.exposure_stops, 0.5);
    assert_eq!(again.model().preferences.recents[0].path, finished_run());
}

#[test]
fn damaged_settings_are_set_aside_and_told() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    patina::files::write_bytes(&folder.path().join("studio.json"), b"{ \"theme\": ").unwrap();
    let mut studio = TestStudio::in_folder(Arc::clone(&folder), None);
    studio.frames(1);
    assert!(studio.says("settings are damaged") && studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");
    studio.control("Open the built-in demo");
    assert!(folder.path().join("studio.damaged.json").is_file());
    studio.close();
    let again = TestStudio::in_folder(folder, None);
    assert!(!again.log().contains("damaged"), "{}", again.log());
}

#[test]
fn settings_that_cannot_be_written_are_told_once_and_stop_nothing() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    // A folder stands where the file should be.
    std::fs::create_dir(folder.path().join("studio.json")).unwrap();
    let mut studio = TestStudio::in_folder(folder, Some(finished_run().into()));
    studio.wait("the run", |model| model.project.is_some());
    studio.model().write_preferences();
    studio.model().write_preferences();
    studio.frames(2);
    assert_eq!(studio.log().matches("could not be saved").count(), 1, "{}", studio.log());
    studio.control("Fit again");
}

#[test]
fn a_remembered_light_that_vanished_is_told_and_the_others_are_there() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let gone = folder.path().join("gone.hdr");
    let text = format!("{{ \"lights\": [{:?}] }}", gone.display().to_string());
    patina::files::write_bytes(&folder.path().join("studio.json"), text.as_bytes()).unwrap();
    let mut studio = TestStudio::in_folder(folder, None);
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("gone.hdr") && studio.says("Fix: "), "{}", studio.log());
    assert_eq!(studio.model().shelf.lights().len(), 4, "the skies and that of an hour");
    // Told once: the next start does without it.
    assert!(studio.log().contains("no longer remembered") && studio.model().preferences.lights.is_empty());
    let mut again = TestStudio::in_folder(studio.close(), None);
    again.wait("what is read at the start", |model| !model.tasks.is_busy());
    assert!(again.model().log.banner().is_none(), "{}", again.log());
}

#[test]
fn a_layout_of_another_version_is_replaced_by_the_first_one() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let text = b"{ \"layout\": \"{\\\"root\\\": 3}\", \"zoom\": 90.0, \"theme\": \"dark\" }";
    patina::files::write_bytes(&folder.path().join("studio.json"), text).unwrap();
    let mut studio = TestStudio::in_folder(folder, Some(finished_run().into()));
    studio.wait("the run", |model| model.project.is_some());
    assert_eq!(studio.harness.ctx.zoom_factor(), 1.0);
    assert!(studio.harness.state().layout.visible().contains(&Panel::Stage));
}

#[test]
fn what_opening_made_is_found_by_the_next_start_and_is_the_same() {
    let made = |studio: &mut TestStudio| {
        let project = studio.model().project.as_ref().unwrap();
        format!("{:?} {:?} {:?} {:?}", project.mesh, project.findings, project.quality, project.settings)
    };
    let kept_in = |folder: &Path| {
        let listed = std::fs::read_dir(folder.join("patina-cache")).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<PathBuf> = listed.filter(|path| path.extension().is_some_and(|own| own == "kept")).collect();
        files.sort();
        files
    };
    let mut studio = TestStudio::with_small_scene();
    let first = made(&mut studio);
    let folder = studio.close();
    let kept = kept_in(folder.path());
    assert_eq!(kept.len(), 2, "the check and the atlas: {kept:?}");

    let mut again = TestStudio::in_folder(Arc::clone(&folder), Some(small_scene().into()));
    again.prepare_fit();
    assert_eq!(made(&mut again), first);
    again.close();
    assert_eq!(kept_in(folder.path()), kept, "found, and not made again under another name");

    // What is damaged is no obstacle, and nothing to tell of.
    for path in &kept {
        std::fs::write(path, b"not what was written").unwrap();
    }
    let mut third = TestStudio::in_folder(folder, Some(small_scene().into()));
    third.prepare_fit();
    assert_eq!(made(&mut third), first);
    assert!(third.model().log.banner().is_none(), "{}", third.log());
}
