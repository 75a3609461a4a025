//! Scenes made in code with their truth, to judge fits by: [`study`] holds a vase, [`hard`] what breaks fits.

pub mod hard;
pub mod study;

use crate::error::Result;
use crate::export::exchange::{self, ExchangeOptions};
use crate::scene::demo::{self, DemoSettings};
use crate::scene::read_mesh;
use std::path::Path;
use study::{StudyKind, StudySettings};

/// Writes the demo and the study scenes, not photographed, as exchange folders under `folder`. Kinds whose mesh is no code
/// are written where `folder` holds it, `KIND.obj`; `tell` hears of those that it does not.
///
/// # Errors
/// A mesh that cannot be read or has no texture coordinates, a folder that cannot be written.
pub fn write_references(folder: &Path, tell: &dyn Fn(&str)) -> Result<()> {
    let demo = demo::build(&DemoSettings::default())?;
    let options = ExchangeOptions { covered: Some(&demo.covered), ..ExchangeOptions::default() };
    if let Some(truth) = &demo.scene.truth {
        exchange::write(&demo.scene, truth, &options, &folder.join("demo"))?;
    }
    let settings = StudySettings::default();
    for kind in StudyKind::ALL {
        let file = folder.join(format!("{}.obj", kind.name()));
        let mesh = match kind.mesh_in_code(settings.map_size)? {
            Some(mesh) => mesh,
            None if file.exists() => read_mesh(&file)?.0,
            None => {
                tell(&format!("left out: there is no {}", file.display()));
                continue;
            }
        };
        let scene = study::build(kind, mesh, &settings)?;
        let options = ExchangeOptions { lobe_strength: kind.lobe_strength(), ..ExchangeOptions::default() };
        if let Some(truth) = &scene.truth {
            exchange::write(&scene, truth, &options, &folder.join(kind.name()))?;
        }
    }
    Ok(())
}
