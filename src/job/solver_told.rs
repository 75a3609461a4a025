//! What the solver tells beside its maps: how sure it is, how lobes are shared, what constrains the environment.

use crate::error::Result;
use crate::export::RunFolder;
use crate::fit::Fitter;
use crate::fit::solver::TransportError;
use crate::image::{GreyImage, RgbImage};
use crate::insight::report::data::Fact;
use crate::material::MaterialMaps;
use crate::math::sphere::solid_angle_of_texel;
use crate::math::statistics::median;
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// What is told of maps and light; everything is `None` under Adam. Large parts are shared, so that a copy costs little.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolverTold {
    /// Standard deviations of the maps' values, in their units; known once the maps are made.
    pub deviations: Option<Arc<MaterialMaps>>,
    /// Number of texels that share a texel's lobe, 0 where none was found; known once the maps are made.
    pub lobe_sharing: Option<Arc<GreyImage>>,
    /// By texel, what judging views chose: 1 no lobe, 2 one lobe a region, 3 lobes of their own; 0 where none judge. Known
    /// once the maps are made.
    pub choice_map: Option<Arc<GreyImage>>,
    /// What each texel of the light is known by: [`Fitter::light_evidence`].
    pub light_evidence: Option<Arc<RgbImage>>,
    /// How far photos leave the factor open that light and reflectance have in common, as a relative standard deviation:
    /// [`Fitter::light_scale_deviation`].
    pub light_scale_deviation: Option<f64>,
}

impl SolverTold {
    /// Asks a fit.
    pub fn of(fitter: &Fitter) -> Self {
        SolverTold {
            deviations: fitter.deviations().map(Arc::new),
            lobe_sharing: fitter.lobe_sharing().map(Arc::new),
            choice_map: fitter.choices().map(|choices| Arc::new(choices.map.clone())),
            light_evidence: fitter.light_evidence().map(Arc::new),
            light_scale_deviation: fitter.light_scale_deviation(),
        }
    }

    /// Reads what a finished run of the solver left in its folder; a file that is not there is `None`.
    ///
    /// # Errors
    /// Files that are there and cannot be read.
    pub fn read(folder: &RunFolder) -> Result<Self> {
        Ok(SolverTold {
            deviations: folder.read_deviations()?.map(Arc::new),
            lobe_sharing: folder.read_lobe_sharing()?.map(Arc::new),
            choice_map: folder.read_choices()?.map(Arc::new),
            light_evidence: folder.read_light_evidence()?.map(Arc::new),
            light_scale_deviation: folder.read_light_scale_deviation()?,
        })
    }

    /// Writes what there is into the run folder.
    pub(super) fn write(&self, folder: &RunFolder) -> Result<()> {
        if let Some(deviations) = &self.deviations {
            folder.write_deviations(deviations)?;
        }
        if let Some(sharing) = &self.lobe_sharing {
            folder.write_lobe_sharing(sharing)?;
        }
        if let Some(choices) = &self.choice_map {
            folder.write_choices(choices)?;
        }
        if let Some(shares) = &self.light_evidence {
            folder.write_light_evidence(shares)?;
        }
        if let Some(deviation) = self.light_scale_deviation {
            folder.write_light_scale_deviation(deviation)?;
        }
        Ok(())
    }

    /// The facts of the report, with the error of transport. Empty under Adam.
    pub(super) fn facts(&self, transport: Option<TransportError>) -> Vec<Fact> {
        let fact = |name: &str, value: String| Fact { name: name.into(), value };
        let mut facts = Vec::new();
        if let Some(error) = transport {
            facts.push(fact(
                "cached transport against the path tracer",
                format!(
                    "{:.2} % relative RMSE, bias {:+.2} %, over {} pixels of {} paths",
                    100.0 * error.relative_rmse,
                    100.0 * error.bias,
                    error.pixels,
                    error.samples
                ),
            ));
        }
        if let Some(shares) = &self.light_evidence {
            let mean = mean_shares(shares).map(|share| 100.0 * share);
            let value = format!(
                "highlights {:.0} %, background {:.0} %, diffuse light and shadows {:.0} %, smoothness prior {:.0} % \
                 (means over the sphere; environment_evidence.exr has each texel)",
                mean[0], mean[1], mean[2], mean[3]
            );
            facts.push(fact("what constrains the environment", value));
        }
        if let Some(deviation) = self.light_scale_deviation {
            facts.push(fact("factor common to light and reflectance", scale_words(deviation)));
        }
        let (Some(sharing), Some(deviations)) = (&self.lobe_sharing, &self.deviations) else { return facts };
        let solved: Vec<usize> = (0..sharing.pixels().len()).filter(|&texel| sharing.pixels()[texel] > 0.0).collect();
        if solved.is_empty() {
            return facts;
        }
        let share = |of: &dyn Fn(f32) -> bool| {
            let count = solved.iter().filter(|&&texel| of(sharing.pixels()[texel])).count();
            100.0 * count as f64 / solved.len() as f64
        };
        let value = format!(
            "{:.0} % of the texels share one with at least 63 others, {:.0} % with fewer, {:.0} % have one of their own",
            share(&|count| count >= 64.0),
            share(&|count| (2.0..64.0).contains(&count)),
            share(&|count| count < 2.0)
        );
        facts.push(fact("specular lobes", value));
        let median_of = |of: &dyn Fn(usize) -> f32| {
            let mut values: Vec<f32> = solved.iter().map(|&texel| of(texel)).collect();
            median(&mut values)
        };
        facts.push(fact(
            "median standard deviation",
            format!(
                "diffuse {:.3}, specular {:.3}, roughness {:.3}",
                median_of(&|texel| deviations.diffuse.pixels()[texel].element_sum() / 3.0),
                median_of(&|texel| deviations.specular.pixels()[texel].element_sum() / 3.0),
                median_of(&|texel| deviations.roughness.pixels()[texel])
            ),
        ));
        facts
    }
}

/// How well the factor is known that light and diffuse reflectance have in common, in words.
pub fn scale_words(relative_deviation: f64) -> String {
    // Beyond this the light could as well be half or twice as bright.
    const OPEN: f64 = 0.5;
    if relative_deviation.is_finite() && relative_deviation < OPEN {
        format!("known from the photos to ± {:.1} %, given that the model holds", 100.0 * relative_deviation)
    } else {
        "left open by the photos: a convention holds it".into()
    }
}

/// Means over the sphere of what the texels of a light are known by: highlights, background, diffuse light and shadows,
/// belief. They add up to 1.
pub fn mean_shares(shares: &RgbImage) -> [f64; 4] {
    let (height, width) = (shares.height(), shares.width());
    let mut mean = DVec3::ZERO;
    for (texel, share) in shares.pixels().iter().enumerate() {
        mean += share.as_dvec3() * solid_angle_of_texel(texel / width, width, height) / (4.0 * PI);
    }
    [mean.x, mean.y, mean.z, 1.0 - mean.element_sum()]
}
