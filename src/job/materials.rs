//! The library of materials to look at: thumbnails, the map of codes, and any place on it; from the weights that come
//! with the program, no data needed. Beside it, measured tables that a user opens.

use super::object::MaterialLook;
use super::object::look::sphere_of;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::RgbImage;
use crate::light::Environment;
use crate::measured::coordinates::HalfDifference;
use crate::neural::between::{MaterialMap, Part};
use crate::neural::embedding::Embedding;
use crate::neural::nodes::GridShape;
use crate::neural::sampler::HalfVectorSampler;
use crate::neural::{self, FlowModel, Trained, source};
use crate::render::regions::MeasuredMaterial;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Nearest codes that purity is told of.
const NEIGHBOURS: usize = 5;
/// Nodes of the grid that thumbnails are read from: they are small.
const SMALL: GridShape = GridShape { halves: 31, differences: 13, azimuths: 8 };

/// The library.
pub struct Materials {
    trained: Arc<Trained>,
    model: FlowModel,
    /// One place a material.
    pub map: MaterialMap,
}

/// What is known of a material or a place between materials.
#[derive(Clone, Debug)]
pub struct MaterialShown {
    /// Its share of each material, the largest first.
    pub parts: Vec<Part>,
    /// Lobes and sphere.
    pub look: MaterialLook,
    /// Share of the light from 10 degrees that leaves again, per channel.
    pub albedo: [f64; 3],
}

impl Materials {
    /// The library that comes with the program.
    ///
    /// # Errors
    /// As of [`neural::shipped`].
    pub fn shipped() -> Result<Self> {
        let trained = Arc::new(neural::shipped()?);
        let embedding = Embedding::of(&trained, NEIGHBOURS);
        let map = MaterialMap::of(&embedding);
        Ok(Materials { model: FlowModel::new(Arc::clone(&trained), 1), trained, map })
    }

    /// What the library was learned from.
    pub fn statement(&self) -> String {
        format!("{} materials; learned from {}", self.map.places.len(), self.trained.account.data)
    }

    /// Spheres of all materials under three lamps, in the order of the map, exposed for a display at 0 stops. `tell`
    /// hears the share done.
    ///
    /// # Errors
    /// `Stopped`.
    pub fn thumbnails(&self, side: usize, stop: &AtomicBool, tell: &dyn Fn(f32)) -> Result<Vec<RgbImage>> {
        let model = FlowModel::with(Arc::clone(&self.trained), 1, SMALL);
        let mut pictures = Vec::new();
        for place in &self.map.places {
            if stop.load(Ordering::Relaxed) {
                return Err(Error::new(ErrorKind::Stopped, "stopped as asked"));
            }
            let parameters = model.of_material(&place.name).unwrap_or_default();
            pictures.push(sphere_of(&model.reader(&parameters), side, None));
            tell(pictures.len() as f32 / self.map.places.len() as f32);
        }
        Ok(pictures)
    }

    /// The material at these shares, its sphere under a light or under three lamps.
    ///
    /// # Errors
    /// `Missing` when a material is not in the library.
    pub fn shown(&self, parts: &[Part], light: Option<&Environment>) -> Result<MaterialShown> {
        let parameters = self.model.of_parts(parts).ok_or_else(|| {
            Error::new(ErrorKind::Missing, "there is no such material in the library").remedy("choose one on the map")
        })?;
        let look = MaterialLook::of(&self.model.reader(&parameters), light);
        let albedos = HalfVectorSampler::new(&self.model, &parameters).albedos();
        let albedo = albedos.first().map_or([0.0; 3], |(_, albedo)| *albedo);
        Ok(MaterialShown { parts: parts.to_vec(), look, albedo })
    }
}

/// A measured table that was opened.
#[derive(Clone, Debug)]
pub struct OpenedMaterial {
    /// Where it was read from.
    pub path: PathBuf,
    material: MeasuredMaterial,
}

impl OpenedMaterial {
    /// Reads a `.binary` file, or the table in a result folder of object mode.
    ///
    /// # Errors
    /// Those of [`source::read`]; `Unsupported` for other files.
    pub fn read(path: &Path) -> Result<Self> {
        if !Self::is_table(path) && !path.is_dir() {
            return Err(Error::new(ErrorKind::Unsupported, "a measured material is a .binary file in MERL's layout")
                .at(Place::File(path.into()))
                .remedy("`patina measured show` and `project` take other sources; or open a result of object mode"));
        }
        let found = source::read(&path.to_string_lossy(), None, None)?;
        Ok(OpenedMaterial { path: path.into(), material: MeasuredMaterial::new(&found.name, found.table) })
    }

    /// Whether a path is that of a table, by its ending.
    pub fn is_table(path: &Path) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("binary"))
    }

    /// Its name: that of the file without its ending, or of the folder.
    pub fn name(&self) -> &str {
        &self.material.name
    }

    /// A sphere of it under three lamps, exposed for a display at 0 stops.
    pub fn thumbnail(&self, side: usize) -> RgbImage {
        sphere_of(&|at| self.value(at), side, None)
    }

    /// The material with its sphere under a light or under three lamps.
    pub fn shown(&self, light: Option<&Environment>) -> MaterialShown {
        let parts = vec![Part { name: self.name().into(), share: 1.0 }];
        let albedo = self.material.albedos().first().map_or([0.0; 3], |(_, albedo)| *albedo);
        MaterialShown { parts, look: MaterialLook::of(&|at| self.value(at), light), albedo }
    }

    fn value(&self, at: HalfDifference) -> [f64; 3] {
        self.material.table().lookup(at).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opened_table_is_what_it_was_written_from() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("copper.binary");
        let materials = Materials::shipped().unwrap();
        let name = materials.map.places[0].name.clone();
        let parameters = materials.model.of_material(&name).unwrap();
        materials.model.table(&parameters).write(&path).unwrap();
        let opened = OpenedMaterial::read(&path).unwrap();
        assert_eq!(opened.name(), "copper");
        let own = opened.shown(None);
        let library = materials.shown(&[Part { name, share: 1.0 }], None).unwrap();
        for channel in 0..3 {
            assert!((own.albedo[channel] / library.albedo[channel] - 1.0).abs() < 0.05, "{own:?} {library:?}");
        }
        assert_eq!(opened.thumbnail(9).width(), 9);
        crate::files::write_bytes(&path, b"cut").unwrap();
        assert_eq!(OpenedMaterial::read(&path).unwrap_err().kind(), ErrorKind::Malformed);
        assert_eq!(OpenedMaterial::read(&folder.path().join("x.png")).unwrap_err().kind(), ErrorKind::Unsupported);
    }

    #[test]
    fn the_library_is_drawn_and_a_place_between_is_between() {
        let materials = Materials::shipped().unwrap();
        let pictures = materials.thumbnails(12, &AtomicBool::new(false), &|_| {}).unwrap();
        assert_eq!(pictures.len(), materials.map.places.len());
        let brightest =
            |picture: &RgbImage| picture.pixels().iter().fold(0.0f32, |most, rgb| most.max(rgb.max_element()));
        // The highlights of black materials fall between pixels this coarse.
        assert!(pictures.iter().all(|picture| brightest(picture) > 0.0 && brightest(picture).is_finite()));
        let stopped = materials.thumbnails(12, &AtomicBool::new(true), &|_| {});
        assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Stopped);

        let (a, b) = (&materials.map.places[0].name, &materials.map.places[30].name);
        let at = |share: f64| {
            let parts = [Part { name: a.clone(), share: 1.0 - share }, Part { name: b.clone(), share }];
            let look = materials.shown(&parts, None).unwrap().look;
            look.lobes[1].points[20].1[1].ln()
        };
        let (first, middle, last) = (at(0.0), at(0.5), at(1.0));
        assert!(first != last && middle != first && middle != last, "{first} {middle} {last}");
        assert!(materials.shown(&[], None).is_err());
    }
}
