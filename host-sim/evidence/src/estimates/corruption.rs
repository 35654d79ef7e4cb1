//! The ways to corrupt a log.

use haptic_analysis::identify::DriveLog;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

use super::kinds::{Drawn, Kind};
use haptic_batch::experiment::ExperimentPlan;
use haptic_sim::participants::PublishedDriver;

/// One way to corrupt a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Corruption {
    /// One sample of e_theta is off by 0.05 rad.
    Outlier,
    /// White noise on e_y, m, and e_theta, rad; a value stays for so many rows.
    LaneNoise(f64, f64, usize),
    /// e_theta in steps, rad.
    Steps(f64),
    /// So many single samples of e_y and e_theta are zero.
    ZeroSamples(usize),
    /// e_y and e_theta are zero for so long, s.
    ZeroFor(f64),
    /// T_d is nothing but noise, N.m.
    TorqueNoise(f64),
    /// T_d is zero for so long, s.
    HandsOff(f64),
    /// For so long, s, the car stands with the wheel askew.
    Parked(f64),
    /// T_d times a factor.
    TorqueScale(f64),
    /// T_d is late, s.
    TorqueLate(f64),
    /// T_h is late, s.
    GuidanceLate(f64),
    /// The sign of T_d is swapped.
    TorqueSign,
    /// The sign of T_h is swapped.
    GuidanceSign,
    /// The sign of the wheel angle is swapped.
    WheelSign,
    /// The signs of e_y and e_theta are swapped.
    LaneSign,
    /// The drive is said to be a manual one.
    CalledManual,
    /// T_d holds T_h.
    SumOfTorques,
    /// The driver's t_nms, s, where 0.1 is assumed.
    OtherMuscle(f64),
    /// The driver changes.
    Driver(Kind),
}

/// Ways with their names, a line each.
macro_rules! population {
    ($($name:literal [$($way:ident$(($($of:expr),*))?),*];)*) => {
        [$(($name, &[$(Corruption::$way$(($($of),*))?),*])),*]
    };
}

/// The ways of the population with their names: each alone, then mixtures.
pub const POPULATION: [(&str, &[Corruption]); 34] = population! {
    "clean" [];
    "one e_theta sample off by 0.05 rad" [Outlier];
    "lane noise 5 mm, 0.5 mrad" [LaneNoise(5e-3, 5e-4, 1)];
    "lane noise 10 mm, 1 mrad" [LaneNoise(1e-2, 1e-3, 1)];
    "lane noise 30 mm, 5 mrad at 30 Hz" [LaneNoise(3e-2, 5e-3, 4)];
    "e_theta in steps of 2 mrad" [Steps(2e-3)];
    "five lane samples zero" [ZeroSamples(5)];
    "lane zero for 0.1 s" [ZeroFor(0.1)];
    "lane zero for 2 s" [ZeroFor(2.0)];
    "T_d is noise" [TorqueNoise(0.2)];
    "hands off for 30 s" [HandsOff(30.0)];
    "parked for 20 s, wheel askew" [Parked(20.0)];
    "T_d at half scale" [TorqueScale(0.5)];
    "T_d 50 ms late" [TorqueLate(0.05)];
    "T_h 8 ms late" [GuidanceLate(0.008)];
    "sign of T_d" [TorqueSign];
    "sign of T_h" [GuidanceSign];
    "sign of the wheel angle" [WheelSign];
    "signs of the lane" [LaneSign];
    "guided, called manual" [CalledManual];
    "T_d is T_d + T_h" [SumOfTorques];
    "t_nms 0.15 s" [OtherMuscle(0.15)];
    "t_nms 0.06 s" [OtherMuscle(0.06)];
    "noise 10 mm, outlier, five zeros" [LaneNoise(1e-2, 1e-3, 1), Outlier, ZeroSamples(5)];
    "noise 10 mm, hands off, zero for 2 s" [LaneNoise(1e-2, 1e-3, 1), HandsOff(30.0), ZeroFor(2.0)];
    "noise 5 mm, parked" [LaneNoise(5e-3, 5e-4, 1), Parked(20.0)];
    "noise 30 mm at 30 Hz, T_h 8 ms late" [LaneNoise(3e-2, 5e-3, 4), GuidanceLate(0.008)];
    "steps, outlier, hands off" [Steps(2e-3), Outlier, HandsOff(30.0)];
    "noise 10 mm, t_nms 0.15 s" [LaneNoise(1e-2, 1e-3, 1), OtherMuscle(0.15)];
    "K_hg steps by 0.5" [Driver(Kind::KHgSteps(0.5))];
    "K_hg drifts by 0.5 in 60 s" [Driver(Kind::KHgDrifts(0.5))];
    "K_d steps by half" [Driver(Kind::KDSteps)];
    "t_p steps from 0.1 to 0.3 s" [Driver(Kind::TPSteps)];
    "noise 10 mm, K_hg steps by 0.5" [LaneNoise(1e-2, 1e-3, 1), Driver(Kind::KHgSteps(0.5))];
};

/// The drive in which the driver changes, if one of the ways is that; the same for the same plan and participant.
pub(super) fn changing(
    ways: &[Corruption],
    truth: &PublishedDriver,
    plan: &ExperimentPlan,
    number: u32,
) -> Option<Drawn> {
    let mut random = random_of(plan, number);
    ways.iter().find_map(|way| match way {
        Corruption::Driver(kind) => Some(kind.drawn(truth, &mut random)),
        _ => None,
    })
}

/// What is drawn by chance of a participant's drive; the same for the same plan.
pub(super) fn random_of(plan: &ExperimentPlan, number: u32) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(plan.seed.wrapping_mul(100).wrapping_add(u64::from(number)))
}

/// `log` as these ways leave it; the same for the same plan and participant.
pub(super) fn corrupted_log(
    log: &DriveLog,
    ways: &[Corruption],
    plan: &ExperimentPlan,
    number: u32,
) -> DriveLog {
    let mut random = random_of(plan, number);
    let mut log = log.clone();
    for way in ways {
        corrupt(&mut log, *way, &mut random);
    }
    log
}

/// Rows at either end that are never corrupted by what happens once: 8 s.
const MARGIN: usize = 1000;

fn corrupt(log: &mut DriveLog, way: Corruption, random: &mut Xoshiro256PlusPlus) {
    let n = log.len();
    let rows = |s: f64| (s / log.dt_s).round() as usize;
    match way {
        Corruption::Outlier => log.e_theta_rad[random.random_range(MARGIN..n - MARGIN)] += 0.05,
        Corruption::LaneNoise(e_y, e_theta, hold) => {
            noise(&mut log.e_y_m, e_y, hold, random);
            noise(&mut log.e_theta_rad, e_theta, hold, random);
        }
        Corruption::Steps(step) => log
            .e_theta_rad
            .iter_mut()
            .for_each(|x| *x = (*x / step).round() * step),
        Corruption::ZeroSamples(count) => {
            for _ in 0..count {
                let k = random.random_range(MARGIN..n - MARGIN);
                (log.e_y_m[k], log.e_theta_rad[k]) = (0.0, 0.0);
            }
        }
        Corruption::ZeroFor(s) => {
            let k = random.random_range(MARGIN..n - MARGIN - rows(s));
            let end = k + rows(s);
            log.e_y_m[k..end].fill(0.0);
            log.e_theta_rad[k..end].fill(0.0);
        }
        Corruption::TorqueNoise(sd) => {
            log.driver_torque_nm.fill(0.0);
            noise(&mut log.driver_torque_nm, sd, 1, random);
        }
        Corruption::HandsOff(s) => {
            let k = random.random_range(MARGIN..n - MARGIN - rows(s));
            for x in &mut log.driver_torque_nm[k..k + (s / log.dt_s) as usize] {
                // A step of the torque sensor down, none, or one up.
                *x = 0.005 * f64::from(random.random_range(-1..2));
            }
        }
        Corruption::Parked(s) => {
            let k = random.random_range(MARGIN..n - MARGIN);
            let rows = rows(s);
            let insert =
                |u: &mut Vec<f64>, value: f64| drop(u.splice(k..k, std::iter::repeat_n(value, rows)));
            let (e_y, e_theta) = (log.e_y_m[k], log.e_theta_rad[k]);
            insert(&mut log.e_y_m, e_y);
            insert(&mut log.e_theta_rad, e_theta);
            insert(&mut log.wheel_angle_rad, 0.3);
            insert(&mut log.guidance_torque_nm, 0.0);
            insert(&mut log.driver_torque_nm, 0.0);
        }
        Corruption::TorqueScale(factor) => log.driver_torque_nm.iter_mut().for_each(|x| *x *= factor),
        Corruption::TorqueLate(s) => delay(&mut log.driver_torque_nm, s / log.dt_s),
        Corruption::GuidanceLate(s) => delay(&mut log.guidance_torque_nm, s / log.dt_s),
        Corruption::TorqueSign => log.driver_torque_nm.iter_mut().for_each(|x| *x = -*x),
        Corruption::GuidanceSign => log.guidance_torque_nm.iter_mut().for_each(|x| *x = -*x),
        Corruption::WheelSign => log.wheel_angle_rad.iter_mut().for_each(|x| *x = -*x),
        Corruption::LaneSign => {
            let lane = log.e_y_m.iter_mut().chain(&mut log.e_theta_rad);
            lane.for_each(|x| *x = -*x);
        }
        Corruption::SumOfTorques => {
            for (x, h) in log.driver_torque_nm.iter_mut().zip(&log.guidance_torque_nm) {
                *x += h;
            }
        }
        // Not in the log: in what is said of it, or in the driver.
        Corruption::CalledManual | Corruption::OtherMuscle(_) | Corruption::Driver(_) => {}
    }
}

pub(super) fn noise(signal: &mut [f64], sd: f64, hold: usize, random: &mut Xoshiro256PlusPlus) {
    let Ok(normal) = Normal::new(0.0, sd) else { return };
    let mut held = 0.0;
    for (k, x) in signal.iter_mut().enumerate() {
        if k % hold == 0 {
            held = *x + normal.sample(random);
        }
        *x = held;
    }
}

pub(super) fn delay(signal: &mut [f64], rows: f64) {
    let original = signal.to_vec();
    for (k, x) in signal.iter_mut().enumerate() {
        let place = (k as f64 - rows).max(0.0);
        let whole = place as usize;
        *x = original[whole]
            + place.fract() * (original[(whole + 1).min(original.len() - 1)] - original[whole]);
    }
}
