//! The radiance that cached transport gives for maps and a light: of shading points, and of whole pictures.

use super::footprint::{ShadingPoint, ViewFootprints};
use super::light_basis::LightPlanes;
use super::lobe_place::{LobePlace, LobeSums, wide_from, width_through};
use super::lobe_sum::{lobe_alone, lobe_with_derivative};
use super::seen_light::{SeenLight, SeenRows};
use super::transport::{CachedTransport, PointLight};
use crate::material::Material;
use crate::math::parallel;

impl CachedTransport {
    /// Mean over a shading point of what the points of the grid hold.
    #[inline]
    pub fn interpolate(values: &[[f32; 3]], footprints: &ViewFootprints, point: &ShadingPoint) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for &(index, weight) in footprints.lit_of(point) {
            let value = &values[index as usize];
            for channel in 0..3 {
                sum[channel] += weight * value[channel];
            }
        }
        sum
    }

    /// Turns `seen` to what a point of the grid sees, and returns the visible shares of the hats there.
    #[inline]
    pub fn seen_from(&self, grid_point: u32, light: &LightPlanes, at: &PointLight, seen: &mut SeenLight) -> &[u8] {
        let shares = self.visibility.of(grid_point as usize);
        seen.turn_to(grid_point, light, shares, (self.surroundings.as_ref(), &at.leaving));
        shares
    }

    /// Turns `seen` to what a point of the grid sees, for sums over hats alone.
    #[inline]
    pub fn gather_seen(&self, grid_point: u32, light: &LightPlanes, at: &PointLight, seen: &mut SeenLight) {
        let shares = self.visibility.of(grid_point as usize);
        seen.gather(grid_point, light, shares, (self.surroundings.as_ref(), &at.leaving));
    }

    /// Where the lobe of a shading point is integrated, under a light and among surface that sends this. `seen` is kept from
    /// place to place, as long as `light` and `at` are the same.
    #[inline]
    pub fn lobe_place<'a>(
        &'a self,
        point: &ShadingPoint,
        light: &LightPlanes,
        at: &PointLight,
        seen: &'a mut SeenLight,
    ) -> LobePlace<'a> {
        let shares = self.seen_from(point.lobe_point, light, at, seen);
        LobePlace {
            normal: point.normal,
            to_viewer: point.to_viewer,
            shares,
            seen,
            normal_variance: point.normal_variance,
            model: self.settings.lobe,
        }
    }

    /// The sums of a shading point's lobe, with their derivatives by the logarithm of the width or without, as
    /// [`CachedTransport::lobe_place`]. A lobe that is wide beside pairs of hats is summed over these: half as many.
    #[inline]
    pub fn lobe_at(
        &self,
        point: &ShadingPoint,
        (light, at): (&LightPlanes, &PointLight),
        seen: &mut SeenRows,
        width: f32,
        has_slope: bool,
    ) -> LobeSums {
        let shares = self.seen_from(point.lobe_point, light, at, &mut seen.fine);
        let ShadingPoint { normal, to_viewer, normal_variance, .. } = *point;
        let (basis, seen) = match width_through(self.settings.lobe, width, normal_variance) >= self.joined_from() {
            true => (&self.joined_basis, seen.joined(&self.basis)),
            false => (&self.basis, &seen.fine),
        };
        let place = LobePlace { normal, to_viewer, shares, seen, normal_variance, model: self.settings.lobe };
        match has_slope {
            true => lobe_with_derivative(basis, &place, width),
            false => lobe_alone(basis, &place, width),
        }
    }

    /// The narrowest lobe that is summed over pairs of hats; infinite where there are none.
    pub fn joined_from(&self) -> f32 {
        if self.joined_basis.height < self.basis.height { wide_from(&self.joined_basis) } else { f32::INFINITY }
    }

    /// Radiance of a shading point with a material of seven numbers.
    pub fn shade(
        &self,
        light: &LightPlanes,
        at: &PointLight,
        footprints: &ViewFootprints,
        point: &ShadingPoint,
        material: &[f32; 7],
        seen: &mut SeenRows,
    ) -> [f32; 3] {
        let arriving = Self::interpolate(&at.arriving, footprints, point);
        let diffuse = [0, 1, 2].map(|c| material[c] * arriving[c]);
        let strength = self.settings.lobe_strength;
        if strength == 0.0 {
            return diffuse;
        }
        let lobe = self.lobe_at(point, (light, at), seen, material[6].exp(), false);
        let lobe = lobe.radiance([material[3], material[4], material[5]]);
        [0, 1, 2].map(|c| diffuse[c] + strength * lobe[c])
    }

    /// Mean over a shading point's texels.
    #[inline]
    pub fn material_of(footprints: &ViewFootprints, point: &ShadingPoint, texels: &[Material<f32>]) -> [f32; 7] {
        let mut mean = Material::default();
        for &(texel, weight) in footprints.texels_of(point) {
            mean.add_scaled(&texels[texel as usize], weight);
        }
        mean.to_array()
    }

    /// A picture of a view in linear radiance, row-major. The background is black.
    pub fn picture(
        &self,
        footprints: &ViewFootprints,
        texels: &[Material<f32>],
        light: &LightPlanes,
        at: &PointLight,
    ) -> Vec<[f32; 3]> {
        let shaded = parallel::map_with(footprints.points.len(), SeenRows::default, |seen, index| {
            let point = &footprints.points[index];
            let material = Self::material_of(footprints, point, texels);
            self.shade(light, at, footprints, point, &material, seen)
        });
        let mut picture = vec![[0.0f32; 3]; footprints.width * footprints.height];
        for (point, radiance) in footprints.points.iter().zip(shaded) {
            for channel in 0..3 {
                picture[point.pixel as usize][channel] += point.share * radiance[channel];
            }
        }
        picture
    }
}
