"use strict";
// The headline at a selection, in the words of sweeps/report/headline.py, which writes the first.
const headlineOf = (about, table, kept, axis, bin) => {
  const { rows } = table, { figure, low, high, chance } = about;
  const along = axis in about.axes && axis !== table.across ? axis : "";
  const valid = kept.map((_, k) => k).filter((k) => kept[k] && rows[figure][k] !== null
    && (!table.across || rows[table.across][k] === bin) && !about.untested.includes(rows.kind?.[k]));
  const ships = valid.filter((k) => rows.scored?.[k] === "ship");
  const groups = new Map();
  for (const k of ships.length ? ships : valid) {
    const name = table.series.map((column) => rows[column][k]).join("\n");
    groups.set(name, [...(groups.get(name) ?? []), k]);
  }
  const simplicity = (value) => (about.simplest.includes(value) ? about.simplest.indexOf(value) : about.simplest.length);
  const order = (a, b) => a.map((rank, k) => rank - b[k]).find((difference) => difference) ?? 0;
  const candidates = [...groups.values()].map((all) => {
    const measured = along ? all.filter((k) => rows[along][k] !== null) : [];
    const axis = measured.length ? along : "";
    const indices = axis ? measured.filter((k, number) => measured.findIndex((first) => rows[axis][first] === rows[axis][k]) === number) : all.slice(0, 1);
    if (axis && typeof rows[axis][indices[0]] === "number") indices.sort((a, b) => rows[axis][a] - rows[axis][b]);
    return { axis, indices };
  });
  // Ranked by their means at the values that all have, of those that depend on the axis.
  const valuesOf = candidates.filter(({ axis }) => axis).map(({ indices }) => new Set(indices.map((k) => rows[along][k])));
  const values = new Set(valuesOf.flatMap((set) => [...set]));
  const shared = [...values].filter((value) => valuesOf.every((set) => set.has(value)));
  const best = candidates.map(({ axis, indices }) => {
    const ranked = axis && shared.length ? indices.filter((k) => shared.includes(rows[axis][k])) : indices;
    const mean = ranked.reduce((sum, k) => sum + rows[figure][k], 0) / ranked.length;
    const words = [rows.classifier?.[indices[0]], rows.channel?.[indices[0]]];
    return { axis, indices, rank: [-Math.round(1e6 * mean), +words.includes("both"), ...words.map(simplicity)] };
  }).sort((a, b) => order(a.rank, b.rank))[0];
  if (!best) return "No score: no test has an answer at this selection.";
  // Python rounds halves to even.
  const rounded = (value) => String(Math.abs(value % 1) === 0.5 ? 2 * Math.round(value / 2) : Math.round(value));
  const text = (value) => (typeof value === "boolean" ? (value ? "yes" : "no") : typeof value === "number" ? String(+value.toPrecision(6)) : value.replaceAll("_", " "));
  const inWords = (name, value, named = true) => [named && about.axes[name][0], text(value), about.axes[name][1]].filter(Boolean).join(" ");
  const [first] = best.indices, ends = [...new Set([first, best.axis ? best.indices.at(-1) : first])];
  const score = ends.map((k, number) => {
    const value = (name) => (name ? rows[name]?.[k] ?? null : null);
    const interval = value(low) === null || value(high) === null ? "" : ` [${rounded(value(low))}–${rounded(value(high))}]`;
    const doubtful = value(chance) !== null && value(low) !== null && value(low) <= value(chance);
    return `${rounded(rows[figure][k])} %${interval}${number ? "" : ` of ${about.ships}`}`
      + (best.axis ? ` at ${inWords(best.axis, rows[best.axis][k], !number)}` : "") + (doubtful ? ", not significantly better than chance" : "");
  });
  const settings = about.settings.filter((name) => name !== best.axis && best.indices.every((k) => rows[name][k] !== null && rows[name][k] === rows[name][first]));
  const conditions = settings.map((name) => inWords(name, rows[name][first]));
  if (table.across && bin !== about.overall) conditions.push(`aspect ${bin}°`);
  const channel = rows.channel[first], name = `${table.words.classifier[rows.classifier[first]]} on ${about.by[channel] ?? channel}`;
  const start = groups.size > 1 ? `Best of ${groups.size}: ${name}` : name[0].toUpperCase() + name.slice(1);
  const level = chance && rows[chance][first] !== null ? `; chance ${rounded(rows[chance][first])} %.` : ".";
  const ranking = shared.length === values.size ? ""
    : shared.length ? ` Ranked by ${shared.length} of ${values.size} values of ${about.axes[along][0]}, ${shared.length > 1 ? "those" : "the one"} that all have.`
    : ` Ranked by means over different values of ${about.axes[along][0]}, since none is shared.`;
  const minAnswers = rows.n ? Math.min(...best.indices.map((k) => rows.n[k])) : about.few;
  return `${start} identifies ${score.join(score[0].endsWith("chance") ? ", and " : " and ")}${conditions.length ? ` (${conditions.join(", ")})` : ""}${level}${ranking}`
    + (minAnswers < about.few ? ` Few answers (n = ${rounded(minAnswers)}) make the interval wide.` : "");
};
