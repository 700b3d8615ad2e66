"use strict";
// Draws the page's plots from the numbers in #page-data. Text from there is only ever written as text.
(() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const INK = "#1d2733", SOFT = "#5b6875", LINE = "#e6eaef";
  const MEASURED = "#24476b", BAND = "rgba(36,71,107,0.16)", MODEL = "#c8501e", START = "#9aa7b4", RESIDUAL = "#4f7f6a";
  const FONT = {family: 'ui-sans-serif, system-ui, -apple-system, "Segoe UI", Roboto, Arial, sans-serif', size: 12, color: SOFT};
  const OPTIONS = {responsive: true, displaylogo: false, displayModeBar: "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]]};
  const MODEBAR = {bgcolor: "rgba(0,0,0,0)", color: "#b9c3cd", activecolor: SOFT};
  // Plotly reads a little HTML in its labels; names are shown as they are.
  const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const press = (buttons, chosen) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === chosen)));

  function axis(extra) {
    return Object.assign({gridcolor: LINE, zeroline: false, linecolor: "#b9c3cd", ticks: "outside", ticklen: 3,
      tickcolor: "#b9c3cd", automargin: true}, extra);
  }
  // 1, 2, 5 per decade: what people read off a logarithmic axis of one or two decades.
  const TICKS = [-3, -2, -1, 0, 1, 2, 3].flatMap((e) => [1, 2, 5].map((m) => Number((m * 10 ** e).toPrecision(1))));
  // A phase that passes 180 degrees is broken there, not drawn across the plot.
  function broken(x, y) {
    const xs = [], ys = [];
    for (let k = 0; k < x.length; k++) {
      if (k && y[k] !== null && y[k - 1] !== null && Math.abs(y[k] - y[k - 1]) > 180) { xs.push(x[k]); ys.push(null); }
      xs.push(x[k]); ys.push(y[k]);
    }
    return [xs, ys];
  }

  function bode(target, configuration, entries, columns, height) {
    const response = data.response, f = response.frequency, traces = [];
    const rows = Math.ceil(entries.length / columns), gapX = columns > 1 ? 0.055 : 0, gapY = rows > 1 ? 0.13 : 0;
    const width = (1 - gapX * (columns - 1)) / columns, tall = (1 - gapY * (rows - 1)) / rows;
    const layout = {height: height * rows, margin: {l: 46, r: 8, t: 24, b: 36}, font: FONT, showlegend: false, modebar: MODEBAR,
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "#fff", annotations: [], hovermode: "closest"};
    entries.forEach(([o, i, title], n) => {
      const id = n ? String(n + 1) : "", column = n % columns, row = Math.floor(n / columns);
      const left = column * (width + gapX), bottom = 1 - (row + 1) * tall - row * gapY;
      const split = bottom + 0.38 * tall, pick = (part) => part[configuration][o][i];
      const magnitude = {xaxis: "x" + id, yaxis: "y" + id}, phase = {xaxis: "x" + id, yaxis: "y" + (n + 101)};
      const line = (y, colour, width, dash, where, name) => {
        const [xs, ys] = where === phase ? broken(f, y) : [f, y];
        traces.push(Object.assign({x: xs, y: ys, mode: "lines", line: {color: colour, width: width, dash: dash},
          name: name, hovertemplate: "%{x:.3g} Hz, %{y:.2f}<extra>" + name + "</extra>"}, where));
      };
      const band = response.band, low = pick(band.low), high = pick(band.high);
      const known = f.map((_, k) => k).filter((k) => low[k] !== null && high[k] !== null);
      if (known.length) {
        const back = known.slice().reverse();
        traces.push(Object.assign({x: known.map((k) => f[k]).concat(back.map((k) => f[k])),
          y: known.map((k) => low[k]).concat(back.map((k) => high[k])), mode: "lines", fill: "toself", fillcolor: BAND,
          line: {width: 0}, hoverinfo: "skip"}, magnitude));
      }
      for (const [part, where] of [["db", magnitude], ["deg", phase]]) {
        line(pick(response.start[part]), START, 1.1, "4px,3px", where, response.model ? "start" : "robot file");
        traces.push(Object.assign({x: f, y: pick(response.measured[part]), mode: "markers", name: "measured",
          marker: {color: MEASURED, size: 3.6}, hovertemplate: "%{x:.3g} Hz, %{y:.2f}<extra>measured</extra>"}, where));
        if (response.model) line(pick(response.model[part]), MODEL, 1.6, "solid", where, "fitted model");
      }
      layout["xaxis" + id] = axis({type: "log", domain: [left, left + width], anchor: "y" + (n + 101), tickvals: TICKS,
        ticktext: TICKS.map(String), title: row === rows - 1 ? {text: "Hz", standoff: 4} : undefined});
      layout["yaxis" + id] = axis({domain: [split + 0.03 * tall, bottom + tall], anchor: "x" + id, nticks: 6,
        title: column === 0 ? {text: "dB", standoff: 2} : undefined});
      layout["yaxis" + (n + 101)] = axis({domain: [bottom, split - 0.03 * tall], anchor: "x" + id, range: [-190, 190],
        tickvals: [-180, 0, 180], title: column === 0 ? {text: "deg", standoff: 2} : undefined});
      if (title) layout.annotations.push({text: plain(title), x: left, y: bottom + tall, xref: "paper", yref: "paper",
        xanchor: "left", yanchor: "bottom", showarrow: false, font: {size: 13, color: INK}});
    });
    Plotly.react(target, traces, layout, OPTIONS);
  }

  const SVG = "http://www.w3.org/2000/svg";
  function element(name, attributes, parent) {
    const node = document.createElementNS(SVG, name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    if (parent) parent.appendChild(node);
    return node;
  }
  function matrix(target, configuration, chosen, choose) {
    const response = data.response, n = response.axes.length, W = 100, H = 66, GAP = 6, LEFT = 14, TOP = 14;
    const f = response.frequency.map(Math.log), first = f[0], span = f[f.length - 1] - first || 1;
    let low = Infinity, high = -Infinity;
    for (const part of [response.measured.db, response.start.db]) for (const row of part[configuration])
      for (const entry of row) for (const v of entry) if (v !== null && v > -200) { low = Math.min(low, v); high = Math.max(high, v); }
    high += 3; low = Math.max(low - 3, high - 90);
    const svg = element("svg", {viewBox: `0 0 ${LEFT + n * (W + GAP)} ${TOP + n * (H + GAP)}`});
    const path = (values, dots) => {
      let d = "", open = false;
      values.forEach((v, k) => {
        if (v === null || v < low) { open = false; return; }
        const x = (4 + (W - 8) * (f[k] - first) / span).toFixed(1), y = (4 + (H - 8) * (high - v) / (high - low)).toFixed(1);
        d += dots ? `M${x} ${y}h0` : (open ? "L" : "M") + x + " " + y;
        open = true;
      });
      return d || "M0 0";
    };
    response.axes.forEach((name, k) => {
      const short = name.length > 16 ? name.slice(0, 15) + "…" : name;
      element("text", {x: LEFT + k * (W + GAP) + W / 2, y: 9, "text-anchor": "middle"}, svg).textContent = short;
      element("text", {transform: `translate(9 ${TOP + k * (H + GAP) + H / 2}) rotate(-90)`, "text-anchor": "middle"}, svg).textContent = short;
    });
    for (let o = 0; o < n; o++) for (let i = 0; i < n; i++) {
      const label = response.axes[o] + " over " + response.axes[i];
      const cell = element("g", {class: "cell" + (o === chosen[0] && i === chosen[1] ? " chosen" : ""), tabindex: "0", role: "button",
        transform: `translate(${LEFT + i * (W + GAP)} ${TOP + o * (H + GAP)})`}, svg);
      cell.setAttribute("aria-label", label);
      element("rect", {width: W, height: H, rx: 4}, cell);
      element("path", {class: "s", d: path(response.start.db[configuration][o][i], false)}, cell);
      element("path", {class: "m", d: path(response.measured.db[configuration][o][i], true)}, cell);
      if (response.model) element("path", {class: "f", d: path(response.model.db[configuration][o][i], false)}, cell);
      element("title", {}, cell).textContent = label;
      cell.addEventListener("click", () => choose(o, i));
      cell.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); choose(o, i); } });
    }
    target.replaceChildren(svg);
  }

  if (data.response) {
    const axes = data.response.axes, buttons = Array.from(document.querySelectorAll("[data-configuration]"));
    const columns = axes.length === 1 ? 1 : axes.length <= 4 ? 2 : 3;
    let configuration = 0, chosen = [0, Math.min(1, axes.length - 1)];
    const drawAxes = () => bode("response-axes", configuration, axes.map((name, a) => [a, a, name]), columns, axes.length === 1 ? 440 : 300);
    const drawEntry = () => {
      if (axes.length < 2) return;
      matrix(document.getElementById("response-matrix"), configuration, chosen, (o, i) => { chosen = [o, i]; drawEntry(); });
      document.getElementById("response-entry-title").textContent = "Acceleration of " + axes[chosen[0]] + " over torque of " + axes[chosen[1]];
      bode("response-entry", configuration, [[chosen[0], chosen[1], ""]], 1, 440);
    };
    buttons.forEach((button) => button.addEventListener("click", () => {
      configuration = Number(button.dataset.configuration); press(buttons, button); drawAxes(); drawEntry();
    }));
    drawAxes(); drawEntry();
  }

  data.time.forEach((comparison, index) => {
    const buttons = Array.from(document.querySelectorAll(`[data-plot="${index}"]`));
    const draw = (a) => {
      const one = comparison.axes[a], unit = plain(comparison.unit);
      const trace = (y, colour, width, where, name) => ({x: one.time, y: y, mode: "lines", name: name, yaxis: where,
        line: {color: colour, width: width}, hovertemplate: "%{x:.4g} s, %{y:.5g} " + unit + "<extra>" + name + "</extra>"});
      Plotly.react("time-" + index, [trace(one.measured, MEASURED, 1.6, "y", "measured"),
        trace(one.modelled, MODEL, 1.1, "y", "simulated"), trace(one.residual, RESIDUAL, 1, "y2", "residual")],
        {height: 390, margin: {l: 64, r: 8, t: 8, b: 38}, font: FONT, showlegend: false, hovermode: "x", modebar: MODEBAR,
          paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "#fff",
          xaxis: axis({anchor: "y2", title: {text: "s", standoff: 4}}),
          yaxis: axis({domain: [0.36, 1], title: {text: plain(comparison.channel) + " / " + unit, standoff: 4}}),
          yaxis2: axis({domain: [0, 0.28], zeroline: true, zerolinecolor: "#b9c3cd", nticks: 4, title: {text: "residual / " + unit, standoff: 4}})},
        OPTIONS);
      const shown = one.time.length < comparison.n_sample ? "; " + one.time.length + " of " + comparison.n_sample + " samples drawn, the extremes of the residual among them" : "";
      document.getElementById("time-note-" + index).textContent = one.name + ": " + one.note + shown;
    };
    buttons.forEach((button) => button.addEventListener("click", () => { press(buttons, button); draw(Number(button.dataset.time)); }));
    draw(0);
  });
})();
