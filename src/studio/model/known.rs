//! What the solver tells of the texels, ready to be shown as layers of the stage and as maps, and why there may be nothing.

use super::Model;
use crate::fit::Method;
use crate::image::{GreyImage, Image};
use crate::job::SolverTold;
use glam::Vec3;
use std::sync::{Arc, OnceLock};

/// Numbers that are looked at, at most, to find the upper end of a colour scale.
const LOOKED_AT: usize = 60_000;

/// What is told of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// Standard deviation of the diffuse reflectance, mean of the channels.
    Diffuse,
    /// The same of the specular reflectance F0.
    Specular,
    /// The same of the roughness, in the units of its map.
    Roughness,
    /// Number of texels that share the texel's lobe.
    LobeSharing,
    /// What judging views chose: 1 no lobe, 2 one lobe a region, 3 lobes of their own.
    Choice,
}

impl Told {
    /// All of them.
    pub const ALL: [Told; 5] = [Told::Diffuse, Told::Specular, Told::Roughness, Told::LobeSharing, Told::Choice];
}

/// One number a texel, and the colour scale for it.
#[derive(Clone, Debug)]
pub struct ToldLayer {
    /// The numbers; NaN where no pixel told of the texel and it took over what its neighbours have.
    pub texels: Arc<GreyImage>,
    /// The same for a scale of equal differences: counts by their logarithm to base 2.
    pub even: Arc<GreyImage>,
    /// Numbers at the two ends of the colour scale.
    pub range: [f32; 2],
}

impl ToldLayer {
    /// Whether its colour scale goes by equal factors, as that of counts.
    pub fn is_by_factors(&self) -> bool {
        !Arc::ptr_eq(&self.texels, &self.even)
    }
}

/// What a run of the solver knows of its own maps and light. Layers are made when they are first asked for.
#[derive(Default)]
pub struct Known {
    told: SolverTold,
    layers: [OnceLock<Option<ToldLayer>>; 5],
}

impl Known {
    /// Of what a fit or a run folder told.
    pub fn of(told: SolverTold) -> Self {
        Known { told, layers: Default::default() }
    }

    /// What was told.
    pub fn told(&self) -> &SolverTold {
        &self.told
    }

    /// Whether there is such a layer.
    pub fn has(&self, what: Told) -> bool {
        match what {
            Told::LobeSharing => self.told.lobe_sharing.is_some(),
            Told::Choice => self.told.choice_map.is_some(),
            _ => self.told.deviations.is_some(),
        }
    }

    /// A layer; `None` where nothing is known.
    pub fn layer(&self, what: Told) -> Option<&ToldLayer> {
        self.layers[what as usize].get_or_init(|| self.make(what)).as_ref()
    }

    fn make(&self, what: Told) -> Option<ToldLayer> {
        let sharing = self.told.lobe_sharing.as_deref();
        let mean = |image: &Image<Vec3>| image.map(|value| value.element_sum() / 3.0);
        let mut texels = match what {
            Told::LobeSharing => sharing?.clone(),
            // Where nobody judges, nothing is known.
            Told::Choice => self.told.choice_map.as_ref()?.map(|&code| if code > 0.0 { code } else { f32::NAN }),
            Told::Diffuse => mean(&self.told.deviations.as_ref()?.diffuse),
            Told::Specular => mean(&self.told.deviations.as_ref()?.specular),
            Told::Roughness => self.told.deviations.as_ref()?.roughness.clone(),
        };
        // A texel without a lobe of its own has no uncertainty of its own either.
        if let Some(sharing) = sharing.filter(|sharing| sharing.pixels().len() == texels.pixels().len()) {
            for (value, count) in texels.pixels_mut().iter_mut().zip(sharing.pixels()) {
                if !(*count > 0.0) {
                    *value = f32::NAN;
                }
            }
        }
        let high = high_end(&texels);
        if what == Told::LobeSharing {
            let even = Arc::new(texels.map(|count| count.log2()));
            return Some(ToldLayer { texels: Arc::new(texels), even, range: [1.0, high.max(2.0)] });
        }
        let texels = Arc::new(texels);
        if what == Told::Choice {
            return Some(ToldLayer { even: Arc::clone(&texels), texels, range: [1.0, 3.0] });
        }
        Some(ToldLayer { even: Arc::clone(&texels), texels, range: [0.0, high] })
    }
}

/// The number that all but two in a hundred stay below; 1 without any above zero.
fn high_end(texels: &GreyImage) -> f32 {
    let every = (texels.pixels().len() / LOOKED_AT).max(1);
    let values: Vec<f64> = texels
        .pixels()
        .iter()
        .step_by(every)
        .filter(|value| value.is_finite())
        .map(|&value| f64::from(value))
        .collect();
    let high = crate::math::statistics::quantile(&values, 0.98) as f32;
    if high > 0.0 { high } else { 1.0 }
}

impl Model {
    /// Why nothing is told of the texels, as a sentence without a full stop.
    pub fn why_untold(&self) -> &'static str {
        match self.method_of_maps() {
            Some(Method::Solver) => "Available when the solver has made its maps, at the end of the fit",
            Some(_) => "Not available with Adam: choose the method Solver and fit again",
            None => "Available at the end of a fit with the method Solver",
        }
    }

    /// Why it is not told what the light is known by, as a sentence without a full stop.
    pub fn why_light_is_untold(&self) -> &'static str {
        match self.method_of_maps() {
            Some(Method::Solver) => {
                "Available after the first iteration on the environment; not after a resume past those iterations"
            }
            Some(_) => "Not available with Adam: choose the method Solver and fit again",
            None => "Available with the method Solver",
        }
    }

    /// The method that made the maps that are shown.
    fn method_of_maps(&self) -> Option<Method> {
        let project = self.project.as_ref().filter(|project| project.maps.is_some())?;
        let in_force = self.fit.settings_in_force.as_ref();
        Some(in_force.map_or(project.settings.fit.method, |settings| settings.method))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::MaterialMaps;

    #[test]
    fn texels_without_a_lobe_are_unknown_and_counts_are_spread_by_factors() {
        let deviations = MaterialMaps {
            diffuse: Image::from_fn(4, 1, |_, column| Vec3::new(0.1, 0.2, 0.3) * column as f32),
            specular: Image::filled(4, 1, Vec3::splat(0.5)),
            roughness: Image::filled(4, 1, 0.25),
        };
        let sharing = Image::from_pixels(4, 1, vec![0.0, 1.0, 8.0, 64.0]);
        let told = SolverTold {
            deviations: Some(Arc::new(deviations)),
            lobe_sharing: Some(Arc::new(sharing)),
            choice_map: Some(Arc::new(Image::from_pixels(4, 1, vec![0.0, 1.0, 2.0, 3.0]))),
            ..SolverTold::default()
        };
        let known = Known::of(told);
        let diffuse = known.layer(Told::Diffuse).unwrap();
        assert!(diffuse.texels.pixels()[0].is_nan());
        assert!((diffuse.texels.pixels()[3] - 0.6).abs() < 1e-6);
        assert!(diffuse.range[0] == 0.0 && (0.39..=0.6).contains(&diffuse.range[1]), "{:?}", diffuse.range);
        let sharing = known.layer(Told::LobeSharing).unwrap();
        assert_eq!(sharing.texels.pixels()[1..], [1.0, 8.0, 64.0]);
        assert_eq!(sharing.even.pixels()[1..], [0.0, 3.0, 6.0]);
        assert!(known.has(Told::Roughness) && known.layer(Told::Roughness).unwrap().range == [0.0, 0.25]);
        let choice = known.layer(Told::Choice).unwrap();
        assert!(choice.texels.pixels()[0].is_nan() && choice.texels.pixels()[1..] == [1.0, 2.0, 3.0]);
        assert!(choice.range == [1.0, 3.0] && !choice.is_by_factors());
        let nothing = Known::default();
        assert!(Told::ALL.iter().all(|&what| !nothing.has(what) && nothing.layer(what).is_none()));
    }
}
