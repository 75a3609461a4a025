//! A run scored on a published benchmark: its pictures under other lights and from other cameras, by the benchmark's rules.
//!
//! [`orb`] and [`owl`] list what a folder of the data set asks for; here it is rendered, one picture after the other, and
//! scored by [`protocols`](crate::insight::protocols).
//!
//! It refuses folders without their ground truth: a score against nothing is none.

pub mod orb;
pub mod owl;

use super::pictures::relit;
use crate::error::{Error, ErrorKind, Place};
use crate::image::{Image, RgbImage};
use crate::insight::protocols::{orb::OrbScore, owl::OwlScore};
use crate::light::Environment;
use crate::math::sphere;
use crate::render::picture::PictureSettings;
use crate::render::{Parameters, Surface};
use crate::scene::Camera;
use glam::Vec3;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A published benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Protocol {
    /// Stanford-ORB: a folder of `blender_HDR`, with `ground_truth` two folders up.
    Orb,
    /// Objects with Lighting: the folder of an object.
    Owl,
}

/// What a picture shows that others did not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// Another camera under the light of the photos.
    NovelView,
    /// Another light.
    Relighting,
}

/// The score of a picture, by the protocol that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Score {
    /// Of Stanford-ORB.
    Orb(OrbScore),
    /// Of Objects with Lighting.
    Owl(OwlScore),
}

/// A scored picture.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Scored {
    /// Its name in the data set.
    pub name: String,
    /// What it asks.
    pub question: Question,
    /// Its score.
    pub score: Score,
}

/// What draws the pictures of a run.
pub struct Drawing<'a> {
    /// The surface of the run.
    pub surface: &'a Surface,
    /// Its maps and its light.
    pub own: &'a Parameters<f32>,
    /// How pictures are drawn; the background is not.
    pub settings: PictureSettings,
}

impl Drawing<'_> {
    /// The picture of a camera, under the run's own light or another one.
    fn picture(&self, camera: &Camera, light: Option<&Environment>, number: usize) -> RgbImage {
        let stop = AtomicBool::new(false);
        let settings = PictureSettings { background_visible: false, ..self.settings };
        let own = || Environment {
            radiance: Image::from_pixels(
                self.own.environment_size.0,
                self.own.environment_size.1,
                self.own.light.iter().map(|rgb| Vec3::from_array(*rgb)).collect(),
            ),
        };
        let light = light.cloned().unwrap_or_else(own);
        relit(self.surface, self.own, &light, camera, number, &settings, &stop).radiance
    }
}

/// An environment of another convention in ours, at the same size: `place` says where on the picture, as shares of its
/// width and height, a direction of our world lies.
fn environment_of(picture: &RgbImage, place: impl Fn(Vec3) -> (f32, f32)) -> Environment {
    let (width, height) = (picture.width(), picture.height());
    // Columns go round, rows end at the poles.
    let at = |row: i64, column: i64| {
        picture[(row.clamp(0, height as i64 - 1) as usize, column.rem_euclid(width as i64) as usize)]
    };
    let radiance = Image::from_fn(width, height, |row, column| {
        let (u, v) = place(sphere::direction_of_texel(row, column, width, height));
        let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (across, down) = (x - left, y - top);
        let line = |row: i64| at(row, left as i64).lerp(at(row, left as i64 + 1), across);
        line(top as i64).lerp(line(top as i64 + 1), down)
    });
    Environment { radiance }
}

fn absent(path: &Path, what: &str) -> Error {
    Error::new(ErrorKind::Missing, format!("{what} is not there"))
        .at(Place::File(path.into()))
        .remedy("--protocol needs the data set as it was downloaded, with its ground truth")
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
#[path = "../../../tests/core/benchmark_protocols.rs"]
mod tests;
