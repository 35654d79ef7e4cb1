//! A car that is not the one on paper: a scenario says how far cars may differ, a number draws one of them.
//!
//! The controller knows the car on paper (`[vehicle]`); the one drawn is what drives. Every quantity is drawn for every
//! car, also where its tolerance is zero, so that one tolerance more or less leaves the others as they were. A uniform
//! quantity lies within its tolerance to both sides, a Gaussian one within three standard deviations.

use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

use super::disturbances::SensorErrors;
use super::nonlinear::WorldParameters;
use super::vehicle::VehicleParameters;
use crate::fields::fields;

/// Where a load lies, as a share of the wheelbase behind the front axle: a back seat and a boot.
const LOAD_PLACE: f64 = 0.75;

fields! {
    /// How far cars of one kind differ.
    #[derive(Copy)]
    Tolerances, "tolerances" {
        /// which car of the population drives; without it `seed` draws one
        car: Option<u64> = None, "car", "", "", Whole;
        /// of the cornering stiffness of each axle, share to both sides
        tyres: f64 = 0.0, "tyres", "", "", Between(0.0, 0.5);
        /// of the trail, share to both sides
        trail: f64 = 0.0, "trail", "", "", Between(0.0, 0.5);
        /// most load, at three quarters of the wheelbase; drawn from none to this
        load_kg: f64 = 0.0, "load_kg", "", "kg", Between(0.0, 2000.0);
        /// least friction of the column
        friction_least_nm: f64 = 0.0, "friction_least_nm", "", "N.m", Between(0.0, 5.0);
        /// most friction, drawn in place of `world.friction_nm` if above 0
        friction_most_nm: f64 = 0.0, "friction_most_nm", "", "N.m", Between(0.0, 5.0);
        /// of the motor's torque, share to both sides, beside `world.motor_error`
        motor_error: f64 = 0.0, "motor_error", "", "", Between(0.0, 0.5);
        /// most lag of the motor, drawn from none to this, beside `world.motor_lag_s`
        motor_lag_s: f64 = 0.0, "motor_lag_s", "", "s", Between(0.0, 0.1);
        /// standard deviation of the driver torque's bias
        torque_bias_nm: f64 = 0.0, "torque_bias_nm", "", "N.m", Between(0.0, 0.5);
        /// standard deviation of its gain
        torque_gain: f64 = 0.0, "torque_gain", "", "", Between(0.0, 0.15);
        /// standard deviation of the wheel angle's offset
        angle_bias_rad: f64 = 0.0, "angle_bias_rad", "", "rad", Between(0.0, 0.09);
        /// standard deviation of the speed's gain
        speed_gain: f64 = 0.0, "speed_gain", "", "", Between(0.0, 0.15);
        /// standard deviation of the yaw of the camera's mount
        camera_yaw_rad: f64 = 0.0, "camera_yaw_rad", "", "rad", Between(0.0, 0.015);
        /// standard deviation of the yaw rate's bias
        yaw_rate_bias_rad_per_s: f64 = 0.0, "yaw_rate_bias_rad_per_s", "", "rad/s", Between(0.0, 0.03);
    }
}

/// A car as it is: what a scenario's tables say, with what its tolerances have drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Car {
    /// Its vehicle.
    pub vehicle: VehicleParameters,
    /// Its column and motor, in the scenario's world.
    pub world: WorldParameters,
    /// Its sensors.
    pub sensor_errors: SensorErrors,
}

/// Draws of one car, in a fixed order.
struct Draw(Xoshiro256PlusPlus);

impl Draw {
    /// From -1 to 1.
    fn both_sides(&mut self) -> f64 {
        2.0 * self.0.random::<f64>() - 1.0
    }

    /// From 0 to 1.
    fn share(&mut self) -> f64 {
        self.0.random()
    }

    /// A normal number of unit standard deviation, within three of it.
    fn normal(&mut self) -> f64 {
        loop {
            let value: f64 = StandardNormal.sample(&mut self.0);
            if value.abs() <= 3.0 {
                return value;
            }
        }
    }
}

impl Tolerances {
    /// The car that `seed` draws around one on paper.
    pub fn draw(&self, seed: u64, on_paper: &Car) -> Car {
        let mut draw = Draw(Xoshiro256PlusPlus::seed_from_u64(seed));
        let mut car = *on_paper;
        let vehicle = &mut car.vehicle;
        vehicle.k_f *= 1.0 + self.tyres * draw.both_sides();
        vehicle.k_r *= 1.0 + self.tyres * draw.both_sides();
        vehicle.e_t *= 1.0 + self.trail * draw.both_sides();
        *vehicle = loaded(vehicle, self.load_kg * draw.share());
        let friction =
            self.friction_least_nm + (self.friction_most_nm - self.friction_least_nm) * draw.share();
        if self.friction_most_nm > 0.0 {
            car.world.friction_nm = friction;
        }
        car.world.motor_error += self.motor_error * draw.both_sides();
        car.world.motor_lag_s += self.motor_lag_s * draw.share();
        let errors = &mut car.sensor_errors;
        errors.torque_bias_nm += self.torque_bias_nm * draw.normal();
        errors.torque_gain *= 1.0 + self.torque_gain * draw.normal();
        errors.angle_bias_rad += self.angle_bias_rad * draw.normal();
        errors.speed_gain *= 1.0 + self.speed_gain * draw.normal();
        errors.camera_yaw_rad += self.camera_yaw_rad * draw.normal();
        errors.yaw_rate_bias_rad_per_s += self.yaw_rate_bias_rad_per_s * draw.normal();
        car
    }
}

/// The vehicle with a load behind its middle: heavier, slower to turn, its centre of gravity further back.
fn loaded(vehicle: &VehicleParameters, load_kg: f64) -> VehicleParameters {
    if load_kg == 0.0 {
        return *vehicle;
    }
    let wheelbase = vehicle.l_f + vehicle.l_r;
    let m = vehicle.m + load_kg;
    // How far the load lies behind the centre of gravity without it.
    let behind = LOAD_PLACE * wheelbase - vehicle.l_f;
    let shift = load_kg * behind / m;
    VehicleParameters {
        m,
        // Two point masses' worth of turning about the new centre of gravity.
        i: vehicle.i + vehicle.m * shift * shift + load_kg * (behind - shift) * (behind - shift),
        l_f: vehicle.l_f + shift,
        l_r: vehicle.l_r - shift,
        ..*vehicle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ON_PAPER: fn() -> Car = || Car {
        vehicle: VehicleParameters::default(),
        world: WorldParameters::default(),
        sensor_errors: SensorErrors::default(),
    };

    fn population(tolerances: Tolerances) -> Vec<Car> {
        (0..4000).map(|n| tolerances.draw(n, &ON_PAPER())).collect()
    }

    #[test]
    fn without_tolerances_every_car_is_the_one_on_paper() {
        for car in population(Tolerances::default()) {
            assert_eq!(car, ON_PAPER());
        }
    }

    /// By hand: 300 kg at three quarters of 2.635 m lie 0.97625 m behind the centre of gravity of 1100 kg, and move
    /// it by 300*0.97625/1400 = 0.20920 m; I = 2940 + 1100*0.0437637 + 300*0.588417 = 3164.7.
    #[test]
    fn a_load_moves_the_centre_of_gravity_back() {
        let car = loaded(&VehicleParameters::default(), 300.0);
        assert_eq!(car.m, 1400.0);
        assert!((car.l_f - 1.209_196).abs() < 1e-5, "{}", car.l_f);
        assert!((car.l_f + car.l_r - 2.635).abs() < 1e-12);
        assert!((car.i - 3164.67).abs() < 0.1, "{}", car.i);
    }

    #[test]
    fn a_population_has_the_spread_that_was_asked_for() {
        let cars = population(Tolerances {
            tyres: 0.15,
            friction_least_nm: 0.2,
            friction_most_nm: 0.4,
            angle_bias_rad: 1.0,
            load_kg: 300.0,
            ..Tolerances::default()
        });
        let of = |value: fn(&Car) -> f64| cars.iter().map(value).collect::<Vec<_>>();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let sd = |values: &[f64]| {
            let m = mean(values);
            mean(&values.iter().map(|v| (v - m).powi(2)).collect::<Vec<_>>()).sqrt()
        };
        let ends = |values: &[f64]| {
            values
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                    [low.min(*v), high.max(*v)]
                })
        };
        let tyres = of(|car| car.vehicle.k_f / 53_300.0);
        let [low, high] = ends(&tyres);
        assert!(
            (0.85..0.852).contains(&low) && (1.148..=1.15).contains(&high),
            "{low} {high}"
        );
        // A uniform share of 15 % has a standard deviation of 15 %/sqrt(3); 4000 draws know it to 1 %.
        assert!(
            (sd(&tyres) - 0.15 / 3.0_f64.sqrt()).abs() < 0.003,
            "{}",
            sd(&tyres)
        );
        let [low, high] = ends(&of(|car| car.world.friction_nm));
        assert!(
            (0.2..0.201).contains(&low) && (0.399..=0.4).contains(&high),
            "{low} {high}"
        );
        let angles = of(|car| car.sensor_errors.angle_bias_rad);
        // Cut at three standard deviations the rest has 0.9866 of it.
        assert!(
            mean(&angles).abs() < 0.05 && (sd(&angles) - 0.9866).abs() < 0.04,
            "{}",
            sd(&angles)
        );
        assert!(angles.iter().all(|a| a.abs() <= 3.0));
        assert!(cars.iter().all(|car| car.sensor_errors.torque_bias_nm == 0.0));
    }

    #[test]
    fn a_tolerance_more_leaves_the_others_as_they_were() {
        let one = Tolerances {
            camera_yaw_rad: 0.0015,
            ..Tolerances::default()
        };
        let two = Tolerances { tyres: 0.15, ..one };
        for seed in 0..20 {
            let [a, b] = [one, two].map(|t| t.draw(seed, &ON_PAPER()).sensor_errors.camera_yaw_rad);
            assert_eq!(a, b);
        }
    }
}
