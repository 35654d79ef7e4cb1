//! A log of frames in one of the formats that hold frames, read frame by frame: a night of them fills a memory.

use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::dbc::Signals;
use super::{Format, asc, blf, replaced};
use crate::bus::{BusFrame, Intake, Take, interface};
use crate::candump;
use crate::notes::{Fate, Notes, Part};
use crate::recording::{RecordingError, refuse};

/// A log of frames.
#[derive(Debug, Clone)]
pub struct BusLog {
    input: Input,
    format: Format,
    bus: Option<String>,
    /// Stretches of time that are wanted, s; all if there is none.
    stretches: Vec<(f64, f64)>,
    watch: Watch,
}

#[derive(Debug, Clone)]
enum Input {
    File(PathBuf),
    Bytes(Arc<[u8]>),
    Frames(Arc<[BusFrame]>, Notes),
}

/// Who is told of each part that is read, in bytes; nobody by default.
#[derive(Clone)]
pub struct Watch(Arc<dyn Fn(u64) + Send + Sync>);

impl Default for Watch {
    fn default() -> Self {
        Self::new(|_| ())
    }
}

impl Watch {
    /// Tells `watch`.
    pub fn new(watch: impl Fn(u64) + Send + Sync + 'static) -> Self {
        Self(Arc::new(watch))
    }

    /// An input whose reading is watched.
    pub fn over<'a>(&'a self, input: impl Read + 'a) -> impl Read + 'a {
        Watched(input, self)
    }
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Watch")
    }
}

/// An input whose reader is watched.
struct Watched<'a, R>(R, &'a Watch);

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.0.read(buffer)?;
        (self.1.0)(read as u64);
        Ok(read)
    }
}

impl BusLog {
    fn new(input: Input, format: Format) -> Self {
        Self {
            input,
            format,
            bus: None,
            stretches: Vec::new(),
            watch: Watch::default(),
        }
    }

    /// The log in a file.
    ///
    /// # Errors
    /// There is none, or it may not be read.
    pub fn of_file(path: &Path, format: Format) -> Result<Self, RecordingError> {
        File::open(path).map_err(refuse)?;
        Ok(Self::new(Input::File(path.to_owned()), format))
    }

    /// The log in the bytes of a file of a format that holds frames.
    #[must_use]
    pub fn of_bytes(bytes: Vec<u8>, format: Format) -> Self {
        Self::new(Input::Bytes(bytes.into()), format)
    }

    /// A log of frames that are known already, and what else was read with them.
    #[must_use]
    pub fn of_frames(frames: Vec<BusFrame>, notes: Notes) -> Self {
        Self::new(Input::Frames(frames.into(), notes), Format::Candump)
    }

    /// The frames of one bus alone, by its name in the log; of all if there is none.
    #[must_use]
    pub fn of_bus(mut self, bus: Option<&str>) -> Self {
        self.bus = bus.map(String::from);
        self
    }

    /// The frames of these stretches of time alone, s; of all time if there is none.
    #[must_use]
    pub fn within(mut self, stretches: &[(f64, f64)]) -> Self {
        self.stretches = stretches.to_vec();
        self
    }

    /// Tells `watch` of each part that is read.
    #[must_use]
    pub fn watched(mut self, watch: Watch) -> Self {
        self.watch = watch;
        self
    }

    /// What it says, with its file's name if it has one.
    fn named(&self, error: &RecordingError) -> RecordingError {
        match &self.input {
            Input::File(path) => format!("{}: {error}", path.display()).into(),
            _ => error.clone(),
        }
    }

    /// Its size, in bytes; 0 if nobody knows.
    #[must_use]
    pub fn size(&self) -> u64 {
        match &self.input {
            Input::File(path) => std::fs::metadata(path).map_or(0, |known| known.len()),
            Input::Bytes(bytes) => bytes.len() as u64,
            Input::Frames(..) => 0,
        }
    }

    /// Reads every data frame, in the order of the log; what else it holds is counted.
    ///
    /// # Errors
    /// Another kind of file; a clock that does not go on; no frame; what `take` says.
    pub fn each(&self, take: &mut Take<'_>) -> Result<Notes, RecordingError> {
        let (mut inside, mut outside) = (0_u64, None);
        let mut within = |frame: &BusFrame| {
            let is_in = |(from, to): &(f64, f64)| (*from..=*to).contains(&frame.time_s);
            if !self.stretches.is_empty() && !self.stretches.iter().any(is_in) {
                let (count, _) = outside.get_or_insert((0, frame.line));
                *count += 1;
                return Ok(());
            }
            inside += 1;
            take(frame)
        };
        let take = &mut within as &mut Take<'_>;
        let read = match &self.input {
            Input::File(path) => self.read(File::open(path).map_err(refuse)?, take),
            Input::Bytes(bytes) => self.read(&bytes[..], take),
            Input::Frames(frames, notes) => {
                let mut intake = Intake::new("frame", self.bus.as_deref(), take);
                intake.notes = notes.clone();
                let mut each = frames.iter();
                each.try_for_each(|frame| intake.frame(frame))
                    .and_then(|()| intake.finish())
            }
        };
        let mut notes = read.map_err(RecordingError::printable)?;
        if let Some((count, first)) = outside {
            let (why, place) = ("outside of the time asked for", format_args!("line {first}"));
            notes.count_many(Fate::LeftOut, Part::Frame, why, count, place);
        }
        if inside == 0 {
            return Err("there is no frame in the stretches of --from and --to".into());
        }
        Ok(notes)
    }

    fn read(&self, input: impl Read, take: &mut Take<'_>) -> Result<Notes, RecordingError> {
        let (mut input, bus) = (
            BufReader::with_capacity(1 << 16, self.watch.over(input)),
            self.bus.as_deref(),
        );
        match self.format {
            Format::Asc => asc::read(&mut input, bus, take),
            Format::Blf => blf::read(&mut input, self.size(), bus, take),
            _ => candump::read(&mut input, bus, take),
        }
    }

    /// Every data frame at once, and what else the log holds.
    ///
    /// # Errors
    /// As [`BusLog::each`].
    pub fn frames(&self) -> Result<(Vec<BusFrame>, Notes), RecordingError> {
        let mut frames = Vec::new();
        let notes = self.each(&mut |frame: &BusFrame| {
            frames.push(frame.clone());
            Ok(())
        })?;
        Ok((frames, notes))
    }
}

/// Writes the frames of a log into the file at `path`; how many there were, and what else the log holds.
///
/// # Errors
/// A format of channels, what the disk says; with the file. What the log says.
pub fn write_frames(path: &Path, log: &BusLog) -> Result<(u64, Notes), RecordingError> {
    let format = Format::from_path(path)?;
    let (mut count, mut is_full, mut unread) = (0, false, None);
    let mut notes = Notes::default();
    let mut all = |write: &mut dyn FnMut(&BusFrame) -> io::Result<()>| {
        let read = log.each(&mut |frame: &BusFrame| {
            count += 1;
            write(frame).map_err(|e| {
                is_full = true;
                refuse(e)
            })
        });
        // What the log says is not of the file that is written.
        notes = read.inspect_err(|e| unread = Some(log.named(e)).filter(|_| !is_full))?;
        Ok::<_, RecordingError>(())
    };
    let mut taken = Notes::default();
    let written = replaced(path, |out| match format {
        Format::Asc => {
            let mut writer = asc::Writer::new(out);
            all(&mut |frame| writer.frame(frame))?;
            writer.numbers.tell(&mut taken);
            writer.finish().map_err(refuse)
        }
        Format::Blf => {
            let mut writer = blf::Writer::new(out).map_err(refuse)?;
            all(&mut |frame| writer.frame(frame))?;
            writer.numbers.tell(&mut taken);
            writer.finish().map_err(refuse)
        }
        Format::Candump => all(&mut |frame| candump::write_frame(out, &interface(&frame.bus), frame)),
        _ => Err("frames become channels by a DBC file first".into()),
    });
    unread.map_or(written, Err)?;
    notes.append(taken);
    Ok((count, notes))
}

impl Signals<'_> {
    /// Writes all channels into the CSV file at `path`, a row an instant, without a table in memory.
    ///
    /// # Errors
    /// What the disk says, with the file; what the log says.
    pub fn write_table(&self, path: &Path) -> Result<(), RecordingError> {
        replaced(path, |out| self.write_csv(out))
    }
}
