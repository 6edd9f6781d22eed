// The numbers of this page, as they were packed into it. See view.rs and view/pack.rs.

const $ = (selector, within = document) => within.querySelector(selector);

const contents = JSON.parse($("#contents").textContent);
const report = JSON.parse($("#report").textContent);
/// A part alone has no path, and figures of its own.
const alone = !report.path;

/// The numbers of an element, which is emptied: nobody needs them twice.
function unpack(id, kind) {
  const element = document.getElementById(id);
  if (!element) return null;
  const text = atob(element.textContent);
  element.remove();
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new kind(bytes.buffer);
}

/// Points in mm from counts of the box that all lie in.
function points(id) {
  const counts = unpack(id, Uint16Array);
  if (!counts) return null;
  const { low, high } = contents;
  const all = new Float32Array(counts.length);
  for (let i = 0; i < counts.length; i++) {
    const k = i % 3;
    all[i] = low[k] + ((high[k] - low[k]) * counts[i]) / 65535;
  }
  return all;
}

const part = { points: points("vertices"), triangles: unpack("triangles", Uint32Array), edges: points("edges") };
/// The body of each point.
part.bodies = new Uint16Array(part.points.length / 3);
contents.bodies.forEach((first, body) => part.bodies.fill(body, first));
const surface = { points: points("samples"), clearances: unpack("clearances", Float32Array) };

/// The machined surface in cells of travel and angle: how far the designed one is from the spindle, and how far
/// the machined one lies outside of it.
const machined = contents.cells && {
  ...contents.cells,
  radii: Float32Array.from(unpack("radii", Uint16Array), (n) => (contents.radius * n) / 65535),
  deviations: unpack("deviations", Float32Array),
};

/// The deepest gouge of the machined surface, if it is more than what is allowed or, if nothing is said, seen.
const gouged = [report.machined?.deepest_gouge].find((spot) => spot && -spot.deviation > (report.machined.tolerance ?? 0.001));

/// The path: a number of each kind for each position that is shown.
const path = {
  index: unpack("index", Float64Array) ?? new Float64Array(),
  heights: unpack("heights", Float32Array) ?? new Float32Array(),
  contacts: points("contacts") ?? new Float32Array(),
  slopes: unpack("slopes", Float32Array) ?? new Float32Array(),
  bends: unpack("bends", Float32Array) ?? new Float32Array(),
};
path.length = path.index.length;
// Positions from elsewhere have places of their own.
path.angles = unpack("angles", Float64Array) ?? path.index.map((i) => (360 * i) / contents.motion.points_per_revolution);
path.travels = unpack("travels", Float64Array) ?? path.index.map(travel);

/// Travel at a position, mm; between rings it goes from the one to the next on the last move of each.
function travel(index) {
  const { kind, from, step, points_per_revolution: turn } = contents.motion;
  if (kind === "helix") return from + (step * index) / turn;
  const ring = Math.floor(index / turn);
  return from + step * (ring + Math.max(0, index - ring * turn - (turn - 1)));
}

/// The extent of each position, and who digitized it.
const extents = report.extents ?? [];
const workers = [...new Set(extents.map((e) => e.worker))];
path.extents = extents.length ? path.index.map((i) => extentOf(i)) : null;

function extentOf(index) {
  let [low, high] = [0, extents.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (extents[middle].first <= index) low = middle;
    else high = middle;
  }
  return low;
}

/// An angle within one turn.
const around = (angle) => ((angle % 360) + 360) % 360;

/// Least and greatest of numbers, those that are none left out.
function range(numbers) {
  let [low, high] = [Infinity, -Infinity];
  for (const n of numbers) {
    if (n < low) low = n;
    if (n > high) high = n;
  }
  return low <= high ? [low, high] : [0, 0];
}

/// What a share of the sizes of numbers does not exceed.
function most(numbers, share) {
  const sizes = Float32Array.from(numbers, Math.abs).filter((n) => n >= 0).sort();
  return sizes.length ? sizes[Math.ceil(share * (sizes.length - 1))] : 0;
}

const count = new Intl.NumberFormat("en", { maximumFractionDigits: 0 });

/// A number to a few digits, with a true minus sign.
function rough(n, digits = 3) {
  if (!Number.isFinite(n)) return "–";
  const text = n !== 0 && Math.abs(n) < 1e-4 ? n.toExponential(digits - 1) : String(Number(n.toPrecision(digits)));
  return text.replace("-", "−");
}

const fixed = (n, digits) => (Number.isFinite(n) ? n.toFixed(digits).replace("-", "−") : "–");
