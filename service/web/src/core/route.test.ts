import { describe, expect, it } from 'vitest';
import { PLAIN, formatRoute, leftOut, parseRoute, type Route } from './route';

const JOB = 'job_01K5Z9Q8M4T6V2X0Y7R3N1W5BC';
const OTHER = 'job_01K5Z9Q8M4T6V2X0Y7R3N1W5BD';

describe('an address', () => {
  const routes: Route[] = [
    { view: 'home' },
    { view: 'mesh', mesh: 'mesh_4T9V0K2J7C8N5R1W3X6Y0ZQABD', up: 'z', name: null },
    { view: 'mesh', mesh: 'mesh_4T9V0K2J7C8N5R1W3X6Y0ZQABD', up: null, name: 'my cat & dog.obj' },
    { view: 'job', shown: { job: JOB, iteration: null }, look: PLAIN },
    {
      view: 'job',
      shown: { job: JOB, iteration: 250 },
      look: {
        color: 'curvature',
        wire: true,
        up: 'z',
        scale: 'linear',
        camera: { azimuth: 0.5, elevation: -0.25, distance: 3, target: [0, 0.1, -0.2] },
      },
    },
    {
      view: 'compare',
      left: { job: JOB, iteration: 0 },
      right: { job: OTHER, iteration: null },
      look: PLAIN,
    },
  ];
  it.each(routes)('is read as it was written: $view', (route) => {
    expect(parseRoute(formatRoute(route).slice(1))).toEqual(route);
  });

  it('is short and readable', () => {
    const route: Route = {
      view: 'compare',
      left: { job: JOB, iteration: 5 },
      right: { job: JOB, iteration: 90 },
      look: PLAIN,
    };
    expect(formatRoute(route)).toBe(`/?compare=${JOB}@5,${JOB}@90`);
    expect(formatRoute({ view: 'home' })).toBe('/');
    expect(formatRoute({ view: 'job', shown: { job: JOB, iteration: 3 }, look: PLAIN }, '/embed')).toBe(
      `/embed?job=${JOB}&it=3`,
    );
  });

  it.each([
    ['?job=<script>', '“<script>” is not the id of a run'],
    ['?job=', 'names no run'],
    [`?job=${JOB.slice(0, 20)}`, 'job_ and then 26 digits'],
    [`?mesh=${JOB}`, 'is not the id of a mesh'],
    [`?compare=${JOB}`, 'needs two runs'],
    [`?compare=${JOB},${OTHER},${JOB}`, 'needs two runs'],
    [`?compare=${JOB}@5,cat@5`, '“cat” is not the id of a run'],
    ['?compare=,', 'names no run'],
  ])('of nothing says why: %s', (search, why) => {
    const route = parseRoute(search);
    expect(route).toMatchObject({ view: 'astray' });
    expect(route.view === 'astray' && route.why).toContain(why);
  });

  it('with nonsense in it leaves the nonsense out, and names it', () => {
    const odd = `?job=${JOB}&it=-5&color=pink&cam=1,2,3&up=x&k=3`;
    expect(parseRoute(odd)).toEqual({ view: 'job', shown: { job: JOB, iteration: null }, look: PLAIN });
    expect(leftOut(odd)).toEqual(['it=-5', 'color=pink', 'cam=1,2,3', 'up=x', 'k=3']);
    expect(leftOut(`?compare=${JOB}@x,${OTHER}`)).toEqual([`compare=${JOB}@x…`]);
    expect(leftOut(`?jbo=${JOB}`)).toHaveLength(1);
    expect(leftOut('?utm_source=mail&fbclid=1')).toEqual([]);
    for (const name of ['__proto__', 'constructor', 'hasOwnProperty', 'toString'])
      expect(leftOut(`?${name}=up`)).toEqual([`${name}=up`]);
    for (const route of routes) expect(leftOut(formatRoute(route).slice(1))).toEqual([]);
  });
});
