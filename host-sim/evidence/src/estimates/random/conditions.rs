//! What a drive may be like: every condition with the range that it is drawn from.
//!
//! A condition is *honest* if a log with it still tells of one driver of equation (8), who is the same throughout: the model's
//! assumptions hold, or what is beside them is what the program says that it takes care of. With any other something is wrong:
//! a sensor, the file, or the driver is not one.
//!
//! Four things that no log can tell are not here: a scale of both lane signals, an e_y that drifts, a camera that is late, an
//! offset of e_y (the driver's own line). Others that a result lists as assumed are drawn, such as torques that cannot be weighed.

use haptic_sim::models::nonlinear::Tyres;
use rand::RngExt;

use super::super::changing::Changed;
use super::super::corruption::{delay, noise};
use super::draft::{Change, Draft, Stage};
use super::rows::{E_THETA, E_Y, PHI, T_D, T_H};

/// What a condition is of; a drive has one of each at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Area {
    /// What measures.
    Sensors,
    /// Which rows there are.
    Sampling,
    /// The car.
    Vehicle,
    /// Its steering.
    Column,
    /// Who drives.
    Driver,
    /// Where, how fast, in which wind.
    Road,
    /// The haptic guidance and its probe.
    Guidance,
    /// How long, and what happens meanwhile.
    Time,
}

/// In one word.
impl std::fmt::Display for Area {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Sensors => "sensors",
            Self::Sampling => "sampling",
            Self::Vehicle => "vehicle",
            Self::Column => "column",
            Self::Driver => "driver",
            Self::Road => "road",
            Self::Guidance => "guidance",
            Self::Time => "time",
        })
    }
}

/// One condition.
#[derive(Debug)]
pub(super) struct RandomCondition {
    /// What it is of.
    pub(super) area: Area,
    /// Whether a log with it is as it should be.
    pub(super) honest: bool,
    /// Its name.
    pub(super) name: &'static str,
    /// Unit of its value; a dash for a condition without one.
    pub(super) unit: &'static str,
    /// What its value is drawn from.
    pub(super) range: [f64; 2],
    pub(super) put: fn(&mut Draft, f64),
}

/// A condition a line: area, name, unit, range, and what it does.
macro_rules! conditions {
    ($honest:literal; $($area:ident, $name:literal, $unit:literal, $low:literal, $high:literal, $put:expr;)*) => {
        [$(RandomCondition {
            area: Area::$area, honest: $honest, name: $name, unit: $unit, range: [$low, $high], put: $put,
        }),*]
    };
}

/// Conditions under which a log is as it should be.
pub(super) const HONEST: [RandomCondition; 46] = conditions! { true;
    Sensors, "noise of the lane signals", "mm and 0.1 mrad", 1.0, 30.0, |d, x| d.spoil(Stage::Sensor, move |r, random| {
        noise(&mut r.signals[E_Y], 1e-3 * x, 1, random);
        noise(&mut r.signals[E_THETA], 1e-4 * x, 1, random);
    });
    Sensors, "steps of e_theta", "mrad", 0.2, 2.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.round(E_THETA, 1e-3 * x));
    Sensors, "steps of e_y", "cm", 0.5, 5.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.round(E_Y, 1e-2 * x));
    Sensors, "steps of T_d", "N.m", 0.01, 0.05, |d, x| d.spoil(Stage::Sensor, move |r, _| r.round(T_D, x));
    Sensors, "steps of the wheel angle", "deg", 0.1, 0.6, |d, x| {
        d.spoil(Stage::Sensor, move |r, _| r.round(PHI, x.to_radians()));
    };
    Sensors, "noise of T_d", "N.m", 0.005, 0.05, |d, x| d.spoil(Stage::Sensor, move |r, random| {
        noise(&mut r.signals[T_D], x, 1, random);
    });
    Sensors, "lane samples that are off by 0.05 rad", "", 1.0, 9.0, |d, x| d.spoil(Stage::Sensor, move |r, random| {
        for _ in 0..x as usize {
            let k = r.somewhere(0.0, random).start;
            r.signals[E_THETA][k] += 0.05;
        }
    });
    Sensors, "three pauses of the lane, as zeros", "s", 0.05, 3.0, |d, x| lane_pauses(d, x, 0.0);
    Sensors, "three pauses of the lane, as no number", "s", 0.05, 3.0, |d, x| lane_pauses(d, x, f64::NAN);
    Sensors, "offset of T_d", "N.m", -0.3, 0.3, |d, x| d.spoil(Stage::Sensor, move |r, _| r.shift(T_D, x));
    Sensors, "offset of the wheel angle", "deg", -3.0, 3.0, |d, x| {
        d.spoil(Stage::Sensor, move |r, _| r.shift(PHI, x.to_radians()));
    };
    Sensors, "rows for each fresh picture", "", 2.0, 12.0, |d, x| d.spoil(Stage::Sensor, move |r, random| {
        for lane in [E_Y, E_THETA] {
            noise(&mut r.signals[lane], 0.0, x as usize, random);
        }
    });
    Sampling, "one row of", "", 2.0, 6.99, |d, x| d.spoil(Stage::Recorder, move |r, _| r.retain(|k| k % x as usize == 0));
    Sampling, "single rows lost", "%", 0.1, 10.0, |d, x| d.spoil(Stage::Recorder, move |r, random| {
        r.retain(|_| random.random_range(0.0..100.0) > x);
    });
    Sampling, "uneven true stamps: rows kept", "%", 25.0, 70.0, |d, x| d.spoil(Stage::Recorder, move |r, random| {
        r.retain(|_| random.random_range(0.0..100.0) < x);
    });
    Sampling, "stamps in whole", "ms", 1.0, 4.99, |d, x| d.spoil(Stage::File, move |r, _| {
        let step = 1e-3 * x.floor();
        r.time_s.iter_mut().for_each(|t| *t = (*t / step).round() * step);
    });
    Sampling, "stamps begin at", "s", 1e3, 1e6, |d, x| d.spoil(Stage::File, move |r, _| {
        r.time_s.iter_mut().for_each(|t| *t += x);
    });
    Vehicle, "mass times", "", 0.8, 1.8, |d, x| { d.vehicle.m *= x; d.vehicle.i *= x; };
    Vehicle, "front tyres' stiffness times", "", 0.7, 1.2, |d, x| d.vehicle.k_f *= x;
    Vehicle, "rear tyres' stiffness times", "", 0.8, 1.5, |d, x| d.vehicle.k_r *= x;
    Vehicle, "trail times", "", 0.6, 1.5, |d, x| d.vehicle.e_t *= x;
    Vehicle, "steering ratio", "", 13.0, 20.0, |d, x| d.vehicle.k_t = 1.0 / x;
    Vehicle, "saturating tyres, friction of the road", "", 0.5, 1.0, |d, x| {
        d.world.tyres = Tyres::Saturating;
        d.world.mu = x;
    };
    Column, "inertia", "kg.m2", 0.06, 0.2, |d, x| d.vehicle.j_s = x;
    Column, "damping", "N.m.s/rad", 0.3, 1.5, |d, x| d.vehicle.b_s = x;
    Column, "dry friction", "N.m", 0.03, 0.5, |d, x| d.world.friction_nm = x;
    Column, "power assist", "N.m", 3.0, 20.0, |d, x| { d.world.assist_nm = x; d.assisted = true; };
    Column, "ripple of the motor", "N.m", 0.01, 0.1, |d, x| d.world.motor_ripple_nm = x;
    Driver, "remnant", "N.m", 0.02, 0.2, |d, x| d.driver.remnant_sd_nm = x;
    Driver, "corner of the remnant", "Hz", 0.15, 2.0, |d, x| d.driver.remnant_corner_hz = x;
    Driver, "K_nms", "N.m/rad", 0.5, 1.5, |d, x| d.driver.k_nms = x;
    Driver, "t_nms", "s", 0.06, 0.15, |d, x| d.driver.t_nms = x;
    Driver, "own line, to the left", "m", -0.6, 0.6, |d, x| d.driver.line_m = x;
    Driver, "K_hg", "", 0.0, 1.0, |d, x| d.first.k_hg = Some(x);
    Driver, "t_p", "s", 0.05, 0.4, |d, x| d.first.t_p = x;
    Road, "speed", "km/h", 35.0, 90.0, |d, x| d.speed_kmh = x;
    Road, "wind", "N", -500.0, 500.0, |d, x| d.world.wind_n = x;
    Road, "gusts", "N", 50.0, 500.0, |d, x| d.world.gust_sd_n = x;
    Road, "bank", "rad", -0.05, 0.05, |d, x| d.world.bank_rad = x;
    Guidance, "probe", "N.m", 0.05, 0.22, |d, x| { d.guidance.probe = true; d.guidance.controller.probe_amplitude_nm = x; };
    Guidance, "frequency of the probe", "Hz", 1.0, 2.7, |d, x| d.guidance.controller.probe_frequency_hz = x;
    Guidance, "no probe", "-", 0.0, 1.0, |d, _| d.guidance.probe = false;
    Guidance, "K_1", "N.m", 0.1, 0.4, |d, x| d.guidance.controller.k_1 = x;
    Time, "seconds of the drive", "s", 25.0, 120.0, |d, x| d.spoil(Stage::File, move |r, random| {
        let kept = r.somewhere(x, random);
        r.retain(|k| kept.contains(&k));
    });
    Time, "hands off", "s", 5.0, 40.0, |d, x| d.spoil(Stage::Signal, move |r, random| {
        for k in r.somewhere(x, random) {
            r.signals[T_D][k] = 0.005 * f64::from(random.random_range(-1..2));
        }
    });
    Time, "standstill", "s", 5.0, 30.0, |d, x| d.spoil(Stage::Signal, move |r, random| r.stand(x, random));
};

/// Conditions that make something wrong.
pub(super) const WRONG: [RandomCondition; 36] = conditions! { false;
    Sensors, "T_d times", "", 0.4, 0.9, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(T_D, x));
    Sensors, "T_d times", "", 1.1, 2.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(T_D, x));
    Sensors, "T_d late", "ms", 5.0, 150.0, |d, x| late(d, T_D, x);
    Sensors, "T_h late", "ms", 5.0, 60.0, |d, x| late(d, T_H, x);
    Sensors, "wheel angle late", "ms", 5.0, 100.0, |d, x| late(d, PHI, x);
    Sensors, "T_d through a lag", "ms", 10.0, 200.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.lag(T_D, 1e-3 * x));
    Sensors, "T_d cut off", "N.m", 0.2, 1.0, |d, x| d.spoil(Stage::Sensor, move |r, _| {
        r.signals[T_D].iter_mut().for_each(|t| *t = t.clamp(-x, x));
    });
    Sensors, "T_d without its sign", "-", 0.0, 1.0, |d, _| d.spoil(Stage::Sensor, |r, _| {
        r.signals[T_D].iter_mut().for_each(|t| *t = t.abs());
    });
    Sensors, "sign of T_d", "-", 0.0, 1.0, |d, _| swapped(d, &[T_D]);
    Sensors, "sign of T_h", "-", 0.0, 1.0, |d, _| swapped(d, &[T_H]);
    Sensors, "sign of the wheel angle", "-", 0.0, 1.0, |d, _| swapped(d, &[PHI]);
    Sensors, "signs of the lane", "-", 0.0, 1.0, |d, _| swapped(d, &[E_Y, E_THETA]);
    Sensors, "sign of e_y", "-", 0.0, 1.0, |d, _| swapped(d, &[E_Y]);
    Sensors, "sign of e_theta", "-", 0.0, 1.0, |d, _| swapped(d, &[E_THETA]);
    Sensors, "T_d is T_d + T_h", "-", 0.0, 1.0, |d, _| d.spoil(Stage::Signal, |r, _| {
        let [.., t_h, t_d] = &mut r.signals;
        t_d.iter_mut().zip(t_h).for_each(|(d, h)| *d += *h);
    });
    Sensors, "T_h times", "", 0.3, 0.85, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(T_H, x));
    Sensors, "T_h times", "", 1.2, 3.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(T_H, x));
    Sensors, "wheel angle times", "", 0.5, 0.85, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(PHI, x));
    Sensors, "wheel angle times", "", 1.2, 2.0, |d, x| d.spoil(Stage::Sensor, move |r, _| r.scale(PHI, x));
    Sensors, "dead e_y", "-", 0.0, 1.0, |d, _| d.spoil(Stage::Sensor, |r, _| r.signals[E_Y].fill(0.0));
    Sensors, "dead e_theta", "-", 0.0, 1.0, |d, _| d.spoil(Stage::Sensor, |r, _| r.signals[E_THETA].fill(0.0));
    Sensors, "e_y and e_theta swapped", "-", 0.0, 1.0, |d, _| d.spoil(Stage::File, |r, _| r.signals.swap(E_Y, E_THETA));
    Sensors, "a new zero of the wheel angle", "deg", 2.0, 20.0, |d, x| from_somewhere(d, PHI, x.to_radians());
    Sensors, "T_d jumps by", "N.m", 0.05, 0.4, |d, x| from_somewhere(d, T_D, x);
    Sensors, "T_d is noise", "N.m", 0.05, 0.4, |d, x| d.spoil(Stage::Sensor, move |r, random| {
        r.signals[T_D].fill(0.0);
        noise(&mut r.signals[T_D], x, 1, random);
    });
    Sensors, "a torsion bar below a wheel", "kg.m2", 0.005, 0.04, |d, x| d.spoil(Stage::Signal, move |r, _| {
        let per_s2 = r.in_rows(1.0).powi(2);
        let phi = smooth(&smooth(&r.signals[PHI]));
        for k in 1..r.len() - 1 {
            r.signals[T_D][k] -= x * per_s2 * (phi[k + 1] - 2.0 * phi[k] + phi[k - 1]);
        }
    });
    Sampling, "T_d of another instant", "s", 0.2, 10.0, |d, x| late(d, T_D, 1e3 * x);
    Column, "lag of the motor", "ms", 5.0, 60.0, |d, x| d.world.motor_lag_s = 1e-3 * x;
    Column, "error of the motor", "", -0.4, 0.4, |d, x| d.world.motor_error = x;
    Driver, "K_hg steps to", "", 0.0, 1.0, |d, x| d.change = Some(Change::Step(Changed::KHg, x));
    Driver, "K_hg up by 0.5 for", "s", 4.0, 20.0, |d, x| d.change = Some(Change::Blip(0.5, x));
    Driver, "K_hg up by 0.3 and down, every", "s", 8.0, 40.0, |d, x| d.change = Some(Change::Swing(0.3, x));
    Driver, "K_hg beyond", "", 1.1, 1.8, |d, x| d.first.k_hg = Some(x);
    Driver, "K_d steps, times", "", 0.4, 2.0, |d, x| d.change = Some(Change::Step(Changed::KD, d.first.k_d * x));
    Driver, "t_p steps to", "s", 0.05, 0.45, |d, x| d.change = Some(Change::Step(Changed::TP, x));
    Guidance, "guided, called manual", "-", 0.0, 1.0, |d, _| d.called_manual = true;
};

/// The lane signals three times away, for so long, s.
fn lane_pauses(draft: &mut Draft, seconds: f64, instead: f64) {
    draft.spoil(Stage::Sensor, move |rows, random| {
        for _ in 0..3 {
            let away = rows.somewhere(seconds, random);
            for lane in [E_Y, E_THETA] {
                rows.signals[lane][away.clone()].fill(instead);
            }
        }
    });
}

fn late(draft: &mut Draft, signal: usize, ms: f64) {
    draft.spoil(Stage::Sensor, move |rows, _| {
        let behind = rows.in_rows(1e-3 * ms);
        delay(&mut rows.signals[signal], behind);
    });
}

fn swapped(draft: &mut Draft, signals: &'static [usize]) {
    draft.spoil(Stage::Sensor, move |rows, _| {
        signals.iter().for_each(|s| rows.scale(*s, -1.0))
    });
}

/// From some instant on a signal has so much more, to one side or the other.
fn from_somewhere(draft: &mut Draft, signal: usize, offset: f64) {
    draft.spoil(Stage::Sensor, move |rows, random| {
        let sign = if random.random_range(0..2) == 1 { 1.0 } else { -1.0 };
        let from = rows.somewhere(0.0, random).start;
        rows.signals[signal][from..]
            .iter_mut()
            .for_each(|x| *x += sign * offset);
    });
}

/// The mean of eleven rows; of what the steps of the angle would make of an acceleration, twice leaves little.
fn smooth(signal: &[f64]) -> Vec<f64> {
    let last = signal.len() - 1;
    let mean = |k: usize| {
        let near = &signal[k.saturating_sub(5)..=(k + 5).min(last)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..=last).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_apart_and_ranges_run_upwards() {
        let all: Vec<&RandomCondition> = HONEST.iter().chain(&WRONG).collect();
        for (i, a) in all.iter().enumerate() {
            assert!(a.range[0] < a.range[1], "{}", a.name);
            let same = |b: &&&RandomCondition| b.name == a.name && b.range == a.range;
            assert_eq!(all[i..].iter().filter(same).count(), 1, "{}", a.name);
        }
    }
}
