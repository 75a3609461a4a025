//! Which view serves what.

use super::settings::FitSettings;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::scene::Scene;
use std::collections::HashSet;

/// What a view serves in a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViewUse {
    /// Its pixels move numbers.
    Training,
    /// It judges the fit.
    HeldOut,
    /// Neither: the user left it out.
    LeftOut,
}

impl ViewUse {
    /// In two words, for tables.
    pub fn label(self) -> &'static str {
        match self {
            ViewUse::Training => "training",
            ViewUse::HeldOut => "held out",
            ViewUse::LeftOut => "left out",
        }
    }
}

/// What each view of a scene serves when the named ones are left out.
pub fn uses_of(scene: &Scene, exclude: &[String]) -> Vec<ViewUse> {
    let exclude: HashSet<usize> = exclude.iter().filter_map(|name| scene.view_named(name)).collect();
    let of = |(index, view): (usize, &crate::scene::View)| match (exclude.contains(&index), view.held_out) {
        (true, _) => ViewUse::LeftOut,
        (false, true) => ViewUse::HeldOut,
        (false, false) => ViewUse::Training,
    };
    scene.views.iter().enumerate().map(of).collect()
}

/// Indices of the views of a use, rising.
pub fn views_of(uses: &[ViewUse], wanted: ViewUse) -> Vec<usize> {
    (0..uses.len()).filter(|&view| uses[view] == wanted).collect()
}

/// Indices of the training views; an error with a remedy when there is none.
pub(super) fn training_views(uses: &[ViewUse], settings: &FitSettings) -> Result<Vec<usize>> {
    let training = views_of(uses, ViewUse::Training);
    if !training.is_empty() {
        return Ok(training);
    }
    Err(if settings.exclude.is_empty() || !uses.contains(&ViewUse::LeftOut) {
        Error::new(ErrorKind::InvalidScene, "no view is left to fit to")
            .remedy("hold out fewer views: --hold-out-every 0 keeps them all")
    } else {
        Error::new(ErrorKind::InvalidSetting, "no view would be left to fit to")
            .at(Place::Setting("exclude".into()))
            .remedy("keep at least one training photo, or hold out fewer views")
    })
}

/// A warning for each name of a photo to leave out that no photo has.
pub fn unknown_names(scene: &Scene, exclude: &[String]) -> Vec<Finding> {
    let unknown = exclude.iter().filter(|name| scene.view_named(name).is_none());
    unknown
        .map(|name| {
            Finding::new(Severity::Warning, "exclude-unknown", format!("no photo is named {name}: none was left out"))
                .at(Place::Setting("exclude".into()))
                .remedy("names are those of the photos, with or without their ending")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::demo::{DemoSettings, build};

    #[test]
    fn a_photo_goes_by_its_name_and_by_its_files_in_either_form_of_unicode() {
        let mut scene =
            build(&DemoSettings { views: 4, held_out: 1, width: 8, height: 6, map_size: 64, ..Default::default() })
                .unwrap()
                .scene;
        let names = ["caf\u{e9}", "0001", "0001.jpg", "a.b", "z"];
        for (view, name) in scene.views.iter_mut().zip(names) {
            (view.name, view.held_out) = (name.into(), false);
        }
        let left_out = |typed: &str| views_of(&uses_of(&scene, &[typed.to_owned()]), ViewUse::LeftOut);
        assert_eq!(left_out("cafe\u{301}"), [0]);
        assert_eq!(left_out("cafe\u{301}.JPG"), [0]);
        assert_eq!(left_out("0001.png"), [1]);
        assert_eq!(left_out("0001.jpg"), [2], "a name that is one goes first");
        assert_eq!(left_out("a.b.tif"), [3]);
        assert_eq!(left_out("a"), [0; 0]);
        assert_eq!(unknown_names(&scene, &["z.exr".into(), "z.txt".into()]).len(), 1);
    }
}
