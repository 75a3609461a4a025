//! What each texel of the light is known by: background pixels, highlights, diffuse light and shadows, or belief alone.
//!
//! A coefficient of the light has a precision from each of them: its diagonal entry in the normal equations. The
//! surface's entry, from which what albedo and lobe could explain is gone, is shared out between highlights and diffuse
//! light as their squares were before. Shares of a texel are those of its coefficients, by their weight in it.

use super::light_shape::LightShape;
use super::normal_equations::NormalEquations;

/// Shares of a texel's precision: highlights, background pixels, diffuse light with its shadows. What is missing to 1
/// is belief: that a sky is smooth.
pub type EvidenceShares = [f32; 3];

/// What is known of a light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightKnown {
    /// What each texel is known by; empty before the first round on the light.
    pub shares: Vec<EvidenceShares>,
    /// Standard deviation, relative, of the factor that light and reflectance have in common. Before the descent that of the
    /// mean light on the surface, by the photos and the belief that skies are smooth, without what the convention that holds
    /// it adds; mean over channels, infinite where no photo tells of it, 0 before the first round. After it, by
    /// [`LightScale`](super::light_scale::LightScale).
    pub scale_deviation: f64,
}

/// Precisions of all coefficients of one channel, in one unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Precisions {
    /// From highlights, background and diffuse light.
    pub evidence: [Vec<f64>; 3],
    /// From belief.
    pub belief: Vec<f64>,
}

impl Precisions {
    /// Of the surface's diagonal, that of surface and background together, and the believed one; the former two are
    /// worth `independence`.
    pub fn new(surface: &[f64], together: &NormalEquations, belief: Vec<f64>, independence: f64) -> Self {
        let [lobe, diffuse] = together.powers();
        let mut evidence: [Vec<f64>; 3] = Default::default();
        for (index, (&own, all)) in surface.iter().zip(together.diagonal()).enumerate() {
            let whole = (lobe[index] + diffuse[index]).max(f64::MIN_POSITIVE);
            evidence[0].push(independence * own * lobe[index] / whole);
            evidence[1].push(independence * (all - own).max(0.0));
            evidence[2].push(independence * own * diffuse[index] / whole);
        }
        Precisions { evidence, belief }
    }
}

/// Shares of every texel over the three channels.
pub fn evidence_shares(channels: &[Precisions], shape: &LightShape) -> Vec<EvidenceShares> {
    let texels = shape.size.0 * shape.size.1;
    let mut sums = vec![[0.0f64; 4]; texels];
    for channel in channels {
        for (kind, values) in channel.evidence.iter().chain([&channel.belief]).enumerate() {
            let values: Vec<f32> = values.iter().map(|&value| value as f32).collect();
            for (texel, sum) in sums.iter_mut().enumerate() {
                sum[kind] += f64::from(shape.expand_at(texel, &values));
            }
        }
    }
    sums.into_iter()
        .map(|sum| {
            let whole: f64 = sum.iter().sum();
            [0, 1, 2].map(|kind| if whole > 0.0 { (sum[kind] / whole) as f32 } else { 0.0 })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_go_to_what_speaks() {
        let shape = LightShape::new((16, 8), Vec::new());
        let count = shape.count();
        let mut equations = NormalEquations::new(count);
        let surface = equations.diagonal();
        // Background shows two coefficients; nothing else says anything.
        equations.add_sparse(&[(0, 3.0), (1, 1.0)], 2.0);
        let precisions = Precisions::new(&surface, &equations, vec![1.0; count], 0.5);
        assert_eq!((precisions.evidence[1][0], precisions.evidence[1][1], precisions.evidence[1][2]), (4.5, 0.5, 0.0));
        let shares = evidence_shares(&[precisions], &shape);
        assert!(shares.iter().all(|[lobe, sky, diffuse]| *lobe == 0.0 && *diffuse == 0.0 && (0.0..1.0).contains(sky)));
        assert!(shares[0][1] > 0.4 && shares.iter().any(|share| share[1] == 0.0), "{:?}", &shares[..4]);
        // Without any belief or evidence there is no share.
        let nothing = Precisions::new(&surface, &NormalEquations::new(count), vec![0.0; count], 1.0);
        assert!(evidence_shares(&[nothing], &shape).iter().flatten().all(|share| *share == 0.0));
    }
}
