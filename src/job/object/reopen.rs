//! A result read from its folder again, as the window shows it.

use super::look::with_log_error;
use super::{ObjectOutcome, ObjectParts, PhotoSeen, worker};
use crate::error::{Finding, Result, Severity};
use crate::image::file;
use crate::object::read::read_views;
use crate::object::result_read::{self, ObjectResult};
use std::path::Path;
use std::sync::Arc;

/// A result that was opened again.
pub struct ReopenedObject {
    /// The photos; empty when they are not where they were, which a finding then says.
    pub photos: Vec<PhotoSeen>,
    /// The result.
    pub outcome: ObjectOutcome,
    /// What was noticed then and now.
    pub findings: Vec<Finding>,
}

/// Opens a result folder of `patina object` or of the window.
///
/// # Errors
/// Those of [`result_read::read`].
pub fn reopen(folder: &Path) -> Result<ReopenedObject> {
    let ObjectResult { inputs, settings, model, estimate, followed, spread } = result_read::read(folder)?;
    let mut findings = estimate.findings.clone();
    let views = match read_views(&inputs.files) {
        Ok((views, _)) => views,
        Err(error) => {
            let message = format!("the photos cannot be read any more: {}", error.message());
            findings.push(
                Finding::new(Severity::Warning, "photos-not-opened", message)
                    .at(error.place().clone())
                    .remedy("put them back; environment and reflectance can be viewed without them"),
            );
            Vec::new()
        }
    };
    let mut pictures = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let picture = file::read_rgb(&folder.join(format!("rerender_{index}.exr")))?;
        if (picture.width(), picture.height()) == (view.geometry.width, view.geometry.height) {
            pictures.push(with_log_error(view, picture));
        }
    }
    let photos = views.iter().map(worker::seen).collect();
    let mut parts = ObjectParts::new(views, model, estimate, settings, inputs);
    parts.read_from = Some(folder.into());
    let outcome = ObjectOutcome::of(Arc::new(parts), Some(folder.into()), pictures, spread, followed);
    Ok(ReopenedObject { photos, outcome, findings })
}
