//! The factor that light and reflectances have in common, told by what is no metal.
//!
//! A light that is twice as bright over surface half as reflective makes nearly the same photos, and so does a red light
//! over surface that is less red. The rounds on the light hold a mean reflectance ([`SolverScene::gauge`]), which surface
//! need not have. But common dielectrics have one F0, grey: an index of refraction of 1.5, give or take a tenth. Where lobes
//! are narrow enough to be told from diffuse light, the F0 that was found for them says how much too bright or too coloured
//! the light is.

use super::estimate::PLAIN_SPECULAR;
use super::scene::{BackgroundPixel, SolverScene};
use crate::material::Material;
use crate::math::statistics::quantile;

/// Microfacet width below which a lobe counts as told from diffuse light: wider ones look much like it.
const NARROW: f32 = 0.5;
/// F0 from which on a texel speaks for metal.
const METAL: f32 = 0.15;
/// Standard deviation of the logarithm of F0 among dielectrics: indices from 1.4 to 1.6 have .028 to .053.
const OF_DIELECTRICS: f64 = 0.2;
/// Standard deviation of the logarithm of a surface's mean reflectance around the one that is held: from 0.27 to 0.91 beside
/// 0.5.
const OF_REFLECTANCE: f64 = 0.6;
/// A smaller share of the surface does not speak for all of it: what else is seen may as well be right as it is.
const MAJORITY: f64 = 0.5;
/// Logarithms of a factor that are less than this are left: no map shows them.
const LEAST: f32 = 0.01;
/// The share of reflectances that the bound of 1 holds for.
const BOUNDED_SHARE: f64 = 0.99;

/// What is known of the factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightScale {
    /// What the light is to be multiplied by, and reflectances divided, per channel.
    pub factor: [f32; 3],
    /// Standard deviation of the logarithm of the factor.
    pub deviation: f64,
}

impl LightScale {
    /// What these texels say, of which pixels show some.
    pub fn told_by(texels: &[Material<f32>], shown: &[bool]) -> Self {
        let seen: Vec<&Material<f32>> = texels.iter().zip(shown).filter(|own| *own.1).map(|own| own.0).collect();
        let is_dielectric =
            |own: &&&Material<f32>| own.log_width < NARROW.ln() && own.specular.iter().sum::<f32>() < 3.0 * METAL;
        let dielectrics: Vec<&Material<f32>> = seen.iter().filter(is_dielectric).copied().collect();
        let share = dielectrics.len() as f64 / seen.len().max(1) as f64;
        let share = if share < MAJORITY { 0.0 } else { share };
        // Told by a part of the surface, the factor of all is known less well.
        let (told, held) = (share / OF_DIELECTRICS.powi(2), OF_REFLECTANCE.powi(-2));
        let factor = [0, 1, 2].map(|c| {
            let of = |number: &dyn Fn(&Material<f32>) -> f32, among: &[&Material<f32>], share: f64| {
                let numbers: Vec<f64> = among.iter().map(|own| f64::from(number(own))).collect();
                if numbers.is_empty() { None } else { Some(quantile(&numbers, share)) }
            };
            let middle = of(&|own| own.specular[c], &dielectrics, 0.5).unwrap_or(f64::from(PLAIN_SPECULAR));
            let logarithm = (middle.max(1e-4) / f64::from(PLAIN_SPECULAR)).ln() * told / (told + held);
            // No surface sends back more than it gets.
            let least = of(&|own| own.diffuse[c], &seen, BOUNDED_SHARE).unwrap_or(0.0);
            logarithm.exp().max(least) as f32
        });
        let is_shown = factor.iter().any(|factor: &f32| factor.ln().abs() >= LEAST);
        let factor = if is_shown { factor } else { [1.0; 3] };
        LightScale { factor, deviation: (told + held).powf(-0.5) }
    }

    /// A texel under the light times the factor.
    pub fn under(&self, texel: &Material<f32>) -> Material<f32> {
        let over = |value: [f32; 3]| [0, 1, 2].map(|c| (value[c] / self.factor[c]).min(1.0));
        Material { diffuse: over(texel.diffuse), specular: over(texel.specular), log_width: texel.log_width }
    }

    /// The light times the factor, but for these shares of its texels, which keep their radiance.
    pub fn of_light(&self, light: &[[f32; 3]], kept: &[f32]) -> Vec<[f32; 3]> {
        let scaled = |(radiance, kept): (&[f32; 3], &f32)| {
            [0, 1, 2].map(|c| radiance[c] * (1.0 + (1.0 - kept) * (self.factor[c] - 1.0)))
        };
        light.iter().zip(kept).map(scaled).collect()
    }
}

impl SolverScene {
    /// Whether the factor is for the photos to tell.
    pub(super) fn is_scale_open(&self) -> bool {
        !self.settings.fixed_light && !self.settings.fixed_maps
    }

    /// How far background pixels show each texel of the light as it is, in [0, 1]: less where views see different ones.
    pub(super) fn shown_by_background(&self) -> Vec<f32> {
        let mut shown = vec![0.0f32; self.transport.basis.count()];
        for BackgroundPixel { tap, radiance, scatter, .. } in &self.background {
            let radiance = radiance.iter().sum::<f32>().max(0.0) / 3.0;
            let trust = if *scatter > 0.0 { radiance / (radiance + scatter) } else { 1.0 };
            for (&texel, weight) in tap.index.iter().zip(tap.weight) {
                shown[texel as usize] += trust * weight;
            }
        }
        shown.into_iter().map(|shown| shown.min(1.0)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(specular: [f32; 3], log_width: f32) -> Vec<Material<f32>> {
        vec![Material { diffuse: [0.2, 0.3, 0.4], specular, log_width }; 100]
    }

    #[test]
    fn gloss_tells_the_factor_and_its_colour() {
        let texels = surface([0.02, 0.03, 0.05], -2.0);
        let told = LightScale::told_by(&texels, &[true; 100]);
        for c in 0..3 {
            let whole = (texels[0].specular[c] / PLAIN_SPECULAR).ln();
            let own = told.factor[c].ln();
            assert!((own / whole - 0.9).abs() < 0.01, "{own} of {whole}");
        }
        assert!((0.15..0.2).contains(&told.deviation), "{told:?}");
        let under = told.under(&texels[0]);
        let light = told.of_light(&[[1.0, 2.0, 3.0], [1.0; 3]], &[0.0, 1.0]);
        assert_eq!(light[1], [1.0; 3], "the background shows it");
        for c in 0..3 {
            assert!((under.diffuse[c] * light[0][c] - texels[0].diffuse[c] * (c + 1) as f32).abs() < 1e-6);
        }
    }

    #[test]
    fn mats_metals_and_what_is_not_seen_leave_it() {
        for texels in [surface([0.02; 3], -0.1), surface([0.5; 3], -2.0), Vec::new()] {
            let told = LightScale::told_by(&texels, &vec![true; texels.len()]);
            assert_eq!(told.factor, [1.0; 3]);
            assert!(told.deviation > 0.5);
        }
        let told = LightScale::told_by(&surface([0.02; 3], -2.0), &[false; 100]);
        assert_eq!(told.factor, [1.0; 3]);
    }

    #[test]
    fn no_reflectance_grows_beyond_one() {
        let mut texels = surface([0.02; 3], -2.0);
        texels.iter_mut().for_each(|own| own.diffuse = [0.9; 3]);
        let told = LightScale::told_by(&texels, &[true; 100]);
        assert_eq!(told.under(&texels[0]).diffuse, [1.0; 3]);
        assert_eq!(told.factor, [0.9; 3]);
    }
}
