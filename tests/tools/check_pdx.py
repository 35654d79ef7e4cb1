"""The PDX file of examples/diagnosis_pdx.py, opened by odxtools: every datum and every code, from bytes put together here.

    python tests/tools/check_pdx.py HOST_SIM
"""

import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import odxtools

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import diagnosis_pdx  # noqa: E402

# Of each format: bytes, and the value that they are.
VALUES = {
    "u8": (b"\x02", 2),
    "u32": (b"\x00\x0f\xff\xff", 0xFFFFF),
    "f32": (struct.pack(">f", -1.25), -1.25),
    "text": (b"0.2.0", "0.2.0"),
}


def main(host_sim):
    description = json.loads(subprocess.check_output([host_sim, "ecu", "diag", "describe", "--json"]))
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "haptic.pdx"
        diagnosis_pdx.write(description, file)
        ecu = odxtools.load_pdx_file(file).diag_layers.HapticGuidance
    names = {service.short_name for service in ecu.services}
    for datum in description["data"]:
        name, identifier = diagnosis_pdx.short(datum["name"]), struct.pack(">H", datum["id"])
        data, expected = VALUES[datum["format"]]
        question = ecu.services[f"read_{name}"].encode_request()
        assert question == b"\x22" + identifier, (name, question.hex())
        (answer,) = ecu.decode_response(b"\x62" + identifier + data, question)
        assert answer.param_dict["value"] == expected, (name, answer.param_dict)
        writes = f"write_{name}" in names
        assert writes == datum["writable"], name
        if writes:
            question = ecu.services[f"write_{name}"].encode_request(value=expected)
            assert question == b"\x2e" + identifier + data, (name, question.hex())
    lines = b"".join(struct.pack(">I", code["dtc"] << 8 | 0x2B) for code in description["codes"])
    (answer,) = ecu.decode_response(b"\x59\x02\x2b" + lines, b"\x19\x02\xff")
    told = [(line["code"].short_name, line["code"].display_trouble_code, line["status"]) for line in answer.param_dict["codes"]]
    assert told == [(code["fault"], code["code"], 0x2B) for code in description["codes"]], told
    print(f"{len(description['data'])} data and {len(told)} codes are in the PDX file as odxtools reads it")


if __name__ == "__main__":
    main(sys.argv[1])
