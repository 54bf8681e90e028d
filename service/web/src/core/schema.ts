/** From a JSON Schema to fields of a form, and from what was filled in to what differs from a preset. */

export type Json = null | boolean | number | string | readonly Json[] | { readonly [name: string]: Json };
export type Values = Readonly<Record<string, Json>>;

interface Described {
  readonly name: string;
  readonly title: string;
  readonly description: string;
}

export interface NumberField extends Described {
  readonly kind: 'number';
  readonly whole: boolean;
  readonly least: number | null;
  readonly most: number | null;
  /** Whether the bounds themselves are out of bounds. */
  readonly open: { readonly least: boolean; readonly most: boolean };
}

export type FormField =
  | NumberField
  | (Described & { readonly kind: 'choice'; readonly choices: readonly string[] })
  | (Described & { readonly kind: 'switch' })
  | (Described & { readonly kind: 'text' })
  /** A fixed number of values side by side. */
  | (Described & { readonly kind: 'tuple'; readonly items: readonly FormField[] })
  /** Rows that can be added and removed. */
  | (Described & { readonly kind: 'rows'; readonly row: readonly FormField[]; readonly most: number })
  /** Several values under a name, which may be off. */
  | (Described & {
      readonly kind: 'group';
      readonly fields: readonly FormField[];
      readonly optional: boolean;
    });

type Schema = Readonly<Record<string, unknown>>;

/** Return a field for each property, in the schema's order. */
export function fieldsOf(schema: Schema, root: Schema = schema): FormField[] {
  const properties = (schema.properties ?? {}) as Readonly<Record<string, Schema>>;
  return Object.entries(properties).map(([name, inner]) => fieldOf(name, inner, root));
}

function fieldOf(name: string, given: Schema, root: Schema): FormField {
  const schema = resolved(given, root);
  const described: Described = {
    name,
    title: text(given.title ?? schema.title, name),
    description: text(given.description ?? schema.description, ''),
  };
  const options = schema.anyOf as readonly Schema[] | undefined;
  if (options) {
    const some = options.filter((option) => option.type !== 'null');
    const [only] = some;
    if (only && some.length === 1) {
      const field = fieldOf(name, { ...resolved(only, root), ...described }, root);
      return field.kind === 'group' ? { ...field, optional: some.length < options.length } : field;
    }
  }
  if (Array.isArray(schema.enum)) return { ...described, kind: 'choice', choices: schema.enum as string[] };
  switch (schema.type) {
    case 'integer':
    case 'number':
      return { ...described, ...numbers(schema) };
    case 'boolean':
      return { ...described, kind: 'switch' };
    case 'object':
      return { ...described, kind: 'group', fields: fieldsOf(schema, root), optional: false };
    case 'array': {
      const items = schema.prefixItems as readonly Schema[] | undefined;
      if (items)
        return { ...described, kind: 'tuple', items: items.map((item, i) => fieldOf(String(i), item, root)) };
      const row = fieldsOf(resolved((schema.items ?? {}) as Schema, root), root);
      return { ...described, kind: 'rows', row, most: Number(schema.maxItems ?? 100) };
    }
    default:
      return { ...described, kind: 'text' };
  }
}

function numbers(schema: Schema): Pick<NumberField, 'kind' | 'whole' | 'least' | 'most' | 'open'> {
  const bound = (name: string): number | null => (typeof schema[name] === 'number' ? schema[name] : null);
  return {
    kind: 'number',
    whole: schema.type === 'integer',
    least: bound('minimum') ?? bound('exclusiveMinimum'),
    most: bound('maximum') ?? bound('exclusiveMaximum'),
    open: { least: bound('exclusiveMinimum') !== null, most: bound('exclusiveMaximum') !== null },
  };
}

function resolved(schema: Schema, root: Schema): Schema {
  const reference = schema.$ref;
  if (typeof reference !== 'string') return schema;
  let found: unknown = root;
  for (const part of reference.replace(/^#\//, '').split('/')) found = (found as Schema)[part];
  return { ...(found as Schema), ...schema };
}

function text(value: unknown, otherwise: string): string {
  return typeof value === 'string' ? value : otherwise;
}

/** Return what is wrong with a number, or an empty text. */
export function wrong(field: NumberField, value: number): string {
  const { least, most, open, whole } = field;
  if (!Number.isFinite(value)) return 'a number is needed';
  if (whole && !Number.isInteger(value)) return 'a whole number is needed';
  if (least !== null && (open.least ? value <= least : value < least))
    return open.least ? `more than ${least}` : `at least ${least}`;
  if (most !== null && (open.most ? value >= most : value > most))
    return open.most ? `less than ${most}` : `at most ${most}`;
  return '';
}

/** Lay what was changed in one preset over another, as far as that one has it: methods have parameters of their own. */
export function carried(values: Values, from: Values, to: Values): Values {
  const kept = Object.entries(changes(values, from)).filter(([name]) => name in to);
  return { ...to, ...Object.fromEntries(kept) };
}

/** Return what differs from a preset: all that has to be sent. */
export function changes(values: Values, preset: Values): Record<string, Json> {
  return Object.fromEntries(
    Object.entries(values).filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(preset[name])),
  );
}
