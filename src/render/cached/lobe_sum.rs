//! Specular integrals of a shading point: what the lobe sends to the camera, before Fresnel.
//!
//! With Schlick's `F = F0 (1 - s) + s`, `s = (1 - h.o)^5`, the lobe's radiance is `F0 (S0 - S5) + S5`, where
//! `S0 = ∫ L V D G / (4 (n.i)(n.o)) (n.i) dω` and `S5` is the same integral with a factor `s`. Both are linear in the
//! light. [`LobeSums::base`] is `S0 - S5`, [`LobeSums::grazing`] is `S5`.
//!
//! Wide lobes are summed over the hats of the light, one value of the lobe a hat: no noise, and smooth in everything.
//! A lobe narrower than a few texels is integrated over half vectors instead, at fixed places of equal probability in a
//! frame that turns with the viewer ([`super::half_vector`]). Tails of GGX, in which such places are few and hats are many, are
//! summed over hats beside it: both have a share of each half vector ([`super::lobe_place::MIDDLE_TANGENT`]).
//!
//! A pixel on a curved surface sees many normals. To it the distribution of half vectors is that of the microfacets,
//! convolved with that of the normals: a lobe that is wider by their variance ([`LobePlace::width_seen`]).

use super::half_vector;
use super::half_vector_kernel::Part;
use super::half_vector_places::place_count;
use super::light_basis::LightBasis;
use super::lobe_kernel::{MOST_AT_ONCE, row_in, sums_in};
use super::lobe_place::{LobePlace, LobeSums, wide_from};
use crate::material::LobeModel;
use crate::math::vector::versions;

/// The sums of a lobe at several widths, which rise, without derivatives. `sums` is as long as `widths`.
pub fn lobe_sums(basis: &LightBasis, place: &LobePlace, widths: &[f32], sums: &mut [LobeSums]) {
    let narrow = widths.partition_point(|&width| place.width_seen(width) < wide_from(basis));
    let over_hats = if has_tails(place) { 0 } else { narrow };
    for (sums, widths) in sums[over_hats..].chunks_mut(MOST_AT_ONCE).zip(widths[over_hats..].chunks(MOST_AT_ONCE)) {
        let mut seen = [0.0; MOST_AT_ONCE];
        for (seen, &width) in seen.iter_mut().zip(widths) {
            *seen = place.width_seen(width);
        }
        wide_sums(basis, place, &seen[..widths.len()], sums);
    }
    for (sum, &width) in sums.iter_mut().zip(&widths[..narrow]) {
        let width = place.width_seen(width);
        let middle = half_vector::lobe_sums(basis, place, width, place_count(basis, width), Part::Middle);
        *sum = if has_tails(place) { sum.and(&middle) } else { middle };
    }
}

/// Whether narrow lobes have tails that are summed over hats beside them.
fn has_tails(place: &LobePlace) -> bool {
    place.model == LobeModel::Ggx
}

/// The sums of a lobe, without derivatives.
pub fn lobe_alone(basis: &LightBasis, place: &LobePlace, width: f32) -> LobeSums {
    let mut sums = [LobeSums::default()];
    lobe_sums(basis, place, &[width], &mut sums);
    sums[0]
}

/// The sums of a lobe and their derivatives by the logarithm of its width.
///
/// Over hats the derivative is that of the sum. Over half vectors it is the difference of the sum at widths two per cent
/// apart: the places move with the width, and between hats the sum bends.
pub fn lobe_with_derivative(basis: &LightBasis, place: &LobePlace, width: f32) -> LobeSums {
    let (width, slope_of_width) = (place.width_seen(width), place.slope_of_width_seen(width));
    let is_wide = width >= wide_from(basis);
    let mut sum = LobeSums::default();
    if is_wide || has_tails(place) {
        wide_sums_with_derivative(basis, place, &[width], std::slice::from_mut(&mut sum));
    }
    if !is_wide {
        const STEP: f32 = 0.01;
        let count = place_count(basis, width);
        let at = |width: f32| half_vector::lobe_sums(basis, place, width, count, Part::Middle);
        let (middle, below, above) = (at(width), at(width * (-STEP).exp()), at(width * STEP.exp()));
        let slope = |above: f32, below: f32| (above - below) / (2.0 * STEP);
        sum = sum.and(&LobeSums {
            d_base: std::array::from_fn(|c| slope(above.base[c], below.base[c])),
            d_grazing: std::array::from_fn(|c| slope(above.grazing[c], below.grazing[c])),
            ..middle
        });
    }
    for slope in sum.d_base.iter_mut().chain(&mut sum.d_grazing) {
        *slope *= slope_of_width;
    }
    sum
}

/// Adds the rows of `S0 - S5` and `S5`, times `scales`, to a row over the padded texels of the light.
pub fn add_lobe_row(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) {
    let width = place.width_seen(width);
    let is_wide = width >= wide_from(basis);
    if !is_wide {
        half_vector::add_lobe_row(basis, place, width, scales, row);
    }
    if is_wide || has_tails(place) {
        row_here(basis, place, width, scales, row);
    }
}

versions! {
    fn wide_sums(
        basis: &LightBasis,
        place: &LobePlace,
        widths: &[f32],
        sums: &mut [LobeSums],
    ) = sums_in[false];
    fn wide_sums_with_derivative(
        basis: &LightBasis,
        place: &LobePlace,
        widths: &[f32],
        sums: &mut [LobeSums],
    ) = sums_in[true];
    fn row_here(basis: &LightBasis, place: &LobePlace, width: f32, scales: [f32; 2], row: &mut [f32]) = row_in;
}

#[cfg(test)]
mod tests {
    use super::super::half_vector_kernel;
    use super::super::light_basis::LightPlanes;
    use super::super::seen_light::SeenLight;
    use super::*;
    use crate::material::{LobeGeometry, Material};
    use crate::math::random::SequentialRandom;
    use crate::math::sphere::{direction_of_texel, solid_angle_of_texel};
    use crate::math::vector::Plain;
    use glam::Vec3;

    fn light_of(basis: &LightBasis, seed: u64) -> LightPlanes {
        let mut random = SequentialRandom::new(seed);
        let mut light: Vec<[f32; 3]> =
            (0..basis.count()).map(|_| [(); 3].map(|()| 0.2 + 0.3 * random.next_number())).collect();
        // A sun.
        light[8 * 64 + 20] = [80.0; 3];
        basis.planes(&light)
    }

    /// The integrals by brute force over the bilinear light: the lobe of the path tracer on a fine grid.
    fn truth(
        light: &LightPlanes,
        (normal, viewer): (Vec3, Vec3),
        model: LobeModel,
        width: f32,
    ) -> ([f64; 3], [f64; 3]) {
        let (mut base, mut grazing) = ([0.0; 3], [0.0; 3]);
        let (fine_width, fine_height) = (64 * 10, 32 * 10);
        for row in 0..fine_height {
            let solid = solid_angle_of_texel(row, fine_width, fine_height);
            for column in 0..fine_width {
                let direction = direction_of_texel(row, column, fine_width, fine_height);
                let Some(geometry) = LobeGeometry::new(normal, direction, viewer) else { continue };
                let lobe = |specular: f32| {
                    let (diffuse, log_width) = ([0.0; 3], width.ln());
                    let material = Material { diffuse, specular: [specular; 3], log_width };
                    f64::from(material.reflect_by(model, &geometry, 1.0)[0])
                };
                let (grazing_lobe, whole) = (lobe(0.0), lobe(1.0));
                let tap = crate::math::sphere::tap_of_direction(direction, 64, 32);
                for channel in 0..3 {
                    let radiance: f64 =
                        (0..4).map(|k| f64::from(light.channels[channel][tap.index[k] as usize] * tap.weight[k])).sum();
                    base[channel] += (whole - grazing_lobe) * radiance * solid;
                    grazing[channel] += grazing_lobe * radiance * solid;
                }
            }
        }
        (base, grazing)
    }

    #[test]
    fn sums_are_the_integrals_of_the_lobe_at_all_widths() {
        LobeModel::ALL.into_iter().for_each(sums_are_integrals_of);
    }

    fn sums_are_integrals_of(model: LobeModel) {
        let basis = LightBasis::new(64, 32);
        let light = light_of(&basis, 2);
        let shares = vec![255u8; basis.padded()];
        let seen = SeenLight::of_light(&light, &shares);
        let sun = basis.direction_of(8 * 64 + 20);
        let normal = Vec3::new(0.1, 0.95, 0.2).normalize_or(Vec3::Y);
        // Beside the highlight only the tail of a narrow lobe reaches the sun, and few places lie there: what counts is
        // the error beside what the highlight sends.
        let mut highlights = Vec::new();
        for (offset, name, tolerance) in
            [(Vec3::ZERO, "highlight", 0.025), (Vec3::new(0.2, 0.1, -0.3), "beside", 0.025)]
        {
            let mirrored = (normal * (2.0 * normal.dot(sun)) - sun + offset).normalize_or(Vec3::Y);
            let (shares, seen, to_viewer) = (&shares[..], &seen, mirrored);
            let place = LobePlace { normal, to_viewer, shares, seen, normal_variance: 0.0, model };
            for (index, width) in [0.01f32, 0.05, 0.1, 0.17, 0.24, 0.26, 0.4, 0.7, 1.0].into_iter().enumerate() {
                let (base, grazing) = truth(&light, (normal, mirrored), model, width);
                if offset == Vec3::ZERO {
                    highlights.push(base);
                }
                let mut sums = [LobeSums::default()];
                lobe_sums(&basis, &place, &[width], &mut sums);
                for channel in 0..3 {
                    let error = f64::from(sums[0].base[channel]) - base[channel];
                    let allowed = tolerance * base[channel] + 0.012 * highlights[index][channel];
                    println!("{name} {width} base {error:.4} of {:.4}", base[channel]);
                    assert!(error.abs() < allowed, "{name} {width}: {error}");
                    let relative = (f64::from(sums[0].grazing[channel]) - grazing[channel]) / base[channel];
                    assert!(relative.abs() < 0.01, "{name} {width} grazing: {relative}");
                }
            }
        }
    }

    /// A pixel on a ball: its normals lie evenly in a square. Without the wider lobe the highlight would be 3 to 40 % too
    /// bright.
    #[test]
    fn a_curved_footprint_sends_what_its_normals_send_on_average() {
        LobeModel::ALL.into_iter().for_each(curved_footprint_of);
    }

    fn curved_footprint_of(model: LobeModel) {
        let basis = LightBasis::new(64, 32);
        let light = light_of(&basis, 2);
        let shares = vec![255u8; basis.padded()];
        let seen = SeenLight::of_light(&light, &shares);
        let sun = basis.direction_of(8 * 64 + 20);
        let normal = Vec3::new(0.1, 0.95, 0.2).normalize_or(Vec3::Y);
        let to_viewer = normal * (2.0 * normal.dot(sun)) - sun;
        let (across, along) = normal.any_orthonormal_pair();
        const SIDE: usize = 12;
        for (width, half_side) in [(0.1f32, 0.08f32), (0.2, 0.12), (0.4, 0.12), (1.0, 0.12)] {
            let (mut mean, mut sum) = (0.0f64, Vec3::ZERO);
            for index in 0..SIDE * SIDE {
                let place = |k: usize| half_side * (2.0 * (k as f32 + 0.5) / SIDE as f32 - 1.0);
                let tilted = normal + across * place(index % SIDE) + along * place(index / SIDE);
                let tilted = tilted.normalize_or(Vec3::Y);
                sum += tilted;
                let (shares, seen, normal) = (&shares[..], &seen, tilted);
                let place = LobePlace { normal, to_viewer, shares, seen, normal_variance: 0.0, model };
                let mut sums = [LobeSums::default()];
                lobe_sums(&basis, &place, &[width], &mut sums);
                mean += f64::from(sums[0].base[1]) / (SIDE * SIDE) as f64;
            }
            let normal_variance = 1.0 - (sum / (SIDE * SIDE) as f32).length_squared();
            let of = |normal_variance: f32| {
                let place = LobePlace { normal, to_viewer, shares: &shares, seen: &seen, normal_variance, model };
                let mut sums = [LobeSums::default()];
                lobe_sums(&basis, &place, &[width], &mut sums);
                f64::from(sums[0].base[1]) / mean - 1.0
            };
            let (error, as_if_flat) = (of(normal_variance), of(0.0));
            println!("width {width}: {error:+.4}, as if flat {as_if_flat:+.4}");
            assert!(
                error.abs() < 0.04 && error.abs() < 0.4 * as_if_flat.abs().max(0.01),
                "{width}: {error} {as_if_flat}"
            );
        }
    }

    /// Surface that sends what the light would send where it hides it is not seen.
    #[test]
    fn surface_as_bright_as_the_light_it_hides_changes_nothing() {
        let basis = LightBasis::new(64, 32);
        let light = basis.planes(&vec![[1.0; 3]; basis.count()]);
        let mut random = SequentialRandom::new(4);
        let some: Vec<u8> = (0..basis.padded()).map(|_| random.below(256) as u8).collect();
        let all = vec![255u8; basis.padded()];
        let (light_alone, with_surface) =
            (SeenLight::of_light(&light, &all), SeenLight::with_surface(&light, &some, |_| 1.0));
        let to_viewer = Vec3::new(-0.5, 0.6, 0.4).normalize_or(Vec3::Y);
        let (normal, shares, seen, model) = (Vec3::Y, &all[..], &light_alone, LobeModel::BlinnPhong);
        let open = LobePlace { normal, to_viewer, shares, seen, normal_variance: 0.0, model };
        let closed = LobePlace { shares: &some, seen: &with_surface, ..open };
        let widths = [0.03f32, 0.2, 0.3, 0.55, 1.0];
        for (model, width) in LobeModel::ALL.into_iter().flat_map(|model| widths.map(|width| (model, width))) {
            let [open, closed] = [open, closed].map(|place| {
                let place = LobePlace { model, ..place };
                let mut sums = [LobeSums::default()];
                lobe_sums(&basis, &place, &[width], &mut sums);
                sums[0]
            });
            assert!((closed.base[1] / open.base[1] - 1.0).abs() < 1e-5, "{width}: {closed:?} {open:?}");
            assert!((closed.grazing[1] / open.grazing[1] - 1.0).abs() < 1e-5, "{width}: {closed:?} {open:?}");
        }
    }

    #[test]
    fn versions_rows_and_derivatives_agree() {
        LobeModel::ALL.into_iter().for_each(versions_agree);
    }

    fn versions_agree(model: LobeModel) {
        let basis = LightBasis::new(64, 32);
        let light = light_of(&basis, 5);
        let mut random = SequentialRandom::new(9);
        let shares: Vec<u8> = (0..basis.padded()).map(|_| (random.next_number() * 255.0) as u8).collect();
        let seen = SeenLight::with_surface(&light, &shares, |_| random.next_number());
        let light_alone = SeenLight::of_light(&light, &shares);
        let normal = Vec3::new(0.3, 0.9, -0.1).normalize_or(Vec3::Y);
        let to_viewer = Vec3::new(-0.5, 0.6, 0.4).normalize_or(Vec3::Y);
        let place = LobePlace { normal, to_viewer, shares: &shares, seen: &seen, normal_variance: 0.004, model };
        for width in [0.03f32, 0.2, 0.3, 0.55, 1.0] {
            let sums = lobe_with_derivative(&basis, &place, width);
            let mut plain = [LobeSums::default()];
            let width_seen = place.width_seen(width);
            let is_wide = width_seen >= wide_from(&basis);
            if is_wide || has_tails(&place) {
                sums_in::<Plain, true>(&basis, &place, &[width_seen], &mut plain);
                plain[0].d_base = plain[0].d_base.map(|slope| slope * place.slope_of_width_seen(width));
            }
            if !is_wide {
                let count = place_count(&basis, width_seen);
                let middle = half_vector_kernel::sums_in::<Plain>(&basis, &place, width_seen, count, Part::Middle);
                plain[0] = plain[0].and(&middle);
                // Its derivative is a difference of sums.
                plain[0].d_base = sums.d_base;
            }
            for channel in 0..3 {
                for (a, b) in [
                    (sums.base[channel], plain[0].base[channel]),
                    (sums.grazing[channel], plain[0].grazing[channel]),
                    (sums.d_base[channel], plain[0].d_base[channel]),
                ] {
                    assert!((a - b).abs() < 2e-5 * sums.base[channel], "{width}: {a} {b}");
                }
            }
            for channel in 0..3 {
                let mut row = vec![0.0; basis.padded()];
                add_lobe_row(&basis, &place, width, [0.3, 1.0], &mut row);
                let by_row: f64 =
                    row.iter().zip(&light.channels[channel]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                let mut of_light = [LobeSums::default()];
                lobe_sums(&basis, &LobePlace { seen: &light_alone, ..place }, &[width], &mut of_light);
                let direct = f64::from(0.3 * of_light[0].base[channel] + of_light[0].grazing[channel]);
                assert!((by_row / direct - 1.0).abs() < 2e-6, "{width}: {by_row} {direct}");
            }
            let step = 0.01f32;
            let at = |width: f32| {
                let mut sums = [LobeSums::default()];
                lobe_sums(&basis, &place, &[width], &mut sums);
                sums[0]
            };
            if width < 1.0 {
                let (below, above) = (at(width * (-step).exp()), at(width * step.exp()));
                let difference = (above.base[1] - below.base[1]) / (2.0 * step);
                assert!((difference - sums.d_base[1]).abs() < 3e-3 * sums.base[1], "{width}: {difference}");
            }
        }
    }
}
