//! The experiments of the paper: figure 2 without any photo, figures 3, 4 and 5 with one, and shadows.
//!
//! [`representation`] is figure 2: models against tables, which `contender` fits. For the others [`inputs`] photographs:
//! the measured reflectance itself, asked at every part of a light that is finer than any that is fitted. [`case`]
//! estimates and measures one case. [`asked`] is what a case asks, [`mod@plan`] says which cases there are,
//! [`crate::lab::study`] takes them and keeps what came of them, [`tables`] makes the tables of it.
//!
//! What this folder refuses to do: fit anything to the truth, or leave out a case that failed.

pub mod asked;
pub mod case;
mod contender;
pub mod inputs;
pub mod plan;
pub mod representation;
pub mod tables;

use crate::error::Result;
use crate::image::{Image, file};
use crate::insight::material_pictures::sheet;
use crate::lab::study::line::CaseInputs;
use crate::lab::study::{Results, Sitting, StudyCase, Tally};
use crate::neural::Trained;
use crate::object::page::{Shown, enlarged, stops_of};
use asked::Case;
use inputs::{Inputs, Photographed};
use plan::plan;
use representation::Representation;
use std::path::{Path, PathBuf};

/// Version of the method: results of another one are void. Raise it with every change that moves them.
pub const VERSION: u32 = 1;

/// What is studied.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// Folder of the neural fits of the MERL materials.
    pub library: PathBuf,
    /// Folder of environments.
    pub envmaps: PathBuf,
    /// Mesh of an object that shadows itself; without one that part is left out, and told.
    pub mesh: Option<PathBuf>,
    /// Weights of the neural model; those that ship for materials left out ([`crate::neural::shipped_leave_out`]) when
    /// not given.
    pub weights: Option<PathBuf>,
    /// Further weights for figure 2, each fitted to the materials it was trained without.
    pub leave_out_weights: Vec<PathBuf>,
    /// Small photos and lights.
    pub quick: bool,
    /// Folder of the pictures of the cases that are done; none are kept without it.
    pub pictures: Option<PathBuf>,
}

impl StudyOptions {
    /// The neural model of the study.
    ///
    /// # Errors
    /// Weights that cannot be read.
    pub fn trained(&self) -> Result<Trained> {
        self.weights.as_deref().map_or_else(crate::neural::shipped_leave_out, Trained::read)
    }

    /// What a case that takes photos is made from, beside what its name says.
    fn case_inputs(&self) -> CaseInputs {
        let stem = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let weights = self.weights.as_ref().map_or_else(|| "shipped, left out".into(), stem);
        [("weights".to_string(), weights)].into()
    }
}

/// Does the cases that `results` does not have yet.
///
/// # Errors
/// Inputs that are missing, files that cannot be written, a stop. Cases that fail are results.
pub fn run(options: &StudyOptions, results: &Path, sitting: &Sitting) -> Result<Tally> {
    let mut results = Results::read(results)?;
    let mut representation = Representation::read(options)?;
    let inputs = Inputs::read(options, sitting.tell)?;
    let photos = plan(&inputs, &sitting.pattern);
    let mut cases = representation.cases();
    let first_photo = cases.len();
    let of_photo = |case: &Case| StudyCase {
        key: case.key(options.quick),
        block: case.block(),
        seed: case.seed,
        inputs: options.case_inputs(),
    };
    cases.extend(photos.iter().map(of_photo));
    // Rivals on one photo follow each other: it is taken once.
    let mut photographed: Option<(String, Photographed)> = None;
    let mut work = |place: usize| {
        let Some(case) = place.checked_sub(first_photo).map(|place| &photos[place]) else {
            return representation.fit(place);
        };
        let taken = match photographed.take() {
            Some((block, taken)) if block == case.block() => taken,
            _ => inputs.photograph(case)?,
        };
        let outcome = case::run(case, &inputs, &taken, sitting.stop);
        photographed = Some((case.block(), taken));
        let (figures, pictures) = outcome?;
        if let Some(folder) = &options.pictures {
            write_pictures(folder, &case.key(options.quick), &pictures)?;
        }
        Ok(figures)
    };
    sitting.run(&mut results, VERSION, &cases, &mut work)
}

/// Writes the pictures of a case on one sheet. A light that was found is shown at the exposure of its own mean: levels
/// are not known.
fn write_pictures(folder: &Path, key: &str, pictures: &case::CasePictures) -> Result<()> {
    let tile = |(caption, picture): &(String, _)| -> (String, Image<[u8; 3]>) {
        let stops = stops_of(picture);
        (caption.clone(), enlarged(&Shown { caption: caption.clone(), picture, stops }, 160))
    };
    let plain: String = key.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
    file::write_png_srgb8(
        &folder.join(format!("{plain}.png")),
        &sheet(&pictures.iter().map(tile).collect::<Vec<_>>(), None),
    )
}
