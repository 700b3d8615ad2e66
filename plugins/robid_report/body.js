"use strict";
// Draws the robot of #body-data as capsules or meshes, turns it by pointer and arrow keys, and swings it in its elastic modes.
(() => {
  const source = document.getElementById("body-data");
  if (!source) return;
  const body = JSON.parse(source.textContent), canvas = document.getElementById("body-canvas");
  const words = document.getElementById("body-words"), play = document.getElementById("body-play");
  const modeButtons = document.getElementById("body-modes");
  const poses = Array.from(document.querySelectorAll("[data-body]"));
  const reduced = matchMedia("(prefers-reduced-motion: reduce)");
  const n = body.parent.length, meshed = new Set(body.meshes.map((one) => one.joint));
  let configuration = 0, mode = -1, yaw = -0.6, pitch = 0.35, phase = 1, running = false, last = 0;

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const press = (buttons, chosen) => buttons.forEach((b) => b.setAttribute("aria-pressed", String(b === chosen)));
  const pose = () => body.configurations[configuration];
  const swinging = () => mode >= 0 ? pose().modes[mode] : null;

  let middle = [0, 0, 0], reach = 1, height = 1;  // of the configuration that is drawn: the scale fits them into the canvas
  function measure() {
    const every = pose().points.slice(0, n).concat([[0, 0, 0]], body.meshes.flatMap((mesh, m) => placed(mesh, m, null, 0)));
    const ends = [0, 1, 2].map((k) => every.reduce(([low, high], p) => [Math.min(low, p[k]), Math.max(high, p[k])], [Infinity, -Infinity]));
    const margin = 2 * Math.max(...body.radius) + 0.05 * body.size;  // thickness of links, and the swing of modes
    middle = ends.map(([low, high]) => (low + high) / 2);
    reach = margin + every.reduce((most, p) => Math.max(most, Math.hypot(p[0] - middle[0], p[1] - middle[1])), 0);
    height = 2 * margin + ends[2][1] - ends[2][0];
  }
  // The same however the robot is turned about the vertical.
  function fitting(canvas) {
    const across = 2 * reach, up = Math.cos(pitch) * height + 2 * Math.abs(Math.sin(pitch)) * reach;
    return Math.min(canvas.width / across, canvas.height / up);
  }
  // Orthographic: x to the right, y up, depth away from the reader.
  function project(p) {
    const x = p[0] - middle[0], y = p[1] - middle[1], z = p[2] - middle[2];
    const cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
    const across = cy * x + sy * y, away = -sy * x + cy * y;
    return [across, cp * z + sp * away, cp * away - sp * z];
  }
  // Vertices of a mesh in the base frame; a mode moves them by `amount` as one rigid body.
  function placed(mesh, m, own, amount) {
    const r = pose().turns[m], still = [0, 0, 0], w = own ? own.turned[m] : still, result = [];
    const origin = mesh.joint < 0 ? still : pose().points[mesh.joint], d = own && mesh.joint >= 0 ? own.moved[mesh.joint] : still;
    for (let k = 0; k < mesh.vertices.length; k += 3) {
      const [x, y, z] = mesh.vertices.slice(k, k + 3).map((v) => v * body.unit);
      const a = r[0] * x + r[1] * y + r[2] * z, b = r[3] * x + r[4] * y + r[5] * z, c = r[6] * x + r[7] * y + r[8] * z;
      result.push([origin[0] + a + amount * (d[0] + w[1] * c - w[2] * b), origin[1] + b + amount * (d[1] + w[2] * a - w[0] * c),
        origin[2] + c + amount * (d[2] + w[0] * b - w[1] * a)]);
    }
    return result;
  }
  const SHADES = 12;
  // Calls `use` with three projected corners of each triangle and how much it faces the reader, from 0 to 1.
  function triangles(at, own, amount, use) {
    body.meshes.forEach((mesh, m) => {
      const points = placed(mesh, m, own, amount).map(at);
      for (let k = 0; k < mesh.triangles.length; k += 3) {
        const [a, b, c] = [points[mesh.triangles[k]], points[mesh.triangles[k + 1]], points[mesh.triangles[k + 2]]];
        const ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
        const across = ux * vy - uy * vx;
        use(a, b, c, Math.abs(across) / (Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, across) || 1));
      }
    });
  }
  function draw() {
    const box = canvas.getBoundingClientRect(), density = window.devicePixelRatio || 1;
    if (!box.width) return;
    canvas.width = Math.round(box.width * density); canvas.height = Math.round(box.height * density);
    const pen = canvas.getContext("2d"), scale = fitting(canvas);
    const own = swinging(), amount = Math.sin(phase);
    const at = (p) => { const [x, y, depth] = project(p); return [canvas.width / 2 + scale * x, canvas.height / 2 - scale * y, scale * depth]; };
    const still = pose().points.map(at);
    const moved = own ? pose().points.map((p, k) => at(p.map((v, axis) => v + amount * own.moved[k][axis]))) : still;
    const origin = at([0, 0, 0]);
    const line = (a, b, width, style, alpha) => {
      pen.globalAlpha = alpha; pen.strokeStyle = style; pen.lineWidth = width; pen.lineCap = "round";
      pen.beginPath(); pen.moveTo(a[0], a[1]); pen.lineTo(b[0], b[1]); pen.stroke(); pen.globalAlpha = 1;
    };
    // The floor: a square about the base.
    const half = 0.22 * body.size, corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]].map(at);
    pen.fillStyle = colour("--line"); pen.beginPath();
    corners.forEach((c, k) => k ? pen.lineTo(c[0], c[1]) : pen.moveTo(c[0], c[1])); pen.fill();
    const from = (points, k) => body.parent[k] >= 0 ? points[body.parent[k]] : origin;
    const triangle = (a, b, c, style) => {
      pen.fillStyle = pen.strokeStyle = style; pen.lineWidth = 0.7 * density; pen.lineJoin = "round";
      pen.beginPath(); pen.moveTo(a[0], a[1]); pen.lineTo(b[0], b[1]); pen.lineTo(c[0], c[1]); pen.closePath(); pen.fill(); pen.stroke();
    };
    const capsules = body.parent.map((p, k) => k).filter((k) => body.radius[k]);
    const ghost = `color-mix(in srgb, ${colour("--edge")} 45%, ${colour("--panel")})`;
    if (own) triangles(at, null, 0, (a, b, c) => triangle(a, b, c, ghost));
    if (own) for (const k of capsules)
      line(from(still, k), still[k], Math.max(2 * scale * body.radius[k], 2), colour("--edge"), 0.45);
    const parts = [];
    const shades = Array.from({length: SHADES}, (_, k) =>
      `color-mix(in srgb, ${colour("--body-light")} ${Math.round(100 * k / (SHADES - 1))}%, ${colour("--body")})`);
    triangles(at, own, amount, (a, b, c, facing) => parts.push([(a[2] + b[2] + c[2]) / 3,
      () => triangle(a, b, c, shades[Math.min(SHADES - 1, Math.floor(SHADES * facing))])]));
    for (const k of capsules) {
      const a = from(moved, k), b = moved[k], width = Math.max(2 * scale * body.radius[k], 2 * density);
      parts.push([(a[2] + b[2]) / 2, () => {
        line(a, b, width + 2.5 * density, colour("--ground"), 1);
        line(a, b, width, colour("--body"), 1);
        line(a, b, 0.45 * width, colour("--body-light"), 0.8);
      }]);
    }
    body.fins.forEach((j, k) => meshed.has(j) || parts.push([moved[j][2] - 0.01 * scale * body.size,
      () => line(moved[j], moved[n + k], 3 * density, colour("--start"), 1)]));
    // Where a spring bends: a disc, as large as its share of the strain energy.
    if (own) own.share.forEach((share, j) => { if (share > 0.03) parts.push([moved[j][2] - 0.2 * scale * body.size, () => {
      pen.globalAlpha = 0.85; pen.fillStyle = colour("--model"); pen.beginPath();
      pen.arc(moved[j][0], moved[j][1], (3 + 13 * Math.sqrt(share)) * density, 0, 2 * Math.PI); pen.fill(); pen.globalAlpha = 1;
    }]); });
    parts.sort((a, b) => b[0] - a[0]).forEach((part) => part[1]());
  }
  function step(now) {
    if (!running) return;
    phase += 2 * Math.PI * 0.8 * Math.min((now - last) / 1000, 0.1); last = now;
    draw();
    requestAnimationFrame(step);
  }
  function run(wanted) {
    const starts = wanted && !running && mode >= 0;
    running = wanted && mode >= 0;
    play.hidden = mode < 0;
    play.textContent = running ? "Pause" : "Play";
    if (starts) { last = performance.now(); requestAnimationFrame(step); }
    if (!running) draw();
  }
  function choose(k, wanted) {
    mode = k; phase = Math.PI / 2;
    press(Array.from(modeButtons.children), modeButtons.children[k + 1]);
    const own = swinging();
    words.textContent = own ? `${own.name}: what bends, by strain energy: ${own.words}.`
      : pose().modes.length ? "At rest. Choose a resonance to see what bends there." : "No resonance of this robot lies in the band.";
    run(wanted);
  }
  function fill() {
    const names = ["at rest", ...pose().modes.map((one) => one.name)];
    modeButtons.replaceChildren(...names.map((name, k) => {
      const button = document.createElement("button");
      button.type = "button"; button.textContent = name;
      button.addEventListener("click", () => choose(k - 1, !reduced.matches));
      return button;
    }));
    choose(pose().modes.length ? 0 : -1, !reduced.matches);
  }
  poses.forEach((button) => button.addEventListener("click", () => {
    configuration = Number(button.dataset.body); press(poses, button); running = false; measure(); fill();
  }));
  play.addEventListener("click", () => run(!running));
  const turn = (across, up) => { yaw += across; pitch = Math.max(-1.5, Math.min(1.5, pitch + up)); if (!running) draw(); };
  let held = null;
  canvas.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    turn((event.clientX - held[0]) * 0.01, (event.clientY - held[1]) * 0.01);
    held = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
  const KEYS = {ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15]};
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS)) return;
    event.preventDefault(); turn(...KEYS[event.key]);
  });
  for (const event of ["resize", "beforeprint", "afterprint"]) addEventListener(event, draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  measure(); fill();
})();
