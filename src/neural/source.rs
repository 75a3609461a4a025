//! Where a reflectance may come from: a table, an estimation, a library of measurements, or codes of the neural model.

use super::model::FlowModel;
use super::weights::Trained;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::measured::fits::NeuralFits;
use crate::measured::table::MeasuredBrdf;
use std::path::Path;
use std::sync::Arc;

/// File of the table in the result folder of an estimation.
const TABLE_OF_RESULT: &str = "reflectance.binary";

/// A table with a name.
#[derive(Clone, Debug)]
pub struct NamedTable {
    /// Name of the material.
    pub name: String,
    /// Its reflectance.
    pub table: MeasuredBrdf,
    /// Where it comes from, in words.
    pub origin: &'static str,
}

/// The reflectance that `source` names: a `.binary` file, the result folder of `patina object`, with `library` a
/// material of this folder of neural fits of MERL, and otherwise a material of the neural model's own library, given by
/// its codes. `weights` are the shaped ones that ship when not given.
///
/// # Errors
/// Files that cannot be read, a name that is nowhere.
pub fn read(source: &str, library: Option<&Path>, weights: Option<&Path>) -> Result<NamedTable> {
    let path = Path::new(source);
    if path.is_dir() {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let table = MeasuredBrdf::read(&path.join(TABLE_OF_RESULT))
            .map_err(|error| error.remedy("name a result folder of `patina object`, or a .binary file"))?;
        return Ok(NamedTable { name, table, origin: "estimated from photos" });
    }
    if path.extension().is_some() || path.exists() {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        return Ok(NamedTable { name, table: MeasuredBrdf::read(path)?, origin: "table" });
    }
    if let Some(library) = library {
        let table = NeuralFits::read(library)?.find(source)?.table();
        return Ok(NamedTable { name: source.into(), table, origin: "neural fit of a measurement" });
    }
    let trained = Arc::new(weights.map_or_else(super::shaped, Trained::read)?);
    let model = FlowModel::new(Arc::clone(&trained), 1);
    let parameters = model.of_material(source).ok_or_else(|| {
        Error::new(ErrorKind::Missing, format!("the neural model has no material {source}, and no file is called so"))
            .at(Place::Setting("material".into()))
            .remedy("`patina measured embedding` writes the names; or give a .binary file, or --library FOLDER")
    })?;
    Ok(NamedTable { name: source.into(), table: model.table(&parameters), origin: "codes of the neural model" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_a_file_and_a_folder_are_told_apart() {
        let trained = super::super::shaped().unwrap();
        let material = trained.account.materials[0].clone();
        let own = read(&material, None, None).unwrap();
        assert_eq!((own.name.as_str(), own.origin), (material.as_str(), "codes of the neural model"));
        let folder = tempfile::tempdir().unwrap();
        let result = folder.path().join("run");
        let file = folder.path().join("some.binary");
        own.table.write(&result.join(TABLE_OF_RESULT)).unwrap();
        own.table.write(&file).unwrap();
        assert_eq!(read(&file.to_string_lossy(), None, None).unwrap().name, "some");
        let of_result = read(&result.to_string_lossy(), None, None).unwrap();
        assert_eq!(of_result.origin, "estimated from photos");
        assert!(of_result.table.raw_value(5) == own.table.raw_value(5));
        assert_eq!(read("no-such", None, None).unwrap_err().kind(), ErrorKind::Missing);
    }
}
