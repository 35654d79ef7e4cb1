//! What is shown of drives that were composed by chance.

use haptic_evidence::estimates::{ConditionLine, RandomDrives, Said, Share};

use haptic_report::document::{Cell, Table};
use haptic_report::plot::{Axis, Figure, Series};
use haptic_report::studies::place;

/// So many of so many, with the interval in percent.
fn in_words(share: Share) -> String {
    let Share { count, of, interval } = share;
    let within = interval.map(|[low, high]| format!(" ({:.2} to {:.2} %, 95 %)", 1e2 * low, 1e2 * high));
    format!("{count} of {of}{}", within.unwrap_or_default())
}

/// What came out, in a few sentences.
pub(super) fn summary(found: &RandomDrives) -> String {
    let RandomDrives {
        plan,
        honest,
        wrong,
        all,
        ..
    } = found;
    format!(
        "Seed {}, probe {} N.m: {} drives, and {} more in which the car left its lane, which tell nothing. Wrong of the identified values: \
         {}; in honest drives {}, in the others {}; of those that are identified if the torques are right {}. Honest logs that are accused: {}; logs in which something is wrong that are refuted: \
         {}. The 95 % intervals of honest drives hold the truth in {}.",
        plan.seed,
        plan.probe_nm,
        all.drives,
        all.lost,
        in_words(all.wrong),
        in_words(honest.wrong),
        in_words(wrong.wrong),
        in_words(all.wrong_if_right),
        in_words(honest.refuted),
        in_words(wrong.refuted),
        in_words(honest.held),
    )
}

pub(super) fn tables(found: &RandomDrives) -> Vec<Table> {
    let row = |l: &ConditionLine| {
        let tally = &l.tally;
        let upper = tally.wrong.interval.map(|[_, high]| 100.0 * high);
        [
            ("Condition", Cell::text(l.condition.as_str())),
            ("Honest", Cell::text(if l.honest { "yes" } else { "no" })),
            ("Drives", Cell::count(tally.drives)),
            ("Lost", Cell::count(tally.lost)),
            ("Refuted", Cell::count(tally.refuted.count)),
            ("Identified", Cell::count(tally.wrong.of)),
            ("Wrong", Cell::count(tally.wrong.count)),
            ("at most (%)", Cell::number(upper, 2)),
            ("If right", Cell::count(tally.wrong_if_right.of)),
            ("Wrong of them", Cell::count(tally.wrong_if_right.count)),
            ("Held by 95 %", Cell::count(tally.held.count)),
        ]
    };
    let said = |caption: &str, all: &[Said]| {
        let row = |s: &Said| {
            [
                ("Drive", Cell::count(s.drive as usize)),
                ("Participant", Cell::count(s.participant as usize)),
                ("Said", Cell::text(s.what.as_str())),
                ("Conditions", Cell::text(s.conditions.as_str())),
            ]
        };
        Table::of_rows(caption, all.iter().map(row))
    };
    let mut tables = vec![Table::of_rows(
        "Each condition among whatever was beside it: an honest one in honest drives, a wrong one in the others. Wrong: called \
         identified, and more than 4 standard errors and 10 % (15 ms of t_p, 0.05 of K_hg) off; at most: the upper end of the \
         95 % interval. If right: identified if the torques are, which this log does not tell. Refuted honest logs are accused.",
        found.lines.iter().map(row),
    )];
    if !found.wrong_values.is_empty() {
        tables.push(said("Every wrong value", &found.wrong_values));
    }
    if !found.accusations.is_empty() {
        tables.push(said("Every accusation of an honest log", &found.accusations));
    }
    tables
}

pub(super) fn figure(found: &RandomDrives) -> Figure {
    let panel = |what: &str, share: fn(&ConditionLine) -> Option<Share>| {
        let lines = found.lines.iter().enumerate();
        let points = lines.filter_map(|(row, line)| {
            let share = share(line).filter(|share| share.of > 0)?;
            Some((place(row), 100.0 * share.count as f64 / share.of as f64))
        });
        Axis::new(what, "%").panel([Series::dots("", 1, points.collect())])
    };
    let panels = [
        panel("Identified values that are wrong", |l| Some(l.tally.wrong)),
        panel("Honest logs that are accused", |l| {
            l.honest.then_some(l.tally.refuted)
        }),
    ];
    Figure::of_rows(found.lines.iter().map(|l| l.condition.as_str()), panels)
}
