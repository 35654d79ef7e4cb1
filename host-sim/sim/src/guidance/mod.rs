//! Who gives the guidance torque in a closed loop.
//!
//! - [`OverBus`]: the shipping ECU behind its bus frames, with the paper's sensors.
//! - [`Direct`]: the shipping controller, fed past the bus with full resolution every step.
//! - [`OwnLaw`]: another law behind the shipping ECU, for comparison.
//! - [`FloatLaw`]: a float64 evaluation of equation (9), the reference that the others are held against.
//! - [`NoGuidance`]: manual driving.
//!
//! [`AnyGuidance`] is one of the first two or none, as a scenario names it.
//!
//! Not here: the failure of the guidance; the loop takes the torque or the lane errors away, whoever gives it.

mod any;
mod direct;
mod float_law;
mod over_bus;
mod own_law;

use haptic_core::bus::Frame;
use haptic_core::quantity::Instant;
use haptic_core::safety::envelope::LimitReason;
use haptic_core::safety::faults::{Fault, FaultSet};
use haptic_core::safety::modes::Mode;

use crate::action::Request;

pub use any::AnyGuidance;
pub use direct::Direct;
pub use float_law::FloatLaw;
pub use over_bus::OverBus;
pub use own_law::OwnLaw;

/// Lane errors at the guidance's own points, as they truly are.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LaneErrors {
    /// e_y', m.
    pub e_y_m: f64,
    /// e_theta', rad.
    pub e_theta_rad: f64,
}

/// What a guidance may look at in one step: the truth, before any sensor.
#[derive(Debug, Clone, Copy)]
pub struct Observation {
    /// Number of the step; one is 1 ms.
    pub step: u32,
    /// The lane errors, in steps in which the guidance looks at the road.
    pub lane: Option<LaneErrors>,
    /// How long ago they were true, ms: a camera says so with its picture.
    pub lane_age_ms: u32,
    /// Driver torque on the column, N.m.
    pub driver_torque_nm: f64,
    /// Wheel angle, rad.
    pub wheel_angle_rad: f64,
    /// Guidance torque really applied since the last step, N.m.
    pub motor_torque_nm: f64,
    /// Speed, m/s.
    pub speed_m_per_s: f64,
    /// Yaw rate, rad/s; `None` in a vehicle that does not measure it.
    pub yaw_rate_rad_per_s: Option<f64>,
    /// What the host asks for.
    pub request: Request,
}

impl Observation {
    /// The ECU's clock at this step, from zero at the start; it wraps every 71.6 minutes, as the real one does.
    pub fn now(&self) -> Instant {
        Instant::from_us(self.step.wrapping_mul(1000))
    }
}

/// The torque that a guidance applies until the next step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Actuation {
    /// T_h, N.m.
    pub torque_nm: f64,
    /// Whether a limit held it back.
    pub limited: bool,
}

/// What an ECU says of itself, as its bus carries it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Status {
    /// Its mode.
    pub mode: Mode,
    /// The faults that are there.
    pub faults: FaultSet,
    /// The driver has to take over.
    pub warning: bool,
    /// K_hg and its standard deviation in the last telemetry, once identified; never past the bus.
    pub k_hg: Option<[f64; 2]>,
}

impl Status {
    /// It guides, and nothing is wrong.
    pub const GUIDES: Self = Self {
        mode: Mode::Active,
        faults: FaultSet::NONE,
        warning: false,
        k_hg: None,
    };

    /// Whether it guides, feels no hand on the wheel and asks for one.
    #[must_use]
    pub fn asks_for_hands(&self) -> bool {
        self.mode == Mode::Active && self.faults.contains(Fault::HandsOff)
    }
}

/// A mode that allows less torque than the law asks for is no limit: a fade or a handover is what was asked.
fn is_limited(reason: LimitReason) -> bool {
    !matches!(reason, LimitReason::None | LimitReason::Mode)
}

/// A controller in the loop.
pub trait Guidance {
    /// Whether the lane errors are asked for at this step.
    fn looks_at_road(&self, step: u32) -> bool;

    /// One step of 1 ms.
    fn step(&mut self, observation: &Observation) -> Actuation;

    /// What it said of itself in the last step: a law without modes always guides. `None` where nobody guides.
    fn status(&self) -> Option<Status> {
        Some(Status::GUIDES)
    }

    /// The frames that went to the ECU in the last step, in order of sending.
    fn frames_in(&self) -> &[Frame] {
        &[]
    }

    /// The frames that came from the ECU in the last step, the guidance frame first.
    fn frames_out(&self) -> &[Frame] {
        &[]
    }
}

/// Manual driving: no torque, ever.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoGuidance;

impl Guidance for NoGuidance {
    fn looks_at_road(&self, _step: u32) -> bool {
        false
    }

    fn step(&mut self, _view: &Observation) -> Actuation {
        Actuation::default()
    }

    fn status(&self) -> Option<Status> {
        None
    }
}
