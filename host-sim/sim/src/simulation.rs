//! The closed loop as a value: driver, guidance, column, vehicle and road, moved by one call a millisecond.
//!
//! A [`Simulation`] holds all that evolves; the road is shared. Everything from outside in one step is an
//! [`Action`], everything that came of it an [`Outcome`]. A clone and its original give the same bits for the same
//! actions.
//!
//! Every run starts at s = 0 on the centreline, tangent to it, with all states zero and the guidance active,
//! and ends when the farthest point that anybody looks at (with table 8 the driver's far point) reaches the
//! end of the course. Order within a step: look at the road, let the guidance decide, record, then let the
//! plant move for 1 ms under the torque decided.
//!
//! A run has *diverged* when the centre of gravity is more than 10 m off the centreline, when the
//! direction of movement is more than 90 degrees off the road's at a far point, or when a look-ahead point has
//! no unique projection on the centreline. It is stopped there and flagged; its samples up to there are finite.

use std::sync::Arc;

use haptic_core::bus::Frame;
use haptic_log::trace::{Sample, Trace};

use crate::action::{Action, Request, WorldFaults};
use crate::guidance::{Actuation, AnyGuidance, Guidance, LaneErrors, Observation, Status};
use crate::models::disturbances::{ErringCamera, ErringGyro, SensorErrors};
use crate::models::driver::{Remnant, Vision};
use crate::models::plant::{Plant, PlantInput, Transition};
use crate::models::real::RealPlant;
use crate::models::road::{Centreline, Projection, Tracker};
use crate::models::tolerances::Car;
use crate::models::{STEP_S, STEPS_PER_SECOND};
use crate::preview::{PreviewPoints, wrapped};
use crate::scenario::{FAILURE_REACTION_S, Failure, FailureKind, Scenario, SpeedProfile};
use crate::seeds::Stream;
use crate::unguided::{Cause, Circumstances, Watch};

/// Nobody is on the road that far from the middle of a lane; a wide exit that comes back is no divergence.
pub(crate) const DIVERGED_M: f64 = 10.0;

/// So far below the least speed that is guided the driver stops asking, m/s: behind the ECU, which leaves there by itself.
const STOPS_ASKING_M_PER_S: f64 = 0.5;
/// So long at that speed or faster the driver asks again, in steps: the ECU wants half a second of good inputs first.
const ASKS_AGAIN_STEPS: u32 = STEPS_PER_SECOND;

/// Samples per second of a trace.
pub const SAMPLE_RATE_HZ: u32 = 200;
/// Steps from one sample of a trace to the next.
pub const STEPS_PER_SAMPLE: u32 = STEPS_PER_SECOND / SAMPLE_RATE_HZ;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ending {
    /// At the end of the course.
    CourseEnd,
    /// Diverged, after this arc length.
    Diverged {
        /// Last arc length on record, m.
        s_m: f64,
    },
}

/// What a run leaves behind.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Its samples.
    pub trace: Trace,
    /// How it ended.
    pub ending: Ending,
    /// Steps simulated; one is 1 ms.
    pub steps: u32,
}

impl Run {
    /// Whether the run was stopped because it diverged.
    pub fn diverged(&self) -> bool {
        self.ending != Ending::CourseEnd
    }
}

/// What came of one step, after the guidance has decided.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    /// Lane errors at the driver's points.
    pub preview: LaneErrors,
    /// What the guidance could look at.
    pub observation: Observation,
    /// The torque that it decided.
    pub decided: Actuation,
    /// The torque really applied, N.m: zero while the torque is lost.
    pub applied_torque_nm: f64,
    /// What the ECU says of itself; `None` without guidance.
    pub status: Option<Status>,
    /// Why the guidance is away, if it is.
    pub unguided: Option<Cause>,
    /// The truth of this instant, 200 times a second.
    pub sample: Option<Sample>,
    /// The frames that went to the ECU, in order of sending.
    pub frames_in: &'a [Frame],
    /// The frames that came from it, the guidance frame first.
    pub frames_out: &'a [Frame],
}

impl Outcome<'_> {
    /// Time since the start of the run, s.
    pub fn time_s(&self) -> f64 {
        f64::from(self.observation.step) * STEP_S
    }
}

/// A closed loop under way.
#[derive(Debug, Clone)]
pub struct Simulation<G = AnyGuidance> {
    pub(crate) road: Arc<Centreline>,
    pub(crate) plan: Plan,
    guidance: G,
    plant: Plant,
    /// What moves the plant where the paper's model does not do.
    pub(crate) real: Option<Box<RealPlant>>,
    /// What the sensors add, if they add anything.
    pub(crate) sensing: Option<Box<Sensing>>,
    pub(crate) vision: Vision,
    pub(crate) remnant: Remnant,
    pub(crate) driver_points: PreviewPoints,
    pub(crate) camera: PreviewPoints,
    pub(crate) body: Tracker,
    /// Speed of the vehicle now, and where along the road it is.
    speed_m_per_s: f64,
    place_m: f64,
    /// Who asks for guidance, if the host does not say.
    request: AskingDriver,
    /// The run ends when the driver's far point gets there.
    pub(crate) end_m: f64,
    /// Step in which something first went wrong.
    failed_at: Option<u32>,
    watch: Watch,
    target_now_rad: f64,
    motor_torque_nm: f64,
    last_s_m: f64,
    lateral_error_m: Option<f64>,
    step: u32,
    ending: Option<Ending>,
}

/// A driver whose speed changes: the ECU leaves where it is slower than is guided, and takes only a request that rises.
#[derive(Debug, Clone)]
struct AskingDriver {
    least_m_per_s: f64,
    asks: bool,
    /// Steps at the least speed or faster, since the last slower one.
    fast: u32,
}

impl AskingDriver {
    fn new(least_m_per_s: f64) -> Self {
        Self {
            least_m_per_s,
            asks: true,
            fast: ASKS_AGAIN_STEPS,
        }
    }

    fn step(&mut self, v_m_per_s: f64) {
        self.fast = if v_m_per_s < self.least_m_per_s {
            0
        } else {
            self.fast.saturating_add(1)
        };
        self.asks = if self.asks {
            v_m_per_s >= self.least_m_per_s - STOPS_ASKING_M_PER_S
        } else {
            self.fast >= ASKS_AGAIN_STEPS
        };
    }
}

/// What the scenario decides for every step.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// How the speed changes, if it does.
    pub(crate) speed: Option<SpeedProfile>,
    /// How far ahead anybody looks, and the driver, s.
    ahead_s: [f64; 2],
    duration_s: f64,
    relying: Transition,
    manual: Transition,
    pub(crate) changed: Option<(u32, Transition)>,
    probe: bool,
    failure: FailureKind,
    pub(crate) failure_step: u32,
}

impl Simulation {
    /// The start of a scenario's run, with the guidance that its condition and sensors name.
    pub fn new(scenario: &Scenario) -> Self {
        Self::with(scenario, AnyGuidance::of(scenario))
    }
}

impl<G: Guidance> Simulation<G> {
    /// The start of a scenario's run with any guidance; the scenario's condition and sensors do not choose it.
    pub fn with(scenario: &Scenario, guidance: G) -> Self {
        let road = scenario.course().centreline();
        let v = scenario.speed_m_per_s();
        let driver = scenario.driver();
        let [t_n, t_f] = [scenario.guidance().t_n, scenario.guidance().t_f];
        let plan = Plan::new(scenario);
        Self {
            speed_m_per_s: v,
            place_m: 0.0,
            end_m: plan.end_m(&road, v),
            request: AskingDriver::new(scenario.controller_params().least_speed_m_per_s),
            plan,
            guidance,
            plant: Plant::default(),
            real: real(scenario),
            sensing: Sensing::of(scenario),
            vision: Vision::new(driver),
            remnant: Remnant::new(driver, Stream::Remnant.seed(scenario.seed())),
            driver_points: PreviewPoints::new(&road, [driver.t_n, driver.t_f], v),
            camera: PreviewPoints::new(&road, [t_n, t_f], v),
            body: road.tracker(0.0),
            failed_at: None,
            watch: Watch::default(),
            target_now_rad: 0.0,
            motor_torque_nm: 0.0,
            last_s_m: 0.0,
            lateral_error_m: None,
            step: 0,
            ending: None,
            road,
        }
    }

    /// One step of 1 ms; `None` once the run has ended.
    #[inline]
    pub fn step(&mut self, action: &Action) -> Option<Outcome<'_>> {
        if self.ending.is_some() {
            return None;
        }
        let Some((preview, far_s_m)) = self.driver_points.look(&self.road, &self.plant) else {
            return self.diverge();
        };
        if far_s_m >= self.end_m {
            self.ending = Some(Ending::CourseEnd);
            return None;
        }
        let is_sample = self.step.is_multiple_of(STEPS_PER_SAMPLE);
        let looks = self.guidance.looks_at_road(self.step);
        let lane = if looks || is_sample {
            let Some((errors, _)) = self.camera.look(&self.road, &self.plant) else {
                return self.diverge();
            };
            Some(errors)
        } else {
            None
        };
        let faults = self.plan.faults(self.step).or(action.world);
        if faults.any() && self.failed_at.is_none() {
            self.failed_at = Some(self.step);
        }
        let remnant_nm = self.remnant.step() + action.hand_torque_nm;
        let observation = Observation {
            step: self.step,
            lane: lane.filter(|_| looks && !faults.lane_lost),
            lane_age_ms: 0,
            driver_torque_nm: self.plant.arm_torque_nm() + remnant_nm,
            wheel_angle_rad: self.plant.wheel_angle_rad(),
            motor_torque_nm: self.motor_torque_nm,
            speed_m_per_s: self.speed_m_per_s,
            yaw_rate_rad_per_s: Some(self.plant.yaw_rate_rad_per_s()),
            request: self.plan.request(action, self.request.asks),
        };
        let seen = match &mut self.sensing {
            None => observation,
            Some(sensing) => sensing.of_truth(&observation),
        };
        let decided = self.guidance.step(&seen);
        let status = self.guidance.status();
        if let Some(status) = &status {
            self.watch
                .step(status, self.circumstances(action, faults, seen.speed_m_per_s));
        }
        let applied = if faults.torque_lost {
            Actuation::default()
        } else {
            decided
        };
        let camera = lane.filter(|_| is_sample);
        let sample = camera.and_then(|camera| self.sample(&observation, [preview, camera], applied));
        if self.ending.is_none() {
            self.move_on(preview, applied.torque_nm, remnant_nm, action.takes_over);
        }
        Some(Outcome {
            preview,
            observation: seen,
            decided,
            applied_torque_nm: applied.torque_nm,
            status,
            unguided: self.watch.cause(),
            sample,
            frames_in: self.guidance.frames_in(),
            frames_out: self.guidance.frames_out(),
        })
    }

    /// What an end of guidance is judged by.
    #[inline]
    fn circumstances(&self, action: &Action, lost: WorldFaults, speed_m_per_s: f64) -> Circumstances {
        Circumstances {
            lost,
            request_ended: action.engage == Some(false),
            speed_m_per_s,
            least_speed_m_per_s: self.request.least_m_per_s,
        }
    }

    /// A sample for the record; none, and the end of the run, where the vehicle has left the road.
    #[inline]
    fn sample(
        &mut self,
        observation: &Observation,
        seen: [LaneErrors; 2],
        applied: Actuation,
    ) -> Option<Sample> {
        let [x, y] = self.plant.position_m();
        match self.road.project(x, y, &mut self.body) {
            Some(projection) if projection.offset_m.abs() <= DIVERGED_M => {
                self.last_s_m = projection.s_m;
                self.place_m = projection.s_m;
                self.lateral_error_m = Some(projection.offset_m);
                let cause = self.watch.cause();
                Some(record(
                    &self.plant,
                    &projection,
                    observation,
                    seen,
                    applied,
                    cause,
                ))
            }
            _ => {
                self.ending = Some(Ending::Diverged { s_m: self.last_s_m });
                None
            }
        }
    }

    /// Lets the plant move for 1 ms.
    #[inline]
    fn move_on(&mut self, preview: LaneErrors, guidance_torque_nm: f64, remnant_nm: f64, takes_over: bool) {
        let target_next_rad = self.vision.step(preview.e_y_m, preview.e_theta_rad);
        let input = PlantInput {
            target_now_rad: self.target_now_rad,
            target_next_rad,
            guidance_torque_nm,
            remnant_nm,
        };
        let transition = if takes_over {
            &self.plan.manual
        } else {
            self.plan.transition(self.step, self.failed_at)
        };
        let now = self.speed_m_per_s;
        let next = match &self.plan.speed {
            None => now,
            Some(speed) => {
                self.request.step(now);
                let time_s = f64::from(self.step + 1) * STEP_S;
                speed.at(time_s, self.place_m + now * STEP_S)
            }
        };
        self.motor_torque_nm = match &mut self.real {
            None => {
                self.plant.step(transition, &input);
                guidance_torque_nm
            }
            Some(real) => {
                let bank_rad = self.road.surface(&self.body).bank_rad;
                real.step(&mut self.plant, [now, next], transition.gains(), &input, bank_rad);
                real.motor_torque_nm()
            }
        };
        if next != now {
            self.change_speed(next);
        }
        // Until the next sample projects it.
        self.place_m += now * STEP_S;
        self.target_now_rad = target_next_rad;
        self.step += 1;
    }

    /// Whatever is looked at by time is looked at in another place.
    fn change_speed(&mut self, v_m_per_s: f64) {
        self.speed_m_per_s = v_m_per_s;
        self.driver_points.at_speed(v_m_per_s);
        self.camera.at_speed(v_m_per_s);
        self.end_m = self.plan.end_m(&self.road, v_m_per_s);
    }

    fn diverge(&mut self) -> Option<Outcome<'_>> {
        self.ending = Some(Ending::Diverged { s_m: self.last_s_m });
        None
    }

    /// Drives to the end as the scenario has it.
    pub fn run(self) -> Run {
        self.run_observed(|_| ())
    }

    /// Drives to the end as the scenario has it; `observe` sees every step.
    pub fn run_observed(mut self, mut observe: impl FnMut(&Outcome)) -> Run {
        let left_s = self.plan.duration_s - f64::from(self.step) * STEP_S;
        let samples = left_s * f64::from(SAMPLE_RATE_HZ);
        let mut trace = Trace {
            sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
            samples: Vec::with_capacity(samples as usize + 2),
        };
        while let Some(outcome) = self.step(&Action::default()) {
            observe(&outcome);
            trace.samples.extend(outcome.sample);
        }
        Run {
            trace,
            ending: self.ending.unwrap_or(Ending::CourseEnd),
            steps: self.step,
        }
    }

    /// A clone that fails as `failure` has it in the place of what the scenario plans, if this is the step in which it
    /// fails (it then differs from here on) or nothing fails; `None` in any other step.
    pub fn fork_at(&self, failure: Failure) -> Option<Self>
    where
        G: Clone,
    {
        let failure_step = failure.at_s().map_or(self.step, step_of);
        (self.step == failure_step && self.failed_at.is_none()).then(|| {
            let mut fork = self.clone();
            fork.plan.failure = failure.kind;
            fork.plan.failure_step = failure.at_s().map_or(u32::MAX, step_of);
            fork
        })
    }

    /// From the next step on the driver is that of another scenario in weights, delay and gains of the arm. Muscle, remnant
    /// and look-ahead stay what they were.
    pub fn change_driver(&mut self, to: &Scenario) {
        self.plan.relying = relying(to);
        self.vision.change(to.driver());
    }

    /// How the run ended, if it has.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Steps simulated so far, which is the number of the next; one is 1 ms.
    pub fn steps(&self) -> u32 {
        self.step
    }

    /// Torque of the driver's arm at the start of the next step, without remnant and hand, N.m.
    pub fn arm_torque_nm(&self) -> f64 {
        self.plant.arm_torque_nm()
    }

    /// Who guides.
    pub fn guidance(&self) -> &G {
        &self.guidance
    }

    /// Who guides, to be told what to do in the next step.
    pub fn guidance_mut(&mut self) -> &mut G {
        &mut self.guidance
    }

    /// Offset of the centre of gravity from the centreline at the last sample, m, left positive.
    pub fn lateral_error_m(&self) -> Option<f64> {
        self.lateral_error_m
    }

    /// Position of the centre of gravity, m, and the direction of movement, rad, not wrapped.
    pub fn place(&self) -> ([f64; 2], f64) {
        (self.plant.position_m(), self.plant.direction_rad())
    }

    /// Who guided, for what it kept.
    pub fn into_guidance(self) -> G {
        self.guidance
    }
}

impl Plan {
    fn new(scenario: &Scenario) -> Self {
        let v = scenario.speed_m_per_s();
        let (vehicle, driver) = (scenario.car().vehicle, scenario.driver());
        let transition = |gains| Transition::new(v, &vehicle, driver, gains);
        let failure = scenario.failure();
        Self {
            speed: scenario.changes_speed().then(|| scenario.speed_profile().clone()),
            ahead_s: [scenario.longest_look_ahead_s(), driver.t_f],
            duration_s: scenario.duration_s(),
            relying: relying(scenario),
            manual: transition(scenario.manual_gains()),
            changed: scenario
                .driver_change()
                .map(|change| (step_of(change.time_s), transition(change.gains()))),
            probe: scenario.guidance().probe,
            failure: failure.kind,
            failure_step: failure.at_s().map_or(u32::MAX, step_of),
        }
    }

    /// Where the driver's far point is at a speed when the farthest that anybody looks at gets to the road's end, m.
    pub(crate) fn end_m(&self, road: &Centreline, v_m_per_s: f64) -> f64 {
        let [longest_s, driver_s] = self.ahead_s;
        road.length_m() - (v_m_per_s * longest_s - v_m_per_s * driver_s)
    }

    /// What the scenario lets go wrong.
    pub(crate) fn faults(&self, step: u32) -> WorldFaults {
        let fails = step >= self.failure_step;
        WorldFaults {
            torque_lost: fails && self.failure == FailureKind::Torque,
            lane_lost: fails && self.failure == FailureKind::Input,
        }
    }

    fn request(&self, action: &Action, asks: bool) -> Request {
        Request {
            engage: action.engage.unwrap_or(asks),
            authority: action.authority.map_or(1.0, |share| {
                if share.is_nan() {
                    0.0
                } else {
                    share.clamp(0.0, 1.0)
                }
            }),
            probe: action.probe.unwrap_or(self.probe),
        }
    }

    /// How the driver's arm moves: a driver notices a failure after a second and then drives as manually.
    pub(crate) fn transition(&self, step: u32, failed_at: Option<u32>) -> &Transition {
        let noticed = failed_at.is_some_and(|at| step >= at.saturating_add(step_of(FAILURE_REACTION_S)));
        match &self.changed {
            _ if noticed => &self.manual,
            Some((at, changed)) if step >= *at => changed,
            _ => &self.relying,
        }
    }
}

/// How the arm of a driver moves who has guidance.
fn relying(scenario: &Scenario) -> Transition {
    let vehicle = &scenario.car().vehicle;
    Transition::new(
        scenario.speed_m_per_s(),
        vehicle,
        scenario.driver(),
        scenario.gains(),
    )
}

/// The sensors of a world that is not the paper's.
#[derive(Debug, Clone)]
pub(crate) struct Sensing {
    pub(crate) errors: SensorErrors,
    pub(crate) camera: ErringCamera,
    pub(crate) gyro: ErringGyro,
}

impl Sensing {
    fn of(scenario: &Scenario) -> Option<Box<Self>> {
        let errors = scenario.car().sensor_errors;
        if errors == SensorErrors::default() {
            return None;
        }
        let camera = ErringCamera::new(errors, Stream::Sensors.seed(scenario.seed()));
        let gyro = ErringGyro::new(errors, Stream::Gyro.seed(scenario.seed()));
        Some(Box::new(Self { errors, camera, gyro }))
    }

    /// What the sensors make of the truth.
    fn of_truth(&mut self, truth: &Observation) -> Observation {
        let seen = truth
            .lane
            .and_then(|lane| self.camera.see(truth.step, [lane.e_y_m, lane.e_theta_rad]));
        Observation {
            lane: seen.map(|([e_y_m, e_theta_rad], _)| LaneErrors { e_y_m, e_theta_rad }),
            lane_age_ms: seen.map_or(0, |(_, age_steps)| age_steps),
            driver_torque_nm: self.errors.torque_gain * truth.driver_torque_nm + self.errors.torque_bias,
            wheel_angle_rad: truth.wheel_angle_rad + self.errors.angle_bias.to_radians(),
            speed_m_per_s: self.errors.speed_gain * truth.speed_m_per_s,
            yaw_rate_rad_per_s: truth
                .yaw_rate_rad_per_s
                .map(|rate| self.gyro.see(truth.step, rate)),
            ..*truth
        }
    }
}

/// The plant of a world that is not the paper's.
fn real(scenario: &Scenario) -> Option<Box<RealPlant>> {
    let (car, driver) = (scenario.car(), scenario.driver());
    let Car { world, vehicle, .. } = car;
    // The paper's plant is linear, and exact, at one speed alone.
    if world.is_ideal() && scenario.course().is_level() && !scenario.changes_speed() {
        return None;
    }
    let seed = Stream::World.seed(scenario.seed());
    Some(Box::new(RealPlant::new(world, &vehicle, driver, seed)))
}

/// The step at or next to a time.
pub(crate) fn step_of(time_s: f64) -> u32 {
    (time_s / STEP_S).round() as u32
}

fn record(
    plant: &Plant,
    projection: &Projection,
    observation: &Observation,
    [preview, camera]: [LaneErrors; 2],
    applied: Actuation,
    unguided: Option<Cause>,
) -> Sample {
    Sample {
        time_s: f64::from(observation.step) * STEP_S,
        s_m: projection.s_m,
        lateral_error_m: projection.offset_m,
        heading_error_rad: wrapped(plant.direction_rad() - projection.heading_rad),
        curvature_1pm: projection.curvature_1pm,
        e_y_m: preview.e_y_m,
        e_theta_rad: preview.e_theta_rad,
        guidance_e_y_m: camera.e_y_m,
        guidance_e_theta_rad: camera.e_theta_rad,
        wheel_angle_rad: plant.wheel_angle_rad(),
        wheel_rate_rad_per_s: plant.wheel_rate_rad_per_s(),
        yaw_rate_rad_per_s: plant.yaw_rate_rad_per_s(),
        sideslip_rad: plant.sideslip_rad(),
        speed_m_per_s: observation.speed_m_per_s,
        driver_torque_nm: observation.driver_torque_nm,
        guidance_torque_nm: applied.torque_nm,
        guidance_limited: applied.limited,
        unguided_cause: unguided.map_or(0.0, Cause::code),
    }
}

/// Simulates a scenario.
pub fn simulate(scenario: &Scenario) -> Run {
    observe(scenario, |_| ())
}

/// As [`simulate`]; `watch` sees every step.
pub fn observe(scenario: &Scenario, watch: impl FnMut(&Outcome)) -> Run {
    // Each kind compiled for itself: a step then chooses nothing.
    match AnyGuidance::of(scenario) {
        AnyGuidance::None(guidance) => Simulation::with(scenario, guidance).run_observed(watch),
        AnyGuidance::Direct(guidance) => Simulation::with(scenario, *guidance).run_observed(watch),
        AnyGuidance::OverBus(guidance) => Simulation::with(scenario, *guidance).run_observed(watch),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::driver::DriverParameters;
    use crate::scenario::{Condition, Sensors};

    fn scenario(condition: Condition, sensors: Sensors) -> Scenario {
        let driver = DriverParameters {
            remnant_sd_nm: 0.1,
            ..Default::default()
        };
        let scenario = Scenario::builder().condition(condition).sensors(sensors);
        scenario.driver(driver).build().unwrap()
    }

    fn is_send<T: Send + 'static>(_: &T) {}

    /// A probe, a hand, less authority and both faults of the world, in turn.
    fn action(step: u32) -> Action {
        Action {
            authority: (step % 7000 > 3000).then_some(0.4),
            probe: Some(step % 2000 < 1000),
            hand_torque_nm: if step % 5000 < 40 { 0.7 } else { 0.0 },
            world: WorldFaults {
                torque_lost: (9000..9100).contains(&step),
                lane_lost: (12_000..12_020).contains(&step),
            },
            ..Action::default()
        }
    }

    #[test]
    fn a_clone_in_mid_run_and_its_original_give_the_same_bits() {
        for (condition, sensors) in [
            (Condition::Manual, Sensors::Paper),
            (Condition::High, Sensors::Exact),
            (Condition::High, Sensors::Paper),
        ] {
            let mut original = Simulation::new(&scenario(condition, sensors));
            is_send(&original);
            for _ in 0..7919 {
                original.step(&action(original.steps())).unwrap();
            }
            let mut clone = original.clone();
            let rest = |simulation: &mut Simulation| {
                let mut bits = Vec::new();
                for _ in 0..8000 {
                    let action = action(simulation.steps());
                    let outcome = simulation.step(&action).unwrap();
                    bits.push(outcome.applied_torque_nm.to_bits());
                    bits.push(outcome.preview.e_y_m.to_bits());
                    bits.push(outcome.observation.driver_torque_nm.to_bits());
                    let frames = outcome.frames_in.iter().chain(outcome.frames_out);
                    bits.extend(frames.flat_map(|frame| frame.data().iter().map(|byte| u64::from(*byte))));
                }
                bits
            };
            // The original goes first: what it does must not reach the clone.
            let first = rest(&mut original);
            assert_eq!(first, rest(&mut clone), "{condition} {sensors:?}");
        }
    }

    #[test]
    fn an_action_lets_the_world_fail_as_a_scenario_does() {
        let failure = |kind| {
            let failure = crate::scenario::Failure { kind, time_s: 30.0 };
            let scenario = Scenario::builder().failure(failure).build().unwrap();
            simulate(&scenario).trace
        };
        let acted = |world: WorldFaults| {
            let mut simulation = Simulation::new(&Scenario::default());
            let mut samples = Vec::new();
            loop {
                let failing = simulation.steps() >= 30_000;
                let action = Action {
                    world: if failing { world } else { WorldFaults::default() },
                    ..Action::default()
                };
                let Some(outcome) = simulation.step(&action) else {
                    break samples;
                };
                samples.extend(outcome.sample);
            }
        };
        let (torque_lost, lane_lost) = (true, false);
        assert_eq!(
            acted(WorldFaults {
                torque_lost,
                lane_lost
            }),
            failure(FailureKind::Torque).samples
        );
        let (torque_lost, lane_lost) = (false, true);
        assert_eq!(
            acted(WorldFaults {
                torque_lost,
                lane_lost
            }),
            failure(FailureKind::Input).samples
        );
    }

    /// On the first curve the paper's guidance gives about 0.4 N.m; a host that allows none of it gets none, and a
    /// host that takes its request back gets a fade to nothing.
    #[test]
    fn the_host_decides_whether_and_how_much() {
        let torque_at_75_s = |action: Action| {
            let mut simulation = Simulation::new(&scenario(Condition::Mid, Sensors::Paper));
            let start = Action::default();
            loop {
                let action = if simulation.steps() < 70_000 {
                    &start
                } else {
                    &action
                };
                let outcome = simulation.step(action).unwrap();
                if outcome.observation.step == 75_000 {
                    return outcome.applied_torque_nm;
                }
            }
        };
        let authority = |share| {
            torque_at_75_s(Action {
                authority: Some(share),
                ..Action::default()
            })
        };
        assert!(authority(1.0) > 0.2, "{}", authority(1.0));
        assert_eq!(authority(7.0), authority(1.0));
        assert_eq!([authority(0.0), authority(-1.0), authority(f64::NAN)], [0.0; 3]);
        let engage = Some(false);
        assert_eq!(
            torque_at_75_s(Action {
                engage,
                ..Action::default()
            }),
            0.0
        );
    }

    #[test]
    fn a_run_that_has_ended_stays_ended() {
        let mut simulation = Simulation::new(&Scenario::default());
        while simulation.step(&Action::default()).is_some() {}
        let (steps, ending) = (simulation.steps(), simulation.ending());
        assert_eq!(ending, Some(Ending::CourseEnd));
        assert!(simulation.step(&Action::default()).is_none());
        assert_eq!((simulation.steps(), simulation.ending()), (steps, ending));
    }
}
