/** Where the arrow keys lead in a list whose entries have several things to press, as the ARIA pattern of a grid has it. */

export interface Cell {
  readonly row: number;
  readonly column: number;
}

/**
 * Return the cell that a key leads to; null for a key that leads nowhere.
 *
 * @param widths how many cells each row has.
 */
export function cellAfter(at: Cell, key: string, ctrl: boolean, widths: readonly number[]): Cell | null {
  const last = widths.length - 1;
  const end = (row: number): number => (widths[row] ?? 1) - 1;
  const to = (row: number): Cell => ({ row, column: Math.min(at.column, end(row)) });
  switch (key) {
    case 'ArrowUp':
      return to(Math.max(at.row - 1, 0));
    case 'ArrowDown':
      return to(Math.min(at.row + 1, last));
    case 'ArrowLeft':
      return { row: at.row, column: Math.max(at.column - 1, 0) };
    case 'ArrowRight':
      return { row: at.row, column: Math.min(at.column + 1, end(at.row)) };
    case 'Home':
      return ctrl ? { row: 0, column: 0 } : { row: at.row, column: 0 };
    case 'End':
      return ctrl ? { row: last, column: end(last) } : { row: at.row, column: end(at.row) };
    default:
      return null;
  }
}
