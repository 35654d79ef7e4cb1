//! `host-sim compare` of laws and drivers who adapt: its files and its JSON, the same bytes for any number of threads, and nothing left of a file that is refused.

use std::fs;

use crate::host_sim;

const FILE: &str = include_str!("../batch/src/adaptation/short.toml");

#[test]
fn two_adaptations_leave_the_same_bytes_on_any_threads_and_nothing_of_a_wrong_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("road.toml"), "[[segment]]\nlength_m = 200\n").unwrap();
    fs::write(folder.join("study.toml"), FILE).unwrap();
    let run = |file, threads, place| {
        host_sim(
            folder,
            &["compare", file, "--threads", threads, "--out", place, "--json"],
        )
    };
    for threads in ["1", "2"] {
        let output = run("study.toml", threads, threads);
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let kept = fs::read_to_string(folder.join(threads).join("results.json")).unwrap();
        assert_eq!(
            String::from_utf8(output.stdout).unwrap().trim_end(),
            kept.trim_end()
        );
        for file in ["results.json", "loops.csv", "report.html"] {
            let [one, two] = ["1", threads].map(|place| fs::read(folder.join(place).join(file)).unwrap());
            assert!(one == two, "{threads} threads: {file}");
        }
    }
    fs::write(
        folder.join("wrong.toml"),
        FILE.replace("lasts_s = 2", "lasts_s = 0"),
    )
    .unwrap();
    let output = run("wrong.toml", "1", "wrong");
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        error.trim_end(),
        "error: wrong.toml: loss.lasts_s = 0 s is outside 0.1 to 3000 s"
    );
    assert!(!folder.join("wrong").exists());
}
