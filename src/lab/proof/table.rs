//! Rows of the proof, their bars, and their pictures.

use super::cases::{Case, Noisy, Reference};
use super::figures::{Figures, ZScores, figures, plain_rmse, side_by_side, z_scores};
use super::lights;
use crate::error::Result;
use crate::image::{RgbImage, file};
use crate::material::LobeModel;
use glam::Vec3;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Largest root mean squared error over the mean, for lobes that the other program has too.
pub const LARGEST_RMSE: f64 = 0.03;
/// Largest root mean square of z; variances from 16 pictures on both sides give about 1.035.
pub const LARGEST_Z: f64 = 1.15;
/// Largest share of z beyond 3; variances from 16 pictures on both sides give about 0.5 %.
pub const LARGEST_SHARE_ABOVE_3: f64 = 0.01;
/// A light as it is comes at least so many times nearer than one that is turned.
pub const LEAST_ADVANTAGE: f64 = 3.0;

/// The page for browsers among the programs.
const PAGE: &str = "page";

/// One comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Who rendered.
    pub program: String,
    /// `LOBE/LIGHT`.
    pub case: String,
    /// Means over the views.
    pub figures: Figures,
    /// Of the exact lobe.
    pub z: Option<ZScores>,
    /// The least error against a reference whose light is turned or mirrored.
    pub turned: Option<f64>,
    /// What is asked, and whether it holds; `None` where the figure is stated only.
    pub bar: Option<(String, bool)>,
}

/// What a checker said of a file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The checker.
    pub name: String,
    /// Its errors; `None` when it was not asked.
    pub errors: Option<Vec<String>>,
    /// Why it was not asked.
    pub note: String,
}

/// All that was compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// Pictures.
    pub rows: Vec<Row>,
    /// Files.
    pub checks: Vec<Check>,
}

impl Table {
    /// A line for each bar that is missed.
    pub fn missed(&self) -> Vec<String> {
        let rows = self.rows.iter().filter_map(|row| match &row.bar {
            Some((bar, false)) => Some(format!("{} {}: {bar}", row.program, row.case)),
            _ => None,
        });
        let checks = self.checks.iter().filter_map(|check| match &check.errors {
            Some(errors) if !errors.is_empty() => Some(format!("{}: {}", check.name, errors.join("; "))),
            _ => None,
        });
        rows.chain(checks).collect()
    }

    /// The table for a reader.
    pub fn to_markdown(&self) -> String {
        let mut text = String::from(
            "| program | lobe/light | RMSE of the mean | noise | factor | SSIM | z: mean, RMS, beyond 3 | turned light | bar |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let Figures { rmse, noise, factor, ssim } = row.figures;
            let z = row.z.map_or(String::new(), |z| {
                format!("{:+.3}, {:.3}, {:.2} %", z.mean, z.root_mean_square, 100.0 * z.above_3)
            });
            let turned = row.turned.map_or(String::new(), |turned| format!("{:.0} %", 100.0 * turned));
            let bar = match &row.bar {
                None => "stated".into(),
                Some((bar, true)) => format!("{bar}: holds"),
                Some((bar, false)) => format!("**{bar}: MISSED**"),
            };
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} % | {:.2} % | {factor:.3} | {ssim:.4} | {z} | {turned} | {bar} |",
                row.program,
                row.case,
                100.0 * rmse,
                100.0 * noise
            );
        }
        text.push_str("\n| checker | errors |\n|---|---|\n");
        for check in &self.checks {
            let said = match &check.errors {
                None => format!("not asked: {}", check.note),
                Some(errors) if errors.is_empty() => "none".into(),
                Some(errors) => format!("**{}**", errors.join("; ")),
            };
            let _ = writeln!(text, "| {} | {said} |", check.name);
        }
        text
    }
}

/// Collects rows and draws their pictures.
pub struct Judged<'a> {
    /// The rows so far.
    pub table: Table,
    pictures: PathBuf,
    tell: &'a dyn Fn(&str),
}

impl<'a> Judged<'a> {
    /// Pictures go to `pictures` under the output folder; `tell` hears a line for each row.
    pub fn new(output: &Path, tell: &'a dyn Fn(&str)) -> Self {
        Judged { table: Table::default(), pictures: output.join("pictures"), tell }
    }

    /// A checker's answer.
    pub fn files(&mut self, name: &str, errors: Vec<String>) {
        let said = if errors.is_empty() { "no errors".into() } else { errors.join("; ") };
        (self.tell)(&format!("{name}: {said}"));
        self.table.checks.push(Check { name: name.into(), errors: Some(errors), note: String::new() });
    }

    /// A checker that was not asked, and why.
    pub fn left_out(&mut self, name: &str, why: &str) {
        (self.tell)(&format!("{name} was not asked: {why}"));
        self.table.checks.push(Check { name: name.into(), errors: None, note: why.into() });
    }

    /// Judges a program's pictures of a case.
    ///
    /// # Errors
    /// Pictures of other sizes than the references; files that cannot be written.
    pub fn pictures(&mut self, case: &Case, program: &str, pictures: &[Noisy]) -> Result<()> {
        let figures = self.figures_of(case, program, &case.references, pictures)?;
        let z = (program == "mitsuba-exact").then(|| mean_of_z(&case.references, pictures));
        let turned = (case.light.name == lights::TEXEL).then(|| least_turned(&case.references, pictures));
        let bar = bar_of(program, case, &figures, z.as_ref(), turned);
        self.add(Row { program: program.into(), case: case.name.clone(), figures, z, turned, bar });
        Ok(())
    }

    /// Judges the page's pictures of a case. The page shows nothing brighter than white: the references are cut alike.
    ///
    /// # Errors
    /// As of [`Judged::pictures`].
    pub fn page(&mut self, case: &Case, pictures: &[Noisy]) -> Result<()> {
        let cut_of = |picture: &mut RgbImage| picture.pixels_mut().iter_mut().for_each(|rgb| *rgb = rgb.min(Vec3::ONE));
        let cut: Vec<Reference> = case
            .references
            .iter()
            .map(|reference| {
                let mut cut = reference.clone();
                cut_of(&mut cut.picture.mean);
                cut.wrong.iter_mut().for_each(cut_of);
                cut
            })
            .collect();
        let figures = self.figures_of(case, PAGE, &cut, pictures)?;
        let turned = (case.light.name == lights::TEXEL).then(|| least_turned(&cut, pictures));
        let bar = turned.and_then(|_| bar_of(PAGE, case, &figures, None, turned));
        self.add(Row { program: PAGE.into(), case: case.name.clone(), figures, z: None, turned, bar });
        Ok(())
    }

    fn add(&mut self, row: Row) {
        let whole = Table { rows: vec![row.clone()], checks: Vec::new() }.to_markdown();
        (self.tell)(whole.lines().nth(2).unwrap_or_default());
        self.table.rows.push(row);
    }

    fn figures_of(&self, case: &Case, program: &str, references: &[Reference], pictures: &[Noisy]) -> Result<Figures> {
        let mut sum = Figures::default();
        for (index, (reference, picture)) in references.iter().zip(pictures).enumerate() {
            let own = figures(reference, picture)?;
            sum.rmse += own.rmse * own.rmse;
            sum.noise += own.noise * own.noise;
            sum.factor += own.factor;
            sum.ssim += own.ssim;
            let name = format!("{}_{program}_{index}.png", case.name.replace('/', "_"));
            file::write_png_srgb8(&self.pictures.join(name), &side_by_side(reference, picture))?;
        }
        let count = references.len().max(1) as f64;
        Ok(Figures {
            rmse: (sum.rmse / count).sqrt(),
            noise: (sum.noise / count).sqrt(),
            factor: sum.factor / count,
            ssim: sum.ssim / count,
        })
    }
}

fn mean_of_z(references: &[Reference], pictures: &[Noisy]) -> ZScores {
    let mut sum = ZScores::default();
    for (reference, picture) in references.iter().zip(pictures) {
        let own = z_scores(reference, picture);
        sum.mean += own.mean;
        sum.root_mean_square += own.root_mean_square * own.root_mean_square;
        sum.above_3 += own.above_3;
    }
    let count = references.len().max(1) as f64;
    ZScores {
        mean: sum.mean / count,
        root_mean_square: (sum.root_mean_square / count).sqrt(),
        above_3: sum.above_3 / count,
    }
}

/// The least error, in the mean over views, against the references of one wrong light.
fn least_turned(references: &[Reference], pictures: &[Noisy]) -> f64 {
    let kinds = references.iter().map(|reference| reference.wrong.len()).min().unwrap_or(0);
    let error_of = |kind: usize| {
        let pairs = references.iter().zip(pictures);
        let errors = pairs.map(|(reference, picture)| {
            let mut other = reference.clone();
            other.picture.mean = reference.wrong[kind].clone();
            plain_rmse(&other, &picture.mean)
        });
        errors.sum::<f64>() / references.len().max(1) as f64
    };
    (0..kinds).map(error_of).fold(f64::INFINITY, f64::min)
}

/// What is asked of a row, and whether it holds.
fn bar_of(
    program: &str,
    case: &Case,
    figures: &Figures,
    z: Option<&ZScores>,
    turned: Option<f64>,
) -> Option<(String, bool)> {
    if let Some(z) = z {
        let holds = z.root_mean_square <= LARGEST_Z && z.above_3 <= LARGEST_SHARE_ABOVE_3;
        return Some(("within noise".into(), holds));
    }
    if let Some(turned) = turned {
        let seen = figures.rmse.hypot(figures.noise);
        return Some((format!("{LEAST_ADVANTAGE} x nearer than turned"), turned >= LEAST_ADVANTAGE * seen));
    }
    let has_bar = case.lobe == LobeModel::Ggx && program != "cycles-glb-sun";
    has_bar.then(|| (format!("RMSE <= {:.0} %", 100.0 * LARGEST_RMSE), figures.rmse <= LARGEST_RMSE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_that_is_missed_is_named() {
        let row = |rmse: f64, holds: bool| Row {
            program: "other".into(),
            case: "ggx/own".into(),
            figures: Figures { rmse, ..Figures::default() },
            z: None,
            turned: None,
            bar: Some(("RMSE <= 3 %".into(), holds)),
        };
        let check = |errors: &[&str]| Check {
            name: "checker".into(),
            errors: Some(errors.iter().map(|error| error.to_string()).collect()),
            note: String::new(),
        };
        let fine = Table { rows: vec![row(0.01, true)], checks: vec![check(&[])] };
        assert!(fine.missed().is_empty());
        let table = Table { rows: vec![row(0.01, true), row(0.2, false)], checks: vec![check(&["no accessor"])] };
        assert_eq!(table.missed(), ["other ggx/own: RMSE <= 3 %", "checker: no accessor"]);
        let text = table.to_markdown();
        assert!(text.contains("20.00 %") && text.contains("MISSED") && text.contains("**no accessor**"), "{text}");
    }
}
