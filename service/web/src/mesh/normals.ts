/** Vertex normals for shading: the sum of the adjoining triangles' normals, each as long as twice its area. */
export function vertexNormals(positions: Float32Array, index: Uint32Array): Int8Array<ArrayBuffer> {
  const sums = new Float32Array(positions.length);
  for (let t = 0; t < index.length; t += 3) {
    const a = 3 * (index[t] ?? 0);
    const b = 3 * (index[t + 1] ?? 0);
    const c = 3 * (index[t + 2] ?? 0);
    const ax = positions[a] ?? 0;
    const ay = positions[a + 1] ?? 0;
    const az = positions[a + 2] ?? 0;
    const ux = (positions[b] ?? 0) - ax;
    const uy = (positions[b + 1] ?? 0) - ay;
    const uz = (positions[b + 2] ?? 0) - az;
    const vx = (positions[c] ?? 0) - ax;
    const vy = (positions[c + 1] ?? 0) - ay;
    const vz = (positions[c + 2] ?? 0) - az;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    for (const corner of [a, b, c]) {
      sums[corner] = (sums[corner] ?? 0) + nx;
      sums[corner + 1] = (sums[corner + 1] ?? 0) + ny;
      sums[corner + 2] = (sums[corner + 2] ?? 0) + nz;
    }
  }
  const normals = new Int8Array((positions.length / 3) * 4);
  for (let v = 0; v < positions.length / 3; v++) {
    const x = sums[3 * v] ?? 0;
    const y = sums[3 * v + 1] ?? 0;
    const z = sums[3 * v + 2] ?? 0;
    const scale = 127 / (Math.hypot(x, y, z) || 1);
    normals[4 * v] = Math.round(x * scale);
    normals[4 * v + 1] = Math.round(y * scale);
    normals[4 * v + 2] = Math.round(z * scale);
  }
  return normals;
}
