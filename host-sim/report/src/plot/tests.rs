//! What a reader of a figure relies on: limits, cuts, names, sizes.

use super::*;

fn line(label: &str, style: usize, points: Vec<(f64, f64)>) -> Line {
    Line {
        label: label.into(),
        style,
        points,
    }
}

fn panel(title: &str, lines: Vec<Line>) -> Panel {
    Panel {
        title: title.into(),
        y: Axis {
            label: "Lateral error (m)".into(),
            limits: None,
        },
        lines,
    }
}

fn two_panels() -> Figure {
    Figure {
        title: "Two drivers".into(),
        x: Axis {
            label: "Distance (m)".into(),
            limits: Some((0.0, 100.0)),
        },
        same_y: true,
        panels: vec![
            panel(
                "A",
                vec![line(
                    "manual",
                    0,
                    vec![(0.0, 0.0), (50.0, 0.13), (100.0, 0.0), (150.0, 9.0)],
                )],
            ),
            panel("B", vec![line("manual", 0, vec![(0.0, -0.05), (100.0, 0.61)])]),
        ],
        markers: vec![Marker {
            label: "failure".into(),
            x: 30.0,
        }],
        bands: vec![Band {
            label: "curve".into(),
            from: 20.0,
            to: 400.0,
            dark: true,
        }],
    }
}

#[test]
fn panels_share_limits_that_hold_what_is_in_view() {
    let figure = two_panels();
    assert_eq!(figure.x_limits(), (0.0, 100.0));
    // 9.0 at x = 150 is out of view.
    assert_eq!(figure.y_limits(), [(-0.2, 0.8), (-0.2, 0.8)]);
    let own = Figure {
        same_y: false,
        ..figure
    };
    let (low, high) = own.y_limits()[0];
    assert!(low == 0.0 && (high - 0.15).abs() < 1e-12, "{high}");
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
        assert_eq!(svg.matches(&format!("\n{name}\n")).count(), 1, "{name}");
    }
}

#[test]
fn text_is_escaped() {
    let mut figure = two_panels();
    figure.title = "<script>alert(1)</script> & co".into();
    let svg = figure.to_svg().unwrap();
    assert!(!svg.contains("<script>") && svg.contains("&lt;script&gt;alert(1)&lt;/script&gt; &amp; co"));
}

#[test]
fn a_long_record_stays_small_and_inside_the_page() {
    let points = (0..46_000)
        .map(|i| f64::from(i) * 0.1)
        .map(|x| (x, x.sin() * 1e3))
        .collect();
    let mut figure = two_panels();
    figure.x.limits = None;
    figure.panels = vec![panel("A", vec![line("a", 0, points)])];
    figure.panels[0].y.limits = Some((-1.0, 1.0));
    let svg = figure.to_svg().unwrap();
    assert!(svg.len() < 400_000, "{} bytes", svg.len());
    figure.panels[0].y.limits = None;
    let svg = figure.to_svg().unwrap();
    assert!(svg.len() < 40_000, "{} bytes", svg.len());
    let curve = svg
        .lines()
        .find(|l| l.contains("polyline") && l.matches(',').count() > 500)
        .unwrap();
    let points = curve
        .split("points=\"")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap();
    for point in points.split_whitespace() {
        let (x, y) = point.split_once(',').unwrap();
        let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
        assert!(
            (0.0..=3600.0).contains(&x) && (0.0..=1400.0).contains(&y),
            "{point}"
        );
    }
}

#[test]
fn nothing_but_nan_still_gives_a_figure() {
    let mut figure = two_panels();
    figure.x.limits = None;
    figure.panels = vec![panel(
        "A",
        vec![line("a", 0, vec![(f64::NAN, 1.0), (1.0, f64::NAN)])],
    )];
    assert_eq!(
        (figure.x_limits(), figure.y_limits()),
        ((0.0, 1.0), vec![(-1.0, 1.0)])
    );
    assert!(!figure.to_svg().unwrap().contains("NaN"));
}

/// The PNG shows the same: white paper, and ink of the line's colour.
#[test]
fn the_png_is_1800_pixels_wide_and_holds_the_lines_colour() {
    let mut figure = two_panels();
    figure.panels[0].lines[0].style = 1;
    let file = figure.to_png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.width, 1800);
    assert_eq!(&pixels[..3], [255, 255, 255]);
    let blue = pixels
        .as_chunks::<3>()
        .0
        .iter()
        .filter(|p| **p == [0x00, 0x72, 0xb2])
        .count();
    assert!(blue > 1000, "{blue} pixels of the line");
}
