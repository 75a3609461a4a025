//! From any mesh to a texture atlas: clean, cut into charts, flatten, pack.
//!
//! Read [`build`] first: it is the whole way. Then, in the order of the work:
//! * [`clean`] degenerate dissolve to a fixpoint;
//! * `topology` who neighbours whom, non-manifold edges cut open;
//! * `cluster` first charts: similar normals, compact outlines;
//! * `chart`, `lscm`, `outline`, `flatten` each chart as a small mesh, its least-squares conformal map, the checks, and
//!   splitting where they fail;
//! * `merge` neighbouring charts that lie flat together become one;
//! * `shape`, `pack` charts as texels on the square, gutters kept;
//! * `border` outlines for drawing; `raster` texels covered by charts, overlaps, dilation; `quality` what is reported.
//!
//! What it refuses to do: it moves no vertex except to collapse edges that have no length, it never mirrors a chart, it
//! makes no chart that touches another one's gutter, and it does not compute normals (a mesh without normals stays
//! without: compute them before the surface is cut, or seams show in the shading).
//!
//! Known limits: gutters are kept between charts, not between two arms of one chart that come near each other; triangles
//! are never cut, so one huge triangle stays whole; angle-based flattening is not offered.
//!
//! A departure from the letter of "a chart is a disk": a chart may have holes. A wall with windows lies flat as it is,
//! and cutting it would only add borders; what its map must be (no flip, no overlap, low distortion) is checked all
//! the same. Charts with handles and closed ones are split.

mod border;
mod chart;
pub mod clean;
mod cluster;
mod flatten;
mod keep;
mod lscm;
mod merge;
mod outline;
mod pack;
mod quality;
pub mod raster;
mod shape;
mod topology;

pub use border::chart_borders;
pub use quality::AtlasQuality;
pub use raster::{covered_texels, dilate, nearest_covered};

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::Mesh;
use chart::Surface;
use flatten::{FlatChart, Limits};
use glam::{DAffine2, DVec2, Vec2};
use std::collections::HashMap;
use topology::Topology;

/// Whether texture coordinates that a mesh came with stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum KeepUv {
    /// Keep them when they lie in [0, 1] and do not overlap; rebuild them otherwise.
    #[default]
    Auto,
    /// Keep them, or fail.
    Keep,
    /// Always make a new atlas.
    Rebuild,
}

/// Settings of [`build`].
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AtlasSettings {
    /// Width and height of the maps in texels, 8 to 16384.
    pub resolution_texels: usize,
    /// Empty texels between two charts at that resolution, 0 to 64.
    pub gutter_texels: usize,
    /// Whether coordinates that are there stay.
    pub keep_uv: KeepUv,
    /// Edges and heights shorter than this share of the bounding box's diagonal are dissolved, 0 to 0.01.
    pub dissolve_distance: f64,
    /// Spread of normals in a first chart, `1 - |sum of area vectors| / area`, 0.01 to 0.9; 0.15 is a cap of 45 degrees.
    pub normal_spread: f64,
    /// Mean ratio of singular values allowed in a chart, above 1.
    pub angle_distortion_limit: f64,
    /// Mean relative change of area allowed in a chart, above 1.
    pub area_distortion_limit: f64,
}

impl Default for AtlasSettings {
    fn default() -> Self {
        AtlasSettings {
            resolution_texels: 1024,
            gutter_texels: 4,
            keep_uv: KeepUv::Auto,
            dissolve_distance: 1e-6,
            normal_spread: 0.2,
            angle_distortion_limit: 1.1,
            area_distortion_limit: 1.35,
        }
    }
}

impl AtlasSettings {
    fn validate(&self) -> Result<()> {
        let check = |name: &str, good: bool, range: &str| {
            if good {
                return Ok(());
            }
            // Of these only the size of the maps can be typed; the others stand in a settings file.
            Err(Error::new(ErrorKind::InvalidSetting, format!("{name} of the atlas is outside {range}"))
                .remedy(format!("give a value in {range}")))
        };
        if !(8..=16384).contains(&self.resolution_texels) {
            return Err(Error::new(ErrorKind::InvalidSetting, "the size of the maps is outside 8 to 16384 texels")
                .at(Place::Setting("map-size".into()))
                .remedy("give a value in 8 to 16384 texels"));
        }
        check("gutter_texels", self.gutter_texels <= 64, "0 to 64 texels")?;
        check("dissolve_distance", (0.0..=0.01).contains(&self.dissolve_distance), "0 to 0.01")?;
        check("normal_spread", (0.01..=0.9).contains(&self.normal_spread), "0.01 to 0.9")?;
        check("angle_distortion_limit", self.angle_distortion_limit > 1.0, "numbers above 1")?;
        check("area_distortion_limit", self.area_distortion_limit > 1.0, "numbers above 1")
    }
}

/// A mesh with an atlas.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// The cleaned mesh: vertices doubled at seams, UVs with v up, in [0, 1] but for a ten-thousandth
    /// where they were kept, normals as they came.
    pub mesh: Mesh,
    /// Chart of each triangle, from 0 without gaps.
    pub chart_of_triangle: Vec<u32>,
    /// Index of each triangle in the mesh that was given.
    pub source_triangle: Vec<u32>,
    /// What was measured.
    pub quality: AtlasQuality,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

/// Makes an atlas. `progress` is called with a share in [0, 1], from any thread, not in order.
///
/// # Errors
/// `InvalidScene` and `NonFinite` when the mesh is inconsistent or has no triangle with an area; `InvalidSetting` when a
/// setting is out of range, when coordinates are to be kept that cannot be, and when the charts do not fit on the map.
pub fn build(mesh: &Mesh, settings: &AtlasSettings, progress: &(dyn Fn(f32) + Sync)) -> Result<Atlas> {
    settings.validate()?;
    let cleaned = clean::dissolve_degenerate(mesh, settings.dissolve_distance)?;
    let mut findings = cleaned.findings();
    progress(0.05);
    let points = topology::weld(&cleaned.mesh.positions);
    let topology = Topology::new(&cleaned.mesh.triangles, &points);
    findings.extend(topology.findings());

    if settings.keep_uv != KeepUv::Rebuild {
        match keep::objection(&cleaned.mesh, settings.resolution_texels) {
            None => {
                let charts = keep::charts(&cleaned.mesh, &topology)?;
                return Ok(finish(cleaned.mesh, charts, cleaned.source_triangle, findings, settings));
            }
            Some(reason) if settings.keep_uv == KeepUv::Keep => return Err(keep::refusal(reason)),
            Some(reason) => {
                if !cleaned.mesh.uvs.is_empty() {
                    let message = format!("the texture coordinates of the mesh are replaced: {reason}");
                    findings.push(Finding::new(Severity::Note, "atlas-rebuilt", message));
                }
            }
        }
    }

    let surface = Surface::new(&cleaned.mesh, &topology);
    let limits = Limits { angle: settings.angle_distortion_limit, area: settings.area_distortion_limit };
    let tiny_area = 1e-5 * surface.areas.iter().sum::<f64>();
    let labels = cluster::cluster(&surface, settings.normal_spread, 4, tiny_area);
    progress(0.15);
    let charts = flatten::flatten_all(&surface, &labels, limits, &|share| progress(0.15 + 0.25 * share));
    // The scale at which about 60 % of the map are filled: near enough to weigh gutters against areas.
    let area: f64 = surface.areas.iter().sum();
    let texels_per_unit = 0.77 * settings.resolution_texels as f64 / area.sqrt();
    let charts =
        merge::merge(&surface, charts, texels_per_unit, settings.gutter_texels, &|share| progress(0.4 + 0.3 * share));
    // A strip three times as long as wide still packs well whole.
    let width = settings.resolution_texels as f64 / texels_per_unit;
    let charts = flatten::split_long(&surface, charts, 1.3 * width, 0.7 * width, limits);
    let placements =
        pack::pack(&charts, settings.resolution_texels, settings.gutter_texels, &|share| progress(0.7 + 0.25 * share))?;
    let (mesh, chart_of_triangle) = assemble(&cleaned.mesh, &charts, &placements, settings.resolution_texels);
    let atlas = finish(mesh, chart_of_triangle, cleaned.source_triangle, findings, settings);
    progress(1.0);
    Ok(atlas)
}

/// The mesh with its vertices doubled at seams and the coordinates of the placed charts.
fn assemble(mesh: &Mesh, charts: &[FlatChart], placements: &[DAffine2], resolution: usize) -> (Mesh, Vec<u32>) {
    let mut made = Mesh { triangles: vec![[0; 3]; mesh.triangles.len()], ..Mesh::default() };
    let mut chart_of_triangle = vec![0; mesh.triangles.len()];
    let size = DVec2::splat(resolution as f64);
    for (index, (flat, placement)) in charts.iter().zip(placements).enumerate() {
        // A vertex of the atlas is a vertex of the chart with the attributes of one vertex of the mesh.
        let mut name: HashMap<(u32, u32), u32> = HashMap::with_capacity(flat.points.len());
        for (&triangle, corners) in flat.chart.triangles.iter().zip(&flat.chart.corners) {
            chart_of_triangle[triangle as usize] = index as u32;
            for (corner, &local) in corners.iter().enumerate() {
                let source = mesh.triangles[triangle as usize][corner];
                let vertex = *name.entry((local, source)).or_insert_with(|| {
                    let texel = placement.transform_point2(flat.points[local as usize]);
                    let uv: Vec2 = (texel / size).as_vec2();
                    made.positions.push(mesh.positions[source as usize]);
                    made.normals.extend(mesh.normals.get(source as usize));
                    made.uvs.push(uv.clamp(Vec2::ZERO, Vec2::ONE));
                    (made.positions.len() - 1) as u32
                });
                made.triangles[triangle as usize][corner] = vertex;
            }
        }
    }
    (made, chart_of_triangle)
}

fn finish(
    mesh: Mesh,
    chart_of_triangle: Vec<u32>,
    source_triangle: Vec<u32>,
    mut findings: Vec<Finding>,
    settings: &AtlasSettings,
) -> Atlas {
    let quality = quality::measure(&mesh, &chart_of_triangle, settings.resolution_texels);
    if quality.overlapping_texels > 0 {
        let message = format!("{} texels belong to two places of the surface", quality.overlapping_texels);
        findings.push(Finding::new(Severity::Warning, "atlas-overlap", message));
    }
    if quality.narrowest_gutter_texels.is_some_and(|gutter| gutter < settings.gutter_texels) {
        let message = format!(
            "charts lie {} texels apart, fewer than the {} asked for: colours may bleed at seams",
            quality.narrowest_gutter_texels.unwrap_or(0),
            settings.gutter_texels
        );
        findings.push(Finding::new(Severity::Warning, "atlas-gutter", message).remedy("use --uv rebuild"));
    }
    Atlas { mesh, chart_of_triangle, source_triangle, quality, findings }
}
