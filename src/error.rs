//! Errors and findings: each has a kind, a place and a remedy.
//!
//! An error is handled once: passed on, or shown. A [`Finding`] is a warning as a value: readers and checks collect
//! them in a list, the command line prints them and the report keeps them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The result of everything that can fail on user data.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, for a program to branch on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A file or folder that is needed is not there.
    Missing,
    /// The operating system refused to read a file.
    Unreadable,
    /// The operating system refused to write a file: full disk, no permission.
    Unwritable,
    /// A file's content breaks its format.
    Malformed,
    /// A file claims more than can be held in memory.
    TooLarge,
    /// A valid file of a kind that is not read here.
    Unsupported,
    /// Parts that are valid alone do not make a scene together.
    InvalidScene,
    /// A setting outside its range, or settings that contradict each other.
    InvalidSetting,
    /// A number that is not finite where one is needed.
    NonFinite,
    /// A numerical method did not reach its goal.
    Numerical,
    /// The user asked to stop.
    Stopped,
    /// A worker ended unexpectedly; a defect of this program.
    Internal,
}

/// Where it went wrong.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Place {
    /// Nowhere in particular.
    #[default]
    Nowhere,
    /// A file or folder.
    File(PathBuf),
    /// A line of a text file, counted from 1.
    Line(PathBuf, usize),
    /// A byte of a binary file, counted from 0.
    Byte(PathBuf, u64),
    /// A view, by name.
    View(String),
    /// A pixel of a view.
    Pixel {
        /// Name of the view.
        view: String,
        /// Row, 0 at the top.
        row: usize,
        /// Column, 0 at the left.
        column: usize,
    },
    /// A texel of a map.
    Texel {
        /// Name of the map: `diffuse`, `specular`, `roughness` or `environment`.
        map: String,
        /// Row, 0 at the top.
        row: usize,
        /// Column, 0 at the left.
        column: usize,
    },
    /// A triangle of the mesh, by index.
    Triangle(usize),
    /// A setting, by its name on the command line.
    Setting(String),
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Nowhere => Ok(()),
            Place::File(path) => write!(formatter, "{}", path.display()),
            Place::Line(path, line) => write!(formatter, "{}, line {line}", path.display()),
            Place::Byte(path, byte) => write!(formatter, "{}, byte {byte}", path.display()),
            Place::View(view) => write!(formatter, "view {view}"),
            Place::Pixel { view, row, column } => write!(formatter, "view {view}, pixel row {row} column {column}"),
            Place::Texel { map, row, column } => write!(formatter, "{map} map, texel row {row} column {column}"),
            Place::Triangle(index) => write!(formatter, "triangle {index}"),
            Place::Setting(name) => write!(formatter, "setting --{name}"),
        }
    }
}

/// An error with kind, place and remedy. It is one pointer wide, so that `Result` stays small.
#[derive(Clone, Debug)]
pub struct Error(Box<Inner>);

#[derive(Clone, Debug)]
struct Inner {
    kind: ErrorKind,
    message: String,
    place: Place,
    remedy: String,
    source: Option<Arc<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// An error of this kind; `message` is one sentence without a full stop.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        let (place, remedy) = (Place::Nowhere, String::new());
        Error(Box::new(Inner { kind, message: message.into(), place, remedy, source: None }))
    }

    /// The same error with what caused it, for a program that asks: [`std::error::Error::source`]. The message says it, too.
    pub fn caused_by(mut self, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        self.0.source = Some(Arc::new(source));
        self
    }

    /// The same error at a place. A place that is already known is kept: the innermost one is the most exact.
    pub fn at(mut self, place: Place) -> Self {
        if self.0.place == Place::Nowhere {
            self.0.place = place;
        }
        self
    }

    /// The same error with a remedy: what the user can do, one sentence without a full stop.
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        if self.0.remedy.is_empty() {
            self.0.remedy = remedy.into();
        }
        self
    }

    /// The same error with another remedy, for who knows better what helps than where it arose.
    pub fn with_remedy(mut self, remedy: impl Into<String>) -> Self {
        self.0.remedy = remedy.into();
        self
    }

    /// An input or output error of the operating system on reading `path`.
    pub fn reading(path: &Path, source: std::io::Error) -> Self {
        let kind = match source.kind() {
            std::io::ErrorKind::NotFound => ErrorKind::Missing,
            std::io::ErrorKind::UnexpectedEof | std::io::ErrorKind::InvalidData => ErrorKind::Malformed,
            _ => ErrorKind::Unreadable,
        };
        let remedy = match kind {
            ErrorKind::Missing => "check the path",
            ErrorKind::Malformed => "the file is cut short or damaged: copy it again",
            _ => "check that the file may be read",
        };
        let message = format!("cannot read the file: {source}");
        Error::new(kind, message).at(Place::File(path.into())).remedy(remedy).caused_by(source)
    }

    /// An input or output error of the operating system on writing `path`.
    pub fn writing(path: &Path, source: std::io::Error) -> Self {
        Error::new(ErrorKind::Unwritable, format!("cannot write the file: {source}"))
            .at(Place::File(path.into()))
            .remedy("check free space and permission; what was saved before is untouched")
            .caused_by(source)
    }

    /// The kind, to branch on.
    pub fn kind(&self) -> ErrorKind {
        self.0.kind
    }

    /// The place, `Place::Nowhere` when there is none.
    pub fn place(&self) -> &Place {
        &self.0.place
    }

    /// What the user can do; empty when nothing is known to help.
    pub fn remedy_text(&self) -> &str {
        &self.0.remedy
    }

    /// The message alone, without place and remedy.
    pub fn message(&self) -> &str {
        &self.0.message
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.place != Place::Nowhere {
            write!(formatter, "{}: ", self.0.place)?;
        }
        write!(formatter, "{}", self.0.message)?;
        if !self.0.remedy.is_empty() {
            write!(formatter, " ({})", self.0.remedy)?;
        }
        Ok(())
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source.as_deref().map(|source| source as _)
    }
}

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Severity {
    /// News for the user.
    Note,
    /// Something else was done than asked, or the result may suffer.
    Warning,
    /// A fit cannot work.
    Fatal,
}

/// A warning as a value: collected, shown, kept in the report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// A short stable name, such as `camera-mirrored`.
    pub code: &'static str,
    /// One sentence.
    pub message: String,
    /// Where, as text; empty when nowhere in particular.
    pub place: String,
    /// The same place for a program that goes there.
    #[serde(skip)]
    pub target: Place,
    /// What the user can do; may be empty.
    pub remedy: String,
    /// How much there is of it, in the unit of its message: pixels, a share, a distance. Of several that become one line the
    /// one with the most is told. 0 where nothing is measured.
    #[serde(skip)]
    pub extent: f64,
}

impl Finding {
    /// A finding of this severity; `code` is its stable name.
    pub fn new(severity: Severity, code: &'static str, message: impl Into<String>) -> Self {
        Finding {
            severity,
            code,
            message: message.into(),
            place: String::new(),
            target: Place::Nowhere,
            remedy: String::new(),
            extent: 0.0,
        }
    }

    /// The same finding at a place.
    pub fn at(mut self, place: Place) -> Self {
        self.place = place.to_string();
        self.target = place;
        self
    }

    /// The same finding with a remedy.
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy = remedy.into();
        self
    }

    /// The same finding with how much there is of it: of several that become one line the one with the most is told.
    pub fn extent(mut self, extent: f64) -> Self {
        self.extent = extent;
        self
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Fatal => "fatal",
        };
        write!(formatter, "{severity} [{}]", self.code)?;
        if !self.place.is_empty() {
            write!(formatter, " {}", self.place)?;
        }
        write!(formatter, ": {}", self.message)?;
        if !self.remedy.is_empty() {
            write!(formatter, " ({})", self.remedy)?;
        }
        Ok(())
    }
}

/// What a thread said when it panicked, as far as it was text.
pub fn text_of_panic(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_place_and_remedy_win() {
        let error = Error::new(ErrorKind::Malformed, "index 0 is not a vertex")
            .at(Place::Line("mesh.obj".into(), 7))
            .remedy("count vertices from 1")
            .at(Place::View("0".into()))
            .remedy("other");
        assert_eq!(error.to_string(), "mesh.obj, line 7: index 0 is not a vertex (count vertices from 1)");
        assert_eq!(error.with_remedy("other").remedy_text(), "other");
    }

    #[test]
    fn what_the_operating_system_said_is_kept_as_the_source() {
        use std::error::Error as _;
        let path = tempfile::tempdir().unwrap().path().join("none");
        let missing = std::fs::read(&path).unwrap_err();
        let error = Error::reading(&path, missing).clone();
        let source = error.source().and_then(|source| source.downcast_ref::<std::io::Error>());
        assert_eq!(source.map(std::io::Error::kind), Some(std::io::ErrorKind::NotFound));
        assert!(Error::new(ErrorKind::Numerical, "no step").source().is_none());
    }
}
