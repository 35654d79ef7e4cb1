//! A part of a recording, under names of one's own.

use super::{Lines, Recording, RecordingError, Series, Term};
use crate::units;

impl Recording {
    /// Its channels under other names, each in the unit that its new name ends with, if it ends with one.
    ///
    /// # Errors
    /// No such channel; a unit that does not convert.
    pub fn renamed(mut self, names: &[(String, Term)]) -> Result<Self, RecordingError> {
        let mut found = Vec::new();
        for (name, term) in names {
            let (_, series) = self.find(&term.channel)?;
            let unit = units::of_name(name).unwrap_or(&series.unit).to_owned();
            let factor = term.factor(series, &unit)?;
            found.push((std::ptr::from_ref(series), name, unit, factor));
        }
        for channel in self.groups.iter_mut().flat_map(|group| &mut group.channels) {
            let own = std::ptr::from_ref::<Series>(channel);
            if let Some((_, name, unit, factor)) = found.iter().find(|(series, ..)| *series == own) {
                (channel.name, channel.unit) = ((*name).clone(), unit.clone());
                for value in channel.values.iter_mut().filter(|_| *factor != 1.0) {
                    *value *= factor;
                }
            }
        }
        Ok(self)
    }

    /// What lies in these stretches, s; all of it if there is none.
    ///
    /// # Errors
    /// Nothing lies in them.
    pub fn within(mut self, stretches: &[(f64, f64)]) -> Result<Self, RecordingError> {
        if stretches.is_empty() {
            return Ok(self);
        }
        for group in &mut self.groups {
            let is_in = |t: &f64| stretches.iter().any(|(from, to)| (*from..=*to).contains(t));
            let kept: Vec<bool> = group.time_s.iter().map(is_in).collect();
            let cut = |values: &mut Vec<f64>| {
                let mut kept = kept.iter();
                values.retain(|_| kept.next().is_some_and(|kept| *kept));
            };
            cut(&mut group.time_s);
            group
                .channels
                .iter_mut()
                .for_each(|channel| cut(&mut channel.values));
            group.lines = Lines::default();
        }
        if self.groups.iter().all(|group| group.time_s.is_empty()) {
            return Err("there is no row in the stretches of --from and --to".into());
        }
        Ok(self)
    }
}
