//! `host-sim compare`: the same bytes for any number of threads, and nothing left of a file that is refused.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::host_sim;

const FILE: &str = "
name = 'short'
seeds = 2
roads = ['road.toml']
speeds_m_per_s = [16.666666666666668]
[faults]
sudden_loss = 1
[tuning]
budget = 2
seeds = 1
roads = ['road.toml']
speeds_m_per_s = [16.666666666666668]
[[law]]
kind = 'none'
[[law]]
kind = 'paper'
[[driver]]
kind = 'paper'
";

fn compare(folder: &Path, arguments: &[&str]) -> Output {
    host_sim(folder, &[&["compare"], arguments].concat())
}

#[test]
fn a_comparison_leaves_the_same_bytes_on_any_threads_and_nothing_of_a_wrong_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("road.toml"), "[[segment]]\nlength_m = 400\n").unwrap();
    fs::write(folder.join("study.toml"), FILE).unwrap();
    fs::write(folder.join("wrong.toml"), FILE.replace("seeds = 2", "seeds = 0")).unwrap();
    for threads in ["1", "3"] {
        let output = compare(
            folder,
            &["study.toml", "--threads", threads, "--out", threads, "--json"],
        );
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let files = [
            folder.join(threads).join("results.json"),
            folder.join("1/results.json"),
        ];
        let [own, first] = files.map(|file| fs::read_to_string(file).unwrap());
        assert_eq!(own, first);
        assert_eq!(
            String::from_utf8(output.stdout).unwrap().trim_end(),
            own.trim_end()
        );
    }
    for file in [
        "drives.csv",
        #[cfg(feature = "parquet")]
        "drives.parquet",
        "report.html",
        "matrix-worst_peak_after_loss_m.svg",
    ] {
        let [one, three] = ["1", "3"].map(|threads| fs::read(folder.join(threads).join(file)).unwrap());
        assert_eq!(one, three, "{file}");
    }
    let drives = fs::read_to_string(folder.join("1/drives.csv")).unwrap();
    assert_eq!(drives.lines().count(), 5);
    let output = compare(folder, &["wrong.toml", "--out", "wrong"]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(
        error.trim_end(),
        "error: wrong.toml: seeds = 0 is outside 1 to 1000"
    );
    assert!(!folder.join("wrong").exists());
}

/// Each file has the directory of its name, and all are checked before one is driven.
#[test]
fn several_files_leave_a_directory_each_and_are_refused_together() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    let one = FILE.split("[tuning]").next().unwrap().to_owned()
        + "[[law]]\nkind = 'none'\n[[driver]]\nkind = 'paper'\n";
    let adapting = include_str!("../batch/src/adaptation/short.toml");
    write("road.toml", "[[segment]]\nlength_m = 200\n");
    write("one.toml", &one);
    write("two.toml", &adapting.replace("'short'", "'loops'"));
    write("same.toml", adapting);
    write("wrong.toml", &one.replace("seeds = 2", "seeds = 0"));
    let output = compare(folder, &["one.toml", "two.toml", "--out", "out"]);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(folder.join("out/short/drives.csv").exists() && folder.join("out/loops/loops.csv").exists());
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("Laws and drivers: short") && printed.contains("Two adaptations: loops"));
    let refused = [
        (
            "same.toml",
            None,
            "one.toml and same.toml: both have the name \"short\"",
        ),
        ("wrong.toml", None, "wrong.toml: seeds = 0 is outside 1 to 1000"),
        (
            "two.toml",
            Some("--json"),
            "--json prints the results of one file",
        ),
    ];
    for (second, option, said) in refused {
        let output = compare(
            folder,
            &[&["one.toml", second, "--out", "none"][..], option.as_slice()].concat(),
        );
        assert_eq!(output.status.code(), Some(2));
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.contains(said), "{error}");
        assert!(!folder.join("none").exists());
    }
}
