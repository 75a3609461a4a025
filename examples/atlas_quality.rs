//! Prints the quality of the atlas of OBJ files as a Markdown table and draws the layouts.
//!
//! `cargo run --release --example atlas_quality -- RESOLUTION GUTTER FOLDER MESH.obj...` writes `FOLDER/MESH.png`.

use glam::{Vec2, Vec3};
use patina::atlas::{AtlasSettings, KeepUv, build};
use patina::scene::Mesh;
use std::path::Path;

fn load(path: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    if let Some(count) = path.strip_prefix("blob:") {
        return Ok(blob(count.parse()?));
    }
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options)?;
    let mut mesh = Mesh::default();
    for model in models {
        let start = mesh.positions.len() as u32;
        mesh.positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        mesh.triangles.extend(model.mesh.indices.chunks_exact(3).map(|t| [t[0] + start, t[1] + start, t[2] + start]));
    }
    Ok(mesh)
}

/// A bumpy sphere of exactly this many triangles, an even number of at least 8.
fn blob(triangles: usize) -> Mesh {
    let columns = ((triangles as f64).sqrt() as usize).max(4);
    let rows = (triangles / (2 * columns)).max(1);
    let point = |row: usize, column: usize| {
        let theta = std::f32::consts::PI * (row as f32 + 1.0) / (rows + 2) as f32;
        let phi = std::f32::consts::TAU * column as f32 / columns as f32;
        let radius =
            1.0 + 0.15 * (5.0 * theta).sin() * (4.0 * phi).cos() + 0.01 * (40.0 * theta).sin() * (37.0 * phi).cos();
        radius * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        mesh.positions.extend((0..columns).map(|column| point(row, column)));
    }
    let vertex = |row: usize, column: usize| (row * columns + column % columns) as u32;
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (vertex(row, column), vertex(row, column + 1));
            let (c, d) = (vertex(row + 1, column), vertex(row + 1, column + 1));
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    // The rest of the count: faces of a fan over the upper opening, the last ones split at their middle.
    let apex = mesh.positions.len() as u32;
    mesh.positions.push(Vec3::Y);
    for column in 0..columns.min(triangles.saturating_sub(mesh.triangles.len())) {
        mesh.triangles.push([vertex(0, column + 1), vertex(0, column), apex]);
    }
    let mut at = 0;
    while mesh.triangles.len() + 2 <= triangles {
        let [a, b, c] = mesh.triangles[at];
        let middle = mesh.positions.len() as u32;
        let sum = mesh.positions[a as usize] + mesh.positions[b as usize] + mesh.positions[c as usize];
        mesh.positions.push(sum / 3.0);
        mesh.triangles[at] = [a, b, middle];
        mesh.triangles.extend([[b, c, middle], [c, a, middle]]);
        at += 1;
    }
    mesh
}

fn draw(mesh: &Mesh, charts: &[u32], size: u32) -> image::RgbImage {
    let mut picture = image::RgbImage::from_pixel(size, size, image::Rgb([18, 18, 22]));
    let corner = |uv: Vec2| Vec2::new(uv.x, 1.0 - uv.y) * size as f32;
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|vertex| corner(mesh.uvs[vertex as usize]));
        let hash = (charts[triangle] + 1).wrapping_mul(2_654_435_761) ^ 0x9e37_79b9;
        let shade = 0.85 + 0.15 * (triangle % 7) as f32 / 7.0;
        let colour = [0, 8, 16].map(|bits| ((90 + (hash >> bits) % 166) as f32 * shade) as u8);
        let (low, high) = (a.min(b).min(c).floor(), a.max(b).max(c).ceil());
        for y in low.y.max(0.0) as u32..(high.y as u32).min(size) {
            for x in low.x.max(0.0) as u32..(high.x as u32).min(size) {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(p - from));
                if sides.iter().all(|&side| side <= 0.0) || sides.iter().all(|&side| side >= 0.0) {
                    picture.put_pixel(x, y, image::Rgb(colour));
                }
            }
        }
    }
    picture
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [resolution, gutter, folder, meshes @ ..] = &arguments[..] else {
        return Err("usage: atlas_quality RESOLUTION GUTTER FOLDER MESH.obj...".into());
    };
    let settings = AtlasSettings {
        resolution_texels: resolution.parse()?,
        gutter_texels: gutter.parse()?,
        keep_uv: KeepUv::Rebuild,
        ..AtlasSettings::default()
    };
    println!(
        "| mesh | triangles | charts | angle mean | angle 95 % | area mean | area 95 % | area in the square | texels touched | overlaps | flipped | gutter | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for path in meshes {
        let mesh = load(path)?;
        let start = std::time::Instant::now();
        let atlas = build(&mesh, &settings, &|_| {})?;
        let seconds = start.elapsed().as_secs_f64();
        let name = Path::new(path).file_stem().unwrap_or_default().to_string_lossy().replace(':', "_");
        let q = &atlas.quality;
        println!(
            "| {name} | {} | {} | {:.4} | {:.3} | {:.4} | {:.3} | {:.1} % | {:.1} % | {} | {} | {} | {seconds:.2} |",
            q.triangles,
            q.charts,
            q.angle_distortion_mean,
            q.angle_distortion_95,
            q.area_distortion_mean,
            q.area_distortion_95,
            100.0 * q.share_of_area,
            100.0 * q.share_covered,
            q.overlapping_texels,
            q.flipped_triangles,
            q.narrowest_gutter_texels.map_or("-".into(), |g| g.to_string()),
        );
        for finding in &atlas.findings {
            eprintln!("{name}: {finding}");
        }
        std::fs::create_dir_all(folder)?;
        let size = settings.resolution_texels.min(1024) as u32;
        draw(&atlas.mesh, &atlas.chart_of_triangle, size).save(Path::new(folder).join(format!("{name}.png")))?;
    }
    Ok(())
}
