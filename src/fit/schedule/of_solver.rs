//! The stages of the solver's method: which maps it makes on photos of which size, and what it leaves to the descent.

use super::{Position, Stage, StageKind};
use crate::fit::settings::FitSettings;

/// Width of the solver's maps on a coarse level, at least.
const LEAST_COARSE_MAP: usize = 128;
/// Rounds of the solver on the light on each level but the coarsest, where it makes all maps.
const FINER_ROUNDS: usize = 2;
/// The same where the descent makes the finest maps.
const FINER_ROUNDS_BEFORE_DESCENT: usize = 1;
/// Rounds on the coarsest level after its first maps, which tell the lobes they are done with; maps are made anew after
/// them.
const ROUNDS_AFTER_MAPS: usize = 1;

/// Who makes the finest maps of the solver's method, where there are coarser ones.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Finest {
    /// Tiles, and then the descent from whole pixels.
    Tiles,
    /// The descent alone. Tiles of full size take most of the time where photos have many pixels.
    Descent,
}

/// The solver's part in maps of all sizes.
///
/// Where others make the finest maps, the solver's need not be found as well: no second maps on the coarsest level, no second
/// round on the light on finer ones.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct SolverShare {
    finest: Finest,
    /// Whether the coarsest level is visited twice.
    visits_again: bool,
    /// Rounds on the light on each level but the coarsest.
    finer_rounds: usize,
}

impl SolverShare {
    pub(super) fn of(settings: &FitSettings) -> Self {
        let is_refined = settings.is_refined();
        SolverShare {
            finest: if is_refined { Finest::Descent } else { Finest::Tiles },
            visits_again: !is_refined,
            finer_rounds: if is_refined { FINER_ROUNDS_BEFORE_DESCENT } else { FINER_ROUNDS },
        }
    }

    /// The same once the stages of a plan have begun: what the solver has begun on whole photos is done, and what was visited
    /// again stays so.
    pub(super) fn as_begun(self, begun: &[Stage]) -> Self {
        let of_solver = || begun.iter().filter(|stage| stage.kind.is_of_solver());
        let has_finest = of_solver().any(|stage| stage.kind != StageKind::Refine && stage.photo_level == 0);
        let coarsest = of_solver().map(|stage| stage.photo_level).max();
        let finer =
            of_solver().find(|stage| stage.kind == StageKind::NarrowLight && Some(stage.photo_level) != coarsest);
        SolverShare {
            finest: if has_finest { Finest::Tiles } else { self.finest },
            visits_again: self.visits_again || of_solver().any(|stage| stage.visit > 0),
            finer_rounds: finer.map_or(self.finer_rounds, |stage| stage.steps_of_kind),
        }
    }
}

/// Light and maps on the coarsest level, twice where the solver makes all maps; on each finer one some rounds more, and
/// maps anew. What is done on the coarsest is cheap, and the second maps know which lobes the first have shown.
pub(super) fn positions_of_solver(settings: &FitSettings, share: SolverShare) -> Vec<Position> {
    let SolverShare { finest, visits_again, finer_rounds } = share;
    if settings.fixed_maps {
        return positions_with_fixed_maps(settings);
    }
    let mut positions: Vec<Position> = Vec::new();
    let map_size_at = |photo_level: usize| settings.map_size >> photo_level;
    let mut add = |kind: StageKind, total: usize, photo_level: usize| {
        let map_size = map_size_at(photo_level);
        if total > 0 {
            let is_like = |other: &&Position| (other.kind, other.photo_level) == (kind, photo_level);
            let visit = positions.iter().filter(is_like).count();
            positions.push(Position { kind, photo_level, map_size, visit, total, place: 0, places: 1 });
        }
    };
    let is_large = |level: &usize| map_size_at(*level) >= LEAST_COARSE_MAP;
    let coarsest = (1..settings.solver_levels).take_while(is_large).last().unwrap_or(0);
    let wide = settings.solver_rounds / 2;
    add(StageKind::WideLight, wide, coarsest);
    add(StageKind::NarrowLight, settings.solver_rounds - wide, coarsest);
    add(StageKind::Maps, 1, coarsest);
    // Where there is one size only, nothing else makes up for it.
    if visits_again || coarsest == 0 {
        add(StageKind::NarrowLight, ROUNDS_AFTER_MAPS, coarsest);
        add(StageKind::Maps, 1, coarsest);
    }
    let finest = usize::from(finest == Finest::Descent);
    for level in (finest..coarsest).rev() {
        add(StageKind::NarrowLight, finer_rounds, level);
        add(StageKind::Maps, 1, level);
    }
    add(StageKind::Refine, settings.solver_refine, 0);
    positions
}

/// Light alone: on the coarsest level as ever, then with narrow hats on each finer one. The maps that are kept have their
/// full size throughout; the solver halves them for its levels.
fn positions_with_fixed_maps(settings: &FitSettings) -> Vec<Position> {
    let is_large = |level: &usize| settings.map_size >> *level >= LEAST_COARSE_MAP;
    let coarsest = (1..settings.solver_levels).take_while(is_large).last().unwrap_or(0);
    let wide = settings.solver_rounds / 2;
    let position = |kind, photo_level, total| Position {
        kind,
        photo_level,
        map_size: settings.map_size,
        visit: 0,
        total,
        place: 0,
        places: 1,
    };
    let mut positions = vec![
        position(StageKind::WideLight, coarsest, wide),
        position(StageKind::NarrowLight, coarsest, settings.solver_rounds - wide),
    ];
    positions.extend((0..coarsest).rev().map(|level| position(StageKind::NarrowLight, level, FINER_ROUNDS)));
    positions
}
