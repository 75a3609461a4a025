//! Every option that a message names is known to the commands that print it.

#![allow(clippy::unwrap_used)]

use clap::CommandFactory;
use patina::cli::arguments::Arguments;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Options of a command and of those below it, by their long names.
fn options_of(command: &clap::Command, into: &mut BTreeSet<String>) {
    into.extend(command.get_arguments().filter_map(|argument| argument.get_long()).map(str::to_owned));
    for argument in command.get_arguments() {
        into.extend(argument.get_all_aliases().unwrap_or_default().into_iter().map(str::to_owned));
    }
    command.get_subcommands().for_each(|below| options_of(below, into));
}

fn options(names: &[&str]) -> BTreeSet<String> {
    let mut whole = Arguments::command();
    whole.build();
    let mut known: BTreeSet<String> = ["help", "version", "json", "threads"].map(String::from).into();
    match names {
        [] => options_of(&whole, &mut known),
        names => names.iter().for_each(|name| options_of(whole.find_subcommand(name).unwrap(), &mut known)),
    }
    known
}

/// Which commands print what is written in a file of the sources; all where several do.
fn commands_of(path: &str) -> &'static [&'static [&'static str]] {
    match path {
        // What a reader or the check says is printed by both.
        path if path.starts_with("scene/read") || path.starts_with("scene/doctor") => &[&["check"], &["fit"]],
        path if path.starts_with("atlas/") || path.starts_with("fit/") => &[&["fit"]],
        _ => &[&[]],
    }
}

/// Options named in the string literals of a source, with the line of each.
fn named_in(source: &str) -> Vec<(usize, String)> {
    let mut named = Vec::new();
    let code = source.split("#[cfg(test)]").next().unwrap_or_default();
    for (index, line) in code.lines().enumerate() {
        if line.trim_start().starts_with("//") {
            continue;
        }
        let mut rest = line;
        while let Some(place) = rest.find("--") {
            let before = rest[..place].chars().next_back();
            rest = &rest[place + 2..];
            let name: String = rest.chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
            let starts = before.is_none_or(|c| !c.is_alphanumeric() && c != '-');
            // `--steps-` followed by a placeholder is a name that is put together.
            let is_whole = !name.ends_with('-') && !rest[name.len()..].starts_with('{');
            if starts && is_whole && name.len() > 1 {
                named.push((index + 1, name));
            }
        }
    }
    named
}

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            into.push(path);
        }
    }
}

#[test]
fn every_option_that_a_message_names_is_known_to_the_command_that_prints_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for file in files {
        let path = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        // Other programs that are measured against and tests have options of their own, pages have styles.
        let others = ["lab/", "job/export.rs", "job/export/sheets.rs", "insight/report/"];
        if others.iter().any(|other| path.starts_with(other)) || path.contains("/bench/") || path.ends_with("tests.rs")
        {
            continue;
        }
        for (line, name) in named_in(&std::fs::read_to_string(&file).unwrap()) {
            seen += 1;
            for commands in commands_of(&path) {
                if !options(commands).contains(&name) {
                    wrong.push(format!("{path}:{line}: --{name} is no option of {commands:?}"));
                }
            }
        }
    }
    assert!(seen > 20, "{seen}: the search itself is broken");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_setting_that_an_error_names_is_an_option() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let known = options(&[]);
    let mut seen = 0;
    for file in files {
        let path = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        if path.starts_with("lab/") {
            continue;
        }
        let source = std::fs::read_to_string(&file).unwrap();
        let code = source.split("#[cfg(test)]").next().unwrap_or_default();
        for part in code.split("Place::Setting(\"").skip(1) {
            let name = part.split('"').next().unwrap();
            seen += 1;
            assert!(known.contains(name), "{path}: setting --{name} is no option");
        }
    }
    assert!(seen > 10, "{seen}: the search itself is broken");
}
