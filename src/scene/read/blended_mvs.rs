//! A BlendedMVS folder as downloaded (Yao et al. 2020), or any folder in its layout.
//!
//! ```text
//! blended_images/ or images/   00000000.jpg ...; 00000000_masked.jpg are twins with a black background
//! cams/                        00000000_cam.txt ...; pair.txt (optional)
//! textured_mesh/               *.obj in one or several pieces, or *.ply; a separate download
//! masks/ or mask/              00000000.png, 00000000.jpg.png, ...: 255 = object (optional, not part of the download)
//! rendered_depth_maps/         *.pfm (optional): not read, the mesh says the same
//! ```

use super::camera_file;
use super::mask_names::{self, Masks, PHOTO_EXTENSIONS};
use super::source::{SourceScene, SourceView};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{name_of_folder, stem_of};
use crate::image::file;
use crate::scene::Background;
use crate::scene::settings::{ColourEncoding, PixelCentre, Up};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Whether the folder has one of the parts of this layout.
pub fn is_folder_of_this_kind(folder: &Path) -> bool {
    folder.join("cams").is_dir() || folder.join("blended_images").is_dir()
}

/// Whether a folder of this kind has the file of a camera.
pub fn holds_cameras(folder: &Path) -> bool {
    let files = files_of(&folder.join("cams"), &["txt"]).unwrap_or_default();
    files.iter().any(|path| stem_of(path).ends_with("_cam"))
}

/// Lists a BlendedMVS folder and reads its cameras. Without a mesh there is none in it: another may be named.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let images = ["blended_images", "images"].map(|name| folder.join(name)).into_iter().find(|path| path.is_dir());
    let cams = Some(folder.join("cams")).filter(|path| path.is_dir());
    let (mesh, mut findings) = find_mesh(folder)?;
    let (Some(images), Some(cams)) = (&images, &cams) else {
        let mut missing = Vec::new();
        if images.is_none() {
            missing.push("the photos: blended_images/*.jpg");
        }
        if cams.is_none() {
            missing.push("the cameras: cams/*_cam.txt");
        }
        if mesh.is_empty() {
            missing.push("the mesh: textured_mesh/*.obj or *.ply");
        }
        return Err(Error::new(ErrorKind::Missing, format!("the folder lacks {}", missing.join("; ")))
            .at(Place::File(folder.into()))
            .remedy("a BlendedMVS folder holds blended_images/, cams/ and textured_mesh/; a scene.toml can name the parts by hand"));
    };
    let views = views(images, cams, mask_names::folder_of_masks(folder).as_deref(), false, &mut findings)?;
    if views.iter().all(|view| view.mask.is_none()) {
        findings.extend(mask_names::told_of_unread([folder]));
    }
    check_pairs(&cams.join("pair.txt"), &views, &mut findings);
    if folder.join("rendered_depth_maps").is_dir() {
        findings.push(Finding::new(
            Severity::Note,
            "depth-maps-ignored",
            "rendered_depth_maps is not read: the mesh decides what is visible",
        ));
    }
    Ok(SourceScene {
        name: name_of_folder(folder),
        folder: folder.into(),
        mesh,
        views,
        up: Up::Auto,
        pixel_centre: PixelCentre::Auto,
        unit_in_metres: None,
        default_pixel_centre: PixelCentre::Integer,
        background: Background::Environment,
        encoding: ColourEncoding::Auto,
        held_out: None,
        has_truth: false,
        flip_winding: false,
        is_of_a_tool: false,
        sizes_are_of_files: false,
        mesh_frames: Vec::new(),
        findings,
    })
}

/// Mesh files of the folder: OBJ pieces before PLY, glTF and STL.
fn find_mesh(folder: &Path) -> Result<(Vec<PathBuf>, Vec<Finding>)> {
    let mut findings = Vec::new();
    for place in [folder.join("textured_mesh"), folder.join("mesh"), folder.to_path_buf()] {
        let of_kinds = |extensions: &[&str]| files_of(&place, extensions);
        let kinds = [of_kinds(&["obj"])?, of_kinds(&["ply"])?, of_kinds(&["glb", "gltf"])?, of_kinds(&["stl"])?];
        if kinds.iter().filter(|files| !files.is_empty()).count() > 1 {
            findings.push(
                Finding::new(
                    Severity::Note,
                    "mesh-choice",
                    "mesh files of several kinds lie side by side: OBJ is read before PLY, glTF and STL",
                )
                .at(Place::File(place.clone()))
                .remedy("choose another with --mesh FILE"),
            );
        }
        let mesh = kinds.into_iter().find(|files| !files.is_empty()).unwrap_or_default();
        if !mesh.is_empty() {
            return Ok((mesh, findings));
        }
    }
    Ok((Vec::new(), findings))
}

/// Files of a folder with one of these extensions, in the order of their names. A missing folder has none.
pub fn files_of(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|source| Error::reading(folder, source))?.path();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if extensions.contains(&extension.as_str()) && !hidden && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Photos of a folder by name, without masks and `_masked` twins among them; and those by the name they belong to.
pub fn photos_of(images: &Path) -> Result<(BTreeMap<String, PathBuf>, BTreeMap<String, PathBuf>)> {
    let (mut photos, mut twins) = (BTreeMap::new(), BTreeMap::new());
    for path in files_of(images, &PHOTO_EXTENSIONS)? {
        let stem = stem_of(&path);
        if let Some(name) = stem.strip_suffix("_masked") {
            twins.insert(name.to_owned(), path);
        } else if let Some(other) = photos.insert(stem.clone(), path.clone()) {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!("two photos are named '{stem}': {} is the other", other.display()),
            )
            .at(Place::File(path))
            .remedy("keep one of them"));
        }
    }
    for (stem, photo) in mask_names::beside_photos(&photos) {
        if let Some(mask) = photos.remove(&stem) {
            twins.entry(photo).or_insert(mask);
        }
    }
    if photos.is_empty()
        && let Some(other) = files_of(images, &mask_names::EXTENSIONS_NOT_READ)?.first()
    {
        // Its error names the kind and the way out.
        file::read_header(other)?;
    }
    if photos.is_empty() {
        return Err(Error::new(ErrorKind::Missing, "the folder holds no photos")
            .at(Place::File(images.into()))
            .remedy("it must hold JPEG, PNG, TIFF, EXR, HDR or PFM files"));
    }
    Ok((photos, twins))
}

/// Joins photos, cameras and masks by name; what stands alone becomes a finding. Masks that a manifest names must all belong
/// to photos.
pub fn views(
    images: &Path,
    cams: &Path,
    masks: Option<&Path>,
    masks_are_named: bool,
    findings: &mut Vec<Finding>,
) -> Result<Vec<SourceView>> {
    let (photos, twins) = photos_of(images)?;
    let mut cameras = BTreeMap::new();
    for path in files_of(cams, &["txt"])? {
        let stem = stem_of(&path);
        if let Some(name) = stem.strip_suffix("_cam") {
            cameras.insert(name.to_owned(), path);
        }
    }
    let mask_files = mask_files(masks, &photos, masks_are_named, findings)?;
    for (name, path) in cameras.iter().filter(|(name, _)| !photos.contains_key(*name)) {
        findings.push(
            Finding::new(
                Severity::Warning,
                "camera-without-photo",
                format!("there is no photo '{name}': its camera is skipped"),
            )
            .at(Place::File(path.clone()))
            .remedy("copy the photo, or delete the camera file"),
        );
    }
    let mut views = Vec::new();
    for (name, photo) in photos {
        let Some(cam) = cameras.get(&name) else {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "photo-without-camera",
                    format!("there is no {name}_cam.txt: the photo is skipped"),
                )
                .at(Place::File(photo))
                .remedy("copy the camera file, or delete the photo"),
            );
            continue;
        };
        let (camera, mut noticed) = camera_file::read_cam_txt(cam)?;
        findings.append(&mut noticed);
        let mask = mask_files.get(&name).or_else(|| twins.get(&name)).cloned();
        views.push(SourceView { name, photo, mask, camera, lens: None, size: None, place: Place::File(cam.clone()) });
    }
    if views.is_empty() {
        return Err(Error::new(ErrorKind::Missing, "no photo has a camera")
            .at(Place::File(cams.into()))
            .remedy("camera files are named after photos: 00000000.jpg needs cams/00000000_cam.txt"));
    }
    if mask_files.is_empty() && !twins.is_empty() {
        findings.push(
            Finding::new(
                Severity::Note,
                "masks-from-twins",
                format!("{} masks are taken from the _masked twins of the photos", twins.len()),
            )
            .remedy("ignore them with --masks ignore"),
        );
    }
    Ok(views)
}

/// The mask file of each photo that has one, by the photo's name; masks of no photo are told, or refused when named.
pub fn mask_files(
    folder: Option<&Path>,
    photos: &BTreeMap<String, PathBuf>,
    are_named: bool,
    findings: &mut Vec<Finding>,
) -> Result<BTreeMap<String, PathBuf>> {
    let Some(folder) = folder else { return Ok(BTreeMap::new()) };
    let mut masks = Masks::of_folder(folder)?;
    let of_photo = |name: &String| Some((name.clone(), masks.of_photo(Path::new(&format!("{name}.png")))?));
    let found = photos.keys().filter_map(of_photo).collect();
    masks.tell_unused(folder, are_named, findings)?;
    Ok(found)
}

/// Checks `pair.txt`. Nothing depends on it, so that what is wrong with it is a finding.
fn check_pairs(path: &Path, views: &[SourceView], findings: &mut Vec<Finding>) {
    if !path.is_file() {
        return;
    }
    let invalid = |message: String| {
        Finding::new(Severity::Note, "pairs-invalid", message)
            .at(Place::File(path.into()))
            .remedy("nothing depends on it here, but it may belong to another scene")
    };
    match camera_file::read_pairs(path) {
        Err(error) => findings.push(invalid(error.to_string())),
        Ok(pairs) => {
            let largest =
                pairs.iter().flat_map(|(view, list)| list.iter().map(|(other, _)| *other).chain([*view])).max();
            let highest_name = views.iter().filter_map(|view| view.name.parse::<usize>().ok()).max();
            if let (Some(largest), Some(highest)) = (largest, highest_name)
                && largest > highest
            {
                findings.push(invalid(format!("it names view {largest}, but the last photo is {highest}")));
            }
            if let Some((view, _)) = pairs.iter().find(|(view, list)| list.iter().any(|(other, _)| other == view)) {
                findings.push(invalid(format!("view {view} is its own neighbour")));
            }
        }
    }
}
