export type Unsigned = number;
export type PageMessage =
  | { type: "shown" }
  | { type: "camera"; sequence: Unsigned; placement: Placement; fov: number | null; zoom: number }
  | { type: "reset"; sequence: Unsigned; camera: Unsigned }
  | ({ type: "set" } & SetOptions)
  | { type: "edit"; path: string; value: string | null }
  | { type: "hide"; shapes: Unsigned[]; others: boolean }
  | { type: "section"; plane: Plane | null }
  | { type: "moment"; time: number | null; variant: string | null }
  | { type: "pick"; x: number; y: number; request: Unsigned }
  | { type: "ticket"; request: Unsigned; errand: Errand }
  | { type: "values"; x: Unsigned; y: Unsigned; width: Unsigned; height: Unsigned; request: Unsigned };
export interface Placement {
  eye: [number, number, number];
  target: [number, number, number];
  up: [number, number, number];
}
export type Channel =
  | "beauty"
  | "albedo"
  | "normal"
  | "depth"
  | "uv"
  | "variance"
  | "ids";
export type ColourMap =
  | "automatic"
  | "grey"
  | "rainbow"
  | "viridis";
export interface Plane {
  point: [number, number, number];
  normal: [number, number, number];
}
export type PageGreeting =
  | { type: "hello"; nonce: string; proof: string };
export type Errand =
  | { for: "picture"; format: FileFormat }
  | { for: "explanation"; language: string; pixel: [Unsigned, Unsigned] }
  | { for: "scene" };
export type FileFormat =
  | "png"
  | "exr";
export interface SetOptions {
  exposure?: number | null;
  tone_map?: string | null;
  false_colour?: boolean | null;
  channel?: Channel | null;
  denoise?: boolean | null;
  paused?: boolean | null;
  scale?: number | null;
  spp?: Unsigned | null;
  noise?: number | null;
  map?: ColourMap | null;
  range?: number[] | null;
}
export interface DroppedFile {
  name: string;
  size: Unsigned;
}
export type ViewerGreeting =
  | { type: "challenge"; nonce: string }
  | { type: "welcome"; proof: string; session: string | null; access: Access };
export type Access =
  | "edit"
  | "watch";
export type ViewerMessage =
  | ({ type: "state" } & ViewerState)
  | { type: "scene"; scene: SceneFacts }
  | ({ type: "progress" } & RenderProgress)
  | { type: "picked"; request: Unsigned; x: number; y: number; ray: PickedRay }
  | { type: "values"; request: Unsigned; x: Unsigned; y: Unsigned; width: Unsigned; height: Unsigned; values: [PixelValue, PixelValue, PixelValue][] }
  | { type: "ticket"; request: Unsigned; address: string | null }
  | { type: "wrong"; what: string };
export interface ViewerState {
  name: string;
  has_scene: boolean;
  error: string | null;
  edit_error: string | null;
  camera: Unsigned;
  sequence: Unsigned;
  moved: boolean;
  placement: Placement | null;
  fov: number | null;
  zoom: number;
  size: [Unsigned, Unsigned] | null;
  channel: Channel;
  scale: number;
  spp: Unsigned | null;
  noise: number | null;
  denoise: boolean | null;
  paused: boolean;
  exposure: number | null;
  tone_map: string | null;
  false_colour: boolean;
  map: ColourMap;
  range: [number, number] | null;
  hidden: HiddenShapes;
  section: Plane | null;
  time: number | null;
  variant: string | null;
  settings: [string, string][];
}
export interface HiddenShapes {
  shapes: Unsigned[];
  others: boolean;
}
export interface SceneFacts {
  cameras: CameraFacts[];
  up: [number, number, number];
  ground: Plane | null;
  tree: ShapeTree;
  bounds: [[number, number, number], [number, number, number]] | null;
  shapes: Record<string, Unsigned>;
  materials: Record<string, Unsigned>;
  lights: Record<string, Unsigned>;
  triangles: Unsigned;
  instances: Unsigned;
  memory: Unsigned;
  build_seconds: number;
  animations: AnimationFacts[];
  variants: string[];
  parameters: ListedParameter[];
  languages: [string, string][];
  warnings: string[];
}
export interface CameraFacts {
  name: string;
  kind: string;
  mirrored: boolean;
  fov: number | null;
}
export interface AnimationFacts {
  name: string | null;
  end: number | null;
}
export interface ShapeTree {
  groups: ShapeGroup[];
  left_out: Unsigned;
}
export interface ShapeGroup {
  name: string | null;
  shapes: ListedShape[];
}
export interface ListedShape {
  shape: Unsigned;
  kind: string;
  name: string | null;
  material: string | null;
  owner: string | null;
  shines: boolean;
}
export interface ListedParameter {
  path: string;
  owner: string;
  name: string;
  kind: ValueKind;
  value: number[] | null;
  low: number | null;
  high: number | null;
}
export type ValueKind =
  | "number"
  | "colour"
  | "light"
  | "point"
  | "factor";
export interface RenderProgress {
  doing: Doing;
  spp: Unsigned | null;
  target: Unsigned | null;
  share: number | null;
  noise: number | null;
  noise_target: number | null;
  rays_per_second: number | null;
  seconds: number | null;
  left: number | null;
  dropped: Unsigned | null;
}
export type Doing =
  | "reading"
  | "building"
  | "rendering"
  | "done"
  | "waiting"
  | "nothing";
export interface PickedRay {
  origin: [number, number, number] | null;
  direction: [number, number, number] | null;
  hits: ListedHit[];
}
export interface ListedHit extends ListedShape {
  distance: number;
  surface: HitSurface | null;
}
export interface HitSurface {
  point: [number, number, number];
  normal: [number, number, number];
  uv: [number, number];
  front: boolean;
  primitive: Unsigned;
  instance: Unsigned | null;
}
export type PixelValue =
  | number
  | string;
export interface StaticPage {
  name: string;
  scene: SceneFacts;
  placement: Placement | null;
  camera: Unsigned;
  progress: StaticProgress;
  channels: StaticChannel[];
  picks: StaticPicks;
}
export interface StaticProgress {
  spp: Unsigned;
  target: Unsigned;
  noise: number | null;
  seconds: number;
  rays_per_second: number;
}
export interface StaticChannel {
  name: Channel;
  png: string;
  values: string;
}
export interface StaticPicks {
  shapes: ListedShape[];
  values: string;
}
