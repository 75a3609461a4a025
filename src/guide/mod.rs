//! The guide: one text for three readers.
//!
//! Each topic is a Markdown file under `assets/guide`. The terminal prints it (`patina guide TOPIC`, through
//! [`plain`]), the window shows it under **Help** ([`Topic::ALL`], [`Topic::title`], [`Topic::text`]), and the modules
//! below are the same text for `cargo doc`.
//!
//! What it refuses to do: say anything that is not in those files.

pub mod plain;

use crate::error::{Error, ErrorKind, Result};

#[doc = include_str!("../../assets/guide/capture.md")]
pub mod capture {}
#[doc = include_str!("../../assets/guide/file-formats.md")]
pub mod file_formats {}
#[doc = include_str!("../../assets/guide/window.md")]
pub mod window {}
#[doc = include_str!("../../assets/guide/object-mode.md")]
pub mod object_mode {}
#[doc = include_str!("../../assets/guide/objective.md")]
pub mod objective {}
#[doc = include_str!("../../assets/guide/benchmarks.md")]
pub mod benchmarks {}
#[doc = include_str!("../../assets/guide/export-and-run-folder.md")]
pub mod export_and_run_folder {}
#[doc = include_str!("../../assets/guide/many-captures.md")]
pub mod many_captures {}
#[doc = include_str!("../../assets/guide/limits.md")]
pub mod limits {}

/// A topic of the guide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Topic {
    /// How to photograph a scene, and what a fit needs of it.
    Capture,
    /// Which scenes, photos, meshes and environments are read.
    FileFormats,
    /// The window: panels, keys, first steps.
    Window,
    /// Reflectance and environment from photos of a single object.
    ObjectMode,
    /// What a fit minimises, with a table of symbols.
    Objective,
    /// What was measured, with the commands that measure it.
    Benchmarks,
    /// The files of a run and how other programs read them.
    ExportAndRunFolder,
    /// A workflow for hundreds of captures, on one machine or a cluster.
    ManyCaptures,
    /// What it does not do.
    Limits,
}

impl Topic {
    /// All topics, in the order in which they are read.
    pub const ALL: [Topic; 9] = [
        Topic::Capture,
        Topic::FileFormats,
        Topic::Window,
        Topic::ObjectMode,
        Topic::Objective,
        Topic::ExportAndRunFolder,
        Topic::ManyCaptures,
        Topic::Benchmarks,
        Topic::Limits,
    ];

    /// Its name on the command line, in lower case with hyphens.
    pub fn slug(self) -> &'static str {
        match self {
            Topic::Capture => "capture",
            Topic::FileFormats => "file-formats",
            Topic::Window => "window",
            Topic::ObjectMode => "object-mode",
            Topic::Objective => "objective",
            Topic::Benchmarks => "benchmarks",
            Topic::ExportAndRunFolder => "export-and-run-folder",
            Topic::ManyCaptures => "many-captures",
            Topic::Limits => "limits",
        }
    }

    /// Its heading: the first line of its text.
    pub fn title(self) -> &'static str {
        self.text().lines().next().unwrap_or_default().trim_start_matches('#').trim()
    }

    /// One line on what it says, without a full stop.
    pub fn summary(self) -> &'static str {
        match self {
            Topic::Capture => "how to photograph a scene, and what a fit needs of it",
            Topic::FileFormats => "which scenes, photos, meshes and environments are read",
            Topic::Window => "panels, keys, the first five minutes",
            Topic::ObjectMode => "reflectance and environment from photos of a single object",
            Topic::Objective => "what a fit minimises, with a table of symbols",
            Topic::Benchmarks => "what was measured, with the commands that measure it",
            Topic::ExportAndRunFolder => "the files of a run, and how other programs read them",
            Topic::ManyCaptures => "a workflow for hundreds of captures, on one machine or a cluster",
            Topic::Limits => "what it does not do, and where it is wrong",
        }
    }

    /// Its text: Markdown with headings, lists, tables, fenced code and no pictures.
    pub fn text(self) -> &'static str {
        match self {
            Topic::Capture => include_str!("../../assets/guide/capture.md"),
            Topic::FileFormats => include_str!("../../assets/guide/file-formats.md"),
            Topic::Window => include_str!("../../assets/guide/window.md"),
            Topic::ObjectMode => include_str!("../../assets/guide/object-mode.md"),
            Topic::Objective => include_str!("../../assets/guide/objective.md"),
            Topic::Benchmarks => include_str!("../../assets/guide/benchmarks.md"),
            Topic::ExportAndRunFolder => include_str!("../../assets/guide/export-and-run-folder.md"),
            Topic::ManyCaptures => include_str!("../../assets/guide/many-captures.md"),
            Topic::Limits => include_str!("../../assets/guide/limits.md"),
        }
    }

    /// The topic of a name: its slug or title in any case, or the beginning of one slug.
    ///
    /// # Errors
    /// `InvalidSetting` when no topic, or more than one, is meant; the remedy names all topics.
    pub fn named(name: &str) -> Result<Topic> {
        let wanted = name.trim().to_lowercase().replace([' ', '_'], "-");
        let wanted = wanted.trim_end_matches(".md");
        if let Some(exact) = Topic::ALL.into_iter().find(|topic| topic.slug() == wanted) {
            return Ok(exact);
        }
        let titled = |topic: &Topic| topic.title().to_lowercase().replace(' ', "-") == wanted;
        let begins = |topic: &Topic| !wanted.is_empty() && topic.slug().starts_with(wanted);
        let mut meant = Topic::ALL.into_iter().filter(|topic| titled(topic) || begins(topic));
        match (meant.next(), meant.next()) {
            (Some(topic), None) => Ok(topic),
            (first, _) => {
                let many = if first.is_some() { "more than one topic" } else { "no topic" };
                let topics = Topic::ALL.map(Topic::slug).join(", ");
                Err(Error::new(ErrorKind::InvalidSetting, format!("the guide has {many} named '{name}'"))
                    .remedy(format!("topics are {topics}")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_found_by_slug_title_and_beginning_and_others_are_refused_with_the_list() {
        for topic in Topic::ALL {
            assert_eq!(Topic::named(topic.slug()).unwrap(), topic);
            assert_eq!(Topic::named(&topic.title().to_uppercase()).unwrap(), topic);
        }
        assert_eq!(Topic::named("export").unwrap(), Topic::ExportAndRunFolder);
        assert_eq!(Topic::named("File_Formats").unwrap(), Topic::FileFormats);
        // "obj" begins two slugs.
        for wrong in ["obj", "", "light", "captured"] {
            let error = Topic::named(wrong).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidSetting);
            assert!(Topic::ALL.iter().all(|topic| error.remedy_text().contains(topic.slug())), "{error}");
        }
    }

    #[test]
    fn every_text_begins_with_its_heading_and_suits_all_three_readers() {
        for topic in Topic::ALL {
            let text = topic.text();
            assert!(text.starts_with("# ") && topic.title().len() > 3, "{topic:?}");
            assert!(topic.summary().split_whitespace().count() > 3 && !topic.summary().ends_with('.'));
            assert!(text.lines().skip(1).all(|line| !line.starts_with("# ")), "{topic:?} has two titles");
            assert!(!text.contains("!["), "{topic:?}: a terminal shows no pictures");
            let opened = text.lines().filter(|line| line.starts_with("```"));
            // A block without a language would be compiled as a test by rustdoc.
            let untagged = opened.step_by(2).filter(|line| line.trim() == "```").count();
            assert_eq!(untagged, 0, "{topic:?}: name the language of each block");
        }
    }
}
