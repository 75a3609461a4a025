//! The first page: opening, recents, and what cannot be opened.

use super::support::{Key, Modifiers, TestStudio, finished_run, small_scene};
use patina::fit::{FitSettings, Method, Preset};
use patina::studio::act::Act;
use patina::studio::model::FitStatus;

#[test]
fn a_typed_path_opens_a_scene_and_the_next_start_remembers_it() {
    let mut studio = TestStudio::new();
    studio.frames(1);
    assert!(studio.says("No recent files") && studio.says("A BlendedMVS scene"));
    studio.replace_text("Path", &small_scene().display().to_string());
    studio.click("Open path");
    studio.wait("the atlas", |model| model.project.as_ref().is_some_and(|own| own.surface.is_some()));
    studio.control("Start fit");
    assert!(studio.says("8 photos (2 held out)"));

    let folder = studio.close();
    let pictures = std::fs::read_dir(folder.path().join("thumbnails")).unwrap().count();
    assert_eq!(pictures, 1, "the list shows what the place looks like");
    let mut again = TestStudio::in_folder(folder, None);
    again.frames(1);
    let name = small_scene().file_name().unwrap().to_string_lossy().into_owned();
    again.click(&name);
    again.wait("the scene", |model| model.project.is_some());
}

#[test]
fn a_finished_run_opens_with_its_maps_curves_and_scores() {
    let studio = TestStudio::with_finished_run();
    let model = &studio.harness.state().model;
    assert_eq!(model.fit.status, FitStatus::Finished);
    assert!(model.project.as_ref().is_some_and(|project| project.maps.is_some() && project.is_run));
    assert!(model.fit.report.is_some() && !model.fit.losses.is_empty());
    studio.control("Fit again");
}

#[test]
fn folders_that_hold_no_scene_and_paths_that_lead_nowhere_are_told_with_a_remedy() {
    let empty = tempfile::tempdir().unwrap();
    for path in [empty.path().to_path_buf(), empty.path().join("nowhere"), finished_run().join("mesh.obj")] {
        let mut studio = TestStudio::opening(Some(path.clone()));
        studio.wait("the error", |model| model.log.banner().is_some());
        assert!(studio.says("Fix: "), "{}", studio.log());
        studio.click("Dismiss");
        assert!(studio.controls("Dismiss").is_empty());
        assert!(studio.harness.state().model.project.is_none(), "{}", path.display());
        // The page still works.
        studio.replace_text("Path", &small_scene().display().to_string());
        studio.press(Modifiers::NONE, Key::Enter);
        studio.wait("the scene", |model| model.project.is_some());
    }
}

#[test]
fn a_recent_folder_that_is_gone_is_grey_and_can_be_forgotten() {
    let gone = tempfile::tempdir().unwrap().path().join("scene-of-old");
    let mut studio = TestStudio::new();
    studio.model().preferences.remember(&gone, false);
    studio.frames(1);
    assert!(studio.is_grey("scene-of-old"));
    studio.click("Remove from list");
    assert!(studio.controls("scene-of-old").is_empty() && studio.says("No recent files"));
}

#[test]
fn a_scene_of_linear_photos_is_given_to_the_solver_and_presets_leave_it_there() {
    let mut studio = TestStudio::opening(Some(small_scene().into()));
    studio.wait("the atlas", |model| model.project.as_ref().is_some_and(|own| own.surface.is_some()));
    assert_eq!(studio.model().edits.fit.method, Method::Solver);
    assert!(studio.log().contains("Using the solver"), "{}", studio.log());
    studio.act(Act::PanelFit);
    studio.control("Method");
    assert!(!studio.says("Changed from preset"), "what suits the scene is the usual there");
    assert!(studio.controls("Consistency").is_empty(), "the solver knows none");
    studio.click("High quality");
    assert_eq!(
        studio.model().edits.fit,
        FitSettings { method: Method::Solver, map_size: 256, ..FitSettings::preset(Preset::Careful) }
    );
}

#[test]
fn a_long_opening_can_be_cancelled() {
    let mut studio = TestStudio::new();
    studio.frames(1);
    studio.click("Open the built-in demo");
    studio.click("Cancel");
    assert!(studio.log().contains("Cancelled: Opening"), "{}", studio.log());
    assert!(!studio.model().tasks.is_busy() && studio.model().project.is_none());
    studio.control("Open the built-in demo");
}

#[test]
fn a_scene_is_read_again_in_another_way() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("Import settings");
    studio.frames(4);
    assert!(studio.is_grey("Reload scene"), "nothing differs");
    studio.control("Downsample photos").set_value_accesskit(2.0);
    studio.control("Unit").set_value_accesskit(0.001);
    studio.frames(2);
    assert!(studio.says("Not applied yet"));
    studio.control("Reload scene").click_accesskit();
    studio.frames(1);
    studio.wait("the scene", |model| model.project.as_ref().is_some_and(|own| own.settings.read.shrink == 2));
    let project = studio.model().project.as_ref().unwrap();
    assert_eq!(project.scene.as_ref().unwrap().views[0].camera.width, 24);
    assert_eq!(project.settings.read.unit_in_metres, Some(0.001));
}
