//! Other programs, started on the scripts of `tests/proof`. Each gets a file of what to do and leaves pictures beside the case.

use super::cases::{Case, GROUPS, Noisy};
use super::table::Judged;
use super::{BOUNCES, ProofOptions, ProofView};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::write_bytes;
use crate::image::{Image, file};
use crate::lab::other_programs::{self, Remedies};
use glam::Vec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The page is drawn so many times larger and averaged: a pixel is then the mean over its area, as a traced one is.
const PAGE_SCALE: usize = 4;

/// A camera as scripts read it: `K` and `w2c` in OpenCV's convention.
fn camera_of(view: &ProofView) -> Value {
    let camera = &view.camera;
    let (focal, centre) = (camera.focal_pixels, camera.centre_pixels);
    let rotation = camera.rotation_camera_from_world;
    let translation = camera.translation_camera_from_world;
    let row = |row: usize| {
        let axis = rotation.row(row);
        [axis.x, axis.y, axis.z, translation[row]]
    };
    json!({
        "name": view.name, "width": camera.width, "height": camera.height,
        "K": [[focal.x, 0.0, centre.x], [0.0, focal.y, centre.y], [0.0, 0.0, 1.0]],
        "w2c": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
    })
}

/// What to do about a program.
const REMEDIES: Remedies = Remedies {
    unstarted: "name it with --python, --node or --browser, or leave it out with --only",
    failed: "install what tests/proof/README.md names, or leave the program out with --only",
};

/// Starts a script of the proof on a job.
fn script(options: &ProofOptions, name: &str, arguments: &[&Path]) -> Result<String> {
    let mut command = other_programs::script(&options.python, &options.scripts, name)?;
    other_programs::output_of(command.args(arguments), REMEDIES)
}

/// Starts a program and gives what it prints.
fn output_of(command: &mut Command) -> Result<String> {
    other_programs::output_of(command, REMEDIES)
}

/// Writes a job and starts a script on it.
fn start(options: &ProofOptions, name: &str, views: &[ProofView], tasks: Vec<Value>) -> Result<()> {
    let views: Vec<Value> = views.iter().map(camera_of).collect();
    // Depth counts as Mitsuba's: 2 is direct light.
    let job = json!({"depth": BOUNCES + 1, "views": views, "tasks": tasks});
    let path = options.output.join(format!("{name}.json"));
    write_bytes(&path, job.to_string().as_bytes())?;
    script(options, &format!("{name}.py"), &[&path]).map(|_| ())
}

/// Renders both scenes of each export in Mitsuba.
pub fn mitsuba(options: &ProofOptions, cases: &[Case], views: &[ProofView]) -> Result<()> {
    let mut tasks = Vec::new();
    for case in cases {
        for (scene, program) in [("scene.xml", "mitsuba_built_in"), ("scene_exact.xml", "mitsuba_exact")] {
            tasks.push(json!({
                "scene": case.export("mitsuba").join(scene), "out": case.stem(program),
                "samples": options.samples / GROUPS, "repeats": GROUPS,
            }));
        }
    }
    start(options, "in_mitsuba", views, tasks)
}

/// Imports each export into Blender in every way and renders it with Cycles.
pub fn blender(options: &ProofOptions, cases: &[Case], views: &[ProofView]) -> Result<()> {
    let mut tasks = Vec::new();
    for case in cases {
        for kind in case.blender_kinds() {
            let folder = match kind {
                "glb_sun" => "glb",
                "script" => "blender",
                other => other,
            };
            tasks.push(json!({
                "kind": kind, "folder": case.export(folder), "out": case.stem(&format!("cycles_{kind}")),
                "samples": options.samples / 2, "repeats": 2,
            }));
        }
    }
    start(options, "in_blender", views, tasks)
}

/// Has the checkers of glTF, USD and MaterialX judge an export.
pub fn check_files(options: &ProofOptions, case: &Case, judged: &mut Judged) -> Result<()> {
    let export = case.folder.join("export");
    let read = |text: String| -> Result<Value> {
        serde_json::from_str(text.lines().last().unwrap_or_default()).map_err(|source| {
            Error::new(ErrorKind::Malformed, format!("a checker's answer is not understood: {source}"))
        })
    };
    let usd = read(script(options, "check_files.py", &[Path::new("usd"), &export])?)?;
    for (name, found) in usd.as_object().into_iter().flatten() {
        let mut errors: Vec<String> =
            found["errors"].as_array().into_iter().flatten().map(|error| error.to_string()).collect();
        if found["bound"] != true || found["dome_lights"] != 1 {
            errors.push(format!("material bound: {}, dome lights: {}", found["bound"], found["dome_lights"]));
        }
        judged.files(&format!("USD: {name}"), errors);
    }
    let materialx = read(script(options, "check_files.py", &[Path::new("materialx"), &export])?)?;
    let mut errors = Vec::new();
    if materialx["valid"] != true {
        errors.push(materialx["message"].to_string());
    }
    if materialx["glsl_lines"].as_u64().unwrap_or(0) < 100 {
        errors.push("no shader comes of it".into());
    }
    judged.files("MaterialX", errors);
    let Some(node) = &options.node else {
        judged.left_out("gltf-validator", "--node names no folder with it");
        return Ok(());
    };
    let issues = read(output_of(
        Command::new("node").current_dir(node).args(["-e", VALIDATE]).arg(file_of(&case.export("glb"), "glb")?),
    )?)?;
    let messages = issues["messages"].as_array().cloned().unwrap_or_default();
    // 0 is an error, 1 a warning.
    let grave = messages.iter().filter(|message| message["severity"].as_u64().unwrap_or(0) < 2);
    judged.files("gltf-validator", grave.map(|message| message.to_string()).collect());
    Ok(())
}

const VALIDATE: &str = "const v=require('gltf-validator'),fs=require('fs');\
    v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r=>console.log(JSON.stringify(r.issues)))";

/// The file of a folder with an ending.
fn file_of(folder: &Path, extension: &str) -> Result<PathBuf> {
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let found =
        entries.flatten().map(|entry| entry.path()).find(|path| path.extension().is_some_and(|e| e == extension));
    found.ok_or_else(|| Error::new(ErrorKind::Missing, format!("no .{extension} file")).at(Place::File(folder.into())))
}

/// Pictures of the page from each camera, in linear values; what is brighter than white is white.
pub fn page(options: &ProofOptions, case: &Case, views: &[ProofView]) -> Result<Vec<Noisy>> {
    let page = case.export("web").join("index.html");
    let one = |view: &ProofView| {
        let camera = &view.camera;
        let (width, height) = (camera.width, camera.height);
        let asked = json!({
            "width": width, "height": height, "focal": camera.focal_pixels.to_array(),
            "centre": camera.centre_pixels.to_array(),
            "rotation": camera.rotation_camera_from_world.to_cols_array(),
            "translation": camera.translation_camera_from_world.to_array(),
        });
        let path = case.folder.join(format!("page_{}.png", view.name));
        // No text of a number or a name needs more than these.
        let fragment = asked.to_string().replace('"', "%22").replace('{', "%7B").replace('}', "%7D");
        let address = format!("file://{}#bare=1&backdrop=0&light=0&camera={fragment}", page.display());
        output_of(Command::new(&options.browser).args([
            "--headless",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--hide-scrollbars",
            "--force-device-scale-factor=1",
            "--virtual-time-budget=30000",
            &format!("--window-size={},{}", PAGE_SCALE * width, PAGE_SCALE * height),
            &format!("--screenshot={}", path.display()),
            &address,
        ]))?;
        let shot = file::read_rgb(&path)?;
        if shot.width() < PAGE_SCALE * width || shot.height() < PAGE_SCALE * height {
            return Err(Error::new(ErrorKind::Malformed, "the browser's picture is smaller than its window")
                .at(Place::File(path)));
        }
        let mean = Image::from_fn(width, height, |row, column| {
            let part =
                |index: usize| shot[(PAGE_SCALE * row + index / PAGE_SCALE, PAGE_SCALE * column + index % PAGE_SCALE)];
            (0..PAGE_SCALE * PAGE_SCALE).map(part).sum::<Vec3>() / (PAGE_SCALE * PAGE_SCALE) as f32
        });
        Ok(Noisy { mean, variance: None })
    };
    views.iter().map(one).collect()
}
