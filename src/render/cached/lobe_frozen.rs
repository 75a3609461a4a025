//! Lobes as weights of the light that their points see.
//!
//! Neither normal nor viewer, width nor microfacets change with the light. So each lobe is kept as its row over the hats,
//! and under any light is the sum of their products: no root, power or quotient is taken again. Rows are kept as upper
//! halves of single numbers, three digits of any size, block by block of those that matter. Schlick's factor belongs to
//! the hats' directions alone, and is worked out beside them.

use super::light_basis::LightBasis;
use super::lobe_place::{LobePlace, LobeSums};
use super::lobe_sum::add_lobe_row;
use super::seen_light::SeenLight;
use crate::math::vector::{Vector, WIDEST, versions};
use glam::Vec3;
use half::bf16;

/// Blocks of hats with less than this share of a row's sum are left out.
const LEAST_SHARE: f32 = 1e-6;

/// Rows of lobes, in the order in which they were added.
#[derive(Clone, Debug, Default)]
pub struct FrozenLobes {
    /// Where the blocks of each row end.
    ends: Vec<u32>,
    /// Which [`WIDEST`] hats a block is of.
    blocks: Vec<u16>,
    /// Their weights, as the upper halves of `f32`.
    weights: Vec<u16>,
}

/// What the sums of rows need room for, kept from row to row.
#[derive(Clone, Debug, Default)]
pub struct FrozenScratch {
    row: Vec<f32>,
    schlick: Vec<f32>,
    all_blocks: Vec<u16>,
}

impl FrozenLobes {
    /// Memory of the rows in bytes, about.
    pub fn bytes(&self) -> usize {
        4 * self.ends.len() + 2 * self.blocks.len() + 2 * self.weights.len()
    }

    /// Adds the row of a lobe of this width over the hats of `basis`. What the place sees is not asked.
    pub fn add(&mut self, basis: &LightBasis, place: &LobePlace, width: f32, scratch: &mut FrozenScratch) {
        scratch.row.clear();
        scratch.row.resize(basis.padded(), 0.0);
        // With 1 for both there is no Fresnel term in it.
        add_lobe_row(basis, place, width, [1.0, 1.0], &mut scratch.row);
        let least = LEAST_SHARE * scratch.row.iter().sum::<f32>();
        for (block, weights) in (0..).zip(scratch.row.chunks_exact(WIDEST)) {
            if weights.iter().sum::<f32>() > least {
                self.blocks.push(block);
                self.weights.extend(weights.iter().map(|&weight| bf16::from_f32(weight).to_bits()));
            }
        }
        self.ends.push(self.blocks.len() as u32);
    }

    fn row(&self, index: usize) -> (&[u16], &[u16]) {
        let begin = if index == 0 { 0 } else { self.ends[index - 1] as usize };
        let end = self.ends[index] as usize;
        (&self.blocks[begin..end], &self.weights[WIDEST * begin..WIDEST * end])
    }

    /// The integrals of rows over the hats of `basis` that have one viewer, among what their point sees in these.
    pub fn sums(
        &self,
        rows: std::ops::Range<usize>,
        (basis, to_viewer): (&LightBasis, Vec3),
        seen: &SeenLight,
        scratch: &mut FrozenScratch,
    ) -> impl Iterator<Item = LobeSums> {
        let FrozenScratch { schlick, all_blocks, .. } = scratch;
        schlick.resize(basis.padded(), 0.0);
        if rows.len() == 1 {
            schlick_of(basis, to_viewer, self.row(rows.start).0, schlick);
        } else if !rows.is_empty() {
            // Several widths have most of their hats in common.
            all_blocks.clear();
            all_blocks.extend(0..(basis.padded() / WIDEST) as u16);
            schlick_of(basis, to_viewer, all_blocks, schlick);
        }
        let schlick = &*schlick;
        rows.map(|row| {
            let (blocks, weights) = self.row(row);
            products(&seen.channels, schlick, blocks, weights)
        })
    }
}

versions! {
    /// Schlick's factor at the hats of blocks.
    fn schlick_of(basis: &LightBasis, to_viewer: Vec3, blocks: &[u16], made: &mut [f32]) = schlick_in;
    /// The sums of a row.
    fn products(seen: &[Vec<f32>; 3], schlick: &[f32], blocks: &[u16], weights: &[u16]) -> LobeSums = products_in;
}

#[inline(always)]
fn schlick_in<V: Vector>(basis: &LightBasis, to_viewer: Vec3, blocks: &[u16], made: &mut [f32]) {
    let [x, y, z] = &basis.direction;
    let (half, one, two) = (V::splat(0.5), V::splat(1.0), V::splat(2.0));
    let (viewer_x, viewer_y, viewer_z) = (V::splat(to_viewer.x), V::splat(to_viewer.y), V::splat(to_viewer.z));
    for &block in blocks {
        for at in (usize::from(block) * WIDEST..(usize::from(block) + 1) * WIDEST).step_by(V::LANES) {
            let (x, y, z) = (V::load(&x[at..]), V::load(&y[at..]), V::load(&z[at..]));
            let cosine = viewer_z.mul_add(z, viewer_y.mul_add(y, viewer_x.mul(x)));
            // h.o = |i + o| / 2.
            let length = cosine.mul_add(two, two).max(V::splat(0.0)).sqrt();
            let rest = one.sub(length.mul(half)).max(V::splat(0.0));
            let squared = rest.mul(rest);
            squared.mul(squared).mul(rest).store(&mut made[at..]);
        }
    }
}

#[inline(always)]
fn products_in<V: Vector>(seen: &[Vec<f32>; 3], schlick: &[f32], blocks: &[u16], weights: &[u16]) -> LobeSums {
    let [red, green, blue] = seen;
    let mut whole = [V::splat(0.0); 3];
    let mut grazing = [V::splat(0.0); 3];
    for (&block, weights) in blocks.iter().zip(weights.chunks_exact(WIDEST)) {
        let begin = usize::from(block) * WIDEST;
        for lane in (0..WIDEST).step_by(V::LANES) {
            let at = begin + lane;
            let weight = V::load_upper_halves(&weights[lane..]);
            let times_schlick = weight.mul(V::load(&schlick[at..]));
            let (r, g, b) = (V::load(&red[at..]), V::load(&green[at..]), V::load(&blue[at..]));
            whole[0] = weight.mul_add(r, whole[0]);
            whole[1] = weight.mul_add(g, whole[1]);
            whole[2] = weight.mul_add(b, whole[2]);
            grazing[0] = times_schlick.mul_add(r, grazing[0]);
            grazing[1] = times_schlick.mul_add(g, grazing[1]);
            grazing[2] = times_schlick.mul_add(b, grazing[2]);
        }
    }
    let mut sums = LobeSums::default();
    for c in 0..3 {
        sums.grazing[c] = grazing[c].sum();
        sums.base[c] = whole[c].sum() - sums.grazing[c];
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::super::light_basis::LightPlanes;
    use super::super::lobe_sum::lobe_alone;
    use super::*;
    use crate::material::LobeModel;

    #[test]
    fn rows_give_the_integrals_of_the_lobes_they_are_of() {
        let basis = LightBasis::new(64, 32);
        let radiance = |hat: usize| [0.2 + 0.1 * (hat % 7) as f32, 1.0, if hat == 700 { 3000.0 } else { 0.3 }];
        let light: LightPlanes = basis.planes(&(0..basis.count()).map(radiance).collect::<Vec<_>>());
        let shares: Vec<u8> = (0..basis.padded()).map(|hat| if hat % 11 == 0 { 90 } else { 255 }).collect();
        let (seen, all) = (SeenLight::of_light(&light, &shares), vec![u8::MAX; basis.padded()]);
        let normal = Vec3::new(0.2, 0.9, -0.1).normalize();
        let (mut scratch, mut most) = (FrozenScratch::default(), 0.0f32);
        for model in [LobeModel::BlinnPhong, LobeModel::Ggx] {
            for to_viewer in [Vec3::new(0.5, 0.8, 0.3).normalize(), Vec3::new(0.9, 0.35, -0.2).normalize()] {
                let place = LobePlace { normal, to_viewer, shares: &shares, seen: &seen, normal_variance: 0.0, model };
                let open = LobePlace { shares: &all, ..place };
                let widths = [0.05, 0.12, 0.24, 0.26, 0.5, 0.9];
                let mut frozen = FrozenLobes::default();
                widths.iter().for_each(|&width| frozen.add(&basis, &open, width, &mut scratch));
                let sums: Vec<LobeSums> =
                    frozen.sums(0..widths.len(), (&basis, to_viewer), &seen, &mut scratch).collect();
                assert_eq!(sums.len(), widths.len());
                for (&width, own) in widths.iter().zip(&sums) {
                    let truth = lobe_alone(&basis, &place, width);
                    for c in 0..3 {
                        let (own, truth) = (own.radiance([0.3; 3])[c], truth.radiance([0.3; 3])[c]);
                        assert!((own - truth).abs() < 0.01 * truth, "{model:?} {width} {c}: {own} for {truth}");
                        most = most.max((own / truth - 1.0).abs());
                    }
                }
                assert!(frozen.bytes() < 2 * widths.len() * basis.padded(), "{}", frozen.bytes());
            }
        }
        println!("off by {most} at most");
    }
}
