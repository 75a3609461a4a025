use super::*;
use crate::image::{Image, file};
use crate::scene::settings::MaskUse;

fn folder_with_photos(photos: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for photo in photos {
        let path = folder.path().join(photo);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        file::write_png_srgb8(&path, &Image::filled(40, 30, [90, 100, 110])).unwrap();
    }
    folder
}

/// Camera to world of a camera at (1, 2, 3) that looks along -z with y up: OpenGL's axes are the world's.
const POSE: &str = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]";

#[test]
fn axes_become_opencv_and_frames_win_over_the_top() {
    let folder = folder_with_photos(&["images/a.png", "images/b.png"]);
    let json = format!(
        r#"{{"camera_model":"OPENCV","fl_x":50,"fl_y":51,"cx":20.5,"cy":14.5,"w":40,"h":30,"k1":0.1,"k2":0,"p1":0.01,"p2":0,
        "frames":[{{"file_path":"./images/a.png","transform_matrix":{POSE}}},
        {{"file_path":"images/b","fl_x":60,"fl_y":61,"k1":0,"p1":0,"transform_matrix":{POSE}}}]}}"#
    );
    std::fs::write(folder.path().join("transforms.json"), json).unwrap();
    let scene = read(folder.path()).unwrap();
    let camera = &scene.views[0].camera;
    // A point in front, to the right and above: x right, y up of the world, depth along -z.
    let point = camera.rotation * DVec3::new(1.5, 3.0, 1.0) + camera.translation;
    assert!((point - DVec3::new(0.5, -1.0, 2.0)).length() < 1e-12, "{point}");
    assert!(scene.views[0].lens.is_some() && scene.views[1].lens.is_none());
    assert_eq!(scene.views[1].camera.pinhole().focal_pixels.to_array(), [60.0, 61.0]);
}

#[test]
fn an_applied_transform_is_undone() {
    let folder = folder_with_photos(&["a.png"]);
    // The file's world is the reconstruction's with y and z exchanged and moved, then twice as large.
    let json = r#"{"fl_x":50,"cx":20,"cy":15,"w":40,"h":30,"applied_scale":2,
        "applied_transform":[[1,0,0,0],[0,0,-1,5],[0,1,0,0]],
        "frames":[{"file_path":"a.png","transform_matrix":[[1,0,0,2],[0,0,-1,4],[0,1,0,4],[0,0,0,1]]}]}"#;
    std::fs::write(folder.path().join("transforms.json"), json).unwrap();
    let scene = read(folder.path()).unwrap();
    let camera = &scene.views[0].camera;
    // (2, 4, 4) / 2 = (1, 2, 2) was (x, -z + 5, y): the camera stood at (1, 2, 3), its axes those of the world.
    let position = camera.rotation.transpose() * -camera.translation;
    assert!((position - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12, "{position}");
    assert!((camera.rotation * DVec3::NEG_Z - DVec3::Z).length() < 1e-12);
    assert_eq!(scene.mesh_frames.len(), 1);
}

#[test]
fn splits_hold_out_what_judges() {
    let folder = folder_with_photos(&["train/r_0.png", "train/r_1.png", "test/r_0.png", "val/r_0.png"]);
    for (split, frames) in [("train", 2), ("test", 1), ("val", 1)] {
        let frames: Vec<String> = (0..frames)
            .map(|index| format!(r#"{{"file_path":"./{split}/r_{index}","transform_matrix":{POSE}}}"#))
            .collect();
        let json = format!(r#"{{"camera_angle_x":0.8,"frames":[{}]}}"#, frames.join(","));
        std::fs::write(folder.path().join(format!("transforms_{split}.json")), json).unwrap();
    }
    let scene = read(folder.path()).unwrap();
    let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["train_r_0", "train_r_1", "test_r_0"]);
    assert_eq!(scene.held_out.unwrap(), ["test_r_0"]);
    let focal = scene.views[0].camera.pinhole().focal_pixels.x;
    assert!((focal - 20.0 / 0.4f64.tan()).abs() < 1e-9, "{focal}");
}

#[test]
fn what_is_missing_is_named() {
    let folder = folder_with_photos(&["a.png"]);
    let error_of = |json: &str| {
        std::fs::write(folder.path().join("transforms.json"), json).unwrap();
        read(folder.path()).unwrap_err()
    };
    assert_eq!(error_of("{").kind(), ErrorKind::Malformed);
    assert_eq!(error_of(r#"{"frames":3}"#).kind(), ErrorKind::Malformed);
    let frame = |rest: &str| format!(r#"{{"frames":[{{"file_path":"a.png"{rest}}}]}}"#);
    assert!(error_of(&frame("")).message().contains("transform_matrix"));
    assert!(error_of(&frame(&format!(r#","transform_matrix":{POSE}"#))).message().contains("fl_x"));
    let panorama = format!(r#","fl_x":9,"camera_model":"EQUIRECTANGULAR","transform_matrix":{POSE}"#);
    assert_eq!(error_of(&frame(&panorama)).kind(), ErrorKind::Unsupported);
}

#[test]
fn a_mask_that_is_named_and_missing_is_an_error_unless_masks_are_ignored() {
    let folder = folder_with_photos(&["a.png"]);
    let frame = format!(r#""file_path":"a.png","fl_x":"9.0","mask_path":"m.png","transform_matrix":{POSE}"#);
    std::fs::write(folder.path().join("transforms.json"), format!(r#"{{"frames":[{{{frame}}}]}}"#)).unwrap();
    std::fs::write(folder.path().join("mesh.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let settings = |masks| crate::scene::ReadSettings { masks, ..Default::default() };
    let read = |masks| crate::scene::read::read(folder.path(), &settings(masks));
    let error = read(MaskUse::Use).unwrap_err();
    assert!(error.kind() == ErrorKind::Missing && error.remedy_text().contains("--masks ignore"), "{error}");
    let scene = read(MaskUse::Ignore).unwrap();
    assert_eq!(scene.views[0].camera.focal_pixels.x, 9.0, "numbers may stand in strings");
}

#[test]
fn distortion_of_what_is_called_a_pinhole_is_undone_and_told() {
    let folder = folder_with_photos(&["a.png"]);
    let json = format!(
        r#"{{"camera_model":"PINHOLE","fl_x":50,"cx":20,"cy":15,"w":40,"h":30,"k1":0.1,
        "frames":[{{"file_path":"a.png","transform_matrix":{POSE}}}]}}"#
    );
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, &json).unwrap();
    let told = |scene: &SourceScene| scene.findings.iter().any(|finding| finding.code == "pinhole-with-distortion");
    let scene = read(folder.path()).unwrap();
    assert!(scene.views[0].lens.is_some() && told(&scene));
    std::fs::write(&path, json.replace("0.1", "0")).unwrap();
    let scene = read(folder.path()).unwrap();
    assert!(scene.views[0].lens.is_none() && !told(&scene));
}
