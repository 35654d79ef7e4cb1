//! What every study does with its results in the same way: the files of `--out`, what is printed, the exit code.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_batch::Confidence;
use haptic_report::document::{Report, write_json};
use serde::Serialize;

use super::output::{Output, pictures};
use super::progress::Threads;
use super::{BadInput, Outcome, print, print_json, print_notes, width};

/// Help of `--out` where a study always leaves files.
pub(super) const DEFAULT_OUT: &str = "Directory for figures, the results and a report";

/// Where the results go, and as what they are printed.
#[derive(Debug, Args)]
pub struct ResultArguments {
    /// Directory for figures, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the results as one JSON object instead of tables
    #[arg(long)]
    pub(super) json: bool,
}

/// How sure intervals are.
#[derive(Debug, Args)]
pub struct LevelArgument {
    /// How often intervals hold what they are of: 0.5 to 0.9999
    #[arg(long, value_name = "SHARE", default_value = "0.95")]
    pub level: Confidence,
}

/// How a study is driven, how sure its intervals are, and where its results go.
#[derive(Debug, Args)]
pub(super) struct DrivenArguments {
    #[command(flatten)]
    pub(super) threads: Threads,
    #[command(flatten)]
    pub(super) level: LevelArgument,
    #[command(flatten)]
    pub(super) results: ResultArguments,
}

impl ResultArguments {
    /// The directory of a command whose `--out` has a default.
    pub(super) fn directory(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new(""))
    }

    /// For a command, as it is typed. Its directory is checked before there is work behind it.
    pub fn begin(&self, command: &str) -> Result<Results<'_>, BadInput> {
        self.begin_beside(command, &[])
    }

    /// Begins the results, where the command keeps files by other means too.
    ///
    /// # Errors
    /// A directory that cannot be written, or that holds files of somebody else.
    pub fn begin_beside(&self, command: &str, keeps: &[&str]) -> Result<Results<'_>, BadInput> {
        let place = self.out.as_deref();
        let output = place.map(|place| Output::begin(place, command, keeps));
        Ok(Results {
            output: output.transpose()?,
            ..self.without_files()
        })
    }

    /// Results of a command whose files are there already.
    pub(super) fn without_files(&self) -> Results<'_> {
        Results {
            arguments: self,
            output: None,
            file: "results.json",
        }
    }
}

/// Where the results of a study go.
pub struct Results<'a> {
    arguments: &'a ResultArguments,
    output: Option<Output>,
    /// Name of the file with the results.
    file: &'static str,
}

impl Results<'_> {
    /// Gives the file with the results another name.
    pub fn named(self, file: &'static str) -> Self {
        Self { file, ..self }
    }

    /// Where a study writes what is neither results nor report, if files are wanted.
    pub fn place(&self) -> Option<&Path> {
        self.output.as_ref().map(Output::place)
    }

    /// Writes and prints the results with where they come from; the command has failed if a check did not hold.
    pub fn show(self, report: &Report, results: &impl Serialize, holds: bool) -> Result<Outcome, BadInput> {
        self.show_bare(report, &report.stamp(results), holds)
    }

    /// Shows results that say by themselves where they come from.
    pub(super) fn show_bare(
        self,
        report: &Report,
        results: &impl Serialize,
        holds: bool,
    ) -> Result<Outcome, BadInput> {
        if let Some(output) = self.output {
            write_json(&output.place().join(self.file), results)?;
            output.finish(|place| haptic_report::studies::write(report, place, pictures()))?;
        }
        if self.arguments.json {
            print_json(results)?;
        } else {
            print(&report.to_text(width()))?;
        }
        print_notes(&report.notes);
        if let Some(shares) = haptic_batch::shares() {
            eprintln!("Vectorised: {shares}");
        }
        if let Some(directory) = &self.arguments.out {
            eprintln!("Report: {}", directory.join("report.html").display());
        }
        Ok(if holds { Outcome::Good } else { Outcome::Failed })
    }
}
