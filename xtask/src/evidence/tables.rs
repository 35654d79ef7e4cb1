//! What is kept, as tables in Markdown with the sentences that say where they come from.

mod availability;
mod campaign;

use std::collections::BTreeMap;

use super::kept::{Earlier, Kept, Origin, Same};
use super::list::{Form, List, Rule, Table};
use availability::availability;
use campaign::{campaigns, classes, ended, failures, goals, latent, left, pushed, sums};

/// Kept measurements in the order of a table, each with what tables call it.
type Columns<'a> = [(&'a str, Option<&'a Kept>)];

/// In the place of what was not measured.
const NOTHING: &str = "not measured";
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
    let same = origin
        .same
        .as_ref()
        .map_or(String::new(), |Same { commit, count }| {
            let commit = short(commit);
            format!("; `{commit}` gives the same to nine digits in {count}")
        });
    format!(
        "Measured at commit `{}` of {} {ran}, {rule}{held_out}{same}",
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

/// A number with thousands set apart.
fn count(number: u64) -> String {
    let digits = number.to_string();
    let groups = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy);
    groups.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests;
