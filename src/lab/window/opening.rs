//! From the drop of a scene to a fit that could start: what the window does, task by task, without the window.
//!
//! The model of the window opens the scene as it does for a person. It is opened twice, with the same memory on disk: what
//! the first opening kept, the second finds.

use crate::error::{Error, ErrorKind, Result};
use crate::insight::report::data::StageTime;
use crate::studio::model::store::Store;
use crate::studio::model::{Model, Project};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Seconds that a scene which was opened before may take until a fit could start.
pub const MOST_SECONDS_AGAIN: f64 = 2.0;
/// Between two looks at what the tasks brought.
const BETWEEN_LOOKS: Duration = Duration::from_millis(2);
/// How long an opening may take, in seconds.
const PATIENCE: f64 = 1800.0;

/// Seconds from the drop on.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct OpeningRow {
    /// The scene.
    pub scene: String,
    /// Whether it was opened before.
    pub is_again: bool,
    /// Until mesh and cameras are there.
    pub shown: f64,
    /// Until the photos lie on the mesh.
    pub photos: f64,
    /// Until a fit could start.
    pub ready: f64,
    /// Until it is relit from cached transport.
    pub relit: f64,
    /// Processor time until a fit could start, in seconds; `None` where the system does not tell.
    pub ready_processor: Option<f64>,
    /// Processor time of all that, in seconds.
    pub processor: Option<f64>,
    /// The stages of becoming ready.
    pub stages: Vec<StageTime>,
}

/// The scene at a path, or the demo, in a word.
pub fn name_of(path: Option<&Path>) -> String {
    path.map_or("demo".into(), |path| path.file_name().unwrap_or_default().to_string_lossy().into_owned())
}

/// Opens the scene at a path, or the demo, twice; what the window remembers goes below `folder` meanwhile.
///
/// # Errors
/// What cannot be opened.
pub fn measure(path: Option<&Path>, folder: &Path, tell: &dyn Fn(&str)) -> Result<Vec<OpeningRow>> {
    let name = name_of(path);
    let own = super::scratch(folder, "opening");
    let mut rows = Vec::new();
    for is_again in [false, true] {
        tell(&format!("opening {}: {name}", if is_again { "again" } else { "for the first time" }));
        let row = opened(path, &own.join("studio-settings.json"));
        rows.push(row.map(|row| OpeningRow { scene: name.clone(), is_again, ..row }));
    }
    let _ = std::fs::remove_dir_all(&own);
    rows.into_iter().collect()
}

fn opened(path: Option<&Path>, settings_file: &Path) -> Result<OpeningRow> {
    let processor = || super::machine::processor_seconds().map(|seconds| seconds.all);
    let before = processor();
    let elapsed = || before.zip(processor()).map(|(before, after)| after - before);
    let mut model = Model::new(Store::at(Some(settings_file.into())), Arc::new(|| {}));
    let mut row = OpeningRow::default();
    until_ready(&mut model, path, |project, seconds| {
        let note = |place: &mut f64, is_there: bool| {
            if is_there && *place == 0.0 {
                *place = seconds;
            }
        };
        note(&mut row.shown, true);
        note(&mut row.photos, project.laid.is_some());
        note(&mut row.ready, project.surface.is_some());
        if project.surface.is_some() && row.ready_processor.is_none() {
            row.ready_processor = elapsed();
        }
        note(&mut row.relit, project.transport.is_some());
        row.stages.clone_from(&project.timings);
        row.photos == 0.0 || row.relit == 0.0
    })?;
    row.processor = elapsed();
    Ok(row)
}

/// Opens the scene at a path, or the demo, and goes on until a fit could start and `waits` says, of the project and the
/// seconds since the drop, that nothing more is waited for.
///
/// # Errors
/// What cannot be opened.
pub(super) fn until_ready(
    model: &mut Model,
    path: Option<&Path>,
    mut waits: impl FnMut(&Project, f64) -> bool,
) -> Result<()> {
    let began = Instant::now();
    match path {
        Some(path) => model.open(path.into()),
        None => model.open_demo(),
    }
    loop {
        let was_busy = model.tasks.is_busy();
        model.poll();
        let seconds = began.elapsed().as_secs_f64();
        if let Some(project) = &model.project
            && !waits(project, seconds)
            && project.surface.is_some()
        {
            return Ok(());
        }
        if !was_busy {
            let why = model.log.banner().map(|message| message.text.clone()).unwrap_or_default();
            return Err(Error::new(ErrorKind::InvalidScene, format!("the scene cannot be opened: {why}"))
                .remedy("see what `patina check` says of it"));
        }
        if seconds > PATIENCE {
            return Err(Error::new(ErrorKind::Internal, "the scene does not come to be ready"));
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
}
