//! From a recorded drive to the parameters of its vehicle and its steering column, with 95 % intervals and verdicts.
//!
//! Mass and wheelbase are given. Two fits follow each other: the yaw rate that the wheel angle makes tells ratio, offset, understeer and
//! tyres; the wheel angle that the torques make tells inertia, damping, friction and aligning torque of the column. Both are
//! simulations from the quieter signal to the coarser one, so that the steps of a quantised angle are noise of an output and
//! bias nothing. Errors of the first fit are carried into the second.
//!
//! What the record does not tell is not identified, and [`Manoeuvre`] says which drive would tell it. Not here: reading files.
//!
//! Above 500 lines because the result's fields stand beside the two fits that fill them: split, a reader could not see which
//! fit a field comes from.

mod fit;
mod log;
mod manoeuvres;
mod model;
mod quantities;
mod recording;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use fit::{Fit, NoFit, Prior, fit};
pub use log::{MOST_LATERAL_M_PER_S2, VehicleColumns, VehicleLog};
pub use manoeuvres::{Manoeuvre, Telling};
pub use model::Known;
use model::{Physical, measured, place as P, wheel_angle, yaw_rate};
pub use quantities::{Part, Quantity, Verdict};
use quantities::{QUANTITIES, STEPS, beforehand};
pub use recording::ColumnsError;

/// Why a drive was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VehicleError {
    /// Columns do not go together.
    #[error("the columns have different lengths")]
    Lengths,
    /// The grid is not even.
    #[error("time_s is uneven at {time_s} s: an even grid is wanted")]
    Uneven {
        /// Where.
        time_s: f64,
    },
    /// The grid is too coarse or too fine.
    #[error("the record has {hz:.1} rows a second, outside {least} to {most}")]
    Rate {
        /// Rows a second.
        hz: f64,
        /// Fewest.
        least: f64,
        /// Most.
        most: f64,
    },
    /// The vehicle turns to the other side.
    #[error(
        "the yaw rate goes against the wheel angle: one of them has the wrong sign (both are positive to the left)"
    )]
    Sign,
    /// The angle is in another unit.
    #[error(
        "the vehicle turns as with a steering ratio of {ratio:.2}: are wheel angle (rad), yaw rate (rad/s) and speed (m/s) in these units?"
    )]
    Unit {
        /// What the record says.
        ratio: f64,
    },
    /// There are too few rows.
    #[error(
        "{used_s:.1} s of {recorded_s:.1} s can be used (speed from 4 m/s on, lateral acceleration up to 4 m/s2, 6 s without a gap), and 10 s is the least"
    )]
    TooShort {
        /// What can be used, s.
        used_s: f64,
        /// What is there, s.
        recorded_s: f64,
    },
    /// What is given cannot be.
    #[error("{name} = {value}, outside {least} to {most} {unit}")]
    Given {
        /// What.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Least.
        least: f64,
        /// Most.
        most: f64,
        /// Unit.
        unit: &'static str,
    },
}

/// A check of a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Whose fit.
    pub part: Part,
    /// What has to hold.
    pub assumption: &'static str,
    /// What is compared with the limit.
    pub value: f64,
    /// From where on, or below which, the assumption is refuted.
    pub limit: f64,
    /// Whether it holds.
    pub holds: bool,
    /// The likeliest cause where it does not.
    pub cause: &'static str,
}

/// Values for a scenario's `[vehicle]`, identified or not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BestValues {
    /// Mass, kg.
    pub m: f64,
    /// Yaw inertia, kg.m2.
    pub i: f64,
    /// Centre of gravity to the front axle, m.
    pub l_f: f64,
    /// Centre of gravity to the rear axle, m.
    pub l_r: f64,
    /// Cornering stiffness of one front tyre, N/rad.
    pub k_f: f64,
    /// Cornering stiffness of one rear tyre, N/rad.
    pub k_r: f64,
    /// Angle of the front wheels per angle of the steering wheel.
    pub k_t: f64,
    /// The column, where the torques tell one.
    pub column: Option<BestColumn>,
}

/// Values of the column, identified or not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BestColumn {
    /// Inertia, kg.m2.
    pub j_s: f64,
    /// Damping, N.m.s/rad.
    pub b_s: f64,
    /// Dry friction, N.m.
    pub friction_nm: f64,
    /// K_aln of equation (4), N.m/rad.
    pub k_aln: f64,
}

/// What a drive tells of its vehicle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleIdentification {
    /// The quantities, the vehicle's first.
    pub quantities: Vec<Quantity>,
    /// Checks of the fits.
    pub checks: Vec<Check>,
    /// Drives that would tell what is not identified.
    pub manoeuvres: Vec<Manoeuvre>,
    /// Share of the yaw rate that the wheel angle explains, %.
    pub yaw_rate_fit_percent: Option<f64>,
    /// Share of the wheel angle that the torques explain, %.
    pub wheel_angle_fit_percent: Option<f64>,
    /// Least and largest speed that is used, m/s.
    pub speeds_m_per_s: [f64; 2],
    /// Mean speed of what is used, m/s.
    pub mean_speed_m_per_s: f64,
    /// Seconds that are used.
    pub used_s: f64,
    /// Seconds of the record.
    pub recorded_s: f64,
    /// Seconds left out because of more than [`MOST_LATERAL_M_PER_S2`].
    pub fast_s: f64,
    /// What is taken for granted.
    pub assumed: Vec<String>,
    /// Values for a scenario; none without a fit.
    pub best: Option<BestValues>,
}

/// Both fits of a drive.
struct Fits<'a> {
    known: &'a Known,
    log: &'a VehicleLog,
    vehicle: Result<Fit, NoFit>,
    column: Result<Fit, String>,
    checks: Vec<Check>,
}

impl Known {
    /// Mass and wheelbase; the rest unknown.
    ///
    /// # Errors
    /// A value that no road vehicle has.
    pub fn new(mass_kg: f64, wheelbase_m: f64) -> Result<Self, VehicleError> {
        let known = Self {
            mass_kg,
            wheelbase_m,
            l_f_m: None,
            yaw_inertia_kg_m2: None,
            steering_ratio: None,
        };
        known.checked()
    }

    /// These values, if each is in its range.
    ///
    /// # Errors
    /// A value that no road vehicle has.
    pub fn checked(self) -> Result<Self, VehicleError> {
        let l = self.wheelbase_m;
        let ranges = [
            ("mass", Some(self.mass_kg), [100.0, 50_000.0], "kg"),
            ("wheelbase", Some(l), [0.5, 15.0], "m"),
            ("l_f", self.l_f_m, [0.2 * l, 0.8 * l], "m"),
            ("yaw inertia", self.yaw_inertia_kg_m2, [100.0, 500_000.0], "kg.m2"),
            ("steering ratio", self.steering_ratio, [5.0, 50.0], ""),
        ];
        for (name, value, [least, most], unit) in ranges {
            if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
                return Err(VehicleError::Given {
                    name,
                    value,
                    least,
                    most,
                    unit,
                });
            }
        }
        Ok(self)
    }
}

/// Identifies vehicle and column of a drive.
#[must_use]
pub fn identify_vehicle(log: &VehicleLog, known: &Known) -> VehicleIdentification {
    let vehicle = fit_vehicle(log, known);
    let column = match &vehicle {
        Err(_) => Err("the vehicle has no fit to build on".to_owned()),
        Ok(_) if !log.has_torque() => Err("driver_torque_nm is not recorded".to_owned()),
        Ok(vehicle) => fit_column(log, known, vehicle).map_err(|no| reason(no).to_owned()),
    };
    let mut fits = Fits {
        known,
        log,
        vehicle,
        column,
        checks: Vec::new(),
    };
    fits.check();
    let quantities: Vec<Quantity> = QUANTITIES.iter().map(|of| fits.quantity(of)).collect();
    let lacking: Vec<&str> = quantities
        .iter()
        .filter(|q| q.verdict == Verdict::NotIdentified)
        .map(|q| q.name)
        .collect();
    VehicleIdentification {
        manoeuvres: manoeuvres::telling(&fits, &lacking),
        yaw_rate_fit_percent: fits.vehicle.as_ref().ok().map(|fit| fit.fit_percent),
        wheel_angle_fit_percent: fits.column.as_ref().ok().map(|fit| fit.fit_percent),
        speeds_m_per_s: log.speed_range(),
        mean_speed_m_per_s: log.mean_speed_m_per_s,
        used_s: log.used_s,
        recorded_s: log.recorded_s,
        fast_s: log.fast_s,
        assumed: assumed(known),
        best: fits.best(),
        checks: fits.checks,
        quantities,
    }
}

const fn reason(no: NoFit) -> &'static str {
    match no {
        NoFit::TooShort => "the stretches are too short for a fit",
        NoFit::Diverged => "no values were found that explain the record",
    }
}

fn fit_vehicle(log: &VehicleLog, known: &Known) -> Result<Fit, NoFit> {
    let before = beforehand(known);
    let start = DVector::from_fn(P::VEHICLE, |i, _| before[i].0);
    let information = DMatrix::from_fn(P::VEHICLE, P::VEHICLE, |i, j| {
        if i == j { before[i].1.powi(-2) } else { 0.0 }
    });
    let prior = Prior {
        mean: start.clone(),
        information,
    };
    let recorded = measured(log, |s| &s.yaw_rate);
    fit(
        &|x| yaw_rate(log, known, x),
        &recorded,
        &start,
        &STEPS[..P::VEHICLE],
        &prior,
    )
}

fn fit_column(log: &VehicleLog, known: &Known, vehicle: &Fit) -> Result<Fit, NoFit> {
    let before = beforehand(known);
    let carried = vehicle
        .covariance
        .clone()
        .cholesky()
        .ok_or(NoFit::Diverged)?
        .inverse();
    let prior = Prior {
        mean: DVector::from_fn(P::ALL, |i, _| {
            if i < P::VEHICLE {
                vehicle.parameters[i]
            } else {
                before[i].0
            }
        }),
        information: with_column(&carried, known),
    };
    let recorded = measured(log, |s| &s.wheel_rad);
    fit(
        &|x| wheel_angle(log, known, x),
        &recorded,
        &prior.mean,
        &STEPS,
        &prior,
    )
}

/// What is known of all parameters, if this is known of the vehicle's.
fn with_column(vehicle: &DMatrix<f64>, known: &Known) -> DMatrix<f64> {
    let before = beforehand(known);
    DMatrix::from_fn(P::ALL, P::ALL, |i, j| match (i.max(j) < P::VEHICLE, i == j) {
        (true, _) => vehicle[(i, j)],
        (_, true) => before[i].1.powi(-2),
        _ => 0.0,
    })
}

/// Chi squared that chance exceeds once in 10,000, by degrees of freedom.
const REFUTING: [f64; 4] = [0.0, 15.14, 18.42, 21.11];
/// Least share of the wheel angle that the torques have to explain, %.
const LEAST_EXPLAINED_PERCENT: f64 = 30.0;

impl Fits<'_> {
    fn check(&mut self) {
        let mut checks = Vec::new();
        let score = |part, assumption, value, freedom: usize, cause| Check {
            part,
            assumption,
            value,
            limit: REFUTING[freedom],
            holds: value <= REFUTING[freedom],
            cause,
        };
        if let Ok(fit) = &self.vehicle {
            let value = fit.change(&[P::K_T, P::ANGLE_OFFSET]);
            let cause = "an angle sensor that was set to zero in mid-drive, or a load or tyres that changed";
            checks.push(score(
                Part::Vehicle,
                "ratio and offset are the same in both halves",
                value,
                2,
                cause,
            ));
        }
        if let Ok(fit) = &self.column {
            let value = fit.change(&[P::ALIGNING, P::FRICTION, P::TORQUE_OFFSET]);
            let cause = "an assist that changes with the speed, or a torque sensor that drifts";
            checks.push(score(
                Part::Column,
                "aligning torque, friction and offset are the same in both halves",
                value,
                3,
                cause,
            ));
            let bent = self.with_more_torque(fit, |torque| torque * torque.abs());
            let cause = "a power assist that is not in guidance_torque_nm";
            checks.push(score(
                Part::Column,
                "no torque grows with the square of the driver's",
                fit.omitted(&bent),
                1,
                cause,
            ));
            let more = self.with_more_torque(fit, |torque| torque);
            let cause = "a gain of one torque sensor, or a power assist";
            checks.push(score(
                Part::Column,
                "both torques have one scale",
                fit.omitted(&more),
                1,
                cause,
            ));
            let explained = fit.fit_percent;
            checks.push(Check {
                part: Part::Column,
                assumption: "the torques explain the wheel angle",
                value: explained,
                limit: LEAST_EXPLAINED_PERCENT,
                holds: explained >= LEAST_EXPLAINED_PERCENT,
                cause: "a torque that is not recorded (power assist), a torsion bar, or a wrong sign",
            });
        }
        self.checks = checks;
    }

    /// What a torque that is a function of the driver's would add to the wheel angle, per N.m.
    fn with_more_torque(&self, fit: &Fit, of: fn(f64) -> f64) -> fit::Stretches {
        const SHARE: f64 = 1e-3;
        let mut log = self.log.clone();
        for stretch in &mut log.stretches {
            if let (Some(torque), Some(driver)) = (&mut stretch.torque_nm, &stretch.driver_nm) {
                torque
                    .iter_mut()
                    .zip(driver)
                    .for_each(|(torque, driver)| *torque += SHARE * of(*driver));
            }
        }
        let [more, now] = [&log, self.log].map(|log| wheel_angle(log, self.known, &fit.parameters));
        let add = |(more, now): (&Vec<f64>, &Vec<f64>)| {
            more.iter().zip(now).map(|(a, b)| (a - b) / SHARE).collect()
        };
        more.iter().zip(&now).map(add).collect()
    }

    fn of(&self, part: Part) -> Result<&Fit, String> {
        match part {
            Part::Vehicle => self.vehicle.as_ref().map_err(|no| reason(*no).to_owned()),
            Part::Column => self.column.as_ref().map_err(Clone::clone),
        }
    }

    /// What refutes a fit.
    fn refuted(&self, part: Part) -> Option<String> {
        let broken = self
            .checks
            .iter()
            .find(|check| check.part == part && !check.holds)?;
        Some(format!(
            "refuted: {} does not hold; the likeliest cause is {}",
            broken.assumption, broken.cause
        ))
    }

    fn quantity(&self, of: &quantities::Definition) -> Quantity {
        match self.of(of.part) {
            Err(why) => of.without_fit(why),
            Ok(fit) => {
                let found = of.known(
                    self.known,
                    &fit.parameters,
                    &fit.covariance,
                    self.log.mean_speed_m_per_s,
                );
                of.quantity(self.known, &found, self.refuted(of.part).as_deref())
            }
        }
    }

    fn best(&self) -> Option<BestValues> {
        let x = &self.vehicle.as_ref().ok()?.parameters;
        let Physical {
            m,
            i,
            l_f,
            l_r,
            k_f,
            k_r,
            k_t,
            ..
        } = Physical::of(self.known, x);
        let column = self
            .column
            .as_ref()
            .ok()
            .filter(|_| self.refuted(Part::Column).is_none());
        let column = column.map(|fit| BestColumn {
            j_s: fit.parameters[P::J_S].exp(),
            b_s: fit.parameters[P::B_S].exp(),
            friction_nm: fit.parameters[P::FRICTION].max(0.0),
            k_aln: Physical::of(self.known, &fit.parameters).aligning_stiffness(),
        });
        Some(BestValues {
            m,
            i,
            l_f,
            l_r,
            k_f,
            k_r,
            k_t,
            column,
        })
    }
}

fn assumed(known: &Known) -> Vec<String> {
    let mut all = vec![
        "mass and wheelbase are exact; a mass that is 5 % too large makes tyres, aligning stiffness and inertias of the vehicle as much too large".to_owned(),
        "the gyroscope shows at most 0.004 rad/s on a straight, and the road's camber is level in the mean: together they bound the angle's offset".to_owned(),
        "tyres answer in proportion to slip up to 4 m/s2; the trail may fall with side force".to_owned(),
        "signals are recorded at one instant: yaw rate and angle within 0.02 s, angle and torques within 0.01 s".to_owned(),
        "dry friction gives way at 0.2 degrees of the wheel".to_owned(),
    ];
    if known.l_f_m.is_none() {
        all.push(
            "l_f is 0.35 to 0.55 of the wheelbase (an axle's load gives it: l_f = wheelbase*rear/mass)"
                .to_owned(),
        );
    }
    if known.yaw_inertia_kg_m2.is_none() {
        all.push("the yaw inertia is 0.6 to 2 times m*l_f*l_r".to_owned());
    }
    if known.steering_ratio.is_none() {
        all.push("the steering ratio is 10 to 26".to_owned());
    }
    all
}
