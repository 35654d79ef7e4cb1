//! What is shown of an identified vehicle.

use crate::document::{Block, Cell, Report, Section, Table};
use haptic_batch::vehicle::IdentifiedVehicle;
use haptic_vehicle::{
    Check, MOST_LATERAL_M_PER_S2, Manoeuvre, Part, Quantity, VehicleIdentification, Verdict,
};

/// The document of an identification.
#[must_use]
pub fn report(vehicle: &IdentifiedVehicle, log: &str) -> Report {
    let found = &vehicle.identification;
    let [least, most] = found.speeds_m_per_s.map(|v| 3.6 * v);
    let percent = |fit: Option<f64>| fit.map_or_else(|| "not fitted".to_owned(), |fit| format!("{fit:.1} %"));
    let summary = format!(
        "{log}: {:.1} of {:.1} s used, at {least:.0} to {most:.0} km/h; {:.1} s were above {MOST_LATERAL_M_PER_S2} m/s2 and left out. Of \
         the yaw rate the wheel angle explains {}, of the wheel angle the torques explain {}.",
        found.used_s,
        found.recorded_s,
        found.fast_s,
        percent(found.yaw_rate_fit_percent),
        percent(found.wheel_angle_fit_percent),
    );
    let mut sections = vec![
        Section::new(
            "Vehicle and column",
            vec![Block::Table(quantities(vehicle)), Block::Table(reasons(found))],
        ),
        Section::of_table("Checks", Table::of_rows("", found.checks.iter().map(check))),
    ];
    if !found.manoeuvres.is_empty() {
        sections.push(Section::new("What would tell the rest", manoeuvres(vehicle)));
    }
    let assumed = Table::of_texts("", ["Taken for granted"], found.assumed.iter().map(|what| [what]));
    sections.push(Section::of_table("Assumed", assumed));
    Report::new("A vehicle from a recorded drive", summary, sections)
}

const fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Identified => "identified",
        Verdict::NotIdentified => "not identified",
        Verdict::Given => "given",
    }
}

/// Decimals with which four digits of a value are seen.
fn decimals(value: f64) -> usize {
    let places = 3.0 - value.abs().max(1e-9).log10().floor();
    places.clamp(0.0, 8.0) as usize
}

fn quantities(found: &IdentifiedVehicle) -> Table {
    let from = format!("{} % from", found.level);
    let row = |q: &Quantity| {
        let interval = found.interval(q);
        let size = q
            .estimate
            .filter(|value| *value != 0.0)
            .or(interval.map(|[low, high]| low.abs().max(high.abs())));
        let places = decimals(size.unwrap_or(1.0));
        let [low, high] = Cell::ends(interval, places);
        [
            ("", Cell::text(q.name)),
            ("Unit", Cell::text(if q.unit.is_empty() { "-" } else { q.unit })),
            ("Verdict", Cell::text(verdict(q.verdict))),
            ("Estimate", Cell::number(q.estimate, places)),
            ("Standard error", Cell::number(q.standard_error, places + 1)),
            (&*from, low),
            ("to", high),
        ]
    };
    Table::of_rows("", found.identification.quantities.iter().map(row))
}

fn reasons(found: &VehicleIdentification) -> Table {
    let lacking = found
        .quantities
        .iter()
        .filter(|q| q.verdict == Verdict::NotIdentified);
    let row = |q: &Quantity| {
        [
            ("Not identified", Cell::text(q.name)),
            ("Why", Cell::text(&q.why)),
        ]
    };
    Table::of_rows("", lacking.map(row))
}

fn part(part: Part) -> &'static str {
    match part {
        Part::Vehicle => "vehicle",
        Part::Column => "column",
    }
}

fn check(check: &Check) -> [(&'static str, Cell); 6] {
    [
        ("Fit", Cell::text(part(check.part))),
        ("Assumption", Cell::text(check.assumption)),
        ("Holds", Cell::text(if check.holds { "yes" } else { "NO" })),
        ("Value", Cell::number(check.value, 1)),
        ("Limit", Cell::number(check.limit, 1)),
        (
            "Likeliest cause",
            Cell::text(if check.holds { "" } else { check.cause }),
        ),
    ]
}

fn manoeuvres(found: &IdentifiedVehicle) -> Vec<Block> {
    let all: &[Manoeuvre] = &found.identification.manoeuvres;
    let behind = format!("Half of the {} % interval behind", found.level);
    let names: Vec<&'static str> = all[0].tells.iter().map(|telling| telling.name).collect();
    let row = |name: &'static str| {
        let mut cells = vec![(&*behind, Cell::text(name))];
        for manoeuvre in all {
            let telling = manoeuvre.tells.iter().find(|telling| telling.name == name);
            let text = telling.map(|t| {
                format!(
                    "{}{}",
                    t.half_width,
                    if t.identified { ", identified" } else { "" }
                )
            });
            cells.push((manoeuvre.name, Cell::text(text.unwrap_or_default())));
        }
        cells
    };
    let how = all.iter().map(|manoeuvre| (manoeuvre.name, manoeuvre.how));
    let caption = "Predicted for the values and the noise of this drive, if a minute of the manoeuvre were added to it.";
    vec![
        Block::Table(Table::of_rows(caption, names.into_iter().map(row))),
        Block::Table(Table::of_pairs(["Manoeuvre", "On an empty place"], how)),
    ]
}
