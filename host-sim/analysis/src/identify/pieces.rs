//! A driver who changes, in pieces: each stretch between two changes is a driver of its own.
//!
//! The record is cut where [`super::noise_model`] finds the driver changed, and each side is fitted and judged again, until no
//! side has changed. Then each change is looked for once more between its neighbours, where no other one disturbs it. The time
//! in which an instant lies (95 %), and that of a drift, is of no piece: there the driver is neither the one before nor the one
//! after.

use serde::Serialize;

use super::change::{Change, Constancy, SHORTEST_S, Shape};
use super::noise_model::{identify_prepared, with_inertia_sought};
use super::options::Options;
use super::prepare::{Prepared, prepare};
use super::result::Identification;
use haptic_recording::DriveLog;

/// A stretch of a drive with one driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Piece {
    /// From when on, s.
    pub from_s: f64,
    /// Until when, s.
    pub to_s: f64,
    /// Whether it would show changes such as those between the pieces, in nine of ten drives: a piece that would not is not told to be
    /// of one driver.
    pub shows_such_changes: bool,
    /// The driver in it.
    #[serde(flatten)]
    pub identification: Identification,
}

/// A drive in pieces.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Pieces {
    /// In order of time.
    pub pieces: Vec<Piece>,
    /// What lies between them. A piece that is too short is left out, so there may be as many as pieces, or more.
    pub changes: Vec<Change>,
}

/// Most changes that are looked for: more is no driver who has parameters.
const MOST: usize = 20;

/// Identifies the driver of each piece of `log`.
pub fn identify_in_pieces(log: &DriveLog, options: &Options) -> Pieces {
    let (prepared, options) = with_inertia_sought(options, |options| prepare(log, options));
    let whole = Whole { prepared, options };
    let [start_s, end_s] = [log.start_s, log.time_s(log.len())];
    let mut changes = Vec::new();
    whole.split([start_s, end_s], &mut changes);
    changes.sort_by(|a, b| a.at_s[0].total_cmp(&b.at_s[0]));
    if changes.len() > 1 {
        for i in 0..changes.len() {
            let from_s = i.checked_sub(1).map_or(start_s, |i| changes[i].within_s()[1]);
            let to_s = changes.get(i + 1).map_or(end_s, |c| c.within_s()[0]);
            let alone = whole.piece([from_s, to_s]);
            let again = alone.as_ref().and_then(|p| p.identification.changed());
            if let Some(change) = again.filter(|c| c.shape != Shape::Swing) {
                changes[i] = change.clone();
            }
        }
    }
    let from = std::iter::once(start_s).chain(changes.iter().map(|c| c.within_s()[1]));
    let to = changes.iter().map(|c| c.within_s()[0]).chain([end_s]);
    let mut pieces: Vec<Piece> = from
        .zip(to)
        .filter_map(|(from, to)| whole.piece([from, to]))
        .collect();
    for piece in &mut pieces {
        piece.shows_such_changes = changes
            .iter()
            .all(|c| shows(piece.identification.constancy.as_ref(), c));
    }
    Pieces { pieces, changes }
}

/// Whether a record would show such a change as a step in its middle.
fn shows(found: Option<&Constancy>, change: &Change) -> bool {
    let power = found.iter().flat_map(|c| &c.power);
    let mut same = power.filter(|p| p.parameter == change.parameter);
    same.any(|p| p.step.is_some_and(|least| least <= change.by.abs()))
}

struct Whole {
    prepared: Prepared,
    options: Options,
}

impl Whole {
    /// The driver between two instants; none if that is too short.
    fn piece(&self, [from_s, to_s]: [f64; 2]) -> Option<Piece> {
        let part = self.prepared.between(from_s, to_s);
        (part.preflight.used_s >= SHORTEST_S).then(|| Piece {
            from_s,
            to_s,
            shows_such_changes: true,
            identification: identify_prepared(&part, &self.options),
        })
    }

    /// Adds the changes between two instants.
    fn split(&self, [from_s, to_s]: [f64; 2], changes: &mut Vec<Change>) {
        if changes.len() >= MOST {
            return;
        }
        let Some(piece) = self.piece([from_s, to_s]) else {
            return;
        };
        // What goes to and fro is everywhere: the piece stays, refuted.
        let Some(change) = piece.identification.changed().filter(|c| c.shape != Shape::Swing) else {
            return;
        };
        let [before_s, after_s] = change.within_s();
        changes.push(change.clone());
        self.split([from_s, before_s], changes);
        self.split([after_s, to_s], changes);
    }
}

impl Prepared {
    /// What of it lies between two instants.
    fn between(&self, from_s: f64, to_s: f64) -> Self {
        let dt_s = self.log.dt_s;
        let row = |s: f64| ((s - self.log.start_s) / dt_s).ceil().max(0.0) as usize;
        let (from, to) = (row(from_s), row(to_s));
        let mut part = self.clone();
        for s in &mut part.stretches {
            *s = s.start.max(from)..s.end.min(to);
        }
        part.stretches.retain(|s| s.start < s.end);
        part.preflight.used_s = part.stretches.iter().map(|s| s.len() as f64 * dt_s).sum();
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::change::Power;

    #[test]
    fn a_piece_shows_what_is_no_smaller_than_its_power() {
        let found = |step| Constancy {
            deviance: 2.0,
            level: 16.0,
            power: vec![Power {
                parameter: "k_hg",
                step,
                blip: None,
                swing: None,
            }],
            change: None,
        };
        let change = |parameter, by| Change {
            parameter,
            shape: Shape::Step,
            at_s: [60.0; 2],
            at_95_s: [[59.0, 61.0]; 2],
            by,
            deviance: 40.0,
        };
        for (least, by, shown) in [
            (0.2, 0.3, true),
            (0.2, -0.3, true),
            (0.2, 0.1, false),
            (0.2, -0.1, false),
        ] {
            assert_eq!(
                shows(Some(&found(Some(least))), &change("k_hg", by)),
                shown,
                "{least} {by}"
            );
        }
        assert!(!shows(Some(&found(None)), &change("k_hg", 0.9)));
        assert!(!shows(Some(&found(Some(0.1))), &change("t_p", 0.9)));
    }
}
