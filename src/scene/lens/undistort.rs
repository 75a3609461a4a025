//! A photo resampled once, in linear light, to what a pinhole of the same resolution would have seen.

use super::Lens;
use crate::image::Image;
use crate::scene::{Photo, PixelState};
use glam::{DVec2, DVec3, Vec3};
use half::f16;

/// The pinhole of the resampled photo: intrinsics in pixels, the centre of the upper left pixel at (0.5, 0.5). The lens has
/// the same, so that the resolution on the axis stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal lengths along x and y.
    pub focal_pixels: DVec2,
    /// The principal point.
    pub centre_pixels: DVec2,
}

/// What the resampling did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Undistorted {
    /// Largest distance between a pixel and where it came from, in pixels.
    pub largest_shift_pixels: f64,
    /// Share of the pinhole's pixels that lie outside the photo, in [0, 1].
    pub share_outside: f64,
    /// Share of the photo's pixels that lie outside the pinhole's picture, in [0, 1].
    pub share_unused: f64,
}

/// Share of the photo, by a grid of its pixels, that falls outside a pinhole's picture of its size.
fn share_unused((width, height): (usize, usize), lens: &Lens, pinhole: &Pinhole, valid_radius: f64) -> f64 {
    /// Places along each side.
    const GRID: usize = 32;
    let place = |index: usize, side: usize| (index as f64 + 0.5) * side as f64 / GRID as f64;
    let is_used = |index: &usize| {
        let from = DVec2::new(place(index % GRID, width), place(index / GRID, height));
        let on_plane = (from - pinhole.centre_pixels) / pinhole.focal_pixels;
        lens.unproject(on_plane, valid_radius).filter(|direction| direction.z > 0.0).is_some_and(|direction| {
            let kept = direction.truncate() / direction.z * pinhole.focal_pixels + pinhole.centre_pixels;
            kept.x >= 0.0 && kept.y >= 0.0 && kept.x <= width as f64 && kept.y <= height as f64
        })
    };
    let used = (0..GRID * GRID).filter(is_used).count();
    1.0 - used as f64 / (GRID * GRID) as f64
}

/// Where a place of the pinhole's picture lies on the photo, in pixels; `None` beyond `valid_radius` of the lens.
fn place_in_photo(place: DVec2, lens: &Lens, pinhole: &Pinhole, valid_radius: f64) -> Option<DVec2> {
    let on_plane = (place - pinhole.centre_pixels) / pinhole.focal_pixels;
    let radius = on_plane.length();
    let reached = if lens.model.is_on_angles() { radius.atan() } else { radius };
    let inside = reached <= valid_radius;
    inside.then(|| lens.project(DVec3::new(on_plane.x, on_plane.y, 1.0)) * pinhole.focal_pixels + pinhole.centre_pixels)
}

/// Resamples a photo and its states. Pixels from outside the photo, or across the edge of a mask, are ignored; a pixel
/// that a clipped one took part in is clipped.
pub fn undistort(
    photo: &Photo,
    states: &Image<PixelState>,
    lens: &Lens,
    pinhole: &Pinhole,
) -> (Photo, Image<PixelState>, Undistorted) {
    let (width, height) = (photo.width(), photo.height());
    let linear = photo.to_linear();
    let valid_radius = lens.valid_radius();
    let mut done = Undistorted::default();
    let mut outside = 0usize;
    let mut resampled_states = Image::filled(width, height, PixelState::Ignored);
    let mut resampled = Image::filled(width, height, Vec3::ZERO);
    for row in 0..height {
        for column in 0..width {
            let place = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            let from = place_in_photo(place, lens, pinhole, valid_radius);
            let inside = |from: &DVec2| {
                let (u, v) = (from.x - 0.5, from.y - 0.5);
                u >= 0.0 && v >= 0.0 && u <= (width - 1) as f64 && v <= (height - 1) as f64
            };
            let Some(from) = from.filter(inside) else {
                outside += 1;
                continue;
            };
            done.largest_shift_pixels = done.largest_shift_pixels.max((from - place).length());
            let (value, state) = sample(&linear, states, from - 0.5);
            resampled[(row, column)] = value;
            resampled_states[(row, column)] = state;
        }
    }
    done.share_unused = share_unused((width, height), lens, pinhole, valid_radius);
    done.share_outside = outside as f64 / (width * height).max(1) as f64;
    let halves = |image: &Image<Vec3>| {
        image.map(|pixel| pixel.min(Vec3::splat(f16::MAX.to_f32())).to_array().map(f16::from_f32))
    };
    let photo = match photo {
        Photo::Linear32(_) => Photo::Linear32(resampled),
        Photo::Linear16(_) => Photo::Linear16(halves(&resampled)),
        Photo::Srgb8(_) | Photo::MeanOfSrgb8(_) => Photo::MeanOfSrgb8(halves(&resampled)),
    };
    (photo, resampled_states, done)
}

/// The photo at a place in units of pixels, pixel centres at whole numbers: cubic (Catmull and Rom 1974), held within the
/// four pixels around so that it does not ring; bilinear where one of the sixteen is missing or ignored.
fn sample(linear: &Image<Vec3>, states: &Image<PixelState>, place: DVec2) -> (Vec3, PixelState) {
    let (width, height) = (linear.width(), linear.height());
    let left = (place.x as usize).min(width.saturating_sub(2));
    let upper = (place.y as usize).min(height.saturating_sub(2));
    let (right, lower) = ((left + 1).min(width - 1), (upper + 1).min(height - 1));
    let fraction = [(place.x - left as f64) as f32, (place.y - upper as f64) as f32];
    let corners = [(upper, left), (upper, right), (lower, left), (lower, right)];
    let weights = [
        (1.0 - fraction[1]) * (1.0 - fraction[0]),
        (1.0 - fraction[1]) * fraction[0],
        fraction[1] * (1.0 - fraction[0]),
        fraction[1] * fraction[0],
    ];
    // A pixel without weight has no say: a lens that moves nothing changes no state.
    let used = || corners.iter().zip(weights).filter(|(_, weight)| *weight > 1e-4).map(|(corner, _)| states[*corner]);
    let backgrounds = used().filter(|state| state.is_background()).count();
    let clipped = used().any(PixelState::is_clipped);
    if used().any(|state| state == PixelState::Ignored) || (backgrounds > 0 && backgrounds < used().count()) {
        return (Vec3::ZERO, PixelState::Ignored);
    }
    let state = match (backgrounds > 0, clipped) {
        (false, false) => PixelState::Surface,
        (false, true) => PixelState::SurfaceClipped,
        (true, false) => PixelState::Background,
        (true, true) => PixelState::BackgroundClipped,
    };
    let around = corners.map(|corner| linear[corner]);
    let bilinear = around.iter().zip(weights).fold(Vec3::ZERO, |sum, (value, weight)| sum + *value * weight);
    if left == 0 || upper == 0 || left + 2 >= width || upper + 2 >= height {
        return (bilinear, state);
    }
    let across = cubic_weights(fraction[0]);
    let down = cubic_weights(fraction[1]);
    let mut sum = Vec3::ZERO;
    for (i, weight_down) in down.into_iter().enumerate() {
        for (j, weight_across) in across.into_iter().enumerate() {
            let at = (upper + i - 1, left + j - 1);
            if states[at] == PixelState::Ignored {
                return (bilinear, state);
            }
            sum += linear[at] * (weight_down * weight_across);
        }
    }
    let least = around.into_iter().fold(around[0], Vec3::min);
    let most = around.into_iter().fold(around[0], Vec3::max);
    (sum.clamp(least, most), state)
}

fn cubic_weights(t: f32) -> [f32; 4] {
    [
        0.5 * t * (-1.0 + t * (2.0 - t)),
        0.5 * (2.0 + t * t * (-5.0 + 3.0 * t)),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (t - 1.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::lens::{Model, Polynomial};

    const PINHOLE: Pinhole = Pinhole { focal_pixels: DVec2::splat(80.0), centre_pixels: DVec2::new(49.0, 41.5) };

    /// A smooth picture of directions, as a pinhole sees it.
    fn scene(direction: DVec2) -> Vec3 {
        let value = |phase: f64| (0.5 + 0.3 * (5.0 * direction.x + phase).sin() * (4.0 * direction.y).cos()) as f32;
        Vec3::new(value(0.0), value(1.0), value(2.0))
    }

    #[test]
    fn a_photo_through_a_lens_becomes_what_a_pinhole_sees() {
        let numerator = [-0.15, 0.03, 0.0, 0.0, 0.0, 0.0];
        let polynomial = Polynomial { numerator, tangential: [2e-3, -1e-3], ..Default::default() };
        let lens = Lens::new(Model::Polynomial(polynomial));
        let valid = lens.valid_radius();
        let photo = Image::from_fn(100, 80, |row, column| {
            let place = (DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - PINHOLE.centre_pixels) / 80.0;
            let direction = lens.unproject(place, valid).unwrap();
            scene(direction.truncate() / direction.z)
        });
        let states = Image::filled(100, 80, PixelState::Surface);
        let (seen, states, done) = undistort(&Photo::Linear32(photo), &states, &lens, &PINHOLE);
        let mut largest = 0.0f32;
        let mut count = 0;
        for row in 0..80 {
            for column in 0..100 {
                if states[(row, column)] == PixelState::Surface {
                    let place = (DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - PINHOLE.centre_pixels) / 80.0;
                    largest = largest.max((seen.radiance(row, column) - scene(place)).abs().max_element());
                    count += 1;
                }
            }
        }
        assert!(count > 7900 && largest < 4e-3, "{count} pixels off by {largest}");
        assert!(done.largest_shift_pixels > 3.0 && done.largest_shift_pixels < 10.0, "{done:?}");
    }

    #[test]
    fn what_lies_outside_the_photo_is_ignored_and_counted() {
        // A pincushion photo holds less than its pinhole at the corners.
        let polynomial = Polynomial { numerator: [0.3, 0.0, 0.0, 0.0, 0.0, 0.0], ..Default::default() };
        let lens = Lens::new(Model::Polynomial(polynomial));
        let photo = Photo::Srgb8(Image::filled(100, 80, [120; 3]));
        let (seen, states, done) = undistort(&photo, &Image::filled(100, 80, PixelState::Surface), &lens, &PINHOLE);
        assert_eq!(states[(0, 0)], PixelState::Ignored);
        let ignored = states.pixels().iter().filter(|state| **state == PixelState::Ignored).count();
        assert_eq!(done.share_outside, ignored as f64 / 8000.0);
        assert!(!seen.is_linear(), "it is a photograph of eight bits still");
        assert!((seen.radiance(40, 50) - photo.radiance(40, 50)).length() < 1e-3);
    }

    #[test]
    fn what_the_pinhole_leaves_of_a_wide_photo_is_counted() {
        let photo = Photo::Srgb8(Image::filled(100, 80, [120; 3]));
        let states = Image::filled(100, 80, PixelState::Surface);
        let share = |lens: &Lens, pinhole: &Pinhole| undistort(&photo, &states, lens, pinhole).2.share_unused;
        let wide = Pinhole { focal_pixels: DVec2::splat(50.0), centre_pixels: DVec2::new(50.0, 40.0) };
        let fisheye = Polynomial { base: crate::scene::lens::Base::Angle, ..Default::default() };
        // On the axes the pinhole keeps atan(1) of 1 and atan(0.8) of 0.8 radians, in the corners less.
        let kept = (1f64.atan() / 1.0) * (0.8f64.atan() / 0.8);
        let unused = share(&Lens::new(Model::Polynomial(fisheye)), &wide);
        assert!(unused > 1.0 - kept && unused < 1.2 - kept, "{unused}");
        assert_eq!(share(&Lens::new(Model::Polynomial(Polynomial::default())), &wide), 0.0);
    }

    #[test]
    fn edges_of_masks_and_clipped_pixels_keep_their_meaning() {
        let polynomial = Polynomial { numerator: [0.01, 0.0, 0.0, 0.0, 0.0, 0.0], ..Default::default() };
        let lens = Lens::new(Model::Polynomial(polynomial));
        let states = Image::from_fn(100, 80, |row, column| match (row, column) {
            (_, 0..30) => PixelState::Background,
            (40, 70) => PixelState::SurfaceClipped,
            _ => PixelState::Surface,
        });
        let (_, states, _) = undistort(&Photo::Srgb8(Image::filled(100, 80, [99; 3])), &states, &lens, &PINHOLE);
        assert_eq!(states[(40, 10)], PixelState::Background);
        assert!((28..32).any(|column| states[(20, column)] == PixelState::Ignored), "a mixture is no evidence");
        assert!((68..73).any(|column| states[(40, column)] == PixelState::SurfaceClipped));
    }
}
