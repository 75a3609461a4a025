//! The models behind published fits, evaluated. Each is its specular part alone.
//!
//! Their authors disagree about constants: what is written here is the form in which the published numbers describe the
//! measurements, told by the independent neural fits (see the test of this folder).

use crate::measured::coordinates::HalfDifference;
use crate::measured::grid;
use std::f64::consts::PI;

/// A model with its parameters, channel by channel where they differ.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Formula {
    /// Ngan: Beckmann normalised over `pi`, V-grooves, Schlick.
    NganCookTorrance { albedo: [f64; 3], normal_reflectance: f64, roughness: f64 },
    /// Ward 1992, over the root of both cosines.
    NganWard { albedo: [f64; 3], roughness: f64 },
    /// Duer 2006, over both cosines.
    NganWardDuer { albedo: [f64; 3], roughness: f64 },
    /// Blinn: a power of the half vector's cosine.
    NganBlinnPhong { albedo: [f64; 3], sharpness: f64 },
    /// Lafortune with one lobe, normalised.
    NganLafortune { albedo: [f64; 3], across: f64, along: f64, sharpness: f64 },
    /// Ashikhmin and Shirley 2000 with Schlick's (Ngan) or the exact Fresnel factor (Low).
    AshikhminShirley { albedo: [f64; 3], fresnel: f64, sharpness: f64, is_exact: bool },
    /// He 1991: read, not evaluated.
    He,
    /// Low: Cook and Torrance 1982 as printed, exact Fresnel factor.
    LowCookTorrance { albedo: [f64; 3], roughness: f64, index: f64 },
    /// Low: the ABC model of microfacets.
    LowMicrofacet { a: [f64; 3], b: f64, c: f64, index: f64 },
    /// Low: the ABC model of smooth surfaces.
    LowSmooth { a: [f64; 3], b: f64, c: f64, index: f64 },
    /// Bagher: shifted gamma distribution, a channel at a time.
    Bagher(Box<[BagherChannel; 3]>),
}

/// Parameters of one channel of Bagher's model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BagherChannel {
    albedo: f64,
    alpha: f64,
    p: f64,
    fresnel: [f64; 2],
    scale: f64,
    lambda: f64,
    c: f64,
    k: f64,
    theta: f64,
}

type Numbers<'a> = &'a dyn Fn(&str, usize) -> Result<Vec<f64>, String>;

impl Formula {
    /// The model of a name, its parameters taken by key and count.
    pub(super) fn of(name: &str, numbers: Numbers<'_>) -> Result<Self, String> {
        let colour = |key: &str| numbers(key, 3).map(|n| [n[0], n[1], n[2]]);
        let one = |key: &str| numbers(key, 1).map(|n| n[0]);
        let at_least = |key: &str, low: f64| {
            one(key).and_then(|x| if x > low { Ok(x) } else { Err(format!("`{key}` must be above {low}")) })
        };
        Ok(match name {
            "NganCookTorrance" => Formula::NganCookTorrance {
                albedo: colour("albedo")?,
                normal_reflectance: one("eta")?,
                roughness: at_least("roughness", 0.0)?,
            },
            "NganWard" => Formula::NganWard { albedo: colour("albedo")?, roughness: at_least("roughness", 0.0)? },
            "NganWardDuer" => {
                Formula::NganWardDuer { albedo: colour("albedo")?, roughness: at_least("roughness", 0.0)? }
            }
            "NganBlinnPhong" => Formula::NganBlinnPhong { albedo: colour("albedo")?, sharpness: one("sharpness")? },
            "NganLafortune" => Formula::NganLafortune {
                albedo: colour("albedo")?,
                across: one("Cxy")?,
                along: one("Cz")?,
                sharpness: one("sharpness")?,
            },
            "NganAshikhminShirley" | "LowAshikhminShirley" => Formula::AshikhminShirley {
                albedo: colour("albedo")?,
                fresnel: one("fresnelReflectance")?,
                sharpness: one("sharpness")?,
                is_exact: name.starts_with("Low"),
            },
            "NganHe" => Formula::He,
            "LowCookTorrance" => Formula::LowCookTorrance {
                albedo: colour("albedo")?,
                roughness: at_least("roughness", 0.0)?,
                index: at_least("eta", 0.0)?,
            },
            "LowMicrofacetFit" => {
                Formula::LowMicrofacet { a: colour("A")?, b: one("B")?, c: one("C")?, index: at_least("eta", 0.0)? }
            }
            "LowSmooth" => {
                Formula::LowSmooth { a: colour("A")?, b: one("B")?, c: one("C")?, index: at_least("eta", 0.0)? }
            }
            "Bagher" => {
                let (albedo, alpha, p) = (colour("albedo")?, colour("alpha")?, colour("p")?);
                let fresnel = numbers("eta", 6)?;
                let (scale, lambda) = (colour("K")?, colour("Lambda")?);
                let (c, k, theta) = (colour("c")?, colour("k")?, colour("theta0")?);
                Formula::Bagher(Box::new(std::array::from_fn(|i| BagherChannel {
                    albedo: albedo[i],
                    alpha: alpha[i],
                    p: p[i],
                    fresnel: [fresnel[i], fresnel[3 + i]],
                    scale: scale[i],
                    lambda: lambda[i],
                    c: c[i],
                    k: k[i],
                    theta: theta[i],
                })))
            }
            _ => return Err(format!("no model is called {name}")),
        })
    }

    /// The specular part in 1/sr: 0 below the horizon; `None` for the model of He.
    pub(super) fn value(&self, at: HalfDifference) -> Option<[f64; 3]> {
        if !grid::is_above_horizon(at) {
            return Some([0.0; 3]);
        }
        let [cos_in, cos_out] = grid::cosines(at);
        let (cos_half, cos_difference) = (at.theta_half.cos().max(1e-9), at.theta_difference.cos().max(1e-9));
        let tan_squared = at.theta_half.tan().powi(2);
        let groove = 2.0 * cos_half / cos_difference;
        let shadowed = (1.0 / (cos_in * cos_out)).min(groove / cos_in).min(groove / cos_out);
        let beckmann = |m: f64| (-tan_squared / (m * m)).exp() / (m * m * cos_half.powi(4));
        let scaled = |colour: &[f64; 3], factor: f64| Some(colour.map(|value| value * factor));
        match self {
            Formula::NganCookTorrance { albedo, normal_reflectance, roughness } => {
                let fresnel = schlick(*normal_reflectance, cos_difference);
                scaled(albedo, beckmann(*roughness) / PI * fresnel * shadowed / PI)
            }
            Formula::NganWard { albedo, roughness } => {
                let lobe = (-tan_squared / (roughness * roughness)).exp() / (4.0 * PI * roughness * roughness);
                scaled(albedo, lobe / (cos_in * cos_out).sqrt())
            }
            Formula::NganWardDuer { albedo, roughness } => {
                let lobe = (-tan_squared / (roughness * roughness)).exp() / (4.0 * PI * roughness * roughness);
                scaled(albedo, lobe / (cos_in * cos_out))
            }
            Formula::NganBlinnPhong { albedo, sharpness } => {
                scaled(albedo, (sharpness + 2.0) / (2.0 * PI) * cos_half.powf(*sharpness))
            }
            Formula::NganLafortune { albedo, across, along, sharpness } => {
                let (light, eye) = at.directions();
                let dot = across * (light.x * eye.x + light.y * eye.y) + along * light.z * eye.z;
                let largest = across.abs().max(along.abs()).max(1e-9);
                scaled(albedo, (sharpness + 2.0) / (2.0 * PI) * (dot.max(0.0) / largest).powf(*sharpness))
            }
            Formula::AshikhminShirley { albedo, fresnel, sharpness, is_exact } => {
                let fresnel = match is_exact {
                    true => dielectric(*fresnel, cos_difference),
                    false => schlick(*fresnel, cos_difference),
                };
                let lobe = (sharpness + 1.0) / (8.0 * PI) * cos_half.powf(*sharpness);
                scaled(albedo, lobe * fresnel / (cos_difference * cos_in.max(cos_out)))
            }
            Formula::He => None,
            Formula::LowCookTorrance { albedo, roughness, index } => {
                scaled(albedo, beckmann(*roughness) / PI * dielectric(*index, cos_difference) * shadowed)
            }
            Formula::LowMicrofacet { a, b, c, index } => {
                let lobe = (1.0 + b * 2.0 * (0.5 * at.theta_half).sin().powi(2)).powf(-c);
                scaled(a, lobe * dielectric(*index, cos_difference) * shadowed / PI)
            }
            Formula::LowSmooth { a, b, c, index } => {
                let (light, eye) = at.directions();
                let (sum, difference) = (light + eye, light - eye);
                let spread = sum.x * sum.x + sum.y * sum.y;
                let apart = difference.x * difference.x + difference.y * difference.y;
                let lobe = (1.0 + b * spread).powf(-c);
                scaled(a, lobe * dielectric(*index, (1.0 - 0.25 * apart).max(0.0).sqrt()))
            }
            Formula::Bagher(channels) => Some(channels.each_ref().map(|channel| {
                let x = channel.alpha + tan_squared / channel.alpha;
                let distribution = channel.scale * (-x).exp() / (x.powf(channel.p) * PI * cos_half.powi(4));
                let fresnel = schlick(channel.fresnel[0], cos_difference) - channel.fresnel[1] * cos_difference;
                let seen = channel.seen(cos_in) * channel.seen(cos_out);
                channel.albedo * distribution * fresnel * seen / (PI * cos_in * cos_out)
            })),
        }
    }
}

impl BagherChannel {
    /// Shadowing of one direction (Bagher 2012, eq. 15), at least 0.
    fn seen(&self, cosine: f64) -> f64 {
        let beyond = cosine.clamp(0.0, 1.0).acos() - self.theta;
        if beyond <= 0.0 { 1.0 } else { (1.0 - self.lambda * (self.c * beyond.powf(self.k)).exp_m1()).max(0.0) }
    }
}

/// Schlick's approximation of the Fresnel factor.
fn schlick(normal: f64, cosine: f64) -> f64 {
    normal + (1.0 - normal) * (1.0 - cosine).powi(5)
}

/// The Fresnel factor of unpolarised light (Cook and Torrance 1982); 1 beyond the critical angle.
fn dielectric(index: f64, cosine: f64) -> f64 {
    let squared = index * index + cosine * cosine - 1.0;
    if !(squared >= 0.0) {
        return 1.0;
    }
    let g = squared.sqrt();
    let parallel = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    let ratio = (g - cosine) / (g + cosine);
    0.5 * ratio * ratio * (1.0 + parallel * parallel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fresnel_factors_are_right_at_both_ends() {
        // An index of 1.5 reflects ((1.5 - 1) / (1.5 + 1))^2 = 4 % at normal incidence, all at grazing.
        assert!((dielectric(1.5, 1.0) - 0.04).abs() < 1e-12 && (dielectric(1.5, 0.0) - 1.0).abs() < 1e-12);
        assert!((schlick(0.04, 1.0) - 0.04).abs() < 1e-12 && (schlick(0.04, 0.0) - 1.0).abs() < 1e-12);
        assert_eq!(dielectric(0.5, 0.1), 1.0);
    }
}
