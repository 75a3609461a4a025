//! Finishes: what the demo and study surfaces are made of, each as a function of a place in its object's own space.
//!
//! They span what the fit must tell apart: dielectrics (F0 about 0.04) and coloured metals, roughness from 0.02 to 0.9,
//! and edges in each map that the other two do not have.

use super::bake::Reflectance;
use super::procedural::{distance_to_whole, fractal, is_dark_check, is_ink, noise, smooth_step};
use glam::{Vec2, Vec3};

fn rgb(red: f32, green: f32, blue: f32) -> Vec3 {
    Vec3::new(red, green, blue)
}

fn blend(a: Reflectance, b: Reflectance, t: f32) -> Reflectance {
    Reflectance {
        diffuse: a.diffuse.lerp(b.diffuse, t),
        specular: a.specular.lerp(b.specular, t),
        roughness: a.roughness + (b.roughness - a.roughness) * t,
    }
}

fn dielectric(diffuse: Vec3, roughness: f32) -> Reflectance {
    Reflectance { diffuse, specular: Vec3::splat(0.04), roughness }
}

/// Copper at normal incidence (Gulbrandsen 2014, table 1, rounded).
const COPPER: Vec3 = Vec3::new(0.93, 0.62, 0.52);
/// Gold, from the same table.
const GOLD: Vec3 = Vec3::new(0.98, 0.78, 0.37);

/// Bare copper with streaks of polish, going green where `weathering` in [0, 1] is above the noise.
pub fn copper(point: Vec3, weathering: f32) -> Reflectance {
    let polish = fractal(31, point * Vec3::new(2.0, 9.0, 2.0), 3);
    let metal = Reflectance { diffuse: Vec3::splat(0.01), specular: COPPER, roughness: 0.03 + 0.22 * polish };
    let verdigris = dielectric(rgb(0.18, 0.42, 0.34) * (0.7 + 0.6 * noise(37, point * 11.0)), 0.75);
    let age = fractal(33, point * 2.6, 4) - 0.25 * point.y;
    blend(metal, verdigris, smooth_step(0.0, 0.05, age + weathering - 1.0))
}

/// Wood with rings around an axis near y, oiled along the dark rings.
pub fn wood(point: Vec3) -> Reflectance {
    let wobble = fractal(41, point * Vec3::new(1.2, 4.0, 1.2), 3) - 0.5;
    let radius = Vec2::new(point.x + 0.35, point.z * 1.2).length() + 0.25 * wobble;
    let ring = distance_to_whole(radius * 5.5) * 2.0;
    let fibre = noise(43, point * Vec3::new(8.0, 40.0, 8.0));
    let pale = rgb(0.58, 0.36, 0.19);
    let dark = rgb(0.27, 0.12, 0.055);
    let share = smooth_step(0.25, 0.85, ring);
    dielectric(dark.lerp(pale, share) * (0.85 + 0.3 * fibre), 0.18 + 0.35 * share)
}

/// Marble: white with dark veins, polished; the veins are a little duller. Letters of the name are inlaid in brass on
/// the faces of a cube of half width `half_edge`.
pub fn marble_with_letters(point: Vec3, normal: Vec3, half_edge: f32) -> Reflectance {
    let bend = fractal(51, point * 2.2, 4) - 0.5;
    let vein = 1.0 - smooth_step(0.0, 0.2, (point.dot(rgb(1.3, 0.9, -0.7)) * 1.6 + 3.2 * bend).sin().abs());
    let cloud = fractal(53, point * 4.0, 3);
    let white = rgb(0.78, 0.76, 0.72) * (0.82 + 0.3 * cloud);
    let stone = dielectric(white.min(Vec3::splat(0.88)).lerp(rgb(0.16, 0.18, 0.21), 0.85 * vein), 0.06 + 0.16 * vein);
    // Each face carries one letter, in the plane of its two other axes.
    let face = normal.abs().max_position();
    let positive = normal[face] > 0.0;
    let sign = if positive { 1.0 } else { -1.0 };
    let (across, up) = match face {
        0 => (-sign * point.z, point.y),
        1 => (point.x, -sign * point.z),
        _ => (sign * point.x, point.y),
    };
    let letter = ["P", "I", "A", "T", "N", "A"][face + if positive { 0 } else { 3 }];
    let place = Vec2::new(across, up) / (1.3 * half_edge) + Vec2::new(5.0 / 14.0, 0.5);
    let brass = Reflectance { diffuse: Vec3::splat(0.02), specular: GOLD * 0.9, roughness: 0.12 };
    if is_ink(letter, place) { brass } else { stone }
}

/// Glazed ceramic with painted bands and a bare foot; `height` is that of the vase.
pub fn glaze(point: Vec3, height: f32) -> Reflectance {
    let y = point.y / height;
    let angle = point.x.atan2(point.z) / std::f32::consts::TAU;
    let crackle = fractal(61, point * 9.0, 3);
    let cream = rgb(0.74, 0.70, 0.58) * (0.9 + 0.15 * crackle);
    let blue = rgb(0.035, 0.08, 0.34) * (0.8 + 0.5 * crackle);
    let zigzag = (y * 9.0 + 1.2 * distance_to_whole(angle * 12.0)).rem_euclid(1.0) < 0.35;
    let dots = Vec2::new(distance_to_whole(angle * 16.0) / 16.0 * 3.0, y - 0.71).length() < 0.022;
    let painted =
        (zigzag && (0.2..0.6).contains(&y)) || dots || (y > 0.86 && is_dark_check(Vec2::new(angle * 20.0, y * 30.0)));
    let glossy = Reflectance {
        diffuse: if painted { blue } else { cream },
        specular: Vec3::splat(0.055),
        roughness: 0.02 + 0.05 * crackle,
    };
    let bare = dielectric(rgb(0.42, 0.19, 0.1) * (0.7 + 0.6 * crackle), 0.7);
    blend(bare, glossy, smooth_step(0.1, 0.12, y + 0.03 * (fractal(63, point * 5.0, 2) - 0.5)))
}

/// Red enamel with gold bands along the object's x and y axes.
pub fn enamel_and_gold(point: Vec3) -> Reflectance {
    let band = distance_to_whole(point.x * 1.4 + point.y * 0.7);
    let grain = fractal(71, point * 6.0, 3);
    let gold = Reflectance { diffuse: Vec3::splat(0.015), specular: GOLD, roughness: 0.04 + 0.3 * grain * grain };
    let enamel = Reflectance {
        diffuse: rgb(0.5, 0.03, 0.03).lerp(rgb(0.1, 0.02, 0.16), smooth_step(0.35, 0.65, noise(73, point * 1.5))),
        specular: Vec3::splat(0.05),
        roughness: 0.08,
    };
    blend(gold, enamel, smooth_step(0.14, 0.16, band))
}

/// Felt: rough, speckled, in two colours.
pub fn felt(point: Vec3) -> Reflectance {
    let speckle = noise(81, point * 24.0);
    let two = smooth_step(0.48, 0.52, fractal(83, point * 1.8, 2));
    let colour = rgb(0.12, 0.3, 0.16).lerp(rgb(0.66, 0.5, 0.14), two);
    dielectric(colour * (0.7 + 0.55 * speckle), 0.9)
}

/// Stone tiles in two kinds with grout, the name painted across them; worn smooth towards the middle. Flat in x and z.
pub fn tiles(point: Vec3) -> Reflectance {
    let place = Vec2::new(point.x, point.z) / 0.8;
    let joint = distance_to_whole(place.x).min(distance_to_whole(place.y));
    let dark = is_dark_check(place);
    let tone = 0.65 + 0.6 * noise(91, Vec3::new(place.x.floor(), 0.0, place.y.floor()) * 7.7);
    let grain = fractal(93, point * 6.0, 4);
    let base = if dark { rgb(0.16, 0.15, 0.15) } else { rgb(0.48, 0.43, 0.36) };
    let wear = smooth_step(0.35, 0.65, fractal(95, point * 0.7, 3));
    let stone =
        dielectric(base * tone * (0.75 + 0.5 * grain), if dark { 0.12 + 0.3 * wear } else { 0.35 + 0.4 * wear });
    let grout = dielectric(rgb(0.3, 0.28, 0.26) * (0.8 + 0.4 * grain), 0.9);
    let paint = Reflectance { diffuse: rgb(0.7, 0.25, 0.06), specular: Vec3::splat(0.06), roughness: 0.2 };
    // Letters 0.8 high, in front of the objects, their feet towards +z.
    if is_ink("PATINA", Vec2::new(point.x + 2.1, 3.25 - point.z) / 0.8) {
        return paint;
    }
    blend(grout, stone, smooth_step(0.03, 0.045, joint))
}

/// Hide of a cow, diffuse only: black patches on white, a pink underside. `point` lies in about `[-1, 1]^3`.
pub fn cow_hide(point: Vec3) -> Reflectance {
    let patch = smooth_step(0.49, 0.53, fractal(101, point * 2.2, 3));
    let hair = noise(103, point * Vec3::new(30.0, 14.0, 30.0));
    let white = rgb(0.78, 0.74, 0.68) * (0.85 + 0.2 * hair);
    let black = rgb(0.06, 0.05, 0.045) * (0.7 + 0.6 * hair);
    let pink = rgb(0.66, 0.38, 0.33);
    let coat = white.lerp(black, patch).lerp(pink, smooth_step(0.15, 0.45, -point.y - 0.35 * point.x.abs()));
    Reflectance { diffuse: coat, specular: Vec3::ZERO, roughness: 1.0 }
}

/// Lustre ware: a dark body under a strong, coloured, sharp reflection. `point` lies in about `[-1, 1]^3`.
pub fn lustre(point: Vec3) -> Reflectance {
    let angle = point.x.atan2(point.z) / std::f32::consts::TAU;
    let leaf = distance_to_whole(angle * 7.0 + 0.8 * (point.y * 6.0).sin());
    let swirl = fractal(111, point * 3.5, 3);
    let body = rgb(0.05, 0.09, 0.2).lerp(rgb(0.25, 0.05, 0.07), smooth_step(0.4, 0.6, swirl));
    let plain = Reflectance { diffuse: body, specular: rgb(0.24, 0.28, 0.36), roughness: 0.02 + 0.05 * swirl };
    let metal = Reflectance { diffuse: Vec3::splat(0.03), specular: GOLD * 0.85, roughness: 0.05 + 0.12 * swirl };
    blend(metal, plain, smooth_step(0.13, 0.16, leaf))
}

/// A teddy with patches: fur, diffuse, and sewn-on patches of satin, specular. `point` lies in about `[-1, 1]^3`.
pub fn teddy(point: Vec3) -> Reflectance {
    let fur = noise(121, point * 26.0);
    let brown = rgb(0.42, 0.23, 0.09).lerp(rgb(0.62, 0.42, 0.2), fractal(123, point * 3.0, 3)) * (0.75 + 0.45 * fur);
    let coat = dielectric(brown, 0.6 + 0.25 * fur);
    let which = fractal(125, point * 1.7 + Vec3::splat(3.0), 2);
    let check = is_dark_check(Vec2::new(point.x + 0.4 * point.z, point.y) * 7.0);
    let satin = Reflectance {
        diffuse: if check { rgb(0.45, 0.06, 0.1) } else { rgb(0.1, 0.12, 0.4) },
        specular: if check { Vec3::splat(0.12) } else { rgb(0.2, 0.22, 0.3) },
        roughness: if check { 0.08 } else { 0.2 },
    };
    blend(coat, satin, smooth_step(0.56, 0.575, which))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finish_stays_in_range_and_keeps_energy() {
        let mut random = crate::math::random::SequentialRandom::new(4);
        for _ in 0..4000 {
            let mut next = || 2.4 * random.next_number() - 1.2;
            let (point, normal) = (rgb(next(), next(), next()), rgb(next(), next(), next()).normalize_or(Vec3::Y));
            for value in [
                copper(point, 0.5),
                wood(point),
                marble_with_letters(point, normal, 0.6),
                glaze(point + Vec3::Y, 2.0),
                enamel_and_gold(point),
                felt(point),
                tiles(point * 4.0),
                cow_hide(point),
                lustre(point),
                teddy(point),
            ] {
                let total = value.diffuse + value.specular;
                assert!(value.diffuse.min_element() >= 0.0 && value.specular.min_element() >= 0.0, "{value:?}");
                assert!(total.max_element() <= 1.0, "{value:?}");
                assert!((0.019..=1.0).contains(&value.roughness), "{value:?}");
            }
        }
    }
}
