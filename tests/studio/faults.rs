//! What goes wrong while the window is open: it lives, says so with a remedy, and the last checkpoint stays.

use super::support::{ENDLESS, Role, TestStudio, write_small_scene};
use patina::files::{temporary_beside, write_bytes};
use patina::studio::act::Act;
use patina::studio::act::availability::availability;
use patina::studio::model::FitStatus;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Pauses and waits until the worker holds; its checkpoint is written then.
fn pause(studio: &mut TestStudio) {
    studio.click("Pause fit");
    studio.wait("the pause", |model| model.fit.status == FitStatus::Paused);
    let checkpoint = studio.run_folder().join("checkpoint");
    studio.wait("the checkpoint", move |model| model.fit.last_checkpoint.is_some() && checkpoint.is_file());
    studio.frames(20);
}

fn assert_lives(studio: &mut TestStudio) {
    studio.frames(3);
    studio.click("Photos");
    studio.control("Exclude");
    studio.click_first("Window");
    studio.click("Panels");
    studio.click_role(Role::MenuItem, "Fit panel");
}

#[test]
fn a_worker_that_panics_is_told_and_the_fit_goes_on_from_its_checkpoint() {
    let falls = Arc::new(AtomicBool::new(false));
    let own = Arc::clone(&falls);
    let mut studio = TestStudio::with_small_scene();
    studio.model().before_step = Some(Arc::new(move |_| assert!(!own.load(Ordering::Relaxed), "a fault on purpose")));
    studio.start_endless_fit();
    let written = studio.model().fit.last_checkpoint;
    studio.click("Checkpoint");
    studio.wait("the checkpoint", move |model| model.fit.last_checkpoint != written);
    let kept = studio.steps_done();
    falls.store(true, Ordering::Relaxed);
    studio.wait("the fault", |model| matches!(model.fit.status, FitStatus::Failed(_)));
    assert!(studio.says("a fault on purpose") && studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");
    assert!(studio.says("Failed: "), "the line at the bottom keeps it");
    assert_lives(&mut studio);

    falls.store(false, Ordering::Relaxed);
    // What helps is to go on: the button is there, and the steps before the checkpoint are not done again.
    studio.click("Resume from checkpoint");
    studio.wait_for_word("Fit resumed after step");
    studio.wait_for_step(kept + 1);
    let log = studio.log();
    let step: usize = log.split("resumed after step ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(step >= 3 && step <= kept + 1, "after step {step}, checkpoint at {kept}");
}

#[test]
fn a_run_folder_that_is_deleted_while_the_fit_runs_is_made_again() {
    let mut studio = TestStudio::with_running_fit();
    pause(&mut studio);
    let run = studio.run_folder();
    std::fs::remove_dir_all(&run).unwrap();
    let written = studio.model().fit.last_checkpoint;
    studio.click("Checkpoint");
    studio.wait("the checkpoint", move |model| model.fit.last_checkpoint != written);
    for file in ["checkpoint", "settings.toml", "mesh.obj", "convention.txt"] {
        assert!(run.join(file).is_file(), "{file}");
    }
    assert_lives(&mut studio);
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    studio.click("Resume from checkpoint");
    studio.wait_for_word("Fit resumed after step");
}

#[test]
fn a_run_folder_that_cannot_be_written_is_a_warning_and_is_tried_again() {
    let mut studio = TestStudio::with_running_fit();
    pause(&mut studio);
    let run = studio.run_folder();
    let aside = run.with_extension("aside");
    std::fs::rename(&run, &aside).unwrap();
    write_bytes(&run, b"in the way").unwrap();
    // What the check says of so small photos.
    studio.model().log.clear();
    studio.click("Checkpoint");
    studio.wait_for_word("the checkpoint could not be saved");
    assert!(studio.says("warning"));
    studio.click("Messages (1)");
    assert!(studio.says("Fix: "), "{}", studio.log());
    assert_eq!(studio.model().fit.status, FitStatus::Paused, "the fit holds on");
    assert_lives(&mut studio);

    std::fs::remove_file(&run).unwrap();
    std::fs::rename(&aside, &run).unwrap();
    studio.click("Checkpoint");
    studio.wait_for_word("is saved again");
}

#[test]
fn a_disk_that_is_full_is_told_and_the_last_checkpoint_stays() {
    if !Path::new("/dev/full").exists() {
        println!("skipped: /dev/full not present");
        return;
    }
    let mut studio = TestStudio::with_running_fit();
    pause(&mut studio);
    let checkpoint = studio.run_folder().join("checkpoint");
    let before = std::fs::read(&checkpoint).unwrap();
    studio.click("Single step");
    studio.wait("the step", |model| model.fit.status == FitStatus::Paused);
    studio.frames(20);
    // The next checkpoint is first written beside its place: there, every byte meets a full disk.
    #[cfg(unix)]
    std::os::unix::fs::symlink("/dev/full", temporary_beside(&checkpoint)).unwrap();
    studio.click("Checkpoint");
    studio.wait_for_word("the checkpoint could not be saved");
    assert!(studio.log().contains("No space left"), "{}", studio.log());
    assert!(std::fs::read(&checkpoint).unwrap() == before, "the last checkpoint stays as it was");
    assert_lives(&mut studio);

    studio.click("Checkpoint");
    studio.wait_for_word("is saved again");
    assert!(std::fs::read(&checkpoint).unwrap() != before);

    // Full again when it stops: the steps since the last checkpoint are lost, which is an error, not a warning.
    studio.click("Single step");
    studio.frames(20);
    #[cfg(unix)]
    std::os::unix::fs::symlink("/dev/full", temporary_beside(&checkpoint)).unwrap();
    studio.click("Stop");
    studio.wait("the error", |model| matches!(model.fit.status, FitStatus::Failed(_)));
    assert!(studio.says("Fix: ") && studio.says("No space left"), "{}", studio.log());
    studio.click("Dismiss");
    studio.click("Resume from checkpoint");
    studio.wait_for_word("Fit resumed after step");
}

#[test]
fn runs_that_cannot_be_written_at_all_are_told_before_anything_is_lost() {
    let mut studio = TestStudio::with_small_scene();
    let runs = studio.folder.path().join("runs");
    write_bytes(&runs, b"in the way").unwrap();
    studio.click("Start");
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");
    assert_eq!(studio.model().fit.status, FitStatus::Idle);
    std::fs::remove_file(&runs).unwrap();
    studio.click("Start");
    studio.wait("the end", |model| model.fit.status == FitStatus::Finished);
}

#[test]
fn a_scene_that_vanished_keeps_its_run_from_going_on_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    std::fs::create_dir(&scene).unwrap();
    write_small_scene(&scene);
    let mut studio = TestStudio::with_scene(&scene);
    // Between opening and starting: everything was read, the fit needs the folder no more.
    let away = folder.path().join("away");
    std::fs::rename(&scene, &away).unwrap();
    studio.start_endless_fit();
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);

    // Going on reads the scene again.
    studio.click("Resume from checkpoint");
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");
    assert_eq!(studio.model().fit.status, FitStatus::Stopped);
    assert_lives(&mut studio);

    // Opened anew, the run shows its maps, and says why it cannot go on.
    let run = studio.run_folder();
    studio.model().open(run);
    studio.wait("the run", |model| model.project.as_ref().is_some_and(|own| own.is_run && own.scene.is_none()));
    assert!(studio.model().project.as_ref().unwrap().maps.is_some());
    assert!(studio.is_grey("Resume from checkpoint"));
    studio.click("Photos");
    assert!(studio.says("a run whose scene has moved"), "{}", studio.log());

    std::fs::rename(&away, &scene).unwrap();
    let run = studio.run_folder();
    studio.model().open(run);
    studio.wait("the run", |model| model.project.as_ref().is_some_and(|own| own.scene.is_some()));
    studio.click_tab("Fit");
    studio.click("Resume from checkpoint");
    studio.wait_for_word("Fit resumed after step");
}

#[test]
fn a_checkpoint_that_is_damaged_is_told_and_a_new_fit_can_start() {
    let mut studio = TestStudio::with_running_fit();
    studio.click("Stop");
    studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
    write_bytes(&studio.run_folder().join("checkpoint"), b"damaged").unwrap();
    studio.click("Resume from checkpoint");
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(studio.says("Fix: "), "{}", studio.log());
    studio.click("Dismiss");
    assert_lives(&mut studio);
    std::fs::remove_file(studio.run_folder().join("checkpoint")).unwrap();
    studio.frames(2);
    studio.click("Start");
    studio.wait_for_word("Fit started");
}

#[test]
fn a_run_that_a_crash_interrupted_is_found_at_the_next_start_and_goes_on() {
    let mut studio = TestStudio::with_running_fit();
    pause(&mut studio);
    let (run, done) = (studio.run_folder(), studio.steps_done());
    // What a killed program leaves: the settings as they were written while the fit ran.
    let left = std::fs::read(studio.folder.path().join("studio.json")).unwrap();
    assert!(String::from_utf8_lossy(&left).contains("running"));
    let folder = Arc::clone(&studio.folder);
    drop(studio);
    write_bytes(&folder.path().join("studio.json"), &left).unwrap();

    let mut again = TestStudio::in_folder(folder, None);
    again.frames(1);
    assert!(again.says("quit unexpectedly during a fit") && again.says("A valid checkpoint was found"));
    again.click("Resume");
    again.wait("the run", |model| model.project.is_some());
    assert_eq!(again.run_folder(), run);
    again.click("Resume from checkpoint");
    again.wait_for_step(done + 1);
    assert_eq!(again.model().edits.fit.steps_diffuse, ENDLESS);

    // Closed in order, nothing is offered at the next start.
    let folder = again.close();
    let mut third = TestStudio::in_folder(folder, None);
    third.frames(1);
    assert!(!third.says("quit unexpectedly during a fit"));
}

#[test]
fn what_is_no_scene_leaves_the_open_one_and_its_fit_alone() {
    let mut studio = TestStudio::with_running_fit();
    let (run, folder) = (studio.run_folder(), studio.folder.path().to_path_buf());
    let (paper, damaged) = (folder.join("paper.pdf"), folder.join("damaged"));
    write_bytes(&paper, b"no scene").unwrap();
    // A folder that calls itself a scene, and cannot be read.
    std::fs::create_dir(&damaged).unwrap();
    write_bytes(&damaged.join("scene.toml"), b"= no settings").unwrap();
    for (path, name) in [(paper, "paper.pdf"), (damaged, "damaged")] {
        studio.model().dropped(path);
        studio.wait("the error", |model| model.log.banner().is_some());
        assert!(studio.log().contains(name), "{}", studio.log());
        studio.click("Dismiss");
        let done = studio.steps_done();
        studio.wait_for_step(done + 1);
        assert_eq!(studio.model().fit.status, FitStatus::Running);
        assert_eq!(studio.run_folder(), run);
    }
}

#[test]
fn a_preparation_that_is_cancelled_leaves_a_scene_that_says_so() {
    let mut studio = TestStudio::with_scene_just_read();
    studio.model().tasks.stop_those_of_scene();
    studio.frames(3);
    // The button is grey rather than dead, and says what helps.
    assert!(studio.is_grey("Start fit"));
    let why = availability(Act::Start, studio.model()).unwrap_err();
    assert!(why.contains("open it again"), "{why}");
    studio.act(Act::CloseProject);
    studio.control("Open the built-in demo");
}
