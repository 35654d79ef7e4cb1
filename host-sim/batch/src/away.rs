//! When the guidance was away in a run, as results hold it: for its table, its report and what is concluded of it.

use serde::Serialize;

use haptic_log::trace::Trace;
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::unguided::{Cause, Unguided, stretches};

/// When the guidance was away in a run. `null` in JSON, and empty in a table, is what did not happen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Away {
    /// When the guidance left, s: the first time by the ECU's own decision, if there is one, else the first time at all.
    pub guidance_left_s: Option<f64>,
    /// Why it left then.
    pub guidance_left_why: Option<Cause>,
    /// When it was back, s; none if it was not in this run.
    pub guidance_back_s: Option<f64>,
    /// How long it was away in all, s; none without guidance, and for a recording that does not say.
    pub unguided_s: Option<f64>,
}

impl Away {
    /// Names of the fields, as columns of a table have them.
    pub const NAMES: [&str; 4] = [
        "guidance_left_s",
        "guidance_left_why",
        "guidance_back_s",
        "unguided_s",
    ];

    /// What a run has of it.
    pub fn new(scenario: &Scenario, trace: &Trace) -> Self {
        if scenario.condition() == Condition::Manual {
            return Self::default();
        }
        stretches(trace).map_or_else(Self::default, |found| Self::from_stretches(&found))
    }

    fn from_stretches(stretches: &[Unguided]) -> Self {
        let told = stretches.iter().find(|stretch| !stretch.asked_for);
        let told = told.or(stretches.first());
        Self {
            guidance_left_s: told.map(|stretch| stretch.from_s),
            guidance_left_why: told.map(|stretch| stretch.why),
            guidance_back_s: told.and_then(|stretch| stretch.until_s),
            unguided_s: Some(stretches.iter().fold(0.0, |sum, stretch| sum + stretch.lasts_s)),
        }
    }

    /// Whether the ECU ended guidance by its own decision: not because the scenario lets something fail.
    pub fn is_by_itself(&self) -> bool {
        self.guidance_left_why.is_some_and(|why| !why.is_asked_for())
    }

    /// The fields as texts, in the order of [`Away::NAMES`].
    pub fn texts(&self) -> [String; 4] {
        let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        [
            number(self.guidance_left_s),
            self.guidance_left_why
                .map_or(String::new(), |why| why.to_string()),
            number(self.guidance_back_s),
            number(self.unguided_s),
        ]
    }

    /// When and why it left, and whether it came back: `at 52.5 s: HandsOff, not back`.
    pub fn when_and_why(&self) -> Option<String> {
        let (left_s, why) = self.guidance_left_s.zip(self.guidance_left_why)?;
        let asked = if why.is_asked_for() { " as asked" } else { "" };
        let back = self
            .guidance_back_s
            .map_or("not back".into(), |back_s| format!("back at {back_s:.1} s"));
        Some(format!("at {left_s:.1} s{asked}: {why}, {back}"))
    }
}

/// Runs named in a sentence; the rest is counted.
const NAMED: usize = 4;

/// Which of some runs were not guided throughout, by the ECU's own decision; none if all were. Each has a name.
pub fn left_by_themselves<'a>(runs: impl IntoIterator<Item = (&'a Away, String)>) -> Option<String> {
    let mut all = 0;
    let mut left = Vec::new();
    for (away, name) in runs {
        all += 1;
        if away.is_by_itself() {
            left.push(format!("{name} {}", away.when_and_why().unwrap_or_default()));
        }
    }
    let more = match left.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    let count = left.len();
    left.truncate(NAMED);
    (count > 0).then(|| {
        format!(
            "the ECU ended guidance by itself in {count} of {all} runs: {}{more}",
            left.join("; ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_core::safety::faults::Fault;

    const HANDS_OFF: Cause = Cause::Faults(1 << Fault::HandsOff as u32);

    fn stretch(from_s: f64, until_s: Option<f64>, why: Cause) -> Unguided {
        Unguided {
            from_s,
            until_s,
            lasts_s: until_s.unwrap_or(100.0) - from_s,
            from_m: 0.0,
            to_m: 0.0,
            why,
            asked_for: why.is_asked_for(),
        }
    }

    #[test]
    fn what_the_ecu_decides_is_told_before_what_was_asked() {
        assert_eq!(Away::from_stretches(&[]).texts().join(","), ",,,0");
        let asked = Away::from_stretches(&[stretch(40.0, None, Cause::TorqueLost)]);
        assert!(!asked.is_by_itself());
        assert_eq!(asked.texts().join(","), "40,torque lost,,60");
        assert_eq!(
            asked.when_and_why().unwrap(),
            "at 40.0 s as asked: torque lost, not back"
        );
        let both = Away::from_stretches(&[
            stretch(10.0, Some(20.0), Cause::RequestEnded),
            stretch(52.5, Some(60.0), HANDS_OFF),
        ]);
        assert!(both.is_by_itself());
        assert_eq!(both.texts().join(","), "52.5,HandsOff,60,17.5");
        assert_eq!(
            both.when_and_why().unwrap(),
            "at 52.5 s: HandsOff, back at 60.0 s"
        );
    }

    #[test]
    fn a_few_runs_are_named_and_the_rest_is_counted() {
        let left = Away::from_stretches(&[stretch(30.0, None, HANDS_OFF)]);
        let asked = Away::from_stretches(&[stretch(30.0, None, Cause::LaneLost)]);
        assert_eq!(left_by_themselves([(&asked, "a".into())]), None);
        let runs = |count: usize| {
            let names = (0..count).map(|number| (&left, number.to_string()));
            left_by_themselves(names.chain([(&asked, "a".into())])).unwrap()
        };
        assert_eq!(
            runs(1),
            "the ECU ended guidance by itself in 1 of 2 runs: 0 at 30.0 s: HandsOff, not back"
        );
        assert!(
            runs(6).starts_with("the ECU ended guidance by itself in 6 of 7 runs: 0 at")
                && runs(6).ends_with("; and 2 more")
        );
    }
}
