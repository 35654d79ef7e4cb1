//! Channels of several groups over one list of instants.

use super::{Group, Recording, RecordingError, Series};

/// Most values of a table on an even grid.
const MOST_VALUES: f64 = 3e7;
/// Most rows between two values of a channel.
const MOST_BRIDGED: f64 = 1e6;

impl Recording {
    /// All channels over one list of instants: those of every group. Where a channel has no value of its own it is NaN.
    ///
    /// # Errors
    /// Instants of a group that do not grow, where there is more than one group.
    pub fn into_one_group(self) -> Result<Group, RecordingError> {
        self.check_names()?;
        if self.groups.len() <= 1 {
            return Ok(self.groups.into_iter().next().unwrap_or_default());
        }
        // Zero is added so that a negative zero, which some loggers write first, is the same instant as zero.
        let instants = |g: &Group| g.time_s.iter().map(|t| t + 0.0).collect::<Vec<f64>>();
        let mut time_s: Vec<f64> = self.groups.iter().flat_map(instants).collect();
        time_s.sort_by(f64::total_cmp);
        time_s.dedup();
        let mut channels = Vec::new();
        for group in &self.groups {
            // Two frames of a message with one time stamp: the later one counts.
            let places: Vec<usize> = instants(group)
                .iter()
                .map(|t| time_s.partition_point(|u| u.total_cmp(t).is_lt()))
                .collect();
            for channel in &group.channels {
                let mut values = vec![f64::NAN; time_s.len()];
                for (place, value) in places.iter().zip(&channel.values) {
                    values[*place] = *value;
                }
                channels.push(Series {
                    name: self.name(group, channel),
                    values,
                    ..channel.clone()
                });
            }
        }
        Ok(Group::new(time_s, channels))
    }

    /// Two channels of one group by one name could not be told apart in a file.
    fn check_names(&self) -> Result<(), RecordingError> {
        for group in &self.groups {
            let mut names: Vec<&str> = group.channels.iter().map(|c| c.name.as_str()).collect();
            names.sort_unstable();
            if let Some(twice) = names.windows(2).find(|w| w[0] == w[1]) {
                return Err(format!("channel {} is there twice", twice[0]).into());
            }
        }
        Ok(())
    }

    /// All channels every `1/rate_hz` s, over the time that all cover: values that steps describe (integers) as held, others
    /// on the line between their neighbours, and none in pauses longer than `longest_s`, if that is given.
    ///
    /// # Errors
    /// No time that all channels cover, instants that do not grow, a clock that was set, more than 30 million values.
    pub fn resampled(&self, rate_hz: f64, longest_s: Option<f64>) -> Result<Group, RecordingError> {
        self.check_names()?;
        let mut courses = Vec::new();
        for (group, channel) in self.channels() {
            let name = self.name(group, channel);
            if let Some(k) = group.step_back() {
                return Err(format!("channel {name}: row {}: the time does not grow", k + 2).into());
            }
            let mut seen = Seen::default();
            present(group, channel).for_each(|(time_s, value)| seen.take(time_s, value));
            if seen.samples > 0 {
                courses.push((group, channel, name, seen));
            }
        }
        let grid = Grid::over(
            courses.iter().map(|(_, _, name, seen)| (&name[..], seen)),
            rate_hz,
            longest_s,
        )?;
        let channels = courses.iter().map(|(group, channel, name, _)| {
            let same = courses.iter().filter(|(_, other, ..)| other.name == channel.name);
            let mut course = OnGrid::new(same.into_iter().all(|(.., seen)| seen.is_whole));
            present(group, channel).for_each(|(time_s, value)| course.take(&grid, time_s, value));
            Series {
                name: name.clone(),
                unit: channel.unit.clone(),
                source: channel.source.clone(),
                values: course.finish(&grid),
            }
        });
        Ok(Group::new(grid.instants(), channels.collect()))
    }
}

/// The values of a channel that are there.
fn present<'a>(group: &'a Group, channel: &'a Series) -> impl Iterator<Item = (f64, f64)> {
    let all = group.time_s.iter().copied().zip(channel.values.iter().copied());
    all.filter(|(_, value)| !value.is_nan())
}

/// What is known of a channel before its values are put on a grid.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    /// First and last instant of a value.
    pub(crate) span_s: [f64; 2],
    pub(crate) samples: usize,
    /// The longest pause.
    longest_s: [f64; 2],
    /// Whether all values are whole numbers.
    pub(crate) is_whole: bool,
}

impl Default for Seen {
    fn default() -> Self {
        Self {
            span_s: [0.0; 2],
            samples: 0,
            longest_s: [0.0; 2],
            is_whole: true,
        }
    }
}

impl Seen {
    /// Takes the next value.
    pub(crate) fn take(&mut self, time_s: f64, value: f64) {
        let [first, last] = if self.samples == 0 {
            [time_s; 2]
        } else {
            self.span_s
        };
        if time_s - last > self.longest_s[1] - self.longest_s[0] {
            self.longest_s = [last, time_s];
        }
        self.span_s = [first, time_s];
        self.samples += 1;
        self.is_whole &= value.fract() == 0.0;
    }
}

/// Instants up to a microsecond before a value have it already, as clocks round.
const ROUNDED_S: f64 = 1e-6;

/// Instants at one distance, over the time that all channels cover.
pub struct Grid {
    from_s: f64,
    rate_hz: f64,
    rows: usize,
    longest_s: f64,
}

impl Grid {
    /// So many instants from `from_s` on. Between values farther apart than `longest_s` there is none.
    #[must_use]
    pub const fn even(from_s: f64, rate_hz: f64, rows: usize, longest_s: f64) -> Self {
        Self {
            from_s,
            rate_hz,
            rows,
            longest_s,
        }
    }

    /// The grid of these channels.
    ///
    /// # Errors
    /// As of [`Recording::resampled`].
    pub(crate) fn over<'a>(
        channels: impl Iterator<Item = (&'a str, &'a Seen)>,
        rate_hz: f64,
        longest_s: Option<f64>,
    ) -> Result<Self, RecordingError> {
        let (mut from_s, mut to_s, mut count) = (f64::NEG_INFINITY, f64::INFINITY, 0.0);
        for (name, seen) in channels {
            let [before, after] = seen.longest_s;
            if (after - before) * rate_hz > MOST_BRIDGED {
                return Err(format!(
                    "channel {name}: its time goes from {before} to {after} s: a clock that was set, or a logger that slept; \
                     cut the file there, or leave the instants as they are (no --rate)"
                )
                .into());
            }
            from_s = seen.span_s[0].max(from_s);
            to_s = seen.span_s[1].min(to_s);
            count += 1.0;
        }
        let rows = ((to_s - from_s) * rate_hz + 1e-6).floor() + 1.0;
        if count == 0.0 || rows < 1.0 {
            return Err("the channels have no time in common".into());
        }
        if rows * count > MOST_VALUES {
            return Err(format!(
                "{count} channels over {:.0} s at {rate_hz} Hz are {:.1e} values, and {MOST_VALUES:.0e} are the most: \
                 give a lower --rate",
                to_s - from_s,
                rows * count
            )
            .into());
        }
        Ok(Self {
            from_s,
            rate_hz,
            rows: rows as usize,
            longest_s: longest_s.unwrap_or(f64::INFINITY),
        })
    }

    fn instant(&self, row: usize) -> f64 {
        self.from_s + row as f64 / self.rate_hz
    }

    pub(crate) fn instants(&self) -> Vec<f64> {
        (0..self.rows).map(|row| self.instant(row)).collect()
    }
}

/// A channel on a grid, from values that come in the order of their time: as held, or on the line between neighbours.
pub struct OnGrid {
    is_held: bool,
    /// The latest value. One that comes at its instant takes its place.
    last: Option<(f64, f64)>,
    values: Vec<f64>,
}

impl OnGrid {
    /// A channel whose values are held, or lie on lines.
    #[must_use]
    pub const fn new(is_held: bool) -> Self {
        Self {
            is_held,
            last: None,
            values: Vec::new(),
        }
    }

    /// Takes the next value.
    pub fn take(&mut self, grid: &Grid, time_s: f64, value: f64) {
        let next = (time_s, value);
        if let Some(last) = self.last.filter(|last| last.0 < time_s) {
            self.fill(grid, last, Some(next));
        }
        self.last = Some(next);
    }

    fn fill(&mut self, grid: &Grid, (time_s, value): (f64, f64), next: Option<(f64, f64)>) {
        while self.values.len() < grid.rows {
            let now_s = grid.instant(self.values.len());
            let at_now = match next {
                Some((next_s, _)) if next_s <= now_s + ROUNDED_S => return,
                Some((next_s, _)) if now_s > time_s + ROUNDED_S && next_s - time_s > grid.longest_s => {
                    f64::NAN
                }
                Some((next_s, next)) if !self.is_held => {
                    value + (now_s - time_s) / (next_s - time_s) * (next - value)
                }
                _ => value,
            };
            self.values.push(at_now);
        }
    }

    /// The value at each instant; none if no value came.
    #[must_use]
    pub fn finish(mut self, grid: &Grid) -> Vec<f64> {
        if let Some(last) = self.last {
            self.fill(grid, last, None);
        }
        self.values
    }
}
