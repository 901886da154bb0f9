"use strict";
(async () => {
  const $ = (id) => document.getElementById(id);
  const unpacked = async (id) => {
    const text = atob($(id).textContent), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  };
  if (typeof DecompressionStream === "undefined") {
    $("shown").textContent = "This browser is too old for the picture; all else is on the page.";
    return;
  }
  const script = document.createElement("script");
  script.textContent = await unpacked("library");
  document.head.append(script);
  const recordings = JSON.parse(await unpacked("series"));
  const label = $("picture").dataset;
  // Each readable on white and on near black, also for the colour-blind.
  const GREY = "#7d868d", BEFORE = "#d1602a", AFTER = "#2a8fad";
  const SHADE = "rgba(230,160,40,0.22)";
  const minus = (a, b) => a.map((v, i) => (v === null || b[i] === null ? null : v - b[i]));

  function traces(r, key) {
    const x = r[key];
    const line = (y, name, color, width, more) => ({
      x, y, name, type: "scatter", mode: "lines", line: {color, width},
      hovertemplate: `%{y:.4g} ${label.unit}`, ...more,
    });
    const below = {yaxis: "y2", showlegend: false};
    const out = [
      line(r.measured, "measured", GREY, 3),
      line(r.before, "simulated before", BEFORE, 1.5),
      line(minus(r.measured, r.before), "measured - before", BEFORE, 1, below),
    ];
    if (r.after) {
      out.push(line(r.after, "simulated after", AFTER, 1.5));
      out.push(line(minus(r.measured, r.after), "measured - after", AFTER, 1, below));
    }
    if (key === "strain" && r.regions.length) {
      const inside = r.time.map((t) => r.regions.some(([a, b]) => t >= a && t <= b));
      const y = r.measured.map((v, i) => (inside[i] ? v : null));
      out.unshift(line(y, "mismatch", SHADE, 14, {hoverinfo: "skip", hovertemplate: null}));
    }
    return out;
  }

  function draw() {
    const r = recordings[$("recording").value];
    const key = document.querySelector("input[name=axis]:checked").value;
    const shapes = key === "strain" ? [] : r.regions.map(([x0, x1]) => ({
      type: "rect", x0, x1, y0: 0, y1: 1, yref: "paper", fillcolor: SHADE,
      line: {width: 0}, layer: "below",
    }));
    const axis = {zeroline: true, automargin: true, fixedrange: false};
    const layout = {
      paper_bgcolor: "transparent", plot_bgcolor: "transparent", shapes,
      margin: {l: 56, r: 8, t: 36, b: 44}, font: {family: "system-ui, sans-serif", size: 13},
      legend: {orientation: "h", x: 0, y: 1.02, yanchor: "bottom"},
      hovermode: key === "time" ? "x unified" : "closest",
      hoverlabel: {bgcolor: "#222a30", bordercolor: "#222a30", font: {color: "#fff"}},
      xaxis: {...axis, anchor: "y2",
        title: {text: key === "time" ? "time since its start [s]" : label.strain}},
      yaxis: {...axis, domain: [0.36, 1], title: {text: label.stress}},
      yaxis2: {...axis, domain: [0, 0.3], title: {text: `left [${label.unit}]`}},
    };
    const config = {responsive: true, displaylogo: false,
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]};
    const shaded = r.regions.length ? ` Shaded: ${label.shaded}.` : "";
    $("shown").textContent = `${r.name}: ${r.time.length} of ${r.samples} samples drawn.${shaded}`;
    return Plotly.react("picture", traces(r, key), layout, config);
  }

  const step = (by) => () => {
    const n = recordings.length, select = $("recording");
    select.value = (Number(select.value) + by + n) % n;
    draw();
  };
  $("recording").addEventListener("change", draw);
  $("previous").addEventListener("click", step(-1));
  $("next").addEventListener("click", step(1));
  for (const one of document.querySelectorAll("input[name=axis]")) one.addEventListener("change", draw);
  for (const when of ["beforeprint", "afterprint"]) addEventListener(when, () => Plotly.Plots.resize("picture"));
  await draw();
  $("picture").dataset.ready = Math.round(performance.now());
})();
