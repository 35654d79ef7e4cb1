"""Engages the steering ECU, drives, lets an input fail and watches the handover. docs/talk-to-the-ecu.md explains it.

    python examples/talk_to_the_ecu.py socket://127.0.0.1:3333            # on the clock of the wall
    python examples/talk_to_the_ecu.py socket://127.0.0.1:3333 --lockstep # on the ECU's own time

Exit codes: 0 the ECU did what it should, 1 it did not, 2 bad usage.
"""

import argparse
import math
import pathlib
import sys
import time

import can
import cantools

from lockstep_client import LockStep

DBC = pathlib.Path(__file__).parent.parent / "core" / "haptic.dbc"
AUTHENTICATION = pathlib.Path(__file__).parent.parent / "core" / "secoc" / "authentication.dbc"
SPEED = 20.0  # m/s
PERIOD_MS = {"LanePreview": 8, "Column": 2, "Vehicle": 10, "Request": 10}


def crc8(data):
    """CRC-8, polynomial 0x2F, init and xorout 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x2F if crc & 0x80 else crc << 1
            crc &= 0xFF
    return crc ^ 0xFF


def protected_crc(message, data):
    """The CRC that a frame must have: over bytes 1 to 7, then the data ID that its counter picks."""
    data_ids = bytes.fromhex(message.dbc.attributes["E2EDataIds"].value)
    return crc8(data[1:] + data_ids[data[1] & 0x0F : (data[1] & 0x0F) + 1])


class Sender:
    """Sends one message, counted and protected."""

    def __init__(self, database, name):
        self.message = database.get_message_by_name(name)
        self.counter = 0

    def frame(self, **signals):
        name = self.message.name
        values = {f"{name}_{signal}": value for signal, value in signals.items()}
        values |= {f"{name}_Crc": 0, f"{name}_Counter": self.counter}
        self.counter = (self.counter + 1) % 16
        data = bytearray(self.message.encode(values))
        data[0] = protected_crc(self.message, bytes(data))
        return can.Message(arbitration_id=self.message.frame_id, data=data, is_extended_id=False)


class Vehicle:
    """Everybody else on the bus: camera, column, speeds and host of a car on a straight road."""

    def __init__(self, database):
        self.senders = {name: Sender(database, name) for name in PERIOD_MS}
        self.engage = False
        self.camera_works = True
        self.torque = 0.0

    def frames(self, ms):
        """What is due in this millisecond."""
        for name, period in PERIOD_MS.items():
            if ms % period == 0 and not (name == "LanePreview" and not self.camera_works):
                yield self.senders[name].frame(**self.signals(name, ms / 1000))

    def signals(self, name, t):
        if name == "LanePreview":
            # The car weaves by 0.2 m within its lane. Its error moves by speed times yaw error: the ECU checks that.
            omega = 2 * math.pi / 10
            error, rate = 0.2 * math.sin(omega * t), 0.2 * omega * math.cos(omega * t)
            return {"LateralError": error, "YawError": rate / SPEED, "Age": 0, "AgeMore": 0, "Valid": 1}
        if name == "Column":
            # The driver holds the wheel straight against the guidance, and the motor delivers what it is told.
            return {"DriverTorque": -self.torque, "WheelAngle": 0, "MotorTorque": self.torque}
        if name == "Vehicle":
            return {"Speed1": SPEED, "Speed2": SPEED, "YawRate": 0, "YawRateValid": 1}
        return {"Engage": int(self.engage), "Authority": 1, "Probe": 0}


class Ecu:
    """What the ECU says, checked."""

    def __init__(self, database):
        self.guidance = database.get_message_by_name("Guidance")
        self.mode, self.torque, self.warning, self.faults = None, 0.0, False, []

    def hear(self, frame):
        """Takes a frame; True if it was a torque frame."""
        if frame.arbitration_id != self.guidance.frame_id:
            return False
        data = bytes(frame.data)
        if len(data) != 8 or data[0] != protected_crc(self.guidance, data):
            raise ValueError(f"a damaged torque frame: {frame}")
        values = self.guidance.decode(data)
        self.mode = str(values["Guidance_Mode"])
        self.torque = values["Guidance_Torque"]
        self.warning = str(values["Guidance_Warning"]) == "Yes"
        prefix = "Guidance_Fault_"
        self.faults = [name.removeprefix(prefix) for name in values if name.startswith(prefix) and values[name] == "Yes"]
        return True


class OnTheWall:
    """A millisecond is a millisecond of this computer's clock."""

    def __init__(self, channel):
        self.bus = can.Bus(interface="slcan", channel=channel, bitrate=500_000)
        self.start = time.monotonic()

    def tick(self, ms, frames):
        for frame in frames:
            self.bus.send(frame)
        heard = []
        while (left := self.start + (ms + 1) / 1000 - time.monotonic()) > 0:
            if (frame := self.bus.recv(timeout=left)) is not None:
                heard.append(frame)
        # When we are late, what came meanwhile.
        while (frame := self.bus.recv(timeout=0)) is not None:
            heard.append(frame)
        return heard

    def late_ms(self, ms):
        return 1000 * (time.monotonic() - self.start) - ms


class InLockStep(LockStep):
    """A millisecond is a tick of the ECU."""

    def tick(self, ms, frames):
        return super().tick(1000 * ms, frames)

    def late_ms(self, ms):
        return 0.0


class Run:
    def __init__(self, clock, database, status, proofs):
        self.clock, self.vehicle, self.ecu, self.ms = clock, Vehicle(database), Ecu(database), 0
        self.latest, self.reported = 0.0, None
        self.status, self.proofs, self.prover, self.questions = status, proofs, None, []

    def step(self):
        """One millisecond."""
        frames, self.questions = self.questions, []
        for frame in self.vehicle.frames(self.ms):
            frames += self.prover.prove(frame) if self.prover else [frame]
        for frame in self.clock.tick(self.ms, frames):
            if self.ecu.hear(frame):
                self.vehicle.torque = self.ecu.torque
                continue
            if self.prover is None and frame.arbitration_id == self.status.frame_id:
                self.authenticate(str(self.status.decode(bytes(frame.data))["Authentication_State"]))
            if self.prover:
                self.questions += self.prover.hear(frame)
        self.ms += 1
        self.latest = max(self.latest, self.clock.late_ms(self.ms))
        if self.ecu.mode != self.reported or self.ms % 5000 == 0:
            self.reported = self.ecu.mode
            faults = f", {', '.join(self.ecu.faults)}" if self.ecu.faults else ""
            print(f"{self.ms / 1000:7.3f} s  {self.ecu.mode}  {self.ecu.torque:+.3f} N.m{faults}", flush=True)

    def authenticate(self, state):
        """Proves the frames from here on, if the ECU has keys."""
        if state == "AesCmac" and self.proofs:
            self.prover = self.proofs
        elif state == "AesCmac":
            self.fail("the ECU has keys, and the package cryptography is missing")
        elif state != "Bench":
            self.fail(f"the ECU says {state}: without keys it never engages, and this program proves by AES-CMAC alone")

    def synchronise(self):
        """Until the ECU can verify what is sent: every 100 ms it says how, if it has something to verify with."""
        for _ in range(150):
            self.step()
        while self.prover and not self.prover.is_synchronised():
            self.step()
            if self.ms == 5000:
                self.fail("no epoch within 5 s")

    def until(self, mode, seconds):
        for _ in range(round(1000 * seconds)):
            self.step()
            if self.ecu.mode == mode:
                return
        self.fail(f"not {mode} within {seconds} s")

    def hold(self, mode, seconds):
        for _ in range(round(1000 * seconds)):
            self.step()
            if self.ecu.mode != mode:
                self.fail(f"no longer {mode}")

    def fail(self, what):
        late = f"; this program was up to {self.latest:.0f} ms late" if self.latest > 5 else ""
        sys.exit(f"{what}: the ECU is in {self.ecu.mode} with {self.ecu.faults or 'no fault'}{late}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("channel", help="of python-can's slcan interface: socket://127.0.0.1:3333 or /dev/ttyUSB0")
    parser.add_argument("--lockstep", action="store_true", help="the image is lockstep: time is the ECU's own")
    parser.add_argument("--seconds", type=float, default=60, help="how long to stay engaged (default: 60)")
    parser.add_argument("--dbc", default=DBC, help="the description of the bus (default: core/haptic.dbc)")
    parser.add_argument("--keys", type=pathlib.Path, help="keys.toml of `cargo xtask keys`, for an ECU with keys (default: those of the bench)")
    arguments = parser.parse_args()

    database = cantools.database.load_file(arguments.dbc)
    status = cantools.database.load_file(AUTHENTICATION).get_message_by_name("Authentication")
    proofs = prepared(database, arguments.keys)
    clock = (InLockStep if arguments.lockstep else OnTheWall)(arguments.channel)
    with clock.bus:
        run = Run(clock, database, status, proofs)
        run.synchronise()
        drive(run, arguments.seconds)


def prepared(database, keys):
    """Proofs for an ECU with keys; None without the package that makes them."""
    try:
        from authentication import Prover, keys_of
    except ImportError:
        return None
    request = database.get_message_by_name("Request")
    return Prover(lambda data: protected_crc(request, data), **(keys_of(keys) if keys else {}))


def drive(run, seconds):
    # Valid inputs first: the ECU wants 500 ms of them, and then a request that rises.
    run.until("Standby", 5)
    run.hold("Standby", 0.7)
    run.vehicle.engage = True
    run.until("Active", 1)
    run.hold("Active", seconds)

    # The camera fails: for a second the ECU goes on without it, then it hands over, warns, and takes another to bring the torque
    # to zero.
    run.vehicle.camera_works = False
    run.until("Handover", 1.2)
    if not run.ecu.warning or "LaneTimeout" not in run.ecu.faults:
        run.fail("no warning, or not for the camera")
    before = run.ecu.torque
    for _ in range(900):
        run.step()
        if run.ecu.mode != "Handover" or abs(run.ecu.torque) > abs(before):
            run.fail("the handover was cut short, or grew")
        before = run.ecu.torque
    run.until("Standby", 0.3)
    if run.ecu.torque != 0:
        run.fail("torque in Standby")
    print(f"Active for {seconds:g} s, a handover, and back to Standby")


if __name__ == "__main__":
    main()
