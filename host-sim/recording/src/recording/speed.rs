//! The speed of a recorded drive, in one of two units.

use haptic_log::recording::Recording;
use haptic_log::units;

use super::{DriveLog, LogError, Mapping, NAMES, SPEED, SPEED_COLUMN, UNITS, converted, factor, refuse};

/// Faster than cars are driven, m/s: the unit may be another.
const FAST_M_PER_S: f64 = 50.0;

/// The least and the largest speed, m/s, if the recording tells it. It is not needed: without a mapping another unit or name tells nothing.
pub(super) fn speeds(
    recording: &Recording,
    maps: &[Mapping],
    notes: &mut Vec<String>,
) -> Result<Option<[f64; 2]>, LogError> {
    let mapped: Vec<&Mapping> = maps.iter().filter(|map| map.column >= SPEED).collect();
    let (column, map) = match mapped[..] {
        [_, _, ..] => {
            let [a, b] = [NAMES[SPEED], NAMES[SPEED + 1]];
            return refuse(format!("{a} and {b} are mapped: one of them is wanted"));
        }
        [map] => (map.column, Some(map)),
        [] if recording.find(SPEED_COLUMN).is_ok() => (SPEED, None),
        [] => (SPEED + 1, None),
    };
    let found = recording.find(map.map_or(NAMES[column], |map| &map.term.channel));
    let found = found.and_then(|(_, series)| Ok((series, factor(series, column, map)?)));
    let (series, scale) = match found {
        Ok(found) => found,
        Err(_) if map.is_none() => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    if scale != 1.0 {
        notes.push(converted(series, column, map, scale));
    }
    let m_per_s = units::factor(UNITS[column], "m/s").unwrap_or(1.0);
    let known = || {
        series
            .values
            .iter()
            .filter(|v| v.is_finite())
            .map(|v| v * scale * m_per_s)
    };
    let ends = known().reduce(f64::min).zip(known().reduce(f64::max));
    Ok(ends.map(Into::into))
}

/// A sentence about a speed that no car is likely to have.
pub(super) fn fast(log: &DriveLog) -> Option<String> {
    let [_, most] = log.speeds_m_per_s.filter(|[_, most]| *most > FAST_M_PER_S)?;
    let kmh = 3.6 * most;
    Some(format!(
        "The speed goes up to {most:.1} m/s, which is {kmh:.0} km/h: is it in km/h?"
    ))
}
