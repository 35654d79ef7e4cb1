//! `host-sim handover`.

use clap::Args;
use haptic_batch::handover::{ROWS, Results, Row, study};

use super::table::{self, number};
use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let bar = progress::bar(ROWS as u64, "rows");
    let results = study(|| bar.inc(1))?;
    bar.finish_and_clear();
    if arguments.json {
        print_json(&results)?;
    } else {
        print(&readable(&results))?;
    }
    Ok(if results.rows.iter().any(Row::is_broken) {
        Outcome::Failed
    } else {
        Outcome::Good
    })
}

fn readable(results: &Results) -> String {
    let headings = [
        "km/h",
        "t_p/s",
        "reliance",
        "manual/m",
        "no failure/m",
        "handover/m",
        "lost/m",
        "handover ratio",
        "lost ratio",
        "",
    ];
    let mut lines = vec![headings.map(String::from).to_vec()];
    for row in &results.rows {
        let verdict = match (row.manual_stable, row.is_judged(), row.is_broken()) {
            (false, ..) => "manual driver unstable",
            (true, false, _) => "not judged",
            (true, true, true) => "TOO MUCH",
            (true, true, false) => "holds",
        };
        lines.push(vec![
            row.speed_kmh.to_string(),
            row.t_p.to_string(),
            row.condition.to_string(),
            number(row.manual_m, 3),
            number(row.nominal_m, 3),
            number(row.handover_m, 3),
            number(row.loss_m, 3),
            number(row.handover_ratio, 2),
            number(row.loss_ratio, 2),
            verdict.into(),
        ]);
    }
    format!(
        "Peak lateral error in the first curve of paper-course, stretched to the speed (0.93 m/s2), failure in the \
         arc.\nRatio: over the larger of the no-failure and the manual peak.\n\n{}\nLargest handover ratio of a \
         judged row: {:.2} (at most {}).",
        table::text(&lines),
        results.largest_judged_ratio,
        results.most
    )
}
