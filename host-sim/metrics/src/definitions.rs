//! The list of metrics: one entry gives a metric its name, unit, label, definition and source.
//!
//! The struct, its documentation and the table printed in reports all come from this one list, so that a
//! report can never explain a metric in other words than the code does. How each value is computed is NOT
//! here: see the parent module.

use serde::Serialize;

/// What one metric means.
#[derive(Debug, Clone, Copy)]
pub struct Definition {
    /// Field name in [`Metrics`], with its unit.
    pub name: &'static str,
    /// Short name for tables.
    pub label: &'static str,
    /// Unit as printed.
    pub unit: &'static str,
    /// How the value is defined.
    pub definition: &'static str,
    /// Where the definition comes from.
    pub source: &'static str,
    /// Reads the metric.
    pub value: fn(&Metrics) -> Option<f64>,
}

macro_rules! metrics {
    ($($name:ident, $label:literal, $unit:literal, $definition:literal, $source:literal;)*) => {
        /// The metrics of one run over one window. `None` (`null` in JSON) where a metric has no value; never
        /// NaN or infinite.
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
        pub struct Metrics {
            $(#[doc = concat!($label, ", ", $unit, ". ", $definition, " Source: ", $source, ".")]
            pub $name: Option<f64>,)*
        }

        /// Every metric, in the order of the fields of [`Metrics`].
        pub const DEFINITIONS: &[Definition] = &[$(Definition {
            name: stringify!($name),
            label: $label,
            unit: $unit,
            definition: $definition,
            source: $source,
            value: |metrics| metrics.$name,
        },)*];
    };
}

metrics! {
    duration_s, "Duration", "s",
        "Number of samples in the window over the sample rate: each sample stands for one sample interval.",
        "ours";
    peak_lateral_error_m, "Peak lateral error", "m",
        "Largest |e|; e is the offset of the centre of gravity from the centreline.",
        "Wang et al. 2022, section 5";
    mean_abs_lateral_error_m, "Mean lateral error", "m",
        "Mean of |e|.",
        "Wang et al. 2022, section 5";
    sdlp_m, "SDLP", "m",
        "Standard deviation of lateral position: of e about its own mean, divisor N.",
        "Verster and Roth 2011, Int. J. General Medicine 4:359-371";
    time_out_of_lane_s, "Time out of lane", "s",
        "Time with a side of the vehicle (width 1.7 m) beyond the lane: |e| + 0.85 m > half the lane width. \
         The vehicle's angle to the road is neglected: it moves its sides by less than 0.1 % of the width \
         up to 2 degrees.",
        "SAE J2944:2015, lane departure";
    min_time_to_lane_crossing_s, "Minimum TLC", "s",
        "Smallest time to lane crossing. TLC: the time until a side of the vehicle reaches a lane boundary \
         if speed and yaw rate stay what they are (a circle of radius v/r, tangent to the direction of \
         movement) on a road that keeps its present curvature. Zero when out of lane; infinite if nothing is \
         crossed within half a turn; no value if infinite throughout.",
        "van Winsum, Brookhuis and de Waard 2000, Accid. Anal. Prev. 32:47-56; Mammar, Glaser and Netto 2006, \
         IEEE Trans. ITS 7:226-241";
    p15_time_to_lane_crossing_s, "15 % TLC", "s",
        "15th percentile of TLC over all samples, infinite ones included, with linear interpolation between \
         ranks; no value if infinite.",
        "Godthelp, Milgram and Blaauw 1984, Human Factors 26:257-268";
    reversals_3deg_per_min, "Steering reversals, 3 deg", "1/min",
        "Steering wheel reversals larger than 3 deg per minute, after a second-order Butterworth low-pass of \
         0.6 Hz run forward and backward. Visual load. Where the probe is on, a notch of 0.5 Hz about its \
         frequency takes it out first.",
        "Markkula and Engstroem 2006, 13th ITS World Congress; SAE J2944:2015";
    reversals_0p1deg_per_min, "Steering reversals, 0.1 deg", "1/min",
        "The same with 0.1 deg and 2 Hz. Cognitive load.",
        "Markkula and Engstroem 2006, 13th ITS World Congress; SAE J2944:2015";
    sd_wheel_angle_rad, "SD of wheel angle", "rad",
        "Standard deviation of the steering wheel angle about its mean, divisor N.",
        "Oestlund et al. 2005, AIDE deliverable D2.2.5";
    mean_abs_driver_torque_nm, "Mean driver torque", "N.m",
        "Driver effort: mean of |T_d|.",
        "Mulder, Abbink and Boer 2012, Human Factors 54:786-798";
    rms_driver_torque_nm, "RMS driver torque", "N.m",
        "Driver effort: root of the mean of T_d squared.",
        "Mulder, Abbink and Boer 2012, Human Factors 54:786-798";
    peak_driver_torque_nm, "Peak driver torque", "N.m",
        "Largest |T_d|.",
        "ours";
    integral_squared_driver_torque_nm2s, "Driver effort integral", "N2.m2.s",
        "Integral of T_d squared over time, as a sum over samples.",
        "the quadratic control effort of optimal-control driver models, e.g. Cole 2012, Vehicle System Dynamics";
    mean_abs_guidance_torque_nm, "Mean guidance torque", "N.m",
        "Mean of |T_h|, the torque really applied.",
        "ours";
    rms_guidance_torque_nm, "RMS guidance torque", "N.m",
        "Root of the mean of T_h squared.",
        "ours";
    peak_guidance_torque_nm, "Peak guidance torque", "N.m",
        "Largest |T_h|.",
        "Wang et al. 2022, section 3.2 (against its 5 N.m limit)";
    limited_time_share, "Time at a limit", "1",
        "Share of time in which a limit held the guidance torque back; a mode that allows none (a fade, \
         Standby) is no limit. No value without guidance.",
        "ours";
    conflict_time_share, "Conflict", "1",
        "Share of time in which driver and guidance turn the wheel against each other: T_d and T_h of opposite \
         sign, both larger than a dead band of 0.005 N.m (the torque sensor's resolution: less has no sign). \
         The probe is taken out of both first, as for reversals. No value without guidance.",
        "Boink, van Paassen, Mulder and Abbink 2014, IEEE SMC; the dead band is ours";
    mean_abs_driver_torque_in_conflict_nm, "Driver torque in conflict", "N.m",
        "Mean of |T_d| over the time in conflict; no value without conflict.",
        "Boink, van Paassen, Mulder and Abbink 2014, IEEE SMC";
    guidance_authority, "Guidance authority", "1",
        "Share of the guidance in the steering effort: integral |T_h| / (integral |T_h| + integral |T_d|). \
         0 is manual, 1 is automatic. Integrals of magnitudes keep it in 0..1 where T_h + T_d passes zero; no \
         value if both are zero throughout.",
        "level of haptic authority: Abbink, Mulder and Boer 2012, Cogn. Tech. Work 14:19-28; the ratio of \
         integrals is ours";
    peak_lateral_error_after_failure_m, "Peak after failure", "m",
        "Largest |e| from the instant of the failure to the end of the window, a stretch between the failure and \
         the window included; no value if the failure comes behind the window.",
        "Wang et al. 2022, section 5.2";
    time_to_recover_s, "Time to recover", "s",
        "Time from the failure to the first sample from which |e| stays at or below the peak of the same run \
         without failure until the window ends. Both are taken over the window and, if the failure comes before \
         it, from the failure on. 0: never above it. No value: above it at the end, or the failure comes behind \
         the window.",
        "ours";
    mean_speed_m_per_s, "Mean speed", "m/s",
        "Mean of v over time.",
        "ours";
    min_speed_m_per_s, "Least speed", "m/s",
        "Smallest v.",
        "ours";
    max_speed_m_per_s, "Largest speed", "m/s",
        "Largest v.",
        "ours";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_other_programs_read_are_fields_in_json() {
        let json = serde_json::to_value(Metrics::default()).unwrap();
        for name in [
            "peak_lateral_error_m",
            "mean_abs_lateral_error_m",
            "peak_guidance_torque_nm",
            "peak_driver_torque_nm",
        ] {
            assert!(json[name].is_null(), "{name}");
            assert!(json.as_object().unwrap().contains_key(name), "{name}");
        }
    }

    #[test]
    fn a_definition_reads_its_own_field() {
        let metrics = Metrics {
            sdlp_m: Some(0.25),
            ..Metrics::default()
        };
        let with_value: Vec<_> = DEFINITIONS
            .iter()
            .filter(|d| (d.value)(&metrics).is_some())
            .collect();
        assert_eq!(with_value.len(), 1);
        assert_eq!(with_value[0].name, "sdlp_m");
    }
}
