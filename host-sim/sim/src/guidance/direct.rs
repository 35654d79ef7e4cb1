//! The shipping controller without its bus: full resolution every step, so that what is seen is the law and
//! the envelope alone.

use haptic_core::controller::{Column, Controller, ControllerState, Input, Inputs, Request};
use haptic_core::faults::FaultSet;
use haptic_core::law::LaneSample;
use haptic_core::params::Setup;
use haptic_core::quantity::{Gain, Instant, Metres, Radians, Speed, Torque};

use super::{Applied, Guidance, View, is_limited};

/// The shipping controller, fed directly and active from the start.
#[derive(Debug, Clone)]
pub struct Direct {
    controller: Controller,
    state: ControllerState,
    probe: bool,
}

impl Direct {
    /// A controller that has seen nothing yet.
    pub fn new(setup: &Setup) -> Self {
        Self {
            controller: Controller::new(setup.config),
            state: ControllerState::engaged(Instant::from_us(0)),
            probe: false,
        }
    }

    /// Whether the host asks for the probe from now on. At first it does not.
    pub fn set_probe(&mut self, probe: bool) {
        self.probe = probe;
    }
}

impl Guidance for Direct {
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    #[inline]
    fn step(&mut self, view: &View) -> Applied {
        let now = view.now();
        let inputs = Inputs {
            lane: view.lane.map_or(Input::Lost, |errors| {
                Input::New(LaneSample {
                    e_y: Metres::from_m(errors.e_y_m),
                    e_theta: Radians::from_rad(errors.e_theta_rad),
                    at: now,
                })
            }),
            column: Input::New(Column {
                driver_torque: Torque::from_nm(view.driver_torque_nm),
                wheel_angle: Radians::from_rad(view.wheel_angle_rad),
            }),
            speeds: Input::New([Speed::from_mps(view.speed_mps); 2]),
            request: Input::New(Request {
                engage: 1,
                authority: Gain::ONE,
                probe: self.probe.into(),
            }),
            faults: FaultSet::NONE,
        };
        let applied = Torque::from_nm(view.motor_torque_nm);
        let command = self.controller.step(&mut self.state, now, applied, &inputs);
        Applied {
            torque_nm: command.torque.nm(),
            limited: is_limited(command.limit),
        }
    }
}
