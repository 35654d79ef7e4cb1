//! One scenario, simulated and measured.

use haptic_core::bus::Frame;
use haptic_core::controller::params::SENSORS;
use serde::Serialize;

use super::RunRecord;
use super::record::{default_window, failure_notes, nominal_peak_m};
use crate::engine::StudyError;
use crate::readings::Readings;
use haptic_log::Event;
use haptic_sim::ecu_events::{EcuEvents, Said};
use haptic_sim::models::torsion_bar::AngleSensor;
use haptic_sim::scenario::{Condition, Failure, FailureKind, Scenario, Sensors};
use haptic_sim::simulation::{Run, observe, simulate};
use haptic_sim::unguided::{Unguided, stretches};

/// K_hg as the ECU reports it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LiveEstimate {
    /// The estimate.
    pub k_hg: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// A scenario with its run.
#[derive(Debug, Clone)]
pub struct SingleRun {
    /// What was simulated.
    pub scenario: Scenario,
    /// What came of it.
    pub run: Run,
    /// What the ECU said of itself, in order of time.
    pub reported: Vec<Event>,
    /// Its modes and faults, from the start and at each change.
    pub said: Vec<Said>,
    /// The stretches without guidance; none by hand.
    pub unguided: Vec<Unguided>,
    /// What the ECU said of the driver's reliance; nothing past the bus.
    pub readings: Readings,
    /// The bus, if it was recorded: milliseconds since the start, and what was sent then, in order.
    pub bus: Vec<(u32, Frame)>,
    /// What is handed on.
    pub results: SingleResults,
}

/// The results of one run, as JSON holds them.
#[derive(Debug, Clone, Serialize)]
pub struct SingleResults {
    /// Name of the course.
    pub course: String,
    /// Its length, m.
    pub course_length_m: f64,
    /// Speed at the start, km/h; the record has the mean, the least and the largest.
    pub speed_kmh: f64,
    /// What the controller saw.
    pub sensors: Sensors,
    /// When the guidance failed, if it did, s.
    pub failure_time_s: Option<f64>,
    /// Seed of the remnant.
    pub seed: u64,
    /// The ECU's last estimate of K_hg, if it identified any.
    pub k_hg: Option<LiveEstimate>,
    /// Stretch that was measured, m: the paper's curve on its course, else all of it.
    pub window_m: [f64; 2],
    /// The run's record.
    #[serde(flatten)]
    pub record: RunRecord,
    /// What a reader has to know of these results.
    pub notes: Vec<String>,
}

/// Simulates a scenario; one with a failure also without it, to tell when the driver has recovered. With
/// `record_bus` every frame is kept.
///
/// # Errors
/// As [`Scenario::check_times`]; a bus to record where there is none.
pub fn run(scenario: Scenario, record_bus: bool) -> Result<SingleRun, StudyError> {
    scenario.check_times()?;
    if record_bus && (scenario.sensors() == Sensors::Exact || scenario.condition() == Condition::Manual) {
        return Err(
            "there is no bus to record: it takes sensors = \"paper\" and a condition with guidance".into(),
        );
    }
    let window = default_window(scenario.course());
    let (mut ecu, mut readings, mut bus) = (EcuEvents::new(), Readings::default(), Vec::new());
    let run = observe(&scenario, |outcome| {
        ecu.observe(outcome);
        readings.observe(outcome);
        if record_bus {
            let frames = outcome.frames_in.iter().chain(outcome.frames_out);
            bus.extend(frames.map(|frame| (outcome.observation.step, *frame)));
        }
    });
    let nominal_peak_m = if let Some(failure_time_s) = scenario.failure().at_s() {
        let failure = Failure {
            kind: FailureKind::None,
            ..scenario.failure()
        };
        let nominal = scenario.to_builder().failure(failure).build()?;
        nominal_peak_m(&simulate(&nominal), window, failure_time_s)
    } else {
        None
    };
    let record = RunRecord::new(&scenario, &run, window, nominal_peak_m);
    let k_hg = readings.readings.iter().rev().find_map(|r| r.estimate);
    let results = SingleResults {
        course: scenario.course().name().into(),
        course_length_m: scenario.course().length_m(),
        speed_kmh: scenario.speed_kmh(),
        sensors: scenario.sensors(),
        failure_time_s: scenario.failure().at_s(),
        seed: scenario.seed(),
        k_hg: k_hg.map(|[k_hg, deviation]| LiveEstimate { k_hg, deviation }),
        window_m: [window.from_m, window.to_m],
        record,
        notes: failure_notes(scenario.failure().time_s, &[record], window)
            .into_iter()
            .chain(sensor_note(&scenario))
            .chain(k_hg.and_then(|_| friction_note(&scenario)))
            .collect(),
    };
    let unguided = stretches(&run.trace).unwrap_or_default();
    Ok(SingleRun {
        scenario,
        run,
        reported: ecu.events().collect(),
        said: ecu.into_said(),
        unguided,
        readings,
        bus,
        results,
    })
}

/// Why what the ECU read of K_hg is not to be believed: its deviation is that of a wheel known to 15 %.
fn friction_note(scenario: &Scenario) -> Option<String> {
    let (column, told) = (scenario.column(), &scenario.guidance().controller);
    let is_off = |told: f64, is: f64| (told - is).abs() > 0.3 * is + 1e-12;
    let is_wrong = is_off(told.wheel_friction_nm, column.upper_friction_nm)
        || is_off(told.wheel_inertia_kg_m2, column.j_w_kg_m2);
    (column.has_bar() && is_wrong).then(|| {
        let note = "friction and inertia of the wheel, as guidance has them, are more than 30 % off those of column, and the deviation of what the \
             ECU reads of K_hg does not know of it";
        format!("{note}: docs/explanation/torsion-bar.md")
    })
}

/// Says where the ECU takes the sensor of the column for another than it is: no check of its own may find it.
fn sensor_note(scenario: &Scenario) -> Option<String> {
    let column = scenario.column();
    let is = match (column.has_bar(), column.angle) {
        (false, _) => SENSORS[0],
        (true, AngleSensor::Column) => SENSORS[1],
        (true, AngleSensor::Wheel) => SENSORS[2],
    };
    let said = SENSORS[scenario.guidance().controller.torque_sensor as usize];
    (scenario.condition() != Condition::Manual && said != is).then(|| {
        format!(
            "guidance.torque_sensor tells the ECU that the column's sensor is {said}, and it is {is}: override, hands off and the check of \
             the column go by what it is not"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_sim::models::torsion_bar::{ColumnKind, ColumnParameters};

    #[test]
    fn a_reading_through_another_wheel_than_the_ecu_is_told_of_is_doubted() {
        // The ECU is told of 0.2 N.m and 0.044 kg.m2.
        for (upper_friction_nm, j_w_kg_m2, is_doubted) in [
            (0.2, 0.044, false),
            (0.155, 0.044, false),
            (0.285, 0.044, false),
            (0.153, 0.044, true),
            (0.287, 0.044, true),
            (0.0, 0.044, true),
            (0.2, 0.033, true),
            (0.2, 0.064, true),
        ] {
            let column = ColumnParameters {
                kind: ColumnKind::TorsionBar,
                upper_friction_nm,
                j_w_kg_m2,
                ..ColumnParameters::default()
            };
            let scenario = Scenario::builder().column(column).build().unwrap();
            assert_eq!(friction_note(&scenario).is_some(), is_doubted, "{column:?}");
        }
    }

    /// Each of the three sensors beside each of the three that the ECU may be told of: six of nine are told apart, and none by hand.
    #[test]
    fn a_sensor_that_the_ecu_takes_for_another_is_told() {
        let columns = [
            (ColumnKind::Rigid, AngleSensor::Wheel),
            (ColumnKind::TorsionBar, AngleSensor::Column),
            (ColumnKind::TorsionBar, AngleSensor::Wheel),
        ];
        for (is, (kind, angle)) in columns.into_iter().enumerate() {
            for said in 0..3 {
                let mut guidance = haptic_sim::scenario::GuidanceParameters::default();
                guidance.controller.torque_sensor = f64::from(said as u32);
                let column = ColumnParameters {
                    kind,
                    angle,
                    ..ColumnParameters::default()
                };
                let builder = Scenario::builder().column(column).guidance(guidance);
                let scenario = builder.clone().build().unwrap();
                assert_eq!(sensor_note(&scenario).is_some(), is != said, "{is} {said}");
                let by_hand = builder.condition(Condition::Manual).build().unwrap();
                assert_eq!(sensor_note(&by_hand), None);
            }
        }
    }
}
