//! The cameras of a Metashape or PhotoScan chunk: sensors, poses, and the frame they stand in.
//!
//! Only what is used is read: a sensor that no aligned camera has may be of any kind. From version 1.5 on a chunk consists of
//! components, each with a transform to the world of its own, and what could not be connected stands in different ones:
//! cameras of another component are brought over where both transforms are known, and told of where not.
//!
//! Of a rig only the master's cameras may have a pose of their own. Those of a slave are where the sensor's `rotation` and
//! `location` put them: `source_from_slave = source_from_master * [R | t]`, R from the slave's axes to the master's and t the
//! slave's centre in the master's frame (PhotogrammetryCommunity, Metashape expert manual, "The slave-sensor transform").

mod components;

use super::colmap_lens::matrix;
use super::photo_index::some_of;
use super::posed::Posed;
use super::source::SourceCamera;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::lens::{Base, Lens, Model, Polynomial};
use components::Components;
use glam::{DMat3, DMat4, DVec3};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The text of a child.
fn text_of<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    node.children().find(|child| child.has_tag_name(name))?.text().map(str::trim)
}

/// A number of a child; one that is written but is none is not a number, which is refused where it is used.
fn number_of(node: Node, name: &str) -> Option<f64> {
    Some(text_of(node, name)?.parse().unwrap_or(f64::NAN))
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let values: Vec<f64> = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    values.try_into().ok()
}

/// A sensor's calibration.
#[derive(Clone)]
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

/// The cameras of a chunk as they are listed.
struct Camera<'a, 'b> {
    node: Node<'a, 'b>,
    label: &'a str,
    /// Label of the group it is in, which may be the folder of its photo.
    group: Option<&'a str>,
    transform: Option<&'a str>,
}

impl Camera<'_, '_> {
    /// The path of its photo as far as labels tell: within its group.
    fn listed(&self) -> String {
        self.group.map_or_else(|| self.label.to_owned(), |group| format!("{group}/{}", self.label))
    }
}

fn is_disabled(node: Node) -> bool {
    matches!(node.attribute("enabled"), Some("false" | "0"))
}

fn cameras_of<'a, 'b>(chunk: Node<'a, 'b>) -> Vec<Camera<'a, 'b>> {
    let list = chunk.children().find(|node| node.has_tag_name("cameras"));
    let nodes = list.into_iter().flat_map(|list| list.descendants()).filter(|node| node.has_tag_name("camera"));
    nodes
        .map(|node| Camera {
            node,
            label: node.attribute("label").unwrap_or_default(),
            group: node
                .parent()
                .filter(|parent| parent.has_tag_name("group"))
                .and_then(|group| group.attribute("label")),
            transform: text_of(node, "transform"),
        })
        .collect()
}

/// The labels of the cameras of a chunk that are aligned and enabled.
pub fn aligned_labels(chunk: Node) -> Vec<String> {
    let (cameras, sensors) = (cameras_of(chunk), sensors_of(chunk));
    let is_placed = |camera: &Camera| camera.transform.is_some() || on_rig(camera.node, &cameras, &sensors).is_some();
    let used = cameras.iter().filter(|camera| !is_disabled(camera.node) && is_placed(camera));
    used.map(Camera::listed).collect()
}

fn sensors_of<'a, 'b>(chunk: Node<'a, 'b>) -> BTreeMap<&'a str, Node<'a, 'b>> {
    let nodes = chunk.descendants().filter(|node| node.has_tag_name("sensor"));
    nodes.filter_map(|node| Some((node.attribute("id")?, node))).collect()
}

/// The number of the master that a camera or a sensor hangs on; `None` for one that is its own.
fn master_of<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.attribute("master_id").filter(|id| Some(*id) != node.attribute("id"))
}

/// `master_from_slave` of a sensor; `None` where it says nothing, or no numbers.
fn offset_of(sensor: Node) -> Option<DMat4> {
    let written = |name| text_of(sensor, name).filter(|text| !text.is_empty());
    let (rotation, location) = (written("rotation"), written("location"));
    if rotation.is_none() && location.is_none() {
        return None;
    }
    let rotation = rotation.map_or(Some(DMat3::IDENTITY.to_cols_array()), numbers)?;
    let location = location.map_or(Some([0.0; 3]), numbers)?;
    let linear = DMat3::from_cols_array(&rotation).transpose();
    Some(DMat4::from_translation(DVec3::from_array(location)) * DMat4::from_mat3(linear))
}

/// The transform and the component of a camera's master, and where its sensor stands on it; `None` where a part is missing,
/// or the sensor's offset is from another sensor than the master's.
fn on_rig<'a>(
    camera: Node<'a, '_>,
    cameras: &[Camera<'a, '_>],
    sensors: &BTreeMap<&str, Node>,
) -> Option<(&'a str, Option<&'a str>, DMat4)> {
    let master = cameras
        .iter()
        .find(|own| own.node.attribute("id").is_some() && own.node.attribute("id") == master_of(camera))?;
    let sensor = *sensors.get(camera.attribute("sensor_id")?)?;
    let is_of_master = master_of(sensor).is_some() && master_of(sensor) == master.node.attribute("sensor_id");
    let offset = offset_of(sensor).filter(|_| is_of_master)?;
    let component = master.node.attribute("component_id").or(camera.attribute("component_id"));
    Some((master.transform?, component, offset))
}

/// The cameras of a chunk and the frame they stand in.
pub struct Cameras {
    /// The cameras.
    pub posed: Vec<Posed>,
    /// `world_from_source`, where it is known: a mesh may be exported in either frame.
    pub transform: Option<DMat4>,
}

/// The cameras of a chunk. `paths` and `masks` are those of the photos by the number of their camera; the label stands in for
/// a path that is not known.
///
/// # Errors
/// `Missing` where no camera has a pose and a calibration, `Unsupported` for a used sensor that is no frame or fisheye,
/// `Malformed` for a pose that is none.
pub fn read(
    chunk: Node,
    paths: &BTreeMap<String, String>,
    masks: &BTreeMap<String, PathBuf>,
    file: &Path,
    findings: &mut Vec<Finding>,
) -> Result<Cameras> {
    let (nodes, listed) = (sensors_of(chunk), cameras_of(chunk));
    let mut sensors: BTreeMap<&str, Option<Sensor>> = BTreeMap::new();
    let mut posed = Vec::new();
    let (mut unaligned, mut of_rigs, mut excluded, mut uncalibrated) = (vec![], vec![], vec![], vec![]);
    let mut on_rigs = Vec::new();
    for camera in &listed {
        let &Camera { node, label, transform, .. } = camera;
        if is_disabled(node) {
            excluded.push(label.to_owned());
            continue;
        }
        let sensor_id = node.attribute("sensor_id").unwrap_or_default();
        // Without a pose of its own it may hang on that of the rig's master.
        let own = transform.map(|transform| (transform, node.attribute("component_id"), DMat4::IDENTITY));
        let Some((transform, component, offset)) = own.or_else(|| on_rig(node, &listed, &nodes)) else {
            let is_of_rig =
                master_of(node).is_some() || nodes.get(sensor_id).is_some_and(|own| master_of(*own).is_some());
            if is_of_rig {
                of_rigs.push(label.to_owned())
            } else {
                unaligned.push(label.to_owned())
            }
            continue;
        };
        let is_on_rig = own.is_none();
        if !sensors.contains_key(sensor_id) {
            let place = Place::File(file.into());
            sensors.insert(sensor_id, nodes.get(sensor_id).map_or(Ok(None), |node| sensor(*node, &place))?);
        }
        let Some(sensor) = sensors.get(sensor_id).cloned().flatten() else {
            uncalibrated.push(label.to_owned());
            continue;
        };
        let place = Place::View(format!("{label} of {}", file.display()));
        let rows: [f64; 16] = numbers(transform).ok_or_else(|| {
            Error::new(ErrorKind::Malformed, "the transform of the camera is not 16 numbers")
                .at(place.clone())
                .remedy("export the cameras again")
        })?;
        let source_from_camera = DMat4::from_cols_array(&rows).transpose() * offset;
        on_rigs.extend(is_on_rig.then(|| label.to_owned()));
        let id = node.attribute("id");
        let listed = id.and_then(|id| paths.get(id)).cloned().unwrap_or_else(|| camera.listed());
        let mask = id.and_then(|id| masks.get(id)).cloned();
        posed.push((component, source_from_camera, sensor, listed, mask, place));
    }
    if posed.is_empty() && !(of_rigs.is_empty() && uncalibrated.is_empty()) {
        let (message, remedy) = if uncalibrated.is_empty() {
            ("no camera has a pose of its own: all hang on the master of a rig, which has none here", RIG_REMEDY)
        } else {
            ("the file holds poses but no calibration", CALIBRATION_REMEDY)
        };
        return Err(Error::new(ErrorKind::Missing, message).at(Place::File(file.into())).remedy(remedy));
    }
    let components = Components::of(chunk);
    let main = components.with_most(posed.iter().map(|own| own.0));
    let mut elsewhere = Vec::new();
    let mut cameras = Vec::new();
    for (component, source_from_camera, sensor, listed, mask, place) in posed {
        let Some(moved) = components.between(main, component) else {
            elsewhere.push(listed);
            continue;
        };
        let source_from_camera = moved * source_from_camera;
        // A component's transform has a scale, a camera has none.
        let scale = DMat3::from_mat4(moved).determinant().abs().cbrt();
        let rotation = (DMat3::from_mat4(source_from_camera) * (1.0 / scale)).transpose();
        let translation = -(rotation * source_from_camera.w_axis.truncate());
        let (camera, mut noticed) = SourceCamera::new(sensor.intrinsics, rotation, translation, &place)?;
        findings.append(&mut noticed);
        cameras.push(Posed { listed, camera, lens: sensor.lens, size: Some(sensor.size), mask, place });
    }
    for (names, severity, code, what, remedy) in [
        (unaligned, Severity::Note, "camera-not-aligned", "are not aligned and are skipped", ""),
        (excluded, Severity::Note, "camera-disabled", "are disabled in the project and are skipped", ""),
        (
            on_rigs,
            Severity::Note,
            "camera-on-rig",
            "are placed by the pose of their rig's master and the offset of their sensor, in the units of the cameras",
            "",
        ),
        (
            of_rigs,
            Severity::Warning,
            "camera-of-rig",
            "hang on the master of a rig, whose pose or whose offset from theirs is not there: they are skipped",
            RIG_REMEDY,
        ),
        (
            uncalibrated,
            Severity::Warning,
            "camera-not-calibrated",
            "have a pose but no calibration: they are skipped",
            CALIBRATION_REMEDY,
        ),
        (
            elsewhere,
            Severity::Warning,
            "camera-of-other-component",
            "belong to another component, whose place is not known: they are skipped",
            "merge the components in Metashape (Workflow > Align Photos, or markers), and export again",
        ),
    ] {
        if !names.is_empty() {
            let message = format!("{} cameras {what}: {}", names.len(), some_of(&names));
            let told = Finding::new(severity, code, message).at(Place::File(file.into()));
            findings.push(if remedy.is_empty() { told } else { told.remedy(remedy) });
        }
    }
    Ok(Cameras { posed: cameras, transform: components.transform(main) })
}

const RIG_REMEDY: &str =
    "export the cameras for COLMAP (File > Export > Export Cameras), where each has a pose of its own";
const CALIBRATION_REMEDY: &str = "align the photos in Metashape, then export with File > Export > Export Cameras";
