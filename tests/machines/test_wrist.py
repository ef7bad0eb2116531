"""Wrist: the inverse through Pinocchio and against the paper's branches; the theta path against brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.machines.wrist import angles_between, gun_axes, inverse
from tests.helpers.machines import sprayer
from tests.helpers.wrists import SPECIAL

angle = st.one_of(st.sampled_from(SPECIAL.tolist()), st.floats(0.0, 2 * np.pi))
slant = st.one_of(
    st.sampled_from(np.radians([0, 1e-7, 1e-3, 15, 30, 45, 60, 89]).tolist()), st.floats(0.0, np.radians(89.9))
)


def test_inverse_points_the_gun_of_both_branches_along_the_normal_by_pinocchio() -> None:
    theta, phi = (values.ravel() for values in np.meshgrid(SPECIAL, np.radians([0, 1e-6, 1, 30, 45, 60, 89])))
    normals = gun_axes(theta, phi)
    for branch in inverse(normals):
        q = np.column_stack([np.full((len(branch), 3), 0.5), branch, np.full(len(branch), 0.15)])
        poses = sprayer().forward_pinocchio(q, "gun")
        np.testing.assert_allclose(poses[:, :3, 2], normals, rtol=0, atol=1e-12)
        np.testing.assert_allclose(poses[:, :3, 3], 0.5 + 0.15 * normals, rtol=0, atol=1e-12)


@given(angle, slant)
def test_inverse_gives_back_the_angles(theta: float, phi: float) -> None:
    (first,), (second,) = inverse(gun_axes(np.array([theta]), np.array([phi])))
    assert 0 <= first[0] < 2 * np.pi
    assert first[1] == pytest.approx(phi, abs=1e-12)
    # A tilt next to the smallest number there is leaves no digits for theta.
    if phi > 1e-300:
        assert np.remainder(first[0] - theta + 1, 2 * np.pi) == pytest.approx(1, abs=1e-9)
    assert second[0] == first[0] + np.pi
    assert second[1] == -first[1]


def test_special_normals() -> None:
    normals = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8], [0.0, -0.6, 0.8]])
    tilt = math.atan2(0.6, 0.8)
    expected = np.column_stack([np.radians([0, 0, 90, 180, 270]), [0, tilt, tilt, tilt, tilt]])
    np.testing.assert_allclose(inverse(normals)[0], expected, rtol=0, atol=1e-15)
    just_below = inverse(np.array([[0.6, -1e-17, 0.8]]))[0, 0, 0]
    assert just_below == 0.0


@pytest.mark.parametrize("z", [0.0, -0.0, -1e-12, -1.0, np.nan])
def test_what_does_not_point_upwards_has_no_solution(z: float) -> None:
    assert np.all(np.isnan(inverse(np.array([[0.5, 0.5, z]]))))


def test_the_paper_s_branches_where_they_are_defined() -> None:
    chance = np.random.default_rng(3)
    normals = chance.normal(size=(5000, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    x, y, z = normals.T
    phi = np.degrees(np.arccos(z))
    quotient = np.degrees(np.arccos(x / np.sin(np.arccos(z))))
    theta = np.where(y > 0, quotient, 360 - np.abs(quotient))
    defined = (y != 0) & (z > 0) & (z < 1) & (np.abs(x) < np.sin(np.arccos(z)))
    assert np.count_nonzero(defined) > 4900
    found = np.degrees(inverse(normals)[0])
    # acos loses half the digits near 0 and 180 deg.
    np.testing.assert_allclose(found[defined], np.column_stack([theta, phi])[defined], rtol=0, atol=1e-4)
    clear = defined & (np.abs(y) > 0.01) & (z < 0.999)
    np.testing.assert_allclose(found[clear], np.column_stack([theta, phi])[clear], rtol=0, atol=1e-10)


@given(angle, slant, angle, slant)
def test_angles_between_is_the_arc(theta: float, phi: float, theta_2: float, phi_2: float) -> None:
    first, second = gun_axes(np.array([theta, theta_2]), np.array([phi, phi_2]))
    expected = math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))
    assert angles_between(first, second) == pytest.approx(expected, abs=1e-12)
