//! glTF 2.0, as `.glb` or as `.gltf` with its buffers, by the crate `gltf` (the document) and by hand (the numbers).
//!
//! All triangles of the default scene become one mesh in the scene's world, the transforms of its nodes applied in `f64`.
//! Every range of bytes is checked against its buffer before it is read. Compressed geometry (Draco, meshopt), sparse
//! accessors and skins are refused or ignored by name; extensions of materials, textures and lights change no geometry.

use super::source_mesh::{SourceMesh, is_a_place, uvs_dropped, vertex_index};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::as_stored;
use crate::image::file::guarded;
use base64::Engine;
use glam::{DMat4, DVec3, Vec2, Vec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::{Mode, Primitive};
use gltf::{Accessor, Document, Gltf, Semantic};
use std::collections::BTreeSet;
use std::path::Path;

/// Nodes deeper than this are a loop.
const DEEPEST: usize = 256;

/// Reads a glTF mesh.
///
/// # Errors
/// `Malformed`, `Unsupported` or `NonFinite`; `Missing` for a buffer that is not there.
pub fn read(path: &Path) -> Result<SourceMesh> {
    let bytes = std::fs::read(path).map_err(|source| Error::reading(path, source))?;
    // The crate panics where a mesh names an accessor that is not there.
    let decoded = guarded(path, || Ok(geometry_of(&bytes, path)))
        .map_err(|_| malformed(path, "the glTF file is damaged in a way its decoder did not expect".into()))?;
    let Gltf { document, mut blob } = decoded?;
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.take().ok_or_else(|| malformed(path, "the file has no binary part".into()))?
            }
            gltf::buffer::Source::Uri(uri) => of_uri(uri, path)?,
        };
        buffers.push(data);
    }
    let mut reader = Reader { path, buffers, mesh: SourceMesh::default(), materials: BTreeSet::new(), left_out: 0 };
    reader.add_scene(&document)?;
    reader.finish()
}

/// The document without its materials, textures and animations: what they need does not matter to the geometry.
fn geometry_of(bytes: &[u8], path: &Path) -> Result<Gltf> {
    let cannot = |error: gltf::Error| malformed(path, format!("the glTF file cannot be read: {error}"));
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(cannot)?;
    let mut root = document.into_json();
    root.extensions_required.retain(|name| !is_beside_geometry(name));
    if let Some(name) = root.extensions_required.first() {
        let (message, remedy) = if name.contains("draco") || name.contains("meshopt") {
            (format!("the geometry is compressed ({name}), which is not read"), "export it again, without compression")
        } else {
            (format!("the file requires the extension {name}, which is not read"), "export it again without it")
        };
        return Err(Error::new(ErrorKind::Unsupported, message).at(Place::File(path.into())).remedy(remedy));
    }
    root.materials.iter_mut().for_each(|material| *material = Default::default());
    root.textures.clear();
    root.images.clear();
    root.samplers.clear();
    root.animations.clear();
    let document = Document::from_json(root).map_err(cannot)?;
    Ok(Gltf { document, blob })
}

/// Whether an extension leaves the geometry as it is, or is read here: numbers of few bits are.
fn is_beside_geometry(name: &str) -> bool {
    const BEGINNINGS: [&str; 4] = ["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_"];
    const NAMES: [&str; 5] = [
        "KHR_mesh_quantization",
        "KHR_lights_punctual",
        "EXT_lights_image_based",
        "KHR_animation_pointer",
        "KHR_xmp_json_ld",
    ];
    BEGINNINGS.iter().any(|start| name.starts_with(start)) || NAMES.contains(&name)
}

fn malformed(path: &Path, message: String) -> Error {
    Error::new(ErrorKind::Malformed, message)
        .at(Place::File(path.into()))
        .remedy("the file is cut short or damaged: export it again")
}

/// A buffer beside the file, or within its text.
fn of_uri(uri: &str, path: &Path) -> Result<Vec<u8>> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once("base64,").map(|(_, encoded)| encoded);
        let encoded = encoded.ok_or_else(|| malformed(path, "a buffer in the text is not base64".into()))?;
        return base64::engine::general_purpose::STANDARD
            .decode(encoded)
            .map_err(|error| malformed(path, format!("a buffer in the text is not base64: {error}")));
    }
    let decoded = unescaped(uri);
    let relative = Path::new(&decoded);
    let stays = relative
        .components()
        .all(|part| matches!(part, std::path::Component::Normal(_) | std::path::Component::CurDir));
    if !stays || uri.contains("://") {
        return Err(Error::new(ErrorKind::Unsupported, format!("the buffer '{uri}' is not in the folder of the file"))
            .at(Place::File(path.into()))
            .remedy("save the mesh as .glb, which holds everything"));
    }
    // Some programs write names as they are, be there a percent sign in them or not.
    let plain = path.with_file_name("").join(uri);
    let file = if plain.is_file() { plain } else { as_stored(path.with_file_name("").join(&decoded)) };
    std::fs::read(&file)
        .map_err(|source| Error::reading(&file, source).with_remedy("copy the buffer beside the .gltf file"))
}

/// A reference with its percent escapes undone (RFC 3986, 2.1), which stand for bytes of UTF-8.
fn unescaped(uri: &str) -> String {
    let mut rest = uri.as_bytes();
    let mut bytes = Vec::with_capacity(rest.len());
    while let Some((&first, behind)) = rest.split_first() {
        let digit = |place: usize| char::from(*behind.get(place)?).to_digit(16);
        let escaped = if first == b'%' { digit(0).zip(digit(1)) } else { None };
        bytes.push(escaped.map_or(first, |(high, low)| (16 * high + low) as u8));
        rest = if escaped.is_some() { &behind[2..] } else { behind };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| uri.to_owned())
}

struct Reader<'a> {
    path: &'a Path,
    buffers: Vec<Vec<u8>>,
    mesh: SourceMesh,
    materials: BTreeSet<Option<usize>>,
    /// Lines and points.
    left_out: usize,
}

/// Attributes of a primitive, one entry a vertex.
struct Vertices {
    positions: Vec<DVec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

impl Reader<'_> {
    fn add_scene(&mut self, document: &Document) -> Result<()> {
        let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
            return Err(malformed(self.path, "the file holds no scene".into()));
        };
        let mut waiting: Vec<_> = scene.nodes().map(|node| (node, DMat4::IDENTITY, 0)).collect();
        while let Some((node, parent, depth)) = waiting.pop() {
            if depth > DEEPEST {
                return Err(malformed(self.path, "the nodes of the scene form a loop".into()));
            }
            let columns = node.transform().matrix().map(|column| column.map(f64::from));
            let world_from_node = parent * DMat4::from_cols_array_2d(&columns);
            for primitive in node.mesh().into_iter().flat_map(|mesh| mesh.primitives()) {
                self.add(&primitive, &world_from_node)?;
            }
            waiting.extend(node.children().map(|child| (child, world_from_node, depth + 1)));
        }
        Ok(())
    }

    fn add(&mut self, primitive: &Primitive, world_from_node: &DMat4) -> Result<()> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.left_out += 1;
            return Ok(());
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        let points: Vec<DVec3> = self.numbers::<3>(&positions)?.into_iter().map(DVec3::from_array).collect();
        let count = points.len();
        let corners: Vec<usize> = match primitive.indices() {
            Some(indices) => self.numbers::<1>(&indices)?.into_iter().map(|[index]| index as usize).collect(),
            None => (0..count).collect(),
        };
        if let Some(corner) = corners.iter().find(|&&corner| corner >= count) {
            return Err(malformed(self.path, format!("a triangle names vertex {corner} of {count}")));
        }
        let mut vertices = Vertices { positions: points, normals: Vec::new(), uvs: Vec::new() };
        if let Some(normals) = primitive.get(&Semantic::Normals) {
            let numbers = self.numbers::<3>(&normals)?;
            vertices.normals = numbers.into_iter().map(|normal| DVec3::from_array(normal).as_vec3()).collect();
        }
        if let Some(uvs) = primitive.get(&Semantic::TexCoords(0)) {
            // v grows downwards there.
            vertices.uvs =
                self.numbers::<2>(&uvs)?.into_iter().map(|[u, v]| Vec2::new(u as f32, 1.0 - v as f32)).collect();
        }
        self.materials.insert(primitive.material().index());
        let triangles: Vec<[usize; 3]> = match mode {
            Mode::Triangles => corners.chunks_exact(3).map(|three| [three[0], three[1], three[2]]).collect(),
            Mode::TriangleStrip => {
                let odd = |(index, three): (usize, &[usize])| match index % 2 {
                    0 => [three[0], three[1], three[2]],
                    _ => [three[1], three[0], three[2]],
                };
                corners.windows(3).enumerate().map(odd).collect()
            }
            _ => corners.get(1..).unwrap_or_default().windows(2).map(|pair| [corners[0], pair[0], pair[1]]).collect(),
        };
        self.join(vertices, triangles, world_from_node)
    }

    fn join(&mut self, vertices: Vertices, triangles: Vec<[usize; 3]>, world_from_node: &DMat4) -> Result<()> {
        let Vertices { positions, normals, uvs } = vertices;
        let mesh = &mut self.mesh;
        let before = mesh.positions.len();
        vertex_index(before + positions.len(), self.path)?;
        let mut used = vec![false; positions.len()];
        triangles.iter().flatten().for_each(|&corner| used[corner] = true);
        for (point, used) in positions.iter().zip(used) {
            let point = world_from_node.transform_point3(*point);
            if used && !is_a_place(point) {
                return Err(Error::new(ErrorKind::NonFinite, format!("a vertex of a triangle is at {point}"))
                    .at(Place::File(self.path.into()))
                    .remedy("export the mesh again"));
            }
            mesh.positions.push(if is_a_place(point) { point } else { DVec3::ZERO });
        }
        // An attribute that one part lacks is kept for none: the lists stay as long as the positions until then.
        let linear = glam::DMat3::from_mat4(*world_from_node);
        let is_mirror = linear.determinant() < 0.0;
        let of_normals = linear.inverse().transpose();
        if mesh.normals.len() == before && normals.len() == positions.len() {
            let turned = normals.iter().map(|normal| (of_normals * normal.as_dvec3()).as_vec3());
            mesh.normals.extend(turned.map(|normal| if normal.is_finite() { normal } else { Vec3::ZERO }));
        }
        if mesh.uvs.len() == before && uvs.len() == positions.len() {
            mesh.uvs.extend(uvs);
        }
        mesh.triangles.extend(triangles.into_iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| (before + corner) as u32);
            if is_mirror { [a, c, b] } else { [a, b, c] }
        }));
        Ok(())
    }

    fn finish(self) -> Result<SourceMesh> {
        let Reader { path, mut mesh, materials, left_out, .. } = self;
        if mesh.triangles.is_empty() {
            return Err(Error::new(ErrorKind::Malformed, "the glTF file holds no triangles")
                .at(Place::File(path.into()))
                .remedy("give a surface mesh; a point cloud must be meshed first"));
        }
        if mesh.normals.len() != mesh.positions.len() {
            mesh.normals.clear();
        }
        let are_complete = mesh.uvs.len() == mesh.positions.len();
        if !mesh.uvs.is_empty() && (!are_complete || materials.len() > 1) {
            let message = match are_complete {
                true => format!("the texture coordinates refer to {} materials and are not kept", materials.len()),
                false => "parts of the mesh have no texture coordinates: none are kept".into(),
            };
            mesh.findings.push(uvs_dropped(path, message));
            mesh.uvs.clear();
        }
        if left_out > 0 {
            let message = format!("{left_out} sets of lines or points are not surfaces: they are ignored");
            let told = Finding::new(Severity::Note, "mesh-lines-dropped", message).at(Place::File(path.into()));
            mesh.findings.push(told.extent(left_out as f64));
        }
        Ok(mesh)
    }

    /// The numbers of an accessor, `COUNT` an element; whole ones that stand for shares become shares.
    fn numbers<const COUNT: usize>(&self, accessor: &Accessor) -> Result<Vec<[f64; COUNT]>> {
        let damaged = |what: &str| malformed(self.path, format!("accessor {} {what}", accessor.index()));
        let dimensions = match accessor.dimensions() {
            Dimensions::Scalar => 1,
            Dimensions::Vec2 => 2,
            Dimensions::Vec3 => 3,
            _ => 0,
        };
        if dimensions != COUNT {
            return Err(damaged(&format!("has elements other than of {COUNT} numbers")));
        }
        let (Some(view), None) = (accessor.view(), accessor.sparse()) else {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("accessor {} is sparse or has no data", accessor.index()),
            )
            .at(Place::File(self.path.into()))
            .remedy("export the mesh as plain glTF, without compression"));
        };
        let (kind, count) = (accessor.data_type(), accessor.count());
        let size = kind.size() * COUNT;
        let stride = view.stride().unwrap_or(size);
        let buffer = self.buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        let bytes = view
            .offset()
            .checked_add(view.length())
            .and_then(|end| buffer.get(view.offset()..end))
            .and_then(|bytes| bytes.get(accessor.offset()..))
            .ok_or_else(|| damaged("lies outside its buffer"))?;
        let needed = count.saturating_sub(1).saturating_mul(stride).saturating_add(size);
        if count == 0 || needed > bytes.len() || stride < size {
            return Err(damaged("lies outside its buffer"));
        }
        let is_share = accessor.normalized();
        let number = |four: &[u8]| -> f64 {
            let two = || [four[0], four[1]];
            let (value, most) = match kind {
                DataType::I8 => (f64::from(four[0] as i8), 127.0),
                DataType::U8 => (f64::from(four[0]), 255.0),
                DataType::I16 => (f64::from(i16::from_le_bytes(two())), 32767.0),
                DataType::U16 => (f64::from(u16::from_le_bytes(two())), 65535.0),
                DataType::U32 => {
                    return f64::from(u32::from_le_bytes([four[0], four[1], four[2], four[3]]));
                }
                DataType::F32 => {
                    return f64::from(f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
                }
            };
            if is_share { (value / most).max(-1.0) } else { value }
        };
        let element = |index: usize| {
            let start = index * stride;
            std::array::from_fn(|part| number(&bytes[start + part * kind.size()..]))
        };
        Ok((0..count).map(element).collect())
    }
}
