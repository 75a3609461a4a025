//! The methods that can be compared.

use crate::fit::FitSettings;

/// A method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, clap::ValueEnum)]
pub enum Contestant {
    /// This program's path tracer, reverse pass and Adam.
    Adam,
    /// This program's deterministic solver.
    Solver,
    /// Mitsuba 3 on the processor, `prb` and Adam, by `tests/mitsuba/fit_exchange.py`.
    Mitsuba,
}

impl Contestant {
    /// All of them.
    pub const ALL: [Contestant; 3] = [Contestant::Adam, Contestant::Solver, Contestant::Mitsuba];

    /// Its name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Contestant::Adam => "adam",
            Contestant::Solver => "solver",
            Contestant::Mitsuba => "mitsuba",
        }
    }

    /// Settings of a fit by this method; `None` when it is no method of this build. Mitsuba's are those of Adam, from
    /// which its start values and sizes are taken.
    pub fn settings(self, base: &FitSettings) -> Option<FitSettings> {
        match self {
            // Where there is no choice, Adam is what there is.
            Contestant::Adam | Contestant::Mitsuba => {
                Some(with_method(base, "paper").or_else(|| with_method(base, "adam")).unwrap_or_else(|| base.clone()))
            }
            Contestant::Solver => with_method(base, "solver"),
        }
    }
}

/// The settings with another `method`; `None` when there is no such setting, or no such method.
fn with_method(base: &FitSettings, method: &str) -> Option<FitSettings> {
    let mut table = toml::Table::try_from(base).ok()?;
    table.insert("method".into(), method.into());
    FitSettings::from_toml(&table.to_string()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_keeps_the_other_settings() {
        let base = FitSettings { map_size: 64, rate_light: 0.25, ..Default::default() };
        for contestant in Contestant::ALL {
            if let Some(settings) = contestant.settings(&base) {
                assert_eq!((settings.map_size, settings.rate_light), (64, 0.25), "{contestant:?}");
                let name = |settings: &FitSettings| settings.get("method").ok();
                let is_solver = name(&settings).is_some_and(|name| format!("{name:?}").contains("solver"));
                assert_eq!(is_solver, contestant == Contestant::Solver);
            }
        }
        assert!(Contestant::Adam.settings(&base).is_some());
    }
}
