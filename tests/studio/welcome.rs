//! The first page.

use super::support::{TestStudio, small_scene};
use egui_kittest::kittest::Queryable;

#[test]
fn a_typed_path_opens_a_scene_and_the_next_start_remembers_it() {
    let mut studio = TestStudio::new();
    studio.step();
    studio.harness.get_by_label("Path").type_text(&small_scene().display().to_string());
    studio.step();
    studio.harness.get_by_label("Open path").click();
    studio.wait("the scene", |studio| studio.model.project.is_some());
    studio.wait("the atlas", |studio| studio.model.project.as_ref().is_some_and(|own| own.surface.is_some()));
    studio.harness.get_by_label("Start the fit");
    studio.harness.state_mut().model.write_preferences();

    let again = TestStudio::in_folder(studio.folder, None);
    let name = small_scene().file_name().unwrap().to_string_lossy().into_owned();
    again.harness.get_by_label(&name);
}

#[test]
fn a_folder_that_holds_no_scene_is_told_with_a_remedy_and_can_be_dismissed() {
    let empty = tempfile::tempdir().unwrap();
    let mut studio = TestStudio::opening(Some(empty.path().into()));
    studio.wait("the error", |studio| studio.model.log.banner().is_some());
    studio.step();
    assert!(studio.harness.query_by_label_contains("What helps").is_some(), "{}", studio.log());
    studio.harness.get_by_label("Dismiss").click();
    studio.step();
    studio.step();
    assert!(studio.harness.query_by_label("Dismiss").is_none());
    assert!(studio.harness.state().model.project.is_none());
}
