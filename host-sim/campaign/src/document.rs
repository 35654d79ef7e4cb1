//! The table of faults in words, which `cargo xtask faults --list` prints.

use super::residual::Detectability;
use super::table::{Expect, FaultCase, GROUPS};

/// All rows as Markdown tables, one for each group.
pub fn table_of_faults() -> String {
    let mut text = String::new();
    for group in GROUPS {
        text.push_str(&format!(
            "### {}\n\n| fault | what is injected | class | reaction | torque at most | where |\n\
             |---|---|---|---|---|---|\n",
            group.name
        ));
        for row in group.rows {
            text.push_str(&format!(
                "| `{}` | {} | {} | {} | {} N.m | {} |\n",
                row.name,
                row.injected,
                row.class,
                reaction(row),
                row.torque_nm,
                place(row)
            ));
        }
        text.push('\n');
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// On which of host and QEMU, and in which worlds, if not in all.
fn place(row: &FaultCase) -> String {
    let worlds = match (row.left_out(false), row.left_out(true)) {
        (Some(_), _) => ", with a bar",
        (None, Some(_)) => ", without a bar",
        (None, None) => "",
    };
    format!("{}{worlds}", row.place)
}

fn reaction(row: &FaultCase) -> String {
    let within = |what: &str| format!("{what} within {} ms {}", row.deadline_ms, row.seen.since());
    match row.expect {
        Expect::GoesOn { rejects: true } => "goes on, rejects".into(),
        Expect::GoesOn { rejects: false } => "goes on".into(),
        Expect::Uncut => "goes on, not cut".into(),
        Expect::MayHandOver if row.seen == Detectability::AtOnce => "goes on, or hands over".into(),
        Expect::MayHandOver => "goes on, or hands over once it looks impossible".into(),
        Expect::OnlyRules => "whatever the rules of every cycle allow".into(),
        Expect::HandsOverOrStops => within("hands over, or zero and latched,"),
        Expect::Reaches { mode, .. } => within(match mode {
            super::bytes::ACTIVE => "engages from zero",
            super::bytes::FADE => "fades",
            super::bytes::HANDOVER => "hands over",
            super::bytes::FAULT => "zero and latched",
            _ => "locked",
        }),
        Expect::Restarts { .. } => within("starts anew into Standby, says the cause,"),
        Expect::Yields => within("zero while opposed"),
    }
}
