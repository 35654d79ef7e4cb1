//! A driver in pieces: the parameters of each stretch, the instants between them, and a figure that shows both.

use haptic_analysis::identify::{Change, History, Parameter, Piece, Pieces};
use haptic_batch::Confidence;
use haptic_batch::identify::IdentifiedDrive;

use crate::document::{Cell, Table};
use crate::plot::{Axis, Band, Figure, Series, Shade};

/// What the figure shows.
pub(super) fn caption(level: Confidence) -> String {
    format!(
        "Each piece with its {level} % intervals, and the same drive followed by the Kalman filter. A band without a line: not identified \
         in that piece. Shaded: where a change lies (95 %), which is of no piece."
    )
}

/// What a torque can tell, in order.
const SHOWN: [&str; 5] = ["k_hg", "gain_1", "gain_2", "gain_3", "t_p"];

fn parameter<'a>(piece: &'a Piece, name: &str) -> Option<&'a Parameter> {
    let list = piece.identification.parameters.list();
    list.into_iter().find(|l| l.0 == name).map(|l| l.2)
}

/// Every piece and every change.
pub(super) fn tables(pieces: &Pieces, level: Confidence) -> Vec<Table> {
    let mut out = vec![each(&pieces.pieces, level)];
    if !pieces.changes.is_empty() {
        out.push(changes(&pieces.changes));
    }
    out
}

fn each(pieces: &[Piece], level: Confidence) -> Table {
    let row = |piece: &Piece| {
        let mut cells = vec![Cell::number(piece.from_s, 1), Cell::number(piece.to_s, 1)];
        for name in SHOWN {
            let p = parameter(piece, name);
            cells.push(Cell::number(p.and_then(|p| p.estimate), 4));
            cells.extend(Cell::ends(p.and_then(|p| p.interval(level.normal())), 4));
        }
        let told = if piece.shows_such_changes { "yes" } else { "no" };
        cells.push(Cell::text(told));
        let refuted = piece.identification.refuted.first();
        cells.push(Cell::Text(refuted.map_or_else(String::new, |r| r.cause.clone())));
        cells
    };
    let mut columns = vec!["From (s)".to_owned(), "to (s)".to_owned()];
    for name in SHOWN {
        columns.extend([name.to_owned(), format!("{level} % from"), "to".to_owned()]);
    }
    columns.extend(["Shows such changes", "Refuted"].map(String::from));
    Table::new(
        "Each piece is a driver of its own. A dash: not identified in it. A piece that would not show changes such as those \
         between the pieces, in nine of ten drives, is not told to be of one driver.",
        columns,
        pieces.iter().map(row),
    )
}

fn changes(changes: &[Change]) -> Table {
    let row = |change: &Change| {
        let mut cells = vec![
            ("Changed", Cell::text(change.parameter)),
            ("by", Cell::number(change.by, 3)),
        ];
        for (name, (at, [low, high])) in ["Begin (s)", "End (s)"]
            .into_iter()
            .zip(change.at_s.into_iter().zip(change.at_95_s))
        {
            let times = [(name, at), ("95 % from", low), ("to", high)];
            cells.extend(times.map(|(name, s)| (name, Cell::number(s, 1))));
        }
        cells.push(("Evidence", Cell::number(change.deviance, 1)));
        cells
    };
    Table::of_rows(
        "What changed most, and when: begin and end are the same for a step. Of k_d the share of all gains. Evidence: what the \
                  change adds to twice the log likelihood.",
        changes.iter().map(row),
    )
}

/// The parameters of each piece over time; none if there are no pieces.
pub(super) fn figure(drive: &IdentifiedDrive) -> Option<Figure> {
    let pieces = drive.results.pieces.as_ref()?;
    let tracking = &drive.tracking;
    let of_a_piece = format!("{} % interval of a piece", drive.results.level);
    let histories: [(&str, &str, &History); 5] = [
        ("k_hg", "-", &tracking.k_hg),
        ("gain_1", "N.m/m", &tracking.gain[0]),
        ("gain_2", "N.m/(m.s)", &tracking.gain[1]),
        ("gain_3", "N.m/rad", &tracking.gain[2]),
        ("t_p", "s", &tracking.t_p),
    ];
    let panel = |(name, unit, history): (&str, &str, &History)| {
        let (mut x, mut ends, mut middles) = (Vec::new(), Vec::new(), Vec::new());
        for piece in &pieces.pieces {
            let p = parameter(piece, name);
            let interval = p.and_then(|p| p.interval(drive.results.level.normal()));
            let interval = interval.unwrap_or([f64::NAN; 2]);
            let estimate = p.and_then(|p| p.estimate).unwrap_or(f64::NAN);
            x.extend([piece.from_s, piece.to_s, piece.to_s]);
            ends.extend([interval, interval, [f64::NAN; 2]]);
            middles.extend([estimate, estimate, f64::NAN]);
        }
        Axis::new(name, unit).panel([
            Series::interval(&of_a_piece, 5, &x, &ends),
            Series::through("followed", 4, &tracking.time_s, &history.estimate),
            Series::through("identified in a piece", 1, &x, &middles),
        ])
    };
    let band = |change: &Change| Band::new("a change lies here (95 %)", change.within_s(), Shade::Dark);
    Some(Figure {
        bands: pieces.changes.iter().map(band).collect(),
        ..Axis::new("Time", "s").figure(histories.map(panel))
    })
}
