//! A fit as a film: one view of its states, each shown for as long as it was the newest, relit from cached transport.

use super::gallery::save_picture;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use crate::light::Environment;
use crate::material::texels::texels_from_maps;
use crate::material::{Material, MaterialMaps};
use crate::render::Surface;
use crate::render::cached::{CachedTransport, FootprintSettings};
use crate::render::relight::RelitView;
use crate::scene::Camera;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maps of a fit at a time, and the light they are seen in.
#[derive(Clone, Debug)]
pub struct StateOfFit {
    /// Seconds since the start of the fit.
    pub seconds: f64,
    /// The maps.
    pub maps: Arc<MaterialMaps>,
    /// The light.
    pub light: Environment,
}

/// How a film of a fit is made.
#[derive(Clone, Debug, PartialEq)]
pub struct FitFilmSettings {
    /// The camera, of the size of a frame.
    pub camera: Camera,
    /// Frames of the film, at least one.
    pub frames: usize,
    /// Whether the light shows behind the surface.
    pub background_visible: bool,
    /// By how many degrees it is blurred there.
    pub background_blur_degrees: f32,
}

/// Writes the frames as `frame_0000.png` and so on into a folder, as the screen shows them, from the first of the states
/// (in order of time) to the last. Returns the files. `progress` gets the share done, in [0, 1].
///
/// # Errors
/// `InvalidSetting` without states or frames, `Stopped` when `stop` was raised, `Unwritable` where the system refuses.
pub fn write_frames(
    folder: &Path,
    surface: &Surface,
    transport: &CachedTransport,
    states: &[StateOfFit],
    settings: &FitFilmSettings,
    display: &DisplaySettings,
    stop: &AtomicBool,
    progress: &dyn Fn(f32),
) -> Result<Vec<PathBuf>> {
    let stopped = || {
        let error = Error::new(ErrorKind::Stopped, "stopped while a film of the fit was rendered");
        error.remedy("images written so far are complete")
    };
    let (Some(first), Some(last), 1..) = (states.first(), states.last(), settings.frames) else {
        return Err(Error::new(ErrorKind::InvalidSetting, "a film without states of a fit or without frames")
            .at(Place::File(folder.into()))
            .remedy("ask for at least one frame, of a fit that has begun"));
    };
    let step = (last.seconds - first.seconds) / (settings.frames - 1).max(1) as f64;
    let mut view: Option<(usize, RelitView)> = None;
    let mut files: Vec<PathBuf> = Vec::with_capacity(settings.frames);
    let mut drawn: Option<(usize, RgbImage)> = None;
    for frame in 0..settings.frames {
        // The last frame is the last state, whatever rounding makes of its second.
        let seconds = if frame + 1 == settings.frames { f64::INFINITY } else { first.seconds + step * frame as f64 };
        let newest = states.partition_point(|state| state.seconds <= seconds).saturating_sub(1);
        let path = folder.join(format!("frame_{frame:04}.png"));
        let picture = match drawn.take().filter(|(state, _)| *state == newest) {
            Some((_, picture)) => picture,
            None => {
                let state = &states[newest];
                let map_size = state.maps.diffuse.width();
                let texels: Vec<Material<f32>> = texels_from_maps(&state.maps);
                let own = match view.take().filter(|(size, _)| *size == map_size) {
                    Some((_, view)) => view.with_texels(transport, &texels),
                    None => {
                        let fine = FootprintSettings { map_size, ..FootprintSettings::default() };
                        RelitView::new(surface, transport, &settings.camera, &texels, &fine, stop)
                            .ok_or_else(stopped)?
                    }
                };
                let reflectance = transport.reflectance_of_points(&texels, map_size);
                let behind = || state.light.out_of_focus(settings.background_blur_degrees);
                let behind = settings.background_visible.then(behind);
                let lit = own.lit(transport, &state.light, &reflectance, behind.as_ref(), stop).ok_or_else(stopped)?;
                view = Some((map_size, own));
                lit.radiance
            }
        };
        save_picture(&path, &picture, display)?;
        drawn = Some((newest, picture));
        files.push(path);
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        progress((frame + 1) as f32 / settings.frames as f32);
    }
    Ok(files)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::image::{Image, file};
    use crate::job::relit::settings_of;
    use crate::render::cached::CachedSettings;
    use crate::scene::demo::{DemoSettings, build};
    use glam::Vec3;

    #[test]
    fn each_state_is_shown_from_its_second_to_that_of_the_next() {
        let demo =
            DemoSettings { views: 1, held_out: 0, width: 48, height: 36, map_size: 64, seed: 1, ..Default::default() };
        let scene = build(&demo).unwrap().scene;
        let surface = Surface::new(scene.mesh.clone()).unwrap();
        let cached = CachedSettings { grid: 16, bounce_rays: 8, ..settings_of(2, None) };
        let stop = AtomicBool::new(false);
        let transport = CachedTransport::build(&surface, cached, (16, 8), &stop).unwrap();
        let state = |seconds, albedo, side| StateOfFit {
            seconds,
            maps: Arc::new(MaterialMaps {
                diffuse: Image::filled(side, side, Vec3::splat(albedo)),
                specular: Image::filled(side, side, Vec3::ZERO),
                roughness: Image::filled(side, side, 1.0),
            }),
            light: Environment::constant(16, 8, Vec3::ONE),
        };
        let states = [state(1.0, 0.1, 16), state(2.0, 0.3, 32), state(5.0, 0.8, 32)];
        let settings = FitFilmSettings {
            camera: scene.views[0].camera,
            frames: 9,
            background_visible: false,
            background_blur_degrees: 0.0,
        };
        let folder = tempfile::tempdir().unwrap();
        let display = DisplaySettings::default();
        let write = |states: &[StateOfFit], frames, stop: &AtomicBool| {
            let settings = FitFilmSettings { frames, ..settings.clone() };
            write_frames(folder.path(), &surface, &transport, states, &settings, &display, stop, &|_| {})
        };
        let files = write(&states, 9, &stop).unwrap();
        let bright = |path: &PathBuf| {
            let picture = file::read_srgb8(path).unwrap();
            picture.pixels().iter().map(|pixel| u64::from(pixel[1])).sum::<u64>()
        };
        let sums: Vec<u64> = files.iter().map(bright).collect();
        // Half a second a frame: two of the first state, six of the second, and the end.
        assert_eq!(sums[0], sums[1]);
        assert!(sums[2..8].iter().all(|own| *own == sums[2]), "{sums:?}");
        assert!(sums[1] < sums[2] && sums[2] < sums[8], "{sums:?}");
        assert_eq!(bright(&write(&states[..1], 1, &stop).unwrap()[0]), sums[0], "one state makes a film of one frame");
        let refused = |states: &[StateOfFit], frames| write(states, frames, &stop).unwrap_err().kind();
        assert_eq!((refused(&[], 3), refused(&states, 0)), (ErrorKind::InvalidSetting, ErrorKind::InvalidSetting));
        assert_eq!(write(&states, 3, &AtomicBool::new(true)).unwrap_err().kind(), ErrorKind::Stopped);
    }
}
