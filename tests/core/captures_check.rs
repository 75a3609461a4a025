//! The whole check on captures beside the project: what spoils each is told, and sound ones are left in peace.

#![allow(clippy::unwrap_used)]

use super::beside::{cases, data};
use patina::scene::doctor::lights::LightKind;
use patina::scene::doctor::{Report, check};
use patina::scene::{ReadSettings, Scene, read};
use std::path::Path;

/// What says that photos do not belong to their cameras, or not to one light.
const DOUBTS: [&str; 7] = [
    "light-in-groups",
    "light-turns-with-camera",
    "photo-turned",
    "photos-disagree",
    "photos-exchanged",
    "photos-of-another-size",
    "photos-shifted",
];

fn checked(folder: &Path, settings: ReadSettings) -> (Scene, Report) {
    let scene = read(folder, &settings).unwrap();
    let report = check(&scene);
    (scene, report)
}

fn codes(report: &Report) -> Vec<&'static str> {
    report.findings.iter().map(|finding| finding.code).collect()
}

#[test]
fn each_small_case_opens_and_tells_what_is_special() {
    let Some(folder) = cases() else { return };
    // Name, what must be told, how many triangles there are at least.
    let expected: [(&str, Option<&str>); 9] = [
        ("tri", None),
        ("saha6", None),
        ("exif6", Some("photo-turned")),
        ("saha_shift1_nomask", Some("photos-shifted")),
        ("double_size", Some("intrinsics-scaled")),
        ("depth_nan", None),
        ("exr_crop", Some("exr-window")),
        ("masks_colmap_names", None),
        ("spike_1e6", Some("mesh-outlier")),
    ];
    for (name, told) in expected {
        let (_, report) = checked(&folder.join(name), ReadSettings { hold_out_every: 0, ..Default::default() });
        let codes = codes(&report);
        assert!(!report.is_fatal(), "{name}: {:#?}", report.findings);
        if let Some(told) = told {
            assert!(codes.contains(&told), "{name}: {told} is not among {codes:?}");
        }
        let doubts: Vec<_> = codes.iter().filter(|code| DOUBTS.contains(code) && Some(**code) != told).collect();
        assert!(doubts.is_empty(), "{name}: {doubts:?}");
    }
}

#[test]
fn a_turntable_is_told_and_captures_under_one_light_are_not() {
    let settings = || ReadSettings { shrink: 4, ..Default::default() };
    if let Some(folder) = data("multilight/head_turntable_bmvs") {
        let (_, report) = checked(&folder, settings());
        let light = report.light.clone().unwrap();
        assert_eq!(light.kind(), LightKind::WithCamera, "{light:?}");
        assert!(codes(&report).contains(&"light-turns-with-camera"));
    }
    for name in ["multilight/head_walk_bmvs", "multiview/saharov_bmvs", "multiview/herzjesu8_bmvs"] {
        let Some(folder) = data(name) else { continue };
        let (_, report) = checked(&folder, settings());
        let light = report.light.clone().unwrap();
        assert_eq!(light.kind(), LightKind::One, "{name}: {light:?}");
    }
}
