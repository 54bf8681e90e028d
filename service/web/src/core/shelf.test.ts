import { describe, expect, it } from 'vitest';
import { Shelf } from './shelf';

/** A browser's storage with room for so many characters. */
function storage(room = Infinity): {
  texts: Map<string, string>;
  getItem: (key: string) => string | null;
  setItem: (key: string, text: string) => void;
  removeItem: (key: string) => void;
} {
  const texts = new Map<string, string>();
  return {
    texts,
    getItem: (key) => texts.get(key) ?? null,
    setItem: (key, text) => {
      const others = [...texts]
        .filter(([other]) => other !== key)
        .reduce((sum, [, one]) => sum + one.length, 0);
      if (others + text.length > room) throw new DOMException('full', 'QuotaExceededError');
      texts.set(key, text);
    },
    removeItem: (key) => {
      texts.delete(key);
    },
  };
}

describe('a shelf', () => {
  it('knows of what another tab put on it', () => {
    const kept = storage();
    const tabs = [new Shelf(kept, 'shelf', 3), new Shelf(kept, 'shelf', 3)];
    for (const key of ['a', 'b', 'c', 'd', 'e']) tabs.reverse()[0]?.put(key, key);
    expect([...kept.texts.keys()].sort()).toEqual(['shelf', 'shelf c', 'shelf d', 'shelf e']);
  });

  it('keeps from one visit to the next, and the newest so many', () => {
    const kept = storage();
    const shelf = new Shelf(kept, 'shelf', 2);
    shelf.put('a', 'A');
    shelf.put('b', 'B');
    shelf.put('a', 'A again');
    const later = new Shelf(kept, 'shelf', 2);
    later.put('c', 'C');
    expect([later.get('a'), later.get('b'), later.get('c')]).toEqual(['A again', null, 'C']);
    expect(kept.texts.size).toBe(3); // two, and the list of them
  });

  it('makes room where there is none, and does without where that does not help', () => {
    const kept = storage(60);
    const shelf = new Shelf(kept, 's', 99);
    for (const key of ['a', 'b', 'c', 'd', 'e']) shelf.put(key, key.repeat(10));
    expect(shelf.get('e')).toBe('eeeeeeeeee');
    expect(shelf.get('a')).toBeNull();
    shelf.put('large', 'x'.repeat(100));
    expect(shelf.get('large')).toBeNull();
  });

  it('does without a storage, and with a spoilt one', () => {
    const none = new Shelf(null, 's', 5);
    none.put('a', 'A');
    expect(none.get('a')).toBeNull();
    const spoilt = storage();
    spoilt.texts.set('s', '{');
    const shelf = new Shelf(spoilt, 's', 5);
    shelf.put('a', 'A');
    expect(shelf.get('a')).toBe('A');
  });
});
