//! Tables of published parameters, `*.fit`: a material a line, as
//! `name = Aggregate(Lambertian(albedo = [r, g, b]), Model(key = number or list, ...))`; `#` starts a remark.
//!
//! Collected by the BSDF benchmark of Peers et al. from the supplements of Ngan, Durand and Matusik 2005, Low, Kronander,
//! Ynnerman and Unger 2012, and Bagher, Soler and Holzschuch 2012.

use super::formula::Formula;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::measured::coordinates::HalfDifference;
use crate::measured::table::MeasuredBrdf;
use std::path::Path;

/// Longest file that is read.
const LONGEST: u64 = 16 << 20;
/// Deepest nesting of brackets.
const DEEPEST: usize = 8;

/// One material's parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedFit {
    /// MERL's name of the material.
    pub name: String,
    /// Name of the model as in the file, such as `LowSmooth`.
    pub model: String,
    /// Diffuse albedo, linear RGB.
    pub diffuse: [f64; 3],
    formula: Formula,
}

/// A file of fits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PublishedFits {
    /// In the order of the file.
    pub materials: Vec<PublishedFit>,
}

/// What may stand behind an `=`.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f64),
    List(Vec<Value>),
    Call(Call),
}

/// `Name(part, key = part, ...)`.
#[derive(Clone, Debug, PartialEq)]
struct Call {
    name: String,
    parts: Vec<(String, Value)>,
}

impl PublishedFits {
    /// Reads a file. Errors: missing, too long, no text, and with the line: another form, a missing or surplus number,
    /// a number that is not finite, a material twice.
    pub fn read(path: &Path) -> Result<Self> {
        let length = std::fs::metadata(path).map_err(|source| Error::reading(path, source))?.len();
        if length > LONGEST {
            return Err(Error::new(ErrorKind::TooLarge, format!("{length} bytes are too many for a table of fits"))
                .at(Place::File(path.into())));
        }
        let text = std::fs::read_to_string(path).map_err(|source| Error::reading(path, source))?;
        let mut fits = PublishedFits::default();
        for (index, line) in text.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let fit = fit_of_line(line).map_err(|message| {
                Error::new(ErrorKind::Malformed, message)
                    .at(Place::Line(path.into(), index + 1))
                    .remedy("a line is `name = Aggregate(Lambertian(albedo = [r, g, b]), Model(...))`")
            })?;
            if fits.materials.iter().any(|other| other.name == fit.name) {
                return Err(Error::new(ErrorKind::Malformed, format!("the material {} is there twice", fit.name))
                    .at(Place::Line(path.into(), index + 1)));
            }
            fits.materials.push(fit);
        }
        if fits.materials.is_empty() {
            return Err(Error::new(ErrorKind::Malformed, "the file names no material").at(Place::File(path.into())));
        }
        Ok(fits)
    }

    /// The fit of this name, if it is there.
    pub fn find(&self, name: &str) -> Option<&PublishedFit> {
        self.materials.iter().find(|fit| fit.name == name)
    }
}

impl PublishedFit {
    /// Whether the model can be evaluated here: all but that of He.
    pub fn can_be_evaluated(&self) -> bool {
        self.formula != Formula::He
    }

    /// Reflectance in 1/sr, at least 0; `None` when [`Self::can_be_evaluated`] is false.
    pub fn value(&self, at: HalfDifference) -> Option<[f64; 3]> {
        let specular = self.formula.value(at)?;
        Some(std::array::from_fn(|channel| (self.diffuse[channel] / std::f64::consts::PI + specular[channel]).max(0.0)))
    }

    /// The whole table. Error: the model cannot be evaluated here.
    pub fn table(&self) -> Result<MeasuredBrdf> {
        if !self.can_be_evaluated() {
            return Err(Error::new(ErrorKind::Unsupported, format!("{} is read, but not evaluated", self.model))
                .remedy("use another model's fit of this material"));
        }
        Ok(MeasuredBrdf::from_fn(|at| self.value(at).unwrap_or_default()))
    }
}

type Parsed<T> = std::result::Result<T, String>;

fn fit_of_line(line: &str) -> Parsed<PublishedFit> {
    let (name, rest) = line.split_once('=').ok_or("there is no `=`")?;
    let mut reader = Reader { rest };
    let Value::Call(aggregate) = reader.value(0)? else { return Err("`Aggregate(...)` is missing".into()) };
    if !reader.rest.trim().is_empty() {
        return Err(format!("`{}` is left over", reader.rest.trim().chars().take(20).collect::<String>()));
    }
    let mut diffuse = None;
    let mut model = None;
    for (_, part) in aggregate.parts {
        match part {
            Value::Call(call) if call.name == "Lambertian" => diffuse = Some(numbers_of(&call, "albedo", 3)?),
            Value::Call(call) => model = Some(call),
            _ => return Err("a part of the aggregate is not a model".into()),
        }
    }
    let diffuse = diffuse.ok_or("`Lambertian(albedo = ...)` is missing")?;
    let model = model.ok_or("a model beside the Lambertian one is missing")?;
    let formula = Formula::of(&model.name, &|key, count| numbers_of(&model, key, count))?;
    let name = name.trim();
    if name.is_empty() {
        return Err("the name is empty".into());
    }
    Ok(PublishedFit { name: name.into(), model: model.name, diffuse: [diffuse[0], diffuse[1], diffuse[2]], formula })
}

/// The numbers behind a key, lists in lists made one.
fn numbers_of(call: &Call, key: &str, count: usize) -> Parsed<Vec<f64>> {
    fn collect(value: &Value, numbers: &mut Vec<f64>) {
        match value {
            Value::Number(number) => numbers.push(*number),
            Value::List(list) => list.iter().for_each(|value| collect(value, numbers)),
            Value::Call(_) => {}
        }
    }
    let mut found = call.parts.iter().filter(|(name, _)| name == key);
    let (_, value) = found.next().ok_or_else(|| format!("{} has no `{key}`", call.name))?;
    if found.next().is_some() {
        return Err(format!("{} has `{key}` twice", call.name));
    }
    let mut numbers = Vec::new();
    collect(value, &mut numbers);
    if numbers.len() != count {
        return Err(format!("`{key}` of {} has {} numbers, not {count}", call.name, numbers.len()));
    }
    Ok(numbers)
}

struct Reader<'a> {
    rest: &'a str,
}

impl Reader<'_> {
    /// Takes a character, if it is next.
    fn take(&mut self, wanted: char) -> bool {
        let trimmed = self.rest.trim_start();
        let taken = trimmed.strip_prefix(wanted);
        self.rest = taken.unwrap_or(trimmed);
        taken.is_some()
    }

    /// Takes the characters of a name or a number.
    fn word(&mut self) -> &str {
        let trimmed = self.rest.trim_start();
        let is_part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '+' | '-');
        let (word, rest) = trimmed.split_at(trimmed.find(|c| !is_part(c)).unwrap_or(trimmed.len()));
        self.rest = rest;
        word
    }

    fn value(&mut self, depth: usize) -> Parsed<Value> {
        if depth > DEEPEST {
            return Err("brackets are nested too deep".into());
        }
        if self.take('[') {
            let mut list = Vec::new();
            while !self.take(']') {
                if !list.is_empty() && !self.take(',') {
                    return Err("a list lacks `,` or `]`".into());
                }
                list.push(self.value(depth + 1)?);
            }
            return Ok(Value::List(list));
        }
        let word = self.word().to_string();
        if self.take('(') {
            let mut parts: Vec<(String, Value)> = Vec::new();
            while !self.take(')') {
                if !parts.is_empty() && !self.take(',') {
                    return Err(format!("{word} lacks `,` or `)`"));
                }
                let before = self.rest;
                let key = self.word().to_string();
                if self.take('=') {
                    parts.push((key, self.value(depth + 1)?));
                } else {
                    self.rest = before;
                    parts.push((String::new(), self.value(depth + 1)?));
                }
            }
            return Ok(Value::Call(Call { name: word, parts }));
        }
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Value::Number(number)),
            _ => Err(format!("`{}` is not a finite number", word.chars().take(20).collect::<String>())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_damage_is_told() {
        let good =
            "a = Aggregate(Lambertian(albedo = [0.1, 0.2, 3e-1]), NganWard(albedo = [1, 2, 3], roughness = 0.1))";
        let fit = fit_of_line(good).unwrap();
        assert_eq!((fit.name.as_str(), fit.model.as_str(), fit.diffuse), ("a", "NganWard", [0.1, 0.2, 0.3]));
        let peak = fit.value(HalfDifference::default()).unwrap();
        assert!((peak[0] - (0.1 / std::f64::consts::PI + 1.0 / (4.0 * std::f64::consts::PI * 0.01))).abs() < 1e-9);
        for end in 0..good.len() {
            assert!(fit_of_line(&good[..end]).is_err(), "{}", &good[..end]);
        }
        for (from, to) in
            [("0.2", "x"), ("0.2", "nan"), ("0.2", "inf"), ("0.2, ", ""), ("NganWard", "New"), ("roughness", "rough")]
        {
            assert!(fit_of_line(&good.replacen(from, to, 1)).is_err(), "{from} {to}");
        }
        assert!(fit_of_line(&format!("a = {}", "[".repeat(1000))).is_err());
        assert!(fit_of_line(&format!("{good} )")).is_err());
    }
}
