//! `host-sim ecu live`: a bus as it comes, or as it was recorded.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use haptic_core::bus::Frame;
use haptic_core::bus::messages::MESSAGES;
use haptic_log::bus::Form;
use haptic_log::candump;
use haptic_log::notes::Notes;
use haptic_pil::PilError;
use haptic_pil::live::{Counts, Listener, Status, Unread, View};
use serde_json::json;

use super::super::{BadInput, Outcome, in_file, print};

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("source").required(true))]
pub(in crate::cli) struct Arguments {
    /// The way to the bus: a CAN interface (can0), the serial port of an SLCAN adapter (/dev/ttyUSB0), or
    /// tcp:HOST:PORT. Nothing is sent
    #[arg(long, value_name = "IFACE", group = "source", value_parser = NonEmptyStringValueParser::new())]
    can: Option<String>,
    /// In place of a bus, what --record or `candump -L` wrote of one
    #[arg(long, value_name = "FILE", group = "source")]
    log: Option<PathBuf>,
    /// The bus of a log of several, by its interface (can0)
    #[arg(long, value_name = "NAME", requires = "log")]
    bus: Option<String>,
    /// Write every frame to this file as it comes, in the form of `candump -L`; a file that is there is not overwritten
    #[arg(long, value_name = "FILE", conflicts_with = "log")]
    record: Option<PathBuf>,
    /// Seconds between two lines of status, 0.01 to 3600
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = seconds)]
    every: f64,
    /// End after so many seconds, 0.01 to 1e9; otherwise Ctrl-C ends it
    #[arg(long, value_name = "SECONDS", value_parser = duration)]
    r#for: Option<f64>,
    /// Print one JSON object a line: {"status": ..}, {"change": ..} and, last, {"counts": .., "unread": .., "notes": ..}
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    within(text, 3600.0)
}

fn duration(text: &str) -> Result<f64, String> {
    within(text, 1e9)
}

fn within(text: &str, most: f64) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "no number of seconds".to_owned())?;
    let range = 0.01..=most;
    let refused = || format!("outside {} to {}", range.start(), range.end());
    range.contains(&value).then_some(value).ok_or_else(refused)
}

/// Set by Ctrl-C, which is the usual end of it: what was recorded is written out first.
static ENDED: AtomicBool = AtomicBool::new(false);

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, BadInput> {
    let mut screen = Screen {
        view: View::default(),
        every_s: arguments.every,
        until_s: arguments.r#for.unwrap_or(f64::INFINITY),
        next_s: arguments.every,
        json: arguments.json,
        bus: arguments.bus.clone(),
        unread: Unread::default(),
        notes: Notes::default(),
    };
    screen.print_heading()?;
    let end = match (&arguments.log, &arguments.can) {
        (Some(path), _) => screen.play(path),
        (None, Some(adapter)) => screen.listen(adapter, arguments.record.as_deref()),
        (None, None) => unreachable!("clap asks for one of them"),
    };
    let whole = match end {
        Ok(()) => true,
        Err(End::Input(error)) => return Err(error),
        Err(End::Lost(error)) => {
            eprintln!("error: {error}");
            false
        }
    };
    screen.print_status()?;
    let counts = screen.view.counts();
    if screen.json {
        let last = json!({ "counts": counts, "unread": screen.unread, "notes": screen.notes });
        print(&last.to_string())?;
    } else {
        print(&summary(counts, &screen.unread, &screen.notes))?;
    }
    let heard = counts.frames.contains_key("Guidance");
    if !heard {
        eprintln!(
            "error: no torque frame (0x0C0) came: does the ECU run steering-ecu, is the bus terminated, and do adapter and \
             ECU both run at 500 kbit/s?"
        );
    }
    Ok(if heard && whole {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

/// Why it ended that should not.
enum End {
    Input(BadInput),
    /// The adapter is gone: what came before is shown.
    Lost(PilError),
}

impl<E: Into<BadInput>> From<E> for End {
    fn from(error: E) -> Self {
        Self::Input(error.into())
    }
}

struct Screen {
    view: View,
    every_s: f64,
    until_s: f64,
    /// When the next line of status is due.
    next_s: f64,
    json: bool,
    bus: Option<String>,
    /// What an adapter wrote that is no frame.
    unread: Unread,
    /// What a log holds that is no frame.
    notes: Notes,
}

impl Screen {
    fn play(&mut self, path: &Path) -> Result<(), End> {
        let mut own_bus: Option<String> = None;
        let mut input = BufReader::new(File::open(path).map_err(in_file(path))?);
        let bus = self.bus.clone();
        self.notes = candump::read(&mut input, bus.as_deref(), &mut |recorded| {
            // This bus is of classic CAN with 11 bits: what is otherwise is of another one.
            let is_other = recorded.extended || recorded.form != Form::Classic;
            let id = u16::try_from(recorded.id).ok().filter(|_| !is_other);
            let Some(frame) = id.and_then(|id| Frame::new(id, &recorded.data)) else {
                self.view.take_foreign();
                return Ok(());
            };
            if let Some(info) = MESSAGES.iter().find(|info| info.id == frame.id()) {
                let own = own_bus.get_or_insert_with(|| recorded.bus.clone());
                if *own != recorded.bus {
                    let (name, other) = (info.name, &recorded.bus);
                    return Err(format!(
                        "{name} and others are on the buses {own} and {other}: say with --bus which is meant"
                    )
                    .into());
                }
            }
            self.show(recorded.time_s, &frame).map_err(|error| error.0.into())
        })
        .map_err(in_file(path))?;
        Ok(())
    }

    fn listen(&mut self, adapter: &str, record: Option<&Path>) -> Result<(), End> {
        let mut record = record.map(create).transpose()?;
        let mut listener = Listener::on(adapter).map_err(|error| BadInput(error.to_string()))?;
        ctrlc::set_handler(|| ENDED.store(true, Ordering::Relaxed)).map_err(BadInput::from)?;
        let (start, epoch) = (Instant::now(), SystemTime::now().duration_since(UNIX_EPOCH));
        let epoch_s = epoch.unwrap_or_default().as_secs_f64();
        let mut flush_s = self.every_s;
        while !ENDED.load(Ordering::Relaxed) && start.elapsed().as_secs_f64() < self.until_s {
            let frame = listener.frame().map_err(|error| {
                self.unread = listener.unread();
                End::Lost(error)
            })?;
            let time_s = epoch_s + start.elapsed().as_secs_f64();
            if let Some(frame) = &frame {
                if let Some((file, path)) = &mut record {
                    candump::write(file, time_s, frame.id(), frame.data()).map_err(in_file(path))?;
                }
                self.show(time_s, frame)?;
            } else if let Some(change) = self.view.wait(time_s) {
                self.print_change(&change)?;
            }
            if let Some((file, path)) = record
                .as_mut()
                .filter(|_| start.elapsed().as_secs_f64() > flush_s)
            {
                // What a crash of this computer may cost.
                flush_s += self.every_s;
                file.flush().map_err(in_file(path))?;
            }
        }
        self.unread = listener.unread();
        if let Some((mut file, path)) = record {
            file.flush().map_err(in_file(&path))?;
        }
        Ok(())
    }

    fn show(&mut self, time_s: f64, frame: &Frame) -> Result<(), BadInput> {
        let silence = self.view.wait(time_s);
        for change in silence.into_iter().chain(self.view.take(time_s, frame)) {
            self.print_change(&change)?;
        }
        if self.view.status().time_s >= self.next_s {
            self.print_status()?;
            // After a gap not a line for each that was due in it.
            self.next_s = self.view.status().time_s + self.every_s;
        }
        Ok(())
    }

    fn print_heading(&self) -> Result<(), BadInput> {
        if self.json {
            return Ok(());
        }
        let names = [
            "time", "mode", "T_h", "limit", "T_d", "wheel", "e_y'", "speed", "K_hg +-",
        ];
        let units = ["s", "", "N.m", "", "N.m", "deg", "m", "km/h", ""];
        print(&line(names.map(String::from), "faults"))?;
        print(&line(units.map(String::from), ""))
    }

    fn print_status(&self) -> Result<(), BadInput> {
        let status = self.view.status();
        print(&if self.json {
            json!({ "status": status }).to_string()
        } else {
            described(status)
        })
    }

    fn print_change(&self, change: &str) -> Result<(), BadInput> {
        let time_s = self.view.status().time_s;
        print(&if self.json {
            json!({ "time_s": time_s, "change": change }).to_string()
        } else {
            format!("{time_s:9.3}  * {change}")
        })
    }
}

/// A recording that cannot be made again is not overwritten.
fn create(path: &Path) -> Result<(BufWriter<File>, PathBuf), BadInput> {
    let file = File::create_new(path).map_err(in_file(path))?;
    Ok((BufWriter::new(file), path.to_owned()))
}

fn described(status: &Status) -> String {
    let number = |value: Option<f64>, factor: f64, digits: usize| {
        value.map_or("-".into(), |value| format!("{:+.digits$}", value * factor))
    };
    let k_hg = match (status.k_hg, status.k_hg_deviation) {
        (Some(k_hg), Some(deviation)) => format!("{k_hg:.2} +- {deviation:.2}"),
        _ => "-".into(),
    };
    let speed = status.speed_m_per_s;
    line(
        [
            format!("{:.3}", status.time_s),
            status.mode.clone().unwrap_or("-".into()),
            number(status.torque_nm, 1.0, 3),
            status.limit.clone().unwrap_or("-".into()),
            number(status.driver_torque_nm, 1.0, 2),
            number(status.wheel_angle_rad, 180.0 / std::f64::consts::PI, 1),
            number(status.e_y_m, 1.0, 2),
            speed.map_or("-".into(), |speed| format!("{:.1}", speed * 3.6)),
            k_hg,
        ],
        &status.faults.join(", "),
    )
}

fn line(cells: [String; 9], faults: &str) -> String {
    let [time, mode, torque, limit, driver, wheel, e_y, speed, k_hg] = cells;
    let line = format!(
        "{time:>9}  {mode:<8} {torque:>7}  {limit:<14} {driver:>6} {wheel:>7} {e_y:>6} {speed:>6}  {k_hg:<14} {faults}"
    );
    line.trim_end().to_owned()
}

fn summary(counts: &Counts, unread: &Unread, notes: &Notes) -> String {
    let mut text = String::from("\nframes:\n");
    for (name, count) in &counts.frames {
        text += &format!("  {name:<16} {count}\n");
    }
    text += &format!(
        "damaged: {}, lost by their counters: {}, of another bus: {}",
        counts.damaged,
        counts.lost,
        counts.foreign + unread.frames
    );
    if let Some(first) = &unread.first_line {
        text += &format!(
            "\nlines of the adapter that are no frame: {}, the first \"{first}\"",
            unread.lines
        );
    }
    for note in notes.iter() {
        text += &format!("\nnote: {note}");
    }
    text
}
