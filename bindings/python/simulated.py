"""Simulates a scenario and prints the bus of the run: simulated.py SCENARIO.toml. Lines of "t_us id data" (decimal, hexadecimal,
hexadecimal), of what the controller sent."""

import sys

import haptic_guidance as hg

bus = hg.simulate(hg.Scenario.load(sys.argv[1]), bus=True).bus
for t_us, id, data in zip(bus["t_us"].tolist(), bus["id"].tolist(), bus["data"]):
    if id not in hg.INPUT_IDS:
        print(t_us, f"{id:03X}", data.tobytes().hex().upper())
