//! `patina fit --maps` and `--seconds` as they are typed: what is written, what goes on, what is refused.

#![allow(clippy::unwrap_used, clippy::disallowed_methods)]

use super::program::patina;
use super::scene_fixture::*;
use patina::export::RunFolder;
use std::path::Path;
use std::process::Output;

/// Options of a fit that takes a moment.
const SHORT: [&str; 6] = ["--solver-rounds", "2", "--solver-refine", "0", "--solver-grid", "32"];

fn fit(scene: &Path, run: &Path, more: &[&str]) -> Output {
    patina().arg("fit").arg(scene).arg("-o").arg(run).args(SHORT).args(more).output().unwrap()
}

fn words(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

#[test]
fn maps_are_kept_to_the_bit_and_a_fit_without_time_leaves_a_whole_run() {
    let (_keep, folder) = folder();
    let [place, first, second, third] = ["scene", "first", "second", "third"].map(|name| folder.join(name));
    write_blended_mvs(&place, &scene(4), &FolderStyle::default());
    // No time at all: whatever is there is a result, and what is left is done later.
    let cut = fit(&place, &first, &["--map-size", "128", "--seconds", "0.001"]);
    assert_eq!(cut.status.code(), Some(0), "{}", words(&cut));
    assert!(words(&cut).contains("ended-by-budget") && words(&cut).contains("patina resume"), "{}", words(&cut));
    let before = RunFolder::open(&first).unwrap().read_result().unwrap();
    assert_eq!(before.maps.diffuse.width(), 128);
    let resumed = patina().arg("resume").arg(&first).output().unwrap();
    assert_eq!(resumed.status.code(), Some(0), "{}", words(&resumed));
    assert!(!words(&resumed).contains("ended-by-budget"), "{}", words(&resumed));
    let maps = RunFolder::open(&first).unwrap().read_result().unwrap();
    assert_ne!(maps.maps, before.maps);

    // The same maps under a light that is sought anew, by a fit that is taken up.
    let kept = fit(&place, &second, &["--maps", first.to_str().unwrap(), "--seconds", "0.001"]);
    assert_eq!(kept.status.code(), Some(0), "{}", words(&kept));
    let resumed = patina().arg("resume").arg(&second).output().unwrap();
    assert_eq!(resumed.status.code(), Some(0), "{}", words(&resumed));
    let again = RunFolder::open(&second).unwrap().read_result().unwrap();
    assert_eq!((&again.maps, &again.mesh, &again.times_seen), (&maps.maps, &maps.mesh, &maps.times_seen));
    assert_ne!(again.environment, maps.environment);
    let whole = fit(&place, &third, &["--maps", first.to_str().unwrap()]);
    assert_eq!(whole.status.code(), Some(0), "{}", words(&whole));
    assert_eq!(RunFolder::open(&third).unwrap().read_result().unwrap(), again, "taken up or not");
    for (more, named) in [
        (["--fixed-light"].as_slice(), "--fixed-light"),
        (&["--method", "paper"], "--method"),
        (&["--map-size", "64"], "--map-size"),
    ] {
        let refused = fit(&place, &third, &[&["--maps", first.to_str().unwrap()], more].concat());
        assert_eq!(refused.status.code(), Some(1), "{more:?}: {}", words(&refused));
        assert!(words(&refused).contains(named), "{more:?}: {}", words(&refused));
    }
    let refused = fit(&place, &third, &["--maps", folder.join("nothing").to_str().unwrap()]);
    assert!(words(&refused).contains("no such run folder"), "{}", words(&refused));
    for wrong in ["0", "-3", "soon", "nan"] {
        let refused = fit(&place, &third, &[&format!("--seconds={wrong}")]);
        assert_eq!(refused.status.code(), Some(2), "{wrong}: {}", words(&refused));
    }
}
