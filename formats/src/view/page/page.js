// The page: one state, drawn whole whenever it has changed.

const shown = ["part", "edges", "contacts", "centres", "wheel"];

const state = {
  position: firstTouch(),
  choice: choices[0],
  turns: report.program?.steady?.turns ?? 20,
  span: "all",
  playing: null,
};

/// A position in the middle of the path, where there is something to see.
function firstTouch() {
  const middle = path.length >> 1;
  for (let i = middle; i < path.length; i++) if (!Number.isNaN(path.heights[i])) return i;
  return 0;
}

// Shown all at once, so that nothing moves while the numbers come.
for (const element of document.querySelectorAll(alone ? ".of-path" : ".of-part")) element.hidden = true;
$("main").classList.toggle("alone", alone);
$("main").hidden = false;

const canvas = $("#solid");
const picture = scene(canvas);
if (picture) {
  orbit(canvas, picture, redraw);
} else {
  $("#no-webgl").hidden = false;
  canvas.hidden = true;
}

/// The colours of the page as the scheme has them: red, green and blue for the picture, text for the
/// plots.
function theme() {
  const probe = document.body.appendChild(make("span"));
  const text = (name) => {
    probe.style.color = `var(--${name})`;
    return getComputedStyle(probe).color;
  };
  const rgb = (name) => text(name).match(/\d+/g).slice(0, 3).map(Number);
  const [plots, solids] = [["text", "faint", "edge", "accent", "bad"], ["part", "wheel", "line", "mark", "fault"]];
  const found = Object.fromEntries([...plots.map((n) => [n, text(n)]), ...solids.map((n) => [n, rgb(n)])]);
  probe.remove();
  return found;
}

let scheme = theme();
let due = 0;
let map = null;

/// Draws at the next frame, once.
function redraw() {
  due ||= requestAnimationFrame(draw);
}

function draw() {
  due = 0;
  const { position, choice } = state;
  const show = Object.fromEntries(shown.map((n) => [n, $(`#show-${n}`).checked]));
  picture?.draw({ position, choice, show, theme: scheme });
  drawLegend(choice);
  if (alone) return;
  if (map?.choice !== choice) map = { ...mapPicture(choice), choice };
  drawMap($("#map"), map, position, scheme);
  drawAxis($("#axis"), { ...state, theme: scheme });
  if (surface.clearances?.length) drawHistogram($("#histogram"), choices[0], scheme);
  tell(position);
}

function drawLegend(choice) {
  const figure = $("#legend");
  const bar = $("canvas", figure);
  const captions = $("figcaption", figure);
  fit(bar);
  const pen = bar.getContext("2d");
  const { names } = choice;
  if (names) {
    names.forEach((_, i) => {
      pen.fillStyle = `rgb(${distinct(i)})`;
      pen.fillRect((bar.width * i) / names.length, 0, bar.width / names.length, bar.height);
    });
    captions.replaceChildren(...names.map((name) => make("span", "", name)));
    return;
  }
  const { low, high, unit, beyond } = choice.scale;
  for (let x = 0; x < bar.width; x++) {
    pen.fillStyle = `rgb(${colourOf(choice, low + ((high - low) * x) / bar.width)})`;
    pen.fillRect(x, 0, 1, bar.height);
  }
  const [before, after] = choice.ends ?? ["", ""];
  const [least, greatest] = beyond ? ["≤ ", "≥ "] : ["", ""];
  captions.replaceChildren(
    make("span", "", `${before} ${least}${rough(low)} ${unit}`.trim()),
    make("span", "", `${rough((low + high) / 2)}`),
    make("span", "", `${after} ${greatest}${rough(high)} ${unit}`.trim()),
  );
}

/// Everything about a position in words.
function tell(i) {
  const touching = !Number.isNaN(path.heights[i]);
  const extent = path.extents && extents[path.extents[i]];
  const pairs = [
    ["position", rough(path.index[i], 12)],
    ["travel", `${fixed(path.travels[i], 3)} mm`],
    ["angle", `${fixed(around(path.angles[i]), 2)}°`],
    ["turn", count.format(Math.floor(path.angles[i] / 360) + 1)],
    ["tool centre", touching ? `${fixed(path.heights[i], 3)} mm` : "no contact"],
    ["touches ahead by", touching ? `${fixed(rim[i], 2)} mm` : "–"],
    ["axis speed", `${fixed(path.slopes[i] * 6 * state.turns, 1)} mm/s`],
    ["digitized by", extent ? `${extent.worker}, extent ${extent.extent}` : contents.motion ? "this process" : "read from a file"],
  ];
  const list = $("#here");
  if (!list.children.length) {
    for (const [name] of pairs) list.append(make("div", "", make("dt", "", name), make("dd")));
  }
  pairs.forEach(([, text], k) => (list.children[k].lastElementChild.textContent = text));
  const slider = $("#at");
  slider.value = i;
  slider.ariaValueText = pairs.slice(0, 5).map(([name, text]) => `${name} ${text}`).join(", ");
}

/// Says what each drawing shows, for those who do not see it.
function describe() {
  const { choice } = state;
  if (alone) {
    canvas.ariaLabel = `The part, a colour for each of its bodies: ${choice.names.join(", ")}`;
    return;
  }
  const where = choice.scale ? `, from ${rough(choice.scale.low)} to ${rough(choice.scale.high)} ${choice.scale.unit}` : "";
  canvas.ariaLabel = `The part on the lathe with its tool path and the wheel, coloured by ${choice.name}${where}`;
  $("#map").ariaLabel = `Unrolled map over travel and angle, coloured by ${choice.name}${where}`;
  const rows = axisRows(state.turns).map((row) => {
    const [low, high] = range(row.values).map((v) => rough(v * row.factor));
    return `${row.name}: from ${low} to ${high}`;
  });
  $("#axis").ariaLabel = `The attack axis over time. ${rows.join("; ")}`;
  $("#motion-note").textContent = motionNote();
  const shows = {
    surface: "the sample that strays most there, at the angle at which it faces the wheel",
    rays: "how far out the machined surface lies there, along the designed one's normal",
    path: "the position that stands out most there",
  };
  $("#map-note").textContent = `Each place shows ${shows[choice.on]}. Click to go there.`;
}

function motionNote() {
  const [, velocity, acceleration] = axisRows(state.turns).map(({ values, factor }) => most(values, 1) * factor);
  const time = path.angles[path.length - 1] / (6 * state.turns);
  return `At ${rough(state.turns)} turns a minute the path takes ${rough(time, 4)} s, and asks the attack axis for ` +
    `${rough(velocity)} mm/s and ${rough(acceleration)} m/s² at most.`;
}

/// How much of everything is shown.
function shownNote() {
  const { positions, triangles, samples, every } = contents;
  const of = ({ shown, of }) => (shown === of ? `all ${count.format(of)}` : `${count.format(shown)} of ${count.format(of)}`);
  const rule = every > 1
    ? `: of every ${every} in a row the first, the lowest, the highest, the steepest, the one that bends most, and the first without contact`
    : "";
  const thinner = samples && samples.shown < samples.of ? ", of those in a row the one that strays most" : "";
  const sampled = samples ? `; ${of(samples)} samples of the surface${thinner}` : "";
  const cells = machined && machined.rows * machined.columns;
  const strayed = machined && cells < machined.rays ? ", of those beside each other the one that strays most" : "";
  const met = machined ? `; ${of({ shown: cells, of: machined.rays })} rays that end at the machined surface${strayed}` : "";
  if (alone) return `Shown are ${of(triangles)} triangles, where the files have them. Lengths are in mm.`;
  return `Shown are ${of(positions)} positions${rule}; ${of(triangles)} triangles of the part${sampled}${met}. Lengths are in mm. ` +
    "Figures and the histogram count everything.";
}

function summary() {
  if (alone) {
    const { files, bodies, open_edges: open } = report;
    const several = (n, one, many) => `${count.format(n)} ${n === 1 ? one : many}`;
    return [files.map(({ name }) => name).join(", "), several(bodies.length, "body", "bodies"),
      open ? several(open, "open edge", "open edges") : "no open edge"].join(" · ");
  }
  const { cutter, motion } = report.job ?? {};
  const positions = `${count.format(report.path.positions)} positions`;
  const gouge = report.verification?.normal.gouge;
  const checked = report.verification ? (gouge ? `deepest gouge ${fixed(gouge.depth, 4)} mm` : "no gouge") : "not verified";
  const tool = cutter && `${cutter.kind} ${Object.entries(cutter).filter(([, v]) => typeof v === "number").map(([, v]) => rough(v)).join(" / ")}`;
  return [positions, tool, motion && `${motion.kind}, ${rough(motion.step)} mm a turn`, checked].filter(Boolean).join(" · ");
}

/// Moves on by the time that has passed: a turn in four seconds.
function play(now) {
  if (!state.playing) return;
  const passed = Math.min((now - state.playing.since) / 1000, 0.1);
  state.playing = { since: now, angle: state.playing.angle + 90 * passed };
  let i = state.position;
  while (i + 1 < path.length && path.angles[i + 1] <= state.playing.angle) i++;
  go(i);
  if (i + 1 < path.length) requestAnimationFrame(play);
  else toggle();
}

function toggle() {
  state.playing = state.playing ? null : { since: performance.now(), angle: path.angles[state.position] };
  const button = $("#play");
  button.ariaPressed = Boolean(state.playing);
  button.textContent = state.playing ? "Pause" : "Play";
  if (state.playing) requestAnimationFrame(play);
}

function go(position) {
  state.position = Math.min(Math.max(position, 0), path.length - 1);
  redraw();
}

/// The position a turn before or after.
function turned(by) {
  const angle = path.angles[state.position] + 360 * by;
  let i = state.position;
  if (by > 0) while (i + 1 < path.length && path.angles[i] < angle) i++;
  else while (i > 0 && path.angles[i] > angle) i--;
  return i;
}

$("#colour").append(...choices.map(({ id, name }) => new Option(name, id)));
$("#colour").addEventListener("change", ({ target }) => {
  state.choice = choices.find((c) => c.id === target.value);
  describe();
  redraw();
});
for (const name of shown) $(`#show-${name}`).addEventListener("change", redraw);
$("#home").addEventListener("click", () => {
  picture?.home();
  redraw();
});
const slider = $("#at");
slider.max = Math.max(path.length - 1, 0);
slider.addEventListener("input", () => {
  if (state.playing) toggle();
  go(Number(slider.value));
});
slider.addEventListener("keydown", (event) => {
  const keys = { PageUp: () => go(turned(1)), PageDown: () => go(turned(-1)), " ": toggle };
  const key = keys[event.key];
  if (!key) return;
  event.preventDefault();
  key();
});
$("#play").addEventListener("click", toggle);
$("#turns").value = rough(state.turns, 4);
$("#turns").addEventListener("input", ({ target }) => {
  if (!(target.valueAsNumber > 0)) return;
  state.turns = target.valueAsNumber;
  describe();
  redraw();
});
$("#span").addEventListener("change", ({ target }) => {
  state.span = target.value;
  redraw();
});
$("#map").addEventListener("click", (event) => go(onMap($("#map"), map, event)));
$("#axis").addEventListener("click", (event) => go(onAxis($("#axis"), state, event)));

if (surface.clearances?.length) {
  const filled = classes();
  $("#histogram").style.height = `${4 + 24 * filled.length}px`;
  const total = filled.reduce((sum, c) => sum + c.count, 0);
  const bars = filled.filter((c) => c.count).map((c) => `${className(c)} mm: ${percent(c.count / total)}`);
  $("#histogram").ariaLabel = `Share of the surface by how far it is from the path. ${bars.join("; ")}`;
  $("#errors-note").textContent =
    "Share of the samples by their clearance along the normal at positions, mm: negative where the wheel gouges, else the material left.";
} else {
  $("#errors").hidden = true;
}
document.title = alone ? `horma · ${report.files.map(({ name }) => name).join(", ")}` : `horma · ${report.path.positions} positions`;
$("#summary").textContent = summary();
$("#shown").textContent = shownNote();
$("#tables").append(...(alone ? partTables(report) : tables()));
describe();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  scheme = theme();
  redraw();
});
new ResizeObserver(redraw).observe($("main"));
draw();
performance.mark("drawn");
