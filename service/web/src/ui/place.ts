import { noChange, type ElementPart } from 'lit-html';
import { Directive, directive, PartType, type DirectiveResult, type PartInfo } from 'lit-html/directive.js';

/** Styles that are computed: set by script, as the content policy allows no style attributes. */
class Property extends Directive {
  constructor(part: PartInfo) {
    super(part);
    if (part.type !== PartType.ELEMENT) throw new TypeError('stands in a tag, and not in an attribute');
  }

  override update(part: ElementPart, [name, value]: [string, string]): typeof noChange {
    (part.element as HTMLElement).style.setProperty(name, value);
    return noChange;
  }

  render(name: string, value: string): unknown {
    return [name, value];
  }
}

const property: (name: string, value: string) => DirectiveResult = directive(Property);

/** Put an element at a share of its parent's width: the style sheet reads --place. */
export const at = (place: number): DirectiveResult => property('--place', String(place));

/** Have room for so many characters: the style sheet reads --characters. */
export const room = (characters: number): DirectiveResult => property('--characters', String(characters));

/** Give an element a background. */
export const background = (image: string): DirectiveResult => property('background-image', image);
