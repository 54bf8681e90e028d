const FOCUSABLE = 'a[href], button, input, select, textarea, summary, [tabindex="0"]';
const REGION = 'section, form, aside, main';

/**
 * Keeps the focus where a visitor without a pointer is: what is pressed may go, as the button to cancel does with the
 * run that it cancels, and a browser then begins at the top of the page.
 */
export class Focus {
  private last: HTMLElement | null = null;

  constructor(private readonly root: HTMLElement) {
    root.addEventListener('pointerdown', () => {
      this.last = null; // fingers need no focus, and where it is handed on to a field a phone would show its keys
    });
    root.addEventListener('focusin', ({ target }) => {
      this.last = (target as HTMLElement).matches(':focus-visible') ? (target as HTMLElement) : null;
    });
    root.addEventListener('keydown', ({ target }) => {
      this.last = target as HTMLElement;
    });
  }

  /** Draw; if what has the focus goes, hand it on to what is beside it, or else to the heading. */
  keeping(draw: () => void): void {
    const held = this.held();
    if (held === null) {
      draw();
      return;
    }
    const disabled = held.matches(':disabled');
    const around = ancestors(held);
    const all = [...(around.at(-1)?.querySelectorAll<HTMLElement>(FOCUSABLE) ?? [])];
    draw();
    if (document.activeElement !== document.body) return;
    if (!held.isConnected) this.handOn(around, all, all.indexOf(held));
    else if (disabled && !held.matches(':disabled')) held.focus({ preventScroll: true });
  }

  /** What has the focus, or had it until it was disabled; in the view, as the list of runs looks after its own. */
  private held(): HTMLElement | null {
    const { last } = this;
    const holds = last !== null && (document.activeElement === last || last.matches(':disabled'));
    return holds && last.closest('main') ? last : null;
  }

  private handOn(around: readonly HTMLElement[], all: readonly HTMLElement[], from: number): void {
    const order = [...all.slice(from + 1), ...all.slice(0, from).reverse()].filter(able);
    for (const place of around) {
      const next = place.isConnected ? order.find((one) => place.contains(one)) : undefined;
      if (next === undefined) continue;
      next.focus();
      return;
    }
    this.root.querySelector<HTMLElement>('main h1')?.focus({ preventScroll: true });
  }
}

/** Return what an element stands in, up to the part of the page that it belongs to. */
function ancestors(element: HTMLElement): HTMLElement[] {
  const found = [];
  for (let at = element.parentElement; at; at = at.parentElement) {
    found.push(at);
    if (at.matches(REGION)) break;
  }
  return found;
}

function able(element: HTMLElement): boolean {
  return element.isConnected && !element.matches(':disabled') && element.getClientRects().length > 0;
}
