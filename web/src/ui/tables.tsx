/** The values of the charts as tables. */

import type { ComponentChildren } from "preact";
import type { Forecast } from "../api/documents";
import { interpolate } from "../model/interpolate";
import { PERCENT } from "../model/units";
import { history, shownProfile } from "../state/drive";
import { format, text, units } from "../state/preferences";
import { DataTable } from "./data-table";
import { Fold } from "./parts";
import { range } from "./wording";

const ROWS = 16;

function Table({ title, head, rows }: { title: string; head: string[]; rows: ComponentChildren[][] }) {
  return (
    <Fold title={title}>
      <DataTable label={title} heads={head}>
        {rows.map((row) => (
          <tr key={String(row[0])}>
            {row.map((cell, k) => (
              <td key={head[k]}>{cell}</td>
            ))}
          </tr>
        ))}
      </DataTable>
    </Fold>
  );
}

/** About `ROWS` of the indices below `count`, the first and the last among them. */
function some(count: number): number[] {
  const rows = Math.min(count, ROWS);
  const picked = Array.from({ length: rows }, (_, k) =>
    Math.round((k * (count - 1)) / Math.max(rows - 1, 1)),
  );
  return [...new Set(picked)];
}

export function RouteTable({ of }: { of: Forecast }) {
  const { distance, speed, height } = units.value;
  const { duration, figure } = format.value;
  const { tables, result } = text.value;
  const { series } = of;
  const profile = shownProfile.value;
  const rows = some(series.distance_m.length).map((k) => {
    const at = series.distance_m[k] as number;
    return [
      figure(distance.from(at), 2),
      duration(series.time_s[k] as number),
      figure(PERCENT.from(series.displayed_soc[k] as number), 1),
      range([series.displayed_soc_low[k] as number, series.displayed_soc_high[k] as number], PERCENT, 1),
      profile ? figure(speed.from(interpolate(at, profile.distanceM, profile.speedMS)), 0) : "",
      profile?.elevationM
        ? figure(height.from(interpolate(at, profile.distanceM, profile.elevationM)), 0)
        : "–",
    ];
  });
  const head = [
    tables.distanceIn(distance.unit),
    result.time,
    tables.battery,
    tables.band,
    tables.speedIn(speed.unit),
    tables.elevationIn(height.unit),
  ];
  return <Table title={tables.route} head={head} rows={rows} />;
}

export function ArrivalTable({ of }: { of: Forecast }) {
  const { shown } = format.value;
  const { tables } = text.value;
  const rows = Object.entries(of.soc_quantiles)
    .map(([p, soc]): [number, number] => [Number(p), soc])
    .sort(([a], [b]) => a - b)
    .map(([p, soc]) => [shown(p, PERCENT, 1), shown(soc, PERCENT, 1)]);
  return <Table title={tables.plain} head={[tables.share, tables.atMost]} rows={rows} />;
}

export function HistoryTable() {
  const { figure } = format.value;
  const { tables } = text.value;
  const points = history.value;
  const { distance } = units.value;
  if (points.length < 2) return null;
  const rows = some(points.length).map((k) => {
    const { distanceM, soc, low, high, naive } = points[k] as (typeof points)[number];
    const percent = (value: number) => figure(PERCENT.from(value), 1);
    return [
      figure(distance.from(distanceM), 2),
      percent(soc),
      range([low, high], PERCENT, 1),
      naive === null ? "–" : percent(naive),
    ];
  });
  const head = [tables.distanceIn(distance.unit), tables.forecast, tables.band, tables.gauge];
  return <Table title={tables.plain} head={head} rows={rows} />;
}
