//! What a lock-step run carries beside the frames of the bus: the records of a binary pipe, how the run starts,
//! the cost of a step. Both ends use it: the simulator and the lock-step image.
//!
//! A *tick* is any number of frames and then one [`SimTime`], at which the ECU
//! receives them all and steps. The image answers with the frames of that step and then its [`StepCost`].
//! Over SLCAN the frames are lines, over a pipe they are records. A run may begin with the parameters and a
//! [`Start`]; without them the ECU boots at the first tick with the paper's parameters, as the product does.
//!
//! Not part of a product image, and not in `core/haptic.dbc`: no vehicle's bus carries these. `lockstep.dbc` describes
//! those that a trace of such a run shows at each tick.

#![no_std]
#![forbid(unsafe_code)]

use haptic_core::bus::Frame;
use haptic_core::bus::messages::ResetCause;
use haptic_core::controller::config::Setup;
use haptic_core::controller::params::{self, ParamError, Params};
use haptic_core::ecu::{Boot, Ecu};
use haptic_core::quantity::Instant;
use haptic_core::safety::faults::FaultSet;
use haptic_secoc::fresh::Algorithm;

/// The simulated time, which ends a tick: the ECU steps when it arrives. Not protected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SimTime(pub Instant);

impl SimTime {
    /// CAN identifier, the weakest on the bus.
    pub const ID: u16 = 0x7F0;

    /// Bytes 0..3: microseconds, little-endian.
    #[must_use]
    pub fn encode(self) -> Frame {
        Frame::full(Self::ID, u64::from(self.0.us()).to_le_bytes())
    }

    /// The instant, if this is such a frame.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let [a, b, c, d, ..] = frame.full_data()?;
        (frame.id() == Self::ID).then(|| Self(Instant::from_us(u32::from_le_bytes([a, b, c, d]))))
    }
}

/// Bytes of a record: identifier (little-endian), length, eight data bytes.
pub const RECORD_LEN: usize = 11;

/// A frame as a record. Bytes past the frame's length are zero.
#[must_use]
pub fn to_record(frame: &Frame) -> [u8; RECORD_LEN] {
    let mut record = [0; RECORD_LEN];
    let data = frame.data();
    let head = frame.id().to_le_bytes().into_iter().chain([data.len() as u8]);
    for (to, from) in record.iter_mut().zip(head.chain(data.iter().copied())) {
        *to = from;
    }
    record
}

/// The frame of a record, or `None` if the identifier or the length is none of a classic frame.
#[must_use]
pub fn from_record(record: &[u8; RECORD_LEN]) -> Option<Frame> {
    let [low, high, len, data @ ..] = record;
    Frame::new(u16::from_le_bytes([*low, *high]), data.get(..usize::from(*len))?)
}

/// Whether a frame is one of this protocol's, which no vehicle's bus carries.
#[must_use]
pub fn is_of_a_lock_step_run(frame: &Frame) -> bool {
    frame.id() >= PARAMETER_ID
}

/// How many parameters a set has.
pub const PARAMETERS: usize = params::PARAMETERS.len();
/// Identifier of the first parameter's frame; the others follow.
const PARAMETER_ID: u16 = 0x7C0;
const _: () = assert!(
    PARAMETERS <= (Start::ID - PARAMETER_ID) as usize,
    "identifiers for all of them"
);

/// The frames that give the image its parameters. Eight bytes: an `f64`, little-endian.
#[must_use]
pub fn parameter_frames(params: &Params) -> [Frame; PARAMETERS] {
    let mut id = PARAMETER_ID;
    params.to_values().map(|value| {
        let frame = Frame::full(id, value.to_le_bytes());
        id = id.wrapping_add(1);
        frame
    })
}

/// Takes one parameter from its frame. False: not a parameter's frame.
pub fn set_parameter(params: &mut Params, frame: &Frame) -> bool {
    let index = usize::from(frame.id().wrapping_sub(PARAMETER_ID));
    let mut values = params.to_values();
    match (values.get_mut(index), frame.full_data()) {
        (Some(value), Some(data)) => {
            *value = f64::from_le_bytes(data);
            *params = Params::from_values(&values);
            true
        }
        _ => false,
    }
}

/// How the ECU of a run starts up, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Start {
    /// In what state.
    pub state: StartState,
    /// The clock at that moment.
    pub at: Instant,
}

// Only those of class C are latched.
const _: () = assert!(
    FaultSet::CRITICAL.bits() < 1 << 24,
    "a start has room for 24 faults"
);

/// In what state an ECU starts up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartState {
    /// The start of a product with good parameters.
    Boot(Boot),
    /// The start of a product whose parameters are damaged.
    WithoutParameters(Boot),
    /// Guiding, with every sender trusted, as in the paper's studies.
    Engaged,
    /// The whole of a product at power-up, with good parameters: the image also says what a product says of its
    /// parameters, of itself and of frames that it did not use, and takes a set of parameters over the bus.
    Product,
}

impl Start {
    /// Identifier.
    const ID: u16 = 0x7EF;

    /// Byte 0: state in bits 0..1, reset cause in 2..4, recent resets in 5..7 (7 stands for more); 1..3: latched
    /// faults, one bit each from the first on; 4..7: clock, us, little-endian.
    #[must_use]
    pub fn encode(self) -> Frame {
        let (code, boot) = match self.state {
            StartState::Boot(boot) => (0, boot),
            StartState::WithoutParameters(boot) => (1, boot),
            StartState::Engaged => (2, Boot::default()),
            StartState::Product => (3, Boot::default()),
        };
        let head = code | (boot.reset as u8) << 2 | boot.recent_resets.min(7) << 5;
        let [a, b, c, d] = self.at.us().to_le_bytes();
        let [low, middle, high, _] = boot.latched.bits().to_le_bytes();
        Frame::full(Self::ID, [head, low, middle, high, a, b, c, d])
    }

    /// The start, if this is such a frame and says one.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let [head, low, middle, high, a, b, c, d] = frame.full_data()?;
        if frame.id() != Self::ID {
            return None;
        }
        let boot = Boot {
            reset: ResetCause::from_code(i64::from(head >> 2 & 7))?,
            recent_resets: head >> 5,
            latched: FaultSet::from_bits(u32::from_le_bytes([low, middle, high, 0])),
        };
        Some(Self {
            state: match head & 3 {
                0 => StartState::Boot(boot),
                1 => StartState::WithoutParameters(boot),
                2 => StartState::Engaged,
                _ => StartState::Product,
            },
            at: Instant::from_us(u32::from_le_bytes([a, b, c, d])),
        })
    }

    /// The ECU that starts up so, the same on both ends.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn ecu(self, params: &Params) -> Result<Ecu, ParamError> {
        Ok(self.ecu_with(&Setup::new(params)?))
    }

    /// An ECU in this state, with parameters that are checked already.
    #[must_use]
    pub fn ecu_with(self, setup: &Setup) -> Ecu {
        match self.state {
            StartState::Boot(boot) => Ecu::new(Some(setup), boot, self.at),
            StartState::WithoutParameters(boot) => Ecu::new(None, boot, self.at),
            StartState::Engaged => Ecu::engaged(setup, self.at),
            StartState::Product => Ecu::new(Some(setup), Boot::default(), self.at),
        }
    }
}

/// From now on, what commands the ECU needs a proof under the keys that everybody knows, and is verified behind the step, as a product does
/// it. A run as [`StartState::Product`] takes no note of it. Not protected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Authenticated(pub Algorithm);

impl Authenticated {
    /// Identifier.
    const ID: u16 = 0x7F3;

    /// Byte 0: 1 SipHash-2-4, 2 AES-CMAC.
    #[must_use]
    pub fn encode(self) -> Frame {
        let code = match self.0 {
            Algorithm::SipHash => 1_u64,
            Algorithm::AesCmac => 2,
        };
        Frame::full(Self::ID, code.to_le_bytes())
    }

    /// The MAC, if this is such a frame and names one.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        match (frame.id(), frame.full_data()?) {
            (Self::ID, [1, ..]) => Some(Self(Algorithm::SipHash)),
            (Self::ID, [2, ..]) => Some(Self(Algorithm::AesCmac)),
            _ => None,
        }
    }
}

/// What one step cost the target, in cycles of its counter. Ends the answer to a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepCost {
    /// Every `Ecu::receive` of the tick and `Ecu::step`.
    pub cycles: u32,
    /// `Ecu::background_step`, and verifying frames.
    pub background_cycles: u32,
}

impl StepCost {
    /// Identifier.
    const ID: u16 = 0x7F1;

    /// Bytes 0..3: cycles, 4..7: cycles of the background step, little-endian.
    #[must_use]
    pub fn encode(self) -> Frame {
        let word = u64::from(self.cycles) | u64::from(self.background_cycles) << 32;
        Frame::full(Self::ID, word.to_le_bytes())
    }

    /// The cost, if this is such a frame.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let [a, b, c, d, e, f, g, h] = frame.full_data()?;
        (frame.id() == Self::ID).then(|| Self {
            cycles: u32::from_le_bytes([a, b, c, d]),
            background_cycles: u32::from_le_bytes([e, f, g, h]),
        })
    }
}

/// How much of its stack the target has ever used. Comes now and then, before a [`StepCost`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StackUse {
    /// Bytes.
    pub bytes: u32,
}

impl StackUse {
    /// Identifier.
    const ID: u16 = 0x7F2;

    /// Bytes 0..3: bytes of stack, little-endian.
    #[must_use]
    pub fn encode(self) -> Frame {
        Frame::full(Self::ID, u64::from(self.bytes).to_le_bytes())
    }

    /// The figure, if this is such a frame.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<Self> {
        let [a, b, c, d, ..] = frame.full_data()?;
        (frame.id() == Self::ID).then(|| Self {
            bytes: u32::from_le_bytes([a, b, c, d]),
        })
    }
}
