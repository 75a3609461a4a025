//! Pixels that say something of one texel each, sorted by texel.
//!
//! A pixel counts where the photo shows surface, the rays agree that one piece of surface fills it, and it is finite. It
//! is booked at the texel it covers most; what it covers of the neighbours, and pixels with edges, count in the descent at
//! the end ([`super::pixels`]).

use crate::fit::targets::Target;
use crate::render::cached::ViewFootprints;
use crate::scene::Scene;

/// A pixel and its texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Index among the views of the solver.
    pub view: u32,
    /// Index of the shading point in the view's footprints.
    pub point: u32,
    /// Row-major texel of the maps.
    pub texel: u32,
    /// Linear radiance of the photo.
    pub radiance: [f32; 3],
    /// The radiance is only known to be at least this.
    pub clipped: bool,
}

/// All observations, sorted by texel.
#[derive(Clone, Debug, Default)]
pub struct Observations {
    /// The observations.
    pub list: Vec<Observation>,
    /// Where each texel begins in `list`, and the end of the last.
    pub of_texel: Vec<u32>,
    /// Mean radiance over observations and channels.
    pub mean: f32,
}

impl Observations {
    /// Sorts the observations of all views.
    pub fn of_views(per_view: Vec<Vec<Observation>>, map_size: usize) -> Self {
        let texels = map_size * map_size;
        let mut of_texel = vec![0u32; texels + 1];
        for observation in per_view.iter().flatten() {
            of_texel[observation.texel as usize + 1] += 1;
        }
        for texel in 0..texels {
            of_texel[texel + 1] += of_texel[texel];
        }
        let count = of_texel[texels] as usize;
        let nothing = Observation { view: 0, point: 0, texel: 0, radiance: [0.0; 3], clipped: false };
        let mut list = vec![nothing; count];
        let mut next = of_texel.clone();
        let mut sum = 0.0f64;
        for observation in per_view.into_iter().flatten() {
            let place = &mut next[observation.texel as usize];
            list[*place as usize] = observation;
            *place += 1;
            sum += observation.radiance.iter().map(|&value| f64::from(value.max(0.0))).sum::<f64>() / 3.0;
        }
        Observations { list, of_texel, mean: (sum / count.max(1) as f64) as f32 }
    }

    /// Range of a texel's observations in the list.
    #[inline]
    pub fn range(&self, texel: usize) -> std::ops::Range<usize> {
        self.of_texel[texel] as usize..self.of_texel[texel + 1] as usize
    }
}

/// The observations of one view, in the order of its shading points.
pub(super) fn of_view(scene: &Scene, target: &Target, index: u32, footprints: &ViewFootprints) -> Vec<Observation> {
    let mut made = Vec::new();
    for (point_index, point) in footprints.points.iter().enumerate() {
        if point.share < 0.999 {
            continue;
        }
        let (radiance, state) = target.at(scene, point.pixel as usize);
        if !state.is_surface() {
            continue;
        }
        let mut best = (0u32, 0.0f32);
        for &(texel, weight) in footprints.texels_of(point) {
            if weight > best.1 {
                best = (texel, weight);
            }
        }
        made.push(Observation {
            view: index,
            point: point_index as u32,
            texel: best.0,
            radiance: radiance.to_array(),
            clipped: state.is_clipped(),
        });
    }
    made
}
