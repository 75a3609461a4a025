//! The exchange folder: a synthetic scene with its truth, in this program's own conventions.
//!
//! ```text
//! mesh.obj  cameras.json  scene.json  views/*.exr          always
//! coverage/*.exr                                           share of the pixel the mesh covers: used as masks
//! diffuse.exr specular.exr roughness.exr env.exr           the truth
//! env_heldout.exr relight/*.exr                            another light and pictures under it
//! texel_seen.exr (or texel_covered.exr)                    texels to compare
//! ```

use super::camera_file::read_cameras_json;
use super::photos::shrink_linear;
use super::source::{SourceScene, SourceView};
use super::text;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{as_stored, name_of_folder, stem_of};
use crate::image::{Image, file};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::scene::settings::{ColourEncoding, PixelCentre, Up};
use crate::scene::{Background, Truth, TruthRelight, View};
use std::path::Path;

/// Whether the folder is an exchange folder.
pub fn is_folder_of_this_kind(folder: &Path) -> bool {
    folder.join("cameras.json").is_file()
}

/// Whether its cameras are a list of views, as those that this program writes; others write files of the name too.
pub fn holds_cameras(folder: &Path) -> bool {
    let text = text::read(&folder.join("cameras.json")).ok();
    let json = text.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    json.is_some_and(|json| json.get("views").is_some_and(serde_json::Value::is_array))
}

#[derive(serde::Deserialize, Default)]
struct SceneJson {
    name: Option<String>,
    max_depth: Option<usize>,
    background: Option<String>,
    rough_pow: Option<f64>,
    g_mode: Option<String>,
    lobe: Option<String>,
}

impl SceneJson {
    /// The microfacets of the pictures; `None` of others than those that can be fitted.
    fn lobe(&self) -> Option<LobeModel> {
        let is_usual = self.rough_pow.is_none_or(|power| power == 1.0);
        match (self.lobe.as_deref(), self.g_mode.as_deref()) {
            _ if !is_usual => None,
            (None | Some("modct"), None | Some("half_alpha")) => Some(LobeModel::BlinnPhong),
            (Some("ggx"), None | Some("smith_ggx")) => Some(LobeModel::Ggx),
            _ => None,
        }
    }
}

fn read_scene_json(folder: &Path) -> Result<SceneJson> {
    let path = folder.join("scene.json");
    if !path.is_file() {
        return Ok(SceneJson::default());
    }
    serde_json::from_str(&text::read(&path)?).map_err(|error| {
        Error::new(ErrorKind::Malformed, format!("the description of the scene cannot be read: {error}"))
            .at(Place::Line(path, error.line().max(1)))
            .remedy("export the folder again")
    })
}

/// Lists an exchange folder and reads its cameras.
pub fn read(folder: &Path) -> Result<SourceScene> {
    let json = read_scene_json(folder)?;
    let (cameras, mut findings) = read_cameras_json(&folder.join("cameras.json"))?;
    let mesh = folder.join("mesh.obj");
    if !mesh.is_file() {
        return Err(Error::new(ErrorKind::Missing, "the exchange folder lacks mesh.obj")
            .at(Place::File(folder.into()))
            .remedy("an exchange folder holds mesh.obj, cameras.json, scene.json and views/"));
    }
    let background = match json.background.as_deref() {
        None | Some("black") => Background::Black,
        Some("environment" | "env") => Background::Environment,
        Some(other) => {
            return Err(Error::new(ErrorKind::Unsupported, format!("the background is '{other}'"))
                .at(Place::File(folder.join("scene.json")))
                .remedy("give black or environment"));
        }
    };
    if json.lobe().is_none() {
        findings.push(
            Finding::new(
                Severity::Warning,
                "truth-other-lobe",
                "the pictures were made with another variant of the reflection lobe",
            )
            .at(Place::File(folder.join("scene.json")))
            .remedy("compare maps with care: rough_pow 1 is used here, with lobe modct and g_mode half_alpha or with lobe ggx and g_mode smith_ggx"),
        );
    }
    let stem = |file: &Path| stem_of(file);
    let marked: Vec<String> = cameras.iter().filter(|view| view.held_out).map(|view| stem(&view.file)).collect();
    let views = cameras
        .into_iter()
        .map(|view| {
            let name = stem(&view.file);
            let coverage = as_stored(folder.join("coverage").join(format!("{name}.exr")));
            SourceView {
                photo: as_stored(folder.join(&view.file)),
                mask: coverage.is_file().then_some(coverage),
                camera: view.camera,
                lens: None,
                size: view.size,
                place: view.place,
                name,
            }
        })
        .collect();
    Ok(SourceScene {
        name: json.name.unwrap_or_else(|| name_of_folder(folder)),
        folder: folder.into(),
        mesh: vec![mesh],
        views,
        up: Up::Y,
        pixel_centre: PixelCentre::Half,
        unit_in_metres: None,
        default_pixel_centre: PixelCentre::Half,
        background,
        encoding: ColourEncoding::Auto,
        held_out: (!marked.is_empty()).then_some(marked),
        has_truth: true,
        flip_winding: false,
        is_of_a_tool: false,
        sizes_are_of_files: false,
        mesh_frames: Vec::new(),
        findings,
    })
}

/// Reads the truth of the folder; `None` with a finding when a part of it is missing.
///
/// `shrink` is the factor the photos were shrunk by.
pub fn read_truth(folder: &Path, views: &[View], shrink: usize, findings: &mut Vec<Finding>) -> Result<Option<Truth>> {
    let parts = ["diffuse.exr", "specular.exr", "roughness.exr", "env.exr"].map(|name| folder.join(name));
    if let Some(missing) = parts.iter().find(|path| !path.is_file()) {
        if parts.iter().any(|path| path.is_file()) {
            findings.push(
                Finding::new(Severity::Note, "truth-incomplete", "a part of the truth is missing: it is not used")
                    .at(Place::File(missing.clone())),
            );
        }
        return Ok(None);
    }
    let [diffuse, specular, roughness, environment] = &parts;
    let maps = MaterialMaps {
        diffuse: file::read_rgb(diffuse)?,
        specular: file::read_rgb(specular)?,
        roughness: file::read_grey(roughness)?,
    };
    let size = (maps.diffuse.width(), maps.diffuse.height());
    let same_size = |other: (usize, usize), path: &Path| {
        if other == size {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::InvalidScene,
            format!("the map is {} x {}, diffuse.exr is {} x {}", other.0, other.1, size.0, size.1),
        )
        .at(Place::File(path.into()))
        .remedy("all maps of the truth have one size"))
    };
    same_size((maps.specular.width(), maps.specular.height()), specular)?;
    same_size((maps.roughness.width(), maps.roughness.height()), roughness)?;
    let seen =
        ["texel_seen.exr", "texel_covered.exr"].map(|name| folder.join(name)).into_iter().find(|path| path.is_file());
    let texels_seen = match seen {
        Some(path) => {
            let seen = file::read_grey(&path)?;
            same_size((seen.width(), seen.height()), &path)?;
            seen.map(|value| *value > 0.5)
        }
        None => Image::filled(size.0, size.1, true),
    };
    let json = read_scene_json(folder)?;
    Ok(Some(Truth {
        maps,
        texels_seen,
        environment: Environment { radiance: file::read_rgb(environment)? },
        relight: read_relight(folder, views, shrink)?,
        // `max_depth` counts as Mitsuba does: the camera, the hits, the light.
        max_bounces: json.max_depth.unwrap_or(2).saturating_sub(1).max(1),
        lobe: json.lobe().unwrap_or_default(),
    }))
}

fn read_relight(folder: &Path, views: &[View], shrink: usize) -> Result<Option<TruthRelight>> {
    let environment = folder.join("env_heldout.exr");
    if !environment.is_file() {
        return Ok(None);
    }
    let mut pictures = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let path = folder.join("relight").join(format!("{}.exr", view.name));
        if !path.is_file() {
            continue;
        }
        let picture = shrink_linear(file::read_rgb(&path)?, shrink);
        if (picture.width(), picture.height()) != (view.camera.width, view.camera.height) {
            return Err(Error::new(
                ErrorKind::InvalidScene,
                format!(
                    "the picture is {} x {}, the view is {} x {}",
                    picture.width(),
                    picture.height(),
                    view.camera.width,
                    view.camera.height
                ),
            )
            .at(Place::File(path))
            .remedy("render it with the camera of the view"));
        }
        pictures.push((index, picture));
    }
    Ok(Some(TruthRelight { environment: Environment { radiance: file::read_rgb(&environment)? }, pictures }))
}
