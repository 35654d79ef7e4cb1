//! What a reader of a figure relies on: limits, names, escapes, sizes.

use super::*;

fn panel(title: &str, series: Vec<Series>) -> Panel {
    Panel::new(title, Axis::new("Lateral error", "m"), series)
}

fn two_panels() -> Figure {
    let first = vec![(0.0, 0.0), (50.0, 0.13), (100.0, 0.0), (150.0, 9.0)];
    Figure {
        title: "Two drivers".into(),
        x: Axis::new("Distance", "m").within(0.0, 100.0),
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

#[test]
fn a_legend_shows_dashes_and_dots_as_the_panel_does() {
    let points = vec![(0.0, 0.0), (50.0, 0.3), (100.0, 0.2)];
    let series = Series::dots("dashed", 3, points).joined();
    let figure = Figure {
        panels: vec![panel("", vec![series])],
        ..Figure::default()
    };
    let svg = figure.to_svg().unwrap();
    assert_eq!(
        svg.matches("stroke-dasharray=\"4 3\"").count(),
        2,
        "one line, one in the legend"
    );
    let diamonds = svg.matches("fill=\"#d55e00\"").count();
    assert_eq!(diamonds, 3 + 1, "three points, one in the legend");
}

/// Without a view box a narrow page shows a part of the drawing, and paper another one.
#[test]
fn a_drawing_fits_the_width_that_it_is_given() {
    let svg = two_panels().to_svg().unwrap();
    let of = |name: &str| {
        let value = &svg[svg.find(&format!(" {name}=\"")).unwrap() + name.len() + 3..];
        value[..value.find('"').unwrap()].to_owned()
    };
    let numbers = |text: String| {
        text.split(' ')
            .map(|n| n.parse::<f64>().unwrap())
            .collect::<Vec<_>>()
    };
    let size = numbers(format!("0 0 {} {}", of("width"), of("height")));
    // The drawing library rounds to hundredths.
    let off = numbers(of("viewBox"))
        .into_iter()
        .zip(size)
        .map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 0.01);
}

#[test]
fn what_lies_beyond_a_row_is_a_number_with_an_arrow() {
    let mut one = panel(
        "A",
        vec![Series::dots("", 1, vec![(1.0, 0.5), (2.0, 19.26), (3.0, 3.6)])],
    );
    one.y.limits = Some((0.0, 3.6));
    let figure = Figure {
        rows: ["first", "second", "third"].map(String::from).to_vec(),
        panels: vec![one],
        ..Figure::default()
    };
    let svg = figure.to_svg().unwrap();
    assert_eq!(svg.matches('\u{2192}').count(), 1);
    assert!(svg.contains(">19.3 \u{2192}</text>"));
}

#[test]
fn a_line_that_ends_early_ends_within_the_frame_with_its_reason() {
    let line = Series::line("", 1, vec![(0.0, 0.0), (50.0, -2.0)]);
    let end = Series::with_mark("ends: left the road", 1, Mark::Ends, vec![(50.0, -2.0)]);
    let figure = Figure {
        panels: vec![panel("", vec![line, end])],
        ..Figure::default()
    };
    assert_eq!(figure.x_limits(), (0.0, 51.0));
    assert!(figure.y_limits()[0].0 < -2.0 && figure.y_limits()[0].1 > 0.0);
    assert!(figure.to_svg().unwrap().contains(">ends: left the road</text>"));
}

#[test]
fn a_map_has_a_word_in_each_field_and_a_tick_at_each() {
    let field = |x: f64, y: f64, label: &str, style| {
        let shown = vec![(0.5, format!("{x} at {y}"))];
        let mark = Mark::Fields {
            size: [10.0, 0.1],
            shown,
        };
        Series::with_mark(label, style, mark, vec![(x, y)])
    };
    let series = vec![
        field(20.0, 0.1, "stable", 1),
        field(30.0, 0.1, "stable", 1),
        field(40.0, 0.1, "unstable", 3),
    ];
    let figure = Figure {
        x: Axis::new("Speed", "km/h").within(15.0, 45.0),
        panels: vec![Panel::new("", Axis::new("t_p", "s").within(0.05, 0.15), series)],
        ..Figure::default()
    };
    let svg = figure.to_svg().unwrap();
    for word in [
        "20 at 0.1",
        "30 at 0.1",
        "40 at 0.1",
        "stable",
        "unstable",
        "20",
        "30",
        "40",
    ] {
        assert_eq!(svg.matches(&format!(">{word}</text>")).count(), 1, "{word}");
    }
}

/// A4 has room for 267 mm, letter for 249, of which a caption takes some: at 180 mm of width 1160 points are 229 mm.
#[test]
fn pages_hold_all_of_a_figure_on_the_same_axes() {
    let names: Vec<String> = (1..=130).map(|i| format!("row {i}")).collect();
    let points = (1..=130).map(|i| (f64::from(i), f64::from(i))).collect();
    let long = Figure {
        rows: names.clone(),
        panels: vec![panel("A", vec![Series::dots("dots", 1, points)])],
        ..Figure::default()
    };
    let mut high = two_panels();
    high.panels = (0..6).map(|i| high.panels[i % 2].clone()).collect();
    for figure in [long, high] {
        let pages = figure.pages();
        let drawn: Vec<String> = pages.iter().map(|page| page.to_svg().unwrap()).collect();
        for (page, svg) in pages.iter().zip(&drawn) {
            assert_eq!(page.y_limits()[0], figure.y_limits()[0]);
            assert!(figure.rows.len() > 1 || page.x_limits() == figure.x_limits());
            let height = &svg[svg.find(" height=\"").unwrap() + 9..];
            let height: f64 = height[..height.find('"').unwrap()].parse().unwrap();
            assert!(height < 1160.0, "{height}");
        }
        let panels: usize = pages.iter().map(|page| page.panels.len()).sum();
        assert!(figure.rows.len() > 1 || panels == figure.panels.len());
        let rows: Vec<&String> = pages.iter().flat_map(|page| &page.rows).collect();
        assert_eq!(rows, figure.rows.iter().collect::<Vec<_>>());
        assert!((2..=3).contains(&pages.len()), "{}", pages.len());
    }
    // A band of one panel goes with it: the fifth is the first of the second page.
    let mut banded = two_panels();
    banded.panels = vec![banded.panels[0].clone(); 6];
    banded.bands[0].panel = Some(4);
    let bands: Vec<Option<usize>> = banded
        .pages()
        .iter()
        .flat_map(|page| &page.bands)
        .map(|band| band.panel)
        .collect();
    assert_eq!(bands, [Some(0)], "the first page has no fifth panel");
    // A row's dot goes with its name: on the third page the row 100 is the twelfth.
    let third = Figure {
        rows: names,
        panels: vec![panel("A", vec![Series::dots("", 1, vec![(100.0, 7.0)])])],
        ..Figure::default()
    }
    .pages()
    .remove(2);
    let place = third.rows.iter().position(|row| row == "row 100").unwrap() + 1;
    assert_eq!(third.panels[0].series[0].points, [(place as f64, 7.0)]);
    assert_eq!(two_panels().pages().len(), 1);
}
