use super::*;
use crate::image::{Image, file};

/// A folder with photos of 40 x 30 pixels in subfolders and a mesh of one triangle.
fn folder_with_photos(photos: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for photo in photos {
        let path = folder.path().join("images").join(photo);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        file::write_png_srgb8(&path, &Image::filled(40, 30, [90, 100, 110])).unwrap();
    }
    std::fs::write(folder.path().join("meshed-poisson.ply"), TRIANGLE).unwrap();
    std::fs::create_dir_all(folder.path().join("sparse/0")).unwrap();
    folder
}

const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

const CAMERAS: &str = "# Camera list\n1 OPENCV 40 30 50 51 20.5 14.5 0.1 -0.01 0.002 -0.003\n\
2 FULL_OPENCV 40 30 50 50 20 15 0 0 0 0 0 0 0 0\n";
// The second line of an image, its points, may be empty: the one of b.png is.
const IMAGES: &str = "# Image list\n1 0.8 0.6 0 0 1 2 3 1 left/a b.png\n1.0 2.0 -1 3.0 4.0 7\n\
2 1 0 0 0 0 0 4 2 right/b.png\n\n3 1 0 0 0 0 0 5 2 left/b.png\n\n";
const PHOTOS: [&str; 3] = ["left/a b.png", "right/b.png", "left/b.png"];

/// The same model as binary files.
fn binary() -> (Vec<u8>, Vec<u8>) {
    let mut cameras = 2u64.to_le_bytes().to_vec();
    for (id, model, parameters) in [
        (1u32, 4u32, vec![50.0, 51.0, 20.5, 14.5, 0.1, -0.01, 0.002, -0.003]),
        (2, 6, [vec![50.0, 50.0, 20.0, 15.0], vec![0.0; 8]].concat()),
    ] {
        cameras.extend([id.to_le_bytes(), model.to_le_bytes()].concat());
        cameras.extend([40u64.to_le_bytes(), 30u64.to_le_bytes()].concat());
        parameters.iter().for_each(|value: &f64| cameras.extend(value.to_le_bytes()));
    }
    let mut images = 3u64.to_le_bytes().to_vec();
    for (id, pose, camera, points) in [
        (1u32, [0.8, 0.6, 0.0, 0.0, 1.0, 2.0, 3.0], 1u32, 2u64),
        (2, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0], 2, 0),
        (3, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0], 2, 0),
    ] {
        images.extend(id.to_le_bytes());
        pose.iter().for_each(|value: &f64| images.extend(value.to_le_bytes()));
        images.extend(camera.to_le_bytes());
        images.extend(PHOTOS[id as usize - 1].as_bytes());
        images.push(0);
        images.extend(points.to_le_bytes());
        images.extend(vec![0xff; 24 * points as usize]);
    }
    (cameras, images)
}

#[test]
fn text_and_binary_say_the_same() {
    let folder = folder_with_photos(&PHOTOS);
    let model = folder.path().join("sparse/0");
    std::fs::write(model.join("cameras.txt"), CAMERAS).unwrap();
    std::fs::write(model.join("images.txt"), IMAGES).unwrap();
    let text = read(folder.path()).unwrap();
    let (cameras, images) = binary();
    std::fs::write(model.join("cameras.bin"), cameras).unwrap();
    std::fs::write(model.join("images.bin"), images).unwrap();
    std::fs::write(model.join("cameras.txt"), "binary files are preferred").unwrap();
    let binary = read(folder.path()).unwrap();
    assert_eq!(text.mesh, [folder.path().join("meshed-poisson.ply")]);
    for scene in [&text, &binary] {
        let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
        assert_eq!(names, ["left_a b", "right_b", "left_b"], "folders tell equal names apart");
        let first = &scene.views[0];
        assert_eq!(first.camera.pinhole().focal_pixels.to_array(), [50.0, 51.0]);
        assert_eq!(first.camera.pinhole().centre_pixels.to_array(), [20.5, 14.5]);
        // 0.8 + 0.6 i turns by 2 acos 0.8 about x: y goes to 0.28 y + 0.96 z.
        assert!((first.camera.rotation * DVec3::Y - DVec3::new(0.0, 0.28, 0.96)).length() < 1e-12);
        assert_eq!(first.camera.translation, DVec3::new(1.0, 2.0, 3.0));
        let place = first.lens.as_ref().unwrap().project(DVec3::new(0.3, 0.4, 1.0));
        // r² = 0.25: radial 1.024375; tangential 2 p1 x y + p2 (r² + 2 x²), p1 (r² + 2 y²) + 2 p2 x y.
        let expected = [0.3 * 1.024375 + 0.002 * 0.24 - 0.003 * 0.43, 0.4 * 1.024375 + 0.002 * 0.57 - 0.003 * 0.24];
        assert!((place - glam::DVec2::from_array(expected)).length() < 1e-12);
        assert!(scene.views[1].lens.is_none(), "twelve parameters of which all distortion is zero: a pinhole");
    }
}

#[test]
fn damage_and_unknown_models_are_errors_with_a_place() {
    let folder = folder_with_photos(&PHOTOS);
    let model = folder.path().join("sparse/0");
    let (cameras, images) = binary();
    std::fs::write(model.join("cameras.bin"), &cameras).unwrap();
    for length in 0..images.len() {
        std::fs::write(model.join("images.bin"), &images[..length]).unwrap();
        let error = read(folder.path()).unwrap_err();
        assert!(matches!(error.place(), Place::Byte(..)), "cut to {length}: {error}");
    }
    std::fs::write(model.join("images.bin"), &images).unwrap();
    let mut unknown = cameras.clone();
    unknown[12] = 99;
    std::fs::write(model.join("cameras.bin"), &unknown).unwrap();
    let error = read(folder.path()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.message().contains("99"), "{error}");
    let mut many = cameras;
    many[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    std::fs::write(model.join("cameras.bin"), &many).unwrap();
    assert_eq!(
        read(folder.path()).unwrap_err().kind(),
        ErrorKind::Malformed,
        "no memory is taken for what cannot be there"
    );
}

#[test]
fn photos_of_half_the_size_take_their_intrinsics_along() {
    let folder = folder_with_photos(&["a.png", "b.png"]);
    let model = folder.path().join("sparse/0");
    std::fs::write(model.join("cameras.txt"), "1 PINHOLE 80 60 100 102 41 29\n").unwrap();
    std::fs::write(
        model.join("images.txt"),
        "1 1 0 0 0 0 0 4 1 a.png\n\n2 1 0 0 0 0 0 5 1 b.png\n\n3 1 0 0 0 0 0 6 1 c.png\n\n",
    )
    .unwrap();
    let scene = crate::scene::read(folder.path(), &crate::scene::ReadSettings::default()).unwrap();
    let camera = &scene.views[0].camera;
    assert_eq!((camera.width, camera.height), (40, 30));
    assert_eq!(camera.focal_pixels.to_array(), [50.0, 51.0]);
    assert_eq!(camera.centre_pixels.to_array(), [20.5, 14.5]);
    let codes: Vec<_> = scene.findings.iter().map(|finding| finding.code).collect();
    assert!(codes.contains(&"intrinsics-scaled") && codes.contains(&"camera-without-photo"), "{codes:?}");
    std::fs::write(model.join("cameras.txt"), "1 PINHOLE 80 80 100 102 41 29\n").unwrap();
    let error = crate::scene::read(folder.path(), &crate::scene::ReadSettings::default()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidScene, "another shape is not another size");
}

#[test]
fn a_distorted_photo_becomes_a_pinhole_of_the_same_size() {
    let folder = folder_with_photos(&["a.png"]);
    let model = folder.path().join("sparse/0");
    std::fs::write(model.join("cameras.txt"), "1 SIMPLE_RADIAL 40 30 30 20 15 0.2\n").unwrap();
    std::fs::write(model.join("images.txt"), "1 1 0 0 0 0 0 4 1 a.png\n\n").unwrap();
    let scene = crate::scene::read(folder.path(), &crate::scene::ReadSettings::default()).unwrap();
    let view = &scene.views[0];
    assert_eq!((view.photo.width(), view.photo.height()), (40, 30));
    assert_eq!(view.states[(0, 0)], crate::scene::PixelState::Ignored, "it lies outside of what was taken");
    assert!(scene.findings.iter().any(|finding| finding.code == "lens-undone"));
}

#[test]
fn of_several_models_the_largest_is_read_and_told() {
    let folder = folder_with_photos(&PHOTOS);
    let root = folder.path();
    std::fs::create_dir_all(root.join("sparse/1")).unwrap();
    let (cameras, images) = binary();
    std::fs::write(root.join("sparse/0/cameras.txt"), CAMERAS).unwrap();
    std::fs::write(root.join("sparse/0/images.txt"), "1 1 0 0 0 0 0 4 2 right/b.png\n\n").unwrap();
    std::fs::write(root.join("sparse/1/cameras.bin"), cameras).unwrap();
    std::fs::write(root.join("sparse/1/images.bin"), images).unwrap();
    assert_eq!(model_folder(root), Some(root.join("sparse/1")));
    let scene = read(root).unwrap();
    assert_eq!(scene.views.len(), 3);
    let told = scene.findings.iter().find(|finding| finding.code == "model-chosen").unwrap();
    assert!(told.message.contains("1 has 3 images") && told.message.contains("0 has 1"), "{told}");
}

#[test]
fn lines_of_points_may_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("images.txt");
    let names = |text: &str| -> Vec<String> {
        std::fs::write(&path, text).unwrap();
        read_images_txt(&path).unwrap().0.into_iter().map(|image| image.name).collect()
    };
    let image = |number: u32, name: &str| format!("{number} 1 0 0 0 0 0 {number} 1 {name}\n");
    let none = image(1, "a.png") + &image(2, "b.png") + &image(3, "7 c.png");
    assert_eq!(names(&none), ["a.png", "b.png", "7 c.png"]);
    // Points at whole pixels look like an image up to its name, which would be a number.
    let points = image(1, "a.png") + "1 2 3 4 5 6 7 8 9 10 11 12\n" + &image(2, "b") + "\n" + &image(3, "c");
    assert_eq!(names(&points), ["a.png", "b", "c"]);
}

#[test]
fn cameras_that_no_image_names_may_be_of_any_kind_and_numbers_must_be_finite() {
    let folder = folder_with_photos(&PHOTOS);
    let model = folder.path().join("sparse/0");
    std::fs::write(model.join("images.txt"), IMAGES).unwrap();
    let others = "98 EQUIRECTANGULAR 10 10 1 2\n99 SPHERE_X 10 10 1 2 3\n";
    std::fs::write(model.join("cameras.txt"), format!("{CAMERAS}{others}")).unwrap();
    assert_eq!(read(folder.path()).unwrap().views.len(), 3);
    let used = CAMERAS.replace("2 FULL_OPENCV 40 30 50 50 20 15 0 0 0 0 0 0 0 0", "2 SPHERE_X 10 10 1 2 3");
    std::fs::write(model.join("cameras.txt"), used).unwrap();
    let error = read(folder.path()).unwrap_err();
    assert!(error.kind() == ErrorKind::Unsupported && error.to_string().contains("SPHERE_X"), "{error}");
    std::fs::write(model.join("cameras.txt"), CAMERAS.replace("0.1 -0.01", "nan 0")).unwrap();
    assert_eq!(read(folder.path()).unwrap_err().kind(), ErrorKind::NonFinite);
}

#[test]
fn a_damaged_image_is_an_error_with_its_line_and_damaged_points_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("images.txt");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let read = read_images_txt(&path).map(|(images, findings)| (images.len(), findings));
        read.map_err(|error| error.place().clone())
    };
    let line = |number| Place::Line(path.clone(), number);
    let image = |index: usize| format!("{index} 1 0 0 0 0 0 {index} 2 right/{index}.png");
    // Without lines of points: cut anywhere, or with a word for a number, the second image is missed.
    let whole = image(2);
    let cuts = (1..whole.len() - "right/2.png".len()).map(|length| whole[..length].to_owned());
    let damaged: Vec<String> = cuts.chain([whole.replace(" 0 0 0 ", " 0 x 0 ")]).collect();
    for damaged in &damaged {
        let text = format!("# images\n{}\n{damaged}\n{}\n{}\n{}\n", image(1), image(3), image(4), image(5));
        assert_eq!(read(&text).unwrap_err(), line(3), "{damaged}");
    }
    // With lines of points, empty or not, what stands in their place and is none is told.
    let points = "1.5 2.5 -1 3 4 7";
    let text = |second: &str| format!("{}\n{points}\n{}\n{second}\n{}\n\n", image(1), image(2), image(3));
    assert_eq!(read(&text(points)).unwrap(), (3, Vec::new()));
    for damaged in ["1.5 2.5 -1 3 4", "1.5 2.5 -1 3 4 x"] {
        let (images, findings) = read(&text(damaged)).unwrap();
        assert_eq!((images, findings.len(), &findings[0].target), (3, 1, &line(4)), "{damaged}");
    }
    let damaged = text(points).replace(&image(2), "2 1 0 0");
    assert_eq!(read(&damaged).unwrap_err(), line(3));
    assert_eq!(read(&format!("{}\n\n2 1 0 0 0 0 0 4 2\n\n", image(1))).unwrap_err(), line(3), "no name");
    assert_eq!(read(&format!("{}\n{}\n{points}\n", image(1), image(2))).unwrap().0, 2, "left out where there are none");
}

#[test]
fn undistorted_photos_go_with_the_cameras_of_their_workspace() {
    // As a reconstruction leaves it whose original photos lie elsewhere.
    for inner in ["dense", "dense/0", "undistorted"] {
        let folder = tempfile::tempdir().unwrap();
        let workspace = folder.path().join(inner);
        for model in [folder.path().join("sparse/0"), workspace.join("sparse")] {
            std::fs::create_dir_all(&model).unwrap();
            std::fs::write(model.join("images.txt"), IMAGES).unwrap();
            std::fs::write(model.join("cameras.txt"), CAMERAS).unwrap();
        }
        let pinholes = "1 PINHOLE 40 30 50 50 20 15\n2 PINHOLE 40 30 50 50 20 15\n";
        std::fs::write(workspace.join("sparse/cameras.txt"), pinholes).unwrap();
        std::fs::write(workspace.join("meshed-poisson.ply"), TRIANGLE).unwrap();
        let put_photos = |images: &Path| {
            for photo in PHOTOS {
                let path = images.join(photo);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                file::write_png_srgb8(&path, &Image::filled(40, 30, [9; 3])).unwrap();
            }
        };
        put_photos(&workspace.join("images"));
        let scene = read(folder.path()).unwrap();
        assert!(scene.views.iter().all(|view| view.lens.is_none() && view.photo.starts_with(&workspace)), "{inner}");
        assert_eq!(model_folder(folder.path()).unwrap(), workspace.join("sparse"));
        // With the original photos beside it, in whatever folder, the original cameras are read.
        put_photos(&folder.path().join("walk"));
        let scene = read(folder.path()).unwrap();
        assert!(scene.views.iter().any(|view| view.lens.is_some()), "{inner}");
        assert!(scene.views.iter().all(|view| view.photo.starts_with(folder.path().join("walk"))), "{inner}");
    }
}
