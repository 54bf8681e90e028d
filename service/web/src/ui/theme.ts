import { storage } from '../core/storage';

/** Light, dark, or as the system has it. */
export type Theme = 'auto' | 'light' | 'dark';

const KEY = 'spherify.theme';
const ORDER: readonly Theme[] = ['auto', 'light', 'dark'];
let chosen: Theme = 'auto'; // where nothing is kept
const system = matchMedia('(prefers-color-scheme: dark)');
system.addEventListener('change', () => {
  applyTheme();
});

/** Return the choice that was made. */
export function theme(): Theme {
  const kept = storage()?.getItem(KEY) ?? chosen;
  return ORDER.find((one) => one === kept) ?? 'auto';
}

/** Put the choice into effect; the style sheet does the rest. */
export function applyTheme(choice: Theme = theme()): void {
  const dark = choice === 'dark' || (choice === 'auto' && system.matches);
  document.documentElement.dataset.theme = dark ? 'dark' : 'light';
}

/** Take the next of the three, and keep it. */
export function nextTheme(): Theme {
  const next = ORDER[(ORDER.indexOf(theme()) + 1) % ORDER.length] ?? 'auto';
  chosen = next;
  storage()?.setItem(KEY, next);
  applyTheme();
  return next;
}

export function reducedMotion(): boolean {
  return matchMedia('(prefers-reduced-motion: reduce)').matches;
}
