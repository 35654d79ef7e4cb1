"""Proofs for the frames of camera and host, by AES-CMAC (docs/reference/bus.md, Authentication).

`Prover.prove` gives what to send in place of a frame; `Prover.hear` takes what the ECU says, and gives the questions to send.
core/secoc/authentication.dbc describes the messages. Needs the package `cryptography`.
"""

import pathlib
import secrets
import tomllib

import can
import cantools
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC

DBC = pathlib.Path(__file__).parent.parent / "core" / "secoc" / "authentication.dbc"
FRAME, OFFER = 1, 2  # what a MAC is for
# Keys that everybody knows, of `host-sim ecu run --authenticate`: the example of RFC 4493, and its bytes from the last to the first.
HOST_KEY = bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c")
CAMERA_KEY = HOST_KEY[::-1]


def tag(key, purpose, identifier, epoch, number, payload=b""):
    """The first 28 bits of the MAC."""
    mac = CMAC(AES(key))
    numbers = ((purpose, 1), (identifier, 2), (epoch, 4), (number, 4))
    mac.update(b"".join(value.to_bytes(size, "big") for value, size in numbers) + payload)
    return int.from_bytes(mac.finalize()[:4], "big") >> 4


def keys_of(path):
    """Camera's and host's keys of a keys.toml."""
    with open(path, "rb") as file:
        kept = tomllib.load(file)
    if kept["mac"] != "aes-cmac":
        raise SystemExit(f"{path}: mac = {kept['mac']!r}; this program has AES-CMAC alone")
    return {name: bytes.fromhex(kept[name]) for name in ("camera", "host")}


def message(identifier, data):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False)


class Sender:
    """What is kept of one message: its epoch, and how many frames were sent in it."""

    def __init__(self, identifier, key):
        self.identifier, self.key = identifier, key
        self.epoch, self.count, self.question, self.is_in_use = None, 0, None, False

    def proof(self, payload):
        self.count += 1
        mac = tag(self.key, FRAME, self.identifier, self.epoch, self.count, payload)
        return (mac << 4 | self.count % 16).to_bytes(4, "little")

    def take(self, epoch, mac):
        """An offer counts if it answers the last question."""
        if self.question is None or mac != tag(self.key, OFFER, self.identifier, epoch, self.question):
            return
        if self.epoch != epoch:
            self.epoch, self.count = epoch, 0
        self.question = None


class Prover:
    """The proofs of all messages; `crc` protects a frame's bytes anew, as core/haptic.dbc says."""

    def __init__(self, crc, camera=CAMERA_KEY, host=HOST_KEY, number=lambda: secrets.randbits(32)):
        self.database, self.crc, self.number = cantools.database.load_file(DBC), crc, number
        self.names = self.database.get_message_by_name("Offer").get_signal_by_name("Offer_Message").choices
        self.questions = {name: self.database.get_message_by_name(f"{name}Question") for name in map(str, self.names.values())}
        self.senders, self.used = {}, set()
        for name, question in self.questions.items():
            identifier = question.frame_id - 0x400
            self.senders[identifier] = Sender(identifier, camera if name == "LanePreview" else host)

    def is_synchronised(self):
        """Whether some message was sent, and each that was has an epoch."""
        used = [self.senders[identifier] for identifier in self.used]
        return bool(used) and all(sender.epoch is not None for sender in used)

    def prove(self, frame):
        """What to send in place of a frame."""
        sender = self.senders.get(frame.arbitration_id)
        if sender is None:
            return [frame]
        sender.is_in_use = True
        self.used.add(frame.arbitration_id)
        if sender.epoch is None:
            return [frame]
        data = bytearray(frame.data)
        if frame.arbitration_id == self.database.get_message_by_name("Request").frame_id:
            data[4:8] = sender.proof(bytes(data[1:4]))
            data[0] = self.crc(bytes(data))
            return [message(frame.arbitration_id, data)]
        return [frame, message(frame.arbitration_id + 1, sender.proof(bytes(data[1:8])))]

    def hear(self, frame):
        """Takes a frame of the ECU's; the questions to send."""
        asked = []
        if frame.arbitration_id == self.database.get_message_by_name("Authentication").frame_id:
            values = self.database.decode_message("Authentication", frame.data)
            for name, question in self.questions.items():
                sender = self.senders[question.frame_id - 0x400]
                if values[f"Authentication_Waiting_{name}"] and sender.is_in_use:
                    sender.question = self.number()
                    asked.append(message(question.frame_id, sender.question.to_bytes(4, "little")))
                sender.is_in_use = False
        elif frame.arbitration_id == self.database.get_message_by_name("Offer").frame_id:
            values = self.database.decode_message("Offer", frame.data)
            question = self.questions.get(str(values["Offer_Message"]))
            if question:
                self.senders[question.frame_id - 0x400].take(values["Offer_Epoch"], values["Offer_Tag"])
        return asked
