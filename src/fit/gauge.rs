//! The freedom that photographs leave: reflectance times c, light over c, per channel.
//!
//! For a Lambert surface every photo stays the same; Schlick's rise to one at grazing angles, interreflection, the
//! bounds of reflectance and a visible background each break the freedom a little or wholly. The rule that fixed it is
//! named in every report, and scores are given raw and scale-aligned.

use super::settings::{BackgroundEvidence, Method};
use crate::render::Parameters;
use crate::scene::Background;
use glam::Vec3;

/// What fixed the scale between reflectance and light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GaugeRule {
    /// Background pixels show the light itself.
    Background,
    /// The light was known.
    FixedLight,
    /// The maps were known.
    FixedMaps,
    /// The start: mean reflectance 0.5 in the mean light that explains the photographs.
    Start,
    /// The start, and F0 of what is no metal where highlights are narrow: 0.04 and grey (Lee 1986). No reflectance beyond 1.
    StartAndHighlights,
}

impl GaugeRule {
    /// The rule that holds for a fit.
    pub fn of(background: Background, evidence: BackgroundEvidence, fixed_light: bool, method: Method) -> Self {
        match (fixed_light, background, evidence, method) {
            (true, _, _, _) => GaugeRule::FixedLight,
            (false, Background::Environment, BackgroundEvidence::Use, _) => GaugeRule::Background,
            (_, _, _, Method::Solver) => GaugeRule::StartAndHighlights,
            _ => GaugeRule::Start,
        }
    }

    /// One sentence for the report.
    pub fn sentence(self) -> &'static str {
        match self {
            GaugeRule::Background => {
                "Background pixels show the light directly and so fix the scale between reflectance and light."
            }
            GaugeRule::FixedLight => "The light was given, so the scale of reflectance is fixed.",
            GaugeRule::FixedMaps => {
                "The maps were given, so the scale of the light is fixed: an error that all reflectances have in common is \
                 one of the light, too."
            }
            GaugeRule::Start => {
                "Nothing in the photographs fixes the scale between diffuse reflectance and light; it stays near the \
                 start, a mean reflectance of 0.5. Read the scale-aligned scores."
            }
            GaugeRule::StartAndHighlights => {
                "Diffuse surface does not tell how bright the light is that it is seen under. The scale between reflectance and \
                 light, and the light's colour, are those under which what is no metal has the F0 of common dielectrics, \
                 0.04 and grey, if most of the surface shows narrow highlights; else they stay near the start, a mean \
                 reflectance of 0.5, unless bright surface would have to send back more than it gets. Read the \
                 scale-aligned scores."
            }
        }
    }
}

/// Moves along the freedom: both reflectances times `scale`, light over it. Pictures of diffuse surfaces stay the same
/// as long as no reflectance meets its bound of 1; returns the share of texel channels that did.
pub fn move_scale(parameters: &mut Parameters<f32>, scale: Vec3) -> f64 {
    let scale = scale.to_array();
    let mut bounded = 0usize;
    let mut total = 0usize;
    for level in &mut parameters.texels.levels {
        for texel in &mut level.texels {
            for channel in 0..3 {
                for value in [&mut texel.diffuse[channel], &mut texel.specular[channel]] {
                    let moved = *value * scale[channel];
                    bounded += usize::from(moved > 1.0);
                    total += 1;
                    *value = moved.clamp(0.0, 1.0);
                }
            }
        }
    }
    for radiance in &mut parameters.light {
        for channel in 0..3 {
            radiance[channel] /= scale[channel];
        }
    }
    bounded as f64 / total.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_that_is_named_is_that_of_the_method() {
        let open = |method| GaugeRule::of(Background::Black, BackgroundEvidence::Use, false, method);
        assert_eq!((open(Method::Solver), open(Method::Adam)), (GaugeRule::StartAndHighlights, GaugeRule::Start));
        for method in [Method::Solver, Method::Adam] {
            let seen = |evidence| GaugeRule::of(Background::Environment, evidence, false, method);
            assert_eq!(seen(BackgroundEvidence::Use), GaugeRule::Background);
            assert_eq!(seen(BackgroundEvidence::Ignore), open(method));
            let known = GaugeRule::of(Background::Environment, BackgroundEvidence::Use, true, method);
            assert_eq!(known, GaugeRule::FixedLight);
        }
    }
}
