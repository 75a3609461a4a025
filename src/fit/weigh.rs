//! The consistency setting, applied to the summed gradient of a step.

use super::batch::pixels_of_visit;
use super::consistency::{Agreement, ViewGradient, released_factor};
use super::fitter::Fitter;
use super::schedule::Stage;
use super::settings::Consistency;
use super::stage_work::StageWork;
use super::step_sums::StepSums;
use crate::light::EnvironmentSampler;
use crate::material::{Material, TexelPyramid};
use crate::math::real::Dual;
use crate::render::accumulate::accumulate;
use crate::render::{ParameterGradient, Parameters};
use std::sync::atomic::{AtomicBool, Ordering};

impl Fitter {
    /// Applies the consistency setting to the summed gradient. `false` when stopped.
    pub(super) fn weigh_by_consistency(
        &self,
        work: &mut StageWork,
        views: &[(usize, usize)],
        view_gradients: &[ViewGradient<f32>],
        stage: &Stage,
        sampler: &EnvironmentSampler,
        sums: &mut StepSums,
        stop: &AtomicBool,
    ) -> bool {
        let count = stage.map_size * stage.map_size;
        let mut agreement = Agreement::of(view_gradients, count, None, f64::from);
        sums.consistency = agreement.value;
        let scale_all = |gradient: &mut ParameterGradient<f32>, factor: f32| {
            for texel in &mut gradient.texels.levels[0].texels {
                texel.d_material = texel.d_material.map(|d| d * factor);
            }
            gradient.light.iter_mut().flatten().for_each(|value| *value *= factor);
        };
        match self.settings.consistency {
            Consistency::None => {}
            Consistency::Released => {
                let factor = released_factor(view_gradients, count);
                sums.consistency = factor.ln();
                sums.loss *= factor;
                scale_all(&mut work.gradient, factor as f32);
            }
            Consistency::Constant => {
                sums.loss *= agreement.value.exp();
                let mean_factor = agreement.value.exp() as f32;
                let gradient = &mut work.gradient;
                for (texel, &value) in gradient.texels.levels[0].texels.iter_mut().zip(&agreement.per_texel) {
                    let factor = value.exp();
                    texel.d_material = texel.d_material.map(|d| d * factor);
                }
                gradient.light.iter_mut().flatten().for_each(|value| *value *= mean_factor);
            }
            Consistency::Exact => {
                // L = mean(L_i) exp(V): grad L = exp(V) (grad mean + mean grad V).
                let factor = agreement.value.exp();
                sums.loss *= factor;
                scale_all(&mut work.gradient, factor as f32);
                let scale = (factor * sums.image_loss) as f32;
                for (&(slot, visit), view_gradient) in views.iter().zip(view_gradients) {
                    let direction = agreement.direction(view_gradient, f64::from);
                    if direction.is_empty() {
                        continue;
                    }
                    if !self.add_hessian_product(work, slot, visit, &direction, stage, sampler, scale, stop) {
                        return false;
                    }
                }
            }
        }
        sums.agreement = Some(std::mem::take(&mut agreement.per_texel));
        true
    }

    /// Adds `scale` times the Hessian of a view's loss times a direction on the diffuse map. `false` when stopped.
    fn add_hessian_product(
        &self,
        work: &mut StageWork,
        slot: usize,
        visit: usize,
        direction: &[(u32, [f64; 3])],
        stage: &Stage,
        sampler: &EnvironmentSampler,
        scale: f32,
        stop: &AtomicBool,
    ) -> bool {
        let StageWork { weights, parameters, gradient, targets, first_hits, .. } = work;
        let target = &targets[slot];
        let lift = |value: f32| Dual::new(value, 0.0f32);
        let mut base: Vec<Material<Dual<f32>>> =
            parameters.texels.levels[0].texels.iter().map(|texel| texel.map(lift)).collect();
        // A direction of unit size keeps the tangents of f32 in range; the size is put back at the end.
        let size = direction.iter().flat_map(|(_, v)| v).fold(0.0f64, |size, value| size.max(value.abs()));
        if size == 0.0 {
            return true;
        }
        for (index, v) in direction {
            for channel in 0..3 {
                base[*index as usize].diffuse[channel].tangent = (v[channel] / size) as f32;
            }
        }
        let dual = Parameters {
            texels: TexelPyramid::from_base(base, weights).with_model(parameters.texels.model),
            light: parameters.light.iter().map(|radiance| radiance.map(lift)).collect(),
            environment_size: parameters.environment_size,
        };
        let mut d_dual = ParameterGradient::<Dual<f32>>::zeros(weights, dual.light.len());
        let pixels = pixels_of_visit(self.settings.seed, target, visit, 0);
        let tracer = self.tracer(stage, parameters, sampler, target);
        let rays = self.rays(target, &first_hits[slot]);
        let loss = self.view_loss(target, 1.0 / (3.0 * pixels.len() as f32));
        accumulate(&tracer, &rays, &pixels, self.pass_key(target), &dual, &loss, &mut d_dual, stop);
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        d_dual.texels.pull_down(weights);
        let factor = scale * size as f32;
        for (texel, d) in gradient.texels.levels[0].texels.iter_mut().zip(&d_dual.texels.levels[0].texels) {
            texel.d_material.add_scaled(&d.d_material.map(|d| d.tangent), factor);
        }
        for (light, d) in gradient.light.iter_mut().zip(&d_dual.light) {
            for channel in 0..3 {
                light[channel] += factor * d[channel].tangent;
            }
        }
        true
    }
}
