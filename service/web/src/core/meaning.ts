/** What the figures mean, for those who rest on them. */
export const MEANING = {
  sphericity: 'Ψ = ∛(36πV²) / A: 1 for a sphere',
  variation: 'Standard deviation of the distance to the centre over its mean: 0 for a sphere',
  quality: '4√3 area / Σ edge²: 1 for an equilateral triangle, 0 for one without area',
  inward: 'Triangles that look towards the centre: 0 for a sphere',
} as const;
