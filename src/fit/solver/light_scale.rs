//! The factor that light and reflectances have in common, told by what is no metal.
//!
//! A light that is twice as bright over surface half as reflective makes nearly the same photos, and so does a red light
//! over surface that is less red. The rounds on the light hold a mean reflectance ([`SolverScene::gauge`]), which surface
//! need not have. But common dielectrics have one F0, grey: an index of refraction of 1.5, give or take a tenth. Where lobes
//! are narrow enough to be told from diffuse light, the F0 that was found for them says how much too bright or too coloured
//! the light is.
//!
//! The other thing that tells is that no surface sends back more than it gets. Until the factor is known the descent lets
//! reflectances go beyond 1, since under a light that is held too dim bright surface asks for that, and would else be explained by nothing;
//! then the light is raised until they do not.

use super::scene::{BackgroundPixel, SolverScene};
use super::sight::Lit;
use crate::material::Material;

/// F0 of common dielectrics: that of a refractive index of 1.5.
pub(super) const PLAIN_SPECULAR: f32 = 0.04;
/// Microfacet width below which a lobe counts as told from diffuse light: wider ones look much like it.
const NARROW: f32 = 0.5;
/// F0 from which on a texel speaks for metal.
const METAL: f32 = 0.15;
/// Standard deviation of the logarithm of F0 among dielectrics: indices from 1.4 to 1.6 have .028 to .053.
pub(super) const OF_DIELECTRICS: f64 = 0.2;
/// Standard deviation of the logarithm of a surface's mean reflectance around the one that is held: from 0.27 to 0.91 beside
/// 0.5.
const OF_REFLECTANCE: f64 = 0.6;
/// A smaller share of the surface does not speak for all of it: what else is seen may as well be right as it is.
const MAJORITY: f64 = 0.5;
/// Logarithms of a factor that are less than this are left: no map shows them.
const LEAST: f32 = 0.01;
/// The share of reflectances that the bound of 1 holds for: what few texels show may be explained by nothing.
const BOUNDED_SHARE: f64 = 0.999;
/// Largest diffuse reflectance in the descent while the factor is open.
const MOST_WHILE_OPEN: f32 = 4.0;

/// What is known of the factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightScale {
    /// What the light is to be multiplied by, and reflectances divided, per channel.
    pub factor: [f32; 3],
    /// Standard deviation of the logarithm of the factor.
    pub deviation: f64,
}

impl LightScale {
    /// Nothing changes, by a light that is known.
    pub const NONE: LightScale = LightScale { factor: [1.0; 3], deviation: 0.0 };

    /// What these texels say, of which pixels show some.
    pub fn told_by(texels: &[Material<f32>], shown: &[bool]) -> Self {
        let seen: Vec<&Material<f32>> = texels.iter().zip(shown).filter(|own| *own.1).map(|own| own.0).collect();
        let dielectrics: Vec<&Material<f32>> =
            seen.iter().filter(|own| is_narrow(own) && is_dielectric(own.specular)).copied().collect();
        let share = dielectrics.len() as f64 / seen.len().max(1) as f64;
        let share = if share < MAJORITY { 0.0 } else { share };
        // Told by a part of the surface, the factor of all is known less well.
        let (told, held) = (share / OF_DIELECTRICS.powi(2), OF_REFLECTANCE.powi(-2));
        let quantile_of = |among: &[&Material<f32>], number: &dyn Fn(&Material<f32>) -> f32, share: f64| {
            let mut numbers: Vec<f32> = among.iter().map(|own| number(own)).collect();
            let place = (share * numbers.len().saturating_sub(1) as f64).round() as usize;
            (!numbers.is_empty()).then(|| *numbers.select_nth_unstable_by(place, f32::total_cmp).1)
        };
        let told_factor = [0, 1, 2].map(|c| {
            let middle = quantile_of(&dielectrics, &|own| own.specular[c], 0.5).unwrap_or(PLAIN_SPECULAR);
            let logarithm = f64::from(middle.max(1e-4) / PLAIN_SPECULAR).ln() * told / (told + held);
            logarithm.exp() as f32
        });
        // No surface sends back more than it gets. That says nothing of the colour of the light.
        let most =
            [0, 1, 2].map(|c| quantile_of(&seen, &|own| own.diffuse[c], BOUNDED_SHARE).unwrap_or(0.0) / told_factor[c]);
        let raised = most.into_iter().fold(1.0, f32::max);
        let factor = told_factor.map(|told| told * raised);
        let is_shown = factor.iter().any(|factor: &f32| factor.ln().abs() >= LEAST);
        let factor = if is_shown { factor } else { [1.0; 3] };
        LightScale { factor, deviation: (told + held).powf(-0.5) }
    }

    /// A texel under the light times the factor. Wide lobes of dielectrics, whose F0 hardly any photo tells, stay.
    pub fn under(&self, texel: &Material<f32>) -> Material<f32> {
        let over = |value: [f32; 3]| [0, 1, 2].map(|c| (value[c] / self.factor[c]).min(1.0));
        let specular = if LightScale::changes_specular(texel) { over(texel.specular) } else { texel.specular };
        Material { diffuse: over(texel.diffuse), specular, log_width: texel.log_width }
    }

    /// Whether a texel's F0 goes with the factor: all but wide lobes of dielectrics.
    pub fn changes_specular(texel: &Material<f32>) -> bool {
        is_narrow(texel) || !is_dielectric(texel.specular)
    }

    /// The light times the factor, but for these shares of its texels, which keep their radiance.
    pub fn of_light(&self, light: &[[f32; 3]], kept: &[f32]) -> Vec<[f32; 3]> {
        let scaled = |(radiance, kept): (&[f32; 3], &f32)| {
            [0, 1, 2].map(|c| radiance[c] * (1.0 + (1.0 - kept) * (self.factor[c] - 1.0)))
        };
        light.iter().zip(kept).map(scaled).collect()
    }
}

/// Whether a lobe is told from diffuse light.
fn is_narrow(texel: &Material<f32>) -> bool {
    texel.log_width < NARROW.ln()
}

/// Whether what has this F0 is no metal.
pub(super) fn is_dielectric(specular: [f32; 3]) -> bool {
    specular.iter().sum::<f32>() < 3.0 * METAL
}

impl SolverScene {
    /// Whether the factor is for the photos to tell.
    pub(super) fn is_scale_open(&self) -> bool {
        !self.settings.fixed_light && !self.settings.fixed_maps
    }

    /// Largest diffuse reflectance of a texel: any without a light, 1 where the factor is known.
    pub(super) fn most_diffuse(&self, lit: Lit) -> f32 {
        match lit {
            Lit::No => f32::MAX,
            // What the background shows of the light leaves no factor that could be so large.
            Lit::Yes if self.is_scale_open() && self.background.is_empty() => MOST_WHILE_OPEN,
            Lit::Yes => 1.0,
        }
    }

    /// How far background pixels show each texel of the light as it is, in [0, 1]: less where views see different ones.
    pub(super) fn told_by_background(&self) -> Vec<f32> {
        let trust = |BackgroundPixel { radiance, scatter, .. }: &BackgroundPixel| {
            let radiance = radiance.iter().sum::<f32>().max(0.0) / 3.0;
            if *scatter > 0.0 { radiance / (radiance + scatter) } else { 1.0 }
        };
        self.shown_by_background(trust).into_iter().map(|shown| shown.min(1.0)).collect()
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
    fn surface_that_asks_for_more_than_it_gets_raises_all_channels_of_the_light() {
        let mut texels = surface([0.03; 3], -0.1);
        texels.iter_mut().for_each(|own| own.diffuse[2] = 1.5);
        let told = LightScale::told_by(&texels, &[true; 100]);
        assert_eq!(told.factor, [1.5; 3]);
        let under = told.under(&texels[0]);
        assert_eq!((under.diffuse[2], under.specular), (1.0, [0.03; 3]), "a wide lobe stays");
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
