//! The shelf of lights: swap, turn, strengthen, two side by side, lights of one's own.

use super::support::{Key, Modifiers, Role, TestStudio};
use eframe::egui;
use glam::Vec3;
use patina::image::{RgbImage, file};
use patina::studio::act::Act;
use patina::studio::model::LightName;
use patina::studio::stage::Layer;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file that is dropped on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

fn drop_on_window(studio: &mut TestStudio, path: &Path) {
    studio.harness.input_mut().dropped_files.push(Arc::new(Dropped(path.into())));
    studio.frames(1);
}

/// A light from the left that no sky resembles.
fn write_light(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    let light = RgbImage::from_fn(32, 16, |_, column| if column < 8 { Vec3::new(8.0, 1.0, 0.5) } else { Vec3::ZERO });
    match name.ends_with("exr") {
        true => file::write_exr_rgb(&path, &light).unwrap(),
        false => file::write_hdr(&path, &light).unwrap(),
    }
    path
}

fn sky(name: &str) -> LightName {
    LightName::Sky(name.into())
}

#[test]
fn a_slider_fades_from_the_photos_to_the_relit_surface() {
    let mut studio = TestStudio::with_finished_run();
    studio.click("Crossfade");
    assert_eq!(studio.model().shown_layer(), Layer::Crossfade);
    for (place, shows_light) in [(0.0, false), (1.0, false), (2.0, true)] {
        studio.move_slider("Photo – albedo – relit", place);
        assert_eq!((studio.model().edits.crossfade, studio.model().shows_light()), (place as f32, shows_light));
    }
    studio.click_role(Role::RadioButton, "Noon sky");
    assert_eq!(studio.model().edits.layer, Layer::Crossfade, "the light is seen already");
    studio.move_slider("Photo – albedo – relit", 0.5);
    studio.click_role(Role::RadioButton, "Evening sky");
    assert_eq!(studio.model().edits.layer, Layer::Lit, "a light that is chosen is seen");
}

#[test]
fn lights_are_swapped_by_click_and_by_arrow_and_the_fitted_one_comes_back() {
    let mut studio = TestStudio::with_finished_run();
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted);
    studio.model().edits.layer = Layer::Diffuse;
    studio.click_role(Role::RadioButton, "Noon sky");
    let edits = &studio.model().edits;
    assert_eq!((&edits.relight.first, edits.layer), (&sky("noon"), Layer::Lit));
    studio.press(Modifiers::NONE, Key::ArrowRight);
    assert_eq!(studio.model().edits.relight.first, sky("evening"));
    studio.press(Modifiers::NONE, Key::ArrowLeft);
    studio.press(Modifiers::NONE, Key::ArrowLeft);
    assert_ne!(studio.model().edits.relight.first, sky("noon"), "the shelf goes on before the skies");
    studio.press(Modifiers::NONE, Key::Home);
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted);
    studio.click_role(Role::RadioButton, "Sky by the hour");
    studio.press(Modifiers::NONE, Key::ArrowRight);
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted, "the shelf goes around");
}

#[test]
fn the_sky_of_an_hour_follows_its_sliders_and_undo() {
    let mut studio = TestStudio::with_finished_run();
    assert!(studio.controls("Hour").is_empty(), "sliders of a sky that does not shine");
    studio.click_role(Role::RadioButton, "Sky by the hour");
    let sky = |studio: &mut TestStudio| Arc::clone(&studio.model().shelf.find(&LightName::Day).unwrap().environment);
    let before = sky(&mut studio);
    studio.move_slider("Hour", 8.0);
    let morning = sky(&mut studio);
    assert_ne!(*before, *morning);
    // A winter in which the sun is not up at that hour: it is as early as it can be.
    studio.move_slider("Latitude", 60.0);
    studio.move_slider("Day of the year", 355.0);
    studio.frames(2);
    assert!(studio.model().edits.relight.day.hour > 8.5, "{:?}", studio.model().edits.relight.day);
    assert_ne!(*sky(&mut studio), *morning);
    // Undo feeds on what has settled for a while.
    studio.model().edits.relight.day = Default::default();
    studio.frames(2);
    assert_eq!(*sky(&mut studio), *before);
}

#[test]
fn a_folder_of_environments_is_put_on_the_shelf_and_searched() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    for name in ["attic.hdr", "barn.hdr", "cellar.exr", "depot.exr", "field.hdr"] {
        write_light(folder.path(), name);
    }
    studio.act(Act::AddLightFolder);
    studio.type_text(&folder.path().display().to_string());
    studio.click("Add this");
    studio.wait("the last of them", |model| {
        model.shelf.lights().iter().filter(|light| matches!(light.name, LightName::File(_))).count() == 5
    });
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted, "a folder chooses none");
    studio.replace_text("Find an environment", "bar");
    assert!(studio.controls("attic").is_empty());
    studio.click_role(Role::RadioButton, "barn");
    studio.replace_text("Find an environment", "xyzzy");
    assert!(studio.says("No matching environment"));
    // A folder without any is an error that says what is wanted.
    studio.act(Act::AddLightFolder);
    let empty = tempfile::tempdir().unwrap();
    studio.type_text(&empty.path().display().to_string());
    studio.click("Add this");
    assert!(
        studio.says("no environment lies in this folder") || studio.log().contains("no environment"),
        "{}",
        studio.log()
    );
}

#[test]
fn the_light_turns_by_key_and_slider_and_is_made_stronger() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::SHIFT, Key::ArrowLeft);
    assert_eq!(studio.number("Rotation"), 15.0);
    studio.press(Modifiers::SHIFT, Key::ArrowRight);
    studio.press(Modifiers::SHIFT, Key::ArrowRight);
    assert_eq!(studio.number("Rotation"), 345.0, "around, not below zero");
    studio.move_slider("Rotation", 90.0);
    studio.move_slider("Intensity (EV)", 2.0);
    assert_eq!((studio.number("Rotation"), studio.number("Intensity (EV)")), (90.0, 2.0));
    let stage_light = studio.model().stage_light(&LightName::Fitted).unwrap();
    let traced = studio.model().traced_light(&LightName::Fitted).unwrap();
    let ratio = traced.mean_radiance() / stage_light.mean_radiance();
    assert!((ratio - Vec3::splat(4.0)).abs().max_element() < 0.1, "two stops are four times: {ratio}");
}

#[test]
fn brightness_is_matched_unless_it_is_not_wished() {
    let mut studio = TestStudio::with_finished_run();
    studio.click_role(Role::RadioButton, "Noon sky");
    let luminance = |studio: &mut TestStudio, name: &LightName| {
        patina::math::luminance(studio.model().stage_light(name).unwrap().mean_radiance())
    };
    let fitted = luminance(&mut studio, &LightName::Fitted);
    assert!((luminance(&mut studio, &sky("noon")) / fitted - 1.0).abs() < 1e-2);
    studio.click("Normalize intensity");
    let own = patina::math::luminance(studio.model().shelf.find(&sky("noon")).unwrap().environment.mean_radiance());
    assert_eq!(luminance(&mut studio, &sky("noon")), own);
}

#[test]
fn two_lights_stand_side_by_side() {
    let mut studio = TestStudio::with_finished_run();
    studio.click("Split view");
    let second = studio.model().edits.relight.second.clone().unwrap();
    assert_ne!(second, LightName::Fitted);
    studio.click("Environment B");
    studio.click_role(Role::Button, "Overcast sky");
    assert_eq!(studio.model().edits.relight.second, Some(sky("overcast")));
    studio.press(Modifiers::NONE, Key::M);
    assert_eq!(studio.model().edits.relight.second, None);
    assert!(studio.controls("Environment B").is_empty());
}

#[test]
#[ignore = "slow: pictures under every light"]
fn the_strip_shows_the_view_under_every_light_and_a_click_takes_one() {
    let mut studio = TestStudio::with_finished_run();
    studio.click("Lighting contact sheet");
    studio.wait("the strip", |model| model.project.as_ref().is_some_and(|own| !own.strip.is_empty()));
    assert_eq!(studio.model().project.as_ref().unwrap().strip.len(), studio.model().shelf.lights().len());
    studio.control("view under Overcast sky").click_accesskit();
    studio.frames(2);
    assert_eq!(studio.model().edits.relight.first, sky("overcast"));
}

#[test]
fn a_light_comes_by_path_or_by_drop_lights_the_stage_and_goes_again() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    let by_path = write_light(folder.path(), "left.hdr");
    studio.press(Modifiers::COMMAND, Key::L);
    assert!(studio.says("Import an HDRI"));
    studio.type_text(&by_path.display().to_string());
    studio.click("Add this");
    studio.wait_for_word("Left was added to the environments");
    assert_eq!(studio.model().edits.relight.first, LightName::File(by_path.clone()));

    let dropped = write_light(folder.path(), "other.exr");
    drop_on_window(&mut studio, &dropped);
    studio.wait_for_word("Other was added to the environments");
    assert_eq!(studio.model().preferences.lights, [by_path.clone(), dropped]);
    studio.click_role(Role::RadioButton, "left");

    studio.controls("left")[0].click_button(egui::PointerButton::Secondary);
    studio.frames(3);
    studio.click("Remove");
    assert!(studio.controls("left").is_empty());
    assert_eq!(studio.model().edits.relight.first, LightName::Fitted, "what lit the stage is gone");
    assert_eq!(studio.model().preferences.lights.len(), 1);
}

#[test]
fn what_is_read_for_the_shelf_outlives_the_scene_that_is_closed() {
    let mut studio = TestStudio::with_finished_run();
    let path = write_light(studio.folder.path(), "late.hdr");
    // No frame between the two takes it in.
    studio.model().add_light(path.clone());
    studio.model().close();
    studio.wait_for_word("Late was added to the environments");
    assert!(studio.model().project.is_none());
    assert!(studio.model().shelf.find(&LightName::File(path)).is_some());
}

#[test]
fn a_remembered_light_is_there_although_a_run_is_opened_at_the_start() {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let path = write_light(folder.path(), "left.hdr");
    let text = format!("{{ \"lights\": [{:?}] }}", path.display().to_string());
    patina::files::write_bytes(&folder.path().join("studio.json"), text.as_bytes()).unwrap();
    let mut studio = TestStudio::in_folder(folder, Some(super::support::finished_run().into()));
    let name = LightName::File(path);
    studio.wait("run and light", |model| model.project.is_some() && model.shelf.find(&name).is_some());
}

#[test]
fn a_file_that_is_no_light_is_told_with_a_remedy() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.hdr");
    patina::files::write_bytes(&bad, b"not a picture").unwrap();
    drop_on_window(&mut studio, &bad);
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: ") && studio.says("bad.hdr"), "{}", studio.log());
    studio.click("Dismiss");
    let count = studio.model().shelf.lights().len();
    drop_on_window(&mut studio, &folder.path().join("nowhere.exr"));
    studio.wait("the error", |model| model.log.banner().is_some());
    assert_eq!(studio.model().shelf.lights().len(), count);
    assert!(studio.model().preferences.lights.is_empty(), "what could not be read is not remembered");
}

#[test]
fn a_run_that_is_dropped_is_opened() {
    let mut studio = TestStudio::new();
    studio.frames(1);
    drop_on_window(&mut studio, super::support::finished_run());
    studio.wait("the run", |model| model.project.is_some());
    studio.control("Fit again");
}
