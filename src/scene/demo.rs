//! The built-in scene: six objects on a tiled floor, made in code, with the truth beside it.
//!
//! It is chosen to be hard where photographs are: polished metal beside felt, edges that live in one map only, contact
//! shadows, reflections of one object in another, a floor that is sharp in one tile and dull in the next. Pictures are
//! not made here, that needs the renderer: [`build`] leaves the photos black, and whoever renders them calls
//! [`Scene::set_photo`].

use super::synthetic::bake::{Reflectance, SurfacePoint, bake};
use super::synthetic::layout::{PartChart, lay_out};
use super::synthetic::orbit::Orbit;
use super::synthetic::shapes::{self, Chart};
use super::synthetic::{finish, seen};
use super::{Background, Camera, Photo, PixelState, Scene, Truth, TruthRelight, View, WorldFromSource};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::Image;
use crate::light::Environment;
use crate::light::sky::{SkySettings, sun_and_sky};
use crate::material::LobeModel;
use glam::{DVec2, Quat, Vec3};

/// What the demo is made with.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DemoSettings {
    /// Number of views for the fit.
    pub views: usize,
    /// Number of further views that judge it.
    pub held_out: usize,
    /// Width of a photo in pixels.
    pub width: usize,
    /// Height of a photo in pixels.
    pub height: usize,
    /// Width and height of the truth maps in texels; at least 64.
    pub map_size: usize,
    /// Where the cameras stand.
    pub seed: u64,
    /// The microfacets of what is photographed.
    pub lobe: LobeModel,
}

impl Default for DemoSettings {
    fn default() -> Self {
        DemoSettings {
            views: 48,
            held_out: 6,
            width: 160,
            height: 120,
            map_size: 512,
            seed: 1,
            lobe: LobeModel::BlinnPhong,
        }
    }
}

/// A scene made in code, and what is known about it.
#[derive(Clone, Debug)]
pub struct DemoScene {
    /// The scene; its photos are black until [`Scene::set_photo`]. `truth` is there, its relight without pictures.
    pub scene: Scene,
    /// Texels of the truth maps inside a chart.
    pub covered: Image<bool>,
    /// Names of the parts.
    pub parts: Vec<&'static str>,
    /// Part of each triangle.
    pub triangle_part: Vec<u32>,
}

/// Rows of the environment of the demo; it is twice as wide.
const LIGHT_HEIGHT: usize = 32;
/// Longest path of the demo's pictures.
const MAX_BOUNCES: usize = 3;
/// Camera rays a pixel that decide which texels are seen.
const SEEN_SAMPLES: u32 = 4;
/// Objects stand this far above the floor, in world units: nothing is coplanar.
const GAP: f32 = 0.004;

/// An object: its charts in its own space, where it stands, and what it is made of there.
struct Part {
    name: &'static str,
    charts: Vec<Chart>,
    rotation: Quat,
    scale: f32,
    offset: Vec3,
    density: f32,
    finish: fn(Vec3, Vec3) -> Reflectance,
}

/// The parts, back to front. World units are decimetres or so.
fn parts() -> Vec<Part> {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y + GAP, z);
    let plain = |name, charts, offset, finish| Part {
        name,
        charts,
        rotation: Quat::IDENTITY,
        scale: 1.0,
        offset,
        density: 1.0,
        finish,
    };
    // From the pole of the foot, up the outside, over the lip and down the inside.
    let profile: Vec<DVec2> = [
        (0.0, 0.0),
        (0.34, 0.0),
        (0.4, 0.04),
        (0.36, 0.16),
        (0.6, 0.55),
        (0.68, 0.95),
        (0.5, 1.45),
        (0.26, 1.75),
        (0.3, 1.95),
        (0.4, 2.06),
        (0.37, 2.07),
        (0.22, 1.8),
        (0.4, 1.4),
        (0.5, 0.9),
        (0.3, 0.3),
        (0.0, 0.2),
    ]
    .map(|(radius, height)| DVec2::new(radius, height))
    .to_vec();
    vec![
        Part {
            density: 0.55,
            ..plain("floor", shapes::disk(4.2, 12, 64), Vec3::ZERO, |point, _| finish::tiles(point))
        },
        plain("vase", shapes::lathe(&profile, 48, 60), at(-0.35, 0.0, -1.05), |point, _| finish::glaze(point, 2.07)),
        plain("sphere", shapes::sphere(0.68, 14), at(1.6, 0.68, 0.4), |point, _| finish::copper(point, 0.52)),
        Part {
            rotation: Quat::from_rotation_y(0.5),
            ..plain("cube", shapes::rounded_cube(0.55, 0.09, 16), at(-1.6, 0.55, -0.2), |point, normal| {
                finish::marble_with_letters(point, normal, 0.55)
            })
        },
        Part {
            rotation: Quat::from_rotation_x(0.25),
            ..plain("torus", shapes::torus(0.55, 0.22, 64, 24), at(0.15, 0.37, 1.15), |point, _| finish::wood(point))
        },
        Part {
            rotation: Quat::from_rotation_x(1.35),
            scale: 0.3,
            ..plain("knot", shapes::knot(0.45, 56, 14, 3), at(1.3, 0.98, -1.35), |point, _| {
                finish::enamel_and_gold(point)
            })
        },
        Part {
            scale: 0.42,
            ..plain("felt", shapes::blob(0.13, 14), at(-1.25, 0.46, 1.45), |point, _| finish::felt(point))
        },
    ]
}

/// The light of the photos of scenes made in code: a clear morning, the sun 38 degrees high and soft enough for 32 rows.
pub(crate) fn morning() -> Environment {
    let settings = SkySettings {
        sun_elevation_radians: 38f32.to_radians(),
        sun_azimuth_radians: 50f32.to_radians(),
        sun_radius_radians: 3f32.to_radians(),
        ..SkySettings::noon()
    };
    sun_and_sky(2 * LIGHT_HEIGHT, LIGHT_HEIGHT, &settings)
}

/// The light they are relit under: a low warm sun on another side.
pub(crate) fn evening() -> Environment {
    let settings = SkySettings {
        sun_elevation_radians: 14f32.to_radians(),
        sun_azimuth_radians: 245f32.to_radians(),
        irradiance: 0.6 * std::f32::consts::PI,
        ..SkySettings::evening()
    };
    sun_and_sky(2 * LIGHT_HEIGHT, LIGHT_HEIGHT, &settings)
}

/// Builds the demo scene.
///
/// # Errors
/// `InvalidSetting` for a picture without pixels, no view at all, or a map too small for the charts.
pub fn build(settings: &DemoSettings) -> Result<DemoScene> {
    let parts = parts();
    let mut charts = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        for chart in &part.charts {
            let chart = chart.clone().placed(part.rotation, part.scale, part.offset);
            charts.push(PartChart { chart, part: number as u32, density: part.density });
        }
    }
    let size = settings.map_size;
    let joined = lay_out(charts, size, size)?;
    let reflectance = |point: &SurfacePoint| {
        let part = &parts[point.part as usize];
        let own_from_world = part.rotation.inverse();
        (part.finish)(own_from_world * (point.position - part.offset) / part.scale, own_from_world * point.normal)
    };
    let baked = bake(&joined.mesh, size, size, |triangle| joined.triangle_part[triangle], reflectance);
    let orbit = Orbit {
        target: Vec3::new(0.0, 0.55, 0.0),
        distance: 6.6,
        elevation_radians: (3f32.to_radians(), 62f32.to_radians()),
        width: settings.width,
        height: settings.height,
        field_of_view_x_radians: 46f32.to_radians(),
        jitter: 0.06,
    };
    let views = views_of(&orbit, settings.views, settings.held_out, settings.seed)?;
    let cameras: Vec<Camera> = views.iter().filter(|view| !view.held_out).map(|view| view.camera).collect();
    let texels_seen = seen::texels_seen(&joined.mesh, &cameras, size, size, SEEN_SAMPLES)?;
    let scene = Scene {
        name: "demo".into(),
        folder: None,
        mesh: joined.mesh,
        views,
        world_from_source: WorldFromSource::default(),
        background: Background::Environment,
        truth: Some(Truth {
            maps: baked.maps,
            texels_seen,
            environment: morning(),
            relight: Some(TruthRelight { environment: evening(), pictures: Vec::new() }),
            max_bounces: MAX_BOUNCES,
            lobe: settings.lobe,
        }),
        findings: Vec::new(),
    };
    Ok(DemoScene {
        scene,
        covered: baked.covered,
        parts: parts.iter().map(|part| part.name).collect(),
        triangle_part: joined.triangle_part,
    })
}

/// Views with black photos around an orbit: first `views` for the fit, then `held_out` between them.
pub(crate) fn views_of(orbit: &Orbit, views: usize, held_out: usize, seed: u64) -> Result<Vec<View>> {
    if views == 0 || orbit.width == 0 || orbit.height == 0 {
        return Err(Error::new(ErrorKind::InvalidSetting, "a scene needs a view, and a view needs pixels")
            .at(Place::Setting(if views == 0 { "views" } else { "width" }.into()))
            .remedy("choose at least one view of one pixel"));
    }
    let cameras = orbit.cameras(views + held_out, seed);
    Ok(cameras
        .into_iter()
        .enumerate()
        .map(|(index, camera)| View {
            name: format!("{index:04}"),
            camera,
            photo: Photo::Linear32(Image::filled(camera.width, camera.height, Vec3::ZERO)),
            states: Image::filled(camera.width, camera.height, PixelState::Surface),
            held_out: index >= views,
            exposure_prior_stops: None,
        })
        .collect())
}
