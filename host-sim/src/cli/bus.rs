//! `bus`: the worst-case load of the CAN bus.

use clap::Args;
use serde_json::json;

use super::table::text;
use super::{BadInput, Outcome, print, print_json};
use haptic_batch::bus_load::{BIT_RATE, MAX_LOAD, table};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Print the table as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let rows = table();
    let total: f64 = rows.iter().map(|row| row.load).sum();
    if arguments.json {
        print_json(&json!({ "bit_rate": BIT_RATE, "messages": rows, "load": total, "max_load": MAX_LOAD }))?;
    } else {
        let mut lines = vec![
            ["message", "identifier", "period/ms", "bits", "load/%"]
                .map(String::from)
                .to_vec(),
        ];
        lines.extend(rows.iter().map(|row| {
            vec![
                row.message.to_owned(),
                format!("{:#05x}", row.id),
                format!("{:.1}", row.period_ms),
                row.bits.to_string(),
                format!("{:.2}", row.load * 100.0),
            ]
        }));
        let percent = |load: f64| format!("{:.2}", load * 100.0);
        lines.push(vec![
            "all".into(),
            String::new(),
            "-".into(),
            "-".into(),
            percent(total),
        ]);
        print(&format!(
            "{}\nat most {} % of 500 kbit/s",
            text(&lines),
            percent(MAX_LOAD)
        ))?;
    }
    Ok(if total <= MAX_LOAD {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}
