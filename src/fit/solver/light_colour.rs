//! The colour of the light, by the highlights of dielectrics.
//!
//! Nothing in diffuse surfaces tells a red light on white things from a white light on red ones, and the gauge begins by
//! taking the mean of all surface for grey. But F0 of what is no metal is grey, so its highlights have the colour of the
//! light (Klinker, Shafer and Kanade 1988; Lee 1986): where blocks find F0 less in red than in green, their light is as
//! much too red.

use super::cell_sums::System;
use super::round::BlockWork;

/// Mean F0 of blocks that are asked: below, there is no highlight to speak of, above, there may be metal.
const SPECULAR: (f32, f32) = (0.015, 0.12);
/// Largest logarithm of a channel's change in one round.
const MOST_CHANGE: f64 = 0.15;
/// Standard deviation of F0 of one block and channel that is no error of its pixels: what is not quite grey, and what the
/// model has wrong.
const BLOCK_SPREAD: f64 = 0.01;
/// Standard deviation of the logarithm of a channel when all surface together is taken for grey.
const GREY_SURFACE: f64 = 0.2;

/// By which factors the light's channels are to change so that F0 of dielectrics is grey; their product is 1.
/// `beside_grey` is by how much the logarithm of each channel of the light is above what makes all surface grey,
/// `independence` the share of blocks that count as independent evidence.
pub(super) fn change_by_highlights<'a>(
    blocks: impl Iterator<Item = &'a BlockWork>,
    beside_grey: [f64; 3],
    independence: f64,
) -> [f64; 3] {
    // Least squares for the factor of each channel over the blocks' grey F0.
    let (mut products, mut squares) = ([0.0f64; 3], [0.0f64; 3]);
    for work in blocks {
        let grey = work.solution.specular.iter().sum::<f32>() / 3.0;
        let Some(prior) = work.prior.filter(|_| (SPECULAR.0..SPECULAR.1).contains(&grey)) else { continue };
        let grey = f64::from(grey);
        for c in 0..3 {
            let (specular, precision) = specular_of(work, c, prior.noise);
            let weight = independence / (1.0 / precision.max(1e-9) + BLOCK_SPREAD * BLOCK_SPREAD);
            products[c] += weight * grey * specular;
            squares[c] += weight * grey * grey;
        }
    }
    let without_mean = |logs: [f64; 3]| {
        let mean = logs.iter().sum::<f64>() / 3.0;
        logs.map(|log| log - mean)
    };
    let held = 1.0 / (GREY_SURFACE * GREY_SURFACE);
    let beside = without_mean(beside_grey);
    let logs = [0, 1, 2].map(|c| {
        let asked = if squares[c] > 0.0 { (products[c] / squares[c]).max(0.1).ln() } else { 0.0 };
        let log: f64 = (squares[c] * asked - held * beside[c]) / (squares[c] + held);
        log.clamp(-MOST_CHANGE, MOST_CHANGE)
    });
    without_mean(logs).map(f64::exp)
}

/// F0 of a block in one channel by its pixels alone, at its width, and its precision.
fn specular_of(work: &BlockWork, c: usize, noise: f64) -> (f64, f64) {
    let stencil = &work.solution.stencil;
    let mut sums = System::default();
    for term in &work.terms {
        let cell = f64::from(work.solution.cells[usize::from(term.cell)][c] - work.solution.diffuse[c]);
        let e = f64::from(term.arriving[c]);
        let own = f64::from(term.radiance[c] - stencil.of(&term.grazing, c)) - cell * e;
        sums.observe(f64::from(term.weight), e, f64::from(stencil.of(&term.base, c)), own);
    }
    // Diffuse reflectance is whatever it is; more than zero, since a block that no light reaches has sums of zero.
    let System { ss, sy, .. } = sums.without_deviation(f64::MIN_POSITIVE);
    if ss <= 1e-6 * sums.ss {
        return (0.0, 0.0);
    }
    (sy / ss, ss / (noise * noise))
}

#[cfg(test)]
mod tests {
    use super::super::lobe_widths::{MOST_NODES, WidthStencil, log_widths};
    use super::super::pixel_terms::PixelTerms;
    use super::super::round::{BlockWork, open_prior};
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Blocks under a light that is believed to be this many times what it is: what their pixels say of it.
    fn blocks(count: usize, specular: [f64; 3], too_much: [f64; 3]) -> Vec<BlockWork> {
        let mut random = SequentialRandom::new(7);
        let widths = log_widths();
        let stencil = WidthStencil::new(&widths, -1.0, 0..widths.len());
        (0..count)
            .map(|_| {
                let mut work = BlockWork { prior: Some(open_prior(0.2, 1.0)), ..BlockWork::default() };
                for _ in 0..40 {
                    let [e, s, noise] = [(); 3].map(|()| random.next_number());
                    let light = too_much.map(|value| value as f32);
                    let arriving = light.map(|light| light * (0.5 + 0.2 * e));
                    let base = light.map(|light| light * 2.0 * s * s);
                    let radiance = [0, 1, 2].map(|c| {
                        [0.5, 0.3, 0.2][c] * arriving[c] / light[c]
                            + specular[c] as f32 * base[c] / light[c]
                            + 0.01 * (noise - 0.5)
                    });
                    let base = [base; MOST_NODES];
                    work.terms.push(PixelTerms { arriving, base, radiance, weight: 1.0, ..PixelTerms::default() });
                }
                work.solution.stencil = stencil;
                work.solution.specular = [0, 1, 2].map(|c| (specular[c] / too_much[c]) as f32);
                work.solution.cells = vec![[0.3; 3]];
                work.solution.diffuse = [0.3; 3];
                work
            })
            .collect()
    }

    #[test]
    fn a_light_that_is_too_red_is_told_by_grey_highlights() {
        let made = blocks(400, [0.05; 3], [1.1, 1.0, 0.95]);
        let change = change_by_highlights(made.iter(), [0.0; 3], 1.0);
        println!("{change:?}");
        let mean = (1.1f64 * 0.95).ln() / 3.0;
        for (change, too_much) in change.into_iter().zip([1.1f64, 1.0, 0.95]) {
            assert!((change.ln() + too_much.ln() - mean).abs() < 0.01, "{change} for {too_much}");
        }
    }

    #[test]
    fn metal_says_nothing_and_without_dielectrics_the_light_is_what_makes_the_surface_grey() {
        let made = blocks(400, [0.9, 0.6, 0.3], [1.1, 1.0, 0.95]);
        let change = change_by_highlights(made.iter(), [0.09, -0.03, -0.06], 1.0);
        for (change, beside) in change.into_iter().zip([0.09, -0.03, -0.06]) {
            assert!((change.ln() + beside).abs() < 1e-6, "{change} for {beside}");
        }
        // One block outvotes nothing.
        let made = blocks(1, [0.05; 3], [1.1, 1.0, 0.95]);
        let change = change_by_highlights(made.iter(), [0.0; 3], 0.05);
        assert!(change.iter().all(|change| change.ln().abs() < 0.02), "{change:?}");
    }

    #[test]
    fn a_block_that_no_light_reaches_leaves_the_light_finite() {
        let mut made = blocks(10, [0.05; 3], [1.1, 1.0, 0.95]);
        for term in made.iter_mut().flat_map(|work| &mut work.terms) {
            term.arriving = [0.0; 3];
        }
        let change = change_by_highlights(made.iter(), [0.0; 3], 0.05);
        assert!(change.iter().all(|change| change.is_finite() && (0.7..1.4).contains(change)), "{change:?}");
    }
}
