//! What a reader did not hand on as it stands in the file: one list of it, which every reader counts into.
//!
//! A [`Recording`](crate::recording::Recording) carries its [`Notes`]; whoever shows what was read shows them too.

use std::fmt::{self, Display};

use serde::Serialize;

/// What became of a part of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It is not in the recording.
    LeftOut,
    /// Several became one.
    Merged,
    /// The file ends, or is damaged, before its end.
    Cut,
    /// It was wrong, and what is right was certain.
    Mended,
    /// The file does not say what it means.
    Guessed,
    /// It is in the recording in another form.
    Converted,
}

/// A part of a file of which there are several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// A channel.
    Channel,
    /// A frame of a bus.
    Frame,
    /// A line of a text.
    Line,
    /// An object of a BLF file.
    Object,
    /// A row of a table.
    Row,
    /// A time stamp.
    Stamp,
    /// A statement of a DBC file.
    Statement,
    /// A single value.
    Value,
}

/// Parts with the same fate for the same reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// What became of them.
    pub fate: Fate,
    /// What they are.
    pub part: Part,
    /// Why, in a few words: `text`, `CAN FD`.
    pub why: String,
    /// How many there are.
    pub count: u64,
    /// Their names, if they have any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Where the first of them stands, such as `line 12`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<String>,
}

/// Everything that a reader passed over, merged, cut, mended, guessed or converted, in the order in which it was met.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Notes(Vec<Note>);

impl Notes {
    /// Counts a channel.
    pub fn channel(&mut self, fate: Fate, name: impl Into<String>, why: &str) {
        let note = self.of(fate, Part::Channel, why);
        note.count += 1;
        note.names.push(name.into());
    }

    /// Counts a part that has no name; `place` says where it stands, such as `line 12`.
    pub fn count(&mut self, fate: Fate, part: Part, why: &str, place: impl Display) {
        self.count_many(fate, part, why, 1, place);
    }

    /// Counts so many parts, of which the first stands at `place`.
    pub fn count_many(&mut self, fate: Fate, part: Part, why: &str, many: u64, place: impl Display) {
        if many > 0 {
            let note = self.of(fate, part, why);
            note.count += many;
            note.first.get_or_insert_with(|| place.to_string());
        }
    }

    fn of(&mut self, fate: Fate, part: Part, why: &str) -> &mut Note {
        let is_it = |note: &Note| note.fate == fate && note.part == part && note.why == why;
        let place = self.0.iter().position(is_it).unwrap_or_else(|| {
            self.0.push(Note {
                fate,
                part,
                why: why.into(),
                count: 0,
                names: Vec::new(),
                first: None,
            });
            self.0.len() - 1
        });
        &mut self.0[place]
    }

    /// Adds those of another reader.
    pub fn append(&mut self, other: Self) {
        for note in other.0 {
            let own = self.of(note.fate, note.part, &note.why);
            own.count += note.count;
            own.names.extend(note.names);
            own.first = own.first.take().or(note.first);
        }
    }

    /// The notes, in the order in which their first part was met.
    pub fn iter(&self) -> impl Iterator<Item = &Note> {
        self.0.iter()
    }

    /// Behind a sentence that refuses a file, what is in it otherwise; empty if there is nothing.
    #[must_use]
    pub fn aside(&self) -> String {
        let said: Vec<String> = self.0.iter().map(Note::to_string).collect();
        if said.is_empty() {
            String::new()
        } else {
            format!(" ({})", said.join("; "))
        }
    }

    /// Whether everything was handed on as it stands in the file.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Why there is no channel of this name, if it was left out.
    #[must_use]
    pub fn left_out(&self, name: &str) -> Option<String> {
        let is_it = |note: &&Note| {
            note.fate == Fate::LeftOut && note.names.iter().any(|own| own.eq_ignore_ascii_case(name))
        };
        let why = &self.0.iter().find(is_it)?.why;
        // A mistake in the file is all that there is to say.
        Some(match why.starts_with("line ") {
            true => why.clone(),
            false => format!("there is no channel {name}: it was left out ({why})"),
        })
    }
}

/// Most names that a sentence lists.
const MOST_NAMES: usize = 8;

impl Note {
    /// What, found, and done, as the tables of a drive have it.
    #[must_use]
    pub fn finding(&self) -> [String; 3] {
        let part = match self.part {
            Part::Channel => "channel",
            Part::Frame => "frame",
            Part::Line => "line",
            Part::Object => "object",
            Part::Row => "row",
            Part::Stamp => "time stamp",
            Part::Statement => "statement",
            Part::Value => "value",
        };
        let plural = if self.count == 1 { "" } else { "s" };
        let mut what = format!("{} {part}{plural}", self.count);
        if !self.names.is_empty() {
            let shown = self.names.len().min(MOST_NAMES);
            let more = if self.names.len() > shown { ", .." } else { "" };
            what += &format!(" ({}{more})", self.names[..shown].join(", "));
        }
        let first = match (&self.first, self.count) {
            (None, _) => String::new(),
            (Some(place), 1) => format!(", in {place}"),
            (Some(place), _) => format!(", the first in {place}"),
        };
        let done = match self.fate {
            Fate::LeftOut => "left out",
            Fate::Merged => "merged",
            Fate::Cut => "cut",
            Fate::Mended => "mended",
            Fate::Guessed => "guessed",
            Fate::Converted => "converted",
        };
        [what, format!("{}{first}", self.why), done.into()]
    }
}

/// `2 channels (gear, mode) left out: text`, `3 frames left out: CAN FD, the first in line 12`.
impl Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [what, why, done] = self.finding();
        write!(f, "{what} {done}: {why}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_fates_for_one_reason_are_one_note() {
        let mut notes = Notes::default();
        notes.channel(Fate::LeftOut, "gear", "text");
        notes.count(Fate::LeftOut, Part::Frame, "CAN FD", "line 12");
        notes.channel(Fate::LeftOut, "mode", "text");
        notes.count(Fate::LeftOut, Part::Frame, "CAN FD", "line 14");
        notes.count_many(Fate::Merged, Part::Row, "equal stamps", 0, "row 1");
        let mut other = Notes::default();
        other.count(Fate::LeftOut, Part::Frame, "CAN FD", "line 3");
        other.count(Fate::Mended, Part::Stamp, "decimal comma", "line 1");
        notes.append(other);
        let said: Vec<String> = notes.iter().map(Note::to_string).collect();
        assert_eq!(
            said,
            [
                "2 channels (gear, mode) left out: text",
                "3 frames left out: CAN FD, the first in line 12",
                "1 time stamp mended: decimal comma, in line 1",
            ]
        );
        let error = notes.left_out("mode");
        assert_eq!(
            error.as_deref(),
            Some("there is no channel mode: it was left out (text)")
        );
        assert_eq!(notes.left_out("angle"), None);
    }
}
