//! `host-sim design-guidance`: the same bytes for any number of threads and after an interrupt; a choice that `run` takes.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::host_sim;

const FILE: &str = include_str!("../batch/src/design_guidance/short.toml");

const ROAD: &str = "[[segment]]\nlength_m = 100\n[[segment]]\nlength_m = 250\ncurvature_per_m = 0.003\n";

fn design(folder: &Path, arguments: &[&str]) -> Output {
    host_sim(folder, &[&["design-guidance", "design.toml"], arguments].concat())
}

#[test]
fn a_design_leaves_the_same_bytes_on_any_threads_and_behind_an_interrupt() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("road.toml"), ROAD).unwrap();
    fs::write(folder.join("design.toml"), FILE).unwrap();
    let sets = |place: &str| fs::read_to_string(folder.join(place).join("sets.jsonl")).unwrap();
    for place in ["1", "2", "cut"] {
        if place == "cut" {
            // What an interrupt leaves: some sets, and a part of a line.
            let whole = sets("1");
            fs::create_dir(folder.join(place)).unwrap();
            fs::write(folder.join("cut/sets.jsonl"), &whole[..whole.len() / 2]).unwrap();
        }
        let threads = if place == "2" { "2" } else { "1" };
        let output = design(folder, &["--threads", threads, "--out", place]);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{error}");
        for file in [
            "sets.jsonl",
            "results.json",
            "report.html",
            "front.svg",
            "chosen.toml",
        ] {
            let [one, other] = ["1", place].map(|place| fs::read(folder.join(place).join(file)).unwrap());
            assert!(one == other, "{place}: {file}");
        }
    }
    let another = design(folder, &["--own-line-share", "0", "--out", "1"]);
    assert_eq!(another.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&another.stderr).contains("belongs to another study"));
    let wrong = design(folder, &["--own-line-share", "1.5", "--out", "wrong"]);
    assert_eq!(
        String::from_utf8_lossy(&wrong.stderr).trim_end(),
        "error: design.toml: population.own_line_share = 1.5 is outside 0 to 1"
    );
    assert!(!folder.join("wrong").exists());
    let run = host_sim(folder, &["run", "1/chosen.toml"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    // Another level drives nothing anew. Two draws have one degree of freedom: 12.7062 at 95 % and 63.6567 at 99 % in tables.
    let before = sets("1");
    let output = design(folder, &["--out", "1", "--level", "0.99"]);
    let said = String::from_utf8_lossy(&output.stdout).replace('\n', " ");
    assert!(
        said.contains("Intervals of 99 % are") && said.contains("judged by intervals of 95 %"),
        "{said}"
    );
    assert_eq!(before, sets("1"));
    let width = |place: &str, field: &str| {
        let text = fs::read_to_string(folder.join(place).join("results.json")).unwrap();
        let results: serde_json::Value = serde_json::from_str(&text).unwrap();
        let ends = &results["choices"][1]["held_out"][0][field];
        (
            ends[1].as_f64().unwrap() - ends[0].as_f64().unwrap(),
            results.get("level").cloned(),
        )
    };
    let [(usual, none), (wide, level)] =
        [("2", "interval_95"), ("1", "interval_99")].map(|(at, field)| width(at, field));
    assert!(
        (wide / usual / (63.6567 / 12.7062) - 1.0).abs() < 1e-5,
        "{wide} {usual}"
    );
    assert_eq!((none, level), (None, Some(0.99.into())));
}

/// A peak of a tenth and no more conflict than the paper's: nothing has both, and the front says so instead of a choice that looks right.
#[test]
fn bars_that_contradict_each_other_are_said_to_and_a_population_of_one_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("road.toml"), ROAD).unwrap();
    let file = format!("{FILE}[bars]\npeak = 0.1\nconflict = 1\n");
    fs::write(folder.join("design.toml"), &file).unwrap();
    let output = design(folder, &["--out", "out"]);
    let said = String::from_utf8(output.stdout).unwrap();
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(
        said.contains("The bars cannot be had together with any set that was tried."),
        "{said}"
    );
    assert!(said.contains("the chosen row misses Mean peak"), "{said}");
    let one = file.replace("participants = [2, 13]", "participants = [13]");
    fs::write(folder.join("design.toml"), one).unwrap();
    let output = design(folder, &["--out", "one"]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("design.toml: population.participants"), "{error}");
    assert!(!folder.join("one").exists());
}
