"""Drives the lock-step image tick by tick: its ECU steps when this client says so, at the time that it says.

    cargo xtask qemu lockstep --can tcp:127.0.0.1:3333,server,nowait
    python examples/lockstep_client.py socket://127.0.0.1:3333

A tick is any number of frames and then one SimTime (0x7F0; bytes 0 to 3: microseconds, little-endian). The ECU receives
them all at that time and steps; the image answers with the frames of the step and, last, StepCost (0x7F1). Both are in
firmware/lockstep/lockstep.dbc. Nothing depends on how fast client or host are.
"""

import struct
import sys

import can

SIM_TIME, STEP_COST = 0x7F0, 0x7F1


class LockStep:
    """A bus to a lock-step image; closing the channel ends the image."""

    def __init__(self, channel):
        self.bus = can.Bus(interface="slcan", channel=channel, bitrate=500_000)

    def tick(self, time_us, frames=()):
        """Sends the frames of a tick and ends it; returns what the ECU answers."""
        for frame in frames:
            self.bus.send(frame)
        data = struct.pack("<Q", time_us & 0xFFFF_FFFF)
        self.bus.send(can.Message(arbitration_id=SIM_TIME, data=data, is_extended_id=False))
        answers = []
        while True:
            frame = self.bus.recv(timeout=60)
            if frame is None:
                raise TimeoutError("no answer to a tick: does lockstep run, and is it built from these sources?")
            if frame.arbitration_id == STEP_COST:
                return answers
            answers.append(frame)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} CHANNEL, for instance socket://127.0.0.1:3333")
    ecu = LockStep(sys.argv[1])
    for ms in range(1000):
        answers = ecu.tick(1000 * ms)
    print(f"1,000 ticks; the last answer: {[hex(frame.arbitration_id) for frame in answers]}")
    ecu.bus.shutdown()
