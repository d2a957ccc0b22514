// What a case's page tells the script, in the data block that harness/report/build.py writes.

export interface PackSource {
  readonly href: string;
  readonly prefix: string; // put before the names of its pictures: which run they are of
  readonly aside: boolean; // its pictures are shown only where they are chosen
}

export interface CaseData {
  readonly id: string;
  readonly packs: readonly PackSource[];
  readonly colours: Readonly<Record<string, string>>; // renderer → class of the stylesheet
  readonly verdicts: Readonly<Record<string, string>>;
  readonly suspects: readonly string[]; // renderers that are said to be off, worst first
  readonly ray: FirstRay | null;
  readonly absent: readonly { readonly name: string; readonly word: string; readonly reason: string }[];
  readonly curves: readonly CurveData[];
}

/** Where a renderer is furthest off. */
export interface FirstRay {
  readonly renderer: string;
  readonly probe: string;
  readonly pixel: readonly [number, number];
}

export interface CurveData {
  readonly low: number; // of the x axis, and where it is drawn
  readonly high: number;
  readonly left: number;
  readonly right: number;
  readonly unit: string;
  readonly byIncidence: boolean;
  readonly lines: readonly {
    readonly renderer: string;
    readonly x: readonly (number | null)[];
    readonly y: readonly (number | null)[];
    readonly residual: readonly (number | null)[];
  }[];
}
