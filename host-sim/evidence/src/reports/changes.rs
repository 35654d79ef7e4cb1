//! What is shown of drivers who change while they drive.

use haptic_evidence::estimates::{Changes, ChangesLine, Held};

use haptic_report::document::{Cell, Table};
use haptic_report::plot::{Axis, Figure, Series};
use haptic_report::studies::place;

/// What came out, in a sentence or two.
pub(super) fn summary(found: &Changes) -> String {
    let all = &found.all;
    let identified: usize = all.identified.iter().sum();
    let wrong: usize = all.false_identifications.iter().sum();
    let share = |held: Held| held.share().map_or("-".into(), |x| format!("{:.1} %", 100.0 * x));
    format!(
        "{wrong} of {identified} identified values are false. Instants of steps of K_hg: within 5 s in {} of {} seen. The 95 % intervals \
         of begin and end of a change hold the truth in {} of {}.",
        all.within_5_s,
        all.steps_seen,
        share(all.instants),
        all.instants.identified
    )
}

pub(super) fn table(found: &Changes) -> Table {
    let row = |l: &ChangesLine| {
        let share = |held: Held| Cell::number(held.share(), 3);
        [
            ("What changes", Cell::text(l.kind)),
            ("Drives", Cell::count(l.drives)),
            ("Seen", Cell::count(l.seen)),
            ("Refuted otherwise", Cell::count(l.refuted_otherwise)),
            ("Steps of K_hg seen", Cell::count(l.steps_seen)),
            ("within 5 s", Cell::count(l.within_5_s)),
            ("Instants held by 95 %", share(l.instants)),
            ("Identified", Cell::count(l.identified[0])),
            ("False", Cell::count(l.false_identifications[0])),
            ("Held by 95 %", share(l.intervals[0])),
            ("In pieces: identified", Cell::count(l.identified[1])),
            ("False", Cell::count(l.false_identifications[1])),
            ("Held by 95 %", share(l.intervals[1])),
        ]
    };
    Table::of_rows(
        "Seen: the driver is refuted for having changed. False: called identified, and for more than half of the time more than 4 \
                  standard errors and 10 % (15 ms of t_p, 0.05 of K_hg) off. In pieces: of the drives that are seen to change.",
        found.lines.iter().chain([&found.all]).map(row),
    )
}

pub(super) fn figure(found: &Changes) -> Figure {
    let share = |what: &str| Axis::new(what, "%").within(-2.0, 102.0);
    let dots = |label: &str, style, share: &dyn Fn(&ChangesLine) -> Option<f64>| {
        let lines = found.lines.iter().enumerate();
        let points = lines.filter_map(|(row, line)| Some((place(row), 100.0 * share(line)?)));
        Series::dots(label, style, points.collect())
    };
    let seen = dots("", 1, &|l| Some(l.seen as f64 / l.drives.max(1) as f64));
    let held = [
        dots("whole drives", 1, &|l| l.intervals[0].share()),
        dots("pieces", 2, &|l| l.intervals[1].share()),
    ];
    let panels = [
        share("Drives seen to change").panel([seen]),
        share("95 % intervals that hold").panel(held),
    ];
    Figure::of_rows(found.lines.iter().map(|l| l.kind), panels)
}
