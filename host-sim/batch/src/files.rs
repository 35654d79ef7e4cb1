//! Scenario and course files: the one place where what a person wrote is read from a disk.

use std::collections::BTreeSet;
use std::path::Path;

use haptic_sim::input::{InputError, in_range};
use haptic_sim::models::road::{Course, LaneChoice, PAPER_COURSE};
use haptic_sim::scenario::Scenario;
use toml::{Table, Value};

/// Reads and checks a scenario file. A course file named in it is looked for beside the scenario.
///
/// # Errors
/// An unreadable file; as [`Scenario::from_toml`] and [`load_lane`].
pub fn load_scenario(path: &Path) -> Result<Scenario, InputError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let text = read(path)?;
    // Every field has a default: whatever is empty would be a scenario.
    if text.trim().is_empty() && path.extension().is_none_or(|extension| extension != "toml") {
        return Err(InputError::new(
            path.display(),
            "it is empty; an empty scenario ends in .toml",
        ));
    }
    Scenario::from_toml(&path.display().to_string(), &text, |course, lane| {
        load_lane(&folder.join(course), lane)
    })
}

/// The built-in course if `path` is its name, else as [`load_lane`].
///
/// # Errors
/// As [`load_lane`].
pub fn open_course(path: &Path, lane: &LaneChoice) -> Result<Course, InputError> {
    if path == Path::new(PAPER_COURSE) {
        lane.check_none(PAPER_COURSE)?;
        return Ok(Course::paper());
    }
    load_lane(path, lane)
}

/// Reads and checks a course file: a lane of an OpenDRIVE file if its name ends with `.xodr`, else TOML.
///
/// # Errors
/// An unreadable file; as [`Course::from_text`].
pub fn load_lane(path: &Path, lane: &LaneChoice) -> Result<Course, InputError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| InputError::new(&name, e))?;
    // Names in other encodings than UTF-8 do not matter to the road.
    Course::from_text(&name, &String::from_utf8_lossy(&bytes), lane)
}

/// Names the file and what the system says of it.
pub(crate) fn read(path: &Path) -> Result<String, InputError> {
    std::fs::read_to_string(path).map_err(|e| InputError::new(path.display(), e))
}

/// Where the file of a study is, for its errors and its courses.
pub(crate) struct Source<'a> {
    pub(crate) name: String,
    pub(crate) folder: &'a Path,
}

impl<'a> Source<'a> {
    pub(crate) fn new(name: impl Into<String>, folder: &'a Path) -> Self {
        let name = name.into();
        Self { name, folder }
    }

    /// A file, and its text.
    pub(crate) fn open(path: &'a Path) -> Result<(Self, String), InputError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok((Self::new(path.display().to_string(), folder), read(path)?))
    }

    /// The course of a name in the file. Its errors name the path; the course has the name, since it is no matter where the program
    /// was called from.
    pub(crate) fn course(&self, name: &str, lane: &LaneChoice) -> Result<Course, InputError> {
        let path = self.folder.join(name);
        let bytes = std::fs::read(&path).map_err(|e| InputError::new(path.display(), e))?;
        Course::from_text(name, &String::from_utf8_lossy(&bytes), lane)
    }

    pub(crate) fn bad(&self, message: impl std::fmt::Display) -> InputError {
        InputError::new(&self.name, message)
    }

    pub(crate) fn within(
        &self,
        field: &str,
        value: f64,
        low: f64,
        high: f64,
        unit: &'static str,
    ) -> Result<(), InputError> {
        in_range(field, value, low..=high, unit).map_err(|e| self.bad(e))
    }

    /// A list of speeds, m/s, that a file gives in one of two units.
    pub(crate) fn speeds(
        &self,
        table: &str,
        m_per_s: Option<&Vec<f64>>,
        kmh: Option<&Vec<f64>>,
    ) -> Result<Vec<f64>, InputError> {
        let (name, speeds) = match (m_per_s, kmh) {
            (Some(speeds), None) => ("speeds_m_per_s", speeds.clone()),
            (None, Some(speeds)) => {
                // In the unit that the file has; in m/s each scenario says its range.
                for kmh in speeds {
                    self.within(&format!("{table}speeds_kmh"), *kmh, 19.8, 252.0, "km/h")?;
                }
                ("speeds_kmh", speeds.iter().map(|kmh| kmh / 3.6).collect())
            }
            _ => {
                let names = format!("{table}speeds_m_per_s, {table}speeds_kmh");
                return Err(self.bad(format!("{names}: one of them is wanted, a list of numbers")));
            }
        };
        if speeds.is_empty() {
            return Err(self.bad(format!("{table}{name} = []: one at least is wanted")));
        }
        Ok(speeds)
    }

    pub(crate) fn count(&self, field: &str, value: u64, low: f64, high: f64) -> Result<u32, InputError> {
        self.within(field, value as f64, low, high, "")?;
        Ok(value as u32)
    }
}

/// Longest name: it becomes the name of a directory.
const LONGEST_NAME: usize = 40;

/// Names that files and directories may bear, each once, and one at least.
pub(crate) fn check_names<'a>(
    source: &Source,
    what: &str,
    names: impl IntoIterator<Item = &'a String>,
) -> Result<(), InputError> {
    let mut seen = BTreeSet::new();
    for name in names {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(plain) {
            return Err(source.bad(format!(
                "{what} {name:?}: a name is 1 to {LONGEST_NAME} letters, digits, - and _, for a directory bears it"
            )));
        }
        // Some disks do not tell large letters from small ones.
        if !seen.insert(name.to_lowercase()) {
            return Err(source.bad(format!("{what} {name:?} is there twice")));
        }
    }
    if seen.is_empty() {
        return Err(source.bad(format!("there is no [[{what}]]")));
    }
    Ok(())
}

/// Puts fields over others, tables field by field.
pub(crate) fn merge(into: &mut Table, over: &Table) {
    for (name, value) in over {
        match (into.get_mut(name), value) {
            // A course is one value.
            (Some(Value::Table(old)), Value::Table(new)) if name != "course" => merge(old, new),
            _ => {
                into.insert(name.clone(), value.clone());
            }
        }
    }
}

/// The default of a seed and of what is done once.
pub(crate) fn one() -> u64 {
    1
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use haptic_sim::scenario::Condition;

    #[test]
    fn the_examples_are_good_and_the_one_with_every_field_holds_the_defaults() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        assert_eq!(
            load_scenario(&folder.join("every-field.toml")).unwrap(),
            Scenario::default()
        );
        let relying = load_scenario(&folder.join("relying-driver.toml")).unwrap();
        assert_eq!(
            (relying.condition(), relying.failure().at_s()),
            (Condition::High, Some(40.0))
        );
        assert!(relying.course().name().ends_with("hill-road.toml"));
        let braking = load_scenario(&folder.join("braking-into-a-curve.toml")).unwrap();
        assert!(braking.changes_speed() && braking.speed_kmh() == 100.0);
    }

    /// `file` with each text replaced is refused, in words that hold the last of the three.
    pub(crate) fn check_refusals(
        file: &str,
        wrong: &[(&str, &str, &str)],
        read: impl Fn(&str) -> Option<InputError>,
    ) {
        for (from, to, says) in wrong {
            let text = file.replacen(from, to, 1);
            assert_ne!(text, file, "{from}");
            let error = read(&text).expect(to).to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_named() {
        let missing = load_lane(Path::new("no-such.toml"), &LaneChoice::default())
            .unwrap_err()
            .to_string();
        assert!(missing.starts_with("no-such.toml: "), "{missing}");
    }
}
