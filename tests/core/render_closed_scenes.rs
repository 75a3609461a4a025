//! Scenes whose light is known without a renderer.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec2, Vec3};
use patina::image::Image;
use patina::light::{Environment, EnvironmentSampler};
use patina::material::Material;
use patina::material::texels::{PyramidWeights, TexelPyramid};
use patina::math::statistics::Moments;
use patina::render::accumulate::{PassKey, PixelDerivative, PixelEstimate, PixelLoss, accumulate, estimate_pixel};
use patina::render::first_hits::{CameraRays, FirstHits, PixelFilter};
use patina::render::picture::{Picture, PictureSettings, render};
use patina::render::{ParameterGradient, Parameters, PathArena, PathSettings, PathTracer, Surface};
use patina::scene::{Camera, Mesh};
use std::sync::atomic::AtomicBool;

// ---------------------------------------------------------------- shapes and materials

/// A mesh of quadrilaterals, each with its own corners; wound counter-clockwise seen from outside.
fn quads(corners: &[[Vec3; 4]]) -> Mesh {
    let mut mesh = Mesh::default();
    for quad in corners {
        let first = mesh.positions.len() as u32;
        let normal = (quad[1] - quad[0]).cross(quad[2] - quad[0]).try_normalize().unwrap();
        mesh.positions.extend(quad);
        mesh.normals.extend([normal; 4]);
        mesh.uvs.extend([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// The six sides of a box about the origin, outwards or inwards.
fn cube(half: f32, inwards: bool) -> Mesh {
    let mut sides = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |a: f32, b: f32| {
                let mut point = [0.0; 3];
                (point[axis], point[u], point[v]) = (sign * half, a * half, b * half);
                Vec3::from_array(point)
            };
            let mut side = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            if (sign < 0.0) != inwards {
                side.reverse();
            }
            sides.push(side);
        }
    }
    quads(&sides)
}

/// A horizontal square about the origin that faces up.
fn square_of_half_side(half: f32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(half * x, 0.0, half * z);
    quads(&[[corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]])
}

/// A sphere about the origin with true normals.
fn sphere(radius: f32, rows: usize, columns: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let (theta, phi) = (std::f32::consts::PI * v, std::f32::consts::TAU * u);
            let normal = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(radius * normal);
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(u, 1.0 - v));
        }
    }
    let stride = columns as u32 + 1;
    for row in 0..rows as u32 {
        for column in 0..columns as u32 {
            let first = row * stride + column;
            mesh.triangles.push([first, first + stride, first + stride + 1]);
            mesh.triangles.push([first, first + stride + 1, first + 1]);
        }
    }
    mesh
}

/// One material everywhere under a given light.
fn uniform(material: Material<f32>, light: &Environment) -> Parameters<f32> {
    let pyramid = TexelPyramid::from_base(vec![material; 4], &PyramidWeights::flat(2, 2));
    Parameters::new(pyramid, light)
}

fn lambert(albedo: f32) -> Material<f32> {
    Material::from_maps(Vec3::splat(albedo), Vec3::ZERO, 0.5)
}

fn constant_light(radiance: f32) -> Environment {
    Environment::constant(8, 4, Vec3::splat(radiance))
}

fn picture(mesh: &Mesh, camera: &Camera, parameters: &Parameters<f32>, settings: &PictureSettings) -> Picture {
    let surface = Surface::new(mesh.clone()).unwrap();
    render(&surface, camera, parameters, 0, settings, &AtomicBool::new(false))
}

fn camera_at(eye: Vec3, target: Vec3, size: usize, degrees: f32) -> Camera {
    Camera::looking_at(eye, target, size, size, degrees.to_radians())
}

/// Mean over the pixels that `keep` accepts, and its standard error, over all channels.
fn mean_and_error(picture: &Picture, keep: impl Fn(f32) -> bool) -> (f64, f64) {
    let variance = picture.variance.as_ref().unwrap();
    let (mut sum, mut variance_sum, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for ((radiance, variance), &coverage) in
        picture.radiance.pixels().iter().zip(variance.pixels()).zip(picture.coverage.pixels())
    {
        if keep(coverage) {
            sum += radiance.as_dvec3();
            variance_sum += variance.as_dvec3();
            count += 1.0;
        }
    }
    assert!(count > 0.0);
    // Channels move together, so the error of their mean is that of one.
    (sum.element_sum() / 3.0 / count, (variance_sum.max_element()).sqrt() / count)
}

fn z_of(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0) / (a.1 * a.1 + b.1 * b.1).sqrt().max(1e-12)
}

// ---------------------------------------------------------------- white furnace

#[test]
fn a_convex_lambertian_sphere_in_a_furnace_has_radiance_albedo_times_light() {
    let mesh = sphere(1.0, 24, 48);
    let camera = camera_at(Vec3::new(0.5, 0.3, 4.0), Vec3::ZERO, 16, 20.0);
    for (albedo, light) in [(1.0, 1.0), (0.6, 3.0), (0.05, 1e-3), (0.5, 1e5)] {
        let settings = PictureSettings {
            samples: 32,
            groups: 4,
            max_bounces: 1,
            lobe_strength: 0.0,
            ..PictureSettings::default()
        };
        let own = picture(&mesh, &camera, &uniform(lambert(albedo), &constant_light(light)), &settings);
        let (mean, error) = mean_and_error(&own, |coverage| coverage == 1.0);
        let expected = f64::from(albedo * light);
        assert!((mean - expected).abs() < 4.0 * error + 2e-3 * expected, "{albedo} {light}: {mean} +- {error}");
        assert!(error < 0.01 * expected, "the test can tell: {error}");
    }
}

#[test]
fn a_white_lobe_never_returns_more_than_it_gets() {
    let mesh = sphere(1.0, 24, 48);
    let camera = camera_at(Vec3::new(0.5, 0.3, 4.0), Vec3::ZERO, 16, 20.0);
    let mut last = f64::INFINITY;
    for roughness in [1e-4f32, 0.01, 0.1, 0.3, 1.0] {
        let material = Material::from_maps(Vec3::ZERO, Vec3::ONE, roughness);
        let settings = PictureSettings { samples: 32, groups: 4, max_bounces: 1, ..PictureSettings::default() };
        let own = picture(&mesh, &camera, &uniform(material, &constant_light(2.0)), &settings);
        let (mean, error) = mean_and_error(&own, |coverage| coverage == 1.0);
        assert!(mean < 2.0 + 4.0 * error, "r {roughness}: {mean} +- {error}");
        assert!(mean < last + 4.0 * error, "a rougher lobe loses more: r {roughness}: {mean} after {last}");
        if roughness < 1e-3 {
            assert!(mean > 1.9, "a mirror loses next to nothing: {mean}");
        }
        last = mean;
    }

    // At r = 1 the distribution is constant; seen head-on the reflected share is the integral of c / q(c) over c, with
    // q(c) = (c + 1) / 2, divided by 2: 1 - ln 2.
    let square = square_of_half_side(1.0);
    let camera = camera_at(Vec3::new(0.0, 40.0, 0.01), Vec3::ZERO, 8, 1.0);
    let material = Material::from_maps(Vec3::ZERO, Vec3::ONE, 1.0);
    let settings = PictureSettings { samples: 256, groups: 4, max_bounces: 1, ..PictureSettings::default() };
    let own = picture(&square, &camera, &uniform(material, &constant_light(2.0)), &settings);
    let (mean, error) = mean_and_error(&own, |coverage| coverage == 1.0);
    let expected = 2.0 * (1.0 - std::f64::consts::LN_2);
    assert!((mean - expected).abs() < 4.0 * error + 1e-3 * expected, "{mean} +- {error}, expected {expected}");
    assert!(error < 5e-3 * expected);
}

#[test]
fn a_white_wedge_approaches_the_light_as_paths_grow() {
    // Two white squares at a right angle, seen from between them: what one does not get from the sky it gets from the
    // other, so with endless paths every point has the radiance of the light.
    let wedge = quads(&[
        [Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::X],
        [Vec3::ZERO, Vec3::Y, Vec3::new(0.0, 1.0, 1.0), Vec3::Z],
    ]);
    let camera = camera_at(Vec3::new(2.0, 2.0, 0.5), Vec3::new(0.3, 0.3, 0.5), 8, 12.0);
    let mut means = Vec::new();
    for max_bounces in [1, 2, 4, 16] {
        let settings =
            PictureSettings { samples: 64, groups: 4, max_bounces, lobe_strength: 0.0, ..PictureSettings::default() };
        let own = picture(&wedge, &camera, &uniform(lambert(1.0), &constant_light(1.5)), &settings);
        let (mean, error) = mean_and_error(&own, |coverage| coverage == 1.0);
        assert!(mean < 1.5 + 4.0 * error, "{max_bounces}: {mean} +- {error}");
        means.push(mean);
    }
    assert!(means.windows(2).all(|pair| pair[1] > pair[0] - 0.01), "{means:?}");
    assert!(means[0] < 1.4, "direct light alone lacks something: {means:?}");
    assert!((means[3] - 1.5).abs() < 0.01, "{means:?}");
}

// ---------------------------------------------------------------- darkness

#[test]
fn a_closed_box_is_black_inside() {
    let camera = camera_at(Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.9, 0.4, 0.6), 16, 90.0);
    let settings = PictureSettings { samples: 16, max_bounces: 8, ..PictureSettings::default() };
    let own = picture(&cube(1.0, true), &camera, &uniform(lambert(0.9), &constant_light(1e4)), &settings);
    assert!(own.coverage.pixels().iter().all(|&coverage| coverage == 1.0));
    assert!(own.radiance.pixels().iter().all(|&radiance| radiance == Vec3::ZERO), "light leaks in");
}

#[test]
fn black_light_gives_black_and_backs_are_black() {
    let camera = camera_at(Vec3::new(0.5, 0.3, 4.0), Vec3::ZERO, 12, 40.0);
    let material = Material::from_maps(Vec3::splat(0.5), Vec3::splat(0.5), 0.1);
    let settings = PictureSettings { samples: 8, groups: 2, ..PictureSettings::default() };
    let dark = picture(&sphere(1.0, 12, 24), &camera, &uniform(material, &constant_light(0.0)), &settings);
    assert!(dark.radiance.pixels().iter().all(|&radiance| radiance == Vec3::ZERO));
    assert_eq!(dark.non_finite_pixels, 0);

    // A square seen from behind: covered, black.
    let square = quads(&[[
        Vec3::new(-2.0, -2.0, 0.0),
        Vec3::new(-2.0, 2.0, 0.0),
        Vec3::new(2.0, 2.0, 0.0),
        Vec3::new(2.0, -2.0, 0.0),
    ]]);
    let behind = picture(&square, &camera, &uniform(material, &constant_light(1.0)), &settings);
    let covered = behind.coverage.pixels().iter().filter(|&&coverage| coverage == 1.0).count();
    assert!(covered > 20);
    for (radiance, &coverage) in behind.radiance.pixels().iter().zip(behind.coverage.pixels()) {
        assert!(coverage < 1.0 || *radiance == Vec3::ZERO, "a back shines: {radiance}");
    }
    // With both sides drawn it is as bright as from the front under an even light.
    let both = PictureSettings { two_sided: true, lobe_strength: 0.0, max_bounces: 1, samples: 64, ..settings };
    let shining = picture(&square, &camera, &uniform(lambert(0.5), &constant_light(1.0)), &both);
    let (mean, error) = mean_and_error(&shining, |coverage| coverage == 1.0);
    assert!((mean - 0.5).abs() < 4.0 * error + 1e-3, "{mean} +- {error}");
}

#[test]
fn the_background_is_the_environment_or_black() {
    let light =
        Environment { radiance: Image::from_fn(8, 16, |row, column| Vec3::new(row as f32, column as f32, 1.0)) };
    let camera = camera_at(Vec3::new(0.0, 0.0, 4.0), Vec3::new(3.0, 1.0, 0.0), 8, 20.0);
    let parameters = uniform(lambert(0.5), &light);
    let settings = PictureSettings { samples: 64, ..PictureSettings::default() };
    let seen = picture(&cube(0.1, false), &camera, &parameters, &settings);
    let hidden =
        picture(&cube(0.1, false), &camera, &parameters, &PictureSettings { background_visible: false, ..settings });
    for row in 0..8 {
        for column in 0..8 {
            let ray = camera.ray_through(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let expected = light.radiance_towards(ray.direction);
            assert_eq!(seen.coverage[(row, column)], 0.0);
            assert!((seen.radiance[(row, column)] - expected).abs().max_element() < 0.05, "{row} {column}");
            assert_eq!(hidden.radiance[(row, column)], Vec3::ZERO);
        }
    }
}

// ---------------------------------------------------------------- hard lights and materials

#[test]
fn a_one_texel_sun_of_a_million_is_finite_and_unbiased() {
    let mut light = Environment::constant(64, 32, Vec3::splat(0.1));
    light.radiance[(8, 20)] = Vec3::splat(1e6);
    let camera = camera_at(Vec3::new(0.5, 2.0, 4.0), Vec3::ZERO, 16, 22.0);
    let material = Material::from_maps(Vec3::splat(0.5), Vec3::splat(0.04), 0.3);
    let parameters = uniform(material, &light);
    let at = |samples, groups, seed| {
        let settings = PictureSettings { samples, groups, seed, ..PictureSettings::default() };
        let own = picture(&sphere(1.0, 24, 48), &camera, &parameters, &settings);
        assert_eq!(own.non_finite_pixels, 0);
        mean_and_error(&own, |coverage| coverage == 1.0)
    };
    let (few, many) = (at(4, 32, 1), at(64, 8, 2));
    assert!(many.1 < 0.05 * many.0, "{many:?}");
    assert!(z_of(few, many).abs() < 4.0, "{few:?} {many:?}");
}

#[test]
fn a_lambertian_square_under_a_sun_has_the_irradiance_of_the_environment() {
    let mut light = Environment::constant(64, 32, Vec3::new(0.2, 0.4, 0.8));
    light.radiance[(6, 40)] = Vec3::new(3e3, 2e3, 1e3);
    let square = square_of_half_side(1.0);
    let camera = camera_at(Vec3::new(0.3, 3.0, 0.2), Vec3::ZERO, 8, 20.0);
    let settings =
        PictureSettings { samples: 256, groups: 8, max_bounces: 2, lobe_strength: 0.0, ..PictureSettings::default() };
    let own = picture(&square, &camera, &uniform(lambert(0.5), &light), &settings);
    let (mean, error) = mean_and_error(&own, |coverage| coverage == 1.0);
    let irradiance = light.irradiance(Vec3::Y);
    let expected = 0.5 * irradiance.element_sum() / 3.0 / std::f64::consts::PI;
    assert!((mean - expected).abs() < 4.0 * error + 3e-3 * expected, "{mean} +- {error}, expected {expected}");
    assert!(error < 0.01 * expected);
}

#[test]
fn every_corner_of_the_material_is_finite_even_at_grazing_views() {
    let mut light = Environment::constant(16, 8, Vec3::splat(1.0));
    light.radiance[(2, 3)] = Vec3::splat(1e5);
    let square = square_of_half_side(9.0);
    let mut scene = square.clone();
    let ball = sphere(1.0, 16, 32);
    let first = scene.positions.len() as u32;
    scene.positions.extend(ball.positions.iter().map(|position| *position + 1.01 * Vec3::Y));
    scene.normals.extend(&ball.normals);
    scene.uvs.extend(&ball.uvs);
    scene.triangles.extend(ball.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
    for specular in [0.0, 1.0] {
        for roughness in [0.0, 1.0] {
            for height in [1e-4f32, 0.05, 3.0] {
                let material = Material::from_maps(Vec3::splat(0.5), Vec3::splat(specular), roughness);
                let camera = camera_at(Vec3::new(0.0, height, 8.0), Vec3::new(0.0, 0.5 * height, 0.0), 12, 30.0);
                let settings = PictureSettings { samples: 16, groups: 2, max_bounces: 4, ..PictureSettings::default() };
                let own = picture(&scene, &camera, &uniform(material, &light), &settings);
                assert_eq!(own.non_finite_pixels, 0, "F0 {specular} r {roughness} height {height}");
                assert!(own.radiance.pixels().iter().all(|radiance| radiance.min_element() >= 0.0));
            }
        }
    }
}

// ---------------------------------------------------------------- statistics and threads

#[test]
fn first_hits_from_the_cache_give_the_same_mean() {
    // With frozen places in the pixels the noise has another shape but the mean over many caches is the same.
    let surface = Surface::new(sphere(1.0, 16, 32)).unwrap();
    let camera = camera_at(Vec3::new(0.5, 0.3, 4.0), Vec3::ZERO, 10, 40.0);
    let light = Environment { radiance: Image::from_fn(16, 8, |row, _| Vec3::splat(8.0 - row as f32)) };
    let parameters = uniform(Material::from_maps(Vec3::splat(0.5), Vec3::splat(0.1), 0.2), &light);
    let sampler = EnvironmentSampler::new(&light);
    let tracer = tracer(&surface, &parameters, &sampler);
    let mut arena = PathArena::default();
    let mut mean_of = |cached: bool| -> Vec<Moments> {
        let mut moments = vec![Moments::default(); 100];
        for round in 0..200u32 {
            let hits = FirstHits::trace(&surface, &camera, PixelFilter::Box, 4, u64::from(round), 0);
            let rays = if cached {
                CameraRays::cached(&surface, &camera, PixelFilter::Box, &hits)
            } else {
                CameraRays::fresh(&surface, &camera, PixelFilter::Box, 4)
            };
            let key = PassKey::halves(if cached { 7 } else { 8 }, round, 0);
            for (pixel, moments) in moments.iter_mut().enumerate() {
                let estimate: PixelEstimate<f32> = estimate_pixel(&tracer, &rays, pixel, key, &parameters, &mut arena);
                moments.add(0.5 * f64::from(estimate.first[1] + estimate.second[1]));
            }
        }
        moments
    };
    let (cached, fresh) = (mean_of(true), mean_of(false));
    let z: Vec<f64> = cached
        .iter()
        .zip(&fresh)
        .filter(|(a, b)| a.variance() + b.variance() > 0.0)
        .map(|(a, b)| (a.mean - b.mean) / ((a.variance() + b.variance()) / 200.0).sqrt())
        .collect();
    let squares = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    let mean = z.iter().sum::<f64>() / (z.len() as f64).sqrt();
    assert!(z.len() > 40 && squares < 1.6 && mean.abs() < 4.0, "{} {squares} {mean}", z.len());
}

fn tracer<'a>(
    surface: &'a Surface,
    parameters: &'a Parameters<f32>,
    sampler: &'a EnvironmentSampler,
) -> PathTracer<'a> {
    PathTracer {
        surface,
        proposal: &parameters.texels,
        light: sampler,
        environment_size: parameters.environment_size,
        settings: PathSettings {
            max_bounces: 3,
            lobe_strength: 1.0,
            background_visible: true,
            two_sided: false,
            camera_cone_radians: 0.01,
            bounce_cone_radians: 0.1,
        },
    }
}

/// The squared distance to a grey of 0.3, as a product of the two estimates.
struct ToGrey;

impl PixelLoss<f32> for ToGrey {
    fn at(&self, _: usize, estimate: &PixelEstimate<f32>) -> Option<PixelDerivative<f32>> {
        let d = |value: [f32; 3]| value.map(|value| value - 0.3);
        let (first, second) = (d(estimate.first), d(estimate.second));
        let loss = (0..3).map(|channel| first[channel] * second[channel]).sum();
        Some(PixelDerivative { loss, d_first: second, d_second: first })
    }
}

#[test]
fn pictures_and_gradients_have_the_same_bits_on_one_and_on_two_threads() {
    let surface = Surface::new(cube(1.0, false)).unwrap();
    // More pixels than one chunk of the accumulation.
    let camera = camera_at(Vec3::new(2.0, 1.5, 3.0), Vec3::ZERO, 72, 50.0);
    let light = Environment { radiance: Image::from_fn(16, 8, |row, _| Vec3::splat(8.0 - row as f32)) };
    let parameters = uniform(Material::from_maps(Vec3::splat(0.5), Vec3::splat(0.1), 0.2), &light);
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let settings = PictureSettings { samples: 4, groups: 2, ..PictureSettings::default() };
            let stop = AtomicBool::new(false);
            let picture = render(&surface, &camera, &parameters, 0, &settings, &stop);
            let sampler = EnvironmentSampler::new(&light);
            let tracer = tracer(&surface, &parameters, &sampler);
            let rays = CameraRays::fresh(&surface, &camera, PixelFilter::Tent, 4);
            let pixels: Vec<u32> = (0..72 * 72).collect();
            let key = PassKey::halves(3, 1, 2);
            let mut gradient = ParameterGradient::zeros(&PyramidWeights::flat(2, 2), parameters.light.len());
            let totals = accumulate(&tracer, &rays, &pixels, key, &parameters, &ToGrey, &mut gradient, &stop);
            (picture, totals.loss.to_bits(), gradient)
        })
    };
    let (one, two) = (on_threads(1), on_threads(2));
    assert!(one.2.light.iter().flatten().any(|&d| d != 0.0));
    assert!(one == two, "the number of threads changes bits");
}

#[test]
fn the_variance_of_a_picture_is_the_variance_of_its_pixels() {
    let camera = camera_at(Vec3::new(0.5, 0.3, 4.0), Vec3::ZERO, 24, 30.0);
    let light = Environment { radiance: Image::from_fn(16, 8, |row, _| Vec3::splat(8.0 - row as f32)) };
    let parameters = uniform(Material::from_maps(Vec3::splat(0.5), Vec3::splat(0.1), 0.2), &light);
    let own = |seed| {
        let settings = PictureSettings { samples: 2, groups: 32, seed, ..PictureSettings::default() };
        picture(&sphere(1.0, 16, 32), &camera, &parameters, &settings)
    };
    let (first, second) = (own(1), own(2));
    let (va, vb) = (first.variance.unwrap(), second.variance.unwrap());
    let mut squares = Moments::default();
    let mut z = Moments::default();
    for (index, (a, b)) in first.radiance.pixels().iter().zip(second.radiance.pixels()).enumerate() {
        let variance = f64::from(va.pixels()[index].x + vb.pixels()[index].x);
        if variance > 0.0 {
            let value = f64::from(a.x - b.x) / variance.sqrt();
            z.add(value);
            squares.add(value * value);
        }
    }
    assert!(squares.count > 300);
    // Student's t with 62 degrees of freedom has variance 1.03.
    let error = (squares.variance() / squares.count as f64).sqrt();
    assert!((squares.mean - 1.03).abs() < 5.0 * error + 0.05, "{} +- {error}", squares.mean);
    assert!(z.mean.abs() < 4.0 / (z.count as f64).sqrt());
}
