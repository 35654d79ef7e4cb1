//! Bad input and bad usage: exit code 2, and a sentence that says what is wrong or what to write.

use super::{host_sim, stderr};

#[test]
#[expect(clippy::too_many_lines, reason = "a table of bad inputs")]
fn bad_input_and_bad_usage_exit_with_2_and_say_why() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    write("short.toml", "[[segment]]\nlength_m = 10\n");
    write("tight.toml", "[[segment]]\nlength_m = 100\ncurvature_per_m = 3\n");
    write("unknown.toml", "[driver]\nt_q = 1\n");
    write("manual.toml", "condition = 'manual'\n");
    write("exact.toml", "sensors = 'exact'\n");
    write("late.toml", "[failure]\nkind = 'torque'\ntime_s = 5000\n");
    write("exponent.toml", "[driver]\nt_p_s = 1e1 # late\n");
    write("inline.toml", "driver = { k_hg = 1, t_p_s = 1_0.0 }\n");
    write("between.toml", "[guidance]\nlaw = 1.5\n");
    write("empty.toml", "");
    write("course.toml", "[[segment]]\nlength_m = 500\n");
    write("on-a-tight-road.toml", "course = 'tight.toml'\n");
    write("notes.txt", "of somebody");
    let cases: [(&[&str], &str); 38] = [
        (
            &["run", "on-a-tight-road.toml"],
            "on-a-tight-road.toml: course: tight.toml: ",
        ),
        (
            &["experiment", "--probe", "9"],
            "--probe = 9 N.m is outside 0 to 0.3 N.m",
        ),
        (
            &[
                "identify-vehicle",
                "none.csv",
                "--mass=1500",
                "--wheelbase=2.7",
                "--level",
                "0.49",
            ],
            "'--level <SHARE>': level = 0.49 is outside 0.5 to 0.9999",
        ),
        (
            &["design", "--level", "0.99991"],
            "level = 0.99991 is outside 0.5 to 0.9999",
        ),
        (
            &["design-guidance", "none.toml", "--level", "95"],
            "level = 95 is outside 0.5 to 0.9999",
        ),
        (
            &["reliance", "--amplitude", "9"],
            "--amplitude = 9 N.m is outside 0 to 0.3 N.m",
        ),
        (
            &["validate", "--coverage", "1", "--probe", "-1"],
            "--probe = -1 N.m",
        ),
        (
            &["experiment", "--participant", "0"],
            "'--participant <LIST>': 0 is outside 1 to 14",
        ),
        (
            &["availability", "--hours", "-1"],
            "--hours: -1 is outside 0 to 100000 h",
        ),
        (
            &["availability", "--drives", "3", "--checkpoint", "notes.txt"],
            "notes.txt: belongs to another study",
        ),
        (&["evaluate", "--course", "none.toml"], "none.toml"),
        (
            &["evaluate", "--course", "paper-course", "--window", "0", "3351"],
            "--window to = 3351 m is outside 0 to 3350 m",
        ),
        (&["evaluate", "--course", "short.toml"], "look-ahead"),
        (&["evaluate", "--course", "tight.toml"], "curvature_per_m = 3"),
        (
            &["evaluate", "--speed", "5"],
            "--speed = 5 km/h is outside 20 to 250 km/h",
        ),
        (
            &["evaluate", "--speed", "-60"],
            "--speed = -60 km/h is outside 20 to 250 km/h",
        ),
        (
            &["evaluate", "--window", "-5", "100"],
            "--window from = -5 m is outside 0 to 3332.3 m: runs end at 3333.3 m",
        ),
        (
            &["evaluate", "--window", "3340", "3350"],
            "--window from = 3340 m",
        ),
        (&["evaluate", "--speed", "nan"], "speed = NaN"),
        // Numbers are shown as they were written.
        (
            &["evaluate", "--speed", "5e0"],
            "--speed = 5e0 km/h is outside 20 to 250 km/h",
        ),
        (&["convert", "a.csv", "b.csv", "--rate=1e9"], "--rate 1e9: 0.1 to"),
        (
            &["run", "exponent.toml"],
            "exponent.toml: driver.t_p_s = 1e1 s is outside 0.001 to 2 s",
        ),
        (&["run", "inline.toml"], "driver.t_p_s = 1_0.0 s is outside"),
        (&["evaluate", "--window", "500", "100"], "window"),
        (
            &["evaluate", "--window", "100", "9000"],
            "--window to = 9000 m is outside 0 to 3350 m",
        ),
        (
            &["evaluate", "--failure-time", "-1"],
            "--failure-time = -1 s is outside 0 to 200 s",
        ),
        (
            &["evaluate", "--failure-time", "5000"],
            "--failure-time = 5000 s is outside 0 to 200 s: the run ends there",
        ),
        (
            &["run", "late.toml"],
            "late.toml: failure.time_s = 5000 s is outside 0 to 200 s",
        ),
        (
            &["evaluate", "--course", "empty.toml"],
            "empty.toml: a course needs",
        ),
        (&["run", "course.toml"], "course.toml: this is a course"),
        (&["ecu", "pil", "exact.toml"], "exact.toml: sensors = \"exact\""),
        (&["evaluate", "--sensors", "perfect"], "perfect"),
        (&["run", "unknown.toml"], "t_q"),
        (
            &["ecu", "parameters", "between.toml", "--can", "can0"],
            "between.toml: guidance.law = 1.5 is not a whole number from 0 to 1",
        ),
        (
            &["ecu", "pil", "manual.toml"],
            "manual.toml: condition = \"manual\"",
        ),
        (&["fly"], "fly"),
        (
            &["evaluate", "--out", "short.toml/out"],
            "cannot write short.toml/out: ",
        ),
        (
            &["run", "empty.toml", "--out", "short.toml"],
            "cannot write short.toml: ",
        ),
    ];
    for (arguments, expected) in cases {
        let output = host_sim(directory.path(), arguments);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{arguments:?}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(expected),
            "{arguments:?} gave {}",
            stderr(&output)
        );
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    let notes = std::fs::read_to_string(directory.path().join("notes.txt")).unwrap();
    assert_eq!(notes, "of somebody");
}

/// Who mistypes a name or forgets the command is told what to write.
#[test]
fn another_name_is_answered_with_the_right_one() {
    let directory = tempfile::tempdir().unwrap();
    let cases: [(&[&str], &str); 10] = [
        (
            &["pil"],
            "there is no command `pil`; did you mean `host-sim ecu pil`?",
        ),
        (
            &["parameters", "--can=can0"],
            "did you mean `host-sim ecu parameters`?",
        ),
        (&["help", "bus"], "did you mean `host-sim ecu bus`?"),
        (
            &["experiment", "--participants", "1,3..5"],
            "`--participant 1,3..5` says which ones",
        ),
        (
            &["validate"],
            "--coverage <N>|--corruptions <N>|--changes <N>|--methods <N>",
        ),
        (&["--speed", "70"], "`host-sim evaluate --speed 70`"),
        (&["evalute"], "'evaluate'"),
        (&["ecu", "parameter"], "'parameters'"),
        (&["evaluate", "--sped", "70"], "'--speed'"),
        (&["ecu", "live", "--recrod", "a.log"], "'--record'"),
    ];
    for (arguments, expected) in cases {
        let output = host_sim(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(expected),
            "{arguments:?} gave {}",
            stderr(&output)
        );
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

/// Before anything is sent.
#[test]
fn parameters_that_no_ecu_takes_and_a_bus_that_is_not_there_are_named() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(
        directory.path().join("strong.toml"),
        "[guidance]\ntorque_limit_nm = 6\n",
    )
    .unwrap();
    let cases: [(&[&str], &[&str]); 8] = [
        (
            &["ecu", "diag", "read", "torque_limit", "--can", "can99"],
            &["did you mean torque_limit_nm?", "ecu diag describe"],
        ),
        (
            &["ecu", "diag", "write", "k_1=9", "--bench-key", "--can", "can99"],
            &["k_1 = 9", "from 0 to 4 N.m"],
        ),
        (
            &[
                "ecu",
                "diag",
                "write",
                "k_1=1",
                "--key",
                "strong.toml",
                "--can",
                "can99",
            ],
            &["strong.toml: ", "32 hexadecimal digits"],
        ),
        (&["ecu", "diag", "write", "k_1=1", "--can", "can99"], &["--key"]),
        (&["ecu", "diag", "list", "--can", "can99"], &["can99"]),
        (
            &["ecu", "parameters", "strong.toml", "--can", "can99"],
            &["strong.toml: ", "torque_limit_nm = 6", "0.1", "5"],
        ),
        (&["ecu", "parameters", "--can", "can99"], &["can99"]),
        (&["ecu", "parameters"], &["--can"]),
    ];
    for (arguments, expected) in cases {
        let output = host_sim(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        for word in expected {
            assert!(
                stderr(&output).contains(word),
                "{arguments:?} gave {}",
                stderr(&output)
            );
        }
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}
