//! The archives of a Metashape or PhotoScan project: a `.psx` with its folder, or a `.psz` that is one.

use super::camera_file::read_text;
use super::zip::Archive;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::files::{folder_of, without_dots};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// A chunk of a project.
pub struct Chunk {
    /// Its number in the project.
    pub id: String,
    /// Its label.
    pub label: String,
    /// The archive it was read from.
    pub file: PathBuf,
    /// Its `doc.xml`.
    pub text: String,
    /// Paths of photos by the number of their camera, of the first frame.
    pub photos: BTreeMap<String, String>,
    /// Masks by the number of their camera: the path of an archive, and in it the entry.
    pub masks: BTreeMap<String, PathBuf>,
    /// The archive of masks that the frame names but that is not there.
    pub absent_masks: Option<PathBuf>,
    /// The model of the first frame: the path of an archive, and in it the mesh.
    pub model: Option<PathBuf>,
}

/// A text file of XML as a document.
pub fn parse<'a>(text: &'a str, path: &Path) -> Result<roxmltree::Document<'a>> {
    roxmltree::Document::parse(text).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("the file is not XML: {error}"))
            .at(Place::Line(path.into(), error.pos().row as usize))
            .remedy("export it again")
    })
}

/// `doc.xml` of an archive.
fn document(archive: &Path) -> Result<String> {
    let bytes = Archive::open(archive)?.read("doc.xml")?;
    String::from_utf8(bytes).map_err(|_| {
        Error::new(ErrorKind::Malformed, "doc.xml is not text")
            .at(Place::File(archive.into()))
            .remedy("save the project again in the program that made it")
    })
}

/// A path written in the project, which may not lead out of its folder.
fn inside(base: &Path, written: &str, file: &Path) -> Result<PathBuf> {
    let relative = Path::new(written);
    if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(Error::new(ErrorKind::Malformed, format!("the project leads out of its folder: {written}"))
            .at(Place::File(file.into()))
            .remedy("save the project again in the program that made it"));
    }
    Ok(base.join(relative))
}

/// A photo's path as a file of the project writes it: from the folder that this file lies in, unless it is whole.
fn listed_from(folder: &Path, written: &str) -> String {
    let path = PathBuf::from(written.replace('\\', "/"));
    let is_whole = path.is_absolute() || written.as_bytes().get(1) == Some(&b':');
    let Some(base) = std::path::absolute(folder).ok().filter(|_| !is_whole) else { return written.to_owned() };
    without_dots(&base.join(path)).to_string_lossy().into_owned()
}

/// Whether a project is one archive with all of it.
fn is_packed(project: &Path) -> bool {
    project.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("psz"))
}

/// The archive of a project, whether it is there or not.
fn archive_of(project: &Path) -> Result<PathBuf> {
    let text = read_text(project)?;
    let root = parse(&text, project)?;
    let stem = project.file_stem().unwrap_or_default().to_string_lossy();
    let path = root.root_element().attribute("path").unwrap_or("{projectname}.files/project.zip");
    inside(folder_of(project), &path.replace("{projectname}", &stem), project)
}

/// Whether the archive of a project is there.
pub fn has_archive(project: &Path) -> bool {
    is_packed(project) || archive_of(project).is_ok_and(|archive| archive.is_file())
}

/// The chunks of a project, those whose archive is there.
pub fn chunks(project: &Path) -> Result<Vec<Chunk>> {
    if is_packed(project) {
        return packed_chunks(project);
    }
    let archive = archive_of(project)?;
    if !archive.is_file() {
        let stem = project.file_stem().unwrap_or_default().to_string_lossy();
        return Err(Error::new(
            ErrorKind::Missing,
            format!("the project's archive {} is not there", archive.display()),
        )
        .at(Place::File(project.into()))
        .remedy(format!("copy the folder {stem}.files along with the project")));
    }
    let base = folder_of(&archive);
    let text = document(&archive)?;
    let listing = parse(&text, &archive)?;
    let mut found = Vec::new();
    for node in listing.descendants().filter(|node| node.has_tag_name("chunk")) {
        let Some(path) = node.attribute("path") else { continue };
        let file = inside(base, path, &archive)?;
        if !file.is_file() {
            continue;
        }
        let text = document(&file)?;
        let (label, frame) = {
            let chunk = parse(&text, &file)?;
            let root = chunk.root_element();
            let frame =
                root.descendants().filter(|node| node.has_tag_name("frame")).find_map(|node| node.attribute("path"));
            (root.attribute("label").unwrap_or_default().to_owned(), frame.map(str::to_owned))
        };
        let frame = frame.map(|path| inside(folder_of(&file), &path, &file)).transpose()?;
        let frame = frame.filter(|path| path.is_file()).map(|path| read_frame(&path)).transpose()?;
        let Frame { photos, masks, absent_masks, model } = frame.unwrap_or_default();
        let id = node.attribute("id").unwrap_or_default().to_owned();
        found.push(Chunk { id, label, file, text, photos, masks, absent_masks, model });
    }
    Ok(found)
}

/// The chunks of a project that is one archive: they stand in its `doc.xml`, and so do their frames.
fn packed_chunks(project: &Path) -> Result<Vec<Chunk>> {
    let text = document(project)?;
    let whole = parse(&text, project)?;
    let nodes = whole.descendants().filter(|node| node.has_tag_name("chunk"));
    let chunk = |(number, node): (usize, roxmltree::Node)| {
        let attribute = |name| node.attribute(name).map(str::to_owned);
        let frame = node.descendants().find(|node| node.has_tag_name("frame"));
        Chunk {
            id: attribute("id").unwrap_or_else(|| number.to_string()),
            label: attribute("label").unwrap_or_default(),
            file: project.into(),
            text: text[node.range()].to_owned(),
            photos: frame.map(|frame| photos_of(frame, folder_of(project))).unwrap_or_default(),
            masks: BTreeMap::new(),
            absent_masks: None,
            model: None,
        }
    };
    Ok(nodes.enumerate().map(chunk).collect())
}

/// Paths of photos by the number of their camera, as a frame lists them; they are written from this folder.
fn photos_of(frame: roxmltree::Node, folder: &Path) -> BTreeMap<String, String> {
    let cameras = frame.descendants().filter(|node| node.has_tag_name("camera"));
    let photo = |camera: roxmltree::Node| {
        let photo = camera.descendants().find(|node| node.has_tag_name("photo"))?;
        Some((camera.attribute("camera_id")?.to_owned(), listed_from(folder, photo.attribute("path")?)))
    };
    cameras.filter_map(photo).collect()
}

/// What a frame says of its photos.
#[derive(Default)]
struct Frame {
    photos: BTreeMap<String, String>,
    masks: BTreeMap<String, PathBuf>,
    absent_masks: Option<PathBuf>,
    model: Option<PathBuf>,
}

/// The mesh in the archive of a frame's model, where that is there.
fn model_of(frame: roxmltree::Node, archive: &Path) -> Option<PathBuf> {
    let node = frame.descendants().find(|node| node.has_tag_name("model") && node.has_attribute("path"))?;
    let model = inside(folder_of(archive), node.attribute("path")?, archive).ok().filter(|path| path.is_file())?;
    let text = document(&model).ok()?;
    let listing = parse(&text, &model).ok()?;
    let mesh = listing.descendants().find(|node| node.has_tag_name("mesh"))?.attribute("path")?;
    Some(model.join(mesh))
}

fn read_frame(archive: &Path) -> Result<Frame> {
    let text = document(archive)?;
    let document_of_frame = parse(&text, archive)?;
    let root = document_of_frame.root_element();
    let (photos, model) = (photos_of(root, folder_of(archive)), model_of(root, archive));
    let mut frame = Frame { photos, model, ..Default::default() };
    let named = document_of_frame.descendants().find(|node| node.has_tag_name("masks"));
    let Some(path) = named.and_then(|node| node.attribute("path")) else { return Ok(frame) };
    let masks = inside(folder_of(archive), path, archive)?;
    if !masks.is_file() {
        frame.absent_masks = Some(masks);
        return Ok(frame);
    }
    let text = document(&masks)?;
    let listing = parse(&text, &masks)?;
    let entries = listing.descendants().filter(|node| node.has_tag_name("mask"));
    frame.masks = entries
        .filter_map(|mask| Some((mask.attribute("camera_id")?.to_owned(), masks.join(mask.attribute("path")?))))
        .collect();
    Ok(frame)
}
