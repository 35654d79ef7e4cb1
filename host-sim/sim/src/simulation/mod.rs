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

mod plan;
mod record;
mod run;
mod sensing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use haptic_log::trace::Sample;

use crate::action::{Action, WorldFaults};
use crate::guidance::{Actuation, AnyGuidance, Guidance, LaneErrors, Observation};
use crate::models::STEP_S;
use crate::models::road::{Centreline, Tracker};
use crate::parts::{Acting, Driver, DriverVehicle, DriverView, Motion, PaperPair, Parts, Vehicle};
use crate::preview::PreviewPoints;
use crate::scenario::Scenario;
use crate::unguided::{Circumstances, Watch};
use plan::AskingDriver;
pub use plan::Plan;
pub use record::{SAMPLE_RATE_HZ, STEPS_PER_SAMPLE};
use record::{Truth, record};
pub use run::{Ending, Outcome, Run, observe, simulate};
pub use sensing::Sensing;

/// Nobody is on the road that far from the middle of a lane; a wide exit that comes back is no divergence.
pub const DIVERGED_M: f64 = 10.0;

/// A closed loop under way: a guidance, and a driver with a vehicle.
#[derive(Debug, Clone)]
pub struct Simulation<G = AnyGuidance, S = PaperPair> {
    road: Arc<Centreline>,
    plan: Plan,
    guidance: G,
    driver_vehicle: S,
    /// What the sensors add, if they add anything.
    sensing: Option<Box<Sensing>>,
    driver_points: PreviewPoints,
    camera: PreviewPoints,
    /// The step of the camera's last look; at first a sample before the start, so that no two looks are 0 steps apart.
    camera_step: u32,
    body: Tracker,
    /// Speed of the vehicle now, and where along the road it is.
    speed_m_per_s: f64,
    place_m: f64,
    request: AskingDriver,
    /// The run ends when the driver's far point gets there.
    end_m: f64,
    watch: Watch,
    /// Whether the driver is warned, and asked for hands.
    told: [bool; 2],
    last_s_m: f64,
    lateral_error_m: Option<f64>,
    step: u32,
    ending: Option<Ending>,
}

impl Simulation {
    /// The start of a scenario's run, with the guidance that its condition and sensors name.
    pub fn new(scenario: &Scenario) -> Self {
        Self::with(scenario, AnyGuidance::new(scenario))
    }
}

impl<G: Guidance> Simulation<G> {
    /// The start of a scenario's run with any guidance; the scenario's condition and sensors do not choose it.
    pub fn with(scenario: &Scenario, guidance: G) -> Self {
        Self::with_driver_vehicle(scenario, PaperPair::new(scenario), guidance)
    }
}

impl<G: Guidance, D: Driver, V: Vehicle> Simulation<G, Parts<D, V>> {
    /// The start of a run of any three parts. The scenario has the road, the speed, the failures, the sensors and the
    /// camera; its driver, vehicle and condition are those of nobody, unless a part was made from them.
    pub fn of_parts(scenario: &Scenario, driver: D, vehicle: V, guidance: G) -> Self {
        Self::with_driver_vehicle(scenario, Parts::new(driver, vehicle), guidance)
    }
}

impl<G: Guidance, S: DriverVehicle> Simulation<G, S> {
    /// The start of a run of any guidance, and any driver with a vehicle.
    pub fn with_driver_vehicle(scenario: &Scenario, driver_vehicle: S, guidance: G) -> Self {
        let road = scenario.course().centreline();
        let v = scenario.speed_m_per_s();
        let camera_s = [scenario.guidance().t_n, scenario.guidance().t_f];
        let driver_s = driver_vehicle.look_ahead_s();
        let plan = Plan::new(scenario, driver_s);
        Self {
            speed_m_per_s: v,
            place_m: 0.0,
            end_m: plan.end_m(&road, v),
            request: AskingDriver::new(scenario.controller_params().least_speed_m_per_s),
            plan,
            guidance,
            driver_vehicle,
            sensing: Sensing::new(scenario),
            driver_points: PreviewPoints::new(&road, driver_s, v),
            camera: PreviewPoints::new(&road, camera_s, v),
            camera_step: 0_u32.wrapping_sub(STEPS_PER_SAMPLE),
            body: road.tracker(0.0),
            watch: Watch::default(),
            told: [false; 2],
            last_s_m: 0.0,
            lateral_error_m: None,
            step: 0,
            ending: None,
            road,
        }
    }

    /// What the driver perceives in the next step, for who steers from outside; `None` once the run has ended.
    pub fn view(&self) -> Option<DriverView> {
        let motion = self.driver_vehicle.motion();
        let mut points = self.driver_points.clone();
        let (lane, points_m) = points.see(&self.road, &self.driver_vehicle, &motion)?;
        let goes_on = self.ending.is_none() && points_m[1] < self.end_m;
        goes_on.then(|| self.perceived(lane, points_m, &motion, self.plan.faults(self.step)))
    }

    #[inline]
    fn perceived(
        &self,
        lane: LaneErrors,
        points_m: [f64; 2],
        motion: &Motion,
        lost: WorldFaults,
    ) -> DriverView {
        DriverView {
            step: self.step,
            lane,
            points_m,
            wheel_angle_rad: motion.wheel_angle_rad,
            wheel_rate_rad_per_s: motion.wheel_rate_rad_per_s,
            speed_m_per_s: self.speed_m_per_s,
            yaw_rate_rad_per_s: motion.yaw_rate_rad_per_s,
            guidance_torque_nm: match self.driver_vehicle.bar() {
                Some(bar) => bar.felt_nm,
                None => self.driver_vehicle.motor_torque_nm(),
            },
            warning: self.told[0],
            asks_for_hands: self.told[1],
            is_lost: lost.any(),
        }
    }

    /// One step of 1 ms; `None` once the run has ended.
    #[inline]
    pub fn step(&mut self, action: &Action) -> Option<Outcome<'_>> {
        if self.ending.is_some() {
            return None;
        }
        let motion = self.driver_vehicle.motion();
        let looked = self.driver_points.see(&self.road, &self.driver_vehicle, &motion);
        let Some((mut preview, points_m)) = looked else {
            return self.diverge();
        };
        preview.e_y_m -= action.beside_m;
        if points_m[1] >= self.end_m {
            self.ending = Some(Ending::CourseEnd);
            return None;
        }
        let is_sample = self.step.is_multiple_of(STEPS_PER_SAMPLE);
        let looks = self.guidance.looks_at_road(self.step);
        let lane = if looks || is_sample {
            self.camera.after(self.step.wrapping_sub(self.camera_step));
            self.camera_step = self.step;
            let seen = self.camera.see(&self.road, &self.driver_vehicle, &motion);
            let Some((errors, _)) = seen else {
                return self.diverge();
            };
            Some(errors)
        } else {
            None
        };
        let faults = self.plan.faults(self.step).or(action.world);
        let view = self.perceived(preview, points_m, &motion, faults);
        let hands_nm = self.driver_vehicle.drive(&view, action.hand_torque_nm);
        let bar = self.driver_vehicle.bar();
        let observation = Observation {
            step: self.step,
            lane: lane.filter(|_| looks && !faults.lane_lost),
            lane_age_ms: 0,
            driver_torque_nm: bar.map_or(hands_nm, |bar| bar.sensor_nm),
            wheel_angle_rad: bar.map_or(motion.wheel_angle_rad, |bar| bar.told_angle_rad),
            motor_torque_nm: self.driver_vehicle.motor_torque_nm(),
            speed_m_per_s: self.speed_m_per_s,
            yaw_rate_rad_per_s: Some(motion.yaw_rate_rad_per_s),
            request: self.plan.request(action, self.request.asks),
        };
        let sensing = self.sensing.as_mut();
        let seen = sensing.map_or(observation, |sensing| sensing.of_truth(&observation));
        let decided = self.guidance.step(&seen);
        let status = self.guidance.status();
        if let Some(status) = &status {
            self.watch
                .step(status, self.circumstances(action, faults, seen.speed_m_per_s));
            self.told = [status.warning, status.asks_for_hands()];
            self.request.see(view.is_lost, status.mode);
        }
        let applied = if faults.torque_lost {
            Actuation::default()
        } else {
            decided
        };
        let camera = lane.filter(|_| is_sample);
        let truth = Truth {
            motion,
            seen: [preview, camera.unwrap_or_default()],
            speed_m_per_s: observation.speed_m_per_s,
            hands_nm,
            bar,
            applied,
        };
        let sample = camera.and_then(|_| self.sample(&truth));
        if self.ending.is_none() {
            self.move_on(hands_nm, applied.torque_nm);
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
    fn sample(&mut self, truth: &Truth) -> Option<Sample> {
        let [x, y] = truth.motion.position_m;
        match self.road.project(x, y, &mut self.body) {
            Some(projection) if projection.offset_m.abs() <= DIVERGED_M => {
                self.last_s_m = projection.s_m;
                self.place_m = projection.s_m;
                self.lateral_error_m = Some(projection.offset_m);
                Some(record(self.step, truth, &projection, self.watch.cause()))
            }
            _ => {
                self.ending = Some(Ending::Diverged { s_m: self.last_s_m });
                None
            }
        }
    }

    fn diverge(&mut self) -> Option<Outcome<'_>> {
        self.ending = Some(Ending::Diverged { s_m: self.last_s_m });
        None
    }

    /// Lets driver and vehicle move for 1 ms.
    #[inline]
    fn move_on(&mut self, driver_torque_nm: f64, guidance_torque_nm: f64) {
        let now = self.speed_m_per_s;
        if self.plan.speed.is_some() || self.request.waits {
            self.request.step(now);
        }
        let next = match &self.plan.speed {
            None => now,
            Some(speed) => {
                let time_s = f64::from(self.step + 1) * STEP_S;
                speed.at(time_s, self.place_m + now * STEP_S)
            }
        };
        self.driver_vehicle.advance(&Acting {
            driver_torque_nm,
            guidance_torque_nm,
            speed_m_per_s: [now, next],
            bank_rad: if self.plan.has_banks {
                self.road.surface(&self.body).bank_rad
            } else {
                0.0
            },
        });
        if next != now {
            self.change_speed(next);
        }
        // Until the next sample projects it.
        self.place_m += now * STEP_S;
        self.step += 1;
    }

    /// Whatever is looked at by time is looked at in another place.
    fn change_speed(&mut self, v_m_per_s: f64) {
        self.speed_m_per_s = v_m_per_s;
        self.driver_points.at_speed(v_m_per_s);
        self.camera.at_speed(v_m_per_s);
        self.end_m = self.plan.end_m(&self.road, v_m_per_s);
    }

    /// How the run ended, if it has.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Steps simulated so far, which is the number of the next; one is 1 ms.
    pub fn steps(&self) -> u32 {
        self.step
    }

    /// Who guides.
    pub fn guidance(&self) -> &G {
        &self.guidance
    }

    /// Who guides, to be told what to do in the next step.
    pub fn guidance_mut(&mut self) -> &mut G {
        &mut self.guidance
    }

    /// Who guided, for what it kept.
    pub fn into_guidance(self) -> G {
        self.guidance
    }

    /// Who drives, and what is driven.
    pub fn driver_vehicle(&self) -> &S {
        &self.driver_vehicle
    }

    /// Who drives, to be told what to do in the next step.
    pub fn driver_vehicle_mut(&mut self) -> &mut S {
        &mut self.driver_vehicle
    }

    /// Offset of the centre of gravity from the centreline at the last sample, m, left positive.
    pub fn lateral_error_m(&self) -> Option<f64> {
        self.lateral_error_m
    }
}
