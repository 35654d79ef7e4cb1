//! Which program made a result, and of what: enough to have the same result again.

use serde::Serialize;

/// Program, version and commit; and the scenario, whole.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// Name of the program.
    pub program: &'static str,
    /// Its version.
    pub version: &'static str,
    /// The commit that it was built from, with `-dirty` behind it if the sources differed; `unknown` outside git.
    pub commit: &'static str,
    /// The scenario as a file (TOML) that needs no other file; none for a result that no scenario decides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
}

impl Provenance {
    /// The provenance of a result that follows from a scenario, if there is one.
    pub fn new(scenario: Option<String>) -> Self {
        Self {
            program: "host-sim",
            version: env!("CARGO_PKG_VERSION"),
            commit: env!("HAPTIC_COMMIT"),
            scenario,
        }
    }

    /// Puts it behind the results.
    pub fn stamp<T>(self, results: &T) -> Stamped<'_, T> {
        Stamped {
            results,
            provenance: self,
        }
    }
}

/// The provenance of a result that no scenario decides.
impl Default for Provenance {
    fn default() -> Self {
        Self::new(None)
    }
}

/// Results with their provenance, as JSON holds them: one object, `provenance` its last field.
#[derive(Debug, Clone, Serialize)]
pub struct Stamped<'a, T> {
    #[serde(flatten)]
    results: &'a T,
    provenance: Provenance,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_commit_is_named_and_no_place_on_a_disk() {
        let Provenance { commit, version, .. } = Provenance::new(None);
        let hash = commit.trim_end_matches("-dirty");
        assert!(
            commit == "unknown" || (hash.len() >= 7 && hash.chars().all(|c| c.is_ascii_hexdigit())),
            "{commit}"
        );
        assert_eq!(version.split('.').count(), 3);
    }
}
