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

/// Which commands print what is written in a file of the sources: each must know the option; `None` where the message itself
/// must name the commands, since some of those that print it have no options of the kind.
fn commands_of(path: &str) -> Option<&'static [&'static [&'static str]]> {
    let is_below = |folders: &[&str]| folders.iter().any(|folder| path.starts_with(folder));
    match path {
        // Pictures, meshes and lights are read by every command.
        _ if is_below(&["image/", "light/", "math/", "files.rs", "error.rs"]) => None,
        _ if is_below(&[
            "scene/read/mesh_file",
            "scene/read/obj",
            "scene/read/ply",
            "scene/read/gltf",
            "scene/read/stl",
        ]) =>
        {
            None
        }
        // What a reader or the check says is printed by all that read scenes.
        _ if is_below(&["scene/"]) => Some(&[&["check"], &["fit"], &["render"], &["compare"], &["relight"]]),
        _ if is_below(&["object/"]) => Some(&[&["object"]]),
        _ if is_below(&["export/", "job/export"]) => Some(&[&["export"]]),
        _ if is_below(&["atlas/", "fit/", "job/known_maps", "job/budget"]) => Some(&[&["fit"]]),
        _ => Some(&[&[]]),
    }
}

/// The commands that a message names as `patina NAME`, in a line or its neighbours: what is written as one string.
fn commands_named_at(source: &str, line: usize) -> Vec<String> {
    let near: Vec<&str> = source.lines().skip(line.saturating_sub(3)).take(5).collect();
    let near = near.join(" ");
    let after = near.split("`patina ").skip(1);
    after.map(|rest| rest.chars().take_while(char::is_ascii_lowercase).collect()).collect()
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
        let source = std::fs::read_to_string(&file).unwrap();
        for (line, name) in named_in(&source) {
            seen += 1;
            let named = commands_named_at(&source, line);
            let named: Vec<[&str; 1]> = named.iter().map(|name| [name.as_str()]).collect();
            let named: Vec<&[&str]> = named.iter().map(|name| &name[..]).collect();
            let known: Option<&[&[&str]]> = commands_of(&path);
            if known.is_none() && named.is_empty() {
                wrong.push(format!("{path}:{line}: --{name} is named without the commands that have it"));
            }
            for commands in known.unwrap_or(&named[..]) {
                if !options(commands).contains(&name) {
                    wrong.push(format!("{path}:{line}: --{name} is no option of {commands:?}"));
                }
            }
        }
    }
    assert!(seen > 20, "{seen}: the search itself is broken");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A remedy that names scene.toml is of no use to folders that have none.
#[test]
fn only_what_is_said_of_a_scene_with_a_manifest_names_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut seen = 0;
    for file in files {
        let path = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        let source = std::fs::read_to_string(&file).unwrap();
        let code = source.split("#[cfg(test)]").next().unwrap_or_default();
        // Files that make one, list the kinds of scenes, or read one.
        let others = ["lab/", "studio/", "scene/read/manifest.rs", "scene/read/detect.rs", "job/capture_folder.rs"];
        if others.iter().any(|other| path.starts_with(other)) {
            continue;
        }
        let is_said = |line: &&str| line.contains("in scene.toml") && !line.trim_start().starts_with("//");
        let count = code.lines().filter(is_said).count();
        seen += count;
        assert!(count == 0 || code.contains("has_manifest()"), "{path} names scene.toml whatever the scene");
    }
    assert!(seen > 3, "{seen}: the search itself is broken");
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
