"use strict";
// Draws Plotly figures: `const show = await figuresIn(dark)`, then `show(target, traces, layouts)` for each.
// `dark`: what stands for each colour on a dark ground. Nothing is returned where the browser cannot unpack Plotly.
async function figuresIn(dark) {
  const OPTIONS = {responsive: true, displaylogo: false, displayModeBar: "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]]};

  // Plotly stands in the page compressed; the page's policy names what comes out of it by its hash.
  async function unpackLibrary() {
    const packed = document.getElementById("library");
    if (!packed) return true;
    if (!("DecompressionStream" in window)) return false;
    const bytes = Uint8Array.from(atob(packed.textContent), (letter) => letter.charCodeAt(0));
    const script = document.createElement("script");
    script.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
    document.head.append(script);
    return "Plotly" in window;
  }

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

  if (await unpackLibrary()) return show;
  document.getElementById("outdated").hidden = false;
}
