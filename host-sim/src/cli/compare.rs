//! `host-sim compare FILE.toml...`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use haptic_batch::Confidence;
use haptic_batch::adaptation::Adaptation;
use haptic_batch::compare::{Compare, Kinds};
use haptic_report::document::{definitions_table, write_bytes};
use haptic_report::studies::compare::{driver_kinds, law_kinds};
use haptic_report::studies::{adaptation, compare};

use super::progress::Threads;
use super::results::{DrivenArguments, ResultArguments};
use super::{BadInput, Outcome, output, print, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Comparison file (TOML): laws, drivers, roads, speeds, seeds, failures, tuning (docs/how-to/compare.md); or maps of laws and drivers
    /// who adapt, and a loss (docs/explanation/two-adaptations.md). Of several files each has a directory of its name in DIR
    #[arg(value_name = "FILE.toml", required_unless_present = "list")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    driven: DrivenArguments,
    /// Print what a file may name, as Markdown, and drive nothing
    #[arg(long, value_enum, value_name = "WHAT", conflicts_with_all = ["files", "out", "json"])]
    list: Option<Named>,
}

/// What a file of a study names.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Named {
    /// Laws: source, parameters with default and range, what tuning varies
    Laws,
    /// Drivers and habits, likewise
    Drivers,
    /// Metrics of every study: unit, definition, source
    Metrics,
}

impl Named {
    fn table(self) -> haptic_report::document::Table {
        match self {
            Self::Laws => law_kinds(),
            Self::Drivers => driver_kinds(),
            Self::Metrics => definitions_table(),
        }
    }
}

/// A file's study, checked.
enum Study<'k> {
    /// Every law with every driver.
    Laws(Box<Compare<'k>>),
    /// Laws that adapt, with drivers whose K_hg follows trust.
    Loops(Box<Adaptation<'k>>),
}

impl<'k> Study<'k> {
    fn load(file: &Path, level: Confidence, kinds: &'k Kinds) -> Result<Self, BadInput> {
        if Adaptation::is_in(file) {
            let mut study = Adaptation::load(file, kinds)?;
            study.level = level;
            return Ok(Self::Loops(Box::new(study)));
        }
        let study = Compare::load(file, kinds)?;
        Ok(Self::Laws(Box::new(Compare { level, ..study })))
    }

    fn name(&self) -> &str {
        match self {
            Self::Laws(study) => &study.name,
            Self::Loops(study) => &study.name,
        }
    }

    fn drive(&self, threads: &Threads, results: &ResultArguments) -> Result<Outcome, BadInput> {
        let output = results.begin(COMMAND)?;
        match self {
            Self::Laws(study) => {
                let found = progress::timed("drives", |watch| threads.run(|| study.run(watch)))??;
                if let Some(place) = output.place() {
                    found.write_tables(place)?;
                }
                output.show(&compare::report(&found), &found, true)
            }
            Self::Loops(study) => {
                let found = progress::timed("drives", |watch| threads.run(|| study.run(watch)))??;
                if let Some(place) = output.place() {
                    write_bytes(&place.join("loops.csv"), found.to_csv())?;
                }
                output.show(&adaptation::report(&found), &found, true)
            }
        }
    }
}

const COMMAND: &str = "compare";

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    if let Some(named) = arguments.list {
        print(&named.table().to_markdown())?;
        return Ok(Outcome::Good);
    }
    let DrivenArguments {
        threads,
        level,
        results,
    } = &arguments.driven;
    let kinds = Kinds::default();
    let files = arguments.files.iter();
    let studies = files.map(|file| Study::load(file, level.level, &kinds));
    let studies: Vec<Study<'_>> = studies.collect::<Result<_, _>>()?;
    if let [study] = &studies[..] {
        return study.drive(threads, results);
    }
    if results.json {
        return Err(
            "--json prints the results of one file; of several, --out DIR has a results.json each".into(),
        );
    }
    // All is checked before the first is driven.
    let place = |study: &Study<'_>| results.out.as_ref().map(|out| out.join(study.name()));
    for (number, study) in studies.iter().enumerate() {
        if let Some(other) = studies[..number]
            .iter()
            .position(|other| other.name() == study.name())
        {
            let [first, second] = [other, number].map(|place| arguments.files[place].display());
            return Err(BadInput(format!(
                "{first} and {second}: both have the name {:?}",
                study.name()
            )));
        }
        if let Some(place) = place(study) {
            output::check(&place, COMMAND, &[])?;
        }
    }
    for study in &studies {
        let out = place(study);
        study.drive(threads, &ResultArguments { out, json: false })?;
    }
    Ok(Outcome::Good)
}
