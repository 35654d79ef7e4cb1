//! The host computer's log: 120 rows a second of a run, through the paper's sensors.
//!
//! The loop runs in steps of 1 ms, the log at instants n/120 s between them. The continuous signals are taken
//! on the line between the two steps, then rounded as their sensors do; T_h is what the actuator holds, at an
//! instant at which it was decided anew the new value.

use haptic_analysis::identify::DriveLog;
use haptic_sim::Outcome;
use haptic_sim::models::{STEPS_PER_SECOND, sensors};
use haptic_sim::scenario::Scenario;
use haptic_sim::simulation::{Run, observe};
use haptic_vectorised::Step;

/// The run of a scenario with the shipping ECU, and its log with the resolution of the sensors.
pub fn recorded(scenario: &Scenario) -> (Run, DriveLog) {
    let mut recorder = Recorder::new(true);
    let run = observe(scenario, |outcome| recorder.observe(outcome));
    (run, recorder.into_log())
}

/// Rows a second.
const RATE_HZ: u32 = 120;

/// Collects the log while a run goes on.
#[derive(Debug, Clone)]
pub struct Recorder {
    rounded: bool,
    last: Option<Step>,
    log: DriveLog,
}

impl Recorder {
    /// An empty log; `rounded` says whether torque and angle have their sensors' resolution or are exact.
    pub fn new(rounded: bool) -> Self {
        let log = DriveLog {
            dt_s: 1.0 / f64::from(RATE_HZ),
            ..DriveLog::default()
        };
        Self {
            rounded,
            last: None,
            log,
        }
    }

    /// Takes in one step.
    pub fn observe(&mut self, outcome: &Outcome) {
        self.take(Step::from(outcome));
    }

    /// Takes in one step of a vectorised run: without errors of sensors, what is true is what is observed.
    pub fn take(&mut self, now: Step) {
        let Some(last) = self.last.replace(now) else {
            return;
        };
        // In whole numbers: by rounding, a row at the instant of a step would now and then miss it.
        let due = self.log.len() as u64 * u64::from(STEPS_PER_SECOND);
        let [since, until] = [last.step, now.step].map(|step| u64::from(step) * u64::from(RATE_HZ));
        if due < until {
            let share = due.saturating_sub(since) as f64 / (until - since) as f64;
            let between = |a: f64, b: f64| a + share * (b - a);
            let torque = between(last.driver_torque_nm, now.driver_torque_nm);
            let angle = between(last.wheel_angle_rad, now.wheel_angle_rad);
            let log = &mut self.log;
            log.e_y_m.push(between(last.e_y_m, now.e_y_m));
            log.e_theta_rad.push(between(last.e_theta_rad, now.e_theta_rad));
            log.wheel_angle_rad.push(if self.rounded {
                sensors::wheel_angle_rad(angle)
            } else {
                angle
            });
            // The new torque is decided in the step at `now`: until then the actuator holds the last one.
            log.guidance_torque_nm.push(last.guidance_torque_nm);
            log.driver_torque_nm.push(if self.rounded {
                sensors::torque_nm(torque)
            } else {
                torque
            });
        }
    }

    /// The log so far.
    pub fn into_log(self) -> DriveLog {
        self.log
    }
}
