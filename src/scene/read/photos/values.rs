//! What a decoded photo says of each pixel, kept in the smallest form that loses nothing.

use crate::error::{Finding, Place, Severity};
use crate::image::{Image, RgbImage};
use crate::scene::read::source::SourceView;
use crate::scene::{Photo, PixelState};
use glam::Vec3;
use half::f16;

/// Sets the state of the pixels that a map marks; ignored pixels stay so.
pub(super) fn mark(
    states: &mut Image<PixelState>,
    map: Option<&Image<bool>>,
    state: PixelState,
    marks: impl Fn(bool) -> bool,
) {
    let Some(map) = map else { return };
    for (own, value) in states.pixels_mut().iter_mut().zip(map.pixels()) {
        if marks(*value) && *own != PixelState::Ignored {
            *own = state;
        }
    }
}

/// Radiance is finite and not negative: what is not is ignored or taken as 0.
pub(super) fn checked_floats(
    mut image: RgbImage,
    is_float: bool,
    view: &SourceView,
    findings: &mut Vec<Finding>,
    shared: &mut Vec<Finding>,
) -> (RgbImage, Image<PixelState>) {
    let mut states = Image::filled(image.width(), image.height(), PixelState::Surface);
    let width = image.width();
    let (mut not_finite, mut negative) = (0usize, 0usize);
    let mut first_bad = 0;
    for (index, (pixel, state)) in image.pixels_mut().iter_mut().zip(states.pixels_mut()).enumerate() {
        if !pixel.is_finite() {
            if not_finite == 0 {
                first_bad = index;
            }
            not_finite += 1;
            *pixel = Vec3::ZERO;
            *state = PixelState::Ignored;
        } else if pixel.min_element() < 0.0 {
            negative += 1;
            *pixel = pixel.max(Vec3::ZERO);
        }
    }
    if not_finite > 0 {
        findings.push(
            Finding::new(
                Severity::Warning,
                "photo-not-finite",
                format!("{not_finite} pixels are not finite, this is the first: they are ignored"),
            )
            .at(Place::Pixel {
                view: view.name.clone(),
                row: first_bad / width.max(1),
                column: first_bad % width.max(1),
            })
            .remedy("render or export the photo again if they matter")
            .extent(not_finite as f64),
        );
    }
    if negative > 0 && is_float {
        findings.push(
            Finding::new(
                Severity::Note,
                "photo-negative",
                format!("{negative} pixels are negative: they are set to 0"),
            )
            .at(Place::View(view.name.clone()))
            .extent(negative as f64),
        );
    } else if negative > 0 {
        shared.push(Finding::new(
            Severity::Note,
            "colour-out-of-gamut",
            "some colours are outside Rec. 709: their negative channels are set to 0",
        ));
    }
    (image, states)
}

/// The smallest form that keeps what the file says. `of_bytes` photos are eight-bit photographs in another colour space.
pub(super) fn kept(
    image: RgbImage,
    mut states: Image<PixelState>,
    of_bytes: bool,
    as_half: bool,
) -> (Photo, Image<PixelState>) {
    let survives_half = |value: f32| f16::from_f32(value).to_f32() == value;
    if as_half || image.pixels().iter().all(|pixel| pixel.to_array().into_iter().all(survives_half)) {
        for (pixel, state) in image.pixels().iter().zip(states.pixels_mut()) {
            if pixel.max_element() > f16::MAX.to_f32() && *state == PixelState::Surface {
                *state = PixelState::SurfaceClipped;
            }
        }
        let half = image.map(|pixel| to_half(*pixel));
        return (if of_bytes { Photo::MeanOfSrgb8(half) } else { Photo::Linear16(half) }, states);
    }
    (Photo::Linear32(image), states)
}

pub(super) fn to_half(pixel: Vec3) -> [f16; 3] {
    pixel.min(Vec3::splat(f16::MAX.to_f32())).to_array().map(f16::from_f32)
}
