//! Reads the measured materials that a user gives to parts of a surface.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file;
use crate::neural::source;
use crate::render::regions::{COVERED, MeasuredMaterial, Regions};
use std::path::{Path, PathBuf};

/// The regions of materials and masks in the order they were given, and what was noticed; `None` when no material was.
/// For what a material may be, and what `library` is for, see [`source::read`].
///
/// # Errors
/// What cannot be read; another number of masks than of materials, unless one material covers all.
pub fn read(
    materials: &[String],
    masks: &[PathBuf],
    library: Option<&Path>,
) -> Result<Option<(Regions, Vec<Finding>)>> {
    if materials.is_empty() {
        return Ok(None);
    }
    let covers_all = materials.len() == 1 && masks.is_empty();
    if !covers_all && materials.len() != masks.len() {
        let message = format!("{} materials and {} regions were given", materials.len(), masks.len());
        return Err(Error::new(ErrorKind::InvalidSetting, message)
            .at(Place::Setting("region".into()))
            .remedy("give one mask for each material, in the same order"));
    }
    let mut findings = Vec::new();
    let mut read = Vec::with_capacity(materials.len());
    for name in materials {
        let found = source::read(name, library, None)?;
        let material = MeasuredMaterial::new(&found.name, found.table);
        let largest = material.albedos().iter().flat_map(|(_, albedo)| *albedo).fold(0.0, f64::max);
        if largest > 1.0 {
            let message = format!("{} reflects up to {largest:.2} times the light it gets", found.name);
            findings.push(
                Finding::new(Severity::Warning, "region-gains-energy", message)
                    .remedy("measured tables do so at grazing angles; renders with many bounces become too bright"),
            );
        }
        read.push(material);
    }
    let regions = match covers_all {
        true => Regions::everywhere(read.swap_remove(0)),
        false => {
            let pictures = masks.iter().map(|path| file::read_grey(path)).collect::<Result<Vec<_>>>()?;
            for (path, picture) in masks.iter().zip(&pictures) {
                if picture.pixels().iter().all(|&value| value.is_nan() || value <= COVERED) {
                    findings.push(
                        Finding::new(Severity::Warning, "region-empty", "the mask is empty: its material is not shown")
                            .at(Place::File(path.clone()))
                            .remedy("paint the region white, on the texture coordinates of the run's mesh"),
                    );
                }
            }
            Regions::of_masks(read.into_iter().zip(pictures).collect())?
        }
    };
    Ok(Some((regions, findings)))
}
