use super::*;
use crate::image::{Image, file};

#[test]
fn numbers_in_strings_and_both_kinds_of_focal_length_are_read() {
    let folder = tempfile::tempdir().unwrap();
    file::write_png_srgb8(&folder.path().join("a.png"), &Image::filled(40, 30, [9; 3])).unwrap();
    let json = r#"{"views":[{"viewId":"1","poseId":"1","intrinsicId":"5","path":"/far/a.png"},{"viewId":"2","poseId":"2",
        "intrinsicId":"5","path":"/far/b.png"}],"intrinsics":[{"intrinsicId":"5","width":"40","height":"30",
        "pxFocalLength":["50","51"],"principalPoint":["0.5","-0.25"],"type":"radial3","distortionParams":["0.1","0","0.01"]}],
        "poses":[{"poseId":"1","pose":{"transform":{"rotation":["0","1","0","-1","0","0","0","0","1"],"center":["1","2","3"]}}}]}"#;
    let path = folder.path().join("sfm.json");
    std::fs::write(&path, json).unwrap();
    let scene = read(&file_of(folder.path()).unwrap()).unwrap();
    let camera = &scene.views[0].camera;
    assert_eq!(camera.pinhole().centre_pixels.to_array(), [20.5, 14.75]);
    assert!((camera.rotation.transpose() * -camera.translation - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    // Row by row camera to world: the camera's x axis is the first column, (0, -1, 0).
    assert!((camera.rotation.transpose() * DVec3::X - DVec3::NEG_Y).length() < 1e-12);
    assert_eq!(scene.findings[0].code, "camera-not-aligned");
    let metric = json.replace(r#""pxFocalLength":["50","51"]"#, r#""focalLength":"45","sensorWidth":"36""#);
    std::fs::write(&path, metric.replace("\"0.5\",\"-0.25\"", "\"21\",\"14\"")).unwrap();
    let pinhole = read(&path).unwrap().views[0].camera.pinhole();
    assert_eq!(pinhole.focal_pixels.to_array(), [50.0, 50.0]);
    assert_eq!(pinhole.centre_pixels.to_array(), [21.0, 14.0], "an old file: absolute");
    // What its version says comes before what numbers look like.
    let of = |version: &str| {
        let ratio = format!(r#""version":{version},"#);
        let json = metric.replacen('{', &format!("{{{ratio}"), 1);
        std::fs::write(&path, json.replace("\"sensorWidth\"", "\"pixelRatio\":\"2\",\"sensorWidth\"")).unwrap();
        let pinhole = read(&path).unwrap().views[0].camera.pinhole();
        (pinhole.focal_pixels.to_array(), pinhole.centre_pixels.to_array())
    };
    assert_eq!(of(r#"["1","2","0"]"#), ([50.0, 25.0], [0.5, -0.25]));
    assert_eq!(of(r#"["1","2","4"]"#), ([50.0, 25.0], [20.5, 14.75]));
    assert_eq!(of(r#"["1","2","5"]"#), ([50.0, 100.0], [20.5, 14.75]));
}

const RIG: &str = r#"{"views":[{"poseId":"1","intrinsicId":"5","path":"/far/a.png","rigId":"7","subPoseId":"0"},
    {"poseId":"1","intrinsicId":"5","path":"/far/b.png","rigId":"7","subPoseId":"1"}],
    "intrinsics":[{"intrinsicId":"5","width":"40","height":"30","focalLength":"45","sensorWidth":"36","type":"pinhole",
    "distortionParams":["0.1","0","0"],"distortionType":"radialk3"}],
    "poses":[{"poseId":"1","pose":{"transform":{"rotation":["0","1","0","-1","0","0","0","0","1"],"center":["1","2","3"]}}}],
    "rigs":[{"rigId":"7","subPoses":[
    {"status":"estimated","pose":{"rotation":["1","0","0","0","1","0","0","0","1"],"center":["0","0","0"]}},
    {"status":"estimated","pose":{"rotation":["1","0","0","0","0","1","0","-1","0"],"center":["0.5","0","0"]}}]}]}"#;

fn folder_of_two() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.png", "b.png"] {
        file::write_png_srgb8(&folder.path().join(name), &Image::filled(40, 30, [9; 3])).unwrap();
    }
    folder
}

#[test]
fn views_of_a_rig_stand_where_pose_and_rig_put_them() {
    let folder = folder_of_two();
    let path = folder.path().join("sfm.json");
    std::fs::write(&path, RIG).unwrap();
    let scene = read(&path).unwrap();
    let cameras = [0, 1].map(|index| scene.views[index].camera);
    let centres = cameras.map(|camera| camera.rotation.transpose() * -camera.translation);
    assert!((centres[0] - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    // The rig's x axis is -y of the world; the second camera is half a unit along it and turned about it.
    assert!((centres[1] - DVec3::new(1.0, 1.5, 3.0)).length() < 1e-12, "{}", centres[1]);
    assert!((cameras[1].rotation.transpose() * DVec3::X - DVec3::NEG_Y).length() < 1e-12);
    assert!((cameras[1].rotation * DVec3::Z).z.abs() < 1e-12);
    let unknown = RIG.replacen("\"estimated\"", "\"uninitialized\"", 1);
    std::fs::write(&path, unknown).unwrap();
    let scene = read(&path).unwrap();
    assert!(scene.views.len() == 1 && scene.findings.iter().any(|own| own.code == "camera-not-aligned"));
}

#[test]
fn cameras_of_other_types_are_refused_by_name_and_numbers_must_be_finite() {
    let folder = folder_of_two();
    let path = folder.path().join("sfm.json");
    std::fs::write(&path, RIG.replace("\"pinhole\"", "\"equidistant\"")).unwrap();
    let error = read(&path).unwrap_err();
    assert!(error.kind() == ErrorKind::Unsupported && error.to_string().contains("equidistant"), "{error}");
    let by_type = RIG.replace("\"pinhole\"", "\"equidistant\"").replace(",\"distortionType\":\"radialk3\"", "");
    std::fs::write(&path, by_type.replace("\"distortionParams\":[\"0.1\",\"0\",\"0\"]", "\"distortionParams\":[]"))
        .unwrap();
    let error = read(&path).unwrap_err();
    assert!(error.kind() == ErrorKind::Unsupported && error.to_string().contains("equidistant"), "{error}");
    for (value, is_read) in [("0.1", false), ("0", true)] {
        let undone =
            format!("\"undistortionType\":\"3declassicld\",\"undistortionParams\":[\"{value}\"],\"distortionParams\"");
        std::fs::write(&path, RIG.replace("\"distortionParams\"", &undone)).unwrap();
        let outcome = read(&path);
        assert_eq!(outcome.is_ok(), is_read);
        assert!(outcome.err().is_none_or(|error| error.to_string().contains("3declassicld")));
    }
    std::fs::write(&path, RIG.replace("[\"0.1\"", "[\"nan\"")).unwrap();
    assert_eq!(read(&path).unwrap_err().kind(), ErrorKind::NonFinite);
}

#[test]
fn of_several_files_the_one_with_poses_is_read() {
    let folder = folder_of_two();
    std::fs::write(folder.path().join("cameraInit.sfm"), RIG.replace("\"poses\"", "\"none\"")).unwrap();
    std::fs::write(folder.path().join("sfm.sfm"), RIG).unwrap();
    let path = file_of(folder.path()).unwrap();
    assert_eq!(path, folder.path().join("sfm.sfm"));
    let scene = read(&path).unwrap();
    assert!(scene.findings[0].code == "sfm-chosen" && scene.findings[0].message.contains("cameraInit.sfm"));
}
