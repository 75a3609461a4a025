//! A second start of the [descent](super::descent): one plain dielectric, where that explains pixels better.
//!
//! The objective has many minima over lobes: from a metal, black below its lobe, no small step leads to a painted wall. Lobes
//! come from tiles, which may have taken what is wrong with light, mesh or cameras for metal, and then no descent gets rid of
//! it. So the same steps are gone from a surface that has the same dielectric everywhere, with the colours that pixels show
//! under it. The surface is cut into small squares of texels, and one goes on from the dielectric unless the photos that show it
//! agree that its pixels are better explained as they were found; all of it only if the whole objective is less then.

use super::agreement::SquareGains;
use super::choice::clustered::ClusteredMean;
use super::descent::{Descent, FIRST_STEPS, Place, difference};
use super::estimate::START_TEXEL;
use super::light_scale::PLAIN_SPECULAR;
use super::objective::Learned;
use super::sight::{Sight, Slopes};
use super::way::Trace;
use crate::material::Material;
use std::sync::Arc;

impl Descent<'_> {
    /// Where to go on from: `found`, which began at `start`, or with the dielectric where that is better. What it chose is
    /// told as a step. `None` when the descent was stopped.
    pub(super) fn or_plain(
        &mut self,
        found: Place,
        (start, shown, texture_scale): (&[Material<f32>], &[bool], f32),
        trace: &mut Trace,
    ) -> Option<Place> {
        let (plain_start, sight) = self.plain(&found, start, shown)?;
        let begun = self.place(&plain_start, sight, (shown, texture_scale));
        let plain = trace.trial(|trace| self.down(begun, &FIRST_STEPS, trace))?;
        let by = Learned::of(self.pixels, &found.sight, found.learned.as_ref());
        let is_plain = self.plain_texels(&found, &plain, &by);
        let choose = |one: &[Material<f32>], other: &[Material<f32>]| -> Vec<Material<f32>> {
            (0..one.len()).map(|texel| if is_plain[texel] { other[texel] } else { one[texel] }).collect()
        };
        let texels = choose(&found.texels, &plain.texels);
        let sight = self.sight_of_both([&found, &plain], &texels, &is_plain);
        let begun = self.place(&choose(start, &plain_start), sight, (shown, texture_scale));
        // Where squares meet neighbours differ at once; a step makes that good before it is judged.
        let begun = Place { texels, learned: found.learned.clone(), ..begun };
        let mixed = trace.trial(|trace| self.down(begun, &FIRST_STEPS[..1], trace))?;
        let objective = |place: &Place| by.objective(self.pixels, &place.sight, place.beliefs.energies(&place.texels));
        let (before, after) = (objective(&found), objective(&mixed));
        if after.total() >= before.total() {
            return Some(found);
        }
        let showing = self.showing(mixed.beliefs.shown(), &by.gains);
        trace.step([before, after], 0.0, (&showing, &mixed.texels));
        Some(mixed)
    }

    /// The dielectric with the colours that pixels show under it: closed, texel by texel of those that pixels cover most.
    fn plain(&mut self, found: &Place, start: &[Material<f32>], shown: &[bool]) -> Option<(Vec<Material<f32>>, Sight)> {
        let mut widths: Vec<f32> =
            start.iter().zip(shown).filter(|(_, shown)| **shown).map(|(own, _)| own.log_width).collect();
        let middle = widths.len() / 2;
        let log_width = match widths.is_empty() {
            true => START_TEXEL.log_width,
            false => *widths.select_nth_unstable_by(middle, f32::total_cmp).1,
        };
        let mut made: Vec<Material<f32>> =
            start.iter().map(|own| Material { specular: [PLAIN_SPECULAR; 3], log_width, ..*own }).collect();
        let sight = self.sight(&made, Slopes::OfReflectances)?;
        let rows = found.learned.as_ref()?.rows(self.pixels, &sight);
        let mut sums = vec![[[0.0f32; 3]; 2]; made.len()];
        for (index, row) in rows.iter().enumerate().take(self.pixels.whole()) {
            let [of_left, of_light] = &mut sums[self.pixels.texel(index) as usize];
            for c in 0..3 {
                let arriving = row.gain[c] * sight.pieces[index].arriving[c];
                of_left[c] += row.weight * arriving * row.left[c];
                of_light[c] += row.weight * arriving * arriving;
            }
        }
        let before = made.clone();
        for (own, [of_left, of_light]) in made.iter_mut().zip(&sums) {
            for c in (0..3).filter(|&c| of_light[c] > 0.0) {
                own.diffuse[c] = (own.diffuse[c] + of_left[c] / of_light[c]).clamp(0.0, self.most_diffuse);
            }
        }
        let sight = sight.moved(&mut self.system, &difference(&before, &made));
        Some((made, sight))
    }

    /// What pixels see of `texels`, some of which are those of the one place and some of the other: of each pixel by the
    /// light that arrives and the lobe that was integrated where most of it lies. No integral is needed; where squares meet,
    /// and in what surface sends surface, it is not exact until widths move.
    fn sight_of_both(&mut self, places: [&Place; 2], texels: &[Material<f32>], is_second: &[bool]) -> Sight {
        let [first, second] =
            places.map(|place| place.sight.moved(&mut self.system, &difference(&place.texels, texels)));
        let own = |pixel: usize| if is_second[self.pixels.texel(pixel) as usize] { &second } else { &first };
        let pixels = 0..self.pixels.count();
        let pieces = pixels.clone().flat_map(|pixel| &own(pixel).pieces[self.pixels.pieces(pixel)]).copied().collect();
        Sight { pieces: Arc::new(pieces), radiance: pixels.map(|pixel| own(pixel).radiance[pixel]).collect() }
    }

    /// The texels of squares that go on from the dielectric: all but those of which views agree that their pixels are better
    /// explained as they were found, both by the same noise. The dielectric is the simpler of the two, so that it is the lobe
    /// that was found which has to be told by the photos. Beliefs are left out here: lobes of tiles differ from texel to texel
    /// by what widths, which have not moved yet, will make good, and one material everywhere has no differences at all.
    fn plain_texels(&self, found: &Place, plain: &Place, by: &Learned) -> Vec<bool> {
        let by_plain = Learned::of(self.pixels, &plain.sight, plain.learned.as_ref()).with_noise_of(by);
        let gain =
            |pixel: usize| by.nats(self.pixels, &found.sight, pixel) - by_plain.nats(self.pixels, &plain.sight, pixel);
        let is_plain = |gain: &ClusteredMean| gain.pixels() > 0.0 && gain.mean() > -gain.standard_error();
        SquareGains::new(self.scene.settings.map_size, self.pixels, gain).texels_where(is_plain)
    }
}

#[cfg(all(test, feature = "cli"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::agreement::SQUARE;
    use super::super::refine::tests::{SIZE, photographed};
    use super::super::sight::Lit;
    use super::super::solver::Solver;
    use super::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn false_metal_becomes_the_painted_wall_that_it_is() {
        let (solver, truth) = photographed(|_| [1.0; 3]);
        let Solver { scene, estimate } = &solver;
        // The upper half of what is seen begins as a metal of the wall's colour, the lower half as it is.
        let seen: Vec<usize> = (0..SIZE * SIZE).filter(|&texel| scene.observations.range(texel).len() > 3).collect();
        let row = (seen[seen.len() / 2] / SIZE).next_multiple_of(SQUARE);
        let mut start = truth.clone();
        for own in &mut start[..row * SIZE] {
            *own = Material { diffuse: [0.02; 3], specular: own.diffuse, log_width: own.log_width };
        }
        let found = scene.descend(estimate, start, Lit::Yes, &AtomicBool::new(false)).unwrap();
        // Two steps, what was chosen, six steps; two more once the scale of the light is told.
        assert_eq!(found.steps.len(), 11, "{:?}", found.steps);
        let [before, after] = found.steps[2];
        assert!(after.total() < before.total() && after.neighbours < before.neighbours, "{before:?} {after:?}");
        for is_upper in [true, false] {
            let half = seen.iter().filter(|&&texel| (texel / SIZE < row) == is_upper);
            let mut specular: Vec<f32> = half.map(|&texel| found.texels[texel].specular[1]).collect();
            assert!(specular.len() > 50, "{}", specular.len());
            specular.sort_by(f32::total_cmp);
            let [middle, most] = [0.5, 0.95].map(|share| specular[(specular.len() as f64 * share) as usize]);
            assert!((0.02..0.08).contains(&middle) && most < 0.15, "{middle} {most}");
        }
    }
}
