//! A sphere of one reflectance under a light, seen from far away: what all image-space figures are taken from.
//!
//! The eye looks along -z at a unit sphere, x to the right, y up. Light is summed exhaustively, texel by texel or lamp
//! by lamp: no noise, no shadows of others, no light from the sphere onto itself (it is convex).

use super::coordinates::HalfDifference;
use super::grid;
use super::table::MeasuredBrdf;
use crate::error::Result;
use crate::image::metrics::{self, Scores};
use crate::image::transfer::srgb_from_linear;
use crate::image::{Image, RgbImage};
use crate::light::Environment;
use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
use crate::math::statistics::quantile;
use crate::math::{luminance, parallel};
use glam::{DVec3, Vec3};

/// A lamp infinitely far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantLamp {
    /// Unit direction towards the lamp, in the sphere's frame.
    pub to_light: DVec3,
    /// Irradiance of a surface that faces the lamp, linear RGB.
    pub irradiance: DVec3,
}

/// The unit normal of each pixel of a `size x size` picture of the sphere; `None` beside it.
pub fn sphere_normals(size: usize) -> Image<Option<DVec3>> {
    let half = 0.5 * size as f64;
    Image::from_fn(size, size, |row, column| {
        let (x, y) = ((column as f64 + 0.5 - half) / half, (half - row as f64 - 0.5) / half);
        let rest = 1.0 - x * x - y * y;
        (rest > 0.0).then(|| DVec3::new(x, y, rest.sqrt()))
    })
}

/// The pixels of the sphere.
pub fn sphere_mask(size: usize) -> Image<bool> {
    sphere_normals(size).map(Option::is_some)
}

/// The lamps that stand for an environment: one a texel with light in it, of its radiance times its exact solid angle.
pub fn lamps_of_environment(environment: &Environment) -> Vec<DistantLamp> {
    let (width, height) = (environment.width(), environment.height());
    let mut lamps = Vec::with_capacity(width * height);
    for row in 0..height {
        let solid_angle = solid_angle_of_texel(row, width, height);
        for column in 0..width {
            let radiance = environment.radiance[(row, column)];
            if radiance != Vec3::ZERO {
                lamps.push(DistantLamp {
                    to_light: direction_of_texel(row, column, width, height).as_dvec3(),
                    irradiance: radiance.as_dvec3() * solid_angle,
                });
            }
        }
    }
    lamps
}

/// Radiance of a sphere under lamps, black beside it. `reflectance` gives 1/sr without the cosine.
pub fn render_sphere(
    size: usize,
    reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync),
    lamps: &[DistantLamp],
) -> RgbImage {
    let normals = sphere_normals(size);
    let pixels: Vec<Vec3> = parallel::map_items(normals.pixels(), |normal| {
        let Some(normal) = normal else { return Vec3::ZERO };
        // Isotropic: any tangents do, and these are the eye's own, for the eye is at +z.
        let mut sum = DVec3::ZERO;
        for lamp in lamps {
            let cosine = normal.dot(lamp.to_light);
            if cosine > 0.0 {
                let at = angles_about(*normal, lamp.to_light, DVec3::Z);
                sum += DVec3::from_array(reflectance(at)) * lamp.irradiance * cosine;
            }
        }
        sum.as_vec3()
    });
    Image::from_pixels(size, size, pixels)
}

/// [`render_sphere`] of a table.
pub fn render_table(size: usize, table: &MeasuredBrdf, lamps: &[DistantLamp]) -> RgbImage {
    render_sphere(size, &|at| table.lookup(at).unwrap_or_default(), lamps)
}

/// An environment at several sizes, from its own (at most 512 rows) down to 8 rows, each half the one before.
#[derive(Clone, Debug)]
pub struct EnvironmentLevels {
    levels: Vec<Environment>,
}

impl EnvironmentLevels {
    /// The levels of an environment.
    pub fn new(environment: &Environment) -> Self {
        let mut height = environment.height().min(512);
        let mut levels = vec![environment.resampled(2 * height, height)];
        while height > 8 {
            height = height.div_ceil(2);
            levels.push(environment.resampled(2 * height, height));
        }
        EnvironmentLevels { levels }
    }

    /// Mean radiance over about this solid angle around a direction.
    fn radiance(&self, direction: DVec3, solid_angle: f64) -> DVec3 {
        // Texels at the equator of a map of n rows cover (pi / n)^2.
        let rows = std::f64::consts::PI / solid_angle.max(1e-12).sqrt();
        let level = self.levels.iter().position(|level| level.height() as f64 <= 1.5 * rows);
        let level = &self.levels[level.unwrap_or(self.levels.len() - 1)];
        level.radiance_towards(direction.as_vec3()).as_dvec3()
    }
}

/// Rings and steps around of the half vectors that [`render_sphere_in`] sums over.
const RINGS: usize = 48;
const STEPS: usize = 40;

/// One light direction of the sum of a pixel.
struct Contribution {
    /// Unit direction towards the light; z is the normal, the eye lies in the plane of x and z.
    to_light: DVec3,
    /// Solid angle it stands for.
    solid_angle: f64,
    /// Reflectance times cosine times solid angle.
    weight: DVec3,
}

/// Radiance of a sphere in an environment, black beside it: for pictures. Summed over half vectors, which lie dense
/// where lobes are narrow, each with the mean radiance over the solid angle it stands for: mirrors stay sharp, and no
/// texel shows as a spot. Figures are taken from [`render_sphere`], which sums over texels.
pub fn render_sphere_in(
    size: usize,
    reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync),
    environment: &EnvironmentLevels,
) -> RgbImage {
    // Reflectance depends on the distance from the middle of the picture alone: it is asked once a step of
    // that.
    let count = size.max(128);
    let rings: Vec<Vec<Contribution>> =
        parallel::map(count, |ring| contributions((ring as f64 + 0.5) / count as f64, reflectance));
    let normals = sphere_normals(size);
    let pixels: Vec<Vec3> = parallel::map_items(normals.pixels(), |normal| {
        let Some(normal) = *normal else { return Vec3::ZERO };
        let radius = normal.x.hypot(normal.y);
        let tangent = (DVec3::Z - normal * normal.z).try_normalize().unwrap_or(DVec3::X);
        let bitangent = normal.cross(tangent);
        let mut sum = DVec3::ZERO;
        for part in &rings[((radius * count as f64) as usize).min(count - 1)] {
            let l = part.to_light;
            let world = tangent * l.x + bitangent * l.y + normal * l.z;
            sum += environment.radiance(world, part.solid_angle) * part.weight;
        }
        sum.as_vec3()
    });
    Image::from_pixels(size, size, pixels)
}

/// The light directions of a pixel whose normal has this sine to the eye.
fn contributions(sine: f64, reflectance: &(dyn Fn(HalfDifference) -> [f64; 3] + Sync)) -> Vec<Contribution> {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};
    let to_eye = DVec3::new(sine, 0.0, (1.0 - sine * sine).sqrt());
    let mut parts = Vec::with_capacity(RINGS * STEPS);
    for ring in 0..RINGS {
        let u = (ring as f64 + 0.5) / RINGS as f64;
        let (sin_theta, cos_theta) = (FRAC_PI_2 * u * u).sin_cos();
        let half_solid_angle = sin_theta * PI * u / RINGS as f64 * TAU / STEPS as f64;
        for step in 0..STEPS {
            let (sin_phi, cos_phi) = (TAU * (step as f64 + 0.5 * (ring % 2) as f64) / STEPS as f64).sin_cos();
            let half = DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta);
            let cos_difference = half.dot(to_eye);
            let to_light = 2.0 * cos_difference * half - to_eye;
            if cos_difference > 0.0 && to_light.z > 0.0 {
                let solid_angle = 4.0 * cos_difference * half_solid_angle;
                let value = DVec3::from_array(reflectance(HalfDifference::from_directions(to_light, to_eye)));
                parts.push(Contribution { to_light, solid_angle, weight: value * (to_light.z * solid_angle) });
            }
        }
    }
    parts
}

/// Half and difference angles of two unit directions about any unit normal.
pub fn angles_about(normal: DVec3, to_light: DVec3, to_eye: DVec3) -> HalfDifference {
    let other = if normal.x.abs() < 0.6 { DVec3::X } else { DVec3::Y };
    let tangent = normal.cross(other).normalize_or(DVec3::X);
    let bitangent = normal.cross(tangent);
    let local = |v: DVec3| DVec3::new(v.dot(tangent), v.dot(bitangent), v.dot(normal));
    HalfDifference::from_directions(local(to_light), local(to_eye))
}

/// Three lamps for pictures of materials: above the left shoulder, dim from beside the eye, and grazing from the right.
/// Lamps rather than a sky: the texels of a coarse sky show as spots in what is nearly a mirror.
pub fn showing_lamps() -> Vec<DistantLamp> {
    [([-0.45, 0.6, 0.66], 2.4), ([0.25, 0.1, 1.0], 0.5), ([0.95, 0.25, -0.2], 1.2)]
        .into_iter()
        .map(|(direction, irradiance)| DistantLamp {
            to_light: DVec3::from_array(direction).normalize(),
            irradiance: DVec3::splat(irradiance),
        })
        .collect()
}

/// The exposure at which a white diffuser that faces the first of [`showing_lamps`] is nearly white.
pub const SHOWING_EXPOSURE: f32 = 1.1;

/// The factor that brings the brightest tenth of the sphere to display white (its 90 % quantile of luminance to 0.8).
pub fn display_exposure(picture: &RgbImage, mask: &Image<bool>) -> f32 {
    let inside = picture.pixels().iter().zip(mask.pixels()).filter(|(_, inside)| **inside);
    let values: Vec<f64> = inside.map(|(rgb, _)| f64::from(luminance(*rgb))).filter(|v| v.is_finite()).collect();
    let bright = quantile(&values, 0.9);
    if bright > 0.0 { (0.8 / bright) as f32 } else { 1.0 }
}

/// Errors of a picture of a sphere as displayed: both times the exposure of the truth ([`display_exposure`]), clipped to
/// [0, 1] and encoded as sRGB; only pixels of the sphere count. Error: pictures of different sizes, or not square.
pub fn displayed_scores(estimate: &RgbImage, truth: &RgbImage) -> Result<Scores> {
    let mask = sphere_mask(truth.width());
    let exposure = display_exposure(truth, &mask);
    let shown =
        |picture: &RgbImage| picture.map(|rgb| Vec3::from_array((*rgb * exposure).to_array().map(srgb_from_linear)));
    metrics::scores(&shown(estimate), &shown(truth), Some(&mask))
}

/// Reflectance along a slice: `theta_half` runs at fixed difference angles. Points below the horizon are left out.
pub fn slice(
    reflectance: &dyn Fn(HalfDifference) -> [f64; 3],
    theta_difference: f64,
    phi_difference: f64,
    points: usize,
) -> Vec<(f64, [f64; 3])> {
    let step = 1.0 / (points.max(2) - 1) as f64;
    (0..points.max(2))
        .map(|index| (index as f64 * step).powi(2) * std::f64::consts::FRAC_PI_2)
        .map(|theta_half| HalfDifference { theta_half, theta_difference, phi_difference })
        .filter(|at| grid::is_above_horizon(*at))
        .map(|at| (at.theta_half, reflectance(at)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_white_sphere_in_a_white_room_is_white() {
        let lamps = lamps_of_environment(&Environment::constant(64, 32, Vec3::ONE));
        let picture = render_sphere(16, &|_| [1.0 / PI; 3], &lamps);
        for (rgb, inside) in picture.pixels().iter().zip(sphere_mask(16).pixels()) {
            let expected = if *inside { 1.0 } else { 0.0 };
            assert!((rgb.y - expected).abs() < 5e-3, "{rgb}");
        }
    }

    #[test]
    fn sums_over_half_vectors_and_over_texels_agree() {
        let sky = Environment {
            radiance: Image::from_fn(64, 32, |row, column| Vec3::splat(1.0 + (row * column % 7) as f32)),
        };
        let value = |at: HalfDifference| [0.2 + 2.0 * (-(at.theta_half / 0.3).powi(2)).exp(), 0.3, 0.1];
        let texels = render_sphere(20, &value, &lamps_of_environment(&sky));
        let halves = render_sphere_in(20, &value, &EnvironmentLevels::new(&sky));
        for (pixel, (a, b)) in texels.pixels().iter().zip(halves.pixels()).enumerate() {
            assert!((a.x - b.x).abs() <= 0.08 * a.x.max(b.x), "pixel {pixel}: {a} {b}");
        }
    }

    #[test]
    fn a_lobe_shines_where_the_half_vector_is_the_normal() {
        let lamp = DistantLamp { to_light: DVec3::new(-0.6, 0.0, 0.8), irradiance: DVec3::ONE };
        let picture = render_sphere(65, &|at| [(-(at.theta_half / 0.1).powi(2)).exp(); 3], &[lamp]);
        let brightest = (0..65 * 65).max_by(|a, b| picture.pixels()[*a].x.total_cmp(&picture.pixels()[*b].x)).unwrap();
        let normal = sphere_normals(65).pixels()[brightest].unwrap();
        let half = (lamp.to_light + DVec3::Z).normalize();
        assert!(normal.dot(half) > 0.999, "{normal}");
    }

    #[test]
    fn scores_of_a_picture_with_itself_are_perfect_and_of_a_dimmer_one_are_not() {
        let lamps = showing_lamps();
        let truth = render_sphere(24, &|at| [0.3 - 0.1 * at.theta_half, 0.2, 0.1], &lamps);
        assert_eq!(displayed_scores(&truth, &truth).unwrap().rmse, 0.0);
        let dimmer = truth.map(|rgb| *rgb * 0.8);
        let scores = displayed_scores(&dimmer, &truth).unwrap();
        assert!(scores.rmse > 0.02 && scores.psnr < 34.0);
        assert_eq!(scores.pixels, sphere_mask(24).pixels().iter().filter(|inside| **inside).count());
        assert!(displayed_scores(&truth, &render_sphere(8, &|_| [0.1; 3], &lamps)).is_err());
    }

    #[test]
    fn black_and_empty_do_no_harm() {
        let black = render_sphere(8, &|_| [0.0; 3], &showing_lamps());
        assert_eq!(display_exposure(&black, &sphere_mask(8)), 1.0);
        assert_eq!(render_sphere(0, &|_| [0.0; 3], &[]).pixels().len(), 0);
    }
}
