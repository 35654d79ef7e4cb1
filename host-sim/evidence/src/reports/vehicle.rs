//! What is shown of how right identified vehicles are.

use haptic_evidence::vehicle::{Covered, VehicleCoverage};
use haptic_report::document::{Cell, Table};
use haptic_report::plot::{Axis, Figure, Series};
use haptic_report::studies::place;

/// What the coverage rests on.
pub(super) fn coverage_summary(coverage: &VehicleCoverage) -> String {
    let refuted: Vec<String> = coverage
        .refuted
        .iter()
        .map(|(world, count)| format!("{world} {count}"))
        .collect();
    format!(
        "CommonRoad's vehicles 1 to 3 with columns of ours, {} drives of 2 km in each world at 40 to 90 km/h, to both sides; angle in steps of 0.1 deg, yaw rate \
         with noise of 0.002 rad/s, torque with noise of 0.02 N.m, all with offsets. Mass and wheelbase are given, in every other six drives \
         l_f and yaw inertia too. Seeds from {}. Drives with a broken check: {}.",
        coverage.drives,
        coverage.seed,
        refuted.join(", ")
    )
}

/// A row for each quantity in each world.
pub(super) fn coverage_table(coverage: &VehicleCoverage) -> Table {
    let row = |row: &Covered| {
        let [low, high] = Cell::ends(
            row.coverage.map(|(_, interval)| interval.map(|end| 100.0 * end)),
            1,
        );
        [
            ("World", Cell::text(row.world)),
            ("Quantity", Cell::text(row.name)),
            ("Drives", Cell::count(row.drives)),
            ("Identified", Cell::count(row.identified)),
            (
                "Hold the truth (%)",
                Cell::number(row.coverage.map(|(share, _)| 100.0 * share), 1),
            ),
            ("95 % from", low),
            ("to", high),
            (
                "RMS error",
                Cell::number(Some(row.rms_error).filter(|_| row.identified > 0), 5),
            ),
            (
                "of",
                Cell::text(if row.unit == "1" { "the truth" } else { row.unit }),
            ),
        ]
    };
    Table::of_rows("", coverage.rows.iter().map(row))
}

/// The shares of the table, a row for each quantity.
pub(super) fn coverage_figure(coverage: &VehicleCoverage) -> Figure {
    let first = coverage.rows.first().map_or("", |row| row.world);
    let names: Vec<&str> = coverage
        .rows
        .iter()
        .filter(|row| row.world == first)
        .map(|row| row.name)
        .collect();
    let series = coverage.refuted.iter().enumerate().map(|(style, (world, _))| {
        let rows = coverage.rows.iter().filter(|row| row.world == *world).enumerate();
        let aside = 0.2 * style as f64 - 0.2;
        let points = rows.filter_map(|(k, row)| Some((place(k) + aside, 100.0 * row.coverage?.0)));
        Series::dots(world, style, points.collect())
    });
    let panel = Axis::new("95 % intervals that hold the truth", "%").panel(series);
    Figure::of_rows(names, [panel])
}

/// Intervals that surely hold the truth too rarely, outside the disturbed world.
pub(super) fn off_coverage(coverage: &VehicleCoverage) -> Vec<String> {
    const LEAST: f64 = 0.9;
    // Of fewer drives, one interval beside the truth would be too many.
    const FEWEST: usize = 20;
    let judged = coverage.rows.iter().filter(|row| row.world != "disturbed");
    let broken = judged.filter_map(|row| {
        let (share, [_, high]) = row.coverage?;
        (high < LEAST && row.identified >= FEWEST).then(|| {
            format!(
                "{} in the {} world: {:.1} % of the 95 % intervals hold the truth",
                row.name,
                row.world,
                100.0 * share
            )
        })
    });
    broken.collect()
}
