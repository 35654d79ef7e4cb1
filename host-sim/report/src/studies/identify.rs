//! What one identification shows: measured and simulated torque (as the paper's figure 6), the residuals, the driver over time,
//! the parameters and what they rest on.
//!
//! Above 500 lines because it is one report: split, a reader could not see whether a verdict stands in its table, its
//! sentence and its figure alike.

use super::{pieces, place};
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Band, Figure, Mark, Panel, Series, Shade};
use haptic_analysis::identify::{
    Combination, History, Identification, InputCorrelation, LeftOut, Parameter, Reason, Refutation, Torques,
    autocorrelation,
};
use haptic_batch::Confidence;
use haptic_batch::identify::IdentifiedDrive;

/// Lags of the autocorrelation drawn.
const LAGS: usize = 60;

/// Highest value of the delay's profile that is drawn, at least: so that the level of 95 %, 3.84, is seen well above the axis.
const HIGHEST: f64 = 15.0;

/// What a line or an area breaks at: a place between rows that are no neighbours, from whose values nothing is drawn.
fn broken<T: Copy>(x: &[f64], y: &[T], nothing: T) -> (Vec<f64>, Vec<T>) {
    let step = x.get(1).map_or(0.0, |second| 1.5 * (second - x[0]));
    let (mut places, mut values) = (Vec::with_capacity(x.len()), Vec::with_capacity(x.len()));
    for (k, (&at, &value)) in x.iter().zip(y).enumerate() {
        if k > 0 && at - x[k - 1] > step {
            places.push(0.5 * (at + x[k - 1]));
            values.push(nothing);
        }
        places.push(at);
        values.push(value);
    }
    (places, values)
}

/// A line that is broken where the rows are.
fn broken_line(label: &str, style: usize, x: &[f64], y: &[f64]) -> Series {
    let (x, y) = broken(x, y, f64::NAN);
    Series::through(label, style, &x, &y)
}

/// Minus twice the log likelihood over t_p for the arm as assumed, up to where it no longer matters, with the level of the intervals,
/// and those for that arm and for any; none if t_p was given.
fn delay_profile(found: &Identification, level: Confidence) -> Option<Figure> {
    let (profile, deviations) = (&found.delay_profile, level.normal());
    let chi_squared = deviations.powi(2);
    let highest = HIGHEST.max(1.2 * chi_squared);
    let mut x = Vec::new();
    let mut y = Vec::new();
    for (k, &[t_p, d]) in profile.iter().enumerate() {
        // Where the line leaves the picture, and where it comes back.
        if let Some([before, was]) = k.checked_sub(1).map(|k| profile[k])
            && (was > highest) != (d > highest)
        {
            x.push(before + (t_p - before) * (highest - was) / (d - was));
            y.push(highest);
        }
        x.push(t_p);
        y.push(if d > highest { f64::NAN } else { d });
    }
    let ends = [*x.first()?, *x.last()?];
    let mut series = Vec::new();
    let assumed = found.at_t_nms.as_ref();
    let narrow = assumed.and_then(|a| a.interval("t_p", deviations));
    let any = match assumed {
        Some(_) => format!("{level} % interval, t_nms not known"),
        None => format!("{level} % interval"),
    };
    if let Some(interval) = found.parameters.t_p.interval(deviations) {
        series.push(Series::interval(&any, 5, &interval, &[[0.0, highest]; 2]));
    }
    if let Some([low, high]) = narrow {
        let (x, y) = (
            [low, low, low, high, high],
            [0.0, highest, f64::NAN, 0.0, highest],
        );
        let label = format!("{level} % interval, t_nms as assumed");
        series.push(Series::through(&label, 2, &x, &y));
    }
    let profile = match assumed {
        Some(_) => "profile, t_nms as assumed",
        None => "profile",
    };
    series.push(Series::through(profile, 0, &x, &y));
    let label = format!("level of {level} %");
    series.push(Series::through(&label, 1, &ends, &[chi_squared; 2]));
    let y = Axis::new("-2 log L above optimum", "-").within(0.0, highest);
    Some(Axis::new("t_p", "s").figure([y.panel(series)]))
}

/// Every parameter's interval as a share of its estimate, and beside it the narrower one for t_nms as assumed; none if there
/// are no intervals.
fn intervals(found: &Identification, level: Confidence) -> Option<Figure> {
    let known = |(name, _, p): (&'static str, _, &Parameter)| {
        let at = p.optimum.filter(|&at| !p.fixed && at.abs() > 1e-9)?;
        Some((name, at, p.interval(level.normal())?))
    };
    let list: Vec<_> = found.parameters.list().into_iter().filter_map(known).collect();
    if list.is_empty() {
        return None;
    }
    let share =
        |i: usize, aside: f64, at: f64, ends: [f64; 2]| ((place(i) + aside, 1.0), ends.map(|x| x / at));
    let listed = list.iter().enumerate();
    let wide = listed
        .clone()
        .map(|(i, &(_, at, interval))| share(i, -0.12, at, interval));
    let narrow = listed.filter_map(|(i, &(name, at, _))| {
        let assumed = found.at_t_nms.as_ref()?.interval(name, level.normal())?;
        Some(share(i, 0.12, at, assumed))
    });
    let label = match is_published(found) {
        true => "interval as published".into(),
        false => format!("{level} % interval"),
    };
    let narrow = Series::whiskers("if t_nms is as assumed", 1, narrow);
    let series = [Series::whiskers(&label, 0, wide), narrow];
    let series = series.into_iter().filter(|series| !series.points.is_empty());
    let panel = Axis::new("Share of the estimate", "-").panel(series);
    Some(Figure::of_rows(list.iter().map(|l| l.0), [panel]))
}

fn over_time(found: &Identification, panels: impl IntoIterator<Item = Panel>) -> Figure {
    Figure {
        bands: left_out_bands(found),
        ..Axis::new("Time", "s").figure(panels)
    }
}

fn torque(found: &Identification) -> Figure {
    let t = &found.traces;
    let mut series = vec![
        broken_line("measured", 0, &t.time_s, &t.measured_nm),
        broken_line("simulated", 3, &t.time_s, &t.simulated_nm),
    ];
    // Whoever reads it can see for themselves whether it was right to leave it out.
    if !left_out_bands(found).is_empty() {
        series.push(broken_line("measured, left out", 4, &t.unused_s, &t.unused_nm));
    }
    over_time(found, [Axis::new("Driver torque", "N.m").panel(series)])
}

/// What was left out, and why.
fn left_out_bands(found: &Identification) -> Vec<Band> {
    let left_out = found.preflight.iter().flat_map(|p| &p.left_out);
    let band = |l: &LeftOut| {
        let is_asked = l.reason == Reason::Asked;
        let shade = if is_asked { Shade::Light } else { Shade::Dark };
        Band::new(format!("left out: {}", l.reason), [l.from_s, l.to_s], shade)
    };
    left_out.map(band).collect()
}

fn residuals(found: &Identification) -> Figure {
    let t = &found.traces;
    let both = t.measured_nm.iter().zip(&t.simulated_nm);
    let unexplained: Vec<f64> = both.map(|(y, m)| y - m).collect();
    let panel = |what: &str, y: &[f64]| Axis::new(what, "N.m").panel([broken_line("", 1, &t.time_s, y)]);
    let panels = [
        panel("Measured - simulated", &unexplained),
        panel("Residual of the loss", &t.residual_nm),
    ];
    over_time(found, panels)
}

fn correlogram(found: &Identification, level: Confidence) -> Figure {
    let r = autocorrelation(&found.traces.residual_nm, LAGS);
    // Two decimals of the quantile, as tables have it: a picture shows no more.
    let bound = (100.0 * level.normal()).round() / 100.0 / (found.rows as f64).sqrt();
    let last = r.len() as f64;
    let stems = (1..=r.len()).map(|k| k as f64).zip(r).collect();
    let series = vec![
        Series::interval(
            &format!("{level} % if white"),
            5,
            &[0.5, last + 0.5],
            &[[-bound, bound]; 2],
        ),
        Series::with_mark("", 0, Mark::Stems, stems),
    ];
    let panel = Axis::new("Autocorrelation", "-").panel(series);
    Axis::counting("Lag (samples)").figure([panel])
}

/// Each panel is thinned before the next is made: of hours all of them at once would be the largest thing in memory.
fn followed(drive: &IdentifiedDrive) -> Figure {
    let t = &drive.tracking;
    let found = &drive.results.identification;
    let panel = |(name, unit, h): (&str, &str, &History)| {
        let both = h.estimate.iter().zip(&h.standard_deviation);
        let ends: Vec<[f64; 2]> = both.map(|(e, s)| [e - 2.0 * s, e + 2.0 * s]).collect();
        let (x, ends) = broken(&t.time_s, &ends, [f64::NAN; 2]);
        let panel = Axis::new(name, unit).panel([
            Series::interval("two standard deviations", 5, &x, &ends),
            broken_line("estimate", 1, &t.time_s, &h.estimate),
        ]);
        over_time(found, [panel]).thinned().panels
    };
    let panels = [
        ("K_hg", "-", &t.k_hg),
        ("gain_1", "N.m/m", &t.gain[0]),
        ("gain_2", "N.m/(m.s)", &t.gain[1]),
        ("gain_3", "N.m/rad", &t.gain[2]),
        ("t_p", "s", &t.t_p),
    ];
    over_time(found, panels.into_iter().flat_map(panel))
}

/// What is known of the driver, and what it rests on.
fn verdict_blocks(found: &Identification, level: Confidence) -> Vec<Block> {
    let sentences = refutations(found)
        .into_iter()
        .chain(verdicts(found, level))
        .chain(own_line(found, level));
    let mut verdict: Vec<Block> = sentences.map(Block::Text).collect();
    verdict.push(Block::Table(parameters(found, level)));
    let beside = match is_published(found) {
        true => format!(
            "The intervals as the published method has them: {level} % only where its residuals do not refute them."
        ),
        false => {
            format!(
                "The {level} % intervals, and what they would be if K_nms and t_nms were what is assumed."
            )
        }
    };
    let valley = match found.at_t_nms {
        Some(_) => {
            "Likelihood of the delay with all else at its best, the arm as assumed: one narrow valley, or the delay is not known. The \
             wider interval holds for every arm, and for what the residuals leave open."
        }
        None => {
            "Likelihood of the delay with all else at its best: one narrow valley, or the delay is not known."
        }
    };
    verdict.extend(intervals(found, level).map(|f| Block::figure("intervals", f, beside)));
    verdict.extend(delay_profile(found, level).map(|f| Block::figure("delay_profile", f, valley)));
    if !found.assumed.is_empty() {
        let assumed = found.assumed.join("; ");
        let text = format!("Assumed, for the log cannot show it: {assumed}.");
        verdict.push(Block::Text(text));
    }
    verdict.extend(found.notes.iter().cloned().map(Block::Text));
    verdict.push(Block::Table(combinations(found)));
    verdict.push(Block::Table(correlation(found)));
    verdict
}

/// The document of an identification.
pub fn report(drive: &IdentifiedDrive) -> Report {
    let found = &drive.results.identification;
    let fitted =
        "Driver torque, measured and simulated from the inputs alone. Shaded: what was left out, and why.";
    let fit = vec![
        Block::figure("torque", torque(found), fitted),
        Block::Table(Table::of_pairs(["", ""], facts(found))),
    ];
    let made_of = "What the driver model leaves over, and what the loss is made of.";
    let correlated = "Autocorrelation of the residuals of the loss.";
    let left_over = vec![
        Block::figure("residuals", residuals(found), made_of),
        Block::figure(
            "autocorrelation",
            correlogram(found, drive.results.level),
            correlated,
        ),
        Block::Table(input_tests(found)),
    ];
    let by_filter = "The same drive followed by the constrained Kalman filter, for drivers who change.";
    let followed = Block::figure("over_time", followed(drive), by_filter);
    let in_pieces = drive.results.pieces.as_ref().zip(pieces::figure(drive));
    let in_pieces = in_pieces.map(|(pieces, figure)| {
        let figure = Block::figure("pieces", figure, pieces::caption(drive.results.level));
        let tables = pieces::tables(pieces, drive.results.level)
            .into_iter()
            .map(Block::Table);
        Section::new("Pieces", [figure].into_iter().chain(tables).collect())
    });
    let in_the_log = in_the_log(found).map(|found| Section::of_table("In the log", found));
    let again =
        drives_again(drive).map(|again| Section::of_table("The identified driver on the course", again));
    let always = [
        Section::new("Parameters", verdict_blocks(found, drive.results.level)),
        Section::new("Fit", fit),
        Section::new("Residuals", left_over),
        Section::new("Over time", vec![followed]),
    ];
    let first = in_pieces.into_iter().chain(in_the_log);
    let (method, rows, fit) = (found.method, found.rows, found.fit_percent);
    let summary = format!("Method {method}, {rows} rows. The fit of the driver torque is {fit:.1} %.");
    let sections = first.chain(always).chain(again).collect();
    Report::new(format!("Driver of {}", drive.name), summary, sections)
}

/// What was found in the log and done about it.
fn in_the_log(found: &Identification) -> Option<Table> {
    Some(Table::of_texts(
        "What was found in the log, and what was done about it.",
        ["In the log", "Found", "Done"],
        found.preflight.as_ref()?.findings(),
    ))
}

/// What the record refutes, a sentence each.
fn refutations(found: &Identification) -> Vec<String> {
    let sentence = |r: &Refutation| {
        format!(
            "Refuted: {}. Evidence: {}. Likeliest cause: {}. Cure: {}.",
            r.assumption, r.evidence, r.cause, r.cure
        )
    };
    found.refuted.iter().map(sentence).collect()
}

/// What is known of each parameter that a torque can tell, in words.
fn verdicts(found: &Identification, level: Confidence) -> Vec<String> {
    let meaning = |name: &str| match name {
        "gain_1" => "torque per lateral error",
        "gain_2" => "torque per integral of the lateral error",
        "gain_3" => "torque per yaw error",
        "t_p" => "the driver's delay",
        _ => "how much the driver resists the guidance (0 gives way, 1 resists)",
    };
    let told = ["gain_1", "gain_2", "gain_3", "t_p", "k_hg"];
    let list = found.parameters.list().into_iter();
    let list = list.filter(|l| told.contains(&l.0));
    list.filter_map(|(name, unit, p)| {
        let unit = match unit {
            "-" => String::new(),
            unit => format!(" {unit}"),
        };
        let what = meaning(name);
        if p.fixed {
            return Some(format!("{name}, {what}, was given: {:.4}{unit}.", p.estimate?));
        }
        let within = p
            .interval(level.normal())
            .map(|[low, high]| format!("between {low:.4} and {high:.4}{unit} ({level} %)"));
        Some(match (p.estimate, within) {
            (Some(x), Some(within)) => format!("{name}, {what}, is {x:.4}{unit}: {within}."),
            (None, Some(_)) if is_refuted_as_published(found) => {
                format!(
                    "{name}, {what}, comes out as {:.4}{unit}; the residuals refute it.",
                    p.optimum?
                )
            }
            (None, Some(within)) if p.identified => {
                format!("{name}, {what}, lies on a bound of the search, which is no value: {within}.")
            }
            (_, Some(within)) => {
                format!("{name}, {what}, is not identified: {within}, which is too wide to name a value.")
            }
            (_, None) if p.optimum.is_none() => return None,
            (_, None) if !found.refuted.is_empty() => {
                format!("{name}, {what}, is not known: the model is refuted.")
            }
            _ => format!("{name}, {what}, is not known: the record does not bound it."),
        })
    })
    .collect()
}

/// The line that the driver takes, in words; nothing where the model is refuted.
fn own_line(found: &Identification, level: Confidence) -> Option<String> {
    let line = found.line.filter(|_| found.refuted.is_empty())?;
    let place = |p: &Parameter| {
        let [low, high] = p.interval(level.normal())?;
        let side = |x: f64| format!("{:.3} m {}", x.abs(), if x < 0.0 { "right" } else { "left" });
        Some(match p.estimate {
            Some(x) => format!(
                "{} of the target line ({low:.3} to {high:.3} m, {level} %)",
                side(x)
            ),
            None => format!(
                "anywhere between {} and {} of it ({level} %)",
                side(low),
                side(high)
            ),
        })
    };
    let added = match line.bend.estimate {
        Some(x) if x > 0.0 => "inside it in bends",
        Some(_) => "outside it in bends",
        None => "in bends",
    };
    Some(format!(
        "The driver's line is {} on a straight road, and {added}: {} more in a left bend of 300 m at 60 km/h, in proportion to v/R in \
         others. A camera whose e_y is off by as much looks the same.",
        place(&line.offset)?,
        place(&line.bend)?
    ))
}

/// Whether the residuals of the published method are not what it takes them for: white, and independent of the inputs.
fn is_refuted_as_published(found: &Identification) -> bool {
    let depend = found.input_correlation.iter().any(|input| !input.independent);
    is_published(found) && (depend || !found.whiteness.white)
}

/// What a value of the published method is worth.
fn published_verdict(found: &Identification, p: &Parameter) -> &'static str {
    match (p.optimum, is_refuted_as_published(found), p.on_bound) {
        (None, ..) => "no part of the method",
        (_, true, true) => "as published, on a bound, refuted",
        (_, true, false) => "as published, refuted",
        (_, false, true) => "as published, on a bound",
        (_, false, false) if p.identified => "as published",
        (_, false, false) => "as published, imprecise",
    }
}

/// Whether the values are those of the published method.
fn is_published(found: &Identification) -> bool {
    found.method == "paper"
}

/// How the identified driver drives a course, if asked.
fn drives_again(drive: &IdentifiedDrive) -> Option<Table> {
    let again = drive.results.drives_again.as_ref()?;
    let left_road = if again.diverged { "yes" } else { "no" };
    let row = |name: &str, cell| vec![Cell::text(name), cell];
    let left = again.away.when_and_why();
    let left = left.map(|left| row("guidance ended", Cell::Text(left)));
    let metrics = &again.metrics;
    let rows = [
        row("peak lateral error (m)", number(metrics.peak_lateral_error_m)),
        row(
            "mean absolute lateral error (m)",
            number(metrics.mean_abs_lateral_error_m),
        ),
        row("left the road", Cell::text(left_road)),
    ];
    Some(Table::new(
        "The identified driver on the course.",
        ["", ""],
        rows.into_iter().chain(left),
    ))
}

fn number(value: impl Into<Option<f64>>) -> Cell {
    Cell::number(value, 4)
}

/// Every parameter with its interval and verdict.
fn parameters(found: &Identification, level: Confidence) -> Table {
    let narrow = |name: &str| {
        let at = found.at_t_nms.as_ref().filter(|_| found.refuted.is_empty())?;
        at.interval(name, level.normal())
    };
    let published = is_published(found);
    let caption = match published {
        true => {
            "The values, errors and intervals of the published method as it prints them, whether the record holds them or not."
        }
        false => "An estimate is given only where the data identify the parameter.",
    };
    let from = if published {
        "As published: from".into()
    } else {
        format!("{level} % from")
    };
    let unit_of = |name: &str| match name {
        "k_nms" => "N.m/rad",
        "wheel_inertia" => "kg.m2",
        _ => "s",
    };
    let line = found.line.as_ref().filter(|_| found.refuted.is_empty());
    let line = line.map(|line| [("line_offset", "m", &line.offset), ("line_bend", "m", &line.bend)]);
    let beyond = found.beyond.iter().map(|(name, p)| (*name, unit_of(name), p));
    let row = |(name, unit, p): (&'static str, &'static str, &Parameter)| {
        let verdict = match (p.fixed, p.identified, p.on_bound) {
            (true, ..) => "given",
            _ if published => published_verdict(found, p),
            (_, true, true) => "identified, on a bound",
            (_, true, false) if found.torques == Some(Torques::AsRecorded) => {
                "identified, if torques are right"
            }
            (_, true, false) => "identified",
            (_, false, true) => "not identified, on a bound",
            (_, false, false) => "not identified",
        };
        let estimate = if published { p.optimum } else { p.estimate };
        let [low, high] = Cell::ends(p.interval(level.normal()), 4);
        let [narrow_low, narrow_high] = Cell::ends(narrow(name), 4);
        [
            ("", Cell::text(name)),
            ("Unit", Cell::text(unit)),
            ("Verdict", Cell::text(verdict)),
            ("Estimate", number(estimate)),
            ("Standard error", number(p.standard_error)),
            (&*from, low),
            ("to", high),
            ("Arm known: from", narrow_low),
            ("to", narrow_high),
        ]
    };
    let all = found
        .parameters
        .list()
        .into_iter()
        .chain(line.into_iter().flatten())
        .chain(beyond);
    Table::of_rows(caption, all.map(row))
}

/// What the data determine where they do not determine each parameter.
fn combinations(found: &Identification) -> Table {
    let row = |c: &Combination| {
        [
            ("Combination", Cell::text(&c.name)),
            ("Estimate", number(c.estimate)),
            ("Standard error", number(c.standard_error)),
        ]
    };
    let caption = "What the data determine instead.";
    Table::of_rows(caption, found.combinations.iter().map(row))
}

/// Correlation of the errors.
fn correlation(found: &Identification) -> Table {
    let names = &found.correlation.names;
    let row = |(name, values): (&&str, &Vec<Option<f64>>)| {
        let mut cells = vec![Cell::Text((*name).into())];
        cells.extend(values.iter().map(|&value| Cell::number(value, 3)));
        cells
    };
    Table::new(
        "Correlation of the errors.",
        std::iter::once("").chain(names.iter().copied()),
        names.iter().zip(&found.correlation.matrix).map(row),
    )
}

/// What else is known of the fit, name and value.
fn facts(found: &Identification) -> Vec<(String, String)> {
    let mut facts = Vec::new();
    let mut add = |name: &str, text: String| facts.push((name.into(), text));
    add("Fit of the torque", format!("{:.2} %", found.fit_percent));
    if let Some(fit) = found.fit_percent_predicted {
        add("Fit of the one-step prediction", format!("{fit:.2} %"));
    }
    if let Some(fit) = found.fit_percent_wheel_angle {
        add("Fit of phi_target to the wheel angle", format!("{fit:.2} %"));
    }
    if let Some(r) = found.remnant {
        if let (Some(corner), Some(sd)) = (r.corner_hz, r.sd_nm) {
            add("Remnant", format!("{sd:.4} N.m, corner {corner:.3} Hz"));
        }
        add("White sensor noise", format!("{:.4} N.m", r.white_sd_nm));
        add("Prediction error", format!("{:.4} N.m", r.innovation_sd_nm));
    }
    let w = found.whiteness;
    let white = if w.white { "white" } else { "not white" };
    let (statistic, lags, p) = (w.statistic, w.lags, w.p_value);
    add(
        "Residuals",
        format!("{white}: Ljung-Box {statistic:.1} over {lags} lags, p = {p:.3}"),
    );
    for start in &found.starts {
        let (from_s, to_s, loss) = (start.from_t_p_s, start.to_t_p_s, start.loss);
        add(
            "Start",
            format!("t_p {from_s:.3} s, ended at {to_s:.4} s with loss {loss:.6e}"),
        );
    }
    let losses: Vec<String> = found.loss_history.iter().map(|l| format!("{l:.6e}")).collect();
    add("Loss", losses.join(", "));
    add("Ended", found.termination.to_string());
    facts
}

/// Whether the residuals are free of the inputs.
fn input_tests(found: &Identification) -> Table {
    let row = |test: &InputCorrelation| {
        let verdict = if test.independent {
            "independent"
        } else {
            "correlated"
        };
        [
            ("Input", Cell::text(test.input)),
            ("Largest", Cell::number(test.largest_z, 2)),
            ("Verdict", Cell::text(verdict)),
        ]
    };
    let caption = "Residuals against each input of 0 to 1 s before, in standard deviations.";
    Table::of_rows(caption, found.input_correlation.iter().map(row))
}
