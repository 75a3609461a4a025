//! STL, binary and ascii: loose triangles, whose corners are joined where they lie at one place.
//!
//! A binary file may begin with `solid` as an ascii one does: its length tells. Normals of facets are not taken up, they
//! follow from the corners.

use super::source_mesh::{SourceMesh, is_a_place, vertex_index};
use super::text;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use glam::{DVec3, Vec3};
use std::path::Path;

/// Bytes before the triangles: a header and their number.
const FRONT: usize = 84;
/// Bytes of a triangle: a normal, three corners, an attribute.
const FACET: usize = 50;

/// Reads an STL mesh.
///
/// # Errors
/// `Malformed` or `NonFinite` with line or byte.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    let count = bytes.get(FRONT - 4..FRONT).map_or(0, |four| u32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    let length = FRONT as u64 + FACET as u64 * u64::from(count);
    let start = bytes.trim_ascii_start();
    let is_text = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let trailing = (bytes.len() as u64).checked_sub(length).filter(|_| bytes.len() >= FRONT);
    // A text has letters for a number of triangles, which stand for more than any file holds.
    let (corners, findings) = if let Some(trailing) = trailing.filter(|more| *more == 0 || count > 0) {
        let message = format!("{trailing} bytes behind the last of {count} triangles are passed over");
        let told = Finding::new(Severity::Note, "stl-trailing-bytes", message)
            .at(Place::Byte(path.into(), length))
            .extent(trailing as f64);
        (of_binary(&bytes[FRONT..length as usize], path)?, if trailing > 0 { vec![told] } else { Vec::new() })
    } else if is_text || bytes.starts_with(b"\xef\xbb\xbf") {
        of_ascii(bytes, path)?
    } else {
        let message = format!("{count} triangles take {length} bytes, the file has {}", bytes.len());
        return Err(Error::new(ErrorKind::Malformed, message)
            .at(Place::Byte(path.into(), bytes.len() as u64))
            .remedy("the file is cut short or damaged: copy it again"));
    };
    if corners.is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "the STL file holds no triangles")
            .at(Place::File(path.into()))
            .remedy("export the mesh again"));
    }
    vertex_index(corners.len(), path)?;
    let triangles = (0..corners.len() as u32 / 3).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect();
    Ok(SourceMesh { positions: corners, triangles, findings, ..Default::default() })
}

fn of_binary(bytes: &[u8], path: &Path) -> Result<Vec<DVec3>> {
    let mut corners = Vec::with_capacity(3 * (bytes.len() / FACET));
    for (index, facet) in bytes.chunks_exact(FACET).enumerate() {
        for corner in 0..3 {
            let number = |axis: usize| {
                let start = 12 + 12 * corner + 4 * axis;
                f32::from_le_bytes([facet[start], facet[start + 1], facet[start + 2], facet[start + 3]])
            };
            let point = Vec3::new(number(0), number(1), number(2)).as_dvec3();
            if !is_a_place(point) {
                return Err(Error::new(ErrorKind::NonFinite, format!("a corner of triangle {index} is at {point}"))
                    .at(Place::Byte(path.into(), (FRONT + FACET * index) as u64))
                    .remedy("export the mesh again"));
            }
            corners.push(point);
        }
    }
    Ok(corners)
}

fn of_ascii(bytes: Vec<u8>, path: &Path) -> Result<(Vec<DVec3>, Vec<Finding>)> {
    let text = text::decode(bytes, path)?;
    let mut corners = Vec::new();
    let mut comma_line = None;
    for statement in text::statements(&text) {
        let mut words = statement.words();
        if !words.next().is_some_and(|word| word.eq_ignore_ascii_case("vertex")) {
            continue;
        }
        let comma = statement.has_decimal_commas();
        let numbers: Vec<f64> = words.map_while(|word| text::number(word, comma)).collect();
        let point = match numbers.as_slice() {
            &[x, y, z] => DVec3::new(x, y, z),
            _ => DVec3::NAN,
        };
        if !is_a_place(point) {
            return Err(Error::new(ErrorKind::Malformed, "a vertex is not three finite numbers")
                .at(Place::Line(path.into(), statement.line))
                .remedy("the file is damaged: export the mesh again"));
        }
        comma_line = comma_line.or(comma.then_some(statement.line));
        corners.push(point);
    }
    if corners.len() % 3 != 0 {
        return Err(Error::new(ErrorKind::Malformed, "the file ends within a triangle")
            .at(Place::Line(path.into(), text.lines().count()))
            .remedy("the file is cut short: copy it again"));
    }
    let findings = comma_line.map(|line| {
        Finding::new(Severity::Note, "decimal-commas", "numbers have decimal commas: they are read as points")
            .at(Place::Line(path.into(), line))
    });
    Ok((corners, findings.into_iter().collect()))
}
