/** Numbers as people read them. */

const THIN = '\u202f'; // where no line ends
const UNITS = ['B', 'kB', 'MB', 'GB', 'TB'] as const;

/** A whole number with its thousands apart: 12 345. */
export function count(value: number): string {
  const digits = Math.round(Math.abs(value)).toString();
  const grouped = digits.length > 4 ? digits.replace(/\B(?=(\d{3})+$)/g, THIN) : digits;
  return value < 0 ? `−${grouped}` : grouped;
}

/** A figure with `digits` significant ones; very large and very small ones as powers of ten. */
export function figure(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa = '', exponent = ''] = value.toExponential(Math.max(digits - 2, 0)).split('e');
    return `${sign(mantissa)}·10${superscript(Number(exponent))}`;
  }
  return sign(String(Number(value.toPrecision(digits))));
}

/** A number with so many decimals, zeros at its end included. */
export function fixed(value: number, decimals: number): string {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace('-', '') : sign(text);
}

/** A share of one, such as a sphericity, to four places, near 1 to five; what is not quite 1 never reads 1. */
export function share(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const places = value > 0.995 && value < 1 ? 5 : 4;
  return (value < 1 ? Math.min(value, 1 - 10 ** -places) : value).toFixed(places);
}

/** Bytes with a decimal unit: 1.2 MB. */
export function bytes(value: number): string {
  let size = value;
  let unit = 0;
  while (size >= 999.5 && unit < UNITS.length - 1) {
    size /= 1000;
    unit += 1;
  }
  return `${size < 10 && unit > 0 ? size.toFixed(1) : size.toFixed(0)} ${UNITS[unit] ?? ''}`;
}

/** Seconds as people say them: 8.1 s, 3 min 20 s, 2 h 5 min. */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return '–';
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  const minutes = Math.round(whole / 60);
  return minutes < 1440
    ? `${Math.floor(minutes / 60)} h ${minutes % 60} min`
    : `${(minutes / 1440).toFixed(1)} days`;
}

/** How long ago a moment was. */
export function ago(moment: string, now = Date.now()): string {
  const seconds = (now - Date.parse(moment)) / 1000;
  if (seconds < 45) return 'just now';
  if (seconds < 5400) return `${Math.max(1, Math.round(seconds / 60))} min ago`;
  if (seconds < 129_600) return `${Math.round(seconds / 3600)} h ago`;
  return new Date(moment).toLocaleDateString(undefined, { day: 'numeric', month: 'short', year: 'numeric' });
}

/** A rate with a sensible number of digits: 71.3 it/s. */
export function rate(perSecond: number | null | undefined): string {
  if (perSecond === null || perSecond === undefined) return '–';
  return `${perSecond >= 100 ? perSecond.toFixed(0) : Number(perSecond.toPrecision(3))} it/s`;
}

function sign(text: string): string {
  return text.replace('-', '−');
}

function superscript(exponent: number): string {
  return String(exponent).replace(/[-\d]/g, (digit) =>
    digit === '-' ? '⁻' : ('⁰¹²³⁴⁵⁶⁷⁸⁹'[Number(digit)] ?? ''),
  );
}

/** Begin with a capital: the service's sentences begin small where they may stand within another. */
export function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
