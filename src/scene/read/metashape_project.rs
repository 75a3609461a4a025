//! The archives of a Metashape or PhotoScan project.

use super::camera_file::read_text;
use super::zip::Archive;
use crate::error::{Error, ErrorKind, Place, Result};
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

/// The chunks of a project, those whose archive is there.
pub fn chunks(project: &Path) -> Result<Vec<Chunk>> {
    let text = read_text(project)?;
    let root = parse(&text, project)?;
    let stem = project.file_stem().unwrap_or_default().to_string_lossy();
    let folder = project.parent().unwrap_or(Path::new(""));
    let path = root.root_element().attribute("path").unwrap_or("{projectname}.files/project.zip");
    let archive = inside(folder, &path.replace("{projectname}", &stem), project)?;
    if !archive.is_file() {
        return Err(Error::new(
            ErrorKind::Missing,
            format!("the project's archive {} is not there", archive.display()),
        )
        .at(Place::File(project.into()))
        .remedy(format!("copy the folder {stem}.files along with the project")));
    }
    let base = archive.parent().unwrap_or(folder);
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
        let frame = frame.map(|path| inside(file.parent().unwrap_or(base), &path, &file)).transpose()?;
        let photos = frame.filter(|path| path.is_file()).map(|path| photos_of_frame(&path)).transpose()?;
        let id = node.attribute("id").unwrap_or_default().to_owned();
        found.push(Chunk { id, label, file, text, photos: photos.unwrap_or_default() });
    }
    Ok(found)
}

fn photos_of_frame(archive: &Path) -> Result<BTreeMap<String, String>> {
    let text = document(archive)?;
    let frame = parse(&text, archive)?;
    let cameras = frame.descendants().filter(|node| node.has_tag_name("camera"));
    Ok(cameras
        .filter_map(|camera| {
            let photo = camera.descendants().find(|node| node.has_tag_name("photo"))?;
            Some((camera.attribute("camera_id")?.to_owned(), photo.attribute("path")?.to_owned()))
        })
        .collect())
}
