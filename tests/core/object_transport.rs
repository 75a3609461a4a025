//! The linear image model of object mode: transposes, matrices, and accuracy against plain sums.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec3};
use patina::math::random::SequentialRandom;
use patina::math::sphere;
use patina::measured::coordinates::HalfDifference;
use patina::measured::model::ReflectanceModel;
use patina::object::geometry::ObjectGeometry;
use patina::object::matrices::{LightMatrix, NodeMatrix};
use patina::object::nodes::{NodeGrid, NodeTable};
use patina::object::transport::{TexelDirections, Transport};
use std::sync::Arc;

/// Lambert and a normalised Blinn-Phong lobe with Schlick's Fresnel term.
struct Blinn {
    exponent: f64,
}

impl ReflectanceModel for Blinn {
    fn name(&self) -> &str {
        "blinn"
    }
    fn parameter_count(&self) -> usize {
        0
    }
    fn start(&self) -> Vec<f64> {
        Vec::new()
    }
    fn evaluate(&self, _: &[f64], at: &[HalfDifference], values: &mut [[f64; 3]]) {
        for (point, value) in at.iter().zip(values) {
            let lobe =
                (self.exponent + 2.0) / (8.0 * std::f64::consts::PI) * point.theta_half.cos().powf(self.exponent);
            let fresnel = 0.04 + 0.96 * (1.0 - point.theta_difference.cos()).powi(5);
            *value = [0.1 + lobe * fresnel, 0.05 + lobe * fresnel, 0.02 + lobe * fresnel];
        }
    }
    fn pull_back(&self, _: &[f64], _: &[HalfDifference], _: &[[f64; 3]], _: &mut [f64]) {}
}

fn transport(pixels: usize, height: usize, grid: NodeGrid) -> Transport {
    let mut geometry = ObjectGeometry::sphere(64, 64, 32.0);
    let step = geometry.pixels.len() / pixels;
    geometry.pixels = geometry.pixels.into_iter().step_by(step.max(1)).collect();
    let directions = TexelDirections::new(2 * height, height).unwrap();
    Transport::new(Arc::new(grid), Arc::new(directions), &geometry.pixels, None)
}

fn noise(count: usize, seed: u64) -> Vec<Vec3> {
    let mut random = SequentialRandom::new(seed);
    (0..count).map(|_| Vec3::new(random.next_number(), random.next_number(), random.next_number())).collect()
}

fn dot(a: &[Vec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.as_dvec3().dot(*b)).sum()
}

#[test]
fn transposes_agree_to_a_millionth() {
    let transport = transport(150, 16, NodeGrid::coarse());
    let table = transport.grid().tabulate(&Blinn { exponent: 60.0 }, &[]);
    let (light, by_pixels) = (noise(512, 1), noise(transport.pixels(), 2));
    let picture = transport.forward(&table, &light);
    let forward: f64 = picture.iter().zip(&by_pixels).map(|(a, b)| a.as_dvec3().dot(b.as_dvec3())).sum();
    let by_light = dot(&light, &transport.adjoint_by_light(&table, &by_pixels));
    assert!((forward - by_light).abs() < 1e-6 * forward, "{forward} {by_light}");
    let nodes = transport.adjoint_by_nodes(&light, &by_pixels);
    let by_nodes: f64 = nodes
        .iter()
        .zip(&table.values)
        .map(|(a, b)| (0..3).map(|channel| a[channel] * f64::from(b[channel])).sum::<f64>())
        .sum();
    assert!((forward - by_nodes).abs() < 1e-6 * forward, "{forward} {by_nodes}");
}

#[test]
fn matrices_are_the_transport_with_one_factor_put_in() {
    let transport = transport(150, 16, NodeGrid::coarse());
    let table = transport.grid().tabulate(&Blinn { exponent: 60.0 }, &[]);
    let light = noise(512, 5);
    let plain = transport.forward(&table, &light);
    let by_light = LightMatrix::new(&transport, &table);
    let channels = [0, 1, 2].map(|channel| light.iter().map(|rgb| rgb[channel]).collect::<Vec<f32>>());
    let by_nodes = NodeMatrix::new(&transport, &light);
    let mut worst = 0.0f32;
    for ((a, b), c) in plain.iter().zip(by_light.forward(&channels)).zip(by_nodes.forward(&table)) {
        worst = worst.max((*a - Vec3::from_array(b)).abs().max_element() / a.max_element());
        worst = worst.max((*a - Vec3::from_array(c)).abs().max_element() / a.max_element());
    }
    assert!(worst < 2e-6, "{worst}");
    // Their transposes, by dot products.
    let by_pixels: Vec<[f32; 3]> = noise(transport.pixels(), 7).iter().map(Vec3::to_array).collect();
    let product: f64 =
        plain.iter().zip(&by_pixels).map(|(a, b)| a.as_dvec3().dot(Vec3::from_array(*b).as_dvec3())).sum();
    let back = by_light.adjoint(&by_pixels);
    let through_light: f64 =
        (0..3).map(|c| channels[c].iter().zip(&back[c]).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()).sum();
    assert!((product - through_light).abs() < 2e-6 * product, "{product} {through_light}");
    let through_nodes: f64 = by_nodes
        .adjoint(&by_pixels)
        .iter()
        .zip(&table.values)
        .map(|(a, b)| (0..3).map(|c| a[c] * f64::from(b[c])).sum::<f64>())
        .sum();
    assert!((product - through_nodes).abs() < 2e-6 * product, "{product} {through_nodes}");
    // The diagonal of the normal matrix, one texel by hand.
    let weights = vec![[1.0f32; 3]; transport.pixels()];
    let diagonal = by_light.squared_adjoint(&weights);
    let mut unit = [0, 1, 2].map(|_| vec![0.0f32; 512]);
    unit[1][200] = 1.0;
    let column: f32 = by_light.forward(&unit).iter().map(|value| value[1] * value[1]).sum();
    assert!((diagonal[1][200] - column).abs() < 1e-5 * column);
}

#[test]
fn the_same_bits_whatever_the_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let transport = transport(300, 16, NodeGrid::coarse());
            let table = transport.grid().tabulate(&Blinn { exponent: 20.0 }, &[]);
            let by_pixels = noise(transport.pixels(), 2);
            (transport.forward(&table, &noise(512, 1)), transport.adjoint_by_light(&table, &by_pixels))
        })
    };
    assert_eq!(run(1), run(3));
}

/// The picture by a plain sum over parts of texels, 24 x 24 a texel, the model itself at each.
fn plain_sum(model: &Blinn, normal: Vec3, to_eye: Vec3, light: &[Vec3], width: usize, height: usize) -> DVec3 {
    const SPLIT: usize = 24;
    let frame = patina::math::frame::Frame::around(normal);
    let eye = frame.local_from_outer(to_eye).as_dvec3();
    let (mut sum, mut value) = (DVec3::ZERO, [[0.0; 3]]);
    for row in 0..height * SPLIT {
        let solid_angle = sphere::solid_angle_of_texel(row, width * SPLIT, height * SPLIT);
        for column in 0..width * SPLIT {
            let direction = sphere::direction_of_texel(row, column, width * SPLIT, height * SPLIT);
            if normal.dot(direction) <= 0.0 {
                continue;
            }
            let local = frame.local_from_outer(direction).as_dvec3();
            model.evaluate(&[], &[HalfDifference::from_directions(local, eye)], &mut value);
            let radiance = light[row / SPLIT * width + column / SPLIT].as_dvec3();
            sum += DVec3::from_array(value[0]) * radiance * (local.z * solid_angle);
        }
    }
    sum
}

#[test]
fn pictures_agree_with_plain_sums_over_fine_parts() {
    let (width, height) = (32, 16);
    let light: Vec<Vec3> = noise(width * height, 3).into_iter().map(|rgb| (rgb * 4.0).map(f32::exp)).collect();
    for (exponent, grid, bound) in [
        (5.0, NodeGrid::fine(), 0.006),
        (80.0, NodeGrid::fine(), 0.006),
        (1500.0, NodeGrid::fine(), 0.02),
        (80.0, NodeGrid::coarse(), 0.02),
    ] {
        let geometry = ObjectGeometry::sphere(64, 64, 32.0);
        let pixels: Vec<_> = geometry.pixels.iter().step_by(400).copied().collect();
        let directions = Arc::new(TexelDirections::new(width, height).unwrap());
        let model = Blinn { exponent };
        let transport = Transport::new(Arc::new(grid), directions, &pixels, None);
        let table = transport.grid().tabulate(&model, &[]);
        let picture = transport.forward(&table, &light);
        let mut squares = 0.0;
        for (pixel, value) in pixels.iter().zip(&picture) {
            let exact = plain_sum(&model, pixel.normal, pixel.to_eye, &light, width, height);
            squares += ((value.as_dvec3() / exact).map(f64::ln)).length_squared() / 3.0;
        }
        let error = (squares / pixels.len() as f64).sqrt();
        println!("exponent {exponent}, {} nodes: log error {error:.5}", transport.grid().len());
        assert!(error < bound, "exponent {exponent}: {error}");
    }
}

#[test]
fn a_white_diffuse_sphere_under_an_even_light_is_as_bright_as_it() {
    let transport = transport(200, 16, NodeGrid::coarse());
    let table = NodeTable::constant(transport.grid(), [std::f32::consts::FRAC_1_PI; 3]);
    let picture = transport.forward(&table, &vec![Vec3::ONE; 512]);
    let worst = picture.iter().map(|value| (value.x - 1.0).abs()).fold(0.0, f32::max);
    assert!(worst < 0.01, "{worst}");
}
