/** Colours of the charts, read from the style sheet. */

export interface Palette {
  text: string;
  muted: string;
  grid: string;
  surface: string;
  main: string;
  mainBand: string;
  mainCore: string;
  other: string;
  otherBand: string;
  driven: string;
  ground: string;
  groundLine: string;
  speed: string;
  alarm: string;
}

export function paletteFrom(element: Element): Palette {
  const style = getComputedStyle(element);
  const colour = (name: string) => style.getPropertyValue(`--${name}`).trim();
  return {
    text: colour("text"),
    muted: colour("muted"),
    grid: colour("grid"),
    surface: colour("surface"),
    main: colour("main"),
    mainBand: colour("main-band"),
    mainCore: colour("main-core"),
    other: colour("other"),
    otherBand: colour("other-band"),
    driven: colour("driven"),
    ground: colour("ground"),
    groundLine: colour("ground-line"),
    speed: colour("speed"),
    alarm: colour("alarm"),
  };
}
