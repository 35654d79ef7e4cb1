"""Frames of this project's bus, judged by a peer: the PyPI package `autosar-e2e` has to accept every one.

Reads what `candump -L` or `host-sim run SCENARIO.toml --out DIR --bus-log` wrote, prints how many frames of each
message were accepted, and ends with 1 if one was not.

    python3 -m venv target/venv && target/venv/bin/pip install autosar-e2e
    cargo run --release -- run examples/relying-driver.toml --out out/mine --bus-log
    target/venv/bin/python tests/tools/check_bus_log.py out/mine/bus.log
"""

import collections
import sys

from e2e.p02 import e2e_p02_check

BASE = bytes.fromhex("D9ADC10B75F8E07C7AE6AE929B3EEA5E")
# By identifier, what the message's list is XORed with (docs/reference/bus.md).
CONSTANTS = {
    0x100: 0x11,
    0x110: 0x22,
    0x120: 0x33,
    0x130: 0x44,
    0x140: 0x55,
    0x0C0: 0x5A,
    0x0D0: 0x66,
    0x300: 0x77,
    0x310: 0x88,
    0x320: 0x99,
}


def main(path):
    accepted, refused = collections.Counter(), 0
    with open(path, encoding="ascii") as log:
        for number, line in enumerate(log, 1):
            identifier, data = line.split()[2].split("#")
            identifier, data = int(identifier, 16), bytes.fromhex(data)
            if identifier not in CONSTANTS:
                continue
            if e2e_p02_check(data, bytes(b ^ CONSTANTS[identifier] for b in BASE)):
                accepted[identifier] += 1
            else:
                refused += 1
                print(f"{path}, line {number}: refused: {line.rstrip()}")
    for identifier, count in sorted(accepted.items()):
        print(f"{identifier:03X}: {count} frames accepted")
    print(f"{sum(accepted.values())} accepted, {refused} refused")
    return 1 if refused or not accepted else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else __doc__)
