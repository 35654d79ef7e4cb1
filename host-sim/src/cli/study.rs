//! `host-sim study FILE.toml`.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_batch::study::Study;
use haptic_report::studies::study::{plan, report, write_tables};

use super::recording::ReadingArguments;
use super::results::{LevelArgument, ResultArguments};
use super::{BadInput, Outcome, output, print, print_notes, progress, width};

const OUT: &str = "Directory of the study: a directory for each session, which is never written again; sessions.csv, results.json, a report. A study that was interrupted goes on where it was";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.default_value("out/study").help(OUT)))]
pub(super) struct Arguments {
    /// Study file (TOML): conditions, participants, how their orders are made (docs/how-to/study.md)
    #[arg(value_name = "FILE.toml")]
    file: PathBuf,
    /// Keep a person's drive, such as the log of the lab, as the recording of a session (N: its repetition, from the
    /// second on); may be repeated
    #[arg(long, value_name = "PARTICIPANT/CONDITION[/N]=FILE")]
    import: Vec<Import>,
    #[command(flatten)]
    reading: ReadingArguments,
    /// Only check the file, and print who drives what in which order
    #[arg(long, conflicts_with_all = ["import", "json"])]
    dry_run: bool,
    #[command(flatten)]
    level: LevelArgument,
    #[command(flatten)]
    results: ResultArguments,
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
            _ => Err(format!("{text:?} is no PARTICIPANT/CONDITION=FILE")),
        }
    }
}

/// Whether a file is kept as it is.
fn is_plain(file: &Path) -> bool {
    file.extension()
        .is_none_or(|extension| extension.eq_ignore_ascii_case("csv"))
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let study = Study::load(&arguments.file)?;
    if arguments.dry_run {
        print(&plan(&study.sessions).to_text(width()))?;
        print_notes(&study.notes);
        return Ok(Outcome::Good);
    }
    let out = arguments.results.directory();
    output::check(out, "study", &[])?;
    // What is another study's is found before anything is imported.
    study.missing(out)?;
    for import in &arguments.import {
        let fail = |e: String| format!("--import {}: {e}", import.session);
        let imported = match is_plain(&import.file) && !arguments.reading.is_given() {
            true => study.import(out, &import.session, &import.file),
            false => {
                let csv = arguments
                    .reading
                    .table(&import.file)
                    .map_err(|BadInput(e)| fail(e))?;
                study.import_table(out, &import.session, (&import.file, &csv))
            }
        };
        imported.map_err(|e| fail(e.to_string()))?;
    }
    output::keeps(out, "session")?;
    progress::watched("sessions", |watch| study.run(out, watch))?;
    let results = study.results(out, arguments.level.level)?;
    let output = arguments.results.begin("study")?;
    if let Some(place) = output.place() {
        write_tables(&results, place)?;
    }
    eprintln!("Sessions: {}", out.join("sessions.csv").display());
    output.show(&report(&results), &results, true)
}
