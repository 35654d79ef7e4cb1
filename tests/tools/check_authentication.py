"""Authentication by another program: its MACs are those of the PyPI package `cryptography`, its frames those of examples/authentication.py.

    python tests/tools/check_authentication.py            # compare core/secoc/tests/frames.csv, and drive the lock-step image in QEMU
    python tests/tools/check_authentication.py --table    # write that file

The file is a talk between an ECU at its start 3 and its senders: who speaks, identifier, bytes; `core/secoc/tests/frames.rs` has the
Rust sides hold it. The drive is on the ECU's own time, so that a busy computer changes nothing.
"""

import socket
import subprocess
import sys
from pathlib import Path

import cantools

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples"))
from authentication import CAMERA_KEY, DBC, HOST_KEY, OFFER, Prover, message, tag  # noqa: E402
import talk_to_the_ecu as client  # noqa: E402

TABLE = ROOT / "core/secoc/tests/frames.csv"
EPOCH = 3 * 4096
NAMES = ["LanePreview", "Vehicle", "Request", "ParameterWrite", "ParameterUnlock"]
AUTHENTICATED, AES_CMAC = 0x7F3, 2  # firmware/lockstep/src/lib.rs
SECONDS = 3


def talk():
    bus, own = cantools.database.load_file(client.DBC), cantools.database.load_file(DBC)
    numbers = iter(range(0x01020304, 0x7FFFFFFF, 0x11111111))
    prover = Prover(lambda data: client.protected_crc(bus.get_message_by_name("Request"), data), number=lambda: next(numbers))
    lines = []

    def said(who, frame):
        lines.append(f"{who},{frame.arbitration_id:03X},{bytes(frame.data).hex().upper()}")

    def sends(name, k):
        data = bytearray((17 * k + 29 * at) % 256 for at in range(8))
        data[0] = client.protected_crc(bus.get_message_by_name(name), bytes(data))
        frame = message(bus.get_message_by_name(name).frame_id, data)
        said("sender", frame)
        for proven in prover.prove(frame):
            said("bus", proven)

    for name in NAMES:
        sends(name, 0)
    status = own.get_message_by_name("Authentication")
    values = {signal.name: 0 for signal in status.signals} | {f"Authentication_Waiting_{name}": 1 for name in NAMES}
    data = bytearray(status.encode(values | {"Authentication_State": 4}, strict=False))
    data[0] = client.protected_crc(status, bytes(data))
    heard = message(status.frame_id, data)
    said("ecu", heard)
    questions = prover.hear(heard)
    for place, question in enumerate(questions):
        said("bus", question)
        identifier = question.arbitration_id - 0x400
        key = CAMERA_KEY if NAMES[place] == "LanePreview" else HOST_KEY
        mac = tag(key, OFFER, identifier, EPOCH, int.from_bytes(question.data, "little"))
        offer = message(0x358, (EPOCH << 32 | mac << 4 | place).to_bytes(8, "little"))
        said("ecu", offer)
        prover.hear(offer)
    for k in range(1, 40):
        for name in NAMES:
            sends(name, k)
    return "\n".join(lines) + "\n"


def drive():
    """The client of the examples against an ECU that uses nothing without a proof, as the ECU itself tells it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = "127.0.0.1:" + str(free.getsockname()[1])
    program = ["cargo", "xtask", "qemu", "lockstep", "--timeout", "600", "--can", f"tcp:{port},server,nowait"]
    with subprocess.Popen(program, cwd=ROOT, stderr=subprocess.PIPE, text=True) as qemu:
        if not any("lockstep on" in line for line in qemu.stderr):
            raise SystemExit("cargo xtask qemu lockstep ended")
        bus, own = cantools.database.load_file(client.DBC), cantools.database.load_file(client.AUTHENTICATION)
        clock = client.InLockStep(f"socket://{port}")
        with clock.bus:
            clock.bus.send(message(AUTHENTICATED, bytes([AES_CMAC] + 7 * [0])))
            run = client.Run(clock, bus, own.get_message_by_name("Authentication"), client.prepared(bus, None))
            run.synchronise()
            if run.prover is None or not run.prover.is_synchronised():
                raise SystemExit("the ECU asked for no proof")
            client.drive(run, SECONDS)


def main(arguments):
    if arguments == ["--table"]:
        TABLE.write_text(talk())
        return
    if arguments:
        raise SystemExit(f"{' '.join(arguments)}: there is --table alone")
    if TABLE.read_text() != talk():
        raise SystemExit(f"{TABLE} is not what this program makes: --table writes it")
    drive()


if __name__ == "__main__":
    main(sys.argv[1:])
