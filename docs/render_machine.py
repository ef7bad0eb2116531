"""Render docs/machine.png: the tape layer at work on the cylinder panel, with a close-up of its head.

Rays are traced on the CPU, so no display is needed: `pip install -e '.[docs]'`, then `python docs/render_machine.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import yourdfpy
from PIL import Image, ImageDraw
from trimesh.ray.ray_pyembree import RayMeshIntersector

from tapelayer.arrays import Floats, Mask
from tapelayer.courses.course_file import read_courses
from tapelayer.geometry.curves import Curve
from tapelayer.geometry.toolpath import Toolpath, to_machine
from tapelayer.machines import gantry
from tapelayer.machines.machine import Machine

HERE = Path(__file__).parent
COURSES = HERE.parent / "examples" / "cylinder_panel_15.txt"
PART_ORIGIN = (0.3, -1.9, -1.4)
PANEL_RADIUS, PANEL_AXIS = 1.8, (0.5, -1.6)
TAPE_WIDTH = 0.075
AT_COURSE, AT_SHARE = 11, 0.62

SUN = np.array([0.55, -0.45, 0.70]) / np.linalg.norm([0.55, -0.45, 0.70])
MOULD, LAID, NEXT = (0.80, 0.74, 0.60), (0.075, 0.08, 0.09), (0.93, 0.35, 0.10)
FLOOR, BACKDROP = (0.74, 0.76, 0.79), np.array([0.93, 0.945, 0.96])
BLADE_ANGLE = np.radians(25.0)


@dataclass(frozen=True)
class Camera:
    """Camera of a picture: eye and target (3,) in metres, horizontal field of view in degrees, size in pixels."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    opening: float
    width: int
    height: int


def main() -> None:
    """Pose the machine, trace both pictures, inset the close-up, and save."""
    machine = Machine.load()
    courses = [to_machine(course, (0.0, 0.0, 0.0), PART_ORIGIN, 0.0) for course in read_courses(COURSES)]
    q = laying_pose(machine, courses[AT_COURSE])
    scene = Scene([*machine_meshes(machine, q), *part_meshes(courses), floor()])
    whole = scene.picture(Camera((8.6, -3.5, 2.0), (0.95, -0.72, -0.66), 36.5, 1200, 750))
    contact = machine.forward(q[None], "contact")[0]
    aim = contact[:3, 3] + 0.04 * contact[:3, 0] + 0.27 * contact[:3, 2]
    eye = aim + contact[:3, :3] @ np.array([1.45, -1.35, 0.12])
    head = scene.picture(Camera(tuple(eye), tuple(aim), 24.0, 400, 400))
    framed(whole, head).quantize(160, dither=Image.Dither.NONE).save(HERE / "machine.png", optimize=True)


def framed(whole: Image.Image, head: Image.Image) -> Image.Image:
    """Return the picture of the whole machine with the head in a round inset."""
    at = (whole.width - head.width - 20, whole.height - head.height - 20)
    fine = 4
    disc = Image.new("L", (head.width * fine, head.height * fine))
    ImageDraw.Draw(disc).ellipse((0, 0, disc.width - 1, disc.height - 1), fill=255)
    rim = disc.resize((head.width + 12, head.height + 12), Image.Resampling.LANCZOS)
    whole.paste((60, 84, 110), (at[0] - 6, at[1] - 6), rim)
    whole.paste(head, at, disc.resize(head.size, Image.Resampling.LANCZOS))
    return whole


def laying_pose(machine: Machine, course: Toolpath) -> Floats:
    """Return the axis values (k,) while the course is being laid, with the knives as for a cut."""
    curve = Curve(course)
    at = curve.at(np.array([AT_SHARE * curve.length]))
    q = np.zeros(len(machine.axes))
    q[[machine.column(name) for name in gantry.POSE]] = gantry.inverse(machine, *at)[0, 0]
    for name, value in (("v", 0.02), ("d", BLADE_ANGLE), ("q", -0.11), ("e", BLADE_ANGLE)):
        q[machine.column(name)] = value
    return q


def machine_meshes(machine: Machine, q: Floats) -> list[trimesh.Trimesh]:
    """Return the URDF's visuals in `machine` axes, in the URDF's colours."""
    robot = yourdfpy.URDF.load(str(machine.path)).robot
    colours = {material.name: material.color.rgba[:3] for material in robot.materials}
    poses = machine.forward_all(q[None], [link.name for link in robot.links])
    meshes = []
    for link in robot.links:
        for visual in link.visuals:
            shape = visual.geometry
            if shape.box is not None:
                mesh = trimesh.creation.box(shape.box.size)
            else:
                mesh = trimesh.creation.cylinder(shape.cylinder.radius, shape.cylinder.length, sections=72)
            mesh.apply_transform(poses[link.name][0] @ visual.origin)
            meshes.append(painted(mesh, colours[visual.material.name]))
    return meshes


def part_meshes(courses: Sequence[Toolpath]) -> list[trimesh.Trimesh]:
    """Return the mould on its ribs, the tapes laid so far, and the centre lines of the remaining ones."""
    across, along = np.linspace(0.0, 1.0, 49), np.linspace(-0.06, 1.56, 2)
    meshes = [painted(slab(across, along, -0.025, 0.0), MOULD)]
    for y in np.linspace(0.0, 1.5, 4):
        meshes.append(painted(slab(across, np.array([y - 0.012, y + 0.012]), None, -0.02), MOULD))
    for x in np.linspace(0.08, 0.92, 4):
        meshes.append(painted(slab(np.array([x - 0.012, x + 0.012]), along, None, -0.02), MOULD))
    for number, course in enumerate(courses):
        length = Curve(course).length
        laid = length * (1.0 if number < AT_COURSE else AT_SHARE if number == AT_COURSE else 0.0)
        if laid > 0.0:
            meshes.append(painted(tape(course, 0.0, laid, TAPE_WIDTH - 0.0025, 0.0012), LAID))
        if laid < length:
            meshes.append(painted(tape(course, laid, length, 0.006, 0.0006), NEXT))
    return meshes


def slab(across: Floats, along: Floats, bottom: float | None, top: float) -> trimesh.Trimesh:
    """Return a piece of the panel between two offsets from its surface, or down to the bed if no bottom is given."""
    x, y = (grid.ravel() for grid in np.meshgrid(across, along, indexing="ij"))
    lean = np.arcsin((x - PANEL_AXIS[0]) / PANEL_RADIUS)

    def shell(offset: float) -> Floats:
        radius = PANEL_RADIUS + offset
        return np.column_stack([PANEL_AXIS[0] + radius * np.sin(lean), y, PANEL_AXIS[1] + radius * np.cos(lean)])

    upper = shell(top)
    lower = np.column_stack([upper[:, :2], np.full(len(x), -0.35)]) if bottom is None else shell(bottom)
    cell = np.arange(len(x)).reshape(len(across), len(along))
    a, b, c, d = (part.ravel() for part in (cell[:-1, :-1], cell[1:, :-1], cell[1:, 1:], cell[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    border = np.concatenate([cell[:, 0], cell[-1, 1:], cell[-2::-1, -1], cell[0, -2::-1]])
    first, second, n = border[:-1], border[1:], len(x)
    walls = np.vstack([np.column_stack([first, second, second + n]), np.column_stack([first, second + n, first + n])])
    mesh = trimesh.Trimesh(np.vstack([upper, lower]) + PART_ORIGIN, np.vstack([faces, faces + n, walls]), process=False)
    return mesh


def tape(course: Toolpath, start: float, end: float, width: float, thickness: float) -> trimesh.Trimesh:
    """Return a strip along a course between two arc lengths, just above the surface."""
    points, normals, tangents = Curve(course).at(np.linspace(start, end, 60))
    left = np.cross(normals, tangents)
    edges = np.stack([points + 0.5 * width * left, points - 0.5 * width * left], axis=1) + thickness * normals[:, None]
    row = 2 * np.arange(len(points) - 1)
    faces = np.vstack([np.column_stack([row, row + 1, row + 3]), np.column_stack([row, row + 3, row + 2])])
    return trimesh.Trimesh(edges.reshape(-1, 3), faces, process=False)


def floor() -> trimesh.Trimesh:
    """Return the shop floor, large enough to fade into the backdrop."""
    mesh = trimesh.creation.box((60.0, 60.0, 0.02))
    mesh.apply_translation((0.0, 0.0, -1.85))
    return painted(mesh, FLOOR)


def painted(mesh: trimesh.Trimesh, colour: Sequence[float]) -> trimesh.Trimesh:
    """Give a mesh a colour (r, g, b in 0..1) and return it."""
    mesh.metadata["colour"] = np.asarray(colour, dtype=np.float64)
    return mesh


class Scene:
    """Meshes lit by a uniform sky and one sun.

    Args:
        meshes: painted meshes in `machine` axes.
    """

    SUN_RAYS, SKY_RAYS, FINE = 3, 16, 3

    def __init__(self, meshes: Sequence[trimesh.Trimesh]) -> None:
        self.mesh = trimesh.util.concatenate(list(meshes))
        self.colours = np.vstack([np.tile(mesh.metadata["colour"], (len(mesh.faces), 1)) for mesh in meshes])
        self.rays = RayMeshIntersector(self.mesh)
        self.chance = np.random.default_rng(7)

    def picture(self, camera: Camera) -> Image.Image:
        """Return what the camera sees, each pixel the mean of FINE x FINE rays."""
        eye, forward = np.array(camera.eye), np.subtract(camera.target, camera.eye)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        half = np.tan(np.radians(camera.opening) / 2)
        columns, rows = camera.width * self.FINE, camera.height * self.FINE
        u = ((np.arange(columns) + 0.5) / columns * 2 - 1) * half
        v = (1 - (np.arange(rows) + 0.5) / rows * 2) * half * rows / columns
        image = np.empty((rows, columns, 3))
        for row in range(0, rows, 60):
            directions = forward + u[None, :, None] * right + v[row : row + 60, None, None] * up
            image[row : row + 60] = self._seen(eye, directions.reshape(-1, 3)).reshape(-1, columns, 3)
        small = image.reshape(camera.height, self.FINE, camera.width, self.FINE, 3).mean(axis=(1, 3))
        shown = np.clip(small, 0.0, 1.0) ** (1 / 2.2)
        return Image.fromarray(np.round(shown * 255).astype(np.uint8))

    def _seen(self, eye: Floats, directions: Floats) -> Floats:
        """Return linear colours (n, 3) along rays from the eye."""
        directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        light = np.tile(BACKDROP**2.2, (len(directions), 1))
        hit = self.rays.intersects_first(np.tile(eye, (len(directions), 1)), directions)
        seen = hit >= 0
        faces, rays = hit[seen], directions[seen]
        normals = self.mesh.face_normals[faces]
        normals = np.where(np.sum(normals * rays, axis=1)[:, None] > 0, -normals, normals)
        corners = self.mesh.triangles[faces, 0]
        distances = np.sum((corners - eye) * normals, axis=1) / np.sum(rays * normals, axis=1)
        points = eye + distances[:, None] * rays + 1e-4 * normals
        sky = np.zeros(len(points))
        for _ in range(self.SKY_RAYS):
            sky += ~self._blocked(points, self._scattered(normals, 1.0)) / self.SKY_RAYS
        sun = np.zeros(len(points))
        facing = normals @ SUN
        for _ in range(self.SUN_RAYS):
            sun += ~self._blocked(points, self._scattered(np.tile(SUN, (len(points), 1)), 0.03)) / self.SUN_RAYS
        albedo = self.colours[faces] ** 2.2
        gloss = np.clip(np.sum((2 * facing[:, None] * normals - SUN) * -rays, axis=1), 0.0, 1.0) ** 40
        lit = sun * np.clip(facing, 0.0, None)
        shade = (0.62 * sky + 0.08)[:, None] * np.array([0.96, 1.0, 1.06]) + (0.85 * lit)[:, None] * [1.05, 1.0, 0.93]
        colour = albedo * shade + (0.10 * gloss * sun)[:, None]
        # The floor fades into the backdrop with distance.
        haze = np.clip((distances - 11.0) / 9.0, 0.0, 1.0)[:, None]
        light[seen] = colour * (1 - haze) + BACKDROP**2.2 * haze
        return light

    def _blocked(self, points: Floats, directions: Floats) -> Mask:
        blocked: Mask = self.rays.intersects_any(points, directions)
        return blocked

    def _scattered(self, about: Floats, spread: float) -> Floats:
        """Return random directions about others: cosine-weighted over the hemisphere for spread 1, a cone for less."""
        ball = self.chance.normal(size=about.shape)
        directions = about + spread * 0.999 * ball / np.linalg.norm(ball, axis=1)[:, None]
        unit: Floats = directions / np.linalg.norm(directions, axis=1)[:, None]
        return unit


if __name__ == "__main__":
    main()
