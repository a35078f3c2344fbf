// Generated from src/message.rs by tests/protocol.rs: change that file, and run
//   LUMBRE_UPDATE_MESSAGES=1 cargo test -p lumbre-viewer --test integration protocol

/** A whole number from 0. */
export type Unsigned = number;

/** A message of the page. Unknown fields are an error: the page is part of the same program. */
export type PageMessage =
  /** It has shown the last frame, and is ready for another. */
  | { type: "shown" }
  /** The camera has moved. */
  | { type: "camera"; sequence: Unsigned; placement: Placement; fov: number | null; zoom: number }
  /** Back to one of the file's cameras. */
  | { type: "reset"; sequence: Unsigned; camera: Unsigned }
  /** What is rendered, and how it is shown. */
  | ({ type: "set" } & SetOptions)
  /** A parameter of the scene; `null` resets it to the file's value. */
  | { type: "edit"; path: string; value: string | null }
  /** Shapes that are hidden, or with `others` all but these; none shows everything. */
  | { type: "hide"; shapes: Unsigned[]; others: boolean }
  /** What is in front of a plane, where its normal points, is not seen by the camera; without a plane, everything is. */
  | { type: "section"; plane: Plane | null }
  /** A moment of an animation, a variant. */
  | { type: "moment"; time: number | null; variant: string | null }
  /** Asks for the shapes at a pixel of the full picture. */
  | { type: "pick"; x: number; y: number; request: Unsigned }
  /** Asks for an address of an HTTP request. */
  | { type: "ticket"; request: Unsigned; errand: Errand }
  /** The values of a rectangle of pixels. */
  | { type: "values"; x: Unsigned; y: Unsigned; width: Unsigned; height: Unsigned; request: Unsigned };

/** A camera's position and orientation. */
export interface Placement {
  /** The camera's position. */
  eye: [number, number, number];
  /** A point in the middle of the picture. */
  target: [number, number, number];
  /** What is upwards in the picture. */
  up: [number, number, number];
}

/** The channel that is shown. */
export type Channel =
  /** The picture. */
  | "beauty"
  /** Reflectance. */
  | "albedo"
  /** Shading normals, (n + 1) / 2. */
  | "normal"
  /** Depth along the camera's axis. */
  | "depth"
  /** Texture coordinates. */
  | "uv"
  /** The variance of the picture's luminance; its square root, the standard error, is shown in false colours. */
  | "variance"
  /** A colour for each shape. */
  | "ids";

/** The colours of numbers. */
export type ColourMap =
  /** Grey for depth, the rainbow for light. */
  | "automatic"
  /** Near is bright; of light, bright is bright. */
  | "grey"
  /** Dark blue, blue, green, yellow, red. */
  | "rainbow"
  /** Dark blue, green, yellow, at steps that look even (S. van der Walt and N. Smith, matplotlib's default of 2015). */
  | "viridis";

/** A plane by a point and a normal of any length but 0. */
export interface Plane {
  point: [number, number, number];
  normal: [number, number, number];
}

/** The first message of a page. */
export type PageGreeting =
  /** The proof that it may come in: see [`guard::Guard::admit`]. */
  | { type: "hello"; nonce: string; proof: string };

/** The purpose of a page's HTTP request, which needs a single-use ticket. */
export type Errand =
  /** It takes the picture as a file. */
  | { for: "picture"; format: FileFormat }
  /** It loads an explanation of a pixel's colour. */
  | { for: "explanation"; language: string; pixel: [Unsigned, Unsigned] }
  /** It sends a scene, or a picture for its light. */
  | { for: "scene" };

/** The formats of pictures that a page can take. */
export type FileFormat =
  | "png"
  | "exr";

/** A page's options; missing ones stay unchanged. */
export interface SetOptions {
  exposure?: number | null;
  tone_map?: string | null;
  false_colour?: boolean | null;
  channel?: Channel | null;
  denoise?: boolean | null;
  paused?: boolean | null;
  scale?: number | null;
  spp?: Unsigned | null;
  /** 0 for none. */
  noise?: number | null;
  /** The colours of numbers. */
  map?: ColourMap | null;
  /** The numbers at both ends of these colours; none to find them. */
  range?: number[] | null;
}

/** A file in the list that precedes files dropped on the page: see [`bundle`]. */
export interface DroppedFile {
  /** Its path in the folder that was dropped. */
  name: string;
  /** Bytes. */
  size: Unsigned;
}

/** A message of the viewer before the page is admitted. */
export type ViewerGreeting =
  /** The number that the page's proof is made with. */
  | { type: "challenge"; nonce: string }
  /** The page is admitted: see [`guard::Welcome`]. */
  | { type: "welcome"; proof: string; session: string | null; access: Access };

/** What a page may do. */
export type Access =
  /** Everything. */
  | "edit"
  /** Ask, and change nothing: see [`PageMessage::only_asks`]. */
  | "watch";

/** A message of the viewer. */
export type ViewerMessage =
  /** What is requested, and how it is shown. */
  | ({ type: "state" } & ViewerState)
  /** The scene, when it was built. */
  | { type: "scene"; scene: SceneFacts }
  /** How far the picture is. */
  | ({ type: "progress" } & RenderProgress)
  /** The answer to `pick`. */
  | { type: "picked"; request: Unsigned; x: number; y: number; ray: PickedRay }
  /** The answer to `values`, row by row. */
  | { type: "values"; request: Unsigned; x: Unsigned; y: Unsigned; width: Unsigned; height: Unsigned; values: [PixelValue, PixelValue, PixelValue][] }
  /** The answer to `ticket`: an address that works once; `null` if the system has no random numbers to make one. */
  | { type: "ticket"; request: Unsigned; address: string | null }
  /** Why the page's message was refused. */
  | { type: "wrong"; what: string };

/** The requested state. */
export interface ViewerState {
  /** The name of the scene. */
  name: string;
  has_scene: boolean;
  /** Why there is no scene, or no picture. */
  error: string | null;
  /** Why the last parameter could not be set. */
  edit_error: string | null;
  /** Which of the file's cameras. */
  camera: Unsigned;
  /** The last change of the camera, as counted by the page that made it. */
  sequence: Unsigned;
  /** Whether the camera was moved by hand. */
  moved: boolean;
  placement: Placement | null;
  /** The field of view in degrees, where it was changed. */
  fov: number | null;
  /** The magnification of an orthographic camera. */
  zoom: number;
  /** Width and height of the picture in pixels. */
  size: [Unsigned, Unsigned] | null;
  channel: Channel;
  /** Pixels along a side, as a factor. */
  scale: number;
  spp: Unsigned | null;
  /** The noise at which the picture is done; 0 for none. */
  noise: number | null;
  denoise: boolean | null;
  paused: boolean;
  /** In stops. */
  exposure: number | null;
  tone_map: string | null;
  false_colour: boolean;
  map: ColourMap;
  /** The numbers at both ends of the colours; `null` where they are found. */
  range: [number, number] | null;
  hidden: HiddenShapes;
  section: Plane | null;
  /** The moment of the animation, in seconds. */
  time: number | null;
  variant: string | null;
  /** Parameters with their values, in the order in which they were first set. */
  settings: [string, string][];
}

/** Shapes that are not in the picture; with `others` all but these. */
export interface HiddenShapes {
  shapes: Unsigned[];
  others: boolean;
}

/** The facts of a scene. */
export interface SceneFacts {
  cameras: CameraFacts[];
  /** The direction upwards. */
  up: [number, number, number];
  /** An infinite plane below everything. */
  ground: Plane | null;
  tree: ShapeTree;
  /** The corners of the bounding box. */
  bounds: [[number, number, number], [number, number, number]] | null;
  /** Shapes by kind. */
  shapes: Record<string, Unsigned>;
  /** Materials by kind. */
  materials: Record<string, Unsigned>;
  /** Lights by kind. */
  lights: Record<string, Unsigned>;
  triangles: Unsigned;
  instances: Unsigned;
  /** Bytes. */
  memory: Unsigned;
  build_seconds: number;
  animations: AnimationFacts[];
  /** The names of the material variants. */
  variants: string[];
  parameters: ListedParameter[];
  /** Those in which pixels are explained: their codes and their own names. */
  languages: [string, string][];
  warnings: string[];
}

/** A camera of the file. */
export interface CameraFacts {
  name: string;
  kind: string;
  /** Whether it shows the scene as in a mirror. */
  mirrored: boolean;
  /** The field of view in degrees of a perspective camera. */
  fov: number | null;
  /**
   * The part of the image plane that it shows (left, right, bottom, top), in units of half the field of view, if the
   * file says so.
   */
  window: [number, number, number, number] | null;
}

/** An animation of the file. */
export interface AnimationFacts {
  name: string | null;
  /** Its last moment in seconds. */
  end: number | null;
}

/** The shapes of the world and of each object. */
export interface ShapeTree {
  groups: ShapeGroup[];
  /** Shapes that are not listed, because there are too many. */
  left_out: Unsigned;
}

/** The shapes of an object, or of the world, which has no name. */
export interface ShapeGroup {
  name: string | null;
  shapes: ListedShape[];
}

/** A shape of the file, or the ground. */
export interface ListedShape {
  shape: Unsigned;
  kind: string;
  name: string | null;
  /** The name and kind of its material. */
  material: string | null;
  /** What the parameters of its material belong to. */
  owner: string | null;
  /** Whether it emits light. */
  shines: boolean;
}

/** A parameter that can be edited. */
export interface ListedParameter {
  path: string;
  owner: string;
  name: string;
  kind: ValueKind;
  /** `null` if a texture gives it. */
  value: number[] | null;
  /** The ends of its range. */
  low: number | null;
  high: number | null;
}

/** What a parameter's value is. */
export type ValueKind =
  | "number"
  | "colour"
  | "light"
  | "point"
  | "factor";

/** How far the picture is; `null` where something is not known or does not apply. */
export interface RenderProgress {
  doing: Doing;
  /** Samples per pixel so far, and at the end. */
  spp: Unsigned | null;
  target: Unsigned | null;
  /** How much of the way to the end is done, in [0, 1]. */
  share: number | null;
  /** The noise so far, and at the end. */
  noise: number | null;
  noise_target: number | null;
  rays_per_second: number | null;
  /** Seconds so far, and those that are left. */
  seconds: number | null;
  left: number | null;
  /** Samples that were no numbers. */
  dropped: Unsigned | null;
}

/** What the viewer is doing. */
export type Doing =
  | "reading"
  | "building"
  | "rendering"
  | "done"
  /** For a file that can be read. */
  | "waiting"
  | "nothing";

/** The ray through a place of the picture; without a camera there is none. */
export interface PickedRay {
  origin: [number, number, number] | null;
  direction: [number, number, number] | null;
  /** By distance. */
  hits: ListedHit[];
}

/** Where a ray meets a shape. */
export interface ListedHit extends ListedShape {
  distance: number;
  /** A page at rest does not know it. */
  surface: HitSurface | null;
}

/** The surface at a hit. */
export interface HitSurface {
  point: [number, number, number];
  normal: [number, number, number];
  uv: [number, number];
  /** Whether the ray comes from outside. */
  front: boolean;
  primitive: Unsigned;
  instance: Unsigned | null;
}

/** A channel of a pixel: a number, or the text of what JSON has no number for, as `inf`. */
export type PixelValue =
  | number
  | string;

/** What a page at rest shows: see [`export`]. */
export interface StaticPage {
  name: string;
  scene: SceneFacts;
  placement: Placement | null;
  camera: Unsigned;
  progress: StaticProgress;
  channels: StaticChannel[];
  picks: StaticPicks;
}

/** How the picture of a page at rest was made. */
export interface StaticProgress {
  spp: Unsigned;
  target: Unsigned;
  noise: number | null;
  seconds: number;
  rays_per_second: number;
}

/** A channel of a page at rest. */
export interface StaticChannel {
  name: Channel;
  /** A picture in base 64. */
  png: string;
  /** Its numbers in half precision, compressed, in base 64; empty where the picture has them. */
  values: string;
}

/** The hits in the middle of each pixel. */
export interface StaticPicks {
  shapes: ListedShape[];
  /**
   * For each pixel the position of the shape in the list, from 1, or 0 for nothing, and its distance; compressed, in
   * base 64.
   */
  values: string;
}
