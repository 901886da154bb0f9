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
  const SHADE = "rgba(230,160,40,0.25)";
  const NARROW = 700;  // pixels, below which the right half goes below the left
  const minus = (a, b) => a.map((v, i) => (v === null || b[i] === null ? null : v - b[i]));
  const narrow = () => $("picture").clientWidth < NARROW;

  function traces(r, key) {
    const x = r[key], missed = minus(r.measured, r.before);
    const line = (y, name, color, width, more) => ({
      x, y, name, type: "scatter", mode: "lines", line: {color, width},
      hovertemplate: `%{y:.4g} ${label.unit}`, ...more,
    });
    const right = {xaxis: "x2", yaxis: "y2"};
    const out = [
      line(r.measured, "measured", GREY, 5),
      line(r.before, "simulation", BEFORE, 2),
    ];
    if (r.after) out.push(line(r.after, "corrected", AFTER, 2));
    out.push(line(missed, "measured - simulation", GREY, 3, right));
    if (r.after) out.push(line(minus(r.after, r.before), "correction", AFTER, 2, right));
    if (key === "strain" && r.regions.length) {
      const inside = r.time.map((t) => r.regions.some(([a, b]) => t >= a && t <= b));
      const only = (values) => values.map((v, i) => (inside[i] ? v : null));
      const quiet = {hoverinfo: "skip", hovertemplate: null, showlegend: false};
      out.unshift(
        line(only(r.measured), "region", SHADE, 13, quiet),
        line(only(missed), "region", SHADE, 13, {...quiet, ...right}),
      );
    }
    return out;
  }

  function draw() {
    const r = recordings[$("recording").value];
    const key = document.querySelector("input[name=axis]:checked").value;
    const shapes = key === "strain" ? [] : r.regions.flatMap(([x0, x1]) => ["", "2"].map((n) => ({
      type: "rect", x0, x1, y0: 0, y1: 1, xref: `x${n}`, yref: `y${n} domain`,
      fillcolor: SHADE, line: {width: 0}, layer: "below",
    })));
    const style = getComputedStyle(document.body);
    const below = narrow(), half = below ? [0, 1] : [0, 0.46];
    const axis = {zeroline: true, automargin: true, nticks: 6, hoverformat: ".4g", title: {standoff: 8}};
    const across = key === "time" ? "time since its start [s]" : label.strain;
    const title = (text, x, y) => ({
      text, x, y, xref: "paper", yref: "paper", xanchor: "left",
      yanchor: "bottom", showarrow: false, font: {size: 18, weight: 700},
    });
    const beside = r.after ? "The correction" : "What the simulation misses";
    const layout = {
      paper_bgcolor: style.backgroundColor, plot_bgcolor: style.backgroundColor, shapes,
      margin: {l: 70, r: 12, t: 36, b: 60},
      font: {family: "system-ui, sans-serif", size: 16, color: style.color},
      legend: {orientation: "h", x: 0, y: below ? -0.14 : -0.17, yanchor: "top"},
      hovermode: key === "time" ? "x unified" : "closest",
      annotations: [
        title(label.quantity[0].toUpperCase() + label.quantity.slice(1), 0, 1.01),
        below ? title(beside, 0, 0.435) : title(beside, 0.56, 1.01),
      ],
      xaxis: {...axis, domain: half, anchor: "y", title: {text: below ? "" : across}},
      yaxis: {...axis, domain: below ? [0.55, 1] : [0, 1], title: {text: label.stress}},
      xaxis2: {...axis, domain: below ? half : [0.56, 1], anchor: "y2", title: {text: across}},
      yaxis2: {...axis, domain: below ? [0, 0.42] : [0, 1], anchor: "x2", title: {text: `${r.after ? "correction" : "difference"} [${label.unit}]`}},
    };
    if (key === "time") layout.xaxis2.matches = "x";
    const config = {responsive: true, displaylogo: false,
      toImageButtonOptions: {filename: r.name, width: 1600, height: 800, scale: 2},
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]};
    const errors = r.after ? `error in the fit ${r.errors[0]} before, ${r.errors[1]} after the correction` : `error in the fit ${r.errors[0]}`;
    const shaded = r.regions.length ? ` Shaded: ${label.shaded}.` : "";
    $("shown").textContent = `${r.name}: ${errors}.${shaded}`;
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
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  let was = narrow();
  addEventListener("resize", () => {
    if (narrow() !== was) draw();
    was = narrow();
  });
  await draw();
  $("picture").dataset.ready = Math.round(performance.now());
})();
