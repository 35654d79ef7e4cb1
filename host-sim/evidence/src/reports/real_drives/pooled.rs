//! The segments of one vehicle together.

use haptic_evidence::real_drives::{Judged, Model, Pooled};
use haptic_report::document::{Block, Cell, Table};

use super::{driving, with_interval};

/// The section's blocks; none without a vehicle of enough segments.
pub(super) fn section(pooled: &[Pooled]) -> Vec<Block> {
    if pooled.is_empty() {
        return Vec::new();
    }
    let text = "Each model is fitted to all segments of a vehicle but one and judged on that one; signals are about their means in the \
                segment, in the one left out too. Medians of the variance accounted for, with 95 % intervals of six segments or more. \
                Segments of one vehicle may be of one person: the intervals are over its segments, not over people. The column's equation \
                holds whoever steers: what it explains is no driver. Planned curvature is the automation's own, also by hand.";
    vec![
        Block::Text(text.to_owned()),
        Block::Table(now(pooled)),
        Block::Table(ahead(pooled)),
    ]
}

fn of(pooled: &Pooled, model: Model, ahead_s: Option<f64>) -> &[f64] {
    let judged = |judged: &&Judged| judged.model == model && judged.ahead_s == ahead_s;
    pooled
        .models
        .iter()
        .find(judged)
        .map_or(&[], |judged| &judged.accounted)
}

fn median(values: &[f64]) -> Cell {
    with_interval(values.into(), 1)
}

/// What the second one adds to the first, and in how many segments it does.
fn added(first: &[f64], second: &[f64]) -> [Cell; 2] {
    let more: Vec<f64> = second
        .iter()
        .zip(first)
        .map(|(second, first)| second - first)
        .collect();
    let better = more.iter().filter(|more| **more > 0.0).count();
    [median(&more), Cell::count(better)]
}

fn now(pooled: &[Pooled]) -> Table {
    let row = |p: &Pooled| {
        let of = |model| of(p, model, None);
        let column = of(Model::Column);
        let [adds, better] = added(column, of(Model::ColumnThenDriver));
        [
            ("Vehicle", Cell::text(&p.vehicle)),
            ("Driving", Cell::text(driving(p.by_hand))),
            ("Segments", Cell::count(p.segments.len())),
            ("Time, s", Cell::number(p.seconds, 0)),
            ("Column", median(column)),
            ("Driver adds", adds),
            ("Adds in", better),
            ("Driver alone", median(of(Model::Driver))),
        ]
    };
    Table::of_rows(
        "The torque of now. Column: wheel angle, that times v^2, its rate and acceleration, friction, lateral acceleration, roll; shared, T_h. \
         Driver: planned curvature times v^2 and lane offset of now, 0.3 and 0.6 s before, never the wheel; it adds to the column by what \
         that leaves.",
        pooled.iter().map(row),
    )
}

fn ahead(pooled: &[Pooled]) -> Table {
    let mut rows = Vec::new();
    for p in pooled {
        for stays in p
            .models
            .iter()
            .filter(|judged| judged.model == Model::Persistence)
        {
            let of = |model| of(p, model, stays.ahead_s);
            let past = of(Model::OwnPast);
            let [adds, better] = added(past, of(Model::Road));
            rows.push([
                ("Vehicle", Cell::text(&p.vehicle)),
                ("Driving", Cell::text(driving(p.by_hand))),
                ("Ahead, s", Cell::number(stays.ahead_s, 1)),
                ("Persistence", median(&stays.accounted)),
                ("Own past", median(past)),
                ("Road adds", adds),
                ("Adds in", better),
                ("Box-Jenkins", median(of(Model::BoxJenkins))),
                ("Ceiling", median(of(Model::Ceiling))),
            ]);
        }
    }
    Table::of_rows(
        "The torque ahead. Own past: a regression on T_d of now to 0.5 s before; the road is planned curvature times v^2 and lane offset. \
         Box-Jenkins: these, the wheel angle and, shared, T_h, of now to 0.3 s before, with ARMA(2,1) noise, fitted to errors of one row. \
         Ceiling: a regression on all that, fitted to the judged segment too: of all segments together no linear model of these signals \
         and lags accounts for more.",
        rows,
    )
}
