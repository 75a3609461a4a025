//! Each setting by name: what it means, its value, another value for it.
//!
//! The help of the command line is the one text on a setting; what is here is read off it, so that a form in a window
//! and `patina fit --help` cannot say different things, and a new field appears in both.

use super::settings::FitSettings;
use crate::error::{Error, ErrorKind, Place, Result};
use clap::Args;
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
    /// One of [`SettingDescription::possible_values`].
    Choice,
    /// Any number of names; as text one a line, or separated by commas.
    Names,
}

/// A setting, for a form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingDescription {
    /// Name on the command line and in settings files, such as `map-size`.
    pub name: String,
    /// What it means: the help of the command line, without a full stop at its end.
    pub help: String,
    /// The values of a choice; empty for other kinds.
    pub possible_values: Vec<String>,
    /// What each of the values of a choice means.
    pub possible_value_help: Vec<String>,
    /// What kind of value it takes.
    pub value_kind: ValueKind,
    /// Whether it may change while a fit runs.
    pub changes_mid_run: bool,
}

impl FitSettings {
    /// Every setting, in the order of the command line's help.
    pub fn described() -> Vec<SettingDescription> {
        let command = FitSettings::augment_args(clap::Command::new("fit"));
        let defaults = table_of(&FitSettings::default());
        let describe = |argument: &clap::Arg| {
            let name = argument.get_long()?;
            let choices = argument.get_possible_values();
            let value_kind = kind_of(defaults.get(name)?);
            let choices = if value_kind == ValueKind::Choice { choices } else { Vec::new() };
            let text = |help: Option<&clap::builder::StyledStr>| help.map(ToString::to_string).unwrap_or_default();
            Some(SettingDescription {
                name: name.into(),
                help: text(argument.get_long_help().or(argument.get_help())),
                possible_values: choices.iter().map(|choice| choice.get_name().into()).collect(),
                possible_value_help: choices.iter().map(|choice| text(choice.get_help())).collect(),
                value_kind,
                changes_mid_run: FitSettings::changes_mid_run(name),
            })
        };
        command.get_arguments().filter_map(describe).collect()
    }

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
            let choices = FitSettings::described().into_iter().find(|setting| setting.name == name);
            let choices = choices.map_or(Vec::new(), |setting| setting.possible_values);
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

fn table_of(settings: &FitSettings) -> Table {
    // Whole numbers of a table have a sign: a seed beyond, which no check lets pass, shows as the largest.
    let seed = settings.seed.min(i64::MAX as u64);
    Table::try_from(FitSettings { seed, ..settings.clone() }).unwrap_or_default()
}

fn kind_of(value: &Value) -> ValueKind {
    match value {
        Value::Integer(_) => ValueKind::Whole,
        Value::Float(_) => ValueKind::Number,
        Value::Boolean(_) => ValueKind::Switch,
        Value::Array(_) => ValueKind::Names,
        _ => ValueKind::Choice,
    }
}

fn text_of(value: &Value) -> String {
    match value {
        // Single precision: without the digits that widening adds.
        Value::Float(number) => (*number as f32).to_string(),
        Value::String(text) => text.clone(),
        Value::Array(names) => names.iter().map(text_of).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Preset;

    /// Another value than the default's, as text.
    fn another(setting: &SettingDescription) -> String {
        match setting.value_kind {
            ValueKind::Whole => "64".into(),
            ValueKind::Number => "0.123".into(),
            ValueKind::Switch => "true".into(),
            ValueKind::Choice => setting.possible_values[1].clone(),
            ValueKind::Names => "a, photo 2".into(),
        }
    }

    #[test]
    fn every_field_is_described_in_words() {
        let described = FitSettings::described();
        let fields = table_of(&FitSettings::default());
        assert_eq!(described.len(), fields.len());
        for (name, value) in &fields {
            let setting = described.iter().find(|setting| setting.name == *name).unwrap();
            assert!(setting.help.split_whitespace().count() >= 3, "{name}: '{}'", setting.help);
            if setting.value_kind == ValueKind::Choice {
                assert!(setting.possible_values.contains(&text_of(value)), "{name}: {:?}", setting.possible_values);
                assert!(setting.possible_value_help.iter().all(|help| !help.is_empty()), "{name}");
                assert!(setting.possible_values.len() >= 2, "{name}");
            } else {
                assert!(setting.possible_values.is_empty(), "{name}");
            }
        }
    }

    #[test]
    fn every_setting_is_set_and_read_back_and_nothing_else_changes() {
        let default = FitSettings::default();
        for setting in FitSettings::described() {
            let name = setting.name.as_str();
            let mut texts = vec![another(&setting), default.get_text(name).unwrap()];
            texts.extend(setting.possible_values.iter().cloned());
            for text in texts {
                let mut settings = default.clone();
                settings.set(name, &format!(" {text}\n")).unwrap();
                assert_eq!(settings.get_text(name).unwrap(), text, "{name}");
                let differences = default.differences(&settings);
                if text == default.get_text(name).unwrap() {
                    assert_eq!(settings, default);
                } else {
                    assert_eq!(differences, [(name.to_string(), default.get_text(name).unwrap(), text)]);
                    assert_eq!(default.with(&[name.into()], &settings).unwrap(), settings);
                }
            }
        }
        let mut settings = default.clone();
        settings.set("exclude", "a, b\nc,").unwrap();
        assert_eq!(settings.exclude, ["a", "b", "c"]);
    }

    #[test]
    fn a_bad_text_names_the_setting_and_changes_nothing() {
        let default = FitSettings::default();
        for setting in FitSettings::described() {
            let bad = match setting.value_kind {
                ValueKind::Whole => ["-1", "1.5", "", "18446744073709551615"].as_slice(),
                ValueKind::Number => &["nan", "inf", "", "a tenth"],
                ValueKind::Switch => &["yes", ""],
                ValueKind::Choice => &["nonsense", ""],
                ValueKind::Names => &[],
            };
            for text in bad {
                let mut settings = default.clone();
                let error = settings.set(&setting.name, text).unwrap_err();
                assert_eq!(error.place(), &Place::Setting(setting.name.clone()), "{error}");
                assert_eq!(error.kind(), ErrorKind::InvalidSetting);
                assert_eq!(settings, default);
            }
        }
        let error = default.clone().set("consistency", "some").unwrap_err();
        assert!(error.to_string().contains("none, released, constant, exact"), "{error}");
        assert!(default.clone().set("map_size", "64").unwrap_err().to_string().contains("--map_size"));
        assert!(default.get("no-such").is_err());
        assert!(FitSettings { seed: u64::MAX, ..default.clone() }.validate().is_err());
    }

    #[test]
    fn presets_are_sound_and_differ() {
        let [quick, balanced, careful] = [Preset::Quick, Preset::Balanced, Preset::Careful].map(FitSettings::preset);
        assert_eq!(balanced, FitSettings::default());
        for preset in [&quick, &careful] {
            preset.validate().unwrap();
            assert!(preset.differences(&balanced).len() >= 4);
            // A change of preset is no other scene: these belong to the user.
            for name in ["seed", "exclude", "background", "start"] {
                assert_eq!(preset.get(name).unwrap(), balanced.get(name).unwrap());
            }
        }
        let work = |settings: &FitSettings| {
            (settings.steps_diffuse + settings.steps_all) * settings.pixels_per_step * settings.samples
        };
        assert!(work(&quick) * 4 < work(&balanced) && work(&balanced) * 2 < work(&careful));
    }

    #[test]
    fn what_shapes_hang_on_is_fixed_while_a_fit_runs() {
        let fixed = FitSettings::described().into_iter().filter(|setting| !setting.changes_mid_run);
        let mut fixed: Vec<String> = fixed.map(|setting| setting.name).collect();
        fixed.sort();
        let expected = [
            "environment-height",
            "levels",
            "map-size",
            "method",
            "seed",
            "solver-choices",
            "solver-grid",
            "solver-levels",
            "solver-rounds",
            "start",
            "steps",
        ];
        assert_eq!(fixed, expected);
        assert!(!FitSettings::changes_mid_run("no-such"));
    }
}
