//! What a message offers to do by a button, where the terminal names a flag: a window has no flags.

use crate::error::{Finding, Place};

/// A setting that a message offers to change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// What its button says.
    pub label: String,
    /// What else there is to know of it; may be empty.
    pub help: String,
    /// What it does.
    pub change: Change,
}

/// What an offer does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// Gives a setting of the fit, by its name, a value.
    Setting(String, String),
    /// Leaves a photo out of the fit.
    Exclude(String),
}

impl Offer {
    pub(super) fn setting(label: impl Into<String>, name: &str, value: &str) -> Self {
        Offer { label: label.into(), help: String::new(), change: Change::Setting(name.into(), value.into()) }
    }
}

/// What a finding offers.
pub fn of_finding(finding: &Finding) -> Vec<Offer> {
    let asks_for = |flag: &str| finding.remedy.contains(flag);
    let mut offers = Vec::new();
    if asks_for("--exposure") {
        offers.push(Offer::setting("Turn exposure compensation on", "exposure", "true"));
    }
    if asks_for("--lobe ggx") {
        offers.push(Offer::setting("Fit GGX lobes", "lobe", "ggx"));
    }
    if let (true, Place::View(name)) = (asks_for("--exclude"), &finding.target) {
        let label = format!("Exclude {name}");
        offers.push(Offer { label, help: String::new(), change: Change::Exclude(name.clone()) });
    }
    offers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Severity;

    #[test]
    fn a_finding_offers_what_its_remedy_names() {
        let found = |remedy: &str| Finding::new(Severity::Warning, "x", "y").at(Place::View("7".into())).remedy(remedy);
        let offers = of_finding(&found("fit a gain for each photo: --exposure"));
        assert_eq!(offers[0].change, Change::Setting("exposure".into(), "true".into()));
        assert_eq!(of_finding(&found("leave it out: --exclude NAME"))[0].change, Change::Exclude("7".into()));
        assert!(of_finding(&found("take another photo")).is_empty());
    }
}
