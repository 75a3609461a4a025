//! What a message offers to do by a button, where the terminal names a flag: a window has no flags.

use super::Model;
use super::log::{Log, Message};
use crate::error::{Finding, Place};
use crate::fit::suited::Taken;
use crate::insight::report::number;
use crate::job::ask::Ask;

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
    fn setting(label: impl Into<String>, name: &str, value: &str) -> Self {
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

/// A text of the terminal as the window says it: `--map-size` is the setting “Map size”.
pub fn without_flags(text: &str) -> String {
    let mut words = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(place) = rest.find("--") {
        let (before, flag) = rest.split_at(place);
        let name: String = flag[2..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
        let is_flag = !name.is_empty() && before.chars().next_back().is_none_or(|c| c.is_whitespace() || c == '(');
        words += before;
        words += &match is_flag {
            true => format!("“{}”", crate::studio::panel::form::words(name.trim_end_matches('-'))),
            false => flag[..2 + name.len()].to_owned(),
        };
        rest = &flag[2 + name.len()..];
    }
    words + rest
}

impl Model {
    /// Tells what was taken for the scene, with buttons for having it otherwise.
    pub(super) fn tell_taken(&mut self, taken: &[Taken]) {
        for own in taken {
            let (value, label) = (own.otherwise.as_str(), |words: &str| format!("{words} instead"));
            let mut offer = match own.setting {
                "method" => Offer::setting("Use Adam only", own.setting, value),
                "exposure" => Offer::setting("Turn it off", own.setting, value),
                "map-size" => Offer::setting(format!("Use {value} x {value}"), own.setting, value),
                other => Offer::setting(label(&crate::studio::panel::form::words(other)), own.setting, value),
            };
            if own.setting == "map-size"
                && let Some(cost) = value.parse().ok().and_then(|side| self.cost_of_map_size(side))
            {
                offer.label += &format!(" ({cost})");
                offer.help = "Expected of a fit on its defaults, as measured on other scenes".into();
            }
            self.log.add(Message { offers: vec![offer], ..Message::note(own.sentence.clone()) });
        }
    }

    /// What maps of another size will cost more than those that are set, in words; `None` where they cost less.
    pub fn cost_of_map_size(&self, side: usize) -> Option<String> {
        let scene = self.project.as_ref()?.scene.as_ref()?;
        let now = self.edits.fit.map_size;
        if side <= now {
            return None;
        }
        let of = |side| Ask::of_sizes(scene, side);
        let (now, then) = (of(now), of(side));
        let seconds =
            then.expected_seconds(rayon::current_num_threads()) - now.expected_seconds(rayon::current_num_threads());
        let memory = number::memory((then.memory_mib - now.memory_mib) << 20);
        Some(format!("about {} and {memory} more", number::duration(seconds)))
    }

    /// Does what a message offers.
    pub fn take_offer(&mut self, offer: &Offer) {
        let done = match &offer.change {
            Change::Setting(name, value) => {
                let mut tried = self.edits.fit.clone();
                match tried.set(name, value).and_then(|()| tried.validate()) {
                    Ok(()) => self.edits.fit = tried,
                    Err(error) => return self.log.error(&error),
                }
                format!("{} is now {value}", crate::studio::panel::form::words(name))
            }
            Change::Exclude(name) => {
                if !self.edits.fit.exclude.contains(name) {
                    self.edits.fit.exclude.push(name.clone());
                }
                format!("{name} is excluded from the fit")
            }
        };
        self.log.taken(offer);
        self.log.note(match self.fit.status.is_live() {
            true => done,
            false => format!("{done}: it takes effect with the next fit"),
        });
    }
}

impl Log {
    /// What was taken is no longer offered.
    fn taken(&mut self, offer: &Offer) {
        for message in self.messages_mut() {
            message.offers.retain(|own| own.change != offer.change);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Severity;

    #[test]
    fn flags_become_settings_and_dashes_stay() {
        for (text, words) in [
            ("exclude them with --exclude if they do not belong", "exclude them with “Exclude” if they do not belong"),
            ("give a smaller --map-size or --bounces", "give a smaller “Map size” or “Max bounces”"),
            ("--steps", "“Steps”"),
            ("a -- b, c--d", "a -- b, c--d"),
            ("", ""),
        ] {
            assert_eq!(without_flags(text), words);
        }
    }

    #[test]
    fn a_finding_offers_what_its_remedy_names() {
        let found = |remedy: &str| Finding::new(Severity::Warning, "x", "y").at(Place::View("7".into())).remedy(remedy);
        let offers = of_finding(&found("fit a gain for each photo: --exposure"));
        assert_eq!(offers[0].change, Change::Setting("exposure".into(), "true".into()));
        assert_eq!(of_finding(&found("leave it out: --exclude NAME"))[0].change, Change::Exclude("7".into()));
        assert!(of_finding(&found("take another photo")).is_empty());
    }
}
