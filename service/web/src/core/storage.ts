/** Return what the browser keeps for this page; null where it keeps nothing, as for frames on other people's pages. */
export function storage(): Storage | null {
  try {
    return localStorage;
  } catch {
    return null;
  }
}
