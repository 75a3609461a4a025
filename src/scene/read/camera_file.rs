//! Files that hold cameras: `*_cam.txt` and `pair.txt` of the MVSNet family, and `cameras.json`.

use super::source::SourceCamera;
pub use super::text::read as read_text;
use super::text::{self, Words};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::stem_of;
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// Reads a camera file of BlendedMVS: `extrinsic` 4x4, `intrinsic` 3x3, and a last line of 2 or 4 numbers (depth range),
/// which may be missing.
///
/// Yao et al. 2020, "BlendedMVS"; the layout is MVSNet's (Yao et al. 2018).
pub fn read_cam_txt(path: &Path) -> Result<(SourceCamera, Vec<Finding>)> {
    let text = text::read(path)?;
    let mut words = Words::new(path, &text);
    words.keyword("extrinsic")?;
    let mut extrinsic = [0.0; 16];
    for value in &mut extrinsic {
        *value = words.number("the extrinsic matrix")?;
    }
    words.keyword("intrinsic")?;
    let mut intrinsic = [0.0; 9];
    for value in &mut intrinsic {
        *value = words.number("the intrinsic matrix")?;
    }
    // The depth range is not used here: whatever stands for it is no reason to refuse a camera.
    let noticed = words.finding();
    let depth_line = words.line();
    let depth_numbers = words.left();
    let (camera, mut findings) = camera_from_rows(&intrinsic, &extrinsic, &Place::File(path.into()))?;
    findings.extend(noticed);
    if !matches!(depth_numbers, 0 | 2 | 4) {
        let message = format!("the depth range has {depth_numbers} words, not 2 or 4: it is not used");
        findings.push(
            Finding::new(Severity::Note, "camera-depth-ignored", message).at(Place::Line(path.into(), depth_line)),
        );
    }
    Ok((camera, findings))
}

/// A camera from row-major 3x3 intrinsics and 4x4 `camera_from_source`.
pub fn camera_from_rows(
    intrinsic: &[f64; 9],
    extrinsic: &[f64; 16],
    place: &Place,
) -> Result<(SourceCamera, Vec<Finding>)> {
    let rows = |row: usize| DVec3::new(extrinsic[4 * row], extrinsic[4 * row + 1], extrinsic[4 * row + 2]);
    let rotation = DMat3::from_cols(rows(0), rows(1), rows(2)).transpose();
    let translation = DVec3::new(extrinsic[3], extrinsic[7], extrinsic[11]);
    let last = &extrinsic[12..];
    if last[..3].iter().any(|value| value.abs() > 1e-6) || (last[3] - 1.0).abs() > 1e-6 {
        return Err(Error::new(ErrorKind::InvalidScene, "the last row of the extrinsics is not 0 0 0 1")
            .at(place.clone())
            .remedy("the matrix may be transposed: export it row by row, camera from world"));
    }
    SourceCamera::new(DMat3::from_cols_array(intrinsic).transpose(), rotation, translation, place)
}

/// The best neighbours of each view: (view, [(neighbour, score)]).
pub type Pairs = Vec<(usize, Vec<(usize, f64)>)>;

/// Reads `pair.txt`: the number of views, then for each its index and `count id score id score ...`.
pub fn read_pairs(path: &Path) -> Result<Pairs> {
    let text = text::read(path)?;
    let mut words = Words::new(path, &text);
    let count = words.index("the number of views")?;
    let mut pairs = Vec::new();
    for _ in 0..count {
        let view = words.index("the index of a view")?;
        let neighbours = words.index("the number of neighbours")?;
        let mut list = Vec::new();
        for _ in 0..neighbours {
            list.push((words.index("the index of a neighbour")?, words.number("the score of a neighbour")?));
        }
        pairs.push((view, list));
    }
    if words.left() > 0 {
        return Err(words.malformed(format!("more follows after the {count} views")));
    }
    Ok(pairs)
}

/// One entry of `cameras.json`.
pub struct JsonView {
    /// Marked to be kept out of the fit.
    pub held_out: bool,
    /// The photo's file, as written.
    pub file: PathBuf,
    /// Width and height, where given.
    pub size: Option<(usize, usize)>,
    /// The camera.
    pub camera: SourceCamera,
    /// Where it is written.
    pub place: Place,
}

#[derive(serde::Deserialize)]
struct CamerasJson {
    #[serde(default)]
    convention: Option<String>,
    views: Vec<ViewJson>,
}

#[derive(serde::Deserialize)]
struct ViewJson {
    file: PathBuf,
    width: Option<usize>,
    height: Option<usize>,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(default)]
    held_out: bool,
    w2c: [[f64; 4]; 4],
    #[serde(default)]
    distortion: Vec<f64>,
}

/// Reads `cameras.json`: `{"convention":"opencv","views":[{"file","width","height","K":3x3,"w2c":4x4}]}`.
pub fn read_cameras_json(path: &Path) -> Result<(Vec<JsonView>, Vec<Finding>)> {
    let text = text::read(path)?;
    let json: CamerasJson = serde_json::from_str(&text).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("not a list of cameras: {error}"))
            .at(Place::Line(path.into(), error.line().max(1)))
            .remedy("give {\"convention\":\"opencv\",\"views\":[{\"file\",\"width\",\"height\",\"K\",\"w2c\"}]}; NaN is not a number of JSON")
    })?;
    if json.convention.as_deref().is_some_and(|convention| convention != "opencv") {
        return Err(Error::new(
            ErrorKind::Unsupported,
            format!("the camera convention is '{}'", json.convention.unwrap_or_default()),
        )
        .at(Place::File(path.into()))
        .remedy("export cameras as opencv: x right, y down, z forward"));
    }
    let mut views = Vec::new();
    let mut findings = Vec::new();
    for view in json.views {
        let name = stem_of(&view.file);
        let place = Place::View(format!("{name} of {}", path.display()));
        if view.distortion.iter().any(|&coefficient| coefficient != 0.0) {
            return Err(Error::new(ErrorKind::Unsupported, "the camera has lens distortion")
                .at(place)
                .remedy("undistort the photos first (COLMAP: image_undistorter)"));
        }
        let mut extrinsic = [0.0; 16];
        extrinsic.copy_from_slice(view.w2c.as_flattened());
        let mut intrinsic = [0.0; 9];
        intrinsic.copy_from_slice(view.k.as_flattened());
        let (camera, mut noticed) = camera_from_rows(&intrinsic, &extrinsic, &place)?;
        findings.append(&mut noticed);
        views.push(JsonView {
            held_out: view.held_out,
            file: view.file,
            size: view.width.zip(view.height),
            camera,
            place,
        });
    }
    Ok((views, findings))
}
