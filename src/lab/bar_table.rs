//! A table of what was asked, its figures, and which bars are missed.

use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use std::fmt::Write;

/// One thing that was asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BarRow {
    /// What was asked.
    pub name: String,
    /// One for each column behind the name.
    pub figures: Vec<String>,
    /// What falls short; `None` when the bar holds.
    pub shortfall: Option<String>,
}

/// All that was asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BarTable {
    /// Headings of name and figures.
    pub columns: Vec<&'static str>,
    /// The rows.
    pub rows: Vec<BarRow>,
}

impl BarTable {
    /// A table without rows.
    pub fn new(columns: &[&'static str]) -> Self {
        BarTable { columns: columns.to_vec(), rows: Vec::new() }
    }

    /// The table for a reader.
    pub fn to_markdown(&self) -> String {
        let mut text = format!("| {} | bar |\n|{}\n", self.columns.join(" | "), "---|".repeat(self.columns.len() + 1));
        for BarRow { name, figures, shortfall } in &self.rows {
            let bar = shortfall.as_ref().map_or("holds".into(), |shortfall| format!("**MISSED: {shortfall}**"));
            let _ = writeln!(text, "| {name} | {} | {bar} |", figures.join(" | "));
        }
        text
    }

    /// A line for each row whose bar is missed.
    pub fn missed(&self) -> Vec<String> {
        let missed = |row: &BarRow| Some(format!("{}: {}", row.name, row.shortfall.as_ref()?));
        self.rows.iter().filter_map(missed).collect()
    }

    /// Nothing when every bar holds.
    ///
    /// # Errors
    /// `Numerical` with the rows that fall short, also where nothing was asked at all.
    pub fn judged(&self, remedy: &str) -> Result<()> {
        let missed = self.missed();
        if !missed.is_empty() || self.rows.is_empty() {
            let message = match missed.len() {
                0 => "nothing was asked".to_string(),
                count => format!("{count} of {} fell short: {}", self.rows.len(), missed.join("; ")),
            };
            return Err(Error::new(ErrorKind::Numerical, message).remedy(remedy));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_falls_short_is_named_and_nothing_is_no_success() {
        let row = |shortfall: Option<&str>| BarRow {
            name: "a".into(),
            figures: vec!["1".into()],
            shortfall: shortfall.map(Into::into),
        };
        let mut table = BarTable::new(&["what", "figure"]);
        assert!(table.judged("ask").is_err(), "an empty table proves nothing");
        table.rows.push(row(None));
        table.judged("ask").unwrap();
        table.rows.push(row(Some("off by 2")));
        let error = table.judged("ask").unwrap_err();
        assert!(error.message().contains("1 of 2") && error.message().contains("a: off by 2"), "{error}");
        assert!(table.to_markdown().contains("MISSED: off by 2"));
    }
}
