//! What a reader of a picture relies on: that there is ink where the data are, and none where they are not.

use resvg::tiny_skia::Pixmap;

use super::*;

/// One blue series over 0 to 100, values -1 to 1.
fn alone(mark: Mark, points: Vec<(f64, f64)>) -> Figure {
    let panel = Panel::new(
        "",
        Axis::new("y", "-").within(-1.0, 1.0),
        vec![Series::with_mark("", 1, mark, points)],
    );
    Figure {
        x: Axis::new("x", "-").within(0.0, 100.0),
        panels: vec![panel],
        ..Figure::default()
    }
}

/// Pixels of a figure, with the place of its frame, found by its colour: left, right, top, bottom.
struct Picture {
    pixels: Pixmap,
    frame: [f64; 4],
}

impl Picture {
    fn new(figure: &Figure) -> Self {
        let pixels = raster::pixels(&figure.to_svg().unwrap()).unwrap();
        let dark = |x: u32, y: u32| pixels.pixel(x, y).is_some_and(|p| p.red() < 60 && p.blue() < 60);
        let (w, h) = (pixels.width(), pixels.height());
        let row = |y: u32| (0..w).filter(|x| dark(*x, y)).count() > w as usize * 3 / 4;
        let column = |x: u32| (0..h).filter(|y| dark(x, *y)).count() > h as usize / 2;
        let middle = |all: Vec<u32>| all.iter().map(|v| f64::from(*v) + 0.5).sum::<f64>() / all.len() as f64;
        let ends = |all: Vec<u32>| {
            let half = (all[0] + all[all.len() - 1]) / 2;
            let (low, high): (Vec<u32>, Vec<u32>) = all.into_iter().partition(|v| *v < half);
            [middle(low), middle(high)]
        };
        let [left, right] = ends((0..w).filter(|x| column(*x)).collect());
        let [top, bottom] = ends((0..h).filter(|y| row(*y)).collect());
        Self {
            pixels,
            frame: [left, right, top, bottom],
        }
    }

    /// Place and value of every pixel that has at least some of the series' blue.
    fn blue(&self) -> Vec<(f64, f64)> {
        let [left, right, top, bottom] = self.frame;
        let mut found = Vec::new();
        for y in 0..self.pixels.height() {
            for x in 0..self.pixels.width() {
                let p = self.pixels.pixel(x, y).unwrap();
                if i32::from(p.blue()) - i32::from(p.red()) > 40 {
                    let (px, py) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                    found.push((
                        100.0 * (px - left) / (right - left),
                        1.0 - 2.0 * (py - top) / (bottom - top),
                    ));
                }
            }
        }
        found
    }

    /// What a pixel is in place and value.
    fn pixel(&self) -> (f64, f64) {
        let [left, right, top, bottom] = self.frame;
        (100.0 / (right - left), 2.0 / (bottom - top))
    }
}

/// No ink beyond the lowest and highest value near it: half of a line 1.5 points wide is 1.5 pixels, and a pixel for
/// its soft edge. And ink where the data are: each extreme is reached.
fn ink_stays_within(points: &[(f64, f64)]) {
    let picture = Picture::new(&alone(Mark::Line, points.to_vec()));
    let (dx, dy) = picture.pixel();
    let (reach_x, reach_y) = (3.0 * dx, 2.6 * dy);
    let value_at = |x: f64| {
        let next = points.partition_point(|p| p.0 < x).clamp(1, points.len() - 1);
        let (a, b) = (points[next - 1], points[next]);
        a.1 + (b.1 - a.1) * ((x - a.0) / (b.0 - a.0)).clamp(0.0, 1.0)
    };
    let blue = picture.blue();
    assert!(blue.len() > 1000, "{} pixels of the line", blue.len());
    for &(x, y) in &blue {
        let first_beyond = |edge: f64| points.partition_point(|p| p.0 <= edge);
        let near = &points[first_beyond(x - reach_x)..first_beyond(x + reach_x)];
        let near = near
            .iter()
            .map(|p| p.1)
            .chain([x - reach_x, x, x + reach_x].map(value_at));
        let (low, high) = extent(near).unwrap();
        assert!(
            y > low - reach_y && y < high + reach_y,
            "ink at {x:.2}, {y:.3}, where the data lie between {low:.3} and {high:.3}"
        );
    }
    let (low, high) = extent(points.iter().map(|p| p.1)).unwrap();
    let (drawn_low, drawn_high) = extent(blue.iter().map(|p| p.1)).unwrap();
    assert!((drawn_low - low).abs() < reach_y && (drawn_high - high).abs() < reach_y);
}

#[test]
fn a_zigzag_has_no_ink_beyond_its_peaks() {
    // Sharper than any line is wide: mitred joins would reach far beyond.
    for period in [0.4, 1.0, 3.0] {
        let count = (100.0 / period) as i32;
        ink_stays_within(
            &(0..=count)
                .map(|i| (f64::from(i) * period, if i % 2 == 0 { 0.5 } else { -0.5 }))
                .collect::<Vec<_>>(),
        );
    }
}

#[test]
fn noise_has_no_ink_beyond_its_envelope() {
    // A full-period congruential generator (Numerical Recipes): noise that needs no crate.
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state) / f64::from(u32::MAX) - 0.5
    };
    let mut values: Vec<(f64, f64)> = (0..40_000)
        .map(|i| (f64::from(i) / 400.0, 0.8 * noise()))
        .collect();
    ink_stays_within(&values);
    // One peak among them is neither lost nor grown.
    values[20_123].1 = 0.9;
    ink_stays_within(&values);
    let sparse: Vec<_> = values.iter().copied().step_by(60).collect();
    ink_stays_within(&sparse);
}

#[test]
fn a_line_breaks_where_it_is_not_a_number() {
    let mut points: Vec<_> = (0..=100).map(|i| (f64::from(i), 0.3)).collect();
    for point in &mut points[40..=60] {
        point.1 = f64::NAN;
    }
    let picture = Picture::new(&alone(Mark::Line, points));
    let (dx, _) = picture.pixel();
    let within = |from: f64, to: f64| picture.blue().iter().filter(|p| p.0 > from && p.0 < to).count();
    assert_eq!(within(39.0 + 3.0 * dx, 61.0 - 3.0 * dx), 0);
    assert!(within(0.0, 39.0) > 500 && within(61.0, 100.0) > 500);
}

#[test]
fn stems_stand_where_the_values_are_and_nowhere_between() {
    let picture = Picture::new(&alone(Mark::Stems, vec![(20.0, 0.8), (50.0, -0.6), (80.0, 0.4)]));
    let blue = picture.blue();
    for (x, value) in [(20.0, 0.8_f64), (50.0, -0.6), (80.0, 0.4)] {
        let stem: Vec<_> = blue.iter().filter(|p| (p.0 - x).abs() < 2.0).collect();
        let (low, high) = extent(stem.iter().map(|p| p.1)).unwrap();
        // A dot of 2.2 points around the value, and a stem to zero.
        let reach = 6.0 * picture.pixel().1;
        assert!(
            (low - value.min(0.0)).abs() < reach && (high - value.max(0.0)).abs() < reach,
            "{low} {high}"
        );
    }
    let between = blue
        .iter()
        .filter(|p| [20.0, 50.0, 80.0].iter().all(|x| (p.0 - x).abs() > 2.0));
    assert_eq!(between.count(), 0);
}

#[test]
fn an_interval_is_shaded_between_its_ends_only() {
    let low: Vec<_> = (0..=10).map(|i| (10.0 * f64::from(i), -0.2)).collect();
    let picture = Picture::new(&alone(Mark::Interval(vec![0.6; 11]), low));
    let (drawn_low, drawn_high) = extent(picture.blue().iter().map(|p| p.1)).unwrap();
    let pixel = picture.pixel().1;
    assert!((drawn_low + 0.2).abs() < 2.0 * pixel && (drawn_high - 0.6).abs() < 2.0 * pixel);
}

#[test]
fn lines_that_coincide_are_both_seen() {
    let points: Vec<_> = (0..=100)
        .map(|i| (f64::from(i), 0.5 * (f64::from(i) / 9.0).sin()))
        .collect();
    let mut figure = alone(Mark::Line, points.clone());
    figure.panels[0]
        .series
        .insert(0, Series::line("reference", 0, points));
    let picture = Picture::new(&figure);
    let [left, right, top, bottom] = picture.frame;
    // At a quarter of the width a column of pixels shows black, blue and black again.
    let x = (left + 0.26 * (right - left)) as u32;
    let column = ((top + 8.0) as u32..(bottom - 8.0) as u32).map(|y| picture.pixels.pixel(x, y).unwrap());
    let (mut black, mut blue) = (0, 0);
    for p in column {
        black += usize::from(p.red() < 90 && p.green() < 90 && p.blue() < 90);
        blue += usize::from(i32::from(p.blue()) - i32::from(p.red()) > 100);
    }
    assert!(black >= 1 && blue >= 1, "{black} black and {blue} blue pixels");
}

#[test]
fn equal_figures_are_equal_files() {
    let figure = alone(Mark::Stems, vec![(20.0, 0.8)]);
    assert_eq!(figure.to_svg(), figure.to_svg());
    let svg = figure.to_svg().unwrap();
    assert_eq!(png(&svg), png(&svg));
}

/// The letters come from the built-in font alone: without one there would be none.
#[test]
fn the_png_is_twice_as_wide_as_the_page_and_holds_letters() {
    let mut figure = alone(Mark::Line, vec![(0.0, 0.0), (100.0, 0.5)]);
    let plain = raster::pixels(&figure.to_svg().unwrap()).unwrap();
    figure.x = Axis::new("Mwww \u{b1} \u{3b1}", "-").within(0.0, 100.0);
    let lettered = raster::pixels(&figure.to_svg().unwrap()).unwrap();
    assert_eq!(plain.width(), lettered.width());
    assert!((1800..1850).contains(&plain.width()), "{}", plain.width());
    let ink = |p: &Pixmap| p.pixels().iter().filter(|p| p.red() < 128).count();
    assert!(ink(&lettered) > ink(&plain) + 200);
}
