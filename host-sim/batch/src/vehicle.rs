//! The vehicle of a recorded drive as a scenario's tables.

use std::collections::BTreeMap;
use std::fmt::Write;

use haptic_log::recording::Recording;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::Scenario;
use haptic_vehicle::{
    Known, Quantity, VehicleColumns, VehicleIdentification, VehicleLog, Verdict, identify_vehicle,
};
use serde::Serialize;

use crate::drivers::Intervals;
use crate::engine::StudyError;
use crate::statistics::Confidence;

/// The vehicle of a drive, with intervals of a level.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IdentifiedVehicle {
    /// What the drive tells. What is called identified is a matter of 95 %, as are the intervals beside each quantity; what a manoeuvre
    /// would tell is of the level.
    #[serde(flatten)]
    pub identification: VehicleIdentification,
    /// How often the intervals of the report hold.
    #[serde(skip_serializing_if = "Confidence::is_usual")]
    pub level: Confidence,
    /// Intervals of that level, where it is not 95 %.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: Intervals,
}

impl IdentifiedVehicle {
    fn new(mut identification: VehicleIdentification, level: Confidence) -> Self {
        let mut intervals = Intervals::new();
        if !level.is_usual() {
            let tells = identification.manoeuvres.iter_mut().flat_map(|of| &mut of.tells);
            tells.for_each(|telling| telling.hold_at(level.normal()));
            let quantities = identification.quantities.iter();
            intervals.extend(quantities.map(|q| (q.name, q.interval(level.normal()))));
        }
        Self {
            identification,
            level,
            intervals,
        }
    }

    /// The interval of a quantity at the level.
    #[must_use]
    pub fn interval(&self, quantity: &Quantity) -> Option<[f64; 2]> {
        let own = self.intervals.get(quantity.name);
        own.map_or(quantity.interval_95, |interval| *interval)
    }
}

/// Identifies the vehicle of a recording, of which pauses up to `bridge_s` are bridged.
///
/// # Errors
/// Columns that are missing or cannot be.
pub fn identify(
    recording: &Recording,
    known: &Known,
    bridge_s: f64,
    level: Confidence,
) -> Result<IdentifiedVehicle, StudyError> {
    let columns = VehicleColumns::of(recording, bridge_s)?;
    let log = VehicleLog::new(&columns, known.wheelbase_m)?;
    Ok(IdentifiedVehicle::new(identify_vehicle(&log, known), level))
}

/// Six digits: more than any drive tells.
fn digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// The trail E_t with which a vehicle has an aligning stiffness, equation (4).
fn trail(k_aln: f64, k_f: f64, k_t: f64, k_s: f64) -> f64 {
    k_aln / (2.0 * k_f * (k_t - k_aln / k_s))
}

/// A scenario with the vehicle that was found: `[vehicle]`, and the friction in `[world]` where there is some. Each value says whether it is identified;
/// where the column is not told, table 9's stays. None where nothing was found.
///
/// # Errors
/// A value that no scenario may have.
pub fn scenario_file(found: &VehicleIdentification, log: &str) -> Result<Option<String>, StudyError> {
    let Some(best) = &found.best else { return Ok(None) };
    let table_9 = VehicleParameters::default();
    let quantity = |name: &str| found.quantities.iter().find(|q| q.name == name);
    let mut lines = vec![
        ("m_kg", best.m, None),
        ("i_kg_m2", best.i, quantity("i")),
        ("l_f_m", best.l_f, quantity("l_f")),
        ("l_r_m", best.l_r, quantity("l_f")),
        ("k_f_n_per_rad", best.k_f, quantity("k_f")),
        ("k_r_n_per_rad", best.k_r, quantity("k_r")),
        ("k_t", best.k_t, quantity("steering_ratio")),
    ];
    if let Some(column) = &best.column {
        let e_t = trail(column.k_aln, best.k_f, best.k_t, table_9.k_s);
        lines.push(("e_t_m", e_t, quantity("k_aln")));
        lines.push(("b_s_nms_per_rad", column.b_s, quantity("b_s")));
        lines.push(("j_s_kg_m2", column.j_s, quantity("j_s")));
    }
    let mut text = format!(
        "# The vehicle of {}, as host-sim identify-vehicle found it.\n[vehicle]\n",
        log.replace(char::is_control, "?")
    );
    for (field, value, quantity) in lines {
        // The trail alone is never told: it makes K_aln of the stiffnesses beside it.
        let whose = if field == "e_t_m" { "K_aln " } else { "" };
        let _ = writeln!(text, "{field} = {} # {whose}{}", digits(value), remark(quantity));
    }
    if best.column.is_some() {
        let _ = writeln!(
            text,
            "# k_s is table 9's: only K_aln can be told, and e_t makes it of k_s and k_f."
        );
    } else {
        let _ = writeln!(
            text,
            "# The column is not told: e_t, b_s, j_s and k_s are table 9's."
        );
    }
    let friction = quantity("friction").filter(|q| q.verdict == Verdict::Identified);
    let surely = friction.and_then(|q| {
        q.estimate
            .filter(|_| q.interval_95.is_some_and(|[low, _]| low > 0.0))
    });
    if let Some(friction) = surely {
        let _ = writeln!(text, "\n[world]\nfriction_nm = {} # identified", digits(friction));
    }
    Scenario::from_toml("vehicle.toml", &text, |_, _| {
        Ok(haptic_sim::models::road::Course::paper())
    })
    .map_err(|e| StudyError::from(format!("{e}: the values found make no scenario")))?;
    Ok(Some(text))
}

fn remark(quantity: Option<&Quantity>) -> &'static str {
    match quantity.map(|q| q.verdict) {
        None | Some(Verdict::Given) => "given",
        Some(Verdict::Identified) => "identified",
        Some(Verdict::NotIdentified) => {
            "NOT identified: with the others it makes the drive's yaw rate and torque"
        }
    }
}

#[cfg(test)]
mod tests;
