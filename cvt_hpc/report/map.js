// Draws the map of a study from the numbers in the page: any two axes as a grid, a third one over panels, a slider
// for each further one, and quantities by choice. `interactive.py` says what the numbers are.
(() => {
"use strict";
const data = JSON.parse(document.getElementById("map-data").textContent);
const MOST_PANELS = 12, MOST_GAPS = 40, MOST_MARKS = 1200; // panels; cells set apart along a side; marks in a panel
const STRIP = 90, LEAST = 130, ROW = 34, HIGHEST = 300, GAP = 62; // [pixel]: one row; several, each, at most; between panels
const OCCURRENCE = -1, STARTS = -2;

const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
const flags = text => text ? new Int8Array(bytes(text).buffer) : null;
const classes = flags(data.classes), inferred = flags(data.inferred), starts = flags(data.starts);
for (const one of data.onsets) one.at = new Float32Array(bytes(one.at).buffer);
for (const one of data.quantities) one.values = new Float32Array(bytes(one.values).buffer);
const amplitude = data.quantities.find(one => one.key === "amplitude");
const frequency = data.quantities.find(one => one.key === "frequency");
const escaped = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const digits = value => String(Number(value.toPrecision(4))).replace("-", "−");
const micro = amplitude && amplitude.unit === "mm" ? 1e-3 : 1; // [um] in its unit
const level = value => Math.log10(Math.max(value, Number.MIN_VALUE) / micro); // on the scale of amplitudes of all maps
const ends = [data.amplitudes[0], data.amplitudes.at(-1)].map(Math.log10);
const named = one => one.unit ? `${one.name} [${one.unit}]` : one.name;
const sizes = data.axes.map(axis => axis.texts.length);
const strides = sizes.map((_, k) => data.sampled ? 1 : sizes.slice(k + 1).reduce((a, b) => a * b, 1));
const chosen = {show: data.first, ...data.sides, places: sizes.map(() => 0)};
if (chosen.panel >= 0 && sizes[chosen.panel] > MOST_PANELS) chosen.panel = -1;

const controls = document.getElementById("map-controls"), place = document.getElementById("map");

function choice(label, options, value, choose) {
  const box = document.createElement("label"), list = document.createElement("select");
  box.append(`${label} `, list);
  for (const [key, text] of options) list.append(new Option(text, key, false, key === value));
  list.addEventListener("change", () => { choose(Number(list.value)); refresh(); });
  controls.append(box);
}

function slider(axis) {
  const box = document.createElement("label"), told = document.createElement("output"), bar = document.createElement("input");
  const tell = () => { told.textContent = data.axes[axis].texts[chosen.places[axis]]; };
  Object.assign(bar, {type: "range", min: 0, max: sizes[axis] - 1, step: 1, value: chosen.places[axis]});
  bar.addEventListener("input", () => { chosen.places[axis] = Number(bar.value); tell(); draw(); });
  tell();
  box.append(`${data.axes[axis].name} `, bar, " ", told);
  controls.append(box);
}

function take(side, axis) { // an axis that is on another side changes places with the one that it replaces
  const other = ["x", "y", "panel"].find(one => one !== side && axis >= 0 && chosen[one] === axis);
  if (other) chosen[other] = chosen[side];
  chosen[side] = axis;
}

function refresh() {
  controls.replaceChildren();
  const shown = data.ofSamples ? [] : [[OCCURRENCE, "occurrence"]];
  if (starts) shown.push([STARTS, "occurrence from the smallest and the largest disturbance"]);
  choice("show", [...shown, ...data.quantities.map((one, k) => [k, named(one)])], chosen.show, k => { chosen.show = k; });
  const names = data.axes.map((axis, k) => [k, axis.name]);
  if (names.length > 1) {
    choice("along x", names, chosen.x, k => take("x", k));
    choice("along y", [...names, [-1, "–"]], chosen.y, k => take("y", k));
  }
  if (names.length > 2 && !data.sampled)
    choice("panels", [...names.filter(([k]) => sizes[k] <= MOST_PANELS), [-1, "–"]], chosen.panel, k => take("panel", k));
  if (chosen.panel >= 0 && sizes[chosen.panel] > MOST_PANELS) chosen.panel = -1;
  if (!data.sampled)
    data.axes.forEach((_, k) => { if (![chosen.x, chosen.y, chosen.panel].includes(k) && sizes[k] > 1) slider(k); });
  draw();
}

// What stands beside the pointer at a run.
function told(index, at, kinds) {
  const lines = at.filter(([axis]) => axis >= 0).map(([axis, k]) => `${data.axes[axis].name}: ${data.axes[axis].texts[k]}`);
  const kind = kinds[index];
  if (!data.ofSamples) lines.push(data.kinds[kind].label + (inferred && inferred[index] ? " (inferred)" : ""));
  if (chosen.show >= 0) {
    const one = data.quantities[chosen.show], value = one.values[index];
    if (Number.isFinite(value)) lines.push(`${one.name}: ${digits(value)} ${one.unit}`);
  } else if (data.kinds[kind].moves && !(inferred && inferred[index]))
    for (const one of [amplitude, frequency])
      if (one && Number.isFinite(one.values[index])) lines.push(`${one.name}: ${digits(one.values[index])} ${one.unit}`);
  return lines.map(escaped).join("<br>");
}

function coloured(index, kinds) { // the number that colours a run; null where its class does
  const one = chosen.show >= 0 ? data.quantities[chosen.show] : amplitude;
  if (!one || !Number.isFinite(one.values[index])) return null;
  if (chosen.show >= 0) return one.values[index];
  return kinds[index] === data.vibrating && !(inferred && inferred[index]) ? level(one.values[index]) : null;
}

function fill(index, kinds) {
  return inferred && inferred[index] && kinds[index] === data.vibrating ? data.inferredVibration : data.kinds[kinds[index]].fill;
}

function grid(panel, on, kinds, width, height) {
  const columns = sizes[chosen.x], rows = chosen.y >= 0 ? sizes[chosen.y] : 1;
  let base = 0;
  data.axes.forEach((_, k) => {
    if (k !== chosen.x && k !== chosen.y) base += strides[k] * (k === chosen.panel ? panel : chosen.places[k]);
  });
  const x = data.axes[chosen.x], y = chosen.y >= 0 ? data.axes[chosen.y] : {edges: [-0.5, 0.5], centres: [0]};
  const values = [], fills = [], texts = [], marks = new Map(), colours = [];
  for (let row = 0; row < rows; row++) {
    values.push([]); fills.push([]); texts.push([]);
    for (let column = 0; column < columns; column++) {
      const index = base + column * strides[chosen.x] + (chosen.y >= 0 ? row * strides[chosen.y] : 0);
      const value = coloured(index, kinds), colour = fill(index, kinds);
      if (!colours.includes(colour)) colours.push(colour);
      values[row].push(value);
      fills[row].push(value === null ? colours.indexOf(colour) : null);
      texts[row].push(told(index, [[chosen.panel, panel], [chosen.y, row], [chosen.x, column]], kinds));
      if (value === null && !(inferred && inferred[index])) {
        if (!marks.has(kinds[index])) marks.set(kinds[index], []);
        marks.get(kinds[index]).push([x.centres[column], y.centres[row]]);
      }
    }
  }
  if (chosen.y < 0 && chosen.show >= 0)
    return [{type: "scatter", mode: "lines+markers", x: x.centres, y: values[0], text: texts[0], hovertemplate: "%{text}<extra></extra>",
             line: {color: "#2a6f97"}, marker: {size: 7}, ...on}];
  const gap = Math.max(columns, rows) <= MOST_GAPS ? 1 : 0;
  const cell = {type: "heatmap", x: x.edges, y: y.edges, text: texts, hovertemplate: "%{text}<extra></extra>", hoverongaps: false, xgap: gap, ygap: gap, ...on};
  const scale = colours.flatMap((colour, k) => [[k / colours.length, colour], [(k + 1) / colours.length, colour]]);
  const layers = [
    {...cell, z: fills, zmin: -0.5, zmax: colours.length - 0.5, colorscale: scale, showscale: false},
    {...cell, z: values, coloraxis: "coloraxis"}].filter(layer => layer.z.some(row => row.some(value => value !== null)));
  const size = Math.min(14, Math.max(4, 0.45 * Math.min(width / columns, height / rows)));
  for (const [kind, points] of marks) {
    const {symbol, letter, ink} = data.kinds[kind];
    if (!letter || points.length > MOST_MARKS) continue;
    const mark = symbol ? {mode: "markers", marker: {symbol, size, color: ink}} : {mode: "text", text: points.map(() => letter), textfont: {size: 1.2 * size, color: ink}};
    layers.push({type: "scatter", x: points.map(one => one[0]), y: points.map(one => one[1]), hoverinfo: "skip", ...mark, ...on});
  }
  return layers;
}

function shownOnsets() { // of the axis along which vibration sets in, where the map shows classes over two axes
  if (chosen.show >= 0 || chosen.y < 0) return [];
  const shown = data.onsets.filter(({axis, starts}) => starts === (chosen.show === STARTS) && [chosen.x, chosen.y].includes(axis));
  return shown.filter(({axis}) => axis === shown[0].axis);
}

function onsetLine({axis, at, dashed}, panel, on) {
  const across = axis === chosen.x ? chosen.y : chosen.x, places = [], borders = [];
  for (let k = 0; k < sizes[across]; k++) {
    let index = 0; // over all other axes
    data.axes.forEach((_, other) => {
      if (other !== axis) index = index * sizes[other] + (other === across ? k : other === chosen.panel ? panel : chosen.places[other]);
    });
    const place = Number.isFinite(at[index]) ? at[index] : null;
    places.push(place, place);
    borders.push(data.axes[across].edges[k], data.axes[across].edges[k + 1]);
  }
  const [x, y] = axis === chosen.x ? [places, borders] : [borders, places];
  return [["#ffffff", 5, "solid"], [data.onsetColour, 2.5, dashed ? "dash" : "solid"]].map(([color, width, dash]) =>
    ({type: "scatter", mode: "lines", x, y, line: {color, width, dash}, hoverinfo: "skip", ...on}));
}

function samples(on, kinds) {
  const x = data.axes[chosen.x].values, y = chosen.y >= 0 ? data.axes[chosen.y].values : x.map(() => 0);
  const at = data.axes.map((_, axis) => axis), traces = [];
  for (const is of [false, true]) {
    const runs = [...x.keys()].filter(index => (coloured(index, kinds) !== null) === is);
    traces.push({type: "scatter", mode: "markers", x: runs.map(k => x[k]), y: runs.map(k => y[k]), hovertemplate: "%{text}<extra></extra>",
      text: runs.map(k => told(k, at.map(axis => [axis, k]), kinds)), ...on,
      marker: {size: 9, line: {width: 1, color: "#606060"}, symbol: runs.map(k => is ? "circle" : data.kinds[kinds[k]].symbol || "circle"),
               ...(is ? {color: runs.map(k => coloured(k, kinds)), coloraxis: "coloraxis"} : {color: runs.map(k => fill(k, kinds))})}});
  }
  return traces;
}

function side(axis, title) {
  if (axis < 0) return {showticklabels: false, showgrid: false, zeroline: false};
  const {label, ticks, edges, minor, log} = data.axes[axis];
  const fixed = {title: {text: title ? escaped(label) : "", font: {size: 13}}, showgrid: false, zeroline: false, automargin: true};
  if (data.sampled) return {...fixed, showgrid: true, type: log ? "log" : "-"};
  if (ticks) Object.assign(fixed, {tickvals: ticks.at, ticktext: ticks.texts.map(escaped)});
  if (minor.length) Object.assign(fixed, {ticks: "outside", ticklen: 6, minor: {tickvals: minor, ticks: "outside", ticklen: 3}});
  return {...fixed, range: [edges[0], edges.at(-1)]};
}

function amplitudeTicks() { // beyond its ends a scale has the colours there, and says so
  const levels = [...amplitude.values].filter((_, k) => classes[k] === data.vibrating).map(level);
  const texts = data.amplitudes.map(one => digits(one * micro));
  if (levels.some(one => one < ends[0])) texts[0] = `≤ ${texts[0]}`;
  if (levels.some(one => one > ends[1])) texts.push(`≥ ${texts.pop()}`);
  return {tickvals: data.amplitudes.map(Math.log10), ticktext: texts};
}

function draw() {
  const kinds = chosen.show === STARTS ? starts : classes;
  const width = place.clientWidth, panels = chosen.panel >= 0 ? sizes[chosen.panel] : 1;
  const columns = panels <= 3 || width < 600 ? 1 : 2, rows = Math.ceil(panels / columns);
  const curve = chosen.y < 0 && chosen.show >= 0;
  const height = data.sampled || curve ? HIGHEST : chosen.y < 0 ? STRIP : Math.min(HIGHEST, Math.max(LEAST, ROW * sizes[chosen.y]));
  const inside = rows * height + (rows - 1) * GAP, above = 40, apart = columns > 1 ? 0.1 : 0;
  const scale = chosen.show >= 0 ? data.quantities[chosen.show] : amplitude;
  const layout = {
    annotations: [], showlegend: false,
    plot_bgcolor: "#ffffff", font: {family: "sans-serif", size: 13}, hoverlabel: {align: "left"},
    dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom"};
  const traces = [], lines = shownOnsets();
  for (let panel = 0; panel < panels; panel++) {
    const row = Math.floor(panel / columns), column = panel % columns, k = panel ? panel + 1 : "";
    const part = (1 - apart) / columns, left = column * (part + apart), top = 1 - row * (height + GAP) / inside;
    const x = {...side(chosen.x, panel + columns >= panels), domain: [left, left + part], anchor: `y${k}`};
    const y = {...side(chosen.y, column === 0), domain: [Math.max(0, top - height / inside), top], anchor: `x${k}`};
    if (curve) Object.assign(y, {title: {text: escaped(named(scale))}, showticklabels: true, showgrid: true, range: null});
    if (curve) y.range = [scale.least - 0.05 * (scale.most - scale.least), scale.most + 0.05 * (scale.most - scale.least)];
    layout[`xaxis${k}`] = panel ? {...x, matches: "x"} : x;
    layout[`yaxis${k}`] = panel ? {...y, matches: "y"} : y;
    const on = {xaxis: `x${k}`, yaxis: `y${k}`};
    traces.push(...lines.flatMap(line => onsetLine(line, panel, on))); // below the marks of the cells
    traces.push(...(data.sampled ? samples(on, kinds) : grid(panel, on, kinds, part * (width - 90), height)));
    if (chosen.panel >= 0) {
      const axis = data.axes[chosen.panel];
      layout.annotations.push({text: escaped(`${axis.name}: ${axis.texts[panel]}`), xref: "paper", yref: "paper",
        x: left, y: top, xanchor: "left", yanchor: "bottom", showarrow: false});
    }
  }
  const scaled = traces.some(trace => trace.coloraxis || (trace.marker && trace.marker.coloraxis && trace.x.length));
  const below = scaled ? 130 : 60;
  Object.assign(layout, {height: inside + above + below, margin: {l: 70, r: 20, t: above, b: below}});
  if (scaled)
    layout.coloraxis = {...(chosen.show >= 0 ? {colorscale: data.others, cmin: scale.least, cmax: scale.most} : {colorscale: data.colours, cmin: ends[0], cmax: ends[1]}),
      colorbar: {...(chosen.show >= 0 ? {} : amplitudeTicks()), orientation: "h", y: -70 / inside, yanchor: "top", thickness: 12, len: 0.9, title: {text: escaped(named(scale)), side: "bottom"}}};
  Plotly.react(place, traces, layout, {responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"],
    "showSendToCloud": false}); // the library's default is a button that uploads the map
  const present = new Set(curve ? [] : kinds), legend = document.getElementById("map-legend");
  legend.replaceChildren();
  if (chosen.show >= 0) return;
  const entries = Object.entries(data.kinds).filter(([kind]) => present.has(Number(kind))).map(([, kind]) => kind);
  if (inferred && inferred.some((is, k) => is && kinds[k] === data.vibrating))
    entries.push({label: "vibrating (inferred)", fill: data.inferredVibration, ink: "", letter: ""});
  const enter = (label, style, letter) => {
    const entry = document.createElement("span"), swatch = document.createElement("i");
    Object.assign(swatch.style, style);
    swatch.textContent = letter;
    entry.append(swatch, label);
    legend.append(entry);
  };
  for (const {label, fill, ink, letter} of entries) enter(label, {background: fill, color: ink}, letter);
  for (const {label, dashed} of lines)
    enter(label, {border: "none", borderTop: `3px ${dashed ? "dashed" : "solid"} ${data.onsetColour}`, height: 0}, "");
}

refresh();
let width = place.clientWidth;
window.addEventListener("resize", () => { if (place.clientWidth !== width) { width = place.clientWidth; draw(); } });
})();
