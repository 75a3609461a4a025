//! `patina guide`.

use super::say;
use crate::error::Result;
use crate::guide::{Topic, plain::plain};
use clap::Args;

/// Options of `patina guide`.
#[derive(Debug, Args)]
pub struct GuideOptions {
    /// The topic, or the beginning of its name; without one, the topics are listed.
    pub topic: Option<String>,
}

/// Longer lines are hard to read, however wide the terminal.
const WIDEST: usize = 100;

/// Prints a topic, or lists all.
pub fn guide(options: &GuideOptions, json: bool) -> Result<()> {
    let text = match &options.topic {
        Some(name) => topic_text(Topic::named(name)?, json),
        None => list(json),
    };
    say::text(&text)
}

fn topic_text(topic: Topic, json: bool) -> String {
    if json {
        let line = serde_json::json!({
            "event": "guide", "topic": topic.slug(), "title": topic.title(), "markdown": topic.text(),
        });
        return format!("{line}\n");
    }
    let width = terminal_size::terminal_size().map_or(WIDEST, |(width, _)| usize::from(width.0).min(WIDEST));
    plain(topic.text(), width)
}

fn list(json: bool) -> String {
    if json {
        let topics = Topic::ALL.map(
            |topic| serde_json::json!({"topic": topic.slug(), "title": topic.title(), "summary": topic.summary()}),
        );
        return format!("{}\n", serde_json::json!({"event": "guide", "topics": topics}));
    }
    let width = Topic::ALL.iter().map(|topic| topic.slug().len()).max().unwrap_or_default();
    let lines = Topic::ALL.map(|topic| format!("  {:width$}  {}\n", topic.slug(), topic.summary()));
    format!("Topics of the guide:\n\n{}\nRead one with `patina guide TOPIC`.\n", lines.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::arguments::Arguments;
    use clap::CommandFactory;

    /// Commands of the program in a text: what stands after `patina ` inside a line of code, up to its end.
    fn commands_of(text: &str) -> Vec<Vec<String>> {
        let mut found = Vec::new();
        let mut in_block = false;
        for line in text.lines() {
            if line.starts_with("```") {
                in_block = !in_block;
            } else if in_block {
                found.push(line.split('#').next().unwrap_or_default().to_string());
            }
        }
        // Code within lines may be wrapped: every second piece between backquotes is code.
        let prose: Vec<&str> = text.split("```").step_by(2).collect();
        for piece in prose {
            found.extend(piece.split('`').skip(1).step_by(2).map(|code| code.replace(['\n', '\r'], " ")));
        }
        let words = |code: String| code.split_whitespace().map(str::to_string).collect::<Vec<_>>();
        found.into_iter().map(words).filter(|words| words.first().is_some_and(|word| word == "patina")).collect()
    }

    /// Why a command is none of the program's, if so. Names in capitals and paths stand for what a user puts there.
    fn objection(words: &[String]) -> Option<String> {
        let mut program = Arguments::command();
        program.build();
        let mut command = &program;
        for (place, word) in words.iter().enumerate().skip(1) {
            let word = word.trim_matches(['[', ']', ',', '.', ';', ':', '(', ')']);
            if let Some(option) = word.strip_prefix("--") {
                let option = option.split('=').next().unwrap_or_default();
                let known = |argument: &clap::Arg| {
                    let aliases = argument.get_all_aliases().unwrap_or_default();
                    argument.get_long() == Some(option) || aliases.contains(&option)
                };
                if option != "help" && !command.get_arguments().any(known) {
                    return Some(format!("{} has no --{option}", command.get_name()));
                }
            } else if let Some(inner) = command.find_subcommand(word) {
                command = inner;
            } else if command.has_subcommands() && !word.starts_with('-') {
                let is_placeholder = word.chars().all(|c| c.is_uppercase() || !c.is_alphabetic());
                if place == 1 && is_placeholder {
                    return None;
                }
                return Some(format!("{} has no command {word}", command.get_name()));
            }
        }
        None
    }

    #[test]
    fn every_command_that_the_docs_name_exists_with_its_options() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
        let mut texts = vec![("README", read("README.md")), ("changelog", read("CHANGELOG.md"))];
        texts.push(("contributing", read("CONTRIBUTING.md")));
        texts.extend(Topic::ALL.map(|topic| (topic.slug(), topic.text().to_string())));
        let mut asked = 0;
        for (name, text) in &texts {
            for words in commands_of(text) {
                asked += 1;
                assert_eq!(objection(&words), None, "{name}: {}", words.join(" "));
            }
        }
        assert!(asked > 40, "only {asked} commands were found");
        assert!(read("README.md").len() <= 8_000, "the README is for five minutes; the rest is for the guide");
        let wrong = |line: &str| objection(&line.split(' ').map(str::to_string).collect::<Vec<_>>()).is_some();
        assert!(wrong("patina fti SCENE") && wrong("patina fit SCENE --map-sise 3") && wrong("patina measured shwo X"));
        assert!(!wrong("patina fit SCENE --shrink 2") && !wrong("patina gauge RUN --factor 2"));
    }

    #[test]
    fn all_topics_are_listed_and_a_json_line_is_one() {
        let listed = list(false);
        assert!(Topic::ALL.iter().all(|topic| listed.contains(topic.slug()) && listed.contains(topic.summary())));
        let line = topic_text(Topic::Limits, true);
        let value: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!((line.lines().count(), value["topic"].as_str()), (1, Some("limits")));
        assert!(value["markdown"].as_str().unwrap().starts_with("# "));
    }
}
