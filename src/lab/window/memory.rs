//! Memory over cycles of open, fit some steps, close.

use super::machine;
use super::person::Person;
use super::scenes::BenchScene;
use crate::error::Result;
use crate::fit::FitSettings;
use crate::studio::act::Act;
use eframe::egui::Key;
use std::time::Instant;

/// Steps of the fit in each cycle.
const STEPS: usize = 3;
/// Seconds that threads of a closed project may take to end.
const ENDING: f64 = 20.0;

/// What was left after a cycle.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct MemoryRow {
    /// The number of the cycle, from 1.
    pub cycle: usize,
    /// Seconds since the first cycle began.
    pub seconds: f64,
    /// Memory in place, in bytes.
    pub resident_bytes: Option<u64>,
    /// Threads.
    pub threads: Option<usize>,
    /// Open files.
    pub files: Option<usize>,
}

/// What the cycles tell together.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct MemoryTrend {
    /// Bytes a cycle, by least squares over the second half of the cycles.
    pub slope_bytes: f64,
    /// Standard error of the slope in bytes a cycle.
    pub slope_error_bytes: f64,
}

/// Opens, fits and closes over and over.
///
/// # Errors
/// Where a cycle does not come to its end.
pub fn measure(person: &Person, scene: &BenchScene, cycles: usize, tell: &dyn Fn(&str)) -> Result<Vec<MemoryRow>> {
    let began = Instant::now();
    let mut rows = Vec::new();
    for cycle in 1..=cycles {
        scene.open(person)?;
        person.ask(|studio, _| {
            let fit = &mut studio.model.edits.fit;
            *fit = FitSettings { map_size: 512, levels: 1, views_per_step: 3, samples: 2, ..fit.clone() };
            studio.model.act(Act::Start);
        })?;
        person.wait_until("some steps", 300.0, |studio| {
            studio.model.fit.losses.last().is_some_and(|row| row.step >= STEPS)
                || !studio.model.fit.status.is_live() && !studio.model.tasks.is_busy()
        })?;
        for key in [Key::ArrowRight, Key::Num2, Key::CloseBracket, Key::C, Key::G, Key::Num1] {
            person.press(key);
            person.watch(0.08);
        }
        person.ask(|studio, _| {
            studio.model.act(Act::CloseProject);
            super::slowdown::forget_run(studio);
        })?;
        let closed = Instant::now();
        while machine::threads_named("patina-fit").unwrap_or(0) > 0 && closed.elapsed().as_secs_f64() < ENDING {
            person.watch(0.05);
        }
        person.watch(0.4);
        rows.push(MemoryRow {
            cycle,
            seconds: began.elapsed().as_secs_f64(),
            resident_bytes: machine::resident_bytes(),
            threads: machine::threads_named(""),
            files: machine::open_files(),
        });
        if let Some(bytes) = rows.last().and_then(|row| row.resident_bytes) {
            tell(&format!("cycle {cycle} of {cycles}: {:.0} MiB", bytes as f64 / f64::from(1 << 20)));
        }
    }
    Ok(rows)
}

/// The trend of the second half: the first cycles fill caches and pools that stay.
pub fn trend(rows: &[MemoryRow]) -> Option<MemoryTrend> {
    let points: Vec<(f64, f64)> =
        rows[rows.len() / 2..].iter().filter_map(|row| Some((row.cycle as f64, row.resident_bytes? as f64))).collect();
    let count = points.len() as f64;
    if points.len() < 3 {
        return None;
    }
    let mean_x = points.iter().map(|point| point.0).sum::<f64>() / count;
    let mean_y = points.iter().map(|point| point.1).sum::<f64>() / count;
    let spread = points.iter().map(|point| (point.0 - mean_x).powi(2)).sum::<f64>();
    let slope = points.iter().map(|point| (point.0 - mean_x) * (point.1 - mean_y)).sum::<f64>() / spread;
    let rest = points.iter().map(|point| (point.1 - mean_y - slope * (point.0 - mean_x)).powi(2)).sum::<f64>();
    Some(MemoryTrend { slope_bytes: slope, slope_error_bytes: (rest / (count - 2.0) / spread).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trend_is_that_of_the_second_half() {
        let row = |cycle: usize| MemoryRow {
            cycle,
            resident_bytes: Some(if cycle <= 10 { 1 << (20 + cycle) } else { 5_000_000_000 + 1000 * cycle as u64 }),
            ..Default::default()
        };
        let rows: Vec<MemoryRow> = (1..=20).map(row).collect();
        let trend = trend(&rows).unwrap();
        assert!((trend.slope_bytes - 1000.0).abs() < 1e-3 && trend.slope_error_bytes < 1e-3, "{trend:?}");
        assert_eq!(super::trend(&rows[..3]), None);
    }
}
