"use strict";
// Texts that were typed in this browser and not stored: each page keeps its own draft, so that tabs and problems do not meet.
// A draft is {id, text, at, opened}: `at` in ms, `opened` the text that it began from.
const Drafts = (() => {
  const KEY = "optiplan.draft", MOST = 10;
  const id = crypto.getRandomValues(new Uint32Array(2)).join("-");

  // The drafts of this browser, the newest first; none where it keeps nothing.
  function all() {
    try { return [].concat(JSON.parse(localStorage.getItem(KEY)) || []).filter((one) => one.text); } catch { return []; }
  }

  // Whether the browser could write these instead.
  function write(drafts) {
    try { localStorage.setItem(KEY, JSON.stringify(drafts.slice(0, MOST))); return true; } catch { return false; }
  }

  const others = (than) => all().filter((one) => one.id !== than);
  const drop = (draft) => write(others(draft.id));

  // The draft of this page, or none where the text is what it began from. False where the browser cannot keep it.
  function keep(text, opened) {
    if (text === opened) return write(others(id));
    const kept = write([{ id, text, at: Date.now(), opened }, ...others(id)]);
    if (kept) sessionStorage.setItem(KEY, id);
    return kept;
  }

  // The draft that this tab left, with the id of this page, since a tab that was doubled left it to two; null for none.
  function take() {
    try {
      const left = all().find((one) => one.id === sessionStorage.getItem(KEY)), mine = left && { ...left, id };
      if (mine && write([mine, ...others(left.id)])) sessionStorage.setItem(KEY, id);
      return mine || null;
    } catch { return null; }
  }

  return { all, keep, drop, take };
})();
