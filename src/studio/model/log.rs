//! What was noticed, newest last: findings, errors, what was done.

use super::offers::{self, Change, Offer};
use super::tasks::TaskKind;
use super::words::{capitalised, without_flags};
use crate::error::{Error, Finding, Place, Severity};
use std::path::PathBuf;
use std::time::Instant;

/// A line of the log.
#[derive(Clone, Debug)]
pub struct Message {
    /// How much it matters.
    pub severity: Severity,
    /// Whether something failed, so that a person should see it at once.
    pub is_error: bool,
    /// One sentence.
    pub text: String,
    /// What can be done; may be empty.
    pub remedy: String,
    /// What a button does about it.
    pub offers: Vec<Offer>,
    /// A file or folder that it is about; a link opens it.
    pub file: Option<PathBuf>,
    /// Where.
    pub place: Place,
    /// When.
    pub at: Instant,
}

impl Message {
    /// A line without place and remedy.
    pub fn note(text: impl Into<String>) -> Self {
        Message {
            severity: Severity::Note,
            is_error: false,
            text: text.into(),
            remedy: String::new(),
            offers: Vec::new(),
            file: None,
            place: Place::Nowhere,
            at: Instant::now(),
        }
    }

    /// The sentence and what can be done, for the clipboard.
    pub fn text_to_copy(&self) -> String {
        match self.remedy.as_str() {
            "" => self.sentence(),
            remedy => format!("{}\nFix: {remedy}", self.sentence()),
        }
    }

    /// The sentence with its place before it.
    pub fn sentence(&self) -> String {
        match self.place {
            Place::Nowhere => capitalised(&self.text),
            _ => capitalised(&format!("{}: {}", self.place, self.text)),
        }
    }
}

impl From<&Finding> for Message {
    fn from(finding: &Finding) -> Self {
        Message {
            severity: finding.severity,
            remedy: without_flags(&finding.remedy),
            offers: offers::of_finding(finding),
            file: file_of(&finding.target),
            place: finding.target.clone(),
            ..Message::note(finding.message.clone())
        }
    }
}

impl From<&Error> for Message {
    fn from(error: &Error) -> Self {
        Message {
            severity: Severity::Fatal,
            is_error: true,
            remedy: without_flags(error.remedy_text()),
            file: file_of(error.place()),
            place: error.place().clone(),
            ..Message::note(error.message())
        }
    }
}

/// The file that a place is in.
fn file_of(place: &Place) -> Option<PathBuf> {
    match place {
        Place::File(path) | Place::Line(path, _) | Place::Byte(path, _) => Some(path.clone()),
        _ => None,
    }
}

/// The newest messages.
#[derive(Clone, Debug, Default)]
pub struct Log {
    messages: Vec<Message>,
    /// The error that stands across the window until it is dismissed.
    banner: Option<Message>,
    /// The task whose error that is.
    banner_task: Option<TaskKind>,
    /// Messages since the panel was last looked at.
    pub unread: usize,
}

/// Messages kept, at most.
const MOST_MESSAGES: usize = 2000;

impl Log {
    /// Adds a message; an error also goes to the banner.
    pub fn add(&mut self, message: Message) {
        // An error stands across the window: it need not be looked for.
        if message.is_error {
            (self.banner, self.banner_task) = (Some(message.clone()), None);
        } else if message.severity > Severity::Note {
            self.unread += 1;
        }
        self.messages.push(message);
        if self.messages.len() > MOST_MESSAGES {
            self.messages.drain(..MOST_MESSAGES / 2);
        }
    }

    /// Adds a line of news.
    pub fn note(&mut self, text: impl Into<String>) {
        self.add(Message::note(text));
    }

    /// Adds a line of news about a file or folder.
    pub fn note_of_file(&mut self, text: impl Into<String>, file: impl Into<PathBuf>) {
        self.add(Message { file: Some(file.into()), ..Message::note(text) });
    }

    /// Adds an error.
    pub fn error(&mut self, error: &Error) {
        self.add(Message::from(error));
    }

    /// Adds the error of a task.
    pub fn error_of(&mut self, error: &Error, task: &TaskKind) {
        self.error(error);
        self.banner_task = Some(task.clone());
    }

    /// A task has worked: its error of before is past.
    pub fn worked(&mut self, task: &TaskKind) {
        let is_same = |own: &TaskKind| std::mem::discriminant(own) == std::mem::discriminant(task);
        if self.banner_task.as_ref().is_some_and(is_same) {
            self.dismiss();
        }
    }

    /// What is told of a scene that was closed need not be looked at any more.
    pub fn scene_was_closed(&mut self) {
        self.unread = 0;
    }

    /// All messages, oldest first.
    pub fn messages(&self) -> &[Message] {
        &self.messages
    }

    /// What was taken is no longer offered.
    pub(super) fn no_longer_offers(&mut self, change: &Change) {
        for message in &mut self.messages {
            message.offers.retain(|own| own.change != *change);
        }
    }

    /// The newest message.
    pub fn newest(&self) -> Option<&Message> {
        self.messages.last()
    }

    /// The error that waits to be dismissed.
    pub fn banner(&self) -> Option<&Message> {
        self.banner.as_ref()
    }

    /// Dismisses the error.
    pub fn dismiss(&mut self) {
        (self.banner, self.banner_task) = (None, None);
    }

    /// Forgets all messages.
    pub fn clear(&mut self) {
        *self = Log::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn an_error_stays_on_the_banner_until_dismissed_and_the_list_is_bounded() {
        let mut log = Log::default();
        log.error(&Error::new(ErrorKind::Missing, "the mesh is not there").remedy("copy it"));
        for number in 0..3000 {
            log.note(format!("step {number}"));
        }
        assert!(log.messages().len() <= MOST_MESSAGES);
        assert_eq!(log.banner().map(Message::sentence).as_deref(), Some("The mesh is not there"));
        assert_eq!(log.unread, 0, "an error that stands across the window need not be looked for");
        log.dismiss();
        assert!(log.banner().is_none());
    }

    #[test]
    fn the_error_of_a_task_goes_when_the_same_task_works() {
        let mut log = Log::default();
        log.error_of(&Error::new(ErrorKind::Missing, "no scene there"), &TaskKind::Opening);
        log.worked(&TaskKind::Saving);
        assert!(log.banner().is_some());
        log.worked(&TaskKind::Opening);
        assert!(log.banner().is_none());
    }
}
