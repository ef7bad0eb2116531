"""urdf/sprayer.urdf: the linkage closes, P rests, the gun points, by Pinocchio, by yourdfpy and by plane geometry."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.arrays import Floats
from tests.helpers.machines import by_yourdfpy, sprayer
from urdf import SPRAYER, TAPELAYER

AXES = ("x", "y", "z", "theta", "phi", "standoff")
LIMITS = {
    "x": (0.0, 2.5),
    "y": (0.0, 2.0),
    "z": (0.0, 1.0),
    "theta": (0.0, 2 * np.pi),
    "phi": (0.0, np.pi / 2),
    "standoff": (0.0, 0.2),
}
SPEEDS = {"x": 1.0, "y": 1.0, "z": 0.5, "theta": np.pi, "phi": np.pi / 2}
MIMICS = {"phi_b": -1.0, "phi_e": 1.0, "phi_d": 1.0, "phi_g": -1.0}
AB, AP, AD, EF = 0.4, 0.6, 0.25, 0.15
RODS = ("rod_ab", "rod_bce", "rod_ef", "rod_dgc", "rod_fg")
ENDS = ("c_of_bce", "c_of_dgc", "f_of_ef", "f_of_fg")
FRAMES = ("fork", *RODS, *ENDS, "P", "gun")
TURNS = np.radians([-180, -90, 0, 30, 45, 90, 135, 180, 270, 359, 360, 450, 540])
SWINGS = np.radians([-90, -45, 0, 1e-6, 15, 30, 45, 60, 90])


def grid() -> Floats:
    """Configurations (n, 6) over the travel that a setup may open up, at special angles and at random ones."""
    chance = np.random.default_rng(7)
    theta, phi = (values.ravel() for values in np.meshgrid(TURNS, SWINGS))
    theta = np.concatenate([theta, chance.uniform(-np.pi, 3 * np.pi, 300)])
    phi = np.concatenate([phi, chance.uniform(-np.pi / 2, np.pi / 2, 300)])
    base = chance.uniform([0, 0, 0], [2.5, 2.0, 1.0], (len(theta), 3))
    return np.column_stack([base, theta, phi, chance.uniform(0, 0.2, len(theta))])


def gun_axes(q: Floats) -> Floats:
    theta, phi = q[:, 3], q[:, 4]
    return np.column_stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])


def origins(q: Floats, frame: str) -> Floats:
    return sprayer().forward_pinocchio(q, frame)[:, :3, 3]


def yourdfpy_pose(q: Floats, frame: str) -> Floats:
    by_yourdfpy(str(SPRAYER)).update_cfg(np.array(q, dtype=float))
    pose: Floats = by_yourdfpy(str(SPRAYER)).get_transform(frame, "machine")
    return pose


def test_axes_travel_and_speeds() -> None:
    assert sprayer().names == AXES
    for name, (lower, upper) in LIMITS.items():
        axis = sprayer().axis(name)
        assert (axis.lower, axis.upper) == (lower, upper)
        assert axis.revolute == (name in ("theta", "phi"))
    assert {name: sprayer().axis(name).speed for name in SPEEDS} == SPEEDS
    assert tuple(by_yourdfpy(str(SPRAYER)).actuated_joint_names) == AXES


def test_every_mimic_follows_phi_itself() -> None:
    model = sprayer().model
    phi, others = sprayer().column("phi"), [index for index, name in enumerate(AXES) if name != "phi"]
    unit = np.eye(len(AXES))
    still, turned = sprayer().configurations(np.array([np.zeros(len(AXES)), unit[phi]]))
    for name, multiplier in MIMICS.items():
        at = model.idx_qs[model.getJointId(name)]
        assert (still[at], turned[at]) == (0.0, multiplier)
        assert not np.any(sprayer().configurations(unit[others])[:, at])
        assert MIMICS[name] == by_yourdfpy(str(SPRAYER)).joint_map[name].mimic.multiplier
        assert by_yourdfpy(str(SPRAYER)).joint_map[name].mimic.joint == "phi"
    assert model.nq == len(AXES) + len(MIMICS)


def test_p_stays_put_by_pinocchio() -> None:
    q = grid()
    np.testing.assert_allclose(origins(q, "P"), q[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(sprayer().forward(q, "P")[:, :3, 3], q[:, :3], rtol=0, atol=1e-12)


def test_p_stays_put_by_yourdfpy() -> None:
    q = grid()[::3]
    found = np.array([yourdfpy_pose(row, "P")[:3, 3] for row in q])
    np.testing.assert_allclose(found, q[:, :3], rtol=0, atol=1e-12)


def test_the_gun_points_to_p_at_the_standoff() -> None:
    q = grid()
    n = gun_axes(q)
    for frame in ("P", "gun", "rod_ef"):
        np.testing.assert_allclose(sprayer().forward_pinocchio(q, frame)[:, :3, 2], n, rtol=0, atol=1e-12)
    np.testing.assert_allclose(origins(q, "gun") - origins(q, "P"), q[:, 5:] * n, rtol=0, atol=1e-12)


def test_both_parallelograms_close() -> None:
    q = grid()
    ends = {name: origins(q, name) for name in ENDS}
    np.testing.assert_allclose(ends["c_of_bce"], ends["c_of_dgc"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ends["f_of_ef"], ends["f_of_fg"], rtol=0, atol=1e-12)


def test_the_rods_are_the_sides_of_the_paper_s_parallelograms() -> None:
    q = grid()
    n, up = gun_axes(q), np.tile([0.0, 0.0, 1.0], (len(q), 1))
    a, b, e, d, g = (origins(q, rod) for rod in RODS)
    c, f, p = origins(q, "c_of_bce"), origins(q, "f_of_ef"), origins(q, "P")
    sides = {
        "AB": (b - a, AB * n),
        "DC": (c - d, AB * n),
        "AD": (d - a, -AD * up),
        "BC": (c - b, -AD * up),
        "BE": (e - b, -AP * up),
        "CE": (e - c, -(AP - AD) * up),
        "GF": (f - g, -(AP - AD) * up),
        "EF": (f - e, -EF * n),
        "CG": (g - c, -EF * n),
        "AP": (p - a, -AP * up),
        "EP": (p - e, -AB * n),
    }
    for name, (found, expected) in sides.items():
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12, err_msg=name)


@given(st.tuples(*[st.integers(0, 1000)] * len(AXES)))
def test_yourdfpy_agrees_on_every_frame(shares: tuple[int, ...]) -> None:
    # Thousandths, because yourdfpy's scene graph drops a joint that stands closer than 1e-8 to its zero.
    lower, upper = np.array(list(LIMITS.values())).T
    q = lower + np.array(shares) / 1000 * (upper - lower)
    for frame in FRAMES:
        expected = sprayer().forward_pinocchio(q[None], frame)[0]
        np.testing.assert_allclose(yourdfpy_pose(q, frame), expected, rtol=0, atol=1e-12, err_msg=frame)


def test_a_family_with_the_tape_layer() -> None:
    def colours(path: str) -> dict[str, str]:
        root = ElementTree.parse(path).getroot()
        return {element.attrib["name"]: element[0].attrib["rgba"] for element in root.findall("material")}

    own, other = colours(str(SPRAYER)), colours(str(TAPELAYER))
    shared = own.keys() & other.keys()
    assert {"structure", "moving", "head", "steel", "dark"} <= shared
    assert {name: own[name] for name in shared} == {name: other[name] for name in shared}


@pytest.mark.parametrize("link", ["machine", "bridge", "carriage", "ram", "fork", *RODS, "gun"])
def test_every_moving_link_is_drawn_in_a_declared_colour_and_can_be_hit(link: str) -> None:
    root = ElementTree.parse(SPRAYER).getroot()
    declared = {element.attrib["name"] for element in root.findall("material")}
    element = next(found for found in root.findall("link") if found.attrib["name"] == link)
    visuals = element.findall("visual")
    assert {visual.find("material").attrib["name"] for visual in visuals} <= declared  # type: ignore[union-attr]
    assert len(element.findall("collision")) == len(visuals) > 0
