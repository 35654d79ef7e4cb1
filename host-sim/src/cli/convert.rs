//! `host-sim convert IN [OUT]`.

use std::path::PathBuf;

use clap::Args;
use haptic_analysis::identify::HAPTIC_DBC;
use haptic_log::formats::{self, Contents, Format, TimeColumn};
use haptic_log::notes::Notes;
use haptic_log::recording::{Recording, RecordingError};
use haptic_report::document::{Cell, Table};
use serde::Serialize;

use super::{BadInput, Outcome, in_file, output, print, print_json, progress, width};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recording to read; its extension says the format: .csv, .parquet, .mat, .mf4, .log (candump), .asc, .blf
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// File to write, in the format of its extension: one of those, or .mcap. Without it the channels are listed
    #[arg(value_name = "OUT")]
    output: Option<PathBuf>,
    /// What the frames of a recording of the bus mean, if not the built-in core/haptic.dbc
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// The bus of a recording of several, by its name there: an interface (can0) or the number of a channel (1)
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// The channel that is the time, if it is not time_s
    #[arg(long, value_name = "CHANNEL[*SCALE]")]
    time: Option<String>,
    /// Put all channels on an even grid of so many rows a second: whole numbers as held, others on the line between
    /// neighbours. Without it every instant of every channel is a row
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Print the channels as JSON instead of a table
    #[arg(long, conflicts_with = "output")]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Listed<'a> {
    channels: Vec<Channel>,
    /// What was left out, merged, cut, mended, guessed or converted.
    notes: &'a Notes,
}

#[derive(Serialize)]
struct Channel {
    name: String,
    unit: String,
    source: String,
    sample_rate_hz: f64,
    samples: usize,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let time = arguments.time.as_deref().map(time_column).transpose()?;
    if let Some(rate_hz) = arguments.rate.filter(|rate| !(0.1..=1e5).contains(rate)) {
        return Err(format!("--rate {rate_hz}: 0.1 to 100000 Hz is wanted").into());
    }
    if let Some(output) = &arguments.output
        && output.exists()
        && !output::is_forced()
    {
        return Err(in_file(output)(
            "the file is there already; --force writes over it",
        ));
    }
    let target = arguments.output.as_deref().map(Format::from_path).transpose()?;
    let contents = formats::read(&arguments.input, time.as_ref())?;
    let named = in_file::<RecordingError>(&arguments.input);
    let mut recording = match contents {
        Contents::Channels(recording) => recording,
        Contents::Frames(log) => {
            let log = log.of_bus(arguments.bus.as_deref());
            let (log, bar) = progress::of_log(log);
            if let (Some(output), Some(true)) = (&arguments.output, target.map(Format::holds_frames)) {
                if arguments.rate.is_some() {
                    return Err("--rate is for channels, not for frames".into());
                }
                let (count, notes) = formats::write_frames(output, &log)?;
                bar.finish_and_clear();
                print_reading(&notes);
                eprintln!("{}: {count} frames", output.display());
                return Ok(Outcome::Good);
            }
            let dbc = match &arguments.dbc {
                Some(path) => std::fs::read(path).map_err(in_file(path))?,
                None => HAPTIC_DBC.into(),
            };
            let recording = formats::dbc::channels(&log, &dbc);
            bar.finish_and_clear();
            recording.map_err(&named)?
        }
    };
    if let Some(rate_hz) = arguments.rate {
        let even = recording.resampled(rate_hz).map_err(&named)?;
        recording.groups = vec![even];
    }
    let table = recording.table();
    let Some(output) = &arguments.output else {
        if arguments.json {
            let channels = table.into_iter().map(|line| Channel {
                name: line.name,
                unit: line.unit,
                source: line.source,
                sample_rate_hz: line.sample_rate_hz,
                samples: line.samples,
            });
            print_json(&Listed {
                channels: channels.collect(),
                notes: &recording.notes,
            })?;
        } else {
            let notes: String = recording.notes.iter().map(|note| format!("\n{note}")).collect();
            let space = if notes.is_empty() { "" } else { "\n" };
            print(&format!("{}{space}{notes}", listed(&recording).to_text(width())))?;
        }
        return Ok(Outcome::Good);
    };
    print_reading(&recording.notes);
    formats::write(output, recording)?;
    eprintln!("{}: {} channels", output.display(), table.len());
    Ok(Outcome::Good)
}

/// What the file that is written does not hold as the other did, on stderr.
fn print_reading(notes: &Notes) {
    for note in notes.iter() {
        eprintln!("note: {note}");
    }
}

fn listed(recording: &Recording) -> Table {
    let row = |line: haptic_log::recording::Line| {
        [
            ("Channel", Cell::Text(line.name)),
            ("Unit", Cell::Text(line.unit)),
            ("Source", Cell::Text(line.source)),
            ("Rate (Hz)", Cell::number(line.sample_rate_hz, 3)),
            ("Values", Cell::Text(line.samples.to_string())),
        ]
    };
    Table::of_rows("", recording.table().into_iter().map(row))
}

fn time_column(text: &str) -> Result<TimeColumn, BadInput> {
    let column = |name: &str, scale| TimeColumn {
        name: name.trim().into(),
        scale,
    };
    let Some((name, scale)) = text.rsplit_once('*') else {
        return Ok(column(text, None));
    };
    match scale.trim().parse::<f64>() {
        Ok(scale) if scale.is_finite() && scale > 0.0 => Ok(column(name, Some(scale))),
        _ => Err(format!("--time {text}: the scale {scale:?} is no number above 0").into()),
    }
}
