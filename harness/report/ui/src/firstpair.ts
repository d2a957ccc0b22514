// Which two pictures are compared before anybody has chosen.

import type { CaseData } from "./case";

/** A is who is off, B the tracer; between two runs, B is A's own picture of the run before. */
export function firstPair(data: CaseData, names: readonly string[]): { a: string; b: string } {
  const rank = (name: string): number => {
    const suspected = data.suspects.indexOf(name);
    const verdict = ({ fail: 0, error: 1, known: 2 })[data.verdicts[name] ?? ""] ?? 3;
    return suspected < 0 ? 100 + verdict : suspected;
  };
  const base = names.find((name) => name === "tracer") ?? names[0] ?? "";
  const others = names.filter((name) => name !== base).sort((p, q) => rank(p) - rank(q));
  const a = others[0] ?? base;
  const prefix = data.packs.find((pack) => pack.prefix && !pack.aside)?.prefix;
  const before = names.find((name) => prefix !== undefined && name === prefix + a);
  return { a, b: before ?? base };
}
