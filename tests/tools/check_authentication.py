"""Authentication by another program: its MACs are those of the PyPI package `cryptography`, its frames those of examples/authentication.py.

    python tests/tools/check_authentication.py HOST_SIM   # compare core/secoc/tests/frames.csv, and drive the ECU of HOST_SIM
    python tests/tools/check_authentication.py --table    # write that file

The file is a talk between an ECU at its start 3 and its senders: who speaks, identifier, bytes; `core/secoc/tests/frames.rs` has the
Rust sides hold it. The ECU does not wait for this program, so a drive in which it came too late is tried again.
"""

import subprocess
import sys
from pathlib import Path

import cantools

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples"))
from authentication import CAMERA_KEY, DBC, HOST_KEY, OFFER, Prover, message, tag  # noqa: E402
from talk_to_the_ecu import DBC as BUS, protected_crc  # noqa: E402

TABLE = ROOT / "core/secoc/tests/frames.csv"
EPOCH = 3 * 4096
NAMES = ["LanePreview", "Vehicle", "Request", "ParameterWrite", "ParameterUnlock"]
ATTEMPTS = 5


def talk():
    bus, own = cantools.database.load_file(BUS), cantools.database.load_file(DBC)
    numbers = iter(range(0x01020304, 0x7FFFFFFF, 0x11111111))
    prover = Prover(lambda data: protected_crc(bus.get_message_by_name("Request"), data), number=lambda: next(numbers))
    lines = []

    def said(who, frame):
        lines.append(f"{who},{frame.arbitration_id:03X},{bytes(frame.data).hex().upper()}")

    def sends(name, k):
        data = bytearray((17 * k + 29 * at) % 256 for at in range(8))
        data[0] = protected_crc(bus.get_message_by_name(name), bytes(data))
        frame = message(bus.get_message_by_name(name).frame_id, data)
        said("sender", frame)
        for proven in prover.prove(frame):
            said("bus", proven)

    for name in NAMES:
        sends(name, 0)
    status = own.get_message_by_name("Authentication")
    values = {signal.name: 0 for signal in status.signals} | {f"Authentication_Waiting_{name}": 1 for name in NAMES}
    data = bytearray(status.encode(values | {"Authentication_State": 4}, strict=False))
    data[0] = protected_crc(status, bytes(data))
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


def drive(host_sim):
    """The client of the examples against an ECU that uses nothing without a proof, as the ECU itself tells it."""
    for _ in range(ATTEMPTS):
        arguments = [host_sim, "ecu", "run", "--listen", "127.0.0.1:0", "--authenticate", "aes-cmac"]
        ecu = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        try:
            port = "socket://" + ecu.stdout.readline().split(" at ")[1].split(";")[0]
            client = [sys.executable, ROOT / "examples/talk_to_the_ecu.py", port, "--seconds", "3"]
            done = subprocess.run(client, capture_output=True, text=True, check=False)
        finally:
            ecu.terminate()
            ecu.wait()
        print(done.stdout, done.stderr, sep="", end="")
        if done.returncode == 0:
            return
    raise SystemExit(f"no drive in {ATTEMPTS} attempts")


def main(argument):
    if argument == "--table":
        TABLE.write_text(talk())
        return
    if TABLE.read_text() != talk():
        raise SystemExit(f"{TABLE} is not what this program makes: --table writes it")
    drive(argument)


if __name__ == "__main__":
    main(sys.argv[1])
