//! The measurements one after another.

use super::person::Person;
use super::report::BenchReport;
use super::scenes::{self, BenchScene};
use super::{BenchOptions, answers, equality, frames, machine, memory, slowdown, stalls};
use crate::error::Result;
use crate::studio::act::Act;
use std::time::Instant;

/// Acts of each kind that are timed.
const ACTS: usize = 20;
/// How long a fit may take to its first steps, in seconds.
const LONG: f64 = 900.0;

/// Measures what was asked for.
pub(super) fn measure(person: &Person, options: &BenchOptions) -> Result<BenchReport> {
    let mut report = options.before.clone();
    let load_before = machine::load();
    let busy = || machine::busy_seconds_of_machine().zip(machine::processor_seconds().map(|seconds| seconds.all));
    let (busy_before, began) = (busy(), Instant::now());
    let (adapter, is_software, pixels) = person.ask(|studio, context| {
        let size = context.content_rect().size() * context.pixels_per_point();
        (studio.model.adapter.clone(), studio.model.software_adapter, [size.x as u32, size.y as u32])
    })?;
    let processors = std::thread::available_parallelism().map_or(1, |count| count.get());

    let large = BenchScene::large(options.scene.as_deref(), options.is_small);
    if options.stalls {
        for scene in [BenchScene::Demo, large.clone()] {
            (options.tell)(&format!("how long the window hears nobody: {}", scene.name()));
            report.stalls.extend(stalls::measure(person, &scene, options.seconds)?);
            person.ask(|studio, _| slowdown::forget_run(studio))?;
            close(person)?;
        }
    }
    if options.frames || options.answers || options.slowdown {
        for scene in [BenchScene::Demo, large] {
            with_scene(person, &scene, options, &mut report)?;
        }
    }
    if options.equality {
        (options.tell)("the same fit with and without the window");
        BenchScene::Demo.open(person)?;
        report.equality =
            Some(equality::measure(person, &BenchScene::Demo.name(), &options.output.join("runs/alone"))?);
        close(person)?;
    }
    if options.memory && options.cycles > 0 {
        (options.tell)("memory over cycles of open, fit, close");
        let folder = options.output.join("runs/small-scene");
        scenes::write_small_scene(&folder)?;
        report.memory = memory::measure(person, &BenchScene::Folder(folder), options.cycles, &*options.tell)?;
        report.memory_trend = memory::trend(&report.memory);
    }
    let taken_by_others = busy_before.zip(busy()).map(|((all, own), (all_after, own_after))| {
        let others = (all_after - all) - (own_after - own);
        (others / (processors as f64 * began.elapsed().as_secs_f64())).clamp(0.0, 1.0)
    });
    report.machine = machine::Machine {
        processors,
        processor: machine::processor(),
        adapter,
        is_software,
        window_pixels: pixels,
        load_before,
        load_after: machine::load(),
        taken_by_others,
        is_optimised: !cfg!(debug_assertions),
    };
    Ok(report)
}

/// What is measured on one scene.
fn with_scene(person: &Person, scene: &BenchScene, options: &BenchOptions, report: &mut BenchReport) -> Result<()> {
    let name = scene.name();
    (options.tell)(&format!("opening: {name}"));
    scene.open(person)?;
    person.ask(|studio, _| studio.model.edits.fit.steps_all = 100_000)?;
    if options.slowdown {
        (options.tell)(&format!("steps a second with and without the window: {name}"));
        let folder = options.output.join("runs");
        report.slowdown.push(slowdown::measure(person, &name, options.pairs, options.seconds, &folder)?);
    }
    if options.frames || options.answers {
        person.ask(|studio, _| {
            studio.model.switches.traced = false;
            slowdown::forget_run(studio);
        })?;
        person.watch(2.0);
        if options.frames {
            (options.tell)(&format!("frames at rest: {name}"));
            let seconds = options.seconds / 2.0;
            report.frames.push(frames::while_watching(person, &name, "no fit, nobody touches it", seconds)?);
            report.frames.push(frames::while_orbiting(person, &name, "no fit, the eye turns", seconds)?);
        }
        person.ask(|studio, _| studio.model.act(Act::Start))?;
        person.wait_until("the first steps", LONG, |studio| {
            studio.model.fit.losses.len() > 2
                && studio.model.project.as_ref().is_some_and(|project| project.maps.is_some())
        })?;
        if options.frames {
            (options.tell)(&format!("frames beside a fit: {name}"));
            report.frames.push(frames::while_watching(
                person,
                &name,
                "a fit runs, nobody touches it",
                options.seconds,
            )?);
            report.frames.push(frames::while_orbiting(person, &name, "a fit runs, the eye turns", options.seconds)?);
        }
        if options.answers {
            (options.tell)(&format!("answers beside a fit: {name}"));
            let count = if options.is_small { 5 } else { ACTS };
            report.answers.extend(answers::measure(person, &name, count)?);
        }
    }
    close(person)
}

fn close(person: &Person) -> Result<()> {
    person.ask(|studio, _| {
        studio.model.act(Act::CloseProject);
    })?;
    person.watch(1.0);
    Ok(())
}
