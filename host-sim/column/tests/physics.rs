//! The paper's column as a limit, energy, resonances, and what the sensor says.

use std::f64::consts::TAU;

use haptic_column::linear::{Hands, Linear};
use haptic_sim::models::nonlinear::{Tyres, WorldParameters};
use haptic_sim::models::torsion_bar::{Assist, BarPlant, ColumnKind, ColumnParameters, Curve, Inject};
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::parts::{Acting, PaperVehicle, Vehicle};
use haptic_sim::{Action, Scenario, Simulation};

pub(crate) const V: f64 = 60.0 / 3.6;

pub(crate) fn plant(column: ColumnParameters, assist: Assist) -> BarPlant {
    plant_in(column, assist, &VehicleParameters::default())
}

fn plant_in(column: ColumnParameters, assist: Assist, vehicle: &VehicleParameters) -> BarPlant {
    let kind = ColumnKind::TorsionBar;
    let builder = Scenario::builder().vehicle(*vehicle).seed(7);
    let scenario = builder
        .column(ColumnParameters { kind, ..column })
        .build()
        .unwrap();
    BarPlant::new(&scenario).with_assist(assist)
}

pub(crate) fn acting(hands_nm: f64, guidance_nm: f64) -> Acting {
    Acting {
        driver_torque_nm: hands_nm,
        guidance_torque_nm: guidance_nm,
        speed_m_per_s: [V; 2],
        bank_rad: 0.0,
    }
}

/// Torques of hands and guidance in a step, N.m.
fn torques(k: u32) -> [f64; 2] {
    let t = f64::from(k) * 1e-3;
    [1.5 * (TAU * 0.6 * t).sin(), 0.5 * (TAU * 1.3 * t).cos() - 0.5]
}

/// The largest difference of the wheel's angle from the paper's column over 10 s, rad.
fn apart_rad(bar: ColumnParameters, motor_lag_s: f64) -> f64 {
    let mut bar = plant(bar.linear(), Assist::None);
    bar.motor.motor_lag_s = motor_lag_s;
    let mut paper = PaperVehicle::new(&Scenario::default());
    let mut most: f64 = 0.0;
    for k in 0..10_000 {
        let [hands, guidance] = torques(k);
        bar.step(&acting(hands, guidance));
        paper.step(&acting(hands, guidance));
        most = most.max((bar.motion().wheel_angle_rad - paper.motion().wheel_angle_rad).abs());
    }
    assert!(paper.motion().wheel_angle_rad.abs() > 1e-4);
    most
}

/// What is left with a stiff bar is the lag of the motor, which the paper's column has not: it falls with it.
#[test]
fn a_stiff_bar_without_assist_is_the_paper_s_column() {
    let with = |k_tb_nm_per_rad, motor_lag_s| {
        let bar = ColumnParameters {
            k_tb_nm_per_rad,
            ..ColumnParameters::default()
        };
        apart_rad(bar, motor_lag_s)
    };
    let [usual, stiff] = [with(143.24, 0.0002), with(1e6, 0.0002)];
    assert!(stiff < 2e-4, "{stiff}");
    assert!(usual > 1e-3 && usual < 0.05, "{usual}");
    assert!(with(1e6, 0.002) > 3.0 * stiff);
}

/// A nanonewton metre of friction is enough to be stepped by Runge-Kutta.
#[test]
fn exact_steps_and_those_of_runge_kutta_agree() {
    let smooth = ColumnParameters::default().linear();
    let mut exact = plant(smooth, Assist::None);
    let mut by_steps = plant(
        ColumnParameters {
            lower_friction_nm: 1e-9,
            ..smooth
        },
        Assist::None,
    );
    for k in 0..5000 {
        let [hands, guidance] = torques(k);
        exact.step(&acting(hands, guidance));
        by_steps.step(&acting(hands, guidance));
    }
    for (state, (a, b)) in exact.state().iter().zip(by_steps.state()).enumerate() {
        // How far friction has given is another question.
        if ![4, 7].contains(&state) {
            assert!((a - b).abs() < 2e-6 * (1.0 + a.abs()), "state {state}: {a} {b}");
        }
    }
}

/// The paper's column with a stiff bar, on saturating tyres, in gusts, on banks to either side, while the car brakes from 25 to 10 m/s.
#[test]
fn a_stiff_bar_in_wind_on_a_bank_and_braking_is_the_paper_s_column() {
    for side in [1.0, -1.0] {
        let world = WorldParameters {
            tyres: Tyres::Saturating,
            mu: 0.8,
            bank_rad: side * 0.05,
            wind_n: -side * 300.0,
            gust_sd_n: 200.0,
            ..WorldParameters::default()
        };
        let text = "[column]\nkind = \"torsion-bar\"\nk_tb_nm_per_rad = 1e6\nupper_friction_nm = 0\nlower_friction_nm = 0\n\
                    sensor_noise_nm = 0\n[assist]\nmotor_lag_s = 0.0002\n";
        let scenario = |text| Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap();
        let within = |of: Scenario| of.to_builder().world(world).seed(7).build().unwrap();
        let (mut bar, mut paper) = (
            BarPlant::new(&within(scenario(text))),
            PaperVehicle::new(&within(scenario(""))),
        );
        let (mut apart, mut aside, mut turned) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..10_000 {
            let [hands, guidance] = torques(k);
            let speed = |k: u32| 25.0 - 1.5e-3 * f64::from(k);
            let acting = Acting {
                speed_m_per_s: [speed(k), speed(k + 1)],
                bank_rad: side * 0.02,
                ..acting(hands, guidance)
            };
            bar.step(&acting);
            paper.step(&acting);
            let [a, b] = [bar.motion(), paper.motion()];
            apart = apart.max((a.wheel_angle_rad - b.wheel_angle_rad).abs());
            aside = aside.max((a.position_m[1] - b.position_m[1]).abs());
            turned = turned.max(b.wheel_angle_rad.abs());
        }
        assert!(
            apart < 2e-4 && aside < 2e-3 && turned > 0.1,
            "{apart} {aside} {turned}"
        );
    }
}

/// Work of hands, motor and tyres is what moves, what is in the bar, and what damping and friction took, here summed by the
/// trapezoidal rule. Friction after Dahl keeps F z^2 / (2 give) and takes the rest. The body has its own balance.
#[test]
fn no_energy_is_lost_or_found() {
    energy(0.0, 0.0, 0.0);
    // Braking by 1.2 m/s2 on a bank, in wind.
    energy(-1.2e-3, 0.06, 300.0);
    energy(-1.2e-3, -0.06, -300.0);
}

fn energy(gains_m_per_s: f64, bank_rad: f64, wind_n: f64) {
    let vehicle = VehicleParameters::default();
    let bar = ColumnParameters {
        kind: ColumnKind::TorsionBar,
        b_tb_nms_per_rad: 0.1,
        sensor_noise_nm: 0.0,
        ..ColumnParameters::default()
    };
    let world = WorldParameters {
        wind_n,
        wind_lever_m: 0.3,
        ..WorldParameters::default()
    };
    let scenario = Scenario::builder().column(bar).world(world).build().unwrap();
    let mut plant = BarPlant::new(&scenario).with_assist(Assist::Points(Curve::usual(1.0)));
    let (j_c, b_c) = (vehicle.j_s - bar.j_w_kg_m2, vehicle.b_s - bar.b_w_nms_per_rad);
    let stored = |x: &[f64; 13]| {
        let friction = |nm: f64, z: f64| nm * z * z / (2.0 * bar.friction_give_rad);
        let column = 0.5
            * (bar.j_w_kg_m2 * x[3] * x[3] + j_c * x[6] * x[6] + bar.k_tb_nm_per_rad * (x[2] - x[5]).powi(2))
            + friction(bar.upper_friction_nm, x[4])
            + friction(bar.lower_friction_nm, x[7]);
        [column, 0.5 * (vehicle.m * x[0] * x[0] + vehicle.i * x[1] * x[1])]
    };
    let k_aln = vehicle.aligning_stiffness();
    let power = |x: &[f64; 13], hands_nm: f64, v: f64| {
        let front_slip = vehicle.k_t * x[5] - (x[0] + vehicle.l_f * x[1]) / v;
        let aligning = -k_aln * front_slip;
        // |w| z^2 / give^2 is what Dahl's friction turns into heat.
        let slides = |nm: f64, w: f64, z: f64| nm * w.abs() * (z / bar.friction_give_rad).powi(2);
        let heat = bar.b_w_nms_per_rad * x[3] * x[3]
            + b_c * x[6] * x[6]
            + bar.b_tb_nms_per_rad * (x[3] - x[6]).powi(2)
            + slides(bar.upper_friction_nm, x[3], x[4])
            + slides(bar.lower_friction_nm, x[6], x[7]);
        let front = 2.0 * vehicle.k_f * front_slip;
        let rear = -2.0 * vehicle.k_r * (x[0] - vehicle.l_r * x[1]) / v;
        let side = front + rear + wind_n - vehicle.m * (9.81 * bank_rad.sin() + v * x[1]);
        let turning = vehicle.l_f * front - vehicle.l_r * rear + 0.3 * wind_n;
        [
            hands_nm * x[3] + (x[10] + aligning) * x[6] - heat,
            side * x[0] + turning * x[1],
        ]
    };
    let (mut given, mut moved) = ([0.0; 2], [0.0_f64; 2]);
    for k in 0..8000 {
        let [hands, guidance] = torques(k);
        let [from, to] = [k, k + 1].map(|k| V + gains_m_per_s * f64::from(k));
        let before = power(plant.state(), hands, from);
        plant.step(&Acting {
            speed_m_per_s: [from, to],
            bank_rad,
            ..acting(hands, guidance)
        });
        let after = power(plant.state(), hands, to);
        for of in 0..2 {
            given[of] += 0.5e-3 * (before[of] + after[of]);
            moved[of] = moved[of].max(stored(plant.state())[of]);
        }
    }
    let left = stored(plant.state());
    for of in 0..2 {
        let balance = given[of] - left[of];
        assert!(
            moved[of] > 0.01 && balance.abs() < 0.01 * moved[of],
            "{balance} of {} J, bank {bank_rad}",
            moved[of]
        );
    }
}

/// By hand: sqrt(143.24/0.044)/2 pi = 9.08 Hz with the column held (heavy); with it free sqrt(143.24 (1/0.044 + 1/0.066))/2 pi =
/// 11.72 Hz, a little more with the tyres' stiffness.
#[test]
fn the_wheel_on_its_bar_swings_where_arithmetic_says() {
    let hz = |vehicle: &VehicleParameters| {
        let linear = Linear::new(
            &plant_in(ColumnParameters::default(), Assist::None, vehicle),
            V,
            0.0,
        );
        let fast = linear.eigenvalues(Hands::Free).into_iter();
        let fast = fast
            .filter(|[re, im]| *im > 30.0 && *re > -300.0)
            .map(|[re, im]| re.hypot(im) / TAU);
        fast.fold(0.0, f64::max)
    };
    let held = VehicleParameters {
        j_s: 2.0,
        b_s: 0.57,
        ..Default::default()
    };
    let by_hand = (143.24_f64 * (1.0 / 0.044 + 1.0 / 1.956)).sqrt() / TAU;
    assert!((hz(&held) / by_hand - 1.0).abs() < 0.01, "{}", hz(&held));
    let free = (143.24_f64 * (1.0 / 0.044 + 1.0 / 0.066)).sqrt() / TAU;
    assert!((free - 11.72).abs() < 0.01 && (hz(&VehicleParameters::default()) / free - 1.0).abs() < 0.02);
}

/// A heavy slow turn of the hands: the sensor reads what passes through the bar, in steps, up to its range, on both sides.
#[test]
fn the_sensor_has_its_range_resolution_and_offset() {
    for side in [1.0, -1.0] {
        let bar = ColumnParameters {
            sensor_offset_nm: side * 0.2,
            sensor_noise_nm: 0.0,
            ..ColumnParameters::default()
        };
        let mut weak = plant(bar, Assist::None);
        let mut strong = weak.clone();
        for _ in 0..4000 {
            weak.step(&acting(side * 2.0, 0.0));
            strong.step(&acting(side * 15.0, 0.0));
        }
        let read = weak.sensor_torque_nm();
        let steps = read / bar.sensor_resolution_nm;
        assert!((steps - steps.round()).abs() < 1e-6, "{read}");
        assert!(
            (read - weak.bar_torque_nm() - side * 0.2).abs() < 0.0026,
            "{read} {}",
            weak.bar_torque_nm()
        );
        assert!(
            (strong.sensor_torque_nm() - side * 10.0).abs() < 1e-9,
            "{}",
            strong.sensor_torque_nm()
        );
    }
}

/// By hand for hands that hold the wheel, slope g = 4, the tyres' stiffness small beside the bar: of 1 N.m behind the assist the hands
/// feel 1/(1 + g) = 0.2, in front of it g/(1 + g) = 0.8 N.m.
#[test]
fn the_assist_takes_an_overlay_and_gives_an_offset() {
    for (inject, expected) in [(Inject::Overlay, 0.2), (Inject::Offset, 0.8)] {
        let mut plant = plant(ColumnParameters::default(), Assist::Slope(4.0));
        plant.motor.inject = inject;
        let linear = Linear::new(&plant, V, 0.0);
        let [felt, motor] = linear.guidance(Hands::Fixed, 0.0, 0.01).unwrap();
        assert!((felt.norm() / expected - 1.0).abs() < 0.02, "{inject:?}: {felt}");
        // What the motor does is what turns the column: but for the tyres' part, the torque of the bar.
        assert!(felt.re < 0.0 && (motor.re + felt.re).abs() < 0.05, "{motor}");
    }
}

/// Nobody holds the wheel, and the motor turns it: the ECU is told the bar's torque and the column's angle, the record has what is
/// true, and the driver feels what comes through the bar. By hand for a bar without an assist: 3 N.m on a wheel of 0.044 of
/// 0.11 kg.m2 pass the bar with 1.2 N.m.
#[test]
fn the_guidance_reads_the_bar_and_the_record_has_the_hands() {
    for side in [1.0, -1.0] {
        let text = "[column]\nkind = \"torsion-bar\"\nangle = \"column\"\nsensor_noise_nm = 0\nupper_friction_nm = 0\n\
                    lower_friction_nm = 0\n[assist]\nmotor_lag_s = 0.0002\n";
        let scenario = Scenario::from_toml("s", text, |_, _| unreachable!()).unwrap();
        let pair = haptic_sim::parts::PaperPair::without_driver(&scenario);
        let mut simulation = Simulation::with_driver_vehicle(&scenario, pair, Held(side * 3.0));
        let (mut most, mut apart) = (0.0_f64, 0.0_f64);
        for _ in 0..60 {
            let outcome = simulation.step(&Action::default()).unwrap();
            most = most.max(-side * outcome.observation.driver_torque_nm);
            if let Some(sample) = outcome.sample {
                assert_eq!(sample.driver_torque_nm, 0.0);
                assert_eq!(sample.assist_torque_nm, Some(0.0));
                apart = apart.max((sample.wheel_angle_rad - outcome.observation.wheel_angle_rad).abs());
            }
        }
        // A swing of the bar goes up to twice of what passes in the mean.
        assert!((1.2..2.5).contains(&most), "{most}");
        assert!((0.008..0.018).contains(&apart), "{apart}");
        let view = simulation.view().unwrap();
        assert!((view.guidance_torque_nm - side * 3.0).abs() < 1e-3, "{view:?}");
    }
}

/// A guidance of one torque.
struct Held(f64);

impl haptic_sim::guidance::Guidance for Held {
    fn looks_at_road(&self, _step: u32) -> bool {
        false
    }

    fn step(&mut self, _observation: &haptic_sim::guidance::Observation) -> haptic_sim::guidance::Actuation {
        haptic_sim::guidance::Actuation {
            torque_nm: self.0,
            limited: false,
        }
    }
}
