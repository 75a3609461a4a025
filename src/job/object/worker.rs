//! The thread of an estimation, and the one that paints beside it.

use super::look::{Painter, with_log_error};
use super::reached::{LOOK_PIXELS, Reached, estimate_as_far_as_it_goes};
use super::{ObjectLook, ObjectNews, ObjectOutcome, ObjectParts, ObjectRequest, PhotoSeen, Teller};
use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, file};
use crate::job::Slot;
use crate::neural;
use crate::object::joint::Estimate;
use crate::object::nodes::NodeGrid;
use crate::object::progress::ObjectEvent;
use crate::object::read::read_views;
use crate::object::result_read::FollowedStart;
use crate::object::split::SplitSpread;
use crate::object::starts::{ModelKind, StartedModel};
use crate::object::{ObjectView, result_folder};
use crossbeam_channel::{Receiver, bounded};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The work.
pub(super) struct Worker {
    pub request: ObjectRequest,
    pub teller: Teller,
    pub looks: Arc<Slot<ObjectLook>>,
    pub stop: Arc<AtomicBool>,
    pub after_round: Option<Box<dyn Fn(usize) + Send + Sync>>,
}

impl Worker {
    /// Does all of it. An error means that nothing was reached.
    pub fn run(self) -> Result<()> {
        let settings = &self.request.settings;
        settings.validate_for(self.request.inputs.light.is_some())?;
        result_folder::prepare(&self.request.output)?;
        self.stage("reading photos and shape");
        let (views, mut findings) = read_views(&self.request.inputs.files)?;
        if views.is_empty() {
            return Err(Error::new(ErrorKind::Missing, "there is no photo").remedy("name at least one photo"));
        }
        self.teller.send(ObjectNews::Read(views.iter().map(seen).collect()));
        let (known, noticed) = self.request.inputs.known()?;
        findings.extend(noticed);
        let model = self.model()?;
        self.check_stop()?;

        let rounds = AtomicUsize::new(0);
        let outcome = self.painted_beside(&views, |paint| {
            let watch = |event: ObjectEvent| match event {
                ObjectEvent::Stage(stage) => self.stage(stage),
                ObjectEvent::Row(row) => self.teller.send(ObjectNews::Row(row)),
                ObjectEvent::State { light, further_lights, table, parameters } => {
                    let round = 1 + rounds.fetch_add(1, Ordering::Relaxed);
                    paint(Reached {
                        round,
                        light: light.clone(),
                        further_lights: further_lights.to_vec(),
                        table: table.clone(),
                        parameters: parameters.to_vec(),
                    });
                    if let Some(after_round) = &self.after_round {
                        after_round(round);
                    }
                }
            };
            estimate_as_far_as_it_goes(&views, &model, &known, settings, &self.stop, &watch)
        });
        let (mut found, error) = outcome?;
        let is_whole = error.is_none();
        if let Some(error) = error.filter(|error| error.kind() != ErrorKind::Stopped) {
            self.teller.send(ObjectNews::Trouble(error));
        }
        found.findings.splice(0..0, findings);
        for finding in &found.findings {
            self.teller.send(ObjectNews::Finding(finding.clone()));
        }
        let parts = Arc::new(ObjectParts::new(views, model, found, settings.clone(), self.request.inputs.clone()));
        let outcome = Box::new(self.finish(parts));
        self.teller.send(match is_whole {
            true => ObjectNews::Finished(outcome),
            false => ObjectNews::Ended(Some(outcome)),
        });
        Ok(())
    }

    fn stage(&self, stage: &str) {
        self.teller.send(ObjectNews::Stage(stage.into()));
    }

    fn check_stop(&self) -> Result<()> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Error::new(ErrorKind::Stopped, "the estimation was stopped")),
            false => Ok(()),
        }
    }

    /// The model; the neural one with the weights that come with the program.
    fn model(&self) -> Result<StartedModel> {
        let (inputs, settings) = (&self.request.inputs, &self.request.settings);
        match inputs.model {
            ModelKind::Ibrdf => {
                let trained = Arc::new(neural::shipped()?);
                Ok(StartedModel::neural(trained, inputs.lobes.clamp(1, 3), settings.code_weight, &[]))
            }
            kind => StartedModel::of(kind, None, inputs.lobes, settings),
        }
    }

    /// Runs the estimation with a function that paints a state on a thread beside it, the newest one only.
    fn painted_beside(
        &self,
        views: &[ObjectView],
        work: impl FnOnce(&(dyn Fn(Reached) + Sync)) -> Result<(Estimate, Option<Error>)>,
    ) -> Result<(Estimate, Option<Error>)> {
        let newest: Mutex<Option<Reached>> = Mutex::default();
        let (bell, rings) = bounded::<()>(1);
        let view = &views[0];
        std::thread::scope(|scope| {
            let painting = || {
                // This thread gives way as the one it comes from does, and so do its own: less would starve it.
                let pool = rayon::ThreadPoolBuilder::new().thread_name(|index| format!("patina-look-{index}")).build();
                match pool {
                    Ok(pool) => pool.install(|| self.paint_all(view, &newest, &rings)),
                    Err(_) => self.paint_all(view, &newest, &rings),
                }
            };
            let painter = std::thread::Builder::new().name("patina-look".into()).spawn_scoped(scope, painting);
            let found = work(&|reached| {
                *newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(reached);
                // A bell that rings already is enough.
                let _ = bell.try_send(());
            });
            drop(bell);
            if let Ok(painter) = painter {
                // Without its pictures an estimation is as good: a panic of the painter is a message.
                if let Err(panic) = painter.join() {
                    self.teller.send(ObjectNews::Trouble(super::panicked(&*panic)));
                }
            }
            found
        })
    }

    fn paint_all(&self, view: &ObjectView, newest: &Mutex<Option<Reached>>, rings: &Receiver<()>) {
        let settings = &self.request.settings;
        let mut painter = None;
        while rings.recv().is_ok() {
            let Some(reached) = newest.lock().unwrap_or_else(PoisonError::into_inner).take() else { continue };
            let painter = painter.get_or_insert_with(|| {
                Painter::new(view, NodeGrid::new(settings.nodes), settings.shadows, LOOK_PIXELS)
            });
            self.looks.put(painter.paint(reached.light.environment(), &reached.table));
            self.teller.wake();
        }
    }

    /// Renders and writes; what cannot be written is told, and kept.
    fn finish(&self, parts: Arc<ObjectParts>) -> ObjectOutcome {
        self.stage("rendering and writing the result");
        let request = &self.request;
        let written = parts.write(&request.output, &request.relights);
        let mut pictures = Vec::new();
        for (index, view) in parts.views.iter().enumerate() {
            if let Ok(picture) = file::read_rgb(&request.output.join(format!("rerender_{index}.exr")))
                && written.is_ok()
            {
                pictures.push(with_log_error(view, picture));
            }
        }
        let folder = match written {
            Ok(()) => Some(request.output.clone()),
            Err(error) => {
                let message = format!("the result could not be written: {}", error.message());
                let told = Error::new(error.kind(), message).at(error.place().clone());
                self.teller.send(ObjectNews::Trouble(told.remedy("it is kept in memory: save it to another folder")));
                None
            }
        };
        let candidates = &parts.estimate.candidates;
        let spread = SplitSpread::of(candidates);
        let followed = candidates.iter().map(|candidate| FollowedStart {
            start: candidate.name.clone(),
            objective: candidate.total(),
            evidence: candidate.evidence,
        });
        let followed = followed.collect();
        ObjectOutcome::of(parts, folder, pictures, spread, followed)
    }
}

/// A view as it is shown.
pub(super) fn seen(view: &ObjectView) -> PhotoSeen {
    let mut is_object = Image::filled(view.geometry.width, view.geometry.height, false);
    for pixel in &view.geometry.pixels {
        is_object[(pixel.row as usize, pixel.column as usize)] = true;
    }
    PhotoSeen {
        name: view.photo.name.clone(),
        radiance: Arc::new(view.photo.radiance.clone()),
        is_object: Arc::new(is_object),
    }
}
