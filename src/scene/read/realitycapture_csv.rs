//! RealityCapture and RealityScan: cameras exported as a table, "Internal/External camera parameters".
//!
//! ```text
//! #name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2
//! ```
//! Columns may be in any order and others may stand between them; a line `#cameras N` may come first. `x y alt` is where the
//! camera stands, +alt up. Rz(-heading) Rx(pitch) Ry(roll) turns the axes of a camera that looks down (x right, y up, z back,
//! as OpenGL's) into the world (nerfstudio, `realitycapture_utils.py`). Focal length and principal point are millimetres of
//! 35 mm film, whose 36 mm are the longer side; the principal point is an offset from the middle. The table does not say
//! which lens model its coefficients are of: Brown's is taken.

use super::blended_mvs::files_of;
use super::camera_file::read_text;
use super::colmap_lens::matrix;
use super::mesh_choice;
use super::photo_index::PhotoIndex;
use super::posed::{Posed, views_of};
use super::source::{SourceCamera, SourceScene};
use super::text;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::folder_of;
use crate::image::file;
use crate::scene::lens::{Lens, Model, Polynomial};
use glam::{DMat3, DVec3};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Width of 35 mm film in millimetres.
const FILM_MILLIMETRES: f64 = 36.0;
/// Columns a table of cameras must have.
const NEEDED: [&str; 8] = ["name", "x", "y", "alt", "heading", "pitch", "roll", "f"];

/// The beginning of a file as text: tables of other kinds may be large.
fn beginning_of(path: &Path) -> Option<String> {
    let mut start = Vec::new();
    std::fs::File::open(path).ok()?.take(1 << 12).read_to_end(&mut start).ok()?;
    text::decode(start, path).ok()
}

/// The table of a folder, if it holds one.
pub fn file_of(folder: &Path) -> Option<PathBuf> {
    let is_table = |path: &PathBuf| beginning_of(path).is_some_and(|text| Table::of(&text).is_some());
    files_of(folder, &["csv"]).ok()?.into_iter().find(is_table)
}

/// Where each column of a table stands.
struct Table<'a> {
    columns: Vec<String>,
    separator: char,
    /// The rest of the text, by lines, with their numbers.
    lines: Vec<(usize, &'a str)>,
}

impl<'a> Table<'a> {
    /// A text whose first line, but for a count of cameras, names the needed columns.
    fn of(text: &'a str) -> Option<Self> {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let (_, mut header) = lines.next()?;
        if header.trim_start().starts_with("#cameras") {
            header = lines.next()?.1;
        }
        let separator = [';', '\t', ','].into_iter().find(|separator| header.contains(*separator))?;
        let columns: Vec<String> = header
            .split(separator)
            .map(|name| name.trim().trim_start_matches('#').trim_matches('"').trim().to_ascii_lowercase())
            .collect();
        let has_all = NEEDED.iter().all(|needed| columns.iter().any(|column| column == needed));
        let lines = lines.map(|(index, line)| (index + 1, line)).collect();
        has_all.then_some(Table { columns, separator, lines })
    }

    /// The words of a line; a name in quotes may hold the separator.
    fn words(&self, line: &str) -> Vec<String> {
        let (mut words, mut word, mut is_quoted) = (Vec::new(), String::new(), false);
        for letter in line.chars() {
            match letter {
                '"' => is_quoted = !is_quoted,
                _ if letter == self.separator && !is_quoted => words.push(std::mem::take(&mut word)),
                _ => word.push(letter),
            }
        }
        words.push(word);
        words.into_iter().map(|word| word.trim().to_owned()).collect()
    }
}

/// A line of the table.
struct Row<'a> {
    table: &'a Table<'a>,
    words: Vec<String>,
    place: Place,
}

impl Row<'_> {
    fn word(&self, column: &str) -> Option<&str> {
        let place = self.table.columns.iter().position(|own| own == column)?;
        self.words.get(place).map(String::as_str)
    }

    /// A number of a column; 0 where the table has no such column.
    fn number(&self, column: &str) -> Result<f64> {
        let Some(word) = self.word(column) else {
            return if self.table.columns.iter().any(|own| own == column) {
                Err(self.malformed(format!("the line ends before its column {column}")))
            } else {
                Ok(0.0)
            };
        };
        let value = text::number(word, self.table.separator != ',').filter(|value| value.is_finite());
        value.ok_or_else(|| self.malformed(format!("'{word}' is not a number for {column}")))
    }

    fn malformed(&self, message: String) -> Error {
        Error::new(ErrorKind::Malformed, message)
            .at(self.place.clone())
            .remedy("export the table again: Internal/External camera parameters")
    }
}

/// Lists a scene of a table and reads its cameras.
pub fn read(path: &Path) -> Result<SourceScene> {
    let text = read_text(path)?;
    let table = Table::of(&text).ok_or_else(|| {
        Error::new(ErrorKind::Malformed, format!("the first line does not name the columns {}", NEEDED.join(", ")))
            .at(Place::Line(path.into(), 1))
            .remedy("export it as Internal/External camera parameters")
    })?;
    let folder = folder_of(path);
    let inner = ["images", "photos", "image"].map(|name| folder.join(name)).into_iter().find(|inner| inner.is_dir());
    let roots: Vec<PathBuf> = inner.into_iter().chain([folder.to_path_buf()]).collect();
    let photos = PhotoIndex::of_folders(&roots)?;
    let (mut posed, mut findings) = (Vec::new(), Vec::new());
    let mut is_distorted = false;
    for &(line, content) in &table.lines {
        if content.trim_start().starts_with('#') {
            continue;
        }
        let row = Row { table: &table, words: table.words(content), place: Place::Line(path.into(), line) };
        let listed = row.word("name").unwrap_or_default().to_owned();
        let size = photos.find(&listed).map(|path| file::read_size(&path)).transpose()?;
        let (width, height) = size.map_or((1.0, 1.0), |(width, height)| (width as f64, height as f64));
        let pixels_per_millimetre = width.max(height) / FILM_MILLIMETRES;
        let focal = row.number("f")? * pixels_per_millimetre;
        let centre = [
            0.5 * width + row.number("px")? * pixels_per_millimetre,
            0.5 * height + row.number("py")? * pixels_per_millimetre,
        ];
        let [k1, k2, k3, k4] = [row.number("k1")?, row.number("k2")?, row.number("k3")?, row.number("k4")?];
        let polynomial = Polynomial {
            numerator: [k1, k2, k3, k4, 0.0, 0.0],
            tangential: [row.number("t1")?, row.number("t2")?],
            ..Default::default()
        };
        let lens = Lens::new(Model::Polynomial(polynomial));
        is_distorted |= !lens.is_pinhole();
        let [heading, pitch, roll] =
            [row.number("heading")?, row.number("pitch")?, row.number("roll")?].map(f64::to_radians);
        let world_from_camera = DMat3::from_rotation_z(-heading)
            * DMat3::from_rotation_x(pitch)
            * DMat3::from_rotation_y(roll)
            * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let position = DVec3::new(row.number("x")?, row.number("y")?, row.number("alt")?);
        let rotation = world_from_camera.transpose();
        let (camera, mut noticed) =
            SourceCamera::new(matrix([focal; 2], centre), rotation, -(rotation * position), &row.place)?;
        findings.append(&mut noticed);
        posed.push(Posed { listed, camera, lens, size, mask: None, place: row.place });
    }
    if is_distorted {
        findings.push(
            Finding::new(
                Severity::Note,
                "lens-model-assumed",
                "the table does not say which lens model its coefficients are of: Brown's is taken, with OpenCV's t1 and t2",
            )
            .at(Place::File(path.into()))
            .remedy("export XMP side files, which name the model, if it was the division model"),
        );
    }
    let views = views_of(posed, &photos, &[folder.into()], &mut findings)?;
    let mesh = mesh_choice::find(&[roots, vec![folder.into()]].concat(), &mut findings);
    Ok(SourceScene { findings, sizes_are_of_files: true, ..SourceScene::of_photographs(folder, mesh, views) })
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::image::{Image, file};
    use glam::DVec2;

    fn folder(table: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a, b.png", "c.png"] {
            file::write_png_srgb8(&folder.path().join(name), &Image::filled(40, 30, [9; 3])).unwrap();
        }
        std::fs::write(folder.path().join("cameras.csv"), table).unwrap();
        folder
    }

    #[test]
    fn a_table_in_any_order_of_columns_gives_cameras() {
        let table = "#cameras 2\n#name,f,x,y,alt,heading,pitch,roll,px,py,k1,k2,k3,k4,t1,t2\n\
                     \"a, b.png\",45,1,2,3,90,60,0,0.36,-0.72,0.1,0,0,0,0,0\n\
                     c.png,18,1,2,3,0,0,0,0,0,0,0,0,0,0,0\n";
        let folder = folder(table);
        let scene = read(&file_of(folder.path()).unwrap()).unwrap();
        assert_eq!(scene.views.len(), 2);
        let (tilted, down) = (&scene.views[0], &scene.views[1]);
        let pinhole = tilted.camera.pinhole();
        assert!((pinhole.focal_pixels - DVec2::splat(50.0)).length() < 1e-12);
        assert!((pinhole.centre_pixels - DVec2::new(20.4, 14.2)).length() < 1e-12, "{pinhole:?}");
        assert!(tilted.lens.is_some() && down.lens.is_none());
        for view in &scene.views {
            let position = view.camera.rotation.transpose() * -view.camera.translation;
            assert!((position - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        }
        // Without angles a camera looks straight down with north, +y, at the top of its picture.
        let forward = |view: &super::super::source::SourceView| view.camera.rotation.transpose() * DVec3::Z;
        assert!((forward(down) - DVec3::NEG_Z).length() < 1e-12);
        assert!((down.camera.rotation * DVec3::Y - DVec3::NEG_Y).length() < 1e-12);
        // Pitched up by 60 degrees and turned to the east, it looks east and down by 30.
        let expected = DVec3::new(60f64.to_radians().sin(), 0.0, -60f64.to_radians().cos());
        assert!((forward(tilted) - expected).length() < 1e-12, "{}", forward(tilted));
        assert!(scene.findings.iter().any(|finding| finding.code == "lens-model-assumed"));
    }

    #[test]
    fn other_tables_are_passed_over_and_bad_lines_have_their_number() {
        let folder_of_others = folder("name,price\na,1\n");
        assert!(file_of(folder_of_others.path()).is_none());
        let table = "#name;x;y;alt;heading;pitch;roll;f\nc.png;1,5;0;0;0;0;0;35\nc.png;1;0;zero;0;0;0;35\n";
        let folder = folder(table);
        let path = file_of(folder.path()).unwrap();
        let error = read(&path).unwrap_err();
        assert_eq!(error.place(), &Place::Line(path.clone(), 3));
        std::fs::write(&path, table.lines().take(2).collect::<Vec<_>>().join("\n")).unwrap();
        let scene = read(&path).unwrap();
        let position = scene.views[0].camera.rotation.transpose() * -scene.views[0].camera.translation;
        assert!((position.x - 1.5).abs() < 1e-12, "a decimal comma");
    }
}
