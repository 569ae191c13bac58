// A sphere is one quad that faces the eye; the ball is found on it by casting the ray. The outline is exact
// at any zoom, and six vertices a ball are what software rendering can still carry.
//
// The quad lies in the plane of the circle where the rays just touch the ball, hence inside the ball: whatever
// is in front of the ball is in front of the quad, and likewise behind. As bodies do not overlap, the quad's
// own depth sorts them without error, and nothing hidden need be shaded, which a depth written here would cost.

import { lightChunk } from "./light.glsl";

export const sphereVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 cameraPosition;
in vec2 corner;
in vec4 centre;      // and radius
in vec4 attitude;
in vec4 look;        // colour, kind
in vec2 badge;       // cell in the atlas of numbers, index of the body
out vec3 vPoint;
flat out vec4 vCentre;
flat out vec4 vAttitude;
flat out vec4 vLook;
flat out vec2 vBadge;
void main() {
  vec3 sight = centre.xyz - cameraPosition;
  float distance = length(sight);
  float r = centre.w;
  sight /= distance;
  vec3 cameraUp = vec3(viewMatrix[0][1], viewMatrix[1][1], viewMatrix[2][1]);
  vec3 right = normalize(cross(sight, cameraUp));
  vec3 up = cross(right, sight);
  // Distance and radius of the circle of touch; a little more, for the smoothed rim.
  float ratio = min(r / distance, 0.98);
  float shrink = 1.0 - ratio * ratio;
  float reach = 1.02 * r * sqrt(shrink);
  vPoint = cameraPosition + sight * (distance * shrink) + reach * (right * corner.x + up * corner.y);
  vCentre = centre;
  vAttitude = attitude;
  vLook = look;
  vBadge = badge;
  gl_Position = projectionMatrix * viewMatrix * vec4(vPoint, 1.0);
}
`;

export const sphereFragment = /* glsl */ `
${lightChunk}
uniform sampler2D uNumbers;
uniform float uAtlas;        // cells along a side of the atlas
uniform float uSelected;     // index of the selected body, or -1
uniform vec4 uGround;        // plane the balls lie on: normal, offset
uniform vec3 uGroundColour;
uniform vec3 uAccent;
uniform float uCoarse;       // 1: a crowd in motion on a slow machine, without mirror images
uniform float uSolid;        // share of the samples of a pixel that a ball covers
in vec3 vPoint;
flat in vec4 vCentre;
flat in vec4 vAttitude;
flat in vec4 vLook;
flat in vec2 vBadge;
out vec4 colour;

vec3 unturn(vec4 q, vec3 v) {  // into the ball's own axes
  vec3 t = 2.0 * cross(v, q.xyz);
  return v + q.w * t + cross(t, q.xyz);
}

// 1 where x > edge, with an edge one pixel wide.
float above(float edge, float x, float width) { return clamp((x - edge) / width + 0.5, 0.0, 1.0); }

const vec3 IVORY = vec3(0.90, 0.86, 0.76);
const vec3 AXIS = vec3(0.0, -0.62, 0.7846);  // the numbers' axis: towards the viewer at the start

vec3 pattern(vec3 n, float width) {
  int kind = int(vLook.w + 0.5);
  vec3 base = vLook.rgb;
  // b: along the badge's axis; u, v: the two others.
  vec3 v3 = vec3(0.0, 0.7846, 0.62);
  float b = dot(n, AXIS);
  float u = n.x;
  float v = dot(n, v3);
  float w = max(width, 1e-4);
  if (kind == 4) {
    // Grain: eight octants in two tones, and a light cap, so that each attitude looks different.
    vec3 s = clamp(n / w, -1.0, 1.0);
    vec3 c = base * (1.0 + 0.34 * s.x * s.y * s.z);
    return mix(c, IVORY, 0.85 * above(0.93, n.z, w * 0.6));
  }
  float spot = max(max(abs(u), abs(v)), 0.0);
  if (kind == 0 || kind == 3) {
    // Twelve dots, at the corners of an icosahedron: three or four are always in view. Red on the cue ball, ivory on others.
    vec3 a = abs(n);
    float near = max(max(a.y + 1.618 * a.z, a.z + 1.618 * a.x), a.x + 1.618 * a.y) / 1.902;
    float dots = above(0.979, near, 0.3 * w);
    return kind == 0 ? mix(IVORY, vec3(0.62, 0.03, 0.035), dots) : mix(base, IVORY, dots);
  }
  vec3 ground = base;
  if (kind == 2) ground = mix(IVORY, base, above(-0.56, -abs(v), w));
  // Small dots on the axes where no number is, so that spin about the numbers' axis shows as well.
  vec3 dot4 = kind == 2 ? mix(base, IVORY, above(-0.56, -abs(v), w)) : IVORY;
  ground = mix(ground, dot4, above(0.982, spot, 0.3 * w));
  float disc = above(0.86, abs(b), 0.55 * w);
  ground = mix(ground, IVORY, disc);
  if (disc > 0.0) {
    // Right way round on both sides: seen from outside, v is up and u to the right (or left, behind).
    vec2 p = vec2(b > 0.0 ? u : -u, v) / 0.80 + 0.5;
    vec2 cell = vec2(mod(vBadge.x, uAtlas), floor(vBadge.x / uAtlas));
    float ink = texture(uNumbers, (cell + clamp(p, 0.02, 0.98)) / uAtlas).r;
    ground = mix(ground, vec3(0.02), ink * disc);
  }
  return ground;
}

void main() {
  vec3 centre = vCentre.xyz;
  float r = vCentre.w;
  vec3 ray = normalize(vPoint - cameraPosition);
  vec3 from = cameraPosition - centre;
  float along = dot(from, ray);
  vec3 nearest = from - along * ray;
  float miss = length(nearest);
  float pixel = fwidth(miss);
  float cover = clamp((r - miss) / pixel + 0.5, 0.0, 1.0);
  float depth = sqrt(max(r * r - dot(nearest, nearest), 0.0));
  vec3 offset = nearest - depth * ray;
  vec3 n = offset / max(length(offset), 1e-9);
  vec3 own = unturn(vAttitude, n);
  if (uCoarse > 0.5) {
    if (cover <= 0.0) discard;
    vec3 octant = step(0.0, own) * 2.0 - 1.0;
    vec3 plain = vLook.rgb * (1.0 + 0.34 * octant.x * octant.y * octant.z);
    if (abs(vBadge.y - uSelected) < 0.5) plain = uAccent;
    float shine = lampLight(n);
    plain *= 0.2 + 0.36 * (0.6 + 0.4 * dot(n, uUp)) * (0.6 + 0.4 * uDay) + 0.75 * shine;
    colour = vec4(sqrt(min(plain, 1.0)), cover * uSolid);
    return;
  }
  // Size of a pixel on the ball's surface, from geometry: derivatives of a cast point break at the rim.
  float width = 1.2 * pixel / (r * max(dot(n, -ray), 0.15));
  vec3 albedo = pattern(own, width);
  if (cover <= 0.0) discard;

  vec3 hit = centre + offset;
  // Height over the ground in radii, for the dark side near the point of contact.
  float height = max(0.0, (dot(hit, uGround.xyz) - uGround.w) / r);
  float open = mix(0.25, 1.0, smoothstep(0.0, 1.6, height + 0.5 * max(0.0, dot(n, uUp))));
  vec3 bounce = uGroundColour * mix(0.16, 0.5, smoothstep(0.0, 2.0, height));
  vec3 light = skyLight(n, bounce) * open + vec3(1.0, 0.96, 0.88) * 0.78 * lampLight(n);
  vec3 c = albedo * light;

  vec3 mirror = reflect(ray, n);
  float facing = max(dot(n, -ray), 0.0);
  float fresnel = 0.04 + 0.32 * pow(1.0 - facing, 4.0);
  vec3 room = mix(uGroundColour * 0.35, mix(vec3(0.05, 0.055, 0.07), vec3(0.36, 0.38, 0.42), uDay), smoothstep(-0.1, 0.35, dot(mirror, uUp)));
  c += fresnel * open * room * 0.8 + (0.07 + fresnel) * 6.5 * lampMirror(mirror, 0.06 + 3.0 * pixel / r);

  if (abs(vBadge.y - uSelected) < 0.5) {
    c = mix(c, uAccent, 0.9 * smoothstep(0.45, 0.28, facing) );
  }
  colour = vec4(display(c), cover * uSolid);
}
`;
