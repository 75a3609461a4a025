//! What was made of a scene's files, on one page: for `patina check`.

use super::locate;
use super::source::SourceView;
use crate::error::Result;
use crate::scene::{Background, ReadSettings, Scene};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// What was understood. Lengths are in units of the source, which seldom says which they are.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Understood {
    /// The kind of the scene.
    pub format: String,
    /// Why it is of this kind, and not of another.
    pub why: String,
    /// Mesh files.
    pub mesh: Vec<PathBuf>,
    /// Number of triangles.
    pub triangles: usize,
    /// Diagonal of the mesh's bounding box.
    pub diagonal: f32,
    /// Number of views.
    pub views: usize,
    /// Number of views kept out of the fit.
    pub held_out: usize,
    /// Sizes of the photos in pixels, with how many have each.
    pub sizes: Vec<(usize, usize, usize)>,
    /// Smallest and largest horizontal field of view, in degrees.
    pub field_of_view_degrees: (f32, f32),
    /// Number of views whose lens was undone.
    pub undistorted: usize,
    /// Number of views with a mask.
    pub masks: usize,
    /// Number of photos that are linear.
    pub linear: usize,
    /// The direction of the source that became +y.
    pub up_in_source: [f64; 3],
    /// The point of the source that became the origin.
    pub origin_in_source: [f64; 3],
    /// Smallest and largest distance of a camera from the middle of the mesh.
    pub distances: (f32, f32),
    /// What the background shows.
    pub background: Background,
}

/// Says what was made of a scene that was read from `path` with `settings`.
///
/// # Errors
/// Those of [`read`](super::read) as far as files are listed again.
pub fn understand(path: &Path, settings: &ReadSettings, scene: &Scene) -> Result<Understood> {
    let located = locate(path)?;
    let source = located.list(settings)?;
    let by_name: BTreeMap<&str, &SourceView> = source.views.iter().map(|view| (view.name.as_str(), view)).collect();
    let mut sizes: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let span = |values: &mut dyn Iterator<Item = f32>| {
        values.fold((f32::INFINITY, 0.0f32), |(low, high), value| (low.min(value), high.max(value)))
    };
    for view in &scene.views {
        *sizes.entry((view.camera.width, view.camera.height)).or_default() += 1;
    }
    let points = &scene.mesh.positions;
    let first = points.first().copied().unwrap_or_default();
    let (low, high) = points.iter().fold((first, first), |(low, high), point| (low.min(*point), high.max(*point)));
    let middle = 0.5 * (low + high);
    let cameras = || scene.views.iter().map(|view| &view.camera);
    let world = &scene.world_from_source;
    Ok(Understood {
        format: located.format.to_string(),
        why: located.why(),
        mesh: settings.mesh.as_ref().map_or(source.mesh.clone(), |mesh| vec![mesh.clone()]),
        triangles: scene.mesh.triangles.len(),
        diagonal: (high - low).length(),
        views: scene.views.len(),
        held_out: scene.views.iter().filter(|view| view.held_out).count(),
        sizes: sizes.into_iter().map(|((width, height), count)| (width, height, count)).collect(),
        field_of_view_degrees: span(
            &mut cameras().map(|own| 2.0 * (0.5 * own.width as f32 / own.focal_pixels.x).atan().to_degrees()),
        ),
        undistorted: scene
            .views
            .iter()
            .filter(|view| by_name.get(view.name.as_str()).is_some_and(|source| source.lens.is_some()))
            .count(),
        masks: scene.views.iter().filter(|view| view.has_mask()).count(),
        linear: scene.views.iter().filter(|view| view.photo.is_linear()).count(),
        up_in_source: world.rotation.row(1).to_array(),
        origin_in_source: world.origin_in_source.to_array(),
        distances: span(&mut cameras().map(|own| own.position_in_world().distance(middle))),
        background: scene.background,
    })
}

impl fmt::Display for Understood {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let triple = |values: [f64; 3]| format!("({:.3}, {:.3}, {:.3})", values[0], values[1], values[2]);
        let sizes: Vec<String> =
            self.sizes.iter().map(|(width, height, count)| format!("{count} of {width} x {height}")).collect();
        let mesh: Vec<String> = self.mesh.iter().map(|path| path.display().to_string()).collect();
        let lens = match self.undistorted {
            0 => "pinhole, photos are not resampled".to_owned(),
            count => format!("distorted in {count} of {} views, undone", self.views),
        };
        let masks = match self.masks {
            0 => "none: rays decide what is surface".to_owned(),
            count => format!("{count} of {}", self.views),
        };
        let (narrow, wide) = self.field_of_view_degrees;
        writeln!(formatter, "format      {}: {}", self.format, self.why)?;
        writeln!(formatter, "mesh        {} triangles, {}", self.triangles, mesh.join(", "))?;
        writeln!(formatter, "cameras     {} views, {} held out", self.views, self.held_out)?;
        writeln!(formatter, "photos      {} pixels", sizes.join(", "))?;
        writeln!(formatter, "lens        {narrow:.1} to {wide:.1} degrees wide, {lens}")?;
        writeln!(
            formatter,
            "colour      {} linear, {} of a camera's tone curve",
            self.linear,
            self.views - self.linear
        )?;
        writeln!(formatter, "masks       {masks}")?;
        let background = match self.background {
            Background::Environment => "the environment",
            Background::Black => "black",
        };
        writeln!(formatter, "background  {background}")?;
        writeln!(formatter, "up          {} of the source", triple(self.up_in_source))?;
        if self.origin_in_source != [0.0; 3] {
            writeln!(formatter, "origin      {} of the source", triple(self.origin_in_source))?;
        }
        let (near, far) = self.distances;
        write!(
            formatter,
            "scale       the mesh is {:.4} across, cameras are {near:.4} to {far:.4} from its middle, in units of the source",
            self.diagonal
        )
    }
}
