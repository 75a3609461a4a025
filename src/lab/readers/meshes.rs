//! Triangle counts, areas and bounding boxes of meshes as other tools find them.

use crate::error::Result;
use crate::lab::bar_table::{BarRow, BarTable};
use crate::scene::read::mesh_file::read_pieces;
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Largest difference of two areas over the area: files hold seven digits.
const LARGEST_OF_AREA: f64 = 1e-5;
/// Largest difference of two corners of a box over its diagonal.
const LARGEST_OF_BOX: f64 = 1e-6;

/// What the script wrote down.
#[derive(Debug, Deserialize)]
pub struct Answers {
    /// Names and versions of the tools.
    pub tools: Vec<String>,
    /// The meshes.
    pub files: Vec<MeshFile>,
}

/// A mesh, and what the tools say of it.
#[derive(Debug, Deserialize)]
pub struct MeshFile {
    /// The file.
    pub path: PathBuf,
    /// Its path below the folder it was found in.
    pub name: String,
    /// How much of the area depends on how polygons that lie in no plane are cut.
    pub area_left_to_cuts: f64,
    /// By the names of the tools.
    pub said: BTreeMap<String, Said>,
}

/// What a tool says of a mesh.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub enum Said {
    /// It reads it.
    Figures(Figures),
    /// It does not.
    Error {
        /// Why.
        error: String,
    },
}

/// Figures of a mesh.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Figures {
    /// Triangles in the file.
    pub triangles: usize,
    /// Those of them that lie between the corners of an earlier one; they are left out here.
    pub copies: usize,
    /// Area without copies.
    pub area: f64,
    /// Least coordinates of a corner of a triangle.
    pub low: DVec3,
    /// Largest ones.
    pub high: DVec3,
}

/// Differences between two readers of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Differences {
    area: f64,
    corners: f64,
}

/// Reads each mesh and compares; files of one folder and ending share a row.
pub fn compare(answers: &Answers) -> BarTable {
    let mut table = BarTable::new(&["meshes", "files", "triangles", "tools", "area off by", "box off by"]);
    let mut groups: BTreeMap<String, Vec<&MeshFile>> = BTreeMap::new();
    for file in &answers.files {
        let first = file.name.split('/').next().unwrap_or_default();
        let extension = file.path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        groups.entry(format!("{first}, {extension}")).or_default().push(file);
    }
    for (name, files) in groups {
        let (mut worst, mut triangles, mut compared) = (Differences::default(), 0, 0);
        let mut short = Vec::new();
        for file in &files {
            let own = match figures_of(file) {
                Ok(own) => own,
                Err(error) => {
                    short.push(format!("{}: {error}", file.name));
                    continue;
                }
            };
            triangles += own.triangles;
            for (tool, said) in &file.said {
                match said {
                    Said::Error { error } => short.push(format!("{}: {tool} does not read it: {error}", file.name)),
                    Said::Figures(theirs) => match differences(&own, theirs, file.area_left_to_cuts) {
                        Err(shortfall) => short.push(format!("{}: {tool} finds {shortfall}", file.name)),
                        Ok(off) => {
                            compared += 1;
                            worst.area = worst.area.max(off.area);
                            worst.corners = worst.corners.max(off.corners);
                        }
                    },
                }
            }
        }
        let figures = vec![
            files.len().to_string(),
            triangles.to_string(),
            format!("{compared} answers"),
            format!("{:.0e}", worst.area),
            format!("{:.0e}", worst.corners),
        ];
        table.rows.push(BarRow { name, figures, shortfall: (!short.is_empty()).then(|| short.join("; ")) });
    }
    table
}

/// The figures of a mesh as it is read here.
fn figures_of(file: &MeshFile) -> Result<Figures> {
    let mesh = read_pieces(std::slice::from_ref(&file.path))?;
    let corners = mesh.triangles.iter().map(|corners| corners.map(|corner| mesh.positions[corner as usize]));
    let area = corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
    let (low, high) = mesh.bounds().unwrap_or_default();
    Ok(Figures { triangles: mesh.triangles.len(), copies: 0, area, low, high })
}

/// How far two readers are apart; what differs beyond the bars in words. Of the area, so much is left to how polygons are
/// cut.
fn differences(own: &Figures, theirs: &Figures, left_to_cuts: f64) -> std::result::Result<Differences, String> {
    let expected = theirs.triangles.saturating_sub(theirs.copies);
    if own.triangles != expected {
        return Err(format!("{expected} triangles without copies, not {}", own.triangles));
    }
    let off = (own.area - theirs.area).abs();
    let diagonal = (theirs.high - theirs.low).length().max(f64::MIN_POSITIVE);
    let corners = (own.low - theirs.low).length().max((own.high - theirs.high).length()) / diagonal;
    if !(off <= LARGEST_OF_AREA * theirs.area + left_to_cuts) {
        return Err(format!("an area of {}, not {}", theirs.area, own.area));
    }
    if !(corners <= LARGEST_OF_BOX) {
        return Err(format!("a box from {} to {}, not from {} to {}", theirs.low, theirs.high, own.low, own.high));
    }
    Ok(Differences { area: (off - left_to_cuts).max(0.0) / theirs.area.max(f64::MIN_POSITIVE), corners })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_areas_and_boxes_are_each_compared() {
        let own = Figures { triangles: 9, copies: 0, area: 2.0, low: DVec3::ZERO, high: DVec3::ONE };
        let theirs = Figures { triangles: 10, copies: 1, ..own.clone() };
        assert_eq!(differences(&own, &theirs, 0.0), Ok(Differences::default()));
        for other in [
            Figures { copies: 0, ..theirs.clone() },
            Figures { area: 2.001, ..theirs.clone() },
            Figures { area: f64::NAN, ..theirs.clone() },
            Figures { high: DVec3::new(1.0, 1.0, 1.001), ..theirs.clone() },
        ] {
            assert!(differences(&own, &other, 0.0).is_err(), "{other:?}");
        }
        let cut_otherwise = Figures { area: 2.001, ..theirs.clone() };
        assert!(differences(&own, &cut_otherwise, 0.002).is_ok() && differences(&own, &cut_otherwise, 5e-4).is_err());
    }
}
