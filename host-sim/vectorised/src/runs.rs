//! The runs that are under way in the lanes, and their millisecond.

mod receive;

use std::cell::Cell;
use std::sync::Arc;

use haptic_log::trace::{Sample, Trace};

use super::checks::Checks;
use super::coast::{BLIND_MS, Coast};
use super::counts::si;
use super::ecu::{Ecus, TIMEOUT_MS};
use super::rejected::Reason;
use super::sensing::Senses;
use super::speeds::Speeds;
use super::world::Worlds;
use super::{ALIVE, Step, either};
use super::{ARM, BETA, WHEEL, WHEEL_RATE, YAW_RATE};
use haptic_sim::models::driver::Remnant;
use haptic_sim::models::plant::Transition;
use haptic_sim::models::road::Centreline;
use haptic_sim::models::sensors::camera_looks;
use haptic_sim::models::{STEP_S, STEPS_PER_SECOND, step_of, wrapped};
use haptic_sim::parts::{ByReliance, DriverVehicle, Mover, PaperPair};
use haptic_sim::scenario::{FailureKind, Scenario};
use haptic_sim::simulation::{Ending, Plan, Run, SAMPLE_RATE_HZ, STEPS_PER_SAMPLE, Sensing};
use haptic_sim::unguided::Cause;

/// After so many steps everything that is periodic (camera, frames, samples) is where it was, so that a run that begins
/// then has the others' rhythm.
const BLOCK: u32 = 50;
/// How much longer a run's way may be than the course: a vehicle that weaves by 8 degrees to both sides throughout.
const DETOUR: f64 = 1.01;

thread_local! {
    /// Room for the samples of a lane each, from the runs before: new room of some megabytes a run would be handed back to
    /// the system and asked for again with every call, page by page.
    static BUFFERS: Cell<Vec<Vec<Sample>>> = const { Cell::new(Vec::new()) };
}

/// What a lane has of its run beside the arrays.
struct Slot {
    /// The scenario's number, while its run is under way or not yet handed on.
    scenario: Option<usize>,
    plan: Option<(Plan, ByReliance<Transition>)>,
    remnant: Option<Remnant>,
    run: Run,
    /// Why the guidance is away, as a sample has it: it leaves only where the scenario lets something fail.
    unguided_cause: f64,
    /// Whether the run came to its end without suspicion.
    is_whole: bool,
    /// The next step in which something is planned.
    event: u32,
    /// The step in which the driver takes over.
    noticed: u32,
    /// The step in which a lane preview that fails ends guidance.
    timeout: u32,
}

pub(super) struct Runs<const N: usize> {
    worlds: Worlds<N>,
    ecus: Ecus<N>,
    checks: Checks<N>,
    senses: Senses<N>,
    speeds: Speeds<N>,
    /// Number of the step in each run.
    own: [i32; N],
    /// All bits where there is a camera for the guidance.
    looks: [u64; N],
    /// Steps since the last look at the road, for guidance or for the record: all runs begin with a block.
    unseen: f64,
    /// Steps between the last two looks.
    apart: f64,
    has_remnants: bool,
    /// Whether something is planned in some lane within this block.
    has_events: bool,
    /// The steps of the last block, where they are asked for.
    steps: Option<Vec<[Step; N]>>,
    roads: [Arc<Centreline>; N],
    slots: [Slot; N],
}

impl<const N: usize> Runs<N> {
    pub(super) fn new(whole: usize, any: &Scenario, every_step: bool) -> Self {
        let road = any.course().centreline();
        let mut buffers = BUFFERS.take();
        Self {
            worlds: Worlds::new(whole),
            ecus: Ecus::new(),
            checks: Checks::new(),
            senses: Senses::new(),
            speeds: Speeds::new(),
            own: [0; N],
            looks: [0; N],
            // A block leaves these: its last two looks are in the steps 42 and 45.
            unseen: f64::from(STEPS_PER_SAMPLE) - 1.0,
            apart: 3.0,
            has_remnants: false,
            has_events: false,
            steps: every_step.then(|| Vec::with_capacity(BLOCK as usize)),
            roads: std::array::from_fn(|_| Arc::clone(&road)),
            slots: std::array::from_fn(|_| Slot {
                scenario: None,
                plan: None,
                remnant: None,
                run: Run {
                    trace: Trace {
                        sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
                        samples: buffers.pop().unwrap_or_default(),
                    },
                    ending: Ending::CourseEnd,
                    steps: 0,
                },
                unguided_cause: 0.0,
                is_whole: false,
                event: u32::MAX,
                noticed: u32::MAX,
                timeout: u32::MAX,
            }),
        }
    }

    pub(super) fn begin(&mut self, lane: usize, number: usize, scenario: &Scenario) {
        let (road, pair) = (scenario.course().centreline(), PaperPair::new(scenario));
        let plan = Plan::new(scenario, pair.look_ahead_s());
        self.worlds.begin(lane, scenario, &road, &plan);
        let has_banks = !scenario.course().is_level();
        let nonlinear = match pair.mover {
            Mover::Nonlinear(plant) => Some(plant),
            // A bar is rejected before its run begins.
            Mover::Linear | Mover::Bar(_) => None,
        };
        self.worlds.nonlinear.begin(lane, nonlinear, has_banks);
        self.speeds.begin(lane, scenario, &plan);
        self.senses.begin(lane, Sensing::new(scenario));
        self.ecus.begin(lane, scenario);
        self.checks.begin(lane, scenario);
        self.own[lane] = 0;
        self.looks[lane] = if self.ecus.hears[lane] == 0 { 0 } else { ALIVE };
        self.roads[lane] = road;
        let failure = scenario.failure();
        let slot = &mut self.slots[lane];
        // Room for the whole run, and for no other: growing would copy it again and again.
        slot.run.trace.samples.clear();
        let samples = scenario.duration_s() * DETOUR * f64::from(SAMPLE_RATE_HZ);
        slot.run.trace.samples.reserve(samples as usize + 2);
        slot.scenario = Some(number);
        slot.unguided_cause = 0.0;
        slot.is_whole = false;
        let [failed_at, _] = plan.failure_steps;
        slot.noticed = failed_at.saturating_add(step_of(scenario.driver().takes_over_after_s));
        slot.timeout = u32::MAX;
        let mut coast = None;
        if failure.kind == FailureKind::Input {
            let last = (0..failed_at).rev().find(|step| camera_looks(*step));
            let lost = last.map_or(0, |last| last + TIMEOUT_MS);
            slot.timeout = lost + BLIND_MS;
            coast = Some(Coast::new(scenario.setup().config, failed_at, lost));
        }
        self.ecus.will_lose(lane, coast);
        slot.remnant = (scenario.driver().remnant_sd_nm != 0.0).then_some(pair.remnant);
        slot.plan = Some((plan, pair.arm));
        self.has_remnants = self.slots.iter().any(|slot| slot.remnant.is_some());
        self.happen(lane);
    }

    /// Lets happen what is planned for this step of a run, and finds when the next is.
    #[cold]
    #[inline(never)]
    fn happen(&mut self, lane: usize) {
        let step = self.own[lane] as u32;
        let slot = &mut self.slots[lane];
        let Some((plan, arm)) = &slot.plan else { return };
        let faults = plan.faults(step);
        let ([failed_at, _], noticed) = (plan.failure_steps, slot.noticed);
        self.worlds.set_transition(lane, arm.at(step, step >= noticed));
        if faults.torque_lost {
            self.ecus.lose_torque(lane);
            slot.unguided_cause = Cause::TorqueLost.code();
        }
        if faults.lane_lost {
            self.ecus.hears[lane] = 0;
        }
        if step == slot.timeout {
            self.ecus.hand_over(lane, step);
            slot.unguided_cause = Cause::LaneLost.code();
        }
        let changed = arm.changes_at().unwrap_or(u32::MAX);
        let events = [failed_at, noticed, changed, slot.timeout];
        let next = events.into_iter().filter(|event| *event > step).min();
        slot.event = next.unwrap_or(u32::MAX);
    }

    /// Whether a lane has no run under way; one that has become suspect is given up.
    pub(super) fn is_free(&mut self, lane: usize) -> bool {
        if self.worlds.suspect[lane] != 0 || self.ecus.suspect[lane] != 0 {
            self.worlds.alive[lane] = 0;
        }
        !self.is_under_way(lane)
    }

    pub(super) fn is_under_way(&self, lane: usize) -> bool {
        self.worlds.alive[lane] == ALIVE
    }

    /// The number of a lane's run that has ended, and the run, or why it is rejected.
    pub(super) fn take(&mut self, lane: usize) -> Option<(usize, Result<&Run, Reason>)> {
        let off_road = if self.worlds.suspect[lane] == 0 {
            0
        } else {
            Reason::OffRoad.bit()
        };
        let doubts = self.ecus.suspect[lane] | off_road;
        let slot = &mut self.slots[lane];
        let number = slot.scenario.take()?;
        let run = slot.is_whole.then_some(&slot.run);
        Some((number, run.ok_or(Reason::first_of(doubts))))
    }

    /// Ends a run after so many seconds.
    pub(super) fn cut(&mut self, lane: usize, most_s: u32) {
        if self.is_under_way(lane) && self.own[lane] as u32 >= most_s.saturating_mul(STEPS_PER_SECOND) {
            self.end_run(lane);
        }
    }

    /// The steps of a lane's run in the last block, and the run's number; none where there are none.
    pub(super) fn steps_of_block(&self, lane: usize, found: &mut Vec<Step>) -> Option<usize> {
        let (steps, slot) = (self.steps.as_ref()?, &self.slots[lane]);
        let number = slot.scenario?;
        let end = if slot.is_whole { slot.run.steps } else { u32::MAX };
        found.clear();
        let of_lane = steps.iter().map(|all| all[lane]);
        found.extend(of_lane.take_while(|step| step.step < end));
        Some(number)
    }

    /// Steps until everything periodic is where it was.
    #[inline(always)]
    pub(super) fn block(&mut self) {
        if let Some(steps) = &mut self.steps {
            steps.clear();
        }
        self.has_events = (0..N).any(|lane| {
            let left = self.slots[lane].event.wrapping_sub(self.own[lane] as u32);
            self.worlds.alive[lane] == ALIVE && left < BLOCK
        });
        for phase in 0..BLOCK {
            if self.has_events {
                for lane in 0..N {
                    if self.slots[lane].event == self.own[lane] as u32 && self.worlds.alive[lane] == ALIVE {
                        self.happen(lane);
                    }
                }
            }
            if phase == 1 {
                self.ecus.let_time_pass();
                self.checks.let_time_pass();
            }
            self.step(phase);
        }
    }

    /// One millisecond of every run.
    #[inline(always)]
    fn step(&mut self, phase: u32) {
        let is_sample = phase.is_multiple_of(STEPS_PER_SAMPLE);
        let looks = camera_looks(phase);
        self.unseen += 1.0;
        if looks || is_sample {
            let mut selected = self.worlds.alive;
            let (mut longer, ratio) = ([1.0; N], self.unseen / self.apart);
            (self.apart, self.unseen) = (self.unseen, 0.0);
            for l in 0..N {
                longer[l] = either(self.looks[l], ratio, 1.0);
                selected[l] &= if is_sample { ALIVE } else { self.looks[l] };
            }
            self.worlds.camera_looks(&self.roads, &selected, &longer);
        }
        self.draw_remnants();
        let mut driver_nm = [0.0; N];
        for l in 0..N {
            driver_nm[l] = self.worlds.state[ARM][l] + self.worlds.remnant_nm[l];
        }
        self.receive(phase, looks, &driver_nm);
        self.hear_motors(phase);
        self.ecus.decide(&self.own, phase == 0, is_sample);
        let torque_nm = si(&self.ecus.applied);
        // Not before: the ECUs do not wait for where the cars moved to, so that the processor has work meanwhile. A run that
        // ends here has decided once more, and nobody has heard it.
        if self.worlds.driver_looks(&self.roads) {
            self.end_runs();
        }
        if is_sample {
            self.worlds.locate(&self.roads);
            self.speeds.locate(&self.worlds.body.s);
            self.record(&driver_nm, &torque_nm);
        }
        if let Some(steps) = &mut self.steps {
            steps.push(std::array::from_fn(|l| Step {
                step: self.own[l] as u32,
                e_y_m: self.worlds.driver.e_y[l],
                e_theta_rad: self.worlds.driver.e_theta[l],
                wheel_angle_rad: self.worlds.state[WHEEL][l],
                guidance_torque_nm: torque_nm[l],
                driver_torque_nm: driver_nm[l],
            }));
        }
        let speeds = self.speeds.of_step(&self.own);
        self.worlds.move_on(&torque_nm, speeds, self.has_remnants);
        self.speeds.advance(&mut self.worlds, &self.roads);
        for own in &mut self.own {
            *own = own.wrapping_add(1);
        }
    }

    #[inline(always)]
    fn draw_remnants(&mut self) {
        if !self.has_remnants {
            return;
        }
        for (lane, slot) in self.slots.iter_mut().enumerate() {
            if let Some(remnant) = &mut slot.remnant {
                // As a hand's torque of zero is added there.
                self.worlds.remnant_nm[lane] = remnant.step() + 0.0;
            }
        }
    }

    /// Runs whose farthest point has come to the end of the course.
    #[cold]
    #[inline(never)]
    fn end_runs(&mut self) {
        for lane in 0..N {
            if self.worlds.alive[lane] == ALIVE && self.worlds.is_at_its_end(lane) {
                self.end_run(lane);
            }
        }
    }

    fn end_run(&mut self, lane: usize) {
        let slot = &mut self.slots[lane];
        slot.run.steps = self.own[lane] as u32;
        let is_recorded = slot.run.trace.samples.len() as u32 == slot.run.steps.div_ceil(STEPS_PER_SAMPLE);
        let is_suspect = (self.worlds.suspect[lane] | self.ecus.suspect[lane] as u64) != 0;
        slot.is_whole = is_recorded && !is_suspect;
        self.worlds.alive[lane] = 0;
    }

    /// A sample of each run.
    #[inline(always)]
    fn record(&mut self, driver_nm: &[f64; N], torque_nm: &[f64; N]) {
        let chi = self.worlds.direction_rad();
        let Worlds {
            state,
            body,
            driver,
            camera,
            alive,
            ..
        } = &self.worlds;
        for (l, slot) in self.slots.iter_mut().enumerate() {
            let samples = &mut slot.run.trace.samples;
            // There is room for the whole run; the compiler has to see it, or it makes each sample twice.
            if alive[l] != ALIVE || samples.len() == samples.capacity() {
                continue;
            }
            samples.push(Sample {
                time_s: f64::from(self.own[l]) * STEP_S,
                s_m: body.s[l],
                lateral_error_m: body.offset[l],
                heading_error_rad: wrapped(chi[l] - body.found_heading[l]),
                curvature_1pm: body.found_curvature[l],
                e_y_m: driver.e_y[l],
                e_theta_rad: driver.e_theta[l],
                guidance_e_y_m: camera.e_y[l],
                guidance_e_theta_rad: camera.e_theta[l],
                wheel_angle_rad: state[WHEEL][l],
                wheel_rate_rad_per_s: state[WHEEL_RATE][l],
                yaw_rate_rad_per_s: state[YAW_RATE][l],
                sideslip_rad: state[BETA][l],
                speed_m_per_s: self.speeds.now[l],
                driver_torque_nm: driver_nm[l],
                guidance_torque_nm: torque_nm[l],
                guidance_limited: self.ecus.limited[l] != 0,
                unguided_cause: slot.unguided_cause,
                bar_torque_nm: None,
                assist_torque_nm: None,
            });
        }
    }
}

impl<const N: usize> Drop for Runs<N> {
    fn drop(&mut self) {
        BUFFERS.set(
            self.slots
                .iter_mut()
                .map(|slot| std::mem::take(&mut slot.run.trace.samples))
                .collect(),
        );
    }
}
