//! What comes from disk is what is made, and what is no whole result of this program is made anew.

use super::{Kept, atlas, check, in_folder, pictures, transport};
use crate::atlas::{AtlasSettings, KeepUv, build};
use crate::error::Result;
use crate::job::demo;
use crate::math::random::SequentialRandom;
use crate::render::Surface;
use crate::render::cached::traced::Traced;
use crate::render::cached::visibility::Visibility;
use crate::render::cached::{CachedSettings, CachedTransport};
use crate::scene::demo::DemoSettings;
use crate::scene::{Scene, doctor};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

static GO: AtomicBool = AtomicBool::new(false);
const SMALL: DemoSettings = DemoSettings {
    views: 5,
    held_out: 1,
    width: 40,
    height: 30,
    map_size: 64,
    seed: 1,
    lobe: crate::material::LobeModel::BlinnPhong,
};

fn small_scene() -> Scene {
    demo::scene(&SMALL, &mut Vec::new(), &GO, &|_| {}).unwrap()
}

fn rebuilt() -> AtlasSettings {
    AtlasSettings { resolution_texels: 128, keep_uv: KeepUv::Rebuild, ..AtlasSettings::default() }
}

/// The file of an entry of this kind.
fn file_of(folder: &Path, kind: &str) -> PathBuf {
    let mut files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.find(|path| path.file_name().unwrap().to_string_lossy().starts_with(kind)).unwrap()
}

/// How many results a folder holds.
fn count_in(folder: &Path) -> usize {
    let is_kept = |path: &Path| path.extension().is_some_and(|ending| ending == "kept");
    std::fs::read_dir(folder).unwrap().filter(|entry| is_kept(&entry.as_ref().unwrap().path())).count()
}

/// Damages the file of an entry in many ways, one after another, and has the result computed each time.
fn each_damage(path: &Path, compute: &mut dyn FnMut(&str)) {
    let whole = std::fs::read(path).unwrap();
    let mut random = SequentialRandom::new(3);
    for round in 0..12 {
        let place = (random.next_number() * whole.len() as f32) as usize % whole.len();
        let mut bytes = whole.clone();
        match round % 4 {
            0 => bytes.truncate(place),
            1 => bytes[place] ^= 0x10,
            2 => bytes = bytes.iter().rev().copied().collect(),
            _ => bytes.clear(),
        }
        std::fs::write(path, bytes).unwrap();
        compute(&format!("damage {round} at {place}"));
        assert_eq!(std::fs::read(path).unwrap(), whole, "the damaged entry is replaced");
    }
}

#[test]
fn an_atlas_from_disk_is_the_one_that_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let kept = in_folder(folder.path().into());
    let mesh = small_scene().mesh;
    let told = AtomicUsize::new(0);
    let progress = |_: f32| {
        told.fetch_add(1, Ordering::Relaxed);
    };
    let made = |kept: &Kept, settings: &AtlasSettings| {
        told.store(0, Ordering::Relaxed);
        let atlas = super::atlas(&mesh, settings, kept, &progress).unwrap();
        (format!("{atlas:?}"), told.load(Ordering::Relaxed) == 1)
    };
    let expected = format!("{:?}", build(&mesh, &rebuilt(), &|_| {}).unwrap());
    assert_eq!(made(&Kept::nowhere(), &rebuilt()), (expected.clone(), false));
    assert_eq!(made(&kept, &rebuilt()), (expected.clone(), false));
    assert_eq!(made(&kept, &rebuilt()), (expected.clone(), true), "the second time it is read");
    let wider = AtlasSettings { gutter_texels: 5, ..rebuilt() };
    assert!(made(&kept, &wider).0 != expected, "other settings are another atlas");
    std::fs::remove_file(file_of(folder.path(), atlas::KIND)).unwrap();
    std::fs::remove_file(file_of(folder.path(), atlas::KIND)).unwrap();
    made(&kept, &rebuilt());
    each_damage(&file_of(folder.path(), atlas::KIND), &mut |what| {
        assert_eq!(made(&kept, &rebuilt()), (expected.clone(), false), "{what}");
    });
    let cannot = AtlasSettings { gutter_texels: 1000, ..rebuilt() };
    assert!(super::atlas(&mesh, &cannot, &kept, &progress).is_err(), "an error stays one");
}

#[test]
fn a_check_from_disk_is_the_one_that_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let kept = in_folder(folder.path().into());
    let scene = small_scene();
    let expected = doctor::check(&scene);
    assert!(!expected.findings.is_empty(), "nothing to keep");
    let text = format!("{expected:?}");
    for _ in 0..2 {
        assert_eq!(format!("{:?}", super::check(&scene, &kept, &GO).unwrap()), text);
    }
    let path = file_of(folder.path(), check::KIND);
    each_damage(&path, &mut |what| {
        assert_eq!(format!("{:?}", super::check(&scene, &kept, &GO).unwrap()), text, "{what}");
    });
    // Whatever the check looks at makes another entry.
    let mut others = [(); 4].map(|()| scene.clone());
    others[0].views[1].held_out = true;
    others[1].views[2].camera.focal_pixels.x *= 1.5;
    others[2].mesh.positions[0].x += 0.01;
    let photo = others[3].views[0].photo.to_linear().map(|pixel| *pixel * 1.001);
    others[3].set_photo(0, photo).unwrap();
    for other in &others {
        let own = super::check(other, &kept, &GO).unwrap();
        assert_eq!(format!("{own:?}"), format!("{:?}", doctor::check(other)));
    }
    let entries = std::fs::read_dir(folder.path())
        .unwrap()
        .filter(|entry| entry.as_ref().is_ok_and(|entry| entry.file_name().to_string_lossy().starts_with(check::KIND)));
    assert_eq!(entries.count(), 5);
    let stop = AtomicBool::new(true);
    others[0].name = "stopped".into();
    assert!(super::check(&others[0], &kept, &stop).is_err(), "what was stopped is no verdict");
}

#[test]
fn pictures_from_disk_are_those_that_are_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let kept = in_folder(folder.path().into());
    let expected = format!("{:?}", small_scene());
    let mut rendered = 0;
    let mut scene = |kept: &Kept| {
        let mut scene = crate::scene::demo::build(&SMALL).unwrap().scene;
        let before = rendered;
        super::photograph(&mut scene, &(SMALL, 16), kept, |scene| {
            rendered += 1;
            demo::photograph(scene, 16, SMALL.seed, 1.0, &GO, &|_| {})
        })
        .unwrap();
        (format!("{scene:?}") == expected, rendered - before)
    };
    assert_eq!([scene(&kept), scene(&kept)], [(true, 1), (true, 0)]);
    each_damage(&file_of(folder.path(), pictures::KIND), &mut |what| assert_eq!(scene(&kept), (true, 1), "{what}"));
    let whole = demo::scene_with(&SMALL, &kept, &mut Vec::new(), &GO, &|_| {}).unwrap();
    assert_eq!(format!("{whole:?}"), expected);
    let failed: Result<()> = super::photograph(&mut small_scene(), &"another", &kept, |_| {
        Err(crate::Error::new(crate::ErrorKind::Stopped, ""))
    });
    assert!(failed.is_err(), "a picture that was stopped is not kept");
}

#[test]
fn transport_from_disk_is_the_one_that_is_traced() {
    let folder = tempfile::tempdir().unwrap();
    let kept = in_folder(folder.path().into());
    let surface = Surface::new(small_scene().mesh).unwrap();
    let deep = CachedSettings { grid: 24, bounce_rays: 5, ..CachedSettings::default() };
    let kinds =
        [deep, CachedSettings { max_bounces: 1, ..deep }, CachedSettings { lobe_strength: 0.0, seed: 2, ..deep }];
    let traced = |settings, kept: &Kept| {
        let mut made = super::transport(&surface, settings, (16, 8), kept, &GO).unwrap();
        let seconds = std::mem::take(&mut made.bounce_seconds);
        (format!("{made:?}"), seconds)
    };
    for (which, settings) in kinds.into_iter().enumerate() {
        let (expected, _) = traced(settings, &Kept::nowhere());
        let (first, seconds) = traced(settings, &kept);
        let (again, kept_seconds) = traced(settings, &kept);
        assert!(first == expected && again == expected, "{settings:?}");
        assert!(seconds > 0.0 || settings.max_bounces == 1);
        assert_eq!(kept_seconds, 0.0, "the second time it is read");
        assert_eq!(count_in(folder.path()), which + 1);
    }
    std::fs::remove_dir_all(folder.path()).unwrap();
    let (expected, _) = traced(deep, &kept);
    each_damage(&file_of(folder.path(), transport::KIND), &mut |what| {
        assert_eq!(traced(deep, &kept).0, expected, "{what}");
    });
    assert!(super::transport(&surface, kinds[2], (16, 8), &kept, &AtomicBool::new(true)).is_none());
    assert_eq!(count_in(folder.path()), 1, "what was stopped is not kept");

    let made = CachedTransport::build(&surface, deep, (16, 8), &GO).unwrap();
    let CachedTransport { basis, grid, visibility, bounces, surroundings, .. } = &made;
    let parts = || Traced {
        visibility: visibility.clone(),
        bounces: bounces.clone(),
        surroundings: surroundings.clone(),
        bounce_seconds: 0.0,
    };
    let read = |bytes: &[u8], settings| transport::unpacked(bytes, &settings, (grid, basis)).is_some();
    let body = transport::packed(&parts()).unwrap();
    assert!(read(&body, deep) && !read(&body, kinds[1]) && !read(&[], deep));
    let fewer = Traced { visibility: Visibility { shares: vec![0; 8], ..visibility.clone() }, ..parts() };
    assert!(!read(&transport::packed(&fewer).unwrap(), deep));
    let mut random = SequentialRandom::new(6);
    for _ in 0..300 {
        let place = (random.next_number() * body.len() as f32) as usize % body.len();
        assert!(!read(&body[..place], deep), "cut at {place}");
        let mut changed = body.clone();
        changed[place] = (random.next_number() * 256.0) as u8;
        // Another number may be as good; nothing may panic.
        read(&changed, deep);
    }
}

/// A file with a right checksum that is nonsense all the same, as no build of this program writes it.
#[test]
fn bytes_that_are_no_result_are_none() {
    let scene = small_scene();
    let atlas = build(&scene.mesh, &rebuilt(), &|_| {}).unwrap();
    let report = doctor::check(&scene);
    let bodies =
        [atlas::packed(&atlas).unwrap(), check::packed(&report, &scene).unwrap(), pictures::packed(&scene).unwrap()];
    let read = |which: usize, bytes: &[u8]| match which {
        0 => atlas::unpacked(bytes).map(|atlas| assert!(atlas.mesh.validate().is_ok())).is_some(),
        1 => check::unpacked(bytes, &scene).is_some(),
        _ => pictures::unpacked(bytes, &scene).is_some(),
    };
    let mut random = SequentialRandom::new(5);
    for (which, body) in bodies.iter().enumerate() {
        assert!(read(which, body));
        assert!(!read(which, &[]) && !read((which + 1) % 3, body), "the bytes of another kind");
        for _ in 0..300 {
            let place = (random.next_number() * body.len() as f32) as usize % body.len();
            assert!(!read(which, &body[..place]), "cut at {place}");
            let mut changed = body.clone();
            changed[place] = (random.next_number() * 256.0) as u8;
            // Another number may be as good; nothing may panic.
            read(which, &changed);
        }
        // Sizes that claim more than is there.
        for place in [0, 8, body.len() / 2 / 8 * 8] {
            let mut large = body.clone();
            let end = (place + 8).min(large.len());
            large[place..end].fill(0xff);
            read(which, &large);
        }
    }
}

#[test]
fn a_folder_that_takes_no_files_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, b"in the way").unwrap();
    let kept = in_folder(file.join("cache"));
    let scene = small_scene();
    let expected = build(&scene.mesh, &rebuilt(), &|_| {}).unwrap();
    for _ in 0..2 {
        let made = super::atlas(&scene.mesh, &rebuilt(), &kept, &|_| {}).unwrap();
        assert_eq!(format!("{made:?}"), format!("{expected:?}"));
    }
    assert_eq!(super::check(&scene, &kept, &GO).unwrap(), doctor::check(&scene));
}
