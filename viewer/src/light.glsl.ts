// Light and colour shared by every surface: one row of lamps over the scene, as over a billiard table.

export const lightChunk = /* glsl */ `
precision highp float;
uniform vec3 cameraPosition;
uniform vec3 uUp;        // against gravity
uniform vec3 uAcross;    // the row of lamps runs along this
uniform float uDay;      // 1 in the light theme, 0 in the dark one

vec3 alongLamps() { return cross(uUp, uAcross); }

// The sky a surface with normal n sees: bright above, the bounce of the ground below.
vec3 skyLight(vec3 n, vec3 bounce) {
  vec3 above = mix(vec3(0.30, 0.33, 0.40), vec3(0.52, 0.55, 0.60), uDay);
  return mix(bounce, above, 0.5 + 0.5 * dot(n, uUp));
}

// Direct light: the lamps hang a little behind the viewer's left shoulder, and are wide, so it wraps.
vec3 lampDirection() { return normalize(uUp + 0.22 * alongLamps() - 0.30 * uAcross); }
float lampLight(vec3 n) {
  float c = dot(n, lampDirection());
  return max(0.0, (c + 0.18) / 1.18);
}

// Three soft rectangles mirrored in whatever is polished.
float lampMirror(vec3 ray, float blur) {
  float height = dot(ray, uUp);
  if (height <= 0.02) return 0.0;
  vec2 p = vec2(dot(ray, uAcross), dot(ray, alongLamps())) / height;
  p.y -= 0.25;
  p.x = abs(p.x + 0.3);
  p.x = min(p.x, abs(p.x - 0.85));
  vec2 inside = smoothstep(vec2(0.34, 0.24) + blur, vec2(0.34, 0.24) - blur, abs(p));
  return inside.x * inside.y;
}

// Soft shoulder, then sRGB.
vec3 display(vec3 c) {
  c = c / (1.0 + 0.18 * max(c, 0.0)) * 1.12;
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

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
`;
