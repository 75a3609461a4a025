//! Into a scene and out of a run: the import's checklist, the export's dialog, the card of a finished fit, and what is seen
//! before there are materials.

use super::support::{Key, Modifiers, TestStudio, finished_run, small_scene};
use patina::studio::act::Act;
use patina::studio::model::FitStatus;
use patina::studio::stage::Layer;
use patina::studio::workspace::Panel;

#[test]
fn photos_stand_on_the_mesh_until_there_are_materials() {
    let mut studio = TestStudio::opening(Some(small_scene().into()));
    studio.wait("the photos on the mesh", |model| {
        model.project.as_ref().is_some_and(|own| own.laid.as_ref().is_some_and(|laid| laid.texels.is_some()))
    });
    assert_eq!(studio.model().edits.layer, Layer::Lit);
    assert_eq!(studio.model().shown_layer(), Layer::Photos, "nothing white is shown for materials");
    studio.prepare_fit();
    studio.start_endless_fit();
    studio.wait("the first materials", |model| model.project.as_ref().is_some_and(|own| own.maps.is_some()));
    assert_eq!(studio.model().shown_layer(), Layer::Lit);
    // They can be looked at again at any time.
    studio.click("Projected");
    assert_eq!(studio.model().shown_layer(), Layer::Photos);
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
}

#[test]
fn a_finished_fit_tells_what_was_found_and_leads_on() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("Start");
    studio.wait("the end of the fit", |model| model.fit.status == FitStatus::Finished);
    for words in ["Fit finished", "Held-out photos", "Uncertain", "Next steps"] {
        assert!(studio.says(words), "{words}");
    }
    studio.click("Relight result");
    assert!(studio.model().visible_panels.contains(&Panel::Relight));
    studio.click("Hide card");
    assert!(!studio.says("Next steps"));
    // Who opens a run that was finished before is told nothing new.
    let studio = TestStudio::with_finished_run();
    assert!(!studio.says("Next steps"));
}

#[test]
fn an_export_is_asked_for_told_of_and_written() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    let into = folder.path().join("out of here");
    studio.wait("the result", |model| model.fit.folder.as_ref().is_some_and(|folder| folder.has_result()));
    studio.act(Act::Export);
    studio.frames(2);
    studio.harness.check_accessibility();
    assert!(studio.says("What will be lost") && studio.says("GGX"), "{}", studio.log());
    // Nothing chosen is nothing to write, and the dialog says so.
    for format in ["GLB (glTF 2.0)", "Texture set"] {
        studio.click(format);
    }
    assert!(studio.says("No format is named"));
    assert!(studio.is_grey("Export"));
    studio.click("Texture set");
    studio.click("MaterialX (OpenPBR)");
    studio.replace_text("Export folder", &into.display().to_string());
    studio.click("Export");
    studio.wait_for_word("Exported to");
    assert!(into.join("textures/convention.txt").is_file() && into.join("materialx").is_dir());
    assert!(!into.join("glb").exists());
    assert!(!studio.says("What will be lost"), "the dialog is gone");
    // A folder that holds other things is not replaced, and the error says so.
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("letter.txt"), b"not an export").unwrap();
    studio.act(Act::Export);
    studio.replace_text("Export folder", &other.display().to_string());
    studio.click("Export");
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(other.join("letter.txt").is_file());
    // A scene that was not fitted has nothing to export.
    let mut studio = TestStudio::with_small_scene();
    studio.act(Act::Export);
    assert!(!studio.says("What will be lost"));
    assert!(studio.log().contains("available when a fit is finished"), "{}", studio.log());
    let _ = finished_run();
}

#[test]
fn an_import_fills_its_list_says_what_is_missing_and_writes_the_manifest() {
    let place = tempfile::tempdir().unwrap();
    let root = place.path();
    std::fs::create_dir(root.join("photos")).unwrap();
    for photo in ["a.jpg", "b.jpg", "c.jpg", "d.jpg"] {
        std::fs::write(root.join("photos").join(photo), b"no picture yet").unwrap();
    }
    let mut studio = TestStudio::new();
    studio.press(Modifiers::COMMAND, Key::I);
    studio.replace_text("Folder", &root.display().to_string());
    assert!(studio.says("4 photos; missing: mesh, cameras"));
    studio.harness.check_accessibility();
    assert!(studio.is_grey("Write scene.toml and open"));
    studio.press(Modifiers::NONE, Key::Escape);
    std::fs::write(root.join("scan.ply"), b"no mesh yet").unwrap();
    std::fs::create_dir(root.join("cams")).unwrap();
    std::fs::write(root.join("cams/a_cam.txt"), b"no camera yet").unwrap();
    studio.press(Modifiers::COMMAND, Key::I);
    studio.replace_text("Folder", &root.display().to_string());
    assert!(studio.says("4 photos; nothing is missing"));
    studio.click("Write scene.toml and open");
    assert!(root.join("scene.toml").is_file());
    // What is in the files is the reader's to judge.
    studio.wait("the error", |model| model.log.banner().is_some());
    // A folder that is a scene already is opened as it is.
    studio.press(Modifiers::NONE, Key::Escape);
    studio.press(Modifiers::COMMAND, Key::I);
    studio.replace_text("Folder", &small_scene().display().to_string());
    studio.click("Open as it is");
    studio.wait("the scene", |model| model.project.is_some());
}
