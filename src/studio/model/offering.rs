//! What is taken for a scene is offered otherwise, and what a message offers is done.

use super::log::Message;
use super::offers::{Change, Offer};
use super::{Model, words};
use crate::fit::suited::Taken;
use crate::insight::report::number;
use crate::job::ask::Ask;

impl Model {
    /// Tells what was taken for the scene, with buttons for having it otherwise.
    pub(super) fn tell_taken(&mut self, taken: &[Taken]) {
        for own in taken {
            let (value, label) = (own.otherwise.as_str(), |words: &str| format!("{words} instead"));
            let mut offer = match own.setting {
                "method" => Offer::setting("Use Adam only", own.setting, value),
                "exposure" => Offer::setting("Turn it off", own.setting, value),
                "map-size" => Offer::setting(format!("Use {value} x {value}"), own.setting, value),
                other => Offer::setting(label(&words::of_setting(other)), own.setting, value),
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
                format!("{} is now {value}", words::of_setting(name))
            }
            Change::Exclude(name) => {
                if !self.edits.fit.exclude.contains(name) {
                    self.edits.fit.exclude.push(name.clone());
                }
                format!("{name} is excluded from the fit")
            }
        };
        self.log.no_longer_offers(&offer.change);
        self.log.note(match self.fit.status.is_live() {
            true => done,
            false => format!("{done}: it takes effect with the next fit"),
        });
    }
}
