//! What is believed of lobes before looking: kinds of surface.
//!
//! A surface is a dielectric, a metal, or neither: kinds that differ in F0 and in what lies under the lobe. A metal has
//! next to no diffuse reflectance; F0 of all others is grey. Without that knowledge a wide lobe of a high F0 stands in
//! for diffuse reflectance wherever the light is a little wrong, in the complementary colour where it is too much.
//! The logarithm of the width is normal. Kinds that have the same belief of it make a family: one of them holds for any
//! scene, others may come from what the scene has shown elsewhere ([`super::lobe_families`]).

/// Standard deviations from its middle within which a family's widths are looked at.
pub(super) const REACH: f64 = 3.0;

/// What is believed of a kind of surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeKind {
    /// Mean of F0 per channel, standard deviation of what its channels have in common, and of what they do not.
    pub specular: ([f64; 3], f64, f64),
    /// Mean per channel and standard deviation of a group's diffuse reflectance; `None` for the mean of what lies around.
    pub diffuse: (Option<[f64; 3]>, f64),
    /// Share of all surface.
    pub share: f64,
}

/// Kinds of surface whose widths are believed to be alike.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeFamily {
    /// The kinds.
    pub kinds: Vec<LobeKind>,
    /// Mean and standard deviation of the logarithm of the width.
    pub log_width: (f64, f64),
    /// Standard deviations from the mean within which widths are looked at; beyond, another family has to hold.
    pub reach: f64,
}

/// What is believed of lobes before looking.
#[derive(Clone, Debug, PartialEq)]
pub struct LobePrior {
    /// All kinds of surface; their shares sum to 1.
    pub families: Vec<LobeFamily>,
    /// Probability that a group that could be cut shares one lobe.
    pub keep: f64,
}

/// Share of metal among all surface.
const METAL_SHARE: f64 = 0.17;
/// Share of what is neither dielectric nor metal.
const OTHER_SHARE: f64 = 0.03;

impl Default for LobePrior {
    fn default() -> Self {
        LobePrior::of_metal_share(METAL_SHARE)
    }
}

impl LobePrior {
    /// Dielectrics, metals, and what is neither.
    fn of_metal_share(share: f64) -> Self {
        let grey = |value: f64| [value; 3];
        let dielectric =
            LobeKind { specular: (grey(0.05), 0.025, 0.005), diffuse: (None, 0.35), share: 1.0 - OTHER_SHARE - share };
        let metal = LobeKind { specular: (grey(0.55), 0.2, 0.15), diffuse: (Some(grey(0.05)), 0.1), share };
        let other = LobeKind { specular: (grey(0.12), 0.08, 0.01), diffuse: (None, 0.35), share: OTHER_SHARE };
        let any = LobeFamily { kinds: vec![dielectric, metal, other], log_width: (-0.6, 0.5), reach: f64::INFINITY };
        LobePrior { families: vec![any], keep: 0.5 }
    }
}
