use super::kernel::{Arrivals, Proposals, propose, propose_in};
use super::*;
use crate::light::{Environment, EnvironmentSampler};
use crate::material::{LobeModel, Material};
use crate::math::frame::Frame;
use crate::math::random::{SequentialRandom, StreamKey};
use crate::math::sphere::{BilinearTap, tap_of_direction};
use crate::math::vector::Plain;
use glam::Vec3;

const SIZE: (usize, usize) = (16, 8);

fn unit_vector(random: &mut SequentialRandom) -> Vec3 {
    let [x, y, z] = [(); 3].map(|()| 2.0 * random.next_number() - 1.0);
    Vec3::new(x, y, z).try_normalize().unwrap_or(Vec3::Y)
}

/// Paths on surfaces of all kinds, seen from above them.
fn arrivals(random: &mut SequentialRandom, count: usize) -> (Arrivals, Vec<Material<f32>>) {
    let mut arrivals = Arrivals { count, ..Arrivals::default() };
    let mut materials = Vec::new();
    for lane in 0..count {
        let normal = unit_vector(random);
        let mut to_viewer = unit_vector(random);
        if to_viewer.dot(normal) < 0.0 {
            to_viewer = -to_viewer;
        }
        // As of a triangle under a smooth normal; the direction to the viewer lies above both.
        let tilted = (normal + 0.4 * unit_vector(random)).normalize_or(normal);
        let geometric_normal = if tilted.dot(to_viewer) > 0.0 { tilted } else { normal };
        let grey = Vec3::splat(random.next_number());
        let roughness = [0.000_025, 0.01, 0.3, 1.0][lane % 4];
        let material = Material::from_maps(grey, Vec3::splat(random.next_number()), roughness);
        for axis in 0..3 {
            arrivals.normal[axis][lane] = normal[axis];
            arrivals.geometric_normal[axis][lane] = geometric_normal[axis];
            arrivals.to_viewer[axis][lane] = to_viewer[axis];
        }
        arrivals.specular[lane] = luminance(Vec3::from_array(material.specular));
        arrivals.diffuse[lane] = luminance(Vec3::from_array(material.diffuse));
        arrivals.log_width[lane] = material.log_width;
        arrivals.streams[lane] = SampleStream::new(StreamKey::new(9, 0, 0, lane as u32 / 4), lane as u32);
        materials.push(material);
    }
    (arrivals, materials)
}

fn vector(of: &[[f32; PACKET]; 3], lane: usize) -> Vec3 {
    Vec3::new(of[0][lane], of[1][lane], of[2][lane])
}

fn read(environment: &Environment, tap: &BilinearTap) -> f32 {
    crate::light::environment::radiance_of_tap(environment.radiance.pixels(), tap).x
}

/// Compares a direction and all that is said of it with what the functions for one path say.
fn assert_described(
    directions: &Directions,
    lane: usize,
    [normal, geometric_normal, to_viewer]: [Vec3; 3],
    (model, material): (LobeModel, &Material<f32>),
    strength: f32,
    environment: &Environment,
) {
    let direction = directions.direction(lane);
    assert!((direction.length() - 1.0).abs() < 1e-5, "{direction}");
    let exact = LobeGeometry::new(normal, direction, to_viewer);
    // At a horizon rounding decides.
    if normal.dot(direction).abs().min(geometric_normal.dot(direction).abs()) > 1e-5 {
        let is_above = exact.is_some() && geometric_normal.dot(direction) > 0.0;
        assert_eq!(directions.above[lane] > 0.0, is_above, "{direction} over {normal} and {geometric_normal}");
    }
    if let Some(exact) = exact {
        let found = directions.geometry(lane, exact.cos_out);
        assert!((found.cos_in - exact.cos_in).abs() < 1e-6 && (found.half_dot_out - exact.half_dot_out).abs() < 1e-6);
        let off = (found.ln_cos_half - exact.ln_cos_half).abs();
        assert!(off < 1e-4 * exact.ln_cos_half.abs() + 1e-8, "{found:?} {exact:?}");
        let density = material.sampler(model, exact.cos_out, strength).density(&exact);
        let found = directions.lobe_density[lane];
        assert!((found - density).abs() < 3e-3 * density + 1e-6, "{found} {density}, {material:?}");
    }
    // Beside a pole any azimuth is as good.
    if direction.y.abs() < 0.999 {
        let found = read(environment, &directions.taps.tap(lane));
        let exact = read(environment, &tap_of_direction(direction, SIZE.0, SIZE.1));
        assert!((found - exact).abs() < 2e-4, "{direction}: {found} {exact}");
    }
}

#[test]
fn a_packet_is_offered_what_each_path_would_be() {
    let mut random = SequentialRandom::new(4);
    let pixels = (0..SIZE.0 * SIZE.1).map(|_| Vec3::splat(random.next_number())).collect();
    let environment = Environment { radiance: crate::image::Image::from_pixels(SIZE.0, SIZE.1, pixels) };
    let light = EnvironmentSampler::new(&environment);
    type Propose = fn(&mut Arrivals, &EnvironmentSampler, (usize, usize), f32, &mut Proposals);
    let mut versions: Vec<Propose> = vec![propose, propose_in::<Plain>];
    #[cfg(target_arch = "x86_64")]
    if crate::math::vector::has_avx2() {
        #[target_feature(enable = "avx2,fma")]
        fn avx2(a: &mut Arrivals, light: &EnvironmentSampler, size: (usize, usize), strength: f32, p: &mut Proposals) {
            propose_in::<crate::math::vector::Avx2>(a, light, size, strength, p);
        }
        // SAFETY: the processor has what the function is compiled for.
        versions.push(|a, light, size, strength, p| unsafe { avx2(a, light, size, strength, p) });
    }
    // Used again and again: what others have left must not matter.
    let mut proposals = Proposals::default();
    for case in 0..400 {
        let strength = if case % 5 == 0 { 0.0 } else { 1.0 };
        let (mut before, materials) = arrivals(&mut random, 1 + case % PACKET);
        before.model = LobeModel::ALL[case / 5 % 2];
        for lane in before.count..PACKET {
            before.normal[lane % 3][lane] = f32::NAN;
            before.log_width[lane] = f32::NAN;
        }
        for version in &versions {
            let mut arrivals = before.clone();
            version(&mut arrivals, &light, SIZE, strength, &mut proposals);
            assert!(proposals.has_light);
            for (lane, material) in materials.iter().enumerate() {
                let [normal, geometric_normal, to_viewer] =
                    [&before.normal, &before.geometric_normal, &before.to_viewer].map(|of| vector(of, lane));
                let mut stream = before.streams[lane];
                let drawn = light.sample(stream.next_pair()).unwrap();
                let direction = proposals.of_light.direction(lane);
                assert!((direction - drawn.direction).length() < 2e-5, "{direction} {}", drawn.direction);
                assert!((proposals.light_density[lane] / drawn.density - 1.0).abs() < 1e-3);
                let sampler = material.sampler(before.model, normal.dot(to_viewer), strength);
                let exact = sampler.sample(&Frame::around(normal), to_viewer, stream.next_pair());
                let found = proposals.of_lobe.direction(lane);
                match exact {
                    Some(exact) => assert!((found - exact).length() < 2e-3, "{found} {exact} {material:?}"),
                    None => assert!(found.dot(normal) < 1e-5, "{found} lies above the horizon"),
                }
                for directions in [&proposals.of_light, &proposals.of_lobe] {
                    let frame = [normal, geometric_normal, to_viewer];
                    assert_described(directions, lane, frame, (before.model, material), strength, &environment);
                }
                assert_eq!(arrivals.streams[lane].next_pair(), stream.next_pair(), "both pairs are used up");
            }
        }
    }
}

#[test]
fn without_light_none_is_offered() {
    let black = EnvironmentSampler::new(&Environment::constant(SIZE.0, SIZE.1, Vec3::ZERO));
    let (mut arrivals, _) = arrivals(&mut SequentialRandom::new(1), 5);
    let mut proposals = Proposals { has_light: true, ..Proposals::default() };
    propose(&mut arrivals, &black, SIZE, 1.0, &mut proposals);
    assert!(!proposals.has_light);
    assert!((0..5).all(|lane| proposals.of_lobe.direction(lane).is_finite()));
}
