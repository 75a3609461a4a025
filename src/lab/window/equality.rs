//! Whether a fit that was watched is the fit that was not, bit for bit.

use super::person::Person;
use super::slowdown::{forget_run, prepared_of};
use crate::error::{Error, ErrorKind, Result};
use crate::export::RunFolder;
use crate::fit::FitSettings;
use crate::job::open;
use crate::job::{self, Event, JobOptions, Snapshot};
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::studio::act::Act;
use crate::studio::model::FitStatus;
use eframe::egui::Key;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Steps of each of the two fits' steps.
const STEPS: usize = 8;
/// How long a fit may take, in seconds.
const LONG: f64 = 900.0;

/// What was compared.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct EqualityRow {
    /// The scene.
    pub scene: String,
    /// Steps of both fits.
    pub steps: usize,
    /// Numbers of maps and light that were compared.
    pub numbers: usize,
    /// Numbers that differ in a bit; 0 is what must be.
    pub different: usize,
}

/// Fits the open scene twice, without the window and under it with somebody at work, and compares maps and light.
///
/// # Errors
/// Where a fit fails.
pub fn measure(person: &Person, scene: &str, folder: &Path) -> Result<EqualityRow> {
    person.ask(|studio, _| {
        let fit = &mut studio.model.edits.fit;
        *fit = FitSettings { steps_diffuse: STEPS, steps_all: STEPS, ..fit.clone() };
    })?;
    let alone = fit_alone(person, folder)?;
    person.ask(|studio, _| {
        forget_run(studio);
        studio.model.act(Act::Start);
    })?;
    let mut round = 0;
    loop {
        let status = person.ask(|studio, _| studio.model.fit.status.clone())?;
        match status {
            FitStatus::Finished => break,
            FitStatus::Failed(message) => return Err(Error::new(ErrorKind::Internal, message)),
            _ => {}
        }
        // Somebody is at work meanwhile: turns the light, changes layer and photo, holds the fit and lets it go on.
        let keys = [Key::ArrowRight, Key::Num2, Key::CloseBracket, Key::E, Key::Num1, Key::Space, Key::Space];
        person.press(keys[round % keys.len()]);
        person.watch(0.4);
        round += 1;
        if round as f64 * 0.4 > LONG {
            return Err(Error::new(ErrorKind::Internal, "the watched fit does not end"));
        }
    }
    let watched = person.ask(|studio, _| studio.model.fit.snapshot.clone())?;
    let watched = watched.ok_or_else(|| Error::new(ErrorKind::Internal, "the watched fit left no maps"))?;
    let (numbers, different) = compared(&alone, &watched);
    Ok(EqualityRow { scene: scene.into(), steps: watched.step, numbers, different })
}

fn fit_alone(person: &Person, folder: &Path) -> Result<Arc<Snapshot>> {
    let (prepared, settings) = prepared_of(person)?;
    let stop = AtomicBool::new(false);
    let (prepared, fitter, settings) = open::begin(prepared, settings, &stop, &|_, _| {})?;
    let job = job::start_with(prepared, fitter, settings, RunFolder::create(folder)?, JobOptions::default())?;
    let mut failure = None;
    for event in job.events.iter() {
        match event {
            Event::Finished(_) => break,
            Event::Failed(error) => failure = Some(error),
            _ => {}
        }
    }
    let snapshot = job.snapshot.newest();
    job.join();
    let _ = std::fs::remove_dir_all(folder);
    match (failure, snapshot) {
        (None, Some((_, snapshot))) => Ok(snapshot),
        (Some(error), _) => Err(error),
        _ => Err(Error::new(ErrorKind::Internal, "the fit without the window left no maps")),
    }
}

/// Numbers compared, and how many differ.
fn compared(one: &Snapshot, other: &Snapshot) -> (usize, usize) {
    let (one, other) = (bits_of(&one.maps, &one.environment), bits_of(&other.maps, &other.environment));
    let different = one.iter().zip(&other).filter(|(one, other)| one != other).count();
    (one.len().max(other.len()), different + one.len().abs_diff(other.len()))
}

fn bits_of(maps: &MaterialMaps, environment: &Environment) -> Vec<u32> {
    let colours = [&maps.diffuse, &maps.specular, &environment.radiance];
    let colours = colours.into_iter().flat_map(|image| image.pixels().iter().flat_map(|rgb| rgb.to_array()));
    colours.chain(maps.roughness.pixels().iter().copied()).map(f32::to_bits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use glam::Vec3;

    #[test]
    fn one_bit_is_seen() {
        let maps = |value: f32| MaterialMaps {
            diffuse: Image::filled(2, 2, Vec3::splat(0.5)),
            specular: Image::filled(2, 2, Vec3::splat(value)),
            roughness: Image::filled(2, 2, 0.5),
        };
        let light = Environment::constant(4, 2, Vec3::ONE);
        let (one, other) =
            (bits_of(&maps(0.25), &light), bits_of(&maps(f32::from_bits(0.25f32.to_bits() + 1)), &light));
        assert_eq!(one.iter().zip(&other).filter(|(one, other)| one != other).count(), 12);
    }
}
