//! UDIM tiles: texture coordinates beyond [0, 1], a square of which is a picture of its own.
//!
//! The tile of a triangle is where its middle lies: 1001 + u + 10 v by whole numbers, u from 0 to 9 (Foundry's UDIM). The
//! program has one square of texels, so tiles are laid out in it side by side, in the order of their numbers from the lower
//! left; a mesh whose coordinates wander over tiles as those of a repeated texture do is left as it is.

use super::source_mesh::SourceMesh;
use crate::error::{Finding, Severity};
use glam::{IVec2, Vec2};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// How far a corner may lie outside the tile of its triangle.
const TOLERANCE: f32 = 1e-4;
/// Tiles in a row of the numbering.
const ROW: i32 = 10;
/// With more tiles than this they would get too few texels each.
const MOST_TILES: usize = 64;

/// The number of a tile.
fn number(tile: IVec2) -> i32 {
    1001 + tile.x + ROW * tile.y
}

/// The tile that a triangle lies in; `None` when it lies in several or in none that has a number.
fn tile_of(corners: [Vec2; 3]) -> Option<IVec2> {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    let tile = middle.floor();
    let is_inside = |corner: &Vec2| {
        let place = *corner - tile;
        place.min_element() >= -TOLERANCE && place.max_element() <= 1.0 + TOLERANCE
    };
    let has_number = tile.min_element() >= 0.0 && tile.x < ROW as f32 && tile.y < 100.0;
    (has_number && corners.iter().all(is_inside)).then(|| tile.as_ivec2())
}

/// Whether texture coordinates lie in several tiles, every triangle in one.
pub fn are_tiles(triangles: impl Iterator<Item = [Vec2; 3]>) -> bool {
    let mut tiles = BTreeSet::new();
    for corners in triangles {
        match tile_of(corners) {
            Some(tile) => tiles.insert(number(tile)),
            None => return false,
        };
    }
    tiles.len() > 1 && tiles.len() <= MOST_TILES
}

/// Lays the tiles of a mesh out in one square, if it has several.
pub fn lay_out(mesh: &mut SourceMesh) {
    if mesh.uvs.len() != mesh.positions.len() {
        return;
    }
    let uvs = |mesh: &SourceMesh, triangle: &[u32; 3]| triangle.map(|vertex| mesh.uvs[vertex as usize]);
    if !are_tiles(mesh.triangles.iter().map(|triangle| uvs(mesh, triangle))) {
        return;
    }
    let tiles: Vec<Option<IVec2>> = mesh.triangles.iter().map(|triangle| tile_of(uvs(mesh, triangle))).collect();
    let numbers: BTreeMap<i32, IVec2> = tiles.iter().flatten().map(|tile| (number(*tile), *tile)).collect();
    let side = (1..).find(|side| side * side >= numbers.len()).unwrap_or(1);
    let place_of: HashMap<IVec2, Vec2> = numbers
        .values()
        .enumerate()
        .map(|(index, tile)| (*tile, Vec2::new((index % side) as f32, (index / side) as f32)))
        .collect();
    // A vertex on the border of two tiles becomes two.
    let mut copy_of: HashMap<(u32, IVec2), u32> = HashMap::new();
    let mut laid: Vec<Option<IVec2>> = vec![None; mesh.positions.len()];
    for (triangle, tile) in tiles.iter().enumerate() {
        let Some(tile) = *tile else { continue };
        for corner in 0..3 {
            let vertex = mesh.triangles[triangle][corner];
            let own = match laid[vertex as usize] {
                None => {
                    laid[vertex as usize] = Some(tile);
                    vertex
                }
                Some(first) if first == tile => vertex,
                Some(_) => *copy_of.entry((vertex, tile)).or_insert_with(|| {
                    let index = vertex as usize;
                    mesh.positions.push(mesh.positions[index]);
                    mesh.uvs.push(mesh.uvs[index]);
                    if let Some(normal) = mesh.normals.get(index).copied() {
                        mesh.normals.push(normal);
                    }
                    (mesh.positions.len() - 1) as u32
                }),
            };
            mesh.triangles[triangle][corner] = own;
        }
    }
    let tile_of_copy = copy_of.iter().map(|((_, tile), copy)| (*copy as usize, *tile));
    let of_vertices = laid.iter().enumerate().filter_map(|(vertex, tile)| Some((vertex, (*tile)?)));
    let moved: Vec<(usize, IVec2)> = of_vertices.chain(tile_of_copy).collect();
    for (vertex, tile) in moved {
        let inside = (mesh.uvs[vertex] - tile.as_vec2()).clamp(Vec2::ZERO, Vec2::ONE);
        mesh.uvs[vertex] = (inside + place_of[&tile]) / side as f32;
    }
    let names: Vec<String> = numbers.keys().map(i32::to_string).collect();
    let message = format!(
        "the texture coordinates lie in the UDIM tiles {}: they are laid out in one square of {side} x {side}, row by row \
         from the lower left",
        names.join(", ")
    );
    mesh.findings.push(
        Finding::new(Severity::Note, "mesh-udim", message).remedy(format!(
            "each tile gets 1 / {side} of the width of the maps: fit larger ones to keep their detail"
        )),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Two squares side by side that share two vertices, the right one in the tile 1012.
    fn mesh(right: Vec2) -> SourceMesh {
        let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from_array);
        SourceMesh {
            positions: (0..8).map(|index| DVec3::new(f64::from(index), 0.0, 0.0)).collect(),
            uvs: [uvs, uvs.map(|uv| uv + right)].concat(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
            ..Default::default()
        }
    }

    #[test]
    fn tiles_are_laid_out_side_by_side() {
        let mut tiled = mesh(Vec2::new(1.0, 1.0));
        lay_out(&mut tiled);
        assert!(tiled.findings[0].message.contains("1001, 1012"), "{:?}", tiled.findings);
        assert_eq!(tiled.uvs[2], Vec2::new(0.5, 0.5));
        assert_eq!((tiled.uvs[4], tiled.uvs[6]), (Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5)));

        // The corner (1, 1) of the first tile is the corner (0, 0) of the other: it stands in both.
        let mut joined = mesh(Vec2::new(1.0, 1.0));
        joined.triangles[2] = [2, 5, 6];
        lay_out(&mut joined);
        assert_eq!(joined.positions.len(), 9);
        let copy = joined.triangles[2][0] as usize;
        assert_eq!((joined.positions[copy], joined.uvs[copy]), (joined.positions[2], Vec2::new(0.5, 0.0)));
        assert_eq!(joined.uvs[2], Vec2::new(0.5, 0.5));
    }

    #[test]
    fn one_tile_and_repeated_textures_are_left_alone() {
        for right in [Vec2::ZERO, Vec2::new(0.5, 0.0), Vec2::new(-1.0, 0.0), Vec2::new(12.0, 0.0)] {
            let mut same = mesh(right);
            let before = same.uvs.clone();
            lay_out(&mut same);
            assert_eq!((same.uvs, same.findings.len()), (before, 0), "{right}");
        }
    }
}
