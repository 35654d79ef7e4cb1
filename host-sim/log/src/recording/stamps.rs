//! Time stamps as they are before anything is made of them: what does not grow is mended where that is certain, or refused.

use super::{Group, Recording, RecordingError};
use crate::notes::{Fate, Notes, Part};

/// Share of steps that do not grow from which on the stamps are no clock at all.
const NO_CLOCK: f64 = 0.2;

/// The lines of a text on which the rows of a group stand.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lines(
    /// Rows from which on the line is so much more than the row.
    Vec<(usize, u64)>,
);

impl Lines {
    /// Says on which line a row stands; rows come in order.
    pub fn push(&mut self, row: usize, line: u64) {
        let more = line - row as u64;
        if self.0.last().is_none_or(|(_, last)| *last != more) {
            self.0.push((row, more));
        }
    }

    /// The line of a row, if the file has lines.
    #[must_use]
    pub fn of(&self, row: usize) -> Option<u64> {
        let next = self.0.partition_point(|(from, _)| *from <= row);
        let (_, more) = self.0.get(next.checked_sub(1)?)?;
        Some(row as u64 + more)
    }

    /// Where a row stands in the file: its line in a text, else its row, from 1.
    #[must_use]
    pub fn place(&self, row: usize) -> String {
        match self.of(row) {
            Some(line) => format!("line {line}"),
            None => format!("row {}", row + 1),
        }
    }
}

impl Group {
    /// Leaves out rows without a stamp, and rows that are there twice.
    ///
    /// # Errors
    /// Stamps that do not grow, with the first place and what it looks like.
    fn settle(&mut self, notes: &mut Notes) -> Result<(), RecordingError> {
        let grows = |w: &[f64]| w[1] > w[0];
        if self.time_s.windows(2).all(grows) && self.time_s.iter().all(|t| t.is_finite()) {
            return Ok(());
        }
        let bits = |x: &f64, y: &f64| x.to_bits() == y.to_bits();
        let same = |a: usize, b: usize| self.channels.iter().all(|c| bits(&c.values[a], &c.values[b]));
        let mut kept: Vec<usize> = Vec::with_capacity(self.time_s.len());
        for (row, time_s) in self.time_s.iter().enumerate() {
            let before = kept.last().copied();
            if !time_s.is_finite() {
                notes.count(Fate::LeftOut, Part::Row, "no time", self.lines.place(row));
            } else if before.is_some_and(|last| self.time_s[last] == *time_s && same(last, row)) {
                notes.count(
                    Fate::Merged,
                    Part::Row,
                    "there twice, with all values",
                    self.lines.place(row),
                );
            } else {
                kept.push(row);
            }
        }
        if let Some(w) = kept.windows(2).find(|w| self.time_s[w[1]] <= self.time_s[w[0]]) {
            return Err(self.does_not_grow(&kept, w[0], w[1]));
        }
        let mut lines = Lines::default();
        for (row, was) in kept.iter().enumerate() {
            if let Some(line) = self.lines.of(*was) {
                lines.push(row, line);
            }
        }
        self.lines = lines;
        let only = |values: &[f64]| kept.iter().map(|row| values[*row]).collect();
        self.time_s = only(&self.time_s);
        for channel in &mut self.channels {
            channel.values = only(&channel.values);
        }
        Ok(())
    }

    fn does_not_grow(&self, kept: &[usize], before: usize, row: usize) -> RecordingError {
        let [a, b] = [before, row].map(|row| self.time_s[row]);
        let steps = kept.windows(2).map(|w| self.time_s[w[1]] - self.time_s[w[0]]);
        let (count, backward) = steps.fold((0, 0), |(n, back), step| (n + 1, back + i32::from(step <= 0.0)));
        let guess = if f64::from(backward) > NO_CLOCK * f64::from(count) {
            "are these the times from row to row, or stamps too coarse for the rows?"
        } else if b == a {
            "two rows have one stamp, and differ"
        } else {
            "does its clock wrap, was it set back, or are two drives in one file?"
        };
        let place = self.lines.place(row);
        format!("{place}: the time goes from {a} to {b} s, and must grow: {guess}").into()
    }
}

impl Recording {
    /// Its groups with stamps that grow, before any of them are merged: those of other groups are left out by name.
    ///
    /// # Errors
    /// Stamps that do not grow in every group.
    pub fn settled(mut self) -> Result<Self, RecordingError> {
        let (mut kept, mut refused) = (Vec::new(), None);
        for mut group in self.groups {
            match group.settle(&mut self.notes) {
                Ok(()) => kept.push(group),
                Err(error) => {
                    for channel in group.channels {
                        let why = format!("group {:?}, {error}", group.name);
                        self.notes.channel(Fate::LeftOut, channel.name, &why);
                    }
                    refused.get_or_insert(error);
                }
            }
        }
        self.groups = kept;
        match refused {
            Some(error) if self.groups.is_empty() => Err(error),
            _ => Ok(self),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Series;

    fn group(time_s: &[f64], values: &[f64]) -> Group {
        let values = values.to_vec();
        let channel = Series {
            name: "a".into(),
            values,
            ..Series::default()
        };
        Group::new(time_s.to_vec(), vec![channel])
    }

    #[test]
    fn rows_that_are_there_twice_or_have_no_time_are_counted() {
        let nan = f64::NAN;
        let whole = Recording::of(group(&[0.0, 0.1, 0.1, nan, 0.2], &[1.0, nan, nan, 3.0, 4.0]));
        let whole = whole.settled().unwrap();
        assert_eq!(whole.groups[0].time_s, [0.0, 0.1, 0.2]);
        let values = &whole.groups[0].channels[0].values;
        assert!(values[0] == 1.0 && values[1].is_nan() && values[2] == 4.0);
        let said: Vec<String> = whole.notes.iter().map(ToString::to_string).collect();
        assert_eq!(
            said,
            [
                "1 row merged: there twice, with all values, in row 3",
                "1 row left out: no time, in row 4"
            ]
        );
    }

    #[test]
    fn what_does_not_grow_is_refused_with_what_it_looks_like() {
        let seconds = |count: u32, period: u32| (0..count).map(move |k| f64::from(k % period) * 0.1);
        for (time_s, says) in [
            (
                seconds(900, 600).collect::<Vec<_>>(),
                "row 601: the time goes from 59.900000000000006 to 0 s, and must grow: does its clock wrap",
            ),
            (
                (0..50).map(|k| 0.01 + f64::from(k % 2) * 1e-4).collect(),
                "row 3: the time goes from 0.0101 to 0.01 s, and must grow: are these the times from row to row",
            ),
            (
                vec![1.0; 9],
                "row 2: the time goes from 1 to 1 s, and must grow: are these",
            ),
            (
                [0.0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5, 0.6].to_vec(),
                "row 4: the time goes from 0.2 to 0.2 s, and must grow: two rows have one stamp",
            ),
        ] {
            let values: Vec<f64> = (0..time_s.len()).map(|k| k as f64).collect();
            let error = Recording::of(group(&time_s, &values)).settled().unwrap_err();
            assert!(error.to_string().starts_with(says), "{error}");
        }
    }

    #[test]
    fn a_group_whose_stamps_do_not_grow_is_left_out_by_name() {
        let good = Group {
            name: "good".into(),
            ..group(&[0.0, 1.0], &[1.0, 2.0])
        };
        let mut bad = group(&[1.0, 0.0], &[1.0, 2.0]);
        bad.channels[0].name = "b".into();
        let both = Recording::from(vec![good, bad]).settled().unwrap();
        assert_eq!(both.groups.len(), 1);
        let error = both.find("b").unwrap_err().to_string();
        assert!(
            error.contains("there is no channel b: it was left out (group \"\", row 2"),
            "{error}"
        );
    }

    #[test]
    fn a_row_knows_its_line() {
        let mut lines = Lines::default();
        for (row, line) in [(0, 2), (1, 3), (2, 5), (3, 6), (4, 9)] {
            lines.push(row, line);
        }
        assert_eq!(
            [0, 1, 2, 3, 4, 5].map(|row| lines.of(row)),
            [2, 3, 5, 6, 9, 10].map(Some)
        );
        assert_eq!(Lines::default().of(3), None);
    }
}
