//! Shapes and finishes of the hard cases.

use super::HardCase;
use crate::error::Result;
use crate::scene::synthetic::bake::{Reflectance, SurfacePoint};
use crate::scene::synthetic::layout::{PartChart, PartMesh, lay_out};
use crate::scene::synthetic::procedural::{fractal, noise, smooth_step};
use crate::scene::synthetic::shapes::{self, Chart};
use glam::{DVec2, Quat, Vec3};

/// Cells a side of the six charts of a round object: three times a whole number, for the decimated one.
pub const CELLS: usize = 12;
/// Where the object stands.
pub const OBJECT_CENTRE: Vec3 = Vec3::new(0.0, 0.8, 0.0);
/// Where the object stands that may be missing.
pub const MISSING_CENTRE: Vec3 = Vec3::new(1.15, 0.36, 0.35);
/// Part of the object, which comes first in the mesh.
pub const OBJECT: u32 = 0;
/// Part of the floor.
pub const FLOOR: u32 = 1;
/// Part of what may be missing.
pub const EXTRA: u32 = 2;

/// The surface of a case with its charts laid out for maps of `size`.
pub fn surface(case: HardCase, size: usize) -> Result<PartMesh> {
    let at = |charts: Vec<Chart>, offset: Vec3, part: u32, density: f32| {
        let scale = if part == OBJECT && is_blob(case) { 0.75 } else { 1.0 };
        charts.into_iter().map(move |chart| PartChart {
            chart: chart.placed(Quat::IDENTITY, scale, offset),
            part,
            density,
        })
    };
    let profile = |points: &[(f64, f64)]| points.iter().map(|&(x, y)| DVec2::new(x, y)).collect::<Vec<_>>();
    let mut charts: Vec<PartChart> = match case {
        // From the foot up the outside, over the lip and down into the bowl.
        HardCase::Plaster => {
            let deep =
                [(0.0, 0.0), (0.5, 0.0), (0.85, 0.5), (0.9, 1.2), (0.8, 1.25), (0.72, 1.1), (0.6, 0.4), (0.0, 0.12)];
            at(shapes::lathe(&profile(&deep), 32, 32), Vec3::new(0.0, 0.01, 0.0), OBJECT, 1.0).collect()
        }
        HardCase::ThinShells => {
            let thin = [
                (0.0, 0.2),
                (0.5, 0.24),
                (0.85, 0.6),
                (1.0, 1.2),
                (0.994, 1.2),
                (0.844, 0.607),
                (0.5, 0.246),
                (0.0, 0.206),
            ];
            at(shapes::lathe(&profile(&thin), 32, 32), Vec3::ZERO, OBJECT, 1.0).collect()
        }
        HardCase::Touching => {
            let pair = at(shapes::sphere(0.6, CELLS), Vec3::new(-0.6, 0.6, 0.0), OBJECT, 1.0);
            pair.chain(at(shapes::sphere(0.6, CELLS), Vec3::new(0.6, 0.6, 0.0), OBJECT, 1.0)).collect()
        }
        _ => at(shapes::blob(0.1, CELLS), OBJECT_CENTRE, OBJECT, 1.0).collect(),
    };
    charts.extend(at(shapes::disk(1.9, 4, 24), Vec3::ZERO, FLOOR, 0.5));
    if case == HardCase::Missing {
        charts.extend(at(shapes::sphere(0.35, 6), MISSING_CENTRE, EXTRA, 0.7));
    }
    lay_out(charts, size, size)
}

/// Whether the object is the blob, which most cases share.
fn is_blob(case: HardCase) -> bool {
    !matches!(case, HardCase::Plaster | HardCase::ThinShells | HardCase::Touching)
}

/// What a place is made of. `map_size` tells how fine the finest texture may be.
pub fn finish(case: HardCase, point: &SurfacePoint, map_size: usize) -> Reflectance {
    let place = point.position;
    let grain = 0.75 + 0.4 * noise(5, place * 7.0);
    let two = smooth_step(0.46, 0.54, fractal(3, place * 1.7, 2));
    let painted = Reflectance {
        diffuse: Vec3::new(0.55, 0.2, 0.12).lerp(Vec3::new(0.15, 0.32, 0.5), two) * grain,
        specular: Vec3::splat(0.05),
        roughness: 0.06 + 0.3 * two,
    };
    if point.part == FLOOR {
        let slab = smooth_step(0.45, 0.55, fractal(7, place * 1.3, 2));
        let diffuse = Vec3::new(0.5, 0.48, 0.42).lerp(Vec3::new(0.24, 0.22, 0.2), slab) * grain;
        let own = Reflectance { diffuse, specular: Vec3::splat(0.04), roughness: 0.5 };
        return if case == HardCase::Rough { Reflectance { roughness: 1.0, ..own } } else { own };
    }
    match case {
        HardCase::Mirror => {
            Reflectance { diffuse: Vec3::splat(0.02), specular: Vec3::new(0.9, 0.88, 0.85), roughness: 1e-4 }
        }
        HardCase::Rough => Reflectance { roughness: 1.0, ..painted },
        // Copper at normal incidence (Gulbrandsen 2014, table 1, rounded).
        HardCase::Metal => {
            Reflectance { diffuse: Vec3::ZERO, specular: Vec3::new(0.93, 0.62, 0.52), roughness: 0.04 + 0.2 * two }
        }
        HardCase::Velvet => {
            Reflectance { diffuse: Vec3::splat(0.005) * grain, specular: Vec3::splat(0.02), roughness: 0.8 }
        }
        HardCase::Plaster => {
            Reflectance { diffuse: Vec3::new(0.95, 0.94, 0.92), specular: Vec3::splat(0.04), roughness: 0.8 }
        }
        HardCase::FineTexture => {
            // Cells of a texel or so, which photos see as grey.
            let cell = place * (map_size as f32 / 5.0);
            let is_dark = (cell.x.floor() + cell.y.floor() + cell.z.floor()).rem_euclid(2.0) < 1.0;
            let diffuse = if is_dark { Vec3::splat(0.08) } else { Vec3::new(0.75, 0.6, 0.4) };
            Reflectance { diffuse, roughness: if is_dark { 0.1 } else { 0.4 }, ..painted }
        }
        _ => painted,
    }
}
