//! What was made of a scene's files, on one page: for `patina check`.

use super::locate;
use super::outliers::bounds_of_most;
use super::source::SourceView;
use crate::error::Result;
use crate::scene::settings::PixelCentre;
use crate::scene::{Background, Mesh, ReadSettings, Scene};
use glam::Vec3;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// What was understood. Lengths are in units of the source, which seldom says which they are: then it can be given.
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
    /// Diagonal of the bounding box of what triangles use, without what lies far from all others.
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
    /// Where the source puts the first pixel's centre, by its format or by the settings; `Auto` where that is measured.
    pub pixel_centre: PixelCentre,
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
    /// How many metres a unit of the source is; `None` where it is not given.
    pub unit_in_metres: Option<f64>,
    /// What the background shows.
    pub background: Background,
    /// Whether the mesh stood in the frame of the cameras, was moved into it, or may stand in another.
    pub frames: Frames,
}

/// How the frame of the mesh was found to be beside that of the cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frames {
    /// The same.
    Shared,
    /// Another, which the source knows: the mesh was moved.
    Moved,
    /// Cameras look past the mesh, and no known transform helps.
    Doubtful,
    /// Cameras look at the mesh, photos or masks do not fit it, and no known transform helps.
    Unproven,
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
    let (low, high) = extent(&scene.mesh);
    let middle = 0.5 * (low + high);
    let cameras = || scene.views.iter().map(|view| &view.camera);
    let world = &scene.world_from_source;
    Ok(Understood {
        format: located.format.to_string(),
        why: located.why(),
        mesh: if settings.mesh.is_empty() { source.mesh.clone() } else { settings.mesh.clone() },
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
        pixel_centre: match settings.pixel_centre {
            PixelCentre::Auto => source.pixel_centre,
            given => given,
        },
        masks: scene.views.iter().filter(|view| view.has_mask()).count(),
        linear: scene.views.iter().filter(|view| view.photo.is_linear()).count(),
        up_in_source: world.rotation.row(1).to_array(),
        origin_in_source: world.origin_in_source.to_array(),
        distances: span(&mut cameras().map(|own| own.position_in_world().distance(middle))),
        unit_in_metres: world.unit_in_metres,
        background: scene.background,
        frames: match &scene.findings {
            findings if findings.iter().any(|finding| finding.code == "mesh-frame-changed") => Frames::Moved,
            findings if findings.iter().any(|finding| finding.code == "mesh-frame-unknown") => Frames::Doubtful,
            findings if findings.iter().any(|finding| finding.code == "mesh-frames-tried") => Frames::Unproven,
            _ => Frames::Shared,
        },
    })
}

/// Lower and upper corner of the vertices that triangles use, without those far from the others.
fn extent(mesh: &Mesh) -> (Vec3, Vec3) {
    let mut used = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
    let points = mesh.positions.iter().zip(&used).filter(|(_, used)| **used).map(|(point, _)| point.as_dvec3());
    let (low, high) = bounds_of_most(points.collect()).unwrap_or_default();
    (low.as_vec3(), high.as_vec3())
}

impl fmt::Display for Understood {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let triple = |values: [f64; 3]| format!("({:.3}, {:.3}, {:.3})", values[0], values[1], values[2]);
        let sizes: Vec<String> =
            self.sizes.iter().map(|(width, height, count)| format!("{count} of {width} x {height}")).collect();
        let mesh: Vec<String> = self.mesh.iter().map(|path| path.display().to_string()).collect();
        let lens = match self.undistorted {
            0 => "without distortion: photos are used as they are".to_owned(),
            count => format!("distortion undone in {count} of {} views", self.views),
        };
        let masks = match self.masks {
            0 => "none: what is surface is where rays meet the mesh".to_owned(),
            count if count == self.views => "for all views".to_owned(),
            count => format!("for {count} of {} views: elsewhere rays decide what is surface", self.views),
        };
        let eight_bit = self.views - self.linear;
        let colour = match (eight_bit, self.linear) {
            (_, 0) => "8 bits, as cameras encode them: the curve of sRGB is undone".to_owned(),
            (0, _) => "linear radiance, as the files have it".to_owned(),
            (encoded, linear) => {
                format!("{encoded} photos of 8 bits by the curve of sRGB, {linear} of linear radiance")
            }
        };
        let centre = match self.pixel_centre {
            PixelCentre::Auto => "measured: see pixel-centre-measured or pixel-centre-assumed below",
            PixelCentre::Half => "at (0.5, 0.5) of the source: its format or a setting says so",
            PixelCentre::Integer => "at (0, 0) of the source: its format or a setting says so",
        };
        let frames = match self.frames {
            Frames::Shared => "the mesh stands in the frame of the cameras",
            Frames::Moved => {
                "the mesh stood in another frame and was moved to the cameras: see mesh-frame-changed below"
            }
            Frames::Doubtful => "the mesh may stand in another frame than the cameras: see mesh-frame-unknown below",
            Frames::Unproven => {
                "photos or masks do not fit the mesh, in its own frame or in another that is known: see mesh-frames-tried below"
            }
        };
        let held_out = match self.held_out {
            0 => "none held out for validation".to_owned(),
            count => format!("{count} of them held out for validation"),
        };
        let (narrow, wide) = self.field_of_view_degrees;
        let angle = if wide - narrow < 0.1 { format!("{wide:.1}") } else { format!("{narrow:.1} to {wide:.1}") };
        writeln!(formatter, "format      {}: {}", self.format, self.why)?;
        writeln!(formatter, "mesh        {} triangles, {}", self.triangles, mesh.join(", "))?;
        writeln!(formatter, "frames      {frames}")?;
        writeln!(formatter, "cameras     {} views, {held_out}", self.views)?;
        writeln!(formatter, "photos      {} pixels", sizes.join(", "))?;
        writeln!(formatter, "pixels      the centre of the first is {centre}")?;
        writeln!(formatter, "lens        {angle} degrees wide, {lens}")?;
        writeln!(formatter, "colour      {colour}")?;
        writeln!(formatter, "masks       {masks}")?;
        let background = match self.background {
            Background::Environment => "shows the environment",
            Background::Black => "black: it says nothing",
        };
        writeln!(formatter, "background  {background}")?;
        writeln!(formatter, "up          {} of the source becomes +y", triple(self.up_in_source))?;
        if self.origin_in_source != [0.0; 3] {
            writeln!(formatter, "origin      {} of the source becomes 0", triple(self.origin_in_source))?;
        }
        let unit = self.unit_in_metres.unwrap_or(1.0);
        let [across, near, far] = [self.diagonal, self.distances.0, self.distances.1].map(|own| f64::from(own) * unit);
        let units = match self.unit_in_metres {
            None => "units of the source".to_owned(),
            Some(metres) => format!("metres: a unit of the source is given as {metres}"),
        };
        write!(
            formatter,
            "scale       the mesh is {across:.4} across and cameras stand {near:.4} to {far:.4} from its middle, in {units}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extent_is_of_what_triangles_use_without_what_lies_far_off() {
        let mut mesh = Mesh::default();
        for index in 0..60u32 {
            let turn = 0.7 * index as f32;
            mesh.positions.push(Vec3::new(turn.cos(), turn.sin(), (1.3 * turn).sin()));
            mesh.triangles.push([index, (index + 1) % 60, (index + 7) % 60]);
        }
        let bounds = extent(&mesh);
        assert!(bounds.0.min_element() >= -1.0 && bounds.1.max_element() <= 1.0);
        mesh.positions.push(Vec3::splat(1e20));
        assert_eq!(extent(&mesh), bounds, "a vertex that no triangle uses");
        mesh.triangles.push([0, 1, 60]);
        assert_eq!(extent(&mesh), bounds, "a vertex far from all others");
        assert_eq!(extent(&Mesh::default()), (Vec3::ZERO, Vec3::ZERO));
    }
}
