//! The shipping controller without its bus: full resolution every step, so that what is seen is the law and
//! the envelope alone.

use haptic_core::controller::{Controller, ControllerState, Inputs};
use haptic_core::envelope::LimitReason;
use haptic_core::law::LaneSample;
use haptic_core::params::Config;
use haptic_core::quantity::{Metres, Radians};

use super::{Applied, Guidance, View};

/// The shipping controller, fed directly.
#[derive(Debug, Clone)]
pub struct Direct {
    controller: Controller,
    state: ControllerState,
}

impl Direct {
    /// A controller that has seen nothing yet.
    pub fn new(config: Config) -> Self {
        Self {
            controller: Controller::new(config),
            state: ControllerState::NEW,
        }
    }
}

impl Guidance for Direct {
    fn looks_at_road(&self, _step: u32) -> bool {
        true
    }

    #[inline]
    fn step(&mut self, view: &View) -> Applied {
        let now = super::instant(view.step);
        let lane = view.lane.map(|errors| LaneSample {
            e_y: Metres::from_m(errors.e_y_m),
            e_theta: Radians::from_rad(errors.e_theta_rad),
            at: now,
        });
        let command = self.controller.step(&mut self.state, now, &Inputs { lane });
        Applied {
            torque_nm: command.torque.nm(),
            limited: command.limit != LimitReason::None,
        }
    }
}
