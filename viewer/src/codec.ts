// Reads what carom/show/viewer/codec.py wrote: prediction errors, folded to unsigned, in byte planes.

export interface Packed {
  offset: number;
  bytes: number;
  shape: [frames: number, bodies: number, components: number];
  order: number;
  planes: number;
  step?: number;
  origin?: [number, number, number];
}

/** Base64 text, then gzip; both by the browser, so that nothing is fetched. */
export async function unpack(base64: string): Promise<Uint8Array<ArrayBuffer>> {
  const bytes = fromBase64(base64.trim());
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function fromBase64(text: string): Uint8Array<ArrayBuffer> {
  const native = (Uint8Array as unknown as { fromBase64?: (t: string) => Uint8Array<ArrayBuffer> }).fromBase64;
  if (native) return native.call(Uint8Array, text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** Decodes into `out` (frame, body, component); narrow arrays simply drop the high bits. */
export function decode<T extends Int32Array | Int16Array>(data: Uint8Array, entry: Packed, out: T): T {
  const [frames, bodies, components] = entry.shape;
  const size = frames * bodies * components;
  const planes = Array.from({ length: entry.planes }, (_, k) =>
    data.subarray(entry.offset + k * size, entry.offset + (k + 1) * size),
  );
  for (let c = 0, i = 0; c < components; c++) {
    for (let n = 0; n < bodies; n++) {
      let value = 0;
      let change = 0;
      for (let t = 0; t < frames; t++, i++) {
        let folded = 0;
        for (let k = 0; k < planes.length; k++) folded |= planes[k][i] << (8 * k);
        const residual = (folded >>> 1) ^ -(folded & 1);
        if (entry.order === 2) {
          change = (change + residual) | 0;
          value = (value + change) | 0;
        } else {
          value = entry.order === 1 ? (value + residual) | 0 : residual;
        }
        out[(t * bodies + n) * components + c] = value;
      }
    }
  }
  return out;
}
