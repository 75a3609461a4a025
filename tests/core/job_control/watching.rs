//! A job that is watched, paused, stepped and stopped.

use super::support::*;
use crate::core_tests::common::*;
use patina::fit::settings::Consistency;
use patina::fit::{FitSettings, checkpoint};
use patina::job::{Command, Event, JobOptions};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

#[test]
fn a_job_takes_changes_refuses_others_and_is_taken_up_where_it_was_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (gate, options) = Gate::new();
    let job = job(new_fitter(&base()), folder.path(), options);
    let good = FitSettings { samples: 4, steps_all: 8, exclude: vec!["view2".into(), "typo".into()], ..base() };
    gate.until(3);
    job.commands.send(Command::Change(Box::new(FitSettings { levels: 1, ..base() }))).unwrap();
    job.commands.send(Command::Change(Box::new(good.clone()))).unwrap();
    gate.one();
    let events = until(&job, |event| matches!(event, Event::SettingsChanged(_)));
    let Some(Event::SettingsChanged(told)) = events.last() else { unreachable!() };
    assert_eq!(**told, good);
    assert!(
        events.iter().any(|event| matches!(event, Event::Refused(error) if error.to_string().contains("--levels")))
    );
    assert!(events.iter().any(|event| is_finding(event, "exclude-unknown")));
    // What is on the disk now is the changed fit after four steps.
    let mut expected = stepped(&base(), 4);
    expected.change(good.clone()).unwrap();
    let at_change = taken_up(folder.path());
    assert_eq!(at_change.settings(), &good);
    assert_eq!(without_seconds(at_change.state()), without_seconds(expected.state()));

    gate.until(6);
    job.stop();
    gate.one();
    let events = until(&job, is_end);
    assert!(matches!(events.last(), Some(Event::Stopped { .. })), "{:?}", events.last());
    job.join();
    let whole = to_end(expected);
    assert_eq!(whole.step, 14);
    assert_eq!(to_end(at_change), whole);
    assert_eq!(to_end(taken_up(folder.path())), whole);
}

#[test]
fn the_report_marks_what_was_left_out_and_the_snapshot_has_live_figures() {
    let folder = tempfile::tempdir().unwrap();
    let settings =
        FitSettings { exclude: vec!["view0".into()], consistency: Consistency::Constant, exposure: true, ..base() };
    let job = job(new_fitter(&settings), folder.path(), JobOptions::default());
    let events = until(&job, is_end);
    let data = report(&events);
    let marked: Vec<&str> = data.views.iter().filter(|view| view.left_out).map(|view| view.name.as_str()).collect();
    assert_eq!(marked, ["view0"]);
    let counts: Vec<_> =
        data.aggregates.iter().map(|aggregate| (aggregate.name.as_str(), aggregate.score.views)).collect();
    assert_eq!(
        counts,
        [("held-out views", 1), ("training views", 3), ("held-out views, the nearest photo", 1)],
        "a baseline beside what was fitted"
    );
    let html = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(html.contains("left out"));

    let (_, snapshot) = job.snapshot.newest().unwrap();
    assert_eq!((snapshot.step, snapshot.steps_total, snapshot.stage.as_str()), (12, 12, "all 1/1"));
    let known: Vec<bool> = snapshot.view_rmse.iter().map(|rmse| rmse.is_some_and(f32::is_finite)).collect();
    assert_eq!(known, [false, true, true, true, true]);
    // The held-out one is that of the last look, which had one view.
    let held_out = snapshot.losses.iter().rev().find_map(|row| row.held_out_rmse).unwrap();
    assert!((f64::from(snapshot.view_rmse[4].unwrap()) - held_out).abs() < 1e-6);
    assert_eq!(snapshot.log_gains.len(), 5);
    assert!(snapshot.log_gains[0] == 0.0 && snapshot.log_gains[1] != 0.0);
    let agreement = snapshot.agreement.as_ref().unwrap();
    assert_eq!((agreement.width(), agreement.height()), (16, 16));
    assert!(agreement.pixels().iter().all(|value| (0.0..=1.0).contains(value)));
    assert!(agreement.pixels().iter().any(|&value| value > 0.0));
    job.join();
}

#[test]
fn the_error_of_a_view_is_that_of_its_step() {
    let mut fitter = new_fitter(&FitSettings { views_per_step: 1, ..base() });
    for _ in 0..4 {
        let before = fitter.figures().view_rmse.clone();
        fitter.step(&GO).unwrap();
        let after = &fitter.figures().view_rmse;
        let moved: Vec<usize> = (0..4).filter(|&view| before[view] != after[view]).collect();
        assert_eq!(moved.len(), 1);
        // What the view's surface says is what the line of the step says; the loss counts its background too.
        let row = fitter.state().losses.last().unwrap();
        let own = f64::from(after[moved[0]].unwrap());
        assert!(own > 0.0 && (row.surface_rmse.unwrap() - own).abs() < 1e-6, "{own} against {row:?}");
    }
}

#[test]
fn single_steps_hold_again_and_show_what_they_did() {
    let folder = tempfile::tempdir().unwrap();
    // More steps than can be done before the pause is heard.
    let job = job(new_fitter(&FitSettings { steps_all: 100_000, ..base() }), folder.path(), JobOptions::default());
    job.commands.send(Command::Pause).unwrap();
    until(&job, |event| matches!(event, Event::Paused));
    let shown = || job.snapshot.newest().unwrap().1.step;
    let before = shown();
    for count in [1, 2] {
        let already = shown();
        (0..count).for_each(|_| job.commands.send(Command::StepOnce).unwrap());
        for step in 1..=count {
            let events = until(&job, |event| matches!(event, Event::Progress(_)));
            let Some(Event::Progress(progress)) = events.last() else { unreachable!() };
            assert_eq!(progress.row.step, already + step);
        }
        // A checkpoint that was asked for is written after the steps and their snapshot.
        job.commands.send(Command::Checkpoint).unwrap();
        until(&job, |event| matches!(event, Event::Checkpoint(_)));
        assert_eq!(shown(), already + count);
    }
    let saved = checkpoint::read(&folder.path().join("checkpoint")).unwrap();
    assert_eq!(saved.step, before + 3);
    job.stop();
    let events = until(&job, is_end);
    assert!(matches!(events.last(), Some(Event::Stopped { steps_done }) if *steps_done == before + 3));
}

#[test]
fn nobody_who_watches_holds_a_fit_up() {
    let folder = tempfile::tempdir().unwrap();
    let woken = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&woken);
    let options = JobOptions {
        wake: Some(Arc::new(move || {
            counter.fetch_add(1, Ordering::Relaxed);
        })),
        ..Default::default()
    };
    let settings = FitSettings { steps_diffuse: 300, steps_all: 0, samples: 1, bounces: 1, levels: 1, ..base() };
    let job = job(new_fitter(&settings), folder.path(), options);
    let events = job.events.clone();
    // Nobody reads until the thread has ended.
    job.join();
    let events: Vec<Event> = events.try_iter().collect();
    assert_eq!(report(&events).loss_history.len(), 300);
    let steps = events.iter().filter(|event| matches!(event, Event::Progress(_))).count();
    assert!((100..300).contains(&steps), "{steps} steps were kept");
    assert!(events.iter().any(|event| matches!(event, Event::Started { .. })));
    assert!(woken.load(Ordering::Relaxed) >= events.len());
}
