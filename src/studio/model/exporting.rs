//! A run on its way to other programs: what the dialog asks for, what it will take and lose, and the export itself.

use super::tasks::TaskKind;
use super::{Dialog, Done, Model};
use crate::error::Error;
use crate::job::export::{self, ExportEvent, ExportOptions, Exported, Forecast, Format};
use std::path::PathBuf;

/// What the dialog asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportRequest {
    /// What to export, and how.
    pub options: ExportOptions,
    /// The folder to make, as it was typed.
    pub output: String,
    /// Options that were looked ahead for last, and what came of it.
    ahead: Option<(ExportOptions, Result<Forecast, Refusal>)>,
}

/// Why nothing can be exported so.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal {
    /// One sentence.
    pub message: String,
    /// What can be done; may be empty.
    pub remedy: String,
}

impl From<&Error> for Refusal {
    fn from(error: &Error) -> Self {
        Refusal { message: error.message().into(), remedy: error.remedy_text().into() }
    }
}

impl ExportRequest {
    /// All that most people need of a run: a file for viewers and Blender, and maps.
    fn new(run: PathBuf) -> Self {
        let output = run.join("export");
        let formats = vec![Format::Glb, Format::Textures];
        let options = ExportOptions { formats, ..ExportOptions::new(&run, &output) };
        ExportRequest { options, output: output.display().to_string(), ahead: None }
    }

    /// What it will take and lose; looked for once for the same options.
    pub fn ahead(&mut self) -> &Result<Forecast, Refusal> {
        self.options.output = PathBuf::from(self.output.trim());
        let known = self.ahead.take().filter(|(options, _)| *options == self.options);
        let made = known.unwrap_or_else(|| {
            let forecast = export::forecast(&self.options).map_err(|error| Refusal::from(&error));
            (self.options.clone(), forecast)
        });
        &self.ahead.insert(made).1
    }

    /// Whether a format is asked for.
    pub fn has(&self, format: Format) -> bool {
        self.options.formats.contains(&format)
    }

    /// Asks for a format, or no longer.
    pub fn set(&mut self, format: Format, is_on: bool) {
        self.options.formats.retain(|own| *own != format);
        if is_on {
            self.options.formats.push(format);
            self.options.formats.sort_unstable();
        }
    }
}

impl Model {
    /// Opens the dialog of the export.
    pub fn ask_to_export(&mut self) {
        let Some(folder) = &self.fit.folder else { return };
        self.dialog = Dialog::Export(Box::new(ExportRequest::new(folder.path().into())));
    }

    /// Writes an export beside the window.
    pub fn export(&mut self, request: &ExportRequest) {
        let options = request.options.clone();
        self.tasks.stop(&TaskKind::Exporting);
        self.tasks.spawn(TaskKind::Exporting, move |context| {
            let tell = |event: ExportEvent| {
                if let ExportEvent::Stage(what, share) = event {
                    context.tell(&what, share);
                }
            };
            Ok(Done::Exported(Box::new(export::export(&options, &context.stop, &tell)?)))
        });
    }

    pub(super) fn run_was_exported(&mut self, exported: Exported) {
        self.note_findings(&exported.findings);
        let text = format!("Exported to {}; what was lost is told in its convention.txt", exported.folder.display());
        self.log.note_of_file(text, exported.folder.clone());
        self.exported = Some(exported.folder);
    }
}
