//! What one run shows: a figure, what happened, its metrics; its time series and its bus.

use std::path::Path;

use super::{LEFT_THE_ROAD, curves, ended, failure_marker};
use crate::document::{
    Block, Cell, Provenance, Report, Section, SeriesFormat, Table, WriteError, definitions_table, write_file,
    write_trace,
};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_batch::readings::Reading;
use haptic_batch::run::{SingleResults, SingleRun};
use haptic_log::trace::Sample;
use haptic_log::{Event, candump};
use haptic_metrics::{DEFINITIONS, Definition};
use haptic_sim::models::torsion_bar::CurveChoice;
use haptic_sim::scenario::{FailureKind, Scenario};
use haptic_sim::simulation::Ending;

/// Writes the time series if they are asked for, and the bus if it was recorded (as `candump -L` does).
///
/// # Errors
/// What could not be written.
pub fn write_series(single: &SingleRun, series: SeriesFormat, directory: &Path) -> Result<(), WriteError> {
    write_trace(directory, "run", &single.run.trace, series)?;
    if single.bus.is_empty() {
        return Ok(());
    }
    write_file(&directory.join("bus.log"), |f| {
        for (ms, frame) in &single.bus {
            candump::write(f, f64::from(*ms) * 1e-3, frame.id(), frame.data())?;
        }
        Ok(())
    })
}

/// How the run ended, and when and why the guidance did, if it did before.
fn how_it_ended(single: &SingleRun) -> String {
    let record = &single.results.record;
    let ended = if record.diverged {
        format!("DIVERGED at {:.0} m", record.end_m)
    } else {
        "ran to its end".into()
    };
    match record.away.when_and_why() {
        Some(left) => format!("{ended}; guidance ended {left}"),
        None => ended,
    }
}

/// Every metric of the run, and what the ECU read of K_hg.
fn table(results: &SingleResults) -> Table {
    let metric = |d: &Definition| {
        let value = (d.value)(&results.record.metrics);
        vec![Cell::text(d.label), Cell::number(value, 4), Cell::text(d.unit)]
    };
    let mut rows: Vec<_> = DEFINITIONS.iter().map(metric).collect();
    if let Some(read) = results.k_hg {
        let name = Cell::text("K_hg, as the ECU reads it");
        let spread = Cell::Text(format!("+- {:.4}", read.deviation));
        rows.push(vec![name, Cell::number(read.k_hg, 4), spread]);
    }
    Table::new("", ["Metric", "Value", "Unit"], rows)
}

fn figure(single: &SingleRun) -> Figure {
    let samples = &single.run.trace.samples;
    let diverged = single.run.diverged().then_some(LEFT_THE_ROAD);
    let panel = |quantity: &str, unit: &str, value: fn(&Sample) -> f64| {
        let points = samples.iter().map(|s| (s.s_m, value(s))).collect();
        Axis::new(quantity, unit).panel(ended(Series::line("", 1, points), diverged))
    };

    // Each torque for itself: the probe would hide the driver's.
    let mut panels = vec![
        panel("Lateral error", "m", |s| s.lateral_error_m),
        panel("Wheel angle", "deg", |s| s.wheel_angle_rad.to_degrees()),
        panel("Driver torque", "N.m", |s| s.driver_torque_nm),
        panel("Guidance torque", "N.m", |s| s.guidance_torque_nm),
    ];
    if single.scenario.column().has_bar() {
        panels[2] = {
            let line = |name, style, value: fn(&Sample) -> Option<f64>| {
                let points = samples.iter().filter_map(|s| Some((s.s_m, value(s)?))).collect();
                ended(Series::line(name, style, points), diverged)
            };
            let hands = line("hands", 1, |s| Some(s.driver_torque_nm));
            let series = hands.into_iter().chain(line("bar", 2, |s| s.bar_torque_nm));
            Axis::new("Hands and bar", "N.m").panel(series)
        };
        panels.push(panel("Assist", "N.m", |s| s.assist_torque_nm.unwrap_or(f64::NAN)));
    }
    if single.scenario.changes_speed() {
        panels.push(panel("Speed", "km/h", |s| 3.6 * s.speed_m_per_s));
    }
    if single.scenario.guidance().probe {
        let place = |time_s: f64| {
            let next = samples.partition_point(|s| s.time_s < time_s);
            samples.get(next).or(samples.last()).map_or(0.0, |s| s.s_m)
        };
        let truth = true_reliance(single).into_iter();
        let truth: Vec<_> = truth.map(|(t, k_hg)| (place(t), k_hg)).collect();
        panels.push(reliance_panel("", &single.readings.readings, &truth, place));
    }
    let bands = curves::bands(single.scenario.course());
    Figure {
        markers: failure_marker(&single.scenario, samples).into_iter().collect(),
        bands: bands
            .into_iter()
            .chain(curves::unguided(&single.unguided))
            .collect(),
        ..Axis::new("Distance along the road", "m").figure(panels)
    }
}

/// K_hg over time, s, for as long as there is guidance.
fn true_reliance(single: &SingleRun) -> Vec<(f64, f64)> {
    let scenario = &single.scenario;
    let last_s = single.run.trace.samples.last().map_or(0.0, |s| s.time_s);
    let end_s = scenario.failure().at_s().map_or(last_s, |t| t.min(last_s));
    let start = scenario.gains().k_hg;
    match &scenario.driver_change() {
        Some(change) if change.time_s < end_s => {
            let t = change.time_s;
            vec![(0.0, start), (t, start), (t, change.k_hg), (end_s, change.k_hg)]
        }
        _ => vec![(0.0, start), (end_s, start)],
    }
}

/// The document of a run.
pub fn report(single: &SingleRun) -> Report {
    let (scenario, results) = (&single.scenario, &single.results);
    let [from, to] = results.window_m;
    let caption = if scenario.guidance().probe {
        "Lateral error, wheel angle, torques, and what the ECU says of K_hg."
    } else {
        "Lateral error, wheel angle and torques."
    };
    let summary = format!(
        "{}, {}, driver with t_p {} s, K_d {} and K_hg {} ({}), failure {}: {}. {}Metrics are taken over {from} to {to} m of \
             {:.0} m.",
        results.course,
        scenario.speed(),
        scenario.driver().t_p,
        scenario.gains().k_d,
        scenario.gains().k_hg,
        scenario.condition(),
        results.record.failure,
        how_it_ended(single),
        column(scenario),
        results.course_length_m,
    );
    let along = vec![
        Block::figure("run", figure(single), caption),
        Block::Events(events(single)),
    ];
    let metrics = vec![
        Block::Table(table(results)),
        Block::Table(definitions_table()).on_page(),
    ];
    let sections = vec![
        Section::new("Along the road", along),
        Section::new("Metrics", metrics),
    ];
    Report {
        notes: results.notes.clone(),
        // Enough to repeat the run.
        provenance: Provenance::new(Some(scenario.to_toml())),
        ..Report::new("A run under shared steering control", summary, sections)
    }
}

/// The column, where it is not the paper's.
fn column(scenario: &Scenario) -> String {
    let column = scenario.column();
    if !column.has_bar() {
        return String::new();
    }
    let assist = match &scenario.assist().curve {
        CurveChoice::Usual(usual) => usual.name(),
        CurveChoice::Points(_) => "the file's own",
    };
    format!(
        "A torsion bar of {} N.m/rad, assist: {assist}. ",
        column.k_tb_nm_per_rad
    )
}

fn events(single: &SingleRun) -> Vec<Event> {
    let end_s = single.run.trace.samples.last().map_or(0.0, |s| s.time_s);
    let mut events = single.reported.clone();
    let event = |time_s, what| Event { time_s, what };
    events.extend(single.unguided.iter().flat_map(|stretch| {
        let left = event(stretch.from_s, format!("The guidance leaves: {}", stretch.why));
        let back = stretch.until_s;
        let back = back.map(|back_s| event(back_s, "The guidance is back".into()));
        std::iter::once(left).chain(back)
    }));
    if let Some(time_s) = single.scenario.failure().at_s().filter(|t| *t <= end_s) {
        let what = match single.scenario.failure().kind {
            FailureKind::Input => "The lane preview stops",
            FailureKind::Torque | FailureKind::None => "The guidance torque drops to zero",
        };
        events.push(event(time_s, what.into()));
        let noticed_s = time_s + single.scenario.driver().takes_over_after_s;
        if noticed_s <= end_s {
            events.push(event(noticed_s, "The driver steers as manually".into()));
        }
    }
    let fault_s = single.scenario.column().fault_at_s().filter(|t| *t <= end_s);
    if let Some(time_s) = fault_s {
        let fault = serde_json::json!(single.scenario.column().fault);
        events.push(event(
            time_s,
            format!("The column fails: {}", fault.as_str().unwrap_or_default()),
        ));
    }
    let what = match single.run.ending {
        Ending::CourseEnd => "The far point reaches the end of the course".into(),
        Ending::Diverged { s_m } => format!("The run diverged at {s_m:.0} m and was stopped"),
    };
    events.push(event(end_s, what));
    events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    events
}

/// The ECU's estimate with two deviations on each side, and the truth: value from an abscissa on. `x` is the
/// abscissa of a time, s.
pub fn reliance_panel(
    title: &str,
    readings: &[Reading],
    truth: &[(f64, f64)],
    x: impl Fn(f64) -> f64,
) -> Panel {
    // A line breaks where a value is not finite: no estimate, no line.
    let estimates = || readings.iter().map(|r| r.estimate.unwrap_or([f64::NAN; 2]));
    let places: Vec<f64> = readings.iter().map(|r| x(r.time_s)).collect();
    let ends: Vec<[f64; 2]> = estimates()
        .map(|[k_hg, deviation]| [k_hg - 2.0 * deviation, k_hg + 2.0 * deviation])
        .collect();
    let estimate = places.iter().copied().zip(estimates().map(|[k_hg, _]| k_hg));
    let series = [
        Series::interval("K_hg by the ECU \u{b1} 2 deviations", 5, &places, &ends),
        Series::line("K_hg of the driver", 0, truth.to_vec()),
        Series::line("K_hg by the ECU", 1, estimate.collect()),
    ];
    Panel::new(title, Axis::new("K_hg", "-").within(-0.5, 1.5), series)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;
    use haptic_sim::models::driver::DriverParameters;
    use haptic_sim::models::torsion_bar::{ColumnFault, ColumnKind, ColumnParameters};
    use haptic_sim::scenario::{Condition, Scenario};

    #[test]
    fn a_column_with_a_bar_and_what_fails_in_it_are_named() {
        let column = ColumnParameters {
            kind: ColumnKind::TorsionBar,
            fault: ColumnFault::AssistLost,
            fault_time_s: 70.0,
            ..ColumnParameters::default()
        };
        let scenario = Scenario::builder().column(column).build().unwrap();
        let single = haptic_batch::run::run(scenario, false).unwrap();
        let summary = report(&single).summary;
        assert!(
            summary.contains("A torsion bar of 143.24 N.m/rad, assist: none."),
            "{summary}"
        );
        let failed = |event: &Event| event.time_s == 70.0 && event.what == "The column fails: assist-lost";
        assert!(events(&single).iter().any(failed));
    }

    fn ends(speed_kmh: f64) -> (SingleRun, Vec<Vec<(f64, f64)>>) {
        let driver = DriverParameters {
            t_p: 0.5,
            ..DriverParameters::default()
        };
        let scenario = Scenario::builder()
            .speed_kmh(speed_kmh)
            .condition(Condition::Manual)
            .driver(driver);
        let single = haptic_batch::run::run(scenario.build().unwrap(), false).unwrap();
        let figure = figure(&single);
        let crosses = figure
            .panels
            .iter()
            .flat_map(|p| &p.series)
            .filter(|s| s.mark == Mark::Ends);
        let places = crosses.map(|s| s.points.clone()).collect();
        (single, places)
    }

    /// By hand a driver with half a second of delay is unstable at 130 km/h (the map of `host-sim stability`).
    #[test]
    fn a_run_that_leaves_the_road_says_so_where_its_lines_end() {
        let (single, crosses) = ends(130.0);
        let last = single.run.trace.samples.last().unwrap();
        assert!(last.lateral_error_m.abs() > 9.0, "{}", last.lateral_error_m);
        assert_eq!(crosses.len(), 4, "one a panel");
        assert_eq!(crosses[0], [(last.s_m, last.lateral_error_m)]);
        assert!(ends(60.0).1.is_empty());
    }
}
