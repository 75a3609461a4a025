//! How freely neighbouring texels may differ in colour: by what predicts photos that took no part.
//!
//! The finest texture of a capture is no constant: a granite of a thousand grains asks for another prior than a painted toy, and
//! photos whose cameras are a fraction of a pixel off bear fewer freedoms out. Noise alone cannot tell, since errors of
//! model, mesh and cameras go together over pixels. So every fourth view is withheld from a few short descents on a part of
//! the surface, with one scale of texture each, and the one is taken that predicts those views best (cross-validation;
//! Stone 1974).

use super::conjugate_gradients::conjugate_gradients;
use super::descent::{difference, stepped};
use super::neighbours::Neighbours;
use super::objective::Learned;
use super::pixel_system::{PixelRow, PixelSystem, Rows};
use super::pixels::Pixels;
use super::scene::SolverScene;
use super::sight::{Lit, Sight, Slopes};
use super::way::Step;
use crate::material::Material;
use std::sync::atomic::AtomicBool;

/// Scales of the differences between logarithms of neighbours' diffuse reflectances that are looked at, the least free first.
const SCALES: [f32; 2] = [0.5, 4.0];
/// Taken where too few views could judge.
const USUAL: f32 = 1.0;
/// One of so many views judges.
const JUDGE_EVERY: usize = 4;
/// Fewer views do not judge.
const LEAST_JUDGES: usize = 2;
/// Pixels that take part, about, in chunks of neighbours.
const PIXELS: usize = 1 << 16;
/// Pixels of a chunk, which lie side by side on the surface.
const CHUNK: usize = 2048;
/// Two short steps.
const STEPS: [Step; 2] = [Step { iterations: 16, slopes: Slopes::OfReflectances }; 2];

/// What candidates are held against each other with.
struct Contest<'a> {
    scene: &'a SolverScene,
    /// A share of the pixels, and what they see.
    pixels: Pixels<'a>,
    sight: Sight,
    texels: &'a [Material<f32>],
    shown: &'a [bool],
    lit: Lit,
    /// The noise by which all are judged: that of the first.
    noise: Option<Learned>,
}

impl SolverScene {
    /// The scale of texture that suits a capture, around these texels, of which pixels show some, and what pixels see of them.
    /// `None` when `stop` was raised.
    pub(super) fn choose_texture_scale(
        &self,
        pixels: &Pixels,
        sight: &Sight,
        (texels, shown): (&[Material<f32>], &[bool]),
        lit: Lit,
        stop: &AtomicBool,
    ) -> Option<f32> {
        if (0..self.views.len()).filter(|&view| is_judge(view)).count() < LEAST_JUDGES {
            return Some(USUAL);
        }
        let stride = (self.observations.list.len() / PIXELS).max(1);
        let (some, taken) = pixels.sampled(CHUNK, stride);
        let mut system = PixelSystem::new(&some, self.settings.map_size);
        let sight = sight.of_some(pixels, &taken);
        let mut contest = Contest { scene: self, pixels: some, sight, texels, shown, lit, noise: None };
        let nats: Vec<Vec<f64>> =
            SCALES.into_iter().map(|scale| contest.nats(&mut system, scale, stop)).collect::<Option<_>>()?;
        Some(SCALES[best(&nats)])
    }
}

/// Whether a view judges.
fn is_judge(view: usize) -> bool {
    view % JUDGE_EVERY == JUDGE_EVERY - 1
}

impl Contest<'_> {
    /// Mean negative logarithm of the density of the judging views' pixels, view by view.
    fn nats(&mut self, system: &mut PixelSystem, texture_scale: f32, stop: &AtomicBool) -> Option<Vec<f64>> {
        let Contest { scene, pixels, sight, texels, shown, lit, noise } = self;
        let beliefs = Neighbours::new(scene.settings.map_size, texels, shown.to_vec(), texture_scale);
        let (mut own, mut seen): (Vec<Material<f32>>, Option<Sight>) = (texels.to_vec(), None);
        let mut learned: Option<Learned> = None;
        for step in STEPS {
            let now = seen.as_ref().unwrap_or(sight);
            let by_now = Learned::of(pixels, now, learned.as_ref());
            let mut rows: Vec<PixelRow> = by_now.rows(pixels, now);
            learned = Some(by_now);
            rows.iter_mut()
                .enumerate()
                .filter(|(index, _)| is_judge(pixels.pixel(*index).view as usize))
                .for_each(|(_, row)| row.weight = 0.0);
            let rows = Rows { pieces: &now.pieces, pixels: &rows };
            let way = conjugate_gradients(system, rows, &beliefs.parabola(&own), step, stop, &mut |_, _| {})?;
            let next = stepped(&own, &way, 1.0, scene.most_diffuse(*lit));
            let moved = now.moved(system, &difference(&own, &next));
            (own, seen) = (next, Some(moved));
        }
        let seen = seen.as_ref().unwrap_or(sight);
        // Each with its own gains, all by the noise of the first.
        let learned = Learned::of(pixels, seen, learned.as_ref());
        let by = learned.with_noise_of(noise.as_ref().unwrap_or(&learned));
        let mut sums = vec![(0.0f64, 0.0f64); pixels.views()];
        for index in 0..pixels.whole() {
            let view = pixels.pixel(index).view as usize;
            if is_judge(view) {
                sums[view] = (sums[view].0 + by.nats(pixels, seen, index), sums[view].1 + 1.0);
            }
        }
        noise.get_or_insert(learned);
        Some(sums.into_iter().filter(|sum| sum.1 > 0.0).map(|(sum, count)| sum / count).collect())
    }
}

/// The candidate that predicts judging views best: least mean of nats, which are given view by view; the least free of
/// equals.
fn best(nats: &[Vec<f64>]) -> usize {
    let mean = |own: &usize| nats[*own].iter().sum::<f64>() / nats[*own].len().max(1) as f64;
    (0..nats.len()).min_by(|a, b| mean(a).total_cmp(&mean(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_that_predicts_best_is_taken() {
        let (good, bad) = (vec![1.0, 2.0, 3.0], vec![1.0, 2.5, 3.0]);
        assert_eq!(best(&[bad.clone(), good.clone(), good.clone()]), 1);
        assert_eq!(best(&[good, bad]), 0);
        assert_eq!(best(&[]), 0);
    }
}
