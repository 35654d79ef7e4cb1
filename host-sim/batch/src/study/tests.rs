//! What is refused, and that nothing recorded is lost.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::engine::{Progress, Watch};
use crate::files;

const STUDY: &str = r#"
name = "reliance"
seed = 7
[scenario]
speed_m_per_s = 16.666666666666668
[scenario.course]
name = "one curve"
lane_width_m = 3.6
segment = [{ length_m = 100.0 }, { length_m = 200.0, curvature_per_m = 0.003 }]
[[condition]]
name = "manual"
scenario = { condition = "manual" }
[[condition]]
name = "guided"
scenario = { condition = "mid", guidance = { probe = true } }
[[participant]]
name = "P01"
published = 3
[[participant]]
name = "P02"
driver = { t_p_s = 0.3, remnant_sd_nm = 0.05, k_hg = 0.4 }
[[participant]]
name = "P03"
person = true
"#;

fn study(text: &str) -> Result<Study, String> {
    file::from_text(&files::Source::new("study.toml", Path::new("")), text).map_err(|e| e.to_string())
}

fn results(study: &Study, out: &Path) -> StudyResults {
    study.results(out, Confidence::USUAL).unwrap()
}

#[test]
fn a_session_is_the_run_of_its_scenario() {
    let out = tempfile::tempdir().unwrap();
    let study = study(STUDY).unwrap();
    let orders: Vec<&str> = study.sessions.iter().map(|s| s.condition.as_str()).collect();
    assert_eq!(
        orders,
        ["manual", "guided", "guided", "manual", "manual", "guided"]
    );
    assert_eq!(study.notes.len(), 1, "three participants share two orders");
    study.run(out.path(), &Watch::nobody()).unwrap();
    let results = results(&study, out.path());
    let recorded: Vec<bool> = results.sessions.iter().map(|s| s.recorded.is_some()).collect();
    assert_eq!(recorded, [true, true, true, true, false, false]);
    let seeds: std::collections::BTreeSet<u64> = results.sessions.iter().map(|s| s.seed).collect();
    assert_eq!(seeds.len(), 6);
    // A driver of the file has K_hg where there is guidance to resist, and no more.
    let own =
        [&study.sessions[2], &study.sessions[3]].map(|s| (s.condition.as_str(), s.scenario.gains().k_hg));
    assert_eq!(own, [("guided", 0.4), ("manual", 0.0)]);
    let session = &study.sessions[1];
    assert_eq!(
        (session.scenario.driver().t_p, session.scenario.gains().k_hg > 0.0),
        {
            let third = haptic_sim::participants::participants()[2].guided;
            (third.t_p, third.k_hg.unwrap() > 0.0)
        }
    );
    let run = haptic_sim::simulation::simulate(&session.scenario);
    let mut csv = Vec::new();
    run.trace.write_csv(&mut csv).unwrap();
    let place = out.path().join("sessions/P01/2-guided");
    assert_eq!(fs::read(place.join("drive.csv")).unwrap(), csv);
    let peak = results.sessions[1]
        .recorded
        .as_ref()
        .unwrap()
        .record
        .metrics
        .peak_lateral_error_m
        .unwrap();
    let expected = run
        .trace
        .samples
        .iter()
        .map(|s| s.lateral_error_m.abs())
        .fold(0.0, f64::max);
    assert!((peak - expected).abs() < 1e-6, "{peak} {expected}");
    let about = fs::read_to_string(place.join("session.toml")).unwrap();
    assert!(about.contains(crate::VERSION) && about.contains(&format!("seed = {}", session.scenario.seed())));
}

#[test]
fn a_study_goes_on_and_overwrites_nothing() {
    let out = tempfile::tempdir().unwrap();
    let first = study(STUDY).unwrap();
    first.run(out.path(), &Watch::nobody()).unwrap();
    let kept = out.path().join("sessions/P02/1-guided");
    let before = fs::read(kept.join("drive.csv")).unwrap();
    fs::remove_dir_all(out.path().join("sessions/P01/1-manual")).unwrap();
    let driven = AtomicU64::new(0);
    let hear = |progress: Progress| {
        driven.store(progress.done, Ordering::Relaxed);
        ControlFlow::Continue(())
    };
    first.run(out.path(), &Watch::new(&hear)).unwrap();
    assert_eq!(driven.into_inner(), 1, "only what was missing");
    // A participant more changes nothing of the others.
    let more = study(&format!(
        "{STUDY}[[participant]]\nname = \"P04\"\npublished = 4\n"
    ))
    .unwrap();
    more.run(out.path(), &Watch::nobody()).unwrap();
    assert!(results(&more, out.path()).sessions[7].recorded.is_some());
    // Another seed, speed or name is another study.
    for (from, to, says) in [
        ("seed = 7", "seed = 8", "another scenario or seed"),
        (
            "speed_m_per_s = 16.666666666666668",
            "speed_m_per_s = 17",
            "another scenario or seed",
        ),
        ("\"reliance\"", "\"trust\"", "in study reliance"),
    ] {
        let error = study(&STUDY.replace(from, to))
            .unwrap()
            .run(out.path(), &Watch::nobody())
            .unwrap_err()
            .to_string();
        assert!(error.contains(says) && error.contains("P01"), "{error}");
        assert_eq!(fs::read(kept.join("drive.csv")).unwrap(), before);
    }
}

#[test]
fn a_persons_drive_is_imported_once_and_only_where_it_belongs() {
    let out = tempfile::tempdir().unwrap();
    let study = study(STUDY).unwrap();
    let file = |name: &str, change: &dyn Fn(&Scenario) -> Scenario| {
        // A person with a hand like that of the model.
        let run = haptic_sim::simulation::simulate(&change(&study.sessions[5].scenario));
        let path = out.path().join(name);
        run.trace.write_csv(fs::File::create(&path).unwrap()).unwrap();
        path
    };
    let guided = file("drive.csv", &|s| s.clone());
    let fast = file("fast.csv", &|s| s.to_builder().speed_kmh(80.0).build().unwrap());
    let unprobed = file("unprobed.csv", &|s| s.to_builder().probe(false).build().unwrap());
    let strong = file("strong.csv", &|s| {
        let mut guidance = *s.guidance();
        guidance.controller.k_1 *= 2.0;
        s.to_builder().guidance(guidance).build().unwrap()
    });
    let short = out.path().join("short.csv");
    let text = fs::read_to_string(&guided).unwrap();
    fs::write(&short, text.lines().take(200).collect::<Vec<_>>().join("\n")).unwrap();
    let jumped = out.path().join("jumped.csv");
    let set = |(row, line): (usize, &str)| match line.split_once(',') {
        Some((time_s, rest)) if row > 3000 => {
            format!("{},{rest}\n", time_s.parse::<f64>().unwrap() + 86_400.0)
        }
        _ => format!("{line}\n"),
    };
    fs::write(&jumped, text.lines().enumerate().map(set).collect::<String>()).unwrap();
    let foreign = out.path().join("foreign.csv");
    fs::write(&foreign, "a,b\n1,2\n").unwrap();
    for (what, path, says) in [
        (
            "P03/guided",
            &fast,
            "driven at 80.0 km/h, and condition guided is at 60.0 km/h",
        ),
        (
            "P03/manual",
            &guided,
            "driven with guidance, and condition manual is without guidance",
        ),
        (
            "P03/guided",
            &unprobed,
            "N.m at 2.5 Hz, and condition guided has one of 0.200 N.m",
        ),
        ("P03/guided", &strong, "times the guidance of condition guided"),
        ("P03/guided", &short, "it lasts 1.0 s"),
        (
            "P03/guided",
            &jumped,
            "row 3001: the time goes from 14.995 to 86415 s",
        ),
        ("P03/guided", &foreign, "time_s"),
        ("P03/guided", &out.path().join("none.csv"), "none.csv"),
        ("P02/guided", &guided, "this participant is simulated"),
        ("P03/wet", &guided, "there are: P03/manual, P03/guided"),
    ] {
        let error = study.import(out.path(), what, path).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        assert!(!out.path().join("sessions").exists(), "{what}: nothing is left");
    }
    study.import(out.path(), "P03/guided", &guided).unwrap();
    let place = out.path().join("sessions/P03/2-guided");
    assert_eq!(fs::read_to_string(place.join("drive.csv")).unwrap(), text);
    let error = study
        .import(out.path(), "P03/guided", &fast)
        .unwrap_err()
        .to_string();
    assert!(error.contains("2-guided is recorded already"), "{error}");
    assert_eq!(fs::read_to_string(place.join("drive.csv")).unwrap(), text);
    let results = results(&study, out.path());
    assert_eq!(
        results.sessions[5].recorded.as_ref().unwrap().source,
        Source::Imported
    );
}

/// The lab's drives are 60 s on the paper's course.
#[test]
fn a_drive_on_another_road_or_without_hands_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let study = study(STUDY).unwrap();
    let recorded = |scenario: &Scenario, change: &dyn Fn(&mut haptic_log::trace::Sample)| {
        let mut trace = haptic_sim::simulation::simulate(scenario).trace;
        trace.samples.iter_mut().for_each(change);
        let path = out.path().join("drive.csv");
        trace.write_csv(fs::File::create(&path).unwrap()).unwrap();
        study
            .import(out.path(), "P03/guided", &path)
            .unwrap_err()
            .to_string()
    };
    let own = &study.sessions[5].scenario;
    let paper = haptic_sim::models::road::Course::paper();
    let elsewhere = recorded(&own.to_builder().course(paper).build().unwrap(), &|_| ());
    for says in [
        "rows do not lie on that of condition guided, one curve; at 100.",
        "the file has a curvature of 0.00000 1/m, and that road, 300.0 m long, 0.00300 1/m",
    ] {
        assert!(elsewhere.contains(says), "{elsewhere}");
    }
    let hands_off = recorded(own, &|sample| sample.driver_torque_nm = 0.0);
    assert!(hands_off.contains("nobody held the wheel"), "{hands_off}");
}

#[test]
fn repetitions_are_blocks_with_orders_and_seeds_of_their_own() {
    let once = study(STUDY).unwrap();
    let twice = study(&STUDY.replace("seed = 7", "seed = 7\nrepetitions = 2")).unwrap();
    let of = |participant: &str| {
        let own = twice.sessions.iter().filter(|s| s.participant == participant);
        own.map(|s| (s.position, s.condition.as_str(), s.repetition))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        of("P01"),
        [
            (1, "manual", 1),
            (2, "guided", 1),
            (3, "guided", 2),
            (4, "manual", 2)
        ]
    );
    assert_eq!(
        of("P02"),
        [
            (1, "guided", 1),
            (2, "manual", 1),
            (3, "manual", 2),
            (4, "guided", 2)
        ]
    );
    let seeds: std::collections::BTreeSet<u64> = twice.sessions.iter().map(|s| s.scenario.seed()).collect();
    assert_eq!(seeds.len(), 12);
    // What is recorded of the first block stays valid.
    assert!(once.sessions.iter().all(|s| seeds.contains(&s.scenario.seed())));
    let out = tempfile::tempdir().unwrap();
    let missing = twice
        .import(out.path(), "P03/guided/3", Path::new("x.csv"))
        .unwrap_err()
        .to_string();
    assert!(missing.contains("P03/guided, P03/guided/2"), "{missing}");
    twice.run(out.path(), &Watch::nobody()).unwrap();
    let results = results(&twice, out.path());
    let peak = |participant: &str, condition: &str| {
        let own = results
            .sessions
            .iter()
            .filter(|s| s.participant == participant && s.condition == condition);
        let peaks: Vec<f64> = own
            .map(|s| {
                s.recorded
                    .as_ref()
                    .unwrap()
                    .record
                    .metrics
                    .peak_lateral_error_m
                    .unwrap()
            })
            .collect();
        assert_eq!(peaks.len(), 2);
        peaks.iter().sum::<f64>() / 2.0
    };
    let expected = ["P01", "P02"].map(|name| peak(name, "guided") - peak(name, "manual"));
    let found = results
        .differences
        .iter()
        .find(|d| d.metric == "peak_lateral_error_m")
        .unwrap();
    assert_eq!(
        (found.from.as_str(), found.to.as_str(), found.participants),
        ("manual", "guided", 2)
    );
    assert!((found.mean.mean - (expected[0] + expected[1]) / 2.0).abs() < 1e-12);
}

#[test]
fn what_is_no_study_is_refused_by_name() {
    for (from, to, says) in [
        (
            "published = 3",
            "published = 15",
            "participant P01, condition manual: published = 15 is outside 1 to 14",
        ),
        (
            "t_p_s = 0.3",
            "t_p_s = 3.0",
            "participant P02, condition guided: driver.t_p_s = 3 s is outside 0.001 to 2 s",
        ),
        (
            "seed = 7",
            "repetitions = 0",
            "repetitions = 0 is outside 1 to 100",
        ),
        ("speed_m_per_s = 16.666666666666668", "sped = 16", "sped"),
        (
            "speed_m_per_s = 16.666666666666668",
            "seed = 16",
            "seed: every session has its own",
        ),
        (
            "person = true",
            "person = false",
            "one of published, driver and person",
        ),
        (
            "person = true",
            "person = true\npublished = 2",
            "one of published, driver and person",
        ),
        ("\"P02\"", "\"p01\"", "participant \"p01\" is there twice"),
        ("\"P02\"", "\"a/b\"", "participant \"a/b\": a name is"),
        ("seed = 7", "order = \"random\"", "balanced-latin-square"),
        ("seed = 7", "sed = 7", "sed"),
        (
            "probe = true }",
            "probe = true }, failure = { kind = \"torque\", time_s = 5 }",
            "P03, condition guided: failure: a person's",
        ),
    ] {
        let error = study(&STUDY.replace(from, to)).unwrap_err();
        assert!(
            error.starts_with("study.toml: ") && error.contains(says),
            "{error}"
        );
    }
    let nobody = STUDY.split("[[participant]]").next().unwrap();
    assert!(study(nobody).unwrap_err().contains("participant"));
}
