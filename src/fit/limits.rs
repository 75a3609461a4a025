//! What settings of a fit may be.

use super::settings::{Consistency, FitSettings, Method};
use super::solver::light_shape::LightShape;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::render::path::MAX_BOUNCES;

/// The solver's equations of the light are square and dense, some fifteen of them at once: with so many unknowns they take
/// about a gigabyte.
const MOST_UNKNOWNS_OF_LIGHT: usize = 2048;
/// One byte for each point of the grid and texel of the light.
const MOST_BYTES_OF_VISIBILITY: usize = 8 << 30;

impl FitSettings {
    /// Checks every range.
    ///
    /// # Errors
    /// `InvalidSetting` with the name of the first that is out of its range.
    pub fn validate(&self) -> Result<()> {
        let wrong = |name: &str, message: &str| {
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())))
        };
        // A settings file holds signed numbers of 64 bits.
        if i64::try_from(self.seed).is_err() {
            return wrong("seed", "must be at most 9223372036854775807");
        }
        if !self.map_size.is_power_of_two() || !(16..=8192).contains(&self.map_size) {
            return wrong("map-size", "must be a power of two from 16 to 8192");
        }
        if !(2..=1024).contains(&self.environment_height) {
            return wrong("environment-height", "must be 2 to 1024");
        }
        if self.fixed_maps {
            self.validate_with_fixed_maps()?;
        }
        if self.method == Method::Solver {
            self.validate_sizes_of_solver()?;
        }
        if self.samples == 0 || self.samples > 4096 {
            return wrong("samples", "must be 1 to 4096");
        }
        if self.bounces == 0 || self.bounces > MAX_BOUNCES {
            return wrong("bounces", "must be 1 to 16");
        }
        if self.views_per_step == 0 {
            return wrong("views-per-step", "must be at least 1");
        }
        if self.consistency != Consistency::None && self.views_per_step < 2 {
            return wrong("views-per-step", "must be at least 2 for consistency between views");
        }
        if !(1..=6).contains(&self.levels) || self.map_size >> (self.levels - 1) < 8 {
            return wrong("levels", "must be 1 to 6 and leave maps of at least 8 texels");
        }
        if self.steps_diffuse + self.steps_all == 0 {
            return wrong("steps-all", "must be at least 1");
        }
        if !(2..=64).contains(&self.solver_rounds) {
            return wrong("solver-rounds", "must be 2 to 64");
        }
        if !(1..=6).contains(&self.solver_levels) {
            return wrong("solver-levels", "must be 1 to 6");
        }
        if !(16..=4096).contains(&self.solver_grid) {
            return wrong("solver-grid", "must be 16 to 4096");
        }
        for (name, rate) in [
            ("rate-diffuse", self.rate_diffuse),
            ("rate-specular", self.rate_specular),
            ("rate-roughness", self.rate_roughness),
            ("rate-light", self.rate_light),
            ("final-rate", self.final_rate),
        ] {
            if !(rate.is_finite() && (0.0..=1.0).contains(&rate)) {
                return wrong(name, "must be 0 to 1");
            }
        }
        if !(self.light_smoothness.is_finite() && self.light_smoothness >= 0.0) {
            return wrong("light-smoothness", "must be 0 or more");
        }
        Ok(())
    }

    /// What says nothing, or something else, once the maps are given.
    fn validate_with_fixed_maps(&self) -> Result<()> {
        let wrong = |name: &str, message: &str, remedy: &str| {
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())).remedy(remedy))
        };
        if self.fixed_light {
            return wrong(
                "fixed-light",
                "with maps and environment both kept there is nothing to find",
                "leave out --fixed-light, or --maps",
            );
        }
        if self.method == Method::Adam {
            return wrong(
                "method",
                "only the solver keeps maps; Adam moves them in all of its steps",
                "leave out --method, and settings that are Adam's alone, such as --samples",
            );
        }
        Ok(())
    }

    /// What the solver keeps at once must fit into memory: square equations of the light, and what each point of the grid
    /// sees of it.
    fn validate_sizes_of_solver(&self) -> Result<()> {
        let too_large = |name: &str, message: String, remedy: &str| {
            Err(Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting(name.into())).remedy(remedy))
        };
        let height = self.environment_height;
        let (columns, rows) = LightShape::wide_hats((2 * height, height));
        let unknowns = columns * rows;
        if !self.fixed_light && unknowns > MOST_UNKNOWNS_OF_LIGHT {
            let message = format!("{unknowns} unknowns of the light are more than the solver can hold");
            return too_large("environment-height", message, "give an even number up to 64, or --method adam");
        }
        let grid = self.solver_grid.min(self.map_size);
        let bytes = grid * grid * 2 * height * height;
        if bytes > MOST_BYTES_OF_VISIBILITY {
            let message = format!(
                "what {grid} x {grid} points see of a light of {} x {height} texels takes {} GiB",
                2 * height,
                bytes >> 30
            );
            return too_large("solver-grid", message, "give a smaller --solver-grid or --environment-height");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked_by_name() {
        FitSettings::default().validate().unwrap();
        let error = FitSettings { map_size: 1000, ..Default::default() }.validate().unwrap_err();
        assert!(error.to_string().contains("--map-size"), "{error}");
        for wrong in [
            FitSettings { rate_diffuse: f32::NAN, ..Default::default() },
            FitSettings { light_smoothness: f32::NAN, ..Default::default() },
        ] {
            assert!(wrong.validate().is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn kept_maps_refuse_what_moves_them_and_what_leaves_nothing_to_find() {
        let base = || FitSettings { fixed_maps: true, method: Method::Solver, ..Default::default() };
        base().validate().unwrap();
        for (name, wrong) in [
            ("fixed-light", FitSettings { fixed_light: true, ..base() }),
            ("method", FitSettings { method: Method::Adam, ..base() }),
        ] {
            let error = wrong.validate().unwrap_err();
            assert_eq!((error.kind(), error.place()), (ErrorKind::InvalidSetting, &Place::Setting(name.into())));
            assert!(!error.remedy_text().is_empty(), "{error}");
        }
    }

    #[test]
    fn the_solver_refuses_sizes_that_no_memory_holds() {
        let of = |environment_height, solver_grid, fixed_light, method| {
            let own = FitSettings { environment_height, solver_grid, fixed_light, method, ..Default::default() };
            own.validate().map_err(|error| error.to_string())
        };
        let solver = Method::Solver;
        assert!(of(32, 256, false, solver).is_ok() && of(64, 512, false, solver).is_ok());
        assert!(of(256, 256, false, solver).unwrap_err().contains("--environment-height"));
        assert!(of(63, 256, false, solver).is_err(), "an odd height is not halved");
        assert!(of(128, 256, true, solver).is_ok(), "a known light has no unknowns");
        assert!(of(1024, 256, true, solver).unwrap_err().contains("GiB"));
        assert!(of(64, 4096, false, solver).unwrap_err().contains("--solver-grid"));
        assert!(of(1024, 4096, false, Method::Adam).is_ok());
    }
}
