use super::*;
use crate::models::plant::Transition;
use crate::models::runge_kutta;

const V: f64 = 60.0 / 3.6;

/// Both plants on the same target angle; the largest difference of a state over the largest value of it.
fn largest_difference(world: WorldParameters, target_rad: f64) -> [f64; 5] {
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
    let transition = Transition::new(V, &vehicle, &driver, gains);
    let (mut linear, mut plant) = (Plant::default(), Plant::default());
    let mut nonlinear = NonlinearPlant::new(world, &vehicle, &driver, 1);
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
        nonlinear.step(&mut plant, [V; 2], gains, input, 0.0);
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
fn steady(world: WorldParameters, lateral_m_per_s2: f64, v: f64, gains: ArmGains, bank: f64) -> PlantState {
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let (l, p) = (vehicle.l_f + vehicle.l_r, &vehicle);
    let stability = p.m * (p.l_r * p.k_r - p.l_f * p.k_f) / (2.0 * l * l * p.k_f * p.k_r);
    let wheel_rad = lateral_m_per_s2 * l * (1.0 + stability * v * v) / (v * v) / p.k_t;
    let mut nonlinear = NonlinearPlant::new(world, &vehicle, &driver, 1);
    let mut plant = Plant::default();
    for _ in 0..20_000 {
        // A stiff hand.
        let state = plant.state();
        let remnant_nm = 200.0 * (wheel_rad - state.wheel_rad) - state.arm_nm - 10.0 * state.wheel_rate_rad_s;
        let input = PlantInput {
            remnant_nm,
            ..PlantInput::default()
        };
        nonlinear.step(&mut plant, [v; 2], gains, input, bank);
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
    // 1/2^(1/4) = 0.840896; cos(1.2*pi/4) = cos(0.942478) = 0.587785.
    let [force, trail] = at(1.0);
    assert!((force - 0.840_896).abs() < 1e-6, "{force}");
    assert!((trail - (0.4 + 0.6 * 0.587_785)).abs() < 1e-6, "{trail}");
    // 3/82^(1/4) = 3/3.009218
    assert!((at(3.0)[0] - 0.996_937).abs() < 1e-5);
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
        friction_nm: 0.3,
        ..WorldParameters::default()
    };
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let turned = |torque_nm: f64| {
        let mut nonlinear = NonlinearPlant::new(world, &vehicle, &driver, 1);
        let mut plant = Plant::default();
        for step in 0..8000 {
            // A ramp of 4 s: a sudden torque would swing.
            let input = PlantInput {
                guidance_torque_nm: torque_nm * (f64::from(step) / 4000.0).min(1.0),
                ..PlantInput::default()
            };
            nonlinear.step(&mut plant, [V; 2], ArmGains { k_d: 0.0, k_hg: 0.0 }, input, 0.0);
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
        wind_n: 500.0,
        ..WorldParameters::default()
    };
    let blown = steady(windy, 0.0, V, gains, 0.0);
    assert!(blown.yaw_rate_rad_s > 1e-3, "{blown:?}");
}

/// CommonRoad's vehicles (tests/tools/commonroad_vehicles.py) in a lane change and in a curve of 2.5 m/s^2. The single-track
/// one: yaw rate and side-slip angle within 2 % of their peaks. The multi-body one leans, and its tyres are others: yaw rate
/// within 5 %; the side-slip angle, 4 to 6 mrad at most, within 40 % of that.
#[test]
fn the_vehicle_is_that_of_commonroad() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/data/commonroad_vehicles.csv"
    );
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<(&str, Vec<f64>)> = text
        .lines()
        .skip(1)
        .map(|line| {
            let comma = line.match_indices(',').nth(1).unwrap().0;
            (&line[..comma], &line[comma + 1..])
        })
        .map(|(name, values)| (name, values.split(',').map(|v| v.parse().unwrap()).collect()))
        .collect();
    // Parameter set 2, a BMW 320i: its tyres give 21.92 times the load per radian on both axles, so it is neutral.
    let (m, l_f, l_r, gravity) = (1_093.295_233_467_404_6, 1.156_195_706_4, 1.422_717_093_6, 9.81);
    let stiffness = |other: f64| 0.5 * 21.92 * m * gravity * other / (l_f + l_r);
    let vehicle = VehicleParameters {
        m,
        i: 1_791.599_530_012_285_6,
        l_f,
        l_r,
        k_f: stiffness(l_r),
        k_r: stiffness(l_f),
        ..VehicleParameters::default()
    };
    let around = Surroundings {
        mu: 1.0489,
        bank_rad: 0.0,
        force_n: 0.0,
        moment_nm: 0.0,
    };
    for tyres in [Tyres::Linear, Tyres::Saturating] {
        let tyre = SingleTrack::new(&vehicle, tyres, 0.4);
        for (manoeuvre, bounds) in [
            ("single_track,lane_change", [0.02, 0.02]),
            ("single_track,curve", [0.02, 0.02]),
            ("multi_body,lane_change", [0.05, 0.4]),
            ("multi_body,curve", [0.05, 0.4]),
        ] {
            let rows: Vec<&Vec<f64>> = rows.iter().filter(|r| r.0 == manoeuvre).map(|r| &r.1).collect();
            assert_eq!(rows.len(), 300);
            let (mut motion, mut worst, mut peak) = ([0.0; 2], [0.0_f64; 2], [0.0_f64; 2]);
            let mut lateral_m_per_s2 = 0.0_f64;
            for pair in rows.windows(2) {
                let [_, v, wheel, yaw_rate, sideslip] = pair[0][..] else {
                    panic!("five numbers")
                };
                let ours = [motion[1], f64::atan2(motion[0], v)];
                for (i, theirs) in [yaw_rate, sideslip].into_iter().enumerate() {
                    worst[i] = worst[i].max((ours[i] - theirs).abs());
                    peak[i] = peak[i].max(theirs.abs());
                }
                lateral_m_per_s2 = lateral_m_per_s2.max(v * yaw_rate);
                // 20 ms between rows, the angle straight between them.
                for step in 0..20 {
                    let at = |motion: [f64; 2], share: f64| {
                        let angle = wheel + (pair[1][2] - wheel) * (f64::from(step) + share) / 20.0;
                        tyre.respond(v, motion, angle / vehicle.k_t, &around).rates
                    };
                    let plus = |k: [f64; 2], h: f64| [motion[0] + h * k[0], motion[1] + h * k[1]];
                    let k1 = at(motion, 0.0);
                    let k2 = at(plus(k1, 0.5 * STEP_S), 0.5);
                    motion = plus(k2, STEP_S);
                }
            }
            assert!(lateral_m_per_s2 > 2.4, "{manoeuvre}: {lateral_m_per_s2}");
            for i in 0..2 {
                let share = worst[i] / peak[i];
                assert!(share < bounds[i], "{tyres:?} {manoeuvre} {i}: {share}");
            }
        }
    }
}

/// The equations of the paper in the form in which the lateral velocity w is a state, solved for the derivatives one by one,
/// with the speed v of the instant.
fn derivatives(x: &[f64; 8], v: f64, target: f64, t_h: f64, gains: ArmGains) -> [f64; 8] {
    let p = VehicleParameters::default();
    let [w, r, phi, phi_dot, t_d, psi, ..] = *x;
    let delta = p.k_t * phi;
    let front = 2.0 * p.k_f * (delta - (w + p.l_f * r) / v);
    let rear = -2.0 * p.k_r * (w - p.l_r * r) / v;
    let k_aln = 2.0 * p.e_t * p.k_f * p.k_t / (1.0 + 2.0 * p.e_t * p.k_f / p.k_s);
    let t_a = k_aln * ((w + p.l_f * r) / v - delta);
    [
        (front + rear) / p.m - v * r,
        (p.l_f * front - p.l_r * rear) / p.i,
        phi_dot,
        (t_d + t_h + t_a - p.b_s * phi_dot) / p.j_s,
        (gains.k_d * target + 1.0 * (target - phi) - gains.k_hg * t_h - t_d) / 0.1,
        r,
        v * psi.cos() - w * psi.sin(),
        v * psi.sin() + w * psi.cos(),
    ]
}

/// 30 m/s for a second, -8 m/s2 for 2.5 s, +4 m/s2 for 2.5 s, 20 m/s for 2 s, the wheel turned to and fro.
#[test]
fn under_braking_a_step_is_as_exact_as_a_fine_runge_kutta() {
    let speed = |t: f64| 30.0 - 8.0 * (t - 1.0).clamp(0.0, 2.5) + 4.0 * (t - 3.5).clamp(0.0, 2.5);
    let target = |t: f64| 0.5 * (1.5 * t).sin() + 0.2;
    let gains = ArmGains { k_d: 3.0, k_hg: 0.5 };
    let (vehicle, driver) = (VehicleParameters::default(), DriverParameters::default());
    let mut nonlinear = NonlinearPlant::new(WorldParameters::default(), &vehicle, &driver, 1);
    let (mut plant, mut x) = (Plant::default(), [0.0; 8]);
    for step in 0..8000_u32 {
        let [from, to] = [step, step + 1].map(|step| f64::from(step) * STEP_S);
        let (now, next, t_h) = (target(from), target(to), 0.3 * f64::from(step / 100).sin());
        let input = PlantInput {
            target_now_rad: now,
            target_next_rad: next,
            guidance_torque_nm: t_h,
            remnant_nm: 0.0,
        };
        nonlinear.step(&mut plant, [speed(from), speed(to)], gains, input, 0.0);
        let h = STEP_S / 10.0;
        for i in 0..10_u32 {
            x = runge_kutta(&x, h, |x, part| {
                let share = (f64::from(i) + part) / 10.0;
                let (v, target) = (speed(from + share * STEP_S), now + (next - now) * share);
                derivatives(x, v, target, t_h, gains)
            });
        }
        let (state, v) = (plant.state(), speed(to));
        let found = [
            v * state.sideslip_rad.tan(),
            state.yaw_rate_rad_s,
            state.wheel_rad,
            state.wheel_rate_rad_s,
            state.arm_nm,
            state.yaw_rad,
        ];
        for (i, (found, wanted)) in found.iter().zip(&x).enumerate() {
            assert!(
                (found - wanted).abs() < 1e-7,
                "step {step}, state {i}: {found}, not {wanted}"
            );
        }
    }
    assert!(x[7].abs() > 20.0 && x[5].abs() > 0.2, "the oracle moved: {x:?}");
    for (found, wanted) in plant.position_m().iter().zip(&x[6..]) {
        assert!((found - wanted).abs() < 1e-4, "{found}, not {wanted}");
    }
}
