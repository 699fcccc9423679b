"use strict";
// Changes of a problem's text that the scene asks for: one key of the file is written anew, the rest stays as it is.
const StudioText = (() => {
  const plain = /^[A-Za-z_][A-Za-z0-9_./-]*$/, words = new Set(["true", "false", "null", "yes", "no", "on", "off", "y", "n"]);

  function flow(value) {
    if (Array.isArray(value)) return "[" + value.map(flow).join(", ") + "]";
    if (value && typeof value === "object") return "{" + Object.entries(value).map(([key, one]) => `${flow(key)}: ${flow(one)}`).join(", ") + "}";
    if (typeof value === "number") return String(Number(value.toFixed(6)));
    if (typeof value === "string" && plain.test(value) && !words.has(value.toLowerCase())) return value;
    return JSON.stringify(value);
  }

  function block(key, value) {
    if (key !== "scene") return `${key}: ${flow(value)}\n`;
    const groups = Object.entries(value).filter(([, bodies]) => bodies.length);
    return "scene:\n" + groups.map(([group, bodies]) => `  ${group}:\n` + bodies.map((body) => `    - ${flow(body)}\n`).join("")).join("");
  }

  // A key at the margin goes on until the next line that begins at the margin.
  function replaced(text, key, value) {
    const lines = text.split("\n"), first = lines.findIndex((line) => line.startsWith(key + ":"));
    if (first < 0) return text.replace(/\n*$/, "\n") + block(key, value);
    let next = first + 1;
    while (next < lines.length && (lines[next] === "" || /^[\s\-\]}]/.test(lines[next]))) next++;
    return [...lines.slice(0, first), ...block(key, value).trimEnd().split("\n"), ...lines.slice(next)].join("\n");
  }
  return { replaced };
})();
