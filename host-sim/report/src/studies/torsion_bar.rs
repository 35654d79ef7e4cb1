//! What the studies of a torsion bar show: overlay or offset, and what a sensor has to deliver.

use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_column::study::assist::{
    Column, DRIVEN_KMH, Felt, Group, GroupRow, LoopRow, Results, Spread, WORKING_NM,
};
use haptic_column::study::hands::{self, Eye, Hand, Row, Scene};
use haptic_column::study::{ecu, reading, sensors};
use haptic_sim::models::torsion_bar::Inject;

/// What stands beside every result: what is not part of it.
const LEFT_OUT: &str = "The ECU is not part of this: law (9) guides in float64. Drivers keep the gains that the paper found on a column \
     without assist.";

/// The document of overlay or offset.
pub fn assist_report(results: &Results) -> Report {
    let caption = "What hands that hold the wheel feel of 1 N.m of guidance, where no torque is on the bar.";
    let felt = vec![
        Block::figure("felt", felt_figure(results), caption),
        Block::Table(felt_table(&results.felt)),
    ];
    let sections = vec![
        Section::new("What 1 N.m of guidance becomes", felt),
        Section::of_table("The loop through the assist", loops_table(&results.loops)),
        Section::of_table("The drivers of tables 5 to 8", drivers_table(&results.drivers)),
    ];
    let bar = &results.column.0;
    let summary = format!(
        "A wheel of {} kg.m2 on a bar of {} N.m/rad. Overlay: guidance is added behind the assist; offset: in front of it.",
        bar.j_w_kg_m2, bar.k_tb_nm_per_rad
    );
    Report::new("Overlay or offset", summary, sections).with_notes(vec![LEFT_OUT.into()])
}

fn name(inject: Inject) -> &'static str {
    match inject {
        Inject::Overlay => "overlay",
        Inject::Offset => "offset",
    }
}

fn felt_table(rows: &[Felt]) -> Table {
    let row = |felt: &Felt| {
        [
            ("Assist", Cell::text(felt.curve)),
            ("Guidance", Cell::text(name(felt.inject))),
            ("Speed (km/h)", Cell::number(felt.speed_kmh, 0)),
            ("T_tb (N.m)", Cell::number(felt.working_nm, 0)),
            ("Slope", Cell::number(felt.slope, 2)),
            ("Felt (N.m)", Cell::number(felt.felt_nm, 2)),
            ("Motor, wheel held (N.m)", Cell::number(felt.motor_held_nm, 2)),
            ("Motor, wheel free (N.m)", Cell::number(felt.motor_free_nm, 2)),
        ]
    };
    let caption = "Of 1 N.m that the guidance asks for at 0.5 Hz: what hands that hold the wheel feel, and what the motor does, which for an \
                   overlay is 1 N.m less what the driver's own assist takes away";
    Table::of_rows(caption, rows.iter().map(row))
}

fn felt_figure(results: &Results) -> Figure {
    let mut curves: Vec<&str> = results.felt.iter().map(|felt| felt.curve).collect();
    // In their order, which is that of the rows.
    curves.dedup();
    let panel = |inject: Inject| {
        let line = |(style, curve): (usize, &&str)| {
            let own = results
                .felt
                .iter()
                .filter(|felt| (felt.inject, felt.curve, felt.working_nm) == (inject, *curve, WORKING_NM[0]));
            Series::line(
                curve,
                style,
                own.map(|felt| (felt.speed_kmh, felt.felt_nm)).collect(),
            )
        };
        let y = Axis::new("Felt", "N.m").within(0.0, 1.0);
        Panel::new(name(inject), y, curves.iter().enumerate().map(line))
    };
    Axis::new("Speed", "km/h").figure([panel(Inject::Overlay), panel(Inject::Offset)])
}

fn loops_table(rows: &[LoopRow]) -> Table {
    let row = |of: &LoopRow| {
        let [free, held] = &of.margins;
        let number = |margins: &Option<haptic_column::linear::Margins>, which: usize| {
            let found = margins
                .as_ref()
                .and_then(|m| [m.gain, m.phase_deg, Some(m.sensitivity)][which]);
            Cell::number(found, if which == 1 { 0 } else { 1 })
        };
        [
            ("Assist", Cell::text(of.curve)),
            ("Speed (km/h)", Cell::number(of.speed_kmh, 0)),
            ("Largest slope", Cell::number(of.slope, 1)),
            ("Gain margin, free", number(free, 0)),
            ("Phase margin, free (deg)", number(free, 1)),
            ("Sensitivity, free", number(free, 2)),
            ("Gain margin, held", number(held, 0)),
            ("Phase margin, held (deg)", number(held, 1)),
            ("Sensitivity, held", number(held, 2)),
        ]
    };
    let caption = "Margins of the loop from motor over bar, sensor and compensator back to the motor, at the largest slope of the assist; \
                   a dash: unstable, or no larger gain swings";
    Table::of_rows(caption, rows.iter().map(row))
}

fn spread(of: &Option<Spread>, decimals: usize) -> Cell {
    let words = |s: &Spread| {
        let [least, median, most] = [s.least, s.median, s.most].map(|x| format!("{x:.decimals$}"));
        format!("{median} ({least} to {most})")
    };
    Cell::Text(of.as_ref().map_or("\u{2013}".into(), words))
}

fn drivers_table(rows: &[GroupRow]) -> Table {
    let row = |of: &GroupRow| {
        let column = match (of.column, of.curve) {
            (Column::Assisted(_, inject), Some(curve)) => format!("{curve}, {}", name(inject)),
            (Column::Rigid, _) => "the paper's".into(),
            (Column::Smooth, _) => "bar without friction".into(),
            _ => "bar alone".into(),
        };
        let group = match of.group {
            Group::Manual => "table 5, by hand",
            Group::Guided => "table 6",
            Group::Conditions => "tables 7, 8",
        };
        [
            ("Column", Cell::Text(column)),
            ("Drivers", Cell::text(group)),
            (
                "Off the road",
                Cell::Text(format!("{} of {}", of.off_road, of.drivers)),
            ),
            ("Peak (m)", spread(&of.peak_m, 2)),
            ("A loss adds (m)", spread(&of.loss_costs_m, 2)),
            ("Phase margin (deg)", spread(&of.phase_deg, 0)),
            ("Motor (N.m)", spread(&of.motor_nm, 2)),
        ]
    };
    let caption = format!(
        "Peak lateral error in the first bend of paper-course at {DRIVEN_KMH} km/h, what a sudden loss of the torque adds to it, the phase margin \
         of eyes and arm on a straight, and the motor's torque for 1 N.m with this arm at the wheel: median (least to largest) of the \
         drivers that stayed on the road"
    );
    Table::of_rows(caption, rows.iter().map(row))
}

fn ecu_table(rows: &[ecu::Row]) -> Table {
    let seconds = |s: Option<f64>| s.map_or(Cell::text("none"), |s| Cell::number(s, 1));
    let row = |row: &ecu::Row| {
        let found: Vec<String> = row
            .found
            .iter()
            .map(|(fault, s)| format!("{fault}, {s:.2} s"))
            .collect();
        [
            ("Its parameters say", Cell::text(row.believed)),
            ("No hand (s)", seconds(row.warned_s)),
            ("With the probe (s)", seconds(row.warned_beside_probe_s)),
            ("Resting hands (s)", seconds(row.falsely_warned_s)),
            (
                "Yields (ms)",
                row.yields_ms
                    .map_or(Cell::text("none"), |ms| Cell::number(f64::from(ms), 0)),
            ),
            ("Found", Cell::Text(found.join("; "))),
        ]
    };
    let caption = format!(
        "A banked straight at 60 km/h, the column every 2 ms: when the driver is warned of hands off, without a hand and with hands that rest \
         on the wheel; after what time half of the guidance is away when hands push with {} N.m; what else the ECU finds, in each of these",
        ecu::PUSH_NM
    );
    Table::of_rows(caption, rows.iter().map(row))
}

/// The document of what the ECU reads of K_hg.
pub fn reading_report(results: &reading::Results) -> Report {
    let row = |row: &reading::Row| {
        [
            ("The arm acts on", Cell::text(row.column.name())),
            ("K_hg", Cell::number(row.k_hg, 1)),
            ("Of the motor's torque", Cell::number(row.of_motor, 3)),
            ("Read", Cell::number(row.read, 3)),
            ("Deviation", Cell::number(row.spread, 3)),
            ("Reported", Cell::number(row.reported, 3)),
            ("Drives", Cell::number(row.drives as f64, 0)),
        ]
    };
    let caption = "The reading at the end of each drive: mean and standard deviation over the drives, and the standard deviation that the ECU \
         reports. Beside an assist the ECU reads an arm's answer to the motor's torque, of which 1/(1 + slope) comes up to the hands.";
    let summary = format!(
        "The paper's driver on paper-course at 60 km/h, with the probe and a remnant of 0.1 N.m, {} seeds of each. The ECU is told right of its \
         bar, and has the angle of the column.",
        reading::SEEDS
    );
    let table = Table::of_rows(caption, results.rows.iter().map(row));
    Report::new(
        "K_hg through a torsion bar",
        summary,
        vec![Section::of_table("", table)],
    )
}

/// The document of the sensors.
pub fn sensors_report(results: &sensors::Results) -> Report {
    let row = |row: &sensors::Row| {
        [
            ("Step (deg)", Cell::number(row.step_deg, 3)),
            ("Rate (Hz)", Cell::number(row.rate.hz(), 0)),
            ("Bandwidth (rad/s)", Cell::number(row.bandwidth, 0)),
            ("Late (ms)", Cell::number(row.lag_ms, 0)),
            ("Error (N.m)", Cell::number(row.error_nm, 3)),
            ("J_w 30 % wrong (N.m)", Cell::number(row.wrong_j_w_nm, 3)),
            ("K_tb 10 % wrong (N.m)", Cell::number(row.wrong_k_tb_nm, 3)),
            ("No hand (N.m)", Cell::number(row.no_hand_nm, 3)),
        ]
    };
    let best = "For each sensor of the angle the observer with the least error";
    let all = "Every observer with every sensor: root of the mean square of what it says, less the hands' torque of so long ago";
    let sections = vec![
        Section::new(
            "What a sensor has to deliver",
            vec![
                Block::Table(Table::of_rows(best, results.best().into_iter().map(row))),
                Block::Text(format!(
                    "The bar's own reading, taken for the hands', is off by {:.3} N.m, and says {:.3} N.m where nobody holds the wheel.",
                    results.bar_alone_nm, results.bar_no_hand_nm
                )),
            ],
        ),
        Section::of_table("The ECU behind the bar", ecu_table(&results.ecu)),
        Section::of_table("All", Table::of_rows(all, results.rows.iter().map(row))),
    ];
    let summary = format!(
        "Hands that steer with {} N.m at 0.4 Hz and half of it at 1.1 Hz, guidance and probe beside them; then no hand. 60 km/h, \
         {} assist, angle of the column.",
        sensors::HANDS_NM,
        results.curve
    );
    let note = "One pattern of hands, a smooth road, no bumps; the angle has no noise but its steps.";
    Report::new("The hands' torque through a torsion bar", summary, sections).with_notes(vec![note.into()])
}

fn hand_name(hand: Hand) -> &'static str {
    match hand {
        Hand::None => "no hand",
        Hand::Touch => "light touch",
        Hand::Resting => "resting hand",
        Hand::Steering => "steering hand",
    }
}

fn scene_name(scene: Scene) -> &'static str {
    match scene {
        Scene::Straight => "straight",
        Scene::Bends => "bends",
        Scene::Bumps => "bends, bumps",
    }
}

fn eye_name(eye: Eye) -> String {
    match eye {
        Eye::Bar => "the bar alone".into(),
        Eye::Observer {
            step_deg,
            rate,
            j_w_share,
            ..
        } => {
            let believed = match j_w_share < 1.0 {
                true => format!(", J_w {:.0} % too low", 100.0 * (1.0 - j_w_share)),
                false => String::new(),
            };
            format!("{step_deg} deg, {:.0} Hz{believed}", rate.hz())
        }
    }
}

/// A row of the table: a wheel, a scene and an eye, and a column for each hand.
fn told_row(rows: &[Row]) -> Vec<(&'static str, Cell)> {
    let first = &rows[0];
    let mut cells = vec![
        ("J_w (kg.m2)", Cell::number(first.wheel.j_w_kg_m2, 3)),
        ("K_tb (N.m/rad)", Cell::number(first.wheel.k_tb_nm_per_rad, 0)),
        ("Road", Cell::text(scene_name(first.scene))),
        ("Angle, or the bar alone", Cell::Text(eye_name(first.eye))),
    ];
    for row in rows {
        let heading = match row.hand {
            Hand::None => "",
            Hand::Touch => "Warned (s): touch",
            Hand::Resting => "resting",
            Hand::Steering => "steering",
        };
        let words = row.told.map_or("\u{2013}".into(), |told| {
            let [_, low, high] = told.after_s;
            let warned = told.warned_s.map_or("never".into(), |s| format!("{s:.0}"));
            let high = match high <= hands::LONGEST_S {
                true => format!("{high:.0}"),
                false => format!("over {:.0}", hands::LONGEST_S),
            };
            format!("{warned} ({low:.0} to {high})")
        });
        cells.push((heading, Cell::Text(words)));
    }
    let counted = rows.iter().filter_map(|row| row.told).map(|told| told.counted);
    cells.push(("False, counted", Cell::Text(counted.sum::<u32>().to_string())));
    cells
}

fn roc_figure(results: &hands::Results) -> Figure {
    let panel = |scene: Scene| {
        let own = results.roc.iter().filter(|roc| roc.scene == scene).enumerate();
        let line = |(style, roc): (usize, &hands::Roc)| {
            let points = roc.points.iter().map(|[none, hand]| (*none, *hand)).collect();
            Series::line(hand_name(roc.hand), style, points)
        };
        let y = Axis::new("Hand is felt", "share of seconds").within(0.0, 1.0);
        Panel::new(scene_name(scene), y, own.map(line))
    };
    Axis::new("Felt where there is none", "share of seconds").figure(Scene::ALL.map(panel))
}

/// The document of hands, told from the motor.
pub fn hands_report(results: &hands::Results) -> Report {
    let rows = results.rows.chunks(Hand::ALL.len() - 1).map(told_row);
    let caption = format!(
        "Median time from letting go to a warning that is false once in {} h beside that hand, and in brackets the least and the largest time \
         without a felt hand after which it comes ({} % of what {} h of each hand say); a dash: not told from no hand within {:.0} s. The last \
         column counts the false warnings of {:.2} h beside the three hands",
        hands::FALSE_IN_H,
        results.level,
        results.hours,
        hands::LONGEST_S,
        3.0 * results.hours
    );
    let figure = "Seconds in which the swing of the estimate is above a threshold, by threshold: where somebody holds the wheel, and where \
                  nobody does. The angle comes in steps of 0.02 deg every millisecond.";
    let sections = vec![
        Section::of_table(
            "How soon a wheel without hands is known",
            Table::of_rows(&caption, rows),
        ),
        Section::new(
            "Hand or motor",
            vec![Block::figure("roc", roc_figure(results), figure)],
        ),
    ];
    let summary = format!(
        "60 km/h, {} assist, guidance of 0.15 N.m rms with the probe, in bends 1.5 N.m more; bumps of 2 to 8 N.m kick back. Thresholds and \
         times are chosen on one half of the drives, and told of the other.",
        results.curve
    );
    let note = "Once in 100 h is extrapolated from the longest fifth of the stretches without a felt hand, not counted. Hands are a spring, a \
                damper, tremor and a wish of our own choice; no driver closes a loop, and the ECU's own criterion is not this one.";
    Report::new("Hands, told from the motor", summary, sections).with_notes(vec![note.into()])
}
