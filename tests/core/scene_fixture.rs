//! A small scene with known answers: two balls under a sky, seen from a ring of cameras.

#![allow(dead_code)]
#![allow(clippy::disallowed_methods)]

use glam::{Mat3, Vec2, Vec3};
use patina::image::{Image, RgbImage, file, transfer};
use patina::scene::{
    Background, Camera, Mesh, Photo, PixelState, Scene, View, WorldFromSource, photo::linear_from_srgb8,
};
use patina::trace::Bvh;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Width and height of the pictures.
pub const SIZE: (usize, usize) = (128, 96);

/// Two closed balls, wound and shaded outwards, without texture coordinates.
pub fn balls() -> Mesh {
    let mut mesh = Mesh::default();
    for (centre, radius) in [(Vec3::new(0.0, 1.0, 0.0), 1.0), (Vec3::new(1.3, 0.5, 0.4), 0.5)] {
        let (rings, sectors) = (24u32, 48u32);
        let first = mesh.positions.len() as u32;
        for ring in 0..=rings {
            let theta = std::f32::consts::PI * ring as f32 / rings as f32;
            for sector in 0..sectors {
                let phi = std::f32::consts::TAU * sector as f32 / sectors as f32;
                let normal = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                mesh.positions.push(centre + radius * normal);
                mesh.normals.push(normal);
            }
        }
        let vertex = |ring: u32, sector: u32| first + ring * sectors + sector % sectors;
        for ring in 0..rings {
            for sector in 0..sectors {
                let [a, b, c, d] = [
                    vertex(ring, sector),
                    vertex(ring, sector + 1),
                    vertex(ring + 1, sector),
                    vertex(ring + 1, sector + 1),
                ];
                if ring > 0 {
                    mesh.triangles.push([a, b, c]);
                }
                if ring + 1 < rings {
                    mesh.triangles.push([b, d, c]);
                }
            }
        }
    }
    mesh
}

/// The first cameras of a ring of eight around the balls, that look slightly down.
pub fn ring(count: usize) -> Vec<Camera> {
    assert!(count <= 8);
    (0..count)
        .map(|index| {
            let angle = 0.2 + std::f32::consts::TAU * index as f32 / 8.0;
            let eye = Vec3::new(5.0 * angle.cos(), 2.2, 5.0 * angle.sin());
            Camera::looking_at(eye, Vec3::new(0.2, 0.9, 0.1), SIZE.0, SIZE.1, 0.7)
        })
        .collect()
}

/// Radiance of the surface: a smooth pattern, the same from all sides.
fn surface_radiance(point: Vec3, normal: Vec3) -> Vec3 {
    let pattern = 0.5 + 0.3 * (4.0 * point.x).sin() * (5.0 * point.y).cos();
    Vec3::new(0.35, 0.3, 0.25) * pattern * (0.6 + 0.4 * normal.y)
}

/// A picture and its mask, averaged over 16 places a pixel; the mask is the mesh at the pixel's centre.
pub fn picture(mesh: &Mesh, bvh: &Bvh, camera: &Camera) -> (RgbImage, Image<bool>) {
    let shade = |place: Vec2| {
        let ray = camera.ray_through(place);
        match bvh.closest_hit(&ray) {
            None => Vec3::splat(0.55 + 0.3 * ray.direction.y),
            Some(hit) => {
                let normal = mesh.area_vector(hit.triangle as usize).normalize_or_zero();
                surface_radiance(ray.origin + hit.t * ray.direction, normal)
            }
        }
    };
    let pixel = |row: usize, column: usize| {
        let places = (0..16).map(|i| {
            Vec2::new(column as f32 + 0.125 + 0.25 * (i % 4) as f32, row as f32 + 0.125 + 0.25 * (i / 4) as f32)
        });
        places.map(shade).sum::<Vec3>() / 16.0
    };
    let centre = |row: usize, column: usize| Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
    (
        Image::from_fn(camera.width, camera.height, pixel),
        Image::from_fn(camera.width, camera.height, |row, column| {
            bvh.closest_hit(&camera.ray_through(centre(row, column))).is_some()
        }),
    )
}

/// sRGB bytes of a linear picture.
pub fn bytes_of(picture: &RgbImage) -> Image<[u8; 3]> {
    picture.map(|pixel| pixel.to_array().map(transfer::srgb8_from_linear_value))
}

/// The scene in memory, with masks; at most eight views, which are rendered once.
pub fn scene(view_count: usize) -> Scene {
    static WHOLE: LazyLock<Scene> = LazyLock::new(render);
    let mut scene = WHOLE.clone();
    scene.views.truncate(view_count);
    scene
}

fn render() -> Scene {
    let mesh = balls();
    let bvh = Bvh::build(&mesh.positions, &mesh.triangles).unwrap();
    let view_of = |(index, camera): (usize, Camera)| {
        let (picture, mask) = picture(&mesh, &bvh, &camera);
        View {
            name: format!("{index:08}"),
            camera,
            photo: Photo::Srgb8(bytes_of(&picture)),
            states: mask.map(|object| if *object { PixelState::Surface } else { PixelState::Background }),
            held_out: false,
            exposure_prior_stops: None,
        }
    };
    let views = ring(8).into_iter().enumerate().map(view_of).collect();
    Scene {
        name: "balls".into(),
        folder: None,
        mesh,
        views,
        world_from_source: WorldFromSource::default(),
        background: Background::Environment,
        truth: None,
        findings: Vec::new(),
    }
}

/// The photo of a view with its radiance changed.
pub fn change_photo(view: &mut View, change: impl Fn(Vec3) -> Vec3) {
    let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
    let linear = bytes.map(|pixel| change(linear_from_srgb8(*pixel)));
    view.photo = Photo::Srgb8(bytes_of(&linear));
}

/// How a folder is written.
pub struct FolderStyle {
    /// Added to the principal point: -0.5 for centres at integers.
    pub centre_shift: f32,
    /// Turns the world into the source's world.
    pub source_from_world: Mat3,
    /// The last line of the camera files.
    pub last_line: &'static str,
    /// Line end of text files.
    pub line_end: &'static str,
}

impl Default for FolderStyle {
    fn default() -> Self {
        FolderStyle {
            centre_shift: -0.5,
            source_from_world: Mat3::IDENTITY,
            last_line: "2.0 0.01 192 9.0",
            line_end: "\n",
        }
    }
}

/// z of the source is up.
pub fn z_up() -> Mat3 {
    Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y)
}

/// Writes a text file.
pub fn write(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

/// Text of a camera file.
pub fn cam_text(camera: &Camera, style: &FolderStyle) -> String {
    let rotation = camera.rotation_camera_from_world * style.source_from_world.transpose();
    let mut text = String::from("extrinsic\n");
    for row in 0..3 {
        let r = rotation.row(row);
        let t = camera.translation_camera_from_world[row];
        writeln!(text, "{:.9} {:.9} {:.9} {t:.9} ", r.x, r.y, r.z).unwrap();
    }
    let (focal, centre) = (camera.focal_pixels, camera.centre_pixels + style.centre_shift);
    writeln!(text, "0.0 0.0 0.0 1.0\n\nintrinsic").unwrap();
    writeln!(text, "{:.6} 0.0 {:.6}\n0.0 {:.6} {:.6}\n0.0 0.0 1.0\n", focal.x, centre.x, focal.y, centre.y).unwrap();
    writeln!(text, "{}", style.last_line).unwrap();
    text.replace('\n', style.line_end)
}

/// OBJ text of a mesh in the source's world.
pub fn obj_text(mesh: &Mesh, style: &FolderStyle) -> String {
    let mut text = String::from("# a mesh\n");
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let (p, n) = (style.source_from_world * *position, style.source_from_world * *normal);
        writeln!(text, "v {} {} {}\nvn {} {} {}", p.x, p.y, p.z, n.x, n.y, n.z).unwrap();
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| vertex + 1);
        writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}").unwrap();
    }
    text.replace('\n', style.line_end)
}

/// Writes the scene as a BlendedMVS folder with masks.
pub fn write_blended_mvs(folder: &Path, scene: &Scene, style: &FolderStyle) {
    for view in &scene.views {
        let Photo::Srgb8(bytes) = &view.photo else { panic!("the fixture's photos have 8 bits") };
        let name = &view.name;
        file::write_png_srgb8(&folder.join(format!("blended_images/{name}.png")), bytes).unwrap();
        let mask = view.states.map(|state| [if state.is_surface() { 255 } else { 0 }; 3]);
        file::write_png_srgb8(&folder.join(format!("masks/{name}.png")), &mask).unwrap();
        write(&folder.join(format!("cams/{name}_cam.txt")), &cam_text(&view.camera, style));
    }
    write(&folder.join("textured_mesh/mesh.obj"), &obj_text(&scene.mesh, style));
}

/// Text of `cameras.json`.
pub fn cameras_json(scene: &Scene) -> String {
    let views: Vec<serde_json::Value> = scene
        .views
        .iter()
        .map(|view| {
            let camera = &view.camera;
            let row = |index: usize| {
                let r = camera.rotation_camera_from_world.row(index);
                [r.x, r.y, r.z, camera.translation_camera_from_world[index]]
            };
            serde_json::json!({
                "file": format!("views/{}.exr", view.name), "width": camera.width, "height": camera.height,
                "K": [[camera.focal_pixels.x, 0.0, camera.centre_pixels.x], [0.0, camera.focal_pixels.y, camera.centre_pixels.y], [0.0, 0.0, 1.0]],
                "w2c": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
            })
        })
        .collect();
    serde_json::json!({ "convention": "opencv", "views": views }).to_string()
}

/// Writes the scene as an exchange folder without truth.
pub fn write_exchange(folder: &Path, scene: &Scene) {
    write(&folder.join("cameras.json"), &cameras_json(scene));
    write(&folder.join("scene.json"), r#"{"name": "small", "max_depth": 3, "background": "black"}"#);
    write(&folder.join("mesh.obj"), &obj_text(&scene.mesh, &FolderStyle::default()));
    for view in &scene.views {
        file::write_exr_rgb(&folder.join(format!("views/{}.exr", view.name)), &view.photo.to_linear()).unwrap();
    }
}

/// A folder for one test, removed at its end.
pub fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_path_buf();
    (folder, path)
}

/// A folder for one test with a copy of a template that is written once. Copies are not flushed to the disk, so that many
/// tests may spoil one each.
pub fn copy_of(template: &LazyLock<tempfile::TempDir>) -> (tempfile::TempDir, PathBuf) {
    fn copy(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let (path, target) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
            if path.is_dir() {
                copy(&path, &target);
            } else {
                std::fs::copy(&path, &target).unwrap();
            }
        }
    }
    let (keep, path) = folder();
    copy(template.path(), &path);
    (keep, path)
}

/// A BlendedMVS folder of two views.
pub static BLENDED_MVS: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let (keep, path) = folder();
    write_blended_mvs(&path, &scene(2), &FolderStyle::default());
    keep
});

/// An exchange folder of two views.
pub static EXCHANGE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let (keep, path) = folder();
    write_exchange(&path, &scene(2));
    keep
});
