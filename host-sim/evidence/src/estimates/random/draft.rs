//! A drive while it is drawn: what is driven, and what becomes of its rows.

use haptic_analysis::identify::DriveLog;
use haptic_batch::StudyError;
use haptic_sim::Action;
use haptic_sim::models::driver::DriverParameters;
use haptic_sim::models::nonlinear::WorldParameters;
use haptic_sim::models::vehicle::VehicleParameters;
use haptic_sim::participants::PublishedDriver;
use haptic_sim::scenario::{Condition, GuidanceParameters, Scenario};
use rand::RngExt;
use rand::rngs::Xoshiro256PlusPlus;

use super::super::changing::{Changed, DriverChanges, driven_changing};
use super::rows::Rows;

/// Where between the signal and the file something happens to it; what comes first happens first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    /// Before the sensor.
    Signal,
    /// In the sensor.
    Sensor,
    /// Which rows are written.
    Recorder,
    /// What of the file is there, and what it is called.
    File,
}

type Spoil = Box<dyn Fn(&mut Rows, &mut Xoshiro256PlusPlus)>;

/// How the driver changes, if so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Change {
    /// Something goes to a value, and stays there.
    Step(Changed, f64),
    /// K_hg moves by so much, and goes back after so long, s.
    Blip(f64, f64),
    /// K_hg goes to and fro between two values, each for so long, s.
    Swing(f64, f64),
}

/// A drive while it is drawn.
pub(super) struct Draft {
    pub(super) first: PublishedDriver,
    pub(super) driver: DriverParameters,
    pub(super) vehicle: VehicleParameters,
    pub(super) world: WorldParameters,
    pub(super) guidance: GuidanceParameters,
    pub(super) speed_kmh: f64,
    pub(super) manual: bool,
    pub(super) called_manual: bool,
    /// What whoever recorded the drive knows and says.
    pub(super) assisted: bool,
    pub(super) change: Option<Change>,
    seed: u64,
    spoils: Vec<(Stage, Spoil)>,
}

impl Draft {
    /// A published driver with the probe in the paper's world.
    pub(super) fn new(first: PublishedDriver, driver: DriverParameters, probe_nm: f64, seed: u64) -> Self {
        let mut guidance = GuidanceParameters {
            probe: probe_nm != 0.0,
            ..GuidanceParameters::default()
        };
        if guidance.probe {
            guidance.controller.probe_amplitude_nm = probe_nm;
        }
        Self {
            first,
            driver,
            vehicle: VehicleParameters::default(),
            world: WorldParameters::default(),
            guidance,
            speed_kmh: 60.0,
            manual: false,
            called_manual: false,
            assisted: false,
            change: None,
            seed,
            spoils: Vec::new(),
        }
    }

    /// Something happens to the rows.
    pub(super) fn spoil(
        &mut self,
        stage: Stage,
        spoil: impl Fn(&mut Rows, &mut Xoshiro256PlusPlus) + 'static,
    ) {
        self.spoils.push((stage, Box::new(spoil)));
    }

    /// The driver at the begin and at the end of the drive.
    pub(super) fn ends(&self) -> [PublishedDriver; 2] {
        let mut last = self.first;
        match self.change {
            Some(Change::Step(Changed::KHg, to)) => last.k_hg = Some(to),
            Some(Change::Step(Changed::KD, to)) => last.k_d = to,
            Some(Change::Step(Changed::TP, to)) => last.t_p = to,
            Some(Change::Blip(..) | Change::Swing(..)) | None => {}
        }
        [self.first, last]
    }

    /// What the torque of a driver depends on: the gains with this driver's arm, t_p and K_hg.
    pub(super) fn truth(&self, driver: &PublishedDriver) -> [f64; 5] {
        let sum = driver.k_d + self.driver.k_nms;
        let gains = [driver.a_1, driver.a_2, driver.a_3].map(|a| sum * a);
        [
            gains[0],
            gains[1],
            gains[2],
            driver.t_p,
            driver.k_hg.unwrap_or(0.0),
        ]
    }

    /// Drives, and gives the rows before anything happened to them.
    ///
    /// # Errors
    /// A value that no scenario takes.
    pub(super) fn drive(&self, random: &mut Xoshiro256PlusPlus) -> Result<DriveLog, StudyError> {
        let first = &self.first;
        let condition = if self.manual {
            Condition::Manual
        } else {
            Condition::Custom
        };
        let mut gains = first.gains();
        if self.manual {
            gains.k_hg = 0.0;
        }
        let scenario = Scenario::builder()
            .driver(DriverParameters {
                a_1: first.a_1,
                a_2: first.a_2,
                a_3: first.a_3,
                t_p: first.t_p,
                ..self.driver
            })
            .vehicle(self.vehicle)
            .world(self.world)
            .guidance(self.guidance)
            .speed_kmh(self.speed_kmh)
            .condition(condition)
            .gains(gains)
            .seed(self.seed)
            .build()?;
        let changes = self.changes(scenario.duration_s(), random);
        Ok(driven_changing(&scenario, first, &changes, |_| {
            Action::default()
        })?)
    }

    fn changes(&self, duration_s: f64, random: &mut Xoshiro256PlusPlus) -> Vec<DriverChanges> {
        let at_s = duration_s * random.random_range(0.15..0.85);
        let k_hg = self.first.k_hg.unwrap_or(0.0);
        let step = |what, to, at_s| DriverChanges {
            what,
            to,
            at_s,
            over_s: 0.0,
        };
        match self.change {
            None => Vec::new(),
            Some(Change::Step(what, to)) => vec![step(what, to, at_s)],
            Some(Change::Blip(by, for_s)) => vec![
                step(Changed::KHg, k_hg + by, at_s),
                step(Changed::KHg, k_hg, at_s + for_s),
            ],
            Some(Change::Swing(by, for_s)) => (0..)
                .map(|i| (i, for_s * f64::from(i)))
                .take_while(|(_, at_s)| *at_s < duration_s)
                .map(|(i, at_s)| step(Changed::KHg, if i % 2 == 0 { k_hg + by } else { k_hg }, at_s))
                .collect(),
        }
    }

    /// The rows as they are in the file.
    pub(super) fn recorded(&mut self, log: &DriveLog, random: &mut Xoshiro256PlusPlus) -> Rows {
        let mut rows = Rows::new(log);
        self.spoils.sort_by_key(|spoil| spoil.0);
        for (_, spoil) in &self.spoils {
            spoil(&mut rows, random);
        }
        rows
    }
}
