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
    let exclude: HashSet<&str> = exclude.iter().map(String::as_str).collect();
    let of = |view: &crate::scene::View| match (exclude.contains(view.name.as_str()), view.held_out) {
        (true, _) => ViewUse::LeftOut,
        (false, true) => ViewUse::HeldOut,
        (false, false) => ViewUse::Training,
    };
    scene.views.iter().map(of).collect()
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
    let known: HashSet<&str> = scene.views.iter().map(|view| view.name.as_str()).collect();
    let unknown = exclude.iter().filter(|name| !known.contains(name.as_str()));
    unknown
        .map(|name| {
            Finding::new(Severity::Warning, "exclude-unknown", format!("no photo is named {name}: none was left out"))
                .at(Place::Setting("exclude".into()))
                .remedy("names are those of the photos without their ending")
        })
        .collect()
}
