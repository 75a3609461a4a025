//! A mesh on the graphics adapter.

use super::coarse;
use super::pipelines::MeshCorner;
use super::texels::Maker;
use crate::error::{Finding, Severity};
use crate::scene::Mesh;
use eframe::wgpu;
use glam::Vec3;
use half::f16;
use rayon::prelude::*;
use std::borrow::Cow;

/// A mesh of more triangles has a coarse twin.
const MANY_TRIANGLES: usize = 60_000;

/// Indices and their number.
pub(super) type Indices = (wgpu::Buffer, u32);

/// Corners and indices, or why there are none.
pub(super) struct GpuMesh {
    /// Corners, and the indices of all triangles.
    pub buffers: Option<(wgpu::Buffer, Indices)>,
    /// Indices of fewer triangles, for a mesh of many.
    pub coarse: Option<Indices>,
    /// Lower and upper corner in the world.
    pub bounds: Option<(Vec3, Vec3)>,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

impl GpuMesh {
    /// Checks and uploads a mesh. Normals are made where it has none; without texture coordinates all are 0. `colours` are
    /// those of its vertices, times their weights; none without.
    pub fn new(maker: &Maker, mesh: &Mesh, colours: Option<&[[f32; 4]]>) -> Self {
        let refused = |code, message: String, remedy: &str| GpuMesh {
            buffers: None,
            coarse: None,
            bounds: None,
            findings: vec![Finding::new(Severity::Warning, code, message).remedy(remedy)],
        };
        if let Err(error) = mesh.validate() {
            return refused("stage-mesh-invalid", error.to_string(), error.remedy_text());
        }
        if mesh.triangles.is_empty() {
            return GpuMesh { buffers: None, coarse: None, bounds: None, findings: Vec::new() };
        }
        let largest = maker.device.limits().max_buffer_size;
        let bytes = (mesh.positions.len() * size_of::<MeshCorner>()).max(mesh.triangles.len() * 12) as u64;
        let too_many = mesh.triangles.len() > (u32::MAX / 3) as usize;
        if bytes > largest || too_many {
            let message = format!(
                "the mesh needs a buffer of {} MB and the graphics adapter takes {} MB at most: it is not shown",
                bytes >> 20,
                largest >> 20
            );
            return refused("stage-mesh-too-large", message, "the fit is not concerned; thin the mesh out to see it");
        }
        let mesh = if mesh.normals.is_empty() {
            let mut whole = mesh.clone();
            whole.compute_normals();
            Cow::Owned(whole)
        } else {
            Cow::Borrowed(mesh)
        };
        let corner = |index: usize| MeshCorner {
            position: mesh.positions[index].to_array(),
            normal: mesh.normals[index].to_array(),
            uv: mesh.uvs.get(index).copied().unwrap_or_default().to_array(),
            colour: colours.and_then(|colours| colours.get(index)).copied().unwrap_or_default().map(|value| {
                // Beyond it half precision has no number.
                f16::from_f32(value.clamp(0.0, 65504.0))
            }),
        };
        let corners: Vec<MeshCorner> =
            (0..mesh.positions.len()).into_par_iter().with_min_len(4096).map(corner).collect();
        let upload = |label, bytes: &[u8], usage| {
            let buffer = maker.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes.len() as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            maker.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let vertices = upload("stage corners", bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX);
        let indices = |triangles: &[[u32; 3]]| {
            let buffer = upload("stage indices", bytemuck::cast_slice(triangles), wgpu::BufferUsages::INDEX);
            (buffer, 3 * triangles.len() as u32)
        };
        let bounds = mesh.bounds();
        let few =
            bounds.filter(|_| mesh.triangles.len() > MANY_TRIANGLES).map(|bounds| coarse::triangles(&mesh, bounds));
        GpuMesh {
            buffers: Some((vertices, indices(&mesh.triangles))),
            coarse: few.filter(|few| !few.is_empty()).map(|few| indices(&few)),
            bounds,
            findings: Vec::new(),
        }
    }
}
