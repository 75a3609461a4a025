//! Kinds of surface that a scene has shown: what rough metal at one place tells of a piece of it elsewhere.
//!
//! Lobes are shared inside tiles, by what lies together ([`super::lobe_tree`]). A material lies in many tiles and charts,
//! and in some of them few bright pixels see it: there what holds for any scene decides, and a rough metal is taken for a
//! dielectric of its colour. Once maps exist (on the coarser level), texels whose lobes are well known are put
//! together by F0 and width, and each cluster that covers enough of the surface becomes a family of its own beside the one
//! for any scene, with the diffuse reflectance that its texels have (empirical Bayes: Efron and Morris 1973).
//!
//! That uses what a texel's own pixels say twice, once in the cluster. So clusters are wide, and families of what any scene
//! has keep half of what is believed.

use super::estimate::{Estimate, TexelVariance};
use super::lobe_prior::{LobeFamily, LobeKind, LobePrior, REACH};
use crate::material::Material;

/// Share of the prior that is left to kinds of surface that any scene has.
const ANY_SHARE: f64 = 0.5;
/// Most families.
const MOST: usize = 6;
/// Texels from which clusters are made, at most.
const SAMPLES: usize = 20_000;
/// A cluster has at least this share of the texels that are known.
const LEAST_SHARE: f64 = 0.02;
/// A lobe is known where the standard deviation of the logarithm of its width is at most this,
const KNOWN_LOG_WIDTH: f32 = 0.25;
/// and that of F0 at most so much of F0, or this.
const KNOWN_SPECULAR: (f32, f32) = (0.25, 0.015);
/// Texels nearer than this to a cluster's middle are of it: in the root of F0, and in the logarithm of the width.
const SIZE: (f64, f64) = (0.12, 0.3);
/// Least standard deviations of a family: of F0 relative to itself, of diffuse reflectance, of the logarithm of the width.
const LEAST: (f64, f64, f64) = (0.08, 0.06, 0.15);
/// Texels that each cluster is begun from, of which the best is taken.
const SEEDS: usize = 64;
/// Rounds in which clusters find their middle.
const ROUNDS: usize = 6;

/// A texel as clusters see it: F0 and diffuse reflectance per channel, logarithm of the width.
#[derive(Clone, Copy, Debug)]
struct Sample {
    specular: [f64; 3],
    root_specular: [f64; 3],
    log_width: f64,
    diffuse: [f64; 3],
}

impl Sample {
    fn new(specular: [f64; 3], log_width: f64, diffuse: [f64; 3]) -> Self {
        Sample { specular, root_specular: specular.map(|value| value.max(0.0).sqrt()), log_width, diffuse }
    }

    /// Of a texel whose lobe is known well.
    fn of(texel: &Material<f32>, known: &TexelVariance) -> Option<Sample> {
        let Material { specular, log_width, .. } = known.variance;
        let is_known = known.is_solved()
            && log_width > 0.0
            && log_width.sqrt() <= KNOWN_LOG_WIDTH
            && (0..3).all(|c| specular[c].sqrt() <= KNOWN_SPECULAR.0 * texel.specular[c] + KNOWN_SPECULAR.1);
        let texel = texel.map(f64::from);
        is_known.then(|| Sample::new(texel.specular, texel.log_width, texel.diffuse))
    }

    /// Squared distance in units of a cluster's size.
    fn distance_squared(&self, other: &Sample) -> f64 {
        let root = |c: usize| (self.root_specular[c] - other.root_specular[c]) / SIZE.0;
        (0..3).map(|c| root(c).powi(2)).sum::<f64>() + ((self.log_width - other.log_width) / SIZE.1).powi(2)
    }
}

/// Sums over the texels of a cluster.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    specular: [f64; 3],
    specular_squared: [f64; 3],
    log_width: [f64; 2],
    diffuse: [f64; 3],
    diffuse_squared: [f64; 3],
}

impl Sums {
    fn add(&mut self, sample: &Sample) {
        self.count += 1.0;
        for c in 0..3 {
            self.specular[c] += sample.specular[c];
            self.specular_squared[c] += sample.specular[c].powi(2);
            self.diffuse[c] += sample.diffuse[c];
            self.diffuse_squared[c] += sample.diffuse[c].powi(2);
        }
        self.log_width[0] += sample.log_width;
        self.log_width[1] += sample.log_width.powi(2);
    }

    fn middle(&self) -> Sample {
        let mean = |sums: &[f64; 3]| sums.map(|sum| sum / self.count);
        Sample::new(mean(&self.specular), self.log_width[0] / self.count, mean(&self.diffuse))
    }

    fn family(&self, share: f64) -> LobeFamily {
        let middle = self.middle();
        let variance = |squares: &[f64; 3], means: &[f64; 3]| {
            (0..3).map(|c| (squares[c] / self.count - means[c].powi(2)).max(0.0)).sum::<f64>() / 3.0
        };
        let bright = middle.specular.iter().sum::<f64>() / 3.0;
        let specular = variance(&self.specular_squared, &middle.specular).sqrt().max(LEAST.0 * bright + 0.002);
        let diffuse = variance(&self.diffuse_squared, &middle.diffuse).sqrt().max(LEAST.1);
        let width = (self.log_width[1] / self.count - middle.log_width.powi(2)).max(0.0).sqrt().max(LEAST.2);
        let kind = LobeKind {
            specular: (middle.specular, specular, 0.5 * specular),
            diffuse: (Some(middle.diffuse), diffuse),
            share,
        };
        LobeFamily { kinds: vec![kind], log_width: (middle.log_width, width), reach: REACH }
    }
}

/// What is believed of lobes when maps are made: the prior, and a family for each kind of surface that earlier maps show.
pub fn with_families_of(estimate: &Estimate) -> LobePrior {
    let any = LobePrior::default();
    let clusters = clusters(&known_samples(estimate));
    if clusters.is_empty() {
        return any;
    }
    // Texels that are known well are no fair sample of the surface: shares go with the root of their number.
    let total: f64 = clusters.iter().map(|cluster| cluster.count.sqrt()).sum();
    let of_any = any.families.iter().map(|family| family.scaled(ANY_SHARE));
    let of_cluster = |cluster: &Sums| cluster.family((1.0 - ANY_SHARE) * cluster.count.sqrt() / total);
    LobePrior { families: of_any.chain(clusters.iter().map(of_cluster)).collect(), keep: any.keep }
}

/// Texels whose lobes are known well, evenly chosen where there are more than it takes.
fn known_samples(estimate: &Estimate) -> Vec<Sample> {
    let texels = estimate.texels.iter().zip(&estimate.variances);
    let known: Vec<Sample> = texels.filter_map(|(texel, variance)| Sample::of(texel, variance)).collect();
    let step = known.len().div_ceil(SAMPLES).max(1);
    known.into_iter().step_by(step).collect()
}

impl LobeFamily {
    /// The same with this share of its share.
    fn scaled(&self, share: f64) -> LobeFamily {
        let scaled = |kind: &LobeKind| LobeKind { share: share * kind.share, ..*kind };
        LobeFamily { kinds: self.kinds.iter().map(scaled).collect(), ..*self }
    }
}

/// Clusters of at most a given size, the largest first: each begins where most texels are that no other has.
fn clusters(samples: &[Sample]) -> Vec<Sums> {
    let least = (LEAST_SHARE * samples.len() as f64).max(4.0);
    let mut free: Vec<&Sample> = samples.iter().collect();
    let mut found = Vec::new();
    while found.len() < MOST && free.len() as f64 >= least {
        let near = |middle: &Sample| {
            let mut sums = Sums::default();
            free.iter().filter(|sample| sample.distance_squared(middle) <= 1.0).for_each(|sample| sums.add(sample));
            sums
        };
        // Places to begin at: spread by the golden ratio, which no pattern of the texels keeps step with.
        let place = |seed: usize| ((seed as f64 * 0.618_034).fract() * free.len() as f64) as usize;
        let begins = (0..SEEDS).map(|seed| near(free[place(seed)]));
        let begin = begins.fold(Sums::default(), |best, own| if own.count > best.count { own } else { best });
        if begin.count < least {
            break;
        }
        let cluster = (0..ROUNDS).fold(begin, |own, _| near(&own.middle()));
        if cluster.count < 1.0 {
            break;
        }
        let middle = cluster.middle();
        free.retain(|sample| sample.distance_squared(&middle) > 1.0);
        if cluster.count >= least {
            found.push(cluster);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::light::Environment;
    use glam::Vec3;

    /// Maps of two materials in stripes, and texels whose lobe is not known.
    fn estimate() -> Estimate {
        let light = Environment { radiance: Image::filled(4, 2, Vec3::ONE) };
        let mut estimate = Estimate::start(32, &light, 1);
        for texel in 0..32 * 32 {
            let wobble = 0.01 * ((texel * 7 % 11) as f32 - 5.0) / 5.0;
            let material = |diffuse, specular, log_width| Material { diffuse, specular, log_width };
            let (own, variance) = match texel % 4 {
                0 => (material([0.05; 3], [0.8 + wobble, 0.5, 0.3], -0.7 + wobble), [1e-4, 0.01]),
                1 | 2 => (material([0.1 * (texel % 7) as f32; 3], [0.05 + 0.2 * wobble; 3], -1.2), [1e-4, 0.01]),
                _ => (material([0.5; 3], [0.3; 3], -0.3), [0.09, 0.5]),
            };
            let variance = material([0.01; 3], [variance[0]; 3], variance[1]);
            estimate.set(texel, own, TexelVariance { variance, lobe_cluster_size: 1.0 });
        }
        estimate
    }

    #[test]
    fn materials_that_are_known_become_families_and_what_is_not_known_does_not() {
        let prior = with_families_of(&estimate());
        assert_eq!(prior.families.len(), 3, "{prior:?}");
        let total: f64 = prior.families.iter().flat_map(|family| &family.kinds).map(|kind| kind.share).sum();
        assert!((total - 1.0).abs() < 1e-12);
        let (grey, metal) = (&prior.families[1], &prior.families[2]);
        assert!((grey.log_width.0 + 1.2).abs() < 1e-6 && (grey.kinds[0].specular.0[0] - 0.05).abs() < 1e-3, "{grey:?}");
        assert!(grey.kinds[0].diffuse.1 > 0.15, "its diffuse reflectance may be anything: {grey:?}");
        assert!(
            (metal.log_width.0 + 0.7).abs() < 1e-2 && (metal.kinds[0].specular.0[1] - 0.5).abs() < 1e-3,
            "{metal:?}"
        );
        assert!(metal.kinds[0].diffuse.1 <= LEAST.1, "{metal:?}");
    }

    #[test]
    fn where_nothing_was_solved_for_nothing_is_added() {
        let light = Environment { radiance: Image::filled(4, 2, Vec3::ONE) };
        assert_eq!(with_families_of(&Estimate::start(16, &light, 1)), LobePrior::default());
    }
}
