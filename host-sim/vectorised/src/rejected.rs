//! What is not driven side by side, and why.

use std::fmt;

use haptic_core::controller::params::{Params, VehicleParams};
use haptic_sim::models::disturbances::SensorErrors;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::tolerances::Car;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::{
    Condition, DriverChange, Failure, FailureKind, GuidanceParameters, Scenario, ScenarioValues, Sensors,
};

use super::counts::{ONE, speed_heard};

/// Declares the reasons: what each is, and what a study says of it.
macro_rules! reasons {
    ($($(#[$doc:meta])* $name:ident $says:literal;)*) => {
        /// Why a run is rejected: the shipping ECU drives it alone.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Reason {
            $($(#[$doc])* $name,)*
        }

        impl Reason {
            /// Every reason, those that are known before a run begins first, with what a study says of them.
            pub const ALL: [(Self, &str); [$($says),*].len()] = [$((Self::$name, $says)),*];
        }
    };
}

reasons! {
    /// A camera whose pictures come late, that is blind at times, or that jumps to another line.
    Camera "a camera that is late, blind at times, or on another line";
    /// A steering column with a torsion bar.
    TorsionBar "a torsion bar";
    /// Another law than the paper's.
    AnotherLaw "another law than the paper's";
    /// A sensor that is a torsion bar.
    BarSensor "an ECU whose sensor is a torsion bar";
    /// Exact sensors, past the bus.
    ExactSensors "exact sensors, past the bus";
    /// Slower than the controller guides.
    TooSlow "slower than is guided";
    /// The lane preview fails within the first two seconds, while the ECU does not know its sender's period yet.
    EarlyFailure "a lane preview that fails within the first 2 s";
    /// A failure that ends: the ECU comes back.
    FailureEnds "a failure that ends";
    /// Longer than the clock of vectorised runs counts.
    TooLong "longer than 2000 s";
    /// Too few runs are left for a batch.
    TooFew "too few for a batch";
    /// The lane preview fails beside a probe, which winds down meanwhile.
    FailureWithProbe "a lane preview that fails beside a probe";
    /// Near the end of what a frame carries.
    SensorRange "a sensor near the end of its range";
    /// A picture that is far from the one before.
    LaneStep "lane errors that jump";
    /// A speed that steps, or is less than is guided.
    Speed "a speed that jumps, or is too slow";
    /// No hand is felt at the wheel.
    HandsOff "no hand at the wheel";
    /// The driver overrides the guidance.
    Override "a driver who overrides";
    /// The law asks for more than its sum holds.
    Law "a law out of its range";
    /// The torque is near the end of the monitor's band.
    MonitorBand "near the end of the monitor's band";
    /// The column check is near its margin.
    ColumnCheck "near the margin of the column check";
    /// The lane check is near its margin.
    LaneCheck "near the margin of the lane check";
    /// The yaw rate is near what wheel angle and speed deny.
    YawRate "near the margin of the yaw rate's check";
    /// The motor does not deliver what it is told.
    Motor "a motor that does not obey";
    /// The vehicle leaves the road, or turns wildly.
    OffRoad "off the road";
    /// The vehicle weaves so far that its way is 1 % longer than the course.
    Detour "a way longer than the course";
}

impl Reason {
    /// Its bit in a run's doubts.
    pub(super) const fn bit(self) -> i32 {
        1 << self as u32
    }

    /// The first of a run's doubts; one without doubts has more samples than there was room for.
    pub(super) fn first_of(doubts: i32) -> Self {
        let first = Self::ALL.get(doubts.trailing_zeros() as usize);
        first.map_or(Self::Detour, |(reason, _)| *reason)
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL[*self as usize].1)
    }
}

/// From here on the ECU waits the same time for every sender of a lane preview.
const SETTLED_S: f64 = 2.0;
/// A count of speed on the bus, m/s.
const SPEED_LSB_M_PER_S: f64 = 1.0 / 256.0;
/// The clock counts microseconds in 31 bits.
const LONGEST_S: f64 = 2000.0;

/// Why a scenario cannot be driven side by side; `None` if it can.
///
/// Every field of a scenario is named here: a new one does not compile until it is decided on. What a name is not bound for
/// is vectorised, or does not enter a run.
#[must_use]
pub fn unsupported_reason(scenario: &Scenario) -> Option<Reason> {
    let ScenarioValues {
        course: _,
        speed: _,
        manual: _,
        driver,
        gains,
        manual_k_d: _,
        vehicle: _,
        guidance,
        sensors,
        failure,
        driver_change,
        // These three as the car that they draw has them.
        world: _,
        sensor_errors: _,
        tolerances: _,
        column,
        // Only a bar has one.
        assist: _,
        seed: _,
    } = scenario.values();
    let Failure {
        kind,
        time_s,
        duration_s,
    } = *failure;
    let params = supported_guidance(guidance);
    supported_driver(driver, *gains, *driver_change);
    let camera = camera_errors(&scenario.car());
    let guided = scenario.condition() != Condition::Manual;
    let heard_m_per_s = f64::from(speed_heard(scenario)) * (1.0 / ONE);
    let reasons = [
        (guided && camera.iter().any(|error| *error != 0.0), Reason::Camera),
        (column.has_bar(), Reason::TorsionBar),
        (guided && params.law != 0.0, Reason::AnotherLaw),
        (guided && params.has_bar(), Reason::BarSensor),
        (guided && *sensors == Sensors::Exact, Reason::ExactSensors),
        (
            guided && heard_m_per_s < params.least_speed_m_per_s + SPEED_LSB_M_PER_S,
            Reason::TooSlow,
        ),
        (
            kind == FailureKind::Input && time_s < SETTLED_S,
            Reason::EarlyFailure,
        ),
        (
            kind != FailureKind::None && duration_s.is_some(),
            Reason::FailureEnds,
        ),
        (scenario.duration_s() > LONGEST_S, Reason::TooLong),
    ];
    let mut reasons = reasons.into_iter();
    reasons.find_map(|(holds, reason)| holds.then_some(reason))
}

/// What keeps out of a car: the camera's errors that move a picture in time or to another line. All else of a car is
/// vectorised.
fn camera_errors(car: &Car) -> [f64; 4] {
    let Car {
        vehicle:
            VehicleParameters {
                m: _,
                i: _,
                l_f: _,
                l_r: _,
                k_f: _,
                k_r: _,
                k_s: _,
                e_t: _,
                b_s: _,
                j_s: _,
                k_t: _,
            },
        world:
            WorldParameters {
                tyres: _,
                mu: _,
                castor_share: _,
                bank_rad: _,
                friction_nm: _,
                friction_give_rad: _,
                assist_nm: _,
                assist_speed_m_per_s: _,
                motor_lag_s: _,
                motor_error: _,
                motor_ripple_nm: _,
                wind_n: _,
                gust_sd_n: _,
                gust_corner_hz: _,
                wind_lever_m: _,
            },
        sensor_errors:
            SensorErrors {
                torque_bias_nm: _,
                torque_gain: _,
                angle_bias_rad: _,
                speed_gain: _,
                yaw_rate_bias_rad_per_s: _,
                yaw_rate_gain: _,
                yaw_rate_noise_rad_per_s: _,
                lane_noise_m: _,
                heading_noise_rad: _,
                camera_yaw_rad: _,
                camera_latency_s,
                camera_jitter_s,
                dropout_rate_per_s,
                // Without its rate a dropout or a jump never comes.
                dropout_duration_s: _,
                line_jump_rate_per_s,
                line_jump_m: _,
            },
    } = *car;
    [
        camera_latency_s,
        camera_jitter_s,
        dropout_rate_per_s,
        line_jump_rate_per_s,
    ]
}

/// All of a controller's parameters are vectorised, but for what its estimator alone knows of the driver's arm.
fn supported_guidance(guidance: &GuidanceParameters) -> &Params {
    let GuidanceParameters {
        controller,
        t_n: _,
        t_f: _,
        probe: _,
    } = guidance;
    let Params {
        k_1: _,
        a_1: _,
        a_2: _,
        a_3: _,
        a_4: _,
        rate_corner_hz: _,
        torque_limit_nm: _,
        wind_up_nm_per_s: _,
        reduction_nm_per_s: _,
        least_speed_m_per_s: _,
        probe_amplitude_nm: _,
        probe_frequency_hz: _,
        t_nms_s: _,
        k_nms: _,
        low_speed_share: _,
        high_speed_share: _,
        vehicle:
            VehicleParams {
                curvature_gain_per_m: _,
                stability_factor_s2_per_m2: _,
                aligning_gain_nm_s2_per_m: _,
                column_damping_nm_s: _,
                far_time_s: _,
                near_time_s: _,
            },
        law: _,
        // Without their laws they do not act.
        activity_lambda_min: _,
        torque_sensor: _,
        // Without a bar they do not act.
        wheel_inertia_kg_m2: _,
        wheel_damping_nm_s: _,
        wheel_friction_nm: _,
        bar_stiffness_nm_per_rad: _,
        column_period_s: _,
        observer_bandwidth_rad_per_s: _,
    } = controller;
    controller
}

/// Any driver is vectorised.
fn supported_driver(driver: &DriverParameters, gains: ArmGains, change: Option<DriverChange>) {
    let DriverParameters {
        a_1: _,
        a_2: _,
        a_3: _,
        t_p: _,
        t_n: _,
        t_f: _,
        t_nms: _,
        k_nms: _,
        remnant_sd_nm: _,
        remnant_corner_hz: _,
        answers_hands_off_after_s: _,
        takes_over_after_s: _,
        line_m: _,
    } = driver;
    let ArmGains { k_d: _, k_hg: _ } = gains;
    if let Some(change) = change {
        let DriverChange {
            time_s: _,
            k_d: _,
            k_hg: _,
        } = change;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_has_its_place_in_the_list() {
        for (place, (reason, text)) in Reason::ALL.into_iter().enumerate() {
            assert_eq!((reason as usize, reason.to_string().as_str()), (place, text));
            assert_eq!(Reason::first_of(reason.bit()), reason);
        }
        assert_eq!(
            Reason::first_of(Reason::Law.bit() | Reason::OffRoad.bit()),
            Reason::Law
        );
        assert_eq!(Reason::first_of(0), Reason::Detour);
    }
}
