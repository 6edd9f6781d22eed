// What can be coloured, and how: one choice for the picture, the map and the legend.

const RAMP = ["#30225c", "#3b4e92", "#2e7d96", "#3aa88a", "#9bcb62", "#f4e26b"].map(parse);
const DIVERGING = ["#c01f2e", "#ee8a5f", "#e9e4da", "#6fa8d6", "#1c4f9c"].map(parse);

function parse(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

/// The colour at a share of a ramp.
function blend(ramp, share) {
  const at = Math.min(Math.max(share, 0), 1) * (ramp.length - 1);
  const low = Math.min(Math.floor(at), ramp.length - 2);
  const [a, b] = [ramp[low], ramp[low + 1]];
  return a.map((c, k) => c + (b[k] - c) * (at - low));
}

/// Colours that neighbours tell apart.
function distinct(number) {
  const hue = (25 + number * 137.5) % 360;
  const channel = (n) => {
    const k = (n + hue / 30) % 12;
    return 255 * (0.54 - 0.3 * Math.max(-1, Math.min(k - 3, 9 - k, 1)));
  };
  return [channel(0), channel(8), channel(4)];
}

/// A quantity from −limit to limit, or from the least to the greatest; what lies beyond has the colour
/// of the end.
function scale(values, unit, signed, share) {
  if (!signed) {
    const [low, high] = range(values);
    return { low, high, ramp: RAMP, unit, beyond: false };
  }
  const limit = most(values, share) || 1e-6;
  const [low, high] = range(values);
  return { low: -limit, high: limit, ramp: DIVERGING, unit, beyond: low < -limit || high > limit };
}

const rim = path.travels.map((x, i) => (Number.isNaN(path.heights[i]) ? NaN : path.contacts[3 * i] - x));

/// Each has colours on a scale, or its own for each of some names.
const choices = [];

/// A choice of colours for deviations from the designed surface. What is cut as it should be fills the colours;
/// hollows that no wheel enters would take all of them.
function deviations(id, name, on, values, deepest, median) {
  const scallop = report.verification?.scallop.predicted ?? 0;
  const limit = Math.max(deepest, 1.5 * scallop, 3 * median, 1e-4);
  const [low, high] = range(values);
  const scale = { low: -limit, high: limit, ramp: DIVERGING, unit: "mm", beyond: low < -limit || high > limit };
  choices.push({ id, name, on, values, scale, ends: ["gouge", "excess"] });
}

if (surface.clearances?.length) {
  const { gouge, excess } = report.verification.normal;
  deviations("errors", "gouge and excess of the surface", "surface", surface.clearances, gouge?.depth ?? 0, excess?.median ?? 0);
}
if (machined) {
  const { deepest_gouge: deepest, percentiles } = report.machined;
  deviations("machined", "the surface as machined", "rays", machined.deviations, -(deepest?.deviation ?? 0), percentiles?.median ?? 0);
}
if (!alone) choices.push(
  { id: "height", name: "tool centre", values: path.heights, on: "path", scale: scale(path.heights, "mm", false) },
  { id: "speed", name: "speed of the attack axis", values: path.slopes, on: "path",
    scale: scale(path.slopes, "mm/°", true, 0.998), ends: ["towards the part", "away from it"] },
  { id: "bend", name: "acceleration of the attack axis", values: path.bends, on: "path",
    scale: scale(path.bends, "mm/°²", true, 0.99) },
  { id: "rim", name: "where on the wheel it touches", values: rim, on: "path", scale: scale(rim, "mm", true, 1),
    ends: ["behind", "ahead"] },
);
if (path.extents) {
  const colour = (extent) => distinct(workers.indexOf(extents[extent].worker)).map((c) => c * (extent % 2 ? 0.8 : 1));
  choices.push({ id: "extent", name: "extent and worker", values: path.extents, on: "path", colour, names: workers });
}
if (alone) {
  const names = report.bodies.map(({ name }) => name);
  choices.push({ id: "bodies", name: "bodies of the part", values: part.bodies, on: "part", colour: distinct, names });
}

/// Red, green and blue of a value of a choice.
function colourOf(choice, value) {
  if (choice.colour) return choice.colour(value);
  const { low, high, ramp } = choice.scale;
  return blend(ramp, high > low ? (value - low) / (high - low) : 0.5);
}

/// Red, green, blue and 255 for each value.
function colours(choice) {
  const all = new Uint8Array(choice.values.length * 4);
  choice.values.forEach((value, i) => {
    if (Number.isNaN(value)) return;
    all.set(colourOf(choice, value), 4 * i);
    all[4 * i + 3] = 255;
  });
  return all;
}
