import type { Values } from './schema';

/** Several meshes, each run in several ways: a row for each mesh, and a column for each way. */

/** One column: what all the meshes are run with. */
export interface Column {
  readonly title: string;
  readonly preset: string;
  /** What differs from the preset. */
  readonly parameters: Values;
}

/** A preset by its name, with the parameters that its method has. */
export interface Offered {
  readonly name: string;
  readonly title: string;
  readonly defaults: Values;
}

/** Read values between commas or blanks, each once: numbers where they are numbers, or else words. */
export function valuesOf(text: string): (number | string)[] {
  const words = text.split(/[\s,;]+/).filter((word) => word !== '');
  return [...new Set(words.map((word) => (Number.isFinite(Number(word)) ? Number(word) : word)))];
}

/**
 * Return a column for each preset, or as many as there are values of a parameter where the preset's method has it.
 *
 * @param varied the parameter, as the schema names it and as people do; null if none is varied.
 */
export function columnsOf(
  presets: readonly Offered[],
  varied: { readonly name: string; readonly title: string } | null,
  values: readonly (number | string)[],
): Column[] {
  return presets.flatMap(({ name, title, defaults }) => {
    if (varied === null || values.length === 0 || !(varied.name in defaults))
      return [{ title, preset: name, parameters: {} }];
    const before = presets.length > 1 ? `${title}, ` : '';
    return values.map((value) => ({
      title: `${before}${varied.title.toLowerCase()} ${value}`,
      preset: name,
      parameters: { [varied.name]: value },
    }));
  });
}
