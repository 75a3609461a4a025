//! Windows over the window: which there are, and what becomes of a path that is typed or picked in one.

use super::exporting::ExportRequest;
use super::importing::ImportRequest;
use super::tasks::TaskKind;
use super::{Done, LightName, Model, lights};
use std::path::{Path, PathBuf};

/// What a path is picked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PickFor {
    /// To open a scene or run folder.
    Open,
    /// To fit a scene after those before it.
    Queue,
    /// To put a light on the shelf.
    Light,
    /// A folder whose HDR maps are put on the shelf.
    LightFolder,
    /// A run to compare with the one that is open.
    OtherRun,
    /// To write new runs into.
    RunsFolder,
    /// To save a picture.
    Save,
    /// To export into.
    ExportFolder,
    /// A folder that holds a capture.
    ImportFolder,
    /// Its photos.
    ImportPhotos,
    /// Its mesh.
    ImportMesh,
    /// Its cameras.
    ImportCameras,
    /// Its masks.
    ImportMasks,
    /// A photo of an object.
    ObjectPhoto,
    /// A mask of such a photo.
    ObjectMask,
    /// The mesh of the object.
    ObjectMesh,
    /// A camera of such a photo.
    ObjectCamera,
    /// The light of the object, where it is known.
    ObjectLight,
    /// A folder for the result of an estimation.
    ObjectResult,
    /// A measured material to look at.
    Material,
}

/// Endings of pictures that are read.
const PHOTOS: &[&str] = &["exr", "hdr", "pfm", "png", "jpg", "jpeg"];

/// A window over the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Dialog {
    /// None.
    #[default]
    None,
    /// Finds acts by name.
    Palette(String),
    /// Lists acts and keys.
    Help,
    /// Asks for the path of a scene, run or light.
    Path {
        /// What for.
        purpose: PickFor,
        /// What was typed.
        text: String,
    },
    /// Asks how and where to save.
    Save(SaveRequest),
    /// Asks what to export, and tells what will be lost.
    Export(Box<ExportRequest>),
    /// Asks for the parts of a capture.
    Import(Box<ImportRequest>),
}

/// What is saved, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct SaveRequest {
    /// What is saved.
    pub what: SaveWhat,
    /// Where to; a file for a picture, a folder for several.
    pub path: String,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Paths a pixel.
    pub samples: usize,
    /// Number of frames of a turntable or film.
    pub frames: usize,
    /// Whether what the surface does not cover is left transparent; of a picture.
    pub cut_out: bool,
    /// Whether a film is made of the frames; of a turntable.
    pub film: bool,
}

/// What can be saved from the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveWhat {
    /// One picture.
    Picture,
    /// A round about the scene.
    Turntable,
    /// The view under every light of the shelf.
    Strip,
    /// The view as the fit went on.
    FitFilm,
}

impl Model {
    /// Takes in a path that was chosen or typed.
    pub fn picked(&mut self, purpose: PickFor, path: PathBuf) {
        match purpose {
            PickFor::Open => self.open(path),
            PickFor::Queue => self.queue_scenes(vec![path]),
            PickFor::OtherRun => self.compare_with(path),
            PickFor::Light => self.add_light(path),
            PickFor::LightFolder => self.add_light_folder(&path),
            PickFor::RunsFolder => self.preferences.runs_folder = path,
            PickFor::ObjectPhoto => self.edits.object.photos.push(path),
            PickFor::ObjectMask => self.edits.object.masks.push(path),
            PickFor::ObjectCamera => self.edits.object.cameras.push(path),
            PickFor::ObjectMesh => self.edits.object.mesh = path.display().to_string(),
            PickFor::ObjectLight => self.edits.object.light = path.display().to_string(),
            PickFor::ObjectResult => self.save_object(path),
            PickFor::Material => self.open_material(path),
            PickFor::ImportFolder
            | PickFor::ImportPhotos
            | PickFor::ImportMesh
            | PickFor::ImportCameras
            | PickFor::ImportMasks => {
                if let Dialog::Import(request) = &mut self.dialog {
                    request.take(purpose, path);
                }
            }
            PickFor::ExportFolder => {
                if let Dialog::Export(request) = &mut self.dialog {
                    request.output = path.display().to_string();
                }
            }
            PickFor::Save => {
                if let Dialog::Save(request) = &mut self.dialog {
                    request.path = path.display().to_string();
                }
            }
        }
    }

    /// Reads an HDR map, puts it on the shelf and lights the viewport by it.
    pub fn add_light(&mut self, path: PathBuf) {
        self.light_to_choose = Some(path.clone());
        self.read_light(path);
    }

    /// Puts every environment of a folder on the shelf.
    pub fn add_light_folder(&mut self, folder: &Path) {
        match lights::of_folder(folder) {
            Ok(paths) => {
                let is_new = |path: &PathBuf| self.shelf.find(&LightName::File(path.clone())).is_none();
                let new: Vec<PathBuf> = paths.into_iter().filter(is_new).collect();
                self.log.note(format!("{} environments of {} are read", new.len(), folder.display()));
                new.into_iter().for_each(|path| self.read_light(path));
            }
            Err(error) => self.log.error(&error),
        }
    }

    /// Lights the viewport by an environment of the shelf.
    pub fn choose_light(&mut self, name: LightName) {
        self.edits.relight.first = name;
        self.show_light();
    }

    /// Reads an HDR map and puts it on the shelf.
    pub(super) fn read_light(&mut self, path: PathBuf) {
        self.tasks.spawn(TaskKind::ReadingEnvironment(path.clone()), move |_| {
            lights::read(&path).map(|(light, noticed)| Done::LightRead(Box::new(light), noticed))
        });
    }

    /// Forgets a remembered light that could not be read, by the task that read it: it is told of once.
    pub(super) fn forget_light(&mut self, task: &TaskKind) {
        let TaskKind::ReadingEnvironment(gone) = task else { return };
        let count = self.preferences.lights.len();
        self.preferences.lights.retain(|path| path != gone);
        if self.preferences.lights.len() < count {
            self.log.note("The environment is no longer remembered: import it again when its file is back");
        }
    }

    /// Opens the system's file dialog on a thread of its own.
    pub fn pick(&mut self, purpose: PickFor) {
        self.tasks.spawn(TaskKind::Choosing, move |_| {
            let dialog = rfd::FileDialog::new();
            let path = match purpose {
                PickFor::Open => dialog.set_title("Open a scene or run folder").pick_folder(),
                PickFor::Queue => dialog.set_title("Add a scene to the queue").pick_folder(),
                PickFor::LightFolder => dialog.set_title("Folder of HDRIs").pick_folder(),
                PickFor::OtherRun => dialog.set_title("Run to compare with").pick_folder(),
                PickFor::RunsFolder => dialog.set_title("Output folder for new runs").pick_folder(),
                PickFor::ImportFolder => dialog.set_title("Folder of the capture").pick_folder(),
                PickFor::ImportPhotos => dialog.set_title("Folder of photos").pick_folder(),
                PickFor::ImportMasks => dialog.set_title("Folder of masks").pick_folder(),
                PickFor::ImportCameras => dialog.set_title("Folder of cameras").pick_folder(),
                PickFor::ImportMesh => dialog.set_title("Mesh").add_filter("Meshes", &["obj", "ply"]).pick_file(),
                PickFor::ExportFolder => dialog.set_title("Export folder").pick_folder(),
                PickFor::Light => dialog
                    .set_title("Import an HDRI")
                    .add_filter("HDRIs", &["hdr", "exr", "pfm", "png", "jpg"])
                    .pick_file(),
                PickFor::Save => dialog.set_title("Render image").add_filter("Images", &["png", "exr"]).save_file(),
                PickFor::ObjectPhoto => {
                    dialog.set_title("Photo of the object").add_filter("Photos", PHOTOS).pick_file()
                }
                PickFor::ObjectMask => dialog.set_title("Mask of the photo").add_filter("Masks", PHOTOS).pick_file(),
                PickFor::ObjectMesh => dialog.set_title("Mesh").add_filter("Meshes", &["obj", "ply"]).pick_file(),
                PickFor::ObjectCamera => dialog.set_title("Camera").add_filter("Cameras", &["json", "txt"]).pick_file(),
                PickFor::ObjectLight => dialog.set_title("Known environment").add_filter("HDRIs", PHOTOS).pick_file(),
                PickFor::Material => {
                    dialog.set_title("Measured material").add_filter("MERL tables", &["binary"]).pick_file()
                }
                PickFor::ObjectResult => dialog.set_title("Folder for the result").pick_folder(),
            };
            Ok(Done::Picked(purpose, path))
        });
    }
}
