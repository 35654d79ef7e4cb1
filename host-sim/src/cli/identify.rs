//! `host-sim identify LOG`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use haptic_batch::identify::{Method, identify, identify_pieces, identify_several};
use haptic_report::studies::identify::report;
use haptic_sim::input::in_range;
use haptic_sim::scenario::{DEFAULT_SPEED_KMH, SPEED_KMH};

use super::recording::{FitArguments, RecordingArguments};
use super::results::{DEFAULT_OUT, LevelArgument, ResultArguments};
use super::road::CourseArguments;
use super::{BadInput, Outcome};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/identify").help(DEFAULT_OUT)))]
pub(super) struct Arguments {
    #[command(flatten)]
    recording: RecordingArguments,
    /// One more drive of the same driver, of the same rate: all are one fit; may be repeated
    #[arg(long, value_name = "LOG")]
    also: Vec<PathBuf>,
    #[command(flatten)]
    fit: FitArguments,
    /// Find when the driver changed, and fit each stretch between two changes as a driver of its own
    #[arg(long, conflicts_with = "also")]
    pieces: bool,
    /// Prediction errors with a disturbance model, or the published way
    #[arg(long, value_enum, default_value_t = MethodArgument::NoiseModel)]
    method: MethodArgument,
    /// The torque was measured by a torsion bar below a steering wheel of this inertia, 0.001 to 0.2: the torque of the hands is made of it
    /// before the fit, from 40 rows a second or more. It counts as known to 10 % (--fix wheel_inertia=J: exactly), and one that
    /// is much too small makes k_hg false. "estimate" takes the one that the drive's probe tells, of 0.005 to 0.1, with its interval. Without it
    /// driver_torque_nm is taken as the torque of the hands
    #[arg(long, value_name = "KG_M2|estimate")]
    wheel_inertia: Option<String>,
    /// Take the lane signals as they are: no camera noise is estimated and removed
    #[arg(long)]
    no_lane_smoothing: bool,
    /// Use every row: hands off, standstill and lane changes are not looked for
    #[arg(long)]
    no_preprocessing: bool,
    #[command(flatten)]
    course: CourseArguments,
    /// Speed on that course, km/h (20 to 250)
    #[arg(long, value_name = "KMH", default_value_t = DEFAULT_SPEED_KMH)]
    speed: f64,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MethodArgument {
    Paper,
    NoiseModel,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut options = arguments.fit.options(&arguments.recording.reading)?;
    if let Some(inertia) = &arguments.wheel_inertia {
        options.take_inertia(inertia)?;
    }
    options.lane_noise = !arguments.no_lane_smoothing;
    options.leave_out = !arguments.no_preprocessing;
    in_range("--speed", arguments.speed, SPEED_KMH, "km/h")?;
    let method = match arguments.method {
        MethodArgument::Paper => Method::Paper,
        MethodArgument::NoiseModel => Method::NoiseModel,
    };
    let course = arguments.course.open()?;
    let output = arguments.results.begin("identify")?;
    let recording = &arguments.recording;
    let (log, converted) = recording.open(&recording.log, options.manual, &options.stretches)?;
    if log.approximate_points {
        eprintln!(
            "note: e_y and e_theta are made of offset and curvature of the lane, which is too rough for the driver's gains: k_hg alone \
             can be identified{}",
            if options.manual {
                ", and not by hand: this fit will have no verdict"
            } else {
                ""
            }
        );
    }
    let name = recording.log.display().to_string();
    let mut drive = if arguments.pieces {
        if method == Method::Paper {
            return Err("--pieces: the published method has none".into());
        }
        identify_pieces(&name, &log, &options)?
    } else if arguments.also.is_empty() {
        identify(&name, &log, &options, method)?
    } else {
        if method == Method::Paper {
            return Err("--also: the published method takes one drive".into());
        }
        let mut logs = vec![log];
        for path in &arguments.also {
            let (other, _) = recording.open(path, options.manual, &options.stretches)?;
            logs.push(other);
        }
        let name = format!("{name} and {} more", arguments.also.len());
        identify_several(&name, &logs, &options)?
    };
    let notes = &mut drive.results.identification.notes;
    notes.splice(0..0, converted);
    if let Some(course) = course {
        drive.drive_again(course, arguments.speed, &options)?;
    }
    drive.hold_at(arguments.level.level);
    output.show(&report(&drive), &drive.results, true)
}
