//! A recorded drive as an argument: the file, and what its channels and frames are; everywhere the same options.

use std::path::{Path, PathBuf};

use clap::Args;
use haptic_analysis::identify::{
    DriveLog, FixError, HAPTIC_DBC, Layout, Mapping, Options, Recording as How, open_mapped,
};
use haptic_batch::files::load_scenario;
use haptic_batch::identify::single_track;
use haptic_log::formats::{self, BusLog, Contents, Format, Reading};
use haptic_log::recording::{Recording, RecordingError, Term};
use haptic_sim::input::in_range;

use super::{BadInput, in_file, print_notes, progress};

/// New names, each with the channel that gets it.
type Names = Vec<(String, Term)>;

/// How a recording is read.
#[derive(Debug, Args)]
pub struct ReadingArguments {
    /// A channel of another name or unit, such as driver_torque_nm=TorsionBar, 'wheel_angle_rad=Steering [deg]' or
    /// wheel_angle_rad=Steering*0.0174533; without a unit or factor the file's own unit is converted; may be repeated
    #[arg(long, value_name = "NAME=CHANNEL")]
    map: Vec<String>,
    /// The channel that is the time, if it is not time_s; with a unit or a factor as in --map
    #[arg(long, value_name = "CHANNEL")]
    time: Option<String>,
    /// Whose recording it is: openlka, openpilot, sadc, udacity, cognitive-driver-model, or a layout of one's own. Of a drive
    /// that an automation shares in turns, --manual takes the stretches by hand, otherwise the others are taken
    #[arg(long, value_name = "NAME|FILE.toml")]
    layout: Option<String>,
    /// Use the recording from this time on, s; may be repeated with --to for several stretches
    #[arg(long, value_name = "S")]
    from: Vec<f64>,
    /// Use the recording up to this time, s
    #[arg(long, value_name = "S")]
    to: Vec<f64>,
    /// Bridge pauses of a signal (lost rows, NaN, a stuck sensor) up to so long, s (0 to 1), and cut the drive at longer
    /// ones; 0 cuts at each; default: 0.3, and in `convert --rate` any
    #[arg(long, value_name = "S")]
    max_gap: Option<f64>,
    /// What the frames of a recording of the bus mean, if not the built-in core/haptic.dbc
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// The bus of a recording of several, by its name there: an interface (can0) or the number of a channel (1)
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct RecordingArguments {
    /// Recorded drive: a table (.csv, .parquet, .mat, .mf4) with time_s, e_y_m, e_theta_rad (the driver's points),
    /// wheel_angle_rad, guidance_torque_nm, driver_torque_nm, or the bus (candump -L, .asc, .blf)
    #[arg(value_name = "LOG")]
    pub(super) log: PathBuf,
    #[command(flatten)]
    pub(super) reading: ReadingArguments,
    /// The vehicle of a recording of the bus, if not that of table 9: a scenario file whose [vehicle] says what it is. The
    /// bus does not carry the driver's far point; it is computed with this vehicle
    #[arg(long, value_name = "FILE.toml")]
    pub(super) vehicle: Option<PathBuf>,
}

/// What is known of the driver before a fit.
#[derive(Debug, Args)]
pub(super) struct FitArguments {
    /// A drive without guidance: there is no K_hg (the driver's weight on the guidance), and guidance_torque_nm may be
    /// missing
    #[arg(long)]
    manual: bool,
    /// A known parameter, such as k_d=3.2 (a_1, a_2, a_3, gain_1, gain_2, gain_3, t_p, k_d, k_hg, k_nms, t_nms; by
    /// how much a column is late, s: t_h_late, t_d_late; the driver's own line, m: line_offset and line_bend, that in a left bend of
    /// 300 m at 60 km/h; of a torsion bar: wheel_inertia, kg.m2, wheel_damping, N.m.s/rad, and bar_stiffness, N.m/rad, where the angle is
    /// the column's); may be repeated. gain_i is (k_d + k_nms)*a_i; docs/glossary.md explains the others
    #[arg(long, value_name = "NAME=VALUE")]
    fix: Vec<String>,
    /// The column has a power assist that is not in guidance_torque_nm: it turns the wheel with the driver, so that the torques on the
    /// column do not tell whether driver_torque_nm is recorded too small
    #[arg(long)]
    assisted: bool,
    /// Estimate what is otherwise taken as known: k_nms, t_nms, t_h_late, t_d_late, in a range if one is given, such as
    /// t_nms=0.06..0.15; may be repeated
    #[arg(long, value_name = "NAME[=LOW..HIGH]")]
    estimate: Vec<String>,
}

impl FitArguments {
    /// The options of a fit to what is read so.
    pub(super) fn options(&self, reading: &ReadingArguments) -> Result<Options, BadInput> {
        let mut options = Options::given(self.manual, &self.fix)?;
        options.assisted = self.assisted;
        for what in &self.estimate {
            options.estimate(what)?;
        }
        reading.choose(&mut options)?;
        Ok(options)
    }
}

impl ReadingArguments {
    /// Takes stretches and gaps into the options of a fit.
    pub fn choose(&self, options: &mut Options) -> Result<(), BadInput> {
        options.between(&self.from, &self.to)?;
        if let Some(max_gap) = self.max_gap()? {
            options.bridge_s = max_gap;
        }
        Ok(())
    }

    /// The stretches that are asked for; all of a recording if there is none.
    fn stretches(&self) -> Result<Vec<(f64, f64)>, FixError> {
        let mut options = Options::default();
        options.between(&self.from, &self.to)?;
        Ok(options.stretches)
    }

    /// The columns of a log that are called otherwise.
    pub fn maps(&self) -> Result<Vec<Mapping>, BadInput> {
        let time = self.time.iter().map(|time| ("--time", format!("time_s={time}")));
        let maps = self.map.iter().map(|map| ("--map", map.clone()));
        let parsed = time.chain(maps).map(|(option, map)| {
            let parsed = map.parse::<Mapping>();
            parsed.map_err(|e| BadInput(format!("{option} {}", e.to_string().trim_start_matches("map "))))
        });
        parsed.collect()
    }

    /// The layout that describes the recording.
    ///
    /// # Errors
    /// A layout that there is not.
    pub fn layout(&self) -> Result<Option<Layout>, BadInput> {
        Ok(self.layout.as_deref().map(Layout::named).transpose()?)
    }

    /// The log in a file, of which these stretches will be used, and what a reader of the results has to know of it.
    pub(super) fn open(
        &self,
        path: &Path,
        manual: bool,
        stretches: &[(f64, f64)],
        vehicle: Option<&Path>,
    ) -> Result<(DriveLog, Vec<String>), BadInput> {
        let vehicle = vehicle.map(load_scenario).transpose()?;
        let (watch, bar) = progress::of_file(path);
        let how = How {
            dbc: self.dbc.as_deref(),
            bus: self.bus.as_deref(),
            vehicle: vehicle.as_ref().map(single_track),
            manual,
            stretches,
            watch: Some(&watch),
        };
        let read = open_mapped(path, self.layout()?.as_ref(), &self.maps()?, &how);
        bar.finish_and_clear();
        Ok(read?)
    }

    /// Whether a file is to be understood otherwise than it says itself.
    pub(super) fn is_given(&self) -> bool {
        let is_cut = !self.from.is_empty() || !self.to.is_empty();
        self.renames() || is_cut || self.dbc.is_some() || self.bus.is_some()
    }

    /// Whether channels get another name.
    pub(super) const fn renames(&self) -> bool {
        self.time.is_some() || self.layout.is_some() || !self.map.is_empty()
    }

    /// What the frames of a recording of the bus mean.
    pub(super) fn dbc(&self) -> Result<Vec<u8>, BadInput> {
        match &self.dbc {
            Some(path) => {
                let bytes = std::fs::read(path).map_err(in_file(path))?;
                formats::dbc::parse(&bytes).map_err(in_file(path))?;
                Ok(bytes)
            }
            None => Ok(HAPTIC_DBC.into()),
        }
    }

    /// What a file holds, its channels named and cut as asked; frames of the bus that is asked for.
    pub(super) fn read(&self, path: &Path) -> Result<Contents, BadInput> {
        if let Some(layout) = self.layout()? {
            let bytes = std::fs::read(path).map_err(in_file(path))?;
            let table = layout.recording(&bytes, Format::if_named(path)?, &self.maps()?);
            let table = table.map_err(in_file(path))?;
            return Ok(Contents::Channels(table.within(&self.stretches()?)?));
        }
        let (time, terms) = self.terms()?;
        let reading = Reading {
            time: time.as_ref(),
            only: None,
        };
        let (watch, bar) = progress::of_file(path);
        let contents = formats::read(path, reading, &watch);
        bar.finish_and_clear();
        Ok(match contents? {
            Contents::Frames(log) => {
                Contents::Frames(log.of_bus(self.bus.as_deref()).within(&self.stretches()?))
            }
            Contents::Channels(recording) => Contents::Channels(self.named(path, recording, &terms)?),
        })
    }

    /// What the frames of a log mean, as asked.
    pub(super) fn channels(&self, path: &Path, log: &BusLog) -> Result<Recording, BadInput> {
        let (_, terms) = self.terms()?;
        let recording = formats::dbc::channels(log, &self.dbc()?, None);
        self.named(path, recording.map_err(in_file(path))?, &terms)
    }

    fn named(
        &self,
        path: &Path,
        recording: Recording,
        terms: &[(String, Term)],
    ) -> Result<Recording, BadInput> {
        let named = in_file::<RecordingError>(path);
        let recording = recording.renamed(terms).map_err(&named)?;
        recording.within(&self.stretches()?).map_err(named)
    }

    /// The time, and the other channels that get another name.
    fn terms(&self) -> Result<(Option<Term>, Names), BadInput> {
        let mut terms = Vec::new();
        for map in &self.map {
            let wanted = || format!("--map {map}: NAME=CHANNEL is wanted");
            let (name, channel) = map.split_once('=').ok_or_else(wanted)?;
            let term = channel.parse::<Term>().map_err(|e| format!("--map {map}: {e}"))?;
            terms.push((name.trim().to_owned(), term));
        }
        let time = self.time.as_deref().map(str::parse).transpose();
        let mut time: Option<Term> = time.map_err(|e| format!("--time: {e}"))?;
        if let Some(place) = terms.iter().position(|(name, _)| name == "time_s") {
            let (_, term) = terms.remove(place);
            if time.replace(term).is_some() {
                return Err("--time and --map time_s=CHANNEL: one of them is wanted".into());
            }
        }
        Ok((time, terms))
    }

    /// The channels of a file as a CSV table.
    pub(super) fn table(&self, path: &Path) -> Result<Vec<u8>, BadInput> {
        let recording = match self.read(path)? {
            Contents::Channels(recording) => recording,
            Contents::Frames(log) => self.channels(path, &log)?,
        };
        print_notes(recording.notes.iter());
        Ok(formats::to_csv(recording)?)
    }

    /// Longest pause that is bridged, s, if it is given.
    pub(super) fn max_gap(&self) -> Result<Option<f64>, BadInput> {
        if let Some(max_gap) = self.max_gap {
            in_range("--max-gap", max_gap, 0.0..=1.0, "s")?;
        }
        Ok(self.max_gap)
    }
}

impl RecordingArguments {
    /// The log in this or another file, of which these stretches will be used, and what a reader of the results has to know of it.
    pub(super) fn open(
        &self,
        path: &Path,
        manual: bool,
        stretches: &[(f64, f64)],
    ) -> Result<(DriveLog, Vec<String>), BadInput> {
        self.reading
            .open(path, manual, stretches, self.vehicle.as_deref())
    }
}
