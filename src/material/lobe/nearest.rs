//! The GGX lobe nearest to a Blinn-Phong lobe.
//!
//! Other renderers shade with GGX, whose tails are longer: at an equal width a highlight is wider there. The width that
//! is written is the one whose lobe has the least squared difference over all pairs of directions, each pair weighed by
//! both cosines as in a picture of a surface under even light.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

/// A GGX lobe in place of a Blinn-Phong lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GgxLobe {
    /// GGX width `alpha`, in (0, 1].
    pub width: f64,
    /// Root of the squared difference of the two lobes over that of the Blinn-Phong lobe.
    pub relative_error: f64,
}

/// Widths the table is made at, evenly spaced in their logarithm.
const TABLE_LENGTH: usize = 25;
/// The narrowest width of the table.
const NARROWEST: f64 = super::MIN_WIDTH as f64;

static TABLE: LazyLock<Vec<GgxLobe>> = LazyLock::new(|| (0..TABLE_LENGTH).map(|i| nearest(width_at(i))).collect());

fn width_at(index: usize) -> f64 {
    (NARROWEST.ln() * (1.0 - index as f64 / (TABLE_LENGTH - 1) as f64)).exp()
}

/// The GGX lobe nearest to the Blinn-Phong lobe of microfacet width `a`, which is clamped to
/// [[`MIN_WIDTH`](super::MIN_WIDTH), 1]. Read from a table, linear in the logarithms.
pub fn ggx_of_blinn_phong(width: f64) -> GgxLobe {
    let place = 1.0 - width.clamp(NARROWEST, 1.0).ln() / NARROWEST.ln();
    let place = place.clamp(0.0, 1.0) * (TABLE_LENGTH - 1) as f64;
    let low = (place as usize).min(TABLE_LENGTH - 2);
    let (share, a, b) = (place - low as f64, TABLE[low], TABLE[low + 1]);
    GgxLobe {
        width: (a.width.ln() * (1.0 - share) + b.width.ln() * share).exp(),
        relative_error: a.relative_error * (1.0 - share) + b.relative_error * share,
    }
}

/// Roughness of glTF, Disney and Blender, `sqrt(alpha)`, for the roughness `r = a^2` of a map.
pub fn perceptual_roughness(roughness: f32) -> f32 {
    ggx_of_blinn_phong(f64::from(roughness.max(0.0)).sqrt()).width.sqrt() as f32
}

/// Searches the width by golden section on the logarithm of its ratio to the Blinn-Phong width.
fn nearest(width: f64) -> GgxLobe {
    nearest_over(&pairs_of_directions(width), width)
}

fn nearest_over(pairs: &[Pair], width: f64) -> GgxLobe {
    let error = |log_ratio: f64| squared_difference(pairs, (width * log_ratio.exp()).min(1.0));
    let (mut low, mut high) = (-1.5f64, 0.5f64);
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut left_error, mut right_error) = (error(left), error(right));
    while high - low > 1e-4 {
        if left_error < right_error {
            (high, right, right_error) = (right, left, left_error);
            left = high - golden * (high - low);
            left_error = error(left);
        } else {
            (low, left, left_error) = (left, right, right_error);
            right = low + golden * (high - low);
            right_error = error(right);
        }
    }
    let log_ratio = 0.5 * (low + high);
    let own: f64 = pairs.iter().map(|pair| pair.weight * pair.value * pair.value).sum();
    GgxLobe { width: (width * log_ratio.exp()).min(1.0), relative_error: (error(log_ratio) / own).sqrt() }
}

/// Two directions about a normal, the Blinn-Phong lobe between them and its weight in the sum.
struct Pair {
    cos_in: f64,
    cos_out: f64,
    cos_half: f64,
    value: f64,
    weight: f64,
}

/// Pairs that sample the lobe where it is: half vectors spread in units of the width.
fn pairs_of_directions(width: f64) -> Vec<Pair> {
    const VIEWS: usize = 8;
    const RINGS: usize = 96;
    const AZIMUTHS: usize = 12;
    const WIDTHS_REACHED: f64 = 12.0;
    let mut pairs = Vec::new();
    for view in 0..VIEWS {
        let theta_out = FRAC_PI_2 * (view as f64 + 0.5) / VIEWS as f64;
        let (sin_out, cos_out) = theta_out.sin_cos();
        for ring in 0..RINGS {
            let reach = WIDTHS_REACHED * (ring as f64 + 0.5) / RINGS as f64;
            let theta_half = (width * reach).atan();
            let (sin_half, cos_half) = theta_half.sin_cos();
            let d_theta = width / (1.0 + (width * reach).powi(2));
            for azimuth in 0..AZIMUTHS {
                let phi = PI * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
                let half_dot_out = sin_half * phi.cos() * sin_out + cos_half * cos_out;
                let cos_in = 2.0 * half_dot_out * cos_half - cos_out;
                if half_dot_out <= 0.0 || cos_in <= 0.0 {
                    continue;
                }
                // d omega_in = 4 (h.o) d omega_half.
                let weight = sin_out * cos_out * cos_in * 4.0 * half_dot_out * sin_half * d_theta;
                let value = blinn_phong(width, cos_in, cos_out, cos_half);
                pairs.push(Pair { cos_in, cos_out, cos_half, value, weight });
            }
        }
    }
    pairs
}

fn squared_difference(pairs: &[Pair], width: f64) -> f64 {
    let difference = |pair: &Pair| pair.value - ggx(width, pair.cos_in, pair.cos_out, pair.cos_half);
    pairs.iter().map(|pair| pair.weight * difference(pair).powi(2)).sum()
}

/// `D G / (4 (n.i)(n.o))` of [`super::blinn_phong`].
fn blinn_phong(width: f64, cos_in: f64, cos_out: f64, cos_half: f64) -> f64 {
    let k = 0.5 * width;
    let inverse = 1.0 / (width * width);
    let distribution = inverse / PI * ((2.0 * inverse - 2.0) * cos_half.ln()).exp();
    distribution / (4.0 * (cos_in * (1.0 - k) + k) * (cos_out * (1.0 - k) + k))
}

/// `D G / (4 (n.i)(n.o))` with the GGX distribution (Walter et al. 2007, eq. 33) and height-correlated Smith shadowing
/// (Heitz 2014, eq. 99), as glTF, Cycles and OpenPBR use them.
fn ggx(width: f64, cos_in: f64, cos_out: f64, cos_half: f64) -> f64 {
    let squared = width * width;
    let distribution = squared / (PI * (cos_half * cos_half * (squared - 1.0) + 1.0).powi(2));
    let root = |cosine: f64| (squared + (1.0 - squared) * cosine * cosine).sqrt();
    distribution * 0.5 / (cos_in * root(cos_out) + cos_out * root(cos_in))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_width_is_nearer() {
        for width in [0.02, 0.1, 0.35, 0.8] {
            let pairs = pairs_of_directions(width);
            let found = ggx_of_blinn_phong(width);
            let error = squared_difference(&pairs, found.width);
            // Everywhere, not only beside what was found.
            for step in -40..=40 {
                let other = (width * (0.05 * f64::from(step)).exp()).min(1.0);
                assert!(squared_difference(&pairs, other) >= error * 0.999, "width {width}: {found:?}, {other}");
            }
            let own: f64 = pairs.iter().map(|pair| pair.weight * pair.value * pair.value).sum();
            assert!((found.relative_error / (error / own).sqrt() - 1.0).abs() < 0.02, "{width}: {found:?}");
        }
    }

    #[test]
    fn narrow_lobes_seen_from_above_have_the_ratio_that_calculus_gives() {
        // With `t` the squared angle of the half vector in units of `a`, and `u = (alpha / a)^2`, narrow lobes are
        // `exp(-t)` and `u / (u + t)^2` times the same factor, and even light weighs all `t` alike. The integral of
        // the squared difference, `1/2 + 1/(3u) - 2 + 2 u e^u E1(u)`, is least where
        // `(1 + u) e^u E1(u) = 1 + 1/(6 u^2)`: at u = 0.855246, where it is 0.0436158.
        let (ratio, relative_error) = (0.855_246f64.sqrt(), 0.208_844);
        for width in [0.005, 0.02] {
            let mut pairs = pairs_of_directions(width);
            // From further aside shadowing is not the same for both.
            pairs.retain(|pair| pair.cos_out > 0.9);
            let found = nearest_over(&pairs, width);
            assert!((found.width / width / ratio - 1.0).abs() < 2e-3, "{width}: {found:?}");
            assert!((found.relative_error / relative_error - 1.0).abs() < 3e-3, "{width}: {found:?}");
        }
    }

    #[test]
    fn roughness_grows_with_the_width() {
        let rising: Vec<f32> = (0..=50).map(|i| perceptual_roughness((i as f32 / 50.0).powi(2))).collect();
        assert!(rising.windows(2).all(|pair| pair[0] <= pair[1]), "{rising:?}");
        assert!(rising[0] > 0.0 && rising[50] <= 1.0);
    }
}
