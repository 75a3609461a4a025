//! The turntable of `patina relight`.

use crate::error::Result;
use crate::image::display::DisplaySettings;
use crate::job::gallery::{Turning, TurntableSettings, write_turntable};
use crate::render::picture::PictureSettings;
use crate::render::regions::Regions;
use crate::render::{Parameters, Surface};
use crate::scene::Camera;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Options of the turntable.
#[derive(Clone, Debug, Args)]
pub struct TurntableOptions {
    /// Render a turntable of this many frames under each environment in place of single images: numbered PNG files of one
    /// turn, from the first of the views.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub turntable: Option<u32>,
    /// What turns.
    #[arg(long, value_enum, default_value = "camera", requires = "turntable")]
    pub turn: Turning,
    /// Width and height of the frames in pixels, as 640x480; those of the view when not given.
    #[arg(long, value_name = "WxH", value_parser = size_of, requires = "turntable")]
    pub size: Option<(usize, usize)>,
}

fn size_of(text: &str) -> std::result::Result<(usize, usize), String> {
    let parts =
        text.split_once(['x', 'X']).and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    match parts {
        Some((width, height)) if (1..=16_384).contains(&width) && (1..=16_384).contains(&height) => Ok((width, height)),
        _ => Err("give width and height in pixels, as 640x480, each from 1 to 16384".into()),
    }
}

/// Writes a turntable; returns the paths of its files.
pub fn write(
    folder: &Path,
    surface: &Surface,
    lit: &Parameters<f32>,
    regions: Option<&Regions>,
    start: &Camera,
    options: &TurntableOptions,
    frames: u32,
    picture: &PictureSettings,
    exposure_stops: f32,
) -> Result<Vec<PathBuf>> {
    let settings = TurntableSettings {
        frames: frames as usize,
        size: options.size.unwrap_or((start.width, start.height)),
        turning: options.turn,
        start: Some(*start),
    };
    let display = DisplaySettings { exposure_stops, ..Default::default() };
    let stop = AtomicBool::new(false);
    write_turntable(folder, surface, lit, regions, &settings, picture, &display, &stop, &|_| {})
}
