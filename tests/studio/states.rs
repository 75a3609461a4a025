//! The one state that labels follow, the one bar over a job, messages that come and go, and the guide.

use super::support::{Key, Modifiers, TestStudio};
use eframe::egui::OutputCommand;
use patina::error::{Error, ErrorKind};
use patina::fit::Method;
use patina::scene::demo::DemoSettings;
use patina::studio::act::Act;
use patina::studio::model::{FitStatus, Phase};
use patina::studio::workspace::Panel;
use std::cell::RefCell;
use std::sync::atomic::AtomicBool;

/// A studio in which the small scene was just read, and is about to be checked; settings of a fit of some seconds.
fn just_read() -> TestStudio {
    let mut studio = TestStudio::with_scene_just_read();
    let fit = &mut studio.model().edits.fit;
    fit.method = Method::Adam;
    (fit.map_size, fit.levels, fit.steps_diffuse, fit.steps_all) = (64, 2, 4, 4);
    (fit.samples, fit.pixels_per_step, fit.views_per_step, fit.environment_height) = (2, 0, 2, 8);
    studio
}

#[test]
fn a_scene_is_shown_before_it_is_checked_and_a_start_waits_for_it() {
    let mut studio = just_read();
    let model = studio.model();
    assert_eq!(model.phase(), Phase::Preparing);
    let project = model.project.as_ref().unwrap();
    assert!(project.surface.is_none() && project.view_count() == 8 && !project.mesh.triangles.is_empty());
    assert!(project.thumbnails.len() == 8, "photos are there at once");
    model.start_fit();
    assert_eq!(model.phase(), Phase::Queued);
    assert!(model.window_title().starts_with("Preparing scene"), "{}", model.window_title());
    studio.wait("the fit by itself", |model| model.fit.status.is_live() || model.fit.status == FitStatus::Finished);
    let fit = studio.model().edits.fit.clone();
    assert_eq!((fit.method, fit.samples, fit.map_size), (Method::Adam, 2, 64), "what was set meanwhile stays");
    assert!(!studio.model().start_is_queued);
}

#[test]
fn a_start_that_waits_can_be_taken_back() {
    let mut studio = just_read();
    studio.model().start_fit();
    studio.model().stop_fit();
    assert_eq!(studio.model().phase(), Phase::Preparing);
    studio.wait("the atlas", |model| model.project.as_ref().is_some_and(|own| own.surface.is_some()));
    studio.frames(5);
    assert_eq!((studio.model().phase(), studio.model().fit.losses.len()), (Phase::Ready, 0));
    assert!(studio.says("Not started"));
}

#[test]
fn one_bar_covers_the_job_and_the_title_shows_its_number() {
    let mut studio = TestStudio::with_small_scene();
    studio.act(Act::Start);
    let seen: RefCell<Vec<(u32, String)>> = RefCell::default();
    studio.wait("the end", |model| {
        if model.fit.status.is_live() {
            seen.borrow_mut().push((model.fit.advance.percent(), model.window_title()));
        }
        model.fit.status == FitStatus::Finished
    });
    let seen = seen.into_inner();
    assert!(!seen.is_empty() && seen.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{seen:?}");
    for (percent, title) in &seen {
        assert!(title.starts_with(&format!("{percent} % ")), "{percent}: {title}");
    }
    assert_eq!(studio.model().fit.advance.percent(), 100);
    assert!(studio.model().window_title().starts_with("Finished"));
    assert!(studio.says("Finished"));
}

#[test]
fn an_error_goes_by_escape_and_when_the_same_task_works() {
    let mut studio = TestStudio::new();
    studio.frames(1);
    studio.model().open("/nowhere/at all".into());
    studio.wait("the error", |model| model.log.banner().is_some());
    assert!(!studio.says("warning"), "a path that leads nowhere is no warning to be looked for");
    studio.press(Modifiers::NONE, Key::Escape);
    assert!(studio.model().log.banner().is_none() && studio.controls("Dismiss").is_empty());

    studio.model().open("/nowhere/at all".into());
    studio.wait("the error", |model| model.log.banner().is_some());
    studio.model().tasks.stop_all();
    // As a person does who drops another folder: the dialog of the error was not touched.
    let error = Error::new(ErrorKind::Missing, "as before");
    studio.model().log.error_of(&error, &patina::studio::model::tasks::TaskKind::Opening);
    studio.model().open_made(tiny_scene(), Default::default());
    studio.wait("the scene", |model| model.project.is_some());
    assert!(studio.model().log.banner().is_none(), "what failed before has worked now");
}

fn tiny_scene() -> patina::scene::Scene {
    let tiny =
        DemoSettings { views: 2, held_out: 0, width: 16, height: 12, map_size: 64, seed: 1, ..Default::default() };
    patina::job::demo::scene(&tiny, &mut Vec::new(), &AtomicBool::new(false), &|_| {}).unwrap()
}

#[test]
fn messages_are_copied_and_cleared() {
    let mut studio = TestStudio::with_finished_run();
    studio.model().log.clear();
    studio.model().log.note("a first line");
    studio.model().log.note("a second line");
    studio.show(Panel::Messages);
    studio.control("Copy all").click();
    studio.harness.step();
    let commands = studio.harness.output().platform_output.commands.clone();
    let copied = commands.iter().find_map(|command| match command {
        OutputCommand::CopyText(text) => Some(text.clone()),
        _ => None,
    });
    assert_eq!(copied.as_deref(), Some("A first line\nA second line"), "{commands:?}");
    studio.click("Clear messages");
    assert!(studio.says("No issues") && studio.model().log.messages().is_empty());
}

#[test]
fn settings_that_the_method_does_not_read_are_hidden() {
    let mut studio = TestStudio::with_small_scene();
    studio.click("All settings");
    assert!(!studio.controls("Lobe ramp").is_empty() && studio.controls("Solver grid").is_empty(), "of Adam");
    studio.model().edits.fit.method = Method::Solver;
    studio.frames(3);
    assert!(studio.controls("Lobe ramp").is_empty() && !studio.controls("Solver grid").is_empty(), "of the solver");
    assert!(!studio.controls("Light iterations").is_empty(), "by the names the field uses");
}

#[test]
fn the_guide_stands_beside_the_work_and_turns_to_every_topic() {
    let mut studio = TestStudio::with_finished_run();
    studio.press(Modifiers::SHIFT, Key::F1);
    assert!(studio.model().guide);
    for topic in patina::guide::Topic::ALL {
        studio.click(topic.title());
        // A word of its text is on screen, beyond its title.
        let line = topic
            .text()
            .lines()
            .find(|line| line.len() > 30 && line.chars().all(|c| c.is_alphanumeric() || " ,.".contains(c)));
        if let Some(line) = line {
            let word = line.split_whitespace().max_by_key(|word| word.len()).unwrap();
            assert!(studio.says(word), "{}: {word}", topic.title());
        }
    }
    studio.press(Modifiers::SHIFT, Key::F1);
    assert!(!studio.model().guide && studio.controls("User guide").is_empty());
}
