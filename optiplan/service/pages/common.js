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
  const SILENT = "The server does not answer. What you typed is kept in this browser; this page goes on by itself when the server is back.";
  const AGAIN = 1000; // ms before what was not answered is asked for again
  let away = false;
  const banner = () => byId("banner");
  const failing = ({ status }) => status >= 500 || status === 401 || status === 429;

  const well = (path) => fetch(path, { cache: "no-store" }).then((answer) => !failing(answer), () => false);

  // Says what is wrong until an address is answered: that which was not, or that of the server's health.
  function lost(words = SILENT, path = "healthz") {
    if (away) return;
    away = true;
    banner().textContent = words;
    banner().hidden = false;
    document.documentElement.classList.add("away");
    setTimeout(() => look(path), AGAIN);
  }

  async function look(path) {
    if (!(await well(path))) { setTimeout(() => look(path), AGAIN); return; }
    away = false;
    banner().hidden = true;
    document.documentElement.classList.remove("away");
    dispatchEvent(new Event("optiplan:back"));
  }

  // As fetch; where no answer comes at all, or that of a proxy before a server that is away, the page says so.
  async function ask(path, options) {
    try {
      const answer = await fetch(path, options), ours = (answer.headers.get("Content-Type") || "").includes("json");
      if (answer.status >= 502 && answer.status <= 504 && !ours) throw new Error("the server does not answer");
      return answer;
    } catch (error) {
      unheard(error, path, options);
    }
  }

  // What was not answered, or not to its end: the page says so until it is, or until the server is well where it is not asked for again.
  function unheard(error, path, options) {
    if (!leaving) lost(SILENT, options ? "healthz" : path);
    throw error;
  }

  // An answer and its whole text.
  async function read(path, options) {
    const answer = await ask(path, options);
    return [answer, await answer.text().catch((error) => unheard(error, path, options))];
  }

  let leaving = false;
  addEventListener("pagehide", () => { leaving = true; });
  addEventListener("beforeunload", () => { leaving = true; setTimeout(() => { leaving = false; }, 3000); });
  addEventListener("unhandledrejection", (event) => { if (away || leaving) event.preventDefault(); });

  // One answer, {status, data}, whatever it says.
  async function said(path, options = { method: "GET" }) {
    const [answer, text] = await read(path, options), { status, statusText } = answer;
    try { return { status, data: status === 204 ? null : JSON.parse(text) }; } catch (error) {
      if (answer.ok) throw error;
      return { status, data: { error: `${status} ${statusText}` } }; // a proxy's page
    }
  }

  const post = (path, data) => said(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(data) });
  const back = () => new Promise((go) => { if (away) addEventListener("optiplan:back", go, { once: true }); else setTimeout(go, AGAIN); });

  // What takes the server work, while it is `wanted`: {status, data}, asked for a few times, since it may fail at this very thing; null once it is not.
  // An answer that does not come counts where the server is well: a proxy may stand before it.
  async function tried(path, wanted, times = 5) {
    for (;;) {
      const answer = await said(path).catch(() => null);
      if (answer && !failing(answer)) return wanted() ? answer : null;
      if ((answer || (await well("healthz"))) && --times <= 0 && wanted()) return answer || { status: 502, data: { error: "no answer came" } };
      if (!wanted()) return null;
      await back();
    }
  }

  // The answer at an address, with its whole text, however long it takes: while there is none, or none of use, the page says why.
  async function answered(path) {
    for (;;) {
      const [answer, text] = await read(path).catch(() => []);
      if (answer && !failing(answer)) return { ok: answer.ok, status: answer.status, text };
      if (answer) {
        let said = `${answer.status} ${answer.statusText}`;
        try { said = JSON.parse(text).error || said; } catch { /* a proxy's page */ }
        lost(`The server says: ${said}. This page goes on by itself when it can.`, path);
      }
      await back();
    }
  }

  // The data at an address; null where there is nothing, or no more.
  async function get(path) {
    const answer = await answered(path);
    return answer.status === 404 ? null : JSON.parse(answer.text);
  }

  // Watches a stream of events, by their names; where it is closed for good, `gone` finds out why.
  function stream(path, acts, gone) {
    const events = new EventSource(path);
    for (const [name, act] of Object.entries(acts)) events.addEventListener(name, (event) => act(JSON.parse(event.data)));
    events.addEventListener("error", () => {
      if (events.readyState === EventSource.CLOSED) setTimeout(gone, AGAIN);
      else ask("healthz").catch(() => {}); // the browser tries again by itself, and the page says if nobody is there
    });
    return events;
  }

  // Of many wishes in a row only the last is asked for, one at a time; each ends when none is left.
  function latest(work) {
    let busy = false, wish = null, all = null;
    async function run() {
      try {
        while (wish) {
          const now = wish;
          wish = null;
          await work(...now);
        }
      } finally { busy = false; }
    }
    return (...given) => {
      wish = given;
      if (busy) return all;
      busy = true;
      return (all = run());
    };
  }

  // Looks at what others change, too: `show` says whether anything runs, and is called again, often while it does.
  // A page that nobody sees looks when it is seen again.
  function watching(show, often, seldom) {
    let waiting = 0;
    return async function look() {
      clearTimeout(waiting);
      let wait = seldom;
      try { if (await show()) wait = often; } finally {
        clearTimeout(waiting);
        waiting = setTimeout(() => { if (document.visibilityState === "visible" || wait === often) look(); else addEventListener("visibilitychange", look, { once: true }); }, wait);
      }
    };
  }

  // The text of the problem that the address names behind its #, a stored one or that of a run (run=…); null where it names none.
  async function named() {
    const hash = location.hash.slice(1), run = /^run=([0-9a-f]{32})$/.exec(hash);
    if (run) {
      const answer = await answered(`api/runs/${run[1]}/problem`);
      return answer.ok ? answer.text : null;
    }
    const stored = /^[0-9a-f]{64}$/.test(hash) ? await get("api/problems/" + hash) : null;
    if (!stored) return null;
    const { problem } = stored;
    return typeof problem === "string" ? problem : JSON.stringify(problem, null, 2);
  }

  // A path through points [x, y] as an SVG element, in steps or straight.
  function drawn(svg, d, colour) {
    const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
    for (const [name, value] of Object.entries({ d, fill: "none", stroke: colour, "stroke-width": "2", "vector-effect": "non-scaling-stroke" })) line.setAttribute(name, value);
    svg.append(line);
  }
  return { byId, make, ask, post, get, tried, stream, latest, watching, named, drawn };
})();
