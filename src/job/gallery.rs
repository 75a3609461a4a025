//! What a user keeps of a fit to show: the same view under several lights, a turntable, a picture as a file.
//!
//! [`relight_strip`] and [`turntable`] make pictures in linear radiance, [`save_picture`] brings one to a file as the
//! screen shows it. Films are sequences of numbered PNG files: any cutter of films reads them, and no frame loses
//! colours to a palette.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::display::DisplaySettings;
use crate::image::{GreyImage, Image, RgbImage, file};
use crate::light::Environment;
use crate::render::measured_regions::render_regions;
use crate::render::passes::Accumulation;
use crate::render::picture::{Picture, PictureSettings, render};
use crate::render::progressive::PictureTracer;
use crate::render::regions::Regions;
use crate::render::{Parameters, Surface};
use crate::scene::{Camera, Mesh};
use glam::{Mat3, Vec2, Vec3};
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Samples a pixel in one pass of a picture that is saved: often enough to tell how far it is.
const SAMPLES_OF_PASS: usize = 4;

/// A light with the name a reader knows it by.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLight {
    /// The name.
    pub name: String,
    /// The light.
    pub environment: Environment,
}

/// What turns from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Turning {
    /// The camera goes around the scene; the light stays.
    #[default]
    Camera,
    /// The light goes around; the camera stays.
    Light,
}

/// How a turntable is made.
#[derive(Clone, Debug, PartialEq)]
pub struct TurntableSettings {
    /// Frames of one whole turn.
    pub frames: usize,
    /// Width and height of a frame in pixels.
    pub size: (usize, usize),
    /// What turns.
    pub turning: Turning,
    /// Where the camera stands in the first frame; [`camera_before`] the scene when `None`.
    pub start: Option<Camera>,
}

/// Pictures of one view under several lights, in their order. `progress` gets the share done, in [0, 1].
///
/// # Errors
/// `Stopped` when `stop` was raised.
pub fn relight_strip(
    surface: &Surface,
    own: &Parameters<f32>,
    camera: &Camera,
    lights: &[NamedLight],
    settings: &PictureSettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Vec<Picture>> {
    let mut lit = own.clone();
    let mut pictures = Vec::with_capacity(lights.len());
    for (index, light) in lights.iter().enumerate() {
        set_light(&mut lit, &light.environment);
        pictures.push(drawn(surface, camera, &lit, 0, settings, stop)?);
        progress((index + 1) as f32 / lights.len() as f32);
    }
    Ok(pictures)
}

/// Draws the frames of one turn under the light of `lit`, with measured materials in `regions` if there are any, and hands
/// each on, with its number from 0.
///
/// # Errors
/// `InvalidSetting` without frames or pixels, `Stopped` when `stop` was raised, and whatever `take` returns.
pub fn turntable(
    surface: &Surface,
    lit: &Parameters<f32>,
    regions: Option<&Regions>,
    turntable: &TurntableSettings,
    settings: &PictureSettings,
    stop: &AtomicBool,
    take: &mut dyn FnMut(usize, Picture) -> Result<()>,
) -> Result<()> {
    if turntable.frames == 0 || turntable.size.0 == 0 || turntable.size.1 == 0 {
        return Err(Error::new(ErrorKind::InvalidSetting, "a turntable without frames or without pixels")
            .at(Place::Setting("turntable".into()))
            .remedy("ask for at least one frame of at least 1 x 1 pixels"));
    }
    let light = lit.environment();
    let mut lit = lit.clone();
    for frame in 0..turntable.frames {
        let camera = camera_of_frame(surface.mesh(), turntable, frame);
        if turntable.turning == Turning::Light {
            set_light(&mut lit, &light.rotated_about_up(angle_of_frame(turntable, frame)));
        }
        // Another view each frame: noise that stands still would look like a pattern on the glass.
        let view = frame as u32;
        let picture = match regions {
            Some(regions) => whole(render_regions(surface, &camera, &lit, regions, view, settings, stop), stop)?,
            None => drawn(surface, &camera, &lit, view, settings, stop)?,
        };
        take(frame, picture)?;
    }
    Ok(())
}

/// [`turntable`] into `frame_0000.png` and so on in a folder, as the screen shows them. Returns the files.
pub fn write_turntable(
    folder: &Path,
    surface: &Surface,
    lit: &Parameters<f32>,
    regions: Option<&Regions>,
    settings: &TurntableSettings,
    picture: &PictureSettings,
    display: &DisplaySettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Vec<PathBuf>> {
    let mut files = Vec::with_capacity(settings.frames);
    turntable(surface, lit, regions, settings, picture, stop, &mut |frame, drawn| {
        let path = folder.join(format!("frame_{frame:04}.png"));
        save_picture(&path, &drawn.radiance, display)?;
        files.push(path);
        progress((frame + 1) as f32 / settings.frames as f32);
        Ok(())
    })?;
    Ok(files)
}

/// One picture into a file, drawn in passes so that `progress` and `stop` are heard; `cut_out` leaves what the surface does
/// not cover transparent, and settings that show the background are not heard then. Returns the file.
///
/// # Errors
/// As of [`save_picture`]; `Stopped` when `stop` was raised.
pub fn write_picture(
    path: &Path,
    surface: &Surface,
    lit: &Parameters<f32>,
    camera: &Camera,
    settings: &PictureSettings,
    display: &DisplaySettings,
    cut_out: bool,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Vec<PathBuf>> {
    is_png(path)?;
    let background_visible = settings.background_visible && !cut_out;
    let tracer = PictureTracer::new(surface, lit, PictureSettings { background_visible, ..*settings });
    let mut accumulation = Accumulation::new(camera.width, camera.height);
    while accumulation.samples() < settings.samples {
        let samples = (settings.samples - accumulation.samples()).min(SAMPLES_OF_PASS);
        if !accumulation.add_pass(&tracer, camera, 0, samples, stop, &|_| {}) {
            return Err(Error::new(ErrorKind::Stopped, "stopped while an image was rendered"));
        }
        progress(accumulation.samples() as f32 / settings.samples.max(1) as f32);
    }
    match cut_out {
        true => save_cut_out(path, accumulation.picture(), accumulation.coverage(), display)?,
        false => save_picture(path, accumulation.picture(), display)?,
    }
    Ok(vec![path.into()])
}

/// [`relight_strip`] into a folder: one PNG a light, named after it. Returns the files.
///
/// # Errors
/// As of [`relight_strip`] and [`save_picture`].
pub fn write_strip(
    folder: &Path,
    surface: &Surface,
    own: &Parameters<f32>,
    camera: &Camera,
    lights: &[NamedLight],
    settings: &PictureSettings,
    display: &DisplaySettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Vec<PathBuf>> {
    let pictures = relight_strip(surface, own, camera, lights, settings, stop, progress)?;
    let mut files = Vec::with_capacity(pictures.len());
    for (number, (light, picture)) in lights.iter().zip(&pictures).enumerate() {
        let safe: String = light.name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let path = folder.join(format!("{:02}_{}.png", number + 1, safe.to_lowercase()));
        save_picture(&path, &picture.radiance, display)?;
        files.push(path);
    }
    Ok(files)
}

/// Angle of a frame in radians; the first is 0.
fn angle_of_frame(turntable: &TurntableSettings, frame: usize) -> f32 {
    TAU * frame as f32 / turntable.frames.max(1) as f32
}

/// The camera of a frame, in the size of the turntable.
pub fn camera_of_frame(mesh: &Mesh, turntable: &TurntableSettings, frame: usize) -> Camera {
    let start = turntable.start.unwrap_or_else(|| camera_before(mesh, turntable.size));
    let start = resized(&start, turntable.size);
    match turntable.turning {
        Turning::Light => start,
        Turning::Camera => turned_about(&start, centre_of(mesh), angle_of_frame(turntable, frame)),
    }
}

/// A camera that has the whole mesh in its picture, from 25 degrees above.
pub fn camera_before(mesh: &Mesh, (width, height): (usize, usize)) -> Camera {
    const FIELD_OF_VIEW: f32 = 0.7;
    let (low, high) = mesh.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
    let radius = (0.5 * (high - low).length()).max(1e-6);
    // The ball around the mesh must fit into the narrower side.
    let half_narrow = (0.5 * FIELD_OF_VIEW).tan() * (height as f32 / width.max(1) as f32).min(1.0);
    let distance = radius / half_narrow.atan().sin();
    let (rise, run) = 25f32.to_radians().sin_cos();
    let centre = centre_of(mesh);
    Camera::looking_at(centre + distance * Vec3::new(0.0, rise, run), centre, width, height, FIELD_OF_VIEW)
}

/// The middle of the mesh's bounding box; the origin without triangles.
fn centre_of(mesh: &Mesh) -> Vec3 {
    mesh.bounds().map_or(Vec3::ZERO, |(low, high)| 0.5 * (low + high))
}

/// The camera moved around the vertical through a point, right-handed: it sees what it saw, turned the other way.
fn turned_about(camera: &Camera, centre: Vec3, radians: f32) -> Camera {
    let rotation = camera.rotation_camera_from_world * Mat3::from_rotation_y(-radians);
    let centre_in_camera = camera.rotation_camera_from_world * centre + camera.translation_camera_from_world;
    Camera {
        rotation_camera_from_world: rotation,
        translation_camera_from_world: centre_in_camera - rotation * centre,
        ..*camera
    }
}

/// The camera with a picture of another size that shows at least all of the old one.
fn resized(camera: &Camera, (width, height): (usize, usize)) -> Camera {
    let old = Vec2::new(camera.width as f32, camera.height as f32);
    let new = Vec2::new(width as f32, height as f32);
    let factor = (new / old).min_element();
    Camera {
        width,
        height,
        focal_pixels: camera.focal_pixels * factor,
        centre_pixels: 0.5 * new + (camera.centre_pixels - 0.5 * old) * factor,
        ..*camera
    }
}

/// Writes a linear picture by the ending of its path: `png` as the screen shows it, `exr` in linear radiance, whatever
/// the display. The file is written whole or not at all.
///
/// # Errors
/// `Unsupported` for another ending, `Unwritable` where the system refuses.
pub fn save_picture(path: &Path, picture: &RgbImage, display: &DisplaySettings) -> Result<()> {
    if is_png(path)? {
        let bytes = Image::from_fn(picture.width(), picture.height(), |row, column| {
            display.bytes(picture[(row, column)], row as u32, column as u32)
        });
        file::write_png_srgb8(path, &bytes)
    } else {
        file::write_exr_rgb(path, picture)
    }
}

/// The same with what the surface does not cover left transparent. `picture` is black there, so that its colours are
/// multiplied by `coverage` already.
///
/// # Errors
/// As of [`save_picture`].
pub fn save_cut_out(path: &Path, picture: &RgbImage, coverage: &GreyImage, display: &DisplaySettings) -> Result<()> {
    if !is_png(path)? {
        return file::write_exr_rgba(path, picture, coverage);
    }
    let bytes = Image::from_fn(picture.width(), picture.height(), |row, column| {
        let covered = coverage[(row, column)].clamp(0.0, 1.0);
        let own = picture[(row, column)] / covered.max(1e-4);
        let [red, green, blue] = display.bytes(own, row as u32, column as u32);
        [red, green, blue, (255.0 * covered).round() as u8]
    });
    file::write_png_srgba8(path, &bytes)
}

/// Whether a path ends in `png`; otherwise it ends in `exr`.
fn is_png(path: &Path) -> Result<bool> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "png" => Ok(true),
        "exr" => Ok(false),
        _ => Err(Error::new(ErrorKind::Unsupported, "images are saved as PNG or EXR")
            .at(Place::File(path.into()))
            .remedy("end the name with .png for what the screen shows, or with .exr for linear radiance")),
    }
}

/// Puts a light in the place of another.
pub(super) fn set_light(lit: &mut Parameters<f32>, light: &Environment) {
    lit.light = light.radiance.pixels().iter().map(|radiance| radiance.to_array()).collect();
    lit.environment_size = (light.width(), light.height());
}

/// A picture, or an error when it was stopped.
pub(super) fn drawn(
    surface: &Surface,
    camera: &Camera,
    lit: &Parameters<f32>,
    view: u32,
    settings: &PictureSettings,
    stop: &AtomicBool,
) -> Result<Picture> {
    whole(render(surface, camera, lit, view, settings, stop), stop)
}

/// A picture that was not stopped.
fn whole(picture: Picture, stop: &AtomicBool) -> Result<Picture> {
    if stop.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Stopped, "stopped while images were rendered")
            .remedy("images written so far are complete"));
    }
    Ok(picture)
}

#[cfg(test)]
mod tests;
