//! Ways from road to road: through junctions, and where they end.

use serde_json::Value;

use super::{broken, host_sim, survey};

#[test]
fn a_junction_with_several_ways_ends_a_way_that_was_chosen_and_refuses_one_that_was_not() {
    let text = broken(
        r#"elementType="road" elementId="2""#,
        r#"elementType="junction" elementId="9""#,
    );
    let way = |id: u8| {
        format!(
            r#"<connection id="{id}" incomingRoad="1" connectingRoad="2" contactPoint="start"><laneLink from="-1" to="-1"/></connection>"#
        )
    };
    let text = text.replace(
        "</OpenDRIVE>",
        &format!("<junction id=\"9\">{}{}</junction></OpenDRIVE>", way(0), way(1)),
    );
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("fork.xodr");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let output = host_sim(&["course", path]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said.contains("not one chain: junction 9 leads on to roads 2, 2; choose"),
        "{said}"
    );
    let course = survey(&[path, "--road", "1"]);
    assert_eq!(course["length_m"], 100.0);
    let notes = course["notes"].to_string();
    assert!(
        notes.contains("the way ends at junction 9: road 1 lane -1 goes on there to roads 2, 2"),
        "{notes}"
    );
}

/// A file may be a part of another one, and a lane may end before its road does: what there is of the way is driven.
#[test]
fn a_way_that_does_not_go_on_ends_there_with_a_note() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("end.xodr");
    let lane = "<link><successor id=\"-1\"/></link>";
    let section = r#"<laneSection s="40"><center><lane id="0"/></center><right><lane id="-1" type="shoulder">
<width sOffset="0" a="1" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
<road id="2""#;
    let two_sections = broken(
        "</laneSection></lanes></road>\n<road id=\"2\"",
        &format!("</laneSection>{section}"),
    );
    for (text, length_m, says) in [
        (
            broken(lane, ""),
            100.0,
            "the way ends with road 1: lane -1 goes on to no lane of road 2",
        ),
        (
            broken(r#"elementId="2""#, r#"elementId="3""#),
            100.0,
            "the way ends with road 1: its successor is road 3, which is not in the file",
        ),
        (
            broken(
                r#"elementType="road" elementId="2""#,
                r#"elementType="junction" elementId="9""#,
            ),
            100.0,
            "the way ends with road 1: its successor is junction 9, which is not in the file",
        ),
        (
            two_sections
                .replacen("<successor id=\"-1\"/>", "<predecessor id=\"-1\"/>", 1)
                .replacen(
                    "type=\"shoulder\">",
                    "type=\"shoulder\"><link><predecessor id=\"-2\"/></link>",
                    1,
                ),
            40.0,
            "the way ends in road 1 at s = 40 m: lane -1 goes on to no lane there",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let course = survey(&[path.to_str().unwrap(), "--road", "1"]);
        assert_eq!(course["length_m"], length_m, "{says}");
        assert!(
            course["notes"].to_string().contains(says),
            "{says}: {}",
            course["notes"]
        );
    }
}

/// A junction leads straight on by road 2, and by road 3 into an arc of 50 m radius that ends at road 4.
#[test]
fn a_turn_at_a_junction_is_chosen_by_the_road_through_it_or_behind_it() {
    let text = broken(
        r#"elementType="road" elementId="2""#,
        r#"elementType="junction" elementId="9""#,
    );
    let way = |id: u8, road: u8| {
        format!(
            r#"<connection id="{id}" incomingRoad="1" connectingRoad="{road}" contactPoint="start"><laneLink from="-1" to="-1"/></connection>"#
        )
    };
    let second = text
        .split("<road id=\"2\"")
        .nth(1)
        .unwrap()
        .split("</OpenDRIVE>")
        .next()
        .unwrap();
    let third = second
        .replacen("<line/>", "<arc curvature=\"0.02\"/>", 1)
        .replacen(
            "<planView>",
            "<link><successor elementType=\"road\" elementId=\"4\" contactPoint=\"start\"/></link><planView>",
            1,
        );
    let text = text.replace(
        "</OpenDRIVE>",
        &format!(
            "<road id=\"3\"{third}<junction id=\"9\">{}{}</junction></OpenDRIVE>",
            way(0, 2),
            way(1, 3)
        ),
    );
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("fork.xodr");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let end_y_m = |options: &[&str]| {
        let course = survey(&[&[path, "--road", "1"], options].concat());
        course["samples"].as_array().unwrap().last().unwrap()["y_m"]
            .as_f64()
            .unwrap()
    };
    let notes = survey(&[path, "--road", "1"])["notes"].to_string();
    assert!(
        notes.contains("goes on there to roads 2, 3 (to 4); --turn ID takes one"),
        "{notes}"
    );
    // The lane lies 1.75 m to the right: 50 + 1.75 m of radius, 2 rad, less the last part of a metre.
    assert!((end_y_m(&["--turn", "2"]) + 1.75).abs() < 1e-9);
    for turn in ["3", "4"] {
        let y_m = end_y_m(&["--turn", turn]);
        assert!(
            (y_m - (50.0 - 51.75 * 2.0_f64.cos())).abs() < 1.0,
            "{turn}: {y_m}"
        );
    }
    let output = host_sim(&["course", path, "--road", "1", "--turn", "7"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        said.contains("turn 7: no junction on the way leads there (") && said.contains("2, 3 (to 4)"),
        "{said}"
    );

    let scenario = directory.path().join("scenario.toml");
    std::fs::write(
        &scenario,
        "course = \"fork.xodr\"\nroad = \"1\"\nturn = [\"3\"]\n",
    )
    .unwrap();
    let output = host_sim(&["run", "--json", scenario.to_str().unwrap()]);
    let results: Value = serde_json::from_slice(&output.stdout).unwrap();
    let length_m = results["course_length_m"].as_f64().unwrap();
    assert!((length_m - 100.0 - 2.0 * 51.75).abs() < 0.01, "{length_m}");
}
