//! A scene as a reader finds it: paths and numbers of the source, before anything is turned or decoded.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::name_of_folder;
use crate::scene::lens::{Lens, Pinhole};
use crate::scene::settings::{ColourEncoding, PixelCentre, Up};
use crate::scene::{Background, Camera, WorldFromSource};
use glam::{DMat3, DMat4, DVec2, DVec3, Vec2};
use std::path::{Path, PathBuf};

/// A camera of the source: OpenCV axes, its own world and pixel convention.
#[derive(Clone, Copy, Debug)]
pub struct SourceCamera {
    /// Intrinsics `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`, in pixels.
    pub intrinsics: DMat3,
    /// Rotation part of `camera_from_source`.
    pub rotation: DMat3,
    /// Translation part of `camera_from_source`.
    pub translation: DVec3,
}

/// A photo and its camera.
#[derive(Clone, Debug)]
pub struct SourceView {
    /// Stem of the photo's file name.
    pub name: String,
    /// The photo's file.
    pub photo: PathBuf,
    /// The mask's file: full scale is object, or 1 of 0 and 1, or what is opaque ([`file::MaskFile`](crate::image::file::MaskFile)).
    pub mask: Option<PathBuf>,
    /// The camera.
    pub camera: SourceCamera,
    /// The lens, unless it is a pinhole: the photo is resampled on loading. The intrinsics then put pixel centres at
    /// (0.5, 0.5).
    pub lens: Option<Lens>,
    /// Width and height the source claims for the photo.
    pub size: Option<(usize, usize)>,
    /// Where the camera is written down.
    pub place: Place,
}

/// What a reader hands over.
#[derive(Clone, Debug)]
pub struct SourceScene {
    /// Name of the scene.
    pub name: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Mesh files, pieces of one mesh.
    pub mesh: Vec<PathBuf>,
    /// Views in any order.
    pub views: Vec<SourceView>,
    /// What the source says of its up axis.
    pub up: Up,
    /// What the source says of its pixel centres; `Auto` when nothing.
    pub pixel_centre: PixelCentre,
    /// What is assumed when neither the source nor a measurement says.
    pub default_pixel_centre: PixelCentre,
    /// How many metres a unit is, where the source says so.
    pub unit_in_metres: Option<f64>,
    /// What background pixels show.
    pub background: Background,
    /// How photos are encoded.
    pub encoding: ColourEncoding,
    /// Names of the views to hold out; `None` for every n-th.
    pub held_out: Option<Vec<String>>,
    /// Whether the folder may hold the truth in the exchange layout.
    pub has_truth: bool,
    /// Turn every triangle over.
    pub flip_winding: bool,
    /// Whether photos may have another size than their cameras claim, and the mesh another frame: so it is with what tools
    /// export.
    pub is_of_a_tool: bool,
    /// Whether the source states no size of its photos, so that those of its views are the sizes of the files.
    pub sizes_are_of_files: bool,
    /// Frames the mesh may stand in, as the source knows them.
    pub mesh_frames: Vec<MeshFrame>,
    /// What the reader noticed.
    pub findings: Vec<Finding>,
}

/// A frame that a mesh may stand in.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshFrame {
    /// What takes it to the frame of the cameras, in words after "after".
    pub name: &'static str,
    /// `source_from_mesh`, a similarity.
    pub source_from_mesh: DMat4,
}

impl SourceScene {
    /// A scene of photographs whose pixel centres are at (0.5, 0.5), with nothing said of its up axis: as most tools export.
    pub fn of_photographs(folder: &Path, mesh: Vec<PathBuf>, views: Vec<SourceView>) -> Self {
        SourceScene {
            name: name_of_folder(folder),
            folder: folder.into(),
            mesh,
            views,
            up: Up::Auto,
            pixel_centre: PixelCentre::Half,
            default_pixel_centre: PixelCentre::Half,
            unit_in_metres: None,
            background: Background::Environment,
            encoding: ColourEncoding::Auto,
            held_out: None,
            has_truth: false,
            flip_winding: false,
            is_of_a_tool: true,
            sizes_are_of_files: false,
            mesh_frames: Vec::new(),
            findings: Vec::new(),
        }
    }
}

/// A rotation this far from orthonormal is repaired in silence: four to five printed digits.
const SILENT_DEPARTURE: f64 = 1e-4;
/// Beyond this it is not a rotation with few digits but a scale or a shear.
const LARGEST_DEPARTURE: f64 = 1e-2;

impl SourceCamera {
    /// From intrinsics and the upper rows of `camera_from_source`, checked: finite, upright intrinsics, a rotation.
    ///
    /// A rotation that is slightly off is replaced by the nearest one, with a finding. A mirror is kept as it is: the
    /// pre-flight check names it.
    pub fn new(intrinsics: DMat3, rotation: DMat3, translation: DVec3, place: &Place) -> Result<(Self, Vec<Finding>)> {
        let mut findings = Vec::new();
        if !(intrinsics.is_finite() && rotation.is_finite() && translation.is_finite()) {
            return Err(Error::new(ErrorKind::NonFinite, "a number of the camera is not finite")
                .at(place.clone())
                .remedy("remove the view or export its camera again"));
        }
        let last_row = intrinsics.row(2);
        let skew = intrinsics.row(0).y;
        let (fx, fy) = (intrinsics.row(0).x, intrinsics.row(1).y);
        if fx <= 0.0 || fy <= 0.0 || last_row.truncate().length() > 1e-9 || (last_row.z - 1.0).abs() > 1e-9 {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                "the intrinsics are not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with positive focal lengths",
            )
            .at(place.clone())
            .remedy("export pinhole intrinsics in pixels; a negative focal length means a flipped axis"));
        }
        if skew.abs() > 1e-3 * fx {
            return Err(Error::new(ErrorKind::Unsupported, format!("the camera's axes are skewed by {skew} pixels"))
                .at(place.clone())
                .remedy("undistort the photos to a pinhole camera without skew"));
        }
        let gram = rotation * rotation.transpose();
        let departure = (0..3).map(|i| (gram.col(i) - DMat3::IDENTITY.col(i)).length()).fold(0.0, f64::max);
        if departure > LARGEST_DEPARTURE {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!("the extrinsics are off a rotation by {departure:.2e}"),
            )
            .at(place.clone())
            .remedy("they carry a scale or a shear: export rigid transforms, camera from world"));
        }
        if departure > SILENT_DEPARTURE {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "camera-not-orthonormal",
                    format!("the extrinsics are off a rotation by {departure:.1e}: the nearest rotation is used"),
                )
                .at(place.clone())
                .remedy("export the camera with more digits")
                .extent(departure),
            );
        }
        Ok((SourceCamera { intrinsics, rotation: nearest_rotation(rotation), translation }, findings))
    }

    /// The pinhole that photos taken through a lens with these intrinsics are resampled to.
    pub fn pinhole(&self) -> Pinhole {
        let columns = self.intrinsics;
        Pinhole {
            focal_pixels: DVec2::new(columns.x_axis.x, columns.y_axis.y),
            centre_pixels: columns.z_axis.truncate(),
        }
    }

    /// The camera in the program's world and pixel convention. `centre_shift` is added to the principal point.
    pub fn in_world(&self, world: &WorldFromSource, size: (usize, usize), centre_shift: f64) -> Camera {
        // x_cam = R x_source + t with x_source = Wᵀ x_world + o, so R' = R Wᵀ and t' = t + R o.
        let rotation = self.rotation * world.rotation.transpose();
        let translation = self.translation + self.rotation * world.origin_in_source;
        let row = |index| self.intrinsics.row(index);
        Camera {
            width: size.0,
            height: size.1,
            focal_pixels: Vec2::new(row(0).x as f32, row(1).y as f32),
            centre_pixels: Vec2::new((row(0).z + centre_shift) as f32, (row(1).z + centre_shift) as f32),
            rotation_camera_from_world: rotation.as_mat3(),
            translation_camera_from_world: translation.as_vec3(),
        }
    }
}

/// The orthonormal matrix nearest to one that is almost so, by Newton's iteration for the polar factor
/// (Higham 1986): X <- (X + X⁻ᵀ) / 2. A mirror stays a mirror.
fn nearest_rotation(matrix: DMat3) -> DMat3 {
    let mut orthonormal = matrix;
    for _ in 0..8 {
        orthonormal = (orthonormal + orthonormal.inverse().transpose()) * 0.5;
    }
    orthonormal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_rotations_are_repaired_and_scaled_ones_refused() {
        let exact = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.0);
        let rounded = DMat3::from_cols_array(&exact.to_cols_array().map(|x| (x * 1e3).round() / 1e3));
        let place = Place::File("cam.txt".into());
        let (camera, findings) = SourceCamera::new(DMat3::IDENTITY, rounded, DVec3::ZERO, &place).unwrap();
        let gram = camera.rotation * camera.rotation.transpose();
        assert!((gram - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-12));
        assert_eq!(findings[0].code, "camera-not-orthonormal");
        let error = SourceCamera::new(DMat3::IDENTITY, exact * 1.1, DVec3::ZERO, &place).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
        assert_eq!(error.place(), &place);
    }

    #[test]
    fn a_mirror_stays_a_mirror() {
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let (camera, _) = SourceCamera::new(DMat3::IDENTITY, mirror, DVec3::ZERO, &Place::Nowhere).unwrap();
        assert!(camera.rotation.determinant() < 0.0);
    }
}
