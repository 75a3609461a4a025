//! What suits a scene, where nobody chose: method, lobe and gains of photographs, maps as large as photos resolve.

use super::method::Method;
use super::settings::FitSettings;
use crate::error::Finding;
use crate::material::LobeModel;
use crate::scene::doctor::{self, Report, exposure};
use crate::scene::{Scene, View};

/// The settings that a scene decides. Everything that begins a fit, the command line, the window and [`Fitter::new`],
/// asks it for the settings as they are run, and records those.
///
/// [`Fitter::new`]: super::Fitter::new
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suited {
    /// The method that came nearer to the truth with such photos, and sooner.
    pub method: Method,
    /// Whether photos have so many pixels that the solver makes maps of less than full size, on a coarser grid.
    pub is_large: bool,
    /// Whether each photo gets a gain.
    pub exposure: bool,
    /// The microfacets of the lobe, for the solver.
    pub lobe: LobeModel,
    /// Width and height of maps with about as many texels as photos resolve; `None` where that is not known.
    pub map_size: Option<usize>,
    /// The same for the part of the surface that photos show most sharply.
    pub sharpest_map_size: Option<usize>,
}

/// From so many pixels of all photos on the solver leaves maps of full size to the descent: with tiles of them fits of real
/// places take three times as long.
const MANY_PIXELS: usize = 4_000_000;
/// Share of an atlas that charts cover, at the least, as a rule.
const COVERED_SHARE: f64 = 0.6;
/// Maps are not made smaller than this of themselves: that all levels of coarse-to-fine have texels.
const LEAST_MAP_SIZE: usize = 256;

impl Suited {
    /// What suits a scene of which the check found what `report` says.
    ///
    /// The solver ends nearer in maps, light and held-out pictures than Adam, in less time, once the photos' exposures, which
    /// cameras choose, are no riddle to the light. Maps with more texels than photos have pixels to tell them apart cost time
    /// and show the photos' noise. Where there are no photos there is nothing to solve. Most surfaces have tails as those of GGX,
    /// and other renderers have its lobe; where the truth is known, so is its lobe.
    pub fn to(scene: &Scene, report: &Report) -> Self {
        // Photographs developed to 16 bits are linear too, but cameras write down how they exposed.
        let by_camera = |view: &View| !view.photo.is_linear() || view.exposure_prior_stops.is_some();
        let is_photographed = scene.views.iter().any(by_camera);
        Suited {
            method: if scene.views.is_empty() { Method::Adam } else { Method::Solver },
            is_large: scene.views.iter().map(|view| view.photo.width() * view.photo.height()).sum::<usize>()
                > MANY_PIXELS,
            exposure: is_photographed && exposure::differ(&report.views),
            lobe: scene.truth.as_ref().map_or(LobeModel::Ggx, |truth| truth.lobe),
            map_size: report.texels_resolved.map(map_size_for),
            sharpest_map_size: report.texels_resolved_sharpest.map(map_size_for),
        }
    }

    /// What suits a scene that nobody checked before.
    pub fn to_unchecked(scene: &Scene) -> Self {
        // The check is asked only where something hangs on it: exposures of photographs.
        let is_photographed = scene.views.iter().any(|view| !view.photo.is_linear());
        Suited::to(scene, &if is_photographed { doctor::check(scene) } else { Report::default() })
    }

    /// Settings as they are run, of settings as they are asked for: the one place where [`Method::Automatic`] is resolved.
    /// What is among the `chosen` settings, by their names, stays as it is. A setting that means something to Adam alone
    /// chooses him. Maps only become smaller: a size that was set is what one is ready to wait for.
    pub fn resolve(&self, asked: &FitSettings, chosen: &[String]) -> FitSettings {
        let mut settings = asked.clone();
        self.apply(&mut settings, chosen);
        if settings.method == Method::Adam {
            // What the solver would do is no setting of such a run.
            settings.solve_as(asked);
        }
        settings
    }

    fn apply(&self, settings: &mut FitSettings, chosen: &[String]) {
        let is_free = |name: &str| !chosen.iter().any(|own| own == name);
        if settings.method == Method::Automatic {
            settings.method = if Method::means_adam(chosen) { Method::Adam } else { self.method };
        }
        // Adam's are those of the paper.
        if settings.method == Method::Solver && is_free("lobe") {
            settings.lobe = self.lobe;
        }
        if self.is_large && is_free("solver-levels") {
            settings.solver_levels = FitSettings::default().solver_levels + 1;
        }
        if self.is_large && is_free("solver-grid") {
            settings.solver_grid = FitSettings::default().solver_grid / 2;
        }
        if is_free("exposure") {
            settings.exposure |= self.exposure;
        }
        if is_free("map-size") {
            settings.map_size = self.map_size.map_or(settings.map_size, |size| size.min(settings.map_size));
        }
    }

    /// What was taken for the scene that nobody asked for; `settings` are what [`Suited::resolve`] made of `asked`.
    pub fn told(&self, asked: &FitSettings, settings: &FitSettings) -> Vec<Taken> {
        let mut told = Vec::new();
        let mut tell = |sentence: String, setting: &'static str, otherwise: String, does: &'static str| {
            told.push(Taken { sentence, setting, otherwise, does });
        };
        if asked.method == Method::Automatic && settings.method == Method::Solver {
            tell("Using the solver".into(), "method", "adam".into(), "takes Adam only");
        }
        if settings.lobe != asked.lobe {
            let sentence = format!("Fitting {} lobes", settings.lobe.label());
            let (otherwise, does) = match settings.lobe {
                LobeModel::Ggx => ("blinn-phong", "fits Blinn-Phong"),
                LobeModel::BlinnPhong => ("ggx", "fits GGX"),
            };
            tell(sentence, "lobe", otherwise.into(), does);
        }
        if settings.exposure != asked.exposure {
            let sentence = "Photo exposures differ: exposure compensation is on, a gain per photo";
            tell(sentence.into(), "exposure", "false".into(), "turns it off");
        }
        if settings.map_size != asked.map_size {
            let size = settings.map_size;
            let sharpest = match self.sharpest_map_size {
                Some(sharpest) if sharpest > size => {
                    format!(" over most of the surface; its sharpest part holds {sharpest} x {sharpest}")
                }
                _ => String::new(),
            };
            let sentence = format!("Map size set to {size} x {size} to match what the photos resolve{sharpest}");
            tell(sentence, "map-size", (2 * size).min(asked.map_size).to_string(), "takes larger maps");
        }
        told
    }
}

/// A setting that was taken for a scene, and how to have it otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taken {
    /// What was taken and why, without a full stop.
    pub sentence: String,
    /// The setting's name.
    pub setting: &'static str,
    /// Another value for it.
    pub otherwise: String,
    /// What that value does, such as `takes larger maps`.
    pub does: &'static str,
}

impl std::fmt::Display for Taken {
    /// The sentence, with what to type for the other value.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}; --{}={} {}", self.sentence, self.setting, self.otherwise, self.does)
    }
}

impl FitSettings {
    /// Whether these settings do already what the remedy of a finding asks for: then it need not be told.
    pub fn do_what_is_asked(&self, finding: &Finding) -> bool {
        self.exposure && ["exposure-jump", "exposure-varies"].contains(&finding.code)
    }
}

/// The power of two whose map holds about so many texels on charts.
fn map_size_for(texels: f64) -> usize {
    let level = (0.5 * (texels / COVERED_SHARE).max(1.0).log2()).round();
    (1usize << level.min(13.0) as u32).max(LEAST_MAP_SIZE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::scene::Photo;
    use crate::scene::demo::{DemoSettings, build};
    use crate::scene::doctor::ViewCheck;

    /// Two views of 8 x 6 pixels.
    fn linear_scene() -> Scene {
        let small =
            DemoSettings { views: 2, held_out: 0, width: 8, height: 6, map_size: 64, seed: 1, ..Default::default() };
        let mut scene = build(&small).unwrap().scene;
        for view in 0..2 {
            scene.set_photo(view, Image::filled(8, 6, glam::Vec3::ONE)).unwrap();
        }
        scene
    }

    fn names(of: &[&str]) -> Vec<String> {
        of.iter().map(|name| name.to_string()).collect()
    }

    fn applied(suited: &Suited, from: FitSettings, chosen: &[&str]) -> FitSettings {
        suited.resolve(&from, &names(chosen))
    }

    #[test]
    fn photos_are_for_the_solver_unless_adam_is_meant() {
        let mut scene = linear_scene();
        let suits = |scene: &Scene, chosen: &[&str]| {
            let settings = applied(&Suited::to(scene, &Report::default()), FitSettings::default(), chosen);
            settings.method
        };
        assert_eq!(suits(&scene, &[]), Method::Solver);
        assert_eq!(suits(&scene, &["map-size"]), Method::Solver);
        assert_eq!(suits(&scene, &["consistency"]), Method::Adam);
        let own = FitSettings { method: Method::Adam, ..FitSettings::default() };
        let kept = applied(&Suited::to(&scene, &Report::default()), own.clone(), &["bounces"]);
        assert_eq!(kept, own, "a method that was chosen stays, and Adam is not given what is the solver's");
        scene.views[1].photo = Photo::Srgb8(Image::filled(8, 6, [200; 3]));
        assert_eq!(suits(&scene, &[]), Method::Solver);
        assert_eq!(suits(&scene, &["samples"]), Method::Adam);
        scene.views.clear();
        assert_eq!(suits(&scene, &[]), Method::Adam);
    }

    #[test]
    fn captures_have_lobes_of_ggx_and_synthetic_scenes_those_they_were_made_with() {
        let mut scene = linear_scene();
        let taken = |scene: &Scene, from: FitSettings, chosen: &[&str]| {
            let suited = Suited::to(scene, &Report::default());
            let settings = applied(&suited, from.clone(), chosen);
            (settings.lobe, suited.told(&from, &settings).iter().any(|taken| taken.setting == "lobe"))
        };
        for lobe in LobeModel::ALL {
            scene.truth.as_mut().unwrap().lobe = lobe;
            assert_eq!(taken(&scene, FitSettings::default(), &[]).0, lobe);
        }
        scene.truth = None;
        assert_eq!(taken(&scene, FitSettings::default(), &[]), (LobeModel::Ggx, true));
        assert_eq!(taken(&scene, FitSettings::default(), &["lobe"]), (LobeModel::BlinnPhong, false));
        let adam = FitSettings { method: Method::Adam, ..FitSettings::default() };
        assert_eq!(taken(&scene, adam, &[]), (LobeModel::BlinnPhong, false));
    }

    #[test]
    fn photographs_whose_exposures_differ_get_gains_unless_that_was_decided() {
        let mut scene = linear_scene();
        let seen = |stops: f64| ViewCheck { exposure_stops: Some(stops), ..ViewCheck::default() };
        let differ = Report { views: vec![seen(0.0), seen(0.7)], ..Report::default() };
        let agree = Report { views: vec![seen(0.0), seen(0.05)], ..Report::default() };
        let gains = |scene: &Scene, report: &Report, from: bool, chosen: &[&str]| {
            let from = FitSettings { exposure: from, ..FitSettings::default() };
            applied(&Suited::to(scene, report), from, chosen).exposure
        };
        assert!(!gains(&scene, &differ, false, &[]), "a renderer's cameras have one exposure: it is gloss");
        scene.views[0].photo = Photo::Srgb8(Image::filled(8, 6, [200; 3]));
        assert!(gains(&scene, &differ, false, &[]));
        assert!(!gains(&scene, &differ, false, &["exposure"]), "refused");
        assert!(!gains(&scene, &agree, false, &[]));
        assert!(gains(&scene, &agree, true, &[]), "a preset that has gains keeps them");
    }

    #[test]
    fn what_was_taken_is_told_and_nothing_else() {
        let suited = Suited {
            method: Method::Solver,
            is_large: false,
            exposure: true,
            lobe: LobeModel::BlinnPhong,
            map_size: Some(512),
            sharpest_map_size: None,
        };
        let told = |asked: &FitSettings, chosen: &[&str]| -> Vec<String> {
            let told = suited.told(asked, &applied(&suited, asked.clone(), chosen));
            told.iter().map(Taken::to_string).collect()
        };
        let usual = FitSettings::default();
        let all = told(&usual, &[]);
        assert_eq!(all.len(), 3, "{all:?}");
        assert!(all[0].contains("solver") && all[1].contains("gain") && all[2].contains("512 x 512"), "{all:?}");
        let solver = FitSettings { method: Method::Solver, ..usual.clone() };
        assert_eq!(told(&solver, &["exposure", "map-size"]), Vec::<String>::new());
        let as_it_is = FitSettings { exposure: true, map_size: 256, ..solver };
        assert_eq!(told(&as_it_is, &[]), Vec::<String>::new());
        // What is typed is understood, and the next size is offered rather than the largest.
        assert!(all[1].contains("--exposure=false") && all[2].contains("--map-size=1024"), "{all:?}");
        let sharp = Suited { sharpest_map_size: Some(1024), ..suited.clone() };
        let told = sharp.told(&usual, &applied(&sharp, usual.clone(), &[]));
        assert!(told[2].sentence.ends_with("its sharpest part holds 1024 x 1024"), "{told:?}");
    }

    #[test]
    fn what_is_done_already_is_not_asked_for() {
        let finding = |code| Finding::new(crate::Severity::Warning, code, "exposures differ");
        let with_gains = FitSettings { exposure: true, ..FitSettings::default() };
        let without = FitSettings { exposure: false, ..FitSettings::default() };
        for code in ["exposure-jump", "exposure-varies"] {
            assert!(with_gains.do_what_is_asked(&finding(code)) && !without.do_what_is_asked(&finding(code)), "{code}");
        }
        assert!(!with_gains.do_what_is_asked(&finding("camera-mirrored")));
    }

    #[test]
    fn many_pixels_leave_full_size_to_the_descent() {
        let of = |is_large: bool, chosen: &[&str]| {
            let scene = linear_scene();
            let suited = Suited { is_large, ..Suited::to(&scene, &Report::default()) };
            let settings = applied(&suited, FitSettings::default(), chosen);
            (settings.solver_levels, settings.solver_grid, settings.is_refined())
        };
        assert_eq!(of(false, &[]), (2, 256, false));
        assert_eq!(of(true, &[]), (3, 128, true));
        assert_eq!(of(true, &["solver-levels"]), (2, 128, false));
        assert_eq!(of(true, &["solver-grid"]), (3, 256, true));
    }

    #[test]
    fn maps_hold_what_photos_resolve_and_no_more() {
        // Charts cover six tenths of a map.
        let sizes = [0.0, 100.0, 78_000.0, 79_000.0, 157_000.0, 630_000.0, 5e6, 5.1e6, 1e30].map(map_size_for);
        assert_eq!(sizes, [256, 256, 256, 512, 512, 1024, 2048, 4096, 8192]);
        let suited = |size| Suited {
            method: Method::Adam,
            is_large: false,
            exposure: false,
            lobe: LobeModel::BlinnPhong,
            map_size: size,
            sharpest_map_size: None,
        };
        let usual = FitSettings::default;
        assert_eq!(applied(&suited(Some(512)), usual(), &[]).map_size, 512);
        assert_eq!(applied(&suited(Some(512)), usual(), &["map-size"]).map_size, 2048);
        assert_eq!(applied(&suited(Some(4096)), usual(), &[]).map_size, 2048);
        assert_eq!(applied(&suited(None), usual(), &[]).map_size, 2048);
    }
}
