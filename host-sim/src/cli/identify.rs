//! `host-sim identify LOG`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use haptic_analysis::identify::{Options, WHEEL_INERTIA_KG_M2};
use haptic_batch::identify::{Method, identify, identify_pieces, identify_several};
use haptic_report::studies::identify::report;
use haptic_sim::input::in_range;
use haptic_sim::scenario::{DEFAULT_SPEED_KMH, SPEED_KMH};

use super::recording::RecordingArguments;
use super::results::{DEFAULT_OUT, ResultArguments};
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
    /// A drive without guidance: there is no K_hg (the driver's weight on the guidance), and guidance_torque_nm may be
    /// missing
    #[arg(long)]
    manual: bool,
    /// Find when the driver changed, and fit each stretch between two changes as a driver of its own
    #[arg(long, conflicts_with = "also")]
    pieces: bool,
    /// Prediction errors with a disturbance model, or the published way
    #[arg(long, value_enum, default_value_t = MethodArgument::NoiseModel)]
    method: MethodArgument,
    /// A known parameter, such as k_d=3.2 (a_1, a_2, a_3, gain_1, gain_2, gain_3, t_p, k_d, k_hg, k_nms, t_nms; by
    /// how much a column is late, s: t_h_late, t_d_late; the driver's own line, m: line_offset and line_bend, that in a left bend of
    /// 300 m at 60 km/h; of a torsion bar: wheel_inertia, kg.m2, wheel_damping, N.m.s/rad, and bar_stiffness, N.m/rad, where the angle is
    /// the column's); may be repeated. gain_i is (k_d + k_nms)*a_i; docs/glossary.md explains the others
    #[arg(long, value_name = "NAME=VALUE")]
    fix: Vec<String>,
    /// The column has a power assist that is not in guidance_torque_nm: it turns the wheel with the driver, so that the torques on the
    /// column do not tell whether driver_torque_nm is recorded too small
    #[arg(long)]
    assisted: bool,
    /// Estimate what is otherwise taken as known: k_nms, t_nms, t_h_late, t_d_late, in a range if one is given, such as
    /// t_nms=0.06..0.15; may be repeated
    #[arg(long, value_name = "NAME[=LOW..HIGH]")]
    estimate: Vec<String>,
    /// The torque was measured by a torsion bar below a steering wheel of this inertia, 0.001 to 0.2: the torque of the hands is made of it
    /// before the fit, from 40 rows a second or more. Weigh the wheel: it counts as known to 10 % (--fix wheel_inertia=J: exactly), and one that
    /// is much too small makes k_hg false. Without it driver_torque_nm is taken as the torque of the hands
    #[arg(long, value_name = "KG_M2")]
    wheel_inertia: Option<f64>,
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
    results: ResultArguments,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MethodArgument {
    Paper,
    NoiseModel,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut options = Options::given(arguments.manual, &arguments.fix)?;
    options.assisted = arguments.assisted;
    for what in &arguments.estimate {
        options.estimate(what)?;
    }
    if let Some(inertia) = arguments.wheel_inertia {
        let [least, most] = WHEEL_INERTIA_KG_M2;
        in_range("--wheel-inertia", inertia, least..=most, "kg.m2")?;
        if options.wheel_inertia.replace(inertia).is_some() {
            return Err(BadInput::from(
                "--wheel-inertia and --fix wheel_inertia: once is allowed".to_owned(),
            ));
        }
    }
    arguments.recording.reading.choose(&mut options)?;
    options.lane_noise = !arguments.no_lane_smoothing;
    options.leave_out = !arguments.no_preprocessing;
    in_range("--speed", arguments.speed, SPEED_KMH, "km/h")?;
    let method = match arguments.method {
        MethodArgument::Paper => Method::Paper,
        MethodArgument::NoiseModel => Method::NoiseModel,
    };
    let course = arguments.course.open()?;
    let output = arguments.results.begin("identify")?;
    let (log, converted) = arguments.recording.open(arguments.manual, &options.stretches)?;
    if log.approximate_points {
        eprintln!(
            "note: e_y and e_theta are made of offset and curvature of the lane, which is too rough for the driver's gains: k_hg alone \
             can be identified{}",
            if arguments.manual {
                ", and not by hand: this fit will have no verdict"
            } else {
                ""
            }
        );
    }
    let name = arguments.recording.log.display().to_string();
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
            let other = arguments
                .recording
                .open_other(path, arguments.manual, &options.stretches)?;
            logs.push(other.0);
        }
        let name = format!("{name} and {} more", arguments.also.len());
        identify_several(&name, &logs, &options)?
    };
    let notes = &mut drive.results.identification.notes;
    notes.splice(0..0, converted);
    if let Some(course) = course {
        drive.drive_again(course, arguments.speed, &options)?;
    }
    output.show(&report(&drive), &drive.results, true)
}
