//! Which cases of a study are taken: words that their names hold.

use std::str::FromStr;

/// Choices, each a list of words; a case is taken when its name holds all words of one choice, and none of those that
/// begin with `!`. Without a choice all are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CasePattern {
    choices: Vec<Vec<String>>,
}

impl CasePattern {
    /// Whether a case of this name is taken.
    pub fn takes(&self, case: &str) -> bool {
        let holds = |words: &Vec<String>| {
            words.iter().all(|word| match word.strip_prefix('!') {
                Some(unwanted) => !case.contains(unwanted),
                None => case.contains(word.as_str()),
            })
        };
        self.choices.is_empty() || self.choices.iter().any(holds)
    }

    /// Whether a word stands in it: for parts of a study that are taken only when they are asked for.
    pub fn names(&self, word: &str) -> bool {
        self.choices.iter().flatten().any(|own| own.contains(word))
    }
}

impl FromStr for CasePattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let choices: Vec<Vec<String>> =
            text.split(',').map(|choice| choice.split_whitespace().map(str::to_string).collect()).collect();
        if choices.iter().any(Vec::is_empty) {
            return Err(
                "give words that names of cases hold, such as `fig5 nickel` or `fig2 !GGX`; a comma stands for `or`"
                    .into(),
            );
        }
        Ok(CasePattern { choices })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_is_taken_by_all_words_of_one_choice() {
        let pattern: CasePattern = "fig5 nickel,fig4 deep".parse().unwrap();
        assert!(pattern.takes("fig5/nickel/lebombo/ibrdf") && pattern.takes("fig4/chrome/lebombo/known + deep"));
        assert!(!pattern.takes("fig5/chrome/lebombo/known + deep") && !pattern.takes("fig3/nickel"));
        let without: CasePattern = "fig2 !DSBRDF".parse().unwrap();
        assert!(without.takes("fig2/nickel/GGX") && !without.takes("fig2/nickel/DSBRDF"));
        assert!(CasePattern::default().takes("anything"));
        assert!(pattern.names("fig4") && !pattern.names("fig3"));
        assert!("".parse::<CasePattern>().is_err() && "fig5,".parse::<CasePattern>().is_err());
    }
}
