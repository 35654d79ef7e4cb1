//! The mode machine: one explicit table of what follows what.
//!
//! Torque is zero outside Active, Fade and Handover. Nothing re-engages by itself: the only way into Active
//! is `Engage`, which the controller raises on a rising edge of the request after 500 ms of valid data in
//! Standby. `docs/explanation/behaviour.md` draws this table, and a test holds the drawing to it.
//!
//! Not here: what raises an event, and what the torque does in a mode.

/// What the ECU is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// The ECU checks itself and its parameters.
    Boot = 0,
    /// The ECU is ready, or waits for valid inputs; no torque.
    Standby = 1,
    /// The ECU guides.
    Active = 2,
    /// Planned end of guidance: the torque falls to zero at 4 N.m/s.
    Fade = 3,
    /// An input failed: the last trusted torque fades to zero over 2 s while the driver is warned.
    Handover = 4,
    /// The computation, memory, timing or output failed: no torque until the next power-up.
    Fault = 5,
    /// There are no valid parameters, or there were several resets in a row: no torque until the next power-up.
    Locked = 6,
}

/// What can change a mode, least urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Event {
    /// The self-test passed.
    BootPassed = 0,
    /// The host requested guidance, and the inputs are ready for it.
    Engage = 1,
    /// The torque of a fade or a handover has reached zero.
    Faded = 2,
    /// The request ended, or the vehicle is too slow to be guided (class A).
    Disengage = 3,
    /// An input is stale, frozen or implausible (class B).
    InputLost = 4,
    /// The self-test found no usable parameters, or too many resets.
    BootRejected = 5,
    /// The computation, the memory, the deadline or the output failed (class C).
    Critical = 6,
}

use Mode::{Active, Boot, Fade, Fault, Handover, Locked, Standby};

impl Mode {
    /// Every mode, in the order of the codes.
    pub const ALL: [Self; 7] = [Boot, Standby, Active, Fade, Handover, Fault, Locked];

    /// The mode of a code on the bus or in memory.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        Some(match code {
            0 => Boot,
            1 => Standby,
            2 => Active,
            3 => Fade,
            4 => Handover,
            5 => Fault,
            6 => Locked,
            _ => return None,
        })
    }

    /// The transition table.
    #[must_use]
    pub const fn after(self, event: Event) -> Self {
        match (self, event) {
            // A fault or a lock ends only with the next power-up, and a critical fault leads there from any other
            // mode.
            (Fault | Locked, _) => self,
            (_, Event::Critical) => Fault,
            (Boot, Event::BootPassed) => Standby,
            (Boot, Event::BootRejected) => Locked,
            (Standby, Event::Engage) => Active,
            (Active, Event::Disengage) => Fade,
            (Active, Event::InputLost) => Handover,
            // The driver's own switch is quicker than the two seconds of a handover.
            (Handover, Event::Disengage) => Fade,
            (Fade | Handover, Event::Faded) => Standby,
            // A fade needs no input, so losing one changes nothing.
            _ => self,
        }
    }

    /// The mode after the events of one step: the most urgent one that changes the mode decides.
    #[must_use]
    pub fn after_all(self, raised: Events) -> Self {
        let changing = raised.0 & self.changing().0;
        Event::from_code(changing.checked_ilog2()).map_or(self, |event| self.after(event))
    }

    /// The events that change the mode, from the table.
    #[expect(
        clippy::as_conversions,
        clippy::indexing_slicing,
        reason = "the table is built at compile time, and a mode has a place in it"
    )]
    const fn changing(self) -> Events {
        const CHANGING: [Events; Mode::ALL.len()] = {
            let mut all = [Events(0); Mode::ALL.len()];
            let mut mode = 0;
            while mode < all.len() {
                let mut event = 0;
                while event < Event::ALL.len() {
                    if Mode::ALL[mode].after(Event::ALL[event]) as u8 != mode as u8 {
                        all[mode].0 |= 1 << event;
                    }
                    event += 1;
                }
                mode += 1;
            }
            all
        };
        // A mode has a place in the table of all modes, so that there is no bounds check to panic.
        CHANGING[self as usize]
    }

    /// Whether the mode may have a torque at all.
    #[must_use]
    pub const fn may_have_torque(self) -> bool {
        matches!(self, Active | Fade | Handover)
    }
}

/// Some events, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Events(u32);

impl Events {
    /// One event.
    #[must_use]
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    pub const fn only(event: Event) -> Self {
        Self(1 << event as u32)
    }

    /// Adds an event if it was raised.
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    pub const fn insert_if(&mut self, raised: bool, event: Event) {
        self.0 |= (raised as u32) << event as u32;
    }
}

impl Event {
    /// The event of a bit's place.
    const fn from_code(code: Option<u32>) -> Option<Self> {
        Some(match code {
            Some(0) => Self::BootPassed,
            Some(1) => Self::Engage,
            Some(2) => Self::Faded,
            Some(3) => Self::Disengage,
            Some(4) => Self::InputLost,
            Some(5) => Self::BootRejected,
            Some(6) => Self::Critical,
            _ => return None,
        })
    }

    /// Every event, least urgent first.
    pub const ALL: [Self; 7] = [
        Self::BootPassed,
        Self::Engage,
        Self::Faded,
        Self::Disengage,
        Self::InputLost,
        Self::BootRejected,
        Self::Critical,
    ];
}
