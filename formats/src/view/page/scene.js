// The picture in three dimensions: the machine stands still, the part turns to face the wheel.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 tint;
uniform vec2 turn;    // cosine and sine of the part's angle
uniform vec3 shift;   // mm
uniform mat3 view;    // right, up and out of the picture
uniform vec3 centre;  // mm
uniform vec3 zoom;    // from mm to half the picture, and to half the depth
uniform float lift;   // towards the viewer, mm
uniform float size;   // of points, pixels
out vec3 facing;
out vec4 colour;
vec3 turned(vec3 p) { return vec3(p.x, p.y * turn.x - p.z * turn.y, p.y * turn.y + p.z * turn.x); }
void main() {
  vec3 seen = (turned(place) + shift - centre) * view;
  gl_Position = vec4(seen.xy * zoom.xy, -(seen.z + lift) * zoom.z, 1.0);
  gl_PointSize = size;
  facing = turned(normal) * view;
  colour = tint;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 facing;
in vec4 colour;
uniform vec4 paint;   // used instead of the colour where it is not transparent
uniform bool lit;
uniform bool ring;    // instead of a point
out vec4 shown;
void main() {
  if (ring && abs(length(gl_PointCoord - 0.5) - 0.43) > 0.07) discard;
  vec4 base = paint.a > 0.0 ? paint : colour;
  if (base.a == 0.0) discard;
  float light = 1.0;
  if (lit) {
    vec3 n = normalize(facing);
    if (n.z < 0.0) n = -n;
    light = 0.34 + 0.5 * max(dot(n, normalize(vec3(-0.35, 0.7, 0.65))), 0.0) + 0.22 * n.z;
  }
  shown = vec4(base.rgb * light, base.a);
}`;

const LIFT = 0.6;
const HOME = { yaw: 0.5, pitch: 0.34, zoom: 1, pan: [0, 0] };

/// Begins the picture on a canvas; nothing if there is no WebGL 2. What it returns draws a state:
/// the number of a position, the choice of colours, and what is shown.
function scene(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: true });
  if (!gl) return null;
  const program = link(gl);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const at = Object.fromEntries(
    ["turn", "shift", "view", "centre", "zoom", "lift", "size", "paint", "lit", "ring"].map((n) => [n, uniform(n)]),
  );
  const solid = solidBuffers(gl, part);
  const edges = part.edges.length && figure(gl, gl.LINES, part.edges, Uint32Array.from({ length: part.edges.length / 3 }, (_, i) => i));
  const spot = gouged && figure(gl, gl.POINTS, Float32Array.from(gouged.point), Uint32Array.of(0));
  const tool = !alone && solidBuffers(gl, wheel(contents.wheel));
  const order = strip();
  const lines = alone ? {} : { contacts: lineBuffers(gl, path.contacts, order), centres: lineBuffers(gl, centres(), order) };
  const samples = surface.points && cloud(gl, surface);
  const left = machined && shellBuffers(gl, shell(machined));
  let coloured = null;
  let camera = structuredClone(HOME);
  const box = extent();

  function colourBy(choice) {
    if (coloured === choice) return;
    coloured = choice;
    const all = colours(choice);
    if (choice.on === "surface") samples.colour(all);
    else if (choice.on === "rays") left.colour(all);
    else if (choice.on === "part") solid.colour(all);
    else for (const line of Object.values(lines)) line.colour(all);
  }

  function draw({ position, choice, show, theme }) {
    fit(canvas);
    const { width, height } = canvas;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    const { yaw, pitch } = camera;
    const out = [Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch)];
    const right = [Math.cos(yaw), 0, -Math.sin(yaw)];
    const up = [out[1] * right[2] - out[2] * right[1], out[2] * right[0] - out[0] * right[2], out[0] * right[1] - out[1] * right[0]];
    const scale = Math.min(width / box.wide, height / box.high) * camera.zoom;
    const centre = box.centre.map((c, k) => c - right[k] * camera.pan[0] - up[k] * camera.pan[1]);
    gl.uniformMatrix3fv(at.view, false, [...right, ...up, ...out]);
    gl.uniform3fv(at.centre, centre);
    gl.uniform3f(at.zoom, (2 * scale) / width, (2 * scale) / height, 1 / box.deep);
    const angle = alone ? 0 : around(path.angles[position]) * (Math.PI / 180);
    const turned = [Math.cos(angle), Math.sin(angle)];
    gl.uniform2fv(at.turn, turned);
    gl.uniform3f(at.shift, 0, 0, 0);
    const paint = (rgb, alpha = 1) => gl.uniform4f(at.paint, ...rgb.map((c) => c / 255), alpha);
    const ownColours = () => paint([0, 0, 0], 0);
    const set = (lit, lift, size = 1) => {
      gl.uniform1i(at.lit, lit);
      gl.uniform1f(at.lift, lift);
      gl.uniform1f(at.size, size);
    };
    colourBy(choice);
    const errors = ["surface", "rays"].includes(choice.on);
    if (show.part) {
      set(true, 0);
      if (choice.on === "part") ownColours();
      else paint(errors ? [226, 222, 216] : theme.part);
      solid.draw();
      if (errors) {
        // Errors tint what is lit below them, each place once; of samples the worst first.
        set(false, LIFT, Math.max(1.5, 1.7 * scale * (report.verification?.spacing ?? 0)));
        ownColours();
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.DST_COLOR, gl.ZERO);
        gl.enable(gl.STENCIL_TEST);
        gl.stencilFunc(gl.EQUAL, 0, 255);
        gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
        gl.depthMask(false);
        (choice.on === "rays" ? left : samples).draw();
        gl.depthMask(true);
        gl.disable(gl.STENCIL_TEST);
        gl.disable(gl.BLEND);
      }
    }
    if (spot && choice.on === "rays") {
      // Seen through the part, so that it is not missed.
      gl.disable(gl.DEPTH_TEST);
      gl.uniform1i(at.ring, true);
      set(false, 0, 34 * devicePixelRatio);
      paint(theme.fault);
      spot.draw();
      gl.uniform1i(at.ring, false);
      gl.enable(gl.DEPTH_TEST);
    }
    for (const [name, line] of Object.entries(lines)) {
      if (!show[name] || (errors && name === "contacts")) continue;
      set(false, name === "contacts" ? LIFT : 0);
      if (errors) paint(theme.line);
      else ownColours();
      line.draw();
    }
    if (edges && show.edges) {
      // Through the part, so that none is missed.
      gl.disable(gl.DEPTH_TEST);
      set(false, 0);
      paint(theme.fault);
      edges.draw();
      gl.enable(gl.DEPTH_TEST);
    }
    if (alone) return;
    const reached = path.heights[position];
    const touching = !Number.isNaN(reached);
    if (touching) {
      set(false, 3 * LIFT, 9 * devicePixelRatio);
      paint(theme.mark);
      lines.contacts.dot(position);
    }
    if (show.wheel) {
      gl.uniform2f(at.turn, 1, 0);
      gl.uniform3f(at.shift, path.travels[position], touching ? reached : box.top, 0);
      set(true, 0);
      paint(theme.wheel, touching ? 0.62 : 0.25);
      gl.enable(gl.BLEND);
      gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      // Depth first, so that only what is nearest of it shines through.
      gl.colorMask(false, false, false, false);
      tool.draw();
      gl.colorMask(true, true, true, true);
      tool.draw();
      gl.disable(gl.BLEND);
    }
  }

  return { draw, gl, camera: () => camera, home: () => (camera = structuredClone(HOME)), scale: () => Math.min(canvas.width / box.wide, canvas.height / box.high) * camera.zoom };
}

/// A canvas as many pixels as it covers.
function fit(canvas) {
  const width = Math.round(canvas.clientWidth * devicePixelRatio);
  const height = Math.round(canvas.clientHeight * devicePixelRatio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
}

/// The middle of what is shown, and how wide, high and deep the picture has to be for it.
function extent() {
  if (alone) return boxed(part.points);
  const axis = (k) => part.points.filter((_, i) => i % 3 === k);
  const [from, to] = range([...range(path.travels), ...range(axis(0))]);
  const [y, z] = [axis(1), axis(2)];
  const radius = Math.max(...range(y.map((v, i) => Math.hypot(v, z[i]))), 1);
  const reach = Math.max(range(path.heights)[1], radius);
  const rim = Math.max(...contents.wheel.map(([, m]) => m));
  const { yaw, pitch } = HOME;
  return {
    centre: [(from + to) / 2, (reach + rim - radius) / 2, 0],
    wide: 1.03 * ((to - from) * Math.cos(yaw) + 2 * radius * Math.sin(yaw)),
    high: (reach + rim + radius) * Math.cos(pitch) + (to - from) * Math.sin(yaw) * Math.sin(pitch),
    deep: 2 * (to - from + reach + rim),
    top: reach + 20,
  };
}

/// The same for points that may lie anywhere.
function boxed(points) {
  const sides = [0, 1, 2].map((k) => range(points.filter((_, i) => i % 3 === k)));
  const across = Math.max(Math.hypot(...sides.map(([low, high]) => high - low)), 1e-6);
  return { centre: sides.map(([low, high]) => (low + high) / 2), wide: 1.05 * across, high: 0.8 * across, deep: 2 * across };
}

function link(gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function attribute(gl, number, data, size, kind, normalized = false) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(number);
  gl.vertexAttribPointer(number, size, kind, normalized, 0, 0);
  return buffer;
}

function indices(gl, data) {
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, data, gl.STATIC_DRAW);
}

function solidBuffers(gl, { points, triangles }) {
  const solid = figure(gl, gl.TRIANGLES, points, triangles);
  gl.bindVertexArray(solid.array);
  attribute(gl, 1, normals(points, triangles), 3, gl.FLOAT);
  return solid;
}

/// Points with a colour each, which can be given anew.
function tinted(gl, points) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  attribute(gl, 0, points, 3, gl.FLOAT);
  const tints = attribute(gl, 2, new Uint8Array((points.length / 3) * 4), 4, gl.UNSIGNED_BYTE, true);
  const colour = (all) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, tints);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, all);
  };
  return { array, colour };
}

/// Such points, drawn in this order as points, lines or triangles.
function figure(gl, mode, points, order) {
  const { array, colour } = tinted(gl, points);
  indices(gl, order);
  return {
    array,
    colour,
    draw() {
      gl.bindVertexArray(array);
      gl.drawElements(mode, order.length, gl.UNSIGNED_INT, 0);
    },
  };
}

function lineBuffers(gl, points, order) {
  const line = figure(gl, gl.LINE_STRIP, points, order);
  return {
    ...line,
    dot(i) {
      gl.bindVertexArray(line.array);
      gl.drawArrays(gl.POINTS, i, 1);
    },
  };
}

function shellBuffers(gl, { points, triangles }) {
  return figure(gl, gl.TRIANGLES, points, triangles);
}

/// Samples of the surface, those that stray most first.
function cloud(gl, { points, clearances }) {
  const order = Uint32Array.from(clearances, (_, i) => i);
  order.sort((a, b) => Math.abs(clearances[b]) - Math.abs(clearances[a]));
  return figure(gl, gl.POINTS, points, order);
}

/// Turns, moves and zooms by pointer and keys; calls `changed` after each.
function orbit(canvas, picture, changed) {
  const camera = () => picture.camera();
  const held = new Map();
  const turnBy = (dx, dy) => {
    camera().yaw -= dx * 0.008;
    camera().pitch = Math.min(Math.max(camera().pitch + dy * 0.008, -1.57), 1.57);
  };
  const moveBy = (dx, dy) => {
    const mm = devicePixelRatio / picture.scale();
    camera().pan[0] += dx * mm;
    camera().pan[1] -= dy * mm;
  };
  const zoomBy = (factor) => {
    camera().zoom = Math.min(Math.max(camera().zoom * factor, 0.3), 60);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (held.size === 2) {
      const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      zoomBy(apart(now) / Math.max(apart(before), 1));
      moveBy(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons & 6) moveBy(dx, dy);
    else turnBy(dx, dy);
    held.set(event.pointerId, now);
    changed();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY * 0.0015));
    changed();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const by = event.shiftKey ? moveBy : turnBy;
    const keys = {
      ArrowLeft: () => by(-25, 0), ArrowRight: () => by(25, 0), ArrowUp: () => by(0, -25), ArrowDown: () => by(0, 25),
      "+": () => zoomBy(1.2), "=": () => zoomBy(1.2), "-": () => zoomBy(1 / 1.2), 0: () => picture.home(),
    };
    const key = keys[event.key];
    if (!key || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    key();
    changed();
  });
}
