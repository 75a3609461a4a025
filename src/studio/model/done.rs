//! What tasks beside the window bring back to it.

use super::lights::ShelfLight;
use super::{LightName, PickFor, laid, materials, object, opened, other_run, rescaling, starting};
use crate::error::Finding;
use std::path::PathBuf;
use std::sync::Arc;

/// What a task brings.
pub enum Done {
    /// A scene was read.
    SceneRead(Box<opened::SceneRead>),
    /// It was checked.
    SceneChecked(Box<opened::SceneChecked>),
    /// The atlas and the tracer of a scene are made.
    Prepared(Box<opened::PreparedScene>),
    /// The photos of a scene were laid on its mesh.
    PhotosLaid(Box<laid::LaidPhotos>),
    /// The transport of a surface was cached.
    TransportCached(Box<laid::CachedOf>),
    /// A run folder was read.
    RunOpened(Box<opened::RunRead>),
    /// A run was read, to compare with the one that is open.
    OtherRun(Box<other_run::OtherRun>),
    /// A job was started.
    FitStarted(Box<starting::Started>),
    /// A light was read; what was noticed.
    LightRead(Box<ShelfLight>, Vec<Finding>),
    /// A folder or file was chosen in the system's dialog; `None` when it was closed.
    Picked(PickFor, Option<PathBuf>),
    /// Files were saved, and the seconds that each of their paths took where they were path-traced.
    Saved(Vec<PathBuf>, Option<f64>),
    /// The run was written anew at another scale.
    Rescaled(Box<rescaling::Rescaled>),
    /// The run was written for other programs.
    Exported(Box<crate::job::export::Exported>),
    /// The error of the photos was spread over the surface, for these maps.
    Layers(Arc<crate::material::MaterialMaps>, Box<crate::insight::surface_layers::SurfaceLayers>),
    /// The stage's view under every light of the shelf.
    Strip(Vec<(LightName, Arc<crate::image::RgbImage>)>),
    /// Pictures under other lights were compared with the truth.
    Entangled(Box<crate::job::entanglement::Entanglement>),
    /// The estimated object under the lights of the shelf.
    ObjectRelit(Vec<object::RelitObject>),
    /// A result of object mode was read from its folder.
    ObjectOpened(Box<crate::job::object::ReopenedObject>),
    /// The result of an estimation was written to a folder.
    ObjectSaved(PathBuf),
    /// The library of materials with its thumbnails.
    MaterialsDrawn(Arc<crate::job::materials::Materials>, Vec<crate::image::RgbImage>),
    /// A measured table was opened.
    MaterialOpened(materials::OpenedTile),
    /// The chosen material.
    MaterialShown(Box<crate::job::materials::MaterialShown>),
}
