//! Drivers of a known truth, recorded as the cars of others record real people: slowly, with lane lines that are noisy, a torque in
//! steps and a torsion bar that feels the wheel's inertia. Read by the layout `openlka`, what is made of them? And what, if
//! `identify` is told the wheel's inertia, rightly or wrongly?
//!
//! The lines differ in one property each, so that they tell what makes K_hg identifiable on a road.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use haptic_analysis::identify::{
    Identification, Layout, Options, Recording, Traces, identify_with_noise_model, of_bytes,
};
use haptic_log::formats::Format;
use haptic_log::trace::Trace;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::torsion_bar::{ColumnKind, ColumnParameters};
use haptic_sim::participants::PublishedDriver;
use haptic_sim::simulation;
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;
use rand_distr::{Distribution, Normal};

use super::corruption::random_of;
use super::corruptions::{CorruptionLine, Corruptions, Held, SoughtWheel};
use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, each};
use haptic_batch::experiment::{COMPARED, Compared, ExperimentPlan, compared, guided, scenario_of_drive};

/// How a drive is recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Rows a second.
    pub rate_hz: f64,
    /// From the drive's 60th second on, s.
    pub length_s: f64,
    /// Whether the guidance holds the probe.
    pub probe: bool,
    /// Moment of inertia of the wheel, which lies between the hands and the torsion bar, kg.m2. Zero: the hands' torque.
    pub wheel_kg_m2: f64,
    /// Friction of that wheel, N.m, where the drive goes through the simulator's column with a bar, of 143 N.m/rad; none: the paper's column
    /// of one piece, and the bar's torque is `T_d - J_w phi''`.
    pub plant_friction_nm: Option<f64>,
    /// What `identify` is told of it as `--wheel-inertia`, kg.m2.
    pub told_kg_m2: Option<f64>,
    /// Whether `identify` is told `--wheel-inertia estimate`.
    pub is_sought: bool,
    /// Whether each driver's arm is drawn: t_nms of 0.06 to 0.15 s, K_nms of 0.5 to 1.5 N.m/rad.
    pub other_arm: bool,
    /// Standard deviation of each lane line, m.
    pub line_noise_m: f64,
}

const ROAD: Channel = Channel {
    rate_hz: 10.0,
    length_s: 60.0,
    probe: false,
    wheel_kg_m2: 0.04,
    plant_friction_nm: None,
    told_kg_m2: None,
    is_sought: false,
    other_arm: false,
    line_noise_m: 0.02,
};
const LONG: Channel = Channel {
    length_s: 130.0,
    ..ROAD
};
const PROBED: Channel = Channel { probe: true, ..LONG };
const FAST: Channel = Channel {
    rate_hz: 100.0,
    ..PROBED
};
const fn told(inertia_kg_m2: f64) -> Channel {
    Channel {
        told_kg_m2: Some(inertia_kg_m2),
        ..FAST
    }
}

const fn sought(wheel_kg_m2: f64) -> Channel {
    Channel {
        wheel_kg_m2,
        is_sought: true,
        ..told(wheel_kg_m2)
    }
}

const fn plant(friction_nm: f64) -> Channel {
    Channel {
        wheel_kg_m2: 0.044,
        plant_friction_nm: Some(friction_nm),
        ..told(0.044)
    }
}

/// The channels, with what each is.
pub const CHANNELS: [(&str, Channel); 22] = [
    ("10 Hz, 60 s, no probe, torsion bar", ROAD),
    ("10 Hz, 130 s, no probe, torsion bar", LONG),
    ("10 Hz, 60 s, probe, torsion bar", Channel { probe: true, ..ROAD }),
    ("10 Hz, 130 s, probe, torsion bar", PROBED),
    (
        "10 Hz, 130 s, probe, torque of the hands",
        Channel {
            wheel_kg_m2: 0.0,
            ..PROBED
        },
    ),
    (
        "20 Hz, 130 s, probe, torque of the hands",
        Channel {
            rate_hz: 20.0,
            wheel_kg_m2: 0.0,
            ..FAST
        },
    ),
    ("100 Hz, 130 s, probe, torsion bar", FAST),
    ("100 Hz, 130 s, probe, torsion bar, its wheel told", told(0.04)),
    (
        "100 Hz, 130 s, probe, torque of the hands",
        Channel {
            wheel_kg_m2: 0.0,
            ..FAST
        },
    ),
    (
        "100 Hz, 130 s, probe, torque of the hands, lines without noise",
        Channel {
            wheel_kg_m2: 0.0,
            line_noise_m: 0.0,
            ..FAST
        },
    ),
    ("100 Hz, 130 s, probe, torsion bar, told 10 % less", told(0.036)),
    ("100 Hz, 130 s, probe, torsion bar, told 10 % more", told(0.044)),
    ("100 Hz, 130 s, probe, torsion bar, told 30 % less", told(0.028)),
    ("100 Hz, 130 s, probe, torsion bar, told 30 % more", told(0.052)),
    (
        "100 Hz, 130 s, probe, the simulator's bar, its wheel told",
        plant(0.0),
    ),
    (
        "100 Hz, 130 s, probe, the simulator's bar, its wheel told, with 0.01 N.m of friction",
        plant(0.01),
    ),
    (
        "100 Hz, 130 s, probe, the simulator's bar, its wheel told, with 0.1 N.m of friction",
        plant(0.1),
    ),
    (
        "100 Hz, 130 s, probe, torsion bar, its wheel of 0.02 kg.m2 sought",
        sought(0.02),
    ),
    (
        "100 Hz, 130 s, probe, torsion bar, its wheel of 0.06 kg.m2 sought",
        sought(0.06),
    ),
    (
        "100 Hz, 130 s, probe, torsion bar, its wheel sought, other arms",
        Channel {
            other_arm: true,
            ..sought(0.04)
        },
    ),
    (
        "100 Hz, 130 s, no probe, torsion bar, its wheel sought",
        Channel {
            probe: false,
            ..sought(0.04)
        },
    ),
    (
        "100 Hz, 130 s, probe, the simulator's bar, its wheel sought",
        Channel {
            is_sought: true,
            ..plant(0.0)
        },
    ),
];

/// Records the guided drives of `plan` with `seeds` seeds from its own on by each of [`CHANNELS`], and identifies each as `identify
/// --layout openlka` does. The corruptions of the result are the channels; no
/// information bound is given for them. What is promised is promised of those whose wheel is told rightly or not at all;
/// of those whose wheel is sought it is that none is false.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a recording that the layout refuses.
pub fn recordings(plan: &ExperimentPlan, seeds: u32, watch: &Watch<'_>) -> Result<Corruptions, StudyError> {
    let layout = Layout::named("openlka")?;
    let jobs = guided(plan, seeds)?;
    let found = each(&jobs, watch, |&(number, truth, seed)| {
        let usual = truth.parameters();
        let drive = |channel: &Channel, driver| channel.driven(plan, (number, &truth, seed), driver);
        let of_rigid = [drive(&ROAD, usual)?, drive(&PROBED, usual)?];
        let mut random = random_of(&plan.repetition(seed), number);
        let fit = |(_, channel): &(&str, Channel)| {
            let mut driver = usual;
            if channel.other_arm {
                driver.t_nms = random.random_range(0.06..0.15);
                driver.k_nms = random.random_range(0.5..1.5);
            }
            let bytes = if channel.other_arm || channel.plant_friction_nm.is_some() {
                channel.record(&drive(channel, driver)?, &mut random)
            } else {
                channel.record(&of_rigid[usize::from(channel.probe)], &mut random)
            };
            let fit = identified(bytes, &layout, channel)?;
            Ok((compared(&truth, &fit.parameters), fit))
        };
        CHANNELS.iter().map(fit).collect::<Result<Vec<_>, StudyError>>()
    })?;
    let mut wheels = Vec::new();
    let lines = CHANNELS.iter().enumerate().map(|(k, (name, channel))| {
        let fits: Vec<([Compared; COMPARED], Identification)> =
            found.iter().map(|each| each[k].clone()).collect();
        if channel.is_sought {
            wheels.push(SoughtWheel::new(name, channel.wheel_kg_m2, &fits));
        }
        CorruptionLine::new(name, &fits)
    });
    let is_judged = |(_, channel): &(&str, Channel)| {
        !channel.is_sought && channel.told_kg_m2.is_none_or(|told| told == channel.wheel_kg_m2)
    };
    let (judged, others) = lines
        .zip(&CHANNELS)
        .partition::<Vec<_>, _>(|(_, channel)| is_judged(channel));
    let judged = judged.into_iter().map(|(line, _)| line).collect();
    let mut found = Corruptions::new(plan, seeds, judged, [f64::NAN; COMPARED]);
    for (line, (_, channel)) in others {
        if channel.is_sought && line.false_identifications > 0 {
            let (count, name) = (line.false_identifications, line.corrupted_by);
            found
                .broken
                .push(format!("{count} false identifications, none is wanted: {name}"));
        }
        found.lines.push(line);
    }
    found.wheels = wheels;
    let all = found
        .intervals
        .iter()
        .fold(Held::default(), |sum, held| sum + *held);
    // Fewer do not tell 95 from 100 %.
    let told = all.share().filter(|_| all.identified >= 100);
    if let Some(share) = told.filter(|share| !(0.93..=0.97).contains(share)) {
        found.broken.push(format!(
            "the 95 % intervals of {} identified values hold the truth in {:.1} %, 93 to 97 are wanted",
            all.identified,
            100.0 * share
        ));
    }
    Ok(found)
}

fn identified(bytes: Vec<u8>, layout: &Layout, channel: &Channel) -> Result<Identification, StudyError> {
    let how = Recording::default();
    let (log, _) = of_bytes(bytes, Some(Format::Csv), Some(layout), &[], &how)?;
    let mut options = Options::default();
    if channel.is_sought {
        options.take_inertia("estimate")?;
    } else {
        options.wheel_inertia = channel.told_kg_m2;
    }
    let mut fit = identify_with_noise_model(&log, &options);
    fit.traces = Traces::default();
    Ok(fit)
}

impl Channel {
    /// A guided drive of a participant as this driver, in the car that the channel records.
    fn driven(
        &self,
        plan: &ExperimentPlan,
        (number, truth, seed): (u32, &PublishedDriver, u64),
        driver: DriverParameters,
    ) -> Result<Trace, StudyError> {
        let plan = ExperimentPlan {
            probe_nm: if self.probe { plan.probe_nm } else { 0.0 },
            ..plan.repetition(seed)
        };
        let mut scenario = scenario_of_drive(&plan, number, truth, driver)?;
        if let Some(upper_friction_nm) = self.plant_friction_nm {
            let column = ColumnParameters {
                kind: ColumnKind::TorsionBar,
                j_w_kg_m2: self.wheel_kg_m2,
                upper_friction_nm,
                lower_friction_nm: 0.3,
                ..ColumnParameters::default()
            };
            let guidance = scenario.guidance().told_of(&column);
            scenario = scenario.to_builder().column(column).guidance(guidance).build()?;
        }
        Ok(simulation::simulate(&scenario).trace)
    }

    /// A drive as this car writes it, with openpilot's names and signs.
    fn record(&self, drive: &Trace, random: &mut Xoshiro256PlusPlus) -> Vec<u8> {
        let mut text = String::from(
            "Time,op_lat_enable,vEgo,aEgo,latOutput,op_curvature_desired,op_curvature_actual,op_state_steer_torque,\
             op_state_steer_angle,op_left_laneline,op_right_laneline,body_yaw_angle,body_roll_angle\n",
        );
        let Ok(noise) = Normal::new(0.0, self.line_noise_m) else {
            unreachable!("the deviations are constants of 0 m and more")
        };
        let samples = &drive.samples;
        let every = (drive.sample_rate_hz / self.rate_hz).round() as usize;
        let first = (60.0 * drive.sample_rate_hz) as usize;
        let rows = (self.length_s * self.rate_hz) as usize;
        let places = (0..rows).map(|row| first + row * every);
        // The vehicle's heading since the first row, rad.
        let mut heading = 0.0;
        for k in places.take_while(|k| k + 1 < samples.len()) {
            let now = &samples[k];
            let acceleration = 0.5
                * drive.sample_rate_hz
                * (samples[k + 1].wheel_rate_rad_per_s - samples[k - 1].wheel_rate_rad_per_s);
            // Torque in steps of 0.01 N.m, angle of 1/16 deg.
            let torque = now
                .bar_torque_nm
                .unwrap_or(now.driver_torque_nm - self.wheel_kg_m2 * acceleration);
            let torque = 0.01 * (100.0 * torque).round();
            let angle = (16.0 * now.wheel_angle_rad.to_degrees()).round() / 16.0;
            let [left, right] = [-1.8, 1.8].map(|line| now.lateral_error_m + line + noise.sample(random));
            let speed = now.speed_m_per_s;
            let _ = writeln!(
                text,
                "{:.4},True,{speed:.4},0,{:.5},{:.7},{:.7},{torque:.2},{angle},{left:.4},{right:.4},{:.5},0",
                now.time_s,
                // The layout takes it for a share of 3 N.m.
                now.guidance_torque_nm / 3.0,
                -now.curvature_1pm,
                -now.yaw_rate_rad_per_s / speed,
                PI - (heading + PI).rem_euclid(TAU),
            );
            heading += samples[k..samples.len().min(k + every)]
                .iter()
                .map(|sample| sample.yaw_rate_rad_per_s / drive.sample_rate_hz)
                .sum::<f64>();
        }
        text.into_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// Every row of a drive that is a straight line, by hand: 1 N.m and 0.2 rad/s2 at a wheel of 0.04 kg.m2 are 0.992 N.m, which is
    /// 0.99 in steps of 0.01; 0.1 rad are 5.7296 deg, 5.75 in steps of 1/16; lines 0.3 m to the left of the car's are at 1.8 m; 0.04 rad/s
    /// for 0.1 s are 0.004 rad, negative to the left.
    #[test]
    fn a_row_is_what_the_car_would_write() {
        let sample = |k: u32| {
            let mut sample = haptic_log::trace::Sample::default();
            sample.time_s = f64::from(k) / 200.0;
            sample.wheel_angle_rad = 0.1;
            sample.wheel_rate_rad_per_s = 0.2 * sample.time_s;
            sample.driver_torque_nm = 1.0;
            sample.guidance_torque_nm = 0.3;
            sample.lateral_error_m = 0.3;
            sample.curvature_1pm = 0.002;
            sample.yaw_rate_rad_per_s = 0.04;
            sample.speed_m_per_s = 20.0;
            sample
        };
        let drive = Trace {
            sample_rate_hz: 200.0,
            samples: (0..12_400).map(sample).collect(),
        };
        let channel = Channel {
            line_noise_m: 0.0,
            ..ROAD
        };
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let text = String::from_utf8(channel.record(&drive, &mut random)).unwrap();
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(rows.len(), 20, "2 s at 10 Hz");
        assert_eq!(
            rows[1],
            "60.1000,True,20.0000,0,0.10000,-0.0020000,-0.0020000,0.99,5.75,-1.5000,2.1000,-0.00400,0"
        );
    }
}
