//! A result read from its folder again, as the window shows it.

use super::look::{MaterialLook, epsilon_of};
use super::{ObjectOutcome, ObjectParts, PhotoSeen, StartFollowed, worker};
use crate::error::{Finding, Result, Severity};
use crate::image::file;
use crate::object::nodes::NodeGrid;
use crate::object::picture::log_error_map;
use crate::object::read::read_views;
use crate::object::result_read::{self, ObjectResult};
use crate::object::split::Gauge;
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
                    .remedy("put them back; light and reflectance can be looked at without them"),
            );
            Vec::new()
        }
    };
    let (mut rerenders, mut log_errors) = (Vec::new(), Vec::new());
    for (index, view) in views.iter().enumerate() {
        let picture = file::read_rgb(&folder.join(format!("rerender_{index}.exr")))?;
        if (picture.width(), picture.height()) == (view.geometry.width, view.geometry.height) {
            let epsilon = epsilon_of(&view.geometry, &view.photo.radiance);
            log_errors.push(Arc::new(log_error_map(&view.geometry, &picture, &view.photo.radiance, epsilon)));
            rerenders.push(Arc::new(picture));
        }
    }
    let best = followed.first().map_or(0.0, |best| best.evidence);
    let starts = followed.into_iter().map(|own| StartFollowed {
        objective: own.objective,
        nats_behind: own.evidence - best,
        is_as_good: spread.starts.contains(&own.start),
        name: own.start,
    });
    let starts = starts.collect();
    let photos = views.iter().map(worker::seen).collect();
    let gauge = Gauge::of(&estimate.light, &NodeGrid::new(settings.nodes), &estimate.table);
    let light = Arc::new(estimate.light.environment());
    let mut parts = ObjectParts::new(views, model, estimate, settings, inputs);
    parts.read_from = Some(folder.into());
    let parts = Arc::new(parts);
    let material = Arc::new(MaterialLook::of(&parts.reflectance(), None));
    let folder = Some(folder.into());
    let outcome = ObjectOutcome { parts, folder, rerenders, log_errors, material, light, starts, spread, gauge };
    Ok(ReopenedObject { photos, outcome, findings })
}
