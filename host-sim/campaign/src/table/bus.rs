//! Faults of the bus: frames lost, late, again, damaged, forged. All of them also run in QEMU.

use super::{BLIND_MS, FaultCase, STALE_MS};
use crate::bytes::{COLUMN, LANE, REQUEST, VEHICLE};
use crate::injection::{Injection, RequestFault, Wire};

const ALL: &[u16] = &[LANE, COLUMN, VEHICLE, REQUEST];

const fn lost(frames: u32) -> Injection {
    Injection::Wire(Wire::Lost(ALL, Some(frames)))
}

const SILENCE: Injection = Injection::Wire(Wire::Lost(ALL, None));

const fn wire(wire: Wire) -> Injection {
    Injection::Wire(wire)
}

pub(super) const ROWS: &[FaultCase] = rows! {
    "silence-20" "no frames for 20 ms after a lane preview" [SILENCE] .after_sample().bridged().lasts(20).q();
    "silence-31" "no frames for 31 ms" [SILENCE] .hands_over(STALE_MS).lasts(31).q();
    "silence-1000" "no frames for 1 s" [SILENCE] .hands_over(STALE_MS).lasts(1000).q();
    "lost-1" "one frame of each message lost" [lost(1)] .bridged().q();
    "lost-3" "three frames of each message in a row lost: 40 ms of speed" [lost(3)] .hands_over(STALE_MS).q();
    "lost-4" "four frames of each message in a row lost" [lost(4)] .hands_over(STALE_MS).q();
    "lost-10" "ten frames of each message in a row lost" [lost(10)] .hands_over(STALE_MS).q();
    "lost-column-10" "ten column frames in a row lost: 20 ms"
        [wire(Wire::Lost(&[COLUMN], Some(10)))] .bridged().q();
    "silent-lane" "no lane preview" [wire(Wire::Lost(&[LANE], None))] .hands_over(BLIND_MS).q();
    "silent-column" "no column frames" [wire(Wire::Lost(&[COLUMN], None))] .hands_over(STALE_MS).q();
    "silent-vehicle" "no speeds" [wire(Wire::Lost(&[VEHICLE], None))] .hands_over(STALE_MS).q();
    "silent-host" "no command" [wire(Wire::Lost(&[REQUEST], None))] .hands_over(STALE_MS).q();
    "duplicates" "every frame twice" [wire(Wire::Twice)] .rejected().q();
    "reordering" "every second frame of a message after its successor" [wire(Wire::Swapped)] .rejected().q();
    "replay" "what was sent 1 s ago in place of what is sent: a counter of 16 lets some column frames pass, whose motor torque is then old"
        [wire(Wire::Replayed(ALL, 1000))] .hands_over_or_stops(STALE_MS).lasts(1000).q();
    "counter-frozen" "counters frozen: the first frame of each is still good"
        [wire(Wire::CounterFrozen)] .hands_over(STALE_MS + 10).q();
    "counter-wrap" "counters wrap every 16 frames, as always" [] .bridged().q();
    "crc-wrong-1" "one bit wrong in one frame of each message" [wire(Wire::Flipped(Some(1)))] .rejected().q();
    "crc-wrong-5" "one bit wrong in five frames of each message"
        [wire(Wire::Flipped(Some(5)))] .hands_over(STALE_MS).q();
    "crc-wrong" "one bit wrong in every frame" [wire(Wire::Flipped(None))] .hands_over(STALE_MS).q();
    "masquerade" "each message's bytes also under another identifier"
        [wire(Wire::Masquerade)] .rejected().q();
    "wrong-length" "frames of seven bytes" [wire(Wire::Short)] .hands_over(STALE_MS).q();
    "wrong-identifier" "frames under an unknown identifier" [wire(Wire::Renamed)] .hands_over(STALE_MS).q();
    "ten-times-the-rate" "ten frames where one is due, counters running: no sender counts so fast"
        [wire(Wire::Burst(10))] .hands_over(STALE_MS).q();
    "jitter" "frames up to 25 ms late, in order: a gap may pass the time-out"
        [wire(Wire::Jittered(25))] .bridged().may_hand_over_at_once().q();
    "request-toggles" "request toggles at 50 Hz" [Injection::Request(RequestFault::Toggles)] .fades(22).q();
    "bus-off" "bus off for 100 ms, then back" [SILENCE] .hands_over(STALE_MS).lasts(100).q();
};
