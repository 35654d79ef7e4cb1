//! The columns of the table of drives, and a drive as a row of it.

use super::{DesignPoint, Driven, Sweep};
use crate::Away;
use crate::engine::{Entry, EntryKind, number};

/// Names of the columns, and what they hold. What is varied is a column of numbers if all its values are numbers.
pub(super) fn columns(sweep: &Sweep) -> Vec<(String, EntryKind)> {
    use EntryKind::{Flag, Number, Text, Whole};
    let named = |name: &str, kind| (name.to_owned(), kind);
    let mut columns: Vec<_> = [("drive", Whole), ("seed", Whole), ("version", Text)]
        .map(|(name, kind)| named(name, kind))
        .into();
    for axis in sweep.axes() {
        for (i, column) in axis.columns.iter().enumerate() {
            let is_text = |row: &Vec<_>| number(&row[i]).is_none();
            let kind = if axis.rows().is_some_and(|rows| rows.iter().any(is_text)) {
                Text
            } else {
                Number
            };
            columns.push(named(
                if column.name == "seed" {
                    "vary.seed"
                } else {
                    &column.name
                },
                kind,
            ));
        }
    }
    columns.extend([named("diverged", Flag), named("end_m", Number)]);
    columns.extend(
        Away::NAMES
            .into_iter()
            .zip([Number, Text, Number, Number])
            .map(|(name, kind)| named(name, kind)),
    );
    columns.extend(sweep.metrics().iter().map(|metric| named(metric.name, Number)));
    columns
}

/// A drive in the order of the columns.
pub(super) fn entries<'a>(point: &'a DesignPoint, driven: &Driven, version: &str) -> Vec<Entry<'a>> {
    let mut entries = vec![
        Entry::Whole(point.drive),
        Entry::Whole(point.seed),
        Entry::Text(version.into()),
    ];
    entries.extend(point.values.iter().map(Entry::Value));
    let Away {
        guidance_left_s,
        guidance_left_why,
        guidance_back_s,
        unguided_s,
    } = driven.away;
    entries.extend([
        Entry::Flag(driven.diverged),
        Entry::Number(Some(driven.end_m)),
        Entry::Number(guidance_left_s),
        Entry::Text(guidance_left_why.map_or(String::new(), |why| why.to_string())),
        Entry::Number(guidance_back_s),
        Entry::Number(unguided_s),
    ]);
    entries.extend(driven.metrics.iter().copied().map(Entry::Number));
    entries
}
