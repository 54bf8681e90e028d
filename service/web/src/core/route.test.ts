import { describe, expect, it } from 'vitest';
import { PLAIN, formatRoute, parseRoute, type Route } from './route';

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

  it('with nonsense in it leads home, or leaves the nonsense out', () => {
    expect(parseRoute('?job=<script>')).toEqual({ view: 'home' });
    expect(parseRoute(`?compare=${JOB}`)).toEqual({ view: 'home' });
    const odd = parseRoute(`?job=${JOB}&it=-5&color=pink&cam=1,2,3&up=x`);
    expect(odd).toEqual({ view: 'job', shown: { job: JOB, iteration: null }, look: PLAIN });
  });
});
