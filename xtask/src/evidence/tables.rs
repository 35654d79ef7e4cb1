//! What is kept, as tables in Markdown with the sentences that say where they come from.

use std::collections::BTreeMap;

use super::kept::{Campaign, Cell, Earlier, Kept, Origin, Row};
use super::list::{Form, Latent, List, Rule, Table};

/// Kept measurements in the order of a table, each with what tables call it.
type Columns<'a> = [(&'a str, Option<&'a Kept>)];

/// In the place of what was not measured.
const NOTHING: &str = "not measured";
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

/// A table with its origin.
pub(super) fn render(list: &List, table: &Table, kept: &BTreeMap<String, Kept>) -> String {
    let of = table.of.iter();
    let columns: Vec<(&str, Option<&Kept>)> = of
        .map(|name| (list.measurement[name].title.as_str(), kept.get(name)))
        .collect();
    let lines = match &table.form {
        Form::Campaigns => campaigns(&columns),
        Form::Failures => failures(&columns),
        Form::Ended => ended(&columns),
        Form::Sums => sums(&columns),
        Form::Classes => classes(&columns),
        Form::Pushed => pushed(&columns),
        Form::Goals => goals(&columns, &list.latent),
        Form::Latent => latent(&columns, &list.latent),
        Form::Left(rows) => left(&columns, rows),
        Form::Availability => availability(&columns, |cell| cell.road == "all"),
        Form::AvailabilityByRoad => availability(&columns, |_| true),
    };
    let origins = table
        .of
        .iter()
        .map(|name| (name.as_str(), kept.get(name).map(|kept| &kept.origin)));
    lines.into_iter().map(|line| line + "\n").collect::<String>()
        + "\n"
        + &origin(&origins.collect::<Vec<_>>())
}

/// Where the numbers of a table come from: a sentence for each origin, and one for what is missing.
fn origin(of: &[(&str, Option<&Origin>)]) -> String {
    let mut sentences: Vec<(String, Vec<&str>)> = Vec::new();
    for (name, origin) in of {
        let said = origin.map_or("Not measured yet".into(), measured);
        match sentences.iter_mut().find(|(sentence, _)| *sentence == said) {
            Some((_, names)) => names.push(name),
            None => sentences.push((said, vec![name])),
        }
    }
    let lines = sentences
        .iter()
        .map(|(said, names)| format!("{said}: `cargo xtask evidence {}`.\n", names.join(" ")));
    lines.collect()
}

/// Commit, seeds and rule of a measurement.
fn measured(origin: &Origin) -> String {
    let from = origin.first_seed;
    let ran = match origin.count {
        Rule::Seeds(seeds) => format!("on seeds {from} to {} of each row", from + seeds - 1),
        Rule::Hours(hours) => format!("for {hours} h on each road with seed {from}"),
    };
    let rule = match (origin.count == origin.rule, origin.rule) {
        (true, _) => "as fixed before".into(),
        (false, Rule::Seeds(seeds)) => format!("where {seeds} seeds were fixed before"),
        (false, Rule::Hours(hours)) => format!("where {hours} h were fixed before"),
    };
    let held_out = match (origin.held_out, origin.earlier.as_slice()) {
        (false, _) => String::new(),
        (true, []) => ", held out until then".into(),
        (true, earlier) => {
            let said = |earlier: &Earlier| {
                let Earlier { commit, count, again } = earlier;
                format!("at commit `{}` with {count} (run again: {again})", short(commit))
            };
            let all: Vec<String> = earlier.iter().map(said).collect();
            format!(", which were held out and used before {}", all.join(", "))
        }
    };
    format!(
        "Measured at commit `{}` of {} {ran}, {rule}{held_out}",
        short(&origin.commit),
        origin.date
    )
}

fn short(commit: &str) -> &str {
    commit.get(..12).unwrap_or(commit)
}

/// Lines of a table: its head, the line below, its rows.
fn lines(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Vec<String> {
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    let head = head.iter().map(|cell| (*cell).to_owned()).collect::<Vec<_>>();
    let below = format!("|{}", "---|".repeat(head.len()));
    [line(head), below]
        .into_iter()
        .chain(rows.into_iter().map(line))
        .collect()
}

/// A column for each measurement behind others.
fn head<'a>(first: &[&'a str], columns: &Columns<'a>) -> Vec<&'a str> {
    let titles = columns.iter().map(|(title, _)| *title);
    first.iter().copied().chain(titles).collect()
}

/// A row with a cell of each campaign.
fn row(first: &str, columns: &Columns, cell: impl Fn(&Campaign) -> String) -> Vec<String> {
    let cell = |kept: Option<&Kept>| kept.and_then(Kept::campaign).map_or(NOTHING.into(), &cell);
    let cells = columns.iter().map(|(_, kept)| cell(*kept));
    [first.to_owned()].into_iter().chain(cells).collect()
}

/// With thousands set apart.
fn count(number: u64) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(",")
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

fn campaigns(columns: &Columns) -> Vec<String> {
    let row = |(title, kept): &(&str, Option<&Kept>)| {
        let Some((kept, campaign)) = kept.and_then(|kept| Some((kept, kept.campaign()?))) else {
            return vec![
                (*title).into(),
                NOTHING.into(),
                "".into(),
                "".into(),
                "".into(),
                "".into(),
            ];
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

fn failures(columns: &Columns) -> Vec<String> {
    let mut rows = Vec::new();
    for (title, kept) in columns {
        let Some(campaign) = kept.and_then(Kept::campaign) else {
            rows.push(vec![(*title).into(), NOTHING.into(), "".into(), "".into()]);
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

fn ended(columns: &Columns) -> Vec<String> {
    let rows = columns.iter().flat_map(|(title, kept)| {
        let Some(campaign) = kept.and_then(Kept::campaign) else {
            return vec![vec![(*title).into(), NOTHING.into(), String::new()]];
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

fn sums(columns: &Columns) -> Vec<String> {
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

fn classes(columns: &Columns) -> Vec<String> {
    let rows = CLASSES.iter().map(|(class, what)| {
        let judged = |of: &Campaign| -> Vec<Row> {
            let of_class = |row: &&Row| row.class == *class && row.is_limited;
            of.rows.iter().filter(of_class).cloned().collect()
        };
        let first = columns.iter().find_map(|(_, kept)| kept.and_then(Kept::campaign));
        let title = format!("{class}, {what} | {}", first.map_or(0, |of| judged(of).len()));
        row(&title, columns, |of| {
            let rows = judged(of);
            let worst = rows.iter().map(|row| row.deviation_m).fold(0.0, f64::max);
            let [runs, left] =
                [|row: &Row| row.runs, |row: &Row| row.left_lane].map(|of| rows.iter().map(of).sum());
            format!("{worst:.2}, {}", percent(left, runs))
        })
    });
    lines(&head(&["class", "rows"], columns), rows.collect::<Vec<_>>())
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

fn pushed(columns: &Columns) -> Vec<String> {
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
    let rows = named
        .iter()
        .map(|name| row(&format!("`{name}`"), columns, |of| cell(of.row(name))));
    let others = row("every other row of class C", columns, |of| {
        let others = of.rows.iter().filter(|row| !named.contains(&row.name));
        let most = others.filter_map(|row| row.pushed_m).fold(0.0, f64::max);
        format!("{most:.2}")
    });
    lines(&head(&["row"], columns), rows.chain([others]).collect::<Vec<_>>())
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

fn goals(columns: &Columns, which: &Latent) -> Vec<String> {
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
        row(
            "SG2: deviated the furthest, in rows that may stay unnoticed",
            columns,
            |of| most(latent(of).iter(), |row| Some(row.deviation_m), "m"),
        ),
        row("SG2: left the lane, in these rows", columns, |of| {
            left_lane(&latent(of))
        }),
        row("SG3: furthest beyond a dropped torque", columns, |of| {
            most(of.rows.iter(), |row| row.excess_m, "m")
        }),
        row("SG3: left the lane, in rows of classes A and B", columns, |of| {
            left_lane(&all(of, &|row| {
                row.is_limited && ["A", "B"].contains(&row.class.as_str())
            }))
        }),
        row(
            "SG4: the largest torque, in rows that may stay unnoticed",
            columns,
            |of| most(latent(of).iter(), |row| Some(row.peak_torque_nm), "N.m"),
        ),
        row("SG4: the largest torque, in any row", columns, |of| {
            most(of.rows.iter(), |row| Some(row.peak_torque_nm), "N.m")
        }),
    ];
    lines(&head(&["goal"], columns), rows)
}

fn latent(columns: &Columns, which: &Latent) -> Vec<String> {
    let cell = |row: Option<&Row>| {
        let Some(row) = row else { return "-".to_owned() };
        let share = 100.0 * row.noticed as f64 / row.runs as f64;
        let [low, high] = row.noticed_interval.map(|share| 100.0 * share);
        let median = row.noticed_after_ms[0].map_or("-".into(), |ms| count(ms.into()));
        let worst = row.deviation_m;
        format!("{share:.0} ({low:.0} to {high:.0}), {median}, {worst:.2}")
    };
    let named = names(columns, |row, _| which.was(row));
    let rows = named
        .iter()
        .map(|name| row(&format!("`{name}`"), columns, |of| cell(of.row(name))));
    lines(&head(&["fault"], columns), rows.collect::<Vec<_>>())
}

fn left(columns: &Columns, rows: &[String]) -> Vec<String> {
    let cell = |row: Option<&Row>| match row {
        None => "-".into(),
        Some(row) => match row.left_after_ms {
            None => format!("{} of {}", row.left, row.runs),
            Some([median, _]) => format!("{} of {}, {:.2} s", row.left, row.runs, f64::from(median) * 1e-3),
        },
    };
    let rows = rows
        .iter()
        .map(|name| row(&format!("`{name}`"), columns, |of| cell(of.row(name))));
    lines(
        &head(&["the ECU left, after (median)"], columns),
        rows.collect::<Vec<_>>(),
    )
}

fn availability(columns: &Columns, is_shown: impl Fn(&Cell) -> bool) -> Vec<String> {
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
        let shown = kept.cells().iter().filter(|cell| is_shown(cell));
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
        count(cell.lost_by_hand.legs),
    ]
}

#[cfg(test)]
mod tests;
