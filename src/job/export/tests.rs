use super::*;
use crate::export::RunResult;
use crate::image::Image;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::scene::Mesh;
use glam::{Vec2, Vec3};
use std::sync::Mutex;

/// A run folder of one square with maps of 32 texels.
fn run(parent: &Path, with_light: bool, with_lobe: bool) -> PathBuf {
    let path = parent.join("square");
    let folder = RunFolder::create(&path).unwrap();
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        normals: vec![Vec3::Z; 4],
        uvs: vec![Vec2::splat(0.05), Vec2::new(0.95, 0.05), Vec2::splat(0.95), Vec2::new(0.05, 0.95)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let maps = MaterialMaps {
        diffuse: Image::filled(32, 32, Vec3::new(0.5, 0.4, 0.3)),
        specular: Image::filled(32, 32, if with_lobe { Vec3::splat(0.05) } else { Vec3::ZERO }),
        roughness: Image::filled(32, 32, 0.3),
    };
    let environment = Environment::constant(16, 8, Vec3::ONE);
    let times_seen = Image::filled(32, 32, 2.0);
    folder.write_result(&RunResult { maps, environment, mesh, times_seen, lobe: Default::default() }).unwrap();
    let mut settings = RunSettings::default();
    if !with_lobe {
        settings.fit.method = crate::fit::Method::Adam;
        settings.fit.steps_all = 0;
    }
    assert_eq!(settings.fit.has_lobe(), with_lobe);
    folder.write_settings(&settings).unwrap();
    if !with_light {
        std::fs::remove_file(folder.file("env.exr")).unwrap();
    }
    path
}

fn silent(options: &ExportOptions) -> Result<Exported> {
    export(options, &AtomicBool::new(false), &|_| {})
}

#[test]
fn every_format_gets_its_folder_and_its_sheet() {
    let parent = tempfile::tempdir().unwrap();
    let output = parent.path().join("out");
    let options = ExportOptions { size: Some(16), ..ExportOptions::new(&run(parent.path(), true, true), &output) };
    let told = Mutex::new(Vec::new());
    let exported = export(&options, &AtomicBool::new(false), &|event| told.lock().unwrap().push(event)).unwrap();
    let told = told.into_inner().unwrap();
    assert!(matches!(&told[0], ExportEvent::Forecast(forecast) if forecast.texels == (16, 16)), "memory is told first");
    assert_eq!(told.iter().filter(|event| matches!(event, ExportEvent::Written(_))).count(), Format::ALL.len());
    for format in Format::ALL {
        let sheet = std::fs::read_to_string(output.join(format.name()).join("convention.txt")).unwrap();
        assert!(sheet.contains("WHAT WAS LOST"), "{sheet}");
        assert_eq!(sheet.contains("GGX"), format != Format::Web, "{sheet}");
    }
    assert_eq!(exported.losses.len(), Format::ALL.len());
    let base = file::read_rgb(&output.join("textures/square_BaseColor.png")).unwrap();
    assert_eq!(base.width(), 16);
    assert!((base[(3, 3)] - Vec3::new(0.5, 0.4, 0.3)).length() < 1e-3);
    // Again: replaced, not refused.
    silent(&options).unwrap();
}

#[test]
fn runs_without_light_or_lobe_are_exported_and_told() {
    let parent = tempfile::tempdir().unwrap();
    let output = parent.path().join("out");
    let options = ExportOptions::new(&run(parent.path(), false, false), &output);
    let exported = silent(&options).unwrap();
    assert_eq!(exported.findings.iter().map(|finding| finding.code).collect::<Vec<_>>(), ["export-without-light"]);
    assert!(!output.join("glb/environment.exr").exists() && output.join("glb/square.glb").is_file());
    assert!(std::fs::read_to_string(output.join("mitsuba/scene.xml")).unwrap().contains("type=\"diffuse\""));
    assert!(forecast(&options).unwrap().losses.is_empty());
}

#[test]
fn a_lobe_that_travels_loses_nothing_on_the_way() {
    let parent = tempfile::tempdir().unwrap();
    let path = run(parent.path(), true, true);
    let folder = RunFolder::open(&path).unwrap();
    let mut settings: RunSettings = folder.read_settings().unwrap();
    settings.fit.lobe = LobeModel::Ggx;
    folder.write_settings(&settings).unwrap();
    assert_eq!(folder.read_result().unwrap().lobe, LobeModel::Ggx);
    let output = parent.path().join("out");
    let options =
        ExportOptions { formats: vec![Format::Mitsuba, Format::Blender], ..ExportOptions::new(&path, &output) };
    assert!(forecast(&options).unwrap().losses.iter().all(|(_, text)| !text.contains("nearest GGX")));
    silent(&options).unwrap();
    assert!(std::fs::read_to_string(output.join("mitsuba/scene_exact.xml")).unwrap().contains("value=\"ggx\""));
    // Roughness r = a^2 is written as sqrt(a).
    let roughness = file::read_grey(&output.join("blender/roughness.exr")).unwrap();
    assert!((roughness[(9, 9)] - 0.3f32.powf(0.25)).abs() < 1e-6);
    // What is proven of a format stands in its sheet.
    let own = std::fs::read_to_string(output.join("blender/convention.txt")).unwrap();
    assert!(own.contains("\nPROOF\n") && own.contains("of the mean off"), "{own}");
    let sheet = std::fs::read_to_string(output.join("convention.txt")).unwrap();
    assert!(sheet.contains("D  GGX") && !sheet.contains("Blinn-Phong"), "{sheet}");
    // A name that no version knows is told, not guessed.
    write_bytes(&folder.file("settings.toml"), b"[fit]\nlobe = \"cook\"\n").unwrap();
    assert!(matches!(folder.read_result().unwrap_err().place(), Place::Line(_, 2)));
}

#[test]
fn memory_is_told_before_maps_of_4096_are_made() {
    let parent = tempfile::tempdir().unwrap();
    let path = run(parent.path(), true, true);
    let small = forecast(&ExportOptions::new(&path, Path::new("out"))).unwrap();
    let large = forecast(&ExportOptions { size: Some(4096), ..ExportOptions::new(&path, Path::new("out")) }).unwrap();
    assert_eq!(large.texels, (4096, 4096));
    assert!(large.peak_bytes > 1 << 30 && large.peak_bytes < 4 << 30, "{large:?}");
    assert!(small.peak_bytes < 1 << 20 && large.largest_disk_bytes > small.largest_disk_bytes);
    assert!(large.losses.iter().any(|(format, text)| *format == Format::Glb && text.contains("GGX")));
}

#[test]
fn what_cannot_be_written_is_an_error_with_place_and_remedy_and_leaves_nothing() {
    let parent = tempfile::tempdir().unwrap();
    let path = run(parent.path(), true, true);
    // A file where a folder is needed cannot be written into, whoever asks.
    let file = parent.path().join("file");
    write_bytes(&file, b"mine").unwrap();
    let output = file.join("out");
    let error = silent(&ExportOptions::new(&path, &output)).unwrap_err();
    assert_eq!((error.kind(), error.place()), (ErrorKind::Unwritable, &Place::File(output)));
    assert!(error.remedy_text().contains("-o"));
    // Stopped on the way.
    let output = parent.path().join("out");
    let stop = AtomicBool::new(false);
    let error = export(&ExportOptions::new(&path, &output), &stop, &|event| {
        if matches!(event, ExportEvent::Written(_)) {
            stop.store(true, Ordering::Relaxed);
        }
    });
    assert_eq!(error.unwrap_err().kind(), ErrorKind::Stopped);
    let mut names: Vec<_> = std::fs::read_dir(parent.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["file", "square"]);
    // Killed on the way: what is left lies beside, and the next export clears it.
    let left = parent.path().join(".out.unfinished");
    write_bytes(&left.join("glb/half.glb"), b"half").unwrap();
    silent(&ExportOptions { formats: vec![Format::Textures], ..ExportOptions::new(&path, &output) }).unwrap();
    assert!(!left.exists() && output.join("textures/convention.txt").is_file() && !output.join("glb").exists());
    // Settings.
    let options = ExportOptions::new(&path, &output);
    for (wrong, setting) in [
        (ExportOptions { formats: Vec::new(), ..options.clone() }, "to"),
        (ExportOptions { size: Some(3), ..options.clone() }, "size"),
    ] {
        let error = silent(&wrong).unwrap_err();
        assert_eq!(error.place(), &Place::Setting(setting.into()));
    }
    let error = silent(&ExportOptions { run: parent.path().join("none"), ..options }).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Missing);
}
