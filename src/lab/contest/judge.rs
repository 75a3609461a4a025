//! One judge for all: errors of pictures, maps, light and relit pictures against the truth.
//!
//! Pictures are traced anew by this program's path tracer at the length of paths of the truth, and compared over all
//! their pixels. The expected square of a noisy difference is too large by the variance of the noise; groups of paths
//! estimate that variance, and it is taken off, so that few paths give the right error on average. The noise of the
//! photographs stays: the truth judged in the same way tells how much that is.

use crate::error::{Error, ErrorKind, Result};
use crate::image::{Image, RgbImage};
use crate::insight::intervals::{IntervalCoverage, interval_coverage};
use crate::insight::scores::AlignmentSums;
use crate::insight::truth::{ErrorPair, environment_errors, map_errors};
use crate::job::against_truth::resampled;
use crate::job::pictures::parameters_with;
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::math::evenly_spread;
use crate::render::picture::{PictureSettings, render};
use crate::render::{Parameters, Surface};
use crate::scene::{Background, Scene};
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name and unit of each score. `aligned` is after the best factor per channel; of relit pictures, after that of the
/// diffuse map, with which they are traced again.
pub const COLUMNS: [(&str, &str); 18] = [
    ("image", ""),
    ("image aligned", ""),
    ("held out", ""),
    ("held out aligned", ""),
    ("diffuse", ""),
    ("diffuse aligned", ""),
    ("specular", ""),
    ("specular aligned", ""),
    ("roughness", ""),
    ("roughness aligned", ""),
    ("light rel. L2", ""),
    ("light aligned", ""),
    ("light log", ""),
    ("light log aligned", ""),
    ("sun off", "deg"),
    ("relit", ""),
    ("relit aligned", ""),
    ("non-finite", ""),
];
/// Column of the error of training views.
pub const IMAGE: usize = 0;
/// Columns that are put side by side in summaries: image, held out, diffuse aligned, specular, roughness, light aligned,
/// relit aligned.
pub const COMPARED: [usize; 7] = [0, 2, 5, 6, 8, 11, 16];

/// Groups of paths a pixel: their spread tells the variance of their mean.
const GROUPS: usize = 4;
/// Seed of the judge's paths, unlike that of any fit.
const SEED: u64 = 0x6a75_6467;

/// Who scores.
pub struct Judge {
    scene: Scene,
    surface: Surface,
    training: Vec<usize>,
    held_out: Vec<usize>,
    relit: Vec<usize>,
    samples: usize,
    lobe: LobeModel,
}

impl Judge {
    /// A judge of a scene with its truth. At most `most_views` pictures of each kind are looked at, evenly chosen, with
    /// `samples` paths a pixel.
    ///
    /// # Errors
    /// `InvalidScene` without truth; a mesh that cannot be traced.
    pub fn new(scene: Scene, samples: usize, most_views: usize) -> Result<Self> {
        let Some(truth) = &scene.truth else {
            return Err(Error::new(ErrorKind::InvalidScene, "the scene has no truth to judge by")
                .remedy("give an exchange folder with its truth"));
        };
        let some = |all: Vec<usize>| evenly_spread(&all, most_views.max(1));
        let scene_views = &scene.views;
        let of_kind =
            |held_out: bool| (0..scene_views.len()).filter(move |&view| scene_views[view].held_out == held_out);
        let (training, held_out) = (some(of_kind(false).collect()), some(of_kind(true).collect()));
        let pictures = truth.relight.as_ref().map_or(0, |relight| relight.pictures.len());
        let relit = some((0..pictures).collect());
        let surface = Surface::new(scene.mesh.clone())?;
        Ok(Judge {
            scene,
            surface,
            training,
            held_out,
            relit,
            samples: samples.max(GROUPS),
            lobe: LobeModel::default(),
        })
    }

    /// A judge of maps on another mesh with the same charts, such as the truth's with a part missing. Pictures are traced
    /// with it, and compared with those of the true one.
    pub fn with_surface(self, surface: Surface) -> Self {
        Judge { surface, ..self }
    }

    /// A judge of maps of these microfacets.
    pub fn of_lobe(self, lobe: LobeModel) -> Self {
        Judge { lobe, ..self }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Pictures that are compared: of training views, of held-out views, relit.
    pub fn pictures(&self) -> [usize; 3] {
        [self.training.len(), self.held_out.len(), self.relit.len()]
    }

    /// The scores, one a column of [`COLUMNS`]; NaN where there is nothing to compare with. `non_finite` is what the fit
    /// counted; pixels and texels that are not finite are added.
    ///
    /// # Errors
    /// Maps that do not belong to the scene; `Stopped` when `stop` is raised.
    pub fn scores(
        &self,
        maps: &MaterialMaps,
        light: &Environment,
        non_finite: u64,
        stop: &AtomicBool,
    ) -> Result<Vec<f64>> {
        let Some(truth) = &self.scene.truth else { return Ok(Vec::new()) };
        let mut broken = non_finite;
        let own = parameters_with(maps, light, self.lobe);
        let photo = |view: &usize| {
            let photo = &self.scene.views[*view].photo;
            (*view, Image::from_fn(photo.width(), photo.height(), |row, column| photo.radiance(row, column)))
        };
        let training = self.sums(&own, self.training.iter().map(photo), &mut broken, stop);
        let held_out = self.sums(&own, self.held_out.iter().map(photo), &mut broken, stop);
        let errors = map_errors(&resampled(maps, size_of(&truth.maps)), &truth.maps, &truth.texels_seen)?;
        let (width, height) = (truth.environment.width(), truth.environment.height());
        let of_light = environment_errors(&light.resampled(width, height), &truth.environment)?;
        broken += errors.non_finite_texels;
        let mut relit = [f64::NAN; 2];
        if let Some(relight) = &truth.relight {
            let pictures = || self.relit.iter().map(|&index| relight.pictures[index].clone());
            relit[0] = self
                .sums(&parameters_with(maps, &relight.environment, self.lobe), pictures(), &mut broken, stop)
                .rmse();
            let scale = Vec3::from_array(errors.diffuse.scale.map(|factor| factor as f32));
            let scaled = |diffuse: &Vec3| (*diffuse * scale).clamp(Vec3::ZERO, Vec3::ONE);
            let aligned = MaterialMaps { diffuse: maps.diffuse.map(scaled), ..maps.clone() };
            let lit = parameters_with(&aligned, &relight.environment, self.lobe);
            relit[1] = self.sums(&lit, pictures(), &mut broken, stop).rmse();
        }
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Stopped, "stopped while scores were made"));
        }
        let pair = |pair: ErrorPair| [pair.raw, pair.aligned];
        let mut scores = vec![training.rmse(), training.rmse_at(training.scale())];
        scores.extend([held_out.rmse(), held_out.rmse_at(held_out.scale())]);
        scores.extend([errors.diffuse, errors.specular, errors.roughness].into_iter().flat_map(pair));
        scores.extend([of_light.relative_l2, of_light.log_rmse].into_iter().flat_map(pair));
        scores.push(of_light.brightest_angle_degrees.unwrap_or(f64::NAN));
        scores.extend(relit);
        scores.push(broken as f64);
        Ok(scores)
    }

    /// The error of training pictures alone: the first score, for a fraction of the work.
    pub fn training_error(&self, maps: &MaterialMaps, light: &Environment, stop: &AtomicBool) -> f64 {
        let photos = self.training.iter().map(|&view| {
            let photo = &self.scene.views[view].photo;
            (view, Image::from_fn(photo.width(), photo.height(), |row, column| photo.radiance(row, column)))
        });
        self.sums(&parameters_with(maps, light, self.lobe), photos, &mut 0, stop).rmse()
    }

    /// Relative L2 error of the light after its factor, both lights blurred by so many degrees at the size of `light`: what is
    /// below that angle, or below the texels of a fit, is not held against it. NaN without truth.
    ///
    /// # Errors
    /// As of [`environment_errors`].
    pub fn light_error_blurred(&self, light: &Environment, degrees: f64) -> Result<f64> {
        let Some(truth) = &self.scene.truth else { return Ok(f64::NAN) };
        let truth = truth.environment.resampled(light.width(), light.height());
        Ok(environment_errors(&light.blurred(degrees), &truth.blurred(degrees))?.relative_l2.aligned)
    }

    /// How often the 90 % intervals of stated deviations hold the truth; `None` where sizes do not agree.
    ///
    /// # Errors
    /// Maps that do not belong to the scene.
    pub fn intervals(&self, maps: &MaterialMaps, deviations: &MaterialMaps) -> Result<Option<IntervalCoverage>> {
        let Some(truth) = &self.scene.truth else { return Ok(None) };
        let (maps, deviations) = (resampled(maps, size_of(&truth.maps)), resampled(deviations, size_of(&truth.maps)));
        let errors = map_errors(&maps, &truth.maps, &truth.texels_seen)?;
        Ok(interval_coverage(&maps, &deviations, &truth.maps, &truth.texels_seen, &errors))
    }

    /// Sums over all pixels of some pictures, without the noise of ours.
    fn sums(
        &self,
        lit: &Parameters<f32>,
        pictures: impl Iterator<Item = (usize, RgbImage)>,
        broken: &mut u64,
        stop: &AtomicBool,
    ) -> AlignmentSums {
        let settings = PictureSettings {
            samples: self.samples.div_ceil(GROUPS),
            groups: GROUPS,
            max_bounces: self.scene.truth.as_ref().map_or(1, |truth| truth.max_bounces),
            background_visible: self.scene.background == Background::Environment,
            seed: SEED,
            ..Default::default()
        };
        let mut total = AlignmentSums::default();
        for (view, truth) in pictures {
            let ours = render(&self.surface, &self.scene.views[view].camera, lit, view as u32, &settings, stop);
            *broken += ours.non_finite_pixels as u64;
            let counted = truth.map(|pixel| pixel.is_finite());
            total.add(&AlignmentSums::without_variance(&truth, &ours.radiance, ours.variance.as_ref(), &counted));
        }
        total.squared_difference = total.squared_difference.max(0.0);
        total
    }
}

/// Width and height of maps in texels.
fn size_of(maps: &MaterialMaps) -> (usize, usize) {
    (maps.diffuse.width(), maps.diffuse.height())
}
