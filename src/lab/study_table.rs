//! Numbers over seeds: a table of medians and quartiles as Markdown, CSV and plots.
//!
//! A study fills the table with one value a seed, in any order of rows; what is written does not depend on threads.

use crate::error::Result;
use crate::insight::plot::{self, Bar, LinePlot, Scale, Series};
use crate::insight::report::number::short;
use crate::math::statistics::quantile;
use std::path::Path;

/// What a column holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name, such as `diffuse RMSE`.
    pub name: String,
    /// Unit, such as `s` or `dB`; empty for a ratio.
    pub unit: String,
}

/// Median and quartiles of one cell, over the finite values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// The middle.
    pub median: f64,
    /// A quarter of the values lie below.
    pub lower_quartile: f64,
    /// A quarter of the values lie above.
    pub upper_quartile: f64,
    /// Number of finite values.
    pub count: usize,
    /// Number of values that are not finite: failures, never left unsaid.
    pub non_finite: usize,
}

/// Rows of cases, columns of measures, a list of values in each cell: one a seed.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyTable {
    /// Title of the table.
    pub title: String,
    /// What the rows are, such as `setting`.
    pub row_heading: String,
    /// The measures.
    pub columns: Vec<Column>,
    rows: Vec<(String, Vec<Vec<f64>>)>,
    /// What several values of a cell are, and what is printed of them: a sentence.
    caption: String,
    /// Sentences below the table: what was run, what it shows.
    pub notes: Vec<String>,
}

impl StudyTable {
    /// An empty table with these columns, given as (name, unit).
    pub fn new(title: &str, row_heading: &str, columns: &[(&str, &str)]) -> Self {
        StudyTable {
            title: title.into(),
            row_heading: row_heading.into(),
            columns: columns.iter().map(|(name, unit)| Column { name: (*name).into(), unit: (*unit).into() }).collect(),
            rows: Vec::new(),
            caption: "Median over seeds, in brackets the quartiles.".into(),
            notes: Vec::new(),
        }
    }

    /// The same table with another sentence about what several values of a cell are: by default they are of seeds.
    pub fn with_caption(self, caption: &str) -> Self {
        StudyTable { caption: caption.into(), ..self }
    }

    /// Adds the values of one seed to a row, one a column; the row is made when it is new. Missing values become NaN,
    /// surplus ones are dropped.
    pub fn add(&mut self, row: &str, values: &[f64]) {
        let value = |column: usize| Some(values.get(column).copied().unwrap_or(f64::NAN));
        self.add_some(row, &(0..self.columns.len()).map(value).collect::<Vec<_>>());
    }

    /// Adds values to a row that has no such thing in some columns: those are `None` or missing, and are no failures.
    pub fn add_some(&mut self, row: &str, values: &[Option<f64>]) {
        let columns = self.columns.len();
        let index = self.rows.iter().position(|(name, _)| name == row).unwrap_or_else(|| {
            self.rows.push((row.into(), vec![Vec::new(); columns]));
            self.rows.len() - 1
        });
        for (cell, value) in self.rows[index].1.iter_mut().zip(values) {
            cell.extend(*value);
        }
    }

    /// The values of a cell, in the order they were added; empty outside the table.
    pub fn values(&self, row: usize, column: usize) -> &[f64] {
        self.rows.get(row).and_then(|(_, cells)| cells.get(column)).map_or(&[], Vec::as_slice)
    }

    /// Median and quartiles of a cell; NaN when no value is finite.
    pub fn summary(&self, row: usize, column: usize) -> Summary {
        let values = self.values(row, column);
        let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        Summary {
            median: quantile(&finite, 0.5),
            lower_quartile: quantile(&finite, 0.25),
            upper_quartile: quantile(&finite, 0.75),
            count: finite.len(),
            non_finite: values.len() - finite.len(),
        }
    }

    /// A Markdown table: `median (lower quartile – upper quartile)`, and how many values failed.
    pub fn to_markdown(&self) -> String {
        let plain = |text: &str| text.replace('|', "/").replace('\n', " ");
        let mut text = format!("## {}\n\n| {} |", plain(&self.title), plain(&self.row_heading));
        for column in &self.columns {
            text += &format!(" {} |", plain(&heading(column)));
        }
        text += "\n| --- |";
        text += &" ---: |".repeat(self.columns.len());
        text.push('\n');
        for (row, (name, _)) in self.rows.iter().enumerate() {
            text += &format!("| {} |", plain(name));
            for column in 0..self.columns.len() {
                text += &format!(" {} |", cell_text(&self.summary(row, column)));
            }
            text.push('\n');
        }
        if self.rows.is_empty() {
            text += "\nNo case was run.\n";
        }
        text += &format!("\n{}\n", self.caption);
        for note in &self.notes {
            text += &format!("\n{note}\n");
        }
        text
    }

    /// One line a row and column: counts, median and quartiles, with all digits.
    pub fn to_csv(&self) -> String {
        let mut text = format!("{},measure,unit,count,non_finite,median,lower_quartile,upper_quartile\n", self.head());
        for (row, (name, _)) in self.rows.iter().enumerate() {
            for (index, column) in self.columns.iter().enumerate() {
                let s = self.summary(row, index);
                let words = [name, &column.name, &column.unit].map(|word| csv_word(word)).join(",");
                text += &format!(
                    "{words},{},{},{},{},{}\n",
                    s.count, s.non_finite, s.median, s.lower_quartile, s.upper_quartile
                );
            }
        }
        text
    }

    /// One line a value: for whoever wants to look again.
    pub fn samples_csv(&self) -> String {
        let mut text = format!("{},measure,unit,sample,value\n", self.head());
        for (name, cells) in &self.rows {
            for (column, cell) in self.columns.iter().zip(cells) {
                let words = [name, &column.name, &column.unit].map(|word| csv_word(word)).join(",");
                for (sample, value) in cell.iter().enumerate() {
                    text += &format!("{words},{sample},{value}\n");
                }
            }
        }
        text
    }

    /// Bars of the medians of one column with the quartiles as whiskers; `None` when there is nothing to show.
    pub fn bar_svg(&self, column: usize) -> Option<String> {
        let bars: Vec<Bar> = (0..self.rows.len())
            .map(|row| {
                let s = self.summary(row, column);
                let range = Some((s.lower_quartile, s.upper_quartile));
                Bar { label: self.rows[row].0.clone(), value: s.median, range }
            })
            .collect();
        plot::bar_svg(&heading(self.columns.get(column)?), &bars)
    }

    /// Medians of one column over another, one point a row, joined in the order of the rows: error over seconds.
    pub fn line_svg(&self, x_column: usize, y_columns: &[usize], x_scale: Scale, y_scale: Scale) -> Option<String> {
        let series = y_columns
            .iter()
            .map(|&y_column| {
                let point = |row: usize| (self.summary(row, x_column).median, self.summary(row, y_column).median);
                let points = (0..self.rows.len()).map(point).collect();
                Some(Series { name: heading(self.columns.get(y_column)?), points, marked: true })
            })
            .collect::<Option<Vec<Series>>>()?;
        LinePlot {
            x_label: heading(self.columns.get(x_column)?),
            y_label: series.first().map(|series| series.name.clone()).unwrap_or_default(),
            x_scale,
            y_scale,
            series,
            marks: Vec::new(),
        }
        .svg()
    }

    /// Writes `STEM.md`, `STEM.csv`, `STEM-samples.csv` and, when a value is finite, `STEM.svg` with the bars of every
    /// column.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<()> {
        let write = |suffix: &str, text: &str| {
            crate::files::write_bytes(&folder.join(format!("{stem}{suffix}")), text.as_bytes())
        };
        write(".md", &self.to_markdown())?;
        write(".csv", &self.to_csv())?;
        write("-samples.csv", &self.samples_csv())?;
        let plots: Vec<String> = (0..self.columns.len()).filter_map(|column| self.bar_svg(column)).collect();
        if plots.is_empty() { Ok(()) } else { write(".svg", &plot::standalone(&plots)) }
    }

    fn head(&self) -> String {
        csv_word(&self.row_heading)
    }
}

fn heading(column: &Column) -> String {
    if column.unit.is_empty() { column.name.clone() } else { format!("{} [{}]", column.name, column.unit) }
}

fn cell_text(summary: &Summary) -> String {
    let mut text = match summary.count {
        0 => "–".to_string(),
        1 => short(summary.median),
        _ => {
            let (low, high) = (short(summary.lower_quartile), short(summary.upper_quartile));
            format!("{} ({low} – {high})", short(summary.median))
        }
    };
    if summary.non_finite > 0 {
        text += &format!(", {} failed", summary.non_finite);
    }
    text
}

/// A field of a CSV file, quoted when it must be (RFC 4180).
fn csv_word(word: &str) -> String {
    if word.contains([',', '"', '\n', '\r']) { format!("\"{}\"", word.replace('"', "\"\"")) } else { word.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> StudyTable {
        let mut table = StudyTable::new("MVCL", "setting", &[("diffuse RMSE", ""), ("time", "s")]);
        for (seed, value) in [0.1, 0.2, 0.3, 0.4, 0.5].into_iter().enumerate() {
            table.add("none", &[value, 10.0 + seed as f64]);
            table.add("exact, twice", &[value / 2.0, if seed == 2 { f64::NAN } else { 20.0 }]);
        }
        table
    }

    #[test]
    fn medians_quartiles_and_failures() {
        let table = table();
        let s = table.summary(0, 0);
        assert_eq!((s.median, s.lower_quartile, s.upper_quartile, s.count), (0.3, 0.2, 0.4, 5));
        assert_eq!(table.summary(1, 1).non_finite, 1);
        assert!(table.summary(7, 7).median.is_nan());
        let markdown = table.to_markdown();
        assert!(markdown.contains("| none | 0.3 (0.2 – 0.4) | 12 (11 – 13) |"), "{markdown}");
        assert!(markdown.contains("20 (20 – 20), 1 failed"), "{markdown}");
        assert!(markdown.contains("Median over seeds"));
        let once = table.clone().with_caption("One value a case.").to_markdown();
        assert!(once.contains("One value a case.") && !once.contains("seeds"), "{once}");
        let mut partial = table.clone();
        partial.add_some("rays alone", &[Some(7.0)]);
        assert!(partial.to_markdown().contains("| rays alone | 7 | – |"), "{}", partial.to_markdown());
        let csv = table.to_csv();
        assert!(csv.contains("\"exact, twice\",time,s,4,1,20,20,20\n"), "{csv}");
        assert_eq!(table.samples_csv().lines().count(), 1 + 2 * 2 * 5);
    }

    #[test]
    fn files_are_written_and_empty_tables_say_so() {
        let folder = tempfile::tempdir().unwrap();
        table().write(folder.path(), "mvcl").unwrap();
        let svg = std::fs::read_to_string(folder.path().join("mvcl.svg")).unwrap();
        assert!(svg.contains("exact, twice") && svg.matches("class='bar'").count() == 4);
        assert!(table().line_svg(1, &[0], Scale::Linear, Scale::Logarithmic).unwrap().contains("<polyline"));

        let mut empty = StudyTable::new("empty", "case", &[("x", "")]);
        assert!(empty.to_markdown().contains("No case was run"));
        assert!(empty.bar_svg(0).is_none() && empty.line_svg(0, &[3], Scale::Linear, Scale::Linear).is_none());
        empty.add("short row", &[]);
        empty.write(folder.path(), "empty").unwrap();
        assert!(!folder.path().join("empty.svg").exists());
    }
}
