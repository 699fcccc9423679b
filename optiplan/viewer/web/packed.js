"use strict";
// Arrays as Python packs them: base64 of little-endian numbers.
const OptiPlanPacked = (() => {
  function bytes(text) {
    const raw = atob(text), out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }
  return {
    floats: (text) => new Float32Array(bytes(text)),
    doubles: (text) => new Float64Array(bytes(text)),
    // Vertices of a mesh, m: low + step times whole numbers of two bytes.
    vertices: ({ vertices, low, step }) => Float32Array.from(new Uint16Array(bytes(vertices)), (k, i) => low[i % 3] + step * k),
    // Indices of triangles: two bytes each where that is enough.
    indices: ({ faces, wide }) => (wide ? new Uint32Array(bytes(faces)) : new Uint16Array(bytes(faces))),
  };
})();
