//! Two layouts of neural rendering: `cameras_sphere.npz` or `cameras.npz` of IDR and NeuS, and LLFF's `poses_bounds.npy`.
//!
//! * NeuS: `world_mat_i` is K [R | t]; `scale_mat_i` takes the unit sphere, where meshes are often extracted, to the world.
//! * LLFF: rows of 17: a 3 x 5 matrix of camera to world with columns down, right, back, camera centre, (height, width, focal
//!   length), then two depths. The principal point is always taken to be the middle, which is wrong for crops.
//!
//! Neither names its photos: they are those of `image/` or `images/` in the order of their names.

use super::blended_mvs::files_of;
use super::colmap_lens::matrix;
use super::mesh_choice;
use super::numpy;
use super::photo_index::{PhotoIndex, reduction_of};
use super::posed::{Posed, views_of};
use super::source::{MeshFrame, SourceCamera, SourceScene};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::folder_of;
use crate::scene::lens::Lens;
use crate::scene::settings::PixelCentre;
use glam::{DMat3, DMat4, DVec3};
use std::path::{Path, PathBuf};

/// Extensions of photos.
const PHOTOS: [&str; 6] = ["png", "jpg", "jpeg", "exr", "tif", "tiff"];

/// The file of NeuS's cameras in a folder.
pub fn neus_file(folder: &Path) -> Option<PathBuf> {
    ["cameras_sphere.npz", "cameras.npz"].map(|name| folder.join(name)).into_iter().find(|path| path.is_file())
}

/// The file of LLFF's poses in a folder.
pub fn llff_file(folder: &Path) -> Option<PathBuf> {
    Some(folder.join("poses_bounds.npy")).filter(|path| path.is_file())
}

/// The photos in the order of their names, as many as there are cameras.
fn photos_in_order(folder: &Path, count: usize) -> Result<Vec<String>> {
    let folders = ["image", "images", "rgb"].map(|name| folder.join(name));
    let whole = folders.into_iter().find(|path| path.is_dir());
    let images = whole.or_else(|| largest_of_smaller(folder)).ok_or_else(|| {
        Error::new(ErrorKind::Missing, "the folder of photos is not there")
            .at(Place::File(folder.into()))
            .remedy("put the photos into image/ or images/, in the order of the cameras")
    })?;
    let files = files_of(&images, &PHOTOS)?;
    if files.len() != count {
        return Err(Error::new(ErrorKind::InvalidScene, format!("{count} cameras but {} photos", files.len()))
            .at(Place::File(images))
            .remedy("cameras go with photos by their order alone: give all photos and no others"));
    }
    Ok(files.iter().map(|path| path.strip_prefix(folder).unwrap_or(path).display().to_string()).collect())
}

/// Of the folders of photos made smaller, `images_4` and `images_8`, the one with the largest.
fn largest_of_smaller(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?;
    let folders = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir());
    let rated = folders.filter_map(|path| Some((reduction_of(&path.file_name()?.to_string_lossy())?, path)));
    rated.min().map(|(_, path)| path)
}

fn wrong(file: &Path, what: &str) -> Error {
    Error::new(ErrorKind::Malformed, what).at(Place::File(file.into())).remedy("export the cameras again")
}

fn finish(folder: &Path, posed: Vec<Posed>, frames: Vec<MeshFrame>) -> Result<SourceScene> {
    let mut findings = Vec::new();
    let photos = PhotoIndex::of_folders(&[folder.into()])?;
    let views = views_of(posed, &photos, &[folder.into()], &mut findings)?;
    let mesh = mesh_choice::find(&[folder.into()], &mut findings);
    Ok(SourceScene { findings, mesh_frames: frames, ..SourceScene::of_photographs(folder, mesh, views) })
}

/// Lists a scene of IDR or NeuS and reads its cameras.
pub fn read_neus(file: &Path) -> Result<SourceScene> {
    let folder = folder_of(file);
    let arrays = numpy::Arrays::open(file)?;
    let matrix_of = |name: String| -> Result<Option<DMat4>> {
        let Some(array) = arrays.get(&name)? else { return Ok(None) };
        let values: [f64; 16] = array.values.try_into().map_err(|_| wrong(file, &format!("{name} is not 4 x 4")))?;
        Ok(Some(DMat4::from_cols_array(&values).transpose()))
    };
    let mut projections = Vec::new();
    while let Some(world) = matrix_of(format!("world_mat_{}", projections.len()))? {
        projections.push(world);
    }
    if projections.is_empty() {
        return Err(wrong(file, "the file holds no world_mat_0"));
    }
    let names = photos_in_order(folder, projections.len())?;
    let mut posed = Vec::new();
    for (index, (projection, listed)) in projections.iter().zip(names).enumerate() {
        let place = Place::View(format!("world_mat_{index} of {}", file.display()));
        let (intrinsics, rotation) = decomposed(DMat3::from_mat4(*projection))
            .ok_or_else(|| wrong(file, &format!("world_mat_{index} is not a camera's")))?;
        // K t is the last column over the scale that was divided out.
        let linear = DMat3::from_mat4(*projection);
        let scale = linear.row(2).length().copysign(linear.determinant());
        let translation = intrinsics.inverse() * (projection.w_axis.truncate() / scale);
        let (camera, _) = SourceCamera::new(intrinsics, rotation, translation, &place)?;
        posed.push(Posed { listed, camera, lens: Lens::default(), size: None, mask: None, place });
    }
    let scale = matrix_of("scale_mat_0".into())?.filter(|scale| scale.determinant().abs() > 1e-18);
    let frames =
        scale.map(|source_from_mesh| MeshFrame { name: "scale_mat, out of the unit sphere", source_from_mesh });
    let scene = finish(folder, posed, frames.into_iter().collect())?;
    // Writers of this file put the first pixel's centre at (0, 0) or (0.5, 0.5) as they please: it is measured.
    Ok(SourceScene { pixel_centre: PixelCentre::Auto, ..scene })
}

/// K and R of K R, K upright with a positive diagonal and 1 in its corner (Hartley and Zisserman 2004, A4.1.1); `None` when
/// singular. A sign that a whole camera matrix may carry is taken out.
fn decomposed(product: DMat3) -> Option<(DMat3, DMat3)> {
    let product = if product.determinant() < 0.0 { product * -1.0 } else { product };
    let rows = product.transpose();
    let third = rows.z_axis.try_normalize()?;
    let (c, e) = (rows.y_axis.dot(third), rows.y_axis);
    let second_length = (e - c * third).length();
    let second = (e - c * third).try_normalize()?;
    let first = second.cross(third);
    let corner = rows.z_axis.length();
    let row = rows.x_axis;
    let (focal, skew, centre) = (row.dot(first), row.dot(second), row.dot(third));
    let intrinsics = DMat3::from_cols(
        DVec3::new(focal, 0.0, 0.0),
        DVec3::new(skew, second_length, 0.0),
        DVec3::new(centre, c, corner),
    ) * (1.0 / corner);
    let rotation = DMat3::from_cols(first, second, third).transpose();
    (intrinsics.is_finite() && focal > 0.0).then_some((intrinsics, rotation))
}

/// Lists a scene of LLFF and reads its cameras.
pub fn read_llff(file: &Path) -> Result<SourceScene> {
    let folder = folder_of(file);
    let array = numpy::read(file)?;
    if array.shape.len() != 2 || array.shape[1] != 17 {
        return Err(wrong(file, "the array is not N x 17"));
    }
    let names = photos_in_order(folder, array.shape[0])?;
    let mut posed = Vec::new();
    for (index, (row, listed)) in array.values.chunks_exact(17).zip(names).enumerate() {
        let place = Place::View(format!("row {index} of {}", file.display()));
        let column = |index: usize| DVec3::new(row[index], row[5 + index], row[10 + index]);
        let rotation = DMat3::from_cols(column(1), column(0), -column(2)).transpose();
        let (height, width, focal) = (row[4], row[9], row[14]);
        if !(width >= 1.0 && height >= 1.0) {
            return Err(wrong(file, &format!("row {index} has no size")));
        }
        let intrinsics = matrix([focal; 2], [0.5 * width, 0.5 * height]);
        let (camera, _) = SourceCamera::new(intrinsics, rotation, -(rotation * column(3)), &place)?;
        let size = Some((width.round() as usize, height.round() as usize));
        posed.push(Posed { listed, camera, lens: Lens::default(), size, mask: None, place });
    }
    finish(folder, posed, Vec::new())
}

#[cfg(test)]
mod tests {
    use super::super::zip::packed;
    use super::*;
    use crate::image::{Image, file};

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("image")).unwrap();
        for name in names {
            let path = folder.path().join("image").join(name);
            file::write_png_srgb8(&path, &Image::filled(40, 30, [9; 3])).unwrap();
        }
        folder
    }

    #[test]
    fn a_camera_matrix_of_any_scale_and_sign_is_taken_apart() {
        let folder = folder(&["000.png"]);
        let intrinsics = matrix([50.0, 51.0], [20.5, 14.5]);
        let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.0);
        let translation = DVec3::new(0.5, -0.25, 4.0);
        for scale in [1.0, -2.5] {
            let mut world = DMat4::from_mat3(intrinsics * rotation * scale);
            world.w_axis = (intrinsics * translation * scale).extend(1.0);
            let world = numpy::written(&[4, 4], &world.transpose().to_cols_array());
            let unit = DMat4::from_translation(DVec3::X) * DMat4::from_scale(DVec3::splat(3.0));
            let unit = numpy::written(&[4, 4], &unit.transpose().to_cols_array());
            let path = folder.path().join("cameras_sphere.npz");
            let other = b"\x93NUMPY\x01\x00\x10\x00{'descr': '<U7'}\n";
            let entries = [("world_mat_0.npy", &world[..]), ("scale_mat_0.npy", &unit[..]), ("names.npy", &other[..])];
            std::fs::write(&path, packed(&entries)).unwrap();
            let scene = read_neus(&neus_file(folder.path()).unwrap()).unwrap();
            let camera = &scene.views[0].camera;
            let near = |a: DMat3, b: DMat3| (a - b).to_cols_array().iter().all(|value| value.abs() < 1e-9);
            assert!(near(camera.intrinsics, intrinsics) && near(camera.rotation, rotation), "{camera:?}");
            // The sign of a camera matrix means nothing: the same pixel, the same camera.
            assert!((camera.translation - translation).length() < 1e-9, "{}", camera.translation);
            assert_eq!(scene.mesh_frames[0].source_from_mesh.transform_point3(DVec3::ONE), DVec3::new(4.0, 3.0, 3.0));
            assert_eq!(scene.pixel_centre, PixelCentre::Auto, "the format does not say");
        }
    }

    #[test]
    fn llff_columns_are_down_right_back() {
        let folder = folder(&["a.png", "b.png"]);
        // A camera at (1, 2, 3) with OpenGL's axes: right x, up y, back z; so down is -y.
        let row = [0.0, 1.0, 0.0, 1.0, 30.0, -1.0, 0.0, 0.0, 2.0, 40.0, 0.0, 0.0, 1.0, 3.0, 50.0, 0.1, 9.0];
        let path = folder.path().join("poses_bounds.npy");
        std::fs::write(&path, numpy::written(&[2, 17], &[row, row].concat())).unwrap();
        let scene = read_llff(&path).unwrap();
        let camera = &scene.views[0].camera;
        let point = camera.rotation * DVec3::new(1.5, 3.0, 1.0) + camera.translation;
        assert!((point - DVec3::new(0.5, -1.0, 2.0)).length() < 1e-12, "{point}");
        assert_eq!(camera.pinhole().centre_pixels.to_array(), [20.0, 15.0]);
        for name in ["images_10", "images_2"] {
            std::fs::rename(folder.path().join("image"), folder.path().join(name)).unwrap();
            assert!(read_llff(&path).unwrap().views[0].photo.parent().unwrap().ends_with(name));
            std::fs::create_dir(folder.path().join("image")).unwrap();
            for photo in ["a.png", "b.png"] {
                let small = Image::filled(4, 3, [9; 3]);
                file::write_png_srgb8(&folder.path().join("image").join(photo), &small).unwrap();
            }
            assert!(read_llff(&path).unwrap().views[0].photo.parent().unwrap().ends_with("image"));
        }
        std::fs::write(&path, numpy::written(&[1, 17], &row)).unwrap();
        assert_eq!(read_llff(&path).unwrap_err().kind(), ErrorKind::InvalidScene, "two photos for one camera");
    }
}
