//! The bridge: measured reflectance on parts of a surface, by the same path tracer.

#![allow(clippy::unwrap_used)]

use glam::{DVec3, Vec2, Vec3};
use patina::image::Image;
use patina::light::Environment;
use patina::material::Material;
use patina::material::texels::{PyramidWeights, TexelPyramid};
use patina::measured::analytic::OwnLobe;
use patina::measured::table::MeasuredBrdf;
use patina::render::measured_regions::render_regions;
use patina::render::picture::{Picture, PictureSettings, render};
use patina::render::regions::{MeasuredMaterial, Regions};
use patina::render::{Parameters, Surface};
use patina::scene::{Camera, Mesh};
use std::sync::atomic::AtomicBool;

/// A sphere over a floor that sees it: light goes from one to the other. The sphere's texture is the left half.
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
            mesh.uvs.push(Vec2::new(0.02 + 0.46 * u, 1.0 - v));
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
    for (x, z) in [(-3.0, -3.0), (-3.0, 3.0), (3.0, 3.0), (3.0, -3.0)] {
        mesh.positions.push(Vec3::new(x, -0.02, z));
        mesh.normals.push(Vec3::Y);
        mesh.uvs.push(Vec2::new(0.75, 0.5));
    }
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    mesh
}

fn sky() -> Environment {
    let radiance = Image::from_fn(32, 16, |row, column| {
        let sun = (-((row as f32 - 4.0).powi(2) + (column as f32 - 10.0).powi(2)) / 2.0).exp();
        Vec3::new(0.5, 0.7, 1.0) + sun * Vec3::new(30.0, 26.0, 20.0)
    });
    Environment { radiance }
}

fn glossy() -> Material<f32> {
    Material::from_maps(Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.2, 0.3, 0.4), 0.16)
}

fn parameters(material: Material<f32>, light: &Environment) -> Parameters<f32> {
    Parameters::new(TexelPyramid::from_base(vec![material; 4], &PyramidWeights::flat(2, 2)), light)
}

/// The table of the program's own lobe, and of the values of the maps that it stands for.
fn table_of(material: &Material<f32>) -> MeasuredBrdf {
    let values = patina::measured::analytic::own_lobe::MapValues {
        diffuse: material.diffuse.map(f64::from),
        specular: material.specular.map(f64::from),
        roughness: f64::from((2.0 * material.log_width).exp()),
    };
    MeasuredBrdf::from_model(&OwnLobe, &OwnLobe::parameters_of(&values))
}

fn camera(size: usize) -> Camera {
    Camera::looking_at(Vec3::new(3.5, 2.6, 4.5), Vec3::new(0.0, 0.7, 0.0), size, size, 0.7)
}

fn pictures(settings: &PictureSettings, regions: &Regions, own: &Parameters<f32>, size: usize) -> (Picture, Picture) {
    let surface = Surface::new(sphere_on_floor()).unwrap();
    let stop = AtomicBool::new(false);
    let native = render(&surface, &camera(size), own, 0, settings, &stop);
    let other = PictureSettings { seed: settings.seed + 1, ..*settings };
    (native, render_regions(&surface, &camera(size), own, regions, 0, &other, &stop))
}

#[test]
fn without_a_region_the_picture_is_that_of_the_maps() {
    let surface = Surface::new(sphere_on_floor()).unwrap();
    let own = parameters(glossy(), &sky());
    let settings = PictureSettings { samples: 16, groups: 2, max_bounces: 4, ..PictureSettings::default() };
    let stop = AtomicBool::new(false);
    let native = render(&surface, &camera(24), &own, 0, &settings, &stop);
    let material = MeasuredMaterial::new("unused", MeasuredBrdf::from_fn(|_| [7.0; 3]));
    let regions = Regions::of_masks(vec![(material, Image::filled(4, 4, 0.0))]).unwrap();
    let walked = render_regions(&surface, &camera(24), &own, &regions, 0, &settings, &stop);
    // Same random numbers, same decisions: equal but for rounding, which moves directions by a millionth. A ray in many
    // thousands passes an edge on the other side then.
    let pixels = native.radiance.pixels().iter().zip(walked.radiance.pixels());
    let off: Vec<f32> = pixels.map(|(a, b)| (*a - *b).abs().max_element() / (1.0 + a.max_element())).collect();
    // What is no number is beyond any limit.
    let beyond = |limit: f32| off.iter().filter(|&&off| !(off <= limit)).count();
    assert!(beyond(1e-4) <= off.len() / 100 && beyond(0.2) == 0, "{} and {}", beyond(1e-4), beyond(0.2));
    assert_eq!(native.coverage, walked.coverage);
}

/// Sums over blocks of pixels with their variances, and the largest share by which blocks differ with their z.
fn compare(a: &Picture, b: &Picture, blocks: usize) -> (f64, f64, f64) {
    let size = a.radiance.width();
    let (mut largest_z, mut chi, mut largest_share, mut seen) = (0.0f64, 0.0, 0.0f64, 0.0);
    for block in 0..blocks * blocks {
        let (top, left) = (block / blocks * size / blocks, block % blocks * size / blocks);
        let (mut difference, mut variance, mut level) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for row in top..top + size / blocks {
            for column in left..left + size / blocks {
                let at = (row, column);
                difference += (b.radiance[at] - a.radiance[at]).as_dvec3();
                variance += (a.variance.as_ref().unwrap()[at] + b.variance.as_ref().unwrap()[at]).as_dvec3();
                level += a.radiance[at].as_dvec3();
            }
        }
        // Where only the empty background is seen there is nothing to tell.
        if level.min_element() <= 0.0 {
            continue;
        }
        let z = difference.element_sum() / variance.element_sum().sqrt().max(1e-12) / 3f64.sqrt();
        largest_z = largest_z.max(z.abs());
        chi += z * z;
        seen += 1.0;
        largest_share = largest_share.max((difference / level).abs().max_element());
    }
    assert!(seen > 20.0, "{seen} blocks see the surface");
    (largest_z, chi / seen, largest_share)
}

#[test]
fn a_table_of_the_programs_own_lobe_looks_like_the_lobe() {
    let own = parameters(glossy(), &sky());
    let regions = Regions::everywhere(MeasuredMaterial::new("own", table_of(&glossy())));
    let settings =
        PictureSettings { samples: 24, groups: 16, max_bounces: 3, background_visible: false, ..Default::default() };
    let (native, bridged) = pictures(&settings, &regions, &own, 48);
    let (largest_z, chi, share) = compare(&native, &bridged, 6);
    println!("largest z {largest_z:.2}, mean z^2 {chi:.2}, largest difference of a block {share:.4}");
    // At most 36 blocks: one beyond 4 sigma has a chance of 0.2 %.
    assert!(largest_z < 4.0 && chi < 2.0, "{largest_z} {chi}");
    // The test can tell: another roughness is far outside.
    let other = Material::from_maps(Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.2, 0.3, 0.4), 0.09);
    let regions = Regions::everywhere(MeasuredMaterial::new("other", table_of(&other)));
    let (native, bridged) = pictures(&settings, &regions, &own, 48);
    assert!(compare(&native, &bridged, 6).0 > 8.0);
}

#[test]
fn a_lambertian_table_in_a_furnace_has_radiance_albedo() {
    let surface = Surface::new(sphere_on_floor()).unwrap();
    let light = Environment::constant(8, 4, Vec3::splat(2.0));
    let own = parameters(glossy(), &light);
    // The sphere is of the table, the floor of the maps; from above the sphere alone is judged, with one bounce.
    let table = MeasuredBrdf::from_fn(|_| [0.6 / std::f64::consts::PI; 3]);
    let left = Image::from_fn(2, 1, |_, column| if column == 0 { 1.0 } else { 0.0 });
    let regions = Regions::of_masks(vec![(MeasuredMaterial::new("matt", table), left)]).unwrap();
    let eye = Camera::looking_at(Vec3::new(0.01, 9.0, 0.01), Vec3::Y, 8, 8, 0.05);
    let settings = PictureSettings { samples: 64, groups: 4, max_bounces: 1, ..PictureSettings::default() };
    let picture = render_regions(&surface, &eye, &own, &regions, 0, &settings, &AtomicBool::new(false));
    let mean: f64 = picture.radiance.pixels().iter().map(|pixel| f64::from(pixel.element_sum()) / 3.0).sum::<f64>()
        / picture.radiance.pixels().len() as f64;
    assert!((mean - 1.2).abs() < 0.006, "{mean}");
    assert_eq!(picture.non_finite_pixels, 0);
}
