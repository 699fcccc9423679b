"use strict";
// Voxels of several robots, drawn as squares from back to front, all turned together.
const shown = JSON.parse(document.getElementById("data").textContent);
const view = { yaw: -0.6, pitch: 0.35, zoom: 1.0 };
const $ = (id) => document.getElementById(id);

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

// Viridis at nine places, enough for the eye.
const STOPS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99],
  [170, 220, 50], [253, 231, 37]];
function colour(t) {
  const x = Math.min(Math.max(t, 0), 1) * (STOPS.length - 1), k = Math.min(Math.floor(x), STOPS.length - 2), f = x - k;
  return "rgb(" + [0, 1, 2].map((i) => Math.round(STOPS[k][i] * (1 - f) + STOPS[k + 1][i] * f)).join(",") + ")";
}
const COLOURS = Array.from({ length: 64 }, (_, k) => colour(k / 63));

for (const robot of shown.robots) {
  robot.points = floats(robot.points);
  for (const name in robot.values) robot.values[name] = floats(robot.values[name]);
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  robot.canvas = document.createElement("canvas");
  robot.canvas.className = "voxels";
  caption.textContent = robot.caption;
  figure.append(robot.canvas, caption);
  $("panels").append(figure);
  listen(robot.canvas);
}
for (const name of Object.keys(shown.robots[0].values)) $("value").add(new Option(shown.labels[name], name));

function range(name) {
  let high = 0;
  for (const robot of shown.robots) for (const v of robot.values[name]) if (v > high) high = v;
  return high || 1;
}

function draw(robot) {
  const canvas = robot.canvas, ratio = window.devicePixelRatio || 1, side = canvas.clientWidth;
  canvas.width = side * ratio;
  canvas.height = side * ratio;
  const pen = canvas.getContext("2d"), scale = 0.45 * side * ratio * view.zoom / robot.radius, half = 0.5 * side * ratio;
  const name = $("value").value, value = robot.values[name], high = range(name), cut = Number($("cut").value) * robot.radius;
  const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
  const seen = [];
  for (let k = 0; k < value.length; k++) {
    const x = robot.points[3 * k], y = robot.points[3 * k + 1], z = robot.points[3 * k + 2];
    if (y < cut - 1e-6 || (value[k] < 0 && !$("holes").checked)) continue;
    const across = cy * x - sy * y, deep = sy * x + cy * y;
    seen.push([cp * deep - sp * z, half + scale * across, half - scale * (sp * deep + cp * z), value[k]]);
  }
  seen.sort((a, b) => b[0] - a[0]);
  const size = 0.82 * robot.edge * scale;
  for (const [, x, y, v] of seen) {
    pen.fillStyle = v < 0 ? "rgba(214,60,50,0.55)" : COLOURS[Math.round(63 * Math.min(v / high, 1))];
    const s = v < 0 ? 0.45 * size : size;
    pen.fillRect(x - s / 2, y - s / 2, s, s);
  }
  pen.strokeStyle = "#7a8794";
  pen.beginPath();
  pen.arc(half, half, robot.radius * scale, 0, 2 * Math.PI);
  pen.stroke();
}

function redraw() {
  const high = range($("value").value);
  $("low").textContent = "0";
  $("high").textContent = high.toPrecision(3);
  const pen = $("scale").getContext("2d");
  for (let k = 0; k < 160; k++) {
    pen.fillStyle = colour(k / 159);
    pen.fillRect(k, 0, 1, 12);
  }
  shown.robots.forEach(draw);
}

function listen(canvas) {
  let last = null;
  canvas.addEventListener("pointerdown", (e) => { last = e; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", () => { last = null; });
  canvas.addEventListener("pointermove", (e) => {
    if (!last) return;
    view.yaw += 0.01 * (e.clientX - last.clientX);
    view.pitch = Math.min(Math.max(view.pitch + 0.01 * (e.clientY - last.clientY), -1.57), 1.57);
    last = e;
    redraw();
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    view.zoom *= Math.exp(-0.001 * e.deltaY);
    redraw();
  }, { passive: false });
}

for (const id of ["value", "cut", "holes"]) $(id).addEventListener("input", redraw);
window.addEventListener("resize", redraw);
redraw();
