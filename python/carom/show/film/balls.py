"""Balls and their shadows: a square each, on which a program finds the ball by casting the ray of every pixel.

So outlines are exact at any size and a ball costs six corners, which software rendering can bear; the viewer draws alike
(viewer/src/spheres.glsl.ts). The square lies inside the ball, where rays just touch it: as bodies do not overlap, its depth
sorts them. They are drawn from the back to the front, so that the soft rims blend with what is behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.scene.billiards.look import KINDS
from carom.show.film.camera import Eye
from carom.show.film.mesh import attach, cells, mesh, place, shaded
from carom.show.film.numbers import atlas

#: Kinds of balls in the program below that are no pattern of billiards: of two tones, of one colour.
GRAIN, PLAIN = KINDS.index("grain"), len(KINDS)

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

BALL_VERTEX = (
    """
in vec4 ball;
in vec4 turn;
in vec3 tint;
in vec2 badge;
out vec3 at;
flat out vec4 vBall;
flat out vec4 vTurn;
flat out vec3 vTint;
flat out vec2 vBadge;
""",
    "at = vertexMC.xyz; vBall = ball; vTurn = turn; vTint = tint; vBadge = badge;",
)
BALL_FRAGMENT = (
    """
in vec3 at;
flat in vec4 vBall;
flat in vec4 vTurn;
flat in vec3 vTint;
flat in vec2 vBadge;   // kind: 0 to 4 of KINDS, 5 plain; cell of its number
const vec3 IVORY = vec3(0.95, 0.93, 0.87);
const vec3 AXIS = vec3(0.0, -0.62, 0.7846);   // of the numbers, as in the viewer: towards the eye at the start
float over(float edge, float x, float width) { return clamp((x - edge) / width + 0.5, 0.0, 1.0); }
vec3 unturned(vec4 q, vec3 v) {
  vec3 t = 2.0 * cross(v, q.yzw);
  return v + q.x * t + cross(t, q.yzw);
}
vec3 pattern(vec3 n, float width, vec3 base) {
  int kind = int(vBadge.x + 0.5);
  if (kind == 5) return base;
  if (kind == 4) {
    // Eight octants in two tones and a light cap, so that every attitude looks different.
    vec3 s = clamp(n / width, -1.0, 1.0);
    return mix(base * (1.0 + 0.3 * s.x * s.y * s.z), IVORY, 0.9 * over(0.9, n.z, 0.5 * width));
  }
  if (kind == 0 || kind == 3) {
    // Twelve dots, at the corners of an icosahedron.
    vec3 a = abs(n);
    float near = max(max(a.y + 1.618 * a.z, a.z + 1.618 * a.x), a.x + 1.618 * a.y) / 1.902;
    return mix(base, kind == 0 ? vec3(0.80, 0.16, 0.17) : IVORY, over(0.979, near, 0.3 * width));
  }
  float b = dot(n, AXIS);
  float v = dot(n, vec3(0.0, 0.7846, 0.62));
  vec3 c = base;
  vec3 spots = IVORY;
  if (kind == 2) {
    float band = over(-0.56, -abs(v), width);
    c = mix(IVORY, base, band);
    spots = mix(base, IVORY, band);
  }
  c = mix(c, spots, over(0.982, max(abs(n.x), abs(v)), 0.3 * width));
  float disc = over(0.86, abs(b), 0.55 * width);
  vec2 p = clamp(vec2(b > 0.0 ? n.x : -n.x, v) / 0.80 + 0.5, 0.02, 0.98);
  vec2 cell = vec2(mod(vBadge.y, cells), floor(vBadge.y / cells));
  float ink = texture(numbers, (cell + p) / cells).r;
  return mix(mix(c, IVORY, disc), vec3(0.12), ink * disc);
}
""",
    """
  vec3 ray = normalize(at - eye);
  vec3 from = eye - vBall.xyz;
  vec3 nearest = from - dot(from, ray) * ray;
  float miss = length(nearest);
  float pixel = max(fwidth(miss), 1e-9);
  float cover = clamp((vBall.w - miss) / pixel + 0.5, 0.0, 1.0);
  if (cover <= 0.0) discard;
  float deep = sqrt(max(vBall.w * vBall.w - miss * miss, 0.0));
  vec3 n = normalize(nearest - deep * ray);
  float facing = max(dot(n, -ray), 0.0);
  // Width of a pixel on the ball, from geometry: derivatives of a cast point break at the rim.
  float width = 1.2 * pixel / (vBall.w * max(facing, 0.15));
  vec3 own = unturned(vTurn, n);
  vec3 c = pattern(own, width, vTint);
  float sky = 0.5 + 0.5 * dot(n, upward);
  float lit = max(dot(n, lamp), 0.0);
  c *= 0.40 + 0.26 * sky + 0.44 * lit;
  vec3 middle = normalize(lamp - ray);
  c += vec3(0.35) * pow(max(dot(n, middle), 0.0), 60.0) + vec3(0.06) * pow(1.0 - facing, 3.0);
  gl_FragData[0] = vec4(min(c, 1.0), cover);
""",
)
SHADE_VERTEX = ("in vec3 spot;\nout vec3 vSpot;", "vSpot = spot;")
SHADE_FRAGMENT = (
    "in vec3 vSpot;",
    """
  float dark = vSpot.z * (1.0 - smoothstep(0.35, 1.0, length(vSpot.xy)));
  if (dark < 0.004) discard;
  gl_FragData[0] = vec4(0.0, 0.0, 0.0, dark);
""",
)


class Balls:
    """All balls of a picture as one actor; `labels` are what is written on them, each once."""

    def __init__(self, lamp: F64, up: F64, labels: Sequence[str] = ("",)) -> None:
        self._data = mesh(np.zeros((0, 3)))
        self.actor = shaded(self._data, ("ball", "turn", "tint", "badge"), BALL_VERTEX, BALL_FRAGMENT)
        texture, side = atlas(labels)
        self.actor.GetProperty().SetTexture("numbers", texture)
        self._known: Any = self.actor.GetShaderProperty().GetFragmentCustomUniforms()
        self._known.SetUniform3f("lamp", lamp.tolist())
        self._known.SetUniform3f("upward", up.tolist())
        self._known.SetUniformf("cells", float(side))

    def place(
        self, eye: Eye, pixel: float, centre: F64, radius: F64, turn: F64, tint: F64, badge: F64
    ) -> None:
        """Centres (n, 3), radii (n,), quaternions (n, 4), colours (n, 3), kinds and cells of numbers (n, 2); `pixel` is the
        angle of one, rad.
        """
        sight = centre - eye.position
        distance = np.linalg.norm(sight, axis=1)
        order = np.argsort(-distance, kind="stable")
        sight, distance, radius = sight[order], distance[order, None], radius[order, None]
        sight = sight / distance
        right = np.cross(sight, eye.up)
        right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-12)
        above = np.cross(right, sight)
        # Distance and radius of the circle of touch; a little more, for the soft rim.
        shrink = 1.0 - np.minimum(radius / distance, 0.98) ** 2
        middle = eye.position + sight * (distance * shrink)
        reach = radius * np.sqrt(shrink) + 1.5 * pixel * distance
        corners = middle[:, None] + reach[:, None] * (
            CORNERS[:, :1] * right[:, None] + CORNERS[:, 1:] * above[:, None]
        )
        self._known.SetUniform3f("eye", eye.position.tolist())
        _squares(self._data, corners)
        attach(self._data, np.repeat(np.hstack([centre[order], radius]), 4, axis=0), "ball")
        attach(self._data, np.repeat(turn[order], 4, axis=0), "turn")
        attach(self._data, np.repeat(tint[order], 4, axis=0), "tint")
        attach(self._data, np.repeat(badge[order], 4, axis=0), "badge")


class Shadows:
    """Soft dark spots on a floor below the balls near it; `polygon` (k, 3) is the floor, `normal` its side of the balls."""

    #: Height at which a shadow is gone, in radii, and what a ball that lies takes from the light.
    TALL = 5.0
    DARK = 0.5
    #: Heights of overlapping shadows differ by this much of the scene, some rounding steps of the depth; they repeat after
    #: so many shadows, so that none floats above the floor.
    APART = 5e-6
    LAYERS = 256

    def __init__(self, polygon: F64, normal: F64, lamp: F64) -> None:
        self._data = mesh(np.zeros((0, 3)))
        self.actor = shaded(self._data, ("spot",), SHADE_VERTEX, SHADE_FRAGMENT)
        self.actor.GetProperty().BackfaceCullingOn()
        self._polygon, self._normal, self._lamp = polygon, normal, lamp
        edge = np.roll(polygon, -1, axis=0) - polygon
        self._inward = np.cross(normal, edge)
        k = int(np.argmin(np.abs(normal)))
        self._u = np.cross(np.eye(3)[k], normal)
        self._u /= np.linalg.norm(self._u)

    def place(self, centre: F64, radius: F64) -> None:
        """Centres (n, 3) and radii (n,) of the balls."""
        height = (centre - self._polygon[0]) @ self._normal
        foot = centre - (height / (self._lamp @ self._normal))[:, None] * self._lamp
        over = height / np.maximum(radius, 1e-300) - 1.0
        seen = (over > -0.5) & (over < self.TALL)
        for corner, inward in zip(self._polygon, self._inward, strict=True):
            seen &= (foot - corner) @ inward > 0
        foot, radius, over = foot[seen], radius[seen], over[seen]
        v = np.cross(self._normal, self._u)
        # Just above the floor, each a little above those that are drawn before: in one plane rounding of depths decides
        # which of two is seen, from pixel to pixel.
        least = 0.004 * float(np.median(radius) if len(radius) else 0.0)
        above = least + self.APART * (np.arange(len(radius)) % self.LAYERS)
        foot = foot + above[:, None] * self._normal
        reach = (1.25 + 0.25 * np.maximum(over, 0.0)) * radius
        spots = CORNERS[:, :1] * self._u + CORNERS[:, 1:] * v
        _squares(self._data, foot[:, None] + reach[:, None, None] * spots)
        dark = self.DARK * (1.0 - np.maximum(over, 0.0) / self.TALL)
        flat = np.broadcast_to(CORNERS, (len(foot), 4, 2))
        attach(
            self._data,
            np.concatenate([flat, np.broadcast_to(dark[:, None, None], (len(foot), 4, 1))], axis=2).reshape(
                -1, 3
            ),
            "spot",
        )


def _squares(data: Any, corners: F64) -> None:
    """Put squares, corners (n, 4, 3), into a vtkPolyData."""
    count = len(corners)
    place(data, corners.reshape(-1, 3))
    first = 4 * np.arange(count)[:, None]
    data.SetPolys(cells((first[:, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)))
    data.Modified()
