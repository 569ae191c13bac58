// A table of the billiards kit: its triangles come with the page (carom/scene/billiards/shape.py), light and grain from here.

import { BufferAttribute, BufferGeometry, Color, DoubleSide, GLSL3, Mesh, NoBlending, RawShaderMaterial, Vector2, Vector3, type IUniform } from "three";
import type { Run, Vec } from "./run";
import type { Mesh as Triangles } from "./run";
import { tableFragment, tableVertex } from "./table.glsl";
import type { Shades } from "./theme";

type Facts = NonNullable<Run["facts"]["table"]>;
type Part = keyof Run["facts"]["colours"];
export type TableColours = Record<Part, string>;

/** Numbers of the kinds in the shader. */
const KINDS = ["line", "cushion", "wood", "sight", "liner", "hole"];

export function tableColours(run: Run, shades: Shades): TableColours {
  const entries = Object.entries(run.facts.colours).map(([part, of]) => [part, of[shades.day ? 0 : 1]]);
  return Object.fromEntries(entries) as TableColours;
}

export class KitTable {
  readonly mesh: Mesh;
  /** The bed, which is drawn as floors are. */
  readonly cloth: BufferGeometry;
  private readonly colours = {
    cloth: { value: new Color() },
    wood: { value: new Color() },
    liner: { value: new Color() },
    sight: { value: new Color() },
    line: { value: new Color() },
  };

  constructor(triangles: Triangles, facts: Facts, origin: Vec, shared: Record<string, IUniform>) {
    const { position, normal, kind, index } = triangles;
    const of = (wanted: (name: string) => boolean) => {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(position, 3));
      geometry.setAttribute("normal", new BufferAttribute(normal, 3));
      geometry.setAttribute("kind", new BufferAttribute(kind.map((k) => KINDS.indexOf(facts.kinds[k])), 1));
      geometry.setIndex(index.filter((_, i) => wanted(facts.kinds[kind[index[i - (i % 3)]]])));
      return geometry;
    };
    this.cloth = of((name) => name === "cloth");
    const { cloth, wood, liner, sight, line } = this.colours;
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: tableVertex,
      fragmentShader: tableFragment,
      side: DoubleSide,
      transparent: true, // see spheres.ts
      blending: NoBlending,
      uniforms: {
        ...shared,
        uCorner: { value: new Vector3(...origin).negate() },
        uTable: { value: new Vector2(...facts.size) },
        uSize: { value: facts.radius },
        uCloth: cloth,
        uWood: wood,
        uLiner: liner,
        uSight: sight,
        uMark: line,
      },
    });
    this.mesh = new Mesh(of((name) => name !== "cloth"), material);
    this.mesh.renderOrder = 2;
    this.mesh.frustumCulled = false;
  }

  paint(colours: TableColours): void {
    for (const part of Object.keys(this.colours) as Part[]) this.colours[part].value.set(colours[part]);
  }
}
