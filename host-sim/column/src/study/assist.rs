//! Overlay or offset: what the hands feel of 1 N.m of guidance, what the driver's own assist takes of it, the margins of both loops,
//! and what a sudden loss costs, for the drivers of tables 5 to 8.
//!
//! Law (9) guides in float64, without the ECU: its envelope, modes and checks are not part of this. Drivers keep the gains that the paper
//! found on its column, which has no assist.

use haptic_engine::{Part, Plan, StudyError};
use haptic_sim::fields::InFile;
use haptic_sim::guidance::{FloatLaw, Guidance, NoGuidance};
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::road::{Course, CourseError, Segment};
use haptic_sim::models::torsion_bar::{
    Assist, AssistParameters, BarPlant, ColumnParameters, CurveChoice, Inject,
};
use haptic_sim::participants::participants;
use haptic_sim::scenario::{Condition, Failure, FailureKind, ScenarioError};
use haptic_sim::{Scenario, Simulation};
use serde::Serialize;

use super::ColumnFile;
use crate::linear::{Hands, Linear, Margins, margins};

/// Speeds of the tables, km/h; drives are at [`DRIVEN_KMH`].
pub const SPEEDS_KMH: [f64; 5] = [10.0, 30.0, 60.0, 100.0, 130.0];
/// The paper's speed, km/h.
pub const DRIVEN_KMH: f64 = 60.0;
/// Torques of the bar at which the guidance is felt, N.m: on a straight, and in a bend.
pub const WORKING_NM: [f64; 2] = [0.0, 2.0];
/// When the torque is lost, s: 6.7 m into the arc, where the paper's failure comes.
const LOST_AT_S: f64 = 206.7 / (DRIVEN_KMH / 3.6);
/// Slow beside a bar and fast beside a bend: where the guidance is felt, Hz.
const FELT_AT_HZ: f64 = 0.5;
/// Both ways to bring it in.
const INJECTS: [Inject; 2] = [Inject::Overlay, Inject::Offset];

/// What guidance is to hands that hold the wheel, and to a wheel that nobody holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Felt {
    /// The assist.
    pub curve: &'static str,
    /// Where the guidance is brought in.
    pub inject: Inject,
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Torque of the bar around which it is felt, N.m.
    pub working_nm: f64,
    /// Slope of the assist there.
    pub slope: f64,
    /// What hands that hold the wheel feel of 1 N.m, N.m.
    pub felt_nm: f64,
    /// What the motor then does for 1 N.m, N.m: guidance, less what the assist takes away.
    pub motor_held_nm: f64,
    /// What the motor does for 1 N.m where nobody holds the wheel, N.m.
    pub motor_free_nm: f64,
}

/// Margins of the loop through the assist at its largest slope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopRow {
    /// The assist.
    pub curve: &'static str,
    /// Speed, km/h.
    pub speed_kmh: f64,
    /// Its largest slope there.
    pub slope: f64,
    /// For a free wheel, and for one that is held; none where the closed loop is unstable.
    pub margins: [Option<Margins>; 2],
}

/// What drives the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Column {
    /// The paper's, of one piece.
    Rigid,
    /// A bar without friction and assist.
    Smooth,
    /// A bar with friction and without assist.
    Bar,
    /// A bar with the assist of that place in the list.
    Assisted(usize, Inject),
}

/// Which drivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// Table 5: the participants by hand.
    Manual,
    /// Table 6: the participants with guidance.
    Guided,
    /// Tables 7 and 8: three delays, three ways to rely.
    Conditions,
}

impl Group {
    /// All.
    pub const ALL: [Self; 3] = [Self::Manual, Self::Guided, Self::Conditions];

    fn drivers(self) -> Vec<(DriverParameters, ArmGains)> {
        let own = participants();
        match self {
            Self::Manual => own
                .iter()
                .map(|p| (p.manual.parameters(), p.manual.gains()))
                .collect(),
            Self::Guided => own
                .iter()
                .map(|p| (p.guided.parameters(), p.guided.gains()))
                .collect(),
            Self::Conditions => [0.1, 0.3, 0.5]
                .into_iter()
                .flat_map(|t_p| {
                    let driver = DriverParameters {
                        t_p,
                        ..DriverParameters::default()
                    };
                    [Condition::High, Condition::Mid, Condition::Low].map(|c| (driver, c.gains()))
                })
                .collect(),
        }
    }
}

/// A driver on a column.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// The column.
    pub column: Column,
    /// The drivers that it belongs to.
    pub group: Group,
    driver: DriverParameters,
    gains: ArmGains,
}

/// What came of a case.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Driven {
    /// Largest lateral error, m; none where the vehicle left the road.
    pub peak_m: Option<f64>,
    /// Largest lateral error where the guidance's torque is lost at once in the bend, m; none off the road, and by hand.
    pub lost_peak_m: Option<f64>,
    /// Margins of the loop through eyes and arm, on a straight; none where the loop is unstable or on the paper's column.
    pub eyes: Option<Margins>,
    /// What the motor does for 1 N.m with this arm at the wheel, on a straight, N.m.
    pub motor_nm: Option<f64>,
}

/// Least, middle and largest of some drivers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// The least.
    pub least: f64,
    /// The middle one.
    pub median: f64,
    /// The largest.
    pub most: f64,
}

/// A group of drivers on a column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupRow {
    /// The column.
    pub column: Column,
    /// The assist's name.
    pub curve: Option<&'static str>,
    /// The drivers.
    pub group: Group,
    /// How many they are.
    pub drivers: usize,
    /// How many left the road, in either drive.
    pub off_road: usize,
    /// Largest lateral error of those that stayed, m.
    pub peak_m: Option<Spread>,
    /// That with the torque lost, less that without, of those that stayed, m.
    pub loss_costs_m: Option<Spread>,
    /// Phase margin of eyes and arm, degrees, of those whose loop is stable.
    pub phase_deg: Option<Spread>,
    /// What the motor does for 1 N.m.
    pub motor_nm: Option<Spread>,
}

/// What came of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// The column.
    pub column: InFile<ColumnParameters>,
    /// What is felt.
    pub felt: Vec<Felt>,
    /// The assist's loop.
    pub loops: Vec<LoopRow>,
    /// The drivers.
    pub drivers: Vec<GroupRow>,
}

/// The study, of a column.
#[derive(Debug, Clone, Default)]
pub struct Study {
    /// The column and its assist.
    pub file: ColumnFile,
}

impl Study {
    fn columns(&self) -> Vec<Column> {
        let curves = 0..self.file.curves().len();
        let assisted = curves.flat_map(|k| INJECTS.map(|inject| Column::Assisted(k, inject)));
        [Column::Rigid, Column::Smooth, Column::Bar]
            .into_iter()
            .chain(assisted)
            .collect()
    }

    /// The car with another assist, and the guidance brought in there.
    fn plant(&self, assist: Assist, inject: Inject) -> Result<BarPlant, ScenarioError> {
        let mut plant = self.file.plant()?.with_assist(assist);
        plant.motor.inject = inject;
        Ok(plant)
    }

    /// The linear form of a case's column at the working point of a straight; none of the paper's.
    fn linear_of(&self, column: Column) -> Result<Option<Linear>, ScenarioError> {
        let plant = match column {
            Column::Rigid => return Ok(None),
            Column::Smooth | Column::Bar => self.plant(Assist::None, Inject::Overlay)?,
            Column::Assisted(k, inject) => self.plant(self.file.curves()[k].1.assist(), inject)?,
        };
        Ok(Some(Linear::new(&plant, DRIVEN_KMH / 3.6, WORKING_NM[0])))
    }

    /// The drive of a case.
    fn scenario(&self, case: &Case, kind: FailureKind) -> Result<Scenario, StudyError> {
        let failure = Failure {
            kind,
            time_s: LOST_AT_S,
            ..Failure::default()
        };
        let with = |column: ColumnParameters, curve, inject| ColumnFile {
            column,
            assist: AssistParameters {
                curve,
                inject,
                ..self.file.assist.clone()
            },
        };
        let (column, none) = (self.file.column, CurveChoice::default());
        let file = match case.column {
            Column::Rigid => None,
            Column::Smooth => Some(with(column.linear(), none, Inject::Overlay)),
            Column::Bar => Some(with(column, none, Inject::Overlay)),
            Column::Assisted(k, inject) => Some(with(column, self.file.curves().swap_remove(k).1, inject)),
        };
        let builder = Scenario::builder().course(road()?).speed_kmh(DRIVEN_KMH);
        let builder = builder.driver(case.driver).gains(case.gains).failure(failure);
        Ok(match file {
            Some(file) => file.with(builder),
            None => builder,
        }
        .build()?)
    }

    /// Drives a case.
    ///
    /// # Errors
    /// A column or a scenario that cannot be.
    pub fn driven(&self, case: &Case) -> Result<Driven, StudyError> {
        let peak = |kind| -> Result<Option<f64>, StudyError> {
            let scenario = self.scenario(case, kind)?;
            Ok(match case.group {
                Group::Manual => peak_of(&scenario, NoGuidance),
                Group::Guided | Group::Conditions => {
                    peak_of(&scenario, FloatLaw::new(scenario.controller_params()))
                }
            })
        };
        let lost_peak_m = match case.group {
            Group::Manual => None,
            Group::Guided | Group::Conditions => peak(FailureKind::Torque)?,
        };
        let linear = self.linear_of(case.column)?;
        let (driver, gains) = (&case.driver, case.gains);
        let peak_m = peak(FailureKind::None)?;
        let eyes = linear
            .as_ref()
            .and_then(|l| margins(|hz| l.driver_loop(driver, gains, hz)));
        let motor = linear
            .as_ref()
            .and_then(|l| l.guidance(Hands::of(driver), gains.k_hg, FELT_AT_HZ));
        Ok(Driven {
            peak_m,
            lost_peak_m,
            eyes,
            motor_nm: motor
                .map(|[_, motor]| motor.norm())
                .filter(|_| case.group != Group::Manual),
        })
    }

    fn felt(&self) -> Result<Vec<Felt>, ScenarioError> {
        let mut rows = Vec::new();
        for (curve, choice) in self.file.curves() {
            for inject in INJECTS {
                let plant = self.plant(choice.assist(), inject)?;
                for speed_kmh in SPEEDS_KMH {
                    for working_nm in WORKING_NM {
                        let v = speed_kmh / 3.6;
                        let linear = Linear::new(&plant, v, working_nm);
                        let at = |hands| {
                            linear
                                .guidance(hands, 0.0, FELT_AT_HZ)
                                .map(|two| two.map(|z| z.norm()))
                        };
                        let (held, free) = (at(Hands::Fixed), at(Hands::Free));
                        let [felt_nm, motor_held_nm] = held.unwrap_or([f64::NAN; 2]);
                        rows.push(Felt {
                            curve,
                            inject,
                            speed_kmh,
                            working_nm,
                            slope: plant.assist.slope(working_nm, v),
                            felt_nm,
                            motor_held_nm,
                            motor_free_nm: free.map_or(f64::NAN, |[_, motor]| motor),
                        });
                    }
                }
            }
        }
        Ok(rows)
    }

    fn loops(&self) -> Result<Vec<LoopRow>, ScenarioError> {
        let mut rows = Vec::new();
        for (curve, choice) in self.file.curves() {
            for speed_kmh in SPEEDS_KMH {
                let slope = choice.assist().steepest(speed_kmh / 3.6);
                let plant = self.plant(Assist::Slope(slope), Inject::Overlay)?;
                let linear = Linear::new(&plant, speed_kmh / 3.6, 0.0);
                let margins = [Hands::Free, Hands::Fixed].map(|hands| {
                    let found = margins(|hz| linear.assist_loop(hands, hz));
                    found.filter(|_| linear.is_stable(hands))
                });
                rows.push(LoopRow {
                    curve,
                    speed_kmh,
                    slope,
                    margins,
                });
            }
        }
        Ok(rows)
    }

    fn groups(&self, cases: &[Case], driven: &[Driven]) -> Vec<GroupRow> {
        let curves = self.file.curves();
        let mut rows = Vec::new();
        for column in self.columns() {
            for group in Group::ALL {
                let own = cases.iter().zip(driven);
                let own: Vec<&Driven> = own
                    .filter(|(case, _)| case.column == column && case.group == group)
                    .map(|(_, driven)| driven)
                    .collect();
                let stayed =
                    |d: &&Driven| d.peak_m.is_some() && (group == Group::Manual || d.lost_peak_m.is_some());
                let on_road = || own.iter().copied().filter(stayed);
                if own.is_empty() {
                    continue;
                }
                rows.push(GroupRow {
                    column,
                    curve: match column {
                        Column::Assisted(k, _) => Some(curves[k].0),
                        Column::Rigid | Column::Smooth | Column::Bar => None,
                    },
                    group,
                    drivers: own.len(),
                    off_road: own.len() - on_road().count(),
                    peak_m: spread(on_road().filter_map(|d| d.peak_m)),
                    loss_costs_m: spread(on_road().filter_map(|d| Some(d.lost_peak_m? - d.peak_m?))),
                    phase_deg: spread(on_road().filter_map(|d| d.eyes?.phase_deg)),
                    motor_nm: spread(own.iter().filter_map(|d| d.motor_nm)),
                });
            }
        }
        rows
    }
}

impl haptic_engine::Study for Study {
    type Case = Case;
    type Row = Driven;
    type Results = Results;

    fn plan(&self) -> Result<Plan<Case>, StudyError> {
        let mut cases = Vec::new();
        for column in self.columns() {
            for group in Group::ALL {
                // By hand there is nothing to bring in.
                if group == Group::Manual && matches!(column, Column::Assisted(_, Inject::Offset)) {
                    continue;
                }
                cases.extend(group.drivers().into_iter().map(|(driver, gains)| Case {
                    column,
                    group,
                    driver,
                    gains,
                }));
            }
        }
        Ok(Plan::one_by_one(cases))
    }

    fn drive(&self, part: &Part<'_, Case, Driven>) -> Result<Vec<Driven>, StudyError> {
        part.one_by_one(|case| self.driven(case))
    }

    /// What the drives say, with what no drive is needed for.
    fn summarise(&self, cases: Vec<Case>, driven: Vec<Driven>) -> Result<Results, StudyError> {
        Ok(Results {
            column: InFile(self.file.column),
            felt: self.felt()?,
            loops: self.loops()?,
            drivers: self.groups(&cases, &driven),
        })
    }
}

fn spread(values: impl Iterator<Item = f64>) -> Option<Spread> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    Some(Spread {
        least: *values.first()?,
        median: values[values.len() / 2],
        most: *values.last()?,
    })
}

/// The first bend of the paper's course behind a shorter straight, and a straight to settle on.
fn road() -> Result<Course, CourseError> {
    let curvature = 1.0 / 300.0;
    let segments = vec![
        Segment::straight(120.0),
        Segment::clothoid(80.0, 0.0, curvature),
        Segment::arc(300.0, curvature),
        Segment::clothoid(80.0, curvature, 0.0),
        Segment::straight(250.0),
    ];
    Course::new("first bend of paper-course", 3.6, segments)
}

fn peak_of(scenario: &Scenario, guidance: impl Guidance) -> Option<f64> {
    let run = Simulation::with(scenario, guidance).run();
    let errors = run
        .trace
        .samples
        .iter()
        .map(|sample| sample.lateral_error_m.abs());
    (!run.diverged()).then(|| errors.fold(0.0, f64::max))
}
