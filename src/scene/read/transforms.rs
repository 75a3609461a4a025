//! `transforms.json` of nerfstudio, instant-ngp and their kin, and the split files of NeRF's synthetic scenes.
//!
//! Camera to world, OpenGL axes (x right, y up, z back), the first pixel's centre at (0.5, 0.5). Intrinsics at the top or with a
//! frame, which wins; without a focal length `camera_angle_x` gives it. `applied_transform` and `applied_scale` are undone, so
//! that cameras stand in the frame of the reconstruction, where the mesh lives.

use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::mesh_choice;
use super::photo_index::{PhotoIndex, some_of};
use super::posed::{Posed, views_of};
use super::source::{MeshFrame, SourceCamera, SourceScene};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{as_stored, folder_of};
use crate::image::file;
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use glam::{DMat3, DMat4, DVec3, DVec4};
use serde_json::Value;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The one file, or the file of the split that is fitted.
const WHOLE: &str = "transforms.json";
const TRAIN: &str = "transforms_train.json";
/// Splits that judge, the better first: one of them is held out.
const JUDGES: [&str; 2] = ["transforms_test.json", "transforms_val.json"];

/// The file that makes a folder one of this kind.
pub fn file_of(folder: &Path) -> Option<PathBuf> {
    [WHOLE, TRAIN].iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Whether a file holds frames.
pub fn holds_frames(path: &Path) -> bool {
    let json = read_text(path).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    json.is_some_and(|json| json.get("frames").and_then(Value::as_array).is_some_and(|frames| !frames.is_empty()))
}

/// A number, be it written as one or, as some scripts do, as a string.
fn number_of(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_str()?.trim().parse().ok())
}

/// One file of frames.
struct Transforms {
    path: PathBuf,
    json: Value,
}

fn malformed(path: &Path, frame: usize, what: impl Into<String>) -> Error {
    Error::new(ErrorKind::Malformed, what)
        .at(Place::View(format!("frame {frame} of {}", path.display())))
        .remedy("export the file again")
}

fn open(path: PathBuf) -> Result<Transforms> {
    let text = read_text(&path)?;
    let json: Value = serde_json::from_str(&text).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("the file is not JSON: {error}"))
            .at(Place::Line(path.clone(), error.line().max(1)))
            .remedy("export the file again; NaN is not a number of JSON")
    })?;
    if json.get("frames").is_none_or(|frames| !frames.is_array()) {
        return Err(Error::new(ErrorKind::Malformed, "the file has no list of frames")
            .at(Place::File(path))
            .remedy("it must hold \"frames\": [{\"file_path\", \"transform_matrix\"}]"));
    }
    Ok(Transforms { path, json })
}

impl Transforms {
    fn frames(&self) -> &[Value] {
        self.json.get("frames").and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    fn number(&self, frame: &Value, key: &str) -> Option<f64> {
        frame.get(key).or_else(|| self.json.get(key)).and_then(number_of)
    }

    /// The rows of a matrix; those that are missing are those of the identity.
    fn matrix(value: &Value) -> Option<DMat4> {
        let rows = value.as_array()?;
        let mut matrix = DMat4::IDENTITY.transpose();
        if !(3..=4).contains(&rows.len()) {
            return None;
        }
        for (index, row) in rows.iter().enumerate() {
            let numbers: Vec<f64> = row.as_array()?.iter().map(number_of).collect::<Option<_>>()?;
            *matrix.col_mut(index) = DVec4::from_array(numbers.try_into().ok()?);
        }
        Some(matrix.transpose())
    }

    /// What was done to the poses: `file_from_reconstruction`.
    fn applied(&self) -> Result<DMat4> {
        let transform = match self.json.get("applied_transform") {
            None | Some(Value::Null) => DMat4::IDENTITY,
            Some(value) => {
                Self::matrix(value).filter(|matrix| matrix.determinant().abs() > 1e-12).ok_or_else(|| {
                    Error::new(ErrorKind::Malformed, "applied_transform is not a matrix of 3 x 4 that can be undone")
                        .at(Place::File(self.path.clone()))
                        .remedy("export the file again, or remove the entry")
                })?
            }
        };
        let scale = self.json.get("applied_scale").and_then(number_of).filter(|scale| *scale > 0.0).unwrap_or(1.0);
        Ok(DMat4::from_scale(DVec3::splat(scale)) * transform)
    }

    fn lens(&self, frame: &Value, index: usize) -> Result<Lens> {
        let number = |key: &str| self.number(frame, key).unwrap_or(0.0);
        let model = frame.get("camera_model").or_else(|| self.json.get("camera_model")).and_then(Value::as_str);
        let is_fisheye = frame.get("is_fisheye").or_else(|| self.json.get("is_fisheye")).and_then(Value::as_bool);
        let name = match (model, is_fisheye) {
            (_, Some(true)) => "OPENCV_FISHEYE",
            (Some(name), _) => name,
            (None, _) => "OPENCV",
        };
        let [k1, k2, k3, k4] = ["k1", "k2", "k3", "k4"].map(number);
        let tangential = [number("p1"), number("p2")];
        let polynomial = match name {
            // Coefficients count whatever the model is called, as for nerfstudio and instant-ngp: see `told_of_pinholes`.
            "PINHOLE" | "SIMPLE_PINHOLE" | "OPENCV" | "SIMPLE_RADIAL" | "RADIAL" | "PERSPECTIVE" => {
                Polynomial { numerator: [k1, k2, k3, k4, 0.0, 0.0], tangential, ..Default::default() }
            }
            "OPENCV_FISHEYE" | "FISHEYE" => Polynomial {
                base: Base::Angle,
                numerator: [k1, k2, k3, k4, 0.0, 0.0],
                tangential,
                ..Default::default()
            },
            other => {
                return Err(Error::new(ErrorKind::Unsupported, format!("the camera model {other} is not supported"))
                    .at(Place::View(format!("frame {index} of {}", self.path.display())))
                    .remedy("OPENCV, OPENCV_FISHEYE and PINHOLE are read: export perspective photos"));
            }
        };
        Ok(Lens::new(Model::Polynomial(polynomial)))
    }

    fn states_centre(&self, frame: &Value) -> bool {
        ["cx", "cy"].iter().all(|key| self.number(frame, key).is_some())
    }

    /// Whether some frame says neither the size of its photo nor where its middle is.
    fn leaves_sizes_open(&self) -> bool {
        let is_open = |frame: &Value| {
            !self.states_centre(frame) && ["w", "h"].iter().any(|key| self.number(frame, key).is_none())
        };
        self.frames().iter().any(is_open)
    }

    fn posed(&self, index: usize, photos: &PhotoIndex, findings: &mut Vec<Finding>) -> Result<Posed> {
        let frame = &self.frames()[index];
        let listed = frame.get("file_path").and_then(Value::as_str);
        let listed = listed.ok_or_else(|| malformed(&self.path, index, "the frame has no file_path"))?.to_owned();
        let place = Place::View(format!("{listed} of {}", self.path.display()));
        let pose = frame.get("transform_matrix").and_then(Self::matrix);
        let pose = pose.ok_or_else(|| malformed(&self.path, index, "transform_matrix is not 4 x 4 numbers"))?;
        let size = self.number(frame, "w").zip(self.number(frame, "h"));
        let stated = size.map(|(width, height)| (width as usize, height as usize));
        let of_file = || photos.find(&listed).map(|path| file::read_size(&path)).transpose();
        let known = if stated.is_some() { stated } else { of_file()? };
        // A principal point tells what size it is for, where nothing else does.
        let size = if self.states_centre(frame) { stated } else { known };
        let (width, height) = known.map_or((0.0, 0.0), |(width, height)| (width as f64, height as f64));
        let of_angle = |key: &str, length: f64| {
            self.number(frame, key).filter(|_| length > 0.0).map(|angle| 0.5 * length / (0.5 * angle).tan())
        };
        let focal_x = self.number(frame, "fl_x").or_else(|| of_angle("camera_angle_x", width));
        let focal_y = self.number(frame, "fl_y").or_else(|| of_angle("camera_angle_y", height));
        let focal_x = focal_x.or(focal_y);
        let intrinsics = match focal_x {
            Some(x) => matrix(
                [x, focal_y.unwrap_or(x)],
                [self.number(frame, "cx").unwrap_or(0.5 * width), self.number(frame, "cy").unwrap_or(0.5 * height)],
            ),
            // Without a photo there is no size to take an angle of: the view is left out anyway.
            None if known.is_none() => DMat3::IDENTITY,
            None => return Err(malformed(&self.path, index, "neither fl_x nor camera_angle_x gives a focal length")),
        };
        // Undone first, while axes are still those of the file; then OpenGL's camera axes become OpenCV's.
        let undone = self.applied()?.inverse() * pose;
        let scale = undone.x_axis.truncate().length();
        if !(scale > 1e-9) {
            return Err(malformed(&self.path, index, "transform_matrix is singular"));
        }
        let axes = DMat3::from_mat4(undone) * (1.0 / scale) * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let rotation = axes.transpose();
        let (camera, mut noticed) =
            SourceCamera::new(intrinsics, rotation, -(rotation * undone.w_axis.truncate()), &place)?;
        findings.append(&mut noticed);
        let base = folder_of(&self.path);
        let mask = frame.get("mask_path").and_then(Value::as_str).map(|mask| as_stored(base.join(mask)));
        Ok(Posed { listed, camera, lens: self.lens(frame, index)?, size, mask, place })
    }
}

/// That frames are called pinholes and have distortion all the same.
fn told_of_pinholes(file: &Transforms, posed: &[Posed]) -> Option<Finding> {
    let is_called_pinhole = |frame: &Value| {
        let model = frame.get("camera_model").or_else(|| file.json.get("camera_model")).and_then(Value::as_str);
        model.is_some_and(|model| model.ends_with("PINHOLE"))
    };
    let frames = file.frames().iter().zip(posed);
    let count = frames.filter(|(frame, own)| is_called_pinhole(frame) && !own.lens.is_pinhole()).count();
    let message = format!("the camera model of {count} frames is a pinhole, yet they have distortion: it is undone");
    (count > 0).then(|| {
        Finding::new(Severity::Warning, "pinhole-with-distortion", message)
            .at(Place::File(file.path.clone()))
            .remedy("take k1, k2, p1 and p2 out of the file if its photos are undistorted already")
    })
}

/// The folder of the scanned mesh of Stanford-ORB, `ground_truth/NAME/mesh_blender` beside the folder of all scenes.
fn orb_mesh(folder: &Path) -> Option<PathBuf> {
    let whole = std::path::absolute(folder).ok()?;
    let mesh = whole.parent()?.parent()?.join("ground_truth").join(whole.file_name()?).join("mesh_blender");
    mesh.is_dir().then_some(mesh)
}

/// Lists a scene of transforms and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let main = file_of(folder).unwrap_or_else(|| folder.join(WHOLE));
    let is_split = main.file_name().is_some_and(|name| name == TRAIN);
    let main = open(main)?;
    let mut findings = Vec::new();
    let photos = PhotoIndex::of_folders(&[folder.into()])?;
    let mut files = Vec::new();
    let mut held: HashSet<PathBuf> = HashSet::new();
    if is_split {
        let judge = JUDGES.iter().map(|name| folder.join(name)).find(|path| path.is_file());
        if let Some(judge) = judge {
            let judge = open(judge)?;
            let paths = judge.frames().iter().filter_map(|frame| frame.get("file_path").and_then(Value::as_str));
            held.extend(paths.filter_map(|listed| photos.find(listed)));
            files.push(judge);
        }
    }
    for key in ["val_filenames", "test_filenames"] {
        let names = main.json.get(key).and_then(Value::as_array).into_iter().flatten();
        held.extend(names.filter_map(|name| photos.find(name.as_str()?)));
    }
    let applied = main.applied()?;
    files.insert(0, main);
    let mut posed = Vec::new();
    for file in &files {
        let first = posed.len();
        for index in 0..file.frames().len() {
            posed.push(file.posed(index, &photos, &mut findings)?);
        }
        findings.extend(told_of_pinholes(file, &posed[first..]));
    }
    let views = views_of(posed, &photos, &[folder.into()], &mut findings)?;
    let held_out: Vec<String> =
        views.iter().filter(|view| held.contains(&view.photo)).map(|view| view.name.clone()).collect();
    if !held_out.is_empty() && held_out.len() < views.len() {
        findings.push(Finding::new(
            Severity::Note,
            "held-out-by-source",
            format!("the source holds out {} of {} views: {}", held_out.len(), views.len(), some_of(&held_out)),
        ));
    }
    let mesh = mesh_choice::find(
        &[Some(folder.to_path_buf()), orb_mesh(folder)].into_iter().flatten().collect::<Vec<_>>(),
        &mut findings,
    );
    let mut scene = SourceScene::of_photographs(folder, mesh, views);
    scene.sizes_are_of_files = files.iter().any(Transforms::leaves_sizes_open);
    if !held_out.is_empty() && held_out.len() < scene.views.len() {
        scene.held_out = Some(held_out);
    }
    if applied != DMat4::IDENTITY {
        findings.push(Finding::new(
            Severity::Note,
            "applied-transform-undone",
            "the file turned its cameras by applied_transform: this is undone, the mesh is taken to be in the frame before it",
        ));
        scene.mesh_frames.push(MeshFrame { name: "applied_transform", source_from_mesh: applied.inverse() });
    }
    scene.findings = findings;
    Ok(scene)
}

#[cfg(test)]
#[path = "transforms_tests.rs"]
mod tests;
