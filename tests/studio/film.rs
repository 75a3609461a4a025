//! A film strip of opening a scene and of one fit: pictures to look at, and when each thing was there first.

use super::adapter::{has_adapter, rendered};
use super::support::{TestStudio, finished_run};
use egui_kittest::Harness;
use patina::studio::act::Act;
use patina::studio::model::{FitStatus, Model};
use patina::studio::workspace::Panel;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Seconds after opening, and after the start of the fit, at which a picture is taken.
const AT_SECONDS: [f64; 7] = [1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0];
/// A fit that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(1800);

/// What is waited for, and when it came.
type Milestone = (&'static str, fn(&Model) -> bool);

struct Film {
    studio: TestStudio,
    folder: PathBuf,
    began: Instant,
    told: Vec<(String, f64)>,
}

impl Film {
    fn shot(&mut self, name: &str) {
        let picture = self.studio.harness.render().unwrap();
        picture.save(self.folder.join(format!("{name}.png"))).unwrap();
    }

    /// Frames until something is so, with pictures on the way.
    fn run(&mut self, what: &str, milestones: &[Milestone], is_over: impl Fn(&Model) -> bool) {
        self.began = Instant::now();
        let (mut next, mut seen) = (0, vec![false; milestones.len()]);
        loop {
            self.studio.harness.step();
            let seconds = self.began.elapsed().as_secs_f64();
            for (seen, (name, is_there)) in seen.iter_mut().zip(milestones) {
                if !*seen && is_there(self.studio.model()) {
                    *seen = true;
                    self.told.push((format!("{what}: {name}"), seconds));
                }
            }
            if next < AT_SECONDS.len() && seconds >= AT_SECONDS[next] {
                self.shot(&format!("{what}_{:02}s", AT_SECONDS[next]));
                next += 1;
            }
            if is_over(self.studio.model()) {
                break;
            }
            let log = self.studio.log();
            assert!(self.began.elapsed() < PATIENCE, "{what}: {log}");
            std::thread::sleep(Duration::from_millis(15));
        }
        self.studio.frames(3);
        self.shot(&format!("{what}_end"));
    }
}

fn of_project(model: &Model, is_so: fn(&patina::studio::model::Project) -> bool) -> bool {
    model.project.as_ref().is_some_and(is_so)
}

#[test]
#[ignore = "slow: opens and fits a scene, and writes pictures to look at into the folder PATINA_FILM"]
fn a_scene_from_the_first_second_to_the_end() {
    let (Some(folder), true) = (std::env::var_os("PATINA_FILM"), has_adapter()) else { return };
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder).unwrap();
    let side: Vec<f32> =
        std::env::var("PATINA_FILM_SIZE").unwrap_or("1440x900".into()).split('x').map(|n| n.parse().unwrap()).collect();
    let builder = Harness::builder().with_size([side[0], side[1]]).wgpu();
    let studio = TestStudio::built(builder, Arc::new(tempfile::tempdir().unwrap()), None);
    let mut film = Film { studio, folder, began: Instant::now(), told: Vec::new() };
    film.studio.model().switches.traced = true;
    film.studio.frames(2);
    film.shot("welcome");
    match std::env::var_os("PATINA_FILM_SCENE") {
        Some(scene) => film.studio.model().open(Path::new(&scene).into()),
        None => film.studio.model().act(Act::OpenDemo),
    }
    let opening: [Milestone; 4] = [
        ("scene", |model| model.project.is_some()),
        ("first colour", |model| of_project(model, |own| own.laid.is_some())),
        ("ready", |model| of_project(model, |own| own.surface.is_some())),
        ("colour of texels", |model| {
            of_project(model, |own| own.laid.as_ref().is_some_and(|laid| laid.texels.is_some()))
        }),
    ];
    film.run("open", &opening, |model| opening.iter().all(|(_, is_there)| is_there(model)));
    film.studio.model().act(Act::Start);
    let fitting: [Milestone; 4] = [
        ("first materials", |model| of_project(model, |own| own.maps.is_some())),
        ("cache", |model| of_project(model, |own| own.transport.is_some())),
        ("relightable", |model| of_project(model, |own| own.maps.is_some() && own.transport.is_some())),
        ("finishing", |model| matches!(model.fit.status, FitStatus::Finishing(_))),
    ];
    film.run("fit", &fitting, |model| matches!(model.fit.status, FitStatus::Finished | FitStatus::Failed(_)));
    let status = film.studio.model().fit.status.clone();
    assert_eq!(status, FitStatus::Finished, "{}", film.studio.log());
    for (name, act) in [
        ("export", Some(Act::Export)),
        ("import", Some(Act::Import)),
        ("photos", Some(Act::LayerPhotos)),
        ("deviation", Some(Act::LayerDiffuseDeviation)),
        ("roughness", Some(Act::LayerRoughness)),
        ("relit_next", Some(Act::NextLight)),
        ("relit_turned", Some(Act::TurnLightLeft)),
        ("two_lights", Some(Act::SecondLight)),
        ("texel", None),
    ] {
        film.studio.model().dialog = Default::default();
        if let Some(act) = act {
            film.studio.act(act);
        }
        let wait = Instant::now();
        while wait.elapsed() < Duration::from_secs(6) {
            film.studio.frames(1);
            std::thread::sleep(Duration::from_millis(20));
        }
        film.shot(&format!("then_{name}"));
        film.studio.model().card = false;
    }
    for (what, seconds) in &film.told {
        println!("{what}: {seconds:.1} s");
    }
}

#[test]
#[ignore = "writes pictures of every panel in a small and in an enlarged window into the folder PATINA_FILM"]
fn every_panel_in_a_small_window_and_at_a_large_scale() {
    let (Some(folder), true) = (std::env::var_os("PATINA_FILM"), has_adapter()) else { return };
    let folder = PathBuf::from(folder);
    std::fs::create_dir_all(&folder).unwrap();
    for (name, size, scale) in
        [("small", [900.0, 600.0], 1.0), ("large_letters", [1440.0, 900.0], 1.7), ("usual", [1440.0, 900.0], 1.0)]
    {
        let builder = Harness::builder().with_size(size).wgpu();
        let folder_of_studio = Arc::new(tempfile::tempdir().unwrap());
        let mut studio = TestStudio::built(builder, folder_of_studio, None);
        studio.harness.ctx.set_zoom_factor(scale);
        studio.frames(3);
        let shot = |studio: &mut TestStudio, what: &str| {
            studio.frames(3);
            rendered(&mut studio.harness).unwrap().save(folder.join(format!("{name}_{what}.png"))).unwrap();
        };
        shot(&mut studio, "welcome");
        studio.model().open(finished_run().into());
        studio.wait("the run", |model| model.project.is_some());
        shot(&mut studio, "first");
        for (panel, title, _) in Panel::ALL {
            studio.show(panel);
            shot(&mut studio, &title.to_lowercase().replace(' ', "_"));
        }
        for (what, act) in [
            ("palette", Act::Palette),
            ("help", Act::Help),
            ("export", Act::Export),
            ("image", Act::SavePicture),
            ("import", Act::Import),
        ] {
            studio.act(act);
            shot(&mut studio, what);
            studio.model().dialog = Default::default();
        }
    }
}
