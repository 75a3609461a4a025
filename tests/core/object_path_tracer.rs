//! The photos that studies of objects are made of are exhaustive sums: here they are held against the path tracer.

#![allow(clippy::unwrap_used)]

use glam::{Vec2, Vec3};
use patina::image::{Image, RgbImage};
use patina::light::Environment;
use patina::material::Material;
use patina::material::texels::{PyramidWeights, TexelPyramid};
use patina::measured::analytic::OwnLobe;
use patina::measured::analytic::own_lobe::MapValues;
use patina::measured::{HalfDifference, MeasuredBrdf};
use patina::object::ObjectGeometry;
use patina::object::picture::render_exact;
use patina::object::transport::TexelDirections;
use patina::render::measured_regions::render_regions;
use patina::render::picture::{Picture, PictureSettings};
use patina::render::regions::{MeasuredMaterial, Regions};
use patina::render::{Parameters, Surface};
use patina::scene::{Camera, Mesh};
use std::sync::atomic::AtomicBool;

/// Side of the pictures in pixels.
const SIZE: usize = 48;
/// Side of a block of pixels.
const BLOCK: usize = 8;
/// What the two may differ by without being wrong, as a share of a block's level. The sum takes a texel of light as
/// constant and as seen wholly or not at all, and a pixel as its middle; the tracer is bilinear between the texels,
/// meets shadows where they are, and spreads its rays over the pixel. The light is so smooth (the sun's standard
/// deviation is 4.5 texels) that the first costs at most half a percent, at the sun; the ragged shadows of single
/// pixels average out over a block, and so do the middles of pixels.
const ALLOWANCE: f64 = 0.015;

/// A sphere on a floor: it shadows the floor, and the floor its lower half. Triangles are wound outwards.
fn sphere_on_floor() -> Mesh {
    let (rows, columns) = (32, 64);
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let (theta, phi) = (std::f32::consts::PI * v, std::f32::consts::TAU * u);
            let normal = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(normal + Vec3::Y);
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
    let first = mesh.positions.len() as u32;
    for (x, z) in [(-4.0, -4.0), (-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)] {
        mesh.positions.push(Vec3::new(x, -0.02, z));
        mesh.normals.push(Vec3::Y);
        mesh.uvs.push(Vec2::new(0.5, 0.5));
    }
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh
}

/// A soft sun on a sky that darkens downwards. The sun stands behind the sphere, which throws its shadow forward.
fn soft_light() -> Environment {
    let radiance = Image::from_fn(96, 48, |row, column| {
        let height = (std::f32::consts::PI * (row as f32 + 0.5) / 48.0).cos();
        let sun = (-((row as f32 - 13.0).powi(2) + (column as f32 - 75.0).powi(2)) / (2.0 * 4.5 * 4.5)).exp();
        (0.5 + 0.3 * height) * Vec3::new(0.8, 0.9, 1.1) + sun * Vec3::new(6.5, 6.0, 5.0)
    });
    Environment { radiance }
}

/// A glossy table of three colours.
fn table() -> MeasuredBrdf {
    let values = MapValues { diffuse: [0.35, 0.2, 0.1], specular: [0.15, 0.25, 0.35], roughness: 0.12 };
    MeasuredBrdf::from_model(&OwnLobe, &OwnLobe::parameters_of(&values))
}

/// Pixels that do not lie across an edge or an outline: their neighbours show the same face nearby.
fn even_pixels(geometry: &ObjectGeometry) -> Image<bool> {
    let (width, height) = (geometry.width, geometry.height);
    let mut seen: Image<Option<usize>> = Image::filled(width, height, None);
    for (index, pixel) in geometry.pixels.iter().enumerate() {
        seen[(pixel.row as usize, pixel.column as usize)] = Some(index);
    }
    Image::from_fn(width, height, |row, column| {
        if row == 0 || column == 0 || row + 1 == height || column + 1 == width {
            return false;
        }
        let Some(own) = seen[(row, column)].map(|index| geometry.pixels[index]) else { return false };
        (0..9).all(|neighbour| {
            let place = (row + neighbour / 3 - 1, column + neighbour % 3 - 1);
            seen[place]
                .map(|index| geometry.pixels[index])
                .is_some_and(|near| near.normal.dot(own.normal) > 0.9 && (near.origin - own.origin).length() < 0.5)
        })
    })
}

/// How two pictures differ.
struct Comparison {
    /// Root mean square over blocks and channels of the difference over its spread.
    root_mean_square: f64,
    /// All that the sum has over all that the tracer has.
    ratio: f64,
    blocks: usize,
}

fn compare(traced: &Picture, summed: &RgbImage, even: &Image<bool>) -> Comparison {
    let variance = traced.variance.as_ref().unwrap();
    let (mut squares, mut blocks, mut totals) = (0.0f64, 0usize, [0.0f64; 2]);
    for block in 0..(SIZE / BLOCK).pow(2) {
        let (top, left) = (block / (SIZE / BLOCK) * BLOCK, block % (SIZE / BLOCK) * BLOCK);
        let places: Vec<(usize, usize)> = (0..BLOCK * BLOCK)
            .map(|index| (top + index / BLOCK, left + index % BLOCK))
            .filter(|&place| even[place])
            .collect();
        if places.len() < 24 {
            continue;
        }
        blocks += 1;
        for channel in 0..3 {
            let sum_of = |image: &RgbImage| -> f64 { places.iter().map(|&at| f64::from(image[at][channel])).sum() };
            let (own, other, noise) = (sum_of(summed), sum_of(&traced.radiance), sum_of(variance));
            squares += (own - other).powi(2) / (noise + (ALLOWANCE * other).powi(2)).max(1e-30);
            totals[0] += own;
            totals[1] += other;
        }
    }
    let root_mean_square = (squares / (3 * blocks).max(1) as f64).sqrt();
    Comparison { root_mean_square, ratio: totals[0] / totals[1], blocks }
}

#[test]
fn the_photos_of_studies_are_those_of_the_path_tracer_with_one_hit() {
    let (light, table) = (soft_light(), table());
    let camera = Camera::looking_at(Vec3::new(2.6, 4.0, 4.0), Vec3::new(0.0, 0.6, 0.0), SIZE, SIZE, 0.7);

    // As the studies do it: every part of every texel, the table itself at each.
    let geometry = ObjectGeometry::of_mesh(&sphere_on_floor(), &camera).unwrap();
    let directions = TexelDirections::of_any_size(light.width(), light.height());
    let visibility = geometry.visibility(&geometry.pixels, light.width(), light.height());
    assert!(visibility.is_some(), "a mesh shadows itself");
    let evaluate = |at: &[HalfDifference], values: &mut [[f64; 3]]| {
        for (value, &at) in values.iter_mut().zip(at) {
            *value = table.lookup(at).unwrap_or_default();
        }
    };
    let photo = render_exact(&geometry, visibility.as_ref(), &directions, &evaluate, &[&light]).swap_remove(0);
    let without_shadows = render_exact(&geometry, None, &directions, &evaluate, &[&light]).swap_remove(0);

    // The path tracer with the same table everywhere. The maps are there because it asks for some: nothing shows them.
    let surface = Surface::new(sphere_on_floor()).unwrap();
    let texel = Material::from_maps(Vec3::ZERO, Vec3::ZERO, 0.5);
    let parameters = Parameters::new(TexelPyramid::from_base(vec![texel; 4], &PyramidWeights::flat(2, 2)), &light);
    let regions = Regions::everywhere(MeasuredMaterial::new("table", table.clone()));
    let settings =
        PictureSettings { samples: 16, groups: 16, max_bounces: 1, background_visible: false, ..Default::default() };
    let traced = render_regions(&surface, &camera, &parameters, &regions, 0, &settings, &AtomicBool::new(false));
    assert_eq!(traced.non_finite_pixels, 0);

    let even = even_pixels(&geometry);
    let found = compare(&traced, &photo, &even);
    println!(
        "root mean square z {:.2} over {} blocks, sum over tracer {:.4}",
        found.root_mean_square, found.blocks, found.ratio
    );
    assert!(found.blocks >= 18, "{} blocks see the surface", found.blocks);
    assert!(found.root_mean_square < 1.5, "{}", found.root_mean_square);
    assert!((found.ratio - 1.0).abs() < 0.01, "{}", found.ratio);

    // The test can tell: shadows left out are far outside.
    let lit = compare(&traced, &without_shadows, &even);
    println!("without shadows: root mean square z {:.2}, sum over tracer {:.4}", lit.root_mean_square, lit.ratio);
    assert!(lit.root_mean_square > 5.0, "{}", lit.root_mean_square);
}
