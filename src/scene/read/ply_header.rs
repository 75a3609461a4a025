//! PLY as programs write it, turned into PLY as `ply-rs-bw` reads it.
//!
//! The parser knows names of letters, digits and underscores, line ends of `\n`, and numbers with digits on both sides
//! of the point. CloudCompare writes `scalar_Illuminance_(PCV)`, others `.5`, `1.` and `nan`. So the header is written
//! anew, and an ascii body becomes a binary one of doubles, which also keeps survey coordinates from being rounded to
//! the `float` that a header claims.

use super::text;
use crate::error::{Error, ErrorKind, Place, Result};
use std::borrow::Cow;
use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

/// A PLY file that the parser reads.
pub(super) struct Readable<'a> {
    /// The file; as it was where the parser reads it as it is.
    pub bytes: Cow<'a, [u8]>,
    /// Bytes by which the header grew: to be taken off a place within `bytes`.
    pub grown: i64,
    /// For an ascii file the line of each row of each element, in the order of the header; empty for binary ones.
    pub lines: Vec<Vec<u32>>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    /// Type of a list's length.
    length: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    Char,
    UChar,
    Short,
    UShort,
    Int,
    UInt,
    Float,
    Double,
}

impl Scalar {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Scalar::Char,
            "uchar" | "uint8" => Scalar::UChar,
            "short" | "int16" => Scalar::Short,
            "ushort" | "uint16" => Scalar::UShort,
            "int" | "int32" => Scalar::Int,
            "uint" | "uint32" => Scalar::UInt,
            "float" | "float32" => Scalar::Float,
            "double" | "float64" => Scalar::Double,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Scalar::Char => "char",
            Scalar::UChar => "uchar",
            Scalar::Short => "short",
            Scalar::UShort => "ushort",
            Scalar::Int => "int",
            Scalar::UInt => "uint",
            Scalar::Float => "float",
            Scalar::Double => "double",
        }
    }

    fn is_float(self) -> bool {
        matches!(self, Scalar::Float | Scalar::Double)
    }
}

/// Makes a file readable.
///
/// # Errors
/// `Malformed` with the line of the header or of the ascii body.
pub(super) fn readable<'a>(bytes: &'a [u8], path: &Path) -> Result<Readable<'a>> {
    let (mut elements, format, body, lines_before) = parse(bytes, path)?;
    make_names_plain(&mut elements);
    if format == "ascii" {
        let text = text::decode(bytes[body..].to_vec(), path)?;
        let mut made = header_of(&elements, "binary_little_endian", true).into_bytes();
        let lines = body_to_binary(&elements, &text, lines_before, &mut made, path)?;
        return Ok(Readable { bytes: Cow::Owned(made), grown: 0, lines });
    }
    let header = header_of(&elements, format, false);
    let plain = text_of_line_ends(&bytes[..body]);
    if plain.is_some_and(|plain| plain == header) {
        return Ok(Readable { bytes: Cow::Borrowed(bytes), grown: 0, lines: Vec::new() });
    }
    let grown = header.len() as i64 - body as i64;
    let mut made = header.into_bytes();
    made.extend_from_slice(&bytes[body..]);
    Ok(Readable { bytes: Cow::Owned(made), grown, lines: Vec::new() })
}

fn text_of_line_ends(header: &[u8]) -> Option<&str> {
    std::str::from_utf8(header).ok()
}

/// Elements, format, place of the body, and the number of lines before it.
fn parse<'a>(bytes: &'a [u8], path: &Path) -> Result<(Vec<Element>, &'static str, usize, usize)> {
    let mut place = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let mut number = 0;
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let malformed = |number: usize, message: String| {
            Error::new(ErrorKind::Malformed, format!("the PLY header cannot be read: {message}"))
                .at(Place::Line(path.into(), number))
                .remedy("the file is cut short or damaged: copy it again")
        };
        let rest: &'a [u8] = &bytes[place..];
        let Some(length) = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            return Err(malformed(number.max(1), "it does not end".into()));
        };
        let line = String::from_utf8_lossy(&rest[..length]);
        number += 1;
        place += length + if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
        let words: Vec<&str> = line.split_whitespace().collect();
        match (number, words.as_slice()) {
            (1, ["ply"]) => {}
            (1, _) => return Err(malformed(1, "the first line is not 'ply'".into())),
            (_, [] | ["comment", ..] | ["obj_info", ..]) => {}
            (_, ["format", name, ..]) => {
                let known = ["ascii", "binary_little_endian", "binary_big_endian"];
                format = known.into_iter().find(|known| known == name);
                if format.is_none() {
                    return Err(malformed(number, format!("the format '{name}' is not known")));
                }
            }
            (_, ["element", name, count]) => {
                let count = count.parse().map_err(|_| malformed(number, format!("'{count}' is not a number")))?;
                elements.push(Element { name: (*name).into(), count, properties: Vec::new() });
            }
            (_, ["property", "list", length, scalar, name @ ..]) if !name.is_empty() => {
                let (length, scalar) = (Scalar::of(length), Scalar::of(scalar));
                let (Some(length), Some(scalar), Some(element)) = (length, scalar, elements.last_mut()) else {
                    return Err(malformed(number, format!("'{}' is no list", line.trim())));
                };
                element.properties.push(Property { name: name.join("_"), length: Some(length), scalar });
            }
            (_, ["property", scalar, name @ ..]) if !name.is_empty() => {
                let (Some(scalar), Some(element)) = (Scalar::of(scalar), elements.last_mut()) else {
                    return Err(malformed(number, format!("'{}' is no property", line.trim())));
                };
                element.properties.push(Property { name: name.join("_"), length: None, scalar });
            }
            (_, ["end_header"]) => {
                let format = format.ok_or_else(|| malformed(number, "it names no format".into()))?;
                return Ok((elements, format, place, number));
            }
            _ => return Err(malformed(number, format!("'{}' is not understood", line.trim()))),
        }
    }
}

/// Names of letters, digits and underscores, each once.
fn make_names_plain(elements: &mut [Element]) {
    fn plain(name: &str, taken: &mut HashSet<String>) -> String {
        let mut plain: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        while !taken.insert(plain.clone()) {
            plain.push('_');
        }
        plain
    }
    let mut taken = HashSet::new();
    for element in elements {
        element.name = plain(&element.name, &mut taken);
        let mut taken = HashSet::new();
        element.properties.iter_mut().for_each(|property| property.name = plain(&property.name, &mut taken));
    }
}

/// The header; `widened` where the body holds doubles, and lists of 32 bits.
fn header_of(elements: &[Element], format: &str, widened: bool) -> String {
    let mut header = format!("ply\nformat {format} 1.0\n");
    // Writing to a string cannot fail.
    for element in elements {
        let _ = writeln!(header, "element {} {}", element.name, element.count);
        for Property { name, length, scalar } in &element.properties {
            let _ = match (length, widened) {
                (None, false) => writeln!(header, "property {} {name}", scalar.name()),
                (None, true) => writeln!(header, "property double {name}"),
                (Some(length), false) => writeln!(header, "property list {} {} {name}", length.name(), scalar.name()),
                (Some(_), true) if scalar.is_float() => writeln!(header, "property list uint double {name}"),
                (Some(_), true) => writeln!(header, "property list uint int {name}"),
            };
        }
    }
    header.push_str("end_header\n");
    header
}

/// Writes the numbers of an ascii body as [`header_of`] announces them; gives the line of each row.
fn body_to_binary(
    elements: &[Element],
    text: &str,
    lines_before: usize,
    made: &mut Vec<u8>,
    path: &Path,
) -> Result<Vec<Vec<u32>>> {
    let mut words = text.split('\n').enumerate().flat_map(|(index, line)| {
        let comma = line.contains(',') && !line.contains('.');
        line.split_whitespace().map(move |word| (lines_before + index + 1, word, comma))
    });
    let mut last_line = lines_before + 1;
    let mut lines = Vec::with_capacity(elements.len());
    for element in elements {
        // A digit and a separator for each number, before anything is set aside for them.
        let needed = element.count.saturating_mul(2 * element.properties.len().max(1) as u64);
        if needed > text.len() as u64 + 1 {
            let message = format!(
                "the header claims {} elements '{}' of at least {} bytes, but only {} bytes follow",
                element.count,
                element.name,
                2 * element.properties.len().max(1),
                text.len()
            );
            return Err(Error::new(ErrorKind::Malformed, message)
                .at(Place::File(path.into()))
                .remedy("the file is cut short or damaged: copy it again"));
        }
        let mut next = || -> Result<(usize, f64)> {
            let Some((line, word, comma)) = words.next() else {
                let message = format!("the file ends within the {} elements '{}'", element.count, element.name);
                return Err(Error::new(ErrorKind::Malformed, message)
                    .at(Place::Line(path.into(), last_line))
                    .remedy("the file is cut short or damaged: copy it again"));
            };
            last_line = line;
            let value = text::number(word, comma).ok_or_else(|| {
                let message = format!("'{word}' of an element '{}' is not a number", element.name);
                Error::new(ErrorKind::Malformed, message).at(Place::Line(path.into(), line)).remedy("export it again")
            })?;
            Ok((line, value))
        };
        let mut rows = Vec::new();
        for _ in 0..element.count {
            let mut first_line = None;
            for property in &element.properties {
                let (line, value) = next()?;
                first_line.get_or_insert(line);
                if property.length.is_none() {
                    made.extend(value.to_le_bytes());
                    continue;
                }
                if !(value >= 0.0 && value <= text.len() as f64) {
                    return Err(Error::new(ErrorKind::Malformed, format!("a list of {value} numbers"))
                        .at(Place::Line(path.into(), line))
                        .remedy("the file is damaged: export it again"));
                }
                made.extend((value as u32).to_le_bytes());
                for _ in 0..value as u32 {
                    let (_, item) = next()?;
                    if property.scalar.is_float() {
                        made.extend(item.to_le_bytes());
                    } else {
                        made.extend((item as i32).to_le_bytes());
                    }
                }
            }
            rows.push(first_line.unwrap_or(lines_before) as u32);
        }
        lines.push(rows);
    }
    Ok(lines)
}
