"use strict";
// What an element holds as base64 of gzip, as text; null where there is no such element or the browser cannot unpack it.
async function unpacked(id) {
  const packed = document.getElementById(id);
  if (!packed || !("DecompressionStream" in window)) return null;
  const bytes = Uint8Array.from(atob(packed.textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}
// Draws Plotly figures: `const [show, data] = await figuresIn()`, then `show(target, traces, layouts)` for each.
// `data` is what #page-data holds; its `dark` says what stands for each colour on a dark ground. Nothing is returned where
// there are no figures, or the browser cannot unpack them.
async function figuresIn() {
  const OPTIONS = {responsive: true, displaylogo: false, displayModeBar: "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]]};

  // The page's policy names Plotly by its hash. What stands in several figures is written once: {"$": 3} is entry 3 of
  // the pool; lists of numbers are shared.
  if (!document.getElementById("library")) return [null, null];
  const library = await unpacked("library");
  if (library !== null) document.head.append(Object.assign(document.createElement("script"), {textContent: library}));
  if (!("Plotly" in window)) {
    document.getElementById("outdated").hidden = false;
    return [null, null];
  }
  const {pool, value} = JSON.parse(await unpacked("page-data"));
  function whole(part) {
    if (Array.isArray(part)) return part.some((entry) => entry && typeof entry === "object") ? part.map(whole) : part;
    if (!part || typeof part !== "object") return part;
    if ("$" in part) return whole(pool[part.$]);
    return Object.fromEntries(Object.entries(part).map(([key, entry]) => [key, whole(entry)]));
  }
  const data = whole(value), dark = data.dark;

  const prefersDark = matchMedia("(prefers-color-scheme: dark)"), PAPER = 700, FLATTER = 0.8;
  const drawn = new Map();
  let printing = false;
  function coloured(part, key) {
    if (Array.isArray(part)) return typeof part[0] === "object" ? part.map((entry) => coloured(entry, key)) : part;
    if (part && typeof part === "object")
      return Object.fromEntries(Object.entries(part).map(([name, entry]) => [name, coloured(entry, name)]));
    return prefersDark.matches && !printing && /color$/.test(key) && part in dark ? dark[part] : part;
  }
  // `layouts`: by number of columns, the widest that fits is taken. Plotly writes into what it is given: copies.
  function show(target, traces, layouts) {
    drawn.set(target, [traces, layouts]);
    const room = printing ? PAPER : document.getElementById(target).clientWidth;
    const columns = room < 480 ? 1 : room < 680 ? 2 : 3;
    const fitting = Object.keys(layouts).map(Number).filter((n) => n <= columns);
    const layout = structuredClone(coloured(layouts[Math.max(...fitting)], ""));
    if (printing) { layout.width = PAPER; layout.height *= FLATTER; }
    Plotly.react(target, coloured(traces, ""), layout, OPTIONS);
  }
  const showAgain = () => { for (const [target, [traces, layouts]] of drawn) show(target, traces, layouts); };
  prefersDark.addEventListener("change", showAgain);
  addEventListener("beforeprint", () => { printing = true; showAgain(); });
  addEventListener("afterprint", () => { printing = false; showAgain(); });
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width && !printing) { width = innerWidth; showAgain(); } });

  return [show, data];
}
