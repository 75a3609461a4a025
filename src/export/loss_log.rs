//! `loss.csv`: the loss of every step.

use crate::error::{Error, ErrorKind, Place, Result};
use std::path::Path;

const HEADER: &str = "step,stage,seconds,loss,image_loss,mvcl,surface_rmse,held_out_rmse";

/// One step of a fit.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LossRow {
    /// Number of the step over the whole run, from 0.
    pub step: u64,
    /// Name of the stage, such as `diffuse` or `all maps`.
    pub stage: String,
    /// Seconds of work since the start of the run, pauses left out.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub seconds: f64,
    /// The whole loss that was stepped on.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub loss: f64,
    /// The part of it that compares pictures with photographs.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub image_loss: f64,
    /// The multi-view consistency value in [0, 1]; 0 when it is off.
    #[serde(deserialize_with = "crate::export::loss_log::number_or_nan")]
    pub mvcl: f64,
    /// Linear RMSE over the unclipped surface pixels of the step's views: the measure of held-out views.
    #[serde(default)]
    pub surface_rmse: Option<f64>,
    /// Linear RMSE over the held-out views, on the steps where it was measured.
    pub held_out_rmse: Option<f64>,
}

/// Reads a number; `null`, as JSON has it for what is not finite, becomes NaN.
pub fn number_or_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<f64, D::Error> {
    Ok(<Option<f64> as serde::Deserialize>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Writes the rows. Numbers keep every digit; a comma or line end in a stage's name becomes a blank.
pub fn write(path: &Path, rows: &[LossRow]) -> Result<()> {
    crate::files::write_bytes(path, text(rows).as_bytes())
}

/// The rows as text, a header line first.
pub fn text(rows: &[LossRow]) -> String {
    let mut text = format!("{HEADER}\n");
    for row in rows {
        let stage = row.stage.replace([',', '\n', '\r'], " ");
        let field = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
        text += &format!(
            "{},{stage},{},{},{},{},{},{}\n",
            row.step,
            row.seconds,
            row.loss,
            row.image_loss,
            row.mvcl,
            field(row.surface_rmse),
            field(row.held_out_rmse)
        );
    }
    text
}

/// Reads the rows of [`fn@write`]. An error names the line.
pub fn read(path: &Path) -> Result<Vec<LossRow>> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
    let mut lines = text.lines().enumerate();
    if lines.next().map(|(_, line)| line.trim()) != Some(HEADER) {
        return Err(Error::new(ErrorKind::Malformed, format!("the first line is not \"{HEADER}\""))
            .at(Place::Line(path.into(), 1))
            .remedy("restore the file, or delete it: the loss curves are then left out"));
    }
    lines.filter(|(_, line)| !line.trim().is_empty()).map(|(index, line)| row_of(path, index + 1, line)).collect()
}

fn row_of(path: &Path, line_number: usize, line: &str) -> Result<LossRow> {
    let malformed = |message: String| {
        Error::new(ErrorKind::Malformed, message)
            .at(Place::Line(path.into(), line_number))
            .remedy("the file is cut short or was edited: remove this line")
    };
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let [step, stage, seconds, loss, image_loss, mvcl, surface_rmse, held_out_rmse] = fields[..] else {
        return Err(malformed(format!("{} fields instead of 8", fields.len())));
    };
    let number = |text: &str| text.parse::<f64>().map_err(|_| malformed(format!("\"{text}\" is not a number")));
    let optional = |text: &str| if text.is_empty() { Ok(None) } else { number(text).map(Some) };
    Ok(LossRow {
        step: step.parse().map_err(|_| malformed(format!("\"{step}\" is not a step number")))?,
        stage: stage.to_string(),
        seconds: number(seconds)?,
        loss: number(loss)?,
        image_loss: number(image_loss)?,
        mvcl: number(mvcl)?,
        surface_rmse: optional(surface_rmse)?,
        held_out_rmse: optional(held_out_rmse)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_bit_for_bit_and_a_cut_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loss.csv");
        let row = |step, held_out_rmse: Option<f64>| LossRow {
            step,
            stage: "all maps".into(),
            seconds: 0.1 + step as f64 / 3.0,
            loss: 1e-12 / 7.0,
            image_loss: 0.25,
            mvcl: 0.0,
            surface_rmse: held_out_rmse.map(|rmse| rmse / 7.0),
            held_out_rmse,
        };
        let rows = vec![row(0, None), row(1, Some(0.1 / 3.0))];
        write(&path, &rows).unwrap();
        assert_eq!(read(&path).unwrap(), rows);

        let text = std::fs::read_to_string(&path).unwrap();
        crate::files::write_bytes(&path, &text.as_bytes()[..text.len() - 35]).unwrap();
        let error = read(&path).unwrap_err();
        assert_eq!(error.place(), &Place::Line(path.clone(), 3));
        crate::files::write_bytes(&path, b"").unwrap();
        assert_eq!(read(&path).unwrap_err().kind(), ErrorKind::Malformed);
    }
}
