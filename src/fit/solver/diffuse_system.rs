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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::fit::solver::observations::Observation;
    use crate::math::random::SequentialRandom;
    use crate::render::cached::ShadingPoint;

    /// Pixels of two views on maps of `map_size`: each covers some texels side by side, some also one far away.
    pub fn made_up(map_size: usize, pixels: usize) -> (Vec<ViewFootprints>, Observations, Vec<DiffuseRow>) {
        let mut random = SequentialRandom::new(5);
        let texels = map_size * map_size;
        let mut footprints = Vec::new();
        let mut list = Vec::new();
        for view in 0..2 {
            let mut of_view = ViewFootprints {
                width: pixels,
                height: 1,
                points: Vec::new(),
                texels: Vec::new(),
                lit: Vec::new(),
                escaped: vec![0.0; pixels],
            };
            for pixel in 0..pixels as u32 {
                let first = (random.next_number() * (texels - map_size - 2) as f32) as u32;
                let first_texel = of_view.texels.len() as u32;
                of_view.texels.extend([(first, 0.5), (first + 1, 0.2), (first + map_size as u32, 0.2)]);
                let other = if pixel % 5 == 0 { (random.next_number() * texels as f32) as u32 } else { first };
                of_view.texels.push((other.min(texels as u32 - 1), 0.1));
                of_view.points.push(ShadingPoint::head_on(pixel, first_texel..first_texel + 4, 0..0));
                list.push(Observation { view, point: pixel, texel: first, radiance: [0.0; 3], clipped: false });
            }
            footprints.push(of_view);
        }
        list.sort_by_key(|observation| observation.texel);
        let mut some = || [(); 3].map(|()| random.next_number());
        let rows = (0..list.len())
            .map(|index| DiffuseRow {
                arriving: some().map(|value| 0.5 + value),
                radiance: some(),
                weight: if index % 7 == 0 { 0.0 } else { some()[0] },
            })
            .collect();
        (footprints, Observations { list, ..Observations::default() }, rows)
    }

    /// Mean reflectance under each row times arriving light, tap by tap.
    pub fn plain_models(
        footprints: &[ViewFootprints],
        observations: &Observations,
        rows: &[DiffuseRow],
        of: &[[f32; 3]],
    ) -> Vec<[f64; 3]> {
        let one = |(own, row): (&Observation, &DiffuseRow)| {
            let view = &footprints[own.view as usize];
            let taps = view.texels_of(&view.points[own.point as usize]);
            [0, 1, 2].map(|c| {
                let mean: f64 = taps.iter().map(|&(texel, w)| f64::from(w) * f64::from(of[texel as usize][c])).sum();
                mean * f64::from(row.arriving[c])
            })
        };
        observations.list.iter().zip(rows).map(one).collect()
    }

    #[test]
    fn products_are_those_of_the_footprints_and_the_transposed_is_the_adjoint() {
        let size = 64;
        let (footprints, observations, rows) = made_up(size, 1500);
        let mut system = DiffuseSystem::new(&footprints, &observations, &rows, size);
        assert!(system.parts.len() > 8 && system.parts.iter().any(|part| !part.far.is_empty()));
        let mut random = SequentialRandom::new(9);
        let x: Vec<[f32; 3]> = (0..size * size).map(|_| [(); 3].map(|()| random.next_number())).collect();
        let plain = plain_models(&footprints, &observations, &rows, &x);
        let models = system.models(&x);
        for ((own, plain), row) in models.iter().zip(&plain).zip(&rows) {
            for c in 0..3 {
                let expected = if row.weight > 0.0 { plain[c] } else { 0.0 };
                assert!((f64::from(own[c]) - expected).abs() < 1e-6, "{own:?} {plain:?}");
            }
        }
        // The dot product of A x with weighted photos is that of x with what the transposed makes of them.
        let transposed = system.transposed(|row| [0, 1, 2].map(|c| row.weight * row.arriving[c] * row.radiance[c]));
        let product = system.normal_product(&x);
        for c in 0..3 {
            let over_rows = |right: &dyn Fn(usize) -> f64| -> f64 {
                (0..rows.len()).map(|k| f64::from(rows[k].weight) * plain[k][c] * right(k)).sum()
            };
            let over_texels = |right: &[[f32; 3]]| -> f64 {
                x.iter().zip(right).map(|(x, right)| f64::from(x[c]) * f64::from(right[c])).sum()
            };
            let (one, other) = (over_rows(&|k| f64::from(rows[k].radiance[c])), over_texels(&transposed));
            assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
            let (one, other) = (over_rows(&|k| plain[k][c]), over_texels(&product));
            assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
        }
    }
}
