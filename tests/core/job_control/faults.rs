//! Folders that vanish, files that cannot be written, workers that panic: nothing the user had is lost.

use super::support::*;
use crate::core_tests::common;
use crate::core_tests::common::*;
use patina::ErrorKind;
use patina::export::RunFolder;
use patina::job::{Command, Event, JobOptions};

#[test]
fn a_folder_that_is_deleted_is_made_again_with_all_that_a_resumed_fit_needs() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    job.commands.send(Command::Checkpoint).unwrap();
    gate.one();
    gate.until(5);
    let taken = taken_up(&folder);
    assert_eq!(taken.state().step, 5);
    std::fs::remove_dir_all(&folder).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    report(&events);
    job.join();
    assert!(RunFolder::open(&folder).unwrap().has_result());
    assert_eq!(to_end(taken), without_seconds(taken_up(&folder).state()));
}

#[test]
fn a_checkpoint_that_cannot_be_written_is_a_warning_and_is_tried_again() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(2);
    // A folder in the place of the file: no permission is needed for this to fail.
    let settings = folder.join("settings.toml");
    let before = std::fs::read(&settings).unwrap();
    std::fs::remove_file(&settings).unwrap();
    std::fs::create_dir_all(settings.join("in the way")).unwrap();
    for _ in 0..2 {
        job.commands.send(Command::Checkpoint).unwrap();
        gate.one();
        gate.next();
    }
    std::fs::remove_dir_all(&settings).unwrap();
    patina::files::write_bytes(&settings, &before).unwrap();
    assert_eq!(taken_up(&folder).state().step, 0, "the last whole checkpoint stays");
    job.commands.send(Command::Checkpoint).unwrap();
    gate.one();
    let events = until(&job, |event| is_finding(event, "checkpoint-written-again"));
    let warnings: Vec<_> = events
        .iter()
        .filter_map(|event| match event {
            Event::Finding(finding) if finding.code == "checkpoint-not-written" => Some(finding),
            _ => None,
        })
        .collect();
    assert_eq!(warnings.len(), 1, "told once: {warnings:?}");
    assert!(warnings[0].place.contains("settings.toml") && warnings[0].remedy.contains("retried"));
    gate.next();
    assert_eq!(taken_up(&folder).state().step, 5);
    drop(gate);
    report(&until(&job, is_end));
}

#[test]
fn results_that_cannot_be_written_are_an_error_at_the_end() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    patina::files::write_bytes(&folder, b"a file in the place of the folder").unwrap();
    job.commands.send(Command::Checkpoint).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    assert!(events.iter().any(|event| is_finding(event, "checkpoint-not-written")));
    let last = events.iter().filter_map(|event| if let Event::Progress(p) = event { Some(p.row.step) } else { None });
    assert_eq!(last.max(), Some(12), "the fit went on to its end");
    let Some(Event::Failed(error)) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!(error.kind(), ErrorKind::Unwritable, "{error}");
    job.join();
    assert_eq!(std::fs::read(&folder).unwrap(), b"a file in the place of the folder");
}

#[test]
fn a_stop_that_cannot_save_is_an_error_and_no_stop() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("run");
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), &folder, options);
    gate.until(4);
    std::fs::remove_dir_all(&folder).unwrap();
    patina::files::write_bytes(&folder, b"in the way").unwrap();
    job.stop();
    gate.one();
    assert!(matches!(until(&job, is_end).last(), Some(Event::Failed(error)) if error.kind() == ErrorKind::Unwritable));
}

#[test]
fn a_stop_while_the_report_is_made_is_no_failure_and_the_maps_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), folder.path(), options);
    gate.until(12);
    job.stop();
    gate.one();
    let events = until(&job, is_end);
    assert!(events.iter().any(|event| matches!(event, Event::Finishing(_))), "the steps were done: {events:?}");
    assert!(matches!(events.last(), Some(Event::Stopped { steps_done: 12 })), "{:?}", events.last());
    assert!(events.iter().any(|event| is_finding(event, "report-not-made")));
    job.join();
    assert!(folder.path().join("diffuse.exr").is_file() && !folder.path().join("report.html").exists());
    // What is left is the report: taken up, it is made.
    let taken = taken_up(folder.path());
    assert_eq!(taken.state().step, 12);
    let job = common::job(taken, folder.path(), JobOptions::default());
    report(&until(&job, is_end));
    assert!(folder.path().join("report.html").is_file());
}

#[test]
fn a_worker_that_panics_says_so_and_its_checkpoint_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, JobOptions { before_step, .. }) = Gate::new();
    let mut hold = before_step.unwrap();
    let before_step = move |step| {
        hold(step);
        assert!(step < 8, "a panic that this test asked for");
    };
    let options = JobOptions { before_step: Some(Box::new(before_step)), ..Default::default() };
    let job = job(new_fitter(&base()), folder.path(), options);
    gate.until(4);
    job.commands.send(Command::Checkpoint).unwrap();
    drop(gate);
    let events = until(&job, is_end);
    let Some(Event::Failed(error)) = events.last() else { panic!("{:?}", events.last()) };
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert!(error.to_string().contains("a panic that this test asked for") && error.to_string().contains("resume"));
    job.join();
    let taken = taken_up(folder.path());
    assert_eq!(taken.state().step, 5);
    assert_eq!(to_end(taken), to_end(new_fitter(&base())));
}
