use super::*;
use crate::models::plant::Transition;

const V: f64 = 60.0 / 3.6;

/// Both plants on the same target angle; the largest difference of a state over the largest value of it.
fn largest_difference(world: WorldParameters, target_rad: f64) -> [f64; 5] {
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
    let transition = Transition::new(V, &vehicle, &driver, gains);
    let (mut linear, mut plant) = (Plant::default(), Plant::default());
    let mut real = RealPlant::new(world, &vehicle, &driver, 1);
    let (mut worst, mut most) = ([0.0_f64; 5], [0.0_f64; 5]);
    let target = |step: u32| target_rad * (1.5 * f64::from(step) * STEP_S).sin();
    for step in 0..8000 {
        let input = PlantInput {
            target_now_rad: target(step),
            target_next_rad: target(step + 1),
            guidance_torque_nm: 0.2 * (f64::from(step / 100)).sin(),
            remnant_nm: 0.0,
        };
        linear.step(&transition, &input);
        real.step(&mut plant, V, gains, &input, 0.0);
        let [a, b] = [&linear, &plant].map(Plant::state);
        let pairs = [
            [a.sideslip_rad, b.sideslip_rad],
            [a.yaw_rate_rad_s, b.yaw_rate_rad_s],
            [a.wheel_rad, b.wheel_rad],
            [a.arm_nm, b.arm_nm],
            [linear.position_m()[1], plant.position_m()[1]],
        ];
        for (i, [a, b]) in pairs.into_iter().enumerate() {
            worst[i] = worst[i].max((a - b).abs());
            most[i] = most[i].max(a.abs());
        }
    }
    std::array::from_fn(|i| worst[i] / most[i])
}

#[test]
fn with_everything_off_it_is_the_papers_plant() {
    let differences = largest_difference(WorldParameters::default(), 0.2);
    assert!(differences.iter().all(|d| *d < 1e-4), "{differences:?}");
}

#[test]
fn saturating_tyres_are_within_1_percent_of_linear_ones_at_half_a_metre_per_second_squared() {
    let world = WorldParameters {
        tyres: Tyres::Saturating,
        ..WorldParameters::default()
    };
    let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
    let steady = steady(world, 0.5, V, gains, 0.0);
    assert!((V * steady.yaw_rate_rad_s - 0.5).abs() < 0.02, "{steady:?}");
    let linear = self::steady(WorldParameters::default(), 0.5, V, gains, 0.0);
    let ratio = |of: fn(&PlantState) -> f64| of(&steady) / of(&linear) - 1.0;
    for of in [|s: &PlantState| s.yaw_rate_rad_s, |s: &PlantState| s.sideslip_rad] {
        assert!(ratio(of).abs() < 0.01, "{} against {}", of(&steady), of(&linear));
    }
}

/// The state after 20 s with the wheel held by hand at the angle that the linear vehicle needs for a lateral
/// acceleration.
fn steady(world: WorldParameters, lateral_mps2: f64, v: f64, gains: ArmGains, bank: f64) -> PlantState {
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let (l, p) = (vehicle.l_f + vehicle.l_r, &vehicle);
    let stability = p.m * (p.l_r * p.k_r - p.l_f * p.k_f) / (2.0 * l * l * p.k_f * p.k_r);
    let wheel_rad = lateral_mps2 * l * (1.0 + stability * v * v) / (v * v) / p.k_t;
    let mut real = RealPlant::new(world, &vehicle, &driver, 1);
    let mut plant = Plant::default();
    for _ in 0..20_000 {
        // A stiff hand.
        let state = plant.state();
        let remnant_nm = 200.0 * (wheel_rad - state.wheel_rad) - state.arm_nm - 10.0 * state.wheel_rate_rad_s;
        let input = PlantInput {
            remnant_nm,
            ..PlantInput::default()
        };
        real.step(&mut plant, v, gains, &input, bank);
    }
    plant.state()
}

#[test]
fn a_tyre_gives_no_more_than_the_road_and_its_trail_falls() {
    let vehicle = VehicleParameters::default();
    let tyre = SingleTrack::new(&vehicle, Tyres::Saturating, 0.4);
    let around = |mu| Surroundings {
        mu,
        bank_rad: 0.0,
        force_n: 0.0,
        moment_nm: 0.0,
    };
    let most_n = 0.5 * 1100.0 * 9.81 * 1.635 / 2.635;
    let lever = vehicle.aligning_stiffness() / (2.0 * 53_300.0);
    let at = |slip: f64| {
        let slip_rad = slip * most_n / (2.0 * 53_300.0);
        let response = tyre.respond(V, [0.0, 0.0], slip_rad / vehicle.k_t, &around(0.5));
        let force_n = response.rates[0] * 1100.0;
        [force_n / most_n, -response.aligning_nm / (lever * force_n)]
    };
    // sin(1.4*atan(x/1.4)) is 1 where the arc tangent is pi/2.8: x = 1.4*tan(1.121997) = 2.91; by a calculator.
    let [force, trail] = at(2.907_09);
    assert!((force - 1.0).abs() < 1e-9, "{force}");
    // cos(1.2*atan(2.907)) = cos(1.488) = 0.0826
    assert!((trail - (0.4 + 0.6 * 0.0826)).abs() < 1e-3, "{trail}");
    for tenths in 0..200 {
        assert!(at(0.1 + f64::from(tenths) / 10.0)[0] <= 1.0);
    }
    // Sliding: castor alone is left of the trail.
    assert!((at(50.0)[1] - 0.4).abs() < 1e-9);
    let [force, trail] = at(1e-4);
    assert!((force / 1e-4 - 1.0).abs() < 1e-6 && (trail - 1.0).abs() < 1e-6);
}

#[test]
fn friction_holds_the_wheel_until_it_is_overcome() {
    let world = WorldParameters {
        friction: 0.3,
        ..WorldParameters::default()
    };
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let turned = |torque_nm: f64| {
        let mut real = RealPlant::new(world, &vehicle, &driver, 1);
        let mut plant = Plant::default();
        for step in 0..8000 {
            // A ramp of 4 s: a sudden torque would swing.
            let input = PlantInput {
                guidance_torque_nm: torque_nm * (f64::from(step) / 4000.0).min(1.0),
                ..PlantInput::default()
            };
            real.step(&mut plant, V, ArmGains { k_d: 0.0, k_hg: 0.0 }, &input, 0.0);
        }
        plant.state().wheel_rad.to_degrees()
    };
    assert!(turned(0.2).abs() < 0.25, "held: {} deg", turned(0.2));
    assert!(turned(1.0) > 1.0, "turned: {} deg", turned(1.0));
}

#[test]
fn a_bank_pushes_to_the_lower_side_and_wind_to_where_it_blows() {
    let gains = ArmGains::MANUAL;
    let none = steady(WorldParameters::default(), 0.0, V, gains, 0.0);
    assert_eq!(none.yaw_rate_rad_s, 0.0);
    // With the wheel held straight the left edge up lets the vehicle turn to the right.
    let banked = steady(WorldParameters::default(), 0.0, V, gains, 0.05);
    assert!(banked.yaw_rate_rad_s < -1e-3, "{banked:?}");
    let windy = WorldParameters {
        wind: 500.0,
        ..WorldParameters::default()
    };
    let blown = steady(windy, 0.0, V, gains, 0.0);
    assert!(blown.yaw_rate_rad_s > 1e-3, "{blown:?}");
}
