//! Ends a fit before its last step, with maps and light that are whole all the same.

use super::fitter::Fitter;
use super::schedule::StageKind;
use super::settings::Method;
use super::underway::Reached;

impl Fitter {
    /// The stages that are not done, by their names, with the steps that are left of each.
    pub fn steps_left(&self) -> Vec<(String, usize)> {
        let left = self.state.plan.iter().enumerate().skip(self.state.stage).map(|(number, stage)| {
            let done = if number == self.state.stage { self.state.step_in_stage } else { 0 };
            (stage.name(), stage.steps.saturating_sub(done))
        });
        left.filter(|(_, steps)| *steps > 0).collect()
    }

    /// Whether maps were made: by Adam from its first step on, by the solver once it has made some, of whatever size.
    pub fn has_maps(&self) -> bool {
        if self.settings.fixed_maps {
            return true;
        }
        match self.settings.method {
            Method::Solver | Method::Automatic => self.state.plan.iter().enumerate().any(|(number, stage)| {
                let is_done = number < self.state.stage
                    || (number == self.state.stage && self.state.step_in_stage >= stage.steps);
                is_done && matches!(stage.kind, StageKind::Maps | StageKind::Refine)
            }),
            Method::Adam => self.state.step > 0,
        }
    }

    /// Ends the fit with what there is, and with what the step that was stopped had reached by then: maps grow to their
    /// full size, and holes in the light are filled. The cheapest that is a whole result, in no time beside a step.
    ///
    /// The state is then that of a fit at its end: a checkpoint to go on from has to be written before.
    pub(crate) fn cut_short(&mut self, reached: Option<Reached>) {
        let Some(stage) = self.stage().copied() else { return };
        // How well maps are known that a descent was half done with nothing tells.
        let knows_deviations = reached.is_none() && self.deviations_are_known();
        if stage.kind.is_of_solver() {
            let state = &mut self.state;
            match reached {
                // A descent begins at a light without holes.
                Some(reached) => reached.put_into(state),
                None => {
                    if let Some(solver) = &self.solver {
                        solver.fill_holes(&mut state.light);
                    }
                }
            }
        }
        self.grow_maps(self.settings.map_size);
        if !knows_deviations {
            // Those of a round on the light are none of the maps.
            self.state.variances.clear();
        }
        self.state.stage = self.state.plan.len();
        self.state.step_in_stage = 0;
        self.work = None;
        self.is_cut_short = true;
    }
}
