"use strict";
// Charts of a page: the pictures of a figure are replaced by charts of the numbers that lie beside them.
(() => {
  const STEP = 0.25, LEAST = 1e-3; // shares of what is shown, and of the record
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function options(panel, data, key, moved) {
    // plain numbers: a comma for thousands would be read as a decimal sign
    const plain = (_, splits) => splits.map((v) => (v == null ? "" : String(+v.toPrecision(10))));
    const axis = { values: plain, stroke: () => colour("--soft"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { show: false } };
    const shade = (u) => {
      u.ctx.fillStyle = colour("--pale");
      for (const [from, to] of data.shaded) {
        const a = Math.max(u.valToPos(from, "x", true), u.bbox.left);
        const b = Math.min(u.valToPos(to, "x", true), u.bbox.left + u.bbox.width);
        if (b > a) u.ctx.fillRect(a, u.bbox.top, b - a, u.bbox.height);
      }
    };
    const line = (s) => ({
      label: s.name, stroke: () => colour(s.colour), width: s.width, points: { show: false },
      value: (_, v) => (v == null ? "–" : v.toPrecision(4)),
    });
    return {
      width: 600, height: 210, cursor: { sync: { key }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [{ ...axis, label: data.time, labelSize: 22, size: 34 }, { ...axis, size: 58 }],
      series: [{ label: "time in s", value: (_, v) => (v == null ? "–" : v.toFixed(3)) }, ...panel.series.map(line)],
      hooks: { drawClear: [shade], setScale: [(u, scale) => { if (scale === "x") moved(u); }] },
    };
  }

  function button(text, says, does) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.title = says;
    made.setAttribute("aria-label", says);
    made.addEventListener("click", does);
    return made;
  }

  function chart(figure) {
    const data = JSON.parse(figure.querySelector("script").textContent);
    const home = figure.querySelector(".chart"), charts = [];
    const first = Math.min(...data.panels.map((p) => p.t[0]));
    const last = Math.max(...data.panels.map((p) => p.t[p.t.length - 1]));
    let busy = false, shown = [first, last];
    const show = (from, to) => {
      const length = Math.min(Math.max(to - from, LEAST * (last - first)), last - first);
      const begin = Math.min(Math.max(from, first), last - length);
      shown = [begin, begin + length];
      busy = true;
      for (const u of charts) u.setScale("x", { min: shown[0], max: shown[1] });
      busy = false;
    };
    const moved = (u) => { if (!busy && charts.length === data.panels.length) show(u.scales.x.min, u.scales.x.max); };
    const by = (left, right) => () => { const l = shown[1] - shown[0]; show(shown[0] + left * l, shown[1] + right * l); };
    const ways = {
      "+": by(STEP, -STEP), "-": by(-2 * STEP, 2 * STEP), ArrowLeft: by(-STEP, -STEP), ArrowRight: by(STEP, STEP),
      0: () => show(first, last),
    };
    const bar = document.createElement("div");
    bar.className = "ways";
    bar.append(
      button("+", "zoom in", ways["+"]), button("−", "zoom out", ways["-"]), button("←", "earlier", ways.ArrowLeft),
      button("→", "later", ways.ArrowRight), button("all", "show the whole record", ways[0]),
    );
    home.append(bar);
    home.hidden = false;
    for (const panel of data.panels) {
      const title = document.createElement("b");
      title.textContent = panel.title;
      home.append(title);
      charts.push(new uPlot(options(panel, data, figure.id, moved), [panel.t, ...panel.series.map((s) => s.y)], home));
    }
    home.addEventListener("keydown", (event) => {
      if (ways[event.key]) { ways[event.key](); event.preventDefault(); }
    });
    const fit = () => { for (const u of charts) u.setSize({ width: home.clientWidth, height: 210 }); };
    new ResizeObserver(fit).observe(home);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach((u) => u.redraw()));
    show(first, last);
    figure.classList.add("live");
  }

  for (const figure of document.querySelectorAll("figure.charted")) chart(figure);
})();
