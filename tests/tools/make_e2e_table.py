"""Protected frames of AUTOSAR E2E profile 2, from a peer tool, as a table for the tests of the bus codec.

Responsible for: tests/data/e2e_profile2.csv, made with the PyPI package `autosar-e2e` (1.0.0 when the table was
made), and for the exhaustive check of the two claims that the choice of data IDs rests on:
  1. every 1-, 2- and 3-bit flip of an eight-byte frame is seen, for every counter;
  2. a frame checked with another message's list (the base list XOR another constant) is never accepted.
Both run on the peer's own check function, so they say nothing that our code computed. The CRC is affine in the
frame's bits, so whether a flip is seen does not depend on the payload: two payloads are tried to guard that.

Terms: a data ID list has one byte for each of the 16 counter values. Layout of a frame: byte 0 CRC, low nibble of
byte 1 counter; the CRC covers bytes 1 to 7, then the data ID of that counter.

Not here: counter sequences and time-outs, which profile 2 leaves to the receiver.

    python3 -m venv target/venv && target/venv/bin/pip install autosar-e2e
    target/venv/bin/python tests/tools/make_e2e_table.py          # check the claims (some seconds), rewrite the table
    target/venv/bin/python tests/tools/make_e2e_table.py --dry    # check the claims only
    target/venv/bin/python tests/tools/make_e2e_table.py --table  # rewrite the table only
"""

import itertools
import pathlib
import random
import sys

from e2e.p02 import e2e_p02_check, e2e_p02_protect

TABLE = pathlib.Path(__file__).resolve().parent.parent / "data" / "e2e_profile2.csv"
SEED = 2022
FRAMES_PER_COUNTER = 4
# Lengths of CAN FD beside the eight bytes of a classic frame.
LONGER = (12, 48, 64)
COMMON = bytes(range(0x01, 0x11))
BASE = bytes.fromhex("D9ADC10B75F8E07C7AE6AE929B3EEA5E")
# The list itself and as three messages would use it.
CONSTANTS = (0x00, 0x11, 0x22, 0x5A)


def with_constant(constant):
    return bytes(b ^ constant for b in BASE)


def protected(payload, counter, ids):
    """`payload` is all bytes from 1 on; its low nibble of byte 1 is replaced by the counter."""
    frame = bytearray([0, payload[0] & 0xF0 | counter, *payload[1:]])
    e2e_p02_protect(frame, ids, increment_counter=False)
    return bytes(frame)


def accepted(frame, ids):
    return e2e_p02_check(frame, ids)


def unseen_flips(ids, payload, bits):
    """How many (counter, set of `bits` flipped bits) the receiver would accept."""
    masks = [1 << i for i in range(64)]
    unseen = 0
    for counter in range(16):
        sent = int.from_bytes(protected(payload, counter, ids), "big")
        for flipped in itertools.combinations(masks, bits):
            unseen += accepted((sent ^ sum(flipped)).to_bytes(8, "big"), ids)
    return unseen


def check_published_values():
    """CRC-8/2F of "123456789", and the first frames of an all-zero payload under the common list."""
    from e2e.crc import calculate_crc8_h2f

    assert calculate_crc8_h2f(b"123456789") == 0xDF
    for counter, crc in enumerate((0x0E, 0x1B, 0x98)):
        assert protected(bytes(7), counter, COMMON) == bytes([crc, counter, 0, 0, 0, 0, 0, 0])


def check_flips(rng):
    for constant in CONSTANTS:
        ids = with_constant(constant)
        for payload in (bytes(7), rng.randbytes(7)):
            unseen = [unseen_flips(ids, payload, bits) for bits in (1, 2, 3)]
            print(f"list XOR {constant:02X}: unseen 1-, 2-, 3-bit flips {unseen}")
            assert unseen == [0, 0, 0]
    for payload in (bytes(7), rng.randbytes(7)):
        print(f"list 01..10: unseen 1-, 2-bit flips {[unseen_flips(COMMON, payload, bits) for bits in (1, 2)]}")


def check_masquerade(rng):
    tried = 0
    for sender, receiver in itertools.permutations(range(256), 2):
        sent_ids, wanted_ids = with_constant(sender), with_constant(receiver)
        for counter in range(16):
            tried += 1
            assert not accepted(protected(rng.randbytes(7), counter, sent_ids), wanted_ids)
    print(f"frames under another message's list: {tried} tried, none accepted")


def write_table(rng):
    lines = [
        "# AUTOSAR E2E profile 2, frames in hexadecimal; made by tests/tools/make_e2e_table.py with the",
        f"# Python package autosar-e2e; seed {SEED}.",
        "data_id_list,counter,frame",
    ]
    for ids in (COMMON, *map(with_constant, CONSTANTS)):
        for counter in range(16):
            for _ in range(FRAMES_PER_COUNTER):
                frame = protected(rng.randbytes(7), counter, ids)
                lines.append(f"{ids.hex().upper()},{counter:X},{frame.hex().upper()}")
    for payload_bytes in LONGER:
        for counter in range(16):
            frame = protected(rng.randbytes(payload_bytes - 1), counter, BASE)
            lines.append(f"{BASE.hex().upper()},{counter:X},{frame.hex().upper()}")
    TABLE.write_text("\n".join(lines) + "\n")
    print(f"{len(lines) - 3} frames in {TABLE.name}")


if __name__ == "__main__":
    check_published_values()
    if "--table" not in sys.argv[1:]:
        check_flips(random.Random(SEED))
        check_masquerade(random.Random(SEED))
    if "--dry" not in sys.argv[1:]:
        write_table(random.Random(SEED))
