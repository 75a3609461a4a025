//! Degenerate dissolve: no edge without length, no face without area, no face twice.
//!
//! The meaning is that of Blender's `dissolve_degenerate`, to a fixpoint: edges shorter than a distance are collapsed,
//! then faces without height are removed. A face whose one corner lies on its opposite edge is not simply dropped, for
//! that would leave a T-junction: its neighbours across that edge are split at the corner. Attributes stay with their
//! corners. Cleaning a clean mesh changes nothing.

use super::topology::weld;
use crate::error::{Error, ErrorKind, Finding, Result, Severity};
use crate::scene::Mesh;
use crate::scene::read::outliers::bounds_of_most;
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// Rounds in which a face without height is dissolved into its neighbours; later ones are dropped, so that the loop
/// ends whatever the input.
const GENTLE_ROUNDS: usize = 24;

/// A mesh after degenerate dissolve.
#[derive(Clone, Debug, Default)]
pub struct Cleaned {
    /// The mesh; only referenced vertices, in the order of the input, split vertices last.
    pub mesh: Mesh,
    /// Index of each triangle in the input.
    pub source_triangle: Vec<u32>,
    /// Edges collapsed.
    pub edges_collapsed: usize,
    /// Faces without area removed, those of collapsed edges included.
    pub faces_dissolved: usize,
    /// Faces dropped because another one has the same corners in the same order.
    pub duplicates_dropped: usize,
}

impl Cleaned {
    /// What was done, for the user; empty when nothing was.
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if self.edges_collapsed + self.faces_dissolved > 0 {
            let message = format!(
                "{} edges without length and {} faces without area were dissolved",
                self.edges_collapsed, self.faces_dissolved
            );
            findings.push(Finding::new(Severity::Note, "mesh-degenerate", message));
        }
        if self.duplicates_dropped > 0 {
            let message = format!("{} faces occur more than once; one of each was kept", self.duplicates_dropped);
            findings.push(Finding::new(Severity::Note, "mesh-duplicate-faces", message));
        }
        findings
    }
}

/// Dissolves what is degenerate. `relative_distance` is the length below which an edge or the height of a face counts
/// as none, in diagonals of the box around most of the mesh (rounded down to a power of two, so that cleaning twice is cleaning once).
///
/// # Errors
/// `InvalidScene` when the mesh is inconsistent, has no triangles, or none that has an area; `NonFinite` for a vertex that
/// is not finite.
pub fn dissolve_degenerate(mesh: &Mesh, relative_distance: f64) -> Result<Cleaned> {
    mesh.validate()?;
    // One vertex far from all others must not make short edges of theirs.
    let points = mesh.triangles.iter().flatten().map(|&vertex| mesh.positions[vertex as usize].as_dvec3()).collect();
    let Some((low, high)) = bounds_of_most(points) else {
        return Err(Error::new(ErrorKind::InvalidScene, "the mesh has no triangles").remedy("give a mesh with faces"));
    };
    let diagonal = (high - low).length();
    let distance = if diagonal > 0.0 { (diagonal * relative_distance).log2().floor().exp2() } else { 0.0 };
    let mut work = Work::new(mesh, distance);
    let mut round = 0;
    loop {
        let before = work.changes;
        work.collapse_short_edges();
        work.drop_collapsed_and_repeated();
        work.dissolve_flat_faces(round < GENTLE_ROUNDS);
        round += 1;
        if work.changes == before {
            break;
        }
    }
    work.finish()
}

struct Work {
    distance: f64,
    mesh: Mesh,
    source: Vec<u32>,
    /// First vertex at the same position, through which positions are shared.
    point: Vec<u32>,
    changes: usize,
    cleaned: Cleaned,
}

impl Work {
    fn new(mesh: &Mesh, distance: f64) -> Self {
        Work {
            distance,
            mesh: mesh.clone(),
            source: (0..mesh.triangles.len() as u32).collect(),
            point: weld(&mesh.positions),
            changes: 0,
            cleaned: Cleaned::default(),
        }
    }

    /// The point of a vertex; follows points that were merged.
    fn point(&mut self, vertex: u32) -> u32 {
        let mut root = vertex;
        while self.point[root as usize] != root {
            root = self.point[root as usize];
        }
        self.point[vertex as usize] = root;
        root
    }

    fn points(&mut self, triangle: usize) -> [u32; 3] {
        self.mesh.triangles[triangle].map(|vertex| self.point(vertex))
    }

    fn position(&self, point: u32) -> DVec3 {
        self.mesh.positions[point as usize].as_dvec3()
    }

    fn collapse_short_edges(&mut self) {
        loop {
            let before = self.changes;
            for triangle in 0..self.mesh.triangles.len() {
                for corner in 0..3 {
                    let points = self.points(triangle);
                    let (a, b) = (points[corner], points[(corner + 1) % 3]);
                    if a != b && self.position(a).distance(self.position(b)) < self.distance {
                        self.point[a.max(b) as usize] = a.min(b);
                        self.changes += 1;
                        self.cleaned.edges_collapsed += 1;
                    }
                }
            }
            if self.changes == before {
                return;
            }
        }
    }

    fn drop_collapsed_and_repeated(&mut self) {
        let mut seen = HashSet::with_capacity(self.mesh.triangles.len());
        let mut keep = Vec::with_capacity(self.mesh.triangles.len());
        for triangle in 0..self.mesh.triangles.len() {
            let points = self.points(triangle);
            let collapsed = points[0] == points[1] || points[1] == points[2] || points[2] == points[0];
            // Two faces that turn their backs to each other are a sheet with two sides, not one face twice.
            let first = (0..3).min_by_key(|&corner| points[corner]).unwrap_or(0);
            let repeated =
                !collapsed && !seen.insert([points[first], points[(first + 1) % 3], points[(first + 2) % 3]]);
            self.cleaned.faces_dissolved += usize::from(collapsed);
            self.cleaned.duplicates_dropped += usize::from(repeated);
            keep.push(!collapsed && !repeated);
        }
        self.retain(&keep);
    }

    fn retain(&mut self, keep: &[bool]) {
        let mut kept = 0;
        for (triangle, &keep) in keep.iter().enumerate() {
            if keep {
                self.mesh.triangles[kept] = self.mesh.triangles[triangle];
                self.source[kept] = self.source[triangle];
                kept += 1;
            }
        }
        self.changes += keep.len() - kept;
        self.mesh.triangles.truncate(kept);
        self.source.truncate(kept);
    }

    /// Corner opposite the longest edge, when the face has no height above that edge.
    fn flat_corner(&self, points: [u32; 3]) -> Option<usize> {
        let corners = points.map(|point| self.position(point));
        let length = |corner: usize| corners[(corner + 1) % 3].distance(corners[(corner + 2) % 3]);
        let apex = (0..3).max_by(|&a, &b| length(a).total_cmp(&length(b)))?;
        let double_area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        (double_area < self.distance * length(apex) || double_area == 0.0).then_some(apex)
    }

    fn dissolve_flat_faces(&mut self, gently: bool) {
        let count = self.mesh.triangles.len();
        let flat: Vec<(usize, usize)> = (0..count)
            .filter_map(|triangle| {
                let points = self.points(triangle);
                self.flat_corner(points).map(|apex| (triangle, apex))
            })
            .collect();
        if flat.is_empty() {
            return;
        }
        self.cleaned.faces_dissolved += flat.len();
        let mut keep = vec![true; count];
        if gently {
            let mut faces_at: HashMap<(u32, u32), Vec<usize>> = HashMap::new();
            for &(triangle, apex) in &flat {
                let points = self.points(triangle);
                let (a, b) = (points[(apex + 1) % 3], points[(apex + 2) % 3]);
                faces_at.insert((a.min(b), a.max(b)), Vec::new());
            }
            for triangle in 0..count {
                let points = self.points(triangle);
                for corner in 0..3 {
                    let (a, b) = (points[corner], points[(corner + 1) % 3]);
                    if let Some(faces) = faces_at.get_mut(&(a.min(b), a.max(b))) {
                        faces.push(triangle);
                    }
                }
            }
            let mut touched = vec![false; count];
            for &(triangle, apex) in &flat {
                let points = self.points(triangle);
                let (a, b) = (points[(apex + 1) % 3], points[(apex + 2) % 3]);
                let faces = faces_at.get(&(a.min(b), a.max(b))).cloned().unwrap_or_default();
                if touched[triangle] || faces.iter().any(|&face| touched[face]) {
                    // The face or a neighbour has changed in this round: it waits for the next one.
                    self.cleaned.faces_dissolved -= 1;
                    self.changes += 1;
                    continue;
                }
                for face in faces {
                    touched[face] = true;
                    if face != triangle {
                        self.split_at(face, (a, b), triangle, apex, &mut keep);
                    }
                }
                keep[triangle] = false;
            }
        } else {
            for &(triangle, _) in &flat {
                keep[triangle] = false;
            }
        }
        keep.resize(self.mesh.triangles.len(), true);
        self.retain(&keep);
    }

    /// Splits `face` across its edge between points `a` and `b` at the apex of the flat triangle.
    fn split_at(&mut self, face: usize, (a, b): (u32, u32), flat: usize, apex: usize, keep: &mut [bool]) {
        let apex_vertex = self.mesh.triangles[flat][apex];
        let apex_point = self.point(apex_vertex);
        let points = self.points(face);
        let is_edge = |corner: usize| {
            let (from, to) = (points[corner], points[(corner + 1) % 3]);
            (from, to) == (a, b) || (from, to) == (b, a)
        };
        let Some(corner) = (0..3).find(|&corner| is_edge(corner)) else { return };
        if points[(corner + 2) % 3] == apex_point {
            // The same three corners: the face is as flat as the other and goes in its own turn.
            keep[face] = false;
            return;
        }
        let vertices = self.mesh.triangles[face];
        let (from, to, tip) = (vertices[corner], vertices[(corner + 1) % 3], vertices[(corner + 2) % 3]);
        let flat_vertices = self.mesh.triangles[flat];
        let middle = if flat_vertices.contains(&from) && flat_vertices.contains(&to) {
            apex_vertex
        } else {
            self.vertex_between(from, to, apex_point)
        };
        self.mesh.triangles[face] = [from, middle, tip];
        self.mesh.triangles.push([middle, to, tip]);
        self.source.push(self.source[face]);
        self.changes += 1;
    }

    /// A new vertex at `point`, with the attributes that the edge from `from` to `to` has nearest to it.
    fn vertex_between(&mut self, from: u32, to: u32, point: u32) -> u32 {
        let (start, end, middle) = (self.point(from), self.point(to), self.position(point));
        let (start, end) = (self.position(start), self.position(end));
        let along = end - start;
        let share = ((middle - start).dot(along) / along.length_squared()).clamp(0.0, 1.0) as f32;
        let (from, to) = (from as usize, to as usize);
        self.mesh.positions.push(self.mesh.positions[point as usize]);
        if !self.mesh.normals.is_empty() {
            let normal = self.mesh.normals[from].lerp(self.mesh.normals[to], share);
            self.mesh.normals.push(normal.try_normalize().unwrap_or(self.mesh.normals[from]));
        }
        if !self.mesh.uvs.is_empty() {
            self.mesh.uvs.push(self.mesh.uvs[from].lerp(self.mesh.uvs[to], share));
        }
        self.point.push(point);
        (self.mesh.positions.len() - 1) as u32
    }

    fn finish(mut self) -> Result<Cleaned> {
        if self.mesh.triangles.is_empty() {
            return Err(Error::new(ErrorKind::InvalidScene, "no triangle of the mesh has an area")
                .remedy("check the units and the export of the mesh"));
        }
        let mut name = vec![u32::MAX; self.mesh.positions.len()];
        for &vertex in self.mesh.triangles.iter().flatten() {
            name[vertex as usize] = 0;
        }
        let mut mesh = Mesh::default();
        for (vertex, name) in name.iter_mut().enumerate() {
            if *name == u32::MAX {
                continue;
            }
            *name = mesh.positions.len() as u32;
            let point = self.point(vertex as u32) as usize;
            mesh.positions.push(self.mesh.positions[point]);
            mesh.normals.extend(self.mesh.normals.get(vertex).copied());
            mesh.uvs.extend(self.mesh.uvs.get(vertex).copied());
        }
        mesh.triangles =
            self.mesh.triangles.iter().map(|triangle| triangle.map(|vertex| name[vertex as usize])).collect();
        self.cleaned.mesh = mesh;
        self.cleaned.source_triangle = self.source;
        Ok(self.cleaned)
    }
}
