//! What an identification says of a drive, for whoever drove it in the page: no option of a command line, no line of a
//! file.

use haptic_analysis::identify::{
    COLUMNS, DriveLog, Identification, Options, Reason, SPEED_COLUMN, identify_with_noise_model,
};
use haptic_log::table::{TableReader, number};
use haptic_sim::participants::{PublishedDriver, participants};
use serde_json::{Value, json};

use crate::LabResult;

/// What the columns of a log are to a driver.
const WORDS: [(&str, &str); 5] = [
    ("e_y_m", "the car's distance from its lane ahead"),
    ("e_theta_rad", "the angle between the car and its lane ahead"),
    ("wheel_angle_rad", "the wheel's angle"),
    ("guidance_torque_nm", "the torque of the guidance"),
    ("driver_torque_nm", "your torque"),
];

/// Who drove a log: fit, parameters with their intervals and the paper's fourteen beside them, notes.
pub(crate) fn identified(csv: &str, manual: bool) -> LabResult<String> {
    let log = drive(csv, manual).map_err(|why| refusal(&why.to_string(), csv))?;
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

/// The page's own time series as a log. The readers of other programs' recordings would be half of the page.
fn drive(csv: &str, manual: bool) -> LabResult<DriveLog> {
    let mut table = TableReader::new(csv.as_bytes())?;
    let place = |name| table.header().iter().position(|own| own == name);
    let at = |name: &'static str| place(name).ok_or(format!("there is no column {name}"));
    let mut places = [0; 6];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = at(name)?;
    }
    let speed = place(SPEED_COLUMN);
    let (mut columns, mut speeds) = ([const { Vec::new() }; 6], Vec::new());
    while let Some(row) = table.next_row()? {
        let value = |place| number(&row.field(place)).unwrap_or(f64::NAN);
        for (column, place) in columns.iter_mut().zip(places) {
            column.push(value(place));
        }
        speeds.extend(speed.map(value));
    }
    let mut log = DriveLog::from_columns(columns, manual)?;
    log.tell_speed(&speeds);
    Ok(log)
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

/// Why a drive cannot be looked at. A log names the row, from 1, behind the line with the columns' names.
fn refusal(why: &str, csv: &str) -> String {
    let at = why.strip_prefix("row ").and_then(|rest| {
        let (row, what) = rest.split_once(": ")?;
        let row = csv.lines().nth(row.parse().ok()?)?;
        Some((row.split(',').next()?.parse::<f64>().ok()?, what))
    });
    let Some((time_s, what)) = at else {
        let plain = why
            .replace("the log covers", "your drive lasts")
            .replace("the sensor measures nothing", "nobody held the wheel");
        return WORDS
            .iter()
            .fold(plain, |why, (name, words)| why.replace(name, words));
    };
    let column = WORDS.iter().find(|(name, _)| what.starts_with(name));
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
