//! How often the 95 % intervals of `identify-vehicle` hold the truth, on simulated drives of vehicles that nothing was tuned on.

use haptic_log::trace::Trace;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::nonlinear::{Tyres, WorldParameters};
use haptic_sim::models::road::Course;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::{Condition, Scenario, Speed};
use haptic_sim::share::wilson;
use haptic_sim::simulation::simulate;
use haptic_vehicle::{Known, VehicleColumns, VehicleLog, Verdict, identify_vehicle};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use serde::Serialize;

use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, each};

/// CommonRoad's vehicles 1 to 3 (a Ford Escort, a BMW 320i, a VW Vanagon): mass, yaw inertia, l_f, l_r; their tyres give 21.92 times
/// their load per radian. Columns, ratios and frictions are ours: inertia, damping, trail, ratio, friction.
const CARS: [(&str, [f64; 4], [f64; 5]); 3] = [
    (
        "escort",
        [1225.89, 1538.85, 0.883_92, 1.508_76],
        [0.08, 0.4, 0.03, 20.0, 0.15],
    ),
    (
        "bmw-320i",
        [1093.30, 1791.60, 1.156_20, 1.422_72],
        [0.11, 0.6, 0.026, 16.0, 0.3],
    ),
    (
        "vanagon",
        [1478.90, 2473.12, 1.150_79, 1.321_14],
        [0.16, 0.9, 0.035, 18.0, 0.45],
    ),
];
const STIFFNESS_PER_LOAD: f64 = 21.92;
const GRAVITY_M_PER_S2: f64 = 9.81;
/// Every other sample of a run.
const EVERY: usize = 2;
/// Resolution of the angle sensor, rad: 0.1 degrees.
const ANGLE_STEP_RAD: f64 = 0.001_745_329_251_994_33;
const TORQUE_STEP_NM: f64 = 0.005;
const TORQUE_NOISE_NM: f64 = 0.02;
const YAW_NOISE_RAD_S: f64 = 0.002;

/// What the sensors add, to one side or to the other.
const ANGLE_OFFSET_RAD: f64 = 0.02;
const YAW_OFFSET_RAD_S: f64 = 0.001;
const TORQUE_OFFSET_NM: f64 = 0.1;

/// One quantity in one world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Covered {
    /// What the world is like.
    pub world: &'static str,
    /// The quantity.
    pub name: &'static str,
    /// Drives.
    pub drives: usize,
    /// Drives in which it is identified.
    pub identified: usize,
    /// Identified ones whose 95 % interval holds the truth.
    pub covered: usize,
    /// Share of the identified ones whose interval holds the truth, with its 95 % interval.
    pub coverage: Option<(f64, [f64; 2])>,
    /// Root of the mean square of what the identified ones miss: as a share of the truth, or in the unit where the truth may be 0.
    pub rms_error: f64,
    /// What `rms_error` is in: 1 for a share.
    pub unit: &'static str,
}

/// How often intervals hold the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VehicleCoverage {
    /// Drives in each world.
    pub drives: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Drives in which a check of one of the fits was broken, by world; none should be.
    pub refuted: Vec<(&'static str, usize)>,
    /// The rows.
    pub rows: Vec<Covered>,
}

/// Values that a truth of zero allows.
const PLAIN: [(&str, &str); 4] = [
    ("wheel_angle_offset", "rad"),
    ("understeer_gradient", "rad.s2/m"),
    ("friction", "N.m"),
    ("torque_offset", "N.m"),
];

fn car([m, i, l_f, l_r]: [f64; 4], [j_s, b_s, e_t, ratio, _]: [f64; 5]) -> VehicleParameters {
    // Half an axle's, for the vehicle has it by tyre; an axle's load is by the distance of the other one.
    let stiffness = |other: f64| 0.5 * STIFFNESS_PER_LOAD * m * GRAVITY_M_PER_S2 * other / (l_f + l_r);
    VehicleParameters {
        m,
        i,
        l_f,
        l_r,
        k_f: stiffness(l_r),
        k_r: stiffness(l_f),
        e_t,
        b_s,
        j_s,
        k_t: 1.0 / ratio,
        ..VehicleParameters::default()
    }
}

/// The worlds: the paper's plant; saturating tyres and dry friction; these in gusts and with a motor that lags, which the model does not know.
const WORLDS: [&str; 3] = ["linear", "nonlinear", "disturbed"];

fn world(name: &str, friction_nm: f64) -> WorldParameters {
    if name == "linear" {
        return WorldParameters::default();
    }
    let disturbed = name == "disturbed";
    WorldParameters {
        tyres: Tyres::Saturating,
        friction_nm,
        motor_lag_s: if disturbed { 0.005 } else { 0.0 },
        gust_sd_n: if disturbed { 100.0 } else { 0.0 },
        ..WorldParameters::default()
    }
}

/// Three times a left and a right bend of 333 m, 2 km in all.
const BENDS: usize = 3;

fn course() -> Result<Course, StudyError> {
    let piece = |length_m: f64, from: f64, to: f64| {
        format!(
            "[[segment]]\nlength_m = {length_m}\ncurvature_start_per_m = {from}\ncurvature_end_per_m = {to}\n"
        )
    };
    let bend = |k: f64| {
        [
            piece(100.0, 0.0, 0.0),
            piece(60.0, 0.0, k),
            piece(120.0, k, k),
            piece(60.0, k, 0.0),
        ]
        .concat()
    };
    let text = [bend(0.003), bend(-0.003)].concat().repeat(BENDS);
    Ok(Course::from_toml("bends", &text)?)
}

/// A drive through bends at 40 to 90 km/h with the probe, by a driver with a remnant.
fn scenario(vehicle: VehicleParameters, world: WorldParameters, seed: u64) -> Result<Scenario, StudyError> {
    let driver = DriverParameters {
        remnant_sd_nm: 0.4,
        remnant_corner_hz: 1.0,
        ..DriverParameters::default()
    };
    let builder = Scenario::builder()
        .condition(Condition::Mid)
        .driver(driver)
        .vehicle(vehicle)
        .world(world);
    let speed = Speed::by_time_kmh(vec![0.0, 10.0, 40.0, 70.0, 90.0], &[40.0, 40.0, 90.0, 60.0, 80.0]);
    Ok(builder
        .course(course()?)
        .speed(speed)
        .probe(true)
        .seed(seed)
        .build()?)
}

/// What sensors make of a run, to the side that `side` says: quantised, with offsets and noise.
fn recorded(trace: &Trace, seed: u64, side: f64) -> VehicleColumns {
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut noise = |sd: f64| sd * generator.sample::<f64, _>(StandardNormal);
    let steps = |value: f64, step: f64| (value / step).round() * step;
    let mut columns = VehicleColumns::default();
    let (mut driver, mut guidance) = (Vec::new(), Vec::new());
    for sample in trace.samples.iter().step_by(EVERY) {
        columns.time_s.push(sample.time_s);
        let angle = side * sample.wheel_angle_rad + side * ANGLE_OFFSET_RAD;
        columns.wheel_angle_rad.push(steps(angle, ANGLE_STEP_RAD));
        let yaw_rate = side * (sample.yaw_rate_rad_per_s + YAW_OFFSET_RAD_S);
        columns.yaw_rate_rad_per_s.push(yaw_rate + noise(YAW_NOISE_RAD_S));
        columns.speed_m_per_s.push(sample.speed_m_per_s);
        let torque = side * (sample.driver_torque_nm + TORQUE_OFFSET_NM) + noise(TORQUE_NOISE_NM);
        driver.push(steps(torque, TORQUE_STEP_NM));
        guidance.push(side * sample.guidance_torque_nm);
    }
    columns.driver_torque_nm = Some(driver);
    columns.guidance_torque_nm = Some(guidance);
    columns
}

fn truths(
    vehicle: &VehicleParameters,
    friction_nm: f64,
    side: f64,
    mean_speed: f64,
) -> Vec<(&'static str, f64)> {
    let steady = vehicle.steady_cornering();
    let l = vehicle.l_f + vehicle.l_r;
    let factor = 1.0 + steady.stability_factor_s2_per_m2 * mean_speed * mean_speed;
    vec![
        ("yaw_rate_gain", mean_speed * vehicle.k_t / l / factor),
        ("steering_ratio", 1.0 / vehicle.k_t),
        ("wheel_angle_offset", side * ANGLE_OFFSET_RAD),
        ("understeer_gradient", l * steady.stability_factor_s2_per_m2),
        (
            "yaw_time",
            mean_speed * vehicle.i / (2.0 * l * vehicle.l_f * vehicle.k_f),
        ),
        ("k_f", vehicle.k_f),
        ("k_r", vehicle.k_r),
        ("i", vehicle.i),
        ("l_f", vehicle.l_f),
        ("j_s", vehicle.j_s),
        ("b_s", vehicle.b_s),
        ("friction", friction_nm),
        ("aligning_gain", steady.aligning_gain_nm_s2_per_m),
        ("k_aln", vehicle.aligning_stiffness()),
        ("torque_offset", side * TORQUE_OFFSET_NM),
    ]
}

/// A quantity of one drive: what it misses, and whether the interval holds the truth; none where it is not identified.
type Told = (&'static str, Option<(f64, bool)>);

/// A drive of one of the vehicles to one of the sides. Every other six are told l_f and the yaw inertia too.
fn drive(world_name: &str, seed: u64) -> Result<(Vec<Told>, bool), StudyError> {
    let (_, chassis, column) = CARS[(seed % 3) as usize];
    let side = if (seed / 3).is_multiple_of(2) { 1.0 } else { -1.0 };
    let weighed = seed / 6 % 2 == 1;
    let vehicle = car(chassis, column);
    let friction_nm = if world_name == "linear" { 0.0 } else { column[4] };
    let scenario = scenario(vehicle, world(world_name, friction_nm), seed)?;
    let columns = recorded(&simulate(&scenario).trace, seed, side);
    let l = vehicle.l_f + vehicle.l_r;
    let known = Known {
        l_f_m: weighed.then_some(vehicle.l_f),
        yaw_inertia_kg_m2: weighed.then_some(vehicle.i),
        ..Known::new(vehicle.m, l)?
    };
    let log = VehicleLog::new(&columns, l)?;
    let found = identify_vehicle(&log, &known);
    let told = |(name, truth): (&'static str, f64)| {
        let scale = if PLAIN.iter().any(|plain| plain.0 == name) {
            1.0
        } else {
            truth
        };
        let quantity = found
            .quantities
            .iter()
            .find(|q| q.name == name && q.verdict == Verdict::Identified);
        let missed = quantity.and_then(|q| {
            let [low, high] = q.interval_95?;
            Some(((q.estimate? - truth) / scale, (low..=high).contains(&truth)))
        });
        (name, missed)
    };
    let truths = truths(&vehicle, friction_nm, side, found.mean_speed_m_per_s);
    Ok((
        truths.into_iter().map(told).collect(),
        found.checks.iter().any(|check| !check.holds),
    ))
}

/// Drives so many times in every world, with seeds from `seed` on.
///
/// # Errors
/// A drive that cannot be.
pub fn coverage(drives: u64, seed: u64, watch: &Watch<'_>) -> Result<VehicleCoverage, StudyError> {
    // Vehicle, side and what is known follow from the seed: twelve drives are one of each.
    let seed = seed - seed % 12;
    let mut coverage = VehicleCoverage {
        drives,
        seed,
        refuted: Vec::new(),
        rows: Vec::new(),
    };
    for world in WORLDS {
        let seeds: Vec<u64> = (seed..seed + drives).collect();
        let all = each(&seeds, watch, |seed| drive(world, *seed))?;
        let (told, refuted): (Vec<_>, Vec<bool>) = all.into_iter().unzip();
        coverage
            .refuted
            .push((world, refuted.into_iter().filter(|refuted| *refuted).count()));
        let count = told.first().map_or(0, Vec::len);
        coverage.rows.extend((0..count).map(|of| row(world, &told, of)));
    }
    Ok(coverage)
}

fn row(world: &'static str, told: &[Vec<Told>], of: usize) -> Covered {
    let name = told[0][of].0;
    let identified: Vec<(f64, bool)> = told.iter().filter_map(|drive| drive[of].1).collect();
    let (count, covered) = (identified.len(), identified.iter().filter(|one| one.1).count());
    let share = covered as f64 / count.max(1) as f64;
    let squares: f64 = identified.iter().map(|(missed, _)| missed * missed).sum();
    Covered {
        world,
        name,
        drives: told.len(),
        identified: count,
        covered,
        coverage: (count > 0).then(|| (share, wilson(share, count as f64))),
        rms_error: (squares / count.max(1) as f64).sqrt(),
        unit: PLAIN
            .iter()
            .find(|plain| plain.0 == name)
            .map_or("1", |plain| plain.1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CommonRoad's vehicles, each in four drives of each world, two to each side: identified values are right within 4 % or 0.02 N.m.
    #[test]
    fn a_simulated_drive_tells_its_vehicle() {
        let rows = coverage(12, 1, &Watch::nobody()).unwrap().rows;
        let told =
            |world: &str, name: &str| rows.iter().find(|r| r.world == world && r.name == name).unwrap();
        for (world, most) in [("linear", 0.04), ("nonlinear", 0.04)] {
            for name in [
                "steering_ratio",
                "yaw_rate_gain",
                "j_s",
                "b_s",
                "aligning_gain",
                "k_aln",
                "yaw_time",
            ] {
                let row = told(world, name);
                assert!(row.identified >= 10 && row.rms_error < most, "{row:?}");
            }
            let friction = told(world, "friction");
            assert!(
                friction.identified >= 10 && friction.rms_error < 0.02,
                "{friction:?}"
            );
            // Tyres need the yaw inertia, which half of the drives are given.
            let tyres = told(world, "k_f");
            assert!(tyres.identified == 6 && tyres.rms_error < 0.04, "{tyres:?}");
        }
    }
}
