//! Each setting in words: what it means and which values it takes.
//!
//! The help of the command line is the one text on a setting; what is here is read off it, so that a form in a window
//! and `patina fit --help` cannot say different things, and a new field appears in both.

pub use super::by_name::ValueKind;
use super::by_name::{kind_of, table_of};
use super::settings::FitSettings;
use clap::Args;

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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{ErrorKind, Place};
    use crate::fit::Preset;
    use crate::fit::by_name::text_of;

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
            "fixed-maps",
            "levels",
            "lobe",
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
