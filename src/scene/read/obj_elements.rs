//! The elements of an OBJ file as they stand in it: vertices, texture coordinates, normals, faces.

use super::source_mesh::is_a_place;
use super::text::{self, Statement};
use super::{outliers, polygon};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::Path;

/// An index that is not there.
pub(super) const NONE: u32 = u32::MAX;

/// What a file holds.
#[derive(Default)]
pub(super) struct Elements {
    /// Vertices, in the source's world; not finite where the file says so.
    pub positions: Vec<DVec3>,
    /// Texture coordinates, `None` where the line is none.
    pub uvs: Vec<Option<[f32; 2]>>,
    /// Normals, `None` where the line is none.
    pub normals: Vec<Option<[f32; 3]>>,
    /// Names of the materials in use.
    pub materials: BTreeSet<String>,
    /// Corners of all faces, one after the other: vertex, texture coordinate, normal, from 0.
    corners: Vec<[u32; 3]>,
    /// Where each face begins among the corners, and its line.
    faces: Vec<(usize, usize)>,
    /// (vertex, line) of those that are not finite.
    bad_vertices: Vec<(usize, usize)>,
    /// Number of faces of fewer than three corners, and the line of the first.
    small_faces: (usize, usize),
    /// Number of lines and points, and the line of the first.
    lines_and_points: (usize, usize),
    /// Number of vertices that are divided by their fourth number, and the line of the first.
    weighted: (usize, usize),
    /// The first line with decimal commas.
    decimal_commas: Option<usize>,
}

impl Elements {
    /// Reads a text.
    pub fn read(text: &str, path: &Path) -> Result<Self> {
        let mut elements = Elements::default();
        for statement in text::statements(text) {
            elements.add(&statement).map_err(|(message, remedy)| {
                Error::new(ErrorKind::Malformed, message).at(Place::Line(path.into(), statement.line)).remedy(remedy)
            })?;
        }
        if elements.faces.is_empty() {
            return Err(Error::new(ErrorKind::Malformed, "the OBJ file holds no faces")
                .at(Place::File(path.into()))
                .remedy("give a surface mesh; a point cloud must be meshed first"));
        }
        Ok(elements)
    }

    fn add(&mut self, statement: &Statement<'_>) -> std::result::Result<(), (String, &'static str)> {
        let mut words = statement.words();
        let comma = statement.has_decimal_commas();
        let line = statement.line;
        match words.next() {
            Some("v") => {
                let values: Vec<Option<f64>> = words.map(|word| text::number(word, comma)).collect();
                let damaged = "the file is cut short or damaged: export it again";
                if values.len() < 3 {
                    return Err(("fewer than 3 numbers".into(), damaged));
                }
                if let Some(bad) = values[..3].iter().position(Option::is_none) {
                    let word = statement.words().nth(1 + bad).unwrap_or_default();
                    return Err((format!("'{word}' is not a number"), "export the mesh again"));
                }
                if comma {
                    self.decimal_commas.get_or_insert(line);
                }
                let mut point = DVec3::from_array([0, 1, 2].map(|axis| values[axis].unwrap_or(f64::NAN)));
                // A fourth number alone is a weight; more are a colour.
                if let (4, Some(Some(weight))) = (values.len(), values.get(3))
                    && *weight != 0.0
                    && *weight != 1.0
                {
                    point /= *weight;
                    count(&mut self.weighted, line);
                }
                if !is_a_place(point) {
                    self.bad_vertices.push((self.positions.len(), line));
                    point = DVec3::NAN;
                }
                self.positions.push(point);
            }
            Some("vt") => self.uvs.push(finite(words, comma)),
            Some("vn") => self.normals.push(finite(words, comma)),
            Some("f" | "fo") => {
                let first = self.corners.len();
                for corner in words {
                    let corner = self.corner(corner).map_err(|message| {
                        (message, "indices count from 1, or backwards from -1: export the mesh again")
                    })?;
                    self.corners.push(corner);
                }
                self.faces.push((first, line));
            }
            Some("l" | "p") => count(&mut self.lines_and_points, line),
            Some("usemtl") => {
                self.materials.insert(words.collect::<Vec<_>>().join(" "));
            }
            _ => {}
        }
        Ok(())
    }

    /// One corner `v/vt/vn` of a face.
    fn corner(&self, corner: &str) -> std::result::Result<[u32; 3], String> {
        let mut parts = corner.split('/');
        let word = parts.next().unwrap_or_default();
        let vertex = index(word, self.positions.len()).ok_or_else(|| format!("'{corner}' is not an index"))?;
        let vertex = match vertex {
            NONE if word.trim_start_matches(['-', '+', '0']).is_empty() => return Err("index 0 is not a vertex".into()),
            NONE => return Err(format!("vertex {word} of {}", self.positions.len())),
            vertex => vertex,
        };
        // Whether there is a texture coordinate or normal of that number is nobody's business unless it is used.
        let mut optional = |count: usize| match parts.next() {
            None | Some("") => Ok(NONE),
            Some(part) => index(part, count).ok_or_else(|| format!("'{corner}' is not an index")),
        };
        let (uv, normal) = (optional(self.uvs.len())?, optional(self.normals.len())?);
        if parts.next().is_some() {
            return Err(format!("'{corner}' has too many slashes"));
        }
        Ok([vertex, uv, normal])
    }

    /// The triangles of all faces, checked; faces of fewer than three corners are counted and left out.
    pub fn triangles(&mut self, path: &Path) -> Result<Vec<[[u32; 3]; 3]>> {
        let mut triangles = Vec::with_capacity(self.faces.len());
        let ends = self.faces.iter().skip(1).map(|face| face.0).chain([self.corners.len()]);
        let mut small = (0, 0);
        for (&(first, line), end) in self.faces.iter().zip(ends) {
            let corners = &self.corners[first..end];
            let malformed = |kind, message: String| Error::new(kind, message).at(Place::Line(path.into(), line));
            for &[vertex, ..] in corners {
                let Some(position) = self.positions.get(vertex as usize) else {
                    let message = format!("vertex {} of {}", u64::from(vertex) + 1, self.positions.len());
                    return Err(malformed(ErrorKind::Malformed, message)
                        .remedy("indices count from 1, or backwards from -1: export the mesh again"));
                };
                if !position.is_finite() {
                    let at = self.bad_vertices.iter().find(|bad| bad.0 == vertex as usize).map_or(line, |bad| bad.1);
                    let message = format!(
                        "vertex {} has a position that is not finite, and a face uses it",
                        u64::from(vertex) + 1
                    );
                    return Err(Error::new(ErrorKind::NonFinite, message)
                        .at(Place::Line(path.into(), at))
                        .remedy("remove the vertex or export the mesh again"));
                }
            }
            match corners {
                [] | [_] | [_, _] => count(&mut small, line),
                &[a, b, c] => triangles.push([a, b, c]),
                _ => {
                    let points: Vec<DVec3> = corners.iter().map(|corner| self.positions[corner[0] as usize]).collect();
                    let cut = polygon::triangulate(&points);
                    triangles.extend(cut.into_iter().map(|triangle| triangle.map(|corner| corners[corner])));
                }
            }
        }
        self.small_faces = small;
        if triangles.is_empty() {
            return Err(Error::new(ErrorKind::Malformed, "no face of the OBJ file has three corners")
                .at(Place::Line(path.into(), small.1))
                .remedy("give a surface mesh; a face needs three corners or more"));
        }
        Ok(triangles)
    }

    /// The point to take off before coordinates become `f32`: that of the vertices in use, where they lie far out.
    pub fn origin(&self, triangles: &[[[u32; 3]; 3]]) -> DVec3 {
        let points = triangles.iter().flatten().map(|corner| self.positions[corner[0] as usize]);
        outliers::far_origin_of(points.collect()).unwrap_or_default()
    }

    /// What was left out, with the line of the first.
    pub fn findings(&self, path: &Path) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut tell = |severity, code, count: usize, line: usize, message: &str, remedy: &str| {
            if count > 0 {
                let finding = Finding::new(severity, code, format!("{count} {message}"));
                findings.push(finding.at(Place::Line(path.into(), line)).remedy(remedy).extent(count as f64));
            }
        };
        let (unused, line) = (self.bad_vertices.len(), self.bad_vertices.first().map_or(0, |bad| bad.1));
        let message = "vertices that no face uses are not finite, this is the first: they are ignored";
        tell(Severity::Note, "mesh-vertices-dropped", unused, line, message, "");
        let (count, line) = self.small_faces;
        let message = "faces have fewer than three corners, this is the first: they are ignored";
        let remedy = "check the exporter if they should be part of the surface";
        tell(Severity::Warning, "mesh-faces-dropped", count, line, message, remedy);
        let (count, line) = self.lines_and_points;
        let message = "lines and points are not surfaces; this is the first: they are ignored";
        tell(Severity::Note, "mesh-lines-dropped", count, line, message, "");
        let (count, line) = self.weighted;
        let message = "vertices have a fourth number, this is the first: they are divided by it, as by a weight";
        let remedy = "if it is a shade of grey, export the mesh without colours, or with three numbers for each";
        tell(Severity::Warning, "mesh-vertices-weighted", count, line, message, remedy);
        if let Some(line) = self.decimal_commas {
            let message = "numbers have decimal commas: they are read as points";
            let finding = Finding::new(Severity::Note, "decimal-commas", message);
            findings.push(finding.at(Place::Line(path.into(), line)));
        }
        findings
    }
}

fn count(counter: &mut (usize, usize), line: usize) {
    if counter.0 == 0 {
        counter.1 = line;
    }
    counter.0 += 1;
}

/// An index of a corner, counted from 0; `seen` elements stand before it. [`NONE`] where no element can have that number,
/// `None` for a word that is no whole number.
fn index(word: &str, seen: usize) -> Option<u32> {
    let index: i64 = word.parse().ok()?;
    let from_zero = if index < 0 { (seen as i64).checked_add(index) } else { index.checked_sub(1) };
    Some(from_zero.and_then(|index| u32::try_from(index).ok()).unwrap_or(NONE))
}

/// The first numbers of a line, `None` unless there are so many and all are finite.
fn finite<'a, const COUNT: usize>(mut words: impl Iterator<Item = &'a str>, comma: bool) -> Option<[f32; COUNT]> {
    let mut values = [0.0; COUNT];
    for value in &mut values {
        *value = words.next().and_then(|word| text::number(word, comma)).filter(|value| value.is_finite())? as f32;
    }
    Some(values)
}
