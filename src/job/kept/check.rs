//! The verdict on a scene.

use super::Kept;
use super::content::add_scene;
use super::findings::{KeptFinding, of_kept, to_keep};
use crate::error::Result;
use crate::files::digest::Digest;
use crate::files::packed::{Packer, Unpacker};
use crate::scene::Scene;
use crate::scene::doctor::{self, Report};
use std::sync::atomic::AtomicBool;

pub(super) const KIND: &str = "check";

/// What the check of a scene says, as [`doctor::check_until`] does, from disk where it was checked before.
///
/// # Errors
/// `Stopped` when the flag is raised.
pub fn check(scene: &Scene, kept: &Kept, stop: &AtomicBool) -> Result<Report> {
    let key = key_of(scene, kept);
    if let Some(report) = key.and_then(|key| unpacked(&kept.read(KIND, key)?, scene)) {
        return Ok(report);
    }
    let report = doctor::check_until(scene, stop)?;
    if let Some((key, bytes)) = key.zip(packed(&report, scene)) {
        kept.write(KIND, key, &bytes);
    }
    Ok(report)
}

fn key_of(scene: &Scene, kept: &Kept) -> Option<Digest> {
    let mut key = kept.key(KIND)?;
    add_scene(&mut key, scene);
    Some(key.finish())
}

pub(super) fn packed(report: &Report, scene: &Scene) -> Option<Vec<u8>> {
    let findings = to_keep(&report.findings, &scene.findings)?;
    let figures = Report { findings: Vec::new(), ..report.clone() };
    let mut packer = Packer::default();
    packer.put_table(&findings)?.put_table(&figures)?;
    Some(packer.finish())
}

/// `None` where the bytes are no verdict on this scene.
pub(super) fn unpacked(bytes: &[u8], scene: &Scene) -> Option<Report> {
    let mut parts = Unpacker::new(bytes);
    let findings: Vec<KeptFinding> = parts.take_table()?;
    let figures: Report = parts.take_table()?;
    parts.end()?;
    // Of a mesh that is none there are no figures of views.
    let is_of_scene = figures.views.is_empty() || figures.views.len() == scene.views.len();
    let findings = of_kept(findings, &scene.findings).filter(|_| is_of_scene)?;
    Some(Report { findings, ..figures })
}
