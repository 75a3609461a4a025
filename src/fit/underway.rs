//! Maps and light within a step of the solver, for who watches: a descent over all texels takes longer than one likes to
//! wait.

use super::solver::way::Look;
use super::state::FitState;
use crate::image::Image;
use crate::light::Environment;
use crate::material::texels::maps_from_texels;
use crate::material::{Material, MaterialMaps};
use glam::Vec3;

/// Where a step is. The state has nothing of it until the step is done.
pub(crate) struct Underway<'a> {
    /// Makes texels of square maps, and the light.
    pub(super) look: &'a dyn Fn() -> Look<'a>,
    /// Texels along the maps' side.
    pub(super) map_size: usize,
    /// Width and height of the light in texels.
    pub(super) light_size: (usize, usize),
    /// Seconds until the step is done, by what it took to this place; `None` while its level is made ready.
    pub seconds_left: Option<f64>,
    /// Views of the scene with the logarithms of their gains; empty where gains are not fitted.
    pub(super) log_gains: Vec<(usize, f32)>,
    /// Whether a fit may end here; else it is only to be seen.
    pub is_reached: bool,
}

/// Hears of it.
pub(crate) type WatchUnderway<'a> = dyn FnMut(&Underway) + 'a;

/// What a step had reached when it was stopped.
pub(crate) struct Reached {
    texels: Vec<Material<f32>>,
    light: Vec<[f32; 3]>,
    log_gains: Vec<(usize, f32)>,
}

impl Underway<'_> {
    /// The maps by now, and the light.
    pub fn shown(&self) -> (MaterialMaps, Environment) {
        let Look { texels, light } = (self.look)();
        let pixels = light.iter().map(|&radiance| Vec3::from_array(radiance)).collect();
        let radiance = Image::from_pixels(self.light_size.0, self.light_size.1, pixels);
        (maps_from_texels(&texels, self.map_size, self.map_size), Environment { radiance })
    }

    /// A copy of it.
    pub fn reached(&self) -> Reached {
        let Look { texels, light } = (self.look)();
        Reached { texels: texels.into_owned(), light: light.into_owned(), log_gains: self.log_gains.clone() }
    }
}

impl Reached {
    /// Becomes the state, of maps of the same size.
    pub(super) fn put_into(self, state: &mut FitState) {
        (state.texels, state.light) = (self.texels, self.light);
        self.log_gains.into_iter().for_each(|(view, gain)| state.log_gains[view] = gain);
    }
}
