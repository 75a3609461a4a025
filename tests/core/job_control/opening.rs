//! Scenes and runs that are opened, stopped, viewed and taken up again.

use super::support::*;
use patina::ErrorKind;
use patina::export::RunFolder;
use patina::fit::{FitSettings, checkpoint};
use patina::job::open::{OpenStage, PathKind};
use patina::job::{JobOptions, RunSettings, open, start_with};
use patina::scene::demo::DemoSettings;
use patina::scene::{ReadSettings, Scene};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn a_scene_is_opened_fitted_stopped_viewed_resumed_and_viewed_again() {
    let parent = tempfile::tempdir().unwrap();
    let (scene_folder, run_folder) = (parent.path().join("scene"), parent.path().join("run"));
    let small =
        DemoSettings { views: 5, held_out: 1, width: 48, height: 36, map_size: 64, seed: 1, ..Default::default() };
    let made = open::open_demo(&small, &GO, &|_, _| {}).unwrap();
    let options = patina::export::exchange::ExchangeOptions { with_photos: true, ..Default::default() };
    patina::export::exchange::write(&made.scene, made.scene.truth.as_ref().unwrap(), &options, &scene_folder).unwrap();
    assert_eq!(open::kind_of(&scene_folder).unwrap(), PathKind::Scene);

    let heard = Mutex::new(Vec::new());
    let tell = |stage: OpenStage, share: f32| {
        assert!((0.0..=1.0).contains(&share));
        let mut heard = heard.lock().unwrap();
        if heard.last() != Some(&stage) {
            heard.push(stage);
        }
    };
    let opened = open::open_scene(&scene_folder, &ReadSettings::default(), &GO, &tell).unwrap();
    assert_eq!((opened.scene.views.len(), opened.report.views.len()), (6, 6));
    let fit = FitSettings { map_size: 32, exclude: vec![opened.scene.views[0].name.clone()], ..base() };
    let settings = RunSettings { scene: scene_folder.clone(), fit, ..Default::default() };
    let (prepared, fitter, settings) = open::start_new(opened, settings, &GO, &tell).unwrap();
    use OpenStage::*;
    assert_eq!(*heard.lock().unwrap(), [Read, Check, Atlas, Tracer, Start]);

    let folder = RunFolder::create(&run_folder).unwrap();
    let (gate, options) = Gate::new();
    let job = start_with(prepared, fitter, settings, folder.clone(), options).unwrap();
    gate.until(2);
    job.stop();
    gate.one();
    until(&job, is_end);
    job.join();

    assert_eq!(open::kind_of(&run_folder).unwrap(), PathKind::Run);
    let view = open::view_run(&folder, None, &GO, &tell).unwrap();
    assert!(!view.is_finished && view.can_resume && view.report.is_none() && view.times_seen.is_none());
    assert_eq!(view.scene.unwrap().views.len(), 6);
    assert_eq!((view.maps.diffuse.width(), view.environment.height()), (16, 4), "the maps of the first stage");
    assert_eq!(view.losses.len(), checkpoint::read(&folder.checkpoint_path()).unwrap().step);
    assert!(view.findings.is_empty(), "{:?}", view.findings);

    let (prepared, fitter, settings) = open::resume(&folder, None, &GO, &tell).unwrap();
    let job = start_with(prepared, fitter, settings, folder.clone(), JobOptions::default()).unwrap();
    let events = until(&job, is_end);
    let data = report(&events).clone();
    job.join();

    // Now the scene is moved away: a finding for who looks, an error for who wants to go on.
    let moved = parent.path().join("moved");
    std::fs::rename(&scene_folder, &moved).unwrap();
    let view = open::view_run(&folder, None, &GO, &tell).unwrap();
    assert!(view.is_finished && view.scene.is_none());
    assert_eq!(view.findings.len(), 1);
    assert!(view.findings[0].code == "scene-not-opened" && !view.findings[0].remedy.is_empty());
    assert_eq!(view.maps.diffuse.width(), 32);
    assert_eq!(view.losses.len(), 12);
    assert_eq!(view.report.unwrap().views.len(), data.views.len());
    assert!(view.times_seen.unwrap().pixels().iter().any(|&times| times > 0.0));
    assert_eq!(open::resume(&folder, None, &GO, &tell).err().unwrap().kind(), ErrorKind::Missing);
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.scene.is_some() && view.findings.is_empty());
    let (_, fitter, settings) = open::resume(&folder, Some(&moved), &GO, &tell).unwrap();
    assert_eq!((fitter.state().step, settings.scene), (12, moved.clone()));

    // Results without a checkpoint can be looked at; a checkpoint with steps to go beats older results.
    let whole = std::fs::read(folder.checkpoint_path()).unwrap();
    std::fs::remove_file(folder.checkpoint_path()).unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.is_finished && !view.can_resume && view.losses.len() == 12);
    checkpoint::write(&folder.checkpoint_path(), &{
        let mut state = fitter.state().clone();
        (state.step, state.stage, state.step_in_stage) = (11, state.plan.len() - 1, 2);
        state
    })
    .unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(!view.is_finished && view.report.is_none());
    patina::files::write_bytes(&folder.checkpoint_path(), &whole[..40]).unwrap();
    let view = open::view_run(&folder, Some(&moved), &GO, &tell).unwrap();
    assert!(view.is_finished && view.findings.iter().any(|finding| finding.code == "checkpoint-unreadable"));
}

#[test]
fn a_raised_flag_stops_before_the_next_stage() {
    let stop = AtomicBool::new(true);
    let error = open::open_scene(Path::new("anywhere"), &ReadSettings::default(), &stop, &|_, _| {}).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Stopped);
    let stop = AtomicBool::new(false);
    let (scene, _) = scene();
    let opened = open::OpenedScene { scene: Scene::clone(&scene), report: Default::default(), timings: Vec::new() };
    let tell = |stage: OpenStage, _: f32| {
        assert_ne!(stage, OpenStage::Tracer, "begun after the flag was raised");
        stop.store(true, Ordering::Relaxed);
    };
    let settings = RunSettings { fit: base(), ..Default::default() };
    assert_eq!(open::start_new(opened, settings, &stop, &tell).err().unwrap().kind(), ErrorKind::Stopped);
}

#[test]
fn a_path_that_is_neither_run_nor_scene_says_what_is_needed() {
    let parent = tempfile::tempdir().unwrap();
    let error = open::kind_of(parent.path()).unwrap_err();
    assert!(error.remedy_text().contains("scene.toml") && error.remedy_text().contains("cameras.json"), "{error}");
    assert_eq!(open::kind_of(&parent.path().join("nothing")).unwrap_err().kind(), ErrorKind::Missing);
    // A file out of a run or a scene: the folder to open is named.
    let run = parent.path().join("run");
    RunFolder::create(&run).unwrap();
    let settings = run.join("settings.toml");
    patina::files::write_bytes(&settings, b"").unwrap();
    assert!(open::kind_of(&settings).unwrap_err().remedy_text().contains(&run.display().to_string()));
    let manifest = parent.path().join("scene.toml");
    patina::files::write_bytes(&manifest, b"").unwrap();
    assert_eq!(open::kind_of(&manifest).unwrap(), PathKind::Scene);
    assert_eq!(open::kind_of(&run).unwrap(), PathKind::Run);
}
