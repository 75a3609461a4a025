//! What the window knows, without any widget.
//!
//! [`Model`] joins the parts: [`project`] is what is open, [`fit`] the job and [`advance`](crate::job::advance) how far it
//! is, [`phase`] the one state that labels follow, [`known`] what the solver is sure of, [`laid`] photos on the mesh and
//! the cache that relights, [`edits`] what undo covers, [`lights`] the shelf, [`tasks`] work beside the window and [`done`]
//! what it brings, [`log`] what was noticed, with what it [`offers`] and how [`offering`] does it, [`words`] how settings
//! and flags are said, [`store`] what is remembered. [`opening`] reads a folder, [`opened`] is what was read, `arriving`
//! makes a project of it and [`starting`] a fit, [`queue`] fits one scene after another, [`timeline`] keeps the fit as it was, `news` takes in what was brought, [`viewing`] where the eye stands,
//! [`dialogs`] what is asked in windows over the window, [`exporting`] a run on its way to other programs, [`importing`] a
//! folder on its way to a scene, [`rescaling`] sets the scale by a known patch. In object mode [`object_form`] is what is
//! asked for, [`object`] the estimation, [`estimating`] how one becomes the other, [`materials`] the library. Panels read
//! the model and queue acts; they change nothing but [`Edits`] directly.

mod arriving;
pub mod dialogs;
pub mod done;
pub mod edits;
pub mod estimating;
pub mod exporting;
pub mod fit;
pub mod framing;
pub mod importing;
pub mod known;
pub mod laid;
pub mod lights;
pub mod log;
pub mod materials;
mod news;
pub mod object;
pub mod object_form;
pub mod offering;
pub mod offers;
pub mod opened;
pub mod opening;
pub mod other_run;
pub mod phase;
pub mod project;
pub mod queue;
pub mod rescaling;
pub mod saving;
pub mod starting;
pub mod store;
pub mod tasks;
pub mod timeline;
pub mod viewing;
pub mod words;

pub use dialogs::{Dialog, PickFor, SaveRequest, SaveWhat};
pub use done::Done;
pub use edits::Edits;
pub use fit::{FitControl, FitStatus};
pub use lights::LightName;
pub use phase::Phase;
pub use project::Project;

use crate::error::{Place, Result};
use crate::job::kept::Kept;
use crate::light::day::Day;
use crate::studio::act::Act;
use crate::studio::stage::eye::OrbitEye;
use crate::studio::workspace::{Panel, Workspace};
use edits::History;
use glam::{Vec2, Vec3};
use lights::Shelf;
use log::Log;
use std::path::PathBuf;
use std::sync::Arc;
use store::{Preferences, Store};
use tasks::{Tasks, Wake};

/// Switches of the stage that undo does not cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageSwitches {
    /// Refine by path tracing while nothing moves.
    pub traced: bool,
    /// Draw the cameras.
    pub frustums: bool,
    /// Draw small photos on them.
    pub thumbnails: bool,
    /// Draw chart borders on the maps.
    pub chart_borders: bool,
    /// The eye is where the chosen photo was taken.
    pub looking_through: bool,
    /// Show the stage alone.
    pub alone: bool,
}

impl Default for StageSwitches {
    fn default() -> Self {
        StageSwitches {
            traced: true,
            frustums: true,
            thumbnails: false,
            chart_borders: false,
            looking_through: false,
            alone: false,
        }
    }
}

/// The place under the cursor, wherever the mouse is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cursor {
    /// The panel the mouse is over.
    pub over: Panel,
    /// Position in the world.
    pub position: Vec3,
    /// Unit normal there.
    pub normal: Vec3,
    /// Texture coordinate, v up.
    pub uv: Vec2,
    /// Whether it stays although the mouse moves on.
    pub pinned: bool,
}

/// Everything the window knows.
pub struct Model {
    /// Which half of the studio is shown.
    pub workspace: Workspace,
    /// The estimation of object mode.
    pub object: object::ObjectControl,
    /// The library of materials.
    pub materials: materials::MaterialBrowser,
    /// What is open.
    pub project: Option<Project>,
    /// The fit.
    pub fit: FitControl,
    /// What undo takes back.
    pub edits: Edits,
    /// Former edits.
    pub history: History,
    /// Work beside the window.
    pub tasks: Tasks<Done>,
    /// What was noticed.
    pub log: Log,
    /// Another run of the scene, to compare with.
    pub other_run: Option<Arc<other_run::OtherRun>>,
    /// Where the run was exported to last.
    pub exported: Option<PathBuf>,
    /// Whether the card of a finished fit is shown.
    pub card: bool,
    /// Whether the fit starts by itself once the scene is prepared.
    pub start_is_queued: bool,
    /// The fit as it was.
    pub timeline: timeline::Timeline,
    /// Scenes that are fitted one after the other.
    pub queue: queue::SceneQueue,
    /// The cache that is being traced, until a fit waits for it or it is there.
    being_cached: Option<laid::BeingCached>,
    /// What is remembered.
    pub preferences: Preferences,
    /// Where it is remembered.
    pub store: Store,
    /// What opening a scene took long to make, on disk.
    pub kept: Kept,
    /// Lights to look at the materials in.
    pub shelf: Shelf,
    /// Hour and latitude that the sky of the shelf was made for.
    pub day_in_force: Day,
    /// The environment that lights the viewport once it is read.
    pub light_to_choose: Option<PathBuf>,
    /// The eye, while it is not a photo's.
    pub eye: OrbitEye,
    /// Switches of the stage.
    pub switches: StageSwitches,
    /// The linked cursor.
    pub cursor: Option<Cursor>,
    /// The window over the window.
    pub dialog: Dialog,
    /// Whether the guide is open.
    pub guide: bool,
    /// Panels that are in front, as last drawn.
    pub visible_panels: Vec<Panel>,
    /// Acts to be done after the panels are drawn.
    pub acts: Vec<Act>,
    /// Panel to bring to the front.
    pub activate: Option<Panel>,
    /// A place of a finding that panels should go to.
    pub go_to: Option<Place>,
    /// What draws the stage, in plain words; empty when nothing can.
    pub adapter: String,
    /// Whether the processor draws in place of a graphics card.
    pub software_adapter: bool,
    /// A run that was in progress when the program last ended without a word.
    pub interrupted_run: Option<PathBuf>,
    /// Place and value under the mouse, for the line at the bottom; emptied every frame.
    pub hovered_value: String,
    /// The sky that lit the stage before there was a fitted light; the fitted light takes its place.
    pub light_was_chosen_for_us: Option<LightName>,
    /// Shift is held over the stage: the photo shows as long.
    pub peek_photo: bool,
    /// A fit runs and nobody touched anything for a moment: what changes need not be shown at once.
    pub nobody_waits: bool,
    /// Called from any thread when the window should look again.
    pub wake: Wake,
    /// Called before each step of a fit with the number of steps done, on its thread; for `patina bench studio`.
    #[doc(hidden)]
    pub before_step: Option<Arc<dyn Fn(usize) + Send + Sync>>,
    /// Called after each round of an estimation with its number, on its thread; a seam for tests of faults.
    #[doc(hidden)]
    pub after_round: Option<Arc<dyn Fn(usize) + Send + Sync>>,
}

impl Model {
    /// A model without a project.
    pub fn new(mut store: Store, wake: Wake) -> Self {
        let (mut preferences, damaged) = store.read();
        let mut log = Log::default();
        if let Some(error) = damaged {
            log.error(&error);
        }
        let interrupted_run = preferences.running.take().filter(|run| run.join("checkpoint").is_file());
        let edits = Edits { display: preferences.display, ..Edits::default() };
        let mut history = History::default();
        history.restart(&edits);
        let mut model = Model {
            workspace: Workspace::Scene,
            object: object::ObjectControl::default(),
            materials: materials::MaterialBrowser::default(),
            project: None,
            fit: FitControl::default(),
            edits,
            history,
            tasks: Tasks::new(Arc::clone(&wake)),
            log,
            other_run: None,
            exported: None,
            card: false,
            start_is_queued: false,
            timeline: timeline::Timeline::default(),
            queue: queue::SceneQueue::default(),
            being_cached: None,
            preferences,
            kept: store.kept(),
            store,
            shelf: Shelf::built_in(),
            day_in_force: Day::default(),
            light_to_choose: None,
            eye: OrbitEye::default(),
            switches: StageSwitches::default(),
            cursor: None,
            dialog: Dialog::None,
            guide: false,
            visible_panels: Vec::new(),
            acts: Vec::new(),
            activate: None,
            go_to: None,
            adapter: String::new(),
            software_adapter: false,
            interrupted_run,
            hovered_value: String::new(),
            peek_photo: false,
            nobody_waits: false,
            light_was_chosen_for_us: None,
            wake,
            before_step: None,
            after_round: None,
        };
        for path in model.preferences.lights.clone() {
            model.read_light(path);
        }
        model
    }

    /// Queues an act.
    pub fn act(&mut self, act: Act) {
        self.acts.push(act);
    }

    /// Writes what should be remembered; a failure is told once.
    pub fn write_preferences(&mut self) {
        self.preferences.display = self.edits.display;
        let outcome: Result<()> = self.store.write(&self.preferences);
        if let Err(error) = outcome {
            self.log.note(format!("Preferences could not be saved: {error}"));
            // Once is enough: from here on nothing is remembered.
            self.store = Store::at(None);
        }
    }

    /// Words for the window's title.
    pub fn window_title(&self) -> String {
        if self.workspace == Workspace::Object {
            let name = self.object.photos.first().map_or(String::new(), |photo| format!(" - {}", photo.name));
            return format!("{}{name} - Patina", self.object.status.words());
        }
        let Some(project) = &self.project else { return "Patina".into() };
        match self.phase() {
            Phase::Ready => format!("{} - Patina", project.title),
            phase if phase.is_live() => {
                let words = phase.words().to_lowercase();
                format!("{} % {words} - {} - Patina", self.fit.advance.percent(), project.title)
            }
            phase => format!("{} - {} - Patina", phase.words(), project.title),
        }
    }
}
