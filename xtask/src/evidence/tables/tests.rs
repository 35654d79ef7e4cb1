use std::collections::BTreeMap;

use super::super::kept::{Kept, Origin};
use super::super::list::List;
use super::{origin, render};

const LIST: &str = r#"
held_out_from = 77
latent = { also = ["drifting"], except = ["override"] }
code.all = ["core/src"]
[measurement.population]
title = "keep"
command = "faults --drivers population"
rule = { seeds = 500 }
judges = "all"
[measurement.paper]
title = "paper"
command = "faults --drivers paper"
rule = { seeds = 500 }
judges = "all"
[measurement.events]
title = "`events`"
command = "availability --worlds events"
rule = { hours = 52.0 }
seeds = "held-out"
judges = "all"
[measurement.missing]
title = "m"
command = "faults"
rule = { seeds = 500 }
judges = "all"
"#;

/// A line of a row; what the arguments name differs from row to row.
fn row(name: &str, class: &str, may_leave: bool, noticed: u64, more: &str) -> String {
    let values = r#"{"runs":20,"is_limited":true,"worst_reaction_ms":281,"peak_torque_nm":1.25,"noticed_interval":[0.026,0.31],
        "noticed_after_ms":[1470,null],"unnoticed_deviation_m":0.31,"unnoticed_torque_nm":1.11,"left":2,
        "left_after_ms":[1610,1700],"deviation_m":0.374,"excess_m":0.05,"pushed_m":null,"beyond_drop":1,"beyond_limit":0,
        "left_lane":3,"leaves_too_often":false,"failed":1,"failures":[{"seed":75,"what":"late"}]}"#;
    let mut row: serde_json::Value = serde_json::from_str(values).unwrap();
    row["name"] = name.into();
    row["class"] = class.into();
    row["may_leave"] = may_leave.into();
    row["noticed"] = noticed.into();
    let more: serde_json::Map<String, serde_json::Value> = serde_json::from_str(more).unwrap();
    row.as_object_mut().unwrap().extend(more);
    row.to_string()
}

fn campaign(command: &str, seeds: u64, share_limit: &str, rows: &[String]) -> Kept {
    let head = format!(
        r#"{{"command":"host-sim {command}","commit":"0123456789abcdef","date":"2026-11-25","rule":{{"seeds":500}},"count":{{"seeds":{seeds}}},"first_seed":1,"held_out":false}}"#
    );
    let sums = format!(
        r#"{{"rows":176,"runs":35200,"cycles":714601238,"failed":3,"rows_beyond_share":1,"share_limit":{share_limit}}}"#
    );
    let text = [&[head, sums], rows].concat().join("\n");
    let kept = Kept::parse(&text).unwrap();
    // What is written is read as what it was.
    let written = kept.to_text().unwrap();
    assert_eq!(Kept::parse(&written).unwrap().to_text().unwrap(), written);
    kept
}

fn table(form: &str, of: &str, kept: Vec<(&str, Kept)>) -> Vec<String> {
    let text = format!("{LIST}\n[table.t]\ndocument = \"x\"\nform = {form}\nof = {of}\n");
    let list = List::parse(&text).unwrap();
    let kept: BTreeMap<String, Kept> = kept.into_iter().map(|(name, kept)| (name.into(), kept)).collect();
    let text = render(&list, &list.table["t"], &kept);
    text.lines().map(str::to_owned).collect()
}

/// Two of twenty runs noticed in the first row, all in the second, none in the fourth, which may go on and lies all the same.
fn rows() -> Vec<String> {
    vec![
        row("frozen", "B", true, 2, "{}"),
        row(
            "silent",
            "B",
            true,
            20,
            r#"{"failed":0,"failures":[],"beyond_drop":0}"#,
        ),
        row("override", "L", true, 0, r#"{"failed":0,"failures":[]}"#),
        row(
            "drifting",
            "L",
            false,
            0,
            r#"{"noticed_after_ms":[null,null],"failed":2,"deviation_m":0.912,"unnoticed_deviation_m":0.908,"unnoticed_torque_nm":2.66,"left":0,"left_after_ms":null}"#,
        ),
        row("law-random", "C", true, 20, r#"{"pushed_m":0.172}"#),
        row("tick-late", "C", true, 20, r#"{"pushed_m":0.03}"#),
        row(
            "motor-ignores",
            "C",
            true,
            20,
            r#"{"pushed_m":0.401,"is_limited":false}"#,
        ),
        row("bank", "L", false, 0, r#"{"left":1}"#),
    ]
}

fn both() -> Vec<(&'static str, Kept)> {
    vec![
        ("population", campaign("faults --seeds 500", 500, "0.04", &rows())),
        ("paper", campaign("faults --seeds 500", 500, "null", &rows()[..5])),
    ]
}

#[test]
fn latent_rows_are_those_of_which_a_run_stayed_unnoticed() {
    let lines = table(r#""latent""#, r#"["population", "paper"]"#, both());
    let frozen = "10 (3 to 31), 1,470, 0.37";
    let drifting = "0 (3 to 31), -, 0.91";
    let wanted = [
        "| fault | keep | paper |".to_owned(),
        "|---|---|---|".into(),
        format!("| `frozen` | {frozen} | {frozen} |"),
        format!("| `drifting` | {drifting} | {drifting} |"),
    ];
    assert_eq!(lines[..4], wanted);
    assert_eq!(
        lines[4], "",
        "neither a hand that overrides nor a road is latent: {lines:?}"
    );
}

#[test]
fn goals_name_the_row_that_is_worst() {
    let lines = table(r#""goals""#, r#"["population", "missing"]"#, both());
    for wanted in [
        "| SG1: pushed the furthest, where the motor obeys | 0.17 m (`law-random`) | not measured |",
        "| SG1: pushed the furthest, where it does not | 0.40 m (`motor-ignores`) | not measured |",
        "| SG2: deviated the furthest, unnoticed | 0.91 m (`drifting`) | not measured |",
        // 2 rows of 3 in 20; and 2 rows of class B.
        "| SG2: left the lane, in rows that may stay unnoticed | 6 of 40 | not measured |",
        "| SG3: left the lane, in rows of classes A and B | 6 of 40 | not measured |",
        "| SG4: the largest torque, unnoticed | 2.66 N.m (`drifting`) | not measured |",
        "| SG4: the largest torque, in any row | 1.25 N.m (`bank`) | not measured |",
    ] {
        assert!(lines.iter().any(|line| line == wanted), "{wanted}\n{lines:#?}");
    }
}

#[test]
fn sums_and_classes_are_those_of_the_rows() {
    let lines = table(r#""sums""#, r#"["population", "paper"]"#, both());
    for wanted in [
        "| rows; runs | 176; 35,200 | 176; 35,200 |",
        "| runs that failed | 3 | 3 |",
        // Seven rows of eight, and four of five.
        "| of these, runs more than 0.1 m further than a dropped torque | 7 | 4 |",
        "| rows beyond their share out of the lane | 1 | not judged |",
        "| runs that left the lane | 24 | 15 |",
    ] {
        assert!(lines.iter().any(|line| line == wanted), "{wanted}\n{lines:#?}");
    }
    let lines = table(r#""classes""#, r#"["population"]"#, both());
    // Three of twenty in each row; what the limits do not judge is not counted.
    let b = "| B, an input lost or false | 2 | 0.37, 15.0 % |";
    let c = "| C, computation, memory, time, motor | 2 | 0.37, 15.0 % |";
    assert!(
        [b, c]
            .iter()
            .all(|wanted| lines.iter().any(|line| line == wanted)),
        "{lines:#?}"
    );
}

#[test]
fn what_hardly_pushes_is_one_line() {
    let lines = table(r#""pushed""#, r#"["population"]"#, both());
    let wanted = [
        "| `law-random` | 0.17, 281 |",
        "| `motor-ignores` | 0.40, 281 |",
        "| every other row of class C | 0.03 |",
    ];
    assert_eq!(lines[2..5], wanted);
}

#[test]
fn failures_and_ended_guidance_are_named_by_row() {
    let lines = table(r#""failures""#, r#"["paper", "missing"]"#, both());
    assert_eq!(lines[2], "| paper | `drifting` | 2 of 20 | seed 75: late |");
    // Three rows fail; no line of what was not measured, and the two origins.
    assert_eq!((lines.len(), lines[5].as_str()), (8, ""));
    let lines = table(r#""ended""#, r#"["population"]"#, both());
    assert_eq!(lines[2], "| keep | `bank` | 1 of 20 |");
    assert_eq!(lines[3], "");
    let lines = table(
        r#"{ left = ["frozen", "drifting", "absent"] }"#,
        r#"["paper"]"#,
        both(),
    );
    assert_eq!(
        lines[2..5],
        [
            "| `frozen` | 2 of 20, 1.61 s |",
            "| `drifting` | 0 of 20 |",
            "| `absent` | - |"
        ]
    );
}

#[test]
fn a_table_says_commit_seeds_and_rule() {
    let kept = vec![("population", campaign("faults --seeds 20", 20, "0.04", &[]))];
    let lines = table(r#""campaigns""#, r#"["population", "missing"]"#, kept);
    assert_eq!(
        lines[2..],
        [
            "| keep | `host-sim faults --seeds 20` | 176 | 35,200 | 714,601,238 | 3, and 1 rows by their share out of the lane |",
            "| m | not measured |  |  |  |  |",
            "",
            "Measured at commit `0123456789ab` of 2026-11-25 on seeds 1 to 20 of each row, where 500 seeds were fixed before: `cargo xtask evidence population`.",
            "Not measured yet: `cargo xtask evidence missing`.",
        ]
    );
}

#[test]
fn a_second_use_of_held_out_seeds_is_said() {
    let text = r#"{"command":"c","commit":"0123456789abcdef","date":"2026-11-25","rule":{"hours":52.0},"count":{"hours":52.0},
        "first_seed":77,"held_out":true,"earlier":[{"commit":"fedcba9876543210","count":{"hours":20.0},"again":"a rule was wrong"}]}"#;
    let own = serde_json::from_str(text).unwrap();
    assert_eq!(
        origin(&[("events", Some(&own))]),
        "Measured at commit `0123456789ab` of 2026-11-25 for 52 h on each road with seed 77, as fixed before, which were held out and used \
         before at commit `fedcba987654` with 20 h a road (run again: a rule was wrong): `cargo xtask evidence events`.\n"
    );
}

#[test]
fn other_code_that_gives_the_same_is_said() {
    let text = r#"{"command":"c","commit":"0123456789abcdef","date":"2026-11-25","rule":{"seeds":500},"count":{"seeds":500},
        "first_seed":1,"held_out":false,"same":{"commit":"fedcba9876543210","count":{"seeds":25}}}"#;
    let own: Origin = serde_json::from_str(text).unwrap();
    assert_eq!(
        origin(&[("paper", Some(&own))]),
        "Measured at commit `0123456789ab` of 2026-11-25 on seeds 1 to 500 of each row, as fixed before; `fedcba987654` gives the same \
         to nine digits in 25 seeds: `cargo xtask evidence paper`.\n"
    );
    assert_eq!(own.holds_at(), "fedcba9876543210");
}

#[test]
fn a_world_has_a_line_with_its_bound() {
    let head = r#"{"command":"c","commit":"0123456789abcdef","date":"d","rule":{"hours":52.0},"count":{"hours":52.0},"first_seed":77,"held_out":true}"#;
    let cell = |road: &str, count: u64, upper: &str| {
        format!(
            r#"{{"world":"events","road":"{road}","hours":103.583,"declarations":{{"count":{count},"upper_95":{upper}}},"causes":[{{"faults":"LaneStep","rate":{{"count":{count},"upper_95":null}}}}],"diverged":0,"lost_by_hand":{{"segments":9}}}}"#
        )
    };
    let text = [head.into(), cell("country", 0, "null"), cell("all", 3, "0.07486")].join("\n");
    let kept = vec![("events", Kept::parse(&text).unwrap())];
    let lines = table(r#""availability""#, r#"["events"]"#, kept);
    assert_eq!(
        lines[2],
        "| `events` | all | 103.58 | 3 (LaneStep 3 times) | 0.0749 | 0 | 9 |"
    );
    assert_eq!(lines[3], "");
    // Without a sum each road has its line.
    let text = [
        head.into(),
        cell("country", 0, "null"),
        cell("motorway", 3, "null"),
    ]
    .join("\n");
    let kept = vec![("events", Kept::parse(&text).unwrap())];
    let lines = table(r#""availability""#, r#"["events"]"#, kept);
    assert!(
        lines[2].contains("country") && lines[3].contains("motorway"),
        "{lines:?}"
    );
}
