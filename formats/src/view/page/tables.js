// The figures of report.json as tables. Nothing is built from text: names and reasons are set as text.

/// An element with a class and a text or children.
function make(tag, kind, ...content) {
  const element = document.createElement(tag);
  if (kind) element.className = kind;
  element.append(...content);
  return element;
}

/// A table under a title: names of columns, and rows of cells, the first of which names the row.
function table(title, columns, rows, kind = "") {
  // Words go to the left, numbers to the right, and so do their headings.
  const words = columns.map((_, i) => rows.every((row) => /[a-z]{3}/i.test(row[i])));
  const head = make("tr", "", ...columns.map((name, i) => heading(name, "col", i && !words[i] ? "number" : "")));
  const body = rows.map(([name, ...cells]) => {
    const all = cells.map((cell, i) => make("td", words[i + 1] ? "" : "number", cell ?? "–"));
    return make("tr", "", heading(name, "row"), ...all);
  });
  const shown = columns.length ? [make("thead", "", head)] : [];
  const whole = make("table", "", ...shown, make("tbody", "", ...body));
  whole.ariaLabel = title;
  const scroll = make("div", "scroll", whole);
  scroll.tabIndex = 0;
  scroll.role = "region";
  scroll.ariaLabel = title;
  return make("article", kind || (columns.length ? "" : "pairs"), make("h3", "", title), scroll);
}

function heading(text, scope, kind = "") {
  const cell = make("th", kind, text);
  cell.scope = scope;
  return cell;
}

const mm = (n, digits = 3) => (n === null || n === undefined ? "–" : `${fixed(n, digits)} mm`);
const seconds = (n) => (n === null || n === undefined ? "–" : `${n < 10 ? fixed(n, 3) : fixed(n, 1)} s`);
const whole = (n) => (n === null || n === undefined ? "–" : count.format(n));

function bytes(n) {
  const units = ["B", "kB", "MB", "GB"];
  let unit = 0;
  for (; n >= 999.5 && unit < units.length - 1; unit++) n /= 1000;
  return `${unit ? rough(n) : n} ${units[unit]}`;
}

function pathTable({ positions, inserted, beyond_tolerance, without_contact, lowest, highest }) {
  return table("Path", [], [
    ["positions", whole(positions)],
    ["of these inserted", whole(inserted)],
    ["without contact", whole(without_contact)],
    ["lowest tool centre", mm(lowest)],
    ["highest tool centre", mm(highest)],
    ["moves too short to insert into", whole(beyond_tolerance)],
  ]);
}

function deviationTable({ normal, attack }) {
  const row = (name, of) => [name, of(normal), of(attack)];
  const where = (gouge) => (gouge ? `${fixed(gouge.x, 2)} mm, ${fixed(around(gouge.angle), 1)}°` : "–");
  const depth = (gouge) => (gouge ? mm(gouge.depth, 4) : "none");
  return table("Held against the designed surface", ["", "along the normal", "along the attack axis"], [
    row("deepest gouge", (d) => depth(d.gouge)),
    row("at", (d) => where(d.gouge)),
    row("deepest gouge on a straight move", (d) => depth(d.motion_gouge)),
    row("at", (d) => where(d.motion_gouge)),
    row("excess, half of the surface within", (d) => mm(d.excess?.median, 4)),
    row("excess, 99 % within", (d) => mm(d.excess?.p99, 4)),
    row("largest excess", (d) => mm(d.excess?.max, 4)),
  ], "broad");
}

function machinedTable({ rays, compared, spacing, columns, deepest_gouge, largest_excess, percentiles, tolerance, within_tolerance }) {
  const spot = (s) => (s ? `${mm(Math.abs(s.deviation), 4)} at ${fixed(s.x, 2)} mm, ${fixed(s.angle, 1)}°` : "none");
  const ranks = percentiles ? Object.entries(percentiles) : [];
  return table("The surface as machined", [], [
    [`deepest below the designed surface${gouged ? ", ringed in the picture" : ""}`, spot(deepest_gouge)],
    ["most above it", spot(largest_excess)],
    ...ranks.map(([name, value]) => [name === "median" ? "median" : `${name.slice(1)} % are not above`, mm(value, 4)]),
    ...(within_tolerance === null ? [] : [[`within ${rough(tolerance)} mm`, percent(within_tolerance)]]),
    ["rays that meet both", whole(compared)],
    ["rays in all", whole(rays)],
    ["rays around the spindle", whole(columns)],
    ["from ray to ray along it", mm(spacing)],
  ]);
}

function samplesTable({ samples, spacing, positions, moves, never_reached, scallop }) {
  return table("How it was verified", [], [
    ["samples of the surface", whole(samples)],
    ["distance between them", mm(spacing)],
    ["positions", whole(positions)],
    ["straight moves", whole(moves)],
    ["never reached along the axis", percent(never_reached)],
    ["scallop, as predicted", mm(scallop.predicted, 4)],
    ["scallop, as found", mm(scallop.measured, 4)],
  ]);
}

function bodiesTable(bodies) {
  const rows = bodies.map((b) => [b.name, whole(b.rows), whole(b.points), whole(b.facets),
    `${fixed(b.x[0], 1)} to ${fixed(b.x[1], 1)}`, mm(b.deviation, 4)]);
  return table("Part", ["body", "rows", "points", "facets", "travel, mm", "facets off by"], rows, "broad");
}

function phasesTable(phases) {
  const total = phases.reduce((sum, p) => sum + p.seconds, 0);
  return table("Time", [], [...phases.map((p) => [p.name, seconds(p.seconds)]), ["together", seconds(total)]]);
}

function extentsTable(all) {
  const rows = all.map((e) => [`${e.extent}`, e.worker, whole(e.positions), whole(e.rows), whole(e.halo_rows),
    bytes(e.bytes_sent), bytes(e.bytes_fetched), bytes(e.bytes_received), seconds(e.seconds), seconds(e.digitize_seconds), `${e.attempt}`]);
  const columns = ["extent", "by", "positions", "rows", "halo", "sent", "fetched", "received", "time", "digitized", "attempt"];
  return table("Extents", columns, rows, "broad");
}

function attemptsTable(title, attempts) {
  const rows = attempts.map((a) => [`${a.extent}`, `${a.attempt}`, a.worker, a.reason]);
  return table(title, ["extent", "attempt", "by", "reason"], rows, "broad");
}

function passesTable(passes) {
  const rows = passes.map((p) => [p.name, p.path, whole(p.positions), mm(p.length, 0), seconds(p.seconds), mm(p.deepest_cut)]);
  return table("Passes", ["pass", "path", "positions", "length", "time", "deepest cut"], rows, "broad");
}

function programTables({ dialect, files, passes, seconds: time, bounds, peaks, steady }) {
  const unit = (axis) => (axis === "rotation" ? "°" : "mm");
  const asked = peaks.map(({ axis, velocity, acceleration, jerk }) => [axis,
    `${rough(velocity)} ${unit(axis)}/s`, `${rough(acceleration)} ${unit(axis)}/s²`, `${rough(jerk)} ${unit(axis)}/s³`]);
  const pairs = [["dialect", dialect], ["files", files.join(", ")], ["time at work", seconds(time)],
    ...bounds.map(([name, share]) => [`moves held by ${name}`, percent(share)])];
  if (steady) pairs.push(["steady spindle within the same limits", `${rough(steady.turns)} turns a minute`], ["time at that", seconds(steady.seconds)]);
  return [table("Program", [], pairs), ...(passes?.length ? [passesTable(passes)] : []), table("Asked of each axis at most", ["axis", "velocity", "acceleration", "jerk"], asked, "broad")];
}

/// Whatever has no table of its own: names and values, those of what lies within after their names.
function plain(title, value) {
  return table(title, [], flat(value));
}

function flat(value, name = "") {
  if (value === null || value === undefined) return name ? [[name, "–"]] : [];
  if (typeof value === "object" && !(Array.isArray(value) && value.every((v) => typeof v !== "object"))) {
    return Object.entries(value).flatMap(([key, inner]) => flat(inner, name ? `${name} · ${spaced(key)}` : spaced(key)));
  }
  const number = (n) => (Number.isInteger(n) ? count.format(n).replace("-", "−") : rough(n, 8));
  const text = (v) => (typeof v !== "number" ? String(v) : name.startsWith("bytes") ? bytes(v) : number(v));
  return [[name, Array.isArray(value) ? value.map(text).join(", ") : text(value)]];
}

const spaced = (key) => key.replaceAll("_", " ");

/// The tables of a part alone.
function partTables({ version, files, bodies, warnings }) {
  const all = [table("Bodies", ["body", "kind", "size", "least corner"], bodies.map((b) => [b.name, b.kind, b.size, b.from]), "broad"),
    table("Files", ["file", "unit"], files.map((f) => [f.name, f.unit]), "broad")];
  if (warnings.length) all.unshift(table("Warnings", [], warnings.map((w) => [w])));
  return [...all, table("Made by", [], [["horma", version]])];
}

/// All tables, what matters most first; the narrow ones are in columns.
function tables() {
  const { version, job, warnings, path: figures, verification, machined: left, phases, bodies, extents, lost, second, counters, traffic, window, workers, extents_from_journal, program, ...others } = report;
  const all = [pathTable(figures)];
  if (warnings.length) all.unshift(table("Warnings", [], warnings.map((w) => [w])));
  if (verification) all.push(deviationTable(verification), samplesTable(verification));
  if (left) all.push(machinedTable(left));
  if (program) all.push(...programTables(program));
  for (const [name, value] of Object.entries(others)) if (value) all.push(plain(spaced(name), value));
  all.push(phasesTable(phases), ...(bodies.length ? [bodiesTable(bodies)] : []), ...(contents.motion ? [plain("What the search cost", counters)] : []));
  if (window) all.push(plain("Windows of the local search", window));
  if (traffic) all.push(plain("Traffic", traffic));
  if (workers.length) all.push(table("Workers", ["name", "address"], workers.map((w) => [w.worker, w.address])));
  if (extents.length) all.push(extentsTable(extents));
  if (lost.length) all.push(attemptsTable("Lost attempts", lost));
  if (second.length) all.push(attemptsTable("Second attempts", second));
  if (job) all.push(plain("The job in effect", job));
  all.push(table("Made by", [], [["horma", version], ["extents taken from the journal", whole(extents_from_journal)]]));
  const broad = (t) => t.classList.contains("broad");
  return [make("div", "narrow", ...all.filter((t) => !broad(t))), ...all.filter(broad)];
}
