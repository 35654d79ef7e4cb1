//! The text of a DBC file that is not understood as a whole: read statement by statement, so that one that is wrong takes no
//! other along.

use std::collections::HashSet;

use can_dbc::{Dbc, DbcError};

use crate::notes::{Fate, Notes, Part};
use crate::recording::RecordingError;

const WHY: &str = "the DBC file's text is not understood";

/// Whether a line within quotes can begin a statement: where a quote is not closed, what follows stands within it.
#[derive(Clone, Copy, PartialEq)]
enum Within {
    Text,
    Statements,
}

/// Reads the text of a DBC file.
///
/// # Errors
/// No message in it is understood, with the place of the first mistake.
pub(super) fn understood(text: &str, notes: &mut Notes) -> Result<Dbc, RecordingError> {
    let first = match Dbc::try_from(text) {
        Ok(dbc) => return Ok(dbc),
        Err(error) => error,
    };
    let mut kept = Kept {
        text: String::with_capacity(text.len()),
        without: HashSet::new(),
        notes,
    };
    for (line, statement) in statements(text, Within::Text) {
        if is_understood(statement) {
            kept.text += statement;
        } else {
            for (own, part) in statements(statement, Within::Statements) {
                kept.take(line + own - 1, part);
            }
        }
    }
    let (whole, without) = (kept.text, kept.without);
    let mut dbc = Dbc::try_from(whole.as_str()).map_err(|e| refuse(&e))?;
    for message in &mut dbc.messages {
        let id = message.id.raw().to_string();
        message
            .signals
            .retain(|signal| !without.contains(&(id.clone(), signal.name.clone())));
    }
    if dbc.messages.is_empty() {
        return Err(refuse(&first));
    }
    Ok(dbc)
}

/// What is understood so far.
struct Kept<'a> {
    text: String,
    /// Signals that mean another value than they say without the statement that was left out.
    without: HashSet<(String, String)>,
    notes: &'a mut Notes,
}

impl Kept<'_> {
    /// Takes a statement, or what is understood of it.
    fn take(&mut self, line: usize, statement: &str) {
        let mut words = statement.lines().next().unwrap_or_default().split_whitespace();
        match (words.next(), words.next(), words.next()) {
            _ if is_understood(statement) => self.text += statement,
            (Some("BO_"), Some(_), Some(name)) => self.message(name.trim_end_matches(':'), statement),
            (Some("SG_MUL_VAL_" | "SIG_VALTYPE_"), Some(id), Some(name)) => {
                let name = name.trim_end_matches(':');
                self.without.insert((id.to_owned(), name.to_owned()));
                self.notes.channel(Fate::LeftOut, name, WHY);
            }
            _ => {
                let place = format_args!("line {line}");
                self.notes.count(Fate::LeftOut, Part::Statement, WHY, place);
            }
        }
    }

    /// Takes a message with those of its signals that are understood.
    fn message(&mut self, name: &str, statement: &str) {
        let mut lines = statement.split_inclusive('\n');
        let heading = lines.next().unwrap_or_default();
        let mut whole = heading.to_owned();
        let mut aside = Vec::new();
        for line in lines {
            if is_understood(&format!("{heading}{line}")) {
                whole += line;
            } else {
                let name = line.split_whitespace().nth(1).unwrap_or(line);
                aside.push(name.split(':').next().unwrap_or(name));
            }
        }
        // Its first line is not, then.
        if is_understood(&whole) {
            self.text += &whole;
        } else {
            aside = vec![name];
        }
        for name in aside {
            self.notes.channel(Fate::LeftOut, name, WHY);
        }
    }
}

fn is_understood(text: &str) -> bool {
    Dbc::try_from(text).is_ok()
}

/// The statements with their lines, from 1: each from a line that begins with its word, `BO_` or another in capitals, to the next
/// such line. A message has its signals behind it.
fn statements(text: &str, within: Within) -> Vec<(usize, &str)> {
    let mut begins = vec![(1, 0)];
    let (mut place, mut quotes) = (0, 0);
    for (i, line) in text.split_inclusive('\n').enumerate() {
        let is_word = |c: char| c.is_ascii_uppercase() || c == '_';
        let word = &line[..line.find(|c| !is_word(c)).unwrap_or(line.len())];
        let begins_here = (word.ends_with('_') || word == "VERSION") && word != "SG_";
        if begins_here && place > 0 && (quotes % 2 == 0 || within == Within::Statements) {
            begins.push((i + 1, place));
        }
        quotes += line.matches('"').count() - line.matches("\\\"").count();
        place += line.len();
    }
    let ends = begins.iter().skip(1).map(|(_, place)| *place).chain([text.len()]);
    let spans = begins.iter().zip(ends);
    spans
        .map(|((line, from), to)| (*line, &text[*from..to]))
        .collect()
}

/// Place and reason, out of a drawing of several lines.
fn refuse(error: &DbcError) -> RecordingError {
    let said = error.to_string();
    let lines: Vec<&str> = said.lines().map(str::trim).collect();
    let place = lines.iter().find_map(|line| line.strip_prefix("--> "));
    let place = place.map(|place| format!("line {}: ", place.replace(':', ", column ")));
    let reason = lines.last().map_or("", |line| line.trim_start_matches("= "));
    RecordingError(format!(
        "the DBC file is not understood: {}{reason}",
        place.unwrap_or_default()
    ))
}
