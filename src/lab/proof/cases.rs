//! A run under one light and with one lobe: its export, and its pictures by the path tracer.

use super::lights::{self, ProofLight};
use super::{BOUNCES, ProofOptions, ProofView};
use crate::error::{Error, Result};
use crate::export::{RunFolder, RunResult};
use crate::image::file::{read_rgb, write_exr_rgb};
use crate::image::{Image, RgbImage};
use crate::job::export::{ExportOptions, Format, export};
use crate::job::pictures::{parameters_of, relit};
use crate::job::prepare::RunSettings;
use crate::material::LobeModel;
use crate::render::Surface;
use crate::render::picture::{PictureSettings, render};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Independent pictures that a variance is made of.
pub const GROUPS: usize = 16;
/// Paths a pixel of pictures under wrong lights, which are told from right ones by far.
const SAMPLES_OF_WRONG: usize = 16;

/// Pictures of one view: their mean, and the variance of that mean where it is known.
#[derive(Clone, Debug)]
pub struct Noisy {
    /// Linear radiance.
    pub mean: RgbImage,
    /// Variance of each pixel's mean.
    pub variance: Option<RgbImage>,
}

/// What a view is held against.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The path tracer's picture.
    pub picture: Noisy,
    /// Pixels that surface covers wholly.
    pub counted: Image<bool>,
    /// The same under lights that are turned; only for [`lights::TEXEL`].
    pub wrong: Vec<RgbImage>,
}

/// A run under one light and with one lobe.
pub struct Case {
    /// `LOBE/LIGHT`; also its folder.
    pub name: String,
    /// The lobe.
    pub lobe: LobeModel,
    /// The light.
    pub light: ProofLight,
    /// Where its files are.
    pub folder: PathBuf,
    /// One for each view.
    pub references: Vec<Reference>,
}

impl Case {
    /// Writes run and export of a case, and traces its pictures.
    ///
    /// # Errors
    /// Errors of writing, exporting and of the surface; `Stopped`.
    pub fn make(
        name: &str,
        run: &RunResult,
        settings: &RunSettings,
        lobe: LobeModel,
        light: ProofLight,
        views: &[ProofView],
        options: &ProofOptions,
        stop: &AtomicBool,
    ) -> Result<Self> {
        let folder = options.output.join(name);
        std::fs::create_dir_all(&folder).map_err(|source| Error::writing(&folder, source))?;
        let folder = folder.canonicalize().map_err(|source| Error::reading(&folder, source))?;
        let result = RunResult { environment: light.environment.clone(), lobe, ..run.clone() };
        let copy = RunFolder::create(&folder.join("run"))?;
        let mut own = settings.clone();
        own.fit.lobe = lobe;
        copy.write_settings(&own)?;
        copy.write_result(&result)?;
        let formats = vec![Format::Glb, Format::Usd, Format::Mitsuba, Format::Blender, Format::Materialx, Format::Web];
        let asked =
            ExportOptions { formats, size: options.size, ..ExportOptions::new(copy.path(), &folder.join("export")) };
        export(&asked, stop, &|_| {})?;

        let parameters = parameters_of(&result);
        let surface = Surface::new(result.mesh)?;
        let picture = PictureSettings {
            samples: options.samples / GROUPS,
            groups: GROUPS,
            max_bounces: BOUNCES,
            background_visible: false,
            two_sided: true,
            lobe_strength: if own.fit.has_lobe() { 1.0 } else { 0.0 },
            ..PictureSettings::default()
        };
        let others = if light.name == lights::TEXEL { lights::wrong(&light.environment) } else { Vec::new() };
        let few = PictureSettings { samples: SAMPLES_OF_WRONG, groups: 1, ..picture };
        let reference = |(index, view): (usize, &ProofView)| {
            let traced = render(&surface, &view.camera, &parameters, index as u32, &picture, stop);
            let counted = traced.fully_covered();
            let wrong = others
                .iter()
                .map(|other| relit(&surface, &parameters, other, &view.camera, index, &few, stop).radiance)
                .collect();
            Reference { picture: Noisy { mean: traced.radiance, variance: traced.variance }, counted, wrong }
        };
        let references: Vec<Reference> = views.iter().enumerate().map(reference).collect();
        for (view, reference) in views.iter().zip(&references) {
            write_exr_rgb(&folder.join(format!("reference_{}.exr", view.name)), &reference.picture.mean)?;
            if let Some(variance) = &reference.picture.variance {
                write_exr_rgb(&folder.join(format!("reference_{}_variance.exr", view.name)), variance)?;
            }
        }
        Ok(Case { name: name.into(), lobe, light, folder, references })
    }

    /// The export's folder of a format.
    pub fn export(&self, format: &str) -> PathBuf {
        self.folder.join("export").join(format)
    }

    /// Where a program leaves its pictures: the beginning of their paths.
    pub fn stem(&self, program: &str) -> PathBuf {
        self.folder.join(program)
    }

    /// The ways in which Blender imports the case.
    pub fn blender_kinds(&self) -> Vec<&'static str> {
        let mut kinds = vec!["glb", "script", "usd"];
        if self.export("glb").join("environment_without_sun.exr").is_file() {
            kinds.push("glb_sun");
        }
        kinds
    }

    /// Reads what a program has left: `STEM_VIEW_mean.pfm` and `STEM_VIEW_variance.pfm`.
    ///
    /// # Errors
    /// Files that are missing or damaged.
    pub fn pictures_of(&self, program: &str, views: &[ProofView]) -> Result<Vec<Noisy>> {
        let read = |view: &ProofView, what: &str| {
            let mut path = self.stem(program).into_os_string();
            path.push(format!("_{}_{what}.pfm", view.name));
            read_rgb(&PathBuf::from(path))
        };
        views
            .iter()
            .map(|view| Ok(Noisy { mean: read(view, "mean")?, variance: Some(read(view, "variance")?) }))
            .collect()
    }
}
