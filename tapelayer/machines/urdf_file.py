"""URDF file: the joints of a file, judged before Pinocchio sees them, and the bare chain for Pinocchio to build.

Pinocchio's own reader reports faults to the standard error alone, takes mimic joints in one order only, and keeps the
bytes of names in whatever encoding the file has. So it gets a chain that has no faults left, in Unicode.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from tapelayer.errors import InputFault, InputRefused, ModelRefused

_MOVING = ("revolute", "continuous", "prismatic")
# The XML reader knows four encodings; Python knows those of other countries, too.
_DECLARED = re.compile(rb"""^(?:\xef\xbb\xbf)?<\?xml[^>]*?\bencoding\s*=\s*["']([A-Za-z][A-Za-z0-9._-]*)["']""")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_XACRO = "http://www.ros.org/wiki/xacro"
_UNEXPANDED = re.compile(r"\$[{(]")
# How many numbers an attribute of an element holds.
_COUNTS = {
    ("axis", "xyz"): 3,
    ("box", "size"): 3,
    ("color", "rgba"): 4,
    ("cylinder", "length"): 1,
    ("cylinder", "radius"): 1,
    ("dynamics", "damping"): 1,
    ("dynamics", "friction"): 1,
    ("limit", "acceleration"): 1,
    ("limit", "effort"): 1,
    ("limit", "jerk"): 1,
    ("limit", "lower"): 1,
    ("limit", "upper"): 1,
    ("limit", "velocity"): 1,
    ("mass", "value"): 1,
    ("mesh", "scale"): 3,
    ("mimic", "multiplier"): 1,
    ("mimic", "offset"): 1,
    ("origin", "rpy"): 3,
    ("origin", "xyz"): 3,
    ("sphere", "radius"): 1,
    **{("inertia", moment): 1 for moment in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
}


# The sizes of the solids that a <collision> may be.
SOLIDS = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}

Faults = Iterator[tuple[ElementTree.Element, str]]


@dataclass(frozen=True)
class Joint:
    """One moving joint of a file.

    Attributes:
        name: joint name.
        kind: revolute, continuous or prismatic.
        lower: lower end of travel, metres or radians; -inf for a continuous joint, 0 where the file has none.
        upper: upper end of travel, likewise.
        speed: greatest speed, m/s or rad/s; 0 where the file has none.
        acceleration: greatest acceleration, m/s2 or rad/s2 (an attribute of URDF 1.2); inf where the file has none.
        jerk: greatest jerk, m/s3 or rad/s3; likewise.
        mimics: name of the driven joint that it follows, through any others; empty for a driven joint.
        multiplier: its value is multiplier * value + offset of that joint; 1 for a driven joint.
        offset: metres or radians; 0 for a driven joint.
    """

    name: str
    kind: str
    lower: float
    upper: float
    speed: float
    acceleration: float
    jerk: float
    mimics: str = ""
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Collision:
    """One rigid shape of a link.

    Attributes:
        link: name of the link.
        name: its own name; empty where the file gives none.
        kind: box, cylinder (along its z) or sphere.
        sizes: metres: the edges along x, y, z of a box, radius and length of a cylinder, radius of a sphere.
        xyz: its middle in the link, metres.
        rpy: its turns about the link's fixed axes x, y, z, radians.
    """

    link: str
    name: str
    kind: str
    sizes: tuple[float, ...]
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]


def read_urdf(path: Path) -> tuple[tuple[Joint, ...], str]:
    """Return the moving joints of a URDF in the file's order, and its links and joints alone as XML for Pinocchio.

    Raises:
        ModelRefused: the file cannot be read, is no URDF, or has faults; all faults at once, with their lines.
    """
    root, _ = _whole(path)
    moving = {element.attrib["name"]: element for element in root.findall("joint") if element.get("type") != "fixed"}
    joints = tuple(_joint(name, moving) for name in moving)
    if not any(not joint.mimics for joint in joints):
        raise ModelRefused(f"{path}: no joint moves")
    return joints, _chain(root)


def read_collisions(path: Path) -> tuple[Collision, ...]:
    """Return the rigid shapes of a URDF's links, in the file's order.

    Raises:
        ModelRefused: as `read_urdf`, or a link is drawn and has no <collision>, or one is no solid of a known size.
    """
    root, lines = _whole(path)
    if found := [InputFault(lines.get(element, 0), sentence) for element, sentence in _solids(root)]:
        raise ModelRefused(str(InputRefused(str(path), sorted(found, key=lambda fault: fault.line))))
    shapes = []
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            origin, solid = collision.find("origin"), next(iter(collision.iterfind("geometry/*")))
            place = {} if origin is None else origin.attrib
            xyz, rpy = (tuple(map(float, place.get(key, "0 0 0").split())) for key in ("xyz", "rpy"))
            sizes = tuple(float(size) for key in SOLIDS[solid.tag] for size in solid.attrib[key].split())
            shapes.append(Collision(link.attrib["name"], collision.get("name", ""), solid.tag, sizes, xyz, rpy))
    return tuple(shapes)


def _whole(path: Path) -> tuple[ElementTree.Element, dict[ElementTree.Element, int]]:
    """Return the root element of a URDF without faults, and the line of each element.

    Raises:
        ModelRefused: as `read_urdf`.
    """
    try:
        root, lines = _parsed(xml_text(path.read_bytes()))
    except OSError as error:
        raise ModelRefused(f"{path}: cannot be read as a URDF: {error.strerror}") from error
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise ModelRefused(f"{path}: not a URDF: {error}") from error
    if root.tag != "robot" or "name" not in root.attrib:
        raise ModelRefused(f"{path}: not a URDF: the root element is <{root.tag}>, expected <robot name=...>")
    for faults in (_xacro(path, root), _numbers(root), _elements(root), _ends(root), _tree(root), _mimics(root)):
        # Each of these relies on the one before.
        if found := [InputFault(lines.get(element, 0), sentence) for element, sentence in faults]:
            raise ModelRefused(str(InputRefused(str(path), sorted(found, key=lambda fault: fault.line))))
    return root, lines


def xml_text(data: bytes) -> bytes | str:
    r"""Return XML as text by the encoding that it declares; as it is where it declares none.

    Raises:
        ValueError: the bytes are not in that encoding.
        LookupError: there is no such encoding.

    Examples:
        >>> xml_text('<?xml version="1.0" encoding="GB2312"?><robot name="铺带机"/>'.encode("gb2312"))[-7:]
        '"铺带机"/>'
    """
    declared = _DECLARED.match(data)
    if declared is None:
        return data
    encoding = declared[1].decode("ascii")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        sentence = (
            f"byte {error.start + 1} is not {encoding}, the encoding that its first line declares; save it as UTF-8"
        )
        raise ValueError(sentence) from None


def _parsed(data: bytes | str) -> tuple[ElementTree.Element, dict[ElementTree.Element, int]]:
    """Return the root element, and the line of each element."""
    builder, lines = ElementTree.TreeBuilder(), {}
    parser = expat.ParserCreate(namespace_separator="}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.Parse(data, True)
    return builder.close(), lines


def _xacro(path: Path, root: ElementTree.Element) -> Faults:
    """Yield one fault where the file is a xacro file that was not expanded."""
    advice = f"this is a xacro file; expand it first: xacro {path.name} > expanded.urdf"
    for holder in (*root.findall("joint"), *root.findall("link")):
        for element in holder.iter():
            for attribute, value in element.attrib.items():
                if _UNEXPANDED.search(value):
                    yield element, f"{_place(holder, element)} {attribute} is {value!r}: {advice}"
                    return
    for element in root.iter():
        if element.tag.startswith(_XACRO):
            yield element, f"<xacro:{element.tag.partition('}')[2]}>: {advice}"
            return


def _numbers(root: ElementTree.Element) -> Faults:
    """Yield the attributes that are not the numbers they must be."""
    for holder in root:
        if holder.tag not in ("joint", "link", "material"):
            continue
        for element in holder.iter():
            for attribute, value in element.attrib.items():
                count = _COUNTS.get((element.tag, attribute), 0)
                if not count or (len(value.split()) == count and all(map(_is_number, value.split()))):
                    continue
                expected = "a number" if count == 1 else f"{count} numbers separated by blanks"
                comma = re.search(r"\d,\d", value) is not None
                yield (
                    element,
                    f"{_place(holder, element)} {attribute} is {value!r}, expected {expected}"
                    f"{'; write decimals with a point' if comma else ''}",
                )


def _is_number(text: str) -> bool:
    return _NUMBER.fullmatch(text) is not None and math.isfinite(float(text))


def _place(holder: ElementTree.Element, element: ElementTree.Element) -> str:
    named = f"{holder.tag} {holder.get('name', '')!r}:"
    return named if element is holder else f"{named} <{element.tag}>"


def _elements(root: ElementTree.Element) -> Faults:
    """Yield the links and joints that are not whole in themselves."""
    for tag in ("link", "joint"):
        seen: set[str] = set()
        for element in root.findall(tag):
            name = element.get("name", "")
            if not name:
                yield element, f"a <{tag}> without a name; give it one"
            elif name in seen:
                yield element, f"a second {tag} {name!r}; names must differ"
            seen.add(name)
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind not in (*_MOVING, "fixed"):
            yield joint, f"joint {name!r} is of type {kind!r}, expected one of {', '.join(_MOVING)}, fixed"
            continue
        limit = joint.find("limit")
        stated = set() if limit is None else set(limit.attrib)
        if kind != "fixed" and joint.find("mimic") is None and not {"velocity", "effort"} <= stated:
            yield joint, f"joint {name!r} needs a <limit> with lower, upper, velocity and effort"
        axis = joint.find("axis")
        if kind != "fixed" and axis is not None and not any(map(float, axis.get("xyz", "1 0 0").split())):
            yield axis, f"joint {name!r}: <axis> xyz is {axis.get('xyz')!r}, expected a direction, not zero"


def _ends(root: ElementTree.Element) -> Faults:
    """Yield the joints that do not connect a link to one that has no other joint above it."""
    links = {link.attrib["name"] for link in root.findall("link")}
    hung: set[str] = set()
    for joint in root.findall("joint"):
        name, ends = joint.attrib["name"], {}
        for tag in ("parent", "child"):
            ends[tag] = _end(joint, tag)
            if ends[tag] not in links:
                yield joint, f"joint {name!r}: <{tag}> link is {ends[tag]!r}, expected the name of a link"
        if ends["child"] in hung:
            yield joint, f"joint {name!r}: link {ends['child']!r} hangs on another joint already; it can have one"
        hung.add(ends["child"])


def _end(joint: ElementTree.Element, tag: str) -> str:
    """Return the link that a joint names as its parent or child; empty for none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _tree(root: ElementTree.Element) -> Faults:
    """Yield the links that are not part of one tree."""
    links = {link.attrib["name"]: link for link in root.findall("link")}
    parents = {_end(joint, "child"): _end(joint, "parent") for joint in root.findall("joint")}
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        yield links[roots[1]], f"link {roots[1]!r} hangs on no joint, nor does {roots[0]!r}; there can be one root link"
    hanging: dict[str, list[str]] = {}
    for child, parent in parents.items():
        hanging.setdefault(parent, []).append(child)
    reached = list(roots)
    for name in reached:
        reached.extend(hanging.get(name, ()))
    for name in sorted(links.keys() - set(reached))[:1]:
        yield links[name], f"link {name!r} hangs on itself through its joints; the links must be a tree"


def _mimics(root: ElementTree.Element) -> Faults:
    """Yield the mimic joints that follow no driven joint."""
    joints = {joint.attrib["name"]: joint for joint in root.findall("joint")}
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is None or joint.get("type") == "fixed":
            continue
        primary = mimic.get("joint", "")
        if primary not in joints:
            yield mimic, f"joint {name!r}: <mimic> joint is {primary!r}, expected the name of a joint"
        elif joints[primary].get("type") == "fixed":
            yield mimic, f"joint {name!r}: <mimic> joint is {primary!r}, which is fixed; expected one that moves"
        elif float(mimic.get("multiplier", "1")) == 0.0:
            yield mimic, f"joint {name!r} mimics with multiplier 0: make it fixed"
        elif name in _followed(name, joints):
            yield mimic, f"joint {name!r}: <mimic> joint is {primary!r}, so it follows itself; expected a driven joint"


def _followed(name: str, joints: Mapping[str, ElementTree.Element]) -> list[str]:
    """Return the joints that a joint follows, up to a driven one or one met before."""
    followed: dict[str, None] = {}
    while name in joints and (mimic := joints[name].find("mimic")) is not None:
        name = mimic.get("joint", "")
        if name in followed:
            break
        followed[name] = None
    return list(followed)


def _solids(root: ElementTree.Element) -> Faults:
    """Yield the links that are drawn and cannot be collided with, and the shapes that are no solids of a known size."""
    for link in root.findall("link"):
        name, collisions = link.attrib["name"], link.findall("collision")
        if link.find("visual") is not None and not collisions:
            yield link, f"no <collision> on link {name!r}, which is drawn; give it boxes, cylinders or spheres"
        for collision in collisions:
            solids = collision.findall("geometry/*")
            if len(solids) != 1 or solids[0].tag not in SOLIDS:
                held = ", ".join(f"<{solid.tag}>" for solid in solids) or "nothing"
                expected = f"expected one of {', '.join(SOLIDS)} that contains the part"
                yield collision, f"link {name!r}: <collision> holds {held}, {expected}"
                continue
            for attribute in SOLIDS[solids[0].tag]:
                sizes = solids[0].get(attribute, "").split()
                if not sizes or not all(float(size) > 0.0 for size in sizes):
                    yield (
                        solids[0],
                        f"link {name!r}: <{solids[0].tag}> {attribute} is {' '.join(sizes)!r}, expected more than 0",
                    )


def _joint(name: str, moving: Mapping[str, ElementTree.Element]) -> Joint:
    kind = moving[name].attrib["type"]
    limit = moving[name].find("limit")
    stated = {} if limit is None else {key: float(limit.get(key, "0")) for key in ("lower", "upper", "velocity")}
    lower, upper = stated.get("lower", 0.0), stated.get("upper", 0.0)
    acceleration, jerk = (
        math.inf if limit is None else float(limit.get(key, "inf")) for key in ("acceleration", "jerk")
    )
    if kind == "continuous":
        lower, upper = -math.inf, math.inf
    multiplier, offset, followed = 1.0, 0.0, _followed(name, moving)
    for mimic in (moving[follower].find("mimic") for follower in (name, *followed)[:-1]):
        assert mimic is not None
        offset += multiplier * float(mimic.get("offset", "0"))
        multiplier *= float(mimic.get("multiplier", "1"))
    primary = followed[-1] if followed else ""
    speed = stated.get("velocity", 0.0)
    return Joint(name, kind, lower, upper, speed, acceleration, jerk, primary, multiplier, offset)


def _chain(root: ElementTree.Element) -> str:
    """Return the links and joints alone, every joint driven."""
    bare = ElementTree.Element("robot", name=root.attrib["name"])
    for link in root.findall("link"):
        ElementTree.SubElement(bare, "link", name=link.attrib["name"])
    for joint in root.findall("joint"):
        copy = ElementTree.SubElement(bare, "joint", name=joint.attrib["name"], type=joint.attrib["type"])
        copy.extend(part for tag in ("origin", "parent", "child", "axis") if (part := joint.find(tag)) is not None)
        if joint.attrib["type"] != "fixed":
            limit = joint.find("limit")
            stated = {} if limit is None else limit.attrib
            ends = {key: stated.get(key, "0") for key in ("lower", "upper", "velocity", "effort")}
            ElementTree.SubElement(copy, "limit", ends)
    return ElementTree.tostring(bare, encoding="unicode")
