import { describe, expect, it } from 'vitest';
import { Player, WHOLE_RUN_S } from './player';
import { scaleOf } from './scale';

describe('Player', () => {
  const scale = scaleOf('log', 1000);

  it('plays the whole run in its time, on any scale', () => {
    const player = new Player();
    let at = player.toggle(0, scale);
    const frames = 120;
    for (let i = 0; i < frames; i++) at = player.advance(at, WHOLE_RUN_S / frames, scale);
    expect(at).toBeCloseTo(1000, 0);
  });

  it('stops at the end, and starts over from there', () => {
    const player = new Player();
    player.toggle(0, scale);
    expect(player.advance(990, 5, scale)).toBe(1000);
    expect(player.playing).toBe(false);
    expect(player.toggle(1000, scale)).toBe(0);
    expect(player.playing).toBe(true);
  });

  it('loops', () => {
    const player = new Player();
    player.loop = true;
    player.toggle(0, scale);
    expect(player.advance(scale.iteration(0.9), WHOLE_RUN_S / 5, scale)).toBeCloseTo(scale.iteration(0.1));
  });

  it('has a slowest and a fastest speed', () => {
    const player = new Player();
    for (let i = 0; i < 9; i++) player.faster(1);
    expect(player.speed).toBe(4);
    for (let i = 0; i < 9; i++) player.faster(-1);
    expect(player.speed).toBe(0.25);
  });
});
