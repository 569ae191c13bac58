"""A table of the billiards kit in a film, lit as in the viewer (viewer/src/table.glsl.ts): one actor, from the triangles and
colours of `carom.billiards`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.scene.billiards.look import COLOURS
from carom.scene.billiards.shape import Shape
from carom.scene.billiards.solid import SURFACES, parts
from carom.show.film.mesh import attach, colour, mesh, shaded

#: The first kinds of `SURFACES` in the program below.
CLOTH, LINE, CUSHION, WOOD, SIGHT, LINER, HOLE = range(len(SURFACES))

VERTEX = (
    """
in vec3 along;
in vec3 facing;
in float kind;
out vec3 at;
out vec3 vAlong;
out vec3 vFacing;
flat out float vKind;
""",
    "at = vertexMC.xyz; vAlong = along; vFacing = facing; vKind = kind;",
)
FRAGMENT = (
    """
in vec3 at;
in vec3 vAlong;    // place in the frame of the table, in radii of a ball
in vec3 vFacing;
flat in float vKind;
float hash(vec2 p) {
  p = fract(p * vec2(123.34, 456.21));
  p += dot(p, p + 45.32);
  return fract(p.x * p.y);
}
float noise(vec2 p) {
  vec2 i = floor(p);
  vec2 f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(hash(i), hash(i + vec2(1.0, 0.0)), f.x), mix(hash(i + vec2(0.0, 1.0)), hash(i + vec2(1.0, 1.0)), f.x), f.y);
}
""",
    """
  int surface = int(vKind + 0.5);
  vec3 n = normalize(vFacing);
  vec3 ray = normalize(at - eye);
  float lit = max((dot(n, lamp) + 0.18) / 1.18, 0.0);
  float sky = 0.5 + 0.5 * n.z;
  vec2 past = max(-vAlong.xy, vAlong.xy - size);   // beyond the noses, of the short rails and of the long ones
  float fine = 1.0 - smoothstep(0.3, 1.2, length(fwidth(vAlong)) / 0.06);
  vec3 c = cloth;
  float gloss = 0.0;
  float open = 1.0;   // share of the light that gets there
  if (surface <= 1) {
    float wall = max(-max(past.x, past.y), 0.0);
    float pool = mix(1.08, 0.72, smoothstep(0.0, 1.1, 2.0 * length(vAlong.xy - 0.5 * size) / length(size)));
    float nap = noise(vAlong.xy / 0.9) - 0.5 + 2.0 * fine * (noise(vAlong.xy / 0.06) - 0.5);
    c = surface == 1 ? mix(cloth, mark, 0.75) : cloth * (1.0 + 0.05 * nap);
    c *= pool * (1.0 - 0.42 * exp(-wall / 0.9));
  } else if (surface == 2) {
    c *= 0.97 + 0.06 * fine * (noise(vAlong.xy / 0.06) - 0.5);
    open = mix(0.45, 1.0, smoothstep(0.0, 1.1, vAlong.z));
  } else if (surface == 3) {
    bool across = past.x > past.y;
    vec2 g = (across ? vec2(vAlong.y, past.x) : vec2(vAlong.x, past.y)) + (across ? 31.7 : 0.0);
    float grain = noise(g / vec2(3.0, 0.10)) + 0.5 * noise(g / vec2(1.0, 0.04));
    c = wood * (0.80 + 0.28 * grain);
    c *= 1.0 - 0.35 * exp(-abs(past.x - past.y) / 0.025) * step(0.0, min(past.x, past.y));
    gloss = 1.0;
    open = mix(0.55, 1.0, smoothstep(-3.0, 0.5, vAlong.z));
  } else if (surface == 4) {
    c = sight;
    gloss = 0.5;
  } else {
    c = liner;
    gloss = surface == 5 ? 0.7 : 0.0;
    // Down in a pocket it is dark.
    open = surface == 5 ? smoothstep(-0.4, 1.3, vAlong.z) : 0.42 * exp(1.1 * min(vAlong.z, 0.0));
  }
  vec3 light = mix(cloth * 0.35, vec3(0.52, 0.55, 0.60), sky) * open + vec3(0.75, 0.72, 0.66) * lit * open * open;
  c *= light * (surface == 2 ? 0.85 : 1.0);
  float fresnel = 0.03 + 0.5 * pow(1.0 - max(dot(n, -ray), 0.0), 5.0);
  c += gloss * open * fresnel * 0.3;
  c = clamp(c / (1.0 + 0.18 * c) * 1.12, 0.0, 1.0);
  c = mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), c));
  gl_FragData[0] = vec4(c, 1.0);
""",
)


def linear(css: str) -> list[float]:
    """`#rrggbb` as shares of light."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour(css)]


class Felt:
    """The table as one actor; `placed` takes points (n, 3), m, into the scene."""

    def __init__(self, shape: Shape, placed: Callable[[F64], F64], lamp: F64) -> None:
        made = parts(shape)
        counts = [len(part.points) for part in made]
        points = np.concatenate([part.points for part in made])
        first = np.cumsum([0, *counts[:-1]])
        faces = np.concatenate([part.faces + at for part, at in zip(made, first, strict=True)])
        data = mesh(placed(points), faces)
        attach(data, points / shape.size, "along")
        attach(data, np.concatenate([part.normals for part in made]), "facing")
        attach(data, np.repeat([float(SURFACES.index(part.kind)) for part in made], counts)[:, None], "kind")
        self.actor = shaded(data, ("along", "facing", "kind"), VERTEX, FRAGMENT)
        self._known: Any = self.actor.GetShaderProperty().GetFragmentCustomUniforms()
        self._known.SetUniform3f("lamp", lamp.tolist())
        self._known.SetUniform2f("size", [shape.length / shape.size, shape.width / shape.size])
        for name, css in (
            ("cloth", "cloth"),
            ("wood", "wood"),
            ("liner", "liner"),
            ("sight", "sight"),
            ("mark", "line"),
        ):
            self._known.SetUniform3f(name, linear(COLOURS[css][0]))
        self.bed = placed(
            np.array(
                [(0, 0, 0), (shape.length, 0, 0), (shape.length, shape.width, 0), (0, shape.width, 0)],
                dtype=float,
            )
        )

    def seen_from(self, eye: F64) -> None:
        self._known.SetUniform3f("eye", eye.tolist())
