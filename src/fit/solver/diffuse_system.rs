//! The equations of all pixels for diffuse reflectance, as a sparse matrix in parts.
//!
//! A pixel's texels lie among the footprints of its view, and pixels that share texels are of many views: read there, each
//! row waits for memory. So taps are copied once, in the order of the rows. Rows are sorted by texel, so a part of them
//! touches a range of texels and few beyond it (the other side of a seam); it works on a copy of those, whose sums are then
//! added up part by part. On photographs of 0.8 million pixels and maps of 2048 x 2048 that makes a product ten times as
//! fast as scattering each part into maps of its own.

use super::observations::Observations;
use crate::render::cached::ViewFootprints;
use rayon::prelude::*;
use std::ops::Range;

/// Number of parts, whatever the number of threads: sums are the same then.
const PARTS: usize = 64;
/// Rows of the maps above and below its own texels that a part holds as well.
const MARGIN: usize = 4;

/// One pixel's equation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiffuseRow {
    /// Arriving light: times the mean reflectance under the footprint.
    pub arriving: [f32; 3],
    /// Photo less lobe.
    pub radiance: [f32; 3],
    /// Weight; 0 leaves it out.
    pub weight: f32,
}

/// Three channels and a gap, which fill one register.
type Channels = [f32; 4];

/// The equations.
pub struct DiffuseSystem<'a> {
    rows: &'a [DiffuseRow],
    parts: Vec<Part>,
    texels: usize,
}

struct Part {
    rows: Range<usize>,
    /// Where the taps of each row end.
    ends: Vec<u32>,
    /// Place among the texels of the part, and weight.
    taps: Vec<(u32, f32)>,
    /// Its texels: a range, and after it these.
    near: Range<usize>,
    far: Vec<u32>,
    values: Vec<Channels>,
    sums: Vec<Channels>,
}

impl<'a> DiffuseSystem<'a> {
    /// The equations of observations, one row each, over the texels of square maps of `map_size`.
    pub fn new(
        footprints: &[ViewFootprints],
        observations: &Observations,
        rows: &'a [DiffuseRow],
        map_size: usize,
    ) -> Self {
        let step = rows.len().div_ceil(PARTS).max(1);
        let parts = (0..rows.len().div_ceil(step))
            .into_par_iter()
            .map(|which| {
                let range = which * step..((which + 1) * step).min(rows.len());
                Part::new(footprints, observations, rows, range, map_size)
            })
            .collect();
        DiffuseSystem { rows, parts, texels: map_size * map_size }
    }

    /// Mean reflectance under each row's footprint times the light that arrives there.
    pub fn models(&mut self, reflectance: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let rows = self.rows;
        let of_parts: Vec<Vec<[f32; 3]>> = self
            .parts
            .par_iter_mut()
            .map(|part| {
                part.hold(reflectance);
                let one = |place: usize| {
                    let (under, row) = (part.under(part.taps_of(place)), &rows[part.rows.start + place]);
                    [0, 1, 2].map(|c| under[c] * row.arriving[c])
                };
                (0..part.ends.len()).map(one).collect()
            })
            .collect();
        of_parts.concat()
    }

    /// Transposed matrix times what `value` makes of each row that counts.
    pub fn transposed(&mut self, value: impl Fn(&DiffuseRow) -> [f32; 3] + Sync) -> Vec<[f32; 3]> {
        self.summed(None, |row, _| {
            let [red, green, blue] = value(row);
            [red, green, blue, 0.0]
        })
    }

    /// Transposed matrix times weights times matrix times reflectances.
    pub fn normal_product(&mut self, reflectance: &[[f32; 3]]) -> Vec<[f32; 3]> {
        self.summed(Some(reflectance), |row, under| {
            let [red, green, blue] = row.arriving.map(|arriving| row.weight * arriving * arriving);
            [red * under[0], green * under[1], blue * under[2], 0.0]
        })
    }

    fn summed(
        &mut self,
        reflectance: Option<&[[f32; 3]]>,
        value: impl Fn(&DiffuseRow, Channels) -> Channels + Sync,
    ) -> Vec<[f32; 3]> {
        let rows = self.rows;
        self.parts.par_iter_mut().for_each(|part| {
            if let Some(reflectance) = reflectance {
                part.hold(reflectance);
            }
            let mut sums = std::mem::take(&mut part.sums);
            sums.clear();
            sums.resize(part.near.len() + part.far.len(), [0.0; 4]);
            for place in 0..part.ends.len() {
                let row = &rows[part.rows.start + place];
                if row.weight <= 0.0 {
                    continue;
                }
                let taps = part.taps_of(place);
                let under = if reflectance.is_some() { part.under(taps) } else { [0.0; 4] };
                let value = value(row, under);
                for &(texel, weight) in taps {
                    let sum = &mut sums[texel as usize];
                    for c in 0..4 {
                        sum[c] += weight * value[c];
                    }
                }
            }
            part.sums = sums;
        });
        let mut total = vec![[0.0f32; 3]; self.texels];
        for part in &self.parts {
            let (near, far) = part.sums.split_at(part.near.len());
            let add = |total: &mut [f32; 3], sum: &Channels| (0..3).for_each(|c| total[c] += sum[c]);
            total[part.near.clone()].iter_mut().zip(near).for_each(|(total, sum)| add(total, sum));
            part.far.iter().zip(far).for_each(|(&texel, sum)| add(&mut total[texel as usize], sum));
        }
        total
    }
}

impl Part {
    fn new(
        footprints: &[ViewFootprints],
        observations: &Observations,
        rows: &[DiffuseRow],
        range: Range<usize>,
        map_size: usize,
    ) -> Self {
        let of = &observations.list[range.clone()];
        let (first, last) = (of.first().map_or(0, |own| own.texel), of.last().map_or(0, |own| own.texel));
        let margin = MARGIN * map_size;
        let near = (first as usize).saturating_sub(margin)..(last as usize + 1 + margin).min(map_size * map_size);
        let mut part = Part {
            rows: range,
            ends: Vec::with_capacity(of.len()),
            taps: Vec::new(),
            near: near.clone(),
            far: Vec::new(),
            values: Vec::new(),
            sums: Vec::new(),
        };
        for (observation, row) in of.iter().zip(&rows[part.rows.clone()]) {
            let view = &footprints[observation.view as usize];
            // What does not count is not held.
            if row.weight > 0.0 {
                part.taps.extend_from_slice(view.texels_of(&view.points[observation.point as usize]));
            }
            part.ends.push(part.taps.len() as u32);
        }
        let is_far = |texel: u32| !near.contains(&(texel as usize));
        part.far = part.taps.iter().map(|tap| tap.0).filter(|&texel| is_far(texel)).collect();
        part.far.sort_unstable();
        part.far.dedup();
        for (texel, _) in &mut part.taps {
            *texel = match part.far.binary_search(texel) {
                Ok(place) => (near.len() + place) as u32,
                Err(_) => *texel - near.start as u32,
            };
        }
        part.taps.shrink_to_fit();
        part
    }

    /// Taps of the row at this place of the part.
    #[inline]
    fn taps_of(&self, place: usize) -> &[(u32, f32)] {
        let start = if place == 0 { 0 } else { self.ends[place - 1] };
        &self.taps[start as usize..self.ends[place] as usize]
    }

    /// Copies what the part needs of the texels.
    fn hold(&mut self, texels: &[[f32; 3]]) {
        let wide = |&[red, green, blue]: &[f32; 3]| [red, green, blue, 0.0];
        self.values.clear();
        self.values.extend(texels[self.near.clone()].iter().map(wide));
        self.values.extend(self.far.iter().map(|&texel| wide(&texels[texel as usize])));
    }

    /// Mean of what is held under taps.
    #[inline]
    fn under(&self, taps: &[(u32, f32)]) -> Channels {
        let mut mean = [0.0; 4];
        for &(texel, weight) in taps {
            let value = &self.values[texel as usize];
            for c in 0..4 {
                mean[c] += weight * value[c];
            }
        }
        mean
    }
}
