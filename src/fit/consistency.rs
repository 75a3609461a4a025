//! Multi-view gradient consistency (Joy and Poullis 2023, eq. 2 and 3), made to mean something.
//!
//! The paper asks that the gradients of different views by the diffuse map agree at each surface point, and multiplies
//! the reconstruction loss by `exp(V)`, `V` the variance over views.
//! * Eq. 3 as printed squares outside the sum and is identically zero; here `V_p = 1/(N-1) sum_i (g_i - mean)^2`.
//! * "Normalised to [0, 1]" is made exact: with `s` the range of all gradients of the step, a variance of N values is
//!   at most `s^2 N / (4 (N-1)) <= s^2 / 2`, so `2 V_p / s^2` lies in [0, 1]. `s` is taken per step and carries no
//!   gradient.
//! * `V` is the mean over texels that two or more views of the step see.
//!
//! For the exact gradient, `sum_i (g_i - mean) = 0` leaves
//! `grad V = sum_i H_i v_i` with `v_i = 4 / (3 P s^2 (N_p - 1)) (g_i - mean)` on the diffuse map and `H_i` the Hessian
//! of view i's loss: one pass per view with dual numbers.

use crate::material::TexelGradient;
use crate::math::real::Real;

/// The gradient of one view's loss by the diffuse map, where the view saw a texel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewGradient<R> {
    /// Indices of the texels, rising.
    pub index: Vec<u32>,
    /// Derivative by diffuse RGB.
    pub d_diffuse: Vec<[R; 3]>,
}

impl<R: Real> ViewGradient<R> {
    /// Collects the touched texels of a gradient on the base level.
    pub fn collect(texels: &[TexelGradient<R>]) -> Self {
        let mut own = ViewGradient { index: Vec::new(), d_diffuse: Vec::new() };
        for (index, texel) in texels.iter().enumerate() {
            if texel.evidence != 0.0 {
                own.index.push(index as u32);
                own.d_diffuse.push(texel.d_material.diffuse);
            }
        }
        own
    }
}

/// Agreement of the gradients of several views.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// `V` in [0, 1]: 0 when all views agree, or when no texel is seen twice.
    pub value: f64,
    /// Range `s` of all gradients of the step.
    pub range: f64,
    /// Texels that two or more views saw.
    pub shared_texels: usize,
    /// `V_p` of each base texel in [0, 1]; 0 where fewer than two views saw it.
    pub per_texel: Vec<f32>,
    mean: Vec<[f64; 3]>,
    seen_by: Vec<u16>,
}

impl Agreement {
    /// Agreement over base maps of `texel_count` texels. `range` is measured when `None`.
    pub fn of<R: Real>(
        views: &[ViewGradient<R>],
        texel_count: usize,
        range: Option<f64>,
        to_f64: impl Fn(R) -> f64,
    ) -> Self {
        let mut mean = vec![[0.0f64; 3]; texel_count];
        let mut squares = vec![[0.0f64; 3]; texel_count];
        let mut seen_by = vec![0u16; texel_count];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        // Welford's update, so that large equal gradients leave no rounding behind.
        for view in views {
            for (&index, d) in view.index.iter().zip(&view.d_diffuse) {
                let index = index as usize;
                seen_by[index] += 1;
                for channel in 0..3 {
                    let value = to_f64(d[channel]);
                    low = low.min(value);
                    high = high.max(value);
                    let delta = value - mean[index][channel];
                    mean[index][channel] += delta / f64::from(seen_by[index]);
                    squares[index][channel] += delta * (value - mean[index][channel]);
                }
            }
        }
        let range = range.unwrap_or(if high > low { high - low } else { 0.0 });
        let mut per_texel = vec![0.0f32; texel_count];
        let (mut sum, mut shared_texels) = (0.0, 0);
        for index in 0..texel_count {
            if seen_by[index] >= 2 {
                shared_texels += 1;
                if range > 0.0 {
                    let variance = squares[index].iter().sum::<f64>() / 3.0 / f64::from(seen_by[index] - 1);
                    let normalised = 2.0 * variance / (range * range);
                    per_texel[index] = normalised as f32;
                    sum += normalised;
                }
            }
        }
        let value = if shared_texels > 0 { sum / shared_texels as f64 } else { 0.0 };
        Agreement { value, range, shared_texels, per_texel, mean, seen_by }
    }

    /// The direction `v_i` of a view: `grad V` is the sum over views of their Hessian times it. Zero for texels that
    /// no other view saw.
    pub fn direction<R: Real>(&self, view: &ViewGradient<R>, to_f64: impl Fn(R) -> f64) -> Vec<(u32, [f64; 3])> {
        if self.shared_texels == 0 || self.range <= 0.0 {
            return Vec::new();
        }
        let factor = 4.0 / (3.0 * self.shared_texels as f64 * self.range * self.range);
        let mut direction = Vec::new();
        for (&texel, d) in view.index.iter().zip(&view.d_diffuse) {
            let index = texel as usize;
            if self.seen_by[index] >= 2 {
                let share = factor / f64::from(self.seen_by[index] - 1);
                direction.push((texel, std::array::from_fn(|c| share * (to_f64(d[c]) - self.mean[index][c]))));
            }
        }
        direction
    }
}

/// The factor of the authors' released code: `exp(Var(g / |g|))` over the whole stack of gradients, zeros included.
/// With `n` numbers of unit norm the variance is below `1/n`, hence the factor about `1 + 1e-6`.
pub fn released_factor(views: &[ViewGradient<f32>], texel_count: usize) -> f64 {
    let values = || views.iter().flat_map(|view| &view.d_diffuse).flatten().map(|&value| f64::from(value));
    let norm = values().map(|value| value * value).sum::<f64>().sqrt();
    let count = (views.len() * texel_count * 3) as f64;
    if norm == 0.0 || count == 0.0 {
        return 1.0;
    }
    let mean = values().sum::<f64>() / norm / count;
    // Sum of squares of a unit vector is 1.
    (1.0 / count - mean * mean).max(0.0).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    fn random_views(count: usize, texels: usize, seed: u64) -> Vec<ViewGradient<f64>> {
        let mut random = SequentialRandom::new(seed);
        (0..count)
            .map(|_| {
                let mut view = ViewGradient { index: Vec::new(), d_diffuse: Vec::new() };
                for index in 0..texels {
                    if random.next_number() < 0.7 {
                        view.index.push(index as u32);
                        view.d_diffuse.push(std::array::from_fn(|_| {
                            f64::from(random.next_number() - 0.5) * 10f64.powi(random.below(6) as i32 - 3)
                        }));
                    }
                }
                view
            })
            .collect()
    }

    #[test]
    fn the_printed_equation_is_identically_zero_and_ours_is_not() {
        let values = [0.3f64, -0.2, 0.9, 0.1];
        let mean = values.iter().sum::<f64>() / 4.0;
        let printed = values.iter().map(|value| value - mean).sum::<f64>().powi(2) / 3.0;
        assert!(printed < 1e-30);
        let views: Vec<_> =
            values.iter().map(|&value| ViewGradient { index: vec![0], d_diffuse: vec![[value; 3]] }).collect();
        let agreement = Agreement::of(&views, 1, None, |v| v);
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 3.0;
        assert!((agreement.value - 2.0 * variance / (1.1 * 1.1)).abs() < 1e-6);
    }

    #[test]
    fn the_value_lies_between_zero_and_one_and_reaches_both() {
        for seed in 0..200 {
            let views = random_views(2 + (seed % 5) as usize, 20, seed);
            let agreement = Agreement::of(&views, 20, None, |v| v);
            assert!((0.0..=1.0).contains(&agreement.value));
            assert!(agreement.per_texel.iter().all(|value| (0.0..=1.0 + 1e-6).contains(value)));
        }
        let one = |value: f64| ViewGradient { index: vec![0], d_diffuse: vec![[value; 3]] };
        assert_eq!(Agreement::of(&[one(2.0), one(2.0), one(2.0)], 1, None, |v| v).value, 0.0, "views that agree");
        assert!((Agreement::of(&[one(-1.0), one(1.0)], 1, None, |v| v).value - 1.0).abs() < 1e-6, "the worst case");
        assert_eq!(Agreement::of(&[one(5.0)], 1, None, |v| v).value, 0.0, "a texel seen once");
    }

    #[test]
    fn the_direction_is_the_derivative_of_the_value_by_the_gradients() {
        let views = random_views(4, 12, 5);
        let agreement = Agreement::of(&views, 12, None, |v| v);
        for (number, view) in views.iter().enumerate() {
            for (texel, d) in agreement.direction(view, |v| v) {
                let place = view.index.iter().position(|&index| index == texel).unwrap();
                for channel in 0..3 {
                    let moved = |delta: f64| {
                        let mut views = views.clone();
                        views[number].d_diffuse[place][channel] += delta;
                        Agreement::of(&views, 12, Some(agreement.range), |v| v).value
                    };
                    let step = 1e-5 * agreement.range;
                    let difference = (moved(step) - moved(-step)) / (2.0 * step);
                    assert!((difference - d[channel]).abs() < 1e-6 * (1.0 / agreement.range + difference.abs()));
                }
            }
        }
    }

    #[test]
    fn the_released_factor_is_one_plus_next_to_nothing() {
        let views: Vec<ViewGradient<f32>> = (0..5)
            .map(|view| ViewGradient {
                index: (0..4096).collect(),
                d_diffuse: (0..4096).map(|texel| [(texel as f32 + view as f32 * 37.0).sin(); 3]).collect(),
            })
            .collect();
        let factor = released_factor(&views, 4096);
        assert!(factor > 1.0 && factor < 1.0 + 2.0 / (5.0 * 4096.0 * 3.0), "{factor}");
    }
}
