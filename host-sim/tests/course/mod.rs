//! `host-sim course` on roads of others: the centre of a lane against a second evaluation in Python
//! (tests/tools/lane_centre.py, which shares nothing with the reader), what is refused and how, and courses of our own
//! written and read back.

mod ways;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn host_sim(arguments: &[&str]) -> Output {
    crate::host_sim(&root(), arguments)
}

fn survey(arguments: &[&str]) -> Value {
    let output = host_sim(&[&["course", "--json"], arguments].concat());
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

/// File, options, and for the oracle: roads with the lane of each section in the direction of travel, a minus before
/// the road for against its s.
const LANES: [(&str, &[&str], &[&str]); 10] = [
    // Every kind of geometry, laneOffset, widths in several cubics, sections, superelevation.
    ("every_kind", &[], &["7:-2,-3"]),
    ("every_kind", &["--lane", "-1"], &["7:-1"]),
    ("every_kind", &["--road", "7", "--lane", "1"], &["-7:1"]),
    // Four roads, one stored against the chain's direction, out of order in the file.
    ("chain", &[], &["A:-1", "B:-1", "-C:1", "D:-1"]),
    ("chain", &["--lane", "1"], &["-D:1", "C:-1", "-B:1", "-A:1"]),
    (
        "chain",
        &["--road", "B", "--lane", "-1"],
        &["B:-1", "-C:1", "D:-1"],
    ),
    ("one_way_junction", &[], &["10:-1", "11:-1", "12:-1"]),
    ("ring_left_hand", &[], &["1:1", "2:1"]),
    // Map coordinates, a hairpin, sections of one side only.
    ("hairpin_far_away", &[], &["3:-1"]),
    ("hairpin_far_away", &["--lane", "1"], &["-3:1,1"]),
];

#[test]
fn lane_centres_are_those_of_an_independent_evaluation() {
    for (name, options, legs) in LANES {
        let file = format!("tests/data/xodr/{name}.xodr");
        let course = survey(&[&[file.as_str()], options].concat());
        // Every metre from the start on.
        let samples = course["samples"].as_array().unwrap();
        let length_m = course["length_m"].as_f64().unwrap();
        assert_eq!(samples.len(), length_m.floor() as usize + 1);
        for (i, sample) in samples.iter().enumerate() {
            assert_eq!(sample["s_m"].as_f64(), Some(i as f64));
        }
        let mut oracle = Command::new("python3")
            .arg("tests/tools/lane_centre.py")
            .arg(&file)
            .args(legs)
            .current_dir(root())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3 is installed");
        oracle
            .stdin
            .take()
            .unwrap()
            .write_all(course.to_string().as_bytes())
            .unwrap();
        let output = oracle.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{name} {options:?}: {said}");
        // It did judge this course.
        let worst: Value = serde_json::from_str(&said).unwrap();
        assert!(
            worst["place"].as_f64().unwrap() < 0.01,
            "{name} {options:?}: {said}"
        );
    }
}

/// A road of one straight and one lane, with a part of its text replaced.
fn broken(old: &str, new: &str) -> String {
    let text = r#"<OpenDRIVE><header revMajor="1" revMinor="6"/>
<road id="1" length="100" junction="-1"><link><successor elementType="road" elementId="2" contactPoint="start"/></link>
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0"/></center><right><lane id="-1" type="driving"><link><successor id="-1"/></link>
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
<road id="2" length="100"><planView><geometry s="0" x="100" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0"/></center><right><lane id="-1" type="driving">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road></OpenDRIVE>"#;
    assert!(text.contains(old), "{old}");
    text.replacen(old, new, 1)
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of broken files")]
fn what_is_broken_or_not_supported_is_refused_in_one_sentence() {
    let first = r#"length="100"><line/>"#;
    let width = r#"<width sOffset="0" a="3.5" b="0" c="0" d="0"/>"#;
    let link = r#"<successor elementType="road" elementId="2" contactPoint="start"/>"#;
    let cases: &[(&str, &str, &[&str], &str)] = &[
        ("</OpenDRIVE>", "", &[], "not well-formed XML"),
        ("OpenDRIVE>", "OpenSCENARIO>", &[], "not well-formed XML"),
        (
            "<line/>",
            "<bezier/>",
            &[],
            "road 1: geometry at s = 0 m: <bezier> is not supported; line, arc, spiral",
        ),
        (
            "<line/>",
            "",
            &[],
            "road 1: geometry at s = 0 m: it has no kind of geometry",
        ),
        (
            "<line/>",
            "<arc/>",
            &[],
            "road 1: geometry at s = 0 m: <arc> has no `curvature`",
        ),
        (
            "<line/>",
            r#"<arc curvature="left"/>"#,
            &[],
            "curvature=\"left\" of <arc> is not a number",
        ),
        (
            "<line/>",
            r#"<arc curvature="NaN"/>"#,
            &[],
            "curvature=\"NaN\" of <arc> is not a number",
        ),
        (
            "<line/>",
            r#"<arc curvature="1e9"/>"#,
            &[],
            "road 1: geometry at s = 0 m: with a curvature of 1000000000 to 1000000000 1/m it turns by up to",
        ),
        (
            first,
            r#"length="1e12"><line/>"#,
            &[],
            "road 1: geometry at s = 0 m: length = 1000000000000 m makes the road longer than 200000 m",
        ),
        (
            width,
            &width.replace("c=\"0\"", "c=\"1e7\""),
            &[],
            "road 1: lane -1 cannot be followed at s = 0.00 m",
        ),
        (
            first,
            r#"length="-100"><line/>"#,
            &[],
            "road 1: geometry at s = 0 m: length = -100 m is negative",
        ),
        (
            "<line/>",
            r#"<paramPoly3 aU="0" bU="100" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0" pRange="metres"/>"#,
            &[],
            "pRange=\"metres\" of <paramPoly3> is neither arcLength nor normalized",
        ),
        (
            "<line/>",
            r#"<paramPoly3 aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>"#,
            &[],
            "the polynomial is 1.00 m long over its parameter's range, not 100 m",
        ),
        (
            r#"elementId="2""#,
            r#"elementId="3""#,
            &[],
            "road 1: its successor is road 3, which is not in the file",
        ),
        (
            r#"elementType="road" elementId="2""#,
            r#"elementType="junction" elementId="9""#,
            &[],
            "road 1: its successor is junction 9, which is not in the file",
        ),
        (
            "<successor id=\"-1\"/>",
            "<successor id=\"-2\"/>",
            &[],
            "road 2: the lane section at s = 0 m has no lane -2; it has -1",
        ),
        (
            link,
            "",
            &[],
            "its 2 roads are not one chain: road 1 has no link to roads 2; choose",
        ),
        (
            r#"x="100""#,
            r#"x="103""#,
            &[],
            "road 2: in the section at s = 0 m the centre of lane -1 does not continue the way",
        ),
        (
            r#"contactPoint="start""#,
            r#"contactPoint="middle""#,
            &[],
            "contactPoint=\"middle\"",
        ),
        (
            width,
            "",
            &[],
            "road 1: lane -1 of the section at s = 0 m: it has no <width>",
        ),
        (
            width,
            "<border sOffset=\"0\" a=\"-3\"/>",
            &[],
            "<border> is not supported, only <width>",
        ),
        (
            width,
            &width.replace("3.5", "-3.5"),
            &[],
            "road 1: lane -1 has a negative width of -3.500 m",
        ),
        (
            width,
            &width.replace("b=\"0\"", "b=\"\""),
            &[],
            "b=\"\" of <width> is not a number",
        ),
        (
            "id=\"-1\" type=\"driving\"",
            "id=\"-1\" type=\"sidewalk\"",
            &[],
            "road 1: it has no driving lane",
        ),
        ("<road id=\"2\"", "<road id=\"1\"", &[], "two roads have the id 1"),
        ("<planView>", "<planview>", &[], "not well-formed XML"),
        ("", "", &["--road", "5"], "it has no road 5; it has 1, 2"),
        (
            "",
            "",
            &["--lane", "-4"],
            "road 1: the lane section at s = 0 m has no lane -4; it has -1",
        ),
        (
            "",
            "",
            &["--lane", "0"],
            "lane 0 is the centre lane, which has no width",
        ),
    ];
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("broken.xodr");
    let path = path.to_str().unwrap();
    for (old, new, options, expected) in cases {
        std::fs::write(path, broken(old, new)).unwrap();
        let output = host_sim(&[&["course", path], *options].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{old} -> {new}: {said}");
        assert!(said.starts_with(&format!("error: {path}: ")), "{said}");
        assert!(said.contains(expected), "{old} -> {new}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "one sentence: {said}");
        assert!(output.stdout.is_empty());
    }
    // What the cases start from is good.
    std::fs::write(path, broken("", "")).unwrap();
    assert_eq!(survey(&[path])["length_m"], 200.0);
}

#[test]
fn courses_of_our_own_are_saved_and_read_back() {
    let directory = tempfile::tempdir().unwrap();
    let saved = directory.path().join("saved.xodr");
    let saved = saved.to_str().unwrap();
    let banked = directory.path().join("banked.toml");
    let text = "lane_width_m = 3.25\n[[segment]]\nlength_m = 40\nbank_rad = -0.02\n[[segment]]\nlength_m = 50\ncurvature_start_per_m = 0\n\
                curvature_end_per_m = 0.01\nbank_start_rad = -0.02\nbank_end_rad = -0.06\ngrade_start = 0\ngrade_end = 0.05\n\
                [[segment]]\nlength_m = 33.3\ncurvature_per_m = 0.01\nbank_rad = -0.06\ngrade = 0.05\n";
    std::fs::write(&banked, text).unwrap();
    let of_test = |name: &str| format!("tests/data/xodr/{name}.xodr");
    let files = [
        ("paper-course".to_owned(), 0.0, 0.0),
        ("examples/hill-road.toml".into(), 0.0, 0.0),
        (banked.to_str().unwrap().into(), 0.0, 1e-12),
        // A lane of somebody else's becomes a row of clothoids of half a metre.
        (of_test("every_kind"), 1e-5, 1e-5),
        (of_test("chain"), 1e-5, 1e-5),
    ];
    for (file, of_place, of_surface) in files {
        assert_eq!(
            host_sim(&["course", &file, "--save", saved]).status.code(),
            Some(0)
        );
        let (before, after) = (survey(&[&file]), survey(&[saved]));
        let (a, b) = (
            before["samples"].as_array().unwrap(),
            after["samples"].as_array().unwrap(),
        );
        assert!(a.len().abs_diff(b.len()) <= 1 && a.len() > 100, "{file}");
        for (a, b) in a.iter().zip(b) {
            for (quantity, limit) in [
                ("x_m", of_place),
                ("y_m", of_place),
                ("heading_rad", of_place),
                ("curvature_1pm", of_place),
                ("bank_rad", of_surface),
                ("grade", of_surface),
                ("width_m", of_surface),
            ] {
                let [a, b] = [a, b].map(|sample| sample[quantity].as_f64().unwrap());
                assert!((a - b).abs() <= limit, "{file} {quantity}: {a} became {b}");
            }
        }
    }
}

#[test]
fn a_road_and_a_lane_are_for_opendrive_alone() {
    for arguments in [
        ["course", "paper-course", "--lane", "-1"],
        ["course", "examples/hill-road.toml", "--road", "1"],
    ] {
        let output = host_sim(&arguments);
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            said.contains("can only be chosen of an OpenDRIVE file (.xodr)"),
            "{said}"
        );
    }
}

#[test]
fn a_scenario_drives_on_a_lane_as_on_the_same_course_in_toml() {
    let directory = tempfile::tempdir().unwrap();
    let saved = directory.path().join("paper.xodr");
    let saved = saved.to_str().unwrap();
    assert_eq!(
        host_sim(&["course", "paper-course", "--save", saved])
            .status
            .code(),
        Some(0)
    );
    let scenario = directory.path().join("scenario.toml");
    let run = |text: &str, options: &[&str]| {
        std::fs::write(&scenario, text).unwrap();
        let output = host_sim(&[&["run", "--json", scenario.to_str().unwrap()], options].concat());
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let results: Value = serde_json::from_slice(&output.stdout).unwrap();
        // Not what depends on the window: the paper's course has one of its own.
        [
            "end_m",
            "diverged",
            "course_length_m",
            "peak_lateral_error_m",
            "peak_guidance_torque_nm",
        ]
        .map(|name| results[name].clone())
    };
    let here = run("", &[]);
    assert_eq!(
        run("course = \"paper.xodr\"\nroad = \"1\"\nlane = -1\n", &[]),
        here
    );
    assert_eq!(run("", &["--course", saved]), here);
    // A banked lane of somebody else's, far from the origin of its file, with kinks and widths that change.
    let foreign = root().join("tests/data/xodr/every_kind.xodr");
    let drive = run(
        "speed_m_per_s = 14",
        &["--course", foreign.to_str().unwrap(), "--lane", "-1"],
    );
    assert_eq!(drive[1], false, "{drive:?}");
    assert!(drive[0].as_f64().unwrap() > 400.0, "{drive:?}");
}
