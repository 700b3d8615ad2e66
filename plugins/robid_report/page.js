"use strict";
// Draws the page's figures, which robid made, from what `figuresIn` unpacks (in figures.js). Text from there is only ever written as text.
(async () => {
  // On paper nothing can be unfolded: all is but what takes pages (.screen), and folded again afterwards.
  let folded = [];
  addEventListener("beforeprint", () => {
    folded = Array.from(document.querySelectorAll("details:not([open]):not(.screen)"));
    folded.forEach((one) => { one.open = true; });
  });
  addEventListener("afterprint", () => { folded.forEach((one) => { one.open = false; }); folded = []; });

  const press = (buttons, chosen) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === chosen)));

  const SVG = "http://www.w3.org/2000/svg";
  function element(name, attributes, parent) {
    const node = document.createElementNS(SVG, name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    if (parent) parent.appendChild(node);
    return node;
  }
  const [show, data] = await figuresIn();
  if (!show) return;

  function matrix(target, configuration, chosen, choose) {
    const response = data.response, n = response.axes.length, W = 100, H = 66, GAP = 6;
    // Letters of 10 pixels however small the drawing becomes, as far as they fit beside one another.
    const letter = Math.min(Math.max(10, 10 * (14 + n * (W + GAP)) / (target.clientWidth || 650)), 22), LEFT = letter + 4, TOP = letter + 4;
    const magnitude = (o, i, name) => entries[o][i].find((trace) => trace.name === name && trace.yaxis === "y");
    const entries = response.entries.data[configuration], start = response.fitted ? "start" : "robot file";
    const f = magnitude(0, 0, "measured").x.map(Math.log), first = f[0], span = f[f.length - 1] - first || 1;
    let low = Infinity, high = -Infinity;
    for (const row of entries) for (const entry of row) for (const trace of entry)
      if (trace.yaxis === "y" && (trace.name === "measured" || trace.name === start))
        for (const v of trace.y) if (v !== null && v > -200) { low = Math.min(low, v); high = Math.max(high, v); }
    high += 3; low = Math.max(low - 3, high - 90);
    const svg = element("svg", {"font-size": letter, viewBox: `0 0 ${LEFT + n * (W + GAP)} ${TOP + n * (H + GAP)}`});
    const path = (trace, dots) => {
      let d = "", open = false;
      trace.y.forEach((v, k) => {
        if (v === null || v < low) { open = false; return; }
        const x = (4 + (W - 8) * (Math.log(trace.x[k]) - first) / span).toFixed(1), y = (4 + (H - 8) * (high - v) / (high - low)).toFixed(1);
        d += dots ? `M${x} ${y}h0` : (open ? "L" : "M") + x + " " + y;
        open = true;
      });
      return d || "M0 0";
    };
    response.axes.forEach((name, k) => {
      const room = Math.floor(W / (0.6 * letter)), short = name.length > room ? name.slice(0, room - 1) + "…" : name;
      element("text", {x: LEFT + k * (W + GAP) + W / 2, y: 0.9 * letter, "text-anchor": "middle"}, svg).textContent = short;
      element("text", {transform: `translate(${0.9 * letter} ${TOP + k * (H + GAP) + H / 2}) rotate(-90)`, "text-anchor": "middle"}, svg).textContent = short;
    });
    for (let o = 0; o < n; o++) for (let i = 0; i < n; i++) {
      const label = response.axes[o] + " over " + response.axes[i];
      const cell = element("g", {class: "cell" + (o === chosen[0] && i === chosen[1] ? " chosen" : ""), tabindex: "0", role: "button",
        transform: `translate(${LEFT + i * (W + GAP)} ${TOP + o * (H + GAP)})`}, svg);
      cell.setAttribute("aria-label", label);
      element("rect", {width: W, height: H, rx: 4}, cell);
      element("path", {class: "s", d: path(magnitude(o, i, start), false)}, cell);
      element("path", {class: "m", d: path(magnitude(o, i, "measured"), true)}, cell);
      if (response.fitted) element("path", {class: "f", d: path(magnitude(o, i, "fitted model"), false)}, cell);
      element("title", {}, cell).textContent = label;
      cell.addEventListener("click", () => choose(o, i));
      cell.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(o, i); } });
    }
    target.replaceChildren(svg);
  }

  if (data.response) {
    const axes = data.response.axes, buttons = Array.from(document.querySelectorAll("[data-configuration]"));
    let configuration = 0, chosen = [0, Math.min(1, axes.length - 1)];
    const {rows, entries} = data.response;
    const drawAxes = () => { for (const id in rows) show(id, rows[id].data[configuration], rows[id].layouts); };
    const drawEntry = () => {
      if (axes.length < 2) return;
      const focused = document.activeElement && document.activeElement.closest("#response-matrix");
      matrix(document.getElementById("response-matrix"), configuration, chosen, (o, i) => { chosen = [o, i]; drawEntry(); });
      if (focused) document.querySelector("#response-matrix .chosen").focus();
      document.getElementById("response-entry-title").textContent = "Acceleration of " + axes[chosen[0]] + " over torque of " + axes[chosen[1]];
      show("response-entry", entries.data[configuration][chosen[0]][chosen[1]], entries.layouts);
    };
    buttons.forEach((button) => button.addEventListener("click", () => {
      configuration = Number(button.dataset.configuration); press(buttons, button); drawAxes(); drawEntry();
    }));
    drawAxes(); drawEntry();
    for (const event of ["resize", "beforeprint", "afterprint"]) addEventListener(event, drawEntry);
  }

  data.time.forEach((comparison, index) => {
    const buttons = Array.from(document.querySelectorAll(`[data-plot="${index}"]`));
    const draw = (a) => {
      const one = comparison.axes[a];
      show("time-" + index, one.figure.data, {1: one.figure.layout});
      document.getElementById("time-note-" + index).textContent = one.name + ": " + one.note;
    };
    buttons.forEach((button) => button.addEventListener("click", () => { press(buttons, button); draw(Number(button.dataset.time)); }));
    draw(0);
  });
})();
