//! Each setting by its name: its value as text, another value for it.

use super::settings::FitSettings;
use crate::error::{Error, ErrorKind, Place, Result};
use toml::{Table, Value};

/// What kind of value a setting takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ValueKind {
    /// A whole number, 0 or above.
    Whole,
    /// A number of single precision.
    Number,
    /// Yes or no: the texts `true` and `false`.
    Switch,
    /// One of a few words.
    Choice,
    /// Any number of names; as text one a line, or separated by commas.
    Names,
}

impl FitSettings {
    /// The value of a setting by its name, as in a settings file.
    ///
    /// # Errors
    /// `InvalidSetting` when there is no such setting.
    pub fn get(&self, name: &str) -> Result<Value> {
        table_of(self).remove(name).ok_or_else(|| unknown(name))
    }

    /// The value of a setting as the text that [`FitSettings::set`] takes.
    ///
    /// # Errors
    /// `InvalidSetting` when there is no such setting.
    pub fn get_text(&self, name: &str) -> Result<String> {
        Ok(text_of(&self.get(name)?))
    }

    /// Sets a setting by its name. Whether the value suits the other settings is for [`FitSettings::validate`] to say.
    ///
    /// # Errors
    /// `InvalidSetting`, with the setting as its place, when there is no such setting or the text is no value for it;
    /// nothing is changed then.
    pub fn set(&mut self, name: &str, text: &str) -> Result<()> {
        let mut table = table_of(self);
        let Some(old) = table.get(name) else { return Err(unknown(name)) };
        let text = text.trim();
        let wrong = |what: &str| {
            Error::new(ErrorKind::InvalidSetting, format!("'{text}' is not {what}")).at(Place::Setting(name.into()))
        };
        let value = match kind_of(old) {
            ValueKind::Whole => text
                .parse::<u64>()
                .ok()
                .and_then(|number| i64::try_from(number).ok())
                .map(Value::Integer)
                .ok_or_else(|| wrong("a whole number from 0 on"))?,
            ValueKind::Number => text
                .parse::<f32>()
                .ok()
                .filter(|number| number.is_finite())
                .map(|number| Value::Float(f64::from(number)))
                .ok_or_else(|| wrong("a number"))?,
            ValueKind::Switch => text.parse::<bool>().map(Value::Boolean).map_err(|_| wrong("true or false"))?,
            ValueKind::Choice => Value::String(text.into()),
            ValueKind::Names => {
                let names = text.split([',', '\n']).map(str::trim).filter(|name| !name.is_empty());
                Value::Array(names.map(|name| Value::String(name.into())).collect())
            }
        };
        table.insert(name.into(), value);
        *self = table.try_into().map_err(|_| {
            let choices = choices_of(name);
            wrong(&if choices.is_empty() { "a value for it".into() } else { format!("one of {}", choices.join(", ")) })
        })?;
        Ok(())
    }

    /// Name, own value and other value of each setting in which two differ, as texts, in alphabetical order.
    pub fn differences(&self, other: &FitSettings) -> Vec<(String, String, String)> {
        let mut others = table_of(other);
        let pairs = table_of(self).into_iter().filter_map(|(name, own)| Some((own, others.remove(&name)?, name)));
        pairs
            .filter(|(own, other, _)| own != other)
            .map(|(own, other, name)| (name, text_of(&own), text_of(&other)))
            .collect()
    }

    /// These settings with the named ones taken from `other`.
    ///
    /// # Errors
    /// `InvalidSetting` when there is no such setting.
    pub fn with(&self, names: &[String], other: &FitSettings) -> Result<Self> {
        let mut table = table_of(self);
        for name in names {
            table.insert(name.clone(), other.get(name)?);
        }
        table.try_into().map_err(|source| {
            Error::new(
                ErrorKind::Internal,
                format!("settings do not go together: {}", toml::de::Error::message(&source)),
            )
        })
    }
}

fn unknown(name: &str) -> Error {
    Error::new(ErrorKind::InvalidSetting, "there is no such setting")
        .at(Place::Setting(name.into()))
        .remedy("names are those of `patina fit --help`")
}

pub(super) fn table_of(settings: &FitSettings) -> Table {
    // Whole numbers of a table have a sign: a seed beyond, which no check lets pass, shows as the largest.
    let seed = settings.seed.min(i64::MAX as u64);
    Table::try_from(FitSettings { seed, ..settings.clone() }).unwrap_or_default()
}

pub(super) fn kind_of(value: &Value) -> ValueKind {
    match value {
        Value::Integer(_) => ValueKind::Whole,
        Value::Float(_) => ValueKind::Number,
        Value::Boolean(_) => ValueKind::Switch,
        Value::Array(_) => ValueKind::Names,
        _ => ValueKind::Choice,
    }
}

pub(super) fn text_of(value: &Value) -> String {
    match value {
        // Single precision: without the digits that widening adds.
        Value::Float(number) => (*number as f32).to_string(),
        Value::String(text) => text.clone(),
        Value::Array(names) => names.iter().map(text_of).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// The values of a choice, for who typed another; they stand in the help of the command line.
#[cfg(feature = "cli")]
fn choices_of(name: &str) -> Vec<String> {
    let setting = FitSettings::described().into_iter().find(|setting| setting.name == name);
    setting.map_or(Vec::new(), |setting| setting.possible_values)
}

#[cfg(not(feature = "cli"))]
fn choices_of(_: &str) -> Vec<String> {
    Vec::new()
}
