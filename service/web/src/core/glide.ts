import type { Scale } from './scale';

/**
 * The way to the newest state of a running job: it waits until that is here, then goes there. States that come
 * meanwhile are for the next one, or a run that is quicker than the network would never be seen to move.
 */
export class Glide {
  private way: { readonly from: number; readonly to: number; began: number | null } | null = null;

  /** The state it goes to, or null. */
  get target(): number | null {
    return this.way?.to ?? null;
  }

  /** Start, unless one is under way. */
  begin(from: number, to: number): void {
    if (from !== to) this.way ??= { from, to, began: null };
  }

  stop(): void {
    this.way = null;
  }

  /**
   * Return where one stands now, in milliseconds; at the target it is over.
   *
   * @param seconds for the whole way; 0 goes there at once.
   */
  at(now: number, seconds: number, scale: Scale): number {
    const { way } = this;
    if (way === null) throw new RangeError('none is under way');
    way.began ??= now;
    const share = seconds > 0 ? Math.min((now - way.began) / 1000 / seconds, 1) : 1;
    if (share >= 1) {
      this.way = null;
      return way.to;
    }
    const [from, to] = [scale.place(way.from), scale.place(way.to)];
    return scale.iteration(from + (to - from) * share * (2 - share)); // slower towards the end
  }
}
