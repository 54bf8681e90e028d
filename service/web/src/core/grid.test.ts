import { describe, expect, it } from 'vitest';
import { cellAfter } from './grid';

const WIDTHS = [3, 1, 2];

describe('the arrow keys in a grid', () => {
  it.each([
    [0, 0, 'ArrowDown', 1, 0],
    [2, 0, 'ArrowDown', 2, 0],
    [0, 0, 'ArrowUp', 0, 0],
    [0, 2, 'ArrowDown', 1, 0],
    [1, 0, 'ArrowRight', 1, 0],
    [0, 1, 'ArrowRight', 0, 2],
    [0, 0, 'ArrowLeft', 0, 0],
    [0, 1, 'End', 0, 2],
    [0, 2, 'Home', 0, 0],
  ])('lead from %i, %i by %s to %i, %i', (row, column, key, nextRow, nextColumn) => {
    expect(cellAfter({ row, column }, key, false, WIDTHS)).toEqual({ row: nextRow, column: nextColumn });
  });

  it('lead to its corners with Control', () => {
    expect(cellAfter({ row: 1, column: 0 }, 'Home', true, WIDTHS)).toEqual({ row: 0, column: 0 });
    expect(cellAfter({ row: 1, column: 0 }, 'End', true, WIDTHS)).toEqual({ row: 2, column: 1 });
  });

  it('are the only ones', () => {
    expect(cellAfter({ row: 0, column: 0 }, 'Enter', false, WIDTHS)).toBeNull();
  });
});
