//! What can be made wrong, between the world and the ECU.
//!
//! An [`Injection`] says what, a row of the table says when and for how long. Sensor faults change values before
//! they are encoded; wire faults change frames after that; both then go through the shipping decoder. Terms:
//! *onset*, the first step in which an injection acts.

use haptic_core::ecu::injection::Region;
use haptic_sim::models::torsion_bar::ColumnFault;

/// What the first injection of a kind says, if there is one.
macro_rules! first_of {
    ($injections:expr, $kind:pat => $says:expr) => {
        $injections.iter().find_map(|injection| match injection {
            $kind => Some($says),
            _ => None,
        })
    };
}
pub(super) use first_of;

/// A value that a sensor gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Signal {
    LateralError,
    YawError,
    DriverTorque,
    WheelAngle,
    Speed1,
    Speed2,
    YawRate,
    /// The motor's torque as the column tells it.
    MotorTorque,
}

impl Signal {
    pub(super) const COUNT: usize = 8;
}

/// What becomes of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Change {
    /// Stays what it was at the onset.
    Frozen,
    /// Times a factor.
    Times(f64),
    /// Moves the other way from the onset on: its rate has the wrong sign.
    Mirrored,
    /// Plus so much.
    Plus(f64),
    /// Plus so much more each second.
    Drifting(f64),
    /// Plus Gaussian noise of this standard deviation in every sample.
    Noisy(f64),
    /// A constant.
    StuckAt(f64),
    /// Falls or rises, beside what the truth does, by so much per second until it reaches a value.
    Approaching { value: f64, per_s: f64 },
    /// Plus so much, reached in a straight line within so many ms.
    Sliding { by: f64, ms: u32 },
    /// Times a factor that is reached in a straight line within so many ms.
    Growing { to: f64, ms: u32 },
    /// A new value far away in every sample: this much up, this much down.
    Jumping(f64),
}

/// What becomes of frames. Lists of identifiers name the messages concerned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wire {
    /// The first so many frames of each message are lost; all if `None`.
    Lost(&'static [u16], Option<u32>),
    /// Every frame comes twice.
    Twice,
    /// Every second frame of a message comes after the one that was sent after it.
    Swapped,
    /// In place of what is sent of these messages comes what was sent so long ago, ms.
    Replayed(&'static [u16], usize),
    /// Another node sends each lane preview first, with an e_y' so many LSB to the left and the camera's own counter.
    Outrun(i64),
    /// Another node sends six frames behind each of this message's, which end where its counter was and so are in order with all;
    /// a field in each has another raw value: start, bits, how much more.
    Between {
        id: u16,
        start: u32,
        bits: u32,
        more: i64,
    },
    /// Senders repeat the counter that they had at the onset.
    CounterFrozen,
    /// One bit is flipped in the first so many frames of each message; in all if `None`.
    Flipped(Option<u32>),
    /// A field's raw value, with a CRC that fits: start, bits, value. The first so many frames; all if `None`.
    Field {
        id: u16,
        start: u32,
        bits: u32,
        value: i64,
        frames: Option<u32>,
    },
    /// Another node sends each message's bytes under the next message's identifier as well.
    Masquerade,
    /// The last byte is missing.
    Short,
    /// Frames come under an identifier that nobody listens to.
    Renamed,
    /// Senders send so many frames, counted on, where they should send one.
    Burst(u8),
    /// Every frame waits up to so many ms; the order of a message's frames stays.
    Jittered(u32),
}

/// What becomes of the ECU's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    /// Runs faster or slower by a factor, from the start of the run.
    Rate(f64),
    /// Wraps at the onset.
    Wraps,
    /// The step at the onset comes so many ms late; those that it covers are lost.
    Late(u32),
    /// So many steps in a row are lost, again and again every so many ms.
    Missing { steps: u32, every_ms: u32 },
    /// Two runs in the tick of the onset.
    TwoRuns,
    /// A timer that runs five times too fast.
    Runaway,
}

/// What becomes of the ECU's inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Inside {
    /// One bit of a region flips at the onset; the seed picks it.
    Flip(Region),
    /// The law asks for 5 N.m, away from what it should ask for.
    LawForced,
    /// The law asks for 5 N.m to the left, but in one of 16 ms for none.
    LawInterrupted,
    /// The law asks for a new random torque every 200 ms.
    LawRandom,
    /// The monitor agrees with everything.
    MonitorAgrees,
    /// The task that receives frames does not run.
    ReceiverSkipped,
    /// The supply breaks down: the ECU starts anew.
    BrownOut,
}

/// What becomes of the torque between command and column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motor {
    /// Delivers a share.
    Times(f64),
    /// Goes on with the torque that it had at the onset.
    Stuck,
}

/// What the driver's hand does to the wheel, beyond what a driver model does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Hand {
    /// Jerks the wheel: a half wave of so many N.m and ms; the seed picks the side. Beginning so many ms before
    /// the onset.
    Jerk { peak_nm: f64, ms: i32, before_ms: i32 },
    /// Holds the driver torque at so many N.m against the guidance, for so many ms.
    Opposes { torque_nm: f64, ms: i32 },
    /// Opposes by so many N.m and lets go again, five times a second.
    Taps { torque_nm: f64 },
}

/// What becomes of the host's request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum RequestFault {
    /// Ends.
    Ends,
    /// Is low in the first so many frames.
    Drops(u32),
    /// Is high and low in turn.
    Toggles,
}

/// One thing that is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Injection {
    Sensor(Signal, Change),
    /// The camera does not vouch for its errors.
    Invalid,
    /// A node that knows the ECU's checks: e_y' goes to so many m within so many ms, and e_theta' follows the yaw rate, so
    /// that no movement is predicted. With `hides_hand` the driver torque becomes what the column's model expects.
    FalseLane {
        to_m: f64,
        ms: u32,
        hides_hand: bool,
    },
    /// A line that bends away: both lane errors move as if it went so many m aside within so many ms, there and no further.
    /// Nothing else is false, and nothing contradicts it.
    BendsAway {
        by_m: f64,
        ms: u32,
    },
    Wire(Wire),
    Clock(Clock),
    Inside(Inside),
    Motor(Motor),
    /// Something of a column with a bar.
    Column(ColumnFault),
    Hand(Hand),
    Request(RequestFault),
}

/// How the ECU starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// Active from the first step, as studies have it.
    Engaged,
    /// From Boot; the request rises at the onset.
    Boot,
    /// From Boot with one bit wrong in both copies of the parameters; the request rises at the onset.
    NoParameters,
    /// From Boot after power failed while a new copy of the parameters was written; the request rises at the onset.
    HalfWritten,
    /// From Boot after three resets within 10 s; the request rises at the onset.
    ThirdReset,
    /// Active, with parameters that are each in range and absurd together.
    Absurd,
    /// Active, on a road whose heading passes pi at the onset.
    HeadingWraps,
}
