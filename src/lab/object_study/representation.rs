//! Figure 2: how closely each model represents a measured material, by the figure of
//! [`crate::measured::metrics`].
//!
//! No photo is taken: each model is fitted to the whole table. Rows go to `fig2.csv` one by one, and what stands there
//! is not fitted again. DSBRDF comes last, since one fit of it takes as long as all others of a material together.
//!
//! The paper's unconditional model has a net for each material and channel. Here it has one for each material, and a code
//! for each of its channels; it begins at the weights that ship ([`crate::lab::neural::own_net`]).
//!
//! What is not here: the paper's leave-one-out (one training a material): ten materials are left out of one training
//! together, which is harder.

use super::StudyOptions;
use super::contender::{Contender, LEFT_OUT, LOBES, SEEN, name_of_left_out};
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::file;
use crate::insight::report::number::{escaped, fixed};
use crate::lab::bar_picture::{self, PictureBar};
use crate::lab::neural::own_net;
use crate::lab::rivals::rows::{ModelSummary, RivalRow, summarise};
use crate::measured::baseline::Baseline;
use crate::measured::category::Category;
use crate::measured::fits::NeuralFits;
use crate::measured::metrics::TableError;
use crate::measured::table::MeasuredBrdf;
use crate::neural::Trained;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Heading of the part.
pub const TITLE: &str = "Figure 2: how closely models represent measured materials";
/// First line of `fig2.csv`.
const HEADER: &str = "material,category,model,parameters,log_rmse,log10_rmse,cosine_rmse,cosine_mean,cells,seconds";
/// Every so many materials are fitted by a quick study.
const QUICK_STRIDE: usize = 22;
/// Materials left out of the training that a quick study adds.
const QUICK_LEFT_OUT: usize = 1;

/// One fit.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    row: RivalRow,
    seconds: f64,
}

impl Row {
    fn csv(&self) -> String {
        let (row, error) = (&self.row, self.row.error);
        format!(
            "{},{},\"{}\",{},{},{},{},{},{},{:.2}",
            row.material,
            row.category.label(),
            row.model,
            row.parameters,
            error.log_rmse,
            error.log10_rmse,
            error.cosine_rmse,
            error.cosine_mean,
            error.cells,
            self.seconds
        )
    }

    fn parse(line: &str) -> Option<Self> {
        let mut quoted = line.split('"');
        let (before, model, after) = (quoted.next()?, quoted.next()?, quoted.next()?);
        let material = before.split(',').next()?.to_string();
        let numbers: Vec<f64> = after.split(',').skip(1).map(|field| field.parse().ok()).collect::<Option<_>>()?;
        let [parameters, log_rmse, log10_rmse, cosine_rmse, cosine_mean, cells, seconds] = numbers.try_into().ok()?;
        let error = TableError { log_rmse, log10_rmse, cosine_rmse, cosine_mean, cells: cells as usize };
        let (category, model) = (Category::of(&material), model.to_string());
        let parameters = parameters as usize;
        Some(Row { row: RivalRow { material, category, model, parameters, error, sphere: None }, seconds })
    }
}

/// Fits what is not fitted yet, and writes `fig2.csv`, `fig2.md`, `fig2-by-kind.md` and `fig2.png`. Returns the tables
/// as Markdown, and as a section of a page.
///
/// # Errors
/// A library that cannot be read, results of another study in the folder, a fit that fails, a stop.
pub fn run(options: &StudyOptions, stop: &AtomicBool, tell: &dyn Fn(&str)) -> Result<(String, String)> {
    let fits = NeuralFits::read(&options.library)?;
    let left_out_model = Arc::new(options.trained()?);
    let left_out: Vec<String> = left_out_model.account.left_out.clone();
    let names: Vec<&str> = fits.materials.iter().map(|fit| fit.name.as_str()).collect();
    let stride = if options.quick { QUICK_STRIDE } else { 1 };
    let most_left_out = if options.quick { QUICK_LEFT_OUT } else { usize::MAX };
    let some_left_out: Vec<&String> = left_out.iter().filter(|name| names.contains(&name.as_str())).collect();
    let chosen: Vec<&str> = names
        .iter()
        .enumerate()
        .filter(|(index, name)| {
            index % stride == 0 || some_left_out.iter().take(most_left_out).any(|own| own.as_str() == **name)
        })
        .map(|(_, name)| *name)
        .collect();

    let shipped = Arc::new(crate::neural::shipped()?);
    let (seen, own) = (Contender::Flow(SEEN.into(), Arc::clone(&shipped)), Contender::OwnNet(shipped));
    let mut unseen = vec![(Contender::Flow(LEFT_OUT.into(), left_out_model), left_out.clone())];
    for path in &options.leave_out_weights {
        let trained = Trained::read(path)?;
        let left_out = trained.account.left_out.clone();
        unseen.push((Contender::Flow(name_of_left_out(&trained), Arc::new(trained)), left_out));
    }
    let path = options.output.join("fig2.csv");
    let mut rows = read_rows(&path)?;
    let mut fit = |contender: &Contender, material: &str, table: &mut Option<MeasuredBrdf>| -> Result<()> {
        if rows.iter().any(|own| own.row.material == material && own.row.model == contender.name()) {
            return Ok(());
        }
        if stop.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Stopped, "the study was stopped; started again it goes on"));
        }
        let table = match table {
            Some(table) => table,
            empty => empty.insert(fits.find(material)?.table()),
        };
        let began = Instant::now();
        let (parameters, error) = contender.fit(table, options.quick)?;
        let row = RivalRow {
            material: material.into(),
            category: Category::of(material),
            model: contender.name().into(),
            parameters,
            error,
            sphere: None,
        };
        let seconds = began.elapsed().as_secs_f64();
        tell(&format!("{material:<26} {:<22} log-RMSE {:.4}  {seconds:6.1} s", contender.name(), error.log_rmse));
        rows.push(Row { row, seconds });
        write_rows(&path, &rows)
    };
    for &material in &chosen {
        let mut table = None;
        fit(&own, material, &mut table)?;
        fit(&seen, material, &mut table)?;
        for (contender, left_out) in &unseen {
            if left_out.iter().any(|name| name == material) {
                fit(contender, material, &mut table)?;
            }
        }
        for rival in Baseline::ALL.into_iter().filter(|rival| *rival != Baseline::Dsbrdf) {
            fit(&Contender::Baseline(rival), material, &mut table)?;
        }
    }
    let began = Instant::now();
    let mut without = Vec::new();
    for &material in &chosen {
        let known = read_rows(&path)?;
        let is_known = known.iter().any(|own| own.row.material == material && own.row.model == Baseline::Dsbrdf.name());
        if !is_known && began.elapsed().as_secs_f64() >= 60.0 * options.dsbrdf_minutes {
            without.push(material);
            continue;
        }
        fit(&Contender::Baseline(Baseline::Dsbrdf), material, &mut None)?;
    }
    let rows: Vec<RivalRow> = read_rows(&path)?
        .into_iter()
        .map(|own| own.row)
        .filter(|row| chosen.contains(&row.material.as_str()))
        .collect();
    finish(options, &rows, &left_out, &without)
}

/// Tables and bars.
fn finish(
    options: &StudyOptions,
    rows: &[RivalRow],
    left_out: &[String],
    without_dsbrdf: &[&str],
) -> Result<(String, String)> {
    let of_left_out: Vec<RivalRow> = rows.iter().filter(|row| left_out.contains(&row.material)).cloned().collect();
    let has_dsbrdf = |row: &&RivalRow| !without_dsbrdf.contains(&row.material.as_str());
    let beside_dsbrdf: Vec<RivalRow> = rows.iter().filter(has_dsbrdf).cloned().collect();
    let mut text = format!("## {TITLE}\n\n{}", summary_markdown(rows));
    if !of_left_out.is_empty() {
        text += "\nOver the materials that were left out of the training, for all models:\n\n";
        text += &summary_markdown(&of_left_out);
    }
    if !without_dsbrdf.is_empty() && beside_dsbrdf.iter().any(|row| row.model == Baseline::Dsbrdf.name()) {
        text += "\nOver the materials that DSBRDF was fitted to, for all models:\n\n";
        text += &summary_markdown(&beside_dsbrdf);
    }
    text += &format!(
        "\nlog-RMSE in natural logarithms of stored values over all cells that count. \"{}\": all weights of a flow \
         fitted to each material, from those that ship on. \"{SEEN}\": weights trained on all \
         materials of the library, codes and colours of {LOBES} lobes fitted to each. \"{LEFT_OUT}\": weights that saw \
         none of {}. Data: MERL via neural fits (Sztrajman et al. 2021), not MERL itself; the neural fits are smoother \
         than what was measured.\n",
        own_net::NAME,
        left_out.join(", ")
    );
    if options.quick {
        text +=
            "\nA quick study: some materials, and the neural models fitted by half the points and steps or fewer.\n";
    }
    if !without_dsbrdf.is_empty() {
        text += &format!("\nDSBRDF was not fitted to {}.\n", without_dsbrdf.join(", "));
    }
    let kinds = by_kind_markdown(rows);
    let write = |name: &str, text: &str| crate::files::write_bytes(&options.output.join(name), text.as_bytes());
    write("fig2.md", &text)?;
    write("fig2-by-kind.md", &kinds)?;

    let overall: Vec<ModelSummary> = summarise(rows).into_iter().filter(|own| own.category.is_none()).collect();
    let mut bars: Vec<PictureBar> = overall
        .iter()
        .map(|own| PictureBar {
            label: format!("{} N={}", own.model, own.materials),
            value: own.mean,
            mark: Some(own.median),
        })
        .collect();
    bars.sort_by(|a, b| a.value.total_cmp(&b.value));
    let picture = bar_picture::bars("log-RMSE: bar = mean, tick = median, N = materials", &bars);
    file::write_png_srgb8(&options.output.join("fig2.png"), &picture)?;
    let shown = bar_picture::embedded(&picture, "log-RMSE of the models")?;
    let section = format!("{shown}<pre>{}</pre><pre>{}</pre>", escaped(&text), escaped(&kinds));
    Ok((format!("{text}\n{kinds}\n"), section))
}

fn summary_markdown(rows: &[RivalRow]) -> String {
    let mut text = String::from(
        "| model | materials | parameters | mean | median | quartiles | largest |\n\
         | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    let mut all: Vec<ModelSummary> = summarise(rows).into_iter().filter(|own| own.category.is_none()).collect();
    all.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    for own in all {
        let parameters = rows.iter().find(|row| row.model == own.model).map_or(0, |row| row.parameters);
        text += &format!(
            "| {} | {} | {parameters} | {} | {} | {} – {} | {} |\n",
            own.model,
            own.materials,
            fixed(own.mean, 3),
            fixed(own.median, 3),
            fixed(own.quartiles.0, 3),
            fixed(own.quartiles.1, 3),
            fixed(own.largest, 3)
        );
    }
    text
}

/// Mean and median of each model over each kind of material.
fn by_kind_markdown(rows: &[RivalRow]) -> String {
    let summaries = summarise(rows);
    let models: Vec<&str> = summaries.iter().filter(|s| s.category.is_none()).map(|s| s.model.as_str()).collect();
    let mut text =
        format!("| kind | materials | {} |\n| --- | ---: |{}\n", models.join(" | "), " ---: |".repeat(models.len()));
    let mut kinds: Vec<Option<Category>> = summaries.iter().map(|summary| summary.category).collect();
    kinds.dedup();
    for kind in kinds {
        let of_kind: Vec<&ModelSummary> = summaries.iter().filter(|summary| summary.category == kind).collect();
        let count = of_kind.iter().map(|summary| summary.materials).max().unwrap_or(0);
        text += &format!("| {} | {count} |", kind.map_or("all", |kind| kind.label()));
        for model in &models {
            text += &match of_kind.iter().find(|summary| summary.model == *model) {
                Some(summary) if summary.materials < count => {
                    format!(" {} / {} ({}) |", fixed(summary.mean, 3), fixed(summary.median, 3), summary.materials)
                }
                Some(summary) => format!(" {} / {} |", fixed(summary.mean, 3), fixed(summary.median, 3)),
                None => " – |".into(),
            };
        }
        text.push('\n');
    }
    text + "\nMean / median log-RMSE; in brackets the number of materials where it is smaller than the row's.\n"
}

fn read_rows(path: &Path) -> Result<Vec<Row>> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let text = crate::scene::read::camera_file::read_text(path)?;
    let wrong = |line: usize| {
        Error::new(ErrorKind::Malformed, "not a row of this study")
            .at(Place::Line(path.into(), line))
            .remedy("delete the file, or name another folder with -o")
    };
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) {
        return Err(wrong(1));
    }
    lines
        .enumerate()
        .filter(|(_, line)| !line.is_empty())
        .map(|(index, line)| Row::parse(line).ok_or_else(|| wrong(index + 2)))
        .collect()
}

fn write_rows(path: &Path, rows: &[Row]) -> Result<()> {
    let lines: Vec<String> = rows.iter().map(Row::csv).collect();
    crate::files::write_bytes(path, format!("{HEADER}\n{}\n", lines.join("\n")).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(material: &str, model: &str, log_rmse: f64) -> Row {
        let error = TableError { log_rmse, log10_rmse: 0.5, cosine_rmse: 0.25, cosine_mean: 0.125, cells: 7 };
        let (category, model) = (Category::of(material), model.to_string());
        Row {
            row: RivalRow { material: material.into(), category, model, parameters: 8, error, sphere: None },
            seconds: 1.25,
        }
    }

    #[test]
    fn rows_survive_their_file_and_a_foreign_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fig2.csv");
        assert!(read_rows(&path).unwrap().is_empty());
        let rows = vec![row("steel", LEFT_OUT, 0.1), row("pink-felt", "GGX", 0.3)];
        write_rows(&path, &rows).unwrap();
        assert_eq!(read_rows(&path).unwrap(), rows);
        crate::files::write_bytes(&path, format!("{HEADER}\nsteel,metal,\"GGX\",8,x\n").as_bytes()).unwrap();
        assert!(read_rows(&path).unwrap_err().to_string().contains("line 2"));
        crate::files::write_bytes(&path, b"something else\n").unwrap();
        assert!(read_rows(&path).is_err());
    }

    #[test]
    fn tables_say_of_how_many_materials_they_speak() {
        let rows = [row("steel", "A", 0.1), row("brass", "A", 0.3), row("steel", "B", 0.4)].map(|own| own.row);
        let text = summary_markdown(&rows);
        assert!(text.contains("| A | 2 | 8 | 0.200 | 0.200 |") && text.contains("| B | 1 | 8 | 0.400 |"), "{text}");
        let kinds = by_kind_markdown(&rows);
        assert!(kinds.contains("| metal | 2 | 0.200 / 0.200 | 0.400 / 0.400 (1) |"), "{kinds}");
    }
}
