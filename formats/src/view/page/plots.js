// The plots in two dimensions: the unrolled map, the attack axis over time, and how often what error.

/// Begins a drawing: a canvas of its own size, in pixels of the page, with the theme's font.
function sheet(canvas, theme) {
  fit(canvas);
  const pen = canvas.getContext("2d");
  pen.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
  pen.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = pen.strokeStyle = theme.faint;
  pen.lineWidth = 1;
  return { pen, width: canvas.clientWidth, height: canvas.clientHeight };
}

/// Round numbers between two.
function ticks(low, high, about) {
  const raw = (high - low) / Math.max(about, 1);
  if (!(raw > 0)) return [low];
  const decade = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((s) => s * decade).find((s) => s >= raw);
  const all = [];
  for (let k = Math.ceil(low / step); k * step <= high + step * 1e-9; k++) all.push(k * step);
  return all;
}

function words(pen, text, x, y, align = "left", baseline = "alphabetic") {
  pen.textAlign = align;
  pen.textBaseline = baseline;
  pen.fillText(text, x, y);
}

// The unrolled map.

/// Step and points per revolution: the path's, or those of the job that it is held against.
const motion = contents.motion ?? report.job?.motion;

const MAP = { left: 46, right: 12, top: 10, bottom: 36 };

/// Values in cells of travel and angle: in each the one farthest from the middle of the colours, so
/// that nothing outstanding is lost.
function unroll(choice) {
  if (choice.on === "rays") return unrolled(machined);
  const errors = choice.on === "surface";
  const [low, high] = range(errors ? surface.points.filter((_, i) => i % 3 === 0) : path.travels);
  const cell = errors
    ? Math.max(1.6 * report.verification.spacing, (high - low) / 480)
    : Math.max(motion.step, (high - low) / 480);
  const columns = Math.max(1, Math.floor((high - low) / cell) + 1);
  const rows = errors ? 120 : Math.min(180, motion.points_per_revolution);
  const cells = new Float32Array(columns * rows).fill(NaN);
  const middle = choice.scale ? (choice.scale.low + choice.scale.high) / 2 : 0;
  choice.values.forEach((value, i) => {
    if (Number.isNaN(value)) return;
    const [x, angle] = errors
      // Where the surface faces the wheel.
      ? [surface.points[3 * i], -Math.atan2(surface.points[3 * i + 2], surface.points[3 * i + 1]) * (180 / Math.PI)]
      : [path.travels[i], path.angles[i]];
    const row = Math.floor((around(angle) / 360) * rows) % rows;
    const at = row * columns + Math.floor((x - low) / cell);
    if (Number.isNaN(cells[at]) || Math.abs(value - middle) > Math.abs(cells[at] - middle)) cells[at] = value;
  });
  return { low, high: low + columns * cell, columns, rows, cells: errors ? filled(cells, columns) : cells };
}

/// The cells of the machined surface as they are, travel by travel.
function unrolled({ rows, columns, first, step, deviations }) {
  const cells = new Float32Array(deviations.length);
  deviations.forEach((value, i) => (cells[(i % columns) * rows + Math.floor(i / columns)] = value));
  const low = first[0] - step[0] / 2;
  return { low, high: low + rows * step[0], columns: rows, rows: columns, cells };
}

/// Where the surface comes near the spindle its samples are too few for every cell: one without takes
/// what is beside it.
function filled(cells, columns) {
  for (let pass = 0; pass < 8; pass++) {
    const before = cells.slice();
    before.forEach((value, i) => {
      if (!Number.isNaN(value)) return;
      const beside = [i - columns, i + columns, i - 1, i + 1].map((k) => before[k]);
      cells[i] = beside.find((v) => v === v) ?? NaN;
    });
  }
  return cells;
}

/// The map as a picture of its own, made once for each choice.
function mapPicture(choice) {
  const map = unroll(choice);
  const { columns, rows, cells } = map;
  const picture = new OffscreenCanvas(columns, rows);
  const pen = picture.getContext("2d");
  const pixels = pen.createImageData(columns, rows);
  cells.forEach((value, i) => {
    if (Number.isNaN(value)) return;
    const row = rows - 1 - Math.floor(i / columns);
    pixels.data.set([...colourOf(choice, value), 255], 4 * (row * columns + (i % columns)));
  });
  pen.putImageData(pixels, 0, 0);
  return { ...map, picture };
}

function drawMap(canvas, map, position, theme) {
  const { pen, width, height } = sheet(canvas, theme);
  const area = { x: MAP.left, y: MAP.top, w: width - MAP.left - MAP.right, h: height - MAP.top - MAP.bottom };
  pen.imageSmoothingEnabled = false;
  pen.drawImage(map.picture, area.x, area.y, area.w, area.h);
  pen.strokeStyle = theme.edge;
  pen.strokeRect(area.x + 0.5, area.y + 0.5, area.w - 1, area.h - 1);
  const across = (x) => area.x + (area.w * (x - map.low)) / (map.high - map.low);
  const down = (angle) => area.y + area.h * (1 - angle / 360);
  for (const x of ticks(map.low, map.high, area.w / 80)) words(pen, rough(x, 6), across(x), area.y + area.h + 15, "center");
  for (const angle of [0, 90, 180, 270, 360]) words(pen, `${angle}°`, area.x - 6, down(angle), "right", "middle");
  words(pen, "travel, mm", area.x + area.w, height - 4, "right");
  const angle = around(path.angles[position]);
  pen.strokeStyle = theme.text;
  pen.beginPath();
  pen.moveTo(across(path.travels[position]), area.y);
  pen.lineTo(across(path.travels[position]), area.y + area.h);
  pen.moveTo(area.x, down(angle));
  pen.lineTo(area.x + area.w, down(angle));
  pen.stroke();
}

/// The position nearest to a place on the map.
function onMap(canvas, map, { offsetX, offsetY }) {
  const w = canvas.clientWidth - MAP.left - MAP.right;
  const h = canvas.clientHeight - MAP.top - MAP.bottom;
  const x = map.low + ((offsetX - MAP.left) / w) * (map.high - map.low);
  const angle = 360 * (1 - (offsetY - MAP.top) / h);
  let [best, least] = [0, Infinity];
  for (let i = 0; i < path.length; i++) {
    const turned = Math.abs(around(path.angles[i] - angle + 180) - 180);
    const far = Math.abs(path.travels[i] - x) / (map.high - map.low) + turned / 360;
    if (far < least) [best, least] = [i, far];
  }
  return best;
}

// The attack axis over time.

const AXIS = { left: 58, right: 12, gap: 26, bottom: 34 };

/// The machine's limits of the attack axis, as far as the job says.
const limits = report.job?.machine?.attack ?? {};

/// Rows of the plot at so many turns a minute: what is drawn, its unit, and what turns a packed number
/// into it.
function axisRows(turns) {
  const degrees = 6 * turns;
  return [
    { name: "position, mm", values: path.heights, factor: 1 },
    { name: "velocity, mm/s", values: path.slopes, factor: degrees, limit: limits.velocity },
    { name: "acceleration, m/s²", values: path.bends, factor: degrees ** 2 / 1000, limit: limits.acceleration && limits.acceleration / 1000 },
  ];
}

/// First and last position that the plot shows: all, or the turn in which a position is.
function axisSpan(span, position) {
  if (span === "all") return [0, path.length - 1];
  const turn = Math.floor(path.angles[position] / 360);
  let first = position;
  while (first > 0 && path.angles[first - 1] >= 360 * turn) first--;
  let last = position;
  while (last + 1 < path.length && path.angles[last] < 360 * (turn + 1)) last++;
  return [first, last];
}

function drawAxis(canvas, { turns, span, position, theme }) {
  const { pen, width, height } = sheet(canvas, theme);
  const rows = axisRows(turns);
  const [first, last] = axisSpan(span, position);
  const time = (i) => path.angles[i] / (6 * turns);
  const [from, to] = [time(first), Math.max(time(last), time(first) + 1e-9)];
  const w = width - AXIS.left - AXIS.right;
  const h = (height - AXIS.bottom - AXIS.gap * rows.length) / rows.length;
  const across = (t) => AXIS.left + (w * (t - from)) / (to - from);
  rows.forEach((row, r) => {
    const top = AXIS.gap + r * (h + AXIS.gap);
    let [low, high] = range(row.values.subarray(first, last + 1)).map((v) => v * row.factor);
    // A limit is shown where it is near; far beyond it would flatten what there is.
    const near = row.limit && row.limit < 3 * Math.max(-low, high);
    if (near) [low, high] = [Math.min(low, -row.limit), Math.max(high, row.limit)];
    const room = 0.06 * (high - low || 1);
    [low, high] = [low - room, high + room];
    const down = (v) => top + h * (1 - (v - low) / (high - low));
    pen.fillStyle = theme.faint;
    words(pen, row.name, AXIS.left, top - 8);
    for (const tick of ticks(low, high, h / 34)) {
      pen.strokeStyle = theme.edge;
      pen.beginPath();
      pen.moveTo(AXIS.left, Math.round(down(tick)) + 0.5);
      pen.lineTo(AXIS.left + w, Math.round(down(tick)) + 0.5);
      pen.stroke();
      words(pen, rough(tick, 6), AXIS.left - 6, down(tick), "right", "middle");
    }
    drawBand(pen, row, first, last, (i) => across(time(i)), down, theme.accent);
    if (row.limit) {
      pen.fillStyle = pen.strokeStyle = theme.bad;
      words(pen, `limit ${rough(row.limit)}`, AXIS.left + w, top - 8, "right");
      if (near) {
        pen.setLineDash([5, 4]);
        for (const v of [-row.limit, row.limit]) {
          pen.beginPath();
          pen.moveTo(AXIS.left, down(v));
          pen.lineTo(AXIS.left + w, down(v));
          pen.stroke();
        }
        pen.setLineDash([]);
      }
    }
    pen.strokeStyle = theme.text;
    pen.beginPath();
    pen.moveTo(across(time(position)), top);
    pen.lineTo(across(time(position)), top + h);
    pen.stroke();
  });
  pen.fillStyle = theme.faint;
  for (const t of ticks(from, to, w / 80)) words(pen, rough(t, 6), across(t), height - AXIS.bottom + 16, "center");
  words(pen, "time, s", AXIS.left + w, height - 2, "right");
}

/// A line; where several positions share a column of pixels, from the least of them to the greatest.
function drawBand(pen, { values, factor }, first, last, across, down, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1.25;
  pen.beginPath();
  let joined = false;
  let column = null;
  let [low, high, end] = [0, 0, 0];
  const flush = () => {
    if (column === null) return;
    const x = column / 2;
    if (joined) pen.lineTo(x, down(high));
    else pen.moveTo(x, down(high));
    if (low !== high) pen.lineTo(x, down(low));
    pen.lineTo(x, down(end));
    joined = true;
    column = null;
  };
  for (let i = first; i <= last; i++) {
    if (Number.isNaN(values[i])) {
      flush();
      joined = false;
      continue;
    }
    const value = values[i] * factor;
    const at = Math.round(across(i) * 2);
    if (at !== column) {
      flush();
      [column, low, high] = [at, value, value];
    }
    low = Math.min(low, value);
    high = Math.max(high, value);
    end = value;
  }
  flush();
  pen.stroke();
  pen.lineWidth = 1;
}

/// The position nearest to a place on the plot.
function onAxis(canvas, { span, position }, { offsetX }) {
  const [first, last] = axisSpan(span, position);
  const share = (offsetX - AXIS.left) / (canvas.clientWidth - AXIS.left - AXIS.right);
  const angle = path.angles[first] + share * (path.angles[last] - path.angles[first]);
  let [low, high] = [first, last];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (path.angles[middle] < angle) low = middle + 1;
    else high = middle;
  }
  return low;
}

// How often what error.

/// The classes that samples are in, from the first that is not empty to the last.
function classes() {
  const [bounds, counts] = contents.classes;
  const all = counts.map((n, i) => ({ from: bounds[i - 1], to: bounds[i], count: n }));
  const filled = all.map((c) => c.count > 0);
  return all.slice(filled.indexOf(true), filled.lastIndexOf(true) + 1);
}

function className({ from, to }) {
  const number = (n) => rough(n, 2);
  if (from === undefined) return `below ${number(to)}`;
  if (to === undefined) return `${number(from)} and more`;
  return `${number(from)} to ${number(to)}`;
}

/// Bars across, since their names are long; a share of the samples each.
function drawHistogram(canvas, choice, theme) {
  const { pen, width, height } = sheet(canvas, theme);
  const all = classes();
  const total = all.reduce((sum, c) => sum + c.count, 0);
  const greatest = Math.max(...all.map((c) => c.count));
  const pitch = Math.min((height - 4) / all.length, 30);
  const [left, right] = [124, 66];
  all.forEach((one, i) => {
    const y = 2 + i * pitch;
    const middle = one.from === undefined ? one.to : one.to === undefined ? one.from : (one.from + one.to) / 2;
    pen.fillStyle = theme.faint;
    words(pen, className(one), left - 8, y + pitch / 2, "right", "middle");
    const length = Math.max(((width - left - right) * one.count) / greatest, one.count ? 2 : 0);
    pen.fillStyle = `rgb(${colourOf(choice, middle)})`;
    pen.fillRect(left, y + 2, length, pitch - 4);
    pen.strokeStyle = theme.edge;
    if (one.count) pen.strokeRect(left + 0.5, y + 2.5, length - 1, pitch - 5);
    pen.fillStyle = theme.text;
    words(pen, one.count ? percent(one.count / total) : "–", left + length + 6, y + pitch / 2, "left", "middle");
  });
}

function percent(share) {
  const n = 100 * share;
  return n < 0.01 ? "< 0.01 %" : `${n.toFixed(n < 1 ? 2 : 1)} %`;
}
