//! What comes from outside in one step of the closed loop.

/// Everything from outside in one step. The default lets the scenario have its way.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Action {
    /// Whether the host asks for guidance; `None`: it does, but not where a speed that changes is less than is guided.
    pub engage: Option<bool>,
    /// Share of the guidance torque that the host allows, 0 to 1; `None`: all of it. Beyond 0 to 1 it is the nearer
    /// end; NaN is 0.
    pub authority: Option<f64>,
    /// Whether the host asks for the probe; `None`: as the scenario has it.
    pub probe: Option<bool>,
    /// Torque of a hand on the wheel beside the driver model's, N.m, positive turns left. The torque sensor sees it.
    pub hand_torque_nm: f64,
    /// Where the driver steers to beside the lane's centre, m to the right: the next lane.
    pub beside_m: f64,
    /// What the world does wrong, beside the failure that the scenario plans.
    pub world: WorldFaults,
}

/// What the world does wrong in one step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WorldFaults {
    /// The guidance torque does not reach the column.
    pub torque_lost: bool,
    /// The lane preview does not reach the controller.
    pub lane_lost: bool,
}

impl WorldFaults {
    /// Whether anything is wrong.
    pub fn any(self) -> bool {
        self.torque_lost || self.lane_lost
    }

    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            torque_lost: self.torque_lost || other.torque_lost,
            lane_lost: self.lane_lost || other.lane_lost,
        }
    }
}

/// What the host asks of the controller in one step, as the request frame carries it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Whether guidance is asked for.
    pub engage: bool,
    /// Share of the guidance torque, 0 to 1.
    pub authority: f64,
    /// Whether the probe is asked for.
    pub probe: bool,
}
