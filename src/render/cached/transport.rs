//! All that is cached of a scene, and the light it brings to the points of the grid.

use super::bounce::BounceMatrix;
use super::footprint::{ShadingPoint, ViewFootprints};
use super::half_vector;
use super::half_vector_kernel::Part;
use super::irradiance::{irradiance, irradiance_backward, vector_irradiance};
use super::light_basis::{LightBasis, LightPlanes};
use super::lobe_place::LobePlace;
use super::points::{VisibilityGrid, VisibilityPoint};
use super::seen_light::SeenLight;
use super::settings::CachedSettings;
use super::surroundings::Surroundings;
use super::traced::Traced;
use super::visibility::Visibility;
use crate::material::{LobeModel, Material};
use crate::math::parallel;
use crate::render::Surface;
use glam::Vec3;
use std::sync::atomic::AtomicBool;

/// Visibility, light between surfaces, and integrals of the light's hats: all that rays are needed for.
#[derive(Clone, Debug)]
pub struct CachedTransport {
    /// How fine it is.
    pub settings: CachedSettings,
    /// Integrals of the light's hats.
    pub basis: LightBasis,
    /// The same of pairs of rows, for wide lobes ([`LightBasis::with_rows_joined`]).
    pub joined_basis: LightBasis,
    /// Where visibility is kept.
    pub grid: VisibilityGrid,
    /// What each point sees of the light.
    pub visibility: Visibility,
    /// What each point sees of other points; `None` for direct light only.
    pub bounces: Option<BounceMatrix>,
    /// What hides the light from each point; `None` for direct light only.
    pub surroundings: Option<Surroundings>,
    /// Seconds that tracing what points see of other points took; 0 where none was traced, or from disk.
    pub bounce_seconds: f64,
    /// Share of light that lobes send back on average, without and with Schlick's factor, over log width.
    albedo: Vec<[f32; 2]>,
}

/// Light at the points of the grid, per channel.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// What a white Lambert surface would send back: irradiance over pi, direct and from other surface.
    pub arriving: Vec<[f32; 3]>,
    /// The part of `arriving` that comes from the light directly.
    pub direct: Vec<[f32; 3]>,
    /// Radiance that points send to others, as far as paths are long enough to bring it to the camera.
    pub leaving: Vec<[f32; 3]>,
}

impl CachedTransport {
    /// Traces everything for lights of this size; `None` when `stop` was raised.
    pub fn build(
        surface: &Surface,
        settings: CachedSettings,
        light_size: (usize, usize),
        stop: &AtomicBool,
    ) -> Option<Self> {
        Self::of_traced(surface, settings, light_size, |places| Traced::trace(surface, &settings, places, stop))
    }

    /// The same of what was `traced` for this grid and these hats; `None` where that is.
    pub fn of_traced(
        surface: &Surface,
        settings: CachedSettings,
        light_size: (usize, usize),
        traced: impl FnOnce((&VisibilityGrid, &LightBasis)) -> Option<Traced>,
    ) -> Option<Self> {
        let basis = LightBasis::new(light_size.0, light_size.1);
        let joined_basis = basis.with_rows_joined();
        let grid = VisibilityGrid::new(surface, settings.grid);
        let Traced { visibility, bounces, surroundings, bounce_seconds } = traced((&grid, &basis))?;
        let albedo = lobe_albedo(settings.lobe);
        Some(CachedTransport {
            settings,
            basis,
            joined_basis,
            grid,
            visibility,
            bounces,
            surroundings,
            bounce_seconds,
            albedo,
        })
    }

    /// Whether it is the one that is built with these settings for lights of this size.
    pub fn is_of(&self, settings: &CachedSettings, light_size: (usize, usize)) -> bool {
        self.settings == *settings && (self.basis.width, self.basis.height) == light_size
    }

    /// Bytes it takes.
    pub fn memory_bytes(&self) -> usize {
        self.visibility.shares.len()
            + self.grid.points.len() * 60
            + self.surroundings.as_ref().map_or(0, Surroundings::memory_bytes)
    }

    /// Direct light at all points: irradiance over pi.
    pub fn direct(&self, light: &LightPlanes) -> Vec<[f32; 3]> {
        self.of_points(|index, point| {
            irradiance(&self.basis, point.shading_normal, self.visibility.of(index), &light.channels)
        })
    }

    /// Light itself at all points: vector irradiance over pi, per channel.
    pub fn vectors(&self, light: &LightPlanes) -> Vec<[Vec3; 3]> {
        self.of_points(|index, point| {
            vector_irradiance(&self.basis, point.shading_normal, self.visibility.of(index), &light.channels)
        })
    }

    fn of_points<T: Send>(&self, of: impl Fn(usize, &VisibilityPoint) -> T + Sync) -> Vec<T> {
        parallel::map_small(self.grid.points.len(), |index| of(index, &self.grid.points[index]))
    }

    /// What arrives at a shading point as [`PointLight::arriving`], but that direct light, of which the grid has these
    /// vectors, is that of the point's own normal.
    #[inline]
    pub fn arriving_at(
        &self,
        (at, vectors): (&PointLight, &[[Vec3; 3]]),
        footprints: &ViewFootprints,
        point: &ShadingPoint,
    ) -> [f32; 3] {
        let (mut indirect, mut mean) = ([0.0; 3], [Vec3::ZERO; 3]);
        for &(index, weight) in footprints.lit_of(point) {
            let (index, vectors) = (index as usize, &vectors[index as usize]);
            for channel in 0..3 {
                mean[channel] += weight * vectors[channel];
                indirect[channel] += weight * (at.arriving[index][channel] - at.direct[index][channel]);
            }
        }
        [0, 1, 2].map(|c| indirect[c] + mean[c].dot(point.normal).max(0.0))
    }

    /// The transpose of [`CachedTransport::direct`]: the derivative by the light, given that by direct light.
    pub fn direct_backward(&self, d_direct: &[[f32; 3]]) -> [Vec<f32>; 3] {
        // A fixed number of parts, added up in order: the same bits whatever the thread count.
        let part = d_direct.len().div_ceil(64).max(1);
        let sums = parallel::map_chunks(d_direct, part, |which, d_direct| {
            let mut sum = [(); 3].map(|()| vec![0.0; self.basis.padded()]);
            for (offset, &d) in d_direct.iter().enumerate() {
                if d != [0.0; 3] {
                    let index = which * part + offset;
                    let normal = self.grid.points[index].shading_normal;
                    irradiance_backward(&self.basis, normal, self.visibility.of(index), d, &mut sum);
                }
            }
            sum
        });
        let mut total = [(); 3].map(|()| vec![0.0f32; self.basis.padded()]);
        for sum in sums {
            for (total, part) in total.iter_mut().zip(sum) {
                for (total, part) in total.iter_mut().zip(part) {
                    *total += part;
                }
            }
        }
        total
    }

    /// What points send back of light from everywhere: diffuse reflectance, and the lobe's as if it were diffuse too.
    pub fn reflectance_of_points(&self, texels: &[Material<f32>], map_size: usize) -> Vec<[f32; 3]> {
        self.of_points(|_, point| {
            let tap = crate::material::TextureTap::at(point.uv, 0, map_size, map_size);
            let mut mean = Material::default();
            for k in 0..4 {
                mean.add_scaled(&texels[tap.index[k] as usize], tap.weight[k]);
            }
            let [base, grazing] = self.lobe_albedo_at(mean.log_width);
            let strength = self.settings.lobe_strength;
            [0, 1, 2].map(|c| mean.diffuse[c] + strength * (mean.specular[c] * base + grazing))
        })
    }

    /// Light at all points, with as many bounces as paths have.
    pub fn point_light(&self, light: &LightPlanes, reflectance: &[[f32; 3]]) -> PointLight {
        let direct = self.direct(light);
        self.with_bounces(direct, reflectance)
    }

    /// Adds the light of other surface to direct light.
    pub fn with_bounces(&self, direct: Vec<[f32; 3]>, reflectance: &[[f32; 3]]) -> PointLight {
        let reflect = |arriving: &[[f32; 3]]| -> Vec<[f32; 3]> {
            arriving.iter().zip(reflectance).map(|(e, r)| [0, 1, 2].map(|c| e[c] * r[c])).collect()
        };
        let Some(bounces) = &self.bounces else {
            let nothing = vec![[0.0; 3]; direct.len()];
            return PointLight { arriving: direct.clone(), direct, leaving: nothing };
        };
        let mut leaving = reflect(&direct);
        let add = |indirect: Vec<[f32; 3]>| -> Vec<[f32; 3]> {
            indirect.iter().zip(&direct).map(|(a, b)| [0, 1, 2].map(|c| a[c] + b[c])).collect()
        };
        for _ in 2..self.settings.max_bounces {
            leaving = reflect(&add(bounces.apply(&leaving)));
        }
        let indirect = bounces.apply(&leaving);
        PointLight { arriving: add(indirect), direct, leaving }
    }

    /// The derivative by direct light of what [`CachedTransport::with_bounces`] returns as arriving, at fixed
    /// reflectance: the exact transpose of its sweeps.
    pub fn with_bounces_backward(&self, d_arriving: &[[f32; 3]], reflectance: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mut d_direct = d_arriving.to_vec();
        let Some(bounces) = &self.bounces else { return d_direct };
        let reflect = |d: Vec<[f32; 3]>| -> Vec<[f32; 3]> {
            d.iter().zip(reflectance).map(|(d, r)| [0, 1, 2].map(|c| d[c] * r[c])).collect()
        };
        let mut d_inner = d_arriving.to_vec();
        for _ in 1..self.settings.max_bounces {
            d_inner = reflect(bounces.apply_transposed(&d_inner));
            for (sum, d) in d_direct.iter_mut().zip(&d_inner) {
                for channel in 0..3 {
                    sum[channel] += d[channel];
                }
            }
        }
        d_direct
    }

    /// Share of light that a lobe sends back, averaged over directions: of F0 and of the grazing part.
    fn lobe_albedo_at(&self, log_width: f32) -> [f32; 2] {
        let last = self.albedo.len() - 1;
        let place = (1.0 + log_width / ALBEDO_SPAN).clamp(0.0, 1.0) * last as f32;
        let low = (place as usize).min(last - 1);
        let share = place - low as f32;
        [0, 1].map(|k| self.albedo[low][k] * (1.0 - share) + self.albedo[low + 1][k] * share)
    }
}

/// Logarithms of widths from minus this to 0 have their albedo in a table.
const ALBEDO_SPAN: f32 = 5.0;

/// Directional albedo of the lobe, averaged over the hemisphere with the cosine, at even steps of log width.
fn lobe_albedo(model: LobeModel) -> Vec<[f32; 2]> {
    let constant = LightBasis::new(1, 1);
    let light = constant.planes(&[[1.0; 3]]);
    let shares = vec![255u8; constant.padded()];
    let seen = SeenLight::of_light(&light, &shares);
    (0..=20)
        .map(|step| {
            let width = (ALBEDO_SPAN * (step as f32 / 20.0 - 1.0)).exp();
            let mut sum = [0.0f32; 2];
            const ANGLES: usize = 24;
            for angle in 0..ANGLES {
                // Equal steps of cos^2: the cosine's density.
                let cosine = ((angle as f32 + 0.5) / ANGLES as f32).sqrt();
                let to_viewer = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
                let place =
                    LobePlace { normal: Vec3::Y, to_viewer, shares: &shares, seen: &seen, normal_variance: 0.0, model };
                let sums = half_vector::lobe_sums(&constant, &place, width, 256, Part::Whole);
                sum[0] += sums.base[0] / ANGLES as f32;
                sum[1] += sums.grazing[0] / ANGLES as f32;
            }
            sum
        })
        .collect()
}
