//! The light that one point of the grid sees in each hat: as much of the light's own as reaches it, and of other surface
//! where that stands before it.
//!
//! To a lobe both are alike, and all pixels that show the point look into the same: it is put together once a point.

use super::light_basis::{LightBasis, LightPlanes};
use super::points::NO_POINT;
use super::surroundings::{Hiding, Surroundings};
use crate::math::vector::{Vector, WIDEST, versions};
use glam::Vec4;

/// Radiance that a point sees in each hat, times the share of the hat. It is kept from place to place as long as they belong
/// to one point, and serves as long as the light and what surface sends are the same.
#[derive(Clone, Debug)]
pub struct SeenLight {
    /// The point it is of, or [`NO_POINT`].
    point: u32,
    /// One plane a channel, in the order of the light.
    pub(super) channels: [Vec<f32>; 3],
    /// Texel by texel.
    pub(super) texels: Vec<Vec4>,
}

/// What a point sees, by the hats of the light and by pairs of them.
#[derive(Clone, Debug, Default)]
pub struct SeenRows {
    /// By the hats.
    pub fine: SeenLight,
    joined: SeenLight,
    /// Of each pair the share of the upper hat in its solid angle.
    upper_shares: Vec<f32>,
}

impl SeenRows {
    /// By pairs of hats of this basis: for sums over [`LightBasis::with_rows_joined`].
    pub fn joined(&mut self, basis: &LightBasis) -> &SeenLight {
        if self.joined.point != self.fine.point {
            if self.upper_shares.is_empty() {
                let rows = basis.solid_angle[..basis.count()].chunks_exact(2 * basis.width);
                let pairs =
                    rows.map(|rows| rows.split_at(basis.width)).flat_map(|(upper, lower)| upper.iter().zip(lower));
                self.upper_shares = pairs.map(|(upper, lower)| upper / (upper + lower)).collect();
            }
            self.fine.join_rows(basis, &self.upper_shares, &mut self.joined);
        }
        &self.joined
    }
}

impl Default for SeenLight {
    fn default() -> Self {
        SeenLight { point: NO_POINT, channels: Default::default(), texels: Vec::new() }
    }
}

versions! {
    /// A plane of the light, times the shares of its hats in 255ths.
    fn shade(plane: &[f32], shares: &[u8], made: &mut [f32]) = shade_in;
}

#[inline(always)]
fn shade_in<V: Vector>(plane: &[f32], shares: &[u8], made: &mut [f32]) {
    for at in (0..made.len()).step_by(V::LANES) {
        let share = V::load_bytes(&shares[at..]).mul(V::splat(1.0 / 255.0));
        share.mul(V::load(&plane[at..])).store(&mut made[at..]);
    }
}

impl SeenLight {
    /// The light alone, of which these shares are seen: no other surface.
    pub fn of_light(light: &LightPlanes, shares: &[u8]) -> Self {
        let mut made = SeenLight::default();
        made.fill(light, shares);
        made.interleave();
        made
    }

    /// The same with surface that sends this grey radiance where it hides a hat.
    #[cfg(test)]
    pub(super) fn with_surface(light: &LightPlanes, shares: &[u8], mut radiance: impl FnMut(usize) -> f32) -> Self {
        let mut made = SeenLight::of_light(light, shares);
        for hat in 0..light.texels.len() {
            let added = radiance(hat) * (1.0 - f32::from(shares[hat]) / 255.0);
            made.channels.iter_mut().for_each(|plane| plane[hat] += added);
        }
        made.interleave();
        made
    }

    fn fill(&mut self, light: &LightPlanes, shares: &[u8]) {
        for (made, plane) in self.channels.iter_mut().zip(&light.channels) {
            made.resize(plane.len(), 0.0);
            shade(plane, shares, made);
        }
    }

    fn interleave(&mut self) {
        let [red, green, blue] = &self.channels;
        self.texels.clear();
        let texels = red.iter().zip(green).zip(blue).map(|((&red, &green), &blue)| Vec4::new(red, green, blue, 0.0));
        self.texels.extend(texels);
    }

    /// Fills `joined` with what is seen in pairs of hats, each of a row of `basis` and the one below it: their mean by solid
    /// angle, for sums over [`LightBasis::with_rows_joined`] alone.
    fn join_rows(&self, basis: &LightBasis, upper_shares: &[f32], joined: &mut SeenLight) {
        joined.point = self.point;
        for (plane, made) in self.channels.iter().zip(&mut joined.channels) {
            made.clear();
            let rows = plane[..basis.count()].chunks_exact(2 * basis.width);
            for (seen, shares) in rows.zip(upper_shares.chunks_exact(basis.width)) {
                let (upper, lower) = seen.split_at(basis.width);
                let pairs = upper.iter().zip(lower).zip(shares);
                made.extend(pairs.map(|((upper, lower), share)| lower + (upper - lower) * share));
            }
            made.resize(made.len().next_multiple_of(WIDEST), 0.0);
        }
    }

    /// Turns to a point that sees `shares` of a light's hats, where points send `leaving` to others.
    pub(super) fn turn_to(
        &mut self,
        point: u32,
        light: &LightPlanes,
        shares: &[u8],
        (surroundings, leaving): (Option<&Surroundings>, &[[f32; 3]]),
    ) {
        if self.point == point && self.texels.len() == shares.len() {
            return;
        }
        self.gather(point, light, shares, (surroundings, leaving));
        self.interleave();
    }

    /// The same channel by channel alone, as sums over hats read it.
    pub(super) fn gather(
        &mut self,
        point: u32,
        light: &LightPlanes,
        shares: &[u8],
        (surroundings, leaving): (Option<&Surroundings>, &[[f32; 3]]),
    ) {
        if self.point == point && self.channels[0].len() == shares.len() {
            return;
        }
        self.point = point;
        self.texels.clear();
        self.fill(light, shares);
        if let Some(surroundings) = surroundings {
            for &Hiding { cell, point } in surroundings.of(point as usize) {
                for hat in surroundings.hats(cell).filter(|&hat| shares[hat] < u8::MAX) {
                    let hidden = 1.0 - f32::from(shares[hat]) * (1.0 / 255.0);
                    for (plane, radiance) in self.channels.iter_mut().zip(leaving[point as usize]) {
                        plane[hat] += hidden * radiance;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::surroundings::tests::traced;
    use super::*;

    #[test]
    fn turning_from_point_to_point_leaves_nothing_behind() {
        let (_, grid, basis, visibility, surroundings) = traced(2);
        let light = basis.planes(&(0..basis.count()).map(|hat| [0.1 * hat as f32, 1.0, 2.0]).collect::<Vec<_>>());
        let leaving = vec![[1.0, 2.0, 3.0]; grid.points.len()];
        let mut turned = SeenLight::default();
        let mut hidden = 0;
        for point in (0..grid.points.len()).step_by(97) {
            let (shares, mut fresh) = (visibility.of(point), SeenLight::default());
            for seen in [&mut turned, &mut fresh] {
                seen.turn_to(point as u32, &light, shares, (Some(&surroundings), &leaving));
            }
            assert_eq!(turned.channels, fresh.channels, "{point}");
            assert_eq!(turned.texels, fresh.texels, "{point}");
            for hat in 0..basis.count() {
                let share = f32::from(shares[hat]) / 255.0;
                let cells = surroundings.of(point).iter();
                let is_hidden =
                    cells.into_iter().any(|hiding| surroundings.hats(hiding.cell).any(|other| other == hat));
                let surface = if is_hidden { 3.0 * (1.0 - share) } else { 0.0 };
                assert!((turned.channels[2][hat] - 2.0 * share - surface).abs() < 1e-5, "{point} {hat}");
                hidden += usize::from(is_hidden);
            }
        }
        assert!(hidden > 1000, "{hidden}");
        // Without other surface it is what the light alone sends.
        turned.turn_to(0, &light, visibility.of(0), (None, &leaving));
        assert_eq!(turned.channels, SeenLight::of_light(&light, visibility.of(0)).channels);
    }

    #[test]
    fn a_plane_is_shaded_alike_by_all_versions() {
        let plane: Vec<f32> = (0..64).map(|k| 0.37 * k as f32).collect();
        let shares: Vec<u8> = (0..64).map(|k| (k * 4) as u8).collect();
        let (mut made, mut plain) = (vec![0.0; 64], vec![0.0; 64]);
        shade(&plane, &shares, &mut made);
        shade_in::<crate::math::vector::Plain>(&plane, &shares, &mut plain);
        assert_eq!(made, plain);
        assert!((made[63] - plane[63] * 252.0 / 255.0).abs() < 1e-5);
    }
}
