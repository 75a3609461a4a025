//! Pictures that are saved, read back.

use super::support::{Key, Modifiers, TestStudio};
use patina::image::file;
use std::path::{Path, PathBuf};

/// Fills in the dialog and saves; waits until the files are there.
fn save(studio: &mut TestStudio, path: &Path, place: &str) {
    studio.replace_text(place, &path.display().to_string());
    for (field, number) in [("Width", "32"), ("Height", "24"), ("Samples per pixel", "2")] {
        studio.type_number(field, number);
    }
    studio.click("Save");
    studio.wait_for_word("Saved");
}

fn files_of(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Fails where a picture has another size or shows nothing.
fn assert_shows_something(path: &Path) {
    let picture = file::read_rgb(path).unwrap();
    assert_eq!((picture.width(), picture.height()), (32, 24), "{}", path.display());
    let brightest = picture.pixels().iter().map(|pixel| pixel.max_element()).fold(0.0f32, f32::max);
    let darkest = picture.pixels().iter().map(|pixel| pixel.max_element()).fold(f32::MAX, f32::min);
    assert!(brightest > 0.02 && darkest < 0.9 * brightest, "{}: {darkest} to {brightest}", path.display());
}

#[test]
fn a_picture_is_saved_as_the_screen_shows_it_and_in_linear_radiance() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    studio.press(Modifiers::COMMAND, Key::S);
    assert!(studio.says("Size (pixels)"));
    studio.harness.check_accessibility();
    let png = folder.path().join("stage.png");
    save(&mut studio, &png, "Image file");
    assert_shows_something(&png);
    assert!(!studio.says("Size (pixels)"), "the dialog is gone");

    studio.model().log.clear();
    // Two stops brighter on the screen: the linear picture does not follow.
    studio.model().edits.display.exposure_stops = 2.0;
    studio.press(Modifiers::COMMAND, Key::S);
    let exr = folder.path().join("deeper").join("stage.exr");
    save(&mut studio, &exr, "Image file");
    assert_shows_something(&exr);
    let mean = |path: &Path| {
        let picture = file::read_rgb(path).unwrap();
        picture.pixels().iter().map(|pixel| pixel.element_sum()).sum::<f32>() / picture.pixels().len() as f32
    };
    assert!((mean(&exr) / mean(&png) - 1.0).abs() < 0.5, "{} against {}", mean(&exr), mean(&png));
}

#[test]
#[ignore = "slow: pictures under every light"]
fn a_strip_shows_every_light_of_the_shelf_and_a_turntable_goes_around() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    let strip = folder.path().join("strip");
    studio.click("Export contact sheet…");
    save(&mut studio, &strip, "Image folder");
    let lights = studio.model().shelf.lights().len();
    let pictures: Vec<PathBuf> = files_of(&strip);
    assert!(pictures.len() >= lights, "{pictures:?}");
    assert_ne!(std::fs::read(&pictures[0]).unwrap(), std::fs::read(&pictures[1]).unwrap());

    studio.model().log.clear();
    let turntable = folder.path().join("turntable");
    studio.click("Render turntable…");
    studio.type_number("Images", "3");
    save(&mut studio, &turntable, "Image folder");
    let (films, frames): (Vec<PathBuf>, Vec<PathBuf>) =
        files_of(&turntable).into_iter().partition(|file| file.file_stem().is_some_and(|stem| stem == "turntable"));
    assert_eq!((films.len(), frames.len()), (1, 3), "a film, as an animated PNG or by ffmpeg: {films:?} {frames:?}");
    frames.iter().for_each(|frame| assert_shows_something(frame));
    assert_ne!(std::fs::read(&frames[0]).unwrap(), std::fs::read(&frames[1]).unwrap());
}

#[test]
fn a_picture_that_cannot_be_written_is_told_and_one_that_is_not_wished_is_not() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    let file_not_folder = folder.path().join("file");
    patina::files::write_bytes(&file_not_folder, b"in the way").unwrap();
    studio.press(Modifiers::COMMAND, Key::S);
    studio.replace_text("Image file", &file_not_folder.join("stage.png").display().to_string());
    for (field, number) in [("Width", "16"), ("Height", "16"), ("Samples per pixel", "1")] {
        studio.type_number(field, number);
    }
    studio.click("Save");
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");

    studio.press(Modifiers::COMMAND, Key::S);
    studio.replace_text("Image file", &folder.path().join("unwished.png").display().to_string());
    studio.press(Modifiers::NONE, Key::Escape);
    assert!(!studio.says("Size (pixels)"));
    assert!(!studio.model().tasks.is_busy() && files_of(folder.path()).len() == 1);
}

#[test]
fn an_image_is_cut_out_of_its_background_and_a_ground_keeps_its_shadow() {
    let mut studio = TestStudio::with_finished_run();
    let folder = tempfile::tempdir().unwrap();
    // From far enough away to have something beside the object.
    studio.model().eye.zoom(2.0, None);
    let mut opaque = Vec::new();
    for (name, ground) in [("alone.png", false), ("with_ground.png", true)] {
        studio.model().log.clear();
        if studio.model().edits.relight.ground != ground {
            studio.click("Ground plane");
        }
        studio.press(Modifiers::COMMAND, Key::S);
        studio.click("Transparent background");
        let path = folder.path().join(name);
        save(&mut studio, &path, "Image file");
        let picture = image::open(&path).unwrap();
        assert!(picture.color().has_alpha());
        let alphas: Vec<u8> = picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
        assert!(alphas.contains(&255), "the object is opaque");
        opaque.push(alphas.iter().map(|&alpha| u64::from(alpha)).sum::<u64>());
        if !ground {
            assert!(alphas.contains(&0), "and what is beside it is not there");
        }
    }
    assert!(opaque[1] > opaque[0], "a shadow covers something: {opaque:?}");
}
