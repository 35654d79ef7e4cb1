//! A channel as somebody names it: `CHANNEL`, `CHANNEL [unit]` or `CHANNEL*FACTOR`.

use std::str::FromStr;

use super::{RecordingError, Series};
use crate::units;

/// A channel by its name, and what its numbers mean if the file does not say it.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Its name, with a unit in brackets behind it if one is given.
    pub channel: String,
    /// What its values are multiplied by.
    pub factor: Option<f64>,
}

impl FromStr for Term {
    type Err = RecordingError;

    fn from_str(text: &str) -> Result<Self, RecordingError> {
        let (channel, factor) = match text.rsplit_once('*') {
            Some((channel, factor)) => {
                let number: Option<f64> = factor.trim().parse().ok();
                let number = number.filter(|n| n.is_finite() && *n != 0.0);
                let number = number.ok_or_else(|| {
                    let factor = factor.trim();
                    RecordingError(format!("the factor {factor:?} is no number other than 0"))
                })?;
                (channel, Some(number))
            }
            None => (text, None),
        };
        let channel = channel.trim().to_owned();
        if channel.is_empty() {
            return Err("the channel has no name".into());
        }
        Ok(Self { channel, factor })
    }
}

impl Term {
    /// What the values of the channel that was found are multiplied by to be in the unit that is wanted.
    ///
    /// # Errors
    /// A unit that is unknown, of another quantity, or not that of the file.
    pub fn factor(&self, series: &Series, wanted: &str) -> Result<f64, RecordingError> {
        let name = &series.name;
        let is_own_name = self.channel == *name;
        let said = units::in_brackets(&self.channel).map(|(_, unit)| unit);
        let said = said.filter(|_| !is_own_name);
        let refuse = |what: String| Err(RecordingError(format!("channel {name}: {what}")));
        let unit = match (self.factor, said, series.unit.as_str()) {
            (Some(_), Some(unit), _) => {
                return refuse(format!(
                    "a unit, {unit:?}, and a factor are given: one of them is wanted"
                ));
            }
            (Some(factor), None, _) => return Ok(factor),
            (None, None, "") => return Ok(1.0),
            (None, Some(unit), "") => unit,
            (None, None, unit) => unit,
            (None, Some(unit), own) if units::factor(unit, own) == Some(1.0) => own,
            (None, Some(unit), own) => {
                return refuse(format!(
                    "its unit is given as {unit:?}, but the file says {own:?}"
                ));
            }
        };
        match units::factor(unit, wanted) {
            Some(factor) => Ok(factor),
            None => refuse(format!(
                "its unit {unit:?} is not known as one of {wanted}; {name}*FACTOR says how many {wanted} it is"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, unit: &str) -> Series {
        Series {
            name: name.into(),
            unit: unit.into(),
            ..Series::default()
        }
    }

    fn factor(text: &str, series: &Series, wanted: &str) -> Result<f64, String> {
        let term: Term = text.parse().map_err(|e: RecordingError| e.to_string())?;
        term.factor(series, wanted).map_err(|e| e.to_string())
    }

    /// A degree is 0.017453292519943295 rad, a foot 0.3048 m.
    #[test]
    fn a_unit_in_brackets_converts() {
        let plain = series("Heading", "");
        assert_eq!(
            factor("Heading [deg]", &plain, "rad"),
            Ok(0.017_453_292_519_943_295)
        );
        assert_eq!(factor("Heading (mrad)", &plain, "rad"), Ok(1e-3));
        assert_eq!(factor("Heading*-2", &plain, "rad"), Ok(-2.0));
        assert_eq!(factor("Heading", &plain, "rad"), Ok(1.0));
        assert_eq!(factor("Gap [ft]", &series("Gap", "ft"), "m"), Ok(0.3048));
        // These brackets are a part of the name.
        assert_eq!(factor("Gap [2]", &series("Gap [2]", ""), "m"), Ok(1.0));
    }

    #[test]
    fn a_unit_that_is_unknown_or_contradicted_is_refused() {
        for (text, unit, says) in [
            (
                "Heading [parsec]",
                "",
                "its unit \"parsec\" is not known as one of rad",
            ),
            ("Heading [m]", "", "its unit \"m\" is not known as one of rad"),
            ("Heading", "V", "its unit \"V\" is not known as one of rad"),
            (
                "Heading [deg]",
                "rad",
                "its unit is given as \"deg\", but the file says \"rad\"",
            ),
            ("Heading [deg]*2", "", "a unit, \"deg\", and a factor"),
        ] {
            let error = factor(text, &series("Heading", unit), "rad").unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
        for (text, says) in [
            ("Heading*0", "the factor"),
            ("Heading*x", "the factor \"x\""),
            (" *2", "has no name"),
        ] {
            let error = text.parse::<Term>().unwrap_err().to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
