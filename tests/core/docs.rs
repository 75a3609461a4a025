//! What the documents show can be typed, and what they point at is there.

use clap::Parser;
use clap::error::ErrorKind;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The documents for users and developers, with their texts.
fn documents() -> Vec<(PathBuf, String)> {
    let guide = std::fs::read_dir(root().join("assets/guide")).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<PathBuf> = guide.filter(|path| path.extension().is_some_and(|kind| kind == "md")).collect();
    paths.sort();
    paths.extend(["README.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    paths.into_iter().map(|path| (path.clone(), std::fs::read_to_string(path).unwrap())).collect()
}

/// A piece of code in a document.
#[derive(Clone, Debug, PartialEq)]
struct Code {
    /// Without line breaks.
    text: String,
    /// Whether it is a line of a block, to be typed as it stands; within a sentence a command may only be named.
    is_whole: bool,
}

/// Lines of blocks, and spans within paragraphs.
fn code_of(document: &str) -> Vec<Code> {
    let (mut found, mut paragraph, mut is_block) = (Vec::new(), String::new(), false);
    for line in document.lines().chain([""]) {
        let is_fence = line.trim_start().starts_with("```");
        if is_block && !is_fence {
            let text = line.split(" #").next().unwrap_or_default().trim();
            found.push(Code { text: text.into(), is_whole: true });
        } else if is_fence || line.trim().is_empty() {
            let spans = paragraph.split('`').skip(1).step_by(2);
            // Within a table a bar is written with a stroke before it.
            found.extend(spans.map(|span| Code { text: span.replace("\\|", "|"), is_whole: false }));
            paragraph.clear();
            is_block ^= is_fence;
        } else {
            paragraph += line.trim();
            paragraph.push(' ');
        }
    }
    found
}

/// The commands of `patina` and `patina-lab` that a piece of code stands for, as arguments: the optional part in brackets
/// is left out, and `a|b` is two commands.
fn commands_of(code: &str) -> Vec<Vec<String>> {
    let mut words: Vec<&str> = Vec::new();
    let mut depth = 0;
    for word in code.split_whitespace().filter(|word| *word != "...") {
        depth += word.matches('[').count();
        if depth == 0 {
            words.push(word);
        }
        depth -= word.matches(']').count().min(depth);
    }
    if words.first() == Some(&"cargo") {
        let Some(end) = words.iter().position(|word| *word == "--").filter(|_| words.get(1) == Some(&"run")) else {
            return Vec::new();
        };
        let is_lab = words[..end].windows(2).any(|pair| pair == ["--bin", "patina-lab"]);
        words = [&[if is_lab { "patina-lab" } else { "patina" }][..], &words[end + 1..]].concat();
    }
    if !matches!(words.first(), Some(&("patina" | "patina-lab"))) || words.len() < 2 {
        return Vec::new();
    }
    let mut commands = vec![Vec::new()];
    for word in words {
        let choices = word.split('|').map(str::to_owned);
        let longer =
            choices.flat_map(|choice| commands.iter().map(move |own| [&own[..], &[choice.clone()][..]].concat()));
        commands = longer.collect();
    }
    commands
}

/// Why the program does not take a command, if so. A command that a sentence only names may lack what it needs.
fn refusal(command: &[String], is_whole: bool) -> Option<String> {
    let outcome = match command[0].as_str() {
        "patina" => patina::cli::arguments::Arguments::try_parse_from(command).map(|_| ()),
        _ => patina::lab::cli::arguments::Arguments::try_parse_from(command).map(|_| ()),
    };
    let error = outcome.err()?;
    let is_taken = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => true,
        ErrorKind::MissingRequiredArgument
        | ErrorKind::MissingSubcommand
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => !is_whole,
        // A word in capitals stands for a value.
        ErrorKind::InvalidValue => {
            let value = error.get(clap::error::ContextKind::InvalidValue).map(ToString::to_string).unwrap_or_default();
            !is_whole && value.chars().all(|c| c.is_ascii_uppercase())
        }
        _ => false,
    };
    (!is_taken).then(|| format!("{}: {}", command.join(" "), error.to_string().lines().next().unwrap_or_default()))
}

/// Every command that a document shows, and what is wrong with them.
fn checked(document: &str) -> (usize, Vec<String>) {
    let (mut count, mut wrong) = (0, Vec::new());
    for code in code_of(document) {
        for command in commands_of(&code.text) {
            count += 1;
            wrong.extend(refusal(&command, code.is_whole));
        }
    }
    (count, wrong)
}

#[test]
fn every_command_in_the_documents_is_one() {
    let (mut count, mut wrong) = (0, Vec::new());
    for (path, text) in documents() {
        let (own, refused) = checked(&text);
        count += own;
        wrong.extend(refused.into_iter().map(|line| format!("{}: {line}", path.display())));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 60, "only {count} commands were found");
}

#[test]
fn a_command_that_is_none_is_found() {
    let wrong = |document: &str| checked(document).1.len();
    for good in [
        "`patina fit`",
        "```\npatina fit SCENE -o RUN   # a comment --no-such\n```",
        "`patina guide [TOPIC]`",
        "`cargo run --release --features lab --bin patina-lab -- bench --help`",
        "`patina-lab bench\nhard|cache`",
        "`patina completions SHELL`",
    ] {
        assert_eq!(wrong(good), 0, "{good}: {:?}", checked(good).1);
    }
    for bad in [
        "`patina fit --no-such`",
        "`patina no-such`",
        "```\npatina fit -o RUN\n```",
        "`patina fit SCENE --method no-such`",
        "`patina completions no-such`",
        "`cargo run --release -- demo --no-such`",
        "`patina-lab bench no-such|cache`",
    ] {
        assert_eq!(wrong(bad), 1, "{bad}: {:?}", checked(bad).1);
    }
}

#[test]
fn everything_the_documents_point_at_is_there() {
    let features: toml::Table = std::fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    let features = features["features"].as_table().unwrap();
    let (mut links, mut paths, mut wrong) = (0, 0, Vec::new());
    for (document, text) in documents() {
        let mut missing = |what: &str| wrong.push(format!("{}: {what}", document.display()));
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let target = target.split('#').next().unwrap_or_default();
            if target.is_empty() || target.starts_with("http") {
                continue;
            }
            links += 1;
            if !document.parent().unwrap().join(target).exists() {
                missing(target);
            }
        }
        for code in code_of(&text) {
            let words: Vec<&str> = code.text.split_whitespace().collect();
            for word in &words {
                let is_path =
                    ["src/", "tests/", "assets/", "screenshots/", ".ci/"].iter().any(|top| word.starts_with(top));
                if is_path && !word.contains(['*', '<', '{']) {
                    paths += 1;
                    if !root().join(word.trim_end_matches([',', '.', ':'])).exists() {
                        missing(word);
                    }
                }
            }
            for pair in words.windows(2).filter(|pair| words[0] == "cargo" && pair[0] == "--features") {
                pair[1].split(',').filter(|name| !features.contains_key(*name)).for_each(&mut missing);
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(links >= 10 && paths >= 10, "{links} links and {paths} paths were found");
}
