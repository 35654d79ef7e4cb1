//! Channels with instants of their own, at those of the driver torque.

use super::{Column, DRIVER, GUIDANCE, LogError, Values, refuse};

// Places of e_y and e_theta in COLUMNS.
const LANE: [usize; 2] = [1, 2];
/// A lane signal whose usual step is so many of the driver torque's is slower.
const SLOWER: f64 = 1.5;
/// Longest pause of a channel with instants of its own that is bridged here, in its usual periods.
const LONGEST_PAUSE: f64 = 3.5;

/// A column's values where it has any, and its usual step, s.
struct Course {
    time_s: Vec<f64>,
    values: Vec<f64>,
    usual_s: f64,
}

impl Course {
    fn from_column(column: &Column<'_>) -> Result<Self, LogError> {
        let (group, series) = (column.group, column.series);
        let known = group
            .time_s
            .iter()
            .zip(&series.values)
            .filter(|(_, v)| !v.is_nan());
        let (time_s, values): (Vec<f64>, Vec<f64>) = known.map(|(t, v)| (*t, v * column.scale)).unzip();
        let refuse = |what: String| Err(LogError::in_file(format_args!("channel {}", series.name), what));
        if let Some(w) = time_s.windows(2).find(|w| w[1].is_nan() || w[1] <= w[0]) {
            return refuse(format!("the time goes from {} to {} s: it must grow", w[0], w[1]));
        }
        let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        match steps.get(steps.len() / 2) {
            Some(&usual_s) => Ok(Self {
                time_s,
                values,
                usual_s,
            }),
            None => refuse(format!("it has {} values, too few", values.len())),
        }
    }

    /// The values at rising instants, as held or on the line between neighbours; none in a pause and beyond the ends. Instants
    /// up to a microsecond before a value have it already, as clocks round.
    fn at(&self, instants_s: &[f64], held: bool) -> Vec<f64> {
        let (time_s, last) = (&self.time_s, self.time_s.len() - 1);
        let mut k = 0;
        let value = |t: f64| {
            while k < last && time_s[k + 1] <= t + 1e-6 {
                k += 1;
            }
            let (past, next) = (t - time_s[k], (k + 1).min(last));
            let step = time_s[next] - time_s[k];
            let longest = LONGEST_PAUSE * self.usual_s;
            if past < -1e-6 || past > longest || (past > 1e-6 && step > longest) {
                f64::NAN
            } else if held || next == k {
                self.values[k]
            } else {
                self.values[k] + (past / step).max(0.0) * (self.values[next] - self.values[k])
            }
        };
        instants_s.iter().copied().map(value).collect()
    }
}

/// The columns at the driver torque's instants, over the time that all cover.
pub(super) fn at_the_torque(
    columns: &[Option<Column<'_>>; 6],
    notes: &mut Vec<String>,
) -> Result<(Vec<f64>, Values), LogError> {
    let mut courses: [Option<Course>; 6] = Default::default();
    for (course, column) in courses.iter_mut().zip(columns) {
        *course = column.as_ref().map(Course::from_column).transpose()?;
    }
    let all = || courses.iter().flatten();
    let from = all().map(|c| c.time_s[0]).fold(f64::NEG_INFINITY, f64::max);
    let to = all()
        .map(|c| c.time_s[c.time_s.len() - 1])
        .fold(f64::INFINITY, f64::min);
    let torque = courses[DRIVER].as_ref().map_or(&[][..], |c| &c.time_s);
    let instants: Vec<f64> = torque
        .iter()
        .copied()
        .filter(|t| (from..=to).contains(t))
        .collect();
    if instants.is_empty() {
        return refuse("the channels have no time in common");
    }
    let pace_s = courses[DRIVER].as_ref().map_or(0.0, |c| c.usual_s);
    notes.push(format!(
        "The channels have instants of their own: taken at those of {}, one in {:.4} s",
        columns[DRIVER].as_ref().map_or("", |c| c.series.name.as_str()),
        pace_s
    ));
    let values = std::array::from_fn(|i| {
        let course = courses[i].as_ref()?;
        let is_slow_lane = LANE.contains(&i) && course.usual_s > SLOWER * pace_s;
        Some(course.at(&instants, i == GUIDANCE || is_slow_lane))
    });
    Ok((instants, values))
}

#[cfg(test)]
mod tests {
    use haptic_log::recording::{Group, Recording, Series};

    use crate::bus_trace;
    use crate::recording::{Mapping, SPEED_COLUMN, of_channels};

    /// A channel in a group of its own: `count` values, one each `period_s` from `start_s` on.
    fn group(name: &str, unit: &str, start_s: f64, period_s: f64, value: impl Fn(usize) -> f64) -> Group {
        let count = (12.0 / period_s) as usize;
        Group {
            name: name.into(),
            time_s: (0..count).map(|k| start_s + period_s * k as f64).collect(),
            channels: vec![Series {
                name: name.into(),
                unit: unit.into(),
                source: String::new(),
                values: (0..count).map(value).collect(),
            }],
            ..Group::default()
        }
    }

    #[test]
    fn a_slow_camera_is_held_and_a_slow_angle_is_not() {
        let zigzag = |k: usize| [0.2, -0.2][k % 2];
        let recording = Recording::from(vec![
            group("Torque", "N.m", 0.0, 0.01, zigzag),
            group("Angle", "rad", 0.0, 0.04, |k| 0.01 * k as f64),
            group("Assist", "N.m", 0.0, 0.04, |k| 0.01 * k as f64),
            group("Offset", "cm", 0.0, 0.04, |k| 100.0 * zigzag(k)),
            group("Heading", "rad", 0.0, 0.01, zigzag),
            group(SPEED_COLUMN, "km/h", 0.0, 0.01, |k| 36.0 + 0.09 * k as f64),
        ]);
        let map = |text: &str| text.parse::<Mapping>().unwrap();
        let maps = [
            "driver_torque_nm=Torque",
            "wheel_angle_rad=Angle",
            "guidance_torque_nm=Assist",
            "e_y_m=Offset",
            "e_theta_rad=Heading",
        ]
        .map(map);
        let (log, _) = of_channels(recording, &maps, &bus_trace::Recording::default()).unwrap();
        assert!((log.dt_s - 0.01).abs() < 1e-12, "{}", log.dt_s);
        let [least, most] = log.speeds_m_per_s.unwrap();
        assert!((least - 10.0).abs() < 1e-9 && (most - 39.975).abs() < 1e-9 && log.changes_speed());
        for k in 0..800 {
            let near =
                |value: f64, wanted: f64| assert!((value - wanted).abs() < 1e-9, "{k}: {value} {wanted}");
            // Each picture with its own noise, and no value that no picture had.
            near(log.e_y_m[k], zigzag(k / 4));
            near(log.guidance_torque_nm[k], 0.01 * (k / 4) as f64);
            near(log.wheel_angle_rad[k], 0.01 * k as f64 / 4.0);
            // As quick as the torque: value for value.
            near(log.e_theta_rad[k], zigzag(k));
            near(log.driver_torque_nm[k], zigzag(k));
        }
    }
}
