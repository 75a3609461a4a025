//! Object mode as a person uses it: from a photo to light and reflectance, what is refused, what is kept.

use super::support::{Key, Modifiers, TestStudio};
use eframe::egui::Rect;
use glam::Vec3;
use patina::image::{GreyImage, Image, file};
use patina::light::sky::{SkySettings, sun_and_sky};
use patina::measured::coordinates::HalfDifference;
use patina::object::ObjectGeometry;
use patina::object::picture::render_exact;
use patina::object::settings::LightsOf;
use patina::object::starts::ModelKind;
use patina::object::transport::TexelDirections;
use patina::studio::act::Act;
use patina::studio::model::object::ObjectStatus;
use patina::studio::model::object_form::{Effort, ObjectForm};
use patina::studio::workspace::{Panel, Workspace};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Writes a photo of a glossy sphere under a sky.
pub fn write_sphere_photo(path: &Path, side: usize) {
    let geometry = ObjectGeometry::sphere(side, side, 0.5 * side as f32);
    let light = sun_and_sky(64, 32, &SkySettings::evening());
    let directions = TexelDirections::of_any_size(64, 32);
    let glossy = |at: &[HalfDifference], values: &mut [[f64; 3]]| {
        for (at, value) in at.iter().zip(values) {
            let lobe = 1.5 * (-(at.theta_half / 0.12).powi(2)).exp();
            *value = [0.14 + lobe, 0.07 + lobe, 0.03 + lobe];
        }
    };
    let picture = render_exact(&geometry, None, &directions, &glossy, &[&light]).swap_remove(0);
    file::write_exr_rgb(path, &picture).unwrap();
}

/// A studio in object mode, asked for a quick look with a model of one lobe.
fn in_object_mode() -> TestStudio {
    let mut studio = TestStudio::new();
    studio.press(Modifiers::NONE, Key::F3);
    assert_eq!(studio.model().workspace, Workspace::Object);
    let form = &mut studio.model().edits.object;
    (form.model, form.effort) = (ModelKind::CookTorrance, Effort::Quick);
    // As little as shows what a window does with it.
    (form.light_rows, form.pixels) = (Some(16), Some(300));
    studio.frames(2);
    studio
}

/// The same with a photo that was typed in.
pub fn with_photo() -> TestStudio {
    let mut studio = in_object_mode();
    let path = studio.folder.path().join("ball.exr");
    write_sphere_photo(&path, 40);
    type_path(&mut studio, "Photo", &path);
    studio
}

pub fn type_path(studio: &mut TestStudio, what: &str, path: &Path) {
    studio.replace_text(&format!("{what} path"), &path.display().to_string());
    studio.click(&format!("Add {what}"));
}

pub fn result_folder(studio: &mut TestStudio) -> PathBuf {
    studio.model().object.outcome.as_ref().unwrap().folder.clone().unwrap()
}

#[test]
fn a_photo_of_a_sphere_becomes_light_and_reflectance_on_the_screen_and_on_disk() {
    let mut studio = TestStudio::new();
    studio.frames(2);
    studio.click("Single object…");
    assert!(studio.is_grey("Estimate"), "without a photo");
    let mut studio = with_photo();
    studio.control("Remove ball.exr");
    assert!(studio.says("No photo yet") && studio.says("No reflectance yet") && studio.says("No environment yet"));
    studio.click("Start estimation");
    studio.wait("the photo", |model| !model.object.photos.is_empty());
    studio.control("Photo of the object");
    studio.wait("a row", |model| model.object.rows.iter().any(|row| row.round > 0));
    studio.wait("a look", |model| model.object.look.is_some() || model.object.outcome.is_some());
    for label in ["Re-render of the object", "Sphere of the estimated reflectance", "Estimated environment map"] {
        studio.control(label);
    }
    assert!(!studio.says("No data"));
    studio.wait("the end", |model| model.object.status == ObjectStatus::Finished);
    let outcome = studio.model().object.outcome.clone().unwrap();
    assert!(outcome.parts.estimate.picture_log_rmse < 0.1, "{}", outcome.parts.estimate.picture_log_rmse);
    assert_eq!(outcome.rerenders[0].width(), 40, "at full size");
    let folder = result_folder(&mut studio);
    for name in
        ["object.json", "env.exr", "environment_seen.exr", "reflectance.binary", "report.html", "relit_0_Noon_sky.exr"]
    {
        assert!(folder.join(name).is_file(), "{name}");
    }
    studio.wait("the relit pictures", |model| !model.object.relit.is_empty());
    studio.act(Act::PanelRelit);
    studio.control("object under Noon sky");
    studio.click("Spheres");
    studio.control("sphere under Noon sky");
    studio.act(Act::PanelObjectLight);
    studio.click("Sensitivity");
    studio.control("Sensitivity of the photos");
    assert!(studio.says("The photos hardly constrain"));
    studio.act(Act::PanelStarts);
    assert!(studio.says("Ambiguity") && studio.says("Initializations"));
    for (button, label) in [
        ("Wipe", "Photo and re-render"),
        ("Difference", "Photo and re-render"),
        ("Log error", "Log error of the re-render"),
    ] {
        studio.click(button);
        studio.control(label);
    }
}

#[test]
fn photos_under_environments_of_their_own_are_asked_for_where_there_are_several() {
    let mut studio = with_photo();
    assert!(!studio.says("An environment for each photo"), "one photo has one environment");
    let path = studio.folder.path().join("other.exr");
    write_sphere_photo(&path, 40);
    type_path(&mut studio, "Photo", &path);
    assert_eq!(studio.model().edits.object.settings().lights, LightsOf::One);
    studio.click("An environment for each photo");
    assert_eq!(studio.model().edits.object.settings().lights, LightsOf::Each);
    studio.replace_text("Known environment path", "probe.exr");
    assert!(studio.says("Known for the first photo: it fixes the absolute scale"));
}

#[test]
#[ignore = "slow: an estimation of its own"]
fn each_photo_shows_its_own_environment_and_the_result_asks_for_the_same_again() {
    let mut studio = with_photo();
    let path = studio.folder.path().join("other.exr");
    write_sphere_photo(&path, 40);
    type_path(&mut studio, "Photo", &path);
    studio.click("An environment for each photo");
    studio.click("Start estimation");
    studio.wait("the end", |model| model.object.status == ObjectStatus::Finished);
    assert_eq!(studio.model().object.outcome.as_ref().unwrap().lights.len(), 2);
    studio.act(Act::PanelObjectLight);
    assert!(studio.says("Environment of ball.exr, one of 2") && studio.says("Sensitivity"));
    let first = studio.model().object.light().unwrap();
    studio.model().object.chosen_photo = 1;
    studio.frames(2);
    assert!(studio.says("Environment of other.exr, one of 2") && !studio.says("Sensitivity"));
    assert!(!Arc::ptr_eq(&first, &studio.model().object.light().unwrap()));
    let folder = result_folder(&mut studio);
    studio.model().edits.object.lights = LightsOf::One;
    studio.model().open_object(folder);
    studio.wait("the result", |model| model.edits.object.lights == LightsOf::Each);
    assert_eq!(studio.model().object.outcome.as_ref().unwrap().lights.len(), 2);
}

#[test]
#[ignore = "slow: an estimation of its own"]
fn an_estimation_that_is_stopped_keeps_what_it_reached() {
    let mut studio = with_photo();
    studio.model().edits.object.effort = Effort::Released;
    studio.frames(1);
    studio.press(Modifiers::COMMAND, Key::E);
    assert!(studio.model().object.status.is_live(), "{}", studio.log());
    studio.wait("the first step", |model| !model.object.rows.is_empty());
    studio.act(Act::ObjectStop);
    studio.wait("the end", |model| !model.object.status.is_live());
    assert_eq!(studio.model().object.status, ObjectStatus::Ended);
    assert!(studio.log().contains("before its first round"), "{}", studio.log());

    studio.model().edits.object.effort = Effort::Quick;
    // It holds after its first round until it was asked to stop.
    let gate = Arc::new(std::sync::Barrier::new(2));
    let own = Arc::clone(&gate);
    studio.model().after_round = Some(Arc::new(move |round| {
        if round == 1 {
            own.wait();
        }
    }));
    studio.frames(1);
    studio.act(Act::ObjectStart);
    studio.wait("a look", |model| model.object.look.is_some());
    studio.click("Stop estimation");
    gate.wait();
    studio.wait("the end", |model| !model.object.status.is_live());
    assert_eq!(studio.model().object.status, ObjectStatus::Ended);
    assert!(result_folder(&mut studio).join("object.json").is_file());
    assert!(studio.says("Ended early") && studio.log().contains("ended after 1 rounds"), "{}", studio.log());
}

#[test]
#[ignore = "slow: an estimation of its own"]
fn a_panic_is_told_and_what_was_reached_is_kept() {
    let mut studio = with_photo();
    studio.model().after_round = Some(Arc::new(|round| assert!(round < 2, "a fault on purpose")));
    studio.act(Act::ObjectStart);
    studio.wait("the end", |model| !model.object.status.is_live());
    assert!(studio.log().contains("a fault on purpose"), "{}", studio.log());
    assert!(result_folder(&mut studio).join("env.exr").is_file());
    studio.click("Dismiss");
    // It works on.
    studio.model().after_round = None;
    studio.act(Act::ObjectStart);
    studio.wait("the end", |model| model.object.status == ObjectStatus::Finished);
}

#[test]
#[ignore = "slow: an estimation of its own"]
fn a_result_that_cannot_be_written_is_kept_and_can_be_saved_elsewhere() {
    let mut studio = with_photo();
    let runs = studio.model().runs_folder();
    let spoiled = runs.clone();
    studio.model().after_round = Some(Arc::new(move |round| {
        if round == 1 {
            // A file takes the place of the folder of runs.
            std::fs::remove_dir_all(&spoiled).unwrap();
            patina::files::write_bytes(&spoiled, b"a file").unwrap();
        }
    }));
    studio.act(Act::ObjectStart);
    studio.wait("the end", |model| !model.object.status.is_live());
    assert!(studio.model().object.outcome.as_ref().unwrap().folder.is_none());
    assert!(studio.says("in memory only") && studio.log().contains("save it to another folder"));
    studio.click("Dismiss");
    studio.act(Act::ObjectStart);
    assert!(studio.log().contains("not on disk yet"), "{}", studio.log());
    let elsewhere = studio.folder.path().join("elsewhere");
    studio.click("Save result as…");
    studio.replace_text("Path", &elsewhere.display().to_string());
    assert!(!studio.says("You can also drop a folder or file"), "nothing is dropped to be written");
    studio.click("Save here");
    studio.wait_for_word("Saved");
    assert!(elsewhere.join("object.json").is_file() && result_folder(&mut studio) == elsewhere);
}

#[test]
fn files_that_do_not_do_are_refused_with_a_remedy_and_good_ones_work_after() {
    let mut studio = with_photo();
    let folder = studio.folder.path().to_path_buf();
    let mask = |name: &str, width: usize, value: f32| {
        let path = folder.join(name);
        file::write_exr_grey(&path, &GreyImage::filled(width, 40, value)).unwrap();
        path
    };
    let (narrow, black) = (mask("narrow.exr", 30, 1.0), mask("black.exr", 40, 0.0));
    let (torn, nowhere, dark) = (folder.join("torn.exr"), folder.join("nowhere.exr"), folder.join("dark.exr"));
    patina::files::write_bytes(&torn, b"no picture").unwrap();
    file::write_exr_rgb(&dark, &Image::filled(40, 40, Vec3::ZERO)).unwrap();
    let mesh = folder.join("ball.obj");
    patina::files::write_bytes(&mesh, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let good = studio.model().edits.object.clone();
    let mut cases = Vec::new();
    for (photo, word) in [(torn, "torn.exr"), (nowhere, "nowhere.exr"), (dark, "neither black nor saturated")] {
        cases.push((ObjectForm { photos: vec![photo], ..good.clone() }, word));
    }
    for (path, word) in [(narrow, "30 x 40"), (black, "marks no pixel")] {
        cases.push((ObjectForm { masks: vec![path], ..good.clone() }, word));
    }
    let of_mesh = |mesh: String| ObjectForm { mesh, is_sphere: false, ..good.clone() };
    cases.push((of_mesh(mesh.display().to_string()), "a mesh needs a camera"));
    cases.push((of_mesh(String::new()), "no mesh is named"));
    let light = folder.join("nowhere.hdr").display().to_string();
    cases.push((ObjectForm { light, ..good.clone() }, "nowhere.hdr"));
    for (form, word) in cases {
        studio.model().edits.object = form;
        studio.frames(1);
        studio.act(Act::ObjectStart);
        studio.wait(word, |model| model.log.banner().is_some() && !model.object.status.is_live());
        assert!(studio.log().contains(word), "{word} is not in {}", studio.log());
        assert!(studio.says("Fix: "), "{word} has no remedy: {}", studio.log());
        studio.click("Dismiss");
        studio.model().log.clear();
    }
    studio.model().edits.object = good;
    studio.frames(1);
    studio.act(Act::ObjectStart);
    studio.wait("the end", |model| model.object.status == ObjectStatus::Finished);
}

#[test]
fn files_that_are_dropped_find_their_place() {
    let mut studio = in_object_mode();
    for name in ["ball.png", "ball_mask.png", "ball.ply", "cameras.json"] {
        studio.model().dropped(name.into());
    }
    studio.frames(2);
    let form = studio.model().edits.object.clone();
    assert_eq!((form.photos, form.masks), (vec!["ball.png".into()], vec!["ball_mask.png".into()]));
    assert_eq!((form.mesh.as_str(), form.is_sphere, form.cameras), ("ball.ply", false, vec!["cameras.json".into()]));
    assert!(studio.log().contains("a mask: ball_mask.png"), "{}", studio.log());
    studio.click("Remove ball.png");
    assert!(studio.model().edits.object.photos.is_empty());
    studio.frames(60);
    studio.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(studio.model().edits.object.photos.len(), 1, "undo covers what is asked for");
}

/// A studio with the library drawn.
pub fn with_materials() -> TestStudio {
    let mut studio = TestStudio::new();
    studio.press(Modifiers::NONE, Key::F4);
    assert_eq!(studio.model().workspace, Workspace::Object);
    studio.wait("the materials", |model| model.materials.library.is_some());
    studio
}

#[test]
fn the_library_is_shown_and_the_map_of_codes_can_be_clicked_through() {
    let mut studio = with_materials();
    let count = studio.model().materials.library.as_ref().unwrap().map.places.len();
    assert_eq!(studio.model().materials.thumbnails.len(), count);
    studio.replace_text("Find a material", "brass");
    studio.click("brass");
    studio.wait("the material", |model| model.materials.shown.is_some());
    studio.control("Sphere of the material");
    assert!(studio.says("Albedo near the normal"));
    let shown = studio.model().materials.shown.clone().unwrap();
    assert_eq!((shown.parts[0].name.as_str(), shown.parts.len()), ("brass", 1));

    studio.act(Act::PanelMaterialMap);
    studio.click("code of blue-fabric");
    studio.wait("the fabric", |model| model.materials.shown.as_ref().unwrap().parts[0].name == "blue-fabric");
    // A place between materials: the middle between the two, unless a third lies there.
    let map = studio.model().materials.library.as_ref().unwrap().map.clone();
    let low = |axis: usize| map.places.iter().map(|place| place.at[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| map.places.iter().map(|place| place.at[axis]).fold(f64::NEG_INFINITY, f64::max);
    let gap = |at: [f64; 2]| {
        let scaled = |place: [f64; 2]| [0, 1].map(|axis| (place[axis] - at[axis]) / (high(axis) - low(axis)));
        map.places.iter().map(|place| scaled(place.at)).map(|d| d[0] * d[0] + d[1] * d[1]).fold(f64::INFINITY, f64::min)
    };
    let parts = (0..400).map(|index| [f64::from(index % 20) / 19.0, f64::from(index / 20) / 19.0]);
    let widest = parts
        .max_by(|a, b| {
            let at = |part: &[f64; 2]| [0, 1].map(|axis| low(axis) + part[axis] * (high(axis) - low(axis)));
            gap(at(a)).total_cmp(&gap(at(b)))
        })
        .unwrap();
    let rect: Rect = studio.control("Map of the latent codes").rect().shrink(26.0);
    let at = rect.lerp_inside(eframe::egui::vec2(widest[0] as f32, 1.0 - widest[1] as f32));
    studio.click_at(at);
    studio.wait("what lies between", |model| model.materials.shown.as_ref().unwrap().parts.len() > 1);
    assert!(studio.says("Between: "));
    studio.press(Modifiers::COMMAND, Key::ArrowRight);
    studio.wait("the next", |model| model.materials.shown.as_ref().unwrap().parts.len() == 1);
}

#[test]
fn a_measured_table_is_opened_and_shown_before_the_library() {
    let mut studio = with_materials();
    let path = studio.folder.path().join("own-lacquer.binary");
    let library = patina::neural::source::read("brass", None, None).unwrap();
    library.table.write(&path).unwrap();
    studio.act(Act::OpenMaterial);
    studio.frames(2);
    studio.replace_text("Path", &path.display().to_string());
    studio.click("Open this");
    studio.wait("the table", |model| model.materials.shown.is_some());
    assert!(studio.says("own-lacquer (measured)"));
    studio.control("Sphere of the material");
    let own = studio.model().materials.shown.clone().unwrap();
    assert!(own.albedo[0] > own.albedo[2], "brass is yellow: {:?}", own.albedo);
    // Another material, and back by its tile; a filter hides it with the rest.
    studio.act(Act::NextMaterial);
    studio.wait("the next", |model| model.materials.shown.as_ref().unwrap().parts[0].name != "own-lacquer");
    studio.act(Act::PanelMaterials);
    studio.click("own-lacquer");
    studio.wait("the table again", |model| model.materials.shown.as_ref().unwrap().parts[0].name == "own-lacquer");
    studio.replace_text("Find a material", "brass");
    assert!(studio.controls("own-lacquer").is_empty());
    // Dropped twice it is one; a damaged one is told of, and changes nothing.
    studio.model().dropped(path.clone());
    studio.wait("the table once more", |model| !model.tasks.is_busy());
    assert_eq!(studio.model().materials.opened.len(), 1);
    let damaged = studio.folder.path().join("cut.binary");
    patina::files::write_bytes(&damaged, b"cut").unwrap();
    studio.model().dropped(damaged);
    studio.wait("the refusal", |model| !model.tasks.is_busy());
    assert!(studio.log().contains("cut.binary"), "{}", studio.log());
    assert_eq!(studio.model().materials.opened.len(), 1);
}

#[test]
fn both_workspaces_keep_what_is_theirs() {
    let mut studio = TestStudio::with_small_scene();
    studio.click_first("Single object");
    assert!(studio.says("No photo yet"));
    studio.act(Act::Start);
    assert!(studio.log().contains("this is for scenes"), "{}", studio.log());
    for (panel, title, act) in Panel::OBJECT {
        studio.act(act);
        assert!(studio.harness.state().object_layout.visible().contains(&panel), "{title} did not come");
    }
    studio.act(Act::SceneWorkspace);
    studio.control("Start fit");
    assert!(studio.model().project.is_some());
    studio.act(Act::PanelObject);
    assert_eq!(studio.model().workspace, Workspace::Object);
    let folder = studio.folder.path().to_path_buf();
    studio.act(Act::OpenPhoto);
    studio.frames(2);
    studio.replace_text("Path", &folder.join("ball.exr").display().to_string());
    studio.click("Add this");
    assert_eq!(studio.model().edits.object.photos.len(), 1);
    studio.act(Act::OpenDemo);
    assert_eq!(studio.model().workspace, Workspace::Scene, "a scene is shown where scenes are");
}
