// Rails, cushions, pockets and sights of a table of the billiards kit, and the lines on its cloth.

import { lightChunk } from "./light.glsl";

export const tableVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 uCorner;
in vec3 position;
in vec3 normal;
in float kind;
out vec3 vPoint;
out vec3 vNormal;
out vec3 vAt;         // in the frame of the table
flat out float vKind;
void main() {
  vPoint = position;
  vNormal = normal;
  vAt = position - uCorner;
  vKind = kind;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}
`;

export const tableFragment = /* glsl */ `
${lightChunk}
uniform vec2 uTable;  // length, width
uniform float uSize;  // a ball's radius
uniform vec3 uCloth;
uniform vec3 uWood;
uniform vec3 uLiner;
uniform vec3 uSight;
uniform vec3 uMark;
in vec3 vPoint;
in vec3 vNormal;
in vec3 vAt;
flat in float vKind;
out vec4 colour;
void main() {
  int kind = int(vKind + 0.5);  // line, cushion, wood, sight, liner, hole
  vec3 n = normalize(vNormal);
  vec3 ray = normalize(vPoint - cameraPosition);
  vec3 at = vAt / uSize;
  if (kind == 0) {
    float pool = mix(1.10, 0.66, smoothstep(0.0, 1.1, 2.0 * length(vAt.xy - 0.5 * uTable) / length(uTable)));
    colour = vec4(display(mix(uCloth, uMark, 0.75) * pool * (0.75 + 0.35 * lampLight(n))), 1.0);
    return;
  }
  vec3 c = uCloth;
  float gloss = 0.0;
  float open = 1.0;     // share of the light that gets there
  if (kind == 1) {
    float fine = 1.0 - smoothstep(0.3, 1.2, length(fwidth(at)) / 0.06);
    c *= 0.97 + 0.06 * fine * (noise(at.xy / 0.06) - 0.5);
    open = mix(0.45, 1.0, smoothstep(0.0, 1.1, at.z));
  } else if (kind == 2) {
    vec2 out2 = max(-vAt.xy, vAt.xy - uTable);  // past the noses, of the short rails and of the long ones
    bool across = out2.x > out2.y;
    vec2 g = (across ? vec2(vAt.y, out2.x) : vec2(vAt.x, out2.y)) / uSize + (across ? 31.7 : 0.0);
    float grain = noise(g / vec2(3.0, 0.10)) + 0.5 * noise(g / vec2(1.0, 0.04));
    c = uWood * (0.80 + 0.28 * grain);
    c *= 1.0 - 0.35 * exp(-abs(out2.x - out2.y) / (0.025 * uSize)) * step(0.0, min(out2.x, out2.y));
    gloss = 1.0;
    open = mix(0.55, 1.0, smoothstep(-3.0, 0.5, at.z));
  } else if (kind == 3) {
    c = uSight;
    gloss = 0.8;
  } else {
    c = uLiner;
    gloss = kind == 4 ? 0.7 : 0.0;
    // Down in a pocket it is dark.
    open = kind == 4 ? smoothstep(-0.4, 1.3, at.z) : 0.42 * exp(1.1 * min(at.z, 0.0));
  }
  vec3 light = skyLight(n, uCloth * 0.35) * open + vec3(1.0, 0.96, 0.88) * 0.75 * lampLight(n) * open * open;
  vec3 lit = c * light * (kind == 1 ? 0.85 : 1.0);
  float fresnel = 0.03 + 0.5 * pow(1.0 - max(dot(n, -ray), 0.0), 5.0);
  lit += gloss * open * fresnel * (0.25 + 1.4 * lampMirror(reflect(ray, n), 0.3));
  colour = vec4(display(lit), 1.0);
}
`;
