"use strict";
// What all pages of the service need: elements, requests, and of many wishes in a row the last.
const Page = (() => {
  const byId = (id) => document.getElementById(id);

  function make(tag, properties = {}, ...children) {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  }

  async function post(path, data) {
    const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(data) });
    return { status: answer.status, data: answer.status === 204 ? null : await answer.json() };
  }

  const get = async (path) => (await fetch(path)).json();

  // Of many wishes in a row only the last is asked for, one at a time.
  function latest(work) {
    let busy = false, wish = null;
    return async (...given) => {
      wish = given;
      if (busy) return;
      busy = true;
      try {
        while (wish) {
          const now = wish;
          wish = null;
          await work(...now);
        }
      } finally { busy = false; }
    };
  }

  // The text of the stored problem that the address names behind its #; null where it names none.
  async function named() {
    const hash = location.hash.slice(1), stored = /^[0-9a-f]{64}$/.test(hash) ? await fetch("api/problems/" + hash) : null;
    if (!stored || !stored.ok) return null;
    const { problem } = await stored.json();
    return typeof problem === "string" ? problem : JSON.stringify(problem, null, 2);
  }

  // A path through points [x, y] as an SVG element, in steps or straight.
  function drawn(svg, d, colour) {
    const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
    for (const [name, value] of Object.entries({ d, fill: "none", stroke: colour, "stroke-width": "2", "vector-effect": "non-scaling-stroke" })) line.setAttribute(name, value);
    svg.append(line);
  }

  // The last seconds of one column of rows [time, ...] as a curve from 0 to `top`; gaps where there is no value.
  function strip(svg, past, column, seconds, colour, top = 0) {
    const rows = past.filter((row) => row[column] !== null), values = rows.map((row) => row[column]);
    svg.replaceChildren();
    if (rows.length < 2) return values;
    const end = past.at(-1)[0], least = Math.min(0, ...values), most = Math.max(top, ...values, 1e-6);
    const points = rows.map((row) => `${(300 * (row[0] - end + seconds)) / seconds} ${57 - (54 * (row[column] - least)) / (most - least)}`);
    drawn(svg, "M" + points.join(" L"), colour);
    return values;
  }
  return { byId, make, post, get, latest, named, drawn, strip };
})();
