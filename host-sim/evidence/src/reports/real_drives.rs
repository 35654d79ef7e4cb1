//! Recordings of real people: what was read and refused, and who predicts the driver's torque best.

mod hands;
mod pooled;

use haptic_evidence::real_drives::{Found, Half, RealDrive, RealDrives, Source};
use haptic_report::document::{Block, Cell, Report, Section, Table};
use haptic_report::plot::{Axis, Figure, Panel, Series};

/// Parameters that a torque record can carry.
const PARAMETERS: [&str; 5] = ["gain_1", "gain_2", "gain_3", "t_p", "k_hg"];

/// The document of recordings.
pub(crate) fn report(found: &RealDrives) -> Report {
    let hands = found.hands.as_ref().map(hands::section);
    let caption = "Every half that was predicted, the best first: the variance of T_d that a driver, or a regression, fitted to the \
                   other half of its drive accounts for. What is below -1 lies at -1: it is worse than that.";
    let each = vec![
        Block::figure("predictions", predictions(found), caption),
        Block::Table(drives(found)),
        Block::Table(refused(found)),
        Block::Table(read(found)),
    ];
    let sections = [
        ("Summary", summary(found)),
        (
            "The segments of a vehicle together",
            pooled::section(&found.pooled),
        ),
        ("Hands and override", hands.unwrap_or_default()),
        ("Drives", each),
        ("Sources", vec![Block::Table(sources(found))]),
    ];
    let sections = sections.into_iter().filter(|(_, blocks)| !blocks.is_empty());
    let sections = sections.map(|(heading, blocks)| Section::new(heading, blocks));
    let title = format!("{} recordings of real people", files(found, |_| true));
    let summary = "A driver is fitted to one half of each drive and judged on the other. VAF is the variance accounted for: 1 is \
                   all, 0 is what the mean does.";
    Report::new(title, summary, sections.collect())
}

fn judged(found: &RealDrives) -> impl Iterator<Item = (&RealDrive, &Found)> {
    found.drives.iter().filter_map(|d| Some((d, d.found.as_ref()?)))
}

/// How many files have a part of this kind.
fn files(found: &RealDrives, of: impl Fn(&RealDrive) -> bool) -> usize {
    let drives = found.drives.iter().filter(|d| of(d));
    let mut names: Vec<&str> = drives.map(|d| d.file.as_str()).collect();
    names.dedup();
    names.len()
}

fn driving(by_hand: bool) -> &'static str {
    if by_hand { "by hand" } else { "shared" }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let middle = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
    let n = values.len();
    0.5 * (middle(n / 2) + middle(n.saturating_sub(1) / 2))
}

/// The 95 % interval of a median, by its ranks: the sign test's. The values of a drive count once, for they are no independent
/// draws. None of fewer than six drives.
fn interval(mut values: Vec<f64>, of_a_drive: usize) -> Option<[f64; 2]> {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let drives = values.len() / of_a_drive;
    // The chance that fewer than `rank` of the drives lie below the median.
    let (mut below, mut chance, mut rank) = (0.0, 0.5_f64.powi(drives as i32), 0);
    while below + chance <= 0.025 && rank < drives {
        below += chance;
        chance *= (drives - rank) as f64 / (rank + 1) as f64;
        rank += 1;
    }
    let first = of_a_drive * rank.checked_sub(1)?;
    Some([values[first], values[values.len() - 1 - first]])
}

fn with_interval(values: Vec<f64>, of_a_drive: usize) -> Cell {
    // A prediction that is ten times as far off as none is nonsense; its size says nothing more.
    let text = |v: f64| match v < -10.0 {
        true => "below -10".into(),
        false => format!("{v:.2}"),
    };
    let within = interval(values.clone(), of_a_drive);
    let within = within.map(|[low, high]| format!(" ({} to {})", text(low), text(high)));
    let median = median(values);
    if median.is_nan() {
        return Cell::text("-");
    }
    Cell::Text(format!("{median:.2}{}", within.unwrap_or_default()))
}

fn summary(found: &RealDrives) -> Vec<Block> {
    let half = |by_hand: Option<bool>, accepted: bool| -> Vec<Half> {
        judged(found)
            .filter(|(d, _)| by_hand.is_none_or(|b| b == d.by_hand))
            .flat_map(|(_, f)| f.halves.iter().copied())
            .filter(|h| h.accepted || !accepted)
            .collect()
    };
    let row = |(name, by_hand, accepted)| {
        let halves = half(by_hand, accepted);
        let of = |value: fn(&Half) -> f64| with_interval(halves.iter().map(value).collect(), 2);
        let wins = halves.iter().filter(|h| h.ours > h.linear).count();
        [
            ("Halves", Cell::text(name)),
            ("Number", Cell::count(halves.len())),
            ("Ours, fitted half", of(|h| h.own)),
            ("Ours, other half", of(|h| h.ours)),
            ("Two-point, other half", of(|h| h.two_point)),
            ("Linear, other half", of(|h| h.linear)),
            ("Ours less linear", of(|h| h.ours - h.linear)),
            ("Ours is better in", Cell::count(wins)),
        ]
    };
    let models = Table::of_rows(
        "Medians of the variance accounted for, with 95 % intervals of six drives or more. Accepted: nothing is refuted on the half \
         that was fitted. Two-point: our driver without a delay. The linear regression is that of T_d on wheel angle, its rate and \
         acceleration, e_y, its rate and T_h.",
        [
            ("by hand", Some(true), false),
            ("by hand, accepted", Some(true), true),
            ("shared", Some(false), false),
            ("shared, accepted", Some(false), true),
            ("all accepted", None, true),
        ]
        .map(row),
    );
    let seconds = |of: &dyn Fn(&RealDrive, &Found) -> bool| -> f64 {
        judged(found)
            .filter(|(d, f)| of(d, f))
            .map(|(_, f)| f.used_s)
            .sum()
    };
    let share = |name: &str| {
        let asked = |d: &RealDrive| name != "k_hg" || !d.by_hand;
        let identified = seconds(&|d, f| asked(d) && f.identified.contains(&name));
        let all = seconds(&|d, _| asked(d));
        [
            ("Parameter", Cell::text(name)),
            ("Identified, s", Cell::number(identified, 0)),
            ("Of, s", Cell::number(all, 0)),
            ("Share", Cell::number(identified / all, 2)),
        ]
    };
    let caption = "Driving time in which a parameter is identified. K_hg is asked of shared driving.";
    let shares = Table::of_rows(caption, PARAMETERS.map(share));
    let chance = judged(found).filter_map(|(_, f)| f.k_hg_p);
    let (beats, shifts) = chance.fold((0, 0), |(beats, n), p| (beats + usize::from(p <= 0.05), n + 1));
    let text = format!(
        "{} of {} recordings have a drive that is fitted; the others are refused, with their causes below. K_hg beats 95 % of the \
         circular shifts of the guidance torque in {beats} of {shifts} shared drives.",
        files(found, |d| d.found.is_some()),
        files(found, |_| true),
    );
    vec![Block::Text(text), Block::Table(models), Block::Table(shares)]
}

/// What each predicts of the other half, sorted: who lies higher predicts more, wherever it is on the line.
fn predictions(found: &RealDrives) -> Figure {
    let panel = |by_hand: bool| {
        let sorted = |label: &str, style, value: fn(&Half) -> f64| {
            let drives = judged(found).filter(|(d, _)| d.by_hand == by_hand);
            let mut values: Vec<f64> = drives.flat_map(|(_, f)| f.halves.iter().map(value)).collect();
            values.retain(|v| !v.is_nan());
            values.sort_by(|a, b| b.total_cmp(a));
            let count = values.len() as f64;
            let point = |(k, v): (usize, &f64)| (100.0 * (k as f64 + 0.5) / count, v.max(-1.0));
            Series::line(label, style, values.iter().enumerate().map(point).collect())
        };
        let series = [
            sorted("ours", 1, |h| h.ours),
            sorted("two-point", 2, |h| h.two_point),
            sorted("linear", 3, |h| h.linear),
        ];
        let y = Axis::new("variance accounted for", "-").within(-1.05, 1.0);
        Panel::new(driving(by_hand), y, series)
    };
    Figure {
        same_y: true,
        ..Axis::new("halves, best first", "%").figure([true, false].map(panel))
    }
}

fn drives(found: &RealDrives) -> Table {
    let row = |(drive, f): (&RealDrive, &Found)| {
        let k_hg = f.k_hg.as_ref().filter(|p| p.identified);
        let [low, high] = Cell::ends(k_hg.and_then(|p| p.interval_95), 2);
        let vaf = |half: usize, value: fn(&Half) -> f64| Cell::number(f.halves.get(half).map(value), 2);
        [
            ("Recording", Cell::text(&drive.file)),
            ("Driving", Cell::text(driving(drive.by_hand))),
            ("Used, s", Cell::number(f.used_s, 1)),
            ("1: own", vaf(0, |h| h.own)),
            ("other", vaf(0, |h| h.ours)),
            ("linear", vaf(0, |h| h.linear)),
            ("2: own", vaf(1, |h| h.own)),
            ("other", vaf(1, |h| h.ours)),
            ("linear", vaf(1, |h| h.linear)),
            ("Residual, N.m", Cell::number(f.residual_nm, 3)),
            ("K_hg", Cell::number(k_hg.and_then(|p| p.estimate), 2)),
            ("95 % from", low),
            ("to", high),
            ("p", Cell::number(f.k_hg_p, 2)),
            ("Identified", Cell::text(f.identified.join(" "))),
            ("Refuted", Cell::text(f.refuted.join("; "))),
        ]
    };
    Table::of_rows(
        "VAF of our driver on the half that was fitted and on the other, and of the linear regression on the other: fitted to the \
         first half, then to the second. A K_hg is shown where it is identified; p is the share of circular shifts with as large a K_hg.",
        judged(found).map(row),
    )
}

fn refused(found: &RealDrives) -> Table {
    let row = |drive: &RealDrive| {
        let cells = [&drive.file, driving(drive.by_hand), drive.refused.as_ref()?].map(Cell::text);
        Some(["Recording", "Driving", "Cause"].into_iter().zip(cells))
    };
    Table::of_rows("Refused.", found.drives.iter().filter_map(row))
}

/// What reading found in each file; what is so by hand and shared stands there once.
fn read(found: &RealDrives) -> Table {
    let mut rows: Vec<[&str; 4]> = Vec::new();
    for drive in &found.drives {
        let findings = drive
            .reading
            .iter()
            .map(|finding| finding.each_ref().map(String::as_str));
        let notes = drive.notes.iter().map(|note| ["", note.as_str(), ""]);
        for [what, found, done] in findings.chain(notes) {
            let row = [drive.file.as_str(), what, found, done];
            if !rows.contains(&row) {
                rows.push(row);
            }
        }
    }
    let headings = ["Recording", "What", "Found", "Done"];
    let rows = rows
        .into_iter()
        .map(|row| headings.into_iter().zip(row.map(Cell::text)));
    Table::of_rows(
        "In the recordings: what was left out, converted, computed or mended.",
        rows,
    )
}

fn sources(found: &RealDrives) -> Table {
    let row = |s: &Source| {
        let commit = s.commit.as_deref().unwrap_or("none: untested");
        let cells = [&s.layout, &s.source, commit, &s.licence].map(Cell::text);
        ["Layout", "Source", "Tried on commit", "Licence"]
            .into_iter()
            .zip(cells)
    };
    Table::of_rows("", found.sources.iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sign test takes of 20 drives the 6th from either end (Conover, table A3: P(X <= 5) = 0.0207); of 6 the first, of 5 none.
    #[test]
    fn the_interval_of_a_median_has_the_ranks_of_the_sign_test() {
        let drives = |n: u32| (0..n).flat_map(|k| [f64::from(k); 2]).collect::<Vec<_>>();
        assert_eq!(interval(drives(20), 2), Some([5.0, 14.0]));
        assert_eq!(interval(drives(6), 2), Some([0.0, 5.0]));
        assert_eq!(interval(drives(5), 2), None);
    }
}
