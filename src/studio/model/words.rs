//! How the window says what the terminal says by names of settings and by flags.

/// A text with its first letter large.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A setting's name in words: `map-size` becomes `Map size`.
pub fn of_setting(name: &str) -> String {
    let named = [
        ("solver-rounds", "Light iterations"),
        ("solver-refine", "Whole-pixel refinement"),
        ("bounces", "Max bounces"),
        ("exposure", "Per-photo exposure compensation"),
        ("background", "Background pixels"),
    ];
    if let Some((_, words)) = named.iter().find(|(own, _)| *own == name) {
        return (*words).into();
    }
    capitalised(&name.replace('-', " "))
}

/// A text of the terminal as the window says it: `--map-size` is the setting “Map size”.
pub fn without_flags(text: &str) -> String {
    let mut words = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(place) = rest.find("--") {
        let (before, flag) = rest.split_at(place);
        let name: String = flag[2..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
        let is_flag = !name.is_empty() && before.chars().next_back().is_none_or(|c| c.is_whitespace() || c == '(');
        words += before;
        words += &match is_flag {
            true => format!("“{}”", of_setting(name.trim_end_matches('-'))),
            false => flag[..2 + name.len()].to_owned(),
        };
        rest = &flag[2 + name.len()..];
    }
    words + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_settings_and_dashes_stay() {
        for (text, words) in [
            ("exclude them with --exclude if they do not belong", "exclude them with “Exclude” if they do not belong"),
            ("give a smaller --map-size or --bounces", "give a smaller “Map size” or “Max bounces”"),
            ("--steps", "“Steps”"),
            ("a -- b, c--d", "a -- b, c--d"),
            ("", ""),
        ] {
            assert_eq!(without_flags(text), words);
        }
    }
}
