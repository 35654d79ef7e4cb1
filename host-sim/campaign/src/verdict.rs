//! Whether a run did what its row asks for.

use super::bytes::{ACTIVE, FADE, FAULT, HANDOVER, STANDBY};
use super::invariants::Violation;
use super::residual::Detectability;
use super::table::{Expect, FaultCase, WEAK_MS};
use super::trial_record::TrialRecord;

/// Before a contradiction has used this share of its margin nobody may react to it.
const TOO_EARLY: f64 = 0.8;

/// Judges a run: first by the rules of every cycle, then by the row. The step of the reaction, if there was one.
pub(super) fn judge(row: &FaultCase, onset: u32, record: &TrialRecord) -> Result<Option<u32>, Violation> {
    if let Some(violation) = &record.violation {
        return Err(violation.clone());
    }
    let reacted_at = reaction(row, onset, record)?;
    if record.peak_nm > row.torque_nm {
        let what = format!(
            "abs(T) reached {:.3} N.m, not {} N.m",
            record.peak_nm, row.torque_nm
        );
        return Err(failed(record.steps, what));
    }
    Ok(reacted_at)
}

fn failed(step: u32, what: impl Into<String>) -> Violation {
    Violation {
        step,
        what: what.into(),
    }
}

/// When the ECU reacted, if it did.
fn reaction(row: &FaultCase, onset: u32, record: &TrialRecord) -> Result<Option<u32>, Violation> {
    if row.expect == Expect::OnlyRules {
        return Ok(None);
    }
    if let Some((step, mode)) = record.modes.iter().skip(1).find(|(step, _)| *step < onset) {
        // From Boot the way leads through Standby.
        if *mode != STANDBY {
            return Err(failed(*step, format!("mode {mode} before the fault")));
        }
    }
    let after = || record.modes.iter().filter(|(step, _)| *step >= onset).copied();
    let stays = || match after().next() {
        // Off the road the line is further aside than a camera tells: nobody has to stay.
        Some((step, HANDOVER)) if record.driven_off => Ok(Some(step)),
        Some((step, mode)) => Err(failed(step, format!("left Active for mode {mode}"))),
        None => Ok(None),
    };
    let only = |allowed: &[u64]| match after().find(|(_, mode)| !allowed.contains(mode)) {
        Some((step, mode)) => Err(failed(step, format!("went to mode {mode}"))),
        None => Ok(after().next().map(|(step, _)| step)),
    };
    match row.expect {
        Expect::GoesOn { rejects } => {
            if let (true, Some(step)) = (rejects, record.accepted_bad_at) {
                return Err(failed(step, "a tampered frame was accepted"));
            }
            if rejects && record.rejected == 0 {
                return Err(failed(record.steps, "no tampered frame came"));
            }
            stays()
        }
        Expect::Uncut => {
            if record.overridden {
                return Err(failed(onset, "the driver's torque cut the guidance"));
            }
            stays()
        }
        Expect::MayHandOver => {
            let at = only(&[HANDOVER, STANDBY])?;
            too_early(row, record, at).map(|()| at)
        }
        Expect::OnlyRules => Ok(None),
        Expect::Reaches { mode, fading } => {
            let locked_at_once = record
                .modes
                .first()
                .filter(|(_, first)| *first == mode && mode != ACTIVE);
            let reached = after()
                // A small torque has faded before the motor's is seen to be another.
                .find(|(_, mode)| !(fading && matches!(*mode, FADE | STANDBY)))
                .or(locked_at_once.map(|_| (onset, mode)));
            in_time(row, record, mode, reached)
        }
        Expect::HandsOverOrStops => {
            let reached = after().next();
            let mode = reached.map_or(HANDOVER, |(_, mode)| if mode == FAULT { FAULT } else { HANDOVER });
            in_time(row, record, mode, reached)
        }
        Expect::Restarts { reset } => {
            if record.reset != reset {
                return Err(failed(record.steps, format!("reset cause {}", record.reset)));
            }
            only(&[STANDBY])?;
            in_time(row, record, STANDBY, after().next())
        }
        Expect::Yields => {
            stays()?;
            let Some(at) = record.yielded_at.filter(|at| *at <= onset + row.deadline_ms) else {
                return Err(failed(
                    onset + row.deadline_ms,
                    "the torque did not yield to the driver",
                ));
            };
            Ok(Some(at))
        }
    }
}

fn in_time(
    row: &FaultCase,
    record: &TrialRecord,
    mode: u64,
    reached: Option<(u32, u64)>,
) -> Result<Option<u32>, Violation> {
    let (seen_at, deadline_ms, mode) = match (record.seen_at, record.weak_at) {
        // A torque the other way that is within a motor's error passes for one that is missing.
        (None, Some(weak_at)) if row.seen == Detectability::MotorAstray => (Some(weak_at), WEAK_MS, HANDOVER),
        (seen_at, _) => (seen_at, row.deadline_ms, mode),
    };
    // What cannot be seen need not be reacted to; the run counts as not seen.
    let Some(seen_at) = seen_at else {
        return match reached {
            Some((step, found)) if found == mode => too_early(row, record, Some(step)).map(|()| Some(step)),
            _ => Ok(None),
        };
    };
    let due = seen_at + deadline_ms;
    match reached {
        // Speeds that fall by themselves contradict the column.
        Some((step, HANDOVER)) if row.seen == Detectability::Speed && record.contradicted >= TOO_EARLY => {
            Ok(Some(step))
        }
        Some((step, found)) if found != mode => Err(failed(step, format!("mode {found}, not {mode}"))),
        Some((step, _)) if step > due => {
            let late = step - seen_at;
            Err(failed(
                step,
                format!("reacted after {late} ms, not {deadline_ms}"),
            ))
        }
        Some((step, _)) => too_early(row, record, Some(step)).map(|()| Some(step)),
        // A run that ends before the reaction is due proves nothing.
        None if due > record.steps => Ok(None),
        None => Err(failed(due, format!("mode {mode} was not reached"))),
    }
}

fn too_early(row: &FaultCase, record: &TrialRecord, reacted_at: Option<u32>) -> Result<(), Violation> {
    match reacted_at {
        Some(step) if row.seen == Detectability::Contradiction && record.used < TOO_EARLY => Err(failed(
            step,
            format!("reacted with {:.2} of the margin used", record.used),
        )),
        _ => Ok(()),
    }
}
