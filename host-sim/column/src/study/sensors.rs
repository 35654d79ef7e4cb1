//! What a sensor has to deliver: how late and how wrong the observer of core tells the torque of the hands, by the steps and
//! the rate of the angle's sensor, the observer's bandwidth, and what is believed of J_w and K_tb.
//!
//! The car has the file's assist, or the medium one, and goes at 60 km/h; its angle is the column's. In the first half the hands steer with
//! [`HANDS_NM`] at 0.4 Hz and half of it at 1.1 Hz while the guidance moves the column; in the second nobody holds the wheel.

use std::f64::consts::TAU;

use haptic_core::controller::config::{Config, hands_lag_s};
use haptic_core::controller::params::Params;
use haptic_core::observer::State;
use haptic_core::quantity::{Radians, Torque};
use haptic_engine::StudyError;
use haptic_sim::parts::{Acting, Vehicle};
use haptic_sim::scenario::ScenarioError;
use serde::Serialize;

use super::{ColumnFile, Rate, believed, ecu, hands_torque, no_observer, rms};

/// Steps of the angle's sensor, degrees.
pub const STEPS_DEG: [f64; 3] = [0.005, 0.02, 0.1];
/// Rates of the angle's sensor.
pub const RATES: [Rate; 2] = [Rate::EveryStep, Rate::Camera];
/// Bandwidths of the observer, rad/s.
pub const BANDWIDTHS: [f64; 6] = [10.0, 20.0, 30.0, 60.0, 100.0, 214.0];
/// How hard the hands steer, N.m.
pub const HANDS_NM: f64 = 1.5;
/// How far J_w is believed wrong.
pub const WRONG_J_W: f64 = 0.3;
/// How far K_tb is believed wrong.
pub const WRONG_K_TB: f64 = 0.1;
/// Steps of each half, and those at its beginning that nothing is judged by.
const HALF: usize = 20_000;
const SETTLES: usize = 2_000;

/// An observer with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Row {
    /// Step of the angle, degrees.
    pub step_deg: f64,
    /// How often it comes.
    pub rate: Rate,
    /// Bandwidth, rad/s.
    pub bandwidth: f64,
    /// How late it is, ms.
    pub lag_ms: f64,
    /// Deviation of the estimate from the hands' torque of so long ago, with what is believed right, N.m.
    pub error_nm: f64,
    /// The larger of those for J_w 30 % too low and too high, N.m.
    pub wrong_j_w_nm: f64,
    /// The larger of those for K_tb 10 % too low and too high, N.m.
    pub wrong_k_tb_nm: f64,
    /// What it says where nobody holds the wheel: root of the mean square, N.m.
    pub no_hand_nm: f64,
}

/// What came of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// The assist.
    pub curve: &'static str,
    /// What the bar's sensor itself is off by, N.m: its own reading taken for the hands', without any lag.
    pub bar_alone_nm: f64,
    /// What the bar's sensor says where nobody holds the wheel, N.m.
    pub bar_no_hand_nm: f64,
    /// By step, rate and bandwidth.
    pub rows: Vec<Row>,
    /// The ECU behind the bar, by what it believes of it.
    pub ecu: Vec<ecu::Row>,
}

impl Results {
    /// The bandwidth with the least deviation for each sensor, with what is believed right.
    pub fn best(&self) -> Vec<&Row> {
        let sensors = RATES
            .into_iter()
            .flat_map(|rate| STEPS_DEG.map(|step| (rate, step)));
        let of = |(rate, step): (Rate, f64)| {
            let own = self
                .rows
                .iter()
                .filter(move |row| row.rate == rate && row.step_deg == step);
            own.min_by(|a, b| a.error_nm.total_cmp(&b.error_nm))
        };
        sensors.filter_map(of).collect()
    }
}

/// What was seen in a millisecond.
struct Seen {
    hands_nm: f64,
    bar_nm: f64,
    column_rad: f64,
}

fn record(file: &ColumnFile, is_held: bool) -> Result<Vec<Seen>, ScenarioError> {
    let mut plant = file.plant()?.with_assist(file.one_curve().1.assist());
    let mut seen = Vec::with_capacity(HALF);
    for k in 0..HALF {
        let t = 1e-3 * k as f64;
        let hands_nm = if is_held {
            HANDS_NM * ((TAU * 0.4 * t).sin() + 0.5 * (TAU * 1.1 * t).sin())
        } else {
            0.0
        };
        // A guidance that steers slowly, and its probe.
        let guidance_nm = 0.5 * (TAU * 0.2 * t).sin() + 0.2 * (TAU * 3.0 * t).sin();
        seen.push(Seen {
            hands_nm,
            bar_nm: plant.sensor_torque_nm(),
            column_rad: plant.column_angle_rad(),
        });
        plant.step(&Acting {
            driver_torque_nm: hands_nm,
            guidance_torque_nm: guidance_nm,
            speed_m_per_s: [60.0 / 3.6; 2],
            bank_rad: 0.0,
        });
    }
    Ok(seen)
}

/// What an observer says of a record, less the hands' torque of its lag ago: root of the mean square, N.m.
fn deviation(of: &Params, seen: &[Seen], step_deg: f64, rate: Rate) -> Result<f64, StudyError> {
    let config = Config::new(of).map_err(no_observer)?;
    let (mut state, step_rad) = (State::NEW, step_deg.to_radians());
    let lag = 1e3 * hands_lag_s(of);
    let (whole, rest) = (lag.floor() as usize, lag.fract());
    let errors = seen.iter().enumerate().map(|(k, now)| {
        let is_sampled = rate.samples(k as u32);
        let angle = is_sampled.then(|| Radians::from_rad((now.column_rad / step_rad).round() * step_rad));
        let bar_torque = Torque::from_nm(now.bar_nm);
        let found = hands_torque(&config, &mut state, bar_torque, angle);
        let ago = |steps: usize| k.checked_sub(steps).map_or(0.0, |at| seen[at].hands_nm);
        found.nm() - ((1.0 - rest) * ago(whole) + rest * ago(whole + 1))
    });
    let errors: Vec<f64> = errors.collect();
    Ok(rms(errors.into_iter().skip(SETTLES)))
}

/// Sets every observer before every sensor.
///
/// # Errors
/// A column that cannot be.
pub fn run(file: &ColumnFile) -> Result<Results, StudyError> {
    let [held, free] = [record(file, true)?, record(file, false)?];
    let mut rows = Vec::new();
    for rate in RATES {
        for step_deg in STEPS_DEG {
            for bandwidth in BANDWIDTHS.into_iter().filter(|w| *w <= rate.hz()) {
                let right = believed(file, 1.0 / rate.hz(), bandwidth);
                let error = |of: Params| deviation(&of, &held, step_deg, rate);
                let wrong = |change: &dyn Fn(f64) -> Params, by: f64| {
                    Ok::<_, StudyError>(error(change(1.0 - by))?.max(error(change(1.0 + by))?))
                };
                rows.push(Row {
                    step_deg,
                    rate,
                    bandwidth,
                    lag_ms: 1e3 * hands_lag_s(&right),
                    error_nm: error(right)?,
                    wrong_j_w_nm: wrong(
                        &|share| Params {
                            wheel_inertia_kg_m2: share * right.wheel_inertia_kg_m2,
                            ..right
                        },
                        WRONG_J_W,
                    )?,
                    wrong_k_tb_nm: wrong(
                        &|share| Params {
                            bar_stiffness_nm_per_rad: share * right.bar_stiffness_nm_per_rad,
                            ..right
                        },
                        WRONG_K_TB,
                    )?,
                    no_hand_nm: deviation(&right, &free, step_deg, rate)?,
                });
            }
        }
    }
    let bar = |seen: &[Seen]| rms(seen.iter().skip(SETTLES).map(|now| now.bar_nm - now.hands_nm));
    Ok(Results {
        curve: file.one_curve().0,
        bar_alone_nm: bar(&held),
        bar_no_hand_nm: bar(&free),
        rows,
        ecu: ecu::run(file)?,
    })
}
