//! AliceVision and Meshroom: `sfm.json`, `cameras.sfm` or any `.sfm` file.
//!
//! Numbers are stored as strings. The nine numbers of a rotation are the columns of camera from world, so row by row they are
//! camera to world; `center` is where the camera stands. The principal point is an offset from the middle in pixels, before
//! version 1.2.1 absolute; a file without a version is told by the point's size. What is called the ratio of pixels was that of
//! the focal lengths before version 1.2.5, and the other way up (aliceVision, `sfmDataIO/jsonIO.cpp`). Views of a rig stand where its pose and their place in it put them. Of several files the
//! first that holds poses is read: `cameraInit.sfm` has none.

use super::blended_mvs::files_of;
use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::photo_index::{PhotoIndex, some_of};
use super::posed::Posed;
use super::source::{SourceCamera, SourceScene};
use super::tool_folder::scene_of;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The files of a folder that may be ones of cameras, the likelier first.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let named = ["sfm.json", "cameras.json.sfm", "cameras.sfm"].map(|name| folder.join(name));
    let mut files: Vec<PathBuf> = named.into_iter().filter(|path| path.is_file()).collect();
    let others = files_of(folder, &["sfm"]).unwrap_or_default();
    let others: Vec<PathBuf> = others.into_iter().filter(|path| !files.contains(path)).collect();
    files.extend(others);
    files
}

/// Whether a file holds poses.
pub fn holds_poses(path: &Path) -> bool {
    let json = read_text(path).ok().and_then(|text| serde_json::from_str::<Value>(&text).ok());
    json.is_some_and(|json| json.get("poses").and_then(Value::as_array).is_some_and(|poses| !poses.is_empty()))
}

/// The file of a folder, if it holds one: the first with poses, or else the first.
pub fn file_of(folder: &Path) -> Option<PathBuf> {
    let files = files_in(folder);
    let with_poses = if files.len() > 1 { files.iter().find(|path| holds_poses(path)) } else { None };
    with_poses.or(files.first()).cloned()
}

/// A number, be it written as one or as a string; an empty string is none.
fn number(value: &Value) -> Option<f64> {
    match value.as_str().map(str::trim) {
        Some("") => None,
        // What is written but is no number is refused where it is used.
        Some(text) => Some(text.parse().unwrap_or(f64::NAN)),
        None => value.as_f64(),
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().map_or_else(|| number(value).into_iter().collect(), |all| all.iter().filter_map(number).collect())
}

/// A name, be it written as one or as a number.
fn name(value: Option<&Value>) -> Option<String> {
    let value = value?;
    value.as_str().map(str::to_owned).or_else(|| value.as_u64().map(|number| number.to_string()))
}

fn malformed(what: &str, place: &Place) -> Error {
    Error::new(ErrorKind::Malformed, what).at(place.clone()).remedy("export the file again (ConvertSfMFormat)")
}

/// The version of the format, as three numbers; `None` where none is written.
fn version_of(json: &Value) -> Option<[u64; 3]> {
    let parts: Vec<f64> = json.get("version").map(numbers)?;
    let part = |index: usize| parts.get(index).map_or(0, |part| *part as u64);
    (!parts.is_empty()).then(|| [part(0), part(1), part(2)])
}

/// Size, intrinsics and lens of an entry of `intrinsics`.
fn intrinsics_of(entry: &Value, version: Option<[u64; 3]>, place: &Place) -> Result<((usize, usize), DMat3, Lens)> {
    let get = |key: &str| entry.get(key).and_then(number);
    let (Some(width), Some(height)) = (get("width"), get("height")) else {
        return Err(malformed("the intrinsics have no size", place));
    };
    let focal = match entry.get("pxFocalLength").map(numbers).unwrap_or_default().as_slice() {
        [both] => [*both; 2],
        [x, y] => [*x, *y],
        _ => {
            // In millimetres on a sensor of known width.
            let (Some(millimetres), Some(sensor)) = (get("focalLength"), get("sensorWidth")) else {
                return Err(malformed("the intrinsics have no focal length", place));
            };
            let x = millimetres / sensor * width;
            let ratio = get("pixelRatio").filter(|ratio| *ratio > 0.0).unwrap_or(1.0);
            let is_of_focal_lengths = version.is_some_and(|version| version < [1, 2, 5]);
            [x, if is_of_focal_lengths { x / ratio } else { x * ratio }]
        }
    };
    let offset = entry.get("principalPoint").map(numbers).unwrap_or_default();
    let middle = [0.5 * width, 0.5 * height];
    let is_offset = |[x, y]: [f64; 2]| match version {
        Some(version) => version >= [1, 2, 1],
        None => x.abs() < 0.5 * middle[0] && y.abs() < 0.5 * middle[1],
    };
    let centre = match *offset {
        [x, y] if is_offset([x, y]) => [middle[0] + x, middle[1] + y],
        [x, y] => [x, y],
        _ => middle,
    };
    let camera = entry.get("type").and_then(Value::as_str).unwrap_or("pinhole");
    let distortion = entry.get("distortionType").and_then(Value::as_str);
    if distortion.is_some() && camera != "pinhole" {
        return Err(Error::new(ErrorKind::Unsupported, format!("a camera of the type {camera} is not supported"))
            .at(place.clone())
            .remedy("align with a pinhole camera, its distortion may be fisheye4, or export undistorted photos (PrepareDenseScene)"));
    }
    // What undoes a lens instead of describing it, as studios calibrate them.
    let undistortion = entry.get("undistortionType").and_then(Value::as_str).unwrap_or("none");
    let undone_by = entry.get("undistortionParams").map(numbers).unwrap_or_default();
    if undistortion != "none" && undone_by.iter().any(|value| *value != 0.0) {
        return Err(Error::new(ErrorKind::Unsupported, format!("the undistortion {undistortion} is not supported"))
            .at(place.clone())
            .remedy("export undistorted photos (PrepareDenseScene) and their cameras"));
    }
    let kind = distortion.unwrap_or(camera);
    // Without coefficients these are no pinholes yet: their radius goes by the angle.
    let is_by_angle = kind.contains("fisheye") || kind.starts_with("equi");
    let k = entry.get("distortionParams").map(numbers).unwrap_or_default();
    let radial = |values: &[f64]| {
        let mut numerator = [0.0; 6];
        let count = values.len().min(6);
        numerator[..count].copy_from_slice(&values[..count]);
        numerator
    };
    let polynomial = match (kind, k.as_slice()) {
        (_, values) if values.iter().all(|value| *value == 0.0) && !is_by_angle => Polynomial::default(),
        ("pinhole" | "none", _) => Polynomial::default(),
        ("radial1" | "radialk1" | "radial3" | "radialk3", values) => {
            Polynomial { numerator: radial(values), ..Default::default() }
        }
        ("brown", [k1, k2, k3, t1, t2]) => {
            Polynomial { numerator: radial(&[*k1, *k2, *k3]), tangential: [*t1, *t2], ..Default::default() }
        }
        ("fisheye" | "fisheye4", values) if values.len() <= 4 => {
            Polynomial { base: Base::Angle, numerator: radial(values), ..Default::default() }
        }
        (other, _) => {
            return Err(Error::new(ErrorKind::Unsupported, format!("the distortion {other} is not supported"))
                .at(place.clone())
                .remedy("use a radial, brown or fisheye4 model, or undistort the photos (ExportColoredPointCloud, PrepareDenseScene)"));
        }
    };
    Ok(((width as usize, height as usize), matrix(focal, centre), Lens::new(Model::Polynomial(polynomial))))
}

/// Rotation and centre of a pose.
fn pose_of(pose: &Value, place: &Place) -> Result<(DMat3, DVec3)> {
    let rotation: [f64; 9] = pose
        .get("rotation")
        .map(numbers)
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| malformed("the rotation is not nine numbers", place))?;
    let centre: [f64; 3] = pose
        .get("center")
        .map(numbers)
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| malformed("the centre is not three numbers", place))?;
    // Row by row camera to world: taken as columns it is camera from world.
    Ok((DMat3::from_cols_array(&rotation), DVec3::from_array(centre)))
}

/// Whether a view says that its pose is that of its rig.
fn is_dependent(view: &Value) -> bool {
    view.get("isPoseIndependant").is_some_and(|value| value.as_bool() == Some(false) || value.as_str() == Some("false"))
}

/// Where the camera of a view is in its rig; `None` where that was not estimated.
fn place_in_rig<'a>(rigs: &'a BTreeMap<String, Value>, rig: &str, view: &Value) -> Option<&'a Value> {
    let index: usize = name(view.get("subPoseId"))?.parse().ok()?;
    let own = rigs.get(rig)?.get("subPoses")?.get(index)?;
    let is_known = own.get("status").and_then(Value::as_str) != Some("uninitialized");
    own.get("pose").filter(|_| is_known)
}

/// That other files of cameras lie beside the one that is read.
fn told_of_others(path: &Path) -> Option<Finding> {
    let own = path.file_name().unwrap_or_default().to_string_lossy();
    let files = files_in(folder_of(path));
    let others = files.iter().filter_map(|file| file.file_name()).map(|name| name.to_string_lossy().into_owned());
    let others: Vec<String> = others.filter(|name| *name != own).collect();
    let message = format!("{own} is read, not {}", some_of(&others));
    (!others.is_empty()).then(|| {
        Finding::new(Severity::Note, "sfm-chosen", message)
            .at(Place::File(path.into()))
            .remedy("give the file in place of the folder to read another")
    })
}

/// Lists an AliceVision scene and reads its cameras.
pub fn read(path: &Path) -> Result<SourceScene> {
    let folder = folder_of(path);
    let json: Value = serde_json::from_str(&read_text(path)?).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("the file is not JSON: {error}"))
            .at(Place::Line(path.into(), error.line().max(1)))
            .remedy("export the file again as .sfm or .json (ConvertSfMFormat)")
    })?;
    let list = |key: &str| json.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let by_id = |entries: &'_ [Value], key: &str| -> BTreeMap<String, Value> {
        entries.iter().filter_map(|entry| Some((name(entry.get(key))?, entry.clone()))).collect()
    };
    let version = version_of(&json);
    let poses = by_id(list("poses"), "poseId");
    let intrinsics = by_id(list("intrinsics"), "intrinsicId");
    let rigs = by_id(list("rigs"), "rigId");
    let mut findings: Vec<Finding> = told_of_others(path).into_iter().collect();
    let (mut posed, mut unposed) = (Vec::new(), 0usize);
    // Where two views share a pose, it is that of their rig.
    let mut sharing: BTreeMap<String, usize> = BTreeMap::new();
    let pose_ids = list("views").iter().filter_map(|view| name(view.get("poseId")));
    pose_ids.for_each(|id| *sharing.entry(id).or_default() += 1);
    for view in list("views") {
        let listed = view.get("path").and_then(Value::as_str).unwrap_or_default().to_owned();
        let place = Place::View(format!("{listed} of {}", path.display()));
        let pose = name(view.get("poseId")).and_then(|id| poses.get(&id)?.get("pose")?.get("transform"));
        let entry = name(view.get("intrinsicId")).and_then(|id| intrinsics.get(&id));
        let (Some(pose), Some(entry)) = (pose, entry) else {
            unposed += 1;
            continue;
        };
        let (mut rotation, mut centre) = pose_of(pose, &place)?;
        let is_shared = name(view.get("poseId")).and_then(|id| sharing.get(&id)).is_some_and(|count| *count > 1);
        if let Some(rig) = name(view.get("rigId")).filter(|_| is_shared || is_dependent(view)) {
            let Some(own) = place_in_rig(&rigs, &rig, view) else {
                unposed += 1;
                continue;
            };
            // Camera from world is camera from rig after rig from world (AliceVision, `SfMData::getPose`).
            let (own_rotation, own_centre) = pose_of(own, &place)?;
            centre += rotation.transpose() * own_centre;
            rotation = own_rotation * rotation;
        }
        let (size, intrinsics, lens) = intrinsics_of(entry, version, &place)?;
        let translation = -(rotation * centre);
        let (camera, mut noticed) = SourceCamera::new(intrinsics, rotation, translation, &place)?;
        findings.append(&mut noticed);
        posed.push(Posed { listed, camera, lens, size: Some(size), mask: None, place });
    }
    if unposed > 0 {
        let message = format!("{unposed} views have no pose and are skipped");
        findings.push(Finding::new(Severity::Note, "camera-not-aligned", message).at(Place::File(path.into())));
    }
    let photos = PhotoIndex::of_folders(&[folder.join("images"), folder.into()].map(|path: PathBuf| path))?;
    scene_of(folder, posed, &photos, &[folder.into()], findings)
}

#[cfg(test)]
#[path = "alicevision_tests.rs"]
mod tests;
