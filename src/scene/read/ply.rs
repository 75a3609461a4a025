//! Stanford PLY, ascii and binary of both byte orders, by `ply-rs-bw` (after `ply_header`).
//!
//! A header may claim any number of elements. The claim is checked against the size of the file before anything is
//! read, so that a lying file of one kilobyte costs one kilobyte.

use super::ply_faces::{Face, split_at_seams};
use super::source_mesh::{SourceMesh, is_a_place, vertex_index};
use super::zip::Archive;
use super::{ply_header, polygon};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::name_of;
use glam::{DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use std::io::Cursor;
use std::path::Path;

/// Reads a PLY mesh; polygons are cut into triangles.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let archive = path.parent().filter(|parent| parent.is_file());
    let bytes = match archive {
        Some(archive) => Archive::open(archive)?.read(&name_of(path))?,
        None => std::fs::read(path).map_err(|source| Error::reading(path, source))?,
    };
    let readable = ply_header::readable(&bytes, path)?;
    let mut source = Source { path, reader: Reader::new(Cursor::new(&readable.bytes)), grown: readable.grown };
    let header = Parser::<Skipped>::new()
        .read_header(&mut source.reader)
        .map_err(|error| malformed(path, 0, format!("the PLY header cannot be read: {}", first_line(&error))))?;
    let mut mesh = SourceMesh::default();
    let mut faces: Vec<Face> = Vec::new();
    let mut face_lines: &[u32] = &[];
    let mut vertex_lines: &[u32] = &[];
    for (index, element) in header.elements.values().enumerate() {
        check_claim(&header, element, &readable.bytes, &source)?;
        let lines = readable.lines.get(index).map_or(&[][..], Vec::as_slice);
        match element.name.as_str() {
            "vertex" => {
                read_vertices(&mut source, &header, element, &mut mesh)?;
                vertex_lines = lines;
            }
            "face" => {
                faces = read_faces(&mut source, &header, element)?;
                face_lines = lines;
            }
            "tristrips" => {
                return Err(Error::new(ErrorKind::Unsupported, "the PLY file holds triangle strips")
                    .at(Place::File(path.into()))
                    .remedy("export the mesh as a list of faces"));
            }
            _ => {
                payload::<Skipped>(&mut source, &header, element)?;
            }
        }
    }
    if faces.is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "the PLY file holds no faces")
            .at(Place::File(path.into()))
            .remedy("give a surface mesh; a point cloud must be meshed first"));
    }
    let place = |lines: &[u32], index: usize| match lines.get(index) {
        Some(&line) => Place::Line(path.into(), line as usize),
        None => Place::File(path.into()),
    };
    split_at_seams(&mut mesh, &mut faces, path)?;
    cut(&mut mesh, &faces, &|index| place(face_lines, index), &|index| place(vertex_lines, index))?;
    Ok(mesh)
}

/// Cuts the faces into triangles. Faces of fewer than three corners and vertices that are not finite and not used are
/// left out, and told.
fn cut(
    mesh: &mut SourceMesh,
    faces: &[Face],
    place_of_face: &dyn Fn(usize) -> Place,
    place_of_vertex: &dyn Fn(usize) -> Place,
) -> Result<()> {
    let (mut small, mut first_small) = (0usize, 0);
    for (index, Face { corners, .. }) in faces.iter().enumerate() {
        let mut points = Vec::with_capacity(corners.len());
        for &corner in corners {
            let Some(position) = mesh.positions.get(corner as usize) else {
                let message = format!("face {index} names vertex {} of {}", corner as i32, mesh.positions.len());
                return Err(Error::new(ErrorKind::Malformed, message)
                    .at(place_of_face(index))
                    .remedy("the file is damaged: export it again"));
            };
            if !is_a_place(*position) {
                return Err(Error::new(
                    ErrorKind::NonFinite,
                    format!("vertex {corner} is at {position}, and a face uses it"),
                )
                .at(place_of_vertex(corner as usize))
                .remedy("remove the vertex or export the mesh again"));
            }
            points.push(*position);
        }
        if corners.len() < 3 {
            first_small = if small == 0 { index } else { first_small };
            small += 1;
        }
        let triangles = polygon::triangulate(&points);
        mesh.triangles.extend(triangles.into_iter().map(|triangle| triangle.map(|corner| corners[corner])));
    }
    if small > 0 {
        let message = format!("{small} faces have fewer than three corners, this is the first: they are ignored");
        mesh.findings.push(
            Finding::new(Severity::Warning, "mesh-faces-dropped", message)
                .at(place_of_face(first_small))
                .remedy("check the exporter if they should be part of the surface"),
        );
    }
    if mesh.triangles.is_empty() {
        return Err(Error::new(ErrorKind::Malformed, "no face of the PLY file has three corners")
            .at(place_of_face(first_small))
            .remedy("give a surface mesh; a face needs three corners or more"));
    }
    let bad: Vec<usize> = (0..mesh.positions.len()).filter(|&index| !is_a_place(mesh.positions[index])).collect();
    if let Some(&first) = bad.first() {
        // Their places are kept, since corners count.
        bad.iter().for_each(|&index| mesh.positions[index] = DVec3::ZERO);
        let message =
            format!("{} vertices that no face uses are not finite, this is the first: they are ignored", bad.len());
        mesh.findings.push(Finding::new(Severity::Note, "mesh-vertices-dropped", message).at(place_of_vertex(first)));
    }
    Ok(())
}

/// The bytes that are read, and how far they are.
struct Source<'a> {
    path: &'a Path,
    reader: ByteReader<'a>,
    /// Bytes by which the header grew.
    grown: i64,
}

impl Source<'_> {
    /// The byte of the file that is read next.
    fn byte(&self) -> u64 {
        self.reader.get_ref().position().saturating_add_signed(-self.grown)
    }
}

type ByteReader<'a> = Reader<Cursor<&'a [u8]>>;

/// Refuses an element whose smallest possible size is larger than what is left of the file.
fn check_claim(header: &Header, element: &ElementDef, bytes: &[u8], source: &Source) -> Result<()> {
    let left = (bytes.len() as u64).saturating_sub(source.reader.get_ref().position());
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
        .at(Place::Byte(source.path.into(), (bytes.len() as u64).saturating_add_signed(-source.grown)))
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

fn payload<E: PropertyAccess>(source: &mut Source, header: &Header, element: &ElementDef) -> Result<Vec<E>> {
    let parsed = Parser::<E>::new().read_payload_for_element(&mut source.reader, element, header);
    parsed.map_err(|error| {
        let message = if error.kind() == std::io::ErrorKind::UnexpectedEof {
            format!("the file ends within the {} elements '{}'", element.count, element.name)
        } else {
            format!("an element '{}' cannot be read: {}", element.name, first_line(&error))
        };
        malformed(source.path, source.byte(), message)
    })
}

fn malformed(path: &Path, byte: u64, message: String) -> Error {
    Error::new(ErrorKind::Malformed, message)
        .at(Place::Byte(path.into(), byte))
        .remedy("the file is cut short or damaged: copy it again")
}

/// The parser quotes the offending line below its message; one line is enough here.
fn first_line(error: &ParseError) -> String {
    error.to_string().lines().next().unwrap_or_default().to_owned()
}

fn read_vertices(source: &mut Source, header: &Header, element: &ElementDef, mesh: &mut SourceMesh) -> Result<()> {
    let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err(Error::new(ErrorKind::Malformed, "the vertices have no x, y and z")
            .at(Place::File(source.path.into()))
            .remedy("export the mesh again"));
    }
    let with_normals = has(&["nx", "ny", "nz"]);
    let with_uvs = has(&["s", "t"]) || has(&["u", "v"]) || has(&["texture_u", "texture_v"]);
    let vertices = payload::<Vertex>(source, header, element)?;
    vertex_index(vertices.len(), source.path)?;
    for Vertex(values) in &vertices {
        mesh.positions.push(DVec3::new(values[0], values[1], values[2]));
        if with_normals {
            mesh.normals.push(Vec3::new(values[3] as f32, values[4] as f32, values[5] as f32));
        }
        if with_uvs {
            mesh.uvs.push(Vec2::new(values[6] as f32, values[7] as f32));
        }
    }
    Ok(())
}

fn read_faces(source: &mut Source, header: &Header, element: &ElementDef) -> Result<Vec<Face>> {
    if !["vertex_indices", "vertex_index"].iter().any(|name| element.properties.contains_key(*name)) {
        return Err(Error::new(ErrorKind::Malformed, "the faces have no list vertex_indices")
            .at(Place::File(source.path.into()))
            .remedy("export the mesh again"));
    }
    payload::<Face>(source, header, element)
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

/// An element that is read over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Skipped
    }
}
