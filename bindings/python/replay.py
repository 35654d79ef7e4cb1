"""Replays a bus: reads "t_us id data" (decimal, hexadecimal, hexadecimal) from standard input, in order, hands what is
addressed to the ECU to it, steps it once for each time, and prints what it sends in the same form."""

import itertools
import sys

import haptic_guidance as hg

ecu = hg.Ecu(engaged=True)
lines = (line.split() for line in sys.stdin)
for t_us, frames in itertools.groupby(lines, key=lambda line: int(line[0])):
    for _, id, data in frames:
        if int(id, 16) in hg.INPUT_IDS:
            refused = ecu.receive(int(id, 16), bytes.fromhex(data), t_us)
            if refused is not None:
                sys.exit(f"{t_us} us: {id} {data}: {refused}")
    for frame in ecu.step(t_us).frames:
        print(t_us, f"{frame.id:03X}", frame.data.hex().upper())
