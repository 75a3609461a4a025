//! The program as a process among others: pipes that close, disks that are full, folders that are shared, signals.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::scene_fixture::*;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

fn patina() -> Command {
    super::program::patina()
}

/// Options of a fit that takes a moment.
const SHORT: [&str; 8] = ["--map-size", "128", "--method", "adam", "--steps-diffuse", "2", "--steps-all", "2"];

fn write_scene(folder: &Path) {
    write_blended_mvs(folder, &scene(4), &FolderStyle::default());
}

#[test]
fn a_pipe_that_closes_or_a_full_disk_ends_no_fit() {
    let (_keep, folder) = folder();
    let scene = folder.join("scene");
    write_scene(&scene);
    for (name, full) in [("closed", false), ("full", true)] {
        let run = folder.join(name);
        let mut command = patina();
        command.args(["--json", "fit"]).arg(&scene).arg("-o").arg(&run).args(SHORT).stderr(Stdio::piped());
        if full {
            command.stdout(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
        } else {
            command.stdout(Stdio::piped());
        }
        let mut fit = command.spawn().unwrap();
        if !full {
            let mut line = String::new();
            BufReader::new(fit.stdout.take().unwrap()).read_line(&mut line).unwrap();
            assert!(line.contains("event"), "{line}");
        }
        let mut words = String::new();
        fit.stderr.take().unwrap().read_to_string(&mut words).unwrap();
        assert!(fit.wait().unwrap().success(), "{name}: {words}");
        assert!(!words.contains("panicked"), "{words}");
        assert!(run.join("report.html").is_file() && run.join("diffuse.exr").is_file());
    }
    let mut check = patina().arg("check").arg(&scene).stdout(Stdio::piped()).spawn().unwrap();
    drop(check.stdout.take());
    assert_eq!(check.wait().unwrap().code(), Some(0));
}

#[test]
fn two_fits_do_not_share_a_folder() {
    let (_keep, folder) = folder();
    let (scene, run) = (folder.join("scene"), folder.join("run"));
    write_scene(&scene);
    // Many steps: it runs until it is stopped.
    let long = ["--map-size", "128", "--method", "adam", "--steps-diffuse", "100000"];
    let mut first = patina()
        .args(["--json", "fit"])
        .arg(&scene)
        .arg("-o")
        .arg(&run)
        .args(long)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(first.stdout.take().unwrap()).lines();
    while !lines.next().unwrap().unwrap().contains("\"started\"") {}
    let before = std::fs::read(run.join("mesh.obj")).unwrap();
    let second = patina().arg("fit").arg(&scene).arg("-o").arg(&run).args(SHORT).output().unwrap();
    let words = String::from_utf8_lossy(&second.stderr).into_owned();
    assert_eq!(second.status.code(), Some(1), "{words}");
    assert!(words.contains(&format!("process {}", first.id())), "{words}");
    assert_eq!(std::fs::read(run.join("mesh.obj")).unwrap(), before);
    let resumed = patina().arg("resume").arg(&run).output().unwrap();
    assert!(String::from_utf8_lossy(&resumed.stderr).contains("another fit works"), "{resumed:?}");
    // Killed, it holds nothing any more.
    first.kill().unwrap();
    first.wait().unwrap();
    let third = patina().arg("fit").arg(&scene).arg("-o").arg(&run).args(SHORT).output().unwrap();
    assert!(third.status.success(), "{}", String::from_utf8_lossy(&third.stderr));
}

#[test]
fn a_fit_that_is_killed_at_its_start_leaves_no_checkpoint_of_another_mesh() {
    let (_keep, folder) = folder();
    let run = patina::export::RunFolder::create(&folder.join("run")).unwrap();
    std::fs::write(run.checkpoint_path(), "of another fit").unwrap();
    run.remove_checkpoint().unwrap();
    assert!(!run.checkpoint_path().exists());
    run.remove_checkpoint().unwrap();
}

#[test]
fn more_threads_than_processors_are_told_and_refused_threads_are_an_error() {
    let (_keep, folder) = folder();
    write_scene(&folder);
    let many = patina().args(["--threads", "100000", "check"]).arg(&folder).output().unwrap();
    let words = String::from_utf8_lossy(&many.stderr).into_owned();
    assert!(many.status.success() && words.contains("threads-clamped"), "{words}");
    // Too little address space for a thread's stack.
    let limited = Command::new("sh")
        .args(["-c", "ulimit -v 120000; exec \"$0\" --threads 4000 check \"$1\""])
        .arg(super::program::patina().get_program())
        .arg(&folder)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&limited.stderr).into_owned();
    assert!(!words.contains("panicked"), "{words}");
}

#[test]
fn pictures_of_a_check_do_not_go_among_the_photos() {
    let (_keep, folder) = folder();
    write_scene(&folder);
    for place in ["blended_images", "masks", "cams/../blended_images"] {
        let check = patina().arg("check").arg(&folder).arg("-o").arg(folder.join(place)).output().unwrap();
        let words = String::from_utf8_lossy(&check.stderr).into_owned();
        assert!(check.status.code() == Some(1) && words.contains("photos or masks"), "{place}: {words}");
    }
    let check = patina().arg("check").arg(&folder).arg("-o").arg(folder.join("outlines")).output().unwrap();
    assert!(check.status.success() && folder.join("outlines/00000000_outline.png").is_file());
}

#[test]
fn a_stop_is_heard_while_a_scene_is_opened() {
    let (_keep, folder) = folder();
    let (scene, run) = (folder.join("scene"), folder.join("run"));
    write_scene(&scene);
    // A large mesh: reading it and making its atlas take long enough to be stopped in.
    let side = 400u32;
    let mut mesh = String::new();
    for row in 0..side {
        for column in 0..side {
            let height = f64::from(row * 7919 % 101 + column * 104_729 % 97) * 1e-3;
            mesh += &format!("v {} {height} {}\n", f64::from(column) * 0.02 - 4.0, f64::from(row) * 0.02 - 4.0);
            if row > 0 && column > 0 {
                let v = row * side + column + 1;
                mesh += &format!("f {} {} {v}\nf {} {v} {}\n", v - side - 1, v - 1, v - side - 1, v - side);
            }
        }
    }
    for file in std::fs::read_dir(scene.join("textured_mesh")).unwrap() {
        std::fs::remove_file(file.unwrap().path()).unwrap();
    }
    std::fs::write(scene.join("textured_mesh/mesh.obj"), mesh).unwrap();
    let mut fit = patina().arg("fit").arg(&scene).arg("-o").arg(&run).stderr(Stdio::null()).spawn().unwrap();
    // The run folder is made first; then the scene is read, checked and cut into charts.
    while !run.join("convention.txt").is_file() {
        std::thread::sleep(Duration::from_millis(10));
    }
    Command::new("kill").arg(fit.id().to_string()).status().unwrap();
    assert_eq!(fit.wait().unwrap().code(), Some(3));
    assert!(!run.join("checkpoint").exists(), "it was stopped while it was opened");
}

#[test]
fn a_map_too_small_for_its_charts_names_the_option_and_white_photos_are_an_error() {
    let (_keep, folder) = folder();
    let (scene, run) = (folder.join("scene"), folder.join("run"));
    write_scene(&scene);
    // Hundreds of loose triangles: each is a chart.
    let mut mesh = String::new();
    for index in 0..900 {
        let (x, z) = (f64::from(index % 30) * 0.1 - 1.5, f64::from(index / 30) * 0.1 - 1.5);
        mesh += &format!("v {x} 0 {z}\nv {} 0 {}\nv {x} 0.05 {}\nf -3 -2 -1\n", x + 0.06, z + 0.01, z + 0.05);
    }
    for file in std::fs::read_dir(scene.join("textured_mesh")).unwrap() {
        std::fs::remove_file(file.unwrap().path()).unwrap();
    }
    std::fs::write(scene.join("textured_mesh/mesh.obj"), mesh).unwrap();
    let fit = patina()
        .arg("fit")
        .arg(&scene)
        .args(["--masks", "ignore", "--map-size", "64", "-o"])
        .arg(&run)
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&fit.stderr).into_owned();
    assert!(fit.status.code() == Some(1) && words.contains("--map-size"), "{words}");
    assert!(!words.contains("--resolution") && !words.contains("gutter"), "{words}");

    let white = patina::image::Image::filled(SIZE.0, SIZE.1, [255u8; 3]);
    for file in std::fs::read_dir(scene.join("blended_images")).unwrap() {
        patina::image::file::write_png_srgb8(&file.unwrap().path(), &white).unwrap();
    }
    let check = patina().arg("check").arg(&scene).output().unwrap();
    let words = String::from_utf8_lossy(&check.stdout).into_owned();
    assert!(check.status.code() == Some(1) && words.contains("fatal [photo-white]"), "{words}");
}
