//! The descent of the [objective](super::objective) over all texels at once, from whole pixels.
//!
//! A pixel's radiance is taken as linear in the numbers of its texels, beliefs as the parabola that touches them
//! ([`super::neighbours`]), and conjugate gradients go down what that makes (Gauss and Newton). The step is halved until the
//! objective itself, with lobes integrated anew and light between surfaces as the new maps have it, is less; a step that
//! never is leaves all as it was. Noise and gains are learned before each step, and stay while the objective falls.

use super::estimate::Estimate;
use super::neighbours::{Neighbours, Parabola};
use super::objective::{Learned, Objective};
use super::pixel_system::{Lanes, PieceRow, PixelSystem, Rows};
use super::pixels::{Piece, Pixels};
use super::report::ErrorSums;
use super::scene::SolverScene;
use crate::material::Material;
use crate::render::cached::lobe_sum::lobe_with_derivative;
use crate::render::cached::{CachedTransport, SeenLight};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Observations whose lobes are integrated together, sorted by the points of the grid that serve them.
const TOGETHER: usize = 4096;
/// Texels that one sum of a dot product goes over: sums are the same whatever the number of threads.
const CHUNK: usize = 1 << 14;
/// Steps down.
const STEPS: [Step; 4] = [
    Step { iterations: 12, moves_widths: false },
    Step { iterations: 12, moves_widths: false },
    Step { iterations: 12, moves_widths: true },
    Step { iterations: 24, moves_widths: true },
];
/// Times that a step is halved.
const HALVINGS: usize = 3;
/// How far the logarithm of a width may go in one step: farther off its slope is another.
const WIDTH_REACH: f32 = 0.3;

/// A step down.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// Iterations of conjugate gradients.
    pub(super) iterations: usize,
    /// Whether widths move, and light between surfaces follows: lobes have to be integrated anew then. Without, pixels are
    /// linear in the texels, and no integral is needed.
    pub(super) moves_widths: bool,
}

/// Light without which there are only colours, or the one that was found.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Lit {
    /// A texture without a light: a pixel is the mean of its texels' diffuse colours.
    No,
    /// The estimate's light, lobes and light between surfaces.
    Yes,
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

/// Where a descent ended.
pub struct Descended {
    /// The texels.
    pub texels: Vec<Material<f32>>,
    /// Noise and gains.
    pub learned: Learned,
    /// The objective before and after each step, by what was learned then.
    pub steps: Vec<[Objective; 2]>,
    /// Precision of each number of a texel by its pixels alone; 0 where none shows it.
    pub precision: Vec<Lanes>,
    /// Squared errors of unclipped pixels in units of the photos.
    pub errors: ErrorSums,
}

impl SolverScene {
    /// What pixels see. `None` when `stop` was raised.
    pub(super) fn sight(
        &self,
        pixels: &Pixels,
        system: &mut PixelSystem,
        estimate: &Estimate,
        texels: &[Material<f32>],
        lit: Lit,
        stop: &AtomicBool,
    ) -> Option<Sight> {
        let lanes: Vec<Lanes> = texels.par_iter().map(lanes_of).collect();
        let means = system.means(&lanes);
        let light = (lit == Lit::Yes).then(|| {
            let planes = self.transport.basis.planes(&estimate.light);
            let at_points = self.point_light(texels, &planes);
            (planes, at_points)
        });
        let count = pixels.count();
        let chunks: Vec<(Vec<PieceRow>, Vec<[f32; 3]>)> = (0..count.div_ceil(TOGETHER))
            .into_par_iter()
            .map_init(SeenLight::default, |seen, chunk| {
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
                for (_, pixel, which) in order {
                    let Piece { footprints, point } = pixels.piece(pixel, which);
                    let index = pixels.pieces(pixel).start + which;
                    let (row, mean) = (&mut rows[index - first], &means[index]);
                    let radiance = &mut radiance[pixel - range.start];
                    let Some((planes, at_points)) = &light else {
                        row.arriving = [point.share; 3];
                        (0..3).for_each(|c| radiance[c] += point.share * mean[c]);
                        continue;
                    };
                    let arriving = CachedTransport::interpolate(&at_points.arriving, footprints, point);
                    let place = self.transport.lobe_place(point, planes, at_points, seen);
                    let sums = lobe_with_derivative(&self.transport.basis, &place, mean[6].exp());
                    for c in 0..3 {
                        let sent = arriving[c] * mean[c] + mean[3 + c] * sums.base[c] + sums.grazing[c];
                        radiance[c] += point.share * sent;
                        row.arriving[c] = point.share * arriving[c];
                        row.base[c] = point.share * sums.base[c];
                        row.slope[c] = point.share * (mean[3 + c] * sums.d_base[c] + sums.d_grazing[c]);
                    }
                }
                (rows, radiance)
            })
            .collect();
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let (pieces, radiance): (Vec<_>, Vec<_>) = chunks.into_iter().unzip();
        Some(Sight { pieces: Arc::new(pieces.concat()), radiance: radiance.concat() })
    }

    /// Goes down from `estimate`'s texels. `None` when `stop` was raised.
    pub(super) fn descend(
        &self,
        estimate: &Estimate,
        start: Vec<Material<f32>>,
        lit: Lit,
        stop: &AtomicBool,
    ) -> Option<Descended> {
        let pixels = Pixels::of(self);
        let mut system = PixelSystem::new(&pixels, self.settings.map_size);
        let mut texels = start;
        let mut sight = self.sight(&pixels, &mut system, estimate, &texels, lit, stop)?;
        let mut learned = Learned::of(&pixels, &sight, None);
        let mut rows = learned.rows(&pixels, &sight);
        let diagonal = system.diagonal(Rows { pieces: &sight.pieces, pixels: &rows });
        let shown: Vec<bool> = diagonal.iter().map(|diagonal| diagonal[0] > 0.0).collect();
        let freedom = self.choose_freedom(&pixels, &sight, (&texels, &shown), lit, stop)?;
        let beliefs = Neighbours::new(self.settings.map_size, &texels, shown, freedom);
        let mut steps = Vec::new();
        let mut is_exact = true;
        for (number, step) in STEPS.into_iter().enumerate() {
            if step.moves_widths && !is_exact {
                sight = self.sight(&pixels, &mut system, estimate, &texels, lit, stop)?;
            }
            if number > 0 {
                learned = Learned::of(&pixels, &sight, Some(&learned));
                rows = learned.rows(&pixels, &sight);
            }
            let before = learned.objective(&pixels, &sight, beliefs.energies(&texels));
            let parabola = beliefs.parabola(&texels);
            let equations = Rows { pieces: &sight.pieces, pixels: &rows };
            let way = conjugate_gradients(&mut system, equations, &parabola, step, stop)?;
            let (mut share, mut after) = (1.0f32, before);
            for _ in 0..=HALVINGS {
                let next = stepped(&texels, &way, share, lit);
                let seen = match step.moves_widths {
                    true => self.sight(&pixels, &mut system, estimate, &next, lit, stop)?,
                    false => sight.moved(&mut system, &difference(&texels, &next)),
                };
                let objective = learned.objective(&pixels, &seen, beliefs.energies(&next));
                if objective.total() < before.total() {
                    (texels, sight, after) = (next, seen, objective);
                    is_exact = step.moves_widths;
                    break;
                }
                share *= 0.5;
            }
            steps.push([before, after]);
        }
        rows = learned.rows(&pixels, &sight);
        let precision = system.diagonal(Rows { pieces: &sight.pieces, pixels: &rows });
        let mut errors = ErrorSums::new(self.views.len());
        for (index, row) in rows.iter().enumerate().filter(|(_, row)| row.weight > 0.0) {
            let own = pixels.pixel(index);
            if !own.clipped {
                errors.add(own.view as usize, row.left.iter().map(|left| f64::from(left * left)).sum::<f64>() / 3.0);
            }
        }
        Some(Descended { texels, learned, steps, precision, errors })
    }
}

/// The numbers of a texel, and a gap.
fn lanes_of(texel: &Material<f32>) -> Lanes {
    let [a, b, c, d, e, f, log_width] = texel.to_array();
    [a, b, c, d, e, f, log_width, 0.0]
}

/// Texels after a share of a step, within what there is.
pub(super) fn stepped(texels: &[Material<f32>], step: &[Lanes], share: f32, lit: Lit) -> Vec<Material<f32>> {
    let most = if lit == Lit::Yes { 1.0 } else { f32::MAX };
    let one = |(texel, step): (&Material<f32>, &Lanes)| {
        let own = texel.to_array();
        let moved = std::array::from_fn(|lane| {
            let moved = own[lane] + share * step[lane];
            match lane {
                _ if !moved.is_finite() => own[lane],
                0..3 => moved.clamp(0.0, most),
                3..6 => moved.clamp(0.0, 1.0),
                _ => moved.clamp(own[6] - WIDTH_REACH, (own[6] + WIDTH_REACH).min(0.0)),
            }
        });
        Material::from_array(moved)
    };
    texels.par_iter().zip(step).map(one).collect()
}

/// How far texels went.
pub(super) fn difference(from: &[Material<f32>], to: &[Material<f32>]) -> Vec<Lanes> {
    let one = |(from, to): (&Material<f32>, &Material<f32>)| {
        let (from, to) = (lanes_of(from), lanes_of(to));
        std::array::from_fn(|lane| to[lane] - from[lane])
    };
    from.par_iter().zip(to).map(one).collect()
}

fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let of_chunk = |(a, b): (&[Lanes], &[Lanes])| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    };
    let sums: Vec<f64> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect();
    sums.into_iter().sum()
}

/// `a = factor_of_a a + factor_of_b b`.
fn combine(a: &mut [Lanes], factor_of_a: f32, b: &[Lanes], factor_of_b: f32) {
    a.par_iter_mut().zip(b).for_each(|(a, b)| {
        for k in 0..8 {
            a[k] = factor_of_a * a[k] + factor_of_b * b[k];
        }
    });
}

/// The way to the least of pixels' squares and beliefs' parabola, about. `None` when `stop` was raised.
pub(super) fn conjugate_gradients(
    system: &mut PixelSystem,
    rows: Rows,
    beliefs: &Parabola,
    step: Step,
    stop: &AtomicBool,
) -> Option<Vec<Lanes>> {
    let mut diagonal = system.diagonal(rows);
    diagonal.par_iter_mut().enumerate().for_each(|(texel, diagonal)| {
        let of_beliefs = beliefs.diagonal(texel);
        for k in 0..8 {
            diagonal[k] += of_beliefs[k];
        }
    });
    let precondition = |residual: &[Lanes]| -> Vec<Lanes> {
        let lanes = if step.moves_widths { 7 } else { 6 };
        let one = |(residual, diagonal): (&Lanes, &Lanes)| {
            std::array::from_fn(|k| if k < lanes && diagonal[k] > 0.0 { residual[k] / diagonal[k] } else { 0.0 })
        };
        residual.par_iter().zip(&diagonal).map(one).collect()
    };
    let mut residual = system.pull(rows);
    combine(&mut residual, 1.0, beliefs.slope(), -1.0);
    let mut way = vec![[0.0f32; 8]; residual.len()];
    let mut z = precondition(&residual);
    let mut direction = z.clone();
    let mut power = dot(&residual, &z);
    let first = power;
    for _ in 0..step.iterations {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        if power.is_nan() || power <= 1e-10 * first {
            break;
        }
        let mut product = system.product(rows, &direction);
        beliefs.add_product(&direction, &mut product);
        let along = dot(&direction, &product);
        if along.is_nan() || along <= 0.0 {
            break;
        }
        let length = (power / along) as f32;
        combine(&mut way, 1.0, &direction, length);
        combine(&mut residual, 1.0, &product, -length);
        z = precondition(&residual);
        let next = dot(&residual, &z);
        combine(&mut direction, (next / power) as f32, &z, 1.0);
        power = next;
    }
    Some(way)
}
