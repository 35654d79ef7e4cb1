//! The closed loop: driver, guidance, column, vehicle and road, a millisecond at a time.
//!
//! Every run starts at s = 0 on the centreline, tangent to it, with all states zero and the guidance active,
//! and ends when the farthest point that anybody looks at (with table 8 the driver's far point) reaches the
//! end of the course. Order within a step: look at the road, let the guidance decide, record, then let the
//! plant move for 1 ms under the torque decided.
//!
//! A run has *diverged* when the centre of gravity is more than 10 m off the centreline, when the
//! direction of movement is more than 90 degrees off the road's at a far point, or when a look-ahead point has
//! no unique foot on the centreline. It is stopped there and flagged; its samples up to there are finite.

use haptic_core::bus::Frame;

use crate::guidance::{Applied, Direct, Guidance, LaneErrors, NoGuidance, OverBus, View};
use crate::models::driver::{ArmGains, Remnant, Vision};
use crate::models::plant::{Plant, PlantInput, Transition};
use crate::models::road::{Centreline, Foot, Tracker};
use crate::models::{STEP_S, STEPS_PER_SECOND};
use crate::scenario::{Condition, FAILURE_REACTION_S, FailureKind, Scenario, Sensors};
use haptic_log::trace::{Sample, Trace};

/// Nobody is on the road that far from the middle of a lane; a wide exit that comes back is no divergence.
const DIVERGED_M: f64 = 10.0;

/// Samples per second of a trace.
pub const SAMPLE_RATE_HZ: u32 = 200;
const STEPS_PER_SAMPLE: u32 = STEPS_PER_SECOND / SAMPLE_RATE_HZ;

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

impl Run {
    /// Whether the run was stopped because it diverged.
    pub fn diverged(&self) -> bool {
        self.ending != Ending::CourseEnd
    }
}

/// One step as an observer sees it, after the guidance has decided.
#[derive(Debug, Clone, Copy)]
pub struct Cycle<'a> {
    /// Lane errors at the driver's points.
    pub seen: LaneErrors,
    /// What the guidance could look at.
    pub view: View,
    /// The torque that it gave.
    pub given: Applied,
    /// The torque really applied, N.m: zero after a failure of the torque.
    pub applied_torque_nm: f64,
    /// The frames that went to the ECU, in order of sending.
    pub frames_in: &'a [Frame],
    /// The frames that came from it, the guidance frame first.
    pub frames_out: &'a [Frame],
}

/// Sees every step of a run.
pub trait Observer {
    /// Called once a step. The loop compiles anew for every observer, so an empty one costs nothing.
    fn cycle(&mut self, cycle: &Cycle);
}

/// Nobody watches.
impl Observer for () {
    #[inline]
    fn cycle(&mut self, _cycle: &Cycle) {}
}

impl<F: FnMut(&Cycle)> Observer for F {
    #[inline]
    fn cycle(&mut self, cycle: &Cycle) {
        self(cycle);
    }
}

/// Simulates a scenario with the shipping controller, or manually if its condition is.
///
/// # Errors
/// As [`Scenario::check`]: nothing that a checked scenario can meet.
pub fn simulate(scenario: &Scenario, centreline: &Centreline) -> Result<Run, String> {
    observe(scenario, centreline, &mut ())
}

/// As [`simulate`], watched by an observer.
///
/// # Errors
/// As [`Scenario::check`].
pub fn observe<O: Observer>(
    scenario: &Scenario,
    centreline: &Centreline,
    observer: &mut O,
) -> Result<Run, String> {
    scenario.check()?;
    let setup = scenario.setup()?;
    let probe = scenario.guidance.probe;
    Ok(match (scenario.condition, scenario.sensors) {
        (Condition::Manual, _) => drive(scenario, centreline, &mut NoGuidance, observer),
        (_, Sensors::Exact) => {
            let mut guidance = Direct::new(&setup);
            guidance.set_probe(probe);
            drive(scenario, centreline, &mut guidance, observer)
        }
        (_, Sensors::Paper) => {
            let mut guidance = OverBus::new(&setup);
            guidance.set_probe(probe);
            drive(scenario, centreline, &mut guidance, observer)
        }
    })
}

/// Simulates a checked scenario with any guidance; its condition and sensors are not looked at.
pub fn drive<G: Guidance, O: Observer>(
    scenario: &Scenario,
    centreline: &Centreline,
    guidance: &mut G,
    observer: &mut O,
) -> Run {
    let v = scenario.speed_mps();
    let (vehicle, driver) = (&scenario.vehicle, &scenario.driver);
    let relying = Transition::new(v, vehicle, driver, scenario.gains);
    let manual = Transition::new(v, vehicle, driver, ArmGains::MANUAL);
    let change = scenario.driver_change;
    let changed = change.map(|change| Transition::new(v, vehicle, driver, change.gains()));
    let change_step = change.map_or(u32::MAX, |change| step_of(change.time_s));
    let failure_step = scenario.failure.at_s().map_or(u32::MAX, step_of);
    let noticed_step = failure_step.saturating_add(step_of(FAILURE_REACTION_S));

    let mut plant = Plant::default();
    let mut vision = Vision::new(driver);
    let mut remnant = Remnant::new(driver, scenario.seed);
    let mut driver_eyes = Eyes::new(centreline, v * driver.t_n, v * driver.t_f);
    let mut camera = Eyes::new(centreline, v * scenario.guidance.t_n, v * scenario.guidance.t_f);
    let mut body = centreline.tracker(0.0);
    let end_m = centreline.length_m() - (scenario.look_ahead_m() - v * driver.t_f);

    let samples = centreline.length_m() / v * f64::from(SAMPLE_RATE_HZ);
    let mut trace = Trace {
        sample_rate_hz: f64::from(SAMPLE_RATE_HZ),
        samples: Vec::with_capacity(samples as usize + 1),
    };
    let mut target_now_rad = 0.0;
    let mut motor_torque_nm = 0.0;
    let mut step = 0_u32;
    let ending = loop {
        let last_s_m = trace.samples.last().map_or(0.0, |sample: &Sample| sample.s_m);
        let diverged = Ending::Diverged { s_m: last_s_m };
        let Some((seen, far_s_m)) = driver_eyes.look(&plant) else {
            break diverged;
        };
        if far_s_m >= end_m {
            break Ending::CourseEnd;
        }
        let is_sample = step.is_multiple_of(STEPS_PER_SAMPLE);
        let looks = guidance.looks_at_road(step);
        let lane = if looks || is_sample {
            let Some((errors, _)) = camera.look(&plant) else {
                break diverged;
            };
            Some(errors)
        } else {
            None
        };
        let remnant_nm = remnant.step() + guidance.hand_torque_nm(step, plant.arm_torque_nm());
        let fails = |kind| step >= failure_step && scenario.failure.kind == kind;
        let view = View {
            step,
            lane: lane.filter(|_| looks && !fails(FailureKind::Input)),
            driver_torque_nm: plant.arm_torque_nm() + remnant_nm,
            wheel_angle_rad: plant.wheel_angle_rad(),
            motor_torque_nm,
            speed_mps: v,
        };
        let given = guidance.step(&view);
        let applied = if fails(FailureKind::Torque) {
            Applied::default()
        } else {
            given
        };
        observer.cycle(&Cycle {
            seen,
            view,
            given,
            applied_torque_nm: applied.torque_nm,
            frames_in: guidance.frames_in(),
            frames_out: guidance.frames_out(),
        });
        if let Some(camera_errors) = lane.filter(|_| is_sample) {
            let [x, y] = plant.position_m();
            let Some(foot) = centreline.project(x, y, &mut body) else {
                break diverged;
            };
            if foot.offset_m.abs() > DIVERGED_M {
                break diverged;
            }
            trace
                .samples
                .push(record(&plant, &foot, &view, seen, camera_errors, applied));
        }

        let target_next_rad = vision.step(seen.e_y_m, seen.e_theta_rad);
        let transition = match &changed {
            _ if step >= noticed_step => &manual,
            Some(changed) if step >= change_step => changed,
            _ => &relying,
        };
        let input = PlantInput {
            target_now_rad,
            target_next_rad,
            guidance_torque_nm: applied.torque_nm,
            remnant_nm,
        };
        plant.step(transition, &input);
        target_now_rad = target_next_rad;
        motor_torque_nm = applied.torque_nm;
        step += 1;
    };
    Run {
        trace,
        ending,
        steps: step,
    }
}

/// The step at or next to a time.
fn step_of(time_s: f64) -> u32 {
    (time_s / STEP_S).round() as u32
}

fn record(
    plant: &Plant,
    foot: &Foot,
    view: &View,
    seen: LaneErrors,
    camera: LaneErrors,
    applied: Applied,
) -> Sample {
    Sample {
        time_s: f64::from(view.step) * STEP_S,
        s_m: foot.s_m,
        lateral_error_m: foot.offset_m,
        heading_error_rad: wrapped(plant.direction_rad() - foot.heading_rad),
        curvature_1pm: foot.curvature_1pm,
        e_y_m: seen.e_y_m,
        e_theta_rad: seen.e_theta_rad,
        guidance_e_y_m: camera.e_y_m,
        guidance_e_theta_rad: camera.e_theta_rad,
        wheel_angle_rad: plant.wheel_angle_rad(),
        wheel_rate_rad_s: plant.wheel_rate_rad_s(),
        yaw_rate_rad_s: plant.yaw_rate_rad_s(),
        sideslip_rad: plant.sideslip_rad(),
        driver_torque_nm: view.driver_torque_nm,
        guidance_torque_nm: applied.torque_nm,
        guidance_limited: applied.limited,
    }
}

/// A pair of look-ahead points on the road (section 2.4), the driver's or the camera's.
struct Eyes<'a> {
    centreline: &'a Centreline,
    near_m: f64,
    far_m: f64,
    near: Tracker,
    far: Tracker,
}

impl<'a> Eyes<'a> {
    fn new(centreline: &'a Centreline, near_m: f64, far_m: f64) -> Self {
        let (near, far) = (centreline.tracker(near_m), centreline.tracker(far_m));
        Self {
            centreline,
            near_m,
            far_m,
            near,
            far,
        }
    }

    /// The errors and the far point's arc length; `None` where there is no road to look at.
    #[inline]
    fn look(&mut self, plant: &Plant) -> Option<(LaneErrors, f64)> {
        let [x, y] = plant.ahead_m(self.near_m);
        let near = self.centreline.project(x, y, &mut self.near)?;
        let [x, y] = plant.ahead_m(self.far_m);
        let far = self.centreline.project(x, y, &mut self.far)?;
        // The target line lies to the left of a point that lies to the right of it.
        let e_y_m = -near.offset_m;
        let e_theta_rad = wrapped(far.heading_rad - plant.direction_rad());
        (e_theta_rad.abs() < std::f64::consts::FRAC_PI_2)
            .then_some((LaneErrors { e_y_m, e_theta_rad }, far.s_m))
    }
}

/// An angle in (-pi, pi].
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle > -PI && angle <= PI {
        return angle;
    }
    let positive = angle.rem_euclid(TAU);
    if positive > PI { positive - TAU } else { positive }
}
