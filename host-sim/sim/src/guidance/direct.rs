//! The shipping controller without its bus: full resolution every step, so that what is seen is the law and
//! the envelope alone.

use haptic_core::controller::config::Setup;
use haptic_core::controller::inputs::{ColumnState, Input, Inputs, Motion, Request};
use haptic_core::controller::{Controller, ControllerState};
use haptic_core::lane::LaneSample;
use haptic_core::quantity::{Instant, Metres, Micros, Radians, Ratio, Speed, Torque, TurningRate};
use haptic_core::safety::faults::FaultSet;

use super::{Actuation, Guidance, Observation, Status, is_limited};

/// The shipping controller, fed directly and active from the start.
#[derive(Debug, Clone)]
pub struct Direct {
    controller: Controller,
    state: ControllerState,
    status: Status,
}

impl Direct {
    /// A controller that has seen nothing yet.
    pub fn new(setup: &Setup) -> Self {
        Self {
            controller: Controller::new(setup.config),
            state: ControllerState::engaged(Instant::from_us(0)),
            status: Status::GUIDES,
        }
    }
}

impl Guidance for Direct {
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    #[inline]
    fn step(&mut self, observation: &Observation) -> Actuation {
        let now = observation.now();
        let inputs = Inputs {
            lane: observation.lane.map_or(Input::Lost, |errors| {
                Input::New(LaneSample {
                    e_y: Metres::from_m(errors.e_y_m),
                    e_theta: Radians::from_rad(errors.e_theta_rad),
                    at: now.before(Micros::from_ms(observation.lane_age_ms)),
                })
            }),
            column: Input::New(ColumnState {
                driver_torque: Torque::from_nm(observation.driver_torque_nm),
                wheel_angle: Radians::from_rad(observation.wheel_angle_rad),
            }),
            motion: Input::New(Motion::new(
                [Speed::from_m_per_s(observation.speed_m_per_s); 2],
                observation.yaw_rate_rad_per_s.map(TurningRate::from_rad_per_s),
            )),
            request: Input::New(Request {
                engage: observation.request.engage,
                authority: Ratio::from_si(observation.request.authority),
                probe: observation.request.probe,
            }),
            faults: FaultSet::NONE,
        };
        let applied = Torque::from_nm(observation.motor_torque_nm);
        let command = self.controller.step(&mut self.state, now, applied, &inputs);
        self.status = Status {
            mode: command.mode,
            faults: command.faults,
            warning: command.warning,
            k_hg: None,
        };
        Actuation {
            torque_nm: command.torque.nm(),
            limited: is_limited(command.limit),
        }
    }
    fn status(&self) -> Option<Status> {
        Some(self.status)
    }
}
