//! The guide and the completions as a shell meets them: whole texts, wrong topics, a reader that has gone.

#![allow(clippy::unwrap_used)]

use std::process::{Output, Stdio};

fn patina(words: &[&str]) -> Output {
    super::program::patina().args(words).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn topics_are_printed_and_a_wrong_one_names_them_all() {
    let listed = patina(&["guide"]);
    assert!(listed.status.success());
    for topic in patina::guide::Topic::ALL {
        assert!(text(&listed.stdout).contains(topic.slug()));
        let shown = patina(&["guide", topic.slug()]);
        assert!(shown.status.success() && text(&shown.stdout).starts_with(topic.title()));
    }
    let wrong = patina(&["guide", "no-such"]);
    assert_eq!(wrong.status.code(), Some(1));
    assert!(wrong.stdout.is_empty() && text(&wrong.stderr).contains("file-formats"), "{wrong:?}");
}

/// What `patina guide | head` leaves the program with: an output that nobody reads.
#[test]
fn a_closed_pipe_is_no_panic() {
    for words in [["guide", "benchmarks"].as_slice(), &["guide"], &["completions", "zsh"], &["fit", "--help"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let child = super::program::patina().args(words).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
        let ended = child.wait_with_output().unwrap();
        assert_eq!((ended.status.code(), text(&ended.stderr)), (Some(0), String::new()), "{words:?}");
    }
}

#[test]
fn completions_know_commands_and_options_of_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = patina(&["completions", shell]);
        let script = text(&script.stdout);
        for word in ["relight", "map-size", "guide"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(patina(&["completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn mistakes_are_answered_with_what_was_meant() {
    let typo = patina(&["fti"]);
    assert_eq!(typo.status.code(), Some(2));
    assert!(text(&typo.stderr).contains("'fit'"), "{typo:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_string_lossy().into_owned();
    let scene = patina(&[&path]);
    assert_eq!(scene.status.code(), Some(2));
    assert!(text(&scene.stderr).contains(&format!("patina check {path}")), "{scene:?}");
    assert!(text(&scene.stderr).contains(&format!("patina fit {path} ")), "{scene:?}");
}
