//! `host-sim study FILE.toml`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::study::{Study, StudyResults, Who};
use haptic_report::studies::study as files;

use super::output::{self, Output};
use super::{BadInput, Outcome, print, print_json, print_notes, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Study file (TOML): conditions, participants, how their orders are made (docs/how-to/study.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// Directory of the study: a directory for each session, which is never written again; sessions.csv, results.json. A
    /// study that was interrupted goes on where it was
    #[arg(long, value_name = "DIR", default_value = "out/study")]
    out: PathBuf,
    /// Keep a person's drive, such as the log of the lab, as the recording of a session (N: its repetition, from the
    /// second on); may be repeated
    #[arg(long, value_name = "PARTICIPANT/CONDITION[/N]=FILE.csv")]
    import: Vec<Import>,
    /// Only check the file, and print who drives what in which order
    #[arg(long, conflicts_with_all = ["import", "json"])]
    dry_run: bool,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// A session, and the file that a person left.
#[derive(Debug, Clone)]
struct Import {
    session: String,
    file: PathBuf,
}

impl std::str::FromStr for Import {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((session, file)) if session.contains('/') && !file.is_empty() => Ok(Self {
                session: session.into(),
                file: file.into(),
            }),
            _ => Err(format!("{text:?} is no PARTICIPANT/CONDITION=FILE.csv")),
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let study = Study::load(&arguments.file)?;
    if arguments.dry_run {
        print(&files::plan(&study.sessions).to_text(width()))?;
        print_notes(&study.notes);
        return Ok(Outcome::Good);
    }
    let out = &arguments.out;
    output::check(out, "study", &[])?;
    let missing = study.missing(out)?.len();
    for import in &arguments.import {
        study
            .import(out, &import.session, &import.file)
            .map_err(|e| format!("--import {}: {e}", import.session))?;
    }
    output::keeps(format!(
        "{} keeps every session that was done; the same command goes on from there.",
        out.display()
    ))?;
    let bar = progress::bar(missing as u64, "sessions");
    study.run(out, || bar.inc(1))?;
    bar.finish_and_clear();
    let results = study.results(out)?;
    Output::begin(out, "study")?.finish(|place| files::write(&results, place))?;
    if arguments.json {
        print_json(&files::stamped(&results))?;
    } else {
        print(&readable(&results))?;
    }
    print_notes(&results.notes);
    eprintln!("Sessions: {}", out.join("sessions.csv").display());
    Ok(Outcome::Good)
}

fn readable(results: &StudyResults) -> String {
    let mut text = format!(
        "{}\n\n{}\n{}",
        results.study,
        files::sessions(results).to_text(width()),
        files::by_condition(results).to_text(width())
    );
    if !results.differences.is_empty() {
        text.push_str(&format!("\n{}", files::differences(results).to_text(width())));
    }
    let waits = |s: &&haptic_batch::study::SessionResult| s.who == Who::Person && s.recorded.is_none();
    if let Some(session) = results.sessions.iter().find(waits) {
        text.push_str(&format!(
            "\n{} sessions wait for a person: --import {}=FILE.csv",
            results.sessions.iter().filter(waits).count(),
            session.name()
        ));
    }
    text
}
