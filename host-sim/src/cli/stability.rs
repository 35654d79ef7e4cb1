//! `host-sim stability`.

use std::path::PathBuf;

use clap::Args;
use haptic_batch::stability::{PLACES, map};
use haptic_report::studies::stability::{self as files, Map};

use super::output::Output;
use super::{BadInput, Outcome, print, print_json, progress};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Directory for figures, the results and a report; default: no files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the results as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let output = arguments.out.as_deref().map(Output::begin).transpose()?;
    let bar = progress::bar(PLACES as u64, "places");
    let map = Map {
        places: map(|| bar.inc(1))?,
    };
    bar.finish_and_clear();
    if let Some(output) = output {
        output.finish(|place| files::write(&map, place))?;
    }
    if arguments.json {
        print_json(&files::stamped(&map))?;
    } else {
        let table = files::table(&map).to_text();
        print(&format!(
            "{}\n\n{table}\n{}",
            files::SUMMARY,
            files::judgement(&map)
        ))?;
    }
    let broken = map.places.iter().any(|place| place.broken().next().is_some());
    Ok(if broken { Outcome::Failed } else { Outcome::Good })
}
