//! The closed loop for a page: a scenario in, steps under a hand, samples, metrics, an identification and a log out.
//!
//! Plain functions of WebAssembly, without a bundler or generated glue. Text goes through one buffer each way: the page writes
//! UTF-8 where [`take`] says and reads the answer at [`text`]. There is one run at a time. No model and no maths is here.

mod replay;
mod run;
mod words;

use std::sync::{Mutex, MutexGuard, PoisonError};

use haptic_sim::Action;
use haptic_sim::action::WorldFaults;
use haptic_sim::models::road::{Course, LaneChoice};
use haptic_sim::participants::participants;
use haptic_sim::scenario::FailureKind;
use run::{NOW, Run};

#[derive(Default)]
struct Lab {
    input: Vec<u8>,
    output: String,
    numbers: Vec<f64>,
    /// Roads of files, by name.
    courses: Vec<(String, Course)>,
    run: Option<Run>,
}

/// An answer for the page, or the error whose text it shows.
type LabResult<T> = Result<T, Box<dyn std::error::Error>>;

static LAB: Mutex<Lab> = Mutex::new(Lab {
    input: Vec::new(),
    output: String::new(),
    numbers: Vec::new(),
    courses: Vec::new(),
    run: None,
});

fn lab() -> MutexGuard<'static, Lab> {
    LAB.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does what it says with the text that was written; puts the answer, or what is wrong, where the page reads it.
fn answer(of: impl FnOnce(&mut Lab, &str) -> LabResult<String>) -> u32 {
    let mut lab = lab();
    let input = std::mem::take(&mut lab.input);
    let result = String::from_utf8(input)
        .map_err(Into::into)
        .and_then(|text| of(&mut lab, &text));
    let good = result.is_ok();
    lab.output = result.unwrap_or_else(|wrong| wrong.to_string());
    good.into()
}

/// Puts numbers where the page reads them.
fn numbers(of: impl FnOnce(&Run) -> Vec<f64>) -> *const f64 {
    let mut lab = lab();
    lab.numbers = lab.run.as_ref().map(of).unwrap_or_default();
    lab.numbers.as_ptr()
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

/// How many numbers stand where they were last put.
#[unsafe(no_mangle)]
pub extern "C" fn count() -> usize {
    lab().numbers.len()
}

/// Keeps the road of a file that was written, its name in the first line; 0 and a sentence if it is none. Otherwise its length in
/// metres.
#[unsafe(no_mangle)]
pub extern "C" fn keep_course() -> u32 {
    answer(|lab, text| {
        let (name, text) = text.split_once('\n').ok_or("a road has a name and a text")?;
        let course = Course::from_text(name, text, &LaneChoice::default())?;
        let length_m = course.length_m().to_string();
        lab.courses.retain(|(known, _)| known != name);
        lab.courses.push((name.to_owned(), course));
        Ok(length_m)
    })
}

/// The names of the library's laws, in their order, as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn laws() -> u32 {
    answer(|_, _| {
        let names: Vec<&str> = haptic_sim::laws::LAWS.iter().map(|law| law.name).collect();
        Ok(serde_json::to_string(&names)?)
    })
}

/// The paper's fourteen participants under guidance, as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn fourteen() -> u32 {
    answer(|_, _| {
        let guided: Vec<_> = participants().into_iter().map(|one| one.guided).collect();
        Ok(serde_json::to_string(&guided)?)
    })
}

/// Begins the scenario that was written; 0 and a sentence if it cannot be. `law` is the place of a law of the library, the number
/// behind the last one the page's own, a negative one the shipping law.
#[unsafe(no_mangle)]
pub extern "C" fn begin(law: i32, person: u32) -> u32 {
    answer(|lab, toml| {
        let law = usize::try_from(law).ok();
        lab.run = Some(Run::begin(toml, &lab.courses, law, person != 0)?);
        Ok(String::new())
    })
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
    drive(steps, &action)
}

/// So many steps as the scenario has them, without a hand; how many there were.
#[unsafe(no_mangle)]
pub extern "C" fn play(steps: u32) -> u32 {
    drive(steps, &Action::default())
}

fn drive(steps: u32, action: &Action) -> u32 {
    let mut lab = lab();
    let run = &mut lab.run;
    run.as_mut().map_or(0, |run| {
        (0..steps).take_while(|_| run.step(action)).count() as u32
    })
}

/// The largest lateral error of the next seconds, m, if the lane (not 0) or the torque (0) is lost in the coming step;
/// NaN without a run, or if something is lost already. The run itself goes on as it was.
#[unsafe(no_mangle)]
pub extern "C" fn peak_if_lost(lane: u32, lasts_s: f64) -> f64 {
    let lost = if lane != 0 {
        FailureKind::Input
    } else {
        FailureKind::Torque
    };
    let lab = lab();
    let peak_m = lab.run.as_ref().and_then(|run| run.peak_if_m(lost, lasts_s));
    peak_m.unwrap_or(f64::NAN)
}

/// Where the numbers of this instant stand.
#[unsafe(no_mangle)]
pub extern "C" fn now() -> *const f64 {
    let mut lab = lab();
    let now = lab.run.as_ref().map_or([0.0; NOW], |run| run.record.now);
    lab.numbers = now.to_vec();
    lab.numbers.as_ptr()
}

/// The centre of the road, every `every_m` from its start to its end: x, y, heading, curvature, in turn.
#[unsafe(no_mangle)]
pub extern "C" fn road(every_m: f64) -> *const f64 {
    numbers(|run| {
        let course = run.scenario.course().centreline();
        let count = (course.length_m() / every_m) as u32;
        (0..=count)
            .flat_map(|k| {
                let (at, curvature, _) = course.at(f64::from(k) * every_m);
                [at.x_m, at.y_m, at.heading_rad, curvature]
            })
            .collect()
    })
}

/// The samples of a channel: by its place among the columns of the log, or behind them.
#[unsafe(no_mangle)]
pub extern "C" fn channel(place: usize) -> *const f64 {
    numbers(|run| run.record.channel(place))
}

/// The log so far, as the command line writes it.
#[unsafe(no_mangle)]
pub extern "C" fn csv() -> u32 {
    answer(|lab, _| lab.run.as_ref().ok_or("there is no run")?.record.csv())
}

/// What the command line judges a run by, over a stretch of road, as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn metrics(from_m: f64, to_m: f64) -> u32 {
    answer(|lab, _| {
        let run = lab.run.as_ref().ok_or("there is no run")?;
        Ok(serde_json::to_string(&run.metrics(from_m, to_m))?)
    })
}

/// Who drove: the parameters of the log that was written as JSON; 0 and a sentence if it tells nothing.
#[unsafe(no_mangle)]
pub extern "C" fn identify(manual: u32) -> u32 {
    answer(|_, csv| words::identified(csv, manual != 0))
}

/// What the shipping ECU sends on the bus that was written; 0 and a sentence if it cannot be read.
#[unsafe(no_mangle)]
pub extern "C" fn replay() -> u32 {
    answer(|_, bus| replay::replay(bus))
}
