//! For how long the window hears nobody: while a scene is opened, and from Start on.
//!
//! Its thread takes in news, lays out panels and hands the drawing on; while it does, it hears no key. What counts is the
//! longest of these times over all frames, each from its news until its drawing begins to be handed on, the wait for an adapter
//! that is behind included.

use super::person::Person;
use super::scenes::BenchScene;
use crate::error::Result;
use crate::math::statistics::quantile;
use crate::studio::act::Act;

/// Seconds for which the window may hear nobody.
pub const MOST_SECONDS: f64 = 0.1;
/// How long a fit may take to begin or to stop, in seconds.
const LONG: f64 = 900.0;

/// The frames of one case.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct StallsRow {
    /// The scene.
    pub scene: String,
    /// What went on.
    pub case: String,
    /// Frames.
    pub frames: usize,
    /// The middle of their seconds.
    pub median: f64,
    /// The longest, in seconds.
    pub longest: f64,
}

/// Opens a scene in the window and starts the fit that suits it; the project is open afterwards, its fit stopped.
///
/// # Errors
/// Where it cannot be opened or fitted.
pub fn measure(person: &Person, scene: &BenchScene, seconds: f64) -> Result<Vec<StallsRow>> {
    let name = scene.name();
    let mut rows = Vec::new();
    let mut counted = |case: &str, work: &mut dyn FnMut() -> Result<()>| -> Result<()> {
        let before = person.shared.frames();
        work()?;
        let busy: Vec<f64> = person.shared.since(before).iter().filter_map(|glance| glance.busy_seconds).collect();
        rows.push(StallsRow {
            scene: name.clone(),
            case: case.into(),
            frames: busy.len(),
            median: quantile(&busy, 0.5),
            longest: busy.iter().copied().fold(f64::NAN, f64::max),
        });
        Ok(())
    };
    counted("opening", &mut || scene.open_as_it_is(person))?;
    counted("a fit, from Start on", &mut || {
        person.ask(|studio, _| studio.model.act(Act::Start))?;
        person.wait_until("a fit that runs", LONG, |studio| studio.model.fit.status.is_live())?;
        person.watch(seconds);
        Ok(())
    })?;
    person.ask(|studio, _| studio.model.act(Act::Stop))?;
    person.wait_until("a fit that has ended", LONG, |studio| !studio.model.fit.status.is_live())?;
    Ok(rows)
}
