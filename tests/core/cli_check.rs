//! The page of `patina check`, as a person and as a program reads it.

#![allow(clippy::unwrap_used)]

use super::scene_fixture::*;
use patina::image::file;

#[test]
fn a_page_says_what_was_understood_and_a_sheet_shows_it() {
    let (_keep, folder) = folder();
    write_blended_mvs(&folder, &scene(8), &FolderStyle::default());
    let output = folder.with_file_name("outlines");
    let run = |words: &[&str]| {
        let mut command = super::program::patina();
        command.args(words).arg("check").arg(&folder).arg("-o").arg(&output);
        let ended = command.output().unwrap();
        assert!(ended.status.success(), "{ended:?}");
        String::from_utf8(ended.stdout).unwrap()
    };
    let page = run(&[]);
    for line in [
        "format",
        "mesh",
        "frames",
        "cameras",
        "photos",
        "lens",
        "colour",
        "masks",
        "background",
        "up",
        "scale",
        "detail",
        "agreement",
        "light",
        "needs",
        "findings",
    ] {
        let wanted = format!("\n{line:12}");
        assert!(page.contains(&wanted), "no {line} in\n{page}");
    }
    assert!(page.contains("BlendedMVS") && page.contains("8 views, 1 of them held out"), "{page}");
    assert!(page.contains("without distortion") && page.contains("masks       for all views"), "{page}");

    // Eight photos of 128 x 96 in a table of four columns; the held-out one has an orange frame.
    let sheet = file::read_srgb8(&output.join("contact_sheet.png")).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (4 * (SIZE.0 + 12), 2 * (SIZE.1 + 12)));
    assert_eq!(sheet[(4, 20)], [255, 170, 0]);
    assert_eq!(sheet[(4, SIZE.0 + 12 + 20)], [32, 32, 32]);
    let silhouette = sheet.pixels().iter().filter(|pixel| **pixel == [255, 0, 200]).count();
    assert!(silhouette > 8 * 40, "{silhouette}: outlines are drawn");

    let told: serde_json::Value = serde_json::from_str(run(&["--json"]).lines().next().unwrap()).unwrap();
    assert_eq!(told["understood"]["views"], 8);
    assert_eq!(told["understood"]["frames"], "shared");
    assert!(told["ask"]["memory_mib"].as_u64().unwrap() > 300, "{}", told["ask"]);
    assert!(told["ask"]["processor_seconds"].as_u64().unwrap() > 60, "{}", told["ask"]);
}
