//! What pixels say of a lobe: sums over them at all widths that are weighed, widths side by side.
//!
//! Sums of a texel, or of a group; those of groups add up. Of a pixel `y = rho e + F0 s` only `s` and `y` change with the
//! width, so that the square of `e` is there once.

use super::cell_sums::System;
use super::lobe_widths::{LOBE_WIDTHS, MOST_NODES, weighed_stencils};
use super::pixel_terms::PixelTerms;
use crate::math::vector::doubles::{DOUBLES, Doubles, versions_of_doubles};

/// Widths go four by four; the last four have one that is not there.
pub(super) const FOURS: usize = LOBE_WIDTHS.div_ceil(DOUBLES);

/// A channel's sums of products at four widths, but for `e e`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FourWidths {
    pub(super) es: Doubles,
    pub(super) ss: Doubles,
    pub(super) ey: Doubles,
    pub(super) sy: Doubles,
    pub(super) yy: Doubles,
}

/// A channel's sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ChannelSums {
    pub(super) ee: f64,
    pub(super) at: [FourWidths; FOURS],
}

/// Sums of a texel, or of a group, per width and channel, in units of the noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LobeSumsOfGroup {
    pub(super) channels: [ChannelSums; 3],
}

/// How integrals at the widths that are weighed follow from those at the nodes, by the first node that is known.
pub(super) struct WidthWeights([[[f32; FOURS * DOUBLES]; MOST_NODES]; MOST_NODES]);

impl WidthWeights {
    pub(super) fn new() -> Self {
        let mut weights = [[[0.0; FOURS * DOUBLES]; MOST_NODES]; MOST_NODES];
        for (weights, stencils) in weights.iter_mut().zip(weighed_stencils()) {
            for (width, stencil) in stencils.iter().enumerate() {
                for (node, weight) in stencil.weights() {
                    weights[node][width] = weight;
                }
            }
        }
        WidthWeights(weights)
    }
}

/// Integrals at all widths of those at the nodes; not below zero, which no integral of a lobe is.
#[inline(always)]
fn at_widths(
    weights: &[[f32; FOURS * DOUBLES]; MOST_NODES],
    nodes: &[[f32; 3]; MOST_NODES],
    c: usize,
) -> [Doubles; FOURS] {
    let mut sums = [0.0f32; FOURS * DOUBLES];
    for (weights, node) in weights.iter().zip(nodes) {
        for (sum, weight) in sums.iter_mut().zip(weights) {
            *sum += weight * node[c];
        }
    }
    let mut made = [Doubles::default(); FOURS];
    for (index, &sum) in sums.iter().enumerate() {
        made[index / DOUBLES].0[index % DOUBLES] = f64::from(if sum > 0.0 { sum } else { 0.0 });
    }
    made
}

#[inline(always)]
fn observe_in(
    sums: &mut LobeSumsOfGroup,
    weight: f64,
    pixel: &PixelTerms,
    (first_node, weights): (usize, &WidthWeights),
    radiance: [f32; 3],
) {
    let weights = &weights.0[first_node];
    for (c, own) in sums.channels.iter_mut().enumerate() {
        let e = f64::from(pixel.arriving[c]);
        own.ee += weight * e * e;
        let (base, grazing) = (at_widths(weights, &pixel.base, c), at_widths(weights, &pixel.grazing, c));
        let (radiance, weight, e) = (Doubles::splat(f64::from(radiance[c])), Doubles::splat(weight), Doubles::splat(e));
        for (own, (s, grazing)) in own.at.iter_mut().zip(base.into_iter().zip(grazing)) {
            let y = radiance - grazing;
            own.es += weight * e * s;
            own.ss += weight * s * s;
            own.ey += weight * e * y;
            own.sy += weight * s * y;
            own.yy += weight * y * y;
        }
    }
}

versions_of_doubles! {
    fn observe(
        sums: &mut LobeSumsOfGroup,
        weight: f64,
        pixel: &PixelTerms,
        widths: (usize, &WidthWeights),
        radiance: [f32; 3],
    ) = observe_in;
}

impl LobeSumsOfGroup {
    /// Adds a pixel that shows this radiance, whose integrals are known from a node on.
    pub(super) fn observe(
        &mut self,
        weight: f64,
        pixel: &PixelTerms,
        widths: (usize, &WidthWeights),
        radiance: [f32; 3],
    ) {
        observe(self, weight, pixel, widths, radiance);
    }

    /// Adds another's.
    pub fn add(&mut self, other: &LobeSumsOfGroup) {
        for (own, other) in self.channels.iter_mut().zip(&other.channels) {
            own.ee += other.ee;
            for (own, other) in own.at.iter_mut().zip(&other.at) {
                own.es += other.es;
                own.ss += other.ss;
                own.ey += other.ey;
                own.sy += other.sy;
                own.yy += other.yy;
            }
        }
    }

    /// Whether no pixel is in it: it says nothing, and adds nothing to others.
    pub fn is_empty(&self) -> bool {
        *self == LobeSumsOfGroup::default()
    }

    /// Sums of `e e` and `e s` in a channel at a width.
    pub(super) fn diffuse(&self, channel: usize, width: usize) -> (f64, f64) {
        let own = &self.channels[channel];
        (own.ee, own.at[width / DOUBLES].es.0[width % DOUBLES])
    }

    /// Those of one texel, once its deviation from its group's diffuse reflectance is eliminated. `ridge` is the inverse
    /// variance of that deviation; `worse` is added to the cost of each width.
    pub(super) fn without_deviation(&self, ridge: f64, worse: &[f64; LOBE_WIDTHS]) -> Self {
        let mut made = self.clone();
        for own in &mut made.channels {
            for width in 0..LOBE_WIDTHS {
                let (at, k) = (&mut own.at[width / DOUBLES], width % DOUBLES);
                let sums = System {
                    ee: own.ee,
                    es: at.es.0[k],
                    ss: at.ss.0[k],
                    ey: at.ey.0[k],
                    sy: at.sy.0[k],
                    yy: at.yy.0[k],
                };
                let System { es, ss, ey, sy, yy, .. } = sums.without_deviation(ridge);
                (at.es.0[k], at.ss.0[k], at.ey.0[k], at.sy.0[k]) = (es, ss, ey, sy);
                at.yy.0[k] = yy + worse[width] / 3.0;
            }
            own.ee *= ridge / (ridge + own.ee);
        }
        made
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Of systems that have the same `ee` at all widths.
    pub fn of_systems(systems: &[[System; 3]; LOBE_WIDTHS]) -> LobeSumsOfGroup {
        let mut made = LobeSumsOfGroup::default();
        for (width, systems) in systems.iter().enumerate() {
            for (own, system) in made.channels.iter_mut().zip(systems) {
                let (at, k) = (&mut own.at[width / DOUBLES], width % DOUBLES);
                own.ee = system.ee;
                (at.es.0[k], at.ss.0[k], at.ey.0[k]) = (system.es, system.ss, system.ey);
                (at.sy.0[k], at.yy.0[k]) = (system.sy, system.yy);
            }
        }
        made
    }

    #[test]
    fn pixels_add_up_as_in_systems_one_by_one_in_all_versions() {
        let (weights, stencils) = (WidthWeights::new(), weighed_stencils());
        let mut random = SequentialRandom::new(6);
        let mut number = || random.next_number();
        let mut systems = [[System::default(); 3]; LOBE_WIDTHS];
        let (mut sums, mut plain) = (LobeSumsOfGroup::default(), LobeSumsOfGroup::default());
        assert!(sums.is_empty());
        for index in 0..40 {
            let first = index % MOST_NODES;
            let mut pixel = PixelTerms { arriving: [(); 3].map(|()| number()), ..PixelTerms::default() };
            for node in first..MOST_NODES {
                (pixel.base[node], pixel.grazing[node]) =
                    ([(); 3].map(|()| number()), [(); 3].map(|()| 0.1 * number()));
            }
            let (weight, radiance) = (f64::from(number()), [(); 3].map(|()| number()));
            sums.observe(weight, &pixel, (first, &weights), radiance);
            observe_in(&mut plain, weight, &pixel, (first, &weights), radiance);
            for (systems, stencil) in systems.iter_mut().zip(&stencils[first]) {
                for (c, system) in systems.iter_mut().enumerate() {
                    let y = f64::from(radiance[c]) - f64::from(stencil.of(&pixel.grazing, c));
                    let (e, s) = (f64::from(pixel.arriving[c]), f64::from(stencil.of(&pixel.base, c)));
                    system.observe(weight, e, s, y);
                }
            }
        }
        assert_eq!(sums, plain);
        assert!(!sums.is_empty());
        let near = |sums: &LobeSumsOfGroup, systems: &[[System; 3]; LOBE_WIDTHS]| {
            let expected = of_systems(systems);
            for (own, expected) in sums.channels.iter().zip(&expected.channels) {
                assert!((own.ee - expected.ee).abs() < 1e-9, "{own:?} {expected:?}");
                for width in 0..LOBE_WIDTHS {
                    let of = |at: &FourWidths| [at.es, at.ss, at.ey, at.sy, at.yy].map(|sum| sum.0[width % DOUBLES]);
                    let (own, expected) = (of(&own.at[width / DOUBLES]), of(&expected.at[width / DOUBLES]));
                    assert!((0..5).all(|k| (own[k] - expected[k]).abs() < 1e-5), "{width}: {own:?} {expected:?}");
                }
            }
        };
        near(&sums, &systems);
        let worse: [f64; LOBE_WIDTHS] = std::array::from_fn(|width| 0.3 * width as f64);
        let mut eliminated = systems.map(|systems| systems.map(|system| system.without_deviation(7.0)));
        for (systems, worse) in eliminated.iter_mut().zip(worse) {
            systems.iter_mut().for_each(|system| system.yy += worse / 3.0);
        }
        near(&sums.without_deviation(7.0, &worse), &eliminated);
        for width in [0, LOBE_WIDTHS - 1] {
            let (ee, es) = sums.diffuse(1, width);
            assert!((ee - systems[width][1].ee).abs() < 1e-9 && (es - systems[width][1].es).abs() < 1e-5);
        }
    }
}
