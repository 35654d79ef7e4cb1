//! What commands print and tools measured is what the documents say.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use super::{documents, place, root, run};
use crate::{EVIDENCE, program};

/// What `--help` of a command lists: the commands below each heading that is indented by nothing.
fn listed(mut program: Command, arguments: &[&str]) -> Vec<(String, Vec<String>)> {
    let place = place();
    let (_, help, _) = run(program.args(arguments).arg("--help"), place.path(), "--help");
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for line in help.lines() {
        if let Some(title) = line.strip_suffix(':').filter(|title| !title.starts_with(' ')) {
            groups.push((title.into(), Vec::new()));
        } else if line.starts_with("  ") && !line.starts_with("   ") {
            let name = line.split_whitespace().next().filter(|name| *name != "help");
            groups.last_mut().unwrap().1.extend(name.map(String::from));
        }
    }
    groups.retain(|(title, _)| title != "Options");
    groups
}

/// Every command of both programs has its row in the reference, below the heading that `--help` has.
#[test]
fn the_reference_names_every_command() {
    let reference = std::fs::read_to_string(root().join("docs/reference/commands.md")).unwrap();
    let mut groups = listed(program(None), &[]);
    assert!(groups.len() > 3, "{groups:?}");
    let evidence = listed(program(Some(EVIDENCE[0])), &[]).remove(0).1;
    assert_eq!(evidence, EVIDENCE);
    groups.push(("Evidence".into(), evidence));
    for (title, names) in groups {
        let part = reference.split(&format!("\n### {title}\n")).nth(1);
        let part = part.unwrap_or_else(|| panic!("docs/reference/commands.md: no heading {title}"));
        let part = part.split("\n#").next().unwrap();
        let below = match names.iter().any(|name| name == "ecu") {
            true => listed(program(None), &["ecu"]).remove(0).1,
            false => Vec::new(),
        };
        let below = below.iter().map(|name| format!("ecu {name}"));
        let own = names.iter().filter(|name| *name != "ecu").cloned();
        for name in own.chain(below) {
            let [row, row_with_arguments] = [format!("\n| `{name}`"), format!("\n| `{name} ")];
            let named = part.contains(&row) || part.contains(&row_with_arguments);
            assert!(named, "docs/reference/commands.md: {title}: no row for {name}");
        }
    }
}

/// A number of the goldens with thousands set apart, as documents write it.
fn golden(name: &str) -> String {
    let text = std::fs::read_to_string(root().join("xtask/golden.json")).unwrap();
    let goldens: BTreeMap<String, u64> = serde_json::from_str(&text).unwrap();
    let digits = goldens[name].to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let groups: Vec<_> = groups
        .map(|group| String::from_utf8_lossy(group).into_owned())
        .collect();
    groups.join(",")
}

/// What `cargo xtask` measured and keeps is what the documents say.
#[test]
fn instruction_counts_in_documents_are_those_of_the_goldens() {
    let documents = documents();
    let has = |name: &str, sentence: String| {
        let text = documents[Path::new(name)].replace('\n', " ");
        assert!(text.contains(&sentence), "{name} should say: {sentence}");
    };
    let porting = "docs/porting.md";
    let share = |count: &str| {
        let count: f64 = count.replace(',', "").parse().unwrap();
        // Two cycles an instruction, 170,000 cycles in a tick.
        format!("{:.1} %", 2.0 * count / 170e3 * 100.0)
    };
    for (row, key) in [
        ("mean", "mps2-an386 mean step"),
        ("worst", "mps2-an386 worst step"),
        ("mean, driver activity", "mps2-an386 mean step, driver activity"),
        ("worst, driver activity", "mps2-an386 worst step, driver activity"),
        (
            "worst of any example: a torsion bar",
            "mps2-an386 worst step, any example",
        ),
        (
            "worst of any [fault](reference/fault-campaign.md): `yaw-error-min`",
            "mps2-an386 worst step, any fault",
        ),
        (
            "with more frames than a bus carries: `ten-times-the-rate`",
            "mps2-an386 worst step, any fault, more frames than a bus carries",
        ),
    ] {
        let count = golden(key);
        has(porting, format!("| {row} | {count} | {} |", share(&count)));
    }
    for mac in ["SipHash-2-4", "AES-CMAC"] {
        for flood in ["", ", flood of false proofs"] {
            let [step, tick] =
                ["step", "tick"].map(|what| golden(&format!("mps2-an386 worst {what}, {mac}{flood}")));
            has(
                porting,
                format!("| {mac}{flood} | {step} | {tick} | {} |", share(&tick)),
            );
        }
    }
    let lane = |kind: &str| {
        ["SipHash-2-4", "AES-CMAC"].map(|mac| golden(&format!("mps2-an386 a {kind} lane preview, {mac}")))
    };
    let ([true_1, true_2], [false_1, false_2]) = (lane("true"), lane("false"));
    has(
        porting,
        format!(
            "A true lane preview takes {true_1} with SipHash-2-4 and {true_2} with AES-CMAC, a false one {false_1} and {false_2}."
        ),
    );
    let worst = golden("mps2-an386 worst step, any example");
    let worst: f64 = worst.replace(',', "").parse().unwrap();
    let slower = 2.0 * worst / 120e3 * 100.0;
    has(
        porting,
        format!("At the SAM E54's 120 MHz the worst step is {slower:.1} % of a tick."),
    );
    let background = golden("mps2-an386 worst background step");
    has(
        "docs/explanation/live-estimate.md",
        format!("at most {background} instructions on the target"),
    );
    let per_ms = golden("host_simulated_second")
        .replace(',', "")
        .parse::<f64>()
        .unwrap()
        / 1000.0;
    let thousands = format!("{},{:03}", per_ms as u64 / 1000, per_ms as u64 % 1000);
    has(
        "docs/explanation/speed.md",
        format!("A simulated millisecond takes {thousands} instructions."),
    );
    has(
        "docs/explanation/speed.md",
        format!("The ECU's step takes {} of them.", golden("host_step_mean")),
    );
}

#[test]
fn the_load_of_the_bus_on_its_page_is_what_the_command_prints() {
    let place = place();
    let load = |arguments: &[&str]| -> serde_json::Value {
        let mut bus = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let command = bus.args(["ecu", "bus", "--json"]).args(arguments);
        let (_, out, err) = run(command, place.path(), "host-sim ecu bus");
        serde_json::from_str(&out).expect(&err)
    };
    let (plain, proven) = (load(&[]), load(&["--proofs"]));
    let percent =
        |load: &serde_json::Value, name: &str| format!("{:.0} %", 100.0 * load[name].as_f64().unwrap());
    let sentences = [
        format!(
            ": {}, of {} allowed.",
            percent(&plain, "load"),
            percent(&plain, "max_load")
        ),
        format!(
            "is {}, and {} while parameters are written in Standby.",
            percent(&proven, "driving"),
            percent(&proven, "load")
        ),
    ];
    let page = &documents()[Path::new("docs/reference/bus.md")];
    for sentence in sentences {
        assert!(
            page.contains(&sentence),
            "docs/reference/bus.md should say{sentence}"
        );
    }
}

/// Peak lateral errors of the slowest driver, in the order of the sentence.
#[test]
fn the_result_in_the_readme_is_what_the_evaluation_prints() {
    let place = place();
    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let (_, out, err) = run(evaluate.args(["evaluate", "--json"]), place.path(), "evaluate");
    let results: serde_json::Value = serde_json::from_str(&out).expect(&err);
    let runs = results["runs"].as_array().unwrap();
    let peak = |condition: &str, failure: &str| {
        let own = |run: &&serde_json::Value| {
            run["t_p"] == 0.5 && run["condition"] == condition && run["failure"] == failure
        };
        let peak = &runs.iter().find(own).unwrap()["peak_lateral_error_m"];
        format!("{:.2} m", peak.as_f64().unwrap())
    };
    let sentence = format!(
        "of a slow driver in the first curve (300 m, 60 km/h) from {} to {}. If its torque is lost at once as the arc begins \
         (70 s), the peak is {}; if an input is lost there and the ECU hands over within two seconds, {}.",
        peak("manual", "none"),
        peak("high", "none"),
        peak("high", "torque"),
        peak("high", "input"),
    );
    let readme = documents()[Path::new("README.md")].replace('\n', " ");
    assert!(readme.contains(&sentence), "README.md should say: {sentence}");
}
