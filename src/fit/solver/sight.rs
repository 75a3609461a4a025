//! What pixels see of texels under a light: their radiance, and what it changes by with each number of a texel.

use super::pixel_system::{Lanes, PieceRow, PixelSystem};
use super::pixels::{Piece, Pixels};
use super::scene::SolverScene;
use crate::material::Material;
use crate::math::parallel;
use crate::render::cached::{CachedTransport, SeenRows};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Observations whose lobes are integrated together, sorted by the points of the grid that serve them.
const TOGETHER: usize = 4096;

/// Light without which there are only colours, or the one that was found.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Lit {
    /// A texture without a light: a pixel is the mean of its texels' diffuse colours.
    No,
    /// A light, lobes and light between surfaces.
    Yes,
}

/// Which numbers of a texel a step may move.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Slopes {
    /// Diffuse reflectance and F0, in which radiance is linear.
    OfReflectances,
    /// The logarithm of the width as well: up to three integrals of a lobe in place of one.
    OfWidths,
}

/// What pixels see of an estimate.
pub struct Sight {
    /// The equations of pieces around it, times their shares.
    pub pieces: Arc<Vec<PieceRow>>,
    /// Radiance of each pixel, without the photo's gain.
    pub radiance: Vec<[f32; 3]>,
}

impl Sight {
    /// What some of the pixels see.
    pub(super) fn of_some(&self, pixels: &Pixels, taken: &[usize]) -> Self {
        let pieces = taken.iter().flat_map(|&index| &self.pieces[pixels.pieces(index)]).copied().collect();
        Sight { pieces: Arc::new(pieces), radiance: taken.iter().map(|&index| self.radiance[index]).collect() }
    }

    /// What pixels see after texels went this far, by the equations around where they were.
    pub(super) fn moved(&self, system: &mut PixelSystem, by: &[Lanes]) -> Self {
        let sent = system.sent(&self.pieces, by);
        let radiance = self.radiance.iter().zip(sent).map(|(own, more)| [0, 1, 2].map(|c| own[c] + more[c]));
        Sight { pieces: Arc::clone(&self.pieces), radiance: radiance.collect() }
    }
}

impl SolverScene {
    /// What pixels see of these texels under a light. `None` when `stop` was raised.
    pub(super) fn sight(
        &self,
        (pixels, system): (&Pixels, &mut PixelSystem),
        light: &[[f32; 3]],
        texels: &[Material<f32>],
        (lit, slopes): (Lit, Slopes),
        stop: &AtomicBool,
    ) -> Option<Sight> {
        let lanes: Vec<Lanes> = texels.par_iter().map(lanes_of).collect();
        let means = system.means(&lanes);
        let lit = (lit == Lit::Yes).then(|| {
            let planes = self.transport.basis.planes(light);
            let at_points = self.point_light(texels, &planes);
            (planes, at_points)
        });
        let count = pixels.count();
        let chunks = parallel::map(count.div_ceil(TOGETHER), |chunk| {
            let range = chunk * TOGETHER..((chunk + 1) * TOGETHER).min(count);
            let first = pixels.pieces(range.start).start;
            let mut rows = vec![PieceRow::default(); pixels.pieces(range.end - 1).end - first];
            let mut radiance = vec![[0.0f32; 3]; range.len()];
            if stop.load(Ordering::Relaxed) {
                return (rows, radiance);
            }
            let mut order: Vec<(u32, usize, usize)> = range
                .clone()
                .flat_map(|pixel| (0..pixels.pieces(pixel).len()).map(move |which| (pixel, which)))
                .map(|(pixel, which)| (pixels.piece(pixel, which).point.lobe_point, pixel, which))
                .collect();
            order.sort_unstable();
            let mut seen = SeenRows::default();
            for (_, pixel, which) in order {
                let Piece { footprints, point } = pixels.piece(pixel, which);
                let index = pixels.pieces(pixel).start + which;
                let (row, mean) = (&mut rows[index - first], &means[index]);
                let radiance = &mut radiance[pixel - range.start];
                let Some((planes, at_points)) = &lit else {
                    row.arriving = [point.share; 3];
                    (0..3).for_each(|c| radiance[c] += point.share * mean[c]);
                    continue;
                };
                let arriving = CachedTransport::interpolate(&at_points.arriving, footprints, point);
                let has_slope = slopes == Slopes::OfWidths;
                let sums = self.transport.lobe_at(point, (planes, at_points), &mut seen, mean[6].exp(), has_slope);
                for c in 0..3 {
                    let sent = arriving[c] * mean[c] + mean[3 + c] * sums.base[c] + sums.grazing[c];
                    radiance[c] += point.share * sent;
                    row.arriving[c] = point.share * arriving[c];
                    row.base[c] = point.share * sums.base[c];
                    row.slope[c] = point.share * (mean[3 + c] * sums.d_base[c] + sums.d_grazing[c]);
                }
            }
            (rows, radiance)
        });
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let (pieces, radiance): (Vec<_>, Vec<_>) = chunks.into_iter().unzip();
        Some(Sight { pieces: Arc::new(pieces.concat()), radiance: radiance.concat() })
    }
}

/// The numbers of a texel, and a gap.
pub(super) fn lanes_of(texel: &Material<f32>) -> Lanes {
    let [a, b, c, d, e, f, log_width] = texel.to_array();
    [a, b, c, d, e, f, log_width, 0.0]
}
