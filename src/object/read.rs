//! From files to views: photo, mesh, camera, mask.

use super::geometry::ObjectGeometry;
use super::observations::ObjectView;
use super::outline::{OutlineCircle, circle_of};
use super::photo::ObjectPhoto;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file::{self, MaskFile, MaskValues, MaskWay};
use crate::scene::read::source::SourceCamera;
use crate::scene::read::world::{up_in_source, world_from_source};
use crate::scene::read::{camera_file, mesh_file};
use crate::scene::settings::{PixelCentre, Up};
use crate::trace::Bvh;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The files of an estimation.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct ObjectFiles {
    /// Photos, at least one.
    pub photos: Vec<PathBuf>,
    /// One mask a photo, or none at all: 0.5 and above is object.
    pub masks: Vec<PathBuf>,
    /// The mesh; `None` for a sphere seen from infinitely far.
    pub mesh: Option<PathBuf>,
    /// One picture of normals a photo, in place of a mesh; none at all otherwise.
    pub normals: Vec<PathBuf>,
    /// `cameras.json`, or one BlendedMVS camera file a photo.
    pub cameras: Vec<PathBuf>,
    /// Which axis of mesh and cameras points up.
    pub up: Up,
    /// Where the source puts pixel centres; `Auto` is by the kind of the camera file.
    pub pixel_centre: PixelCentre,
}

/// Reads photos and what they show.
///
/// # Errors
/// Anything missing, damaged or contradictory, with place and remedy.
pub fn read_views(files: &ObjectFiles) -> Result<(Vec<ObjectView>, Vec<Finding>)> {
    let wrong = |setting: &str, message: String| {
        Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(setting.into()))
    };
    if !files.masks.is_empty() && files.masks.len() != files.photos.len() {
        let message = format!("{} masks for {} photos", files.masks.len(), files.photos.len());
        return Err(wrong("mask", message).remedy("give one mask a photo, in the same order, or none"));
    }
    if !files.normals.is_empty() && files.normals.len() != files.photos.len() {
        let message = format!("{} pictures of normals for {} photos", files.normals.len(), files.photos.len());
        return Err(wrong("normals", message).remedy("give one a photo, in the same order"));
    }
    let mut findings = Vec::new();
    let masks = files.masks.iter().map(|path| MaskFile::open(path)).collect::<Result<Vec<_>>>()?;
    let way = MaskWay::of_set(masks.iter().map(MaskFile::facts));
    let mut masks = files.masks.iter().zip(masks);
    let mut photos = Vec::new();
    for path in &files.photos {
        let (mut photo, mut noticed) = ObjectPhoto::read(path)?;
        findings.append(&mut noticed);
        if let Some((mask, file)) = masks.next() {
            let MaskValues { values, told, .. } = file.into_values(way);
            findings.extend(told.map(|told| told.at(Place::File(mask.clone()))));
            photo.apply_mask(&values, Place::File(mask.clone()))?;
        }
        photos.push(photo);
    }
    let geometries = match &files.mesh {
        None if !files.normals.is_empty() => {
            let of = |path: &PathBuf| {
                let normals = file::read_rgb(path)?;
                ObjectGeometry::of_normals(&normals, Vec3::Z).map_err(|error| error.at(Place::File(path.clone())))
            };
            files.normals.iter().map(of).collect::<Result<Vec<_>>>()?
        }
        None => photos.iter().map(|photo| sphere_in(photo, !files.masks.is_empty(), &mut findings)).collect(),
        Some(mesh) => geometries_of_mesh(files, mesh, &photos, &mut findings)?,
    };
    let views = photos.into_iter().zip(geometries).map(|(photo, geometry)| ObjectView::new(photo, geometry));
    Ok((views.collect::<Result<Vec<_>>>()?, crate::scene::read::repeated::joined(findings)))
}

/// Less of an outline on its circle than this is no ball's.
const ROUND_SHARE: f64 = 0.75;
/// A ball is told to be elsewhere than where it is taken to be from so many radii on.
const OFF: f64 = 0.03;
/// Darker than this share of the median is what surrounds an object that was cut out or rendered alone.
const SURROUND: f32 = 1e-3;

/// The ball in a photo: where its mask says, else the one that fills the photo. What does not look like it is told.
fn sphere_in(photo: &ObjectPhoto, has_mask: bool, findings: &mut Vec<Finding>) -> ObjectGeometry {
    let (width, height) = (photo.radiance.width(), photo.radiance.height());
    let filling = OutlineCircle::filling(width, height);
    let place = || Place::View(photo.name.clone());
    let mut circle = filling;
    if has_mask {
        match circle_of(&photo.is_object) {
            Some(found) if found.share >= ROUND_SHARE => {
                circle = found;
                if filling.distance(&found) > OFF {
                    let message = format!("the ball is taken to be where its mask is: {}", in_words(&found));
                    let told = Finding::new(Severity::Note, "sphere-from-mask", message).at(place());
                    findings.push(told.extent(filling.distance(&found)));
                }
            }
            found => {
                let on = found.map_or(0.0, |found| 100.0 * found.share);
                let message = format!(
                    "the mask is not that of a ball: {on:.0} % of its outline lie on a circle; the ball is taken to fill \
                     the photo"
                );
                findings.push(
                    Finding::new(Severity::Warning, "sphere-mask-not-round", message)
                        .at(place())
                        .remedy("mask the whole ball and nothing else, or give the shape with --mesh or --normals")
                        .extent(100.0 - on),
                );
            }
        }
    } else if let Some(found) = bright_disc(photo, &filling)
        && filling.distance(&found) > OFF
    {
        let message = format!(
            "the ball is taken to fill the photo, but what is not black lies on another circle: {}",
            in_words(&found)
        );
        findings.push(
            Finding::new(Severity::Warning, "sphere-off-centre", message)
                .at(place())
                .remedy("give its silhouette with --mask, or crop the photo to the ball")
                .extent(filling.distance(&found)),
        );
    }
    ObjectGeometry::sphere_at(width, height, circle.centre.as_vec2(), circle.radius as f32)
}

fn in_words(circle: &OutlineCircle) -> String {
    format!("centre at {:.1}, {:.1}, radius {:.1} pixels", circle.centre.x, circle.centre.y, circle.radius)
}

/// The circle around all that is not black, where the corners of the photo are: only then does the photo itself show
/// where the object ends.
fn bright_disc(photo: &ObjectPhoto, filling: &OutlineCircle) -> Option<OutlineCircle> {
    let levels = photo.radiance.map(|pixel| pixel.max_element());
    let mut sorted: Vec<f32> = levels.pixels().iter().copied().filter(|level| *level > 0.0).collect();
    sorted.sort_by(f32::total_cmp);
    let threshold = SURROUND * sorted.get(sorted.len() / 2)?;
    let is_bright = levels.map(|level| *level > threshold);
    let (width, height) = (levels.width(), levels.height());
    let corners = [(0, 0), (0, width - 1), (height - 1, 0), (height - 1, width - 1)];
    if filling.radius < 4.0 || corners.iter().any(|corner| is_bright[*corner]) {
        return None;
    }
    circle_of(&is_bright).filter(|found| found.share >= ROUND_SHARE)
}

fn geometries_of_mesh(
    files: &ObjectFiles,
    mesh: &Path,
    photos: &[ObjectPhoto],
    findings: &mut Vec<Finding>,
) -> Result<Vec<ObjectGeometry>> {
    let (cameras, default_centre) = source_cameras(files, findings)?;
    let source = mesh_file::read_pieces(&[mesh.to_path_buf()])?;
    let (up, mut noticed) = up_in_source(files.up, &cameras)?;
    findings.append(&mut noticed);
    let world = world_from_source(up, source.bounds());
    let (mut mesh, mut noticed) = source.into_world(&world);
    findings.append(&mut noticed);
    mesh.validate()?;
    if mesh.normals.len() != mesh.positions.len() {
        mesh.compute_normals();
    }
    let bvh = Arc::new(Bvh::build(&mesh.positions, &mesh.triangles)?);
    let centre = if files.pixel_centre == PixelCentre::Auto { default_centre } else { files.pixel_centre };
    cameras
        .iter()
        .zip(photos)
        .map(|(camera, photo)| {
            let size = (photo.radiance.width(), photo.radiance.height());
            let camera = camera.in_world(&world, size, centre.shift_pixels());
            camera.validate(1e-2)?;
            Ok(ObjectGeometry::of_mesh_with(&mesh, Arc::clone(&bvh), &camera))
        })
        .collect()
}

/// The camera of each photo, and where its kind of file puts pixel centres.
fn source_cameras(files: &ObjectFiles, findings: &mut Vec<Finding>) -> Result<(Vec<SourceCamera>, PixelCentre)> {
    let missing = |message: String| {
        Error::new(ErrorKind::Missing, message)
            .at(Place::Setting("camera".into()))
            .remedy("give cameras.json, or one BlendedMVS camera file a photo, in the same order")
    };
    let Some(first) = files.cameras.first() else {
        return Err(missing("a mesh needs a camera".into()));
    };
    if first.extension().is_some_and(|extension| extension == "json") {
        let (listed, mut noticed) = camera_file::read_cameras_json(first)?;
        findings.append(&mut noticed);
        let cameras = files.photos.iter().map(|photo| {
            let stem = photo.file_stem();
            let only = if listed.len() == 1 && files.photos.len() == 1 { listed.first() } else { None };
            let found = listed.iter().find(|view| view.file.file_stem() == stem).or(only);
            found
                .map(|view| view.camera)
                .ok_or_else(|| missing(format!("{} has no camera for {}", first.display(), photo.display())))
        });
        return Ok((cameras.collect::<Result<Vec<_>>>()?, PixelCentre::Half));
    }
    if files.cameras.len() != files.photos.len() {
        return Err(missing(format!("{} cameras for {} photos", files.cameras.len(), files.photos.len())));
    }
    let mut cameras = Vec::new();
    for path in &files.cameras {
        let (camera, mut noticed) = camera_file::read_cam_txt(path)?;
        findings.append(&mut noticed);
        cameras.push(camera);
    }
    // The centres of BlendedMVS lie at whole numbers in the scenes that were measured.
    Ok((cameras, PixelCentre::Integer))
}
