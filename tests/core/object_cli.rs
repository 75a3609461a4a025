//! `patina object`, from the command line: what it leaves behind, and what it says of mistakes.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use patina::files::write_bytes;
use patina::image::{Image, RgbImage, file};
use patina::light::Environment;
use patina::measured::{HalfDifference, MeasuredBrdf};
use patina::object::ObjectGeometry;
use patina::object::picture::{log_errors, render_exact};
use patina::object::progress::read_rows;
use patina::object::read::{ObjectFiles, read_views};
use patina::object::result_read;
use patina::object::settings::ObjectSettings;
use patina::object::starts::ModelKind;
use patina::object::transport::TexelDirections;
use patina::scene::{Camera, Mesh};
use std::path::{Path, PathBuf};
use std::process::Output;

/// Reflectance of the objects in 1/sr, everywhere and in all channels: a matt grey.
const GREY: f64 = 0.5 / std::f64::consts::PI;
/// Side of the photo of the sphere in pixels.
const SIZE: usize = 24;
/// Radius in pixels of the ball that does not fill its photo; its mask is white there.
const MASK_RADIUS: f32 = 10.0;

fn patina(arguments: &[&str]) -> Output {
    super::program::patina().arg("object").args(arguments).output().unwrap()
}

/// Runs a command that must succeed.
fn done(arguments: &[&str]) {
    let output = patina(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A sky with a soft sun over a floor, of the size of a light that is fitted quickly: nothing is lost on the way there.
fn sky(sun_column: f32) -> Environment {
    let radiance = Image::from_fn(64, 32, |row, column| {
        let sun = (-((row as f32 - 9.0).powi(2) + (column as f32 - sun_column).powi(2)) / 6.0).exp();
        let base = if row < 16 { Vec3::new(0.5, 0.7, 1.0) } else { Vec3::new(0.25, 0.2, 0.15) };
        base + sun * Vec3::new(30.0, 27.0, 22.0)
    });
    Environment { radiance }
}

fn photograph(geometry: &ObjectGeometry, light: &Environment) -> RgbImage {
    let directions = TexelDirections::of_any_size(light.width(), light.height());
    let visibility = geometry.visibility(&geometry.pixels, light.width(), light.height());
    let evaluate = |_: &[HalfDifference], values: &mut [[f64; 3]]| values.fill([GREY; 3]);
    render_exact(geometry, visibility.as_ref(), &directions, &evaluate, &[light]).swap_remove(0)
}

fn is_in_mask(row: usize, column: usize) -> bool {
    let offset = |place: usize| place as f32 + 0.5 - 0.5 * SIZE as f32;
    offset(row).hypot(offset(column)) < MASK_RADIUS
}

fn write_mask(path: &Path, size: usize) {
    let mask = Image::from_fn(size, size, |row, column| if is_in_mask(row, column) { [255u8; 3] } else { [0; 3] });
    file::write_png_srgb8(path, &mask).unwrap();
}

/// Paths in a folder as text, for arguments.
fn text(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().into()
}

/// Writes the photo of a grey sphere and its light.
fn write_sphere(folder: &Path) -> RgbImage {
    let photo = photograph(&ObjectGeometry::sphere(SIZE, SIZE, 0.5 * SIZE as f32), &sky(28.0));
    file::write_exr_rgb(&folder.join("sphere.exr"), &photo).unwrap();
    sky(28.0).write(&folder.join("noon.exr")).unwrap();
    photo
}

#[test]
fn a_sphere_under_a_known_light_leaves_a_whole_result_behind() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| text(folder.path(), name);
    write_sphere(folder.path());
    let mut geometry = ObjectGeometry::sphere(SIZE, SIZE, MASK_RADIUS);
    let photo = photograph(&geometry, &sky(28.0));
    // A mask of so few pixels tells its circle to a tenth of a pixel: the rim is not judged.
    geometry.pixels.retain(|pixel| pixel.normal.z > 0.3);
    file::write_exr_rgb(&folder.path().join("ball.exr"), &photo).unwrap();
    write_mask(&folder.path().join("mask.png"), SIZE);
    sky(40.0).write(&folder.path().join("evening.exr")).unwrap();
    let output = path("run");
    done(&[
        path("ball.exr").as_str(),
        "--sphere",
        "--mask",
        &path("mask.png"),
        "--env",
        &path("noon.exr"),
        "--model",
        "cook-torrance",
        "--quick",
        "--relight",
        &path("evening.exr"),
        "-o",
        &output,
    ]);

    let run = PathBuf::from(&output);
    let result = result_read::read(&run).unwrap();
    assert_eq!(result.settings, ObjectSettings::quick());
    assert_eq!(result.inputs.model, ModelKind::CookTorrance);
    assert_eq!(result.inputs.light, Some(folder.path().join("noon.exr")));
    assert_eq!(result.inputs.files.photos, [folder.path().join("ball.exr")]);
    assert_eq!(result.inputs.files.masks, [folder.path().join("mask.png")]);
    assert!(result.estimate.picture_log_rmse < 0.1, "{}", result.estimate.picture_log_rmse);
    assert!(!result.followed.is_empty());
    let rows = read_rows(&run.join("loss.csv")).unwrap();
    assert!(!rows.is_empty() && rows.iter().all(|row| row.total().is_finite() && row.not_finite == 0));

    // The light that was known is the light of the result.
    let (light, findings) = Environment::read(&run.join("env.exr")).unwrap();
    assert!(findings.is_empty() && (light.width(), light.height()) == (64, 32));
    for (own, known) in light.radiance.pixels().iter().zip(sky(28.0).radiance.pixels()) {
        assert!((*own - *known).abs().max_element() < 1e-3 * known.max_element(), "{own} {known}");
    }
    // A sphere before a camera sees nearly all of the light; the known light says what each direction matters.
    let seen = result.estimate.light_seen.as_ref().unwrap();
    assert_eq!((seen.sensitivity.width(), seen.sensitivity.height()), (64, 32));
    assert!(seen.sensitivity.pixels().iter().all(|texel| texel.is_finite() && texel.min_element() >= 0.0));
    assert!((0.0..0.4).contains(&seen.unseen_share), "{}", seen.unseen_share);
    // The reflectance is the grey one, at angles that the photo shows.
    let table = MeasuredBrdf::read(&run.join("reflectance.binary")).unwrap();
    for (theta_half, theta_difference) in [(0.3, 0.6), (0.6, 0.4), (0.2, 0.9)] {
        let found = table.lookup(HalfDifference { theta_half, theta_difference, phi_difference: 1.0 }).unwrap();
        assert!(found.iter().all(|value| (value / GREY).ln().abs() < 0.3), "{found:?} for {GREY}");
    }

    // Re-render and relit picture show what the mask allows, as bright as it is.
    let rerender = file::read_rgb(&run.join("rerender_0.exr")).unwrap();
    let relit = file::read_rgb(&run.join("relit_0_evening.exr")).unwrap();
    for (picture, truth) in [(&rerender, &photo), (&relit, &photograph(&geometry, &sky(40.0)))] {
        assert_eq!((picture.width(), picture.height()), (SIZE, SIZE));
        let (raw, _) = log_errors(&geometry, picture, truth, 1e-3);
        assert!(raw < 0.15, "{raw}");
        assert!(!is_in_mask(12, 1) && picture[(12, 1)] == Vec3::ZERO);
    }
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("re-render") && page.contains("under evening") && page.contains("</html>"));

    // A folder of an earlier estimation is taken again, here without the other light.
    let (sphere, noon) = (path("sphere.exr"), path("noon.exr"));
    done(&[sphere.as_str(), "--sphere", "--env", &noon, "--model", "ward", "--quick", "-o", &output]);
    let result = result_read::read(&run).unwrap();
    assert_eq!((result.inputs.model, result.inputs.files.masks.len()), (ModelKind::Ward, 0));
}

#[test]
fn a_mesh_and_its_camera_are_taken_in_place_of_a_sphere() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| text(folder.path(), name);
    // An octahedron: its corners are shared, so its normals turn smoothly.
    let positions = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mesh = Mesh { positions, triangles, ..Mesh::default() };
    let corners: String = mesh.positions.iter().map(|at| format!("v {} {} {}\n", at.x, at.y, at.z)).collect();
    // OBJ counts from 1.
    let faces: String = mesh.triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)).collect();
    write_bytes(&folder.path().join("object.obj"), format!("{corners}{faces}").as_bytes()).unwrap();

    let camera = Camera::looking_at(Vec3::new(0.4, 0.5, 3.0), Vec3::ZERO, 32, 32, 0.75);
    let row = |index: usize| {
        let axis = camera.rotation_camera_from_world.row(index);
        [axis.x, axis.y, axis.z, camera.translation_camera_from_world[index]]
    };
    let (focal, centre) = (camera.focal_pixels, camera.centre_pixels);
    let cameras = serde_json::json!({ "convention": "opencv", "views": [{
        "file": "photo.exr", "width": camera.width, "height": camera.height,
        "K": [[focal.x, 0.0, centre.x], [0.0, focal.y, centre.y], [0.0, 0.0, 1.0]],
        "w2c": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
    }] });
    write_bytes(&folder.path().join("cameras.json"), cameras.to_string().as_bytes()).unwrap();

    let geometry = ObjectGeometry::of_mesh(&mesh, &camera).unwrap();
    let photo = photograph(&geometry, &sky(28.0));
    file::write_exr_rgb(&folder.path().join("photo.exr"), &photo).unwrap();
    sky(28.0).write(&folder.path().join("noon.exr")).unwrap();
    let (photo_path, light_path, output) = (path("photo.exr"), path("noon.exr"), path("run"));
    let (mesh_path, cameras_path) = (path("object.obj"), path("cameras.json"));
    let shape = ["--mesh", &mesh_path, "--camera", &cameras_path, "--up", "Y"];
    let rest = ["--env", &light_path, "--model", "cook-torrance", "--quick", "-o", &output];
    done(&[&[photo_path.as_str()][..], &shape[..], &rest[..]].concat());
    let rerender = file::read_rgb(&folder.path().join("run/rerender_0.exr")).unwrap();
    let (raw, _) = log_errors(&geometry, &rerender, &photo, 1e-3);
    assert!(raw < 0.15, "{raw}");
    assert!(result_read::is_result(&folder.path().join("run")));
}

/// Names and bytes of the files in a folder.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<(PathBuf, Vec<u8>)> = entries
        .map(|path| {
            let bytes = std::fs::read(&path).unwrap();
            (path, bytes)
        })
        .collect();
    files.sort();
    files
}

/// Reads photos as of a ball, and returns the codes of what was noticed with the number of pixels.
fn noticed(photo: &Path, mask: Option<&Path>) -> (Vec<&'static str>, usize) {
    let files = ObjectFiles {
        photos: vec![photo.into()],
        masks: mask.map(PathBuf::from).into_iter().collect(),
        ..ObjectFiles::default()
    };
    let (views, findings) = read_views(&files).unwrap();
    (findings.iter().map(|finding| finding.code).collect(), views[0].geometry.pixels.len())
}

#[test]
fn a_ball_is_where_its_mask_is_and_what_is_no_ball_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let size = 96;
    let at = |x: f32, y: f32, radius: f32| ObjectGeometry::sphere_at(size, size, glam::Vec2::new(x, y), radius);
    let write = |name: &str, geometry: &ObjectGeometry| {
        let path = folder.path().join(name);
        let mut picture = Image::filled(size, size, Vec3::ZERO);
        for pixel in &geometry.with_grazing().pixels {
            picture[(pixel.row as usize, pixel.column as usize)] = Vec3::splat(0.2 + 0.5 * pixel.normal.y.max(0.0));
        }
        file::write_exr_rgb(&path, &picture).unwrap();
        path
    };
    let mask = |name: &str, inside: &dyn Fn(f32, f32) -> bool| {
        let path = folder.path().join(name);
        let value = |row: usize, column: usize| [255 * u8::from(inside(column as f32 + 0.5, row as f32 + 0.5)); 3];
        file::write_png_srgb8(&path, &Image::from_fn(size, size, value)).unwrap();
        path
    };
    let filling = write("filling.exr", &at(48.0, 48.0, 48.0));
    let aside = write("aside.exr", &at(60.0, 40.0, 30.0));
    let round = mask("round.png", &|x, y| (x - 60.0).hypot(y - 40.0) < 30.0);
    let square = mask("square.png", &|x, y| (x - 48.0).abs() < 30.0 && (y - 48.0).abs() < 30.0);
    assert_eq!(noticed(&filling, None).0, [""; 0]);
    let (codes, pixels) = noticed(&aside, Some(&round));
    assert_eq!(codes, ["sphere-from-mask"]);
    assert!(pixels.abs_diff(at(60.0, 40.0, 30.0).pixels.len()) < 60, "{pixels}");
    // Without the mask the photo itself shows that the ball is elsewhere.
    assert_eq!(noticed(&aside, None).0, ["sphere-off-centre"]);
    assert_eq!(noticed(&filling, Some(&square)).0, ["sphere-mask-not-round"]);
}

#[test]
fn mistakes_are_told_with_a_remedy_and_harm_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| text(folder.path(), name);
    write_sphere(folder.path());
    write_mask(&folder.path().join("small.png"), SIZE / 2);
    std::fs::create_dir_all(folder.path().join("thesis")).unwrap();
    write_bytes(&folder.path().join("thesis/chapter.txt"), b"precious").unwrap();
    write_bytes(&folder.path().join("thesis/report.html"), b"precious too").unwrap();
    let thesis = contents(&folder.path().join("thesis"));

    let (photo, nothing, mask) = (path("sphere.exr"), path("nothing.exr"), path("small.png"));
    let (output, theses) = (path("run"), path("thesis"));
    // Before any photo is read: this one does not even exist.
    let odd = patina(&[&nothing, "--sphere", "--light-height", "33", "-o", &output]);
    let odd_text = String::from_utf8_lossy(&odd.stderr).into_owned();
    assert_eq!(odd.status.code(), Some(1), "{odd_text}");
    assert!(odd_text.contains("--light-height") && odd_text.contains("--prior gradient"), "{odd_text}");
    let known = ["--quick", "--model", "cook-torrance"];
    for (arguments, message, remedy) in [
        (vec![nothing.as_str(), "--sphere", "-o", &output], "nothing.exr", "check the path"),
        (
            vec![photo.as_str(), "--sphere", "--mask", &mask, "-o", &output],
            "the mask is 12 x 12 but the photo is 24 x 24",
            "make the mask in the size of the photo",
        ),
        (vec![photo.as_str(), "--sphere", "-o", &theses], "thesis", "name a new or an empty folder with -o"),
    ] {
        let told = patina(&[&arguments[..], &known[..]].concat());
        let told_text = String::from_utf8_lossy(&told.stderr).into_owned();
        assert_eq!(told.status.code(), Some(1), "{arguments:?}: {told_text}");
        assert!(told_text.starts_with("error: ") && !told_text.contains("panicked"), "{arguments:?}: {told_text}");
        assert!(told_text.contains(message) && told_text.contains(remedy), "{arguments:?}: {told_text}");
    }
    assert_eq!(contents(&folder.path().join("thesis")), thesis);
    assert!(!result_read::is_result(&folder.path().join("run")));
}
