// Shapes as triangles with a normal at each corner.

/// Normals of corners, from the triangles around each.
function normals(points, triangles) {
  const all = new Float32Array(points.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * triangles[t + k]);
    const [ux, uy, uz] = [0, 1, 2].map((k) => points[b + k] - points[a + k]);
    const [vx, vy, vz] = [0, 1, 2].map((k) => points[c + k] - points[a + k]);
    const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const corner of [a, b, c]) {
      for (let k = 0; k < 3; k++) all[corner + k] += normal[k];
    }
  }
  return all;
}

/// A body of revolution about X through the origin, from its profile; each piece of the profile is
/// smooth and ends in an edge.
function revolved(pieces, sectors = 96) {
  const all = [];
  const triangles = [];
  for (const piece of pieces) {
    const first = all.length / 3;
    for (const [d, m] of piece) {
      for (let k = 0; k < sectors; k++) {
        const angle = (2 * Math.PI * k) / sectors;
        all.push(d, m * Math.cos(angle), m * Math.sin(angle));
      }
    }
    for (let i = 0; i + 1 < piece.length; i++) {
      for (let k = 0; k < sectors; k++) {
        const [a, b] = [k, (k + 1) % sectors].map((s) => first + i * sectors + s);
        triangles.push(a, b, a + sectors, b, b + sectors, a + sectors);
      }
    }
  }
  return { points: Float32Array.from(all), triangles: Uint32Array.from(triangles) };
}

/// The wheel, with its sides.
function wheel(profile) {
  const [first, last] = [profile[0], profile[profile.length - 1]];
  return revolved([[[first[0], 0], first], profile, [last, [last[0], 0]]]);
}

/// The points of the path about the part: contacts as they are, and tool centres as the part sees them.
function centres() {
  const all = new Float32Array(3 * path.length);
  for (let i = 0; i < path.length; i++) {
    const angle = around(path.angles[i]) * (Math.PI / 180);
    all[3 * i] = path.travels[i];
    all[3 * i + 1] = path.heights[i] * Math.cos(angle);
    all[3 * i + 2] = -path.heights[i] * Math.sin(angle);
  }
  return all;
}

/// The designed surface where the rays end: a point for each cell, joined to those beside it where the machined one
/// is known.
function shell({ rows, columns, first, step, radii, deviations }) {
  const points = new Float32Array(3 * radii.length);
  radii.forEach((radius, i) => {
    const angle = (first[1] + step[1] * (i % columns)) * (Math.PI / 180);
    points.set([first[0] + step[0] * Math.floor(i / columns), radius * Math.cos(angle), -radius * Math.sin(angle)], 3 * i);
  });
  const triangles = new Uint32Array(6 * (rows - 1) * columns);
  let count = 0;
  const known = (corner) => !Number.isNaN(deviations[corner]);
  for (let a = 0; a < (rows - 1) * columns; a++) {
    const b = a - (a % columns) + ((a + 1) % columns);
    const [c, d] = [a + columns, b + columns];
    if (!(known(a) && known(b) && known(c) && known(d))) continue;
    triangles.set([a, b, c, b, d, c], count);
    count += 6;
  }
  return { points, triangles: triangles.subarray(0, count) };
}

/// The order in which positions are joined, interrupted where nothing is touched.
function strip() {
  const order = [];
  for (let i = 0; i < path.length; i++) order.push(Number.isNaN(path.heights[i]) ? 0xffffffff : i);
  return Uint32Array.from(order);
}
