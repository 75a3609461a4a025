//! Hard cases: small scenes in code with their truth, each with one thing that breaks fits.
//!
//! [`HardCase`] names them. [`build`] makes what is photographed: surface, light and cameras as they really are
//! (`objects` holds shapes and finishes). [`spoil`](HardScene::spoil) makes of the photographed scene what a fit is
//! given: wrong masks, shaken cameras, clipped bytes, a mesh with a part missing. A case that spoils nothing gives the fit
//! the truth's own mesh, photos and cameras.
//!
//! Nothing here renders: photos are black until somebody traces them, with the widths of lobes of
//! [`HardScene::width_factors`].

mod objects;
mod spoil;

use crate::error::Result;
use crate::image::{GreyImage, Image};
use crate::light::Environment;
use crate::material::LobeModel;
use crate::scene::demo::{evening, morning, views_of};
use crate::scene::synthetic::bake::bake;
use crate::scene::synthetic::orbit::Orbit;
use crate::scene::synthetic::seen;
use crate::scene::{Background, Camera, Scene, Truth, TruthRelight, WorldFromSource};
use glam::Vec3;

/// What is hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum HardCase {
    /// Nothing: what the others are held against.
    Plain,
    /// A mirror-like object, microfacet width 0.01.
    Mirror,
    /// Everything of roughness 1.
    Rough,
    /// Bare copper.
    Metal,
    /// Velvet that reflects half a percent.
    Velvet,
    /// A deep bowl of plaster that reflects 95 %: light goes to and fro.
    Plaster,
    /// A sun of 1e5 in one texel of the light.
    Sun,
    /// Light from below only.
    Below,
    /// Eight views, all from one side.
    OneSided,
    /// 3 % of the pixels with a wrong mask.
    Masks,
    /// Cameras turned by one pixel each.
    OnePixel,
    /// Cameras turned by two pixels each.
    TwoPixels,
    /// Exposures that jump by 30 %; the fit is asked to find gains.
    Exposure,
    /// Photos of 8 bits in sRGB, clipped at 1.
    EightBit,
    /// An object that the mesh lacks.
    Missing,
    /// An object of nine times fewer triangles than it has.
    Decimated,
    /// Normals of the mesh that are off by ten degrees or so.
    NoisyNormals,
    /// Walls thinner than a texel, lit from both sides.
    ThinShells,
    /// Objects that touch each other and stand on the floor.
    Touching,
    /// Photos of a surface with GGX in place of Blinn-Phong, direct light only.
    Ggx,
    /// A texture finer than the photos resolve.
    FineTexture,
}

impl HardCase {
    /// All of them, the plain one first.
    pub const ALL: [HardCase; 21] = [
        HardCase::Plain,
        HardCase::Mirror,
        HardCase::Rough,
        HardCase::Metal,
        HardCase::Velvet,
        HardCase::Plaster,
        HardCase::Sun,
        HardCase::Below,
        HardCase::OneSided,
        HardCase::Masks,
        HardCase::OnePixel,
        HardCase::TwoPixels,
        HardCase::Exposure,
        HardCase::EightBit,
        HardCase::Missing,
        HardCase::Decimated,
        HardCase::NoisyNormals,
        HardCase::ThinShells,
        HardCase::Touching,
        HardCase::Ggx,
        HardCase::FineTexture,
    ];

    /// Its name on the command line and in tables.
    pub fn name(self) -> String {
        use clap::ValueEnum;
        self.to_possible_value().map(|value| value.get_name().to_string()).unwrap_or_default()
    }

    /// Where the mesh a fit is given is wrong; `None` where it is right.
    fn defect_in_world(self) -> Option<Vec3> {
        match self {
            HardCase::Missing => Some(objects::MISSING_CENTRE),
            HardCase::Decimated | HardCase::NoisyNormals => Some(objects::OBJECT_CENTRE),
            _ => None,
        }
    }
}

/// Sizes of a hard scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardSettings {
    /// Width and height of a photo in pixels.
    pub size: usize,
    /// Views to fit to.
    pub views: usize,
    /// Further views that judge.
    pub held_out: usize,
    /// Width and height of the maps in texels.
    pub map_size: usize,
    /// Rows of the light.
    pub light_height: usize,
    /// Where the cameras stand, and how they are shaken.
    pub seed: u64,
}

impl Default for HardSettings {
    fn default() -> Self {
        HardSettings { size: 48, views: 16, held_out: 4, map_size: 64, light_height: 16, seed: 1 }
    }
}

/// A hard scene as it really is.
#[derive(Clone, Debug)]
pub struct HardScene {
    /// What is hard.
    pub case: HardCase,
    /// The scene with its truth; photos are black.
    pub scene: Scene,
    /// Photos are the mean of pictures whose microfacet widths are these times the truth's: one factor, 1, but for GGX.
    pub width_factors: Vec<f32>,
    /// Distance in world units of each texel of the maps from the defect of the mesh; `None` without one.
    pub distance_to_defect: Option<GreyImage>,
    /// Part of each triangle: 0 for the object, 1 for the floor, 2 for what may be missing.
    triangle_part: Vec<u32>,
    seed: u64,
}

/// Builds a case.
///
/// # Errors
/// `InvalidSetting` for sizes of 0 and maps too small to hold the charts.
pub fn build(case: HardCase, settings: &HardSettings) -> Result<HardScene> {
    let size = settings.map_size;
    let joined = objects::surface(case, size)?;
    let mesh = joined.mesh;
    let part_of = |triangle: usize| joined.triangle_part[triangle];
    let baked = bake(&mesh, size, size, part_of, |point| objects::finish(case, point, size));
    let orbit = Orbit {
        target: Vec3::new(0.0, 0.5, 0.0),
        distance: 5.2,
        elevation_radians: match case {
            HardCase::Plaster => (35f32.to_radians(), 75f32.to_radians()),
            HardCase::Below => (3f32.to_radians(), 30f32.to_radians()),
            _ => (8f32.to_radians(), 60f32.to_radians()),
        },
        width: settings.size,
        height: settings.size,
        field_of_view_x_radians: 40f32.to_radians(),
        jitter: 0.03,
    };
    let mut views = views_of(&orbit, settings.views, settings.held_out, settings.seed)?;
    if case == HardCase::OneSided {
        one_sided(&mut views, &orbit);
    }
    let cameras: Vec<Camera> = views.iter().filter(|view| !view.held_out).map(|view| view.camera).collect();
    let texels_seen = seen::texels_seen(&mesh, &cameras, size, size, 4)?;
    let distance_to_defect = case.defect_in_world().map(|defect| {
        let place = |point: &crate::scene::synthetic::bake::SurfacePoint| crate::scene::synthetic::bake::Reflectance {
            diffuse: point.position,
            ..Default::default()
        };
        let places = bake(&mesh, size, size, part_of, place);
        places.maps.diffuse.map(|place| place.distance(defect))
    });
    let height = settings.light_height;
    let scene = Scene {
        name: case.name(),
        folder: None,
        mesh,
        views,
        world_from_source: WorldFromSource::default(),
        background: Background::Environment,
        truth: Some(Truth {
            maps: baked.maps,
            texels_seen,
            environment: light(case, height),
            relight: Some(TruthRelight { environment: evening().resampled(2 * height, height), pictures: Vec::new() }),
            // A mean of pictures is one of lobes for direct light only.
            lobe: LobeModel::BlinnPhong,
            max_bounces: match case {
                HardCase::Ggx => 1,
                HardCase::Plaster => 6,
                _ => 3,
            },
        }),
        findings: Vec::new(),
    };
    let width_factors = if case == HardCase::Ggx { ggx_width_factors(8) } else { vec![1.0] };
    Ok(HardScene {
        case,
        scene,
        width_factors,
        distance_to_defect,
        triangle_part: joined.triangle_part,
        seed: settings.seed,
    })
}

/// The first eight views stand within a quarter of the circle, and there are no more.
fn one_sided(views: &mut Vec<crate::scene::View>, orbit: &Orbit) {
    let mut kept = 0;
    views.retain(|view| {
        kept += usize::from(!view.held_out);
        view.held_out || kept <= 8
    });
    for (index, view) in views.iter_mut().filter(|view| !view.held_out).enumerate() {
        let azimuth = (index as f32 / 8.0 - 0.5) * std::f32::consts::FRAC_PI_2;
        let elevation = (15.0 + 35.0 * ((index * 3) % 8) as f32 / 8.0).to_radians();
        let towards = Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let eye = orbit.target + orbit.distance * towards;
        view.camera = Camera::looking_at(eye, orbit.target, orbit.width, orbit.height, orbit.field_of_view_x_radians);
    }
}

fn light(case: HardCase, height: usize) -> Environment {
    let mut light = morning().resampled(2 * height, height);
    match case {
        HardCase::Sun => light.radiance[(height / 4, height / 2)] = Vec3::new(1.0, 0.95, 0.85) * 1e5,
        // So bright that much of what is lit by the sun is clipped.
        HardCase::EightBit => light.radiance.pixels_mut().iter_mut().for_each(|radiance| *radiance *= 2.5),
        HardCase::Below => {
            light.radiance = Image::from_fn(2 * height, height, |row, column| {
                // Brighter on one side, so that it casts shadows.
                let side = 1.0 + (column as f32 / height as f32 * std::f32::consts::PI).cos();
                if row > height / 2 { Vec3::new(0.9, 1.0, 1.1) * (0.2 + side) } else { Vec3::ZERO }
            });
        }
        _ => {}
    }
    light
}

/// Factors of the microfacet width whose Beckmann lobes have a GGX lobe as their mean.
///
/// `a^2 / (pi (a^2 + t^2)^2)`, the slopes `t` of GGX (Walter, Marschner, Li and Torrance 2007), is the mean of Beckmann's
/// `s / (pi a^2) exp(-s t^2 / a^2)` over `s` with density `exp(-s)`. Blinn-Phong of exponent `2 / a^2 - 2` stands for
/// Beckmann. The `count` values of `s` are medians of equal shares.
fn ggx_width_factors(count: usize) -> Vec<f32> {
    let of = |index: usize| -(-(index as f32 + 0.5) / count as f32).ln_1p();
    (0..count).map(|index| 1.0 / of(index).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_sound_surface_and_a_name() {
        let settings = HardSettings { size: 12, views: 9, held_out: 1, ..Default::default() };
        for case in HardCase::ALL {
            let hard = build(case, &settings).unwrap();
            hard.scene.mesh.validate().unwrap();
            let truth = hard.scene.truth.as_ref().unwrap();
            let seen = truth.texels_seen.pixels().iter().filter(|seen| **seen).count();
            assert!(seen > 300, "{}: {seen} texels seen", case.name());
            assert!(truth.maps.diffuse.pixels().iter().all(|value| value.is_finite()));
            assert!(!case.name().is_empty() && hard.triangle_part.len() == hard.scene.mesh.triangles.len());
            assert_eq!(hard.distance_to_defect.is_some(), case.defect_in_world().is_some());
        }
    }

    #[test]
    fn widths_of_ggx_have_its_median_slope_and_a_long_tail() {
        // The share of slopes beyond t is a^2 / (a^2 + t^2), and exp(-s t^2 / a^2) of a Beckmann lobe.
        let factors = ggx_width_factors(64);
        for t in [0.3f32, 1.0, 3.0] {
            let mean = factors.iter().map(|factor| (-t * t / (factor * factor)).exp()).sum::<f32>() / 64.0;
            assert!((mean - 1.0 / (1.0 + t * t)).abs() < 0.02, "{t}: {mean}");
        }
    }
}
