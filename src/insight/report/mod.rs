//! One page that shows what a fit found and how good it is: `report.html`, with its numbers in `report.json`.
//!
//! Read [`data`] for what is shown, [`images`] for the pictures that come with it, `page` for the order of the
//! sections, `gallery`, `curves`, [`choices`] and `tables` fill them. [`picture`] makes bytes on a screen of linear pixels, [`number`] makes text of numbers.
//!
//! The page is one file that works offline: pictures are embedded, there is no script but in the 3D view, which lies in a
//! frame of its own, and it follows the reader's choice of light or dark. It stays below about 15 MB whatever the number of views. Every section that is empty says
//! why. What it refuses to do: it computes no score (that is [`super::scores`]) and hides no number that is not finite.

pub mod choice_table;
mod choices;
mod curves;
pub mod data;
mod gallery;
pub mod images;
pub mod number;
mod page;
pub mod picture;
mod tables;

pub use data::ReportData;
pub use images::{RelitPicture, RelitStrip, ReportImages, ViewPictures};

use crate::error::Result;
use crate::export::RunFolder;

/// Writes `report.json` and `report.html` into a run folder.
pub fn write_report(folder: &RunFolder, data: &ReportData, images: &ReportImages) -> Result<()> {
    folder.write_report_json(data)?;
    crate::files::write_bytes(&folder.report_html_path(), page::html(data, images).as_bytes())
}
