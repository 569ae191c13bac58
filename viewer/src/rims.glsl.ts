// Rims (cushion and wooden rail of a table, or the edge of a tray) and glazed walls.

import { lightChunk } from "./light.glsl";

export const rimVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec3 normal;
in vec4 strip;    // metres along the edge, its length, distance out from the wall, material
out vec3 vPoint;
out vec3 vNormal;
out vec4 vStrip;
void main() {
  vPoint = position;
  vNormal = normal;
  vStrip = strip;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}
`;

export const rimFragment = /* glsl */ `
${lightChunk}
uniform vec3 uCloth;
uniform vec3 uWood;
uniform float uSize;
uniform float uSights;    // distance out of the diamonds, 0 for none
in vec3 vPoint;
in vec3 vNormal;
in vec4 vStrip;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  vec3 ray = normalize(vPoint - cameraPosition);
  bool wood = vStrip.w > 0.5;
  vec3 c = wood ? uWood : uCloth;
  float gloss = 0.0;
  if (wood && uSights > 0.0) {
    float s = vStrip.x;
    float grain = noise(vec2(s / (3.0 * uSize), vStrip.z / (0.10 * uSize))) + 0.5 * noise(vec2(s / uSize, vStrip.z / (0.04 * uSize)));
    c *= 0.80 + 0.28 * grain;
    gloss = 1.0;
    if (dot(n, uUp) > 0.9) {
      // Diamonds: eighths of a long rail, quarters of a short one.
      float step = vStrip.y / (vStrip.y > 60.0 * uSize ? 8.0 : 4.0);
      float k = floor(s / step + 0.5);
      if (k > 0.5 && k < vStrip.y / step - 0.5) {
        vec2 q = abs(vec2(s - k * step, vStrip.z - uSights)) / (0.42 * uSize);
        float d = q.x + 1.5 * q.y;
        float w = fwidth(d);
        c = mix(c, vec3(0.86, 0.83, 0.74), 1.0 - smoothstep(1.0 - w, 1.0 + w, d));
      }
    }
  }
  vec3 light = skyLight(n, uCloth * 0.35) + vec3(1.0, 0.96, 0.88) * 0.75 * lampLight(n);
  vec3 lit = c * light * (wood ? 1.0 : 0.85);
  float fresnel = 0.03 + 0.5 * pow(1.0 - max(dot(n, -ray), 0.0), 5.0);
  lit += gloss * fresnel * (0.25 + 1.4 * lampMirror(reflect(ray, n), 0.3));
  colour = vec4(display(lit), 1.0);
}
`;

export const paneFragment = /* glsl */ `
precision highp float;
uniform vec3 uLine;
uniform float uFill;
uniform float uSize;
uniform vec4 uEdges[8];
uniform int uEdgeCount;
in vec3 vPoint;
out vec4 colour;
void main() {
  float d = 1e30;
  for (int i = 0; i < 8; i++) {
    if (i >= uEdgeCount) break;
    d = min(d, dot(uEdges[i].xyz, vPoint) + uEdges[i].w);
  }
  float w = fwidth(d);
  float line = 1.0 - smoothstep(w, 2.0 * w, d);
  float glow = 0.6 * exp(-d / (2.0 * uSize));
  colour = vec4(uLine, uFill * (1.0 + glow) + 0.45 * line);
}
`;
