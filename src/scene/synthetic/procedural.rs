//! Patterns in space: noise, stripes, checks, letters. Pure functions of place and seed.

use crate::math::random::mix;
use glam::{Vec2, Vec3};

/// A number in [0, 1) for a point of the whole-number lattice.
fn lattice(seed: u32, x: i32, y: i32, z: i32) -> f32 {
    let key = u64::from(seed) << 32 ^ u64::from(x as u32);
    let bits = mix(mix(mix(key) ^ u64::from(y as u32)) ^ u64::from(z as u32));
    (bits >> 40) as f32 * (1.0 / 16_777_216.0)
}

/// Smooth noise in [0, 1] with features of about one unit: lattice values joined by the quintic fade of
/// Perlin 2002 ("Improving Noise").
pub fn noise(seed: u32, point: Vec3) -> f32 {
    let floor = point.floor();
    let t = point - floor;
    let fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (x, y, z) = (floor.x as i32, floor.y as i32, floor.z as i32);
    let mix_of = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along_x = |dy: i32, dz: i32| {
        let at = |dx: i32| lattice(seed, x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz));
        mix_of(at(0), at(1), fade.x)
    };
    let along_y = |dz: i32| mix_of(along_x(0, dz), along_x(1, dz), fade.y);
    mix_of(along_y(0), along_y(1), fade.z)
}

/// Noise of several octaves, each half as large and half as wide as the one before; in [0, 1].
pub fn fractal(seed: u32, point: Vec3, octaves: u32) -> f32 {
    let (mut sum, mut weights, mut weight, mut place) = (0.0, 0.0, 1.0, point);
    for octave in 0..octaves {
        sum += weight * noise(seed.wrapping_add(octave * 101), place);
        weights += weight;
        weight *= 0.5;
        place = place * 2.0 + Vec3::new(17.3, -5.1, 9.7);
    }
    if weights > 0.0 { sum / weights } else { 0.5 }
}

/// 0 below `low`, 1 above `high`, a smooth cubic between.
pub fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How far `x` is from the nearest whole number, in [0, 0.5].
pub fn distance_to_whole(x: f32) -> f32 {
    (x - x.round()).abs()
}

/// Whether a place lies on a dark field of a checkerboard with fields of one unit.
pub fn is_dark_check(place: Vec2) -> bool {
    (place.x.floor() as i64 + place.y.floor() as i64).rem_euclid(2) == 1
}

/// Rows of the letters of `PATINA`, 5 x 7 dots, the leftmost dot in the highest bit.
fn dots_of(letter: char) -> [u8; 7] {
    match letter {
        'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
        'A' => [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
        'I' => [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'N' => [0b10001, 0b11001, 0b11001, 0b10101, 0b10011, 0b10011, 0b10001],
        _ => [0; 7],
    }
}

/// Whether a place lies on the ink of a line of text. The line fills `[0, 1]` in height (y up) and starts at x = 0; a
/// letter is 6/7 wide with its space.
pub fn is_ink(text: &str, place: Vec2) -> bool {
    if !(0.0..1.0).contains(&place.y) || place.x < 0.0 {
        return false;
    }
    let (column, row) = ((place.x * 7.0) as usize, ((1.0 - place.y) * 7.0).min(6.0) as usize);
    text.chars()
        .nth(column / 6)
        .is_some_and(|letter| column % 6 < 5 && dots_of(letter)[row] >> (4 - column % 6) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_varied_and_meets_the_lattice() {
        let (mut low, mut high) = (1.0f32, 0.0f32);
        for step in 0..4000 {
            let point = Vec3::new(step as f32 * 0.013 - 20.0, step as f32 * 0.007, 3.0 - step as f32 * 0.011);
            let (here, there) = (noise(5, point), noise(5, point + Vec3::splat(1e-3)));
            assert!((0.0..=1.0).contains(&here) && (here - there).abs() < 0.02);
            low = low.min(here);
            high = high.max(here);
        }
        assert!(low < 0.15 && high > 0.85, "{low} {high}");
        assert_eq!(noise(5, Vec3::new(2.0, -3.0, 4.0)), lattice(5, 2, -3, 4));
        assert_ne!(noise(5, Vec3::splat(0.3)), noise(6, Vec3::splat(0.3)));
    }

    #[test]
    fn letters_stand_upright() {
        // The stem of P runs over the full height at the left, its bowl is in the upper half only.
        assert!(is_ink("P", Vec2::new(0.05, 0.05)) && is_ink("P", Vec2::new(0.05, 0.95)));
        assert!(is_ink("P", Vec2::new(0.62, 0.7)) && !is_ink("P", Vec2::new(0.62, 0.2)));
        assert!(!is_ink("P", Vec2::new(0.05, 1.2)) && !is_ink("P", Vec2::new(2.0, 0.5)));
    }
}
