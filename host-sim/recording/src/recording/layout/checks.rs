//! What a layout knows of its columns, held against a recording: what refuses it, and which rows are left out.

use std::collections::BTreeMap;

use super::points::{SLOPE_S, Table, line};
use super::{Layout, Limit, LogError, SPEED_COLUMN, Slope, refuse};

/// No car changes its speed or its wheel angle faster: m/s and rad, at once and per second.
const FASTEST: [(&str, f64, f64); 2] = [(SPEED_COLUMN, 1.0, 15.0), ("wheel_angle_rad", 0.1, 12.0)];
/// Columns go together where their correlation is at least this; then their slope is judged.
const TOGETHER: f64 = 0.8;

impl Layout {
    pub(super) fn within_limits(&self, table: &Table) -> Result<(), LogError> {
        for (
            name,
            Limit {
                range: [low, high],
                why,
            },
        ) in &self.limits
        {
            let outside = |v: &f64| v.is_finite() && !(*low..=*high).contains(v);
            let values = table.get(name).map_or(&[][..], Vec::as_slice);
            if let Some(k) = values.iter().position(outside) {
                let value = values[k];
                return refuse(format!(
                    "row {}: {name} is {value}, outside {low} to {high}: {why}",
                    k + 1
                ));
            }
        }
        Ok(())
    }

    pub(super) fn slopes_agree(&self, table: &Table, is_free: &[bool]) -> Result<(), LogError> {
        for Slope {
            of,
            on,
            range: [low, high],
            why,
        } in &self.slopes
        {
            let (Some(y), Some(x)) = (table.get(of), table.get(on)) else {
                return refuse(format!(
                    "layout {}: there is no column {of} or no {on}",
                    self.name
                ));
            };
            let pairs = x.iter().zip(y).zip(is_free);
            let pairs: Vec<(f64, f64)> = pairs
                .filter_map(|((x, y), free)| (*free && (x + y).is_finite()).then_some((*x, *y)))
                .collect();
            let (slope, correlation) = line(&pairs);
            if correlation.abs() >= TOGETHER && !(*low..=*high).contains(&slope) {
                return refuse(format!(
                    "{of} is {slope:.3} times {on}, outside {low} to {high}: {why}"
                ));
            }
        }
        Ok(())
    }

    /// Why a row is left out, if it is.
    pub(super) fn causes(&self, time_s: &[f64], table: &Table, manual: bool) -> Vec<Option<String>> {
        let mut causes: Vec<Option<String>> = vec![None; time_s.len()];
        for (name, at_once, per_s) in FASTEST {
            let Some(values) = table.get(name) else { continue };
            for k in 1..values.len() {
                let step_s = time_s[k] - time_s[k - 1];
                if (values[k] - values[k - 1]).abs() > at_once + per_s * step_s {
                    let joint = time_s[k];
                    for (cause, t) in causes.iter_mut().zip(time_s) {
                        if (t - joint).abs() <= SLOPE_S {
                            cause.get_or_insert(format!("{name} jumps (two drives in one file?)"));
                        }
                    }
                }
            }
        }
        let wanted = if manual { 0.0..0.5 } else { 0.5..f64::INFINITY };
        for (k, cause) in causes.iter_mut().enumerate() {
            if table
                .get("shared")
                .is_some_and(|shared| !wanted.contains(&shared[k]))
            {
                cause.get_or_insert(if manual { "shared" } else { "by hand" }.into());
            }
            for (name, [low, high]) in &self.keep {
                if table
                    .get(name)
                    .is_some_and(|column| !(*low..=*high).contains(&column[k]))
                {
                    cause.get_or_insert(format!("{name} outside {low} to {high}"));
                }
            }
        }
        causes
    }
}

/// How long each cause holds, in the table "In the log".
pub(super) fn counted(causes: &[Option<String>], dt_s: f64) -> Vec<[String; 3]> {
    let mut rows: BTreeMap<&str, usize> = BTreeMap::new();
    for cause in causes.iter().flatten() {
        *rows.entry(cause).or_default() += 1;
    }
    rows.into_iter()
        .map(|(cause, rows)| {
            [
                cause.to_owned(),
                format!("{:.1} s", dt_s * rows as f64),
                "left out".into(),
            ]
        })
        .collect()
}
