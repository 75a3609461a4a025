//! A background of one colour in all photos: a matte of white or black, which is no sky.
//!
//! Renderers and editors put objects on such a matte. Taken for the sky it would be the brightest thing of the scene, or a
//! night. Where masks tell background from object, what they call background is compared over all photos; where nothing does,
//! the frame of the photos is, and what hangs together with it in its colour is set aside.

use super::photos::LoadedPhoto;
use crate::error::{Finding, Severity};
use crate::image::{Image, transfer};
use crate::scene::{Photo, PixelState};
use glam::Vec3;

/// A matte is the same to this many steps of a byte of sRGB: JPEG moves it by one or two.
const TOLERANCE: u8 = 3;
/// Share of what masks call background that must be of one colour. Renderers leave no speck.
const SHARE_BEHIND_MASKS: f64 = 0.995;
/// Share of the frame that must be: objects may touch it.
const SHARE_OF_FRAME: f64 = 0.5;
/// Share of the photos that must agree.
const SHARE_OF_PHOTOS: f64 = 0.9;
/// Pixels of a photo that are looked at behind masks.
const SAMPLES: usize = 1 << 14;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Matte {
    /// Its colour in bytes of sRGB.
    pub colour: [u8; 3],
    /// Whether masks tell where it is.
    pub is_masked: bool,
}

/// Looks for one colour behind what all photos show.
pub fn find(photos: &[LoadedPhoto]) -> Option<Matte> {
    // Photos that show nothing else hold no object: that is told as what it is.
    let shows_more = |photo: &LoadedPhoto| {
        let width = photo.states.width().max(1);
        let step = (photo.states.pixels().len() / SAMPLES).max(1);
        let mut colours =
            (0..photo.states.pixels().len()).step_by(step).map(|at| colour_at(&photo.photo, at / width, at % width));
        colours.next().is_some_and(|first| colours.any(|other| !same(first, other)))
    };
    if !photos.iter().any(shows_more) {
        return None;
    }
    let has_mask = |photo: &&LoadedPhoto| photo.states.pixels().iter().any(|state| state.is_background());
    let masked: Vec<&LoadedPhoto> = photos.iter().filter(has_mask).collect();
    let is_masked = 2 * masked.len() > photos.len();
    let (asked, least_share) =
        if is_masked { (masked, SHARE_BEHIND_MASKS) } else { (photos.iter().collect(), SHARE_OF_FRAME) };
    if asked.len() < 2 {
        return None;
    }
    let colours: Vec<[u8; 3]> = asked
        .iter()
        .filter_map(|photo| {
            let colours = if is_masked { behind_mask(photo) } else { of_frame(photo) };
            common(colours, least_share)
        })
        .collect();
    let colour = common(colours.iter().copied(), SHARE_OF_PHOTOS)?;
    let agree = colours.iter().filter(|other| same(colour, **other)).count();
    (agree as f64 >= SHARE_OF_PHOTOS * asked.len() as f64).then_some(Matte { colour, is_masked })
}

/// Takes the matte out of the evidence: behind masks it becomes black, elsewhere what hangs together with the frame in its
/// colour is ignored.
pub fn set_aside(photos: &mut [LoadedPhoto], matte: Matte) {
    for loaded in photos {
        if matte.is_masked {
            blacken(&mut loaded.photo, &mut loaded.states);
        } else {
            ignore_from_frame(loaded, matte.colour);
        }
    }
}

/// What is told of it.
pub fn told(matte: Matte, count: usize) -> Finding {
    let name = match matte.colour {
        [red, green, blue] if red.min(green).min(blue) >= 250 => "white".to_owned(),
        [red, green, blue] if red.max(green).max(blue) <= 5 => "black".to_owned(),
        [red, green, blue] => format!("of the one colour {red} {green} {blue}"),
    };
    let severity = if matte.is_masked { Severity::Note } else { Severity::Warning };
    let message =
        format!("the background of all {count} photos is {name}: it is treated as a backdrop, not as the environment");
    Finding::new(severity, "background-matte", message)
        .remedy("if it is the real environment, read the scene with --scene-background environment")
}

fn colour_at(photo: &Photo, row: usize, column: usize) -> [u8; 3] {
    match photo {
        Photo::Srgb8(image) => image[(row, column)],
        _ => photo.radiance(row, column).to_array().map(transfer::srgb8_from_linear_value),
    }
}

fn same(a: [u8; 3], b: [u8; 3]) -> bool {
    (0..3).all(|channel| a[channel].abs_diff(b[channel]) <= TOLERANCE)
}

/// The colour that at least this share of some have, to the tolerance; `None` where none is so common.
fn common(colours: impl Iterator<Item = [u8; 3]>, least_share: f64) -> Option<[u8; 3]> {
    let all: Vec<[u8; 3]> = colours.collect();
    let mut counts = std::collections::BTreeMap::new();
    all.iter().for_each(|colour| *counts.entry(*colour).or_insert(0usize) += 1);
    // Of equal counts the brightest: any rule does, but it must be one.
    let (&most, _) = counts.iter().max_by_key(|(colour, count)| (**count, **colour))?;
    let agree = all.iter().filter(|colour| same(most, **colour)).count();
    (agree as f64 >= least_share * all.len() as f64).then_some(most)
}

fn behind_mask(loaded: &LoadedPhoto) -> Box<dyn Iterator<Item = [u8; 3]> + '_> {
    let width = loaded.states.width().max(1);
    let places = loaded.states.pixels().iter().enumerate().filter(|(_, state)| state.is_background());
    let step = (places.clone().count() / SAMPLES).max(1);
    Box::new(places.step_by(step).map(move |(index, _)| colour_at(&loaded.photo, index / width, index % width)))
}

/// Places of the outermost pixels.
fn frame(width: usize, height: usize) -> Vec<(usize, usize)> {
    let last_row = height.saturating_sub(1);
    let rows = (0..height).flat_map(|row| [(row, 0), (row, width.saturating_sub(1))]);
    let columns = (0..width).flat_map(|column| [(0, column), (last_row, column)]);
    rows.chain(columns).collect()
}

fn of_frame(loaded: &LoadedPhoto) -> Box<dyn Iterator<Item = [u8; 3]> + '_> {
    let places = frame(loaded.states.width(), loaded.states.height());
    let is_seen = |place: &(usize, usize)| loaded.states[*place] != PixelState::Ignored;
    Box::new(places.into_iter().filter(is_seen).map(|(row, column)| colour_at(&loaded.photo, row, column)))
}

fn blacken(photo: &mut Photo, states: &mut Image<PixelState>) {
    for (index, state) in states.pixels_mut().iter_mut().enumerate().filter(|(_, state)| state.is_background()) {
        *state = PixelState::Background;
        match photo {
            Photo::Srgb8(image) => image.pixels_mut()[index] = [0; 3],
            Photo::MeanOfSrgb8(image) | Photo::Linear16(image) => image.pixels_mut()[index] = [half::f16::ZERO; 3],
            Photo::Linear32(image) => image.pixels_mut()[index] = Vec3::ZERO,
        }
    }
}

fn ignore_from_frame(loaded: &mut LoadedPhoto, colour: [u8; 3]) {
    let (width, height) = (loaded.states.width(), loaded.states.height());
    let mut open = frame(width, height);
    while let Some((row, column)) = open.pop() {
        if loaded.states[(row, column)] == PixelState::Ignored || !same(colour, colour_at(&loaded.photo, row, column)) {
            continue;
        }
        loaded.states[(row, column)] = PixelState::Ignored;
        let around =
            [(row.wrapping_sub(1), column), (row + 1, column), (row, column.wrapping_sub(1)), (row, column + 1)];
        open.extend(around.into_iter().filter(|(row, column)| *row < height && *column < width));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(background: impl Fn(usize, usize) -> [u8; 3], is_masked: bool) -> LoadedPhoto {
        let is_object = |row: usize, column: usize| (4..12).contains(&row) && (4..12).contains(&column);
        let photo =
            Image::from_fn(
                16,
                16,
                |row, column| {
                    if is_object(row, column) { [200, 120, 40] } else { background(row, column) }
                },
            );
        let state = |row, column| match is_object(row, column) || !is_masked {
            true => PixelState::Surface,
            false => PixelState::BackgroundClipped,
        };
        LoadedPhoto::new(Photo::Srgb8(photo), Image::from_fn(16, 16, state))
    }

    #[test]
    fn white_and_black_mattes_are_found_with_and_without_masks() {
        for (colour, is_masked) in [([255; 3], true), ([255; 3], false), ([0; 3], true), ([0; 3], false)] {
            let jpeg = |row: usize, column: usize| colour.map(|c: u8| c.abs_diff(((row + column) % 3) as u8));
            let mut photos: Vec<LoadedPhoto> = (0..3).map(|_| loaded(jpeg, is_masked)).collect();
            let matte = find(&photos).unwrap();
            assert!(same(matte.colour, colour) && matte.is_masked == is_masked);
            set_aside(&mut photos, matte);
            let expected = if is_masked { PixelState::Background } else { PixelState::Ignored };
            assert_eq!((photos[1].states[(0, 0)], photos[1].states[(3, 3)]), (expected, expected));
            assert_eq!(photos[1].states[(5, 5)], PixelState::Surface);
            if is_masked {
                assert_eq!(photos[1].photo.radiance(0, 0), Vec3::ZERO);
            }
        }
    }

    #[test]
    fn skies_and_photos_of_different_backgrounds_are_no_matte() {
        let sky = |row: usize, _| [90 + 8 * row as u8, 120 + 8 * row as u8, 230];
        for is_masked in [true, false] {
            assert_eq!(find(&[loaded(sky, is_masked), loaded(sky, is_masked)]), None);
            let photos = [40u8, 80, 120].map(|grey| loaded(move |_, _| [grey; 3], is_masked));
            assert_eq!(find(&photos), None);
        }
        assert_eq!(find(&[loaded(|_, _| [255; 3], false)]), None, "one photo says nothing of all");
    }
}
