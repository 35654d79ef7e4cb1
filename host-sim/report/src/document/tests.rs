//! What a reader and a file system rely on.

use super::*;
use crate::plot::{Axis, Panel, Series};
use crate::studies::compare::{driver_kinds, law_kinds};
use haptic_metrics::{DEFINITIONS, Metrics};
use std::fs;
use std::io;

fn report_of(blocks: Vec<Block>) -> String {
    let section = Section {
        heading: "Results & more".into(),
        blocks,
    };
    Report {
        title: "A <b>title</b>".into(),
        summary: "Course: ours.".into(),
        sections: vec![section],
        provenance: Provenance::new(Some("seed = 1 # </pre><b>".into())),
        ..Report::default()
    }
    .to_html()
    .unwrap()
}

#[test]
fn text_from_outside_cannot_become_markup() {
    let evil = "</td><script>alert('x')</script>";
    let figure = Figure {
        title: evil.into(),
        panels: vec![Panel {
            title: evil.into(),
            ..Panel::default()
        }],
        ..Figure::default()
    };
    let html = report_of(vec![
        Block::Text(evil.into()),
        Block::Table(Table::of_pairs([evil, "b"], [(evil, evil)])),
        Block::Figure {
            name: String::new(),
            figure,
            caption: evil.into(),
        },
        Block::Events(vec![Event {
            time_s: 70.0,
            what: evil.into(),
        }]),
    ]);
    assert!(
        !html.contains("alert('x')</script>") && !html.contains("<script>alert") && !html.contains("<b>")
    );
    // The figure's data, and the page's own script.
    assert_eq!(
        (html.matches("<script").count(), html.matches("</script>").count()),
        (2, 2)
    );
    assert_eq!(
        html.matches("&lt;script&gt;").count(),
        8,
        "each place shows the text"
    );
    assert!(
        html.contains("\\u003c/td>\\u003cscript>"),
        "so does the chart's data"
    );
    assert!(html.contains("seed = 1 # &lt;/pre&gt;&lt;b&gt;"));
    assert!(html.contains("Results &amp; more"));
}

#[test]
fn a_report_loads_nothing() {
    let figure = Figure {
        panels: vec![Panel::default()],
        ..Figure::default()
    };
    let html = report_of(vec![Block::Figure {
        name: String::new(),
        figure,
        caption: String::new(),
    }]);
    // Names that are no addresses to load from: the namespace of SVG, the banner of the chart library, and the clip
    // paths of the page itself.
    let mut rest = html.replace("url(#", "");
    for name in [
        "http://www.w3.org/2000/svg",
        "/*! https://github.com/leeoniya/uPlot (v1.6.32) */",
    ] {
        assert!(rest.contains(name), "{name}");
        rest = rest.replace(name, "");
    }
    for outside in [
        "http:",
        "https:",
        "src=",
        "url(",
        "@import",
        "<link",
        "fetch(",
        "XMLHttpRequest",
        "import(",
    ] {
        assert!(!rest.contains(outside), "{outside}");
    }
    assert!(html.contains("default-src 'none'") && html.contains("script-src 'sha256-"));
}

#[test]
fn a_number_that_is_none_is_a_dash() {
    let cell = |value, decimals| Cell::Number { value, decimals };
    let table = Table {
        columns: ["a", "b", "c", "d"].map(String::from).to_vec(),
        rows: vec![vec![
            cell(Some(0.12345), 4),
            cell(None, 4),
            cell(Some(f64::NAN), 1),
            cell(Some(-0.0001), 2),
        ]],
        ..Table::default()
    };
    let html = report_of(vec![Block::Table(table)]);
    let cells: Vec<_> = html
        .split("<td class=\"number\">")
        .skip(1)
        .map(|c| c.split('<').next().unwrap())
        .collect();
    assert_eq!(cells, ["0.1235", "\u{2013}", "\u{2013}", "0.00"]);
}

#[test]
fn a_sign_can_be_read_off_a_number_however_small() {
    for (value, written) in [
        (-0.0614, "-0.061"),
        (0.0004, "+0.0004"),
        (-0.000_04, "-0.00004"),
        (12.0, "+12.000"),
        (0.0, "0"),
        (-0.0, "0"),
        (f64::NAN, "\u{2013}"),
    ] {
        assert_eq!(signed(value), written);
    }
    let table = Table {
        columns: vec!["Growth".into()],
        rows: vec![vec![Cell::Signed(-0.0004)]],
        ..Table::default()
    };
    assert!(table.to_text(None).ends_with("-0.0004\n"));
    assert!(report_of(vec![Block::Table(table)]).contains("<td class=\"number\">-0.0004</td>"));
}

#[test]
fn a_page_and_a_terminal_show_the_same_value_but_for_what_is_marked() {
    let figure = Figure {
        panels: vec![Panel::default()],
        ..Figure::default()
    };
    let said = |text: &str| Block::Text(text.into());
    let report = Report {
        title: "Title".into(),
        summary: "Three words here.".into(),
        notes: vec!["A note".into()],
        sections: vec![
            Section::new(
                "First",
                vec![
                    Block::figure("figure", figure, "Caption"),
                    said("Both."),
                    Block::Table(Table::new("Empty", ["a"], [])),
                ],
            ),
            Section::new(
                "Second",
                vec![said("Page.").on_page(), said("Terminal.").on_terminal()],
            ),
            Section::new("Third", vec![said("Detail.").on_page()]),
        ],
        ..Report::default()
    };
    assert_eq!(
        report.to_text(Some(11)),
        "Title\n\nThree words\nhere.\n\nFirst\n-----\n\nBoth.\n\nSecond\n------\n\nTerminal.\n"
    );
    let html = report.to_html().unwrap();
    for shown in ["Caption", "Both.", "Page.", "Detail.", "Note: A note."] {
        assert!(html.contains(shown), "{shown}");
    }
    assert!(!html.contains("Terminal.") && !html.contains("Empty"));
}

#[test]
fn a_figure_that_cannot_be_drawn_fails_the_report_with_its_name() {
    let x = Axis::new("x", "m").within(1.0, 0.0);
    let figure = Figure {
        title: "Figure 8".into(),
        x,
        ..Figure::default()
    };
    let section = Section {
        heading: String::new(),
        blocks: vec![Block::Figure {
            name: String::new(),
            figure,
            caption: String::new(),
        }],
    };
    let report = Report {
        sections: vec![section],
        ..Report::default()
    };
    assert!(report.to_html().unwrap_err().to_string().contains("Figure 8"));
}

#[test]
fn a_metrics_table_shows_the_chosen_metrics_with_units() {
    let metrics = Metrics {
        peak_lateral_error_m: Some(0.61789),
        conflict_time_share: Some(0.25),
        ..Metrics::default()
    };
    let keys = ["Driver"];
    let runs = [(vec![Cell::Text("t_p 0.5".into())], metrics)];
    let shown = ["peak_lateral_error_m", "conflict_time_share", "time_to_recover_s"];
    let table = metrics_table("", &keys, &runs, |d| shown.contains(&d.name));
    assert_eq!(
        table.columns,
        [
            "Driver",
            "Peak lateral error (m)",
            "Conflict",
            "Time to recover (s)"
        ]
    );
    assert_eq!(
        table.rows[0][1],
        Cell::Number {
            value: Some(0.61789),
            decimals: 4
        }
    );
    assert_eq!(
        table.rows[0][3],
        Cell::Number {
            value: None,
            decimals: 2
        }
    );
    assert_eq!(definitions_table().rows.len(), DEFINITIONS.len());
}

/// Rows as they are published, written by hand.
#[test]
fn what_a_file_may_name_is_a_table_in_markdown() {
    let has = |table: Table, row: &str| {
        let text = table.to_markdown();
        assert!(text.lines().any(|line| line == row), "{text}");
    };
    has(law_kinds(), "| Kind | Source | Parameters |");
    has(
        law_kinds(),
        "| `band` | after Petermeijer et al. 2015, 2020 (descriptions) | `outer_m` 0.5 (0 to 2; tuned 0.1 to 0.5), `inner_m` 0.19* (0 to 2), \
         `k_1` 0.25 (0 to 4; tuned 0.25 to 0.45) |",
    );
    has(
        driver_kinds(),
        "| `participant` | Wang et al. 2022, table 6 | `number` 1 (1 to 14) |",
    );
    has(driver_kinds(), "| `warning` | ours | `answers` 1* (0 to 1) |");
    has(
        definitions_table(),
        "| Mean lateral error | mean_abs_lateral_error_m | m | Mean of \\|e\\|. | Wang et al. 2022, section 5 |",
    );
}

#[test]
fn a_file_is_replaced_whole_or_not_at_all() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("new/out.txt");
    write_file(&path, |f| f.write_all(b"first")).unwrap();
    let error = write_file(&path, |f| {
        f.write_all(b"half of the sec")?;
        Err(io::Error::other("the run was stopped"))
    })
    .unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("cannot write {}: the run was stopped", path.display())
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "first");
    assert_eq!(
        fs::read_dir(path.parent().unwrap()).unwrap().count(),
        1,
        "no partial file is left"
    );
}

#[test]
fn an_unwritable_path_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("file");
    fs::write(&file, "").unwrap();
    let below = file.join("report.html");
    let message = write_file(&below, |_| Ok(())).unwrap_err().to_string();
    assert!(message.contains("report.html"), "{message}");
}

#[test]
fn json_has_null_where_there_is_no_value() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("results.json");
    write_json(&path, &[f64::NAN, 0.5]).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "[\n  null,\n  0.5\n]\n");
}

/// A page of four figures of long records stays below a few megabytes.
#[test]
fn a_report_of_long_records_stays_small() {
    let points: Vec<_> = (0..46_000)
        .map(|i| f64::from(i) / 200.0)
        .map(|t| (t, (3.0 * t).sin()))
        .collect();
    let line = |style| Series::line(&format!("run {style}"), style, points.clone());
    let panel = Panel {
        series: (0..4).map(line).collect(),
        ..Panel::default()
    };
    let figure = Figure {
        panels: vec![panel.clone(), panel.clone(), panel],
        ..Figure::default()
    };
    let block = Block::Figure {
        name: String::new(),
        figure,
        caption: String::new(),
    };
    let html = report_of(vec![block.clone(), block.clone(), block.clone(), block]);
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
}
