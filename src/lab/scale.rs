//! How time and memory grow with triangles, views and maps: `patina bench scale`.
//!
//! Scenes are bumpy spheres in code with exact triangle counts; photographs are one colour, since only cost is looked
//! at. Peak memory is that of the whole process so far, that is, of the largest case up to there.

use super::contest::Contestant;
use crate::atlas::{self, AtlasSettings};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::fit::settings::Steps;
use crate::fit::{FitSettings, Fitter, Method, StepOutcome};
use crate::image::Image;
use crate::insight::memory::peak_bytes;
use crate::insight::report::data::StageTime;
use crate::job::prepare::timed;
use crate::lab::study_table::StudyTable;
use crate::render::Surface;
use crate::scene::{Background, Camera, Mesh, Photo, PixelState, Scene, View};
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One case of the bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleCase {
    /// Triangles of the mesh, exactly.
    pub triangles: usize,
    /// Number of views, 768 x 576 pixels each.
    pub views: usize,
    /// Width and height of the maps in texels.
    pub map_size: usize,
}

/// Cases along three axes: the first of each list together, then each list in turn with the first of the others.
pub fn cases_along(triangles: &[usize], views: &[usize], maps: &[usize]) -> Vec<ScaleCase> {
    let first = |list: &[usize], otherwise: usize| list.first().copied().unwrap_or(otherwise);
    let base = ScaleCase { triangles: first(triangles, 31_964), views: first(views, 48), map_size: first(maps, 512) };
    let mut cases = vec![base];
    cases.extend(maps.iter().skip(1).map(|&map_size| ScaleCase { map_size, ..base }));
    cases.extend(triangles.iter().skip(1).map(|&triangles| ScaleCase { triangles, ..base }));
    cases.extend(views.iter().skip(1).map(|&views| ScaleCase { views, ..base }));
    cases
}

/// The cases, from small to large: maps, then triangles, then views.
pub fn cases(quick: bool) -> Vec<ScaleCase> {
    let case = |triangles, views, map_size| ScaleCase { triangles, views, map_size };
    if quick {
        return vec![case(31_964, 8, 512), case(100_000, 8, 1024)];
    }
    vec![
        case(31_964, 48, 512),
        case(31_964, 48, 1024),
        case(31_964, 48, 2048),
        case(454_854, 48, 2048),
        case(454_854, 1000, 2048),
        case(454_854, 1000, 4096),
    ]
}

/// How much of a fit is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// One step on whole photos and maps. The solver's first traces what later ones share.
    OneStep,
    /// A fit on its defaults from its first step, small at first, to its end.
    WholeFit,
}

/// Runs the cases by each method and writes seconds and memory to `folder`, anew after each; `tell` hears of each case
/// before it runs.
///
/// # Errors
/// A case of no triangles, views or texels; files that cannot be written.
pub fn run(
    cases: &[ScaleCase],
    methods: &[Contestant],
    extent: Extent,
    folder: &Path,
    tell: &dyn Fn(&str),
) -> Result<StudyTable> {
    for &ScaleCase { triangles, views, map_size } in cases {
        for (name, value) in [("triangles", triangles), ("views", views), ("maps", map_size)] {
            if value == 0 {
                return Err(Error::new(ErrorKind::InvalidSetting, "must be at least 1").at(Place::Setting(name.into())));
            }
        }
    }
    let columns = [
        ("mesh file read", "s"),
        ("atlas", "s"),
        ("tracer", "s"),
        ("prepare fit", "s"),
        (if extent == Extent::WholeFit { "whole fit" } else { "one step" }, "s"),
        ("peak memory so far", "MiB"),
    ];
    let title = format!("Growth with triangles, views and maps, {} threads", rayon::current_num_threads());
    let mut table = StudyTable::new(&title, "case", &columns).with_caption("One value a case, in the order they ran.");
    for &case in cases {
        for &method in methods {
            let name = format!(
                "{}: {} triangles, {} views, maps {}",
                method.name(),
                case.triangles,
                case.views,
                case.map_size
            );
            let settings = settings(case, extent);
            let Some(settings) = method.settings(&settings).filter(|_| method != Contestant::Mitsuba) else {
                let note = format!("`{}` was left out: this build has no such method.", method.name());
                if !table.notes.contains(&note) {
                    table.notes.push(note);
                }
                continue;
            };
            tell(&name);
            let timings = run_case(case, settings, extent, folder)?;
            let mut row: Vec<f64> = timings.iter().map(|time| time.seconds).collect();
            row.push(peak_bytes().map_or(f64::NAN, |bytes| bytes as f64 / (1 << 20) as f64));
            table.add(&name, &row);
            // Whoever stops a later case keeps this one.
            table.write(folder, "scale")?;
        }
    }
    Ok(table)
}

/// The scene of a case, made in code; its mesh has no texture coordinates yet.
pub fn scene(case: ScaleCase) -> Scene {
    scene_of(bumpy_sphere(case.triangles), case.views)
}

/// One step at full size, or what a fit does by default.
fn settings(case: ScaleCase, extent: Extent) -> FitSettings {
    if extent == Extent::WholeFit {
        return FitSettings { method: Method::Adam, map_size: case.map_size, ..Default::default() };
    }
    FitSettings {
        method: Method::Adam,
        map_size: case.map_size,
        steps: Steps::OneStep,
        steps_diffuse: 0,
        steps_all: 1,
        levels: 1,
        held_out_interval: 0,
        ..Default::default()
    }
}

fn run_case(case: ScaleCase, settings: FitSettings, extent: Extent, folder: &Path) -> Result<Vec<StageTime>> {
    let mut timings = Vec::new();
    let path = folder.join("scale_mesh.obj");
    crate::export::obj::write(&path, &bumpy_sphere(case.triangles))?;
    let mesh = timed(&mut timings, "read", || crate::export::obj::read(&path));
    let _ = std::fs::remove_file(&path);
    let mesh = mesh?;
    if mesh.triangles.len() != case.triangles {
        return Err(Error::new(ErrorKind::Internal, "the mesh of the bench has another number of triangles"));
    }
    let atlas_settings =
        AtlasSettings { resolution_texels: case.map_size, keep_uv: atlas::KeepUv::Rebuild, ..Default::default() };
    let atlas = timed(&mut timings, "atlas", || atlas::build(&mesh, &atlas_settings, &|_| {}))?;
    let surface = timed(&mut timings, "tracer", || Surface::new(atlas.mesh))?;
    let scene = scene_of(mesh, case.views);
    let mut fitter =
        timed(&mut timings, "prepare", || Fitter::new(Arc::new(scene), Arc::new(surface), settings, None))?;
    timed(&mut timings, "fit", || take_steps(&mut fitter, extent))?;
    Ok(timings)
}

/// Steps as far as is timed; their number.
fn take_steps(fitter: &mut Fitter, extent: Extent) -> Result<usize> {
    let mut steps = 0;
    loop {
        match fitter.step(&AtomicBool::new(false))? {
            StepOutcome::Stepped(_) if extent == Extent::OneStep => return Ok(1),
            StepOutcome::Stepped(_) => steps += 1,
            StepOutcome::Finished if extent == Extent::WholeFit => return Ok(steps),
            other => {
                return Err(Error::new(ErrorKind::Internal, format!("a step of the bench did not run: {other:?}")));
            }
        }
    }
}

/// A closed bumpy sphere, less the last triangles of its grid so that the count is exact.
fn bumpy_sphere(triangles: usize) -> Mesh {
    let rows = ((triangles as f64 / 4.0).sqrt().ceil() as usize).max(3);
    let columns = triangles.div_ceil(2 * rows) + 1;
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let theta = 0.05 + (std::f32::consts::PI - 0.1) * row as f32 / rows as f32;
            let phi = std::f32::consts::TAU * column as f32 / columns as f32;
            let direction = crate::math::sphere::direction_of_angles(phi, theta);
            let bump = 0.03 * (14.0 * theta).sin() * (18.0 * phi).sin();
            mesh.positions.push(direction * (1.0 + bump));
        }
    }
    let at = |row: usize, column: usize| (row * (columns + 1) + column) as u32;
    for row in 0..rows {
        for column in 0..columns {
            let (a, b, c, d) = (at(row, column), at(row, column + 1), at(row + 1, column), at(row + 1, column + 1));
            mesh.triangles.push([a, b, c]);
            mesh.triangles.push([b, d, c]);
        }
    }
    mesh.triangles.truncate(triangles);
    // Wind outwards whatever the handedness of the grid.
    if mesh.area_vector(0).dot(mesh.corners(0)[0]) < 0.0 {
        mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    mesh.compute_normals();
    mesh
}

fn scene_of(mesh: Mesh, views: usize) -> Scene {
    let (width, height) = (768, 576);
    let view = |index: usize| {
        let angle = index as f32 * 2.399_963;
        let height_in_world = 1.5 * (2.0 * (index as f32 + 0.5) / views as f32 - 1.0);
        let eye = Vec3::new(3.2 * angle.cos(), height_in_world, 3.2 * angle.sin());
        View {
            name: format!("{index:04}"),
            camera: Camera::looking_at(eye, Vec3::ZERO, width, height, 0.8),
            photo: Photo::Srgb8(Image::filled(width, height, [120, 110, 100])),
            states: Image::filled(width, height, PixelState::Surface),
            held_out: false,
            exposure_prior_stops: None,
        }
    };
    Scene {
        name: "scale".into(),
        folder: None,
        mesh,
        views: (0..views).map(view).collect(),
        world_from_source: Default::default(),
        background: Background::Environment,
        truth: None,
        findings: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_counts_are_exact_and_a_small_case_runs() {
        for count in [31_964, 1001, 12] {
            assert_eq!(bumpy_sphere(count).triangles.len(), count);
        }
        let folder = tempfile::tempdir().unwrap();
        let case = ScaleCase { triangles: 500, views: 3, map_size: 64 };
        let timings = run_case(case, settings(case, Extent::OneStep), Extent::OneStep, folder.path()).unwrap();
        assert_eq!(timings.len(), 5);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the mesh file is gone");
    }

    #[test]
    fn a_whole_fit_goes_to_its_end() {
        let scene = Arc::new(scene_of(bumpy_sphere(500), 3));
        let atlas_settings =
            AtlasSettings { resolution_texels: 64, keep_uv: atlas::KeepUv::Rebuild, ..Default::default() };
        let surface =
            Arc::new(Surface::new(atlas::build(&scene.mesh, &atlas_settings, &|_| {}).unwrap().mesh).unwrap());
        let case = ScaleCase { triangles: 500, views: 3, map_size: 64 };
        let short = FitSettings { steps_diffuse: 1, steps_all: 2, levels: 1, ..settings(case, Extent::WholeFit) };
        for (extent, steps) in [(Extent::OneStep, 1), (Extent::WholeFit, 3)] {
            let mut fitter = Fitter::new(scene.clone(), surface.clone(), short.clone(), None).unwrap();
            assert_eq!(take_steps(&mut fitter, extent).unwrap(), steps, "{extent:?}");
        }
    }

    #[test]
    fn cases_vary_one_thing_at_a_time() {
        let cases = cases_along(&[100, 200], &[8, 16, 32], &[64]);
        assert_eq!(cases.len(), 1 + 1 + 2);
        assert!(cases.iter().skip(1).all(|case| {
            let same = [case.triangles == 100, case.views == 8, case.map_size == 64];
            same.iter().filter(|same| **same).count() == 2
        }));
        assert_eq!(cases_along(&[], &[], &[]).len(), 1);
    }
}
