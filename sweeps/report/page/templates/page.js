"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const all = (what, where = document) => [...where.querySelectorAll(what)];
  const state = {};
  const against = document.getElementById("against");
  const selects = all("select[data-axis]");
  const by = () => (against ? against.value : "");

  // The selection is kept in the address: #range_km=100&by=cnr_db.
  const read = () => {
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      const select = name === "by" ? against : selects.find((one) => one.dataset.axis === name);
      const option = select && [...select.options].find((one) => one.value === text || one.text === text);
      if (option) select.value = option.value;
    }
  };
  const write = () => {
    const changed = new URLSearchParams();
    if (against && !against.selectedOptions[0].defaultSelected) changed.set("by", against.value);
    for (const select of selects) {
      const option = select.selectedOptions[0];
      if (!option.defaultSelected) changed.set(select.dataset.axis, option.text);
    }
    const text = changed.toString();
    history.replaceState(null, "", text ? "#" + text : location.pathname + location.search);
  };

  // The axis down and along the chart of a table: the chosen one, or its own first, or that across.
  const axisOf = (table) => {
    const own = [by(), ...Object.keys(table.x).filter((one) => one !== table.across), table.across];
    return own.find((one) => one in table.x) || "";
  };

  // Whether each row is at the selection. A part of a table that lacks a value keeps its nearest.
  const selected = (table, free) => {
    const count = table.labels.length;
    const kept = new Array(count).fill(true);
    for (const name of table.axes) {
      if (!(name in state) || free.includes(name) || table.series.includes(name)) continue;
      const column = table.rows[name], wanted = {};
      for (let k = 0; k < count; k++) {
        const part = table.rows.part[k], value = column[k];
        if (value === null || !kept[k]) continue;
        const best = wanted[part];
        const near = (v) => (typeof v === "number" && typeof state[name] === "number" ? Math.abs(v - state[name]) : v === state[name] ? 0 : 1);
        if (best === undefined || near(value) < near(best)) wanted[part] = value;
      }
      for (let k = 0; k < count; k++) {
        const part = table.rows.part[k];
        // What tells parts apart, such as tests from training, is not for them to keep.
        const own = table.parts[part]?.labels.includes(name) ? state[name] : wanted[part];
        if (column[k] !== null && column[k] !== own) kept[k] = false;
      }
    }
    return kept;
  };

  const wordsOf = (table, name, k) => {
    const value = table.rows[name]?.[k] ?? null;
    return value === null ? "" : table.words[name][value] ?? String(value);
  };
  const seriesOf = (table, k, axis) => table.series.filter((name) => name !== axis)
    .map((name) => wordsOf(table, name, k)).filter(Boolean).join(", ");

  const fill = (section) => {
    const table = data.tables[section.dataset.table];
    const axis = axisOf(table);
    const kept = selected(table, [axis, table.across]);
    const place = new Map(table.labels.map((label, k) => [label, k]));
    const rows = all("tbody tr", section);
    for (const row of rows) {
      const cells = [...row.querySelectorAll("td[data-r]")].map((cell) => place.get(Number(cell.dataset.r)));
      row.hidden = !cells.some((k) => kept[k]);
    }
    all("td[tabindex]", section).forEach((cell) => cell.removeAttribute("tabindex"));
    const first = section.querySelector("tbody tr:not([hidden]) td");
    if (first) first.tabIndex = 0;
    // Axes of one value in the rows shown are left out.
    all("thead th[data-axis]", section).forEach((head, k) => {
      const values = new Set(rows.filter((row) => !row.hidden).map((row) => row.children[k].textContent));
      values.delete("");
      head.hidden = values.size < 2;
      for (const row of rows) row.children[k].hidden = head.hidden;
    });
  };

  // Charts: one specification each, with the rows at the selection.
  const tip = document.getElementById("tip");
  const views = new Map();
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const theme = () => ({
    background: "transparent",
    axis: { labelColor: colour("--ink"), titleColor: colour("--ink"), gridColor: colour("--rule"), domainColor: colour("--rule"), tickColor: colour("--rule") },
    legend: { orient: "bottom", columns: 2, labelColor: colour("--ink"), labelLimit: 300 },
    view: { stroke: colour("--rule") },
    rule: { color: colour("--soft") },
  });
  const hover = (handler, event, item, value) => {
    tip.hidden = !value;
    if (!value) return;
    const lines = Object.entries(value).filter(([key]) => !["shift", "part", "colour"].includes(key));
    tip.textContent = lines.map(([key, text]) => `${key}: ${text}`).join("\n");
    tip.style.left = Math.min(event.pageX + 12, document.documentElement.clientWidth - 240) + "px";
    tip.style.top = event.pageY + 12 + "px";
  };
  const DASHES = [[1, 0], [5, 3], [2, 2], [8, 3, 2, 3]];
  const valuesOf = (table, axis, figure) => {
    const kept = selected(table, [axis]);
    const found = [];
    for (let k = 0; k < kept.length; k++) {
      if (!kept[k] || table.rows[figure][k] === null || table.rows[axis]?.[k] === null) continue;
      if (axis === table.across && table.rows[axis][k] === "overall") continue;
      const row = { series: seriesOf(table, k, axis) || table.headings[figure], colour: wordsOf(table, table.colour, k) };
      for (const [name, column] of Object.entries(table.rows)) {
        if (column[k] !== null && (name === axis || !table.series.includes(name))) row[name] = column[k];
      }
      found.push(row);
    }
    return found;
  };
  const draw = async (section) => {
    const table = data.tables[section.dataset.table], figure = section.querySelector(".chart");
    if (!figure) return;
    const axis = axisOf(table), which = section.querySelector("select.figure");
    const name = which ? which.value : Object.keys(table.charts)[0];
    const rows = axis && name ? valuesOf(table, axis, name) : [];
    figure.hidden = !rows.length;
    if (!rows.length) return;
    const series = [...new Set(rows.map((row) => row.series))];
    // Words have no order: their values stand side by side, not joined.
    const joined = table.x[axis].type !== "nominal", apart = joined ? 7 : 32;
    for (const row of rows) row.shift = series.length < 2 ? 0 : apart * (series.indexOf(row.series) / (series.length - 1) - 0.5);
    // A tip shows the axis, the figure and what belongs to it, and axes that differ.
    const differing = table.axes.filter((one) => new Set(rows.map((row) => row[one])).size > 1);
    const tipped = ["series", ...differing, ...Object.keys(rows[0]).filter((one) => !table.axes.includes(one) && one.length && (one === name || /ci_|^n$|source|chance|spread/.test(one)))];
    const spec = structuredClone(data.chart), { y, low, high, chance } = table.charts[name];
    // A classifier has one colour in every chart; its curves differ by their dashes.
    const number = (one) => {
      const place = data.colours.indexOf(rows.find((row) => row.series === one).colour);
      return (place < 0 ? series.indexOf(one) : place) % 8;
    };
    const dash = (one, place) => DASHES[series.slice(0, place).filter((other) => number(other) === number(one)).length % DASHES.length];
    const domain = { domain: series, range: series.map((one) => colour(`--c${number(one)}`)) };
    const dashes = { domain: series, range: series.map(dash) };
    const legend = series.length < 2 ? { legend: null } : {};
    const shared = {
      x: table.x[axis],
      color: { field: "series", type: "nominal", title: null, scale: domain, ...legend },
      opacity: { condition: { param: "picked", value: 1 }, value: 0.08 },
    };
    const { interval, line, point, chance: level } = spec.layer;
    interval.encoding = { ...shared, y: { ...y, field: low }, y2: { field: high } };
    line.encoding = { ...shared, y, strokeDash: { field: "series", title: null, scale: dashes, ...legend } };
    const tooltip = [...new Set(tipped)].map((field) => ({ field, title: table.headings[field] ?? field }));
    point.encoding = { ...shared, y, shape: { field: "series", legend: null }, tooltip };
    level.encoding.y = { field: chance, type: "quantitative", aggregate: "max", title: y.title };
    spec.layer = [...(low && high ? [interval] : []), ...(joined ? [line] : []), point, ...(chance ? [level] : [])];
    spec.data = { values: rows };
    spec.width = Math.max(200, Math.min(620, figure.clientWidth - 70));
    if (series.length < 2 || figure.clientWidth < 500) spec.config.legend.columns = 1;
    const made = await vegaEmbed(figure.querySelector(".draw"), spec, {
      ast: true, renderer: "svg", actions: false, defaultStyle: false, logLevel: 1, tooltip: hover, config: theme(),
    });
    views.get(section)?.finalize();
    views.set(section, made);
    figure.dataset.axis = axis;
  };
  const save = (name, text, type) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const csv = (section) => {
    const table = data.tables[section.dataset.table];
    const names = Object.keys(table.rows).filter((one) => one !== "part");
    const cell = (value) => {
      const text = value === null ? "" : String(value);
      const safe = typeof value === "string" && /^[=+\-@\t\r]/.test(text) ? "'" + text : text;
      return /[",\n\r]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
    };
    const lines = table.labels.map((_, k) => names.map((one) => cell(table.rows[one][k])).join(","));
    return [names.join(","), ...lines].join("\r\n");
  };

  // Which Python gives a figure: of the cell under the pointer, or the keyboard.
  const where = document.getElementById("where");
  const code = (section, cell) => {
    const table = data.tables[section.dataset.table], figure = cell.dataset.f;
    const k = table.labels.indexOf(Number(cell.dataset.r)), part = table.parts[table.rows.part[k]];
    if (!part?.group || !(figure in part.variables)) return "computed from the group classification";
    const quoted = (value) => (value === true ? "True" : value === false ? "False" : JSON.stringify(value));
    const place = part.dims[figure].filter((dim) => dim in part.names && table.rows[part.names[dim]][k] !== null)
      .map((dim) => `${dim}=${quoted(table.rows[part.names[dim]][k])}`).join(", ");
    const factor = table.factors[figure] === 1 ? "" : `${table.factors[figure]} * `;
    const group = `xr.open_zarr(${JSON.stringify(data.store)}, group="${part.group}")`;
    return `${factor}float(${group}["${part.variables[figure]}"]${place ? `.sel(${place})` : ""})`;
  };
  for (const section of all("section.table")) {
    const table = section.querySelector("table");
    const say = (event) => {
      const cell = event.target.closest("td[data-f]");
      if (!cell) return;
      where.hidden = false;
      where.querySelector("code").textContent = code(section, cell);
    };
    table.addEventListener("pointerover", say);
    table.addEventListener("focusin", say);
    table.addEventListener("keydown", (event) => {
      const cell = event.target.closest("td");
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!cell || !step) return;
      const rows = all("tbody tr:not([hidden])", table);
      const next = rows[rows.indexOf(cell.parentElement) + step[0]]?.children[cell.cellIndex + step[1]];
      if (!next || next.tagName !== "TD") return;
      event.preventDefault();
      cell.tabIndex = -1;
      next.tabIndex = 0;
      next.focus();
    });
    section.querySelector("select.figure")?.addEventListener("change", () => draw(section));
    section.querySelector("button.svg")?.addEventListener("click", async () =>
      save(`${section.dataset.table}.svg`, await views.get(section).view.toSVG(), "image/svg+xml"));
    section.querySelector("button.csv")?.addEventListener("click", () => save(`${section.dataset.table}.csv`, csv(section), "text/csv"));
  }
  const copy = where.querySelector("button");
  copy.addEventListener("click", () => {
    const range = document.createRange();
    range.selectNodeContents(where.querySelector("code"));
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    copy.textContent = document.execCommand("copy") ? "Copied" : "Press Ctrl+C";
    setTimeout(() => { copy.textContent = "Copy"; }, 1500);
  });

  const said = document.querySelector(".headline");
  const update = () => {
    for (const select of selects) state[select.dataset.axis] = JSON.parse(select.value);
    if (data.headline) {
      const about = data.headline, table = data.tables[about.table];
      const bin = state[table.across] ?? about.overall, kept = selected(table, [by(), table.across]);
      said.textContent = headlineOf(about, table, kept, by(), bin);
    }
    for (const section of all("section.table")) {
      fill(section);
      draw(section);
    }
  };
  // What is closed is printed.
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = all("details:not([open], .code)");
    for (const one of closed) one.open = true;
  });
  addEventListener("afterprint", () => { for (const one of closed) one.open = false; });

  const bar = document.querySelector(".bar");
  if (selects.length || against) {
    bar.hidden = false;
    bar.addEventListener("submit", (event) => event.preventDefault());
    bar.addEventListener("change", () => { write(); update(); });
  }
  addEventListener("hashchange", () => { read(); update(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", update);
  let wide = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== wide) { wide = innerWidth; update(); } });
  read();
  update();
})();
