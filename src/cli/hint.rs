//! What to type in place of what was not understood.

use super::arguments::Arguments;
use crate::export::RunFolder;
use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::path::Path;

/// What to say when a path was typed in place of a command; `None` for other mistakes, which clap explains.
pub fn of(usage: &clap::Error) -> Option<String> {
    if usage.kind() != ErrorKind::InvalidSubcommand {
        return None;
    }
    match usage.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(typed)) => of_path(typed),
        _ => None,
    }
}

/// The same mistake with the nearest command as a suggestion, where clap has none: it does not see that letters have
/// changed places.
pub fn suggested(mut usage: clap::Error) -> clap::Error {
    let typed = match usage.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(typed)) if usage.get(ContextKind::SuggestedSubcommand).is_none() => typed.clone(),
        _ => return usage,
    };
    let program = Arguments::command();
    // The usage names the command whose own command was mistyped.
    let own_usage = |text: &clap::builder::StyledStr| text.to_string().contains("patina [OPTIONS]");
    if !matches!(usage.get(ContextKind::Usage), Some(ContextValue::StyledStr(text)) if own_usage(text)) {
        return usage;
    }
    let names = program.get_subcommands().map(|command| command.get_name().to_string());
    let nearest = names.map(|name| (edits(&typed, &name), name)).min();
    if let Some((_, name)) = nearest.filter(|(edits, name)| *edits <= 2 && edits + 1 < name.len()) {
        usage.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![name]));
    }
    usage
}

/// Letters to insert, leave out, replace or swap with their neighbour to make one word of another (Damerau 1964).
fn edits(from: &str, to: &str) -> usize {
    let (from, to): (Vec<char>, Vec<char>) = (from.chars().collect(), to.chars().collect());
    let mut rows = vec![(0..=to.len()).collect::<Vec<usize>>()];
    for i in 1..=from.len() {
        let mut row = vec![i];
        for j in 1..=to.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(from[i - 1] != to[j - 1]);
            let mut least = replaced.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[from.len()][to.len()]
}

fn of_path(typed: &str) -> Option<String> {
    let path = Path::new(typed);
    let shown = quoted(typed);
    if !path.exists() {
        let is_path = typed.contains(['/', '\\']);
        return is_path.then(|| format!("error: there is no file or folder {shown}, nor is it a command\n{HELP}"));
    }
    let commands = match RunFolder::open(path).is_ok_and(|folder| folder.is_run()) {
        true => [
            ("open it in the window", format!("patina studio {shown}")),
            ("render it under another environment", format!("patina relight {shown} --env noon")),
            ("resume an interrupted fit", format!("patina resume {shown}")),
        ],
        false => [
            ("validate the scene", format!("patina check {shown}")),
            ("fit it, into a new folder in runs", format!("patina fit {shown}")),
            ("open it in the window", format!("patina studio {shown}")),
        ],
    };
    let widest = commands.iter().map(|(_, command)| command.chars().count()).max().unwrap_or_default();
    let lines = commands.iter().map(|(what, command)| format!("  {command:widest$}  {what}\n"));
    Some(format!("error: {shown} is a path, and a command comes first:\n\n{}\n{HELP}", lines.collect::<String>()))
}

const HELP: &str = "For more information, try 'patina --help'.";

/// The path as a shell takes it for one word.
fn quoted(path: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@%=\\~".contains(c);
    if path.chars().all(is_plain) { path.into() } else { format!("'{}'", path.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn mistake(words: &[&str]) -> clap::Error {
        Arguments::try_parse_from([&["patina"], words].concat()).unwrap_err()
    }

    #[test]
    fn a_scene_in_place_of_a_command_is_told_what_can_be_done_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("my scene");
        std::fs::create_dir(&scene).unwrap();
        let scene = scene.to_string_lossy().into_owned();
        let hint = of(&mistake(&[&scene])).unwrap();
        assert!(hint.contains(&format!("patina check '{scene}'")), "{hint}");
        assert!(hint.contains(&format!("patina fit '{scene}'")), "{hint}");
    }

    #[test]
    fn a_run_in_place_of_a_command_is_not_fitted_again() {
        let folder = tempfile::tempdir().unwrap();
        RunFolder::create(folder.path()).unwrap();
        let run = folder.path().to_string_lossy().into_owned();
        let hint = of(&mistake(&["--json", &run])).unwrap();
        assert!(hint.contains(&format!("patina relight {run} --env noon")), "{hint}");
        assert!(!hint.contains("patina fit"), "{hint}");
    }

    #[test]
    fn other_mistakes_are_left_to_the_suggestions() {
        let typo = mistake(&["fti"]);
        assert_eq!(of(&typo), None);
        for (typed, meant) in
            [("fti", "'fit'"), ("rleight", "'relight'"), ("reliht", "'relight'"), ("guied", "'guide'")]
        {
            let answer = suggested(mistake(&[typed])).to_string();
            assert!(answer.contains(meant), "{answer}");
        }
        assert!(!suggested(mistake(&["xyzzy"])).to_string().contains("similar"));
        assert!(!suggested(mistake(&["measured", "dmeo"])).to_string().contains("'demo'"), "not a command of measured");
        assert_eq!(of(&mistake(&["fit"])), None, "a missing scene is no path");
        assert!(of(&mistake(&["no/such/folder"])).unwrap().contains("no file or folder no/such/folder"));
    }

    #[test]
    fn edits_count_swaps_once() {
        let pairs =
            [("fti", "fit", 1), ("", "fit", 3), ("fit", "", 3), ("fit", "fit", 0), ("ca", "abc", 3), ("é", "e", 1)];
        for (from, to, count) in pairs {
            assert_eq!((edits(from, to), edits(to, from)), (count, count), "{from} {to}");
        }
    }

    #[test]
    fn what_a_shell_would_cut_is_quoted() {
        let words = ["a/b-c.d", "a b", "it's", "$x"].map(quoted);
        assert_eq!(words, ["a/b-c.d", "'a b'", r"'it'\''s'", "'$x'"]);
    }
}
