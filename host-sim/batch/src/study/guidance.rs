//! Whether a recording was driven with the guidance of its condition: its strength, and its probe.

use std::f64::consts::TAU;

use haptic_log::trace::Trace;

use super::Session;
use crate::engine::{StudyError, refuse};

/// Length of the stretches that the probe's amplitude is the median of, s.
const STRETCH_S: f64 = 4.0;
/// Largest factor between the guidance recorded and that of the condition: envelope and rates make the rest.
const STRENGTH_WITHIN: f64 = 1.5;

/// # Errors
/// Another guidance, in words.
pub(super) fn check(session: &Session, trace: &Trace) -> Result<(), StudyError> {
    let guidance = session.scenario.guidance();
    let p = &guidance.controller;
    let condition = &session.condition;
    let scaled = p.low_speed_share != 1.0 || p.high_speed_share != 1.0;
    let found_nm = amplitude_nm(trace, p.probe_frequency_hz);
    let wanted_nm = if guidance.probe { p.probe_amplitude_nm } else { 0.0 };
    let differs = |found_nm: f64| (found_nm - wanted_nm).abs() > 0.5 * p.probe_amplitude_nm;
    if let Some(found_nm) = found_nm.filter(|found_nm| !scaled && differs(*found_nm)) {
        return refuse(format!(
            "driven with a probe of {found_nm:.3} N.m at {} Hz, and condition {condition} has one of {wanted_nm:.3} N.m",
            p.probe_frequency_hz
        ));
    }
    // A law that weighs what the driver does, or the speed, is no fixed share of the errors.
    let strength = strength(trace, [p.k_1 * p.a_1, p.k_1 * p.a_3]).filter(|_| !scaled && p.law == 0.0);
    let within = 1.0 / STRENGTH_WITHIN..=STRENGTH_WITHIN;
    if let Some(strength) = strength.filter(|strength| !within.contains(strength)) {
        return refuse(format!(
            "driven with {strength:.2} times the guidance of condition {condition} (K_1 {} N.m): {:.2} to {STRENGTH_WITHIN} times is \
             taken for the same",
            p.k_1,
            within.start()
        ));
    }
    Ok(())
}

/// Amplitude of the guidance torque at a frequency, N.m: the median over stretches, each without its mean and behind a Hann window, in
/// which slow torques leave nothing. None of a drive that is shorter than a stretch.
fn amplitude_nm(trace: &Trace, frequency_hz: f64) -> Option<f64> {
    let rows = (STRETCH_S * trace.sample_rate_hz) as usize;
    let of_stretch = |stretch: &[haptic_log::trace::Sample]| {
        let window = |k: usize| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / rows as f64).cos();
        let weights: f64 = (0..rows).map(window).sum();
        let each = || stretch.iter().enumerate().map(|(k, s)| (window(k), s));
        let mean = each().map(|(w, s)| w * s.guidance_torque_nm).sum::<f64>() / weights;
        let [mut cosine, mut sine] = [0.0; 2];
        for (w, s) in each() {
            let phase = TAU * frequency_hz * s.time_s;
            cosine += w * (s.guidance_torque_nm - mean) * phase.cos();
            sine += w * (s.guidance_torque_nm - mean) * phase.sin();
        }
        2.0 * f64::hypot(cosine, sine) / weights
    };
    let mut all: Vec<f64> = trace.samples.chunks_exact(rows.max(1)).map(of_stretch).collect();
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Slope of the guidance torque over what the condition's gains make of the camera's errors, where there is guidance; none of a
/// recording without these errors.
fn strength(trace: &Trace, [by_e_y, by_e_theta]: [f64; 2]) -> Option<f64> {
    let rows = trace.samples.iter().filter(|s| s.guidance_torque_nm != 0.0);
    let pairs = rows.map(|s| {
        let wanted = by_e_y * s.guidance_e_y_m + by_e_theta * s.guidance_e_theta_rad;
        (wanted, s.guidance_torque_nm)
    });
    let [mut both, mut square] = [0.0; 2];
    for (wanted, found) in pairs.filter(|(wanted, _)| wanted.is_finite()) {
        both += wanted * found;
        square += wanted * wanted;
    }
    (square > 0.0).then(|| both / square)
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptic_log::trace::Sample;

    /// 20 s of a probe of 0.2 N.m at 2.5 Hz on a slow torque that is 0.7 times what gains of 0.5 and 10 make of the errors.
    #[test]
    fn probe_and_strength_are_those_of_the_torque() {
        let sample = |k: u32| {
            let mut sample = Sample::default();
            sample.time_s = f64::from(k) / 200.0;
            sample.guidance_e_y_m = 0.4 * (TAU * 0.05 * sample.time_s).sin();
            sample.guidance_e_theta_rad = 0.01;
            let wanted = 0.5 * sample.guidance_e_y_m + 10.0 * sample.guidance_e_theta_rad;
            sample.guidance_torque_nm = 0.7 * wanted + 0.2 * (TAU * 2.5 * sample.time_s).sin();
            sample
        };
        let trace = Trace {
            sample_rate_hz: 200.0,
            samples: (0..4000).map(sample).collect(),
        };
        assert!((amplitude_nm(&trace, 2.5).unwrap() - 0.2).abs() < 1e-3);
        assert!(amplitude_nm(&trace, 3.5).unwrap() < 1e-3);
        assert!((strength(&trace, [0.5, 10.0]).unwrap() - 0.7).abs() < 0.01);
        assert_eq!(
            amplitude_nm(
                &Trace {
                    samples: Vec::new(),
                    ..trace
                },
                2.5
            ),
            None
        );
    }
}
