//! Tables of hours without a fault.

use super::super::kept::Cell;
use super::{Columns, NOTHING, count, lines};

pub(super) fn availability(columns: &Columns, is_shown: impl Fn(&Cell) -> bool) -> Vec<String> {
    let mut rows = Vec::new();
    for (title, kept) in columns {
        let Some(kept) = kept else {
            let empty = std::iter::repeat_n(String::new(), 5);
            rows.push(
                [(*title).to_owned(), NOTHING.into()]
                    .into_iter()
                    .chain(empty)
                    .collect(),
            );
            continue;
        };
        // A world that is not judged has no sum over its roads: each of them is shown.
        let none_is_shown = !kept.cells().iter().any(&is_shown);
        let shown = kept.cells().iter().filter(|cell| none_is_shown || is_shown(cell));
        rows.extend(shown.map(|cell| availability_row(title, cell)));
    }
    let head = [
        "world",
        "road",
        "hours",
        "false declarations",
        "an hour at most, with 95 % confidence",
        "off the road",
        "lost by hand",
    ];
    lines(&head, rows)
}

fn availability_row(title: &str, cell: &Cell) -> Vec<String> {
    let causes = cell.causes.iter().map(|cause| match cause.rate.count {
        1 => cause.faults.clone(),
        times => format!("{} {times} times", cause.faults),
    });
    let causes = causes.collect::<Vec<_>>().join("; ");
    let declared = match cell.declarations.count {
        0 => "0".into(),
        times => format!("{times} ({causes})"),
    };
    let at_most = cell.declarations.upper_95;
    vec![
        title.into(),
        cell.road.clone(),
        format!("{:.2}", cell.hours),
        declared,
        at_most.map_or("nothing is known".into(), |rate| format!("{rate:.4}")),
        count(cell.diverged),
        count(cell.lost_by_hand.segments),
    ]
}
