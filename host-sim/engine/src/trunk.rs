//! A drive of any law and any driver, and what comes of it where something fails: the *trunk* goes to the end of the course, and at each
//! failure a copy of the loop, its *fork*, goes on without the torque or without the lane.

use haptic_log::trace::Trace;
use haptic_sim::drivers::AnyDriver;
use haptic_sim::guidance::OwnLaw;
use haptic_sim::laws::Law;
use haptic_sim::models::STEPS_PER_SECOND;
use haptic_sim::parts::{PaperVehicle, Parts};
use haptic_sim::scenario::{Failure, FailureKind, Scenario};
use haptic_sim::simulation::{DIVERGED_M, Ending, Run, SAMPLE_RATE_HZ};
use haptic_sim::{Action, Simulation};
use serde::Deserialize;

/// A loop of any law and any driver, behind the shipping ECU.
pub type Trunk = Simulation<OwnLaw<Box<dyn Law>>, Parts<Box<dyn AnyDriver>, PaperVehicle>>;

/// What fails in a drive.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// Instants of a sudden loss of the torque, evenly over the drive.
    pub sudden_loss: u32,
    /// Instants from which on no lane comes.
    pub silent_lane: u32,
    /// How long a failed drive goes on, s.
    pub lasts_s: f64,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            sudden_loss: 0,
            silent_lane: 0,
            lasts_s: 15.0,
        }
    }
}

/// The beginning of a drive of a law and a driver.
pub fn trunk(scenario: &Scenario, law: Box<dyn Law>, driver: Box<dyn AnyDriver>) -> Trunk {
    let vehicle = PaperVehicle::new(scenario);
    Simulation::of_parts(scenario, driver, vehicle, OwnLaw::new(scenario, law))
}

/// Drives to the end of the course, and so long from each failure. The run of the trunk, and what `measure` makes of each fork, in the
/// order of the failures. The samples of a fork begin with the failure.
pub fn drive_forked<T>(
    mut trunk: Trunk,
    failures: &[(u32, Failure)],
    lasts_s: f64,
    measure: impl Fn(Failure, &Run) -> T,
) -> (Run, Vec<T>) {
    let lasts = (lasts_s * f64::from(STEPS_PER_SECOND)) as u32;
    let mut next = failures.iter().peekable();
    let mut forked = Vec::new();
    let mut samples = Vec::new();
    loop {
        while let Some((_, failure)) = next.next_if(|(step, _)| *step == trunk.steps()) {
            let fork = trunk.fork_at(*failure);
            forked.extend(fork.map(|fork| measure(*failure, &goes_on(fork, lasts))));
        }
        let Some(outcome) = trunk.step(&Action::default()) else {
            break;
        };
        // One step in five has a sample.
        samples.extend(outcome.sample);
    }
    (run_of(&trunk, samples), forked)
}

/// So many steps more, or what there is of them.
fn goes_on(mut fork: Trunk, steps: u32) -> Run {
    let mut samples = Vec::new();
    for _ in 0..steps {
        let Some(outcome) = fork.step(&Action::default()) else {
            break;
        };
        samples.extend(outcome.sample);
    }
    run_of(&fork, samples)
}

fn run_of(simulation: &Trunk, samples: Vec<haptic_log::trace::Sample>) -> Run {
    Run {
        trace: Trace {
            sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
            samples,
        },
        ending: simulation.ending().unwrap_or(Ending::CourseEnd),
        steps: simulation.steps(),
    }
}

/// The failures with their steps, in time: evenly over what of the drive leaves time to go on.
pub fn failures(scenario: &Scenario, faults: Faults) -> Vec<(u32, Failure)> {
    let span_s = (scenario.duration_s() - faults.lasts_s).max(0.0);
    let of_kind = |kind, count: u32| {
        (0..count).map(move |place| {
            let step =
                // The middles of equal parts: none lies at the very beginning.
                ((f64::from(place) + 0.5) / f64::from(count) * span_s * f64::from(STEPS_PER_SECOND)) as u32;
            let time_s = f64::from(step) / f64::from(STEPS_PER_SECOND);
            let failure = Failure {
                kind,
                time_s,
                duration_s: None,
            };
            (step, failure)
        })
    };
    let mut all: Vec<_> = of_kind(FailureKind::Torque, faults.sudden_loss).collect();
    all.extend(of_kind(FailureKind::Input, faults.silent_lane));
    all.sort_by_key(|(step, _)| *step);
    all
}

/// From when on behind a failure the after-effect counts, s: what comes before is the failure itself.
const AFTER_S: f64 = 5.0;

/// Lateral errors behind a failure, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct After {
    /// What failed.
    pub kind: FailureKind,
    /// The largest one; of a drive that leaves the road 10 m, where runs end.
    pub peak_m: f64,
    /// The mean from 5 s behind the failure on; none if the drive ends before.
    pub mean_m: Option<f64>,
}

impl After {
    /// Measures a fork.
    pub fn new(failure: Failure, fork: &Run) -> Self {
        let kind = failure.kind;
        if fork.diverged() {
            let (peak_m, mean_m) = (DIVERGED_M, Some(DIVERGED_M));
            return Self { kind, peak_m, mean_m };
        }
        let errors_m = |from_s: f64| {
            // Half a sample's time is far from any instant of one.
            let samples = fork.trace.samples.iter();
            let later = samples.filter(move |sample| sample.time_s - failure.time_s > from_s - 0.5e-3);
            later.map(|sample| sample.lateral_error_m.abs())
        };
        let (sum_m, count) = errors_m(AFTER_S).fold((0.0, 0_u32), |(sum, count), e| (sum + e, count + 1));
        Self {
            kind,
            peak_m: errors_m(0.0).fold(0.0, f64::max),
            mean_m: (count > 0).then(|| sum_m / f64::from(count)),
        }
    }

    /// Whether the drive left the road.
    pub fn is_off_road(&self) -> bool {
        self.peak_m >= DIVERGED_M
    }
}
