//! The headings under which `patina fit --help` lists what can be typed, and what `-h` leaves out.
//!
//! What a setting means stands at its field in [`crate::fit::FitSettings`]; how the help is laid out is said here.

/// The photos, the mesh, and how they are read.
pub const SCENE: &str = "Scene";
/// The environment, and what is taken as evidence for it.
pub const LIGHT: &str = "Light";
/// How maps are estimated, and how large they are.
pub const METHOD: &str = "Method";
/// What is written, and how often it is judged.
pub const OUTPUT: &str = "Output";
/// What few need to change; shown by `--help` alone.
pub const EXPERT: &str = "Expert";

/// Headings of the settings of a fit; those that are not listed are for experts.
const HEADINGS: [(&str, &str); 15] = [
    ("exclude", SCENE),
    ("environment-height", LIGHT),
    ("background", LIGHT),
    ("exposure", LIGHT),
    ("fixed-light", LIGHT),
    ("fixed-maps", LIGHT),
    ("method", METHOD),
    ("map-size", METHOD),
    ("bounces", METHOD),
    ("consistency", METHOD),
    ("steps", METHOD),
    ("solver-choices", METHOD),
    ("solver-refine", METHOD),
    ("seed", METHOD),
    ("held-out-interval", OUTPUT),
];

/// Settings whose value a scene decides when they are not typed ([`crate::fit::Suited`]): a default told beside them
/// would be one that few fits have. Their help says what is taken.
const DECIDED_BY_SCENE: [&str; 6] = ["method", "map-size", "exposure", "solver-grid", "solver-levels", "lobe"];

/// Puts the settings of a fit under their headings.
pub fn arrange(command: clap::Command) -> clap::Command {
    crate::fit::FitSettings::described().iter().fold(command, |command, setting| {
        // Arguments are known by the names of the fields.
        command.mut_arg(setting.name.replace('-', "_"), |argument| {
            let heading =
                HEADINGS.iter().find(|(name, _)| *name == setting.name).map_or(EXPERT, |(_, heading)| heading);
            argument
                .help_heading(heading)
                .hide_short_help(heading == EXPERT)
                .hide_default_value(DECIDED_BY_SCENE.contains(&setting.name.as_str()))
        })
    })
}

/// An option of the reader beside a run: where it is not typed, the scene is read as the run read it.
pub fn beside_a_run(argument: clap::Arg) -> clap::Arg {
    let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
    match help.split_once(" [default: ") {
        Some((told, otherwise)) if argument.get_help_heading() == Some(SCENE) => {
            argument.help(format!("{told} [default: as the run; else {otherwise}"))
        }
        _ => argument,
    }
}

/// Options of the reader that say what photos show, out of the help of what takes cameras alone. They are still
/// understood: a scene may not be read without them.
pub fn of_cameras(argument: clap::Arg) -> clap::Arg {
    let is_of_photos =
        ["scene_background", "masks", "encoding", "layer", "unit_in_metres"].contains(&argument.get_id().as_str());
    argument.hide(is_of_photos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::arguments::Arguments;
    use crate::fit::{FitSettings, Method, Suited};
    use crate::material::LobeModel;
    use clap::CommandFactory;

    fn fit_command() -> clap::Command {
        let mut all = Arguments::command();
        all.build();
        all.find_subcommand("fit").unwrap().clone()
    }

    #[test]
    fn every_option_of_a_fit_has_a_heading_and_every_heading_an_option() {
        let command = fit_command();
        let global = ["json", "threads", "help"];
        let options: Vec<_> = command.get_opts().filter(|option| !global.contains(&option.get_id().as_str())).collect();
        for option in &options {
            assert!(option.get_help_heading().is_some(), "{}", option.get_id());
        }
        for heading in [SCENE, LIGHT, METHOD, OUTPUT, EXPERT] {
            assert!(options.iter().any(|option| option.get_help_heading() == Some(heading)), "{heading}");
        }
        let described = FitSettings::described();
        let is_setting = |name: &str| described.iter().any(|setting| setting.name == name);
        assert!(
            HEADINGS.iter().all(|(name, _)| is_setting(name)) && DECIDED_BY_SCENE.iter().all(|name| is_setting(name))
        );
    }

    #[test]
    fn short_help_leaves_out_what_is_for_experts_and_long_help_does_not() {
        let short = fit_command().render_help().to_string();
        let long = fit_command().render_long_help().to_string();
        for expert in ["--rate-diffuse", "--lobe-ramp", "--solver-grid"] {
            assert!(!short.contains(expert) && long.contains(expert), "{expert}");
        }
        for common in ["--map-size", "--method", "--hold-out-every", "--env", "--output"] {
            assert!(short.contains(common), "{common}");
        }
        assert!(short.len() * 2 < long.len());
    }

    /// A default is told only where a fit without options has it, whatever the scene.
    #[test]
    fn defaults_that_are_told_are_true() {
        let command = fit_command();
        let told = |name: &str| {
            let argument = command.get_arguments().find(|argument| argument.get_long() == Some(name)).unwrap();
            !argument.is_hide_default_value_set() && !argument.get_default_values().is_empty()
        };
        let base = FitSettings::default();
        for (method, is_large, exposure, map_size) in [
            (Method::Solver, false, false, None),
            (Method::Solver, true, true, Some(512)),
            (Method::Adam, false, false, Some(256)),
        ] {
            let lobe = LobeModel::Ggx;
            let suited = Suited { method, is_large, exposure, lobe, map_size, sharpest_map_size: None };
            let settings = suited.resolve(&base, &[]);
            for (name, _, taken) in base.differences(&settings) {
                assert!(!told(&name), "--{name} tells a default, and {taken} was taken");
            }
        }
        for setting in FitSettings::described().iter().filter(|setting| told(&setting.name)) {
            let argument = command.get_arguments().find(|argument| argument.get_long() == Some(setting.name.as_str()));
            let shown = argument.unwrap().get_default_values()[0].to_string_lossy().into_owned();
            assert_eq!(shown, base.get_text(&setting.name).unwrap(), "--{}", setting.name);
        }
        // Options of the reader have no default of clap's; their text tells it.
        let read = crate::scene::ReadSettings::default();
        let text = |name: &str| {
            let argument = command.get_arguments().find(|argument| argument.get_long() == Some(name)).unwrap();
            argument.get_help().unwrap().to_string()
        };
        for (name, value) in [
            ("hold-out-every", read.hold_out_every.to_string()),
            ("max-views", read.max_views.to_string()),
            ("downsample", read.shrink.to_string()),
            ("up", read.up.to_string()),
        ] {
            assert!(text(name).contains(&format!("[default: {value}]")), "{name}: {}", text(name));
        }
    }

    #[test]
    fn beside_a_run_the_help_tells_what_the_run_was_read_by() {
        let mut all = Arguments::command();
        all.build();
        let help = |name: &str| all.find_subcommand(name).unwrap().clone().render_long_help().to_string();
        for name in ["relight", "render", "compare"] {
            let text = help(name);
            assert!(text.contains("[default: as the run; else 8]"), "{name}");
            assert!(!text.contains("[default: 8]"), "{name}");
            assert_eq!(text.contains("--encoding"), name != "relight");
        }
        use clap::Parser;
        assert!(Arguments::try_parse_from("patina relight r --env noon --encoding linear".split(' ')).is_ok());
    }

    #[test]
    fn what_was_typed_before_names_changed_is_still_understood() {
        use clap::Parser;
        let parsed = |words: &[&str]| Arguments::try_parse_from(words).map(|_| ()).map_err(|error| error.to_string());
        for line in [
            "patina fit s -o r --shrink 2 --method paper --solver-choices tell --preset quick",
            "patina fit s -o r --downsample 2 --method adam --solver-choices report --preset draft",
            "patina gauge r --factor 2 -o n",
            "patina rescale r --factor 2 -o n",
            "patina relight r --env noon --shrink 2",
        ] {
            assert_eq!(parsed(&line.split(' ').collect::<Vec<_>>()), Ok(()), "{line}");
        }
    }
}
