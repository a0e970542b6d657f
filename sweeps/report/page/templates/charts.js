"use strict";
// Specifications of charts for Vega-Lite, of rows that have `series`, the name of their curve.
const charts = (() => {
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const theme = () => {
    const [ink, rule] = [colour("--ink"), colour("--rule")];
    return {
      background: "transparent",
      axis: { labelColor: ink, titleColor: ink, gridColor: rule, domainColor: rule, tickColor: rule },
      legend: { labelColor: ink, titleColor: ink },
      title: { color: ink },
      text: { color: ink },
      view: { stroke: rule },
      rule: { color: colour("--soft") },
    };
  };
  // `count` colours from that of small to that of large values.
  const sequence = (count) => {
    const parts = (name) => [1, 3, 5].map((k) => parseInt(colour(name).slice(k, k + 2), 16));
    const [low, high] = [parts("--s0"), parts("--s1")];
    const mixed = (share) => low.map((part, k) => Math.round(part + share * (high[k] - part)));
    return Array.from({ length: count }, (_, k) => `rgb(${mixed(count < 2 ? 0 : k / (count - 1))})`);
  };

  // Dashes of growing gaps, so that of curves which coincide each shows in the gaps of others.
  const PERIOD = 24, GAP = 4, MAX_GAP = 19;
  const dash = (k, count) => {
    const gap = k * Math.min(GAP, MAX_GAP / count);
    return [PERIOD - gap, gap];
  };
  const SHAPES = ["circle", "square", "triangle-up", "diamond", "cross", "triangle-down", "triangle-right", "triangle-left"];

  // How curves are told from each other: by colour, dash and marker, the same in the legend.
  const looks = (names, colours) => {
    const scale = (range) => ({ field: "series", type: "nominal", legend: null, scale: { domain: names, range } });
    return {
      color: scale(colours),
      strokeDash: scale(names.map((_, k) => dash(k, names.length))),
      shape: scale(names.map((_, k) => SHAPES[k % SHAPES.length])),
      ...(names.length > 1 && { opacity: { condition: { param: "picked", value: 1 }, value: 0.08 } }),
    };
  };
  const ROW = 19;
  const widthOf = (names, title) => 48 + 5.9 * Math.max(...[...names, title].map((name) => name.length));
  const legend = (names, title, { color, strokeDash, shape, opacity }) => {
    const x = (value) => ({ value }), y = { field: "series", type: "nominal", sort: names, axis: null };
    return {
      title: { text: title, anchor: "start", fontSize: 11 },
      width: widthOf(names, title),
      height: ROW * names.length,
      view: { stroke: null },
      data: { values: names.map((series) => ({ series })) },
      encoding: { y, color, opacity },
      layer: [
        { mark: { type: "rule", strokeWidth: 2 }, encoding: { x: x(0), x2: x(34), strokeDash } },
        { mark: { type: "point", filled: true, size: 45 }, encoding: { x: x(17), shape } },
        {
          mark: { type: "text", align: "left", fontSize: 11, cursor: "pointer" },
          encoding: { x: x(42), text: { field: "series" }, color: { value: colour("--ink") } },
          params: [{ name: "picked", select: { type: "point", fields: ["series"] } }],
        },
      ],
    };
  };
  const MIN_WIDTH = 200, AXIS_WIDTH = 75; // pixels across a chart, and of an axis with its labels
  // A chart with its legend beside it, or below where there is no room.
  const withLegend = (chartOf, { names, title, room }, how, maxWidth) => {
    const several = names.length > 1;
    const available = room - AXIS_WIDTH - (several ? widthOf(names, title) : 0), beside = available > 1.2 * MIN_WIDTH;
    const chart = chartOf(Math.round(Math.max(MIN_WIDTH, Math.min(maxWidth, beside ? available : room - AXIS_WIDTH))));
    if (!several) return chart;
    return { [beside ? "hconcat" : "vconcat"]: [chart, legend(names, title, how)], spacing: 15 };
  };

  // A figure along an axis: a curve a series, with intervals side by side.
  const chart = ({ rows, x, figure, colours, tooltip, ...about }) => {
    const { names } = about, { y, low, high, chance } = figure;
    const how = looks(names, colours), { shape, strokeDash, ...shared } = how;
    const joined = x.type !== "nominal", along = new Set(rows.map((row) => row[x.field])).size;
    const shift = { xOffset: { expr: "datum.shift" } };
    const marked = { transform: [{ filter: "!datum.bare" }] };
    const interval = { ...marked, mark: { type: "rule", ...shift }, encoding: { ...shared, x, y: { ...y, field: low }, y2: { field: high } } };
    const line = { mark: { type: "line", strokeDashOffset: { expr: "datum.shift" }, ...shift }, encoding: { ...shared, x, y, strokeDash } };
    const point = {
      ...marked,
      mark: { type: "point", filled: true, size: 45, ...shift },
      encoding: { ...shared, x, y, shape, tooltip },
      params: [{ name: "zoom", select: { type: "interval", zoom: "wheel![event.shiftKey]" }, bind: "scales" }],
    };
    const level = {
      mark: { type: "rule", strokeDash: [2, 3] },
      encoding: { x: { value: 0 }, x2: { value: "width" }, y: { field: chance, type: "quantitative", aggregate: "max", title: y.title } },
    };
    // Of a difference, where there is none.
    const zero = { data: { values: [{}] }, mark: { type: "rule", strokeWidth: 1.5 }, encoding: { y: { datum: 0, type: "quantitative", title: y.title } } };
    const layer = [...(figure.difference ? [zero] : []), ...(low && high ? [interval] : []), ...(joined ? [line] : []), point, ...(chance ? [level] : [])];
    const chartOf = (width) => {
      const apart = Math.min(4 * (names.length - 1), (joined ? 0.3 : 0.6) * (width / along));
      for (const row of rows) row.shift = names.length < 2 ? 0 : apart * (names.indexOf(row.series) / (names.length - 1) - 0.5);
      return { width, height: 250, layer, data: { values: rows } };
    };
    return withLegend(chartOf, about, how, 700);
  };

  // A figure by aspect, of rows that have `bin`, its ends: the bow is above, the port beam to the
  // right, and each series an arc in each bin.
  const aspect = ({ rows, figure, colours, tooltip, ...about }) => {
    const { names } = about, how = looks(names, colours), { shape, strokeDash, ...shared } = how;
    const { y: { field, scale }, low, high } = figure, maximum = scale.domain[1], margin = 1.2 * maximum;
    const at = (angle, radius) => [radius * Math.sin((angle * Math.PI) / 180), radius * Math.cos((angle * Math.PI) / 180)];
    const arc = ([low, high], radius, of) => {
      const steps = Math.ceil((high - low) / 3) || 1;
      return Array.from({ length: steps + 1 }, (_, k) => {
        const [x, y] = at(low + (k * (high - low)) / steps, radius);
        return { x, y, k: low + k / steps, ...of };
      });
    };
    const end = 90 * Math.ceil(Math.max(90, ...rows.map((row) => row.bin[1])) / 90);
    const rings = [0.25, 0.5, 0.75, 1].flatMap((share) => arc([0, end], share * maximum, { share }));
    const spokes = Array.from({ length: Math.min(12, end / 30 + 1) }, (_, k) => {
      const [[x, y], [x2, y2]] = [at(30 * k, maximum), at(30 * k, 1.1 * maximum)];
      return { x, y, x2, y2, zero: 0, text: `${30 * k}°` };
    });
    // Markers and intervals stand side by side on their arc.
    const path = [], points = [];
    for (const row of rows) {
      const [from, to] = row.bin[0] < row.bin[1] ? row.bin : [row.bin[0] - 2, row.bin[0] + 2];
      const angle = from + ((names.indexOf(row.series) + 0.5) / names.length) * (to - from);
      path.push(...arc([from, to], row[field], { series: row.series, of: row.bin[0] }));
      const [[x, y], [x1, y1], [x2, y2]] = [field, low || field, high || field].map((name) => at(angle, row[name]));
      points.push({ ...row, x, y, x1, y1, x2, y2 });
    }
    const side = (name, below) => ({ field: name, type: "quantitative", axis: null, scale: { domain: [below ? -margin : -0.1 * maximum, margin], nice: false } });
    const x = side("x", end > 180), y = side("y", end > 90);
    const grid = { color: { value: colour("--rule") } }, text = { field: "text" }, order = { field: "k", type: "quantitative" };
    const layer = [
      { data: { values: rings }, mark: "line", encoding: { detail: { field: "share" }, order, ...grid } },
      { data: { values: spokes }, mark: "rule", encoding: { x: { ...x, field: "zero" }, y: { ...y, field: "zero" }, x2: { field: "x" }, y2: { field: "y" }, ...grid } },
      { data: { values: spokes }, mark: { type: "text", fontSize: 11 }, encoding: { x: { ...x, field: "x2" }, y: { ...y, field: "y2" }, text } },
      { data: { values: rings.filter((ring) => ring.k === 0) }, mark: { type: "text", fontSize: 10, align: "right", dx: -4 }, encoding: { text: { field: "y" } } },
      { data: { values: points }, mark: { type: "rule", opacity: 0.6 }, encoding: { ...shared, x: { ...x, field: "x1" }, y: { ...y, field: "y1" }, x2: { field: "x2" }, y2: { field: "y2" } } },
      { data: { values: path }, mark: "line", encoding: { ...shared, strokeDash, detail: { field: "of" }, order } },
      { data: { values: points }, mark: { type: "point", filled: true, size: 45 }, encoding: { ...shared, shape, tooltip } },
    ];
    const extent = ({ scale: { domain: [from, to] } }) => to - from;
    const chartOf = (width) => ({ width, height: (width * extent(y)) / extent(x), view: { stroke: null }, encoding: { x, y }, layer });
    return withLegend(chartOf, about, how, 280);
  };

  // A figure by two axes, with its values; a panel for each of several names.
  const heat = ({ rows, x, y, figure, names, tooltip, room }) => {
    const { field, title, scale } = figure.y;
    const values = rows.map((row) => row[field]), extreme = Math.max(...values.map(Math.abs));
    // Of differences, as far to either side of 0, where there is no colour.
    const domain = figure.difference ? [-extreme, 0, extreme] : scale.domain ?? [Math.min(...values), Math.max(...values)];
    const axis = (field, { title, sort }, more) => ({ field, title, type: "ordinal", sort, axis: { labelLimit: 110, ...more } });
    const narrow = room < 480, available = Math.min(room, 560) - (narrow ? 100 : 190);
    const side = Math.max(16, Math.min(names.length ? 44 : 64, available / x.sort.length));
    const legible = figure.format.endsWith("g") ? 36 : 24; // pixels across the longest value
    const shown = `datum[${JSON.stringify(field)}]`;
    const strong = figure.difference ? `abs(${shown}) > ${0.65 * extreme}` : `${shown} > ${(domain[0] + domain[1]) / 2}`;
    const range = figure.difference ? [colour("--c1"), colour("--panel"), colour("--c0")] : [colour("--panel"), colour("--s1")];
    const legend = names.length ? null : { title, orient: narrow ? "bottom" : "right", gradientLength: 90, ...figure.y.axis };
    const cell = { mark: { type: "rect", stroke: colour("--paper") }, encoding: { color: { field, type: "quantitative", scale: { domain, range, ...(figure.difference && { interpolate: "rgb" }) }, legend } } };
    const value = {
      mark: { type: "text", fontSize: 11 },
      encoding: {
        text: { field, type: "quantitative", format: figure.format },
        color: { condition: { test: strong, value: colour("--paper") }, value: colour("--ink") },
      },
    };
    const spec = {
      width: { step: side }, height: { step: Math.min(side, 40) },
      encoding: { x: axis("across", x, { labelAngle: side < 60 ? -40 : 0 }), y: axis("down", y), tooltip },
      layer: side < legible ? [cell] : [cell, value],
    };
    if (names.length < 2) return { data: { values: rows }, ...spec };
    const columns = Math.max(1, Math.floor((room - 80) / (side * x.sort.length + 14)));
    const header = { title: null, labelFontSize: 10, labelColor: colour("--ink"), labelExpr: "split(datum.label, ', ')" };
    return { data: { values: rows }, facet: { field: "series", type: "nominal", sort: names, header }, columns, spacing: 14, spec };
  };
  return { colour, theme, sequence, chart, aspect, heat };
})();
