//! A driver: what it perceives, and what it answers.

use super::{ByReliance, Notices};
use crate::guidance::LaneErrors;
use crate::models::STEP_S;
use crate::models::arm::Arm;
use crate::models::driver::{ArmGains, Remnant, Vision};
use crate::models::hands_answer::HandsAnswer;
use crate::scenario::Scenario;
use crate::seeds::Stream;

/// What a driver perceives in a step of 1 ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverView {
    /// Number of the step.
    pub step: u32,
    /// e_y at the near and e_theta at the far point, to the middle of the lane.
    pub lane: LaneErrors,
    /// Arc length of the near and of the far point, m: a driver whose line is not the middle of the lane knows it by place.
    pub points_m: [f64; 2],
    /// phi, rad.
    pub wheel_angle_rad: f64,
    /// phi', rad/s.
    pub wheel_rate_rad_per_s: f64,
    /// Speed, m/s.
    pub speed_m_per_s: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_rad_per_s: f64,
    /// T_h that the hands feel, N.m: that of the last step.
    pub guidance_torque_nm: f64,
    /// Whether the ECU's warning lamp is on.
    pub warning: bool,
    /// Whether the ECU guides and asks for a hand on the wheel, which it does not feel; the lamp is on then too.
    pub asks_for_hands: bool,
    /// Whether the scenario or an action takes torque or lane preview away. The paper's driver knows it some time later; one
    /// who has only eyes and hands leaves it unread.
    pub is_lost: bool,
}

impl DriverView {
    /// Time since the start of the run, s.
    pub fn time_s(&self) -> f64 {
        f64::from(self.step) * STEP_S
    }
}

/// Somebody at the steering wheel.
pub trait Driver {
    /// How far ahead the near and the far point are that it looks at, s; the same throughout a run.
    fn look_ahead_s(&self) -> [f64; 2];

    /// The torque on the column in this step of 1 ms, N.m, positive turns left.
    fn step(&mut self, view: &DriverView) -> f64;

    /// K_hg in the last step, if the driver has one; nothing of the loop depends on it.
    fn k_hg(&self) -> Option<f64> {
        None
    }
}

/// Nobody; a hand of an [`Action`](crate::Action) may steer in the driver's place.
#[derive(Debug, Clone, Copy)]
pub struct NoDriver {
    /// The look-ahead of whoever steers, s.
    pub look_ahead_s: [f64; 2],
}

impl Driver for NoDriver {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, _view: &DriverView) -> f64 {
        0.0
    }
}

/// The paper's driver, for a vehicle of one's own: vision (7), arm (8) and remnant. The arm takes the wheel angle and the
/// guidance torque of a step's start for the whole step, which [`PaperPair`](super::PaperPair) does not.
#[derive(Debug, Clone)]
pub struct PaperDriver {
    look_ahead_s: [f64; 2],
    vision: Vision,
    remnant: Remnant,
    arm: Arm,
    torque_nm: f64,
    gains: ByReliance<ArmGains>,
    notices: Notices,
    answer: HandsAnswer,
}

impl PaperDriver {
    /// A scenario's driver.
    pub fn new(scenario: &Scenario) -> Self {
        let driver = scenario.driver();
        Self {
            look_ahead_s: [driver.t_n, driver.t_f],
            vision: Vision::new(driver),
            remnant: Remnant::new(driver, Stream::Remnant.seed(scenario.seed())),
            arm: Arm::new(driver, scenario.gains()),
            torque_nm: 0.0,
            gains: ByReliance::new(scenario, |gains| gains),
            notices: Notices::new(driver),
            answer: HandsAnswer::new(driver),
        }
    }
}

impl Driver for PaperDriver {
    fn look_ahead_s(&self) -> [f64; 2] {
        self.look_ahead_s
    }

    fn step(&mut self, view: &DriverView) -> f64 {
        self.notices.step(view.is_lost);
        self.arm.gains = *self.gains.at(view.step, self.notices.is_manual());
        let now_nm = self.torque_nm + self.remnant.step() + self.answer.step(view.asks_for_hands);
        let target_rad = self.vision.step(view.lane.e_y_m, view.lane.e_theta_rad);
        self.torque_nm = self
            .arm
            .step(target_rad, view.wheel_angle_rad, view.guidance_torque_nm);
        now_nm
    }

    fn k_hg(&self) -> Option<f64> {
        Some(self.arm.gains.k_hg)
    }
}
