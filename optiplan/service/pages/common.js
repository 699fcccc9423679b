"use strict";
// What all pages of the service need: elements, requests, and of many wishes in a row the last.
const Page = (() => {
  const byId = (id) => document.getElementById(id);

  function make(tag, properties = {}, ...children) {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  }

  // Whether the server answers; while it does not, a line says so, and it is asked again and again.
  let away = false;
  const banner = () => byId("banner");

  function lost() {
    if (away) return;
    away = true;
    banner().textContent = "The server does not answer. What you typed is kept in this browser; this page goes on by itself when the server is back.";
    banner().hidden = false;
    document.documentElement.classList.add("away");
    setTimeout(look, 1000);
  }

  async function look() {
    try {
      if (!(await fetch("healthz", { cache: "no-store" })).ok) throw new Error("not yet");
    } catch (error) {
      setTimeout(look, 1500);
      return;
    }
    away = false;
    banner().hidden = true;
    document.documentElement.classList.remove("away");
    dispatchEvent(new Event("optiplan:back"));
  }

  // As fetch; where no answer comes at all, the page says so.
  async function ask(path, options) {
    try {
      return await fetch(path, options);
    } catch (error) {
      if (!leaving) lost();
      throw error;
    }
  }
  let leaving = false;
  addEventListener("pagehide", () => { leaving = true; });
  addEventListener("beforeunload", () => { leaving = true; setTimeout(() => { leaving = false; }, 3000); });
  addEventListener("unhandledrejection", (event) => { if (away || leaving) event.preventDefault(); });

  async function post(path, data) {
    const answer = await ask(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(data) });
    return { status: answer.status, data: answer.status === 204 ? null : await answer.json() };
  }

  const get = async (path) => (await ask(path)).json();

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

  // The text of the problem that the address names behind its #, a stored one or that of a run (run=…); null where it names none.
  async function named() {
    const hash = location.hash.slice(1), run = /^run=([0-9a-f]{32})$/.exec(hash);
    if (run) {
      const answer = await ask(`api/runs/${run[1]}/problem`);
      return answer.ok ? answer.text() : null;
    }
    const stored = /^[0-9a-f]{64}$/.test(hash) ? await ask("api/problems/" + hash) : null;
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
  return { byId, make, ask, lost, post, get, latest, named, drawn };
})();
