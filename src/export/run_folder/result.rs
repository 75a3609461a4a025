//! What a fit found, and the check that its parts belong together.

use super::RunFolder;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, Image};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::scene::Mesh;
use std::path::Path;

/// What a fit found.
#[derive(Clone, Debug, PartialEq)]
pub struct RunResult {
    /// The maps, on the atlas of `mesh`.
    pub maps: MaterialMaps,
    /// The light of the photographs.
    pub environment: Environment,
    /// The surface with atlas coordinates.
    pub mesh: Mesh,
    /// In how many photographs a texel was seen, of the maps' size; 0: never.
    pub times_seen: GreyImage,
    /// The lobe that specular reflectance and roughness are meant for: `lobe` of the fit's settings.
    pub lobe: LobeModel,
}

impl RunResult {
    /// Writes the result into a run folder: [`RunFolder::write_result`].
    pub fn write(&self, folder: &RunFolder) -> Result<()> {
        folder.write_result(self)
    }

    /// Reads the result of a run folder: [`RunFolder::read_result`].
    pub fn read(folder: &RunFolder) -> Result<Self> {
        folder.read_result()
    }

    /// Checks that the parts belong together and that every number is finite.
    pub(super) fn validate(&self, folder: &Path) -> Result<()> {
        let diffuse = &self.maps.diffuse;
        let size = (diffuse.width(), diffuse.height());
        if size.0 == 0 || size.1 == 0 {
            return Err(Error::new(ErrorKind::Malformed, "the map has no texels")
                .at(Place::File(folder.join("diffuse.exr")))
                .remedy("make the run again with `patina fit SCENE -o RUN`"));
        }
        let specular = &self.maps.specular;
        let (roughness, seen) = (&self.maps.roughness, &self.times_seen);
        for (name, width, height) in [
            ("specular.exr", specular.width(), specular.height()),
            ("roughness.exr", roughness.width(), roughness.height()),
            ("seen.exr", seen.width(), seen.height()),
        ] {
            if (width, height) != size {
                let message = format!("the map is {width} x {height}, diffuse.exr is {} x {}", size.0, size.1);
                return Err(Error::new(ErrorKind::Malformed, message)
                    .at(Place::File(folder.join(name)))
                    .remedy("the files are of different runs: make them again with `patina fit SCENE -o RUN`"));
            }
        }
        check_finite(folder, "diffuse.exr", diffuse, |p| p.is_finite())?;
        check_finite(folder, "specular.exr", specular, |p| p.is_finite())?;
        check_finite(folder, "roughness.exr", roughness, |p| p.is_finite())?;
        check_finite(folder, "seen.exr", seen, |p| p.is_finite())?;
        check_finite(folder, "env.exr", &self.environment.radiance, |p| p.is_finite() && p.min_element() >= 0.0)
    }
}

fn check_finite<T: std::fmt::Debug>(
    folder: &Path,
    name: &str,
    image: &Image<T>,
    is_valid: impl Fn(&T) -> bool,
) -> Result<()> {
    match image.pixels().iter().position(|pixel| !is_valid(pixel)) {
        None => Ok(()),
        Some(index) => {
            let (row, column) = (index / image.width(), index % image.width());
            let message = format!("texel row {row} column {column} is {:?}", image.pixels()[index]);
            Err(Error::new(ErrorKind::NonFinite, message)
                .at(Place::File(folder.join(name)))
                .remedy("the file is damaged: make it again with `patina fit SCENE -o RUN`"))
        }
    }
}
