import { svg, type TemplateResult } from 'lit-html';

/** Line icons on a grid of 16, drawn here. */
const PATHS = {
  play: 'M5 3.5v9l7.5-4.5z',
  pause: 'M5 3.5v9M11 3.5v9',
  first: 'M4 3.5v9M12.5 3.5 6.5 8l6 4.5z',
  last: 'M12 3.5v9M3.5 3.5l6 4.5-6 4.5z',
  previous: 'M10.5 3.5 5 8l5.5 4.5',
  next: 'M5.5 3.5 11 8l-5.5 4.5',
  loop: 'M3 8a4 4 0 0 1 4-4h5m0 0L10 2m2 2-2 2M13 8a4 4 0 0 1-4 4H4m0 0 2 2m-2-2 2-2',
  sun: 'M8 5.2a2.8 2.8 0 1 0 0 5.6 2.8 2.8 0 0 0 0-5.6M8 1v1.4M8 13.6V15M1 8h1.4M13.6 8H15M3 3l1 1M12 12l1 1M3 13l1-1M12 4l1-1',
  moon: 'M13 9.6A5.6 5.6 0 0 1 6.4 3 5.6 5.6 0 1 0 13 9.6',
  auto: 'M8 2a6 6 0 1 0 0 12zM8 2a6 6 0 0 1 0 12',
  upload: 'M8 10.5V2.5m0 0L4.8 5.7M8 2.5l3.2 3.2M2.5 10v3.5h11V10',
  download: 'M8 2.5v8m0 0 3.2-3.2M8 10.5 4.8 7.3M2.5 10v3.5h11V10',
  link: 'M6.8 9.2 9.2 6.8M7.2 4.8l1.5-1.5a2.7 2.7 0 0 1 4 4l-1.5 1.5M8.8 11.2l-1.5 1.5a2.7 2.7 0 0 1-4-4l1.5-1.5',
  copy: 'M5.5 5.5h8v8h-8zM10.5 5.5v-3h-8v8h3',
  compare: 'M8 1.5v13M2.5 4h3v8h-3zM10.5 4h3v8h-3z',
  camera: 'M2 4.5h3l1-1.5h4l1 1.5h3v8H2zM8 6.2a2.3 2.3 0 1 0 0 4.6 2.3 2.3 0 0 0 0-4.6',
  grid: 'M2.5 13 8 2.5 13.5 13zM5.2 7.8h5.6M8 13 5.2 7.8M8 13l2.8-5.2',
  reset: 'M3 8a5 5 0 1 0 1.6-3.7M4.3 1.6v3h3',
  trash: 'M3 4.5h10M6 4.5v-2h4v2M4.2 4.5l.6 9h6.4l.6-9M6.8 7v4M9.2 7v4',
  stop: 'M4 4h8v8H4z',
  check: 'M3 8.5 6.5 12 13 4.5',
  cross: 'M4 4l8 8M12 4l-8 8',
  warn: 'M8 2 14.5 13.5h-13zM8 6.5v3M8 11.6v.2',
  more: 'M8 3.5v9M3.5 8h9',
  list: 'M2.5 4h11M2.5 8h11M2.5 12h11',
  sphere: 'M8 2a6 6 0 1 0 0 12A6 6 0 0 0 8 2M2 8c2 2.4 10 2.4 12 0M8 2c-2.6 2-2.6 10 0 12',
  upright: 'M3 2v11.5h11M6 4.500a6 6 0 0 1 5.500 5.500m0 0 2-2m-2 2-2.300-1.700',
  facets: 'M8 1.8 13.4 5v6L8 14.2 2.6 11V5zM8 8l5.4-3M8 8v6.2M8 8 2.6 5',
  branch: 'M4.5 2.5v11M4.5 9.5c0-3 7-1.500 7-5.500m0 0L9.200 6.200M11.500 4l2.200 2.300',
} as const;

export type IconName = keyof typeof PATHS;
const SOLID: ReadonlySet<IconName> = new Set(['play', 'stop']);

/** Return an icon; it is for the eye alone, so a button needs a name besides. */
export function icon(name: IconName): TemplateResult<2> {
  return svg`<svg class="icon ${SOLID.has(name) ? 'solid' : ''}" viewBox="0 0 16 16" width="16" height="16"
    aria-hidden="true"><path d=${PATHS[name]} /></svg>`;
}
