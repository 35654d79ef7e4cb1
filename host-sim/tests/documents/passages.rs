//! Numbers in sentences are those that a command prints.
//!
//! `<!-- of: COMMAND -->` begins a passage and `<!-- /of -->` ends it. Every number between them, as far as it is written there, has
//! to be among those that the command printed. COMMAND is a part of a command line above; where no line has it, it begins with
//! `cargo run --release` and runs for the passage alone. Numbers in backticks, and those that are a part of a name such as
//! `K_1`, do not count; a number as a word does not either.

/// A passage whose numbers a command prints.
#[derive(Debug, PartialEq)]
pub(super) struct Passage<'t> {
    pub(super) command: &'t str,
    text: &'t str,
}

const BEGIN: &str = "<!-- of: ";
const END: &str = "<!-- /of -->";

/// The passages of a document.
pub(super) fn passages(document: &str) -> Vec<Passage<'_>> {
    let passage = |rest| {
        let (command, rest) = str::split_once(rest, " -->").expect("the end of a comment");
        let (text, _) = rest
            .split_once(END)
            .unwrap_or_else(|| panic!("{BEGIN}{command}: no {END}"));
        Passage { command, text }
    };
    document.split(BEGIN).skip(1).map(passage).collect()
}

impl<'t> Passage<'t> {
    /// Numbers of the passage that are not among those that were printed.
    pub(super) fn wrong(&self, printed: &str) -> Vec<&'t str> {
        let there: Vec<f64> = numbers(printed).into_iter().filter_map(value).collect();
        let code = self.text.split('`').step_by(2);
        let written: Vec<&str> = code.flat_map(numbers).collect();
        assert!(!written.is_empty(), "{BEGIN}{}: no number", self.command);
        let is_wrong = |number: &&str| {
            let decimals = number.split_once('.').map_or(0, |(_, behind)| behind.len());
            let rounded = |value: &f64| format!("{value:.decimals$}");
            let number = number.replace(',', "");
            !there.iter().any(|value| rounded(value) == number)
        };
        written.into_iter().filter(is_wrong).collect()
    }
}

fn value(number: &str) -> Option<f64> {
    number.replace(',', "").parse().ok()
}

/// Numbers without their signs; thousands may be set apart by commas.
fn numbers(text: &str) -> Vec<&str> {
    let part = |c: char| c.is_alphanumeric() || c == '_' || c == '.' || c == ',';
    let words = text.split(|c| !part(c));
    let words = words.map(|word| word.trim_matches(|c| c == '.' || c == ','));
    let is_number = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit()) && value(word).is_some();
    words.filter(is_number).collect()
}

#[test]
fn a_number_of_a_passage_has_to_be_printed_as_far_as_it_is_written() {
    let text = "a <!-- of: run x -->from 0.22 m to `7` 1,250 s, with K_1, and -3.<!-- /of --> 99";
    let found = passages(text);
    assert_eq!(found[0].command, "run x");
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].wrong("0.2226  1250.4 (-3)"), [""; 0]);
    assert_eq!(found[0].wrong("0.2266  1251 3.5"), ["0.22", "1,250", "3"]);
}
