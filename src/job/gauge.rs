//! Moving a finished fit along the freedom that photos leave: reflectance times a factor, light over it.
//!
//! [`crate::fit::gauge`] says which parts of the picture are exactly free (direct light on diffuse surfaces) and which
//! break the freedom (interreflection, the specular rise, a visible background, reflectance held at 1).
//! [`move_scale`] moves by a known factor, [`factor_of_patch`] finds the factor at which a patch of the map has a known
//! reflectance, such as a grey card of 18 %, and [`move_run`] writes a moved run into a new folder.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::export::{RunFolder, RunResult};
use crate::fit::gauge;
use crate::image::Image;
use crate::light::Environment;
use crate::material::texels::texel_of_uv;
use crate::material::{Material, MaterialMaps};
use glam::{Vec2, Vec3};
use std::path::Path;

use super::pictures::parameters;
use super::prepare::RunSettings;

/// A reflectance below this says nothing: any factor fits it.
const LEAST_REFLECTANCE: f32 = 1e-3;

/// Maps and light after a move.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// The maps; roughness is untouched.
    pub maps: MaterialMaps,
    /// The light.
    pub environment: Environment,
    /// Share in [0, 1] of the reflectances, over texels and channels, that were held at 1.
    pub bounded_share: f64,
}

/// Both reflectances times a factor per channel, the light over it.
///
/// # Errors
/// `InvalidSetting` for a factor that is not finite and positive.
pub fn move_scale(maps: &MaterialMaps, environment: &Environment, factor: Vec3) -> Result<Moved> {
    if !(factor.is_finite() && factor.min_element() > 0.0) {
        return Err(Error::new(ErrorKind::InvalidSetting, format!("{factor} is no factor of reflectance"))
            .at(Place::Setting("factor".into()))
            .remedy("give three numbers above 0"));
    }
    let mut own = parameters(maps, environment);
    let bounded_share = gauge::move_scale(&mut own, factor);
    let base = &own.texels.levels[0];
    let image = |colour: fn(&Material<f32>) -> [f32; 3]| {
        let pixels = base.texels.iter().map(|texel| Vec3::from_array(colour(texel)));
        Image::from_pixels(base.width, base.height, pixels.collect())
    };
    // Roughness as it was: through the logarithm that the tracer keeps it would be rounded.
    let maps = MaterialMaps {
        diffuse: image(|texel| texel.diffuse),
        specular: image(|texel| texel.specular),
        roughness: maps.roughness.clone(),
    };
    let environment = own.environment();
    if environment.radiance.pixels().iter().any(|radiance| !radiance.is_finite()) {
        return Err(Error::new(
            ErrorKind::InvalidSetting,
            format!("the environment divided by {factor} is not finite"),
        )
        .at(Place::Setting("factor".into()))
        .remedy("give a factor closer to 1"));
    }
    Ok(Moved { maps, environment, bounded_share })
}

/// The factor per channel at which the diffuse reflectance of a patch has the value `target` in [0, 1]. The patch is
/// the mean over the texels within `radius_texels` of the one at `uv` (v up); 0 is that texel alone.
///
/// # Errors
/// `InvalidSetting` for a place outside the map, a target out of range, or a patch too dark to measure.
pub fn factor_of_patch(maps: &MaterialMaps, uv: Vec2, radius_texels: usize, target: Vec3) -> Result<Vec3> {
    let wrong = |message: String, remedy: &str| {
        Error::new(ErrorKind::InvalidSetting, message).at(Place::Setting("patch".into())).remedy(remedy)
    };
    if !(uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()) {
        return Err(wrong(format!("{uv} is outside the map"), "u and v lie between 0 and 1, v is up"));
    }
    if !(target.cmpgt(Vec3::ZERO).all() && target.cmple(Vec3::ONE).all()) {
        return Err(wrong(format!("{target} is no reflectance"), "give a share above 0 and at most 1, as 0.18"));
    }
    let map = &maps.diffuse;
    let (row, column) = texel_of_uv(uv, map.width(), map.height());
    let range =
        |place: usize, count: usize| place.saturating_sub(radius_texels)..(place + radius_texels + 1).min(count);
    let (mut sum, mut count) = (Vec3::ZERO, 0.0);
    for near_row in range(row, map.height()) {
        for near_column in range(column, map.width()) {
            let (down, right) = (near_row.abs_diff(row), near_column.abs_diff(column));
            if down * down + right * right <= radius_texels * radius_texels {
                sum += map[(near_row, near_column)];
                count += 1.0;
            }
        }
    }
    let mean = sum / count;
    if !(mean.min_element() >= LEAST_REFLECTANCE) {
        return Err(wrong(
            format!("the patch at texel row {row} column {column} has the diffuse reflectance {mean}"),
            "choose a patch that is not black in any channel",
        ));
    }
    Ok(target / mean)
}

/// How a run is to be moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Move {
    /// By this factor per channel.
    Factor(Vec3),
    /// So that a patch gets this diffuse reflectance: [`factor_of_patch`].
    Patch {
        /// Place on the map, v up.
        uv: Vec2,
        /// Radius of the patch in texels.
        radius_texels: usize,
        /// Its diffuse reflectance.
        target: Vec3,
    },
}

/// What a move did.
#[derive(Clone, Debug, PartialEq)]
pub struct MovedRun {
    /// The factor per channel.
    pub factor: Vec3,
    /// Share in [0, 1] of the reflectances that were held at 1.
    pub bounded_share: f64,
    /// What the user should know.
    pub findings: Vec<Finding>,
}

/// Moves the result of a run into a new folder, with its settings; the old folder is only read. Checkpoint, loss and
/// report stay behind: they tell of the fit as it was.
///
/// # Errors
/// `Unwritable` when the new folder exists with anything in it; errors of reading and writing, and those of the move.
pub fn move_run(run: &Path, by: &Move, output: &Path) -> Result<MovedRun> {
    let folder = RunFolder::open(run)?;
    let result = folder.read_result()?;
    let settings: RunSettings = folder.read_settings()?;
    let factor = match *by {
        Move::Factor(factor) => factor,
        Move::Patch { uv, radius_texels, target } => factor_of_patch(&result.maps, uv, radius_texels, target)?,
    };
    let moved = move_scale(&result.maps, &result.environment, factor)?;
    if std::fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(Error::new(ErrorKind::Unwritable, "the folder is not empty")
            .at(Place::File(output.into()))
            .remedy("name a new folder with -o; nothing was changed"));
    }
    let mut findings = Vec::new();
    if moved.bounded_share > 0.0 {
        let message = format!(
            "{:.2} % of the reflectances would exceed 1 and were clamped: renders of those texels are darker",
            100.0 * moved.bounded_share
        );
        findings.push(
            Finding::new(Severity::Warning, "gauge-bounded", message)
                .remedy("move by a smaller factor, or check the patch"),
        );
    }
    let new = RunFolder::create(output)?;
    new.write_settings(&settings)?;
    let (maps, environment) = (moved.maps, moved.environment);
    new.write_result(&RunResult { maps, environment, ..result })?;
    Ok(MovedRun { factor, bounded_share: moved.bounded_share, findings })
}
