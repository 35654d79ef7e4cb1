//! What the controller remembers from step to step: what decides a torque is kept twice ([`Memory`]), the rest once ([`KeptOnce`]).
//!
//! Not here: how memory is kept twice ([`crate::safety::redundant`]).

use crate::law::LawState;
use crate::law::activity::Activity;
use crate::law::probe::ProbeState;
use crate::quantity::{Instant, Micros, Radians, Ratio, Torque, TurningRate};
use crate::safety::coast::Coast;
use crate::safety::envelope::EnvelopeState;
use crate::safety::faults::FaultSet;
use crate::safety::frozen_torque::FrozenTorqueState;
use crate::safety::hands::HandsState;
use crate::safety::modes::Mode;
use crate::safety::motion_history::MotionHistory;
use crate::safety::plausibility::PlausibilityState;
use crate::safety::ramp::{Ramp, TorqueHistory};
use crate::safety::redundant::{Redundant, Words, words};

words! {
    /// State that is kept twice, so that a flipped bit is found. Each part is copied only in steps that change it.
    pub(crate) struct Memory {
        pub(super) fast: FastState,
        /// When each input was last new. Guidance ends long before these instants are a wrap of the clock old.
        pub(super) input_times: InputTimes,
        pub(super) law: LawState,
        pub(super) plausibility: PlausibilityState,
        /// Share of the law's torque at the speed in use, 0 to 1; 0 before the first speed.
        pub(super) share: Ratio,
        pub(super) coast: Coast,
        pub(super) ramp: Ramp,
    }
}

words! {
    /// The part that most steps change.
    pub(super) struct FastState {
        pub(super) packed: PackedState,
        pub(super) last_step: Instant,
        /// How long the inputs have been valid in Standby.
        pub(super) ready: Micros,
        /// [`crate::safety::faults::Fault`] bits that last beyond a step: of inputs that were implausible when last new, and of
        /// class C until power-off.
        pub(super) kept: u32,
        /// The rate of turn at the instant of the last lane sample, and the angle turned since; zero for a fresh sample.
        pub(super) rate_then: TurningRate,
        pub(super) turned: Radians,
        /// The probe's part of the torque applied.
        pub(super) probe_applied: Torque,
        pub(super) probe: ProbeState,
        pub(super) hands: HandsState,
        pub(super) envelope: EnvelopeState,
    }
}

words! {
    pub(super) struct InputTimes {
        pub(super) lane: Instant,
        pub(super) column: Instant,
        pub(super) motion: Instant,
        pub(super) request: Instant,
    }
}

/// Four bytes that share a word, as memory is compared word by word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(4))]
pub(super) struct PackedState {
    /// A [`Mode`] code.
    pub(super) mode: u8,
    /// 1 while the last request was high.
    pub(super) requested: u8,
    /// Late and early steps in a row.
    pub(super) late: u8,
    pub(super) early: u8,
}

impl PackedState {
    const fn word(self) -> u32 {
        u32::from_ne_bytes([self.mode, self.requested, self.late, self.early])
    }
}

impl Words for PackedState {
    fn map_words(self, change: &mut impl FnMut(u32) -> u32) -> Self {
        let [mode, requested, late, early] = change(self.word()).to_ne_bytes();
        Self {
            mode,
            requested,
            late,
            early,
        }
    }

    fn agreement(&self, other: &Self) -> u32 {
        self.word().agreement(&other.word())
    }
}

impl Memory {
    #[expect(clippy::as_conversions, reason = "a code is its discriminant")]
    pub(super) const fn new(mode: Mode, now: Instant) -> Self {
        Self {
            fast: FastState {
                packed: PackedState {
                    mode: mode as u8,
                    // A request that is high from the start is no rising edge.
                    requested: 1,
                    late: 0,
                    early: 0,
                },
                last_step: now,
                ready: Micros::from_us(0),
                kept: 0,
                rate_then: TurningRate::ZERO,
                turned: Radians::ZERO,
                probe_applied: Torque::ZERO,
                probe: ProbeState::SILENT,
                hands: HandsState::NEW,
                envelope: EnvelopeState::new(now),
            },
            input_times: InputTimes {
                lane: now,
                column: now,
                motion: now,
                request: now,
            },
            law: LawState::NEW,
            plausibility: PlausibilityState::NEW,
            share: Ratio::ZERO,
            coast: Coast::NEW,
            ramp: Ramp::NONE,
        }
    }

    pub(super) fn faults(&self) -> FaultSet {
        FaultSet::from_bits(self.fast.kept)
    }
}

/// The parts beside `FastState` that a step changed, one bit each. A part that is not among them keeps its old second copy, so that
/// a bit that flips in it during the step is found in the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ChangedParts(u32);

impl ChangedParts {
    pub(super) const NOTHING: Self = Self(0);
    pub(super) const INPUT_TIMES: Self = Self(1);
    pub(super) const LAW: Self = Self(2);
    pub(super) const MOTION: Self = Self(4);
    pub(super) const LANE: Self = Self(8);
    pub(super) const COLUMN: Self = Self(16);
    pub(super) const RAMP: Self = Self(32);
    pub(super) const COAST: Self = Self(64);

    pub(super) const fn add(&mut self, part: Self) {
        self.0 |= part.0;
    }

    const fn has(self, part: Self) -> bool {
        self.0 & part.0 != 0
    }
}

/// Brings the second copy of each changed part up to date.
pub(super) fn seal(guarded: &mut Redundant<Memory>, changed: ChangedParts) {
    guarded.seal_part(|memory| &mut memory.fast);
    if changed.has(ChangedParts::INPUT_TIMES) {
        guarded.seal_part(|memory| &mut memory.input_times);
    }
    if changed.has(ChangedParts::LAW) {
        guarded.seal_part(|memory| &mut memory.law);
    }
    if changed.has(ChangedParts::MOTION) {
        guarded.seal_part(|memory| &mut memory.plausibility.motion);
        guarded.seal_part(|memory| &mut memory.share);
    }
    if changed.has(ChangedParts::LANE) {
        guarded.seal_part(|memory| &mut memory.plausibility.lane);
    }
    if changed.has(ChangedParts::COLUMN) {
        guarded.seal_part(|memory| &mut memory.plausibility.column);
    }
    if changed.has(ChangedParts::COAST) {
        guarded.seal_part(|memory| &mut memory.coast);
    }
    if changed.has(ChangedParts::RAMP) {
        guarded.seal_part(|memory| &mut memory.ramp);
    }
}

/// What is kept once, because what a flipped bit can do there is bounded (`docs/explanation/monitor-and-memory.md`).
#[derive(Debug, Clone)]
pub(super) struct KeptOnce {
    pub(super) torque_history: TorqueHistory,
    pub(super) motion_history: MotionHistory,
    /// Whether the newest sample of lane and column is still to be checked. A flip skips one check, whose time the next one covers, or
    /// repeats one on the same sample, over no time.
    pub(super) is_lane_pending: bool,
    pub(super) is_column_pending: bool,
    /// What the check of the column alone knows of the driver torque.
    pub(super) frozen_torque: FrozenTorqueState,
    /// What driver activity has felt; the share that is read from it is bounded.
    pub(super) activity: Activity,
}

impl KeptOnce {
    pub(super) fn new() -> Self {
        Self {
            torque_history: TorqueHistory::NEW,
            motion_history: MotionHistory::new(),
            is_lane_pending: false,
            is_column_pending: false,
            frozen_torque: FrozenTorqueState::default(),
            activity: Activity::NEW,
        }
    }
}
