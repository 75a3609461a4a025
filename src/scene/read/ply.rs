//! Stanford PLY, ascii and binary of both byte orders, by `ply-rs-bw`.
//!
//! A header may claim any number of elements. The claim is checked against the size of the file before anything is
//! read, so that a lying file of one kilobyte costs one kilobyte.

use super::mesh_file::{SourceMesh, vertex_index};
use crate::error::{Error, ErrorKind, Place, Result};
use glam::{DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    BeginList, ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use std::io::Cursor;
use std::path::Path;

/// Reads a PLY mesh; polygons become fans of triangles.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    let mut reader = Reader::new(Cursor::new(bytes.as_slice()));
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|error| {
        malformed(path, &error, 0, format!("the PLY header cannot be read: {}", first_line(&error)))
    })?;
    let mut mesh = SourceMesh::default();
    for element in header.elements.values() {
        check_claim(path, &header, element, &bytes, &reader)?;
        match element.name.as_str() {
            "vertex" => read_vertices(path, &mut reader, &header, element, &mut mesh)?,
            "face" => read_faces(path, &mut reader, &header, element, &mut mesh)?,
            "tristrips" => {
                return Err(Error::new(ErrorKind::Unsupported, "the PLY file holds triangle strips")
                    .at(Place::File(path.into()))
                    .remedy("export the mesh as a list of faces"));
            }
            _ => {
                payload::<Skipped>(path, &mut reader, &header, element)?;
            }
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "the PLY file holds no faces")
            .at(Place::File(path.into()))
            .remedy("give a surface mesh; a point cloud must be meshed first"));
    }
    Ok(mesh)
}

type ByteReader<'a> = Reader<Cursor<&'a [u8]>>;

/// Refuses an element whose smallest possible size is larger than what is left of the file.
fn check_claim(path: &Path, header: &Header, element: &ElementDef, bytes: &[u8], reader: &ByteReader) -> Result<()> {
    let left = (bytes.len() as u64).saturating_sub(reader.get_ref().position());
    let smallest: u64 = match header.encoding {
        // A digit and a separator for each number.
        Encoding::Ascii => 2 * element.properties.len() as u64,
        _ => element
            .properties
            .values()
            .map(|property| match &property.data_type {
                PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => size_of_scalar(scalar),
            })
            .sum(),
    };
    let needed = (element.count as u64).saturating_mul(smallest.max(1));
    if needed > left + 1 {
        return Err(Error::new(
            ErrorKind::Malformed,
            format!(
                "the header claims {} elements '{}' of at least {} bytes, but only {left} bytes follow",
                element.count,
                element.name,
                smallest.max(1)
            ),
        )
        .at(Place::Byte(path.into(), bytes.len() as u64))
        .remedy("the file is cut short or damaged: copy it again"));
    }
    Ok(())
}

fn size_of_scalar(scalar: &ScalarType) -> u64 {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

fn payload<E: PropertyAccess>(
    path: &Path,
    reader: &mut ByteReader,
    header: &Header,
    element: &ElementDef,
) -> Result<Vec<E>> {
    let parsed = Parser::<E>::new().read_payload_for_element(reader, element, header);
    parsed.map_err(|error| {
        let byte = reader.get_ref().position();
        let message = if error.kind() == std::io::ErrorKind::UnexpectedEof {
            format!("the file ends within the {} elements '{}'", element.count, element.name)
        } else {
            format!("an element '{}' cannot be read: {}", element.name, first_line(&error))
        };
        malformed(path, &error, byte, message)
    })
}

fn malformed(path: &Path, error: &ParseError, byte: u64, message: String) -> Error {
    let place = match error.line() {
        Some(line) => Place::Line(path.into(), line),
        None => Place::Byte(path.into(), byte),
    };
    Error::new(ErrorKind::Malformed, message).at(place).remedy("the file is cut short or damaged: copy it again")
}

/// The parser quotes the offending line below its message; one line is enough here.
fn first_line(error: &ParseError) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

fn read_vertices(
    path: &Path,
    reader: &mut ByteReader,
    header: &Header,
    element: &ElementDef,
    mesh: &mut SourceMesh,
) -> Result<()> {
    let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err(Error::new(ErrorKind::Malformed, "the vertices have no x, y and z")
            .at(Place::File(path.into()))
            .remedy("export the mesh again"));
    }
    let with_normals = has(&["nx", "ny", "nz"]);
    let with_uvs = has(&["s", "t"]) || has(&["u", "v"]) || has(&["texture_u", "texture_v"]);
    let first_line = reader.line();
    let vertices = payload::<Vertex>(path, reader, header, element)?;
    vertex_index(vertices.len(), path)?;
    for (index, Vertex(values)) in vertices.iter().enumerate() {
        let position = DVec3::new(values[0], values[1], values[2]);
        if !position.is_finite() || position.abs().max_element() > 1e30 {
            let place = match header.encoding {
                Encoding::Ascii => Place::Line(path.into(), first_line + index),
                _ => Place::File(path.into()),
            };
            return Err(Error::new(ErrorKind::NonFinite, format!("vertex {index} is at {position}"))
                .at(place)
                .remedy("remove the vertex or export the mesh again"));
        }
        mesh.positions.push(position);
        if with_normals {
            mesh.normals.push(Vec3::new(values[3] as f32, values[4] as f32, values[5] as f32));
        }
        if with_uvs {
            mesh.uvs.push(Vec2::new(values[6] as f32, values[7] as f32));
        }
    }
    Ok(())
}

fn read_faces(
    path: &Path,
    reader: &mut ByteReader,
    header: &Header,
    element: &ElementDef,
    mesh: &mut SourceMesh,
) -> Result<()> {
    let first_line = reader.line();
    if !["vertex_indices", "vertex_index"].iter().any(|name| element.properties.contains_key(*name)) {
        return Err(Error::new(ErrorKind::Malformed, "the faces have no list vertex_indices")
            .at(Place::File(path.into()))
            .remedy("export the mesh again"));
    }
    let count = if mesh.positions.is_empty() {
        header.elements.get("vertex").map_or(0, |vertices| vertices.count)
    } else {
        mesh.positions.len()
    };
    for (index, Face(corners)) in payload::<Face>(path, reader, header, element)?.iter().enumerate() {
        let place = || match header.encoding {
            Encoding::Ascii => Place::Line(path.into(), first_line + index),
            _ => Place::File(path.into()),
        };
        if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= count) {
            return Err(Error::new(
                ErrorKind::Malformed,
                format!("face {index} names vertex {} of {count}", *corner as i32),
            )
            .at(place())
            .remedy("the file is damaged: export it again"));
        }
        if corners.len() < 3 {
            return Err(Error::new(ErrorKind::Malformed, format!("face {index} has {} corners", corners.len()))
                .at(place())
                .remedy("a face needs three corners or more"));
        }
        mesh.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
    }
    Ok(())
}

/// Position, normal and texture coordinate.
struct Vertex([f64; 8]);

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        let place = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "nx" => 3,
            "ny" => 4,
            "nz" => 5,
            "s" | "u" | "texture_u" => 6,
            "t" | "v" | "texture_v" => 7,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[place] = value;
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex([0.0; 8])
    }
    fn set_float(&mut self, name: &str, value: f32) -> PropertyAccessResult {
        self.set(name, f64::from(value))
    }
    fn set_double(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        self.set(name, value)
    }
    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(value) => f64::from(value),
            Property::UChar(value) => f64::from(value),
            Property::Short(value) => f64::from(value),
            Property::UShort(value) => f64::from(value),
            Property::Int(value) => f64::from(value),
            Property::UInt(value) => f64::from(value),
            _ => return PropertyAccessResult::Ignored,
        };
        self.set(name, value)
    }
}

/// Corners of a polygon. Negative or overlong indices become `u32::MAX`, which no mesh has.
struct Face(Vec<u32>);

fn is_corner_list(name: &str) -> bool {
    name == "vertex_indices" || name == "vertex_index"
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face(Vec::new())
    }
    fn begin_list_uint(&mut self, name: &str, _length: usize) -> BeginList<'_, u32> {
        if is_corner_list(name) { BeginList::Fill(&mut self.0) } else { BeginList::UseSetter }
    }
    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_corner_list(name) {
            return PropertyAccessResult::Ignored;
        }
        let index = |value: i64| u32::try_from(value).unwrap_or(u32::MAX);
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUChar(list) => list.into_iter().map(u32::from).collect(),
            Property::ListShort(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUShort(list) => list.into_iter().map(u32::from).collect(),
            Property::ListInt(list) => list.into_iter().map(|value| index(value.into())).collect(),
            Property::ListUInt(list) => list,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element that is read over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Skipped
    }
}
