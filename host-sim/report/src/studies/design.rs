//! The answer to "which experiment": its table, its picture and its report.

use super::ended;
use crate::document::{Block, Cell, Report, Section, Table};
use crate::plot::{Axis, Figure, Panel, Series};
use haptic_analysis::identify::{INFORMED, TABLE_4};
use haptic_batch::Confidence;
use haptic_batch::design::{Confirmation, Design, DesignResult};

/// The document of the answer.
pub fn report(answer: &DesignResult) -> Report {
    let caption = "How long they have to drive, over the frequency of the probe.";
    let mut blocks = vec![
        Block::figure("design", figure(answer), caption),
        Block::Table(table(answer)),
    ];
    blocks.extend(sentences(answer).into_iter().map(Block::Text));
    let (parameter, error) = (&answer.parameter, answer.error);
    let summary = format!("Wanted: a standard error of {error} of {parameter}.");
    let sections = vec![Section::new("Designs", blocks)];
    Report::new(format!("Which experiment tells {parameter}"), summary, sections)
}

fn form(design: &Design) -> String {
    match design.frequencies_hz[..] {
        [] => "none".to_owned(),
        [f] => format!("sine of {f} Hz"),
        [f, g] => format!("half {f} Hz, half {g} Hz"),
        _ => "several".to_owned(),
    }
}

/// Every design, the best one marked.
fn table(answer: &DesignResult) -> Table {
    let row = |(i, d): (usize, &Design)| {
        let head = [
            ("", Cell::text(if answer.best == Some(i) { "best" } else { "" })),
            ("Course", Cell::text(&d.course)),
            ("Probe", Cell::Text(form(d))),
            ("N.m", Cell::number(d.amplitude_nm, 2)),
            ("Minutes needed", Cell::number(d.needed_s.map(|s| s / 60.0), 1)),
        ];
        let error = |(name, error)| (format!("error {name}"), Cell::number(error, 4));
        let errors = INFORMED.into_iter().zip(d.standard_errors).map(error);
        let head = head.into_iter().map(|(name, cell)| (name.to_owned(), cell));
        head.chain(errors)
    };
    let once = answer.designs.first().map_or(0.0, |d| d.span_s);
    Table::of_rows(
        format!(
            "Least standard errors after once over the course (the first: {once:.0} s), and how long {} takes to {}.",
            answer.parameter, answer.error
        ),
        answer.designs.iter().enumerate().map(row),
    )
}

/// The answer in words.
fn sentences(answer: &DesignResult) -> Vec<String> {
    let Some(best) = answer.best.map(|i| &answer.designs[i]) else {
        return vec![format!(
            "No design here tells {} to {} within two hours.",
            answer.parameter, answer.error
        )];
    };
    let needed_s = best.needed_s.unwrap_or_default();
    let probe = match best.frequencies_hz[..] {
        [] => "without a probe".to_owned(),
        _ => format!("with a probe of {} N.m ({})", best.amplitude_nm, form(best)),
    };
    let mut out = vec![format!(
        "{} to {}: drive {:.1} minutes on {} {probe}.",
        answer.parameter,
        answer.error,
        needed_s / 60.0,
        best.course
    )];
    out.extend(cost_of_delay(answer, best, needed_s));
    if best.left_by_itself > 0 {
        out.push(format!(
            "It rests on {} drives in which the ECU ended guidance by itself, and does not hold for guided driving.",
            best.left_by_itself
        ));
    }
    if let Some(c) = &answer.confirmation {
        out.push(format!(
            "Confirmed by {} simulated records of {:.0} s: predicted error {:.4}, RMS error {:.4}; {:.0} % of the {} % intervals \
             hold the truth.",
            c.fits,
            c.length_s,
            c.predicted,
            c.rms,
            100.0 * c.coverage,
            answer.level
        ));
        out.push(format!(
            "{} is identified in {}.",
            answer.parameter,
            named(c, answer.level)
        ));
        out.push(match &answer.for_most {
            Some(most) => format!(
                "For 95 % of the drives: {:.1} minutes, which identify it in {}.",
                most.length_s / 60.0,
                named(most, answer.level)
            ),
            None => "No length tried up to half an hour identifies it in 95 % of the drives.".into(),
        });
    }
    out
}

/// How many fits call the parameter identified.
fn named(c: &Confirmation, level: Confidence) -> String {
    let [low, high] = c.identified_share.map(|share| 100.0 * share);
    format!(
        "{} of {} of them ({low:.0} to {high:.0} %, {level} %)",
        c.identified, c.fits
    )
}

/// How little a drive that is long enough for another parameter tells of the delay; none if it tells enough.
fn cost_of_delay(answer: &DesignResult, best: &Design, needed_s: f64) -> Option<String> {
    // Its fourth parameter is t_p.
    let (_, low, high) = TABLE_4[3];
    let enough_s = 0.1 * (high - low);
    let place = INFORMED.iter().position(|name| *name == "t_p")?;
    let error_s = best.standard_errors[place] * (best.span_s / needed_s).sqrt();
    (answer.parameter != "t_p" && error_s > enough_s).then(|| {
        let minutes = needed_s / 60.0 * (error_s / enough_s).powi(2);
        format!(
            "That drive tells t_p to {error_s:.3} s only, of the {low} to {high} s that drivers have (table 4): for a tenth of \
             that range, {enough_s:.3} s, drive {minutes:.0} minutes."
        )
    })
}

/// Minutes over the frequency, a line for each amplitude, a panel for each course.
fn figure(answer: &DesignResult) -> Figure {
    let mut courses: Vec<&str> = answer.designs.iter().map(|d| d.course.as_str()).collect();
    courses.dedup();
    let minutes = |d: &Design| d.needed_s.map_or(f64::NAN, |s| s / 60.0);
    let all = answer.designs.iter().flat_map(|d| &d.frequencies_hz);
    let quickest_hz = all.copied().fold(0.0, f64::max);
    let panels = courses.into_iter().map(|course| {
        let here = || answer.designs.iter().filter(move |d| d.course == course);
        let with = |sines: usize, amplitude_nm: f64| {
            let same =
                here().filter(move |d| d.frequencies_hz.len() == sines && d.amplitude_nm == amplitude_nm);
            let middle = |d: &Design| d.frequencies_hz.iter().sum::<f64>() / sines as f64;
            same.map(|d| (middle(d), minutes(d))).collect::<Vec<_>>()
        };
        let mut amplitudes: Vec<f64> = here().map(|d| d.amplitude_nm).filter(|a| *a > 0.0).collect();
        amplitudes.sort_by(f64::total_cmp);
        amplitudes.dedup();
        let series = amplitudes.iter().enumerate().flat_map(|(i, &amplitude_nm)| {
            let one = with(1, amplitude_nm);
            let refused = one.last().is_some_and(|p| p.0 < quickest_hz);
            let line = Series::dots(&format!("{amplitude_nm} N.m"), i + 1, one).joined();
            let label = format!("{amplitude_nm} N.m, two sines, at their middle");
            let two = Series::dots(&label, i + 4, with(2, amplitude_nm));
            ended(line, refused.then_some("ends: quicker, the ECU refuses it")).chain([two])
        });
        let without = here().find(|d| d.amplitude_nm == 0.0);
        let without = without.map(|d| match d.needed_s {
            Some(s) => format!(", {:.1} min without a probe", s / 60.0),
            None => ", no drive is long enough without a probe".into(),
        });
        let title = format!("{course}{}", without.unwrap_or_default());
        Panel::new(title, Axis::new("Drive needed", "min"), series)
    });
    Axis::new("Frequency of the probe", "Hz").figure(panels)
}
