//! A run under way: its loop, its record, and what the page asks of them.

use haptic_core::bus::Frame;
use haptic_core::bus::e2e::ReceiverState;
use haptic_core::bus::messages::{Column, Guidance as GuidanceMessage, Message};
use haptic_core::controller::config::Config;
use haptic_core::observer::{Sensor, State};
use haptic_log::trace::{CHANNELS, Sample, Trace};
use haptic_metrics::{self as metrics, Circumstances, Metrics, Window, measure};
use haptic_sim::guidance::{AnyGuidance, Guidance, OwnLaw};
use haptic_sim::input::InputError;
use haptic_sim::kind::Make;
use haptic_sim::laws::{LAWS, Law, LawView};
use haptic_sim::models::STEPS_PER_SECOND;
use haptic_sim::models::road::Course;
use haptic_sim::parts::PaperPair;
use haptic_sim::scenario::{Condition, Failure, FailureKind};
use haptic_sim::simulation::{DIVERGED_M, Ending, Outcome, SAMPLE_RATE_HZ};
use haptic_sim::{Action, Scenario, Simulation};

use crate::LabResult;

/// Numbers of [`Record::now`], by their places: time, arc length, lateral error, heading error, wheel angle, driver torque,
/// applied torque, mode, limit, warning, e_y and e_theta at the driver's points, speed, wheel rate, steps, diverged, K_hg as
/// the ECU tells it and its deviation (NaN until it does), the driver torque as the ECU takes it (NaN without one).
pub(crate) const NOW: usize = 19;
/// Which of them are recorded beside the channels of the log.
const SAID: [usize; 7] = [7, 8, 9, 16, 17, 5, 18];

/// What a run leaves behind.
pub(crate) struct Record {
    /// The actuator's ear: how the page knows the limit.
    receiver: ReceiverState,
    config: Config,
    /// The ECU's ear for the column, its last frame, and what the observer remembers of a bar.
    column: (ReceiverState, Option<Column>, State),
    pub(crate) trace: Trace,
    said: Vec<[f64; SAID.len()]>,
    pub(crate) now: [f64; NOW],
}

enum Loop {
    Shipping(Box<Simulation>),
    Law(Box<Simulation<OwnLaw>>),
}

pub(crate) struct Run {
    pub(crate) scenario: Scenario,
    simulation: Loop,
    pub(crate) record: Record,
}

impl Run {
    /// The start of a scenario's run: with a law of the library by its place, or the page's own behind them, in the place of
    /// the shipping one; and with nobody in the place of the driver model, where a person drives.
    pub(crate) fn begin(
        toml: &str,
        courses: &[(String, Course)],
        law: Option<usize>,
        person: bool,
    ) -> LabResult<Self> {
        let scenario = Scenario::from_toml("this page", toml, |name, _| {
            let known = courses.iter().find(|(known, _)| known == name);
            let missing = || InputError::new(name, "this road is not in the page: drop its file on it");
            known.map(|(_, course)| course.clone()).ok_or_else(missing)
        })?;
        scenario.check_times()?;
        let pair = if person {
            PaperPair::without_driver(&scenario)
        } else {
            PaperPair::new(&scenario)
        };
        let simulation = match law.filter(|_| scenario.condition() != Condition::Manual) {
            None => {
                let guidance = AnyGuidance::new(&scenario);
                Loop::Shipping(Box::new(Simulation::with_driver_vehicle(
                    &scenario, pair, guidance,
                )))
            }
            Some(place) => {
                let law = OwnLaw::new(&scenario, law_at(place, &scenario)?);
                Loop::Law(Box::new(Simulation::with_driver_vehicle(&scenario, pair, law)))
            }
        };
        let record = Record::new(scenario.setup().config);
        Ok(Self {
            scenario,
            simulation,
            record,
        })
    }

    /// One step; whether there was one.
    pub(crate) fn step(&mut self, action: &Action) -> bool {
        match &mut self.simulation {
            Loop::Shipping(simulation) => self.record.step(simulation, action),
            Loop::Law(simulation) => self.record.step(simulation, action),
        }
    }

    /// The largest lateral error of the next seconds, m, if `lost` fails in the coming step; 10 m and more of a run that leaves
    /// the road, `None` if something has failed before. The run itself goes on as it was.
    pub(crate) fn peak_if_m(&self, lost: FailureKind, lasts_s: f64) -> Option<f64> {
        let failure = Failure {
            kind: lost,
            time_s: 0.0,
            duration_s: None,
        };
        match &self.simulation {
            Loop::Shipping(simulation) => peak_of_fork_m(simulation, failure, lasts_s),
            Loop::Law(simulation) => peak_of_fork_m(simulation, failure, lasts_s),
        }
    }

    /// What a run is judged by, as the command line has it: over a stretch of road, with its failure.
    pub(crate) fn metrics(&self, from_m: f64, to_m: f64) -> Metrics {
        let scenario = &self.scenario;
        let guidance = scenario.guidance();
        let is_probed = guidance.probe && scenario.condition() != Condition::Manual;
        let failure = scenario.failure();
        measure(
            &self.record.trace,
            &Circumstances {
                speed_m_s: scenario.speed_m_per_s(),
                lane_width_m: scenario.course().lane_width_m(),
                window: Some(Window { from_m, to_m }),
                failure: (failure.kind != FailureKind::None).then_some(metrics::Failure {
                    time_s: failure.time_s,
                    nominal_peak_lateral_error_m: None,
                }),
                probe_hz: is_probed.then_some(guidance.controller.probe_frequency_hz),
            },
        )
    }
}

impl Record {
    fn new(config: Config) -> Self {
        let mut now = [0.0; NOW];
        now[16..].fill(f64::NAN);
        Self {
            receiver: ReceiverState::TRUSTED,
            config,
            column: (ReceiverState::TRUSTED, None, State::NEW),
            trace: Trace {
                sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
                samples: Vec::new(),
            },
            said: Vec::new(),
            now,
        }
    }

    fn step<G: Guidance>(&mut self, simulation: &mut Simulation<G>, action: &Action) -> bool {
        if let Some(outcome) = simulation.step(action) {
            self.take(&outcome);
            return true;
        }
        let diverged = matches!(simulation.ending(), Some(Ending::Diverged { .. }));
        self.now[15] = f64::from(u8::from(diverged));
        false
    }

    /// The driver torque as the ECU takes it, N.m: what it reads of the frames that it gets, or what its own observer makes of a bar.
    fn driver_torque_nm(&mut self, frames: &[Frame]) -> Option<f64> {
        let (receiver, last, observed) = &mut self.column;
        let frame = frames.iter().find(|frame| frame.id() == Column::ID);
        let new = frame.and_then(|frame| Column::decode(receiver, frame).ok());
        *last = new.or(*last);
        let read = last.as_ref()?.driver_torque;
        let torque = match self.config.sensor() {
            Some(Sensor::Bar(observer)) => observer.step(observed, read, new.map(|new| new.wheel_angle)),
            _ => read,
        };
        Some(torque.nm())
    }

    fn take(&mut self, outcome: &Outcome) {
        let driver_torque_nm = self.driver_torque_nm(outcome.frames_in);
        let now = &mut self.now;
        if let Some(Ok(said)) = outcome
            .frames_out
            .first()
            .map(|frame| GuidanceMessage::decode(&mut self.receiver, frame))
        {
            now[8] = f64::from(said.limit as u8);
        }
        if let Some(status) = outcome.status {
            now[7] = f64::from(status.mode as u8);
            now[9] = f64::from(u8::from(status.warning));
            if let Some(reading) = status.k_hg {
                now[16..18].copy_from_slice(&reading);
            }
        }
        if let Some(Sample {
            s_m,
            lateral_error_m,
            heading_error_rad,
            wheel_rate_rad_per_s,
            ..
        }) = outcome.sample
        {
            (now[1], now[2], now[3]) = (s_m, lateral_error_m, heading_error_rad);
            now[13] = wheel_rate_rad_per_s;
        }
        now[18] = driver_torque_nm.unwrap_or(f64::NAN);
        let seen = outcome.observation;
        now[0] = outcome.time_s();
        now[4] = seen.wheel_angle_rad;
        now[5] = seen.driver_torque_nm;
        now[6] = outcome.applied_torque_nm;
        (now[10], now[11]) = (outcome.preview.e_y_m, outcome.preview.e_theta_rad);
        now[12] = seen.speed_m_per_s;
        now[14] = f64::from(seen.step);
        if let Some(sample) = outcome.sample {
            self.trace.samples.push(sample);
            self.said.push(SAID.map(|place| self.now[place]));
        }
    }

    /// The samples of a channel, by its place among the columns of the log; behind them mode, limit, warning, K_hg, its
    /// deviation, the torque that the column's sensor reads and the driver torque as the ECU takes it.
    pub(crate) fn channel(&self, place: usize) -> Vec<f64> {
        match CHANNELS.get(place) {
            Some(channel) => self.trace.samples.iter().map(channel.value).collect(),
            None => {
                let place = place - CHANNELS.len();
                self.said
                    .iter()
                    .filter_map(|said| said.get(place))
                    .copied()
                    .collect()
            }
        }
    }

    pub(crate) fn csv(&self) -> LabResult<String> {
        let mut csv = Vec::new();
        self.trace.write_csv(&mut csv)?;
        Ok(String::from_utf8(csv)?)
    }
}

fn peak_of_fork_m<G: Guidance + Clone>(trunk: &Simulation<G>, failure: Failure, lasts_s: f64) -> Option<f64> {
    let steps_per_s = f64::from(STEPS_PER_SECOND);
    let time_s = f64::from(trunk.steps()) / steps_per_s;
    let mut fork = trunk.fork_at(Failure { time_s, ..failure })?;
    let mut peak_m: f64 = 0.0;
    for _ in 0..(lasts_s * steps_per_s) as u32 {
        let Some(outcome) = fork.step(&Action::default()) else {
            break;
        };
        if let Some(sample) = outcome.sample {
            peak_m = peak_m.max(sample.lateral_error_m.abs());
        }
    }
    Some(match fork.ending() {
        Some(Ending::Diverged { .. }) => peak_m.max(DIVERGED_M),
        _ => peak_m,
    })
}

fn law_at(place: usize, scenario: &Scenario) -> LabResult<Box<dyn Law>> {
    let made = match LAWS.get(place) {
        None => return Ok(Box::new(PageLaw)),
        Some(kind) => match &kind.make {
            Make::Part(make) => make(scenario, &kind.defaults()),
            Make::Given(make) => make(scenario, &kind.defaults()),
            // The only limit of the library is around its paper's law.
            Make::Around(make) => {
                let paper = LAWS.iter().find(|kind| kind.name == "paper");
                match paper.map(|paper| (&paper.make, paper.defaults())) {
                    Some((Make::Part(paper), values)) => {
                        paper(scenario, &values).map(|law| make(scenario, &kind.defaults(), law))
                    }
                    _ => return Err("the library has no law of the paper".into()),
                }
            }
        },
    };
    Ok(made?)
}

/// The law that stands in the page: JavaScript, asked in every step.
#[derive(Debug, Clone, Copy)]
struct PageLaw;

unsafe extern "C" {
    /// The torque that the page's law asks for, N.m, of ten numbers: time, e_y, its rate, e_theta, its rate, driver torque,
    /// wheel angle, its rate, speed, K_hg (NaN if not told).
    safe fn law(seen: *const f64) -> f64;
}

impl Law for PageLaw {
    fn ask(&mut self, view: &LawView) -> f64 {
        let seen = [
            f64::from(view.step) * 1e-3,
            view.e_y_m,
            view.e_y_rate_m_per_s,
            view.e_theta_rad,
            view.e_theta_rate_rad_per_s,
            view.driver_torque_nm,
            view.wheel_angle_rad,
            view.wheel_rate_rad_per_s,
            view.speed_m_per_s,
            view.k_hg.unwrap_or(f64::NAN),
        ];
        law(seen.as_ptr())
    }
}
