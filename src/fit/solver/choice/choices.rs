//! What was chosen, what each choice bought in error and what it cost in time: the outcome of the check.

use super::judge::{JudgedSums, Judgement, PAIRS, SurfaceAlternatives, region_of};
use super::{ALTERNATIVES, Alternative, LOBE_ALTERNATIVES};
use crate::image::{GreyImage, Image};
use std::fmt;

/// A freedom of the model, and what judging views say of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChoiceLine {
    /// What it is, in a few words.
    pub name: &'static str,
    /// What it is compared with; empty for the simplest model.
    pub compared_with: &'static str,
    /// Share in [0, 1] of the judged texels for which it is the choice; `None` for what the scene has as a whole.
    pub share: Option<f64>,
    /// Mean over all judging pixels of the gain in log-likelihood over what it is compared with, and its standard error
    /// over views, in nats a pixel; `None` for the simplest model.
    pub gain: Option<(f64, f64)>,
    /// Root mean squared error over all judging pixels, in linear radiance.
    pub rmse: f64,
    /// That less the error of what it is compared with; `None` for the simplest model.
    pub rmse_change: Option<f64>,
    /// Seconds that it added to the fit; `None` where that was not measured.
    pub seconds: Option<f64>,
}

impl fmt::Display for Choices {
    /// The lines as a table of plain text.
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        let kind = if self.are_withheld { "withheld" } else { "held-out" };
        write!(formatter, "{} pixels of {} {kind} views judge, {:.2} s", self.pixels, self.views, self.seconds)?;
        for line in &self.lines {
            let seconds = line.seconds.map_or("not timed".into(), |seconds| format!("{seconds:.2} s"));
            write!(formatter, "\n  {:<34} RMSE {:.5}, {seconds}", line.name, line.rmse)?;
            if let Some(share) = line.share {
                write!(formatter, ", the choice for {:.1} % of the texels", 100.0 * share)?;
            }
            if let (Some((gain, error)), Some(change)) = (line.gain, line.rmse_change) {
                let against = line.compared_with;
                write!(formatter, ", {gain:+.4} ± {error:.4} nats a pixel and RMSE {change:+.5} over {against}")?;
            }
        }
        Ok(())
    }
}

impl ChoiceLine {
    /// Whether the gain is larger than its standard error; the simplest model needs no leave.
    pub fn is_borne_out(&self) -> bool {
        self.gain.is_none_or(|(gain, error)| gain > error)
    }
}

/// The outcome of the check.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// The freedoms: no lobe, one a region, lobes of their own, light from other surface (where there is any), the
    /// light's resolution.
    pub lines: Vec<ChoiceLine>,
    /// By texel: 1 no lobe, 2 one lobe for its region, 3 lobes of their own; 0 where less than two views judge.
    pub map: GreyImage,
    /// Views that judged.
    pub views: usize,
    /// Pixels that judged.
    pub pixels: u64,
    /// Whether those were training views, withheld from this check only.
    pub are_withheld: bool,
    /// Seconds that the check took.
    pub seconds: f64,
}

/// Seconds that parts of the model took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChoiceSeconds {
    /// Integrals of lobes at all widths, and sums over pixels of them.
    pub integrals: f64,
    /// Beliefs of which texels share a lobe.
    pub beliefs: f64,
    /// Rays between surfaces; `None` without.
    pub bounces: Option<f64>,
    /// Alternatives solved for this check.
    pub alternatives: [f64; ALTERNATIVES],
    /// Judging them.
    pub judging: f64,
}

impl ChoiceSeconds {
    /// Adds the seconds of a tile's alternatives.
    pub fn add_alternatives(&mut self, seconds: &[f64; ALTERNATIVES]) {
        self.alternatives.iter_mut().zip(seconds).for_each(|(sum, seconds)| *sum += seconds);
    }

    /// Divides what is in seconds of one processor among so many threads.
    pub fn share_among(&mut self, threads: f64) {
        let sums = [&mut self.integrals, &mut self.beliefs].into_iter().chain(&mut self.alternatives);
        sums.for_each(|seconds| *seconds /= threads.max(1.0));
    }
}

impl Choices {
    /// From what judges said.
    pub fn of(
        judgement: &Judgement,
        surface: &SurfaceAlternatives,
        map_size: usize,
        seconds: &ChoiceSeconds,
        are_withheld: bool,
    ) -> Self {
        let chosen: Vec<Option<Alternative>> = judgement.regions.iter().map(JudgedSums::simplest).collect();
        let map = Image::from_fn(map_size, map_size, |row, column| {
            let texel = row * map_size + column;
            let choice = surface.is_solved(texel).then(|| chosen[region_of(texel, map_size)]).flatten();
            choice.map_or(0.0, |choice| 1.0 + choice.index() as f32)
        });
        let judged = map.pixels().iter().filter(|&&code| code > 0.0).count().max(1) as f64;
        let share = |choice: Alternative| {
            let code = 1.0 + choice.index() as f32;
            map.pixels().iter().filter(|&&own| own == code).count() as f64 / judged
        };
        let total = &judgement.total;
        let rmse = |alternative: Alternative| (total.squares[alternative.index()] / total.pixels.max(1.0)).sqrt();
        let bought = |simple: Alternative, rich: Alternative| {
            let pair = PAIRS.iter().position(|pair| *pair == (simple, rich));
            let gain = pair.map(|pair| (total.pairs[pair].mean(), total.pairs[pair].standard_error()));
            (gain, rmse(rich), Some(rmse(rich) - rmse(simple)))
        };
        let line = |name, compared_with, share, (gain, rmse, rmse_change), seconds| ChoiceLine {
            name,
            compared_with,
            share,
            gain,
            rmse,
            rmse_change,
            seconds,
        };
        use Alternative::*;
        // The richest model is held against the likelier of the simpler ones: a straw man would flatter it.
        let simpler = if total.logs[OneLobe.index()] > total.logs[Diffuse.index()] { OneLobe } else { Diffuse };
        let simpler_name = if simpler == OneLobe { "one lobe a region" } else { "no lobe" };
        debug_assert_eq!(LOBE_ALTERNATIVES, 3);
        let mut lines = vec![
            line("no lobe", "", Some(share(Diffuse)), (None, rmse(Diffuse), None), Some(seconds.alternatives[0])),
            line(
                "one lobe a region",
                "no lobe",
                Some(share(OneLobe)),
                bought(Diffuse, OneLobe),
                Some(seconds.integrals),
            ),
            line(
                "lobes as the evidence shares them",
                simpler_name,
                Some(share(OwnLobes)),
                bought(simpler, OwnLobes),
                Some(seconds.beliefs),
            ),
        ];
        if surface.has(DirectLight) {
            let bought = bought(DirectLight, OwnLobes);
            lines.push(line("light from other surface", "direct light only", None, bought, seconds.bounces));
        }
        let bought = bought(HalfLight, OwnLobes);
        lines.push(line("light at full resolution", "half of it, maps as they are", None, bought, None));
        Choices {
            lines,
            map,
            views: judgement.views,
            pixels: total.pixels as u64,
            are_withheld,
            seconds: seconds.alternatives.iter().sum::<f64>() + seconds.judging,
        }
    }
}
