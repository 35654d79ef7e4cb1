//! Drivers who change while they drive, with a known truth: is the change seen, when, and is anybody called identified who was
//! not there?
//!
//! Terms: a value is *false* if it is called identified and, for more than half of the time that it is said to hold, more than
//! four of its own standard errors and more than 10 % (15 ms of t_p, 0.05 of K_hg) from the truth of that time. A drive is *seen*
//! to change if the driver is refuted for having changed.

use haptic_analysis::identify::{
    Change, DriveLog, Identification, Options, Pieces, identify_in_pieces, identify_with_noise_model,
};
use haptic_log::near::did_you_mean;
use serde::Serialize;

use super::changing::{Changed, driver_at};
use super::corruption::random_of;
use super::corruptions::{Held, tolerance};
use super::kinds::{ASSUMED_NOT_TO, Drawn, KINDS};
use haptic_batch::StudyError;
use haptic_batch::engine::{Watch, each};
use haptic_batch::experiment::{COMPARED, ExperimentPlan, compared, guided};

/// What was made of one kind of change.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ChangesLine {
    /// What changed.
    pub kind: &'static str,
    /// Whether it was the driver.
    pub of_driver: bool,
    /// Drives.
    pub drives: usize,
    /// Drives whose driver is said to have changed.
    pub seen: usize,
    /// Drives that were refuted for something else.
    pub refuted_otherwise: usize,
    /// Drives that were seen to change, and whose only change was a step of K_hg.
    pub steps_seen: usize,
    /// Steps that were seen, with their instant within 5 s of the truth.
    pub within_5_s: usize,
    /// Instants of those seen, of which there was one change: begin and end, and whether their 95 % intervals hold the truth.
    pub instants: Held,
    /// Values called identified in drives that were taken as of one driver, and in pieces of the others.
    pub identified: [usize; 2],
    /// False ones among them.
    pub false_identifications: [usize; 2],
    /// 95 % intervals of identified values, in whole drives and in pieces.
    pub intervals: [Held; 2],
}

/// The whole population.
#[derive(Debug, Clone, Serialize)]
pub struct Changes {
    /// Who drove, with which probe; its seed is that of the first drive of each participant, from which the others count on.
    #[serde(flatten)]
    pub plan: ExperimentPlan,
    /// Drives of each participant.
    pub drives: u32,
    /// By kind.
    pub lines: Vec<ChangesLine>,
    /// Everything together but what is assumed not to happen.
    pub all: ChangesLine,
    /// What was promised and is not kept.
    pub broken: Vec<String>,
}

/// Drives each participant of `plan` so often, with one kind of change after the other, and identifies each drive as of one driver,
/// and in pieces where that is refuted.
///
/// # Errors
/// An unknown participant; a probe that the controller refuses; a drive that differs from the shipping ECU's.
pub fn changes(
    plan: &ExperimentPlan,
    drives: u32,
    only: &str,
    watch: &Watch<'_>,
) -> Result<Changes, StudyError> {
    let kinds: Vec<_> = KINDS.iter().filter(|(name, _)| name.contains(only)).collect();
    if kinds.is_empty() {
        let names = KINDS.map(|k| k.0);
        let (near, names) = (did_you_mean(only, names), names.join("; "));
        return Err(StudyError::Asked(format!(
            "--only {only:?}: none of {names}{near}"
        )));
    }
    let jobs = guided(plan, drives)?;
    let found = each(&jobs, watch, |&(number, published, drive)| {
        // Each participant has each kind in turn.
        let place = (drive as usize + number as usize) % kinds.len();
        let (name, kind) = kinds[place];
        let plan = plan.repetition(drive);
        let drawn = kind.drawn(&published, &mut random_of(&plan, number));
        let log = drawn.log(&plan, number)?;
        let options = Options::default();
        let whole = identify_with_noise_model(&log, &options);
        let pieces = whole.changed().map(|_| identify_in_pieces(&log, &options));
        Ok((
            place,
            ChangesLine::new(name, &drawn, &log, &whole, pieces.as_ref()),
        ))
    })?;
    let lines: Vec<ChangesLine> = (0..kinds.len())
        .filter_map(|place| {
            let of_kind = found.iter().filter(|f| f.0 == place).map(|f| f.1.clone());
            of_kind.reduce(ChangesLine::and)
        })
        .collect();
    Ok(Changes::new(plan, drives, lines))
}

impl ChangesLine {
    fn new(
        kind: &'static str,
        drawn: &Drawn,
        log: &DriveLog,
        whole: &Identification,
        pieces: Option<&Pieces>,
    ) -> Self {
        let changed = whole.changed();
        let mut line = Self {
            kind,
            of_driver: !drawn.changes.is_empty(),
            drives: 1,
            seen: usize::from(changed.is_some()),
            refuted_otherwise: usize::from(changed.is_none() && !whole.refuted.is_empty()),
            ..Self::default()
        };
        line.judge(0, drawn, [log.start_s, log.time_s(log.len())], whole);
        for piece in pieces.iter().flat_map(|p| &p.pieces) {
            line.judge(1, drawn, [piece.from_s, piece.to_s], &piece.identification);
        }
        if let ([truth], Some(pieces)) = (&drawn.changes[..], pieces)
            && let Some(change) = nearest(&pieces.changes, truth.at_s)
        {
            let ends = [truth.at_s, truth.at_s + truth.over_s];
            if truth.over_s == 0.0 && truth.what == Changed::KHg {
                line.steps_seen = 1;
                let miss = [0, 1].map(|i| (change.at_s[i] - ends[i]).abs());
                line.within_5_s = usize::from(miss.iter().all(|m| *m <= 5.0));
            }
            for (end, [low, high]) in ends.into_iter().zip(change.at_95_s) {
                line.instants.identified += 1;
                line.instants.held += usize::from(low <= end && end <= high);
            }
        }
        line
    }

    /// Counts the values that are said to hold between two instants.
    fn judge(&mut self, place: usize, drawn: &Drawn, [from_s, to_s]: [f64; 2], found: &Identification) {
        const INSTANTS: u32 = 200;
        let at = |i: u32| from_s + (to_s - from_s) * (f64::from(i) + 0.5) / f64::from(INSTANTS);
        let truths: Vec<_> = (0..INSTANTS)
            .map(|i| compared(&driver_at(&drawn.first, &drawn.changes, at(i)), &found.parameters))
            .collect();
        for i in (0..COMPARED).filter(|&i| truths[0][i].1.identified) {
            let far = truths.iter().filter(|values| {
                let (name, p, truth) = &values[i];
                let error = (p.optimum.unwrap_or(f64::NAN) - truth).abs();
                error > tolerance(name, *truth) && p.standard_error.is_some_and(|s| error > 4.0 * s)
            });
            // On a bound no value is named, but an interval.
            let named = usize::from(truths[0][i].1.estimate.is_some());
            self.identified[place] += named;
            self.false_identifications[place] += named * usize::from(far.count() * 2 > truths.len());
            let middle = truths[truths.len() / 2][i];
            self.intervals[place] = self.intervals[place] + Held::new(std::iter::once(&middle));
        }
    }

    fn and(mut self, other: Self) -> Self {
        self.drives += other.drives;
        self.seen += other.seen;
        self.refuted_otherwise += other.refuted_otherwise;
        self.steps_seen += other.steps_seen;
        self.within_5_s += other.within_5_s;
        self.instants = self.instants + other.instants;
        for i in 0..2 {
            self.identified[i] += other.identified[i];
            self.false_identifications[i] += other.false_identifications[i];
            self.intervals[i] = self.intervals[i] + other.intervals[i];
        }
        self
    }
}

fn nearest(changes: &[Change], at_s: f64) -> Option<&Change> {
    let miss = |c: &Change| (c.at_s[0] - at_s).abs();
    changes.iter().min_by(|a, b| miss(a).total_cmp(&miss(b)))
}

impl Changes {
    fn new(plan: &ExperimentPlan, drives: u32, lines: Vec<ChangesLine>) -> Self {
        let promised = lines.iter().filter(|l| l.kind != ASSUMED_NOT_TO);
        let all = promised.cloned().reduce(ChangesLine::and).unwrap_or_default();
        let all = ChangesLine { kind: "all", ..all };
        let mut broken = Vec::new();
        let identified: usize = all.identified.iter().sum();
        let wrong: usize = all.false_identifications.iter().sum();
        if wrong * 1000 > identified {
            broken.push(format!(
                "{wrong} false identifications among {identified} identified values: more than 1 of 1,000"
            ));
        }
        if all.within_5_s * 10 < all.steps_seen * 9 {
            broken.push(format!(
                "instants within 5 s in {} of {} steps seen: less than nine of ten",
                all.within_5_s, all.steps_seen
            ));
        }
        for line in lines
            .iter()
            .filter(|l| !l.of_driver && l.seen * 50 > l.drives && l.seen > 1)
        {
            broken.push(format!(
                "{}: {} of {} drivers are said to have changed, more than 2 %",
                line.kind, line.seen, line.drives
            ));
        }
        Self {
            plan: plan.clone(),
            drives,
            lines,
            all,
            broken,
        }
    }
}
