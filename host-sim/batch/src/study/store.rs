//! Sessions on a disk. Each has a directory of its own, which appears whole or not at all and is never written again.
//!
//! `sessions/PARTICIPANT/POSITION-CONDITION/` holds `session.toml` (who, what, when in the order, version, seed), `scenario.toml`
//! (whole) and `drive.csv` (what was recorded).

use std::path::{Path, PathBuf};
use std::{fs, io};

use haptic_log::trace::{Sample, Trace};
use haptic_sim::input::{InputError, parse_toml};
use haptic_sim::scenario::{Condition, Scenario};
use haptic_sim::simulation::{Ending, Run};
use serde::{Deserialize, Serialize};

use super::{Session, Source, Study, guidance};
use crate::engine::{StudyError, refuse};
use crate::record::{RunRecord, default_window};

/// What a session's directory says of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stored {
    pub(super) study: String,
    pub(super) participant: String,
    pub(super) condition: String,
    pub(super) position: usize,
    pub(super) seed: u64,
    pub(super) version: String,
    pub(super) source: Source,
    pub(super) diverged: bool,
}

/// Largest difference between the speed of a recording and the scenario's, as a share.
const SPEED_WITHIN: f64 = 0.02;
/// Largest difference between the road's curvature in a recording and in the scenario, 1/m; and the share of rows that may lie
/// beyond, where a curve begins a little elsewhere.
const CURVATURE_WITHIN_1PM: f64 = 2e-4;
const OTHER_ROAD_SHARE: f64 = 0.02;
/// Less torque than this on the wheel is nobody's, N.m.
const HANDS_NM: f64 = 0.01;
/// Shortest recording that is a drive, s.
const LEAST_S: f64 = 5.0;

pub(super) fn place(out: &Path, session: &Session) -> PathBuf {
    out.join("sessions")
        .join(&session.participant)
        .join(format!("{}-{}", session.position, session.condition))
}

/// What is recorded of a session, if it is: checked to be this session.
pub(super) fn read(
    study: &Study,
    session: &Session,
    out: &Path,
) -> Result<Option<(Stored, RunRecord)>, StudyError> {
    let place = place(out, session);
    if !place.exists() {
        return Ok(None);
    }
    let text = |name: &str| {
        let path = place.join(name);
        fs::read_to_string(&path).map_err(|e| InputError::new(path.display(), e))
    };
    let name = place.join("session.toml").display().to_string();
    let stored: Stored = parse_toml(&name, &text("session.toml")?)?;
    let another = |what: &str| {
        refuse(format!(
            "{}: recorded {what}; nothing recorded is overwritten: give another --out",
            place.display()
        ))
    };
    if stored.study != study.name {
        return another(&format!("in study {}", stored.study));
    }
    if (stored.position, &stored.participant, &stored.condition)
        != (session.position, &session.participant, &session.condition)
    {
        return another("as another session");
    }
    let path = place.join("scenario.toml").display().to_string();
    // As a file gives it back: a course of OpenDRIVE is moved by rounding.
    if scenario(&path, &text("scenario.toml")?)? != scenario(&path, &session.scenario.to_toml())? {
        return another("with another scenario or seed");
    }
    let path = place.join("drive.csv");
    let trace = fs::File::open(&path)
        .map_err(|e| e.to_string())
        .and_then(|file| Trace::read_csv(file).map_err(|e| e.to_string()))
        .map_err(|e| InputError::new(path.display(), e))?;
    let record = measured(session, trace, stored.diverged);
    Ok(Some((stored, record)))
}

/// The scenario of a stored text.
fn scenario(name: &str, text: &str) -> Result<Scenario, StudyError> {
    Scenario::from_toml(name, text, |course, _| {
        Err(InputError::new(course, "a stored scenario holds its course"))
    })
    .map_err(StudyError::from)
}

fn measured(session: &Session, trace: Trace, diverged: bool) -> RunRecord {
    let s_m = trace.samples.last().map_or(0.0, |sample| sample.s_m);
    let run = Run {
        trace,
        ending: if diverged {
            Ending::Diverged { s_m }
        } else {
            Ending::CourseEnd
        },
        steps: 0,
    };
    RunRecord::new(
        &session.scenario,
        &run,
        default_window(session.scenario.course()),
        None,
    )
}

/// Keeps what a simulated participant drove.
pub(super) fn keep_run(study: &Study, session: &Session, out: &Path, run: &Run) -> Result<(), StudyError> {
    let mut csv = Vec::new();
    let written = run.trace.write_csv(&mut csv);
    written.map_err(|e| InputError::new(session.name(), e))?;
    keep(study, session, out, &csv, Source::Simulated, run.diverged())
}

/// Keeps what a person's drive left, byte for byte, if it is one of this session.
pub(super) fn import(
    study: &Study,
    session: &Session,
    out: &Path,
    (file, csv): (&Path, &[u8]),
) -> Result<(), StudyError> {
    let trace = Trace::read_csv(csv).map_err(|e| InputError::new(file.display(), e))?;
    let checked = check(session, &trace)
        .and_then(|()| check_hands(&trace))
        .and_then(|()| check_road(session, &trace))
        .and_then(|()| match session.scenario.condition() {
            Condition::Manual => Ok(()),
            _ => guidance::check(session, &trace),
        });
    checked.map_err(|e| InputError::new(file.display(), e))?;
    keep(study, session, out, csv, Source::Imported, false)
}

/// A drive in which nobody drove says nothing of anybody.
fn check_hands(trace: &Trace) -> Result<(), StudyError> {
    let torques = trace.samples.iter().map(|sample| sample.driver_torque_nm.abs());
    let most = torques.fold(0.0, f64::max);
    if most < HANDS_NM {
        return refuse(format!(
            "driver_torque_nm is at most {most:.3} N.m in its {} rows: nobody held the wheel",
            trace.samples.len()
        ));
    }
    Ok(())
}

/// The road of a recording is told by its curvature at each place.
fn check_road(session: &Session, trace: &Trace) -> Result<(), StudyError> {
    let course = session.scenario.course().centreline();
    let told = || {
        trace
            .samples
            .iter()
            .filter(|sample| sample.curvature_1pm.is_finite())
    };
    let wanted = |s_m: f64| course.at(s_m.clamp(0.0, course.length_m())).1;
    let differs = |sample: &&Sample| {
        !(0.0..=course.length_m()).contains(&sample.s_m)
            || (sample.curvature_1pm - wanted(sample.s_m)).abs() > CURVATURE_WITHIN_1PM
    };
    let differing = told().filter(differs).count();
    if differing as f64 <= OTHER_ROAD_SHARE * told().count() as f64 {
        return Ok(());
    }
    let Sample {
        s_m, curvature_1pm, ..
    } = told().find(differs).copied().unwrap_or_default();
    refuse(format!(
        "driven on another road: {differing} of {} rows do not lie on that of condition {}, {}; at {s_m:.1} m the file has a curvature \
         of {curvature_1pm:.5} 1/m, and that road, {:.1} m long, {:.5} 1/m",
        trace.samples.len(),
        session.condition,
        session.scenario.course().name(),
        course.length_m(),
        wanted(s_m)
    ))
}

/// What tells a recording of this session from one of another.
fn check(session: &Session, trace: &Trace) -> Result<(), StudyError> {
    let (Some(first), Some(last)) = (trace.samples.first(), trace.samples.last()) else {
        return refuse("there are no rows");
    };
    for (row, sample) in trace.samples.iter().enumerate() {
        let values = [
            sample.time_s,
            sample.s_m,
            sample.lateral_error_m,
            sample.driver_torque_nm,
        ];
        if values.iter().any(|value| !value.is_finite()) {
            return refuse(format!("row {}: a value is missing", row + 1));
        }
    }
    let steps = || {
        trace
            .samples
            .windows(2)
            .map(|pair| pair[1].time_s - pair[0].time_s)
    };
    let usual_s = steps().next().unwrap_or_default();
    if let Some(row) = steps().position(|step| (step - usual_s).abs() > 0.5 * usual_s) {
        let [before, after] = [row, row + 1].map(|row| trace.samples[row].time_s);
        return refuse(format!(
            "row {}: the time goes from {before} to {after} s, where others are {usual_s:.4} s apart: a drive is recorded in one \
             piece",
            row + 2
        ));
    }
    let lasts_s = last.time_s - first.time_s;
    if lasts_s < LEAST_S {
        return refuse(format!(
            "it lasts {lasts_s:.1} s, and a drive at least {LEAST_S} s"
        ));
    }
    let speed = (last.s_m - first.s_m) / lasts_s;
    let wanted = session.scenario.mean_speed_m_per_s(first.time_s, last.time_s);
    if (speed / wanted - 1.0).abs() > SPEED_WITHIN {
        return refuse(format!(
            "driven at {:.1} km/h, and condition {} is at {:.1} km/h",
            speed * 3.6,
            session.condition,
            wanted * 3.6
        ));
    }
    let guided = trace
        .samples
        .iter()
        .any(|sample| sample.guidance_torque_nm != 0.0);
    let wanted = session.scenario.condition() != Condition::Manual;
    if guided != wanted {
        let says = |with: bool| if with { "with guidance" } else { "without guidance" };
        return refuse(format!(
            "driven {}, and condition {} is {}",
            says(guided),
            session.condition,
            says(wanted)
        ));
    }
    Ok(())
}

/// Writes a session's directory beside its place and moves it there.
fn keep(
    study: &Study,
    session: &Session,
    out: &Path,
    csv: &[u8],
    source: Source,
    diverged: bool,
) -> Result<(), StudyError> {
    let place = place(out, session);
    let stored = Stored {
        study: study.name.clone(),
        participant: session.participant.clone(),
        condition: session.condition.clone(),
        position: session.position,
        seed: session.scenario.seed(),
        version: crate::VERSION.into(),
        source,
        diverged,
    };
    let about = toml::to_string(&stored).map_err(|e| InputError::new(session.name(), e))?;
    let folder = place.parent().unwrap_or(out);
    let beside = folder.join(format!(
        ".{}.{}.unfinished",
        session.condition,
        std::process::id()
    ));
    let write = || -> io::Result<()> {
        fs::create_dir_all(folder)?;
        // Of a process with the same number that was killed.
        let _ = fs::remove_dir_all(&beside);
        fs::create_dir(&beside)?;
        for (name, bytes) in [
            ("session.toml", about.as_bytes()),
            ("scenario.toml", session.scenario.to_toml().as_bytes()),
            ("drive.csv", csv),
        ] {
            let path = beside.join(name);
            fs::write(&path, bytes)?;
            fs::File::open(&path)?.sync_all()?;
        }
        // A directory with something in it is not replaced.
        fs::rename(&beside, &place)
    };
    write().map_err(|e| {
        let _ = fs::remove_dir_all(&beside);
        if place.exists() {
            already(&place)
        } else {
            InputError::new(place.display(), e).into()
        }
    })
}

pub(super) fn already(place: &Path) -> StudyError {
    let place = place.display();
    format!("{place} is recorded already, and nothing recorded is overwritten").into()
}
