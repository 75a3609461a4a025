//! The photos of a study: measured reflectance itself under a light finer than any that is fitted.

use super::StudyOptions;
use super::asked::{Case, Figure, Spoilt};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::RgbImage;
use crate::light::Environment;
use crate::math::random::SequentialRandom;
use crate::measured::fits::NeuralFits;
use crate::neural::Trained;
use crate::object::geometry::ObjectGeometry;
use crate::object::photo::ObjectPhoto;
use crate::object::picture::render_exact;
use crate::object::settings::ObjectSettings;
use crate::object::transport::TexelDirections;
use crate::scene::Camera;
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;

/// How many times finer along each axis the light of the photos is than that of the fit.
const FINER: usize = 4;
const FINER_WHEN_QUICK: usize = 2;

/// Names of lights in the order in which studies take them: sun, overcast, indoor, low sun.
const LIGHTS: [&str; 11] = [
    "kloppenheim_05",
    "lebombo",
    "potsdamer_platz",
    "venice_sunset",
    "aerodynamics_workshop",
    "forest_slope",
    "noon_grass",
    "kiara_1_dawn",
    "rooitou_park",
    "hilly_terrain_01",
    "chinese_garden",
];
/// The light that is held out, for relit pictures.
const HELD_OUT: &str = "studio_small_03";

/// What a study works on.
pub struct Inputs {
    /// The measured reflectance.
    pub fits: NeuralFits,
    /// Lights of photos with their names, at the fine size.
    pub lights: Vec<(String, Environment)>,
    /// The light no photo was taken under.
    pub held_out: (String, Environment),
    /// The sphere.
    pub sphere: ObjectGeometry,
    /// The object that shadows itself.
    pub mesh: Option<ObjectGeometry>,
    /// Settings of all estimations; cases change prior, shadows and seed.
    pub settings: ObjectSettings,
    /// The neural model: that of the options, or the one that ships for materials left out.
    pub trained: Arc<Trained>,
}

/// One material under two lights, without noise, as rendered.
#[derive(Clone, Debug)]
pub struct Photographed {
    /// Under the light of the case.
    pub truth: RgbImage,
    /// Under the held-out light.
    pub held_out: RgbImage,
}

impl Inputs {
    /// Reads the library, the lights and the mesh.
    ///
    /// # Errors
    /// What cannot be read; a folder without two lights.
    pub fn read(options: &StudyOptions, tell: &dyn Fn(&str)) -> Result<Self> {
        let fits = NeuralFits::read(&options.library)?;
        let trained = Arc::new(options.trained()?);
        let base = if options.quick { ObjectSettings::quick() } else { ObjectSettings::default() };
        let settings = ObjectSettings {
            light_height: if options.quick { 32 } else { 64 },
            pixels: if options.quick { 768 } else { base.pixels },
            ..base
        };
        let (width, height) = settings.light_size();
        let finer = if options.quick { FINER_WHEN_QUICK } else { FINER };
        let held_out_path = file_of(&options.envmaps, HELD_OUT);
        // Without a file for it the last of one more is held out.
        let mut lights = Vec::new();
        for path in &light_files(&options.envmaps)? {
            lights.push(read_light(path, (finer * width, finer * height))?);
        }
        let held_out = match held_out_path {
            Some(path) => read_light(&path, (finer * width, finer * height))?,
            None => lights.pop().ok_or_else(|| no_lights(&options.envmaps))?,
        };
        if lights.is_empty() {
            return Err(no_lights(&options.envmaps));
        }
        let size = if options.quick { 48 } else { 128 };
        let mesh = match &options.mesh {
            Some(path) => {
                let mut mesh = crate::scene::read_mesh(path)?.0;
                mesh.compute_normals();
                let (low, high) = mesh.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
                let (centre, reach) = (0.5 * (low + high), (high - low).length());
                let eye = centre + Vec3::new(0.35, 0.3, 1.0) * reach * 1.2;
                let camera = Camera::looking_at(eye, centre, size + size / 2, size + size / 2, 0.62);
                Some(ObjectGeometry::of_mesh(&mesh, &camera)?)
            }
            None => {
                tell("no mesh was given: the part on shadows is left out");
                None
            }
        };
        let sphere = ObjectGeometry::sphere(size, size, 0.5 * size as f32);
        Ok(Inputs { fits, lights, held_out, sphere, mesh, settings, trained })
    }

    /// Whether the neural model was trained on a material: what it says of such a one is not a finding.
    pub fn has_seen(&self, material: &str) -> bool {
        self.trained.account.materials.iter().any(|own| own == material)
    }

    /// The geometry of a case.
    pub fn geometry(&self, case: &Case) -> &ObjectGeometry {
        match (case.figure, &self.mesh) {
            (Figure::Shadows, Some(mesh)) => mesh,
            _ => &self.sphere,
        }
    }

    /// A light by its name, at the fine size.
    ///
    /// # Errors
    /// A name that is not there.
    pub fn light(&self, name: &str) -> Result<&Environment> {
        let all = self.lights.iter().chain(std::iter::once(&self.held_out));
        all.into_iter()
            .find(|(own, _)| own == name)
            .map(|(_, light)| light)
            .ok_or_else(|| Error::new(ErrorKind::Missing, format!("there is no light {name}")))
    }

    /// Photographs a case's material under its light and under the held-out one.
    ///
    /// # Errors
    /// A material or a light that is not there.
    pub fn photograph(&self, case: &Case) -> Result<Photographed> {
        let fit = self.fits.find(&case.material)?;
        let geometry = self.geometry(case);
        let fine = &self.held_out.1;
        let directions = TexelDirections::of_any_size(fine.width(), fine.height());
        let visibility = geometry.visibility(&geometry.pixels, fine.width(), fine.height());
        let lights = [self.light(&case.light)?, fine];
        let evaluate = |at: &[crate::measured::HalfDifference], values: &mut [[f64; 3]]| fit.evaluate(at, values);
        let mut pictures = render_exact(geometry, visibility.as_ref(), &directions, &evaluate, &lights);
        let held_out = pictures.swap_remove(1);
        Ok(Photographed { truth: pictures.swap_remove(0), held_out })
    }
}

impl Photographed {
    /// The photo as it is given away.
    ///
    /// # Errors
    /// Those of [`ObjectPhoto::new`].
    pub fn photo(&self, geometry: &ObjectGeometry, spoilt: Spoilt, seed: u64) -> Result<ObjectPhoto> {
        let clean = ObjectPhoto::new("photo", self.truth.clone(), f32::INFINITY, 0.0)?.0;
        let mut levels: Vec<f32> = geometry
            .pixels
            .iter()
            .map(|pixel| self.truth[(pixel.row as usize, pixel.column as usize)].max_element())
            .collect();
        levels.sort_by(f32::total_cmp);
        let level = |share: f64| levels.get((levels.len() as f64 * share) as usize).copied().unwrap_or(1.0).max(1e-20);
        Ok(match spoilt {
            Spoilt::Clean => clean,
            Spoilt::Noise => {
                let mut random = SequentialRandom::new(seed);
                // Twelve uniform numbers less six are near to a normal one.
                let mut normal = || (0..12).map(|_| random.next_number()).sum::<f32>() - 6.0;
                let floor = 1e-3 * level(0.5);
                let noisy =
                    clean.radiance.map(|pixel| pixel.map(|value| (value + (0.01 * value + floor) * normal()).max(0.0)));
                ObjectPhoto { radiance: noisy, ..clean }
            }
            Spoilt::Bytes => clean.as_bytes(1.0 / level(0.98)),
        })
    }
}

fn no_lights(folder: &Path) -> Error {
    Error::new(ErrorKind::Missing, "the folder holds fewer than two environments")
        .at(Place::File(folder.into()))
        .remedy("give a folder of latitude-longitude HDR files")
}

fn read_light(path: &Path, size: (usize, usize)) -> Result<(String, Environment)> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().trim_end_matches("_1k").to_string();
    Ok((name, Environment::read(path)?.0.resampled(size.0, size.1)))
}

fn file_of(folder: &Path, name: &str) -> Option<std::path::PathBuf> {
    ["_1k.hdr", ".hdr", ".exr"].iter().map(|end| folder.join(format!("{name}{end}"))).find(|path| path.is_file())
}

/// The lights that are known by name, then any other of the folder.
fn light_files(folder: &Path) -> Result<Vec<std::path::PathBuf>> {
    let mut found: Vec<_> = LIGHTS.iter().filter_map(|name| file_of(folder, name)).collect();
    let entries = std::fs::read_dir(folder).map_err(|source| Error::reading(folder, source))?;
    let mut others: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "hdr" || extension == "exr"))
        .filter(|path| !found.contains(path) && !path.to_string_lossy().contains(HELD_OUT))
        .collect();
    others.sort();
    found.append(&mut others);
    Ok(found)
}
