"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const sections = all("section.table");
  const state = {};
  const bar = document.querySelector(".bar"), below = document.querySelector(".at");
  const selects = all("select[data-axis]");
  const axisSelect = document.getElementById("against"), colourSelect = document.getElementById("colour");
  const by = () => axisSelect?.value ?? data.against;
  // The axis that gives curves their colours; empty: what a table declares, such as classifiers.
  const colourBy = () => colourSelect?.value ?? "";

  for (const section of sections) {
    const table = data.tables[section.dataset.table], { across } = table;
    section.table = table;
    // A curve for each value across, too, unless one is selected.
    if (across && !selects.some((select) => select.dataset.axis === across)) table.series.push(across);
  }

  // The selection is kept in the address: #range_km=100&by=cnr_db&colour=range_km&of=ACN. The curve
  // that the first table is of is chosen among those at the selection.
  const ofSelect = document.querySelector("label.of select");
  const controls = [["by", axisSelect], ["colour", colourSelect], ...selects.map((select) => [select.dataset.axis, select])].filter(([, select]) => select);
  const read = () => {
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      if (name === "of" && ofSelect) ofSelect.dataset.chosen = text;
      const select = controls.find(([key]) => key === name)?.[1];
      const match = select && [...select.options].find((option) => option.value === text || option.text === text);
      if (match) select.value = match.value;
    }
  };
  const write = () => {
    const changed = new URLSearchParams();
    for (const [name, select] of controls) {
      const option = select.selectedOptions[0];
      if (!option.defaultSelected) changed.set(name, select.dataset.axis ? option.text : option.value);
    }
    if (ofSelect?.dataset.chosen) changed.set("of", ofSelect.dataset.chosen);
    const text = changed.toString();
    // A chart of a notebook has no address.
    if (location.protocol !== "about:") history.replaceState(null, "", text ? "#" + text : location.pathname + location.search);
  };

  // Whether each row is at the selection. A part of a table that lacks a value keeps its nearest.
  const selected = (table, free) => {
    const count = table.labels.length;
    const kept = new Array(count).fill(true);
    for (const name of table.axes) {
      if (!(name in state) || free.includes(name) || table.series.includes(name)) continue;
      const column = table.rows[name], nearest = {};
      for (let k = 0; k < count; k++) {
        const part = table.rows.part[k], value = column[k];
        if (value === null || !kept[k]) continue;
        const best = nearest[part];
        const near = (v) => (typeof v === "number" && typeof state[name] === "number" ? Math.abs(v - state[name]) : v === state[name] ? 0 : 1);
        if (best === undefined || near(value) < near(best)) nearest[part] = value;
      }
      for (let k = 0; k < count; k++) {
        const part = table.rows.part[k];
        // What tells parts apart, such as tests from training, is not for them to keep.
        const choice = table.parts[part]?.labels.includes(name) ? state[name] : nearest[part];
        if (column[k] !== null && column[k] !== choice) kept[k] = false;
      }
    }
    return kept;
  };

  const wordsOf = (table, name, k) => {
    const value = table.rows[name]?.[k] ?? null;
    return value === null ? "" : table.words[name]?.[value] ?? String(value);
  };
  const distinct = (values) => [...new Set(values)].filter((value) => value !== null);
  const ascending = (values) => (values.every((value) => typeof value === "number") ? values.sort((a, b) => a - b) : values);
  const numeric = (table, name) => table.x[name]?.type === "quantitative";
  // Rows at the selection that have a figure, by their places in the columns.
  const placesOf = (table, figure, free) =>
    selected(table, free).flatMap((kept, k) => (kept && table.rows[figure][k] !== null ? [k] : []));
  const figureOf = (section) => section.querySelector("select.figure")?.value ?? Object.keys(section.table.figures)[0];
  // The declared axes, but some, along which rows differ, and the name that tells a row's curve.
  const curvesOf = (table, places, but) =>
    table.series.filter((name) => !but.includes(name) && distinct(places.map((k) => table.rows[name][k])).length > 1);
  const nameOf = (table, names, k) => names.map((name) => wordsOf(table, name, k)).filter(Boolean).join(", ");

  // Whether a figure or its interval differs along an axis, on any curve at the selection.
  const varies = (table, figure, axis) => {
    const { low, high } = table.figures[figure], texts = new Map();
    const others = table.axes.filter((name) => name !== axis);
    return placesOf(table, figure, [axis]).some((k) => {
      const value = table.rows[axis][k];
      if (value === null || value === "overall") return false;
      const key = JSON.stringify(others.map((name) => table.rows[name][k]));
      const text = JSON.stringify([figure, low, high].map((name) => table.rows[name]?.[k] ?? null));
      if (!texts.has(key)) texts.set(key, text);
      return texts.get(key) !== text;
    });
  };
  // The axis along the chart of a figure: the chosen one, or of a table without it the first; empty
  // if the figure is the same all along.
  const axisOf = (table, figure) => (by() in table.x ? [by()] : table.along).find((axis) => varies(table, figure, axis)) ?? "";
  // The axis of the colours of a chart, or of the other side of its heat map.
  const colourOf = (table, axis) => {
    if (colourBy() !== axis && colourBy() in table.x) return colourBy();
    const names = table.series.filter((name) => name !== axis);
    return names.length === 1 && numeric(table, names[0]) ? names[0] : "";
  };

  const fill = (section) => {
    const { table } = section, axis = axisOf(table, figureOf(section)) || by();
    const kept = selected(table, [axis, colourOf(table, axis), table.across]);
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

  // Charts, each in a figure of its own.
  const tip = document.getElementById("tip");
  const views = new Map();
  const hover = (section) => (handler, event, item, value) => {
    tip.hidden = !value;
    if (!value) return;
    tip.textContent = Object.entries(value).map(([key, text]) => `${key}: ${text}`).join("\n");
    tip.style.left = Math.min(event.pageX + 12, document.documentElement.clientWidth - 240) + "px";
    tip.style.top = event.pageY + 12 + "px";
    if (item.datum.k !== undefined) reproduce(section, item.datum.k, figureOf(section));
  };
  // Draw rows as a chart of a kind, if there are any, in the figure of that class.
  const show = async (section, kind, figure, rows, more) => {
    const element = section.querySelector(`figure.${kind}`);
    element.hidden = !rows.length;
    if (!rows.length) return;
    const spec = charts[kind]({ rows, figure: section.table.figures[figure], room: element.clientWidth, ...more });
    const view = await vegaEmbed(element.querySelector(".draw"), spec, {
      ast: true, renderer: "svg", actions: false, defaultStyle: false, logLevel: 1, tooltip: hover(section), config: charts.theme(),
    });
    views.get(element)?.finalize();
    views.set(element, view);
  };
  // Rows of a chart: what it shows of each place, and the name of its curve.
  const rowsOf = (table, places, figure, names, more = []) => {
    const { low, high, chance } = table.figures[figure];
    const shown = [figure, low, high, chance, ...more].filter(Boolean);
    return places.map((k) => ({
      k, series: nameOf(table, names, k) || table.headings[figure],
      ...Object.fromEntries(shown.map((name) => [name, table.rows[name][k]])),
    }));
  };
  const tipsOf = (table, figure, axes = []) => {
    const { low, high } = table.figures[figure];
    const titled = (field) => ({ field, title: table.headings[field] });
    const figures = [figure, low, high].filter(Boolean).map((field) => ({ ...titled(field), type: "quantitative", format: ".4~g" }));
    return [...axes.map(titled), ...figures];
  };
  // Names, colours and heading of the curves of some rows. A classifier has one colour everywhere.
  const curvesIn = (table, rows, names, figure, axis) => {
    const series = distinct(rows.map((row) => row.series)), title = names.map((name) => table.headings[name]).join(", ");
    const hue = (name, number) => {
      const place = data.colours.indexOf(wordsOf(table, table.colour, rows.find((row) => row.series === name).k));
      return charts.colour(`--c${(place < 0 ? number : place) % 8}`);
    };
    const colours = numeric(table, names[0]) ? charts.sequence(series.length) : series.map(hue);
    return { names: series, colours, title, tooltip: [{ field: "series", title: title || "curve" }, ...tipsOf(table, figure, [axis])] };
  };
  // Keep the rows of one curve, which a section lets choose: at first the one with the best mean.
  const ofOne = (section, places, but, figure) => {
    const { table } = section, label = section.querySelector("label.of"), select = label.querySelector("select");
    const names = table.series.filter((name) => !but.includes(name));
    const curves = distinct(places.map((k) => nameOf(table, names, k)));
    label.hidden = curves.length < 2;
    if (label.hidden) return places;
    label.querySelector("span").textContent = colourBy() ? "curves and heat map of" : "heat map of";
    const mean = (curve) => {
      const values = places.filter((k) => nameOf(table, names, k) === curve).map((k) => table.rows[figure][k]);
      return values.reduce((sum, value) => sum + value, 0) / values.length;
    };
    const { chosen } = select.dataset, best = curves.includes(chosen) ? chosen : curves.reduce((highest, curve) => (mean(curve) > mean(highest) ? curve : highest));
    select.replaceChildren(...curves.map((curve) => new Option(curve, curve, false, curve === best)));
    return places.filter((k) => nameOf(table, names, k) === select.value);
  };

  const drawCurves = (section, figure, axis, tone) => {
    const { table } = section, has = (k, name) => table.rows[name][k] !== null;
    let places = placesOf(table, figure, [axis, tone]).filter((k) => table.rows[axis][k] !== "overall" || axis !== table.across);
    if (tone) {
      const order = ascending(distinct(places.map((k) => table.rows[tone][k])));
      const rank = (k) => order.indexOf(table.rows[tone][k]);
      places = places.filter((k) => has(k, axis) && has(k, tone)).sort((a, b) => rank(a) - rank(b));
      if (section.querySelector("label.of") && colourBy()) places = ofOne(section, places, [axis, tone], figure);
    }
    const names = [...(tone ? [tone] : []), ...curvesOf(table, places, [axis, tone])];
    // A curve without the axis is a horizontal line, with its marker at the last value.
    const along = ascending(distinct(places.map((k) => table.rows[axis][k])));
    const last = along.length - 1, joined = table.x[axis].type !== "nominal";
    const rows = rowsOf(table, places, figure, names, [axis]).flatMap((row) =>
      row[axis] !== null ? [row] : along.map((value, k) => ({ ...row, [axis]: value, bare: joined && k < last })));
    return show(section, "chart", figure, rows, { x: table.x[axis], ...curvesIn(table, rows, names, figure, axis) });
  };
  const drawAspect = (section, figure) => {
    const { table } = section, angle = table.across;
    const ends = (bin) => /^([\d.]+)(?:-([\d.]+))?$/.exec(bin)?.slice(1).map((end) => Number(end ?? bin));
    const places = placesOf(table, figure, [angle]).filter((k) => ends(table.rows[angle][k]));
    const names = curvesOf(table, places, []), rows = rowsOf(table, places, figure, names, [angle]);
    for (const row of rows) row.bin = ends(row[angle]);
    const bins = distinct(rows.map((row) => row[angle])).length;
    return show(section, "aspect", figure, bins > 1 ? rows : [], curvesIn(table, rows, names, figure, angle));
  };
  const CELLS = 160; // of matrices that are shown side by side
  const drawHeat = (section, figure, across, down) => {
    const { table } = section;
    let places = placesOf(table, figure, [across, down]).filter((k) => table.rows[across][k] !== null && table.rows[down][k] !== null);
    const names = curvesOf(table, places, [across, down]), beside = table.matrix.length && places.length <= CELLS;
    if (!beside) places = ofOne(section, places, [across, down], figure);
    const whose = table.series.filter((name) => ![across, down].includes(name));
    section.querySelector(".whose").textContent = beside || !places.length ? "" : nameOf(table, whose, places[0]);
    const values = (name) => ascending(distinct(places.map((k) => table.rows[name][k])));
    const [x, y] = [values(across), values(down)], enough = x.length > 1 && y.length > 1;
    const words = (name, values) => values.map((value) => table.words[name]?.[value] ?? String(value));
    const rows = rowsOf(table, places, figure, names).map((row) => ({ ...row, across: wordsOf(table, across, row.k), down: wordsOf(table, down, row.k) }));
    const tooltip = [["across", across], ["down", down]].map(([field, name]) => ({ field, title: table.headings[name] }));
    return show(section, "heat", figure, enough ? rows : [], {
      names: beside ? distinct(rows.map((row) => row.series)) : [],
      x: { title: table.headings[across], sort: words(across, x) },
      y: { title: table.headings[down], sort: words(down, numeric(table, down) ? y.reverse() : y) },
      tooltip: [...tooltip, ...tipsOf(table, figure)],
    });
  };
  const draw = async (section) => {
    const { table } = section;
    // Only figures that differ along the axis are drawn; a table without any is unfolded.
    const options = all("select.figure option", section);
    for (const option of options) option.hidden = option.disabled = !axisOf(table, option.value);
    if (options.some((option) => option.selected && option.hidden)) (options.find((option) => !option.hidden) ?? options[0]).selected = true;
    const figure = figureOf(section), axis = axisOf(table, figure), tone = colourOf(table, axis);
    if (!axis && !table.matrix.length) section.querySelector("details.rows").open = true;
    const [chart, aspect, heat] = ["chart", "aspect", "heat"].map((kind) => section.querySelector(`figure.${kind}`));
    if (chart) {
      const note = chart.querySelector(".same");
      note.hidden = axis !== "" || !(by() in table.x);
      if (!note.hidden) note.textContent = `${table.headings[figure]} is the same at every ${table.headings[by()]}.`;
      for (const part of all(".draw, .svg", chart)) part.hidden = !axis;
      chart.hidden = false;
      if (axis) await drawCurves(section, figure, axis, tone);
      section.dataset.axis = axis;
    }
    if (aspect && table.figures[figure].y.scale.domain) await drawAspect(section, figure);
    else if (aspect) aspect.hidden = true; // a radius is not below 0
    const [across, down] = table.matrix.length ? table.matrix : [axis, colourBy() || data.second];
    const crossed = across !== down && [across, down].every((name) => table.axes.includes(name));
    if (heat && crossed) await drawHeat(section, figure, across, down);
    else if (heat) heat.hidden = true;
  };
  const save = (name, text, type) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const csvOf = (lines) => lines.map((line) => line.map((value) => {
    const text = value === null || value === undefined ? "" : String(value);
    const safe = typeof value === "string" && /^[=+\-@\t\r]/.test(text) ? "'" + text : text;
    return /[",\n\r]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  }).join(",")).join("\r\n");
  const allRows = ({ table }) => {
    const names = Object.keys(table.rows).filter((name) => name !== "part");
    return [names, ...table.labels.map((_, k) => names.map((name) => table.rows[name][k]))];
  };
  // The visible rows and columns; after a figure the ends of its interval, if any is visible.
  const seenRows = (section) => {
    const { table } = section, visible = (cells) => [...cells].filter((cell) => !cell.hidden);
    const heads = visible(section.querySelectorAll("thead th")).map((cell) => cell.textContent);
    const rows = all("tbody tr:not([hidden])", section).map((row) => visible(row.children));
    const bounded = heads.map((_, column) => rows.some((cells) => cells[column].querySelector(".interval")));
    const places = new Map(table.labels.map((label, k) => [label, k]));
    const valuesOf = (cell, ends) => {
      if (!cell.dataset.f) return [cell.textContent, ...(ends ? [null, null] : [])];
      const { low, high } = table.figures[cell.dataset.f], k = places.get(Number(cell.dataset.r));
      return [cell.dataset.f, ...(ends ? [low, high] : [])].map((name) => table.rows[name]?.[k]);
    };
    return [
      heads.flatMap((head, column) => (bounded[column] ? [head, `${head} low`, `${head} high`] : [head])),
      ...rows.map((cells) => cells.flatMap((cell, column) => valuesOf(cell, bounded[column]))),
    ];
  };

  // Which Python gives a figure: of the cell under the pointer, or the keyboard.
  const where = document.getElementById("where");
  const code = (table, k, figure) => {
    const part = table.parts[table.rows.part[k]];
    if (!part?.group || !(figure in part.variables)) return "computed from the group classification";
    const quoted = (value) => (value === true ? "True" : value === false ? "False" : JSON.stringify(value));
    const place = part.dims[figure].filter((dim) => dim in part.names && table.rows[part.names[dim]][k] !== null)
      .map((dim) => `${dim}=${quoted(table.rows[part.names[dim]][k])}`).join(", ");
    const factor = table.factors[figure] === 1 ? "" : `${table.factors[figure]} * `;
    const group = `xr.open_zarr(${JSON.stringify(data.store)}, group="${part.group}")`;
    return `${factor}float(${group}["${part.variables[figure]}"]${place ? `.sel(${place})` : ""})`;
  };
  const reproduce = (section, k, figure) => {
    where.hidden = false;
    where.querySelector("code").textContent = code(section.table, k, figure);
  };
  for (const section of sections) {
    const table = section.querySelector("table");
    const say = (event) => {
      const cell = event.target.closest("td[data-f]");
      if (cell) reproduce(section, section.table.labels.indexOf(Number(cell.dataset.r)), cell.dataset.f);
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
    const name = section.dataset.table, of = section.querySelector("label.of select");
    section.querySelector("select.figure")?.addEventListener("change", () => { fill(section); draw(section); });
    of?.addEventListener("change", () => { of.dataset.chosen = of.value; write(); draw(section); });
    for (const button of all("button.svg", section)) {
      const figure = button.closest("figure");
      button.addEventListener("click", async () => save(`${name}-${figure.className}.svg`, await views.get(figure).view.toSVG(), "image/svg+xml"));
    }
    for (const [kind, rows] of [["seen", seenRows], ["all", allRows]]) {
      section.querySelector(`button.${kind}`).addEventListener("click", () => save(`${name}.csv`, csvOf(rows(section)), "text/csv"));
    }
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

  // The bar has no value of the axes along and of the colours of charts: only pictures below, and
  // tables, are at one.
  const arrange = () => {
    const along = by();
    if (colourSelect?.value === along) colourSelect.value = "";
    const coloured = colourBy();
    for (const select of selects) {
      const label = select.parentElement, spread = [along, coloured].includes(select.dataset.axis);
      (spread ? below : bar).append(label);
    }
    below.hidden = !below.querySelector("label") || !document.querySelector("figure.aspect, [data-table=confusion]");
    for (const option of colourSelect?.options ?? []) option.hidden = option.disabled = option.value === along;
  };
  const headline = document.querySelector(".headline");
  const update = () => {
    for (const select of selects) state[select.dataset.axis] = JSON.parse(select.value);
    arrange();
    if (data.headline) {
      const about = data.headline, table = data.tables[about.table];
      const bin = state[table.across] ?? about.overall, kept = selected(table, [by(), table.across]);
      headline.textContent = headlineOf(about, table, kept, by(), bin);
    }
    for (const section of sections) {
      fill(section);
      draw(section);
    }
  };
  // What is closed is printed.
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = all("details:not([open], .code)");
    for (const details of closed) details.open = true;
  });
  addEventListener("afterprint", () => { for (const details of closed) details.open = false; });

  if (controls.length) {
    bar.hidden = false;
    for (const form of [bar, below]) form.addEventListener("change", () => { write(); update(); });
    bar.addEventListener("submit", (event) => event.preventDefault());
  }
  addEventListener("hashchange", () => { read(); update(); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", update);
  let wide = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== wide) { wide = innerWidth; update(); } });
  read();
  for (const section of sections) section.querySelector("details.rows").open = false;
  update();
})();
