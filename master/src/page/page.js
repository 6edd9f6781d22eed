// Draws what /api/events tells: states as they are, events as they happen. Nothing is built from text
// that came from elsewhere: names are set as text.

const $ = (selector, within = document) => within.querySelector(selector);
const count = new Intl.NumberFormat("en", { maximumFractionDigits: 0 });
const rough = new Intl.NumberFormat("en", { maximumSignificantDigits: 3 });

/// An element with a class and a text.
function make(tag, kind, text) {
  const element = document.createElement(tag);
  if (kind) element.className = kind;
  if (text !== undefined) element.textContent = text;
  return element;
}

/// Sets a text if it differs, so that what is selected stays selected.
function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function bytes(n) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  for (; n >= 999.5 && unit < units.length - 1; unit++) n /= 1000;
  return `${n >= 99.5 || unit === 0 ? n.toFixed(0) : n.toPrecision(2)} ${units[unit]}`;
}

function time(s) {
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 90) return `${s.toFixed(0)} s`;
  const minutes = Math.round(s / 60);
  return minutes < 90 ? `${minutes} min` : `${(minutes / 60).toFixed(1)} h`;
}

const mm = (x) => `${x.toFixed(1).replace("-", "−")} mm`;

// Each worker has a colour from when it is first seen; neighbours in that order are far apart.
const hues = new Map();
function hue(worker) {
  if (!hues.has(worker)) hues.set(worker, Math.round((25 + hues.size * 137.5) % 360));
  return hues.get(worker);
}

/// Keeps one child of a parent for each item, in their order, by what is their name.
function keep(parent, items, name, begin, update) {
  const there = new Map([...parent.children].map((child) => [child.dataset.name, child]));
  let at = parent.firstElementChild;
  for (const item of items) {
    const key = String(name(item));
    let child = there.get(key);
    if (child) {
      there.delete(key);
    } else {
      child = begin(item);
      child.dataset.name = key;
    }
    if (child === at) at = at.nextElementSibling;
    else parent.insertBefore(child, at);
    update(child, item);
  }
  for (const child of there.values()) child.remove();
}

// Jobs.

function beginJob(job) {
  const card = make("article", "job");
  const head = make("div", "head");
  const title = make("h3", "", `Job ${job.job}`);
  title.id = `job-${job.job}`;
  card.setAttribute("aria-labelledby", title.id);
  head.append(title, make("span", "state"), make("span", "rate"));
  const progress = make("progress");
  progress.setAttribute("aria-label", "Positions that have arrived");
  const strip = make("ol", "strip");
  strip.setAttribute("aria-label", "Extents along the last; arrow keys go from one to the next");
  strip.addEventListener("keydown", walk);
  for (const event of ["focusin", "pointerover"]) {
    strip.addEventListener(event, ({ target }) => {
      if (target.tagName === "BUTTON") select(card, target);
    });
  }
  const axis = make("div", "axis");
  axis.append(make("span"), make("span"), make("span"));
  const key = make("div", "key");
  for (const state of ["waiting", "placed", "running", "done"]) key.append(make("span", state, state));
  const figures = make("dl");
  for (const name of ["To workers", "Between workers", "Results", "Lost attempts"]) {
    const pair = make("div");
    pair.append(make("dt", "", name), make("dd"));
    figures.append(pair);
  }
  const detail = make("p", "detail hint", "Point at an extent, or use Tab and the arrow keys.");
  card.append(head, make("p", "reason"), progress, strip, axis, detail, key, figures);
  return card;
}

function updateJob(card, job) {
  card.dataset.state = job.state;
  if (job.name) say($("h3", card), `Job ${job.job} · ${job.name}`);
  say($(".state", card), job.state);
  const left = job.seconds_left === null || job.state !== "running" ? "" : ` · ${time(job.seconds_left)} left`;
  const speed = job.arrived ? ` · ${rough.format(job.rate)}/s` : "";
  say($(".rate", card), `${count.format(job.arrived)} of ${count.format(job.positions)} positions${speed}${left}`);
  say($(".reason", card), job.reason ?? "");
  const progress = $("progress", card);
  progress.max = job.positions || 1;
  progress.value = job.arrived;
  const { traffic } = job;
  const figures = [
    bytes(traffic.bytes_to_workers),
    bytes(traffic.bytes_between_workers),
    bytes(traffic.bytes_of_results),
    count.format(job.lost),
  ];
  card.querySelectorAll("dd").forEach((dd, i) => say(dd, figures[i]));
  updateStrip(card, job);
}

function updateStrip(card, { extents }) {
  const strip = $(".strip", card);
  const from = extents.length ? extents[0].x[0] : 0;
  const to = extents.length ? extents[extents.length - 1].x[1] : 0;
  const share = (x) => (to > from ? (100 * (x - from)) / (to - from) : 0);
  [from, (from + to) / 2, to].forEach((x, i) => say($(".axis", card).children[i], mm(x)));
  // An extent goes as far as the next one begins.
  const ends = extents.map((_, i) => (i + 1 < extents.length ? extents[i + 1].x[0] : to));
  keep(strip, extents.map((extent, i) => ({ ...extent, end: ends[i] })), (e) => e.extent, () => {
    const item = make("li");
    const button = make("button");
    button.type = "button";
    button.tabIndex = strip.children.length ? -1 : 0;
    item.append(button);
    return item;
  }, (item, extent) => {
    const button = item.firstElementChild;
    const workers = extent.workers.join(" and ");
    const by = workers && ` ${extent.state === "done" ? "by" : "on"} ${workers}`;
    const again = extent.attempt > 1 ? `, attempt ${extent.attempt}` : "";
    const words = `Extent ${extent.extent}, ${mm(extent.x[0])} to ${mm(extent.x[1])}, ` +
      `${count.format(extent.positions)} positions, ${extent.state}${by}${again}`;
    if (button.ariaLabel === words) return;
    button.ariaLabel = words;
    button.dataset.state = extent.state;
    button.style.left = `${share(extent.x[0])}%`;
    button.style.width = `${share(extent.end) - share(extent.x[0])}%`;
    button.style.setProperty("--hue", workers ? hue(extent.workers[0]) : 0);
    if (card.selected === button) select(card, button);
  });
}

/// Tells about an extent in words.
function select(card, button) {
  card.selected = button;
  const detail = $(".detail", card);
  detail.classList.remove("hint");
  say(detail, button.ariaLabel);
}

/// From one extent to another by keys; one of them can be reached with Tab.
function walk(event) {
  const items = [...event.currentTarget.children];
  const at = items.indexOf(event.target.parentElement);
  const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: items.length - 1 }[event.key];
  if (to === undefined || !items[to]) return;
  event.preventDefault();
  event.target.tabIndex = -1;
  const button = items[to].firstElementChild;
  button.tabIndex = 0;
  button.focus();
}

// What is over stays where it was, below what goes on.
function drawJobs({ jobs, queued, ended }) {
  const all = [...jobs, ...ended];
  $("#jobs .none").hidden = all.length + queued.length > 0;
  keep($("#queued"), queued, (job) => job.job, () => make("li"), (item, job) => {
    say(item, `Job ${job.job} ${job.name} waits since ${new Date(job.submitted).toLocaleTimeString("en-GB")}`);
  });
  keep($("#all"), all, (job) => job.job, beginJob, updateJob);
}

// Workers.

function drawWorkers(workers) {
  $("#workers .none").hidden = workers.length > 0;
  $("#workers .scroll").hidden = workers.length === 0;
  keep($("#workers tbody"), workers, (worker) => worker.worker, (worker) => {
    const row = make("tr");
    const name = make("th", "", worker.worker);
    name.scope = "row";
    name.style.setProperty("--hue", hue(worker.worker));
    row.append(name, make("td"), make("td", "wide"), make("td", "number"), make("td", "number"));
    return row;
  }, (row, worker) => {
    const [name, does, extent, rate, heard] = row.children;
    name.title = `${worker.worker} at ${worker.address}: ${count.format(worker.positions)} positions delivered`;
    say(does, worker.state);
    say(extent, worker.task ? `${worker.task[1]} of job ${worker.task[0]}` : "–");
    say(rate, worker.rate === null ? "–" : rough.format(worker.rate));
    say(heard, `${time(worker.silent)} ago`);
  });
}

// Events, newest first.

const MOST = 200;

function addEvent({ id, at, bad, text }) {
  const list = $("#events ol");
  $("#events .none").hidden = true;
  list.hidden = false;
  const item = make("li", bad ? "bad" : "");
  const when = new Date(at);
  const clock = make("time", "", when.toLocaleTimeString("en-GB"));
  clock.dateTime = when.toISOString();
  item.dataset.id = id;
  item.append(clock, make("span", "", text));
  list.prepend(item);
  while (list.children.length > MOST) list.lastElementChild.remove();
}

function link(state, words) {
  const element = $("#link");
  element.dataset.link = state;
  say(element, words);
}

const source = new EventSource("api/events");
source.addEventListener("open", () => link("live", "live"));
source.addEventListener("error", () => link("lost", "no connection"));
source.addEventListener("happening", ({ data }) => addEvent(JSON.parse(data)));
source.addEventListener("state", ({ data }) => {
  const state = JSON.parse(data);
  say($("#version"), state.version);
  drawJobs(state);
  drawWorkers(state.workers);
});
