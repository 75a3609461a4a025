//! The one way text files are read: bytes to lines, lines to statements, words to numbers.
//!
//! What editors, exporters and operating systems do to a text file is undone here once, so that no reader has to know of
//! it: a byte order mark, UTF-16, comments in Latin-1, line ends of any system, lines that go on after a `\`, comments
//! behind the data, decimal commas. What a number means is the reader's own business; where it stands (file and line)
//! is kept for its errors.

use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use std::borrow::Cow;
use std::path::Path;

/// Text files other than meshes are refused above this size, in bytes.
const MOST_BYTES: u64 = 1 << 28;

/// Reads a text file of at most 256 MiB: line ends are `\n`, there is no byte order mark.
///
/// # Errors
/// `Missing`, `Unreadable`, `TooLarge`, or `Malformed` for a file that holds no text.
pub fn read(path: &Path) -> Result<String> {
    let size = std::fs::metadata(path).map_err(|source| Error::reading(path, source))?.len();
    if size > MOST_BYTES {
        return Err(Error::new(ErrorKind::TooLarge, format!("a text file of {size} bytes"))
            .at(Place::File(path.into()))
            .remedy("this is not the file it should be: check the path"));
    }
    decode(std::fs::read(path).map_err(|source| Error::reading(path, source))?, path)
}

/// The text of a file's bytes: UTF-8, UTF-16 with its mark, or else Latin-1 (ISO 8859-1), in which every byte is a
/// character. Line ends become `\n`.
///
/// # Errors
/// `Malformed` with the byte where a zero shows that this is no text.
pub fn decode(bytes: Vec<u8>, path: &Path) -> Result<String> {
    let utf16 = |from: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].chunks_exact(2).map(|pair| from([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    let text = if bytes.starts_with(&[0xff, 0xfe]) {
        utf16(u16::from_le_bytes)
    } else if bytes.starts_with(&[0xfe, 0xff]) {
        utf16(u16::from_be_bytes)
    } else if let Some(byte) = bytes.iter().position(|&byte| byte == 0) {
        return Err(Error::new(ErrorKind::Malformed, "the file is not text")
            .at(Place::Byte(path.into(), byte as u64))
            .remedy("the file is damaged or of another kind: copy it again"));
    } else {
        match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
        }
    };
    let text = match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    };
    Ok(if text.contains('\r') { text.replace("\r\n", "\n").replace('\r', "\n") } else { text })
}

/// A line, or several joined by `\`, without its comment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Statement<'a> {
    /// The line it begins on, from 1.
    pub line: usize,
    /// What it says; not blank.
    pub text: Cow<'a, str>,
}

impl Statement<'_> {
    /// Its words.
    pub fn words(&self) -> std::str::SplitWhitespace<'_> {
        self.text.split_whitespace()
    }

    /// Whether a comma between digits is a decimal point here: where a number is written with a point, it is not.
    pub fn has_decimal_commas(&self) -> bool {
        self.text.contains(',') && !self.text.contains('.')
    }
}

/// The statements of a text whose comments begin with `#` and go to the end of the line. A `\` at the end of a line
/// continues it, but not within a comment.
pub fn statements(text: &str) -> impl Iterator<Item = Statement<'_>> {
    let mut lines = text.split('\n').enumerate();
    std::iter::from_fn(move || {
        loop {
            let (index, line) = lines.next()?;
            let mut text = Cow::Borrowed(without_comment(line));
            while text.trim_end().ends_with('\\') {
                // Some write two, as if for a shell.
                let mut joined = text.trim_end().trim_end_matches('\\').to_owned();
                joined.push(' ');
                let next = lines.next();
                joined.push_str(next.map_or("", |(_, line)| without_comment(line)));
                text = Cow::Owned(joined);
                if next.is_none() {
                    break;
                }
            }
            if !text.trim().is_empty() {
                return Some(Statement { line: index + 1, text });
            }
        }
    })
}

/// A line without what stands behind a word that begins with `#`; within a word, as in a name, it is a character, but not
/// among the indices of a face.
fn without_comment(line: &str) -> &str {
    let is_face = line.trim_start().strip_prefix('f').is_some_and(|rest| rest.starts_with(char::is_whitespace));
    let begins_a_word = |place: &usize| line[..*place].chars().next_back().is_none_or(char::is_whitespace);
    let place = line.match_indices('#').map(|(place, _)| place).find(|place| is_face || begins_a_word(place));
    place.map_or(line, |place| &line[..place])
}

/// A number as programs write it: `1`, `.5`, `1.`, `-2e3`, with `decimal_comma` also `1,5`. All that C and C++ libraries
/// print for what is no number (`nan`, `-nan(ind)`, `1.#QNAN`, `inf`) is one that is not finite. `None` for other words.
pub fn number(word: &str, decimal_comma: bool) -> Option<f64> {
    if let Ok(value) = word.parse() {
        return Some(value);
    }
    if decimal_comma && word.bytes().filter(|&byte| byte == b',').count() == 1 {
        return word.replace(',', ".").parse().ok();
    }
    let bare = word.trim_start_matches(['-', '+']).to_ascii_lowercase();
    let is_none = bare.starts_with("nan(") || bare.starts_with("1.#") || bare.starts_with("1,#");
    is_none.then_some(f64::NAN)
}

/// The words of a whole file one after the other, where line ends mean nothing.
pub struct Words<'a> {
    path: &'a Path,
    words: Vec<(usize, Cow<'a, str>, bool)>,
    next: usize,
    last_line: usize,
}

impl<'a> Words<'a> {
    /// The words of a text; `path` is for errors.
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        let mut words = Vec::new();
        for statement in statements(text) {
            let comma = statement.has_decimal_commas();
            match statement.text {
                Cow::Borrowed(text) => {
                    words.extend(text.split_whitespace().map(|word| (statement.line, Cow::Borrowed(word), comma)));
                }
                Cow::Owned(text) => {
                    let own = text.split_whitespace().map(|word| (statement.line, Cow::Owned(word.to_owned()), comma));
                    words.extend(own);
                }
            }
        }
        Words { path, words, next: 0, last_line: text.lines().count().max(1) }
    }

    /// How many words are left.
    pub fn left(&self) -> usize {
        self.words.len() - self.next
    }

    /// The line of the next word, or the last line.
    pub fn line(&self) -> usize {
        self.words.get(self.next).map_or(self.last_line, |word| word.0)
    }

    /// Passes over a word.
    pub fn skip(&mut self) {
        self.next = (self.next + 1).min(self.words.len());
    }

    /// An error at the next word.
    pub fn malformed(&self, message: String) -> Error {
        Error::new(ErrorKind::Malformed, message)
            .at(Place::Line(self.path.into(), self.line()))
            .remedy("the file is cut short or damaged: copy it again")
    }

    fn peek(&self, what: &str) -> Result<&str> {
        let word = self.words.get(self.next).ok_or_else(|| self.malformed(format!("the file ends before {what}")))?;
        Ok(&word.1)
    }

    /// Takes a word that must be `keyword`, in any case.
    pub fn keyword(&mut self, keyword: &str) -> Result<()> {
        if self.words.get(self.next).is_some_and(|word| word.1.eq_ignore_ascii_case(keyword)) {
            self.next += 1;
            return Ok(());
        }
        Err(self.malformed(format!("the word '{keyword}' is missing")))
    }

    /// Takes a finite number of `what`.
    pub fn number(&mut self, what: &str) -> Result<f64> {
        let word = self.peek(what)?;
        let value = number(word, self.words[self.next].2)
            .ok_or_else(|| self.malformed(format!("'{word}' is not a number of {what}")))?;
        if !value.is_finite() {
            return Err(Error::new(ErrorKind::NonFinite, format!("{what} holds {word}"))
                .at(Place::Line(self.path.into(), self.line()))
                .remedy("remove the view or export its camera again"));
        }
        self.next += 1;
        Ok(value)
    }

    /// Takes a whole number that is not negative.
    pub fn index(&mut self, what: &str) -> Result<usize> {
        let word = self.peek(what)?;
        let index = word.parse().map_err(|_| self.malformed(format!("'{word}' is not {what}")))?;
        self.next += 1;
        Ok(index)
    }

    /// What is told of decimal commas, where the file has any.
    pub fn finding(&self) -> Option<Finding> {
        let is_comma = |word: &str| number(word, false).is_none() && number(word, true).is_some();
        let (line, ..) = self.words.iter().find(|word| word.2 && is_comma(&word.1))?;
        let message = "numbers have decimal commas: they are read as points";
        Some(Finding::new(Severity::Note, "decimal-commas", message).at(Place::Line(self.path.into(), *line)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(usize, String)> {
        statements(text).map(|statement| (statement.line, statement.text.trim().to_owned())).collect()
    }

    #[test]
    fn any_encoding_and_line_end_gives_the_same_text() {
        let path = Path::new("a.txt");
        for (bytes, expected) in [
            (b"\xef\xbb\xbfv 1\r\nv 2\r\n".to_vec(), "v 1\nv 2\n"),
            (b"v 1\rv 2\r".to_vec(), "v 1\nv 2\n"),
            (b"# stra\xdfe\nv 1".to_vec(), "# stra\u{df}e\nv 1"),
            (b"\xff\xfev\0 \x001\0\n\0".to_vec(), "v 1\n"),
            (b"\xfe\xff\0v\0 \x001\0\n".to_vec(), "v 1\n"),
        ] {
            assert_eq!(decode(bytes, path).unwrap(), expected);
        }
        let error = decode(b"v 1\0\0".to_vec(), path).unwrap_err();
        assert_eq!(error.place(), &Place::Byte(path.into(), 3));
    }

    #[test]
    fn comments_go_and_lines_are_joined_with_the_number_of_the_first() {
        let text = "a 1 # one\n\nb \\\n 2 \\\\\n3\n# c \\\nd\ne \\\n\nf 1 2#3\ng 2#3";
        let expected = [(1, "a 1"), (3, "b   2  3"), (7, "d"), (8, "e"), (10, "f 1 2"), (11, "g 2#3")];
        assert_eq!(all(text), expected.map(|(line, text)| (line, text.to_owned())));
    }

    #[test]
    fn numbers_of_any_locale_and_library_are_read() {
        for (word, value) in [(".5", 0.5), ("1.", 1.0), ("-2e3", -2000.0), ("+7", 7.0)] {
            assert_eq!(number(word, false), Some(value));
        }
        assert_eq!(number("1,5", true), Some(1.5));
        assert_eq!(number("1,5", false), None);
        assert_eq!(number("1,000,5", true), None);
        for word in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND00", "NaN"] {
            assert!(number(word, false).unwrap().is_nan(), "{word}");
        }
        assert_eq!(number("one", true), None);
        let mixed = Statement { line: 1, text: Cow::Borrowed("v 1.5 2,5 3") };
        assert!(!mixed.has_decimal_commas(), "where a point is a point, a comma may be anything");
    }

    #[test]
    fn words_know_their_line() {
        let text = "extrinsic\n1 0,5 # note\nx\n";
        let path = Path::new("cam.txt");
        let mut words = Words::new(path, text);
        words.keyword("extrinsic").unwrap();
        assert_eq!(words.number("m").unwrap(), 1.0);
        assert_eq!(words.number("m").unwrap(), 0.5);
        assert_eq!(words.number("m").unwrap_err().place(), &Place::Line(path.into(), 3));
        assert_eq!(words.finding().unwrap().code, "decimal-commas");
        words.skip();
        assert_eq!(words.left(), 0);
    }
}
