//! What the tests share: a small scene, fits of it, and a gate that holds a job before chosen steps.

use crate::core_tests::common::*;
use patina::export::RunFolder;
use patina::fit::state::FitState;
use patina::fit::{FitSettings, Fitter, checkpoint};
use patina::insight::report::ReportData;
use patina::job::{Event, JobHandle, JobOptions, RunSettings};
use patina::render::Surface;
use patina::scene::Scene;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};

/// A stop flag that nobody raises.
pub static GO: AtomicBool = AtomicBool::new(false);

/// Five views, the last held out; photographed once for all tests.
pub fn scene() -> (Arc<Scene>, Arc<Surface>) {
    static SCENE: OnceLock<(Arc<Scene>, Arc<Surface>)> = OnceLock::new();
    SCENE.get_or_init(|| last_held_out(5)).clone()
}

pub fn base() -> FitSettings {
    FitSettings { views_per_step: 2, held_out_interval: 3, ..quick() }
}

pub fn new_fitter(settings: &FitSettings) -> Fitter {
    let (scene, surface) = scene();
    Fitter::new(scene, surface, settings.clone(), None).unwrap()
}

pub fn stepped(settings: &FitSettings, steps: usize) -> Fitter {
    let mut fitter = new_fitter(settings);
    (0..steps).for_each(|_| drop(fitter.step(&GO).unwrap()));
    fitter
}

pub fn to_end(mut fitter: Fitter) -> FitState {
    run(&mut fitter).unwrap();
    without_seconds(fitter.state())
}

/// Holds a job before chosen steps.
pub struct Gate {
    at: Receiver<usize>,
    go: Sender<()>,
}

impl Gate {
    pub fn new() -> (Gate, JobOptions) {
        let (at_sender, at) = channel();
        let (go, go_receiver) = channel();
        let before_step = move |step| {
            at_sender.send(step).ok();
            // A test that is over holds nothing up.
            go_receiver.recv().ok();
        };
        (Gate { at, go }, JobOptions { before_step: Some(Box::new(before_step)), ..Default::default() })
    }

    /// Waits until the job holds.
    pub fn next(&self) -> usize {
        self.at.recv().unwrap()
    }

    /// Lets the job go until so many steps are done; it then holds. A command sent now is obeyed one step later.
    pub fn until(&self, step: usize) {
        loop {
            if self.next() == step {
                return;
            }
            self.go.send(()).unwrap();
        }
    }

    /// Lets the job do one step.
    pub fn one(&self) {
        self.go.send(()).unwrap();
    }
}

/// Takes up what a folder holds.
pub fn taken_up(folder: &Path) -> Fitter {
    let folder = RunFolder::open(folder).unwrap();
    assert!(folder.is_run() && folder.file("mesh.obj").is_file());
    let settings: RunSettings = folder.read_settings().unwrap();
    let (scene, surface) = scene();
    Fitter::resume(scene, surface, settings.fit, checkpoint::read(&folder.checkpoint_path()).unwrap()).unwrap()
}

/// All events up to one that `is_it`; fails when the job ends before.
pub fn until(job: &JobHandle, is_it: impl Fn(&Event) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    loop {
        let event = job.events.recv().unwrap_or_else(|_| panic!("the job ended after {events:?}"));
        let found = is_it(&event);
        events.push(event);
        if found {
            return events;
        }
    }
}

pub fn report(events: &[Event]) -> &ReportData {
    let Some(Event::Finished(data)) = events.last() else { panic!("{:?}", events.last()) };
    data
}

pub fn is_end(event: &Event) -> bool {
    matches!(event, Event::Finished(_) | Event::Failed(_) | Event::Stopped { .. })
}

pub fn is_finding(event: &Event, wanted: &str) -> bool {
    matches!(event, Event::Finding(finding) if finding.code == wanted)
}
