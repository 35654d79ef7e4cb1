//! Tables of campaigns of faults.

use super::super::kept::{Campaign, Kept, Row};
use super::super::list::Latent;
use super::{Columns, NOTHING, count, head, lines};

/// Rows of a campaign that are named where runs failed.
const MOST_NAMED: usize = 8;
/// What the torque after a fault of class C may push a vehicle, and is not worth a line, m.
const HARDLY_PUSHED_M: f64 = 0.05;
/// Classes, each with what it is.
const CLASSES: [(&str, &str); 6] = [
    ("L", "an extreme but valid input"),
    ("R", "a bad frame"),
    ("A", "a planned fade"),
    ("B", "an input lost or false"),
    ("C", "computation, memory, time, motor"),
    ("D", "the driver opposes"),
];

pub(super) fn campaigns(columns: &Columns) -> Vec<String> {
    let row = |(title, kept): &(&str, Option<&Kept>)| {
        let Some((kept, campaign)) = kept.and_then(|kept| Some((kept, kept.campaign()?))) else {
            let mut cells = vec![(*title).into(), NOTHING.into()];
            cells.resize(6, String::new());
            return cells;
        };
        let sums = &campaign.sums;
        let failed = match sums.rows_beyond_share {
            0 => count(sums.failed),
            rows => format!(
                "{}, and {rows} rows by their share out of the lane",
                count(sums.failed)
            ),
        };
        vec![
            (*title).into(),
            format!("`{}`", kept.origin.command),
            count(sums.rows),
            count(sums.runs),
            count(sums.cycles),
            failed,
        ]
    };
    lines(
        &["campaign", "command", "rows", "runs", "cycles", "failed runs"],
        columns.iter().map(row),
    )
}

pub(super) fn failures(columns: &Columns) -> Vec<String> {
    let mut rows = Vec::new();
    for (title, kept) in columns {
        // What was not measured is said below the table.
        let Some(campaign) = kept.and_then(Kept::campaign) else {
            continue;
        };
        let mut failing: Vec<&Row> = campaign.rows.iter().filter(|row| row.failed > 0).collect();
        failing.sort_by_key(|row| std::cmp::Reverse(row.failed));
        let named = failing.len().min(MOST_NAMED);
        for row in &failing[..named] {
            let first = row.failures.first();
            let first = first.map_or(String::new(), |f| format!("seed {}: {}", f.seed, f.what));
            rows.push(vec![
                (*title).into(),
                format!("`{}`", row.name),
                format!("{} of {}", row.failed, row.runs),
                first,
            ]);
        }
        if failing.len() > named {
            let others = &failing[named..];
            let runs = others.iter().map(|row| row.failed).sum();
            rows.push(vec![
                (*title).into(),
                format!("{} more rows", others.len()),
                count(runs),
                String::new(),
            ]);
        }
        if failing.is_empty() {
            rows.push(vec![(*title).into(), "none".into(), "0".into(), String::new()]);
        }
    }
    lines(&["campaign", "row", "failed runs", "the first of them"], rows)
}

pub(super) fn ended(columns: &Columns) -> Vec<String> {
    let rows = columns.iter().flat_map(|(title, kept)| {
        let Some(campaign) = kept.and_then(Kept::campaign) else {
            return Vec::new();
        };
        let ended = campaign.rows.iter().filter(|row| row.ended());
        let rows = ended.map(|row| {
            let runs = format!("{} of {}", count(row.left), count(row.runs));
            vec![(*title).into(), format!("`{}`", row.name), runs]
        });
        let rows: Vec<_> = rows.collect();
        match rows.is_empty() {
            true => vec![vec![(*title).into(), "none".into(), "0".into()]],
            false => rows,
        }
    });
    lines(&["campaign", "row", "runs in which guidance ended"], rows)
}

pub(super) fn sums(columns: &Columns) -> Vec<String> {
    let sum = |campaign: &Campaign, of: fn(&Row) -> u64| count(campaign.rows.iter().map(of).sum());
    let by_share = |campaign: &Campaign| match campaign.sums.share_limit {
        Some(_) => count(campaign.sums.rows_beyond_share),
        None => "not judged".into(),
    };
    let rows = [
        row("rows; runs", columns, |of| {
            format!("{}; {}", count(of.sums.rows), count(of.sums.runs))
        }),
        row("runs that failed", columns, |of| count(of.sums.failed)),
        row("of these, runs beyond their deviation", columns, |of| {
            sum(of, |row| row.beyond_limit)
        }),
        row(
            "of these, runs more than 0.1 m further than a dropped torque",
            columns,
            |of| sum(of, |row| row.beyond_drop),
        ),
        row("rows beyond their share out of the lane", columns, by_share),
        row("runs in which the ECU left", columns, |of| {
            sum(of, |row| row.left)
        }),
        row("runs that left the lane", columns, |of| {
            sum(of, |row| row.left_lane)
        }),
    ];
    lines(&head(&[""], columns), rows)
}

pub(super) fn classes(columns: &Columns) -> Vec<String> {
    let rows = CLASSES.iter().map(|(class, what)| {
        let judged = |of: &Campaign| -> Vec<Row> {
            let of_class = |row: &&Row| row.class == *class && row.is_limited;
            of.rows.iter().filter(of_class).cloned().collect()
        };
        let first = columns.iter().find_map(|(_, kept)| kept.and_then(Kept::campaign));
        let number = first.map_or("-".into(), |of| judged(of).len().to_string());
        let title = format!("{class}, {what} | {number}");
        row(&title, columns, |of| {
            let rows = judged(of);
            let worst = rows.iter().map(|row| row.deviation_m).fold(0.0, f64::max);
            let [runs, left] =
                [|row: &Row| row.runs, |row: &Row| row.left_lane].map(|of| rows.iter().map(of).sum());
            format!("{worst:.2}, {}", percent(left, runs))
        })
    });
    lines(&head(&["class", "rows"], columns), rows)
}

/// Rows of all columns, in the order of the first that has any.
fn names(columns: &Columns, is_wanted: impl Fn(&Row, &Campaign) -> bool) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let campaigns = || {
        columns
            .iter()
            .filter_map(|(_, kept)| kept.and_then(Kept::campaign))
    };
    let Some(order) = campaigns().next() else {
        return names;
    };
    for row in &order.rows {
        let wanted = campaigns().any(|of| of.row(&row.name).is_some_and(|row| is_wanted(row, of)));
        if wanted {
            names.push(row.name.clone());
        }
    }
    names
}

pub(super) fn pushed(columns: &Columns) -> Vec<String> {
    let is_pushed = |row: &Row, of: &Campaign| {
        of.sums.share_limit.is_some() && row.pushed_m.is_some_and(|pushed_m| pushed_m > HARDLY_PUSHED_M)
    };
    let named = names(columns, is_pushed);
    let cell = |row: Option<&Row>| match row.and_then(|row| Some((row, row.pushed_m?))) {
        None => "-".into(),
        Some((row, pushed_m)) => match row.worst_reaction_ms {
            None => format!("{pushed_m:.2}"),
            Some(ms) => format!("{pushed_m:.2}, {}", count(ms.into())),
        },
    };
    let others = row("every other row of class C", columns, |of| {
        let others = of.rows.iter().filter(|row| !named.contains(&row.name));
        let most = others.filter_map(|row| row.pushed_m).fold(0.0, f64::max);
        format!("{most:.2}")
    });
    let rows = rows_of(&named, columns, cell).chain([others]);
    lines(&head(&["row"], columns), rows)
}

impl Latent {
    /// Whether a fault of this row may stay unnoticed where it should not.
    fn may_be(&self, row: &Row) -> bool {
        let named = |names: &[String]| names.contains(&row.name);
        let is_fault = row.may_leave && ["B", "C", "L"].contains(&row.class.as_str());
        (is_fault || named(&self.also)) && !named(&self.except)
    }

    /// Whether it did.
    fn was(&self, row: &Row) -> bool {
        self.may_be(row) && row.noticed < row.runs
    }
}

pub(super) fn goals(columns: &Columns, which: &Latent) -> Vec<String> {
    let pushed_m = |row: &Row| row.pushed_m;
    let all = |of: &Campaign, is: &dyn Fn(&Row) -> bool| -> Vec<Row> {
        of.rows.iter().filter(|row| is(row)).cloned().collect()
    };
    let latent = |of: &Campaign| all(of, &|row| which.was(row));
    let left_lane = |rows: &[Row]| {
        let [left, runs] =
            [|row: &Row| row.left_lane, |row: &Row| row.runs].map(|of| rows.iter().map(of).sum());
        format!("{} of {}", count(left), count(runs))
    };
    let rows = [
        row("SG1: pushed the furthest, where the motor obeys", columns, |of| {
            most(all(of, &|row| row.is_limited).iter(), pushed_m, "m")
        }),
        row("SG1: pushed the furthest, where it does not", columns, |of| {
            most(all(of, &|row| !row.is_limited).iter(), pushed_m, "m")
        }),
        row("SG2: deviated the furthest, unnoticed", columns, |of| {
            most(latent(of).iter(), |row| row.unnoticed_deviation_m, "m")
        }),
        row(
            "SG2: left the lane, in rows that may stay unnoticed",
            columns,
            |of| left_lane(&latent(of)),
        ),
        row("SG3: furthest beyond a dropped torque", columns, |of| {
            most(all(of, &|row| row.is_limited).iter(), |row| row.excess_m, "m")
        }),
        row("SG3: left the lane, in rows of classes A and B", columns, |of| {
            left_lane(&all(of, &|row| {
                row.is_limited && ["A", "B"].contains(&row.class.as_str())
            }))
        }),
        row("SG4: the largest torque, unnoticed", columns, |of| {
            most(latent(of).iter(), |row| row.unnoticed_torque_nm, "N.m")
        }),
        row("SG4: the largest torque, in any row", columns, |of| {
            most(of.rows.iter(), |row| Some(row.peak_torque_nm), "N.m")
        }),
    ];
    lines(&head(&["goal"], columns), rows)
}

pub(super) fn latent(columns: &Columns, which: &Latent) -> Vec<String> {
    let cell = |row: Option<&Row>| {
        let Some(row) = row else { return "-".to_owned() };
        let share = 100.0 * row.noticed as f64 / row.runs as f64;
        let [low, high] = row.noticed_interval.map(|share| 100.0 * share);
        let median = row.noticed_after_ms[0].map_or("-".into(), |ms| count(ms.into()));
        let worst = row.deviation_m;
        format!("{share:.0} ({low:.0} to {high:.0}), {median}, {worst:.2}")
    };
    let named = names(columns, |row, _| which.was(row));
    lines(&head(&["fault"], columns), rows_of(&named, columns, cell))
}

pub(super) fn left(columns: &Columns, rows: &[String]) -> Vec<String> {
    let cell = |row: Option<&Row>| match row {
        None => "-".into(),
        Some(row) => match row.left_after_ms {
            None => format!("{} of {}", row.left, row.runs),
            Some([median, _]) => format!("{} of {}, {:.2} s", row.left, row.runs, f64::from(median) * 1e-3),
        },
    };
    let head = head(&["the ECU left, after (median)"], columns);
    lines(&head, rows_of(rows, columns, cell))
}

/// A row for each name, with a cell of each campaign's row of this name.
fn rows_of(
    names: &[String],
    columns: &Columns,
    cell: impl Fn(Option<&Row>) -> String,
) -> impl Iterator<Item = Vec<String>> {
    let row = move |name: &String| row(&format!("`{name}`"), columns, |of| cell(of.row(name)));
    names.iter().map(row)
}

/// A row with a cell of each campaign.
fn row(first: &str, columns: &Columns, cell: impl Fn(&Campaign) -> String) -> Vec<String> {
    let cell = |kept: Option<&Kept>| kept.and_then(Kept::campaign).map_or(NOTHING.into(), &cell);
    let cells = columns.iter().map(|(_, kept)| cell(*kept));
    [first.to_owned()].into_iter().chain(cells).collect()
}

/// The largest of some rows, with its row.
fn most<'a>(rows: impl Iterator<Item = &'a Row>, of: fn(&Row) -> Option<f64>, unit: &str) -> String {
    let values = rows.filter_map(|row| Some((of(row)?, row.name.as_str())));
    let most = values.max_by(|a, b| a.0.total_cmp(&b.0));
    most.map_or("-".into(), |(value, name)| {
        format!("{value:.2} {unit} (`{name}`)")
    })
}

fn percent(part: u64, of: u64) -> String {
    match 100.0 * part as f64 / of.max(1) as f64 {
        0.0 => "0 %".into(),
        share => format!("{share:.1} %"),
    }
}
