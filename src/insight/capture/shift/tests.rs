use super::*;
use crate::math::random::SequentialRandom;

/// A smooth pattern at a place, in [0, 1].
fn pattern(x: f64, y: f64) -> Vec3 {
    let wave = |a: f64, b: f64, c: f64| (0.5 + 0.2 * (a * x + b * y + c).sin()) as f32;
    Vec3::new(wave(0.5, 0.2, 0.0), wave(-0.3, 0.45, 1.0), wave(0.21, -0.6, 2.0))
}

fn picture(shift: [f64; 2], roll: f64, noise: f32, seed: u64) -> RgbImage {
    let mut random = SequentialRandom::new(seed);
    Image::from_fn(56, 48, |row, column| {
        let (x, y) = (column as f64 - 27.5, row as f64 - 23.5);
        let mut draw = || noise * 3.46 * (random.next_number() - 0.5);
        let noise = Vec3::new(draw(), draw(), draw());
        pattern(x - shift[0] + roll * y, y - shift[1] - roll * x) + noise
    })
}

#[test]
fn a_known_shift_and_roll_are_found_within_their_errors() {
    let valid = Image::filled(56, 48, true);
    for (known, roll) in [([0.0, 0.0], 0.0), ([0.4, -0.3], 0.0), ([-1.9, 1.2], 0.0), ([0.6, 0.9], 0.02)] {
        let halves = [picture([0.0; 2], 0.0, 0.03, 2), picture([0.0; 2], 0.0, 0.03, 3)];
        let shift = shift_between(&picture(known, roll, 0.02, 1), [&halves[0], &halves[1]], &valid).unwrap();
        for (found, known) in shift.pixels.iter().zip(known) {
            assert!((found - known).abs() < 0.06, "{shift:?} for {known:?}");
        }
        assert!((shift.roll_radians - roll).abs() < 0.002, "{shift:?} for {roll}");
        assert!(shift.pixels_error.iter().all(|error| (0.002..0.06).contains(error)), "{shift:?}");
    }
}

#[test]
fn shading_and_brightness_of_their_own_move_nothing() {
    let valid = Image::filled(56, 48, true);
    let own = picture([0.7, 0.0], 0.0, 0.0, 1);
    let photo = Image::from_fn(56, 48, |row, column| {
        own[(row, column)] * (0.7 + 0.01 * column as f32) + Vec3::splat(0.004 * row as f32)
    });
    let half = picture([0.0; 2], 0.0, 0.0, 1);
    let shift = shift_between(&photo, [&half, &half], &valid).unwrap();
    assert!((shift.pixels[0] - 0.7).abs() < 0.05 && shift.pixels[1].abs() < 0.05, "{shift:?}");
}

#[test]
fn noise_alone_is_never_four_errors_and_a_quarter_of_a_pixel_away() {
    let valid = Image::filled(56, 48, true);
    for seed in 0..12 {
        let halves = [picture([0.0; 2], 0.0, 0.05, 100 + seed), picture([0.0; 2], 0.0, 0.05, 200 + seed)];
        let Some(shift) = shift_between(&picture([0.0; 2], 0.0, 0.1, seed), [&halves[0], &halves[1]], &valid) else {
            continue;
        };
        let (length, error) = shift.length();
        assert!(length < 0.25 || length < 4.0 * error, "{shift:?}");
    }
}

#[test]
fn flat_and_empty_pictures_say_nothing() {
    let grey = Image::filled(56, 48, Vec3::splat(0.5));
    assert!(shift_between(&grey, [&grey, &grey], &Image::filled(56, 48, true)).is_none());
    assert!(shift_between(&grey, [&grey, &grey], &Image::filled(56, 48, false)).is_none());
    let tiny = Image::filled(1, 1, Vec3::ONE);
    assert!(shift_between(&tiny, [&tiny, &tiny], &Image::filled(1, 1, true)).is_none());
}
