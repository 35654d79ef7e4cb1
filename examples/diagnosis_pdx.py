"""Writes the ECU's diagnosis as ODX (ISO 22901-1) in a PDX file, from what `host-sim ecu diag describe --json` prints.

    host-sim ecu diag describe --json | python examples/diagnosis_pdx.py haptic.pdx

In it: a service that reads each datum, one that writes each that can be written, one that reads the stored trouble codes, and the
codes by their names. Not in it: sessions, security access and routines, which docs/reference/diagnosis.md describes.
"""

import json
import sys
import zipfile
from xml.sax.saxutils import escape, quoteattr

NAME = "HapticGuidance"
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
ODX = '<ODX MODEL-VERSION="2.2.0" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">'
# Of each format: base type on the bus, bits, type for people.
TYPES = {
    "u8": ("A_UINT32", 8, "A_UINT32"),
    "u32": ("A_UINT32", 32, "A_UINT32"),
    "f32": ("A_FLOAT32", 32, "A_FLOAT32"),
}
IDENTICAL = "<COMPU-METHOD><CATEGORY>IDENTICAL</CATEGORY></COMPU-METHOD>"


def short(name):
    """A short name, of letters, digits and underscores."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)


def named(tag, identifier, name, text, inside=""):
    description = f"<DESC><p>{escape(text)}</p></DESC>" if text else ""
    return f"<{tag} ID={quoteattr(identifier)}><SHORT-NAME>{name}</SHORT-NAME>{description}{inside}</{tag}>"


def constant(name, at, value, bits=8):
    return (
        f'<PARAM xsi:type="CODED-CONST"><SHORT-NAME>{name}</SHORT-NAME><BYTE-POSITION>{at}</BYTE-POSITION>'
        f"<CODED-VALUE>{value}</CODED-VALUE>"
        f'<DIAG-CODED-TYPE BASE-DATA-TYPE="A_UINT32" xsi:type="STANDARD-LENGTH-TYPE"><BIT-LENGTH>{bits}</BIT-LENGTH>'
        "</DIAG-CODED-TYPE></PARAM>"
    )


def value(name, at, dop):
    return (
        f'<PARAM xsi:type="VALUE"><SHORT-NAME>{name}</SHORT-NAME><BYTE-POSITION>{at}</BYTE-POSITION>'
        f"<DOP-REF ID-REF={quoteattr(dop)}/></PARAM>"
    )


def dop(format, unit):
    """A data object property of a format and a unit."""
    name = short(f"{format}_{unit}")
    if format == "text":
        coded = (
            '<DIAG-CODED-TYPE BASE-DATA-TYPE="A_ASCIISTRING" TERMINATION="END-OF-PDU" xsi:type="MIN-MAX-LENGTH-TYPE">'
            "<MIN-LENGTH>0</MIN-LENGTH></DIAG-CODED-TYPE>"
        )
        physical = "A_UNICODE2STRING"
    else:
        base, bits, physical = TYPES[format]
        coded = (
            f'<DIAG-CODED-TYPE BASE-DATA-TYPE="{base}" xsi:type="STANDARD-LENGTH-TYPE"><BIT-LENGTH>{bits}</BIT-LENGTH>'
            "</DIAG-CODED-TYPE>"
        )
    kind = f'<PHYSICAL-TYPE BASE-DATA-TYPE="{physical}"/>'
    reference = "" if unit == "1" else f"<UNIT-REF ID-REF={quoteattr('unit.' + short(unit))}/>"
    return named("DATA-OBJECT-PROP", f"dop.{name}", name, "", IDENTICAL + coded + kind + reference)


def service(name, text, request, response):
    """A service, its request and its positive answer, as three elements."""
    comm = (
        f"<REQUEST-REF ID-REF={quoteattr('rq.' + name)}/>"
        f"<POS-RESPONSE-REFS><POS-RESPONSE-REF ID-REF={quoteattr('pr.' + name)}/></POS-RESPONSE-REFS>"
    )
    parts = [("DIAG-SERVICE", "ds", name, comm)]
    parts += [("REQUEST", "rq", f"{name}_request", request), ("POS-RESPONSE", "pr", f"{name}_response", response)]
    return [
        named(tag, f"{head}.{name}", title, text if head == "ds" else "", inside if head == "ds" else f"<PARAMS>{inside}</PARAMS>")
        for tag, head, title, inside in parts
    ]


def services(description):
    for datum in description["data"]:
        name, kind = short(datum["name"]), "dop." + short(f"{datum['format']}_{datum['unit']}")
        head = lambda sid: constant("sid", 0, sid) + constant("did", 1, datum["id"], 16)  # noqa: E731
        yield service(f"read_{name}", datum["meaning"], head(0x22), head(0x62) + value("value", 3, kind))
        if datum["writable"]:
            yield service(f"write_{name}", datum["meaning"], head(0x2E) + value("value", 3, kind), head(0x6E))
    ask = constant("sid", 0, 0x19) + constant("function", 1, 2) + value("mask", 2, "dop.u8_1")
    says = constant("sid", 0, 0x59) + constant("function", 1, 2) + value("available", 2, "dop.u8_1")
    says += (
        '<PARAM xsi:type="VALUE"><SHORT-NAME>codes</SHORT-NAME><BYTE-POSITION>3</BYTE-POSITION>'
        '<DOP-REF ID-REF="eopdu.codes"/></PARAM>'
    )
    yield service("read_codes", "The stored trouble codes, each with its status", ask, says)


def codes(description):
    """The codes, and a list of them to the end of an answer."""
    lines = "".join(
        named(
            "DTC",
            f"dtc.{code['code']}",
            short(code["fault"]),
            "",
            f"<TROUBLE-CODE>{code['dtc']}</TROUBLE-CODE><DISPLAY-TROUBLE-CODE>{code['code']}</DISPLAY-TROUBLE-CODE>"
            f"<TEXT>{escape(code['fault'])}</TEXT>",
        )
        for code in description["codes"]
    )
    coded = (
        '<DIAG-CODED-TYPE BASE-DATA-TYPE="A_UINT32" xsi:type="STANDARD-LENGTH-TYPE"><BIT-LENGTH>24</BIT-LENGTH>'
        '</DIAG-CODED-TYPE><PHYSICAL-TYPE BASE-DATA-TYPE="A_UINT32"/>'
    )
    dtcs = named("DTC-DOP", "dop.code", "code", "", f"{coded}{IDENTICAL}<DTCS>{lines}</DTCS>")
    inside = value("code", 0, "dop.code") + value("status", 3, "dop.u8_1")
    line = named("STRUCTURE", "struct.code", "code_and_status", "", f"<PARAMS>{inside}</PARAMS>")
    to_the_end = '<BASIC-STRUCTURE-REF ID-REF="struct.code"/>'
    return dtcs, line, named("END-OF-PDU-FIELD", "eopdu.codes", "codes", "", to_the_end)


def odx(description):
    dtcs, line, to_the_end = codes(description)
    kinds = sorted({(datum["format"], datum["unit"]) for datum in description["data"]})
    units = sorted({unit for _, unit in kinds if unit != "1"})
    unit = lambda name: named("UNIT", f"unit.{short(name)}", short(name), "", f"<DISPLAY-NAME>{escape(name)}</DISPLAY-NAME>")  # noqa: E731
    comms, requests, responses = zip(*services(description))
    dictionary = (
        f"<DTC-DOPS>{dtcs}</DTC-DOPS><DATA-OBJECT-PROPS>{''.join(dop(*kind) for kind in kinds)}</DATA-OBJECT-PROPS>"
        f"<STRUCTURES>{line}</STRUCTURES><END-OF-PDU-FIELDS>{to_the_end}</END-OF-PDU-FIELDS>"
        f"<UNIT-SPEC><UNITS>{''.join(map(unit, units))}</UNITS></UNIT-SPEC>"
    )
    variant = named(
        "BASE-VARIANT",
        f"bv.{NAME}",
        NAME,
        "",
        f"<DIAG-DATA-DICTIONARY-SPEC>{dictionary}</DIAG-DATA-DICTIONARY-SPEC><DIAG-COMMS>{''.join(comms)}</DIAG-COMMS>"
        f"<REQUESTS>{''.join(requests)}</REQUESTS><POS-RESPONSES>{''.join(responses)}</POS-RESPONSES>",
    )
    container = named("DIAG-LAYER-CONTAINER", f"dlc.{NAME}", NAME, "", f"<BASE-VARIANTS>{variant}</BASE-VARIANTS>")
    return f"{HEAD}{ODX}{container}</ODX>\n"


def write(description, path):
    """The PDX file: the description, and an index of what the file holds."""
    file = f"{NAME}.odx-d"
    index = (
        f'{HEAD}<CATALOG F-DTD-VERSION="ODX-2.2.0" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">'
        f"<SHORT-NAME>{NAME}</SHORT-NAME><ABLOCKS><ABLOCK UPD=\"UNCHANGED\"><SHORT-NAME>{NAME}</SHORT-NAME>"
        f"<CATEGORY>ODX-DATA</CATEGORY><FILES><FILE MIME-TYPE=\"application/x-asam.odx.odx-d\">{file}</FILE></FILES>"
        "</ABLOCK></ABLOCKS></CATALOG>\n"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as pdx:
        pdx.writestr(file, odx(description))
        pdx.writestr("index.xml", index)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    write(json.load(sys.stdin), sys.argv[1])
