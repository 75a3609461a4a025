//! Metashape and PhotoScan: exported `cameras.xml`, and the project `NAME.psx` with its `NAME.files/`.
//!
//! ```text
//! NAME.files/project.zip            doc.xml: chunks        NAME.files/C/chunk.zip        doc.xml: sensors, cameras
//! NAME.files/C/F/frame.zip          doc.xml: paths of photos  NAME.files/C/F/masks/masks.zip    masks by camera
//! ```
//! Camera to chunk, OpenCV axes. PhotoScan up to 1.2 writes `fx fy cx cy` in pixels and p1 p2 in OpenCV's order (measured on
//! tie points); later versions write `f`, offsets from the middle, an affinity b1 b2, and P1 P2 the other way round
//! (Metashape manual, appendix D). Cameras without a transform are not aligned: they are told.

use super::colmap_lens::matrix;
use super::mesh_choice;
use super::metashape_project::{self, Chunk, parse};
use super::photo_index::{PhotoIndex, Posed, some_of, views_of};
use super::source::{MeshFrame, SourceCamera, SourceScene};
use super::{blended_mvs::files_of, camera_file::read_text};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use glam::{DMat3, DMat4, DVec3};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The project of a folder, if it holds one.
pub fn project_of(folder: &Path) -> Option<PathBuf> {
    files_of(folder, &["psx"]).ok()?.into_iter().next()
}

/// The exported cameras of a folder, if it holds any: an XML file whose root is a document with cameras.
pub fn export_of(folder: &Path) -> Option<PathBuf> {
    files_of(folder, &["xml"]).ok()?.into_iter().find(|path| {
        let Ok(text) = read_text(path) else { return false };
        let start: String = text.chars().take(2000).collect();
        start.contains("<document") && start.contains("<chunk")
    })
}

/// The text of a child.
fn text_of<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    node.children().find(|child| child.has_tag_name(name))?.text().map(str::trim)
}

fn number_of(node: Node, name: &str) -> Option<f64> {
    text_of(node, name)?.parse().ok().filter(|value: &f64| value.is_finite())
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let values: Vec<f64> = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    values.try_into().ok()
}

/// A sensor's calibration.
struct Sensor {
    size: (usize, usize),
    intrinsics: DMat3,
    lens: Lens,
}

fn sensor(node: Node, place: &Place) -> Result<Option<Sensor>> {
    let all = || node.children().filter(|child| child.has_tag_name("calibration"));
    let adjusted = all().find(|child| child.attribute("class") == Some("adjusted"));
    let Some(calibration) = adjusted.or_else(|| all().next()) else { return Ok(None) };
    let resolution = |node: Node| {
        let found = node.children().find(|child| child.has_tag_name("resolution"))?;
        Some((found.attribute("width")?.parse().ok()?, found.attribute("height")?.parse().ok()?))
    };
    let size: Option<(usize, usize)> = resolution(calibration).or_else(|| resolution(node));
    let size = size.ok_or_else(|| {
        Error::new(ErrorKind::Malformed, "a sensor has no resolution")
            .at(place.clone())
            .remedy("export the cameras again")
    })?;
    let kind = calibration.attribute("type").or_else(|| node.attribute("type")).unwrap_or("frame");
    let base = match kind {
        "frame" => Base::Plane,
        "fisheye" | "equidistant_fisheye" => Base::Angle,
        other => {
            return Err(Error::new(ErrorKind::Unsupported, format!("a sensor of the type {other} is not supported"))
                .at(place.clone())
                .remedy("frame and fisheye are read: export undistorted photos for the others"));
        }
    };
    let number = |name: &str| number_of(calibration, name).unwrap_or(0.0);
    let [k1, k2, k3, k4] = ["k1", "k2", "k3", "k4"].map(number);
    let radial = Polynomial { base, numerator: [k1, k2, k3, k4, 0.0, 0.0], ..Default::default() };
    if let Some(focal_x) = number_of(calibration, "fx") {
        let focal_y = number_of(calibration, "fy").unwrap_or(focal_x);
        let skew = number("skew");
        let polynomial = Polynomial { tangential: [number("p1"), number("p2")], ..radial };
        let lens = Lens { model: Model::Polynomial(polynomial), shear: skew / focal_x };
        return Ok(Some(Sensor { size, intrinsics: matrix([focal_x, focal_y], [number("cx"), number("cy")]), lens }));
    }
    let Some(focal) = number_of(calibration, "f") else { return Ok(None) };
    let polynomial = Polynomial {
        tangential: [number("p2"), number("p1")],
        tangential_growth: [number("p3"), number("p4")],
        ..radial
    };
    let centre = [0.5 * size.0 as f64 + number("cx"), 0.5 * size.1 as f64 + number("cy")];
    let focal_x = focal + number("b1");
    let lens = Lens { model: Model::Polynomial(polynomial), shear: number("b2") / focal_x };
    Ok(Some(Sensor { size, intrinsics: matrix([focal_x, focal], centre), lens }))
}

/// The cameras of a chunk. `paths` and `masks` are those of the photos by the number of their camera; the label stands in for
/// a path that is not known.
pub fn posed_of(
    chunk: Node,
    paths: &BTreeMap<String, String>,
    masks: &BTreeMap<String, PathBuf>,
    file: &Path,
    findings: &mut Vec<Finding>,
) -> Result<Vec<Posed>> {
    let place = Place::File(file.into());
    let mut sensors = BTreeMap::new();
    for node in chunk.descendants().filter(|node| node.has_tag_name("sensor")) {
        if let (Some(id), Some(sensor)) = (node.attribute("id"), sensor(node, &place)?) {
            sensors.insert(id, sensor);
        }
    }
    let Some(list) = chunk.children().find(|node| node.has_tag_name("cameras")) else { return Ok(Vec::new()) };
    let (mut posed, mut unaligned, mut excluded) = (Vec::new(), Vec::new(), Vec::new());
    for node in list.descendants().filter(|node| node.has_tag_name("camera")) {
        let label = node.attribute("label").unwrap_or_default().to_owned();
        if matches!(node.attribute("enabled"), Some("false" | "0")) {
            excluded.push(label);
            continue;
        }
        let transform = text_of(node, "transform");
        let (Some(transform), Some(sensor)) = (transform, node.attribute("sensor_id").and_then(|id| sensors.get(id)))
        else {
            unaligned.push(label);
            continue;
        };
        let place = Place::View(format!("{label} of {}", file.display()));
        let rows: [f64; 16] = numbers(transform).ok_or_else(|| {
            Error::new(ErrorKind::Malformed, "the transform of the camera is not 16 numbers")
                .at(place.clone())
                .remedy("export the cameras again")
        })?;
        let chunk_from_camera = DMat4::from_cols_array(&rows).transpose();
        let rotation = DMat3::from_mat4(chunk_from_camera).transpose();
        let translation = -(rotation * chunk_from_camera.w_axis.truncate());
        let (camera, mut noticed) = SourceCamera::new(sensor.intrinsics, rotation, translation, &place)?;
        findings.append(&mut noticed);
        let listed = node.attribute("id").and_then(|id| paths.get(id)).cloned().unwrap_or(label);
        let mask = node.attribute("id").and_then(|id| masks.get(id)).cloned();
        posed.push(Posed { listed, camera, lens: sensor.lens.clone(), size: Some(sensor.size), mask, place });
    }
    for (names, code, what) in [
        (unaligned, "camera-not-aligned", "are not aligned and are skipped"),
        (excluded, "camera-disabled", "are disabled in the project and are skipped"),
    ] {
        if !names.is_empty() {
            let message = format!("{} cameras {what}: {}", names.len(), some_of(&names));
            findings.push(Finding::new(Severity::Note, code, message).at(Place::File(file.into())));
        }
    }
    Ok(posed)
}

/// `world_from_chunk` of a chunk, where it has one.
pub fn chunk_transform(chunk: Node) -> Option<DMat4> {
    let node = chunk.children().find(|node| node.has_tag_name("transform"))?;
    let rotation: [f64; 9] = numbers(text_of(node, "rotation")?)?;
    let translation: [f64; 3] = text_of(node, "translation").and_then(numbers).unwrap_or_default();
    let scale = number_of(node, "scale").unwrap_or(1.0);
    let linear = DMat3::from_cols_array(&rotation).transpose() * scale;
    let matrix = DMat4::from_translation(DVec3::from_array(translation)) * DMat4::from_mat3(linear);
    (matrix.determinant().abs() > 1e-18).then_some(matrix)
}

fn photos_of(folder: &Path) -> Result<PhotoIndex> {
    PhotoIndex::of_folders(&[folder.join("images"), folder.into()].map(|path: PathBuf| path))
}

fn finish(
    folder: &Path,
    posed: Vec<Posed>,
    transform: Option<DMat4>,
    photos: &PhotoIndex,
    mut findings: Vec<Finding>,
) -> Result<SourceScene> {
    let views = views_of(posed, photos, &[folder.join("masks"), folder.join("mask")], &mut findings)?;
    let mesh = mesh_choice::find(&[folder.into()], &mut findings);
    let mut scene = SourceScene::of_photographs(folder, mesh, views);
    if let Some(world_from_chunk) = transform {
        // A mesh may be exported in the chunk's frame or in the world's.
        let source_from_mesh = world_from_chunk.inverse();
        scene.mesh_frames.push(MeshFrame { name: "the transform of the chunk", source_from_mesh });
    }
    scene.findings = findings;
    Ok(scene)
}

/// Reads exported cameras.
pub fn read_export(file: &Path) -> Result<SourceScene> {
    let text = read_text(file)?;
    let document = parse(&text, file)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let photos = photos_of(folder)?;
    let mut findings = Vec::new();
    let mut best: Option<(usize, Vec<Posed>, Option<DMat4>)> = None;
    for chunk in document.descendants().filter(|node| node.has_tag_name("chunk")) {
        let posed = posed_of(chunk, &BTreeMap::new(), &BTreeMap::new(), file, &mut findings)?;
        let here = photos.count(posed.iter().map(|own| own.listed.as_str()));
        if best.as_ref().is_none_or(|(most, ..)| here > *most) {
            best = Some((here, posed, chunk_transform(chunk)));
        }
    }
    let (_, posed, transform) = best.ok_or_else(|| {
        Error::new(ErrorKind::Malformed, "the file holds no chunk with cameras")
            .at(Place::File(file.into()))
            .remedy("export cameras with File > Export > Export Cameras")
    })?;
    finish(folder, posed, transform, &photos, findings)
}

/// Reads a project; `asked` is the label or the number of the chunk, otherwise the one most of whose photos are here.
pub fn read_project(file: &Path, asked: Option<&str>) -> Result<SourceScene> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let photos = photos_of(folder)?;
    let chunks = metashape_project::chunks(file)?;
    let chosen = choose(chunks, asked, &photos, file)?;
    let mut findings = vec![chosen.1];
    let chunk = chosen.0;
    let document = parse(&chunk.text, &chunk.file)?;
    let posed = posed_of(document.root_element(), &chunk.photos, &chunk.masks, &chunk.file, &mut findings)?;
    if let Some(absent) = &chunk.absent_masks {
        let message = "the project has masks of its own, but their archive is not there";
        let remedy = "copy it along with the project, or put masks named after the photos into a folder masks/";
        findings
            .push(Finding::new(Severity::Note, "masks-absent", message).at(Place::File(absent.clone())).remedy(remedy));
    }
    finish(folder, posed, chunk_transform(document.root_element()), &photos, findings)
}

fn choose(chunks: Vec<Chunk>, asked: Option<&str>, photos: &PhotoIndex, file: &Path) -> Result<(Chunk, Finding)> {
    let labels: Vec<String> = chunks.iter().map(|chunk| format!("{} ({})", chunk.label, chunk.id)).collect();
    let count = chunks.len();
    let remedy = || format!("choose one with --chunk: {}", labels.join(", "));
    let failed = |kind, message: String| Err(Error::new(kind, message).at(Place::File(file.into())).remedy(remedy()));
    if let Some(asked) = asked {
        return match chunks.into_iter().find(|chunk| chunk.label == asked || chunk.id == asked) {
            Some(chunk) => {
                let message = format!("the chunk {} was asked for", chunk.label);
                Ok((chunk, Finding::new(Severity::Note, "chunk-chosen", message)))
            }
            None => failed(ErrorKind::InvalidSetting, format!("the project has no chunk '{asked}'")),
        };
    }
    // Of chunks with the same photos here the one with the fewest others: a merged chunk holds them all.
    let here = |chunk: &Chunk| photos.count(chunk.photos.values().map(String::as_str));
    let mut ranked: Vec<(usize, std::cmp::Reverse<usize>, usize)> = chunks
        .iter()
        .enumerate()
        .map(|(index, chunk)| (here(chunk), std::cmp::Reverse(chunk.photos.len()), index))
        .collect();
    ranked.sort_by(|a, b| (b.0, b.1).cmp(&(a.0, a.1)).then(a.2.cmp(&b.2)));
    let Some(&(found, _, index)) = ranked.first() else {
        return failed(ErrorKind::InvalidScene, "the project has no chunks".into());
    };
    let Some(chunk) = chunks.into_iter().nth(index) else {
        return failed(ErrorKind::InvalidScene, "the project has no chunks".into());
    };
    let message = format!(
        "of {count} chunks the one labelled {} is read: {found} of its {} photos are here, no other has more",
        chunk.label,
        chunk.photos.len()
    );
    Ok((chunk, Finding::new(Severity::Note, "chunk-chosen", message).remedy(remedy())))
}

#[cfg(test)]
#[path = "metashape_tests.rs"]
mod tests;
