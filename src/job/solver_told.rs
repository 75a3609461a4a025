//! What the solver tells beside its maps: how sure it is, how lobes are shared, what the light is known by.

use crate::error::Result;
use crate::export::RunFolder;
use crate::fit::Fitter;
use crate::fit::solver::TransportError;
use crate::fit::solver::report::median;
use crate::image::{GreyImage, RgbImage};
use crate::insight::report::data::Fact;
use crate::material::MaterialMaps;
use crate::math::sphere::solid_angle_of_texel;
use glam::DVec3;
use std::f64::consts::PI;

/// Asked once of a fit that is done; everything is `None` under Adam.
pub(super) struct SolverTold {
    deviations: Option<MaterialMaps>,
    lobe_sharing: Option<GreyImage>,
    light_evidence: Option<RgbImage>,
}

impl SolverTold {
    /// Asks a fit.
    pub fn of(fitter: &Fitter) -> Self {
        SolverTold {
            deviations: fitter.deviations(),
            lobe_sharing: fitter.lobe_sharing(),
            light_evidence: fitter.light_evidence(),
        }
    }

    /// Writes what there is into the run folder.
    pub fn write(&self, folder: &RunFolder) -> Result<()> {
        if let Some(deviations) = &self.deviations {
            folder.write_deviations(deviations)?;
        }
        if let Some(sharing) = &self.lobe_sharing {
            folder.write_lobe_sharing(sharing)?;
        }
        if let Some(shares) = &self.light_evidence {
            folder.write_light_evidence(shares)?;
        }
        Ok(())
    }

    /// The facts of the report, with the error of transport. Empty under Adam.
    pub fn facts(&self, transport: Option<TransportError>) -> Vec<Fact> {
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
            let (height, width) = (shares.height(), shares.width());
            let mut mean = DVec3::ZERO;
            for (texel, share) in shares.pixels().iter().enumerate() {
                mean += share.as_dvec3() * solid_angle_of_texel(texel / width, width, height) / (4.0 * PI);
            }
            facts.push(fact(
            "what the light is known by",
            format!(
                "highlights {:.0} %, background {:.0} %, diffuse light and shadows {:.0} %, belief that skies are smooth \
                 {:.0} % (means over the sphere; environment_evidence.exr has each texel)",
                100.0 * mean.x,
                100.0 * mean.y,
                100.0 * mean.z,
                100.0 * (1.0 - mean.element_sum())
            ),
        ));
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
        facts.push(fact(
        "specular lobes",
        format!(
            "{:.0} % of the texels share one with at least 63 others, {:.0} % with fewer, {:.0} % have one of their own",
            share(&|count| count >= 64.0),
            share(&|count| (2.0..64.0).contains(&count)),
            share(&|count| count < 2.0)
        ),
    ));
        let median_of = |of: &dyn Fn(usize) -> f32| {
            let mut values: Vec<f32> = solved.iter().map(|&texel| of(texel)).collect();
            median(&mut values)
        };
        facts.push(fact(
            "median standard deviation given the light",
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
