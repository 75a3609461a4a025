//! Which of the two ways to find maps and light: Adam by paths, or the solver.

use super::settings::FitSettings;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// How maps and light are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// As in the paper: many small steps of Adam along gradients of the path tracer.
    #[default]
    Paper,
    /// A few large steps without noise: rays are traced once, then texels are solved in closed form and the light by
    /// Gauss-Newton with the texels eliminated. Settings of Adam's steps do not matter to it.
    Solver,
}

impl Method {
    /// The method for a scene when none was asked for: that which came nearer to the truth with such photos, and sooner.
    ///
    /// Linear radiance in all photos is what renderers write, and what the solver's model follows: there it ends nearer in
    /// maps, light and pictures under another light, in less time. On photographs of real places, 8 bits a channel, Adam
    /// through whole paths is some tenths of a decibel ahead on views that were held out. The README has both tables.
    pub fn suited_to(scene: &Scene) -> Self {
        if is_rendered(scene) { Method::Solver } else { Method::Paper }
    }

    /// Sets what suits the solver on a scene, but for what is among the `chosen` settings: no polishing where its model
    /// holds, some after photographs, of which edges, silhouettes and errors of geometry are a large part. The solver is
    /// then left with the sizes below the full one, and does with one more of them.
    pub fn suit_solver(scene: &Scene, settings: &mut FitSettings, chosen: &[String]) {
        let is_free = |name: &str| !chosen.iter().any(|own| own == name);
        if is_free("solver-polish") {
            settings.solver_polish = if is_rendered(scene) { 0 } else { POLISH_OF_PHOTOGRAPHS };
        }
        if is_free("solver-levels") && settings.solver_polish > 0 {
            settings.solver_levels = FitSettings::default().solver_levels + 1;
        }
    }

    /// [`Method::suited_to`], or Adam where one of the `chosen` settings, by their names, means something to Adam alone.
    pub fn suited_to_settings(scene: &Scene, chosen: &[String]) -> Self {
        match Method::means_adam(chosen) {
            true => Method::Paper,
            false => Method::suited_to(scene),
        }
    }

    /// Whether one of the settings, by their names, means something to Adam alone.
    pub fn means_adam(chosen: &[String]) -> bool {
        chosen.iter().any(|name| OF_ADAM.contains(&name.as_str()))
    }
}

/// Whether all photos hold linear radiance.
fn is_rendered(scene: &Scene) -> bool {
    !scene.views.is_empty() && scene.views.iter().all(|view| view.photo.is_linear())
}

/// From here on more steps bring a scene of photographs little: 60 leave a tenth of a decibel, 150 bring none.
const POLISH_OF_PHOTOGRAPHS: usize = 80;

/// Settings that say nothing to the solver, unless it polishes.
const OF_ADAM: [&str; 15] = [
    "steps",
    "steps-diffuse",
    "steps-all",
    "views-per-step",
    "pixels-per-step",
    "samples",
    "levels",
    "pixel-filter",
    "consistency",
    "start",
    "rate-diffuse",
    "rate-specular",
    "rate-roughness",
    "rate-light",
    "lobe-ramp",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::scene::Photo;
    use crate::scene::demo::{DemoSettings, build};

    #[test]
    fn linear_photos_are_for_the_solver_unless_adam_is_meant() {
        let small = DemoSettings { views: 2, held_out: 0, width: 8, height: 6, map_size: 64, seed: 1 };
        let mut scene = build(&small).unwrap().scene;
        for view in 0..2 {
            scene.set_photo(view, Image::filled(8, 6, glam::Vec3::ONE)).unwrap();
        }
        assert_eq!(Method::suited_to(&scene), Method::Solver);
        assert_eq!(Method::suited_to_settings(&scene, &["map-size".into()]), Method::Solver);
        assert_eq!(Method::suited_to_settings(&scene, &["consistency".into()]), Method::Paper);
        scene.views[1].photo = Photo::Srgb8(Image::filled(8, 6, [200; 3]));
        assert_eq!(Method::suited_to(&scene), Method::Paper);
        scene.views.clear();
        assert_eq!(Method::suited_to(&scene), Method::Paper);
    }

    #[test]
    fn what_is_adams_alone_are_settings() {
        assert!(OF_ADAM.iter().all(|name| FitSettings::default().get(name).is_ok()));
    }
}
