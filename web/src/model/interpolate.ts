/** Linear interpolation at `x`; `xs` must not decrease. Beyond the ends, the value of the end is returned. */
export function interpolate(x: number, xs: ArrayLike<number>, ys: ArrayLike<number>): number {
  const last = xs.length - 1;
  if (last < 0) return Number.NaN;
  let low = 0;
  let high = last;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((xs[middle] as number) < x) low = middle + 1;
    else high = middle;
  }
  const b = ys[low] as number;
  if (low === 0 || (xs[low] as number) <= x) return b;
  const x0 = xs[low - 1] as number;
  const y0 = ys[low - 1] as number;
  return y0 + ((b - y0) * (x - x0)) / ((xs[low] as number) - x0);
}
