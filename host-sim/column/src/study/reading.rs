//! What the ECU reads of [K_hg] from an arm above a torsion bar: simulated drivers on the paper's course at 60 km/h, with the probe.
//!
//! [K_hg]: haptic_core::estimator

use haptic_engine::{Part, Plan, StudyError};
use haptic_sim::Scenario;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::torsion_bar::{AngleSensor, AssistParameters, ColumnParameters, CurveChoice};
use haptic_sim::scenario::{Condition, GuidanceParameters, ScenarioError};
use serde::Serialize;

use super::ColumnFile;

/// K_hg of the drivers.
pub const K_HG: [f64; 3] = [0.0, 0.3, 0.6];
/// Draws of the remnant, from seed 1 on, and its standard deviation, N.m.
pub const SEEDS: u64 = 8;
const REMNANT_NM: f64 = 0.1;
/// Speed, km/h.
const SPEED_KMH: f64 = 60.0;

/// On what the driver's arm acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Column {
    /// The paper's column.
    Rigid,
    /// The bar, without friction or assist.
    Smooth,
    /// The bar with the file's friction of the wheel alone.
    Wheel,
    /// The bar with the file's friction of the column alone.
    Below,
    /// The bar with the file's assist, without friction.
    Assist,
    /// The bar with both frictions and the assist.
    Both,
}

impl Column {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Rigid,
        Self::Smooth,
        Self::Wheel,
        Self::Below,
        Self::Assist,
        Self::Both,
    ];

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rigid => "the paper's column",
            Self::Smooth => "bar, no friction, no assist",
            Self::Wheel => "bar, friction of the wheel",
            Self::Below => "bar, friction of the column",
            Self::Assist => "bar and assist",
            Self::Both => "bar, both frictions and assist",
        }
    }
}

/// A drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    column: Column,
    k_hg: f64,
    seed: u64,
}

/// What is read of one K_hg on one column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// On what the arm acts.
    pub column: Column,
    /// The driver's K_hg: his answer to what comes up to his hands.
    pub k_hg: f64,
    /// His answer to the motor's torque, which the ECU reads: K_hg/(1 + slope) beside an assist, by its slope on a straight.
    pub of_motor: f64,
    /// Mean of what is read at the end of each drive, over the drives that have a reading.
    pub read: f64,
    /// Standard deviation over those drives.
    pub spread: f64,
    /// Mean of the standard deviation that the ECU reports.
    pub reported: f64,
    /// Drives with a reading.
    pub drives: usize,
}

/// What is read of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// A row for each K_hg on each column.
    pub rows: Vec<Row>,
}

/// The last reading of a drive, value and standard deviation; none where there was none.
pub type Reading = Option<[f64; 2]>;

/// The study of a column.
#[derive(Debug, Clone)]
pub struct Study {
    /// Wheel, bar, friction and assist.
    pub file: ColumnFile,
    /// Drives a scenario and reads what the ECU says at its end.
    pub read: fn(Scenario) -> Result<Reading, StudyError>,
}

impl Study {
    /// The drive of a case.
    ///
    /// # Errors
    /// A column that cannot be.
    pub fn scenario(&self, case: &Case) -> Result<Scenario, ScenarioError> {
        let driver = DriverParameters {
            remnant_sd_nm: REMNANT_NM,
            ..DriverParameters::default()
        };
        // The paper's drivers have K_d = 2 + 2 K_hg.
        let gains = ArmGains {
            k_d: 2.0 + 2.0 * case.k_hg,
            k_hg: case.k_hg,
        };
        let builder = Scenario::builder()
            .condition(Condition::Custom)
            .speed_kmh(SPEED_KMH);
        let builder = builder.driver(driver).gains(gains).seed(case.seed);
        let probed = GuidanceParameters {
            probe: true,
            ..GuidanceParameters::default()
        };
        if case.column == Column::Rigid {
            return builder.guidance(probed).build();
        }
        let (column, none) = (self.file.column, CurveChoice::default());
        let smooth = ColumnParameters {
            upper_friction_nm: 0.0,
            lower_friction_nm: 0.0,
            ..column
        };
        let curve = || self.file.one_curve().1;
        let (column, curve) = match case.column {
            Column::Rigid | Column::Smooth => (smooth, none),
            Column::Wheel => (
                ColumnParameters {
                    upper_friction_nm: column.upper_friction_nm,
                    ..smooth
                },
                none,
            ),
            Column::Below => (
                ColumnParameters {
                    lower_friction_nm: column.lower_friction_nm,
                    ..smooth
                },
                none,
            ),
            Column::Assist => (smooth, curve()),
            Column::Both => (column, curve()),
        };
        let file = ColumnFile {
            column: ColumnParameters {
                angle: AngleSensor::Column,
                ..column
            },
            assist: AssistParameters {
                curve,
                ..self.file.assist.clone()
            },
        };
        let told = probed.told_of(&file.column);
        file.with(builder).guidance(told).build()
    }
}

impl haptic_engine::Study for Study {
    type Case = Case;
    type Row = Reading;
    type Results = Results;

    fn plan(&self) -> Result<Plan<Case>, StudyError> {
        let of = |column| {
            K_HG.into_iter()
                .flat_map(move |k_hg| (1..=SEEDS).map(move |seed| Case { column, k_hg, seed }))
        };
        Ok(Plan::one_by_one(Column::ALL.into_iter().flat_map(of).collect()))
    }

    fn drive(&self, part: &Part<'_, Case, Reading>) -> Result<Vec<Reading>, StudyError> {
        part.one_by_one(|case| (self.read)(self.scenario(case)?))
    }

    fn summarise(&self, cases: Vec<Case>, readings: Vec<Reading>) -> Result<Results, StudyError> {
        let slope = self.file.one_curve().1.assist().slope(0.0, SPEED_KMH / 3.6);
        let row = |column, k_hg| {
            let here = cases
                .iter()
                .zip(&readings)
                .filter(|(case, _)| case.column == column && case.k_hg == k_hg);
            let read: Vec<[f64; 2]> = here.filter_map(|(_, reading)| *reading).collect();
            let mean = |of: &dyn Fn(&[f64; 2]) -> f64| read.iter().map(of).sum::<f64>() / read.len() as f64;
            let middle = mean(&|r| r[0]);
            let is_assisted = matches!(column, Column::Assist | Column::Both);
            Row {
                column,
                k_hg,
                of_motor: if is_assisted { k_hg / (1.0 + slope) } else { k_hg },
                read: middle,
                spread: mean(&|r| (r[0] - middle).powi(2)).sqrt(),
                reported: mean(&|r| r[1]),
                drives: read.len(),
            }
        };
        let of = |column| K_HG.into_iter().map(move |k_hg| row(column, k_hg));
        Ok(Results {
            rows: Column::ALL.into_iter().flat_map(of).collect(),
        })
    }
}
