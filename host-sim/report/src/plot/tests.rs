//! What a reader of a figure relies on: limits, names, escapes, sizes.

use super::*;

fn panel(title: &str, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        y: Axis::of("Lateral error (m)"),
        series,
    }
}

fn two_panels() -> Figure {
    let first = vec![(0.0, 0.0), (50.0, 0.13), (100.0, 0.0), (150.0, 9.0)];
    Figure {
        title: "Two drivers".into(),
        x: Axis {
            label: "Distance (m)".into(),
            limits: Some((0.0, 100.0)),
            ..Axis::default()
        },
        same_y: true,
        panels: vec![
            panel("A", vec![Series::line("manual", 0, first)]),
            panel(
                "B",
                vec![Series::line("manual", 0, vec![(0.0, -0.05), (100.0, 0.61)])],
            ),
        ],
        markers: vec![Marker {
            label: "failure".into(),
            x: 30.0,
        }],
        bands: vec![Band {
            label: "curve".into(),
            from: 20.0,
            to: 400.0,
            shade: Shade::Dark,
            panel: None,
        }],
        ..Figure::default()
    }
}

#[test]
fn panels_share_limits_that_hold_what_is_in_view() {
    let figure = two_panels();
    assert_eq!(figure.x_limits(), (0.0, 100.0));
    // 9.0 at x = 150 is out of view; a twentieth of 0.66 is room.
    for (low, high) in figure.y_limits() {
        assert!(
            (low + 0.083).abs() < 1e-9 && (high - 0.643).abs() < 1e-9,
            "{low} {high}"
        );
    }
    let own = Figure {
        same_y: false,
        ..figure
    };
    let (low, high) = own.y_limits()[0];
    assert!(low == 0.0 && (high - 0.1365).abs() < 1e-12, "{high}");
    assert_eq!(with_room(None, true), (-1.0, 1.0));
    assert_eq!(with_room(Some((0.0, 2.0)), false), (-0.1, 2.1));
    assert_eq!(with_room(Some((4.0, 4.0)), true), (2.0, 6.0));
}

#[test]
fn given_limits_are_kept_and_bad_ones_refused() {
    let mut figure = two_panels();
    figure.panels[1].y.limits = Some((-1.0, 1.0));
    assert_eq!(figure.y_limits()[1], (-1.0, 1.0));
    for bad in [(1.0, 1.0), (0.0, f64::NAN), (2.0, 1.0)] {
        figure.panels[1].y.limits = Some(bad);
        let message = figure.to_svg().unwrap_err().to_string();
        assert!(
            message.contains("'Two drivers'") && message.contains("'Lateral error (m)'"),
            "{message}"
        );
    }
}

#[test]
fn a_legend_names_each_thing_once() {
    let svg = two_panels().to_svg().unwrap();
    for name in ["manual", "failure", "curve"] {
        assert_eq!(svg.matches(&format!(">{name}</text>")).count(), 1, "{name}");
    }
}

#[test]
fn rows_bear_their_names_from_top_to_bottom() {
    let names = ["first", "second", "third"];
    let figure = Figure {
        rows: names.map(String::from).to_vec(),
        panels: vec![
            panel(
                "A",
                vec![Series::dots("", 1, vec![(1.0, 0.5), (2.0, 0.7), (3.0, 0.1)])]
            );
            2
        ],
        ..Figure::default()
    };
    let svg = figure.to_svg().unwrap();
    let height = |name: &str| -> f64 {
        let text = &svg[..svg.find(&format!(">{name}</text>")).unwrap()];
        let y = &text[text.rfind(" y=\"").unwrap() + 4..];
        y[..y.find('"').unwrap()].parse().unwrap()
    };
    assert!(height("first") < height("second") && height("second") < height("third"));
    assert_eq!(
        svg.matches(">first</text>").count(),
        1,
        "the second panel needs no names"
    );
}

#[test]
fn text_is_escaped() {
    let mut figure = two_panels();
    figure.title = "<script>alert(1)</script> & co".into();
    let svg = figure.to_svg().unwrap();
    assert!(!svg.contains("<script>") && svg.contains("&lt;script&gt;alert(1)&lt;/script&gt; &amp; co"));
}

#[test]
fn a_long_record_stays_small() {
    let points = (0..46_000)
        .map(|i| f64::from(i) * 0.1)
        .map(|x| (x, x.sin() * 1e3))
        .collect();
    let mut figure = two_panels();
    figure.x.limits = None;
    figure.panels = vec![panel("A", vec![Series::line("a", 0, points)])];
    let svg = figure.to_svg().unwrap();
    assert!(svg.len() < 60_000, "{} bytes", svg.len());
}

#[test]
fn nothing_but_nan_still_gives_a_figure() {
    let mut figure = two_panels();
    figure.x.limits = None;
    figure.panels = vec![panel(
        "A",
        vec![Series::line("a", 0, vec![(f64::NAN, 1.0), (1.0, f64::NAN)])],
    )];
    assert_eq!(
        (figure.x_limits(), figure.y_limits()),
        ((0.0, 1.0), vec![(-1.0, 1.0)])
    );
    assert!(!figure.to_svg().unwrap().contains("NaN"));
    assert!(!Figure::default().to_svg().unwrap().contains("NaN"));
}
