// Where the beams of a scan and the parts of its features lie.

/** Bearings and points of a scan as it comes from the server; null where a beam is invalid. */
export function placeBeams(scan) {
  const bearing = (i) => scan.angles?.[i] ?? scan.angle_min + i * scan.angle_increment;
  scan.bearings = Array.from({ length: scan.beams }, (_, i) => bearing(i));
  scan.points = scan.bearings.map((a, i) => {
    const r = scan.ranges[i];
    return r === null ? null : [r * Math.cos(a), r * Math.sin(a)];
  });
  scan.reach = Math.max(0, ...scan.ranges); // of the farthest measurement [m]
}

/** Whether all numbers of a position or a covariance are known. */
export const isKnown = (numbers) => numbers.flat().every(Number.isFinite);

/** Beams of a feature in order, over the seam where the first is larger than the last. */
export function beamsOf(feature, scan) {
  const count = (feature.last_beam - feature.first_beam + scan.beams) % scan.beams + 1;
  const beams = Array.from({ length: count }, (_, k) => (feature.first_beam + k) % scan.beams);
  return beams.filter((i) => scan.points[i]);
}

/** Standard deviations along the axes of an ellipse, and the direction of the longer one [rad]. */
export function ellipseOf([[xx, xy], [, yy]]) {
  const middle = (xx + yy) / 2, half = Math.hypot((xx - yy) / 2, xy);
  return {
    major: Math.sqrt(Math.max(middle + half, 0)),
    minor: Math.sqrt(Math.max(middle - half, 0)),
    direction: Math.atan2(2 * xy, xx - yy) / 2,
  };
}

/** First and last direction [rad] from the centre of an arc to its measurements. */
export function seenOf(arc, scan) {
  const [cx, cy] = arc.center;
  const turns = beamsOf(arc, scan).map((i) => {
    const [x, y] = scan.points[i];
    return Math.atan2(y - cy, x - cx);
  });
  const first = turns[0] ?? 0;
  const around = turns.map((t) => Math.atan2(Math.sin(t - first), Math.cos(t - first)));
  return [first + Math.min(0, ...around), first + Math.max(0, ...around)];
}
