//! What the caller knows already: parameters given instead of estimated (`--fix NAME=VALUE`).

use std::fmt;

use super::signals::Muscle;

/// Why a `NAME=VALUE` was refused.
#[derive(Debug, Clone, PartialEq)]
pub struct FixError(pub(crate) String);

impl fmt::Display for FixError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for FixError {}

/// How a drive is to be identified.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// A drive without guidance: K_hg is not part of the model.
    pub manual: bool,
    /// Known muscle.
    pub muscle: Muscle,
    /// Known a_1, a_2, a_3.
    pub a: [Option<f64>; 3],
    /// Known (K_d + K_nms)*a_i.
    pub gain: [Option<f64>; 3],
    /// Known delay, s.
    pub t_p_s: Option<f64>,
    /// Known K_d, N.m/rad.
    pub k_d: Option<f64>,
    /// Known K_hg.
    pub k_hg: Option<f64>,
}

/// Names that can be fixed, with the range of each.
const FIXABLE: [(&str, f64, f64); 11] = [
    ("a_1", 1e-4, 10.0),
    ("a_2", 1e-4, 10.0),
    ("a_3", 1e-4, 100.0),
    ("gain_1", -10.0, 10.0),
    ("gain_2", -10.0, 10.0),
    ("gain_3", -100.0, 100.0),
    ("t_p", 0.0, 0.6),
    ("k_d", 0.0, 20.0),
    ("k_hg", 0.0, 1.0),
    ("k_nms", 0.0, 10.0),
    ("t_nms", 0.01, 1.0),
];

impl Options {
    /// Takes a `NAME=VALUE`.
    ///
    /// # Errors
    /// No `=`, an unknown name, a value that is no number or outside the name's range.
    pub fn fix(&mut self, assignment: &str) -> Result<(), FixError> {
        let Some((name, text)) = assignment.split_once('=') else {
            return Err(FixError(format!(
                "--fix {assignment}: NAME=VALUE is wanted, such as k_d=3.2"
            )));
        };
        let name = name.trim().to_ascii_lowercase();
        let Some(&(_, low, high)) = FIXABLE.iter().find(|(n, ..)| *n == name) else {
            let names: Vec<&str> = FIXABLE.iter().map(|f| f.0).collect();
            return Err(FixError(format!(
                "--fix {name}: unknown, one of {} is wanted",
                names.join(", ")
            )));
        };
        let value: f64 = text
            .trim()
            .parse()
            .map_err(|_| FixError(format!("--fix {name}: {text:?} is not a number")))?;
        if !(low..=high).contains(&value) {
            return Err(FixError(format!(
                "--fix {name}: {value} is outside {low} to {high}"
            )));
        }
        match name.as_str() {
            "a_1" => self.a[0] = Some(value),
            "a_2" => self.a[1] = Some(value),
            "a_3" => self.a[2] = Some(value),
            "gain_1" => self.gain[0] = Some(value),
            "gain_2" => self.gain[1] = Some(value),
            "gain_3" => self.gain[2] = Some(value),
            "t_p" => self.t_p_s = Some(value),
            "k_d" => self.k_d = Some(value),
            "k_hg" => self.k_hg = Some(value),
            "k_nms" => self.muscle.k_nms = value,
            _ => self.muscle.t_nms_s = value,
        }
        Ok(())
    }

    /// Whether what is given can all be true for the noise model, in which gain_i = (K_d + K_nms)*a_i: K_d and one
    /// a_i with its gain say each other, and so do two a_i without K_d.
    ///
    /// # Errors
    /// What contradicts what, or could.
    pub fn check(&self) -> Result<(), FixError> {
        let given: Vec<usize> = (0..3).filter(|&i| self.a[i].is_some()).collect();
        if let Some(i) = (0..3).find(|&i| self.a[i].is_some() && self.gain[i].is_some() && self.k_d.is_some())
        {
            return Err(FixError(format!(
                "--fix: a_{n}, gain_{n} and k_d are too many, for gain_{n} = (k_d + k_nms)*a_{n}",
                n = i + 1
            )));
        }
        if self.k_d.is_none()
            && let [first, second, ..] = given[..]
        {
            return Err(FixError(format!(
                "--fix: a_{} and a_{} need k_d beside them: each alone gives k_d",
                first + 1,
                second + 1
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_lands_in_its_place_and_a_bad_one_is_named() {
        let mut o = Options::default();
        for fix in ["k_d=3.5", "A_2 = 0.02", "gain_3=15", "t_nms=0.12"] {
            o.fix(fix).unwrap();
        }
        assert_eq!(
            (o.k_d, o.a[1], o.gain[2], o.muscle.t_nms_s),
            (Some(3.5), Some(0.02), Some(15.0), 0.12)
        );
        for (fix, says) in [
            ("k_d", "NAME=VALUE"),
            ("K_x=1", "k_x: unknown"),
            ("k_hg=1.5", "k_hg: 1.5 is outside 0 to 1"),
            ("t_p=soon", "\"soon\" is not a number"),
            ("t_p=NaN", "NaN is outside"),
        ] {
            let e = o.fix(fix).unwrap_err().to_string();
            assert!(e.contains(says), "{e}");
        }
    }

    #[test]
    fn what_says_the_same_thing_twice_is_refused() {
        for (fixes, says) in [
            (
                &["a_2=0.1", "k_d=3", "gain_2=0.4"][..],
                Some("a_2, gain_2 and k_d are too many"),
            ),
            (&["a_1=0.1", "a_3=3.7"], Some("a_1 and a_3 need k_d")),
            (&["a_1=0.1", "a_3=3.7", "k_d=3"], None),
            (&["a_1=0.1", "gain_1=0.4"], None),
            (&["a_1=0.1", "gain_2=0.4", "k_d=3"], None),
        ] {
            let mut o = Options::default();
            for fix in fixes {
                o.fix(fix).unwrap();
            }
            match (o.check(), says) {
                (Ok(()), None) => {}
                (Err(e), Some(says)) => assert!(e.to_string().contains(says), "{e}"),
                (got, _) => panic!("{fixes:?}: {got:?}"),
            }
        }
    }
}
