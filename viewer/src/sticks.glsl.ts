// Arrows and rods: a prism with or without a cone on it, stretched in the vertex shader from its tail to its tip.

import { lightChunk } from "./light.glsl";

export const stickVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 cameraPosition;
uniform float uPixel;     // size of a pixel at distance one
in vec3 corner;           // cosine and sine around the axis, part (see sticks.ts)
in vec4 tail;             // and radius of the shaft
in vec4 tip;              // and 1 for an arrow, 0 for a rod
in vec3 tint;
out vec3 vNormal;
out vec3 vPoint;
flat out vec3 vTint;
void main() {
  vec3 axis = tip.xyz - tail.xyz;
  float whole = length(axis);
  axis /= max(whole, 1e-30);
  float r = max(tail.w, 1.1 * uPixel * distance(cameraPosition, 0.5 * (tail.xyz + tip.xyz)));
  bool arrow = tip.w > 0.5;
  if (arrow) r = min(r, 0.1 * whole);
  float wide = arrow ? 2.6 * r : r;
  float head = arrow ? min(6.5 * r, 0.75 * whole) : 0.0;
  vec3 u = normalize(abs(axis.x) < 0.7 ? cross(axis, vec3(1.0, 0.0, 0.0)) : cross(axis, vec3(0.0, 1.0, 0.0)));
  vec3 out_ = corner.x * u + corner.y * cross(axis, u);
  int part = int(corner.z + 0.5);
  float along = part < 2 ? 0.0 : part == 5 ? whole : whole - head;
  float reach = part < 3 ? r : part == 5 ? 0.0 : wide;
  bool back = part == 0 || part == 3;
  vNormal = back ? -axis : part < 3 ? out_ : normalize(out_ * max(head, 1e-6 * r) + axis * wide);
  vPoint = tail.xyz + along * axis + reach * out_;
  vTint = tint;
  gl_Position = projectionMatrix * (viewMatrix * vec4(vPoint, 1.0));
}
`;

export const stickFragment = /* glsl */ `
${lightChunk}
in vec3 vNormal;
in vec3 vPoint;
flat in vec3 vTint;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  vec3 light = 0.55 + 0.5 * skyLight(n, vec3(0.2)) + vec3(0.5 * lampLight(n));
  vec3 c = vTint * light;
  // Darker where it turns away: an outline that sets it off from whatever is behind.
  c *= mix(0.55, 1.0, smoothstep(0.0, 0.55, abs(dot(n, normalize(cameraPosition - vPoint)))));
  colour = vec4(display(c), 1.0);
}
`;
