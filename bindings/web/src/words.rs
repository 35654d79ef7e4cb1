//! What an identification says of a drive, for whoever drove it in the page: no option of a command line, no line of a
//! file.

use haptic_analysis::identify::{DriveLog, Identification, Options, Reason, identify_with_noise_model};
use haptic_sim::participants::{PublishedDriver, participants};
use serde_json::{Value, json};

use crate::LabResult;

/// What the columns of a log are to a driver.
const COLUMNS: [(&str, &str); 5] = [
    ("e_y_m", "the car's distance from its lane ahead"),
    ("e_theta_rad", "the angle between the car and its lane ahead"),
    ("wheel_angle_rad", "the wheel's angle"),
    ("guidance_torque_nm", "the torque of the guidance"),
    ("driver_torque_nm", "your torque"),
];

/// Who drove a log: fit, parameters with their intervals and the paper's fourteen beside them, notes.
pub(crate) fn identified(csv: &str, manual: bool) -> LabResult<String> {
    let log = DriveLog::read(csv.as_bytes(), manual).map_err(|why| refusal(&why.to_string(), csv))?;
    let options = Options::given(manual, &[])?;
    let found = identify_with_noise_model(&log, &options);
    let parameters: Vec<Value> = found
        .parameters
        .list()
        .into_iter()
        .map(|(name, unit, parameter)| {
            json!({"name": name, "unit": unit, "found": parameter, "fourteen": fourteen(name, manual)})
        })
        .collect();
    let notes = notes(&found, manual);
    Ok(json!({"fit_percent": found.fit_percent, "parameters": parameters, "notes": notes}).to_string())
}

/// A parameter of the paper's fourteen participants, smallest first; none that it did not identify.
fn fourteen(name: &str, manual: bool) -> Vec<f64> {
    let of = |driver: &PublishedDriver| {
        let arm = driver.k_d + driver.parameters().k_nms;
        match name {
            "t_p" => Some(driver.t_p),
            "gain_1" => Some(arm * driver.a_1),
            "gain_2" => Some(arm * driver.a_2),
            "gain_3" => Some(arm * driver.a_3),
            "k_hg" => driver.k_hg,
            _ => None,
        }
    };
    let drivers = participants().into_iter();
    let drivers = drivers.map(|participant| {
        if manual {
            participant.manual
        } else {
            participant.guided
        }
    });
    let mut values: Vec<f64> = drivers.filter_map(|driver| of(&driver)).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Why a drive cannot be looked at. A log's reader names the line, of which the first is the columns' names.
fn refusal(why: &str, csv: &str) -> String {
    let at = why.strip_prefix("line ").and_then(|rest| {
        let (line, what) = rest.split_once(": ")?;
        let row = csv.lines().nth(line.parse::<usize>().ok()?.checked_sub(1)?)?;
        Some((row.split(',').next()?.parse::<f64>().ok()?, what))
    });
    let Some((time_s, what)) = at else {
        let plain = why
            .replace("the log covers", "your drive lasts")
            .replace("the sensor measures nothing", "nobody held the wheel");
        return COLUMNS
            .iter()
            .fold(plain, |why, (name, words)| why.replace(name, words));
    };
    let column = COLUMNS.iter().find(|(name, _)| what.starts_with(name));
    let what = column.map_or("the drive", |(_, words)| words);
    format!(
        "At {time_s:.1} s {what} was beyond what a driver on the road has. Stop before the car leaves the road, or begin again."
    )
}

/// What a driver has to know of what was found.
fn notes(found: &Identification, manual: bool) -> Vec<String> {
    let mut notes = Vec::new();
    for left_out in found.preflight.iter().flat_map(|looked| &looked.left_out) {
        let what = match left_out.reason {
            Reason::HandsOff => "nobody held the wheel",
            Reason::Standstill => "nothing moved",
            Reason::LaneChange => "you changed the lane",
            Reason::Asked | Reason::Pause => "nothing new could be seen",
        };
        let (from_s, to_s) = (left_out.from_s, left_out.to_s);
        notes.push(format!(
            "From {from_s:.1} to {to_s:.1} s {what}: that is left out."
        ));
    }
    if !found.refuted.is_empty() {
        notes.push(
            "The model of a driver does not fit this drive, so nothing is said of you. It takes one driver who steers by the \
             road ahead, all the time and in one way."
                .to_owned(),
        );
    } else if !manual && !found.parameters.k_hg.identified {
        notes.push(
            "Your weight on the guidance cannot be told: the guidance pulled as you did, or not at all. A longer drive through \
             more bends says more."
                .to_owned(),
        );
    }
    notes
}
