//! A drive recorded on the bus, as the text of candump: what is computed from it, and what is refused.
//!
//! The truth is the driver model that drove, and the lane errors that it saw.

use std::fmt::Write;
use std::path::Path;
use std::sync::LazyLock;

use haptic_analysis::identify::{
    DriveLog, Options, Recording, SingleTrack, identify_with_noise_model, open_mapped,
};
use haptic_batch::identify::single_track;
use haptic_sim::models::driver::{ArmGains, DriverParameters};
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::scenario::{Scenario, Speed};
use haptic_sim::simulation::{self, Outcome};

/// What candump would have written, and the driver's e_theta at each millisecond.
static DRIVE: LazyLock<(String, Vec<f64>)> = LazyLock::new(|| record(&scenario()));

fn scenario() -> Scenario {
    let scenario = Scenario::builder()
        .driver(DriverParameters {
            t_p: 0.15,
            remnant_sd_nm: 0.07,
            ..DriverParameters::default()
        })
        .gains(ArmGains { k_d: 3.0, k_hg: 0.4 })
        .seed(5)
        .guidance(crate::probing());
    scenario.build().unwrap()
}

fn record(scenario: &Scenario) -> (String, Vec<f64>) {
    let (mut text, mut seen) = (String::new(), Vec::new());
    let watch = |outcome: &Outcome| {
        seen.push(outcome.preview.e_theta_rad);
        let time_s = 1_700_000_000.0 + f64::from(outcome.observation.step) * 1e-3;
        for frame in outcome.frames_in.iter().chain(outcome.frames_out) {
            write!(text, "({time_s:.6}) can0 {:03X}#", frame.id()).unwrap();
            for byte in frame.data() {
                write!(text, "{byte:02X}").unwrap();
            }
            text.push('\n');
        }
    };
    simulation::observe(scenario, watch);
    (text, seen)
}

fn open(text: &str, dbc: Option<&str>) -> Result<(DriveLog, Vec<String>), String> {
    let directory = tempfile::tempdir().unwrap();
    let [trace, dbc_file] = ["trace.log", "mine.dbc"].map(|name| directory.path().join(name));
    std::fs::write(&trace, text).unwrap();
    if let Some(dbc) = dbc {
        std::fs::write(&dbc_file, dbc).unwrap();
    }
    let how = Recording {
        dbc: dbc.map(|_| dbc_file.as_path()),
        ..Recording::default()
    };
    open_mapped(&trace, None, &[], &how).map_err(|e| e.to_string())
}

/// The largest error of the far point that was computed, rad, past the first seconds, in which the vehicle model forgets how
/// it began.
fn largest_error(log: &DriveLog, seen: &[f64]) -> f64 {
    let mut largest: f64 = 0.0;
    for k in 600..log.len() {
        let ms = k as f64 / 120.0 * 1000.0;
        let (whole, share) = (ms.floor() as usize, ms.fract());
        let truth = seen[whole] + share * (seen[whole + 1] - seen[whole]);
        largest = largest.max((log.e_theta_rad[k] - truth).abs());
    }
    largest
}

/// K_hg and (K_d + K_nms)*a_i of the scenario: 0.4; 4*0.1, 4*0.05, 4*3.7; and its t_p.
fn assert_found(log: &DriveLog) {
    let p = identify_with_noise_model(log, &Options::default()).parameters;
    assert!(p.k_hg.identified && (p.k_hg.estimate.unwrap() - 0.4).abs() < 0.05);
    for (parameter, truth) in [(p.gain_1, 0.4), (p.gain_2, 0.2), (p.gain_3, 14.8), (p.t_p, 0.15)] {
        let (centre, error) = (parameter.optimum.unwrap(), parameter.standard_error.unwrap());
        assert!(
            (centre - truth).abs() < 4.0 * error,
            "{parameter:?} against {truth}"
        );
    }
}

#[test]
fn the_driver_is_found_from_the_bus() {
    let (text, seen) = &*DRIVE;
    let (log, note) = open(text, None).unwrap();
    assert!(note[0].contains("far point"));
    // Within 0.5 mrad of what the driver saw, where the guidance's own error would be off by tens.
    let largest = largest_error(&log, seen);
    assert!(largest < 5e-4, "{largest}");
    assert_found(&log);
}

/// A logger that gets the date after 60 s: before, its clock counts from when it was switched on.
#[test]
fn a_clock_that_was_set_during_a_trace_is_refused_or_cut_at_its_line() {
    let (text, _) = &*DRIVE;
    let begin_s = 1_700_000_000.0;
    let mut set_at = 0;
    let jumped: Vec<String> = (1..)
        .zip(text.lines())
        .map(|(line, content)| {
            let (time, frame) = content[1..].split_once(')').unwrap();
            let since_s = time.parse::<f64>().unwrap() - begin_s;
            if since_s >= 60.0 {
                set_at = if set_at == 0 { line } else { set_at };
                return content.to_owned();
            }
            format!("({since_s:.6}){frame}")
        })
        .collect();
    let jumped = jumped.join("\n");
    let error = open(&jumped, None).unwrap_err();
    let line: usize = error
        .split("line ")
        .nth(1)
        .unwrap()
        .split(':')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    // The first of the frames that are needed is among the first of the new clock.
    assert!((set_at..set_at + 5).contains(&line), "{error} {set_at}");
    assert!(
        error.contains("the time goes from 59.99") && error.contains("to 1700000060"),
        "{error}"
    );

    let directory = tempfile::tempdir().unwrap();
    let trace = directory.path().join("trace.log");
    std::fs::write(&trace, &jumped).unwrap();
    let (whole, _) = open(text, None).unwrap();
    let within = |from_s: f64, to_s: f64| {
        let stretches = &[(from_s, to_s)];
        let how = Recording {
            stretches,
            ..Recording::default()
        };
        open_mapped(&trace, None, &[], &how).unwrap().0
    };
    let before = within(f64::NEG_INFINITY, 50.0);
    assert!(
        (59.0..60.0).contains(&(before.len() as f64 * before.dt_s)),
        "{}",
        before.len()
    );
    // Stamps of candump are rounded to a microsecond.
    let torques = before.driver_torque_nm.iter().zip(&whole.driver_torque_nm);
    assert!(torques.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-3);
    let after = within(begin_s, f64::INFINITY);
    assert!((after.start_s - begin_s - 60.0).abs() < 0.1, "{}", after.start_s);
    let lost = (whole.len() - after.len()) as f64 * whole.dt_s;
    assert!((lost - 60.0).abs() < 0.1, "{lost}");
}

/// Between 45 and 85 km/h, by up to 3 m/s2, in the curves too: the driver's model has no speed in it, and the far point is
/// computed with the speed of each instant.
#[test]
fn a_speed_that_changes_hides_no_driver() {
    let (mut time, mut kmh) = (Vec::new(), Vec::new());
    for round in 0..7 {
        let at = 30.0 * f64::from(round) + 5.0;
        time.extend([at, at + 4.0, at + 11.0, at + 14.8, at + 22.0, at + 26.0]);
        kmh.extend([60.0, 85.0, 85.0, 45.0, 45.0, 60.0]);
    }
    let scenario = scenario().to_builder().speed(Speed::by_time_kmh(time, &kmh));
    let scenario = scenario.build().unwrap();
    let (text, seen) = record(&scenario);
    let (log, _) = open(&text, None).unwrap();
    let largest = largest_error(&log, &seen);
    assert!(largest < 5e-4, "{largest}");
    assert_found(&log);

    let mut csv = Vec::new();
    simulation::simulate(&scenario).trace.write_csv(&mut csv).unwrap();
    let from_csv = DriveLog::read(&csv[..], false).unwrap();
    assert_found(&from_csv);
    // The balance of torques on the column takes one speed: it would call the torque sensor wrong.
    for log in [log, from_csv] {
        assert!(
            log.findings.iter().any(|[what, ..]| what == "speed"),
            "{:?}",
            log.findings
        );
        assert!(
            identify_with_noise_model(&log, &Options::default())
                .balance
                .is_none()
        );
    }
}

/// The default drive, without remnant and probe: what the bus does not carry exactly is all the noise there is, and it
/// draws K_hg (truth: 0.5) beyond 1. Nothing that goes with K_hg may then be called known; what stays put along its
/// ridge is, and the truth (4*0.1, 4*0.05, 4*3.7; 0.1 s) lies there.
#[test]
fn a_bound_that_the_data_contradict_takes_the_verdict_of_all_that_it_moves() {
    let (text, _) = record(&Scenario::default());
    let (log, _) = open(&text, None).unwrap();
    let found = identify_with_noise_model(&log, &Options::default());
    let p = &found.parameters;
    assert!(p.k_hg.on_bound && p.k_hg.optimum == Some(1.0));
    for parameter in [p.gain_1, p.gain_2, p.gain_3, p.t_p, p.k_hg] {
        assert!(!parameter.identified && parameter.estimate.is_none());
        assert!(parameter.interval_95.is_none(), "{parameter:?}");
    }
    assert!(found.notes.iter().any(|n| n.contains("k_hg rests on a bound")));
    assert!(
        !found
            .notes
            .iter()
            .any(|n| n.contains("standard error is too large"))
    );
    let on_ridge = found
        .combinations
        .iter()
        .find(|c| c.name.starts_with("gain_3 - "))
        .unwrap();
    let slope: f64 = on_ridge.name["gain_3 - ".len()..]
        .trim_end_matches("*k_hg")
        .parse()
        .unwrap();
    assert!((on_ridge.estimate - (14.8 - 0.5 * slope)).abs() < 4.0 * on_ridge.standard_error);
}

#[test]
fn a_trace_that_lacks_something_is_refused_with_the_reason() {
    // 20 s, every line of which has an equal length per message.
    let text: String = DRIVE
        .0
        .lines()
        .take_while(|line| *line < "(1700000020")
        .flat_map(|line| [line, "\n"])
        .collect();
    let without = |id: &str| -> String {
        text.lines()
            .filter(|line| !line.contains(id))
            .flat_map(|line| [line, "\n"])
            .collect()
    };
    for (id, says) in [
        (
            " 100#",
            "no frame 100 (LanePreview), so no LanePreview_LateralError",
        ),
        (" 110#", "no frame 110 (Column), so no Column_DriverTorque"),
        (" 0C0#", "no frame 0C0 (Guidance), so no Guidance_Torque"),
        (" 120#", "no frame 120 (Vehicle), so no Vehicle_Speed1"),
    ] {
        let error = open(&without(id), None).unwrap_err();
        assert!(error.ends_with(says), "{error}");
    }
    let short: String = text.lines().take(3000).flat_map(|line| [line, "\n"]).collect();
    assert!(open(&short, None).unwrap_err().contains("less than 10 s"));
    // Half a byte more: those lines are left out, and said to be.
    let error = open(&text.replace(" 120#", " 120#0"), None).unwrap_err();
    assert!(
        error.ends_with("no frame 120 (Vehicle), so no Vehicle_Speed1"),
        "{error}"
    );

    let dbc = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("core/haptic.dbc")).unwrap();
    let error = open(&text, Some(&dbc.replace("Column_WheelAngle", "Angle"))).unwrap_err();
    assert!(
        error.ends_with("the DBC file has no signal Column_WheelAngle"),
        "{error}"
    );
    let (a, b) = (open(&text, Some(&dbc)).unwrap(), open(&text, None).unwrap());
    assert_eq!(a, b);
}

/// A minute of the drive with a hundred milliseconds of silence, some frames dropped, some with a flipped bit and some sent
/// twice: what is wrong is counted exactly, not used, and the driver is found all the same.
#[test]
fn what_is_wrong_with_the_frames_is_counted_and_not_used() {
    let minute: Vec<&str> = DRIVE.0.lines().take_while(|line| *line < "(1700000120").collect();
    let column = |line: &&&str| line.contains(" 110#");
    let columns: Vec<&str> = minute.iter().filter(column).copied().collect();
    // Of the column's frames, far from each other and from the silence.
    let [dropped, flipped, twice] = [10, 20, 30].map(|share: usize| {
        (1..7)
            .map(|k| columns[columns.len() * share / 100 + 40 * k])
            .collect::<Vec<_>>()
    });
    let silence = |line: &str| line.starts_with("(1700000107.3");
    let lost_in_silence = columns.iter().filter(|line| silence(line)).count();
    let mut text = String::new();
    for line in minute
        .into_iter()
        .filter(|line| !silence(line) && !dropped.contains(line))
    {
        if flipped.contains(&line) {
            // The last bit of the last byte.
            let last = u8::from_str_radix(&line[line.len() - 2..], 16).unwrap() ^ 1;
            writeln!(text, "{}{last:02X}", &line[..line.len() - 2]).unwrap();
        } else {
            writeln!(text, "{line}").unwrap();
        }
        if twice.contains(&line) {
            writeln!(text, "{line}").unwrap();
        }
    }
    let (log, _) = open(&text, None).unwrap();
    let of = |what: &str| log.findings.iter().find(|f| f[0] == what).unwrap()[1].clone();
    let lost = 6 + 6 + lost_in_silence;
    assert!(
        of("Column").ends_with(&format!("6 with a wrong CRC, 6 repeated; {lost} lost")),
        "{}",
        of("Column")
    );
    assert!(
        of("Column_DriverTorque").starts_with("1 pause, the longest of 0.10"),
        "{:?}",
        log.findings
    );
    let found = identify_with_noise_model(&log, &Options::default());
    let k_hg = found.parameters.k_hg;
    assert!(
        (k_hg.estimate.unwrap() - 0.4).abs() < 4.0 * k_hg.standard_error.unwrap(),
        "{k_hg:?}"
    );
}

/// A wheel angle turns another vehicle otherwise: the far point of a drive with another one is that driver's only if
/// the vehicle is said.
#[test]
fn the_far_point_is_that_of_the_vehicle_that_was_given() {
    let heavy = VehicleParameters {
        m: 1600.0,
        i: 4200.0,
        ..VehicleParameters::default()
    };
    let scenario = Scenario::builder().vehicle(heavy).build().unwrap();
    let (text, seen) = record(&scenario);
    let directory = tempfile::tempdir().unwrap();
    let trace = directory.path().join("trace.log");
    std::fs::write(&trace, text).unwrap();
    let given = single_track(&scenario);
    let worst = |vehicle: Option<SingleTrack>| {
        let recording = Recording {
            vehicle,
            ..Recording::default()
        };
        let (log, _) = open_mapped(&trace, None, &[], &recording).unwrap();
        (600..log.len())
            .map(|k| {
                let ms = k as f64 / 120.0 * 1000.0;
                let (whole, share) = (ms.floor() as usize, ms.fract());
                let truth = seen[whole] + share * (seen[whole + 1] - seen[whole]);
                (log.e_theta_rad[k] - truth).abs()
            })
            .fold(0.0, f64::max)
    };
    let (right, wrong) = (worst(Some(given)), worst(None));
    assert!(right < 5e-4 && wrong > 2.0 * right, "{right} {wrong}");
}
