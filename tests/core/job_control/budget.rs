//! A fit whose time is limited: by clocks that are set by hand, so that no test waits or hangs on how fast a machine is.

use super::support::*;
use crate::core_tests::common::*;
use patina::export::RunFolder;
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, Method, StepOutcome};
use patina::insight::report::ReportData;
use patina::job::budget::ENDED_BY_BUDGET;
use patina::job::open::view_run;
use patina::job::{Budget, JobOptions, RunSettings};
use patina::material::LobeModel;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// The solver on maps of half size first.
fn of_solver() -> FitSettings {
    FitSettings { method: Method::Solver, map_size: 256, solver_levels: 3, solver_rounds: 2, solver_grid: 32, ..base() }
}

/// Where the solver ends that nothing ends, fitted once for all tests.
fn end_of_solver() -> &'static FitState {
    static END: OnceLock<FitState> = OnceLock::new();
    END.get_or_init(|| to_end(new_fitter(&of_solver())))
}

/// Options of a job whose time is up once so many steps are done, before the next look but `looks` at the clock.
fn over_after(steps: usize, looks: usize) -> JobOptions {
    let never = usize::MAX;
    let left = Arc::new(AtomicUsize::new(never));
    let own = Arc::clone(&left);
    let clock = move || {
        let take = |left: usize| (left != never).then(|| left.saturating_sub(1));
        if own.fetch_update(Ordering::Relaxed, Ordering::Relaxed, take) == Ok(0) { 1.0 } else { 0.0 }
    };
    let before_step = move |step| {
        if step == steps {
            left.store(looks, Ordering::Relaxed);
        }
    };
    JobOptions {
        budget: Some(Budget::by_clock(1.0, Arc::new(clock))),
        before_step: Some(Box::new(before_step)),
        ..JobOptions::default()
    }
}

fn finished(fitter: Fitter, path: &Path, options: JobOptions) -> ReportData {
    let job = job(fitter, path, options);
    let events = until(&job, is_end);
    job.join();
    report(&events).clone()
}

fn finding(data: &ReportData) -> Option<&str> {
    let found = data.findings.iter().find(|finding| finding.code == ENDED_BY_BUDGET)?;
    assert!(found.remedy.contains("patina resume"), "{found:?}");
    Some(&found.message)
}

fn bytes_of_result(folder: &RunFolder) -> Vec<Vec<u8>> {
    let names = ["diffuse.exr", "specular.exr", "roughness.exr", "seen.exr", "env.exr", "mesh.obj", "settings.toml"];
    names.map(|name| std::fs::read(folder.file(name)).unwrap()).into()
}

#[test]
fn a_fit_that_its_budget_does_not_end_has_the_bits_of_one_without() {
    for settings in [base(), of_solver()] {
        let folder = tempfile::tempdir().unwrap();
        let [free, limited] = ["free", "limited"].map(|name| folder.path().join(name));
        let without = finished(new_fitter(&settings), &free, JobOptions::default());
        let budget = Some(Budget::by_clock(1.0, Arc::new(|| 0.0)));
        let with = finished(new_fitter(&settings), &limited, JobOptions { budget, ..JobOptions::default() });
        assert_eq!((finding(&with), &with.aggregates), (None, &without.aggregates));
        let [free, limited] = [free, limited].map(|path| RunFolder::open(&path).unwrap());
        assert!(bytes_of_result(&free) == bytes_of_result(&limited));
    }
}

/// A job that ends by its budget after so many steps leaves a whole run, and goes on as if nothing had ended it.
fn assert_whole(settings: &FitSettings, steps: usize, left_out: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let data = finished(new_fitter(settings), &path, over_after(steps, 0));
    let told = finding(&data).unwrap();
    assert!(told.contains(left_out), "{told}");
    assert_eq!(data.loss_history.len(), steps);
    assert!(data.aggregates.iter().any(|aggregate| aggregate.name == "held-out views"));
    let run = RunFolder::open(&path).unwrap();
    let result = run.read_result().unwrap();
    assert_eq!((result.maps.diffuse.width(), result.lobe), (settings.map_size, settings.lobe));
    assert!(run.report_html_path().is_file());
    // Looked at, it is a finished run, although its checkpoint has steps to go.
    let mut own: RunSettings = run.read_settings().unwrap();
    own.scene = folder.path().join("none");
    run.write_settings(&own).unwrap();
    let seen = view_run(&run, None, &GO, &|_, _| {}).unwrap();
    assert!(seen.is_finished && seen.can_resume && seen.report.is_some());
    assert_eq!(seen.maps.diffuse, result.maps.diffuse);
    let resumed = taken_up(&path);
    assert_eq!(resumed.state().step, steps);
    let end = to_end(resumed);
    match *settings == of_solver() {
        true => assert!(end == *end_of_solver(), "after {steps} steps"),
        false => assert!(end == to_end(new_fitter(settings)), "after {steps} steps"),
    }
}

#[test]
fn a_fit_that_its_budget_ends_is_a_whole_run_and_goes_on_bit_for_bit() {
    let solver = of_solver();
    assert_whole(&solver, 0, "0 of 4 steps; left out: wide light 1/2, narrow light 1/2, maps 1/2, refine; no maps");
    assert_whole(&solver, 1, "1 of 4 steps; left out: narrow light 1/2, maps 1/2, refine; no maps were made");
    assert_whole(&solver, 3, "left out: refine");
    let ggx = FitSettings { lobe: LobeModel::Ggx, ..solver };
    assert_whole(&ggx, 3, "left out: refine");
    assert_whole(&base(), 2, "left out: diffuse 1/2");
}

#[test]
fn texels_that_no_round_has_reached_have_the_colours_of_their_pixels() {
    let mut fitter = stepped(&FitSettings { map_size: 32, ..of_solver() }, 1);
    let is_solved: Vec<bool> = fitter.state().variances.iter().map(|known| known.is_solved()).collect();
    let before = fitter.state().texels.clone();
    fitter.cut_short(None);
    assert_sound(fitter.state());
    assert!(fitter.steps_left().is_empty() && fitter.deviations().is_none());
    let after = &fitter.state().texels;
    assert!(before == *after);
    let unsolved: Vec<_> = (0..after.len()).filter(|&texel| !is_solved[texel]).map(|texel| after[texel]).collect();
    assert!(unsolved.len() > 100 && unsolved.len() < after.len(), "{}", unsolved.len());
    let mut colours: Vec<_> = unsolved.iter().map(|own| own.diffuse.map(f32::to_bits)).collect();
    colours.sort();
    colours.dedup();
    // Those that no photo shows have the colour of the nearest.
    assert!(colours.len() > 50, "{} of {}", colours.len(), unsolved.len());
}

#[test]
fn a_descent_that_is_stopped_leaves_what_it_had_reached_to_the_result_alone() {
    let mut fitter = stepped(&of_solver(), 3);
    let before = fitter.state().clone();
    let (stop, mut seen) = (AtomicBool::new(false), Vec::new());
    let outcome = fitter.step_watched(&stop, &mut |underway| {
        // What is between two steps is only to be seen.
        if underway.is_reached {
            seen.push((underway.shown().0, underway.reached()));
            stop.store(true, Ordering::Relaxed);
        }
    });
    assert_eq!(outcome.unwrap(), StepOutcome::Interrupted);
    assert!(fitter.state().texels != before.texels, "maps of full size are what it begins with");
    assert_eq!((fitter.state().step, fitter.state().losses.len()), (before.step, before.losses.len()));
    let (maps, reached) = seen.pop().unwrap();
    assert!(seen.is_empty() && maps != fitter.maps());
    fitter.cut_short(Some(reached));
    assert_sound(fitter.state());
    assert!(maps == fitter.maps() && fitter.steps_left().is_empty());
}

#[test]
fn a_step_of_maps_that_the_time_is_up_in_is_dropped_or_done_and_nothing_between() {
    let settings = of_solver();
    let folder = tempfile::tempdir().unwrap();
    // The first look is before the step.
    let data = finished(new_fitter(&settings), folder.path(), over_after(2, 1));
    assert!(finding(&data).is_some() && [2, 3].contains(&data.loss_history.len()), "{}", data.loss_history.len());
    assert!(to_end(taken_up(folder.path())) == *end_of_solver());
}
