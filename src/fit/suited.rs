//! What suits a scene, where nobody chose: method, polishing after photographs, maps as large as photos resolve.

use super::method::Method;
use super::settings::FitSettings;
use crate::scene::Scene;

/// The settings that a scene decides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suited {
    /// The method that came nearer to the truth with such photos, and sooner.
    pub method: Method,
    /// Steps of polishing after the solver's maps.
    pub solver_polish: usize,
    /// Width and height of maps with about as many texels as photos resolve; `None` where that is not known.
    pub map_size: Option<usize>,
}

/// As many as take no longer than what photographs do not need of the solver: finer edges, a finer grid, larger and second
/// maps on halved photos.
const POLISH_OF_PHOTOGRAPHS: usize = 110;
/// So much coarser is the solver's grid where polishing follows, by whole paths: shadows as fine as maps need are theirs.
const COARSER_GRID: usize = 2;
/// Share of an atlas that charts cover, at the least, as a rule.
const COVERED_SHARE: f64 = 0.6;
/// Maps are not made smaller than this of themselves: that all levels of coarse-to-fine have texels.
const LEAST_MAP_SIZE: usize = 256;

impl Suited {
    /// What suits a scene; `texels_resolved` is that of the check ([`crate::scene::doctor::Report`]).
    ///
    /// Linear radiance in all photos is what renderers write, and what the solver's model follows: there it ends nearer in
    /// maps, light and pictures under another light, in less time, and needs no polishing. On photographs of real places,
    /// 8 bits a channel, Adam through whole paths is ahead in the structure of what it shows. The README has both tables.
    /// Maps with more texels than photos have pixels to tell them apart cost time and show the photos' noise.
    pub fn to(scene: &Scene, texels_resolved: Option<f64>) -> Self {
        let is_rendered = !scene.views.is_empty() && scene.views.iter().all(|view| view.photo.is_linear());
        Suited {
            method: if is_rendered { Method::Solver } else { Method::Paper },
            solver_polish: if is_rendered { 0 } else { POLISH_OF_PHOTOGRAPHS },
            map_size: texels_resolved.map(map_size_for),
        }
    }

    /// Sets what suits the scene, but for what is among the `chosen` settings, by their names. A setting that means
    /// something to Adam alone chooses him. Maps only become smaller: a size that was set is what one is ready to wait for.
    pub fn apply(&self, settings: &mut FitSettings, chosen: &[String]) {
        let is_free = |name: &str| !chosen.iter().any(|own| own == name);
        if is_free("method") {
            settings.method = if Method::means_adam(chosen) { Method::Paper } else { self.method };
        }
        if is_free("solver-polish") {
            settings.solver_polish = self.solver_polish;
        }
        // Polishing leaves the solver the sizes below the full one, and it does with one more of them.
        if is_free("solver-levels") {
            settings.solver_levels = FitSettings::default().solver_levels + usize::from(settings.solver_polish > 0);
        }
        if is_free("solver-grid") {
            let coarser = if settings.solver_polish > 0 { COARSER_GRID } else { 1 };
            settings.solver_grid = FitSettings::default().solver_grid / coarser;
        }
        if is_free("map-size") {
            settings.map_size = self.map_size.map_or(settings.map_size, |size| size.min(settings.map_size));
        }
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

    fn names(of: &[&str]) -> Vec<String> {
        of.iter().map(|name| name.to_string()).collect()
    }

    fn applied(suited: &Suited, from: FitSettings, chosen: &[&str]) -> FitSettings {
        let mut settings = from;
        suited.apply(&mut settings, &names(chosen));
        settings
    }

    #[test]
    fn linear_photos_are_for_the_solver_unless_adam_is_meant() {
        let small = DemoSettings { views: 2, held_out: 0, width: 8, height: 6, map_size: 64, seed: 1 };
        let mut scene = build(&small).unwrap().scene;
        for view in 0..2 {
            scene.set_photo(view, Image::filled(8, 6, glam::Vec3::ONE)).unwrap();
        }
        let method =
            |scene: &Scene, chosen: &[&str]| applied(&Suited::to(scene, None), FitSettings::default(), chosen).method;
        assert_eq!(method(&scene, &[]), Method::Solver);
        assert_eq!(method(&scene, &["map-size"]), Method::Solver);
        assert_eq!(method(&scene, &["consistency"]), Method::Paper);
        assert_eq!(method(&scene, &["method", "bounces"]), FitSettings::default().method);
        scene.views[1].photo = Photo::Srgb8(Image::filled(8, 6, [200; 3]));
        assert_eq!(method(&scene, &[]), Method::Paper);
        scene.views.clear();
        assert_eq!(method(&scene, &[]), Method::Paper);
    }

    #[test]
    fn polishing_and_its_sizes_go_together() {
        let photographs = Suited { method: Method::Paper, solver_polish: 110, map_size: None };
        let rendered = Suited { method: Method::Solver, solver_polish: 0, map_size: None };
        let of = |suited: &Suited, polish: usize, chosen: &[&str]| {
            let from = FitSettings { solver_polish: polish, solver_levels: 1, ..FitSettings::default() };
            let settings = applied(suited, from, chosen);
            (settings.solver_polish, settings.solver_levels, settings.solver_grid)
        };
        assert_eq!((of(&photographs, 0, &[]), of(&rendered, 0, &[])), ((110, 3, 128), (0, 2, 256)));
        assert_eq!(of(&rendered, 5, &["solver-polish"]), (5, 3, 128));
        assert_eq!(of(&photographs, 0, &["solver-polish"]), (0, 2, 256));
        assert_eq!(of(&photographs, 0, &["solver-levels"]), (110, 1, 128));
        assert_eq!(of(&photographs, 0, &["solver-grid"]), (110, 3, 256));
    }

    #[test]
    fn maps_hold_what_photos_resolve_and_no_more() {
        // Charts cover six tenths of a map.
        let sizes = [0.0, 100.0, 78_000.0, 79_000.0, 157_000.0, 630_000.0, 5e6, 5.1e6, 1e30].map(map_size_for);
        assert_eq!(sizes, [256, 256, 256, 512, 512, 1024, 2048, 4096, 8192]);
        let suited = |size| Suited { method: Method::Paper, solver_polish: 0, map_size: size };
        let usual = FitSettings::default;
        assert_eq!(applied(&suited(Some(512)), usual(), &[]).map_size, 512);
        assert_eq!(applied(&suited(Some(512)), usual(), &["map-size"]).map_size, 2048);
        assert_eq!(applied(&suited(Some(4096)), usual(), &[]).map_size, 2048);
        assert_eq!(applied(&suited(None), usual(), &[]).map_size, 2048);
    }
}
