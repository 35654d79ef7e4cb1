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
        let many = |name: &str| self.channels().filter(|(_, c)| c.name == name).count() > 1;
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
                let name = match many(&channel.name) {
                    true => format!("{}.{}", group.name, channel.name),
                    false => channel.name.clone(),
                };
                channels.push(Series {
                    name,
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
        let whole = |name: &str| {
            let mut all = self.channels().filter(|(_, c)| c.name == name);
            all.all(|(_, c)| c.values.iter().all(|v| v.is_nan() || v.fract() == 0.0))
        };
        self.on_grid(rate_hz, longest_s.unwrap_or(f64::INFINITY), whole)
    }

    /// As [`Recording::resampled`], with a say in which channels are held.
    ///
    /// # Errors
    /// As there.
    fn on_grid(
        &self,
        rate_hz: f64,
        longest_s: f64,
        held: impl Fn(&str) -> bool,
    ) -> Result<Group, RecordingError> {
        self.check_names()?;
        let mut courses = Vec::new();
        for (group, channel) in self.channels() {
            if let Some(k) = group.step_back() {
                let name = &channel.name;
                return Err(format!("channel {name}: row {}: the time does not grow", k + 2).into());
            }
            let (time_s, values) = channel.present_values(group);
            let longest = (1..time_s.len()).max_by(|a, b| {
                let gap = |k: usize| time_s[k] - time_s[k - 1];
                gap(*a).total_cmp(&gap(*b))
            });
            if let Some(k) = longest.filter(|&k| (time_s[k] - time_s[k - 1]) * rate_hz > MOST_BRIDGED) {
                let (name, before, after) = (&channel.name, time_s[k - 1], time_s[k]);
                return Err(format!(
                    "channel {name}: its time goes from {before} to {after} s: a clock that was set, or a logger that slept; \
                     cut the file there, or leave the instants as they are (no --rate)"
                )
                .into());
            }
            if !time_s.is_empty() {
                courses.push((channel, time_s, values));
            }
        }
        let (starts, ends): (Vec<f64>, Vec<f64>) =
            courses.iter().map(|(_, t, _)| (t[0], t[t.len() - 1])).unzip();
        let from = starts.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let to = ends.into_iter().fold(f64::INFINITY, f64::min);
        let rows = ((to - from) * rate_hz + 1e-6).floor() + 1.0;
        if courses.is_empty() || rows < 1.0 {
            return Err("the channels have no time in common".into());
        }
        if rows * courses.len() as f64 > MOST_VALUES {
            let (span_s, count) = (to - from, courses.len());
            return Err(format!(
                "{count} channels over {span_s:.0} s at {rate_hz} Hz are {:.1e} values, and {MOST_VALUES:.0e} are the most: \
                 give a lower --rate",
                rows * count as f64
            )
            .into());
        }
        let time_s: Vec<f64> = (0..rows as usize).map(|k| from + k as f64 / rate_hz).collect();
        let channels = courses
            .into_iter()
            .map(|(channel, t, v)| Series {
                values: on_grid((&t, &v), &time_s, longest_s, held(&channel.name)),
                ..channel.clone()
            })
            .collect();
        Ok(Group::new(time_s, channels))
    }
}

/// Values of a course at rising instants: as held, or on the line between neighbours. Instants up to a microsecond before a
/// value have it already, as clocks round.
fn on_grid((time_s, values): (&[f64], &[f64]), at_s: &[f64], longest_s: f64, held: bool) -> Vec<f64> {
    let mut k = 0;
    at_s.iter()
        .map(|&t| {
            while k + 1 < time_s.len() && time_s[k + 1] <= t + 1e-6 {
                k += 1;
            }
            let next = (k + 1).min(time_s.len() - 1);
            if t > time_s[k] + 1e-6 && time_s[next] - time_s[k] > longest_s {
                f64::NAN
            } else if held || time_s[next] <= time_s[k] {
                values[k]
            } else {
                values[k] + (t - time_s[k]) / (time_s[next] - time_s[k]) * (values[next] - values[k])
            }
        })
        .collect()
}
