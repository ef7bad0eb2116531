"""Planes: frames that lie along a surface, in which it is a height over a plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tapelayer.arrays import Floats, Frozen

# A best plane whose normal is further from the facets' mean normal stands across the surface, as in a deep channel.
_LEAST_COSINE = 0.9


@dataclass(frozen=True, eq=False)
class Plane(Frozen):
    """A frame whose x and y axes lie in a plane and whose z axis is its normal, in the frame it is a plane of.

    Attributes:
        rotation: (3, 3) rows are the axes x, y, z, unit vectors in the outer frame.
        origin: (3,) in metres in the outer frame.
    """

    rotation: Floats
    origin: Floats

    @property
    def normal(self) -> Floats:
        """Return the unit normal (3,) in the outer frame."""
        normal: Floats = self.rotation[2]
        return normal

    def into(self, points: Floats) -> Floats:
        """Return points (n, 3) of the outer frame in the plane's, metres.

        Examples:
            >>> plane = Plane(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), np.array([5.0, 0.0, 0.0]))
            >>> plane.into(np.array([[6.0, 2.0, 3.0]])).tolist()
            [[2.0, 3.0, 1.0]]
        """
        inside: Floats = (points - self.origin) @ self.rotation.T
        return inside

    def out_of(self, points: Floats) -> Floats:
        """Return points (n, 3) of the plane's frame in the outer one, metres.

        Examples:
            >>> plane = Plane(np.eye(3), np.array([5.0, 0.0, 0.0]))
            >>> plane.out_of(np.array([[2.0, 3.0, 1.0]])).tolist()
            [[7.0, 3.0, 1.0]]
        """
        outside: Floats = points @ self.rotation + self.origin
        return outside

    def turned_into(self, vectors: Floats) -> Floats:
        """Return vectors (n, 3) of the outer frame in the plane's."""
        inside: Floats = vectors @ self.rotation.T
        return inside

    def turned_out_of(self, vectors: Floats) -> Floats:
        """Return vectors (n, 3) of the plane's frame in the outer one."""
        outside: Floats = vectors @ self.rotation
        return outside


def plane_across(normal: Floats, origin: Floats) -> Plane:
    """Return the plane square to a normal (3,) of any length; its x axis is along the outer x axis, or near it.

    Args:
        normal: not zero.
        origin: (3,) metres.

    Examples:
        >>> plane_across(np.array([0.0, 0.0, 2.0]), np.zeros(3)).rotation.tolist()
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    z = normal / np.linalg.norm(normal)
    # The outer axes that are least along the normal leave no doubt of where the plane's own lie.
    y = np.cross(z, [1.0, 0.0, 0.0]) if abs(z[0]) < _LEAST_COSINE else np.cross(z, [0.0, 0.0, 1.0])
    y /= np.linalg.norm(y)
    return Plane(np.stack([np.cross(y, z), y, z]), origin)


def best_plane(corners: Floats, areas: Floats, normals: Floats) -> Plane:
    """Return the plane nearest to facets, by least squares over their area; its normal points to their mean one's side.

    Where that plane would stand across the facets, as in a deep channel, the plane square to their mean normal.

    Args:
        corners: (m, 3, 3) of the facets, metres.
        areas: (m,) square metres.
        normals: (m, 3) unit normals, which are not in balance as those of a closed body.

    Examples:
        >>> corners = np.array([[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]]])
        >>> plane = best_plane(corners, np.array([0.5]), np.array([[0.0, 0.0, -1.0]]))
        >>> (plane.normal + 0.0).tolist(), np.round(plane.origin, 3).tolist()
        ([0.0, 0.0, -1.0], [0.333, 0.333, 2.0])
    """
    shares = areas / areas.sum()
    middle = shares @ corners.mean(axis=1)
    mean = shares @ normals
    mean = mean / np.linalg.norm(mean)
    away = corners - middle
    sums = away.sum(axis=1)
    # The integral of p p' over a triangle of area A with corners p1, p2, p3 is A / 12 (sum pi pi' + s s'), s their sum.
    moments = np.einsum("m,mci,mcj->ij", shares, away, away) + np.einsum("m,mi,mj->ij", shares, sums, sums)
    across = np.linalg.eigh(moments)[1][:, 0]
    along = float(across @ mean)
    return plane_across(mean if abs(along) < _LEAST_COSINE else np.copysign(1.0, along) * across, middle)
