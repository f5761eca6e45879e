/** The report of a fleet: its tables can be sorted and filtered, and its first page has charts. */

import DataTable from "datatables.net";
import uPlot from "uplot";
import "./report.css";

interface Chart {
  title: string;
  names: string[];
  series: [string, number[]][];
}

const MOST_CHOICES = 30;
const ROWS = 15;
const HEIGHT = 260;
const DARK = "(prefers-color-scheme:dark)";

/** The number of a cell as the report writes it; a dash is below all numbers. */
function figureOf(text: string): number {
  const value = Number.parseFloat(text.replaceAll(",", "").replace("\u2212", "-"));
  return Number.isNaN(value) ? Number.NEGATIVE_INFINITY : value;
}

/** A choice of the values of each column of words that has few of them. */
function filtersOf(table: HTMLTableElement): HTMLElement {
  const filters = document.createElement("div");
  filters.className = "filters";
  const rows = [...(table.tBodies[0]?.rows ?? [])];
  for (const [at, head] of [...(table.tHead?.rows[0]?.cells ?? [])].entries()) {
    const values = [...new Set(rows.map((row) => row.cells[at]?.textContent ?? ""))].sort();
    if (!head.classList.contains("text") || at === 0 || values.length < 2 || values.length > MOST_CHOICES)
      continue;
    const select = document.createElement("select");
    select.add(new Option("\u2013", ""));
    for (const value of values) select.add(new Option(value));
    select.dataset.column = String(at);
    select.ariaLabel = head.textContent;
    const label = document.createElement("label");
    label.append(`${head.textContent ?? ""} `, select);
    filters.append(label);
  }
  return filters;
}

function enhance(table: HTMLTableElement): void {
  const heads = [...(table.tHead?.rows[0]?.cells ?? [])];
  const figures = heads.flatMap((head, at) => (head.classList.contains("text") ? [] : [at]));
  const filters = filtersOf(table);
  const shown = new DataTable(table, {
    order: [],
    // drivers are not ranked
    ordering: table.closest("#panel-drivers") === null,
    pageLength: ROWS,
    paging: (table.tBodies[0]?.rows.length ?? 0) > ROWS,
    info: false,
    autoWidth: false,
    columnDefs: [{ targets: figures, type: "figure" }],
    layout: { topStart: filters, topEnd: "search", bottomStart: null, bottomEnd: "paging" },
  });
  filters.addEventListener("change", ({ target }) => {
    if (!(target instanceof HTMLSelectElement)) return;
    shown
      .column(Number(target.dataset.column))
      .search(target.value, { exact: target.value !== "" })
      .draw();
  });
}

function draw(place: HTMLElement, { title, names, series }: Chart): uPlot {
  const style = getComputedStyle(document.documentElement);
  const [ink, accent, rule] = ["--soft", "--accent", "--rule"].map((name) => style.getPropertyValue(name));
  const bars = uPlot.paths.bars?.({ size: [0.6, 40] });
  const axis = { stroke: ink, grid: { stroke: rule, width: 1 }, ticks: { stroke: rule } } as uPlot.Axis;
  const named = (_: uPlot, at: number[]) => at.map((x) => names[x] ?? "");
  return new uPlot(
    {
      title,
      legend: { live: false },
      width: place.clientWidth,
      height: HEIGHT,
      cursor: { drag: { x: false, y: false } },
      scales: {
        x: { time: false, range: [-0.6, names.length - 0.4] },
        y: { range: (_, low, high) => [Math.min(0, low) * 1.05, Math.max(0, high) * 1.05] },
      },
      axes: [
        { ...axis, grid: { show: false }, values: named, rotate: -60, size: 70, incrs: [1, 2, 5, 10] },
        axis,
      ],
      series: [
        {},
        ...series.map(([label], k) =>
          k === 0
            ? { label, fill: accent, paths: bars, points: { show: false } }
            : { label, stroke: ink, width: 2, points: { show: true } },
        ),
      ] as uPlot.Series[],
    },
    [names.map((_, at) => at), ...series.map(([, values]) => values)],
    place,
  );
}

function showCharts(charts: readonly Chart[]): void {
  const places = charts.map(({ title }) => {
    const place = document.createElement("div");
    place.setAttribute("role", "img");
    place.setAttribute("aria-label", title);
    document.getElementById("charts")?.append(place);
    return place;
  });
  let drawn: uPlot[] = [];
  const again = () => {
    for (const chart of drawn) chart.destroy();
    drawn = places.map((place, at) => draw(place, charts[at] as Chart));
  };
  again();
  matchMedia(DARK).addEventListener("change", again);
  addEventListener("resize", again);
}

DataTable.type("figure", "order", { pre: figureOf });
for (const table of document.querySelectorAll("table")) enhance(table);
showCharts(JSON.parse(document.getElementById("data")?.textContent ?? "[]") as Chart[]);
