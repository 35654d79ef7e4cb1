"""Diagnosis as a workshop's own tools meet it: udsoncan over can-isotp over python-can's slcan, with an image in QEMU.

    python tests/tools/check_diagnosis.py target/release/host-sim     # the bus of `host-sim ecu run`
    python tests/tools/check_diagnosis.py IMAGE.elf                   # the product's serial port, on a computer with time for it
    python tests/tools/check_diagnosis.py --power IMAGE.elf           # the same; the machine is ended, and started again with its flash

A fault is injected, its code is read, found again after a reset, and cleared; a parameter is read, written behind security access, and
read back after the restart. With --power the code is found again after a loss of supply, cleared, and gone after another. The ECU does not
wait for this program, so what came too late is asked again, a few times.
"""

import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from pathlib import Path

import can
import cantools
import isotp
import udsoncan
from can.interfaces.slcan import slcanBus
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC
from udsoncan.client import Client
from udsoncan.connections import PythonIsoTpConnection
from udsoncan.exceptions import InvalidResponseException, NegativeResponseException
from udsoncan.exceptions import TimeoutException, UnexpectedResponseException

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples"))
from talk_to_the_ecu import DBC, Sender  # noqa: E402

KEY = bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c")  # RFC 4493, of images for the bench
OWN_IDENTIFIER, DEADLINE = 0x511100, 0x510800  # C1111, C1108
TORQUE_LIMIT = 0x1000  # and the parameter's place in the list, from the DBC file
SEQUENCE, COMMIT = 0x0201, 0x0200
PATIENCE = 60
SILENCE = 6  # seconds without a frame after which codes are in the flash: five, and one to write them
SPEED_MS = 20  # nearly the slowest that an ECU takes for one
PATIENT = {"tx_padding": 0xCC, "rx_consecutive_frame_timeout": 10_000, "rx_flowcontrol_timeout": 10_000}


class Codec(udsoncan.DidCodec):
    """A number, big-endian."""

    def __init__(self, layout):
        self.layout = layout

    def encode(self, value):
        return struct.pack(self.layout, value)

    def decode(self, payload):
        return struct.unpack(self.layout, payload)[0]

    def __len__(self):
        return struct.calcsize(self.layout)


class Bench:
    """The ECU of `host-sim ecu run`, on any port that is free."""

    def __init__(self, host_sim):
        arguments = [host_sim, "ecu", "run", "--listen", "127.0.0.1:0"]
        self.program = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        # "the ECU is on the bus at 127.0.0.1:40123; Ctrl-C ends it"
        line = self.program.stdout.readline()
        self.port = "socket://" + line.split(" at ")[1].split(";")[0]

    def end(self):
        self.program.terminate()
        self.program.wait()


class Machine:
    """The product in QEMU, its bus on a pseudo-terminal; its flash in a file, if there is one."""

    def __init__(self, elf, flash=None):
        machine = "mps2-an386,memory-backend=flash" if flash else "mps2-an386"
        kept = ["-object", f"memory-backend-file,id=flash,size=16M,mem-path={flash},share=on"] if flash else []
        arguments = "-display none -monitor none -serial pty -serial null -icount shift=5,align=on"
        program = ["qemu-system-arm", "-machine", machine, *kept, *arguments.split()]
        self.qemu = subprocess.Popen(
            [*program, "-semihosting-config", "enable=on,target=native", "-kernel", elf],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
        )
        line = self.qemu.stdout.readline()
        self.port = next(word for word in line.split() if word.startswith("/dev/"))

    def end(self):
        self.qemu.kill()
        self.qemu.wait()


class Slcan(slcanBus):
    """python-can's, which reads byte by byte: this one reads what is there, and leaves out what is no answer of the ECU's, a thousand
    frames in a second. Torque frames, one in a millisecond, are the ECU's clock; by it this bus sends the speeds of a vehicle
    that stands, while it is told to."""

    def __init__(self, port, sender):
        self.lines, self.sender, self.lock = deque(), sender, threading.Lock()
        self.is_standing, self.ms, self.sent_ms = False, 0, 0
        super().__init__(port, bitrate=500_000, sleep_after_open=0.2)

    def send(self, message, timeout=None):
        with self.lock:
            super().send(message, timeout)

    def _read(self, timeout):
        until = time.monotonic() + (timeout or 0)
        while not self.lines:
            self._buffer.extend(self.serialPortOrig.read(4096))
            *whole, rest = bytes(self._buffer).split(b"\r")
            self._buffer[:] = rest
            self.lines.extend(line.decode() + "\r" for line in whole if line.startswith(b"t738"))
            self.ms += sum(line.startswith(b"t0C0") for line in whole)
            if self.is_standing and self.ms - self.sent_ms >= SPEED_MS:
                self.sent_ms = self.ms
                self.send(self.sender.frame(Speed1=0, Speed2=0, YawRate=0, YawRateValid=0))
            if time.monotonic() >= until:
                break
        return self.lines.popleft() if self.lines else None

    def wait(self, seconds):
        """Of the ECU's."""
        end = self.ms + 1000 * seconds
        for _ in range(6000):
            if self.ms >= end:
                return
            time.sleep(0.01)
        raise SystemExit("the ECU is silent")


class Tester:
    """udsoncan's client, and the ECU behind it."""

    def __init__(self, bus, parameter):
        self.bus = bus
        address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=0x730, rxid=0x738)
        stack = isotp.CanStack(bus, address=address, params=PATIENT)
        config = dict(udsoncan.configs.default_client_config)
        config |= {
            "data_identifiers": {parameter: Codec(">f"), SEQUENCE: Codec(">I"), 0xF189: udsoncan.AsciiCodec(5)},
            "security_algo": lambda level, seed, params: proof(seed),
            "p2_timeout": 10,
            "request_timeout": 11,
            "use_server_timing": False,
        }
        self.client = Client(PythonIsoTpConnection(stack), config=config)
        self.client.open()

    def ask(self, what, *values):
        """Asks again where an answer did not come."""
        for _ in range(PATIENCE):
            try:
                return getattr(self.client, what)(*values)
            except TimeoutException:
                self.reopen()
            except (InvalidResponseException, UnexpectedResponseException):
                # The late answer to an earlier question.
                time.sleep(0.5)
                self.client.conn.empty_rxqueue()
        raise SystemExit(f"{what}: no answer in {PATIENCE} attempts")

    def refused(self, code, what, *values):
        try:
            self.ask(what, *values)
        except NegativeResponseException as answer:
            assert answer.response.code == code, f"{what}: {answer.response.code:#x}, not {code:#x}"
            return
        raise AssertionError(f"{what} was not refused")

    def unlock(self):
        for _ in range(PATIENCE):
            try:
                self.ask("change_session", 3)
                return self.ask("unlock_security_access", 1)
            except NegativeResponseException as answer:
                # The session was over, or the challenge, before an answer that came late.
                assert answer.response.code in (0x24, 0x7F), answer
        raise SystemExit("it was not unlocked")

    def reopen(self):
        """After a reset, which closes the channel."""
        time.sleep(0.5)
        self.bus.open()

    def status(self, code):
        """The status of a code; None where it is not stored."""
        found = self.ask("get_dtc_by_status_mask", 0xFF).service_data.dtcs
        return next((dtc.status for dtc in found if dtc.id == code), None)

    def value(self, did):
        return self.ask("read_data_by_identifier", did).service_data.values[did]


def proof(seed):
    mac = CMAC(AES(KEY))
    mac.update(bytes(seed))
    return mac.finalize()


def faults(tester, bus):
    """Somebody sends under the ECU's own identifier: a code, which a reset leaves alone and clearing does not."""
    tester.ask("change_session", 3)
    tester.ask("clear_dtc", 0xFFFFFF)
    assert tester.status(OWN_IDENTIFIER) is None
    bus.send(can.Message(arbitration_id=0x0D0, data=bytes(8), is_extended_id=False))
    status = tester.status(OWN_IDENTIFIER)
    assert status is not None and status.confirmed and status.test_failed_this_operation_cycle, status
    counted = tester.ask("get_dtc_extended_data_by_dtc_number", OWN_IDENTIFIER, 1, 1)
    assert counted.service_data.dtcs[0].extended_data[0].raw_data == b"\x01"
    print("C1111 is stored once")


def reset(tester, bus):
    """A reset, by its own service, and what it leaves."""
    tester.ask("change_session", 3)
    tester.refused(0x33, "ecu_reset", 1)
    stand(bus)
    for _ in range(PATIENCE):
        tester.unlock()
        try:
            tester.ask("ecu_reset", 1)
            break
        except NegativeResponseException as answer:
            # Our speeds were late.
            assert answer.response.code == 0x88, answer
            stand(bus)
    else:
        raise SystemExit("no reset")
    bus.is_standing = False
    tester.reopen()
    status = tester.status(OWN_IDENTIFIER)
    assert status is not None and status.confirmed and not status.test_failed_this_operation_cycle, status
    tester.ask("change_session", 3)
    tester.ask("clear_dtc", OWN_IDENTIFIER)
    assert tester.status(OWN_IDENTIFIER) is None
    print("C1111 is there after a reset, and gone once it was cleared")


def stand(bus):
    """A hundred speeds of zero in a row, and three of a new sender."""
    bus.is_standing = True
    bus.wait(0.11 * SPEED_MS)


def security(tester):
    """Who has not the key is refused; the attempt costs its challenge."""
    tester.ask("change_session", 3)
    tester.ask("request_seed", 1)
    tester.refused(0x35, "send_key", 2, bytes(16))
    tester.refused(0x24, "send_key", 2, bytes(16))


def parameter(tester, bus, did):
    """Read, written, and read back after the restart that it causes."""
    before, sequence = tester.value(did), tester.value(SEQUENCE)
    tester.ask("change_session", 3)
    tester.refused(0x33, "write_data_by_identifier", did, 3.0)
    # A set is taken ten seconds after a reset at the earliest.
    bus.wait(10)
    stand(bus)
    for _ in range(PATIENCE):
        tester.unlock()
        tester.refused(0x31, "write_data_by_identifier", did, 5.5)
        tester.ask("write_data_by_identifier", did, 3.0)
        try:
            tester.ask("start_routine", COMMIT)
        except NegativeResponseException as answer:
            # Our speeds were late.
            assert answer.response.code == 0x88, answer
            stand(bus)
            continue
        time.sleep(1)
        tester.reopen()
        if tester.value(SEQUENCE) != sequence:
            break
    bus.is_standing = False
    after = tester.value(did)
    assert (before, after, tester.value(SEQUENCE)) == (5.0, 3.0, sequence + 1), (before, after)
    print(f"torque_limit_nm was {before} N.m and is {after} N.m after the restart")


def power(elf):
    """What is left of a fault when the supply was lost, first with its code stored, then with it cleared."""
    with tempfile.TemporaryDirectory() as folder:
        for turn in ("stored", "found again", "gone"):
            machine = Machine(elf, Path(folder) / "flash")
            try:
                with Slcan(machine.port, None) as bus:
                    tester = Tester(bus, TORQUE_LIMIT)
                    if turn == "stored":
                        faults(tester, bus)
                    status = tester.status(OWN_IDENTIFIER)
                    assert (status is None) == (turn == "gone"), status
                    if turn == "found again":
                        assert status.confirmed and not status.test_failed_this_operation_cycle, status
                        tester.ask("change_session", 3)
                        tester.ask("clear_dtc", 0xFFFFFF)
                    bus.wait(SILENCE)
                    tester.client.close()
            finally:
                machine.end()
    print("C1111 is there after a loss of supply, and gone after another once it was cleared")


def main(program):
    database = cantools.database.load_file(DBC)
    names = database.get_message_by_name("ParameterValue").get_signal_by_name("ParameterValue_Index").choices
    did = TORQUE_LIMIT + next(code for code, name in names.items() if str(name).lower() == "torque_limit_nm")
    sender = Sender(database, "Vehicle")
    machine = Bench(program) if Path(program).name == "host-sim" else Machine(program)
    try:
        with Slcan(machine.port, sender) as bus:
            tester = Tester(bus, did)
            print(f"software {tester.value(0xF189)}")
            faults(tester, bus)
            security(tester)
            reset(tester, bus)
            parameter(tester, bus, did)
            assert tester.status(DEADLINE) is None, "a step was late"
            tester.client.close()
    finally:
        machine.end()


if __name__ == "__main__":
    power(sys.argv[2]) if sys.argv[1] == "--power" else main(sys.argv[1])
