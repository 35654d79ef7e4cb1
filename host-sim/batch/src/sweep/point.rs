//! A drive by its number: what is varied in it, its scenario, and what is wrong with it before anything is driven.

use haptic_sim::input::{InputError, in_range};
use haptic_sim::scenario::Scenario;
use haptic_sim::seeds::{self, Stream};
use toml::{Table, Value};

use super::axis::Kind;
use super::{Design, DesignPoint, MOST_DRIVES, SLICES, Sweep, value};
use crate::engine::{StudyError, number, text};

impl Sweep {
    /// What is varied in a drive. Repeats follow each other, then the grid (its last axis first), then the mixtures of
    /// Saltelli's design, then the samples. All of a sample's drives share its values, and its repeats' seeds: what is
    /// compared meets the same chance.
    pub fn point(&self, drive: u64) -> DesignPoint {
        let (repeat, rest) = (drive % self.repeats, drive / self.repeats);
        let (mut grid, rest) = (rest % self.grid_points(), rest / self.grid_points());
        let (role, sample) = (rest % self.places.roles(), rest / self.places.roles());
        let mut rows = Vec::with_capacity(self.grid.len());
        for axis in self.grid.iter().rev() {
            let Kind::Grid(of) = &axis.kind else { continue };
            let count = of.len() as u64;
            rows.push(((grid % count) as u32, of[(grid % count) as usize].clone()));
            grid /= count;
        }
        rows.reverse();
        let mut levels: Vec<u32> = rows.iter().map(|(level, _)| *level).collect();
        let mut values: Vec<Value> = rows.into_iter().flat_map(|(_, row)| row).collect();
        for (axis, u) in self.sampled.iter().zip(self.places.at(sample, role)) {
            let Kind::Sampled(distribution) = &axis.kind else {
                continue;
            };
            values.extend(distribution.at(u));
            let slices = distribution.rows().map_or(SLICES, |rows| rows.len() as f64);
            levels.push((u * slices) as u32);
        }
        let own = self
            .columns()
            .position(|name| name == "seed")
            .and_then(|at| values[at].as_integer());
        // 53 bits, so that a table's number holds it.
        let drawn = seeds::nth(Stream::Drives.seed(self.seed), sample * self.repeats + repeat) >> 11;
        let seed = own.and_then(|seed| u64::try_from(seed).ok()).unwrap_or(drawn);
        DesignPoint {
            drive,
            seed,
            values,
            sample,
            role,
            levels,
        }
    }

    /// The fields of a drive's scenario.
    fn fields(&self, point: &DesignPoint) -> Result<Table, StudyError> {
        let mut table = self.scenario.clone();
        table.insert("seed".into(), Value::Integer(point.seed as i64));
        let columns = || self.axes().flat_map(|axis| &axis.columns);
        let of = |name: &str| {
            let mut named = columns()
                .zip(&point.values)
                .filter(|(column, _)| column.name == name);
            named.next().and_then(|(_, value)| number(value))
        };
        for (column, value) in columns().zip(&point.values) {
            let applied = match (&column.over, number(value)) {
                (None, Some(number)) if column.times != 1.0 => Value::Float(column.times * number),
                (Some(over), Some(number)) => {
                    let over =
                        of(over).ok_or_else(|| format!("vary.{}: {over} is no number", column.name))?;
                    Value::Float(column.times * number / over)
                }
                _ => value.clone(),
            };
            for path in &column.paths {
                value::put(&mut table, path, applied.clone()).map_err(|e| format!("vary.{e}"))?;
            }
        }
        Ok(table)
    }

    /// The scenario of a drive.
    ///
    /// # Errors
    /// A value out of range, with the drive's number and what is varied in it; an instant behind the end of the run.
    pub fn scenario(&self, point: &DesignPoint) -> Result<Scenario, InputError> {
        let scenario = self
            .fields(point)
            .map_err(|e| InputError::new(&self.name, e))
            .and_then(|table| {
                Scenario::from_table(&self.name, table, |course, _| {
                    let known = self.courses.get(course).cloned();
                    known.ok_or_else(|| InputError::new(&self.name, format!("course: no course {course:?}")))
                })
            });
        let scenario = scenario.and_then(|scenario| {
            let times = scenario.check_times();
            times
                .map_err(|e| InputError::new(&self.name, e))
                .map(|()| scenario)
        });
        scenario.map_err(|error| {
            let varied: Vec<String> = self
                .columns()
                .zip(&point.values)
                .map(|(name, value)| format!("{name} = {}", text(value)))
                .collect();
            let message = error.to_string();
            // The parser's place in a text that nobody wrote helps nobody.
            let place = message.rsplit_once("|\n").map_or(message.as_str(), |(_, last)| {
                last.trim_start_matches(['|', ' ', '^', '\n'])
            });
            InputError::new(
                &self.name,
                format!(
                    "drive {} ({}): {}",
                    point.drive,
                    varied.join(", "),
                    shortened(&self.name, place)
                ),
            )
        })
    }

    /// Tries every axis at its ends, the others as in the first drive, so that a field or a range that is wrong is found
    /// before anything is driven.
    pub(super) fn check(&self) -> Result<(), InputError> {
        let bad = |message: String| Err(InputError::new(&self.name, message));
        if self.drives() > MOST_DRIVES {
            return bad(format!("{} drives are more than {MOST_DRIVES}", self.drives()));
        }
        if self.design == Design::Saltelli && (!self.grid.is_empty() || self.repeats > 1) {
            return bad(
                "design = \"saltelli\" takes sampled fields alone (choice in place of a list) and no repeats"
                    .into(),
            );
        }
        if let Some(stop) = &self.stop {
            if self.design != Design::Random || self.sampled.is_empty() && self.repeats == 1 {
                return bad(
                    "[stop] takes design = \"random\", whose samples are independent of each other".into(),
                );
            }
            if !self.metrics.iter().any(|d| d.name == stop.metric) {
                return bad(format!(
                    "stop.metric = {:?} is not among the metrics",
                    stop.metric
                ));
            }
            let checks = [
                ("stop.half_width", stop.half_width, f64::MIN_POSITIVE..=f64::MAX),
                ("stop.confidence", stop.confidence, 0.5..=0.9999),
            ];
            for (field, value, range) in checks {
                in_range(field, value, range, "").map_err(|e| InputError::new(&self.name, e))?;
            }
        }
        let first = self.point(0);
        self.check_at(&first)?;
        let mut column = 0;
        for axis in self.axes() {
            let rows = match &axis.kind {
                Kind::Grid(rows) => rows.clone(),
                Kind::Sampled(distribution) => distribution.extremes(),
            };
            for row in rows {
                let mut point = first.clone();
                point.values[column..column + row.len()].clone_from_slice(&row);
                self.check_at(&point)?;
            }
            column += axis.columns.len();
        }
        Ok(())
    }

    fn check_at(&self, point: &DesignPoint) -> Result<(), InputError> {
        let scenario = self.scenario(point)?;
        let Some(window) = self.window else { return Ok(()) };
        crate::check_window(window, &scenario).map_err(|e| InputError::new(&self.name, e))
    }
}

/// A message without the file's name at its start.
fn shortened<'a>(name: &str, message: &'a str) -> &'a str {
    message
        .strip_prefix(name)
        .map_or(message, |rest| rest.trim_start_matches([':', ' ']))
}
