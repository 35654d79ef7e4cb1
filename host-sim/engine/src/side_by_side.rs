//! Many runs: side by side first ([`haptic_vectorised`]), and with the shipping ECU where that is not enough.
//!
//! What cannot be vectorised, and every run in which something could have ended guidance, is rejected, to be driven alone with
//! the shipping ECU. [`super::shares()`] says how many were, and why. So that no result depends on who drove, one run in five hundred, and one of each
//! study at least, is driven by both: a bit that differs, in any field of any sample, is an error.

use haptic_log::trace::CHANNELS;
use haptic_sim::scenario::Scenario;
use haptic_sim::seeds::{self, Stream};
use haptic_sim::simulation::Run;
use haptic_vectorised::{BATCH, Event, Options, Reason, run_batch};

use super::shares::count;
use crate::error::{StudyError, refuse};

/// One in so many runs of a batch is driven by the shipping ECU too, which takes some ten times as long.
const CHECKED_OF: u64 = 500;
/// Fewer runs than this are as soon done one by one: a block of steps takes its time however few are under way.
const FEWEST: usize = BATCH / 4;

/// Which runs are driven twice.
#[derive(Debug, Clone, Copy)]
pub struct Checked {
    seed: u64,
    of: u64,
}

impl Checked {
    /// Which runs of a study of so many are checked, drawn by its seed.
    pub fn new(seed: u64, of: u64) -> Self {
        Self {
            seed: Stream::Design.seed(seed),
            of: of.max(1),
        }
    }

    fn has(self, number: u64) -> bool {
        // The second condition holds for one run of each study, however short.
        seeds::nth(self.seed, number).is_multiple_of(CHECKED_OF) || number == self.seed % self.of
    }
}

/// Runs that are driven in one thread: those of a study from a number on.
#[derive(Debug, Clone, Copy)]
pub struct Group<'a> {
    /// Each run's scenario.
    pub scenarios: &'a [Scenario],
    /// Number of the first of them in the study.
    pub first: u64,
    /// Which of the study's are driven twice.
    pub checked: Checked,
}

impl Group<'_> {
    /// Drives side by side; gives the places of those that are rejected. `alone` is a scenario's run by the shipping ECU,
    /// against which some are held.
    ///
    /// # Errors
    /// A run that differs from the shipping ECU's; what `on` says.
    pub fn run_batch(
        &self,
        options: Options,
        alone: impl Fn(&Scenario) -> Run,
        on: impl FnMut(usize, Event) -> Result<(), StudyError>,
    ) -> Result<Vec<usize>, StudyError> {
        let too_few = self.scenarios.len() < FEWEST;
        self.with(
            |on| {
                if too_few {
                    (0..self.scenarios.len()).for_each(|place| on(place, Event::Rejected(Reason::TooFew)));
                } else {
                    run_batch(self.scenarios, options, on);
                }
            },
            alone,
            on,
        )
    }

    /// Drives the runs by whatever drives side by side.
    fn with(
        &self,
        drive: impl FnOnce(&mut dyn FnMut(usize, Event)),
        alone: impl Fn(&Scenario) -> Run,
        mut on: impl FnMut(usize, Event) -> Result<(), StudyError>,
    ) -> Result<Vec<usize>, StudyError> {
        let (mut rejected, mut result) = (Vec::new(), Ok(()));
        drive(&mut |place, event| {
            let (number, is_ended) = (self.first + place as u64, matches!(event, Event::Ended(_)));
            result = match (&result, event) {
                (Err(_), _) => return,
                (Ok(()), Event::Rejected(reason)) => {
                    count(Some(reason));
                    rejected.push(place);
                    return;
                }
                (Ok(()), Event::Ended(run)) if self.checked.has(number) => {
                    agree(number, run, &alone(&self.scenarios[place]))
                        .and_then(|()| on(place, Event::Ended(run)))
                }
                (Ok(()), event) => on(place, event),
            };
            if is_ended {
                count(None);
            }
        });
        result.map(|()| rejected)
    }

    /// What `measure` makes of each run that is driven side by side; nothing of those that are rejected.
    ///
    /// # Errors
    /// A run that differs from the shipping ECU's; what `measure` says.
    pub fn measured<T>(
        &self,
        options: Options,
        alone: impl Fn(&Scenario) -> Run,
        mut measure: impl FnMut(usize, &Run) -> Result<T, StudyError>,
    ) -> Result<Vec<Option<T>>, StudyError> {
        let mut found: Vec<Option<T>> = self.scenarios.iter().map(|_| None).collect();
        self.run_batch(options, alone, |place, event| {
            if let Event::Ended(run) = event {
                found[place] = Some(measure(place, run)?);
            }
            Ok(())
        })?;
        Ok(found)
    }
}

/// Whether two runs are the same to the last bit, signs of zeros included.
fn agree(number: u64, batched: &Run, alone: &Run) -> Result<(), StudyError> {
    let differ = |what: String| {
        refuse(format!(
            "run {number}: {what} side by side and with the shipping ECU. This is a fault of this program, not of what it was \
             given: please report it, with all that is needed to start it again"
        ))
    };
    if (batched.steps, batched.ending) != (alone.steps, alone.ending) {
        return differ(format!(
            "{} steps and {}, {:?} and {:?}",
            batched.steps, alone.steps, batched.ending, alone.ending
        ));
    }
    for (mine, shipping) in batched.trace.samples.iter().zip(&alone.trace.samples) {
        for channel in &CHANNELS {
            let values = [mine, shipping].map(|sample| (channel.value)(sample));
            if values[0].to_bits() != values[1].to_bits() {
                let [a, b] = values;
                return differ(format!(
                    "{} at {} s is {a:?} and {b:?}",
                    channel.name, mine.time_s
                ));
            }
        }
    }
    match [batched, alone].map(|run| run.trace.samples.len()) {
        [a, b] if a != b => differ(format!("there are {a} and {b} samples")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use haptic_sim::scenario::Condition;
    use haptic_sim::simulation::{Ending, simulate};

    use super::*;

    fn scenario(condition: Condition) -> Scenario {
        let course = crate::paper::stretched_curve(0.5).unwrap();
        let scenario = Scenario::builder().course(course).condition(condition);
        scenario.build().unwrap()
    }

    /// Differences that one run in a study of one must not get away with: each field of each sample, the sign of a zero
    /// too, the number of samples and steps, and the ending.
    #[test]
    fn a_bit_that_differs_is_an_error() {
        let scenarios = [scenario(Condition::High)];
        let honest = simulate(&scenarios[0]);
        let group = Group {
            scenarios: &scenarios,
            first: 0,
            checked: Checked::new(1, 1),
        };
        let told = |run: &Run| {
            let batch = |on: &mut dyn FnMut(usize, Event)| on(0, Event::Ended(run));
            let mut taken = 0;
            let result = group.with(
                batch,
                |_| honest.clone(),
                |_, _| {
                    taken += 1;
                    Ok(())
                },
            );
            (result, taken)
        };
        assert_eq!(told(&honest), (Ok(vec![]), 1));
        let lie = |change: &dyn Fn(&mut Run)| {
            let mut run = honest.clone();
            change(&mut run);
            let (result, taken) = told(&run);
            assert_eq!(taken, 0, "what is wrong is not taken");
            result.unwrap_err().to_string()
        };
        let error = lie(&|run| run.trace.samples[700].yaw_rate_rad_per_s += 1e-18);
        assert!(error.starts_with("run 0: yaw_rate"), "{error}");
        let zero = honest
            .trace
            .samples
            .iter()
            .position(|s| s.guidance_torque_nm.to_bits() == 0);
        let error = lie(&|run| run.trace.samples[zero.unwrap()].guidance_torque_nm = -0.0);
        assert!(error.contains("is -0.0 and 0.0 side by side and"), "{error}");
        let error = lie(&|run| run.trace.samples.truncate(5));
        assert!(error.starts_with("run 0: there are 5 and"), "{error}");
        lie(&|run| run.steps += 1);
        lie(&|run| run.ending = Ending::Diverged { s_m: 1.0 });
    }

    #[test]
    fn one_in_five_hundred_is_checked_and_one_of_each_study() {
        let count = |of: u64| {
            let checked = Checked::new(7, of);
            (0..of).filter(|number| checked.has(*number)).count()
        };
        for of in 1..30 {
            assert!((1..5).contains(&count(of)), "{of}: {}", count(of));
        }
        // Binomial: 200 and four standard deviations of 14.
        assert!((144..257).contains(&count(100_000)), "{}", count(100_000));
    }
}
