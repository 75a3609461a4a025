//! A fit that keeps its maps: the solver finds the light of new photos alone.

use super::adam::Moments;
use super::fitter::Fitter;
use super::known_maps::{KnownMaps, none_given};
use super::solver::{Estimate, SolverScene, TexelVariance};
use super::stage_work::halved;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::material::texels::texels_from_maps;
use std::sync::Arc;

impl Fitter {
    /// Takes the maps that are kept, for a fit that begins or is taken up with
    /// [`fixed_maps`](super::FitSettings::fixed_maps).
    ///
    /// # Errors
    /// `InvalidSetting` when the fit keeps no maps, or has maps of another size.
    pub fn take_maps(&mut self, known: Arc<KnownMaps>) -> Result<()> {
        let wrong = |name: &str, message: String, remedy: &str| {
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())).remedy(remedy))
        };
        if !self.settings.fixed_maps {
            return wrong("fixed-maps", "maps are given that are not to be kept".into(), "turn it on");
        }
        let size = (known.maps.diffuse.width(), known.maps.diffuse.height());
        let own = self.settings.map_size;
        if size != (own, own) {
            let message = format!("the maps to keep are {} x {}, those of this fit {own} x {own}", size.0, size.1);
            return wrong("map-size", message, "leave out --map-size: the maps keep theirs");
        }
        self.state.texels = texels_from_maps(&known.maps);
        self.state.moments = Moments::zeros(self.state.texels.len());
        self.state.map_size = own;
        self.known_maps = Some(known);
        Ok(())
    }

    /// The maps that are kept, where some are.
    pub fn known_maps(&self) -> Option<&Arc<KnownMaps>> {
        self.known_maps.as_ref()
    }

    /// What the solver begins a round with where maps are kept: those of its level, the light so far.
    pub(super) fn estimate_of_known(&self, solver: &SolverScene) -> Result<Estimate> {
        let Some(known) = &self.known_maps else {
            return Err(none_given());
        };
        let (mut texels, mut size) = (self.state.texels.clone(), self.state.map_size);
        let mut is_seen: Vec<bool> = known.times_seen.pixels().iter().map(|&times| times > 0.0).collect();
        while size > solver.settings.map_size {
            texels = halved(&texels, size);
            is_seen = all_of_four(&is_seen, size);
            size /= 2;
        }
        let solved = TexelVariance { lobe_cluster_size: 1.0, ..TexelVariance::default() };
        let variance = |seen: bool| if seen { solved } else { TexelVariance::default() };
        Ok(Estimate {
            texels,
            variances: is_seen.into_iter().map(variance).collect(),
            light: self.state.light.clone(),
            light_known: self.light_known.clone(),
            log_gains: solver.views.iter().map(|&view| self.state.log_gains[view]).collect(),
        })
    }
}

/// Of maps of half the size, which texels have all of their four.
fn all_of_four(of: &[bool], size: usize) -> Vec<bool> {
    let half = size / 2;
    let four = |index: usize| {
        let first = 2 * (index / half) * size + 2 * (index % half);
        [first, first + 1, first + size, first + size + 1]
    };
    (0..half * half).map(|index| four(index).into_iter().all(|texel| of[texel])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_texel_is_known_where_all_of_it_is() {
        let seen: Vec<bool> = (0..16).map(|texel| texel != 5).collect();
        assert_eq!(all_of_four(&seen, 4), [false, true, true, true]);
    }
}
