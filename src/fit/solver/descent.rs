//! The descent of the [objective](super::objective) over all texels at once, from whole pixels.
//!
//! A pixel's radiance is taken as linear in the numbers of its texels, beliefs as the parabola that touches them
//! ([`super::neighbours`]), and conjugate gradients go down what that makes (Gauss and Newton). The step is halved until the
//! objective itself, with lobes integrated anew and light between surfaces as the new maps have it, is less; a step that
//! never is leaves all as it was. Noise and gains are learned before each step, and stay while the objective falls.
//!
//! With a light it begins twice: at the texels that were found, and at one plain dielectric ([`super::second_start`]). From
//! there the light is found once more ([`super::light_again`]) and taken as it is. At its end the scale of the light is told ([`super::light_scale`]), and dielectrics are common ones.

use super::conjugate_gradients::conjugate_gradients;
use super::estimate::Estimate;
use super::light_evidence::EvidenceShares;
use super::light_scale::LightScale;
use super::neighbours::Neighbours;
use super::objective::{Learned, Objective};
use super::photo_gains::log_gains;
use super::pixel_system::{Lanes, PixelSystem, Rows};
use super::pixels::Pixels;
use super::report::ErrorSums;
use super::scene::SolverScene;
use super::sight::{Lit, Sight, Slopes, lanes_of};
use super::way::{ENDS_OF_PARTS, Showing, Step, Trace, Watch, weight_of};
use crate::material::Material;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// The first steps down, from each start.
pub(super) const FIRST_STEPS: [Step; 2] = [Step { iterations: 12, slopes: Slopes::OfReflectances }; 2];
/// Those after them, from the better one: what the choice left unsettled first, without an integral of a lobe; then widths as
/// well.
const LAST_STEPS: [Step; 6] = [
    FIRST_STEPS[0],
    FIRST_STEPS[0],
    FIRST_STEPS[0],
    FIRST_STEPS[0],
    Step { iterations: 12, slopes: Slopes::OfWidths },
    Step { iterations: 24, slopes: Slopes::OfWidths },
];
/// Times that a step is halved.
const HALVINGS: usize = 3;
/// How far the logarithm of a width may go in one step: farther off its slope is another.
const WIDTH_REACH: f32 = 0.3;

/// Where a descent ended.
pub struct Descended {
    /// The texels.
    pub texels: Vec<Material<f32>>,
    /// Noise and gains.
    pub learned: Learned,
    /// The objective before and after each step, by what was learned then.
    pub steps: Vec<[Objective; 2]>,
    /// Precision of each number of a texel by its pixels alone; 0 where none shows it.
    pub precision: Vec<Lanes>,
    /// Squared errors of unclipped pixels in units of the photos.
    pub errors: ErrorSums,
    /// What light and reflectances were scaled by at the end, and how well that is known; `None` without a light to find.
    pub scale: Option<LightScale>,
    /// Whether F0 of a texel was scaled with it.
    pub scaled_specular: Vec<bool>,
    /// The light by then.
    pub light: Vec<[f32; 3]>,
    /// What its texels are known by; empty where it is the light of the start.
    pub light_shares: Vec<EvidenceShares>,
}

/// A place on the way down.
pub(super) struct Place {
    /// The texels.
    pub(super) texels: Vec<Material<f32>>,
    /// What pixels see there.
    pub(super) sight: Sight,
    /// Noise and gains that were learned last.
    pub(super) learned: Option<Learned>,
    /// What is believed of the texels.
    pub(super) beliefs: Neighbours,
    /// Whether the sight has all slopes, at these very texels.
    pub(super) is_exact: bool,
}

/// A way down.
pub(super) struct Descent<'a> {
    pub(super) scene: &'a SolverScene,
    pub(super) pixels: &'a Pixels<'a>,
    pub(super) system: PixelSystem,
    light: Vec<[f32; 3]>,
    light_shares: Vec<EvidenceShares>,
    lit: Lit,
    /// Largest diffuse reflectance of a texel.
    pub(super) most_diffuse: f32,
    stop: &'a AtomicBool,
}

impl SolverScene {
    /// Goes down from `start` under `estimate`'s light. `None` when `stop` was raised.
    pub(super) fn descend(
        &self,
        estimate: &Estimate,
        start: Vec<Material<f32>>,
        lit: Lit,
        stop: &AtomicBool,
    ) -> Option<Descended> {
        self.descend_watched(estimate, start, lit, stop, None)
    }

    /// The same; `watch` hears of the way.
    pub(super) fn descend_watched<'a>(
        &self,
        estimate: &Estimate,
        start: Vec<Material<f32>>,
        lit: Lit,
        stop: &AtomicBool,
        watch: Option<&'a mut Watch<'a>>,
    ) -> Option<Descended> {
        let pixels = Pixels::of(self);
        let system = PixelSystem::new(&pixels, self.settings.map_size);
        let (light, most_diffuse) = (estimate.light.clone(), self.most_diffuse(lit));
        let mut descent =
            Descent { scene: self, pixels: &pixels, system, light, light_shares: Vec::new(), lit, most_diffuse, stop };
        let sight = descent.sight(&start, FIRST_STEPS[0].slopes)?;
        let rows = Learned::of(&pixels, &sight, None).rows(&pixels, &sight);
        let diagonal = descent.system.diagonal(Rows { pieces: &sight.pieces, pixels: &rows });
        let shown: Vec<bool> = diagonal.iter().map(|diagonal| diagonal[0] > 0.0).collect();
        let texture_scale = self.choose_texture_scale(&pixels, &sight, (&start, &shown), lit, stop)?;

        let mut trace = Trace::of(watch);
        // Most of it goes into looking at all pixels.
        trace.begin((0.75 * ENDS_OF_PARTS[0], ENDS_OF_PARTS[0]), weight_of(&FIRST_STEPS));
        let mut place =
            descent.down(descent.place(&start, sight, (&shown, texture_scale)), &FIRST_STEPS, &mut trace)?;
        if lit == Lit::Yes {
            // Lobes of the dielectric are integrated first; two steps from it, and one from what was chosen.
            let [from, to, ..] = ENDS_OF_PARTS;
            trace.begin((from + 0.4 * (to - from), to), 1.5 * weight_of(&FIRST_STEPS));
            place = descent.or_plain(place, (&start, &shown, texture_scale), &mut trace)?;
        }
        if lit == Lit::Yes && self.is_scale_open() {
            trace.begin((ENDS_OF_PARTS[1], ENDS_OF_PARTS[2]), 1.0);
            place = descent.under_light_again(place, estimate, (&shown, texture_scale), &mut trace)?;
        }
        // Where the scale is given, nothing was done between.
        let from = ENDS_OF_PARTS[if self.is_scale_open() { 2 } else { 1 }];
        trace.begin((from, ENDS_OF_PARTS[3]), weight_of(&LAST_STEPS));
        let mut place = descent.down(place, &LAST_STEPS, &mut trace)?;
        trace.begin((ENDS_OF_PARTS[3], 1.0), weight_of(&FIRST_STEPS));
        let scale = (lit == Lit::Yes && self.is_scale_open()).then(|| LightScale::told_by(&place.texels, &shown));
        let scaled_specular = place.texels.iter().map(LightScale::changes_specular).collect();
        if lit == Lit::Yes {
            place = descent.settled(place, scale.unwrap_or(LightScale::NONE), (&shown, texture_scale), &mut trace)?;
        }

        let (light, light_shares) = (descent.light, descent.light_shares);
        let Place { texels, sight, learned, .. } = place;
        let learned = learned?;
        let rows = learned.rows(&pixels, &sight);
        let precision = descent.system.diagonal(Rows { pieces: &sight.pieces, pixels: &rows });
        let mut errors = ErrorSums::new(self.views.len());
        for (index, row) in rows.iter().enumerate().filter(|(_, row)| row.weight > 0.0) {
            let own = pixels.pixel(index);
            if !own.clipped {
                errors.add(own.view as usize, row.left.iter().map(|left| f64::from(left * left)).sum::<f64>() / 3.0);
            }
        }
        let steps = trace.steps;
        Some(Descended { texels, learned, steps, precision, errors, scale, scaled_specular, light, light_shares })
    }
}

impl Descent<'_> {
    /// What pixels see of texels. `None` when `stop` was raised.
    pub(super) fn sight(&mut self, texels: &[Material<f32>], slopes: Slopes) -> Option<Sight> {
        let pixels = (self.pixels, &mut self.system);
        self.scene.sight(pixels, &self.light, texels, (self.lit, slopes), self.stop)
    }

    /// Goes on under the light that the texels of a place say. What that makes wrong of them, steps make good.
    fn under_light_again(
        &mut self,
        place: Place,
        estimate: &Estimate,
        (shown, texture_scale): (&[bool], f32),
        trace: &mut Trace,
    ) -> Option<Place> {
        let here = Estimate {
            texels: place.texels.clone(),
            variances: estimate.variances.clone(),
            light: self.light.clone(),
            log_gains: match &place.learned {
                Some(learned) if self.scene.settings.exposure => log_gains(&learned.gains),
                _ => estimate.log_gains.clone(),
            },
            ..Estimate::default()
        };
        let gains = place.learned.as_ref().map_or(&[][..], |learned| &learned.gains);
        let mut seen = |share: f64, light: &[[f32; 3]]| {
            let showing = Showing { light, ..self.showing(shown, gains) };
            trace.within_step(share, &showing, &|| place.texels.clone());
        };
        let found = self.scene.light_again(here, self.stop, &mut seen)?;
        (self.light, self.light_shares) = found;
        let sight = self.sight(&place.texels, FIRST_STEPS[0].slopes)?;
        Some(Place { learned: place.learned, ..self.place(&place.texels, sight, (shown, texture_scale)) })
    }

    /// The end of the way: the light is multiplied by what was told of its scale, and dielectrics are known to be common
    /// ones from then on. What that makes wrong, as Schlick's rise, light between surfaces and what the background told of
    /// the light, steps make good.
    fn settled(
        &mut self,
        place: Place,
        scale: LightScale,
        (shown, texture_scale): (&[bool], f32),
        trace: &mut Trace,
    ) -> Option<Place> {
        self.most_diffuse = 1.0;
        let texels: Vec<Material<f32>> = place.texels.par_iter().map(|texel| scale.under(texel)).collect();
        let sight = match scale.factor == [1.0; 3] && texels == place.texels {
            true => place.sight,
            false => {
                self.light = scale.of_light(&self.light, &self.scene.told_by_background());
                self.sight(&texels, Slopes::OfReflectances)?
            }
        };
        let mut begun = Place { learned: place.learned, ..self.place(&texels, sight, (shown, texture_scale)) };
        begun.beliefs.know_dielectrics(&texels);
        self.down(begun, &FIRST_STEPS, trace)
    }

    /// What texels are shown by on the way.
    pub(super) fn showing<'b>(&'b self, shown: &'b [bool], gains: &'b [[f32; 3]]) -> Showing<'b> {
        Showing { scene: self.scene, light: &self.light, most_diffuse: self.most_diffuse, shown, gains }
    }

    /// A place to begin at, around which texture has such a scale.
    pub(super) fn place(&self, start: &[Material<f32>], sight: Sight, (shown, texture_scale): (&[bool], f32)) -> Place {
        let beliefs = Neighbours::new(self.scene.settings.map_size, start, shown.to_vec(), texture_scale);
        Place { texels: start.to_vec(), sight, learned: None, beliefs, is_exact: false }
    }

    /// Goes these steps from a place, and tells the objective before and after each. `None` when `stop` was raised.
    pub(super) fn down(&mut self, from: Place, steps: &[Step], trace: &mut Trace) -> Option<Place> {
        let Place { mut texels, mut sight, mut learned, beliefs, mut is_exact } = from;
        for (number, step) in steps.iter().enumerate() {
            let moves_widths = self.lit == Lit::Yes && step.slopes == Slopes::OfWidths;
            if moves_widths && !is_exact {
                sight = self.sight(&texels, step.slopes)?;
            }
            let by = Learned::of(self.pixels, &sight, learned.as_ref());
            let rows = by.rows(self.pixels, &sight);
            let before = by.objective(self.pixels, &sight, beliefs.energies(&texels));
            let parabola = beliefs.parabola(&texels);
            let equations = Rows { pieces: &sight.pieces, pixels: &rows };
            let most = self.most_diffuse;
            let showing = Showing {
                scene: self.scene,
                light: &self.light,
                most_diffuse: most,
                shown: beliefs.shown(),
                gains: &by.gains,
            };
            // As it is judged after them, with widths lobes are integrated anew.
            let weight_of_iterations = if moves_widths { 0.5 } else { 0.8 } * step.weight();
            let mut ahead = |done: usize, way: &[Lanes]| {
                let weight = weight_of_iterations * done as f64 / step.iterations as f64;
                trace.within_step(weight, &showing, &|| stepped(&texels, way, 1.0, most));
            };
            let way = conjugate_gradients(&mut self.system, equations, &parabola, *step, self.stop, &mut ahead)?;
            let after_it = steps.get(number + 1).map_or(Slopes::OfReflectances, |next| next.slopes);
            let (mut share, mut after) = (1.0f32, before);
            for _ in 0..=HALVINGS {
                let next = stepped(&texels, &way, share, self.most_diffuse);
                let seen = match moves_widths {
                    true => self.sight(&next, after_it)?,
                    false => sight.moved(&mut self.system, &difference(&texels, &next)),
                };
                let objective = by.objective(self.pixels, &seen, beliefs.energies(&next));
                if objective.total() < before.total() {
                    (texels, sight, after) = (next, seen, objective);
                    is_exact = moves_widths && after_it == Slopes::OfWidths;
                    break;
                }
                share *= 0.5;
            }
            trace.step([before, after], step.weight(), (&self.showing(beliefs.shown(), &by.gains), &texels));
            learned = Some(by);
        }
        Some(Place { texels, sight, learned, beliefs, is_exact })
    }
}

/// Texels after a share of a step, within what there is.
pub(super) fn stepped(texels: &[Material<f32>], step: &[Lanes], share: f32, most_diffuse: f32) -> Vec<Material<f32>> {
    let one = |(texel, step): (&Material<f32>, &Lanes)| {
        let own = texel.to_array();
        let moved = std::array::from_fn(|lane| {
            let moved = own[lane] + share * step[lane];
            match lane {
                _ if !moved.is_finite() => own[lane],
                0..3 => moved.clamp(0.0, most_diffuse),
                3..6 => moved.clamp(0.0, 1.0),
                _ => moved.clamp(own[6] - WIDTH_REACH, (own[6] + WIDTH_REACH).min(0.0)),
            }
        });
        Material::from_array(moved)
    };
    texels.par_iter().zip(step).map(one).collect()
}

/// How far texels went.
pub(super) fn difference(from: &[Material<f32>], to: &[Material<f32>]) -> Vec<Lanes> {
    let one = |(from, to): (&Material<f32>, &Material<f32>)| {
        let (from, to) = (lanes_of(from), lanes_of(to));
        std::array::from_fn(|lane| to[lane] - from[lane])
    };
    from.par_iter().zip(to).map(one).collect()
}
