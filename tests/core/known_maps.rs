//! Maps of an earlier run that are kept while the light of other photos is found.

#![allow(clippy::unwrap_used)]

use super::common::*;
use glam::Vec3;
use patina::export::{RunFolder, RunResult};
use patina::fit::gauge::GaugeRule;
use patina::fit::{FitSettings, Fitter, KnownMaps, Method, StepOutcome, checkpoint};
use patina::image::Image;
use patina::insight::truth::environment_errors;
use patina::job::known_maps::settle;
use patina::job::open::{OpenedScene, start_new};
use patina::job::{Budget, Event, JobOptions, RunSettings};
use patina::light::Environment;
use patina::material::texels::{PyramidWeights, TexelPyramid, texels_from_maps};
use patina::material::{LobeModel, MaterialMaps};
use patina::render::picture::{PictureSettings, render};
use patina::render::{Parameters, Surface};
use patina::scene::{Background, Scene};
use patina::{ErrorKind, Place, Result};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

static GO: AtomicBool = AtomicBool::new(false);
const SIZE: usize = 32;

/// Patches of other colours, some of them glossy; roughness is no number that its own square root brings back.
fn maps() -> MaterialMaps {
    let patch = |row: usize, column: usize| (row / 4 + 2 * (column / 4)) % 5;
    let colour = |row, column| {
        [Vec3::new(0.6, 0.3, 0.2), Vec3::new(0.2, 0.4, 0.5), Vec3::splat(0.7), Vec3::splat(0.1), Vec3::splat(0.35)]
            [patch(row, column)]
    };
    MaterialMaps {
        diffuse: Image::from_fn(SIZE, SIZE, colour),
        specular: Image::from_fn(SIZE, SIZE, |row, column| {
            Vec3::splat([0.04, 0.3, 0.05, 0.04, 0.1][patch(row, column)])
        }),
        roughness: Image::from_fn(SIZE, SIZE, |row, column| [0.47, 0.11, 0.33, 0.29, 0.23][patch(row, column)]),
    }
}

/// A light that nobody would take for the usual start: warm, with a bright side. What shines from below meets the floor.
fn light() -> Environment {
    let radiance = Image::from_fn(8, 4, |row, column| {
        let up = [1.1, 0.8, 0.2, 0.1][row];
        up * Vec3::new(1.3, 0.9, 0.6) * if column == 5 && row < 2 { 5.0 } else { 0.7 }
    });
    Environment { radiance }
}

/// Photos of the patches under that light before black cloth, the last held out.
fn scene() -> (Arc<Scene>, Arc<Surface>) {
    static SCENE: OnceLock<(Arc<Scene>, Arc<Surface>)> = OnceLock::new();
    let made = || {
        let cameras = (0..7).map(|view| camera_at(360.0 * view as f32 / 7.0, 35.0, 64, 64)).collect();
        let trial = Trial { cameras, background: Background::Black, ..Default::default() };
        let surface = trial.surface();
        let texels = TexelPyramid::from_base(texels_from_maps(&maps()), &PyramidWeights::flat(SIZE, SIZE));
        let truth = Parameters::new(texels, &light());
        let settings = PictureSettings { samples: 64, max_bounces: 2, background_visible: false, ..Default::default() };
        let mut scene = trial.black();
        for view in 0..scene.views.len() {
            let picture = render(&surface, &scene.views[view].camera, &truth, view as u32, &settings, &GO);
            scene.set_photo(view, picture.radiance).unwrap();
        }
        scene.views.last_mut().unwrap().held_out = true;
        (Arc::new(scene), surface)
    };
    SCENE.get_or_init(made).clone()
}

fn free() -> FitSettings {
    FitSettings { method: Method::Solver, solver_rounds: 6, solver_grid: 32, map_size: SIZE, ..quick() }
}

fn known() -> Arc<KnownMaps> {
    Arc::new(KnownMaps { maps: maps(), times_seen: Image::filled(SIZE, SIZE, 3.0) })
}

fn keeping() -> Fitter {
    let (scene, surface) = scene();
    let settings = FitSettings { fixed_maps: true, ..free() };
    let mut fitter = Fitter::new(scene, surface, settings, None).unwrap();
    fitter.take_maps(known()).unwrap();
    fitter
}

fn light_error(fitter: &Fitter) -> f64 {
    environment_errors(&fitter.environment(), &light()).unwrap().relative_l2.raw
}

#[test]
fn the_light_is_found_nearer_to_the_truth_than_with_maps_that_are_sought_too() {
    let (scene, surface) = scene();
    let mut free = Fitter::new(scene, surface, free(), None).unwrap();
    run(&mut free).unwrap();
    let mut keeping = keeping();
    let before = keeping.state().texels.clone();
    run(&mut keeping).unwrap();
    let (with, without) = (light_error(&keeping), light_error(&free));
    println!("relative L2 of the light: maps kept {with:.3}, maps sought {without:.3}");
    assert!(with < 0.7 * without, "{with} {without}");
    assert!(keeping.state().texels == before && keeping.maps() == maps(), "maps are kept bit for bit");
    let stages: Vec<&str> = keeping.state().losses.iter().map(|row| row.stage.as_str()).collect();
    assert_eq!(stages, ["wide light", "wide light", "wide light", "narrow light", "narrow light", "narrow light"]);
    assert_eq!(keeping.gauge(), GaugeRule::FixedMaps);
    assert!(keeping.deviations().is_none() && keeping.light_evidence().is_some());
    // Round by round it explains the photo better that took no part.
    let held_out: Vec<f64> = keeping.state().losses.iter().filter_map(|row| row.held_out_rmse).collect();
    assert!(held_out.last().unwrap() < &(0.8 * held_out[0]), "{held_out:?}");
}

#[test]
fn it_goes_on_bit_for_bit_from_its_folder_and_maps_of_any_level_stay() {
    // Photos of half size first: the maps are halved for them, and stay whole.
    for (size, levels, steps, ways) in [(SIZE, 1, 6, [0, 2, 5].as_slice()), (256, 2, 8, &[3])] {
        let large = |image: &Image<Vec3>| {
            Image::from_fn(size, size, |row, column| image[(row * SIZE / size, column * SIZE / size)])
        };
        let small = maps();
        let roughness =
            Image::from_fn(size, size, |row, column| small.roughness[(row * SIZE / size, column * SIZE / size)]);
        let maps = MaterialMaps { diffuse: large(&small.diffuse), specular: large(&small.specular), roughness };
        let known = Arc::new(KnownMaps { maps, times_seen: Image::filled(size, size, 1.0) });
        let settings =
            FitSettings { fixed_maps: true, map_size: size, solver_levels: levels, exposure: true, ..free() };
        let (scene, surface) = scene();
        let new = || {
            let mut fitter = Fitter::new(scene.clone(), surface.clone(), settings.clone(), None).unwrap();
            fitter.take_maps(known.clone()).unwrap();
            fitter
        };
        let mut whole = new();
        run(&mut whole).unwrap();
        assert_eq!(whole.state().step, steps);
        for &done in ways {
            let folder = tempfile::tempdir().unwrap();
            let mut fitter = new();
            (0..done).for_each(|_| drop(fitter.step(&GO).unwrap()));
            assert_eq!(fitter.step(&AtomicBool::new(true)).unwrap(), StepOutcome::Interrupted);
            // A job whose time is up at once leaves a result, and what goes on.
            let budget = Some(Budget::by_clock(0.0, Arc::new(|| 0.0)));
            let job = job(fitter, folder.path(), JobOptions { budget, ..JobOptions::default() });
            while !matches!(job.events.recv().unwrap(), Event::Finished(_)) {}
            job.join();
            let run_folder = RunFolder::open(folder.path()).unwrap();
            let state = checkpoint::read(&run_folder.checkpoint_path()).unwrap();
            assert_eq!(state.step, done);
            let mut resumed = Fitter::resume(scene.clone(), surface.clone(), settings.clone(), state).unwrap();
            assert!(resumed.step(&GO).is_err(), "nothing is kept before maps are given");
            let (maps, times_seen) = run_folder.read_maps().unwrap();
            resumed.take_maps(Arc::new(KnownMaps { maps, times_seen })).unwrap();
            run(&mut resumed).unwrap();
            assert!(without_seconds(resumed.state()) == without_seconds(whole.state()), "after step {done}");
        }
    }
}

/// A run folder with the patches on the atlas of a scene.
fn run_folder(path: &Path, lobe: LobeModel) -> RunSettings {
    let (scene, surface) = scene();
    let folder = RunFolder::create(path).unwrap();
    let result = RunResult {
        maps: maps(),
        environment: sky(),
        mesh: surface.mesh().clone(),
        times_seen: Image::filled(SIZE, SIZE, 3.0),
        lobe,
    };
    folder.write_result(&result).unwrap();
    let fit = FitSettings { lobe, ..free() };
    folder.write_settings(&RunSettings { fit, ..Default::default() }).unwrap();
    drop(scene);
    RunSettings { known_maps: path.into(), fit: free(), ..Default::default() }
}

fn started(scene: &Scene, settings: RunSettings) -> Result<(patina::job::prepare::Prepared, Fitter, RunSettings)> {
    let opened = OpenedScene { scene: scene.clone(), report: Default::default(), timings: Vec::new() };
    start_new(opened, settings, &GO, &|_, _| {})
}

#[test]
fn the_new_run_has_the_maps_and_the_atlas_of_the_old_one_and_another_light() {
    let folder = tempfile::tempdir().unwrap();
    let [old, new] = ["old", "new"].map(|name| folder.path().join(name));
    let mut settings = run_folder(&old, LobeModel::BlinnPhong);
    let mut chosen = Vec::new();
    settings.fit.map_size = 2048;
    settle(&mut settings, &mut chosen).unwrap();
    assert_eq!(
        (settings.fit.map_size, settings.fit.fixed_maps, chosen.as_slice()),
        (SIZE, true, &["map-size".into(), "lobe".into()][..])
    );
    let (prepared, fitter, settings) = started(&scene().0, settings).unwrap();
    let run = RunFolder::create(&new).unwrap();
    let job = patina::job::start(prepared, fitter, settings, run.clone()).unwrap();
    let data = loop {
        match job.events.recv().unwrap() {
            Event::Finished(data) => break data,
            Event::Failed(error) => panic!("{error}"),
            _ => {}
        }
    };
    let (before, after) = (RunFolder::open(&old).unwrap().read_result().unwrap(), run.read_result().unwrap());
    assert_eq!((&after.maps, &after.times_seen, &after.mesh), (&before.maps, &before.times_seen, &before.mesh));
    assert_ne!(after.environment, before.environment);
    assert!(data.scene_facts.iter().any(|fact| fact.name == "maps kept from" && fact.value.contains("old")));
    assert!(data.gauge_statement.contains("maps were given"), "{}", data.gauge_statement);
    assert!(data.aggregates.iter().any(|aggregate| aggregate.name == "held-out views"));
}

#[test]
fn maps_of_another_surface_or_lobe_are_refused_with_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("old");
    let mut settings = run_folder(&old, LobeModel::BlinnPhong);
    let error = settle(&mut settings.clone(), &mut vec!["map-size".into()]).err();
    assert!(error.is_none(), "the same size may be asked for: {error:?}");
    let mut other = RunSettings { fit: FitSettings { map_size: 64, ..free() }, ..settings.clone() };
    let error = settle(&mut other, &mut vec!["map-size".into()]).unwrap_err();
    assert_eq!(error.place(), &Place::Setting("map-size".into()));
    settle(&mut settings, &mut Vec::new()).unwrap();
    // A vertex that lies elsewhere, and a triangle too few.
    let own = scene().0;
    for change in 0..2 {
        let mut scene = Scene::clone(&own);
        if change == 0 {
            scene.mesh.positions[7].y += 0.01;
        } else {
            scene.mesh.triangles.pop();
        }
        let error = started(&scene, settings.clone()).err().unwrap();
        assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidScene, &Place::File(old.join("mesh.obj"))));
        assert!(error.remedy_text().contains("--mesh"), "{error}");
    }
    // Coordinates of the scene's own that differ, where they are asked for.
    let mut scene = Scene::clone(&own);
    scene.mesh.uvs.iter_mut().for_each(|uv| uv.x *= 0.5);
    assert!(started(&scene, settings.clone()).is_ok(), "the atlas of the run is taken");
    let mut keep = settings.clone();
    keep.atlas.keep_uv = patina::atlas::KeepUv::Keep;
    assert!(started(&own, keep.clone()).is_ok());
    let error = started(&scene, keep).err().unwrap();
    assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidSetting, &Place::Setting("uv".into())));
    // A fit that was prepared with another atlas.
    let prepared = started(&own, RunSettings { fit: free(), ..Default::default() }).unwrap().0;
    let mut mesh = prepared.surface.mesh().clone();
    mesh.uvs.iter_mut().for_each(|uv| uv.x *= 0.5);
    let prepared = patina::job::prepare::Prepared { surface: Arc::new(Surface::new(mesh).unwrap()), ..prepared };
    let error = patina::job::open::begin(prepared, settings, &GO, &|_, _| {}).err().unwrap();
    assert!(error.kind() == ErrorKind::InvalidScene && error.message().contains("atlas"), "{error}");
    let mut ggx = run_folder(&folder.path().join("ggx"), LobeModel::Ggx);
    settle(&mut ggx, &mut Vec::new()).unwrap();
    assert_eq!(ggx.fit.lobe, LobeModel::Ggx);
    let mut other = RunSettings { fit: FitSettings { lobe: LobeModel::BlinnPhong, ..ggx.fit.clone() }, ..ggx };
    let error = settle(&mut other, &mut vec!["lobe".into()]).unwrap_err();
    assert!(error.place() == &Place::Setting("lobe".into()) && error.remedy_text().contains("--lobe"), "{error}");
    let none = RunSettings { fit: FitSettings { fixed_maps: true, ..free() }, ..Default::default() };
    let error = started(&own, none).err().unwrap();
    assert!(error.place() == &Place::Setting("fixed-maps".into()) && error.remedy_text().contains("--maps"), "{error}");
}
