// Walls that have an end, a curve or a motion: glass with lines where balls live inside, solid where they live outside.

import { lightChunk } from "./light.glsl";

export const wallVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uFrom;   // the wall's point at the start and now
uniform vec3 uTo;
uniform vec4 uTurn;   // rotation since the start
in vec3 position;
in vec3 normal;
in vec4 mesh;         // two coordinates that are whole on lines; distances to the two ends in units of the line width's scale
out vec3 vPoint;
out vec3 vNormal;
out vec4 vMesh;
vec3 turned(vec3 v) {
  vec3 t = 2.0 * cross(uTurn.xyz, v);
  return v + uTurn.w * t + cross(uTurn.xyz, t);
}
void main() {
  vPoint = uTo + turned(position - uFrom);
  vNormal = turned(normal);
  vMesh = mesh;
  gl_Position = projectionMatrix * (viewMatrix * vec4(vPoint, 1.0));
}
`;

const lines = /* glsl */ `
float meshLines(vec2 p) {
  vec2 w = fwidth(p);
  vec2 d = abs(fract(p - 0.5) - 0.5) / max(w, 1e-6);
  vec2 on = (1.0 - min(d, vec2(1.0))) * (1.0 - smoothstep(0.2, 0.6, w));
  return max(on.x, on.y);
}
float edgeLine(vec2 d) {
  vec2 w = max(fwidth(d), 1e-9);
  vec2 on = 1.0 - smoothstep(0.8 * w, 2.0 * w, d);
  return max(on.x, on.y);
}
`;

/** The face that balls touch, behind the balls. */
export const glassFragment = /* glsl */ `
${lightChunk}
uniform vec3 uLine;
uniform vec3 uFloor;
uniform float uFill;
in vec3 vPoint;
in vec3 vNormal;
in vec4 vMesh;
out vec4 colour;
${lines}
void main() {
  vec3 n = normalize(vNormal);
  float carries = smoothstep(0.25, 0.8, dot(n, uUp));   // what balls lie on looks like a floor
  vec3 ray = normalize(vPoint - cameraPosition);
  float graze = pow(1.0 - abs(dot(n, ray)), 3.0);
  float light = 0.72 + 0.36 * lampLight(n);
  vec3 c = mix(uLine, display(uFloor * light), carries);
  float line = max(0.30 * meshLines(vMesh.xy), 0.75 * edgeLine(vMesh.zw));
  float fill = mix(uFill * (1.6 + 2.0 * graze), 0.82, carries);
  colour = vec4(mix(c, uLine, line * carries), max(fill, line));
}
`;

/** The same wall seen from its back: no more than its edges, over the balls. */
export const outlineFragment = /* glsl */ `
precision highp float;
uniform vec3 uLine;
in vec3 vPoint;
in vec3 vNormal;
in vec4 vMesh;
out vec4 colour;
${lines}
void main() {
  float line = max(0.12 * meshLines(vMesh.xy), 0.7 * edgeLine(vMesh.zw));
  if (line < 0.01) discard;
  colour = vec4(pow(uLine, vec3(1.0 / 2.2)), line); // as the theme has it, or it is lost in the dark
}
`;

/** A body that balls touch from outside. */
export const solidFragment = /* glsl */ `
${lightChunk}
uniform vec3 uRim;
uniform vec3 uFloor;
in vec3 vPoint;
in vec3 vNormal;
in vec4 vMesh;
out vec4 colour;
${lines}
void main() {
  vec3 n = normalize(vNormal);
  vec3 ray = normalize(vPoint - cameraPosition);
  if (dot(n, ray) > 0.0) n = -n;
  vec3 light = skyLight(n, uFloor * 0.35) + vec3(1.0, 0.96, 0.88) * 0.75 * lampLight(n);
  vec3 c = uRim * light * (1.0 - 0.35 * max(0.5 * meshLines(vMesh.xy), edgeLine(vMesh.zw)));
  float fresnel = 0.03 + 0.4 * pow(1.0 - max(dot(n, -ray), 0.0), 5.0);
  c += fresnel * (0.2 + 1.2 * lampMirror(reflect(ray, n), 0.3));
  colour = vec4(display(c), 1.0);
}
`;
