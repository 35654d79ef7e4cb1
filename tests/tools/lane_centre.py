"""The centre of a lane of an OpenDRIVE file, evaluated a second time, by brute force and with other means.

Nothing here is shared with the reader under test: the reference line of clothoids is integrated in steps of a
centimetre, polynomials are walked along their parameter in tiny steps, offsets are summed and points are placed on
the superelevated cross section; headings, curvatures and lengths are differences of points. Standard library alone.

    python3 tests/tools/lane_centre.py FILE.xodr ROAD:LANE,LANE,... [ROAD:LANE,...]  < course.json

A road is given by its id and the lane of each of its sections in the direction of travel; a leading `-` before the
id means: against its s, as in `-2:1`. Reads the object that `host-sim course FILE --json` prints and ends with 1 if a
sample lies more than 1 cm from the centre evaluated here, its heading or bank is off by more than 1 mrad, or lengths
differ by more than 1 cm. Prints the largest deviations.
"""

import json
import math
import sys
import xml.etree.ElementTree as ElementTree

STEP = 0.01  # m along the reference line


def strip(node):
    """Names without namespaces."""
    for element in node.iter():
        if isinstance(element.tag, str):
            element.tag = element.tag.split("}")[-1]
    return node


def polynomial(records, key, at, origin=0.0):
    """The value at a place of the polynomial that starts last before it."""
    value = 0.0
    for record in records:
        start = origin + float(record.get(key))
        if start <= at + 1e-9:
            d = at - start
            a, b, c, e = (float(record.get(k)) for k in "abcd")
            value = a + b * d + c * d * d + e * d**3
    return value


def reference_line(road):
    """Points (s, x, y, heading) of the whole reference line, geometry by geometry."""
    points = []
    for geometry in road.find("planView").findall("geometry"):
        s0, x0, y0, hdg, length = (float(geometry.get(k)) for k in ("s", "x", "y", "hdg", "length"))
        if length < 1e-6:
            continue
        kind = [child for child in geometry if child.tag not in ("userData", "include", "dataQuality")][0]
        if kind.tag in ("line", "arc", "spiral"):
            start = end = 0.0
            if kind.tag == "arc":
                start = end = float(kind.get("curvature"))
            elif kind.tag == "spiral":
                start, end = float(kind.get("curvStart")), float(kind.get("curvEnd"))
            count = max(2, int(math.ceil(length / STEP)))
            h = length / count
            x, y = x0, y0
            points.append((s0, x, y, hdg))
            for i in range(count):
                # Midpoint rule with the exact heading.
                middle = (i + 0.5) * h
                heading = hdg + start * middle + 0.5 * (end - start) / length * middle**2
                x, y = x + h * math.cos(heading), y + h * math.sin(heading)
                s = (i + 1) * h
                points.append((s0 + s, x, y, hdg + start * s + 0.5 * (end - start) / length * s * s))
        else:
            points += cubic_line(kind, s0, x0, y0, hdg, length)
    return points


def cubic_line(kind, s0, x0, y0, hdg, length):
    """Walks along the parameter in small steps and sums chords; s is the share of the chord length."""
    if kind.tag == "poly3":
        u, v = [0.0, 1.0, 0.0, 0.0], [float(kind.get(k)) for k in "abcd"]
        end = None
    else:
        u = [float(kind.get(k + "U")) for k in "abcd"]
        v = [float(kind.get(k + "V")) for k in "abcd"]
        end = length if kind.get("pRange") == "arcLength" else 1.0

    def at(p):
        return (u[0] + p * (u[1] + p * (u[2] + p * u[3])), v[0] + p * (v[1] + p * (v[2] + p * v[3])))

    def direction(p):
        return math.atan2(v[1] + p * (2 * v[2] + 3 * p * v[3]), u[1] + p * (2 * u[2] + 3 * p * u[3]))

    count = max(1000, int(length / STEP))
    step = (end if end is not None else length) / count
    walked, last, total, i = [(0.0, at(0.0), direction(0.0))], at(0.0), 0.0, 0
    while i < count if end is not None else total < length:
        i += 1
        here = at(i * step)
        total += math.dist(last, here)
        walked.append((total, here, direction(i * step)))
        last = here
    scale = length / total if end is not None else 1.0
    c, s = math.cos(hdg), math.sin(hdg)
    turned = []
    for arc, (a, b), heading in walked:
        if arc * scale > length + 1e-9:
            break
        turned.append((s0 + arc * scale, x0 + a * c - b * s, y0 + a * s + b * c, hdg + heading))
    return turned


def sections_of(road, lane):
    side = "right" if lane < 0 else "left"
    sections = road.find("lanes").findall("laneSection")
    return [s for s in sections if s.get("singleSide") not in ("true", "1") or s.find(side) is not None]


def lane_points(road, lanes, against):
    """Points (x, y, bank) of the lane's centre in the direction of travel."""
    line = reference_line(road)
    total = line[-1][0]
    sections = sections_of(road, lanes[0])
    starts = [float(s.get("s")) for s in sections]
    ids = lanes[::-1] if against else lanes
    if len(ids) == 1:
        ids = ids * len(sections)
    offsets = road.find("lanes").findall("laneOffset")
    rolls = road.findall("lateralProfile/superelevation")
    points = []
    for s, x, y, heading in line:
        if s > total + 1e-9:
            continue
        number = max(i for i, start in enumerate(starts) if start <= s + 1e-9)
        section, lane = sections[number], ids[number]
        sign = 1 if lane > 0 else -1
        side = section.find("left" if lane > 0 else "right")
        of_id = {int(node.get("id")): node.findall("width") for node in side.findall("lane")}
        t = polynomial(offsets, "s", s)
        for n in range(1, abs(lane)):
            t += sign * polynomial(of_id[sign * n], "sOffset", s, starts[number])
        t += 0.5 * sign * polynomial(of_id[lane], "sOffset", s, starts[number])
        roll = polynomial(rolls, "s", s)
        plan = t * math.cos(roll)
        points.append((x - plan * math.sin(heading), y + plan * math.cos(heading), roll))
    if against:
        points = [(x, y, -roll) for x, y, roll in reversed(points)]
    return points


def main(path, *legs):
    root = strip(ElementTree.parse(path).getroot())
    roads = {road.get("id"): road for road in root.findall("road")}
    points = []
    for leg in legs:
        name, lanes = leg.rsplit(":", 1)
        against = name.startswith("-")
        points += lane_points(roads[name.lstrip("-")], [int(lane) for lane in lanes.split(",")], against)
    arc = [0.0]
    for a, b in zip(points, points[1:]):
        arc.append(arc[-1] + math.dist(a[:2], b[:2]))

    course = json.load(sys.stdin)
    worst = {"length": abs(course["length_m"] - arc[-1]), "place": 0.0, "beside": 0.0, "heading": 0.0, "bank": 0.0}
    i = 0
    for sample in course["samples"]:
        while i + 2 < len(points) and arc[i + 1] < sample["s_m"]:
            i += 1
        a, b = points[i], points[i + 1]
        share = (sample["s_m"] - arc[i]) / max(arc[i + 1] - arc[i], 1e-12)
        x, y, bank = (p + share * (q - p) for p, q in zip(a, b))
        dx, dy = sample["x_m"] - x, sample["y_m"] - y
        heading = math.atan2(b[1] - a[1], b[0] - a[0])
        turn = (sample["heading_rad"] - heading + math.pi) % (2 * math.pi) - math.pi
        worst["place"] = max(worst["place"], math.hypot(dx, dy))
        worst["beside"] = max(worst["beside"], abs(dy * math.cos(heading) - dx * math.sin(heading)))
        worst["heading"] = max(worst["heading"], abs(turn))
        worst["bank"] = max(worst["bank"], abs(sample["bank_rad"] - bank))
    print(json.dumps(worst))
    limits = {"length": 0.01, "place": 0.01, "beside": 0.01, "heading": 1e-3, "bank": 1e-3}
    return int(any(not worst[name] <= limit for name, limit in limits.items()))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
