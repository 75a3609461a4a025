//! A tile solved anew with less, from the terms its pixels have already: no lobe, one lobe for all its texels, no light
//! from other surface.
//!
//! Diffuse reflectance is solved in closed form for each alternative, and the noise of each is what it leaves of the
//! tile's own training pixels. Where views are withheld, the solver's own choice is made once more without their pixels:
//! what judges must not have taken part. Without light from other surface lobes stay as they were found with it: they
//! would be integrated anew otherwise, which is what takes the time.

use super::super::lobe_prior::LobePrior;
use super::super::lobe_tree::LobeSharing;
use super::super::tile::{Tile, forgiven, least_noise};
use super::student::StudentNoise;
use super::{ALTERNATIVES, Alternative};
use std::time::Instant;

/// A lobe as maps hold it: F0 per channel, logarithm of the width.
pub type Lobe = [f32; 4];

/// What the alternatives of all tiles are solved with.
#[derive(Clone, Copy)]
pub struct TileTerms<'a> {
    /// Width and height of the maps in texels.
    pub map_size: usize,
    /// Mean radiance of the photos.
    pub mean_radiance: f32,
    /// Share of the pixels that count as independent evidence, at most.
    pub independence: f64,
    /// What is believed of lobes.
    pub prior: &'a LobePrior,
    /// Whether an observation, by its index, takes no part.
    pub is_withheld: &'a (dyn Fn(u32) -> bool + Sync),
    /// The light that reaches an observation directly; `None` where there is no other.
    pub direct: Option<&'a (dyn Fn(u32) -> [f32; 3] + Sync)>,
}

/// What the alternatives make of a tile.
#[derive(Clone, Debug, Default)]
pub struct TileAlternatives {
    /// Row-major texels of the maps.
    pub texels: Vec<u32>,
    /// Their diffuse reflectance under each [`Alternative`] that has one of its own; empty for the others.
    pub rho: [Vec<[f32; 3]>; ALTERNATIVES],
    /// The one lobe that all share, and what is believed of it.
    pub one: Lobe,
    /// The lobes of their own.
    pub own: Vec<Lobe>,
    /// The noise of each alternative; `None` where nothing could be solved.
    pub noise: Option<[StudentNoise; ALTERNATIVES]>,
    /// Seconds of one processor that each took here.
    pub seconds: [f64; ALTERNATIVES],
}

impl TileAlternatives {
    /// Solves the alternatives of a tile that is solved; it is left as it was.
    pub fn of(tile: &mut Tile, terms: &TileTerms) -> Self {
        let &TileTerms { map_size, mean_radiance, independence, prior, is_withheld, direct } = terms;
        let kept: Vec<_> =
            tile.pixels.iter().map(|pixel| (pixel.terms.weight, pixel.terms.arriving, pixel.lobe)).collect();
        let kept_tile = (tile.rho.clone(), tile.lobes.clone(), tile.variance.clone(), tile.one_lobe);
        let kept_numbers = (tile.noise, tile.seconds);
        let mut made = TileAlternatives { texels: tile.texels.clone(), ..TileAlternatives::default() };
        let mut any_withheld = false;
        for pixel in &mut tile.pixels {
            pixel.withheld = is_withheld(pixel.observation);
            if pixel.withheld {
                pixel.terms.weight = 0.0;
                any_withheld = true;
            }
        }
        if tile.pixels.is_empty() {
            return TileAlternatives::default();
        }
        let mut noise = [None; ALTERNATIVES];
        // Each begins at the reflectance that the tile was given and is solved as often: reflectance leans on what it
        // was, so that whoever is solved more often would follow the noise of the pixels further.
        let mut again = |tile: &mut Tile, choice: Alternative| {
            let began = Instant::now();
            tile.rho.clone_from(&kept_tile.0);
            tile.solve_diffuse();
            tile.weigh(mean_radiance);
            tile.solve_diffuse();
            made.rho[choice.index()] = tile.rho.clone();
            noise[choice.index()] = noise_of(tile, mean_radiance);
            made.seconds[choice.index()] += began.elapsed().as_secs_f64();
        };
        let began = Instant::now();
        if any_withheld {
            tile.solve_diffuse();
            tile.weigh(mean_radiance);
            tile.solve_lobes(map_size, tile.independence(independence), (prior, LobeSharing::THOROUGH));
            tile.end();
        }
        let withheld_seconds = began.elapsed().as_secs_f64();
        let own: Vec<Lobe> = tile.lobes.iter().map(|lobe| lobe.mean.map(|value| value as f32)).collect();
        let one = tile.one_lobe;
        again(tile, Alternative::OwnLobes);
        if let Some(direct) = direct {
            for pixel in &mut tile.pixels {
                pixel.terms.arriving = direct(pixel.observation);
            }
            again(tile, Alternative::DirectLight);
            for (pixel, (_, arriving, _)) in tile.pixels.iter_mut().zip(&kept) {
                pixel.terms.arriving = *arriving;
            }
        }
        tile.lobes.fill(one);
        tile.set_lobes();
        again(tile, Alternative::OneLobe);
        tile.pixels.iter_mut().for_each(|pixel| pixel.lobe = [0.0; 3]);
        again(tile, Alternative::Diffuse);

        (tile.rho, tile.lobes, tile.variance, tile.one_lobe) = kept_tile;
        (tile.noise, tile.seconds) = kept_numbers;
        for (pixel, (weight, _, lobe)) in tile.pixels.iter_mut().zip(kept) {
            (pixel.terms.weight, pixel.lobe, pixel.withheld) = (weight, lobe, false);
        }
        made.seconds[Alternative::OwnLobes.index()] += withheld_seconds;
        made.own = own;
        made.one = one.mean.map(|value| value as f32);
        // What is not solved anew has the noise of the solver's own choice.
        let of_own = noise[Alternative::OwnLobes.index()];
        made.noise = of_own.map(|of_own| noise.map(|noise| noise.unwrap_or(of_own)));
        made
    }
}

/// The noise that a solved tile leaves of the pixels that took part; `None` without any.
fn noise_of(tile: &Tile, mean_radiance: f32) -> Option<StudentNoise> {
    let squares: Vec<f64> = tile
        .pixels
        .iter()
        .filter(|pixel| !pixel.withheld && !pixel.clipped)
        .map(|pixel| {
            let square: f32 = tile.residual(pixel).iter().map(|e| e * e).sum();
            f64::from(forgiven(&pixel.terms.radiance, mean_radiance) * square)
        })
        .collect();
    // Each texel has taken a share of the pixels' freedom.
    let left = (squares.len() as f64 - tile.texels.len() as f64) / squares.len().max(1) as f64;
    (!squares.is_empty()).then(|| StudentNoise::fit(&squares, least_noise(mean_radiance), left.max(0.25)))
}
