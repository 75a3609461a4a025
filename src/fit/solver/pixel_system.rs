//! The linearised equations of all pixels over all texels, as a sparse matrix in parts.
//!
//! A pixel's texels lie among the footprints of its view, and pixels that share texels are of many views: read there, each
//! row waits for memory. So taps are copied once, in the order of the pixels. Those are sorted by texel, so a part of them
//! touches a range of texels and few beyond it (the other side of a seam); it works on a copy of those, whose sums are then
//! added up part by part. On photographs of 0.8 million pixels and maps of 2048 x 2048 that makes a product ten times as
//! fast as scattering each part into maps of its own.

use super::pixels::Pixels;
use crate::math::parallel;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Number of parts, whatever the number of threads: sums are the same then.
const PARTS: usize = 64;
/// Rows of the maps above and below its own texels that a part holds as well.
const MARGIN: usize = 4;

/// Texels or pixels that are added up together, here and where sums go over all of them: sums are the same whatever the
/// number of threads.
pub(super) const CHUNK: usize = 1 << 14;

/// The seven numbers of a texel in the order of [`Material::to_array`](crate::material::Material::to_array), and a gap:
/// they fill one wide register.
pub type Lanes = [f32; 8];

/// What a pixel's radiance changes by with the mean of each number under one piece of surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PieceRow {
    /// By diffuse reflectance: arriving light.
    pub arriving: [f32; 3],
    /// By F0.
    pub base: [f32; 3],
    /// By the logarithm of the width.
    pub slope: [f32; 3],
}

/// What a pixel's equation is to give.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelRow {
    /// What is left of the photo.
    pub left: [f32; 3],
    /// What the photo makes of radiance, by channel.
    pub gain: [f32; 3],
    /// Weight; 0 leaves it out.
    pub weight: f32,
}

impl PieceRow {
    /// Adds the radiance that goes along with means of the numbers under the piece.
    #[inline]
    fn add(&self, under: &Lanes, radiance: &mut [f32; 3]) {
        for c in 0..3 {
            radiance[c] += self.arriving[c] * under[c] + self.base[c] * under[3 + c] + self.slope[c] * under[6];
        }
    }

    /// The transposed of [`PieceRow::add`].
    #[inline]
    fn transposed(&self, radiance: [f32; 3]) -> Lanes {
        let mut lanes = [0.0; 8];
        for c in 0..3 {
            lanes[c] = self.arriving[c] * radiance[c];
            lanes[3 + c] = self.base[c] * radiance[c];
            lanes[6] += self.slope[c] * radiance[c];
        }
        lanes
    }
}

/// The equations: pieces and pixels in the order of [`Pixels`].
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Of the pieces.
    pub pieces: &'a [PieceRow],
    /// Of the pixels.
    pub pixels: &'a [PixelRow],
}

/// The matrix.
pub struct PixelSystem {
    parts: Vec<Part>,
    texels: usize,
}

struct Part {
    pixels: Range<usize>,
    pieces: Range<usize>,
    /// Where the pieces of each pixel end, among those of the part.
    ends: Vec<u32>,
    /// Where the taps of each piece end.
    tap_ends: Vec<u32>,
    /// Place among the texels of the part, and weight.
    taps: Vec<(u32, f32)>,
    /// Its texels: a range, and after it these.
    near: Range<usize>,
    far: Vec<u32>,
    values: Vec<Lanes>,
    sums: Vec<Lanes>,
}

impl PixelSystem {
    /// The matrix of all pixels over the texels of square maps of `map_size`.
    pub fn new(pixels: &Pixels, map_size: usize) -> Self {
        let (whole, count) = (pixels.whole(), pixels.count());
        // Both kinds of pixels are sorted by texel, each by itself.
        let cut = |range: Range<usize>, parts: usize| {
            let step = range.len().div_ceil(parts).max(1);
            range.clone().step_by(step).map(move |first| first..(first + step).min(range.end))
        };
        let ranges: Vec<Range<usize>> = cut(0..whole, PARTS).chain(cut(whole..count, PARTS / 4)).collect();
        let parts = parallel::map_items(&ranges, |range| Part::new(pixels, range.clone(), map_size));
        PixelSystem { parts, texels: map_size * map_size }
    }

    /// Means of the texels' numbers under each piece.
    pub fn means(&mut self, texels: &[Lanes]) -> Vec<Lanes> {
        self.of_parts(|part| {
            part.hold(texels);
            (0..part.tap_ends.len()).map(|place| part.under(part.taps_of(place))).collect()
        })
    }

    /// Radiance that texels send to each pixel, by the rows of its pieces.
    pub fn sent(&mut self, rows: &[PieceRow], texels: &[Lanes]) -> Vec<[f32; 3]> {
        self.of_parts(|part| {
            part.hold(texels);
            let rows = &rows[part.pieces.clone()];
            let one = |place: usize| {
                let first = if place == 0 { 0 } else { part.ends[place - 1] };
                let mut sent = [0.0; 3];
                for piece in first as usize..part.ends[place] as usize {
                    rows[piece].add(&part.under(part.taps_of(piece)), &mut sent);
                }
                sent
            };
            (0..part.ends.len()).map(one).collect()
        })
    }

    fn of_parts<T: Clone + Send>(&mut self, of: impl Fn(&mut Part) -> Vec<T> + Sync) -> Vec<T> {
        let parts: Vec<Mutex<&mut Part>> = self.parts.iter_mut().map(Mutex::new).collect();
        parallel::map_items(&parts, |part| of(&mut part.lock().unwrap_or_else(PoisonError::into_inner))).concat()
    }

    /// Transposed matrix times weights times what is left of the photos: half of the negative slope of their weighted squares.
    pub fn pull(&mut self, rows: Rows) -> Vec<Lanes> {
        let mut sums = vec![[0.0; 8]; self.texels];
        self.summed(rows, None, |pixel, _| pixel.left, |row, radiance| row.transposed(radiance), &mut sums);
        sums
    }

    /// Sums over the pixels of each texel, by share, of weights times squares: an upper bound of the diagonal of the normal
    /// equations where one piece fills each pixel.
    pub fn diagonal(&mut self, rows: Rows) -> Vec<Lanes> {
        let squares = |row: &PieceRow, weights: [f32; 3]| {
            let mut lanes = [0.0; 8];
            for c in 0..3 {
                lanes[c] = weights[c] * row.arriving[c] * row.arriving[c];
                lanes[3 + c] = weights[c] * row.base[c] * row.base[c];
                lanes[6] += weights[c] * row.slope[c] * row.slope[c];
            }
            lanes
        };
        let mut sums = vec![[0.0; 8]; self.texels];
        self.summed(rows, None, |pixel, _| pixel.gain, squares, &mut sums);
        sums
    }

    /// Transposed matrix times weights times matrix times numbers of texels, in place of what `product` holds.
    pub fn product(&mut self, rows: Rows, texels: &[Lanes], product: &mut [Lanes]) {
        self.summed(rows, Some(texels), |_, sent| sent, |row, radiance| row.transposed(radiance), product);
    }

    /// Sums over the pieces of each texel, in place of what `total` holds: `of_piece` of what `of_pixel` makes of a pixel and
    /// what texels send it, times its weight.
    fn summed(
        &mut self,
        rows: Rows,
        texels: Option<&[Lanes]>,
        of_pixel: impl Fn(&PixelRow, [f32; 3]) -> [f32; 3] + Sync,
        of_piece: impl Fn(&PieceRow, [f32; 3]) -> Lanes + Sync,
        total: &mut [Lanes],
    ) {
        let of_part = |part: &mut Part| {
            if let Some(texels) = texels {
                part.hold(texels);
            }
            let mut sums = std::mem::take(&mut part.sums);
            sums.clear();
            sums.resize(part.near.len() + part.far.len(), [0.0; 8]);
            let pieces = &rows.pieces[part.pieces.clone()];
            let mut first = 0;
            for (pixel, &end) in rows.pixels[part.pixels.clone()].iter().zip(&part.ends) {
                let own = first..end as usize;
                first = own.end;
                if pixel.weight <= 0.0 {
                    continue;
                }
                let mut sent = [0.0; 3];
                if texels.is_some() {
                    own.clone().for_each(|piece| pieces[piece].add(&part.under(part.taps_of(piece)), &mut sent));
                }
                let sent = [0, 1, 2].map(|c| pixel.gain[c] * sent[c]);
                let of_pixel = of_pixel(pixel, sent);
                let radiance = [0, 1, 2].map(|c| pixel.weight * pixel.gain[c] * of_pixel[c]);
                for piece in own {
                    let value = of_piece(&pieces[piece], radiance);
                    for &(texel, weight) in part.taps_of(piece) {
                        let sum = &mut sums[texel as usize];
                        for k in 0..8 {
                            sum[k] += weight * value[k];
                        }
                    }
                }
            }
            part.sums = sums;
        };
        parallel::each_chunk(&mut self.parts, 1, &|_, parts| parts.iter_mut().for_each(of_part));
        parallel::each_chunk(total, CHUNK, &|chunk, total| {
            total.fill([0.0; 8]);
            self.parts.iter().for_each(|part| part.add_sums(chunk * CHUNK, total));
        });
    }
}

impl Part {
    fn new(all: &Pixels, pixels: Range<usize>, map_size: usize) -> Self {
        let margin = MARGIN * map_size;
        let (first, last) = (all.texel(pixels.start) as usize, all.texel(pixels.end - 1) as usize);
        let near = first.saturating_sub(margin)..(last + 1 + margin).min(map_size * map_size);
        let pieces = all.pieces(pixels.start).start..all.pieces(pixels.end - 1).end;
        let mut ends = Vec::with_capacity(pixels.len());
        let (mut tap_ends, mut taps) = (Vec::with_capacity(pieces.len()), Vec::new());
        for pixel in pixels.clone() {
            for which in 0..all.pieces(pixel).len() {
                let piece = all.piece(pixel, which);
                taps.extend_from_slice(piece.footprints.texels_of(piece.point));
                tap_ends.push(taps.len() as u32);
            }
            ends.push(tap_ends.len() as u32);
        }
        let is_far = |texel: u32| !near.contains(&(texel as usize));
        let mut far: Vec<u32> = taps.iter().map(|tap| tap.0).filter(|&texel| is_far(texel)).collect();
        far.sort_unstable();
        far.dedup();
        for (texel, _) in &mut taps {
            *texel = match far.binary_search(texel) {
                Ok(place) => (near.len() + place) as u32,
                Err(_) => *texel - near.start as u32,
            };
        }
        taps.shrink_to_fit();
        Part { pixels, pieces, ends, tap_ends, taps, near, far, values: Vec::new(), sums: Vec::new() }
    }

    /// Taps of the piece at this place of the part.
    #[inline]
    fn taps_of(&self, place: usize) -> &[(u32, f32)] {
        let start = if place == 0 { 0 } else { self.tap_ends[place - 1] };
        &self.taps[start as usize..self.tap_ends[place] as usize]
    }

    /// Adds its sums to those of the texels from `first` on.
    fn add_sums(&self, first: usize, total: &mut [Lanes]) {
        let add = |total: &mut Lanes, sum: &Lanes| (0..8).for_each(|k| total[k] += sum[k]);
        let (near, far) = self.sums.split_at(self.near.len());
        let own = self.near.start.max(first)..self.near.end.min(first + total.len());
        if !own.is_empty() {
            let near = &near[own.start - self.near.start..own.end - self.near.start];
            total[own.start - first..own.end - first].iter_mut().zip(near).for_each(|(total, sum)| add(total, sum));
        }
        let end = first + total.len();
        let [begin, end] = [first, end].map(|texel| self.far.partition_point(|&own| (own as usize) < texel));
        let far = self.far[begin..end].iter().zip(&far[begin..end]);
        far.for_each(|(&texel, sum)| add(&mut total[texel as usize - first], sum));
    }

    /// Copies what the part needs of the texels.
    fn hold(&mut self, texels: &[Lanes]) {
        self.values.clear();
        self.values.extend_from_slice(&texels[self.near.clone()]);
        self.values.extend(self.far.iter().map(|&texel| texels[texel as usize]));
    }

    /// Mean of what is held under taps.
    #[inline]
    fn under(&self, taps: &[(u32, f32)]) -> Lanes {
        let mut mean = [0.0; 8];
        for &(texel, weight) in taps {
            let value = &self.values[texel as usize];
            for k in 0..8 {
                mean[k] += weight * value[k];
            }
        }
        mean
    }
}
