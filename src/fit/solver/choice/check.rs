//! The check from its beginning to its end: which views judge, tiles as they are solved, and what comes out.

use super::super::estimate::Estimate;
use super::super::lobe_prior::LobePrior;
use super::super::observations::Observation;
use super::super::scene::SolverScene;
use super::super::tile::Tile;
use super::alternatives::{TileAlternatives, TileTerms};
use super::choices::{ChoiceSeconds, Choices};
use super::judge::{JudgedLight, JudgingView, SurfaceAlternatives};
use crate::render::cached::PointLight;
use std::borrow::Cow;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// One of so many training views judges where none is held out.
const WITHHOLD_EVERY: usize = 8;
/// Fewer views than these do not judge: there would be no standard error.
const LEAST_VIEWS: usize = 2;

/// A check under way.
pub struct Check<'a> {
    views: Vec<JudgingView<'a>>,
    /// Whether a training view, in the order of the solver, is withheld. Empty where views are held out.
    withheld: Vec<bool>,
    at_points: &'a PointLight,
    prior: &'a LobePrior,
    surface: SurfaceAlternatives,
    /// Seconds of one processor.
    seconds: ChoiceSeconds,
}

impl<'a> Check<'a> {
    /// Begins where it is asked for and enough views can judge; `at_points` is the light at the points of the grid, `prior`
    /// what the tiles believe of lobes.
    pub fn begin(scene: &'a SolverScene, at_points: &'a PointLight, prior: &'a LobePrior) -> Option<Self> {
        if !scene.settings.check_choices {
            return None;
        }
        let (views, withheld) = if scene.held_out_pixels.len() >= LEAST_VIEWS {
            let pixels = scene.held_out.iter().zip(&scene.held_out_pixels);
            (pixels.map(|((_, footprints), pixels)| (footprints, Cow::from(pixels))).collect(), Vec::new())
        } else {
            let withheld = withheld(scene.views.len())?;
            (withheld_views(scene, &withheld), withheld)
        };
        Some(Check {
            views,
            withheld,
            at_points,
            prior,
            surface: SurfaceAlternatives::new(scene.settings.map_size),
            seconds: ChoiceSeconds::default(),
        })
    }

    /// The alternatives of a tile that was solved; it is left as it was.
    pub fn of_tile(&self, scene: &SolverScene, tile: &mut Tile) -> TileAlternatives {
        let is_withheld = |observation: u32| {
            let view = scene.observations.list[observation as usize].view;
            self.withheld.get(view as usize).is_some_and(|&withheld| withheld)
        };
        let direct = |observation: u32| scene.interpolate(&self.at_points.direct, observation as usize);
        let has_bounces = scene.transport.bounces.is_some();
        let terms = TileTerms {
            map_size: scene.settings.map_size,
            mean_radiance: scene.observations.mean,
            independence: scene.settings.independence,
            prior: self.prior,
            is_withheld: &is_withheld,
            direct: has_bounces.then_some(&direct),
        };
        TileAlternatives::of(tile, &terms)
    }

    /// Adds a tile: its alternatives, and the seconds of one processor for its blocks, for sums over its pixels and for
    /// beliefs from them.
    pub fn add(&mut self, tile: &TileAlternatives, blocks: f64, [sums, beliefs]: [f64; 2]) {
        self.surface.add(tile);
        self.seconds.integrals += blocks + sums;
        self.seconds.beliefs += beliefs;
        self.seconds.add_alternatives(&tile.seconds);
    }

    /// Judges under a light. `None` when `stop` was raised.
    pub fn end(
        mut self,
        scene: &SolverScene,
        estimate: &Estimate,
        light: JudgedLight,
        stop: &AtomicBool,
    ) -> Option<Choices> {
        let threads = rayon::current_num_threads() as f64;
        self.seconds.share_among(threads);
        let began = Instant::now();
        let (width, height) = scene.settings.light_size;
        let half = estimate.environment((width, height)).resampled(width / 2, height / 2).resampled(width, height);
        let half: Vec<[f32; 3]> = half.radiance.pixels().iter().map(|radiance| radiance.to_array()).collect();
        let planes = scene.transport.basis.planes(&half);
        let at_points = scene.point_light(&estimate.texels, &planes);
        let judgement = scene.judge(&self.surface, &self.views, light, (&planes, &at_points), stop)?;
        self.seconds.judging = began.elapsed().as_secs_f64();
        // Of a cache that was there nobody knows.
        self.seconds.bounces = Some(scene.transport.bounce_seconds).filter(|&seconds| seconds > 0.0);
        let is_withheld = !self.withheld.is_empty();
        Some(Choices::of(&judgement, &self.surface, scene.settings.map_size, &self.seconds, is_withheld))
    }
}

/// Which of so many training views are withheld, evenly spread; `None` of too few.
fn withheld(views: usize) -> Option<Vec<bool>> {
    // At least two, where that leaves two to fit to.
    let every = WITHHOLD_EVERY.min(views / LEAST_VIEWS);
    (every >= 2).then(|| (0..views).map(|view| view % every == every - 1).collect())
}

fn withheld_views<'a>(scene: &'a SolverScene, withheld: &[bool]) -> Vec<JudgingView<'a>> {
    let mut pixels: Vec<Vec<Observation>> = vec![Vec::new(); withheld.len()];
    for observation in &scene.observations.list {
        if withheld[observation.view as usize] {
            pixels[observation.view as usize].push(*observation);
        }
    }
    let all = scene.footprints.iter().zip(pixels.into_iter().map(Cow::from)).zip(withheld);
    all.filter(|(_, withheld)| **withheld).map(|(view, _)| view).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_views_judge_and_most_do_not() {
        for views in 4..200 {
            let withheld = withheld(views).unwrap();
            let count = withheld.iter().filter(|&&withheld| withheld).count();
            assert!(count >= LEAST_VIEWS && 2 * count <= views, "{views}: {count}");
            assert!(views < 16 || count == views / WITHHOLD_EVERY);
        }
        assert!((0..4).all(|views| withheld(views).is_none()));
    }
}
