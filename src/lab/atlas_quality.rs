//! The quality of the atlas of meshes as a table, and pictures of the layouts.

use crate::atlas::{AtlasSettings, KeepUv, build};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{RgbImage, file};
use crate::scene::{Mesh, read_mesh};
use clap::Args;
use glam::{Vec2, Vec3};
use std::path::{Path, PathBuf};

/// Options of `patina-lab bench atlas`.
#[derive(Clone, Debug, Args)]
pub struct AtlasArguments {
    /// Meshes, or `blob:N` for a bumpy sphere of N triangles.
    #[arg(required = true)]
    pub meshes: Vec<String>,
    /// Width of the maps in texels.
    #[arg(long, default_value_t = 1024)]
    pub map_size: usize,
    /// Texels between charts.
    #[arg(long, default_value_t = 2)]
    pub gutter: usize,
    /// Folder of the pictures.
    #[arg(short, long, default_value = "patina-bench")]
    pub output: PathBuf,
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

/// The layout: triangles in the colour of their chart.
fn draw(mesh: &Mesh, charts: &[u32], size: usize) -> RgbImage {
    let mut picture = RgbImage::from_fn(size, size, |_, _| Vec3::splat(0.006));
    let corner = |uv: Vec2| Vec2::new(uv.x, 1.0 - uv.y) * size as f32;
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|vertex| corner(mesh.uvs[vertex as usize]));
        let hash = (charts[triangle] + 1).wrapping_mul(2_654_435_761) ^ 0x9e37_79b9;
        let shade = 0.7 + 0.3 * (triangle % 7) as f32 / 7.0;
        let colour = Vec3::from_array([0, 8, 16].map(|bits| (0.1 + ((hash >> bits) % 166) as f32 / 185.0) * shade));
        let (low, high) = (a.min(b).min(c).floor(), a.max(b).max(c).ceil());
        for row in low.y.max(0.0) as usize..(high.y.max(0.0) as usize).min(size) {
            for column in low.x.max(0.0) as usize..(high.x.max(0.0) as usize).min(size) {
                let p = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(p - from));
                if sides.iter().all(|&side| side <= 0.0) || sides.iter().all(|&side| side >= 0.0) {
                    picture[(row, column)] = colour;
                }
            }
        }
    }
    picture
}

fn load(name: &str) -> Result<Mesh> {
    let Some(count) = name.strip_prefix("blob:") else { return Ok(read_mesh(Path::new(name))?.0) };
    count.parse().map(blob).map_err(|_| {
        Error::new(ErrorKind::InvalidSetting, format!("{count} is no number of triangles"))
            .at(Place::Setting("meshes".into()))
            .remedy("give an even number of at least 8, as in blob:100000")
    })
}

/// Prints the table and writes `MESH.png` for each mesh.
///
/// # Errors
/// A mesh that cannot be read, an atlas that cannot be made, pictures that cannot be written.
pub fn run(options: &AtlasArguments) -> Result<()> {
    let settings = AtlasSettings {
        resolution_texels: options.map_size,
        gutter_texels: options.gutter,
        keep_uv: KeepUv::Rebuild,
        ..AtlasSettings::default()
    };
    println!(
        "| mesh | triangles | charts | angle mean | angle 95 % | area mean | area 95 % | area in the square | texels touched | overlaps | flipped | gutter | seconds |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for path in &options.meshes {
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
        let size = settings.resolution_texels.min(1024);
        let picture = draw(&atlas.mesh, &atlas.chart_of_triangle, size);
        file::write_png_srgb8(&options.output.join(format!("{name}.png")), &file::srgb8_from_linear(&picture, 0.0))?;
    }
    Ok(())
}
