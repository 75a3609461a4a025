//! Readers: from a folder or a manifest to a [`Scene`].
//!
//! [`read`] is the door. [`detect`] finds out the kind of the scene ([`manifest`], [`exchange`], [`blended_mvs`], [`colmap`],
//! [`transforms`], [`metashape`], and the others of [`Format`]); each kind only lists files and reads cameras into a
//! [`source::SourceScene`]. What follows is the same for all: true sizes of photos (`photo_size`, `calibrated_size`), mesh
//! ([`mesh_file`], with `obj`, `ply`, `gltf` and `stl`) and its frame (`mesh_frame`), up axis and origin ([`world`]), photos,
//! masks and lenses ([`photos`], `masks`), how photos lie (`orientation`, `orientation_trial`), pixel centres. [`understood`]
//! says on a page what was made of it all.
//!
//! What it refuses to do: guess. What is missing or contradictory is an error with place and remedy, or a finding; what
//! was assumed is a finding. Whether the parts fit together is judged by [`doctor`](crate::scene::doctor), not here.

mod again;
mod alicevision;
pub mod blended_mvs;
mod bundler;
mod bytes;
mod calibrated_size;
pub mod camera_file;
pub mod colmap;
mod colmap_files;
pub mod colmap_lens;
pub mod detect;
pub mod exchange;
mod gltf;
pub mod manifest;
mod mask_names;
mod masks;
mod matte;
mod mesh_choice;
pub mod mesh_file;
mod mesh_frame;
mod mesh_frame_rating;
pub mod metashape;
mod metashape_cameras;
mod metashape_project;
mod neural_scenes;
pub(crate) mod numpy;
mod obj;
mod obj_elements;
pub mod objects_with_lighting;
mod open_size;
mod openmvs;
mod opensfm;
mod orientation;
mod orientation_trial;
pub mod outliers;
mod photo_index;
mod photo_size;
pub mod photos;
mod ply;
mod ply_faces;
mod ply_header;
pub mod polygon;
mod posed;
mod realitycapture;
mod realitycapture_csv;
pub(crate) mod repeated;
pub mod source;
mod source_mesh;
mod stl;
pub mod text;
mod tool_folder;
pub mod transforms;
mod udim;
pub mod understood;
pub mod world;
pub(crate) mod zip;

pub use detect::{Format, Located, locate};
pub use mesh_file::read_mesh;
pub use understood::{Understood, understand};

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::files::{as_stored, composed};
use crate::scene::doctor::pixel_centre;
use crate::scene::settings::{BackgroundChoice, ColourEncoding, MaskUse, PixelCentre, ReadSettings, Up};
use crate::scene::{Background, Scene, View, WorldFromSource};
pub(super) use mask_names::PHOTO_EXTENSIONS;
use mesh_frame_rating::Rater;
use orientation::Turns;
use photos::LoadedPhoto;
use source::{SourceCamera, SourceScene, SourceView};
use std::path::Path;

/// With fewer views than this none is held out: each is needed.
const FEWEST_VIEWS_TO_HOLD_OUT: usize = 4;

/// Reads a scene of any [`Format`]: its folder, or a manifest or a project file itself.
///
/// # Errors
/// Anything missing, damaged or contradictory, with file, line or byte and a remedy. Geometry or photos that are valid
/// but useless are not errors here: [`doctor::check`](crate::scene::doctor::check) names them.
pub fn read(path: &Path, settings: &ReadSettings) -> Result<Scene> {
    settings.validate()?;
    assemble(locate(path)?.list(settings)?, settings)
}

/// The folders that hold photos and masks of a scene, without decoding any.
///
/// # Errors
/// As of [`read`], as far as files are listed and cameras read.
pub fn picture_folders(path: &Path) -> Result<std::collections::BTreeSet<std::path::PathBuf>> {
    let views = locate(path)?.list(&ReadSettings::default())?.views;
    let files = views.iter().flat_map(|view| std::iter::once(&view.photo).chain(&view.mask));
    Ok(files.filter_map(|file| file.parent().map(Path::to_path_buf)).collect())
}

/// Turns, decodes and joins what a reader listed.
fn assemble(source: SourceScene, settings: &ReadSettings) -> Result<Scene> {
    let SourceScene { name, folder, mesh, views, mut findings, .. } = source;
    let mut views = choose_views(views, settings.max_views, &folder)?;
    let sizes = photo_size::of_files(&views)?;
    photo_size::fit_to_photos(&mut views, &sizes, &mut findings)?;
    let mesh = if settings.mesh.is_empty() { mesh } else { settings.mesh.iter().cloned().map(as_stored).collect() };
    if mesh.is_empty() {
        return Err(mesh_choice::none_found(&folder));
    }

    // The mesh.
    let mut source_mesh = mesh_file::read_pieces(&mesh)?;
    if source.flip_winding {
        source_mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        source_mesh.normals.iter_mut().for_each(|normal| *normal = -*normal);
    }
    let cameras: Vec<_> = views.iter().map(|view| view.camera).collect();
    let asked_up = if settings.up == Up::Auto { source.up } else { settings.up };
    let (up, mut noticed) = world::up_in_source(asked_up, &cameras)?;
    findings.append(&mut noticed);

    // The photos.
    let encoding = if settings.encoding == ColourEncoding::Auto { source.encoding } else { settings.encoding };
    if source.sizes_are_of_files {
        open_size::settle(&mut views, &source_mesh, encoding, settings, &mut findings)?;
    }
    let mut loaded = photos::load_all(&views, &sizes, encoding, (None, &Turns::new()), settings)?;
    let way_of_masks = photos::way_of_masks(&loaded);
    findings.extend(photos::told_of_lenses(&loaded));
    let mut background = match settings.background {
        BackgroundChoice::Auto => source.background,
        BackgroundChoice::Environment => Background::Environment,
        BackgroundChoice::Black => Background::Black,
    };
    let may_be_matte = settings.background == BackgroundChoice::Auto && background == Background::Environment;
    let matte = matte::find(&loaded).filter(|_| may_be_matte);
    if let Some(matte) = matte {
        matte::set_aside(&mut loaded, matte);
        findings.push(matte::told(matte, loaded.len()));
        if matte.is_masked {
            background = Background::Black;
        }
    }
    if settings.masks == MaskUse::Use {
        let without = views.iter().filter(|view| view.mask.is_none()).count();
        if without > 0 && without < views.len() {
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "masks-incomplete",
                    format!(
                        "{without} of {} views have no mask: ray casting against the mesh decides there",
                        views.len()
                    ),
                )
                .remedy("add the missing masks, or ignore all with --masks ignore"),
            );
        }
    }
    let asked_centre =
        if settings.pixel_centre == PixelCentre::Auto { source.pixel_centre } else { settings.pixel_centre };
    let assumed_centre = if asked_centre == PixelCentre::Auto { source.default_pixel_centre } else { asked_centre };
    let scaled = calibrated_size::fit(&mut views, &loaded, assumed_centre.shift_pixels(), &mut findings);
    let open: Vec<Option<u8>> = loaded.iter().map(|photo| photo.open_orientation).collect();
    let file_sizes: Vec<(usize, usize)> = loaded.iter().map(|photo| photo.file_size).collect();
    let camera_in = |world: &WorldFromSource, camera: &SourceCamera, view: usize| {
        let camera = camera.in_world(world, file_sizes[view], assumed_centre.shift_pixels());
        if settings.shrink == 1 { camera } else { camera.shrunk(settings.shrink) }
    };
    let mut joined = Vec::with_capacity(views.len());
    for (view, photo) in views.iter().zip(loaded) {
        joined.push(join(view, photo, &WorldFromSource::default(), assumed_centre, settings.shrink, &mut findings));
    }

    let in_source = |camera: &SourceCamera, view| camera_in(&WorldFromSource::default(), camera, view);
    let cameras: Vec<SourceCamera> = views.iter().map(|view| view.camera).collect();
    let mut turns = Turns::new();
    if open.iter().any(Option::is_some) && !source_mesh.triangles.is_empty() {
        let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
        let mut rater = Rater::new(&source_mesh, &cameras, joined, &in_source);
        turns = orientation_trial::decide(&mut rater, &names, &open, &mut findings);
        joined = rater.into_views();
        let loading = again::Loading { encoding, way_of_masks, matte, turns: &turns, settings };
        again::turn(&mut joined, &views, &loading)?;
    }

    // Both in one frame, turned so that +y is up.
    if source.is_of_a_tool {
        joined =
            mesh_frame::put_right(&mut source_mesh, (&cameras, joined), &in_source, &source.mesh_frames, &mut findings);
    }
    let mut world_from_source = world::world_from_source(up, source_mesh.bounds_of_most());
    world_from_source.unit_in_metres = settings.unit_in_metres.or(source.unit_in_metres);
    for (index, (own, view)) in joined.iter_mut().zip(&views).enumerate() {
        own.camera = camera_in(&world_from_source, &view.camera, index);
    }
    let (mesh, mut noticed) = source_mesh.into_world(&world_from_source);
    findings.append(&mut noticed);
    mesh.validate()?;
    hold_out(&mut joined, source.held_out.as_deref(), settings.hold_out_every, &mut findings)?;

    let mut scene = Scene {
        name,
        folder: Some(folder.clone()),
        mesh,
        views: joined,
        world_from_source,
        background,
        truth: None,
        findings,
    };
    if source.has_truth {
        let mut noticed = Vec::new();
        scene.truth = exchange::read_truth(&folder, &scene.views, settings.shrink, &mut noticed)?;
        scene.findings.append(&mut noticed);
    }
    if asked_centre == PixelCentre::Auto {
        let (centre, finding) = if settings.shrink == 1 {
            pixel_centre::decide(&scene, assumed_centre, scaled)
        } else {
            let loading = again::Loading { encoding, way_of_masks, matte: None, turns: &turns, settings };
            again::decide_centre_unshrunk(&scene, &views, &loading, assumed_centre, scaled)?
        };
        let shift = scaled * (centre.shift_pixels() - assumed_centre.shift_pixels()) / settings.shrink as f64;
        scene.views.iter_mut().for_each(|view| view.camera.centre_pixels += shift as f32);
        scene.findings.push(finding);
    }
    scene.findings = repeated::joined(std::mem::take(&mut scene.findings));
    Ok(scene)
}

/// A view in the world, of the size of its shrunk photo.
fn join(
    view: &SourceView,
    photo: LoadedPhoto,
    world: &WorldFromSource,
    centre: PixelCentre,
    shrink: usize,
    findings: &mut Vec<Finding>,
) -> View {
    findings.extend(photo.findings);
    let camera = view.camera.in_world(world, photo.file_size, centre.shift_pixels());
    View {
        name: view.name.clone(),
        camera: if shrink == 1 { camera } else { camera.shrunk(shrink) },
        photo: photo.photo,
        states: photo.states,
        held_out: false,
        exposure_prior_stops: photo.exposure_prior_stops,
    }
}

/// Sorts the views by name, refuses names that occur twice and takes at most `most` of them, spread evenly.
fn choose_views(mut views: Vec<SourceView>, most: usize, folder: &Path) -> Result<Vec<SourceView>> {
    views.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(pair) = views.windows(2).find(|pair| pair[0].name == pair[1].name) {
        return Err(Error::new(ErrorKind::InvalidScene, format!("two views are named '{}'", pair[0].name))
            .at(pair[1].place.clone())
            .remedy("photos need different names, whatever their folder or extension"));
    }
    if views.is_empty() {
        return Err(Error::new(ErrorKind::InvalidScene, "the scene has no views")
            .at(Place::File(folder.into()))
            .remedy("add photos and their cameras"));
    }
    if most > 0 && most < views.len() {
        let count = views.len();
        let mut index = 0;
        views.retain(|_| {
            // View i stays when it is the first of its share: floor(i m / n) steps up there.
            let stays = index == 0 || index * most / count != (index - 1) * most / count;
            index += 1;
            stays
        });
    }
    Ok(views)
}

fn hold_out(views: &mut [View], named: Option<&[String]>, every: usize, findings: &mut Vec<Finding>) -> Result<()> {
    if let Some(names) = named {
        for name in names {
            let Some(view) = views.iter_mut().find(|view| view.name == composed(name)) else {
                findings.push(
                    Finding::new(
                        Severity::Warning,
                        "held-out-unknown",
                        format!("there is no view '{name}' to hold out"),
                    )
                    .remedy("held_out names photos without their extension"),
                );
                continue;
            };
            view.held_out = true;
        }
        if views.iter().all(|view| view.held_out) {
            return Err(Error::new(ErrorKind::InvalidScene, "every view is held out, none is left to fit")
                .remedy("list fewer views in held_out"));
        }
        return Ok(());
    }
    if every == 0 {
        return Ok(());
    }
    if views.len() < FEWEST_VIEWS_TO_HOLD_OUT || every == 1 {
        findings.push(Finding::new(
            Severity::Note,
            "none-held-out",
            format!("no view of {} is held out: the fit cannot be validated on views it has not seen", views.len()),
        ));
        return Ok(());
    }
    views.iter_mut().step_by(every).for_each(|view| view.held_out = true);
    Ok(())
}
