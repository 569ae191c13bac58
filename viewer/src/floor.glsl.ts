// The floor (cloth of a table, or plain ground with a grid) and the shadows on it.

import { lightChunk } from "./light.glsl";

export const floorVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
out vec3 vPoint;
void main() {
  vPoint = position;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}
`;

export const floorFragment = /* glsl */ `
${lightChunk}
uniform vec3 uU;
uniform vec3 uV;
uniform vec3 uNormal;
uniform vec3 uColour;
uniform vec3 uLine;
uniform vec3 uMiddle;
uniform float uReach;     // half the diagonal of the floor
uniform float uSize;      // a ball's radius
uniform float uGrid;      // spacing of the grid, 0 for cloth
uniform vec4 uEdges[8];   // inward normal and offset; the sum is the distance to the edge
uniform float uWalls[8];  // 1 where a wall stands on the edge
uniform int uEdgeCount;
in vec3 vPoint;
out vec4 colour;

float gridLine(vec2 p, float spacing) {
  vec2 q = p / spacing;
  vec2 w = fwidth(q);
  vec2 d = abs(fract(q - 0.5) - 0.5) / max(w, 1e-6);
  float fade = 1.0 - smoothstep(0.15, 0.5, max(w.x, w.y));
  return (1.0 - min(1.0, min(d.x, d.y))) * fade;
}

void main() {
  vec2 p = vec2(dot(vPoint, uU), dot(vPoint, uV));
  float fade = 1.0;
  float shade = 1.0;
  for (int i = 0; i < 8; i++) {
    if (i >= uEdgeCount) break;
    float d = dot(uEdges[i].xyz, vPoint) + uEdges[i].w;
    if (uWalls[i] > 0.5) shade *= 1.0 - 0.42 * exp(-max(d, 0.0) / (0.9 * uSize));
    else fade *= smoothstep(0.0, 0.28 * uReach, d);
  }
  vec3 c = uColour;
  if (uGrid > 0.0) {
    c = mix(c, uLine, 0.30 * gridLine(p, uGrid) + 0.35 * gridLine(p, 5.0 * uGrid));
  } else {
    // Napped cloth: two scales of mottling, the finer one gone before it could flicker.
    float fine = 1.0 - smoothstep(0.3, 1.2, length(fwidth(p)) / (0.06 * uSize));
    c *= 1.0 + 0.05 * (noise(p / (0.9 * uSize)) - 0.5) + 0.10 * fine * (noise(p / (0.06 * uSize)) - 0.5);
  }
  // A pool of light in the middle.
  float away = length(vPoint - uMiddle) / uReach;
  float pool = mix(1.10, 0.66, smoothstep(0.0, 1.1, away));
  if (uGrid > 0.0) pool = mix(1.04, 0.92, smoothstep(0.0, 1.0, away));
  colour = vec4(display(c * pool * shade * (0.75 + 0.35 * lampLight(uNormal))), fade);
  colour.rgb *= fade;
}
`;

// One quad a ball. Two shadows: the sky a ball takes from the point below it, exact for an open sky, and
// the lamps', soft with height. Black with alpha multiplies what lies under it, in any order.
export const shadowVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uU;
uniform vec3 uV;
uniform vec4 uPlane;      // normal, offset
uniform vec3 uLamp;       // towards the lamps
uniform float uTallest;   // balls higher than this many radii cast none
in vec2 corner;
in vec4 centre;
out vec3 vPoint;
flat out vec3 vFoot;
flat out vec3 vShade;     // foot of the lamps' shadow
flat out vec3 vBall;      // radius, height of the centre, strength
void main() {
  float r = centre.w;
  float h = dot(centre.xyz, uPlane.xyz) - uPlane.w;
  vFoot = centre.xyz - h * uPlane.xyz;
  float fall = dot(uLamp, uPlane.xyz);
  vShade = centre.xyz - uLamp * (h / max(fall, 0.2));
  vBall = vec3(r, h, 1.0 - smoothstep(0.6 * uTallest, uTallest, h / r));
  bool drawn = h > -r && h < uTallest * r;
  float size = drawn ? 2.6 * r + 1.1 * h : 0.0;
  vec3 middle = 0.5 * (vFoot + vShade);
  size += drawn ? 0.5 * length(vFoot - vShade) : 0.0;
  vPoint = middle + size * (uU * corner.x + uV * corner.y);
  gl_Position = projectionMatrix * (viewMatrix * vec4(vPoint, 1.0));
}
`;

export const shadowFragment = /* glsl */ `
precision highp float;
uniform vec4 uEdges[8];
uniform int uEdgeCount;
uniform float uStrength;
in vec3 vPoint;
flat in vec3 vFoot;
flat in vec3 vShade;
flat in vec3 vBall;
out vec4 colour;
void main() {
  for (int i = 0; i < 8; i++) {
    if (i >= uEdgeCount) break;
    if (dot(uEdges[i].xyz, vPoint) + uEdges[i].w < 0.0) discard;
  }
  float r = vBall.x;
  float h = max(vBall.y, 0.6 * r);
  float rho = distance(vPoint, vFoot);
  float sky = h * r * r / pow(h * h + rho * rho, 1.5);
  float soft = 0.55 * max(h - 0.4 * r, 0.2 * r);
  float lamps = 1.0 - smoothstep(r - soft, r + soft, distance(vPoint, vShade));
  lamps *= min(1.0, 1.6 * r / h);
  // Fade to nothing at the quad's border.
  float border = 1.0 - smoothstep(1.6 * r + 0.8 * h, 2.5 * r + 1.05 * h, rho);
  float dark = 1.0 - (1.0 - 0.85 * min(sky, 1.0)) * (1.0 - 0.42 * lamps);
  colour = vec4(0.0, 0.0, 0.0, uStrength * vBall.z * dark * border);
}
`;
