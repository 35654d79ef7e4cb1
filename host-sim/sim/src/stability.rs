//! Whether a driver keeps a lane at a speed, alone or with guidance: the closed loop's slowest motion, from its equations.
//!
//! Vehicle, column, arm, vision and guidance on a straight are linear but for the driver's delay, which is taken as a
//! rational function of the third order (Pade), good to a phase of some degrees up to t_p*w = 3. The rates of the
//! guidance go through their low-pass; that the camera looks 120 times a second is left out. What the largest real part of
//! an eigenvalue says is the growth: an error changes by a factor e in the time of its reciprocal.
//!
//! Not here: limits, friction, tyres that slide. They need a simulation.

use nalgebra::{DMatrix, DVector};

use crate::models::driver::{ArmGains, DriverParameters};
use crate::models::plant::{ARM, BETA, WHEEL, WHEEL_RATE, YAW, YAW_RATE};
use crate::models::vehicle::VehicleParameters;
use haptic_core::controller::params::Params;

/// Who guides, for the loop: the law's parameters and the look-ahead times of its near point.
#[derive(Debug, Clone, Copy)]
pub struct Guided<'a> {
    /// The law's gains and corner.
    pub law: &'a Params,
    /// t'_n, s.
    pub t_n: f64,
}

// Behind the states of the plant.
const OFFSET: usize = 6;
const INTEGRAL: usize = 7;
/// Three states of the delay.
const DELAY: usize = 8;
/// Two of the rates' low-pass.
const RATES: usize = 11;
const STATES: usize = 13;

/// Rows of a loop under way: each a sum of states.
type Sum = DVector<f64>;

fn state(index: usize) -> Sum {
    let mut sum = Sum::zeros(STATES);
    sum[index] = 1.0;
    sum
}

/// The share of the law's torque at a speed: two lines through all of it at 60 km/h, to those of the parameters at 20 and
/// 130 km/h.
pub fn share(law: &Params, v_m_per_s: f64) -> f64 {
    let kmh = (v_m_per_s * 3.6).clamp(20.0, 130.0);
    if kmh < 60.0 {
        1.0 - (1.0 - law.low_speed_share) * (60.0 - kmh) / 40.0
    } else {
        1.0 - (1.0 - law.high_speed_share) * (kmh - 60.0) / 70.0
    }
}

/// The growth of the slowest motion, 1/s: below zero the loop is stable.
pub fn growth_per_s(
    v_m_per_s: f64,
    vehicle: &VehicleParameters,
    driver: &DriverParameters,
    gains: ArmGains,
    guided: Option<Guided<'_>>,
) -> f64 {
    let v = v_m_per_s;
    let mut a = DMatrix::<f64>::zeros(STATES, STATES);
    let mut row = |index: usize, sum: Sum| a.set_row(index, &sum.transpose());
    let [beta, r, phi, rate, arm, y] = [BETA, YAW_RATE, WHEEL, WHEEL_RATE, ARM, OFFSET].map(state);
    let direction = state(YAW) + &beta;
    let k_aln = vehicle.aligning_stiffness();
    let front_slip = vehicle.k_t * &phi - &beta - vehicle.l_f / v * &r;
    let rear_slip = vehicle.l_r / v * &r - &beta;
    let (front, rear) = (2.0 * vehicle.k_f * &front_slip, 2.0 * vehicle.k_r * rear_slip);
    row(BETA, (&front + &rear) / (vehicle.m * v) - &r);
    row(YAW_RATE, (vehicle.l_f * &front - vehicle.l_r * &rear) / vehicle.i);
    row(WHEEL, rate.clone());
    row(YAW, r.clone());
    row(OFFSET, v * &direction);
    let near = |t_n: f64| -(&y + v * t_n * &direction);
    let e_y = near(driver.t_n);
    row(INTEGRAL, e_y.clone());
    let wanted = driver.a_1 * &e_y + driver.a_2 * state(INTEGRAL) - driver.a_3 * &direction;
    // exp(-s*t) = (120 - 60*s*t + 12*(s*t)^2 - (s*t)^3) / (120 + 60*s*t + 12*(s*t)^2 + (s*t)^3), as a chain of
    // integrators: what comes out is minus the input and 24*x3 + 240*x1 in units of t.
    let t = driver.t_p;
    let [x1, x2, x3] = [0, 1, 2].map(|n| state(DELAY + n));
    row(DELAY, &x2 / t);
    row(DELAY + 1, &x3 / t);
    row(DELAY + 2, (&wanted - 120.0 * &x1 - 60.0 * &x2 - 12.0 * &x3) / t);
    let target = 240.0 * &x1 + 24.0 * &x3 - &wanted;
    let mut torque = Sum::zeros(STATES);
    if let Some(Guided { law, t_n }) = guided {
        let corner = std::f64::consts::TAU * law.rate_corner_hz;
        let errors = [near(t_n), -&direction];
        let k_1 = law.k_1 * share(law, v);
        let gains = [[law.a_1, law.a_2], [law.a_3, law.a_4]];
        for (n, (error, [on_error, on_rate])) in errors.iter().zip(gains).enumerate() {
            let filtered = corner * (error - state(RATES + n));
            torque += k_1 * (on_error * error + on_rate * &filtered);
            row(RATES + n, filtered);
        }
    } else {
        // States that nothing drives and that die away at once.
        row(RATES, -1e3 * state(RATES));
        row(RATES + 1, -1e3 * state(RATES + 1));
    }
    row(
        WHEEL_RATE,
        (&arm + &torque - k_aln * &front_slip - vehicle.b_s * &rate) / vehicle.j_s,
    );
    let asked = gains.k_d * &target + driver.k_nms * (&target - &phi) - gains.k_hg * &torque;
    row(ARM, (asked - &arm) / driver.t_nms);
    if driver.a_2 == 0.0 {
        // An integral that nobody looks at.
        a = a.remove_row(INTEGRAL).remove_column(INTEGRAL);
    }
    let roots = a.complex_eigenvalues();
    roots.iter().map(|root| root.re).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::road::{Course, DEFAULT_LANE_WIDTH_M, Segment};
    use crate::scenario::{Condition, GuidanceParameters, Sensors};
    use crate::{Action, Scenario, Simulation};

    /// Growth of the lateral error between 20 and 40 s after a push at the wheel, from the simulation itself.
    fn simulated(kmh: f64, t_p: f64, condition: Condition, law: Params) -> f64 {
        let course = Course::new(
            "straight",
            DEFAULT_LANE_WIDTH_M,
            vec![Segment::straight(kmh / 3.6 * 60.0)],
        );
        let driver = DriverParameters {
            t_p,
            ..DriverParameters::default()
        };
        let scenario = Scenario::builder()
            .course(course.unwrap())
            .speed_kmh(kmh)
            .driver(driver)
            .condition(condition)
            .guidance(GuidanceParameters {
                controller: law,
                ..GuidanceParameters::default()
            })
            .sensors(Sensors::Exact);
        let mut simulation = Simulation::new(&scenario.build().unwrap());
        let mut peaks = [0.0_f64; 2];
        loop {
            let step = simulation.steps();
            let push = Action {
                hand_torque_nm: if step < 200 { 0.05 } else { 0.0 },
                ..Action::default()
            };
            let Some(outcome) = simulation.step(&push) else {
                break;
            };
            if let Some(sample) = outcome.sample {
                let half = match step {
                    10_000..25_000 => 0,
                    25_000..40_000 => 1,
                    _ => continue,
                };
                peaks[half] = peaks[half].max(sample.lateral_error_m.abs());
            }
        }
        (peaks[1] / peaks[0]).ln() / 15.0
    }

    #[test]
    fn the_simulation_grows_and_dies_down_as_the_eigenvalues_say() {
        let mut signs = [0, 0];
        for kmh in [40.0, 80.0, 120.0] {
            for t_p in [0.1, 0.5] {
                for condition in [Condition::Manual, Condition::Mid] {
                    let growth = agreed(kmh, t_p, condition, Params::PAPER);
                    signs[usize::from(growth > 0.0)] += 1;
                }
            }
        }
        assert!(signs.iter().all(|n| *n > 0), "both kinds: {signs:?}");
    }

    /// A schedule that leaves little of the guidance leaves a driver nearly alone; the simulated ECU has it too.
    #[test]
    fn a_schedule_counts() {
        let law = Params {
            low_speed_share: 0.25,
            high_speed_share: 0.1,
            ..Params::PAPER
        };
        for (kmh, expected) in [
            (20.0, 0.25),
            (40.0, 0.625),
            (60.0, 1.0),
            (95.0, 0.55),
            (130.0, 0.1),
            (200.0, 0.1),
        ] {
            assert!((share(&law, kmh / 3.6) - expected).abs() < 1e-12, "{kmh}");
        }
        let [whole, little] = [Params::PAPER, law].map(|law| agreed(120.0, 0.4, Condition::Mid, law));
        assert!(whole < -0.05 && little > 0.0, "{whole} {little}");
    }

    /// The growth, which the simulation has to show too.
    fn agreed(kmh: f64, t_p: f64, condition: Condition, law: Params) -> f64 {
        let driver = DriverParameters {
            t_p,
            ..DriverParameters::default()
        };
        let guided = Guided { law: &law, t_n: 0.3 };
        let growth = growth_per_s(
            kmh / 3.6,
            &VehicleParameters::default(),
            &driver,
            condition.gains(),
            (condition != Condition::Manual).then_some(guided),
        );
        let seen = simulated(kmh, t_p, condition, law);
        let what = format!("{kmh} km/h, t_p {t_p}, {condition}: {growth:.3}, simulated {seen:.3}");
        // A fast decay ends in the sensors' rounding and in the integral's slow way back.
        if growth.abs() < 0.3 && seen.is_finite() {
            assert!((growth - seen).abs() < 0.03 + 0.15 * growth.abs(), "{what}");
        }
        assert_eq!(growth > 0.0, seen > 0.0, "{what}");
        growth
    }
}
