//! The materials a flow is trained on, and which of them a study leaves out.

use super::target::TargetGrid;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::math::random::SequentialRandom;
use crate::measured::fits::neural::NAMES_FILE;
use crate::measured::{Category, MeasuredBrdf, NeuralFits};
use std::path::Path;

/// Densities of materials, three a material.
#[derive(Clone, Debug)]
pub struct Library {
    /// What the densities were made of, for the metadata of weights.
    pub statement: String,
    /// Names of the materials.
    pub names: Vec<String>,
    /// Red, green and blue of each material.
    pub targets: Vec<[TargetGrid; 3]>,
}

impl Library {
    /// Reads a folder: the neural fits when it holds them, otherwise every `.binary` table in it. `tell` hears of the
    /// progress; materials named in `without` are not read.
    ///
    /// Errors: an unreadable or empty folder, a damaged file.
    pub fn read(folder: &Path, without: &[String], tell: &dyn Fn(&str)) -> Result<Self> {
        let mut library = Library { statement: String::new(), names: Vec::new(), targets: Vec::new() };
        if folder.join(NAMES_FILE).is_file() {
            library.statement = "MERL via neural fits (Sztrajman et al. 2021)".into();
            for fit in NeuralFits::read(folder)?.materials {
                if !without.contains(&fit.name) {
                    library.targets.push(TargetGrid::of_reflectance(|at, values| fit.evaluate(at, values)));
                    library.names.push(fit.name);
                }
            }
        } else {
            let mut files: Vec<_> = std::fs::read_dir(folder)
                .map_err(|source| Error::reading(folder, source))?
                .filter_map(|entry| entry.ok().map(|entry| entry.path()))
                .filter(|path| path.extension().is_some_and(|extension| extension == "binary"))
                .collect();
            files.sort();
            library.statement = "tables in the layout of MERL".into();
            for path in files {
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                if !without.contains(&name) {
                    tell(&format!("reading {name}"));
                    let table = MeasuredBrdf::read(&path)?;
                    library.targets.push(of_table(&table));
                    library.names.push(name);
                }
            }
        }
        if library.names.is_empty() {
            return Err(Error::new(ErrorKind::Missing, "there is no material to learn from in this folder")
                .at(Place::File(folder.into()))
                .remedy(format!("name a folder with {NAMES_FILE} and its weights, or with .binary tables")));
        }
        Ok(library)
    }

    /// Drops every material that is not named.
    pub fn keep(&mut self, names: &[String]) {
        let (old_names, old_targets) = (std::mem::take(&mut self.names), std::mem::take(&mut self.targets));
        for (name, target) in old_names.into_iter().zip(old_targets) {
            if names.contains(&name) {
                self.names.push(name);
                self.targets.push(target);
            }
        }
    }

    /// One channel of one material, `NAME:red`, three times over: what a flow without codes learns.
    pub fn single(&self, name_and_channel: &str) -> Option<Library> {
        let (name, channel) = name_and_channel.rsplit_once(':')?;
        let channel = ["red", "green", "blue"].iter().position(|own| *own == channel)?;
        let index = self.names.iter().position(|own| own == name)?;
        let target = &self.targets[index][channel];
        Some(Library {
            statement: format!("{}, {name_and_channel} alone", self.statement),
            names: vec![name.into()],
            targets: vec![[target.clone(), target.clone(), target.clone()]],
        })
    }
}

/// The three densities of a table.
pub fn of_table(table: &MeasuredBrdf) -> [TargetGrid; 3] {
    TargetGrid::of_reflectance(|at, values| {
        at.iter().zip(values).for_each(|(at, value)| *value = table.lookup(*at).unwrap_or_default());
    })
}

/// Names to train on when `left_out` are evaluated: `fraction` of the rest, as the paper's code samples it. All that
/// share a category with one left out stay; the others are thinned at random, every category at the same rate. When many
/// are left out together and those of their categories are too many already, all categories are thinned alike.
pub fn subset(names: &[String], left_out: &[String], fraction: f64, seed: u64) -> Vec<String> {
    let rest: Vec<&String> = names.iter().filter(|name| !left_out.contains(name)).collect();
    let wanted = (fraction.clamp(0.0, 1.0) * rest.len() as f64).round() as usize;
    let is_close = |name: &str| left_out.iter().any(|out| Category::of(out) == Category::of(name));
    let (mut close, mut far): (Vec<&String>, Vec<&String>) = rest.iter().partition(|name| is_close(name));
    if close.len() > wanted {
        far.append(&mut close);
    }
    let far_wanted = wanted.saturating_sub(close.len()).min(far.len());
    let mut random = SequentialRandom::new(seed);
    random.shuffle(&mut far);
    // In order of category, every k-th is taken: each category keeps its share to within one.
    far.sort_by_key(|name| Category::of(name));
    let total = far.len().max(1);
    let taken = far
        .iter()
        .enumerate()
        .filter(|(index, _)| (index + 1) * far_wanted / total > index * far_wanted / total)
        .map(|(_, name)| *name);
    let kept: Vec<&String> = close.iter().copied().chain(taken).collect();
    names.iter().filter(|name| kept.contains(name)).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subset_keeps_the_category_of_what_is_left_out() {
        let names: Vec<String> = (0..10)
            .flat_map(|index| [format!("red-{index}-fabric"), format!("x{index}-phenolic"), format!("y{index}-rubber")])
            .collect();
        let left_out = vec![names[0].clone()];
        let kept = subset(&names, &left_out, 0.6, 1);
        let count = |word: &str| kept.iter().filter(|name| name.contains(word)).count();
        assert_eq!(kept.len(), 17);
        assert_eq!((count("fabric"), kept.contains(&left_out[0])), (9, false));
        assert_eq!((count("phenolic"), count("rubber")), (4, 4));
        assert_eq!(kept, subset(&names, &left_out, 0.6, 1));
        assert_ne!(kept, subset(&names, &left_out, 0.6, 2));
        assert_eq!(subset(&names, &left_out, 1.0, 1).len(), 29);
        let many: Vec<String> = names[..6].to_vec();
        assert_eq!(subset(&names, &many, 0.5, 1).len(), 12);
    }

    #[test]
    fn an_empty_folder_is_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Library::read(folder.path(), &[], &|_| {}).unwrap_err().kind(), ErrorKind::Missing);
    }
}
