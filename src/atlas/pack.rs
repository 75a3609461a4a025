//! Charts on the square: even texel density, gutters kept, as large as fits.
//!
//! For one scale the charts are turned into texels, from long to short each laid into the lowest free place of a strip
//! as wide as the map (any place, also holes between and inside other charts), in the best of four quarter turns. The
//! scale is then searched for which the strip is as high as wide. Charts stand on whole texels: what is measured here
//! is what the stored map has.

use super::flatten::FlatChart;
use super::shape::{Boxed, Shape, bounds, least_box};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::parallel;
use glam::{DAffine2, DMat2, DVec2};
use std::collections::HashMap;

/// Trials of the search for the scale.
const TRIALS: usize = 8;
/// Charts up to which large ones are also tried askew.
const FEW_CHARTS: usize = 400;
/// Share of the height that may stay empty when the search ends early.
const GOOD_ENOUGH: f64 = 0.99;

/// Where each chart goes: texels (y up) from chart points.
pub(crate) fn pack(
    charts: &[FlatChart],
    resolution: usize,
    gutter: usize,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Vec<DAffine2>> {
    let boxes = parallel::map_items(charts, |flat| least_box(&flat.points));
    let area: f64 = charts.iter().map(chart_area).sum();
    let longest = boxes.iter().map(|boxed| boxed.size.x).fold(0.0, f64::max);
    let size = resolution as f64;
    if charts.len() > resolution * resolution || longest <= 0.0 || area <= 0.0 {
        return Err(does_not_fit(charts.len(), resolution));
    }
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (boxes[a].size, boxes[b].size);
        (b.x + b.y).total_cmp(&(a.x + a.y)).then(b.y.total_cmp(&a.y))
    });
    let largest_scale = (size - 1.0) / longest;
    let mut scale = (0.7 * size * size / area).sqrt().min(largest_scale);
    let (mut fits, mut fails) = (None::<(f64, Vec<DAffine2>)>, f64::INFINITY);
    let mut trial = 0;
    while trial < TRIALS || (fits.is_none() && trial < 40) {
        let strip = lay(charts, &boxes, &order, scale, resolution, gutter);
        trial += 1;
        progress((trial as f32 / TRIALS as f32).min(1.0));
        let used = strip.height as f64 / size;
        if used <= 1.0 && strip.complete {
            let done = used >= GOOD_ENOUGH || scale >= largest_scale;
            fits = Some((scale, strip.placements));
            if done {
                break;
            }
        } else {
            fails = fails.min(scale);
        }
        // Area grows with the square of the scale; keep the guess between what fits and what fails.
        let aim = if strip.complete { scale * (0.995 / used).sqrt() } else { scale * 0.7 };
        scale = match &fits {
            Some((low, _)) if fails.is_finite() => {
                if fails / low < 1.004 {
                    break;
                }
                aim.clamp(low + 0.15 * (fails - low), fails - 0.15 * (fails - low))
            }
            Some(_) => aim.min(largest_scale),
            None => aim.min(scale * 0.97),
        };
    }
    fits.map(|(_, placements)| placements).ok_or_else(|| does_not_fit(charts.len(), resolution))
}

fn does_not_fit(charts: usize, resolution: usize) -> Error {
    Error::new(ErrorKind::InvalidSetting, format!("{charts} charts do not fit on {resolution} x {resolution} texels"))
        .at(Place::Setting("map-size".into()))
        .remedy("give a larger --map-size, or a mesh of fewer parts")
}

fn chart_area(flat: &FlatChart) -> f64 {
    let corners = |corners: &[u32; 3]| corners.map(|vertex| flat.points[vertex as usize]);
    flat.chart.corners.iter().map(corners).map(|[a, b, c]| (b - a).perp_dot(c - a) / 2.0).sum()
}

struct Laid {
    placements: Vec<DAffine2>,
    height: usize,
    complete: bool,
}

/// Lays all charts at a scale (texels per world unit) into the strip.
fn lay(charts: &[FlatChart], boxes: &[Boxed], order: &[usize], scale: f64, resolution: usize, gutter: usize) -> Laid {
    let poses_of = |&index: &usize| poses(&charts[index], boxes[index], scale, resolution, charts.len());
    let prepared = parallel::map_items(order, poses_of);
    let mut strip = Strip::new(resolution);
    let mut laid = Laid { placements: vec![DAffine2::IDENTITY; charts.len()], height: 0, complete: true };
    let limit = resolution * 3 / 2;
    // Among many charts, one of the size of an earlier one need not look again where that one found no place.
    let mut found: HashMap<(u32, u32), usize> = HashMap::new();
    let class = |shape: &Shape| [shape.width, shape.height].map(|size| (4.0 * (size as f64).log2()) as u32).into();
    for (&index, poses) in order.iter().zip(&prepared) {
        // The pose whose top ends lowest wins; equal ones keep the first.
        let mut best: Option<(usize, usize, usize, usize)> = None;
        for (pose, (_, shape)) in poses.iter().enumerate() {
            let top = best.map_or(limit, |b| b.0 - 1);
            let start = match found.get(&class(shape)) {
                Some(&row) if charts.len() > FEW_CHARTS => row.saturating_sub(shape.height),
                _ => 0,
            };
            if let Some((x, y)) = strip.lowest_place(shape, start, top) {
                best = Some((y + shape.height, pose, x, y));
            }
        }
        let Some((top, pose, x, y)) = best else {
            laid.complete = false;
            break;
        };
        let (place, shape) = &poses[pose];
        strip.occupy(shape, x, y, gutter);
        found.insert(class(shape), y);
        laid.height = laid.height.max(top);
        laid.placements[index] = DAffine2::from_translation(DVec2::new(x as f64, y as f64)) * *place;
    }
    laid
}

/// The ways in which a chart may stand: in its least box, in four quarter turns; a large one among few also askew.
fn poses(flat: &FlatChart, boxed: Boxed, scale: f64, resolution: usize, charts: usize) -> Vec<(DAffine2, Shape)> {
    let large = boxed.size.x * scale * 12.0 > resolution as f64 && charts <= FEW_CHARTS;
    let tilts: &[f64] = if large { &[0.0, 22.5, 45.0, 67.5] } else { &[0.0] };
    let mut poses = Vec::with_capacity(4 * tilts.len());
    for &tilt in tilts {
        let boxed = match tilt {
            0.0 => boxed,
            _ => bounds(&flat.points, DMat2::from_angle(f64::to_radians(tilt)) * boxed.rotation),
        };
        let extent = boxed.size * scale;
        let (width, height) = ((extent.x.ceil() as usize).max(1), (extent.y.ceil() as usize).max(1));
        let slack = (DVec2::new(width as f64, height as f64) - extent) / 2.0;
        let place = DAffine2::from_mat2_translation(boxed.rotation * scale, slack - boxed.low * scale);
        let outline = |vertices: &Vec<u32>| -> Vec<DVec2> {
            vertices.iter().map(|&vertex| place.transform_point2(flat.points[vertex as usize])).collect()
        };
        let loops: Vec<Vec<DVec2>> = flat.chart.loops.iter().map(outline).collect();
        let mut shape = Shape::new(width, height, &loops);
        for turns in 0..4 {
            let motion = quarter_turns(turns, (width as f64, height as f64)) * place;
            let turned = shape.quarter_turn();
            poses.push((motion, std::mem::replace(&mut shape, turned)));
        }
    }
    poses
}

/// The motion that belongs to `Shape::quarter_turn` applied `turns` times to a box of this size.
fn quarter_turns(turns: usize, (width, height): (f64, f64)) -> DAffine2 {
    let columns = |x: DVec2, y: DVec2, shift: DVec2| DAffine2::from_mat2_translation(DMat2::from_cols(x, y), shift);
    match turns {
        0 => DAffine2::IDENTITY,
        1 => columns(DVec2::Y, DVec2::NEG_X, DVec2::new(height, 0.0)),
        2 => columns(DVec2::NEG_X, DVec2::NEG_Y, DVec2::new(width, height)),
        _ => columns(DVec2::NEG_Y, DVec2::X, DVec2::new(0.0, width)),
    }
}

/// A strip of texels with those that are taken, gutters included. A bit is a texel.
struct Strip {
    width: usize,
    words: usize,
    rows: Vec<Vec<u64>>,
    /// Longest run of free texels in each row.
    longest_free: Vec<u32>,
}

impl Strip {
    fn new(width: usize) -> Self {
        Strip { width, words: width.div_ceil(64), rows: Vec::new(), longest_free: Vec::new() }
    }

    /// The lowest place (x, y) from row `start`, then leftmost, whose top `y + height` is at most `top`.
    fn lowest_place(&self, shape: &Shape, start: usize, top: usize) -> Option<(usize, usize)> {
        if shape.width > self.width || shape.height > top {
            return None;
        }
        let mut free = vec![0u64; self.words];
        let mut scratch = vec![0u64; self.words];
        for y in start..=(top - shape.height).min(self.rows.len()) {
            let row_at = |row: u32| self.rows.get(y + row as usize).map(|bits| (row as usize, bits));
            let too_narrow = |&row: &u32| {
                self.longest_free.get(y + row as usize).is_some_and(|&free| free < shape.longest[row as usize])
            };
            if shape.order.iter().any(too_narrow) {
                continue;
            }
            fill_low_bits(&mut free, self.width - shape.width + 1);
            let mut open = true;
            'rows: for (row, bits) in shape.order.iter().filter_map(|&row| row_at(row)) {
                for &(first, end) in &shape.rows[row] {
                    taken_within(bits, first as usize, (end - first) as usize, &mut scratch);
                    let mut any = 0;
                    for (free, taken) in free.iter_mut().zip(&scratch) {
                        *free &= !taken;
                        any |= *free;
                    }
                    if any == 0 {
                        open = false;
                        break 'rows;
                    }
                }
            }
            if open && let Some(word) = free.iter().position(|&word| word != 0) {
                return Some((word * 64 + free[word].trailing_zeros() as usize, y));
            }
        }
        None
    }

    /// Takes the texels of a shape and a gutter around them.
    fn occupy(&mut self, shape: &Shape, x: usize, y: usize, gutter: usize) {
        let top = y + shape.height + gutter;
        if self.rows.len() < top {
            self.rows.resize(top, vec![0; self.words]);
            self.longest_free.resize(top, self.width as u32);
        }
        for (row, runs) in shape.rows.iter().enumerate() {
            for target in (y + row).saturating_sub(gutter)..=y + row + gutter {
                if target >= top {
                    continue;
                }
                for &(first, end) in runs {
                    let first = (x + first as usize).saturating_sub(gutter);
                    let end = (x + end as usize + gutter).min(self.width);
                    set_bits(&mut self.rows[target], first, end);
                }
            }
        }
        for row in y.saturating_sub(gutter)..top {
            self.longest_free[row] = longest_free_run(&self.rows[row], self.width);
        }
    }
}

/// Sets bit `x` of `out` when any of the `length` bits from `x + first` is set: bits are shifted together in doubling
/// steps.
fn taken_within(bits: &[u64], first: usize, length: usize, out: &mut [u64]) {
    let words = bits.len();
    let (skip, shift) = (first / 64, first % 64);
    for (word, out) in out.iter_mut().enumerate() {
        let low = bits.get(word + skip).copied().unwrap_or(0);
        let high = bits.get(word + skip + 1).copied().unwrap_or(0);
        *out = if shift == 0 { low } else { low >> shift | high << (64 - shift) };
    }
    let mut covered = 1;
    while covered < length {
        let step = covered.min(length - covered);
        let (skip, shift) = (step / 64, step % 64);
        // Words are read at or above the one written: in place is safe from below upwards.
        for word in 0..words {
            let low = out.get(word + skip).copied().unwrap_or(0);
            let high = out.get(word + skip + 1).copied().unwrap_or(0);
            out[word] |= if shift == 0 { low } else { low >> shift | high << (64 - shift) };
        }
        covered += step;
    }
}

fn fill_low_bits(words: &mut [u64], count: usize) {
    for (index, word) in words.iter_mut().enumerate() {
        let left = count.saturating_sub(index * 64);
        *word = if left >= 64 { u64::MAX } else { (1u64 << left) - 1 };
    }
}

fn set_bits(words: &mut [u64], first: usize, end: usize) {
    for (index, word) in words.iter_mut().enumerate().take(end.div_ceil(64)).skip(first / 64) {
        let low = first.saturating_sub(index * 64);
        let high = (end - index * 64).min(64);
        let upto = if high == 64 { u64::MAX } else { (1u64 << high) - 1 };
        *word |= upto & (u64::MAX << low);
    }
}

fn longest_free_run(words: &[u64], width: usize) -> u32 {
    let (mut longest, mut run, mut at) = (0, 0, 0);
    while at < width {
        let (word, bit) = (words[at / 64] >> (at % 64), at % 64);
        if word & 1 == 1 {
            longest = longest.max(run);
            run = 0;
            at += word.trailing_ones() as usize;
        } else {
            let zeros = (word.trailing_zeros() as usize).min(64 - bit).min(width - at);
            run += zeros;
            at += zeros;
        }
    }
    longest.max(run) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifted_runs_agree_with_a_search_bit_by_bit() {
        let mut bits = vec![0u64; 4];
        for (first, end) in [(3, 5), (60, 70), (130, 131), (250, 256)] {
            set_bits(&mut bits, first, end);
        }
        let is_set = |x: usize| x < 256 && bits[x / 64] >> (x % 64) & 1 == 1;
        for (first, length) in [(0, 1), (2, 7), (63, 64), (5, 100), (64, 129)] {
            let mut out = vec![0; 4];
            taken_within(&bits, first, length, &mut out);
            for x in 0..256 {
                let expected = (x + first..x + first + length).any(is_set);
                assert_eq!(out[x / 64] >> (x % 64) & 1 == 1, expected, "x {x} first {first} length {length}");
            }
        }
        assert_eq!(longest_free_run(&bits, 256), 119);
    }
}
