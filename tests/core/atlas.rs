//! Properties that every atlas has, on shapes with known answers and on real meshes.

#![allow(clippy::unwrap_used)]

use super::beside::data;
use glam::{Vec2, Vec3};
use patina::ErrorKind;
use patina::atlas::raster::overlaps;
use patina::atlas::{Atlas, AtlasSettings, KeepUv, build, covered_texels};
use patina::scene::Mesh;
use std::collections::HashMap;

fn settings(resolution: usize) -> AtlasSettings {
    AtlasSettings { resolution_texels: resolution, keep_uv: KeepUv::Rebuild, ..AtlasSettings::default() }
}

/// Builds an atlas and checks what must hold for every mesh, with code that shares nothing with the atlas but the
/// counting of overlaps.
fn checked(mesh: &Mesh, settings: &AtlasSettings) -> Atlas {
    let atlas = build(mesh, settings, &|share| assert!((0.0..=1.0).contains(&share))).unwrap();
    let made = &atlas.mesh;
    let resolution = settings.resolution_texels;
    made.validate().unwrap();
    assert_eq!(made.uvs.len(), made.positions.len());
    assert_eq!(made.normals.len(), if mesh.normals.is_empty() { 0 } else { made.positions.len() });
    assert!(made.uvs.iter().all(|uv| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()));
    assert_eq!(atlas.chart_of_triangle.len(), made.triangles.len());
    assert_eq!(atlas.source_triangle.len(), made.triangles.len());
    assert!(atlas.source_triangle.iter().all(|&source| (source as usize) < mesh.triangles.len()));
    let charts = *atlas.chart_of_triangle.iter().max().unwrap() as usize + 1;
    assert_eq!(charts, atlas.quality.charts);

    // No vertex belongs to two charts, so every triangle lies in exactly one.
    let mut chart_of_vertex = vec![None; made.positions.len()];
    let (mut space, mut texture) = (vec![0.0f64; charts], vec![0.0f64; charts]);
    for (index, triangle) in made.triangles.iter().enumerate() {
        let chart = atlas.chart_of_triangle[index];
        for &vertex in triangle {
            assert_eq!(*chart_of_vertex[vertex as usize].get_or_insert(chart), chart);
        }
        let [a, b, c] = triangle.map(|vertex| made.uvs[vertex as usize].as_dvec2());
        let signed = (b - a).perp_dot(c - a) / 2.0;
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        assert!(signed > -longest * 2f64.powi(-22), "triangle {index} is flipped: area {signed:e}");
        texture[chart as usize] += signed;
        space[chart as usize] += f64::from(made.area_vector(index).length()) / 2.0;
    }
    // Even density: charts of more than a few texels have the same texture area per surface area.
    let density = texture.iter().sum::<f64>() / space.iter().sum::<f64>();
    let texels = (resolution * resolution) as f64;
    for chart in 0..charts {
        if texture[chart] * texels > 4.0 {
            let ratio = texture[chart] / space[chart] / density;
            assert!((ratio - 1.0).abs() < 0.01, "chart {chart} has {ratio} times the mean density");
        }
    }
    assert_eq!(overlaps(made, resolution), 0);
    assert_eq!(atlas.quality.overlapping_texels, 0);
    assert_eq!(atlas.quality.flipped_triangles, 0);
    assert!(atlas.quality.narrowest_gutter_texels.is_none_or(|gutter| gutter >= settings.gutter_texels));
    check_gutters(&atlas, resolution, settings.gutter_texels);
    let covered = covered_texels(made, resolution, resolution).pixels().iter().filter(|&&texel| texel).count();
    assert!((covered as f64 / texels - atlas.quality.share_covered).abs() < 1e-12);
    assert!(atlas.quality.share_covered >= atlas.quality.share_of_area - 1e-3);
    atlas
}

/// Vertices of different charts lie farther apart than the gutter, by a search over a grid.
fn check_gutters(atlas: &Atlas, resolution: usize, gutter: usize) {
    let mut cells: HashMap<(i64, i64), Vec<(Vec2, u32)>> = HashMap::new();
    let cell = |texel: Vec2| ((texel.x / 8.0) as i64, (texel.y / 8.0) as i64);
    for (index, triangle) in atlas.mesh.triangles.iter().enumerate() {
        for &vertex in triangle {
            let texel = atlas.mesh.uvs[vertex as usize] * resolution as f32;
            cells.entry(cell(texel)).or_default().push((texel, atlas.chart_of_triangle[index]));
        }
    }
    for (&(x, y), texels) in &cells {
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1), (-1, 1)] {
            let Some(others) = cells.get(&(x + dx, y + dy)) else { continue };
            for (a, chart_a) in texels {
                for (b, chart_b) in others {
                    let apart = (*a - *b).abs().max_element();
                    assert!(chart_a == chart_b || apart > gutter as f32 - 0.01, "{a} and {b}: {apart}");
                }
            }
        }
    }
}

fn grid(columns: usize, rows: usize, point: impl Fn(f32, f32) -> Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            mesh.positions.push(point(column as f32 / columns as f32, row as f32 / rows as f32));
        }
    }
    let vertex = |row: usize, column: usize| (row * (columns + 1) + column) as u32;
    for row in 0..rows {
        for column in 0..columns {
            let corners = [(0, 0), (0, 1), (1, 1), (1, 0)].map(|(down, right)| vertex(row + down, column + right));
            mesh.triangles.push([corners[0], corners[1], corners[2]]);
            mesh.triangles.push([corners[0], corners[2], corners[3]]);
        }
    }
    mesh
}

fn torus(columns: usize, rows: usize) -> Mesh {
    let tau = std::f32::consts::TAU;
    let mut mesh = grid(columns, rows, |u, v| {
        let ring = 1.0 + 0.35 * (tau * v).cos();
        Vec3::new(ring * (tau * u).cos(), ring * (tau * u).sin(), 0.35 * (tau * v).sin())
    });
    // Close it by index: the last row and column are the first ones.
    let wrap = |vertex: u32| {
        let (row, column) = (vertex as usize / (columns + 1), vertex as usize % (columns + 1));
        ((row % rows) * (columns + 1) + column % columns) as u32
    };
    mesh.triangles.iter_mut().for_each(|triangle| *triangle = triangle.map(wrap));
    mesh
}

fn icosphere(levels: usize) -> Mesh {
    let g = (1.0 + 5f32.sqrt()) / 2.0;
    let mut mesh = Mesh::default();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        mesh.positions
            .extend([Vec3::new(a, b, 0.0), Vec3::new(0.0, a, b), Vec3::new(b, 0.0, a)].map(Vec3::normalize_or_zero));
    }
    // Faces are the triples of mutual neighbours, turned outwards.
    let near = |a: usize, b: usize| mesh.positions[a].distance(mesh.positions[b]) < 1.1;
    let mut triangles = Vec::new();
    for a in 0..12usize {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let normal = mesh.positions[a].cross(mesh.positions[b]).dot(mesh.positions[c]);
                    triangles.push(if normal > 0.0 {
                        [a as u32, b as u32, c as u32]
                    } else {
                        [a as u32, c as u32, b as u32]
                    });
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..levels {
        let mut middle = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                *middle.entry((from.min(to), from.max(to))).or_insert_with(|| {
                    let sum = mesh.positions[from as usize] + mesh.positions[to as usize];
                    mesh.positions.push(sum.normalize_or_zero());
                    mesh.positions.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    mesh.triangles = triangles;
    mesh
}

fn area(mesh: &Mesh) -> f64 {
    (0..mesh.triangles.len()).map(|triangle| f64::from(mesh.area_vector(triangle).length()) / 2.0).sum()
}

#[test]
fn a_bent_sheet_unrolls_without_distortion_in_one_chart() {
    // A third of a cylinder: not flat, but developable, so its conformal map is an isometry.
    let mesh = grid(40, 24, |u, v| Vec3::new((2.1 * u).sin(), 1.7 * v, (2.1 * u).cos()));
    let atlas = checked(&mesh, &settings(512));
    assert_eq!(atlas.quality.charts, 1);
    assert!(atlas.quality.angle_distortion_max < 1.0 + 1e-5, "{:?}", atlas.quality);
    assert!(atlas.quality.area_distortion_95 < 1.0 + 1e-4, "{:?}", atlas.quality);
    assert!(atlas.quality.share_of_area > 0.5, "a rectangle of 2.1 to 1.7 fills more: {:?}", atlas.quality);
}

#[test]
fn a_flat_sheet_keeps_its_shape() {
    let tilt = |u: f32, v: f32| Vec3::new(u, 0.3 * u + 0.1 * v, 2.0 * v + 0.2 * u * 0.0);
    let atlas = checked(&grid(5, 9, tilt), &settings(256));
    assert_eq!(atlas.quality.charts, 1);
    let q = &atlas.quality;
    assert!(q.angle_distortion_max < 1.0 + 1e-4 && q.area_distortion_95 < 1.0 + 1e-4, "{q:?}");
}

#[test]
fn a_long_strip_does_not_waste_the_map() {
    let atlas = checked(&grid(400, 10, |u, v| Vec3::new(40.0 * u, v, 0.0)), &settings(512));
    assert!(atlas.quality.share_of_area > 0.5, "{:?}", atlas.quality);
    assert!(atlas.quality.charts <= 24, "{:?}", atlas.quality);
}

#[test]
fn closed_surfaces_of_genus_0_and_1_are_cut() {
    for (mesh, name) in [(icosphere(4), "sphere"), (torus(64, 32), "torus")] {
        let atlas = checked(&mesh, &settings(512));
        assert!(atlas.quality.charts >= 2, "{name}");
        assert!(atlas.quality.charts <= 24, "{name}: {} charts", atlas.quality.charts);
        assert_eq!(atlas.mesh.triangles.len(), mesh.triangles.len());
        assert!(atlas.quality.angle_distortion_mean < 1.06, "{name}: {:?}", atlas.quality);
        assert!(atlas.quality.area_distortion_mean < 1.35, "{name}: {:?}", atlas.quality);
        assert!(atlas.quality.share_of_area > 0.5, "{name}: {:?}", atlas.quality);
    }
}

#[test]
fn one_triangle_and_disjoint_triangles() {
    let mut mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::new(3.0, 0.0, 1.0), Vec3::new(0.0, 4.0, 0.5)],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let atlas = checked(&mesh, &settings(64));
    assert_eq!(atlas.quality.charts, 1);
    assert!(atlas.quality.angle_distortion_max < 1.0 + 1e-4);
    assert!(atlas.quality.share_of_area > 0.35, "{:?}", atlas.quality);
    for shift in 1..40u32 {
        let offset = Vec3::new(shift as f32 * 7.0, 0.0, (shift % 5) as f32);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([0, 1, 2].map(|corner| mesh.positions[corner] * (1.0 + shift as f32 * 0.1) + offset));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    assert_eq!(checked(&mesh, &settings(256)).quality.charts, 40);
}

#[test]
fn non_manifold_and_sliver_ridden_input() {
    let mut mesh = icosphere(3);
    let clean_area = area(&mesh);
    mesh.normals = mesh.positions.clone();
    let faces = mesh.triangles.clone();
    // A fin on an edge, a face twice, a sliver between an edge and its middle, an edge without length, a needle.
    let fin = mesh.positions.len() as u32;
    let push = |mesh: &mut Mesh, point: Vec3| {
        mesh.positions.push(point);
        mesh.normals.push(point.normalize_or(Vec3::Y));
    };
    let [a, b, _] = faces[0];
    let edge_middle = (mesh.positions[a as usize] + mesh.positions[b as usize]) * 0.5;
    push(&mut mesh, edge_middle * 1.3);
    mesh.triangles.push([a, b, fin]);
    mesh.triangles.extend([faces[5], [faces[6][1], faces[6][2], faces[6][0]]]);
    for face in faces.iter().skip(20).step_by(9).take(30) {
        let (a, b) = (face[0], face[1]);
        let middle = mesh.positions.len() as u32;
        let point = mesh.positions[a as usize].lerp(mesh.positions[b as usize], 0.37);
        push(&mut mesh, point);
        mesh.triangles.push([b, a, middle]);
        // A copy of a vertex, a hair away.
        let copy = mesh.positions.len() as u32;
        let near = mesh.positions[face[2] as usize] + Vec3::splat(3e-8);
        push(&mut mesh, near);
        mesh.triangles.push([face[2], copy, a]);
    }
    mesh.triangles.push([7, 7, 9]);
    let atlas = checked(&mesh, &settings(512));
    for code in ["mesh-degenerate", "mesh-duplicate-faces", "mesh-non-manifold"] {
        assert!(atlas.findings.iter().any(|finding| finding.code == code), "{code}: {:?}", atlas.findings);
    }
    let fin_area = f64::from(mesh.area_vector(faces.len()).length()) / 2.0;
    assert!((area(&atlas.mesh) - clean_area - fin_area).abs() < 1e-4 * clean_area);
    for (index, triangle) in atlas.mesh.triangles.iter().enumerate() {
        let corners = atlas.mesh.corners(index);
        let longest = (0..3).map(|c| corners[c].distance(corners[(c + 1) % 3])).fold(0.0, f32::max);
        assert!(atlas.mesh.area_vector(index).length() / longest > 1e-6, "triangle {index} has no height");
        for &vertex in triangle {
            let turned = atlas.mesh.normals[vertex as usize].angle_between(atlas.mesh.positions[vertex as usize]);
            assert!(turned < 0.2, "the normal of vertex {vertex} was lost");
        }
    }
}

/// A triangle and its back share all corners: no parting of the two by their centres is possible.
#[test]
fn a_triangle_with_its_back_is_parted() {
    let mut mesh = grid(10, 10, |x, y| Vec3::new(x, 0.0, y));
    let first = mesh.positions.len() as u32;
    // An ear at the corner of the sheet, once from each side.
    let (corner, along) = (mesh.positions[0], Vec3::new(0.1, 0.0, 0.0));
    mesh.positions.extend([corner, corner - along, corner - Vec3::new(0.0, 0.0, 0.1)]);
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 1]]);
    checked(&mesh, &settings(256));
    // Alone.
    let mut both = Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y], ..Mesh::default() };
    both.triangles = vec![[0, 1, 2], [0, 2, 1]];
    checked(&both, &settings(64));
}

#[test]
fn cleaning_twice_is_cleaning_once_and_leaves_no_holes() {
    use patina::atlas::clean::dissolve_degenerate;
    let mut mesh = grid(12, 12, |u, v| Vec3::new(u, v, 0.2 * (5.0 * u).sin()));
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(p.x, p.y)).collect();
    let border = |mesh: &Mesh| {
        let mut edges: HashMap<([u32; 3], [u32; 3]), i32> = HashMap::new();
        let name = |vertex: u32| mesh.positions[vertex as usize].to_array().map(f32::to_bits);
        for triangle in &mesh.triangles {
            for corner in 0..3 {
                let (from, to) = (name(triangle[corner]), name(triangle[(corner + 1) % 3]));
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        edges.values().filter(|&&sum| sum != 0).count()
    };
    let before = (border(&mesh), area(&mesh));
    // Put a flat triangle into every diagonal: the right half gets a corner on the edge that the left half keeps.
    let faces = std::mem::take(&mut mesh.triangles);
    for pair in faces.chunks_exact(2) {
        let [a, _, c] = pair[0];
        let middle = mesh.positions.len() as u32;
        mesh.positions.push((mesh.positions[a as usize] + mesh.positions[c as usize]) * 0.5);
        mesh.uvs.push((mesh.uvs[a as usize] + mesh.uvs[c as usize]) * 0.5);
        mesh.triangles.extend([pair[0], [a, c, middle], [a, middle, pair[1][2]], [middle, c, pair[1][2]]]);
    }
    let once = dissolve_degenerate(&mesh, 1e-6).unwrap();
    assert_eq!(once.faces_dissolved, 144);
    assert_eq!(border(&once.mesh), before.0, "a T-junction was left open");
    assert!((area(&once.mesh) - before.1).abs() < 1e-5);
    let twice = dissolve_degenerate(&once.mesh, 1e-6).unwrap();
    assert_eq!(twice.mesh, once.mesh);
    assert_eq!(twice.faces_dissolved + twice.edges_collapsed + twice.duplicates_dropped, 0);
    for (point, uv) in once.mesh.positions.iter().zip(&once.mesh.uvs) {
        assert!((Vec2::new(point.x, point.y) - *uv).length() < 1e-6, "an attribute left its corner");
    }
}

#[test]
fn meshes_without_a_surface_are_errors_with_a_remedy() {
    let points = vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    let flat = Mesh { positions: points.clone(), triangles: vec![[0, 1, 2], [0, 0, 1]], ..Mesh::default() };
    let empty = Mesh { positions: points.clone(), ..Mesh::default() };
    let damaged = Mesh { positions: points, triangles: vec![[0, 1, 7]], ..Mesh::default() };
    for mesh in [flat, empty, damaged, Mesh::default()] {
        let error = build(&mesh, &settings(64), &|_| {}).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidScene);
        assert!(!error.remedy_text().is_empty());
    }
    let mut nan = icosphere(0);
    nan.positions[3].y = f32::NAN;
    assert_eq!(build(&nan, &settings(64), &|_| {}).unwrap_err().kind(), ErrorKind::NonFinite);
}

#[test]
fn too_small_a_map_is_an_error_and_not_a_hang() {
    let mut mesh = Mesh::default();
    for index in 0..400u32 {
        let at = Vec3::new(index as f32 * 3.0, 0.0, 0.0);
        mesh.positions.extend([at, at + Vec3::X, at + Vec3::Y]);
        mesh.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
    }
    let error = build(&mesh, &settings(64), &|_| {}).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidSetting);
    checked(&mesh, &settings(256));
}

#[test]
fn good_coordinates_stay_and_bad_ones_go() {
    let mut mesh = grid(6, 6, |u, v| Vec3::new(u, v, 0.0));
    mesh.uvs = mesh.positions.iter().map(|p| Vec2::new(0.1 + 0.5 * p.x, 0.2 + 0.5 * p.y)).collect();
    let keep = |mode: KeepUv| AtlasSettings { keep_uv: mode, ..settings(128) };
    let atlas = build(&mesh, &keep(KeepUv::Auto), &|_| {}).unwrap();
    assert_eq!(atlas.mesh.uvs, mesh.uvs);
    assert_eq!(atlas.quality.charts, 1);
    assert_eq!(build(&mesh, &keep(KeepUv::Keep), &|_| {}).unwrap().mesh, atlas.mesh);
    assert_ne!(build(&mesh, &keep(KeepUv::Rebuild), &|_| {}).unwrap().mesh.uvs, mesh.uvs);
    // Folded over at the middle: overlapping coordinates are replaced, or refused when they were to be kept.
    mesh.uvs.iter_mut().for_each(|uv| uv.x = (uv.x - 0.35).abs() + 0.1);
    let rebuilt = build(&mesh, &keep(KeepUv::Auto), &|_| {}).unwrap();
    assert!(rebuilt.findings.iter().any(|finding| finding.code == "atlas-rebuilt"));
    assert_eq!(rebuilt.quality.overlapping_texels, 0);
    assert_eq!(build(&mesh, &keep(KeepUv::Keep), &|_| {}).unwrap_err().kind(), ErrorKind::InvalidSetting);
}

#[test]
fn the_same_mesh_gives_the_same_atlas_whatever_the_thread_count() {
    let mesh = torus(40, 24);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build(&mesh, &settings(256), &|_| {}).unwrap())
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.mesh, three.mesh);
    assert_eq!(one.chart_of_triangle, three.chart_of_triangle);
    assert_eq!(one.quality, three.quality);
}

fn data_mesh(name: &str) -> Option<Mesh> {
    let path = data(&format!("meshes/{name}"))?;
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) = tobj::load_obj(&path, &options).unwrap();
    let mut mesh = Mesh::default();
    for model in models {
        let start = mesh.positions.len() as u32;
        mesh.positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        mesh.triangles.extend(model.mesh.indices.chunks_exact(3).map(|t| [t[0] + start, t[1] + start, t[2] + start]));
    }
    Some(mesh)
}

/// Name, resolution, and the bounds that a regression would cross: charts, area in the square, angle and area distortion.
fn check_data_mesh(name: &str, resolution: usize, charts: usize, share: f64, angle: f64, stretch: f64) {
    let Some(mesh) = data_mesh(name) else { return };
    let q = checked(&mesh, &settings(resolution)).quality;
    println!("{name}: {q:?}");
    assert!(q.charts <= charts && q.share_of_area >= share, "{name}: {q:?}");
    assert!(q.angle_distortion_mean <= angle && q.area_distortion_mean <= stretch, "{name}: {q:?}");
}

#[test]
fn the_cow() {
    check_data_mesh("common/cow.obj", 1024, 80, 0.6, 1.04, 1.15);
}

#[test]
fn the_teapot() {
    check_data_mesh("common/teapot.obj", 1024, 40, 0.65, 1.03, 1.10);
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn the_bunny() {
    check_data_mesh("common/stanford-bunny.obj", 1024, 30, 0.53, 1.02, 1.25);
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn the_city_of_delft() {
    check_data_mesh("city/delft_derived.obj", 2048, 2900, 0.5, 1.03, 1.06);
}

#[test]
#[ignore = "slow: cargo test -- --ignored"]
fn the_buildings_of_3dbag() {
    check_data_mesh("city/3dbag_sub_derived.obj", 1024, 280, 0.6, 1.03, 1.15);
}
