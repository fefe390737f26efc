"use strict";
const film = JSON.parse(document.getElementById("data").textContent);
const [moving, play, slider, clock, pace] =
  ["moving", "play", "frame", "clock", "pace"].map((name) => document.getElementById(name));

const add = (name, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return moving.appendChild(made);
};
const onPlan = (x, y) => [film.plan[0] + film.plan[1] * x, film.plan[2] + film.plan[3] * y];
const onPlane = (s, v) => [film.plane[0] + film.plane[1] * s, film.plane[2] + film.plane[3] * v];

const actors = film.bodies.map((body) => {
  const colour = body.colour;
  const trail = add("path", {
    fill: "none", stroke: colour, "stroke-width": 1.2, "stroke-dasharray": body.dashes,
  });
  const radius = body.radius * film.plan[1];
  const link = add("path", { fill: "none", stroke: colour, "stroke-width": 1.2 });
  const disk = add("circle", { r: radius, fill: colour, stroke: "#000000", "stroke-width": 0.8 });
  const mark = add("line", { stroke: "#ffffff", "stroke-width": body.turn ? 1.4 : 0 });
  const point = add("circle", { r: body.point ? 3 : 0, fill: colour });
  return { body, trail, link, disk, mark, point, radius };
});

const path = ([times, places, speeds], from, to) => {
  let text = "", pen = "M";
  for (let n = 0; n < times.length && times[n] <= to; n += 1) {
    if (times[n] < from) continue;
    if (places[n] === null) { pen = "M"; continue; }
    text += pen + onPlane(places[n], speeds[n]).join(" ");
    pen = "L";
  }
  return text;
};

const coil = ({ foot, coil }, x, y) => {
  const [along, up] = [x - foot[0], y - foot[1]];
  const length = Math.hypot(along, up) || 1;
  const places = coil.map(([share, aside]) =>
    onPlan(foot[0] + share * along - (aside * up) / length,
      foot[1] + share * up + (aside * along) / length).join(" "));
  return `M${places.join("L")}`;
};

const show = (frame) => {
  const from = Math.max(film.time[Math.max(0, frame - film.past)], film.time[frame] - film.span);
  for (const { body, trail, link, disk, mark, point, radius } of actors) {
    const [x, y] = onPlan(body.x[frame], body.y[frame]);
    disk.setAttribute("cx", x);
    disk.setAttribute("cy", y);
    if (body.turn) {
      mark.setAttribute("x1", x);
      mark.setAttribute("y1", y);
      mark.setAttribute("x2", x + 0.85 * radius * Math.sin(body.turn[frame]));
      mark.setAttribute("y2", y - 0.85 * radius * Math.cos(body.turn[frame]));
    }
    if (body.foot) link.setAttribute("d", coil(body, body.x[frame], body.y[frame]));
    const [across, along] = onPlane(body.across[frame], body.up[frame]);
    point.setAttribute("cx", across);
    point.setAttribute("cy", along);
    trail.setAttribute("d", path(body.trail, from, film.time[frame]));
  }
  clock.textContent = `t = ${film.time[frame].toFixed(film.digits)} s`;
  slider.value = frame;
  slider.setAttribute("aria-valuetext", clock.textContent);
};

let running = false, begun = 0, first = 0;
const last = film.time.length - 1;
const stop = () => { running = false; play.textContent = "Play"; };
const step = (now) => {
  if (!running) return;
  const gone = ((now - begun) / 1000) * film.rate * Number(pace.value);
  const frame = Math.min(last, first + Math.max(0, Math.floor(gone)));
  show(frame);
  if (frame === last) stop();
  else requestAnimationFrame(step);
};
const start = () => {
  first = Number(slider.value) === last ? 0 : Number(slider.value);
  begun = performance.now();
  running = true;
  play.textContent = "Pause";
  requestAnimationFrame(step);
};
play.addEventListener("click", () => (running ? stop() : start()));
slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
pace.addEventListener("change", () => { if (running) start(); });
show(0);
