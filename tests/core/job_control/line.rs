//! What is typed, against presets and files.

use clap::Parser;
use patina::Place;
use patina::cli::arguments::{Arguments, Task};
use patina::cli::fit::run_settings;
use patina::fit::{FitSettings, Method, Preset};
use patina::image::Image;
use patina::job::RunSettings;
use patina::job::open::OpenedScene;
use patina::scene::settings::{ColourEncoding, MaskUse, Up};
use patina::scene::{Photo, ReadSettings, Scene};

#[test]
fn what_is_typed_wins_over_a_preset_and_over_a_file() {
    let of = |more: &[&str]| {
        let words = ["patina", "fit", "scene", "-o", "run"].iter().chain(more);
        let Some(Task::Fit(options)) = Arguments::try_parse_from(words).unwrap().task else { unreachable!() };
        run_settings(&options).unwrap().settings
    };
    assert_eq!(of(&[]).fit, FitSettings::default());
    assert_eq!(of(&["--preset", "careful"]).fit, FitSettings::preset(Preset::Careful));
    let typed = of(&["--preset", "quick", "--map-size", "2048", "--exclude", "a", "--exclude", "b c"]).fit;
    let exclude = vec!["a".to_string(), "b c".to_string()];
    assert_eq!(typed, FitSettings { map_size: 2048, exclude, ..FitSettings::preset(Preset::Quick) });
    // A switch may stand alone, or say that it is off.
    let gains = ["--exposure", "--exposure=true", "--exposure=false"]
        .map(|word| of(&["--preset", "careful", word]).fit.exposure);
    assert_eq!(gains, [true, true, false]);

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("settings.toml");
    patina::files::write_bytes(&file, b"[read]\nshrink = 4\nmax_views = 9\n[fit]\nsamples = 16\nbounces = 5\n")
        .unwrap();
    let file = file.to_str().unwrap();
    // 4 is the default: typed, it wins all the same.
    let settings = of(&["--settings", file, "--samples", "4", "--shrink", "2"]);
    assert_eq!((settings.fit.samples, settings.fit.bounces), (4, 5));
    assert_eq!((settings.read.shrink, settings.read.max_views), (2, 9));
    let both = ["patina", "fit", "s", "-o", "r", "--settings", file, "--preset", "quick"];
    assert!(Arguments::try_parse_from(both).is_err());
}

#[test]
fn how_a_scene_is_read_can_be_typed() {
    let of = |more: &[&str]| {
        let words = ["patina", "fit", "scene", "-o", "run"].iter().chain(more);
        let Some(Task::Fit(options)) = Arguments::try_parse_from(words).unwrap().task else { unreachable!() };
        run_settings(&options).unwrap().settings.read
    };
    assert_eq!(of(&[]), ReadSettings::default());
    assert_eq!(of(&["--up", "-Z"]).up, Up::NegZ, "as the remedies of the reader name it");
    assert_eq!(of(&["--up", "+x"]).up, Up::X);
    let read = of(&["--masks", "ignore", "--encoding", "linear"]);
    assert_eq!((read.masks, read.encoding), (MaskUse::Ignore, ColourEncoding::Linear));
}

#[test]
fn a_settings_file_of_another_form_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("settings.toml");
    let of = |text: &str| {
        patina::files::write_bytes(&file, text.as_bytes()).unwrap();
        let words = ["patina", "fit", "scene", "-o", "run", "--settings", file.to_str().unwrap()];
        let Some(Task::Fit(options)) = Arguments::try_parse_from(words).unwrap().task else { unreachable!() };
        run_settings(&options)
    };
    // As `bench fit` and `demo` read it: without sections it would set nothing here.
    for (text, line) in [("map-size = 512\n", 1), ("[read]\n[Fit]\n", 2), ("[atlas]\nkep_uv = \"keep\"\n", 2)] {
        let error = of(text).unwrap_err();
        assert_eq!(error.place(), &Place::Line(file.clone(), line), "{error}");
        assert!(error.remedy_text().contains("[fit]"), "{error}");
    }
    assert_eq!(of("[fit]\nmap-size = 512\n").unwrap().settings.fit.map_size, 512);
}

#[test]
fn photos_are_given_to_the_solver_unless_something_else_was_asked_for() {
    let linear = super::support::scene().0;
    let mut bytes = Scene::clone(&linear);
    let size = (bytes.views[0].photo.width(), bytes.views[0].photo.height());
    bytes.views[0].photo = Photo::Srgb8(Image::filled(size.0, size.1, [90; 3]));
    let of = |scene: &Scene, more: &[&str]| suited(scene, None, more).method;
    assert_eq!(of(&linear, &[]), Method::Solver);
    assert_eq!(of(&linear, &["--light-smoothness", "0.1"]), Method::Adam, "the solver has a wish of its own");
    assert_eq!(of(&linear, &["--map-size", "64", "--preset", "careful"]), Method::Solver);
    assert_eq!(of(&linear, &["--method", "paper"]), Method::Adam);
    assert_eq!(of(&linear, &["--consistency", "exact"]), Method::Adam, "the solver knows no consistency");
    assert_eq!(of(&bytes, &[]), Method::Solver);
    assert_eq!(of(&bytes, &["--method", "paper"]), Method::Adam);
    assert_eq!(of(&bytes, &["--samples", "8"]), Method::Adam, "paths a pixel are Adam's");
    let solved = |scene: &Scene, more: &[&str]| {
        let settings = suited(scene, None, &[&["--method", "solver"], more].concat());
        (settings.solver_refine, settings.solver_levels, settings.solver_grid)
    };
    assert_eq!((solved(&linear, &[]), solved(&bytes, &[])), ((1, 2, 256), (1, 2, 256)), "alike");
    assert_eq!(solved(&bytes, &["--solver-refine", "0"]), (0, 2, 256));
    assert_eq!(solved(&bytes, &["--solver-levels", "1"]), (1, 1, 256));
    assert_eq!(solved(&bytes, &["--solver-grid", "128"]), (1, 2, 128));

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("settings.toml");
    let of_file = |scene: &Scene, text: &str, more: &[&str]| {
        patina::files::write_bytes(&file, text.as_bytes()).unwrap();
        suited(scene, None, &[&["--settings", file.to_str().unwrap()], more].concat())
    };
    assert_eq!(of_file(&linear, "[fit]\nseed = 2\n", &[]).method, Method::Solver, "a file without a method");
    assert_eq!(of_file(&linear, "[fit]\nsamples = 8\n", &[]).method, Method::Adam, "its setting is Adam's");
    assert_eq!(of_file(&linear, "[fit]\nmethod = \"paper\"\n", &[]).method, Method::Adam, "an older file");
    assert_eq!(of_file(&linear, "[fit]\nmethod = \"solver\"\nsamples = 8\n", &[]).method, Method::Solver);
    assert_eq!(of_file(&linear, "[fit]\nseed = 2\n", &["--method", "adam"]).method, Method::Adam);
    // The settings of a run hold everything: what was run is run again, whatever would suit.
    let run = RunSettings { fit: FitSettings { method: Method::Adam, ..FitSettings::default() }, ..Default::default() };
    assert_eq!(of_file(&bytes, &toml::to_string(&run).unwrap(), &[]), run.fit);
}

#[test]
fn maps_hold_what_the_photos_resolve_unless_a_size_was_asked_for() {
    let scene = super::support::scene().0;
    let of = |more: &[&str]| suited(&scene, Some(100_000.0), more).map_size;
    assert_eq!(of(&[]), 512);
    assert_eq!(of(&["--map-size", "2048"]), 2048, "the default, but typed");
    assert_eq!(of(&["--preset", "quick"]), 512);
    assert_eq!(suited(&scene, Some(10_000.0), &["--preset", "quick"]).map_size, 256);
    assert_eq!(suited(&scene, Some(1e9), &["--preset", "quick"]).map_size, 512);
    assert_eq!(suited(&scene, None, &[]).map_size, 2048);
}

/// The settings of a line for a scene of which photos resolve so many texels.
fn suited(scene: &Scene, texels_resolved: Option<f64>, more: &[&str]) -> FitSettings {
    let words = ["patina", "fit", "scene", "-o", "run"].iter().chain(more);
    let Some(Task::Fit(options)) = Arguments::try_parse_from(words).unwrap().task else { unreachable!() };
    let mut opened = OpenedScene { scene: scene.clone(), report: Default::default(), timings: Vec::new() };
    opened.report.texels_resolved = texels_resolved;
    let mut asked = run_settings(&options).unwrap();
    opened.resolve(&mut asked.settings.fit, &asked.chosen);
    asked.settings.fit
}
