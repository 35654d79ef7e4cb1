//! The closed loop for a page: a scenario in, steps under a hand, samples, an identification and a log out.
//!
//! Plain functions of WebAssembly, without a bundler or generated glue. Text goes through one buffer each way: the page writes
//! UTF-8 where [`take`] says and reads the answer at [`text`]. There is one run at a time. No model and no maths is here.

mod replay;
mod words;

use std::sync::{Mutex, MutexGuard, PoisonError};

use haptic_analysis::identify::{DriveLog, Options, identify_with_noise_model};
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Guidance as GuidanceMessage, Message};
use haptic_log::trace::{CHANNELS, Sample, Trace};
use haptic_sim::action::WorldFaults;
use haptic_sim::input::InputError;
use haptic_sim::simulation::{Ending, SAMPLE_RATE_HZ};
use haptic_sim::{Action, Scenario, Simulation};
use serde_json::{Value, json};

/// Numbers of [`now`], by their places: time, arc length, lateral error, heading error, wheel angle, driver torque, applied
/// torque, mode, limit, warning, e_y and e_theta at the driver's points, speed, wheel rate, steps, diverged.
const NOW: usize = 16;

struct Run {
    scenario: Scenario,
    simulation: Simulation,
    /// The actuator's ear: how the page knows mode and limit.
    receiver: ReceiverState,
    trace: Trace,
    now: [f64; NOW],
}

#[derive(Default)]
struct Lab {
    input: Vec<u8>,
    output: String,
    numbers: Vec<f64>,
    run: Option<Run>,
}

static LAB: Mutex<Lab> = Mutex::new(Lab {
    input: Vec::new(),
    output: String::new(),
    numbers: Vec::new(),
    run: None,
});

fn lab() -> MutexGuard<'static, Lab> {
    LAB.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Lab {
    /// Puts an answer, or what is wrong, where the page reads it.
    fn answer(&mut self, result: Result<String, String>) -> u32 {
        let good = result.is_ok();
        self.output = result.unwrap_or_else(|wrong| wrong);
        good.into()
    }

    fn begin(&mut self) -> Result<String, String> {
        let text = std::str::from_utf8(&self.input).map_err(|e| e.to_string())?;
        let scenario = Scenario::from_toml("this page", text, |course, _| {
            Err(InputError::new(course, "a page has the built-in course alone"))
        })
        .map_err(|e| e.to_string())?;
        scenario.check_times()?;
        self.run = Some(Run {
            simulation: Simulation::new(&scenario),
            receiver: ReceiverState::TRUSTED,
            trace: Trace {
                sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
                samples: Vec::new(),
            },
            now: [0.0; NOW],
            scenario,
        });
        Ok(String::new())
    }
}

impl Run {
    /// One step; whether there was one.
    fn step(&mut self, action: &Action) -> bool {
        let Some(outcome) = self.simulation.step(action) else {
            self.now[15] = f64::from(u8::from(matches!(
                self.simulation.ending(),
                Some(Ending::Diverged { .. })
            )));
            return false;
        };
        if let Some(Ok(said)) = outcome
            .frames_out
            .first()
            .map(|frame| GuidanceMessage::decode(&mut self.receiver, frame))
        {
            self.now[7] = f64::from(said.mode as u8);
            self.now[8] = f64::from(said.limit as u8);
            self.now[9] = f64::from(u8::from(said.warning));
        }
        if let Some(Sample {
            s_m,
            lateral_error_m,
            heading_error_rad,
            wheel_rate_rad_per_s,
            ..
        }) = outcome.sample
        {
            (self.now[1], self.now[2], self.now[3]) = (s_m, lateral_error_m, heading_error_rad);
            self.now[13] = wheel_rate_rad_per_s;
        }
        let seen = outcome.observation;
        self.now[0] = outcome.time_s();
        self.now[4] = seen.wheel_angle_rad;
        self.now[5] = seen.driver_torque_nm;
        self.now[6] = outcome.applied_torque_nm;
        (self.now[10], self.now[11]) = (outcome.preview.e_y_m, outcome.preview.e_theta_rad);
        self.now[12] = seen.speed_m_per_s;
        self.now[14] = f64::from(seen.step);
        self.trace.samples.extend(outcome.sample);
        true
    }

    fn csv(&self) -> Result<String, String> {
        let mut csv = Vec::new();
        self.trace.write_csv(&mut csv).map_err(|e| e.to_string())?;
        String::from_utf8(csv).map_err(|e| e.to_string())
    }

    fn identified(&self, manual: bool) -> Result<String, String> {
        let log = DriveLog::read(self.csv()?.as_bytes(), manual);
        let log = log.map_err(|why| words::refusal(&why.to_string(), &self.trace))?;
        let options = Options::given(manual, &[]).map_err(|e| e.to_string())?;
        let found = identify_with_noise_model(&log, &options);
        let parameters: Vec<Value> = found
            .parameters
            .list()
            .into_iter()
            .map(|(name, unit, parameter)| json!({"name": name, "unit": unit, "found": parameter}))
            .collect();
        let notes = words::notes(&found, manual);
        Ok(json!({"fit_percent": found.fit_percent, "parameters": parameters, "notes": notes}).to_string())
    }
}

/// Where the page may write so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn take(bytes: usize) -> *mut u8 {
    let mut lab = lab();
    lab.input = vec![0; bytes];
    lab.input.as_mut_ptr()
}

/// Where the last answer stands.
#[unsafe(no_mangle)]
pub extern "C" fn text() -> *const u8 {
    lab().output.as_ptr()
}

/// How long it is.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    lab().output.len()
}

/// Begins the scenario that was written; 0 and a sentence if it cannot be.
#[unsafe(no_mangle)]
pub extern "C" fn begin() -> u32 {
    let mut lab = lab();
    let result = lab.begin();
    lab.answer(result)
}

/// So many steps of 1 ms under a hand's torque; how many there were.
#[unsafe(no_mangle)]
pub extern "C" fn step(
    steps: u32,
    hand_nm: f64,
    engage: u32,
    authority: f64,
    torque_lost: u32,
    lane_lost: u32,
) -> u32 {
    let mut lab = lab();
    let Some(run) = &mut lab.run else {
        return 0;
    };
    let action = Action {
        engage: Some(engage != 0),
        authority: Some(authority),
        hand_torque_nm: if hand_nm.is_finite() { hand_nm } else { 0.0 },
        world: WorldFaults {
            torque_lost: torque_lost != 0,
            lane_lost: lane_lost != 0,
        },
        ..Action::default()
    };
    (0..steps).take_while(|_| run.step(&action)).count() as u32
}

/// So many steps as the scenario has them, without a hand; how many there were.
#[unsafe(no_mangle)]
pub extern "C" fn play(steps: u32) -> u32 {
    let mut lab = lab();
    let Some(run) = &mut lab.run else {
        return 0;
    };
    (0..steps).take_while(|_| run.step(&Action::default())).count() as u32
}

/// Where the numbers of this instant stand.
#[unsafe(no_mangle)]
pub extern "C" fn now() -> *const f64 {
    let mut lab = lab();
    let now = lab.run.as_ref().map_or([0.0; NOW], |run| run.now);
    lab.numbers = now.to_vec();
    lab.numbers.as_ptr()
}

/// The centre of the road from the vehicle on, every `every_m`: x forward and y left of the direction of movement, in turn.
#[unsafe(no_mangle)]
pub extern "C" fn road(every_m: f64, count: u32) -> *const f64 {
    let mut lab = lab();
    let mut points = Vec::new();
    if let Some(run) = &lab.run {
        let course = run.scenario.course().centreline();
        let (here, ..) = course.at(run.now[1]);
        let [offset, turned] = [run.now[2], here.heading_rad + run.now[3]];
        let place = [
            here.x_m - offset * here.heading_rad.sin(),
            here.y_m + offset * here.heading_rad.cos(),
        ];
        for k in 0..count {
            let s_m = (run.now[1] + f64::from(k) * every_m).min(course.length_m());
            let (ahead, ..) = course.at(s_m);
            let [dx, dy] = [ahead.x_m - place[0], ahead.y_m - place[1]];
            points.push(dx * turned.cos() + dy * turned.sin());
            points.push(dy * turned.cos() - dx * turned.sin());
        }
    }
    lab.numbers = points;
    lab.numbers.as_ptr()
}

/// How many samples were recorded.
#[unsafe(no_mangle)]
pub extern "C" fn samples() -> usize {
    lab().run.as_ref().map_or(0, |run| run.trace.samples.len())
}

/// The samples of a channel, by its place among the columns of the log.
#[unsafe(no_mangle)]
pub extern "C" fn channel(place: usize) -> *const f64 {
    let mut lab = lab();
    let values = match (CHANNELS.get(place), &lab.run) {
        (Some(channel), Some(run)) => run.trace.samples.iter().map(channel.value).collect(),
        _ => Vec::new(),
    };
    lab.numbers = values;
    lab.numbers.as_ptr()
}

/// The log so far, as the command line writes it.
#[unsafe(no_mangle)]
pub extern "C" fn csv() -> u32 {
    let mut lab = lab();
    let result = lab
        .run
        .as_ref()
        .ok_or_else(|| "there is no run".to_owned())
        .and_then(Run::csv);
    lab.answer(result)
}

/// Who drove: the parameters of the log so far as JSON; 0 and a sentence if it tells nothing.
#[unsafe(no_mangle)]
pub extern "C" fn identify(manual: u32) -> u32 {
    let mut lab = lab();
    let run = lab.run.as_ref().ok_or_else(|| "there is no run".to_owned());
    let result = run.and_then(|run| run.identified(manual != 0));
    lab.answer(result)
}

/// What the shipping ECU sends on the bus that was written; 0 and a sentence if it cannot be read.
#[unsafe(no_mangle)]
pub extern "C" fn replay() -> u32 {
    let mut lab = lab();
    let result = std::str::from_utf8(&lab.input)
        .map_err(|e| e.to_string())
        .and_then(replay::replay);
    lab.answer(result)
}
