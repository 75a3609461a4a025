//! Pixels of judging views under all alternatives, summed by region and view.

use super::super::observations::Observation;
use super::super::scene::SolverScene;
use super::super::tile::{TILE, forgiven};
use super::alternatives::{Lobe, TileAlternatives};
use super::clustered::ClusteredMean;
use super::student::StudentNoise;
use super::{ALTERNATIVES, Alternative, LOBE_ALTERNATIVES};
use crate::math::parallel;
use crate::render::cached::lobe_place::LobeSums;
use crate::render::cached::lobe_sum::lobe_sums;
use crate::render::cached::{CachedTransport, LightPlanes, PointLight, SeenLight, ViewFootprints};
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most pixels of a view that judge.
const MOST_PIXELS_OF_VIEW: usize = 8192;
/// Pairs of alternatives whose difference is looked at: the simpler one first. The first three are those of lobes.
pub const PAIRS: [(Alternative, Alternative); 5] = [
    (Alternative::Diffuse, Alternative::OneLobe),
    (Alternative::OneLobe, Alternative::OwnLobes),
    (Alternative::Diffuse, Alternative::OwnLobes),
    (Alternative::DirectLight, Alternative::OwnLobes),
    (Alternative::HalfLight, Alternative::OwnLobes),
];

/// What the alternatives make of the whole surface.
pub struct SurfaceAlternatives {
    map_size: usize,
    /// Diffuse reflectance by texel; NaN where nothing was solved. Empty for alternatives without one of their own.
    rho: [Vec<[f32; 3]>; ALTERNATIVES],
    /// Lobes by texel.
    own: Vec<Lobe>,
    /// The one lobe of each region and its noise; `None` where nothing was solved.
    regions: Vec<Option<(Lobe, [StudentNoise; ALTERNATIVES])>>,
}

/// Sums over pixels of a region, or of the whole surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JudgedSums {
    /// Differences of log-likelihood, second less first of [`PAIRS`], in nats.
    pub pairs: [ClusteredMean; PAIRS.len()],
    /// Sum of the squared error, mean over channels, of each alternative, in squared radiance.
    pub squares: [f64; ALTERNATIVES],
    /// Sum of the log-likelihood of each alternative, in nats.
    pub logs: [f64; ALTERNATIVES],
    /// Pixels.
    pub pixels: f64,
}

/// What judges said.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// By region, row-major over the maps.
    pub regions: Vec<JudgedSums>,
    /// Of all pixels together.
    pub total: JudgedSums,
    /// Views that judged.
    pub views: usize,
}

/// A light to judge under: its planes, and what reaches the points of the grid.
pub type JudgedLight<'a> = (&'a LightPlanes, &'a PointLight);

/// A view that judges: its footprints, and its pixels.
pub type JudgingView<'a> = (&'a ViewFootprints, Cow<'a, [Observation]>);

/// What a pixel says of each alternative.
#[derive(Clone, Copy, Default)]
struct Judged {
    region: usize,
    models: [[f32; 3]; ALTERNATIVES],
    radiance: [f32; 3],
}

/// Number of regions along the side of maps.
pub fn regions_across(map_size: usize) -> usize {
    map_size.div_ceil(TILE)
}

/// The region of a texel.
pub fn region_of(texel: usize, map_size: usize) -> usize {
    texel / map_size / TILE * regions_across(map_size) + texel % map_size / TILE
}

impl SurfaceAlternatives {
    /// Nothing yet, for maps of so many texels a side.
    pub fn new(map_size: usize) -> Self {
        let regions = regions_across(map_size).pow(2);
        SurfaceAlternatives {
            map_size,
            rho: Default::default(),
            own: vec![[0.0; 4]; map_size * map_size],
            regions: vec![None; regions],
        }
    }

    /// Adds a tile.
    pub fn add(&mut self, tile: &TileAlternatives) {
        let (Some(noise), Some(&first)) = (tile.noise, tile.texels.first()) else { return };
        self.regions[region_of(first as usize, self.map_size)] = Some((tile.one, noise));
        for (&texel, lobe) in tile.texels.iter().zip(&tile.own) {
            self.own[texel as usize] = *lobe;
        }
        for (all, own) in self.rho.iter_mut().zip(&tile.rho).filter(|(_, own)| !own.is_empty()) {
            if all.is_empty() {
                *all = vec![[f32::NAN; 3]; self.map_size * self.map_size];
            }
            for (&texel, rho) in tile.texels.iter().zip(own) {
                all[texel as usize] = *rho;
            }
        }
    }

    /// Whether an alternative was solved.
    pub fn has(&self, alternative: Alternative) -> bool {
        !self.rho[alternative.index()].is_empty()
    }

    /// Whether a texel was solved.
    pub fn is_solved(&self, texel: usize) -> bool {
        self.rho[Alternative::OwnLobes.index()].get(texel).is_some_and(|rho| rho[0].is_finite())
    }
}

impl SolverScene {
    /// What judging views say of the alternatives, under the light and a coarser one. `None` when `stop` was raised.
    pub fn judge(
        &self,
        surface: &SurfaceAlternatives,
        views: &[JudgingView],
        light: JudgedLight,
        coarse: JudgedLight,
        stop: &AtomicBool,
    ) -> Option<Judgement> {
        let regions = surface.regions.len();
        let mut made = Judgement { regions: vec![JudgedSums::default(); regions], ..Judgement::default() };
        for (footprints, pixels) in views {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let unclipped: Vec<&Observation> = pixels.iter().filter(|pixel| !pixel.clipped).collect();
            let step = unclipped.len().div_ceil(MOST_PIXELS_OF_VIEW).max(1);
            let of_chunk = |_: usize, pixels: &[&Observation]| -> Vec<Judged> {
                let mut around = Default::default();
                let pixels = pixels.iter().step_by(step);
                pixels.filter_map(|own| self.judged(surface, footprints, own, [light, coarse], &mut around)).collect()
            };
            let judged: Vec<Judged> =
                parallel::map_chunks(&unclipped, 64 * step, of_chunk).into_iter().flatten().collect();
            made.add_view(surface, &judged, self.observations.mean, self.settings.exposure);
        }
        Some(made)
    }

    /// A pixel under all alternatives; `None` where some texel of it was not solved.
    fn judged(
        &self,
        surface: &SurfaceAlternatives,
        footprints: &ViewFootprints,
        pixel: &Observation,
        [light, coarse]: [JudgedLight; 2],
        around: &mut [SeenLight; 2],
    ) -> Option<Judged> {
        let point = &footprints.points[pixel.point as usize];
        let mut rho = [[0.0f32; 3]; ALTERNATIVES];
        let (mut one, mut own) = ([0.0f32; 4], [0.0f32; 4]);
        for &(texel, weight) in footprints.texels_of(point) {
            let texel = texel as usize;
            let (lobe, _) = surface.regions[region_of(texel, surface.map_size)]?;
            for (sum, all) in rho.iter_mut().zip(&surface.rho).filter(|(_, all)| !all.is_empty()) {
                (0..3).for_each(|c| sum[c] += weight * all[texel][c]);
            }
            for k in 0..4 {
                one[k] += weight * lobe[k];
                own[k] += weight * surface.own[texel][k];
            }
        }
        // NaN wherever a texel has none.
        let is_solved = rho[Alternative::OwnLobes.index()][0].is_finite();
        let region = region_of(pixel.texel as usize, surface.map_size);
        if !is_solved || surface.regions[region].is_none() {
            return None;
        }
        let lobes = |(planes, at): JudgedLight, around: &mut SeenLight, lobes: [Lobe; 2]| -> [[f32; 3]; 2] {
            let place = self.transport.lobe_place(point, planes, at, around);
            let swap = usize::from(lobes[0][3] > lobes[1][3]);
            let widths = [lobes[swap][3].exp(), lobes[1 - swap][3].exp()];
            let mut sums = [LobeSums::default(); 2];
            let count = if widths[0] == widths[1] { 1 } else { 2 };
            lobe_sums(&self.transport.basis, &place, &widths[..count], &mut sums[..count]);
            if count == 1 {
                sums[1] = sums[0];
            }
            [0, 1].map(|which| {
                let [red, green, blue, _] = lobes[which];
                sums[which ^ swap].radiance([red, green, blue])
            })
        };
        let arriving = |values: &[[f32; 3]]| CachedTransport::interpolate(values, footprints, point);
        let (all, straight, smooth) =
            (arriving(&light.1.arriving), arriving(&light.1.direct), arriving(&coarse.1.arriving));
        let [around, around_coarse] = around;
        let [of_one, of_own] = lobes(light, around, [one, own]);
        let [of_coarse, _] = lobes(coarse, around_coarse, [own, own]);
        let none = [0.0; 3];
        let own_rho = rho[Alternative::OwnLobes.index()];
        let models = Alternative::ALL.map(|alternative| {
            let (rho, arriving, lobe) = match alternative {
                Alternative::Diffuse => (rho[alternative.index()], all, none),
                Alternative::OneLobe => (rho[alternative.index()], all, of_one),
                Alternative::OwnLobes => (own_rho, all, of_own),
                Alternative::DirectLight if surface.has(alternative) => (rho[alternative.index()], straight, of_own),
                Alternative::DirectLight => (own_rho, all, of_own),
                Alternative::HalfLight => (own_rho, smooth, of_coarse),
            };
            [0, 1, 2].map(|c| rho[c] * arriving[c] + lobe[c])
        });
        let is_finite = models.iter().flatten().chain(&pixel.radiance).all(|value| value.is_finite());
        is_finite.then_some(Judged { region, models, radiance: pixel.radiance })
    }
}

impl Judgement {
    /// Adds the pixels of a view. `has_gain`: the view's own gain is not known, so each alternative is given its best.
    fn add_view(&mut self, surface: &SurfaceAlternatives, judged: &[Judged], mean_radiance: f32, has_gain: bool) {
        if judged.is_empty() {
            return;
        }
        self.views += 1;
        let gains = if has_gain { best_gains(judged) } else { [1.0; ALTERNATIVES] };
        // Per region: logarithms and squares of each alternative, pixels.
        let mut sums = vec![([0.0f64; ALTERNATIVES], [0.0f64; ALTERNATIVES], 0.0f64); self.regions.len()];
        for pixel in judged {
            let Some((_, noise)) = &surface.regions[pixel.region] else { continue };
            let scale = f64::from(forgiven(&pixel.radiance, mean_radiance));
            let (logs, squares, count) = &mut sums[pixel.region];
            *count += 1.0;
            for k in 0..ALTERNATIVES {
                let errors = [0, 1, 2].map(|c| f64::from(pixel.radiance[c] - gains[k] * pixel.models[k][c]));
                let square = errors.iter().map(|error| error * error).sum::<f64>();
                // What brightness forgives changes a density by a factor that is the same for all alternatives.
                logs[k] += noise[k].log_density(scale * square);
                squares[k] += square / 3.0;
            }
        }
        let mut total = ([0.0f64; ALTERNATIVES], [0.0f64; ALTERNATIVES], 0.0f64);
        for (region, own) in self.regions.iter_mut().zip(&sums) {
            region.add_view(own);
            for k in 0..ALTERNATIVES {
                total.0[k] += own.0[k];
                total.1[k] += own.1[k];
            }
            total.2 += own.2;
        }
        self.total.add_view(&total);
    }
}

impl JudgedSums {
    fn add_view(&mut self, (logs, squares, pixels): &([f64; ALTERNATIVES], [f64; ALTERNATIVES], f64)) {
        for (pair, (simple, rich)) in self.pairs.iter_mut().zip(PAIRS) {
            pair.add_view(logs[rich.index()] - logs[simple.index()], *pixels);
        }
        for k in 0..ALTERNATIVES {
            self.logs[k] += logs[k];
            self.squares[k] += squares[k];
        }
        self.pixels += pixels;
    }

    /// The simplest alternative within one standard error of the best, of those that differ by their lobes. `None` where
    /// less than two views judged: nothing is known of the error then.
    pub fn simplest(&self) -> Option<Alternative> {
        if self.pairs[0].views() < 2 {
            return None;
        }
        let best = (1..LOBE_ALTERNATIVES).fold(0, |best, k| if self.logs[k] > self.logs[best] { k } else { best });
        let is_near = |simple: usize| {
            let pair = PAIRS.iter().position(|(a, b)| (a.index(), b.index()) == (simple, best));
            pair.is_some_and(|pair| self.pairs[pair].mean() <= self.pairs[pair].standard_error())
        };
        Some(Alternative::ALL[(0..best).find(|&simple| is_near(simple)).unwrap_or(best)])
    }
}

/// The gain under which each alternative is nearest to a view, in least squares.
fn best_gains(judged: &[Judged]) -> [f32; ALTERNATIVES] {
    std::array::from_fn(|k| {
        let (mut product, mut power) = (0.0f64, 0.0f64);
        for pixel in judged {
            for c in 0..3 {
                let model = f64::from(pixel.models[k][c]);
                product += model * f64::from(pixel.radiance[c]);
                power += model * model;
            }
        }
        if power > 0.0 && product > 0.0 { (product / power) as f32 } else { 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;

    /// Share of regions that choose the simplest and the richest model, where the richest gains so much a pixel and
    /// pixels of a view go together.
    fn shares(gain: f64) -> [f64; 2] {
        let mut random = SequentialRandom::new(3);
        let mut number = || f64::from(random.next_number()) - 0.5;
        let mut counts = [0.0; 2];
        for _ in 0..400 {
            let mut region = JudgedSums::default();
            for _ in 0..6 {
                let pixels = (60.0 + 80.0 * number()).round();
                let mut logs = [0.0; ALTERNATIVES].map(|_: f64| pixels * number());
                logs[Alternative::OwnLobes.index()] += pixels * gain;
                region.add_view(&(logs, [0.0; ALTERNATIVES], pixels));
            }
            match region.simplest() {
                Some(Alternative::Diffuse) => counts[0] += 1.0 / 400.0,
                Some(Alternative::OwnLobes) => counts[1] += 1.0 / 400.0,
                _ => {}
            }
        }
        counts
    }

    #[test]
    fn noise_alone_mostly_chooses_the_simplest_model_and_a_gain_the_richest() {
        // One gain in six is larger than its standard error by chance, and there are two of them.
        let [simplest, _] = shares(0.0);
        assert!(simplest > 0.65, "{simplest}");
        let [_, richest] = shares(1.5);
        assert!(richest > 0.9, "{richest}");
        assert_eq!(JudgedSums::default().simplest(), None);
    }
}
