//! Embree 4, loaded at run time where `EMBREE_LIB` names its shared library: the only module with `unsafe`.
//!
//! The declarations follow the C headers that its documentation describes (Embree 4 API reference, sections
//! "RTCRayHit", "rtcSetSharedGeometryBuffer", "rtcSetGeometryIntersectFunction" and so on). Structures that the library
//! writes are declared with every optional field, so that they are never too small.

#![allow(unsafe_code)]

use std::ffi::{CString, OsStr, c_char, c_int, c_uint, c_void};
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use anyhow::{Context, Result, bail, ensure};
use libloading::Library;
use lumbre_geometry::{PlacedShape, Ray};
use lumbre_kernel::TriangleMesh;
use lumbre_math::DVec3;

use crate::clock::Start;
use crate::program::{Built, Bytes, Pass, Program, Query, Tree};
use crate::rays::Ray32;
use crate::scene::Scene;

const INVALID: c_uint = c_uint::MAX;

const GEOMETRY_TRIANGLE: c_int = 0;
const GEOMETRY_FLAT_BEZIER_CURVE: c_int = 25;
const GEOMETRY_SPHERE_POINT: c_int = 50;
const GEOMETRY_USER: c_int = 120;
const GEOMETRY_INSTANCE: c_int = 121;

const BUFFER_INDEX: c_int = 0;
const BUFFER_VERTEX: c_int = 1;

const FORMAT_UINT: c_int = 0x5001;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const FORMAT_FLOAT4: c_int = 0x9004;
const FORMAT_FLOAT3X4_COLUMN_MAJOR: c_int = 0x9234;

const SCENE_FLAG_COMPACT: c_int = 1 << 1;
const SCENE_FLAG_ROBUST: c_int = 1 << 2;
const QUERY_FLAG_COHERENT: c_int = 1 << 16;
const FEATURES_ALL: c_uint = c_uint::MAX;

const PROPERTY_MAJOR: c_int = 1;
const PROPERTY_MINOR: c_int = 2;
const PROPERTY_PATCH: c_int = 3;

/// A device, a scene or a geometry of the library.
type Handle = *mut c_void;

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcRay {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
}

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcHit {
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: c_uint,
    geometry: c_uint,
    instance: c_uint,
    instance_primitive: c_uint,
}

#[repr(C)]
#[derive(Clone, Copy)]
struct RtcRayHit {
    ray: RtcRay,
    hit: RtcHit,
}

const _: () = assert!(size_of::<RtcRay>() == 48 && size_of::<RtcHit>() == 48);

#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct RtcRayHit16 {
    // The fields of the ray come first and form an `RTCRay16`.
    origin: [[f32; 16]; 3],
    t_near: [f32; 16],
    direction: [[f32; 16]; 3],
    time: [f32; 16],
    t_far: [f32; 16],
    mask: [c_uint; 16],
    id: [c_uint; 16],
    flags: [c_uint; 16],
    normal: [[f32; 16]; 3],
    uv: [[f32; 16]; 2],
    primitive: [c_uint; 16],
    geometry: [c_uint; 16],
    instance: [c_uint; 16],
    instance_primitive: [c_uint; 16],
}

#[repr(C, align(64))]
struct Lanes([c_int; 16]);

static ALL_LANES: Lanes = Lanes([-1; 16]);

/// What `rtcIntersect` and `rtcOccluded` take besides; both have this layout.
#[repr(C)]
struct Arguments {
    flags: c_int,
    features: c_uint,
    context: *mut c_void,
    filter: *const c_void,
    callback: *const c_void,
    // Where the library is built with minimal widths of curves.
    width_factor: f32,
}

impl Arguments {
    const COHERENT: Self = Self {
        flags: QUERY_FLAG_COHERENT,
        features: FEATURES_ALL,
        context: std::ptr::null_mut(),
        filter: std::ptr::null(),
        callback: std::ptr::null(),
        width_factor: 0.0,
    };
}

#[repr(C, align(16))]
struct RtcBounds {
    lower: [f32; 3],
    _lower_padding: f32,
    upper: [f32; 3],
    _upper_padding: f32,
}

#[repr(C)]
struct BoundsArguments {
    user: *mut c_void,
    primitive: c_uint,
    _time_step: c_uint,
    bounds: *mut RtcBounds,
}

/// Of the callbacks for closest and for any hits alike: `rays` points to rays with hits for the first, to rays for the
/// second, as structures of arrays of `count`.
#[repr(C)]
struct CallbackArguments {
    valid: *const c_int,
    user: *mut c_void,
    primitive: c_uint,
    context: *const c_uint,
    rays: *mut f32,
    count: c_uint,
    geometry: c_uint,
}

type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;
type BoundsCallback = unsafe extern "C" fn(*const BoundsArguments);
type RayCallback = unsafe extern "C" fn(*const CallbackArguments);

/// Declares the functions of the library and how they are found in it.
macro_rules! functions {
    ($($name:ident = $symbol:literal : fn($($argument:ty),*) $(-> $answer:ty)?;)+) => {
        struct Api {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $answer)?,)+
            // Never let go of: threads that it started may still run when the program ends.
            _library: ManuallyDrop<Library>,
        }

        impl Api {
            fn load(path: &OsStr) -> Result<Self> {
                // SAFETY: the path is the user's, who says that it is Embree 4; its initialisers are those of an
                // ordinary library. The symbols have the types that version 4 documents, which `Embree::load` checks.
                unsafe {
                    let library = Library::new(path).with_context(|| format!("cannot load {}", path.display()))?;
                    Ok(Self {
                        $($name: *library.get($symbol).context(concat!("no function ", stringify!($name)))?,)+
                        _library: ManuallyDrop::new(library),
                    })
                }
            }
        }
    };
}

functions! {
    new_device = b"rtcNewDevice\0": fn(*const c_char) -> Handle;
    release_device = b"rtcReleaseDevice\0": fn(Handle);
    device_error = b"rtcGetDeviceError\0": fn(Handle) -> c_int;
    device_property = b"rtcGetDeviceProperty\0": fn(Handle, c_int) -> isize;
    set_memory_monitor = b"rtcSetDeviceMemoryMonitorFunction\0": fn(Handle, MemoryMonitor, *mut c_void);
    new_scene = b"rtcNewScene\0": fn(Handle) -> Handle;
    release_scene = b"rtcReleaseScene\0": fn(Handle);
    set_scene_quality = b"rtcSetSceneBuildQuality\0": fn(Handle, c_int);
    set_scene_flags = b"rtcSetSceneFlags\0": fn(Handle, c_int);
    attach_geometry = b"rtcAttachGeometry\0": fn(Handle, Handle) -> c_uint;
    commit_scene = b"rtcCommitScene\0": fn(Handle);
    new_geometry = b"rtcNewGeometry\0": fn(Handle, c_int) -> Handle;
    release_geometry = b"rtcReleaseGeometry\0": fn(Handle);
    commit_geometry = b"rtcCommitGeometry\0": fn(Handle);
    set_geometry_quality = b"rtcSetGeometryBuildQuality\0": fn(Handle, c_int);
    set_shared_buffer = b"rtcSetSharedGeometryBuffer\0":
        fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    set_user_count = b"rtcSetGeometryUserPrimitiveCount\0": fn(Handle, c_uint);
    set_user_data = b"rtcSetGeometryUserData\0": fn(Handle, *mut c_void);
    set_bounds_callback = b"rtcSetGeometryBoundsFunction\0": fn(Handle, BoundsCallback, *mut c_void);
    set_intersect_callback = b"rtcSetGeometryIntersectFunction\0": fn(Handle, RayCallback);
    set_occluded_callback = b"rtcSetGeometryOccludedFunction\0": fn(Handle, RayCallback);
    set_instanced_scene = b"rtcSetGeometryInstancedScene\0": fn(Handle, Handle);
    set_transform = b"rtcSetGeometryTransform\0": fn(Handle, c_uint, c_int, *const c_void);
    intersect1 = b"rtcIntersect1\0": fn(Handle, *mut RtcRayHit, *const Arguments);
    occluded1 = b"rtcOccluded1\0": fn(Handle, *mut RtcRay, *const Arguments);
    intersect16 = b"rtcIntersect16\0": fn(*const c_int, Handle, *mut RtcRayHit16, *const Arguments);
    occluded16 = b"rtcOccluded16\0": fn(*const c_int, Handle, *mut RtcRayHit16, *const Arguments);
}

/// How a scene is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setting {
    /// Embree's default: medium quality, no flags.
    Default,
    /// High quality: spatial splits.
    High,
    /// Medium quality with its robust flag.
    Robust,
    /// Medium quality with its compact flag.
    Compact,
    /// The default, and rays in coherent packets of sixteen.
    Packets,
}

impl Setting {
    const fn quality(self) -> c_int {
        match self {
            Self::High => 2,
            Self::Default | Self::Robust | Self::Compact | Self::Packets => 1,
        }
    }

    const fn flags(self) -> c_int {
        match self {
            Self::Robust => SCENE_FLAG_ROBUST,
            Self::Compact => SCENE_FLAG_COMPACT,
            Self::Default | Self::High | Self::Packets => 0,
        }
    }
}

/// The library, with one setting.
pub(crate) struct Embree {
    api: Arc<Api>,
    version: String,
    setting: Setting,
}

impl Embree {
    /// Loads the library once for several settings.
    ///
    /// # Errors
    /// When it cannot be loaded or is not of version 4.
    pub(crate) fn load(path: &OsStr, settings: &[Setting]) -> Result<Vec<Self>> {
        let api = Arc::new(Api::load(path)?);
        let device = Device::new(&api, 1)?;
        // SAFETY: the device is live.
        let number = |property| unsafe { (api.device_property)(device.handle, property) };
        let version = [PROPERTY_MAJOR, PROPERTY_MINOR, PROPERTY_PATCH].map(number);
        let [major, minor, patch] = version;
        ensure!(major == 4, "{} is Embree {major}.{minor}, not 4", path.display());
        let version = format!("{major}.{minor}.{patch}");
        let with = |&setting| Self { api: Arc::clone(&api), version: version.clone(), setting };
        Ok(settings.iter().map(with).collect())
    }
}

impl Program for Embree {
    fn name(&self) -> String {
        let version = &self.version;
        match self.setting {
            Setting::Default => format!("Embree {version}"),
            Setting::High => format!("Embree {version} high"),
            Setting::Robust => format!("Embree {version} robust"),
            Setting::Compact => format!("Embree {version} compact"),
            Setting::Packets => format!("Embree {version} packets of 16"),
        }
    }

    fn refuses(&self, scene: &Scene) -> Option<&'static str> {
        (self.setting == Setting::Packets && !scene.shapes.is_empty())
            .then_some("packets are measured without callbacks")
    }

    fn takes_packets(&self) -> bool {
        self.setting == Setting::Packets
    }

    fn build<'a>(&'a self, scene: &'a Scene, threads: usize) -> Result<Built<'a>> {
        let device = Arc::new(Device::new(&self.api, threads)?);
        // The library reads sixteen bytes at every vertex, so that a copy with room behind it is needed.
        let padded = |mesh: &Arc<TriangleMesh>| {
            let mut floats: Vec<f32> = mesh.positions.iter().flat_map(|p| p.to_array()).collect();
            floats.extend([0.0; 4]);
            SharedMesh { mesh: Arc::clone(mesh), floats: Arc::new(floats) }
        };
        let meshes: Vec<_> = scene.meshes.iter().map(padded).collect();
        let placed: Vec<_> = scene.placed_meshes.iter().map(padded).collect();

        let start = Start::of_program();
        let placed: Result<Vec<_>> = placed
            .into_iter()
            .map(|mesh| {
                let mut group = Group::new(&device, self.setting);
                group.add_mesh(mesh);
                group.commit()
            })
            .collect();
        let placed = placed?;
        let mut group = Group::new(&device, self.setting);
        for mesh in meshes {
            group.add_mesh(mesh);
        }
        if !scene.spheres.spheres.is_empty() {
            group.add_spheres(&scene.spheres.spheres);
        }
        if !scene.curves.points.is_empty() {
            group.add_curves(&scene.curves.points);
        }
        if !scene.shapes.is_empty() {
            group.add_shapes(Arc::clone(&scene.shapes));
        }
        for placement in &scene.placements {
            group.add_instance(&placed[placement.mesh], &placement.world_from_object);
        }
        group.inner = placed;
        let group = group.commit()?;
        let seconds = start.program_seconds(threads);
        let bytes = device.memory.bytes();
        Ok(Built {
            tree: Box::new(Committed { group, setting: self.setting, _scene: scene }),
            seconds,
            bytes,
        })
    }
}

/// What the library says that it allocates.
#[derive(Default)]
struct Memory {
    now: AtomicIsize,
    peak: AtomicIsize,
}

impl Memory {
    fn bytes(&self) -> Bytes {
        let whole = |bytes: &AtomicIsize| bytes.load(Ordering::Relaxed).max(0) as usize;
        Bytes { kept: whole(&self.now), peak: whole(&self.peak) }
    }
}

/// Counts, and never refuses.
unsafe extern "C" fn count_memory(user: *mut c_void, bytes: isize, _after: bool) -> bool {
    // SAFETY: `Device::new` passes its counters, which outlive the device.
    let memory = unsafe { &*user.cast::<Memory>() };
    let now = memory.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
    memory.peak.fetch_max(now, Ordering::Relaxed);
    true
}

struct Device {
    api: Arc<Api>,
    handle: Handle,
    memory: Box<Memory>,
}

// SAFETY: a device may be used from several threads (Embree 4 API, "Thread Safety"); the counters are atomic.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    fn new(api: &Arc<Api>, threads: usize) -> Result<Self> {
        let settings = CString::new(format!("threads={threads},set_affinity=0")).expect("no zero inside");
        let memory = Box::<Memory>::default();
        // SAFETY: the string ends in a zero and outlives the call.
        let handle = unsafe { (api.new_device)(settings.as_ptr()) };
        ensure!(!handle.is_null(), "Embree makes no device");
        let user = (&raw const *memory).cast_mut().cast();
        // SAFETY: the device is live. The counters are in a box that is dropped after the device is released.
        unsafe { (api.set_memory_monitor)(handle, count_memory, user) };
        Ok(Self { api: Arc::clone(api), handle, memory })
    }

    fn check(&self) -> Result<()> {
        // SAFETY: the device is live.
        match unsafe { (self.api.device_error)(self.handle) } {
            0 => Ok(()),
            code => bail!("Embree reports error {code}"),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: made by `new`, released once; every scene holds its device.
        unsafe { (self.api.release_device)(self.handle) };
    }
}

#[derive(Clone)]
struct SharedMesh {
    mesh: Arc<TriangleMesh>,
    floats: Arc<Vec<f32>>,
}

/// A scene of the library, and what it reads without owning it.
struct Group {
    handle: Handle,
    setting: Setting,
    meshes: Vec<SharedMesh>,
    spheres: Vec<Vec<f32>>,
    curves: Vec<(Vec<f32>, Vec<u32>)>,
    // The callbacks have the address of the list inside.
    shapes: Vec<Arc<Vec<PlacedShape>>>,
    inner: Vec<Self>,
    device: Arc<Device>,
}

// SAFETY: a committed scene may be queried from several threads (Embree 4 API, "Thread Safety"), and it is not changed
// after `commit`; what it shares is read only.
unsafe impl Send for Group {}
// SAFETY: as above.
unsafe impl Sync for Group {}

impl Group {
    fn new(device: &Arc<Device>, setting: Setting) -> Self {
        let api = &device.api;
        // SAFETY: the device is live, and so is the scene that it makes; a null scene would show as an error in
        // `commit` before anything is asked of it.
        let handle = unsafe {
            let handle = (api.new_scene)(device.handle);
            (api.set_scene_quality)(handle, setting.quality());
            (api.set_scene_flags)(handle, setting.flags());
            handle
        };
        Self {
            handle,
            setting,
            meshes: Vec::new(),
            spheres: Vec::new(),
            curves: Vec::new(),
            shapes: Vec::new(),
            inner: Vec::new(),
            device: Arc::clone(device),
        }
    }

    /// Makes a geometry, fills it and attaches it.
    fn add(&self, kind: c_int, fill: impl FnOnce(&Api, Handle)) {
        let api = &*self.device.api;
        // SAFETY: device and scene are live, and `fill` gets a live geometry; the scene keeps it after the release.
        unsafe {
            let geometry = (api.new_geometry)(self.device.handle, kind);
            (api.set_geometry_quality)(geometry, self.setting.quality());
            fill(api, geometry);
            (api.commit_geometry)(geometry);
            (api.attach_geometry)(self.handle, geometry);
            (api.release_geometry)(geometry);
        }
    }

    fn add_mesh(&mut self, shared: SharedMesh) {
        self.add(GEOMETRY_TRIANGLE, |api, geometry| {
            let (positions, indices) = (&shared.floats, &shared.mesh.indices);
            let count = shared.mesh.positions.len();
            // SAFETY: both arrays outlive the scene, which `self.meshes` holds, and are as long as is said; behind the
            // last vertex are sixteen more bytes.
            unsafe {
                let set = api.set_shared_buffer;
                set(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT3, positions.as_ptr().cast(), 0, 12, count);
                set(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, indices.as_ptr().cast(), 0, 12, indices.len());
            }
        });
        self.meshes.push(shared);
    }

    fn add_spheres(&mut self, spheres: &[[f32; 4]]) {
        let floats: Vec<f32> = spheres.iter().flatten().copied().collect();
        self.add(GEOMETRY_SPHERE_POINT, |api, geometry| {
            let (start, count) = (floats.as_ptr().cast(), spheres.len());
            // SAFETY: `self.spheres` holds the array, four numbers a sphere, as long as the scene.
            unsafe {
                (api.set_shared_buffer)(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT4, start, 0, 16, count)
            };
        });
        self.spheres.push(floats);
    }

    fn add_curves(&mut self, curves: &[[[f32; 4]; 4]]) {
        let floats: Vec<f32> = curves.as_flattened().as_flattened().to_vec();
        let firsts: Vec<u32> = (0..curves.len() as u32).map(|i| 4 * i).collect();
        self.add(GEOMETRY_FLAT_BEZIER_CURVE, |api, geometry| {
            let set = api.set_shared_buffer;
            // SAFETY: `self.curves` holds both arrays as long as the scene: four numbers a control point, and the first
            // of four control points of each curve.
            unsafe {
                let (points, count) = (floats.as_ptr().cast(), 4 * curves.len());
                set(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT4, points, 0, 16, count);
                set(geometry, BUFFER_INDEX, 0, FORMAT_UINT, firsts.as_ptr().cast(), 0, 4, firsts.len());
            }
        });
        self.curves.push((floats, firsts));
    }

    fn add_shapes(&mut self, shapes: Arc<Vec<PlacedShape>>) {
        let user = Arc::as_ptr(&shapes).cast_mut().cast();
        self.add(GEOMETRY_USER, |api, geometry| {
            // SAFETY: the callbacks take `user` for what it is; `self.shapes` holds it as long as the scene.
            unsafe {
                (api.set_user_count)(geometry, shapes.len() as c_uint);
                (api.set_user_data)(geometry, user);
                (api.set_bounds_callback)(geometry, shape_bounds, user);
                (api.set_intersect_callback)(geometry, shape_intersect);
                (api.set_occluded_callback)(geometry, shape_occluded);
            }
        });
        self.shapes.push(shapes);
    }

    fn add_instance(&self, of: &Self, world_from_object: &[[f32; 3]; 4]) {
        self.add(GEOMETRY_INSTANCE, |api, geometry| {
            // SAFETY: both are live, and the instance retains the scene; the twelve numbers are copied by the call.
            unsafe {
                (api.set_instanced_scene)(geometry, of.handle);
                let numbers = world_from_object.as_ptr().cast();
                (api.set_transform)(geometry, 0, FORMAT_FLOAT3X4_COLUMN_MAJOR, numbers);
            }
        });
    }

    fn commit(self) -> Result<Self> {
        self.device.check()?;
        // SAFETY: device and scene are live: making them gave no error.
        unsafe { (self.device.api.commit_scene)(self.handle) };
        self.device.check()?;
        Ok(self)
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        // SAFETY: made by `new`, released once, before what it shares and before its device.
        unsafe { (self.device.api.release_scene)(self.handle) };
    }
}

/// The shapes of a user geometry.
///
/// # Safety
/// `user` must come from [`Group::add_shapes`], with its group still alive.
unsafe fn shapes_of<'a>(user: *mut c_void) -> &'a [PlacedShape] {
    // SAFETY: the caller's promise.
    unsafe { &*user.cast::<Vec<PlacedShape>>() }
}

unsafe extern "C" fn shape_bounds(arguments: *const BoundsArguments) {
    // SAFETY: the library passes its arguments, with the user pointer of `add_shapes`, a primitive that was counted,
    // and room for a box.
    unsafe {
        let arguments = &*arguments;
        let shape = &shapes_of(arguments.user)[arguments.primitive as usize];
        // An infinite shape would be everywhere.
        let (min, max) = shape.bounds().map_or((DVec3::splat(-1e30), DVec3::splat(1e30)), |b| (b.min, b.max));
        let down = |x: f64| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
        let up = |x: f64| if f64::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
        (*arguments.bounds).lower = min.to_array().map(down);
        (*arguments.bounds).upper = max.to_array().map(up);
    }
}

/// The rays of a callback that are to be answered, each in double precision.
///
/// # Safety
/// `arguments` must come from the library, whose rays are twelve arrays of `count`.
unsafe fn active_rays(arguments: &CallbackArguments) -> impl Iterator<Item = (usize, Ray)> {
    let (n, valid, rays) = (arguments.count as usize, arguments.valid, arguments.rays);
    // SAFETY: the caller's promise.
    let number = move |field: usize, i: usize| f64::from(unsafe { *rays.add(field * n + i) });
    // SAFETY: as above.
    (0..n).filter(move |&i| unsafe { *valid.add(i) } != 0).map(move |i| {
        let vector = |first: usize| DVec3::new(number(first, i), number(first + 1, i), number(first + 2, i));
        (i, Ray::new(vector(0), vector(4)).with_range(number(3, i), number(8, i)))
    })
}

unsafe extern "C" fn shape_intersect(arguments: *const CallbackArguments) {
    // SAFETY: the library passes its arguments, with the user pointer of `add_shapes` and a primitive that was counted;
    // rays with hits are twenty arrays of `count` and one for each level of instances, whose first the context holds.
    unsafe {
        let arguments = &*arguments;
        let shape = &shapes_of(arguments.user)[arguments.primitive as usize];
        let n = arguments.count as usize;
        for (i, ray) in active_rays(arguments) {
            let Some(root) = shape.closest(&ray) else { continue };
            // As for Lumbre, what else is wanted of the hit can be computed for the winner.
            *arguments.rays.add(8 * n + i) = root.t as f32;
            let integers = arguments.rays.cast::<c_uint>();
            *integers.add(17 * n + i) = arguments.primitive;
            *integers.add(18 * n + i) = arguments.geometry;
            *integers.add(19 * n + i) = *arguments.context;
        }
    }
}

unsafe extern "C" fn shape_occluded(arguments: *const CallbackArguments) {
    // SAFETY: as for `shape_intersect`, with rays without hits.
    unsafe {
        let arguments = &*arguments;
        let shape = &shapes_of(arguments.user)[arguments.primitive as usize];
        for (i, ray) in active_rays(arguments) {
            if shape.any(&ray) {
                *arguments.rays.add(8 * arguments.count as usize + i) = f32::NEG_INFINITY;
            }
        }
    }
}

struct Committed<'a> {
    group: Group,
    setting: Setting,
    _scene: &'a Scene,
}

impl Tree for Committed<'_> {
    fn prepare<'a>(&'a self, query: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a> {
        let group = &self.group;
        if self.setting == Setting::Packets {
            let packets = rays.chunks(16).map(packet).collect();
            return Box::new(Packets { group, query, ends: ends(rays), packets });
        }
        let ray_of = |ray: &Ray32| RtcRay {
            origin: ray.origin,
            t_near: 0.0,
            direction: ray.direction,
            time: 0.0,
            t_far: ray.t_max,
            mask: c_uint::MAX,
            id: 0,
            flags: 0,
        };
        match query {
            Query::Closest => {
                let hit = RtcHit {
                    normal: [0.0; 3],
                    uv: [0.0; 2],
                    primitive: INVALID,
                    geometry: INVALID,
                    instance: INVALID,
                    instance_primitive: INVALID,
                };
                let list = rays.iter().map(|ray| RtcRayHit { ray: ray_of(ray), hit }).collect();
                Box::new(Closest { group, ends: ends(rays), rays: list })
            }
            Query::Any => Box::new(Any { group, ends: ends(rays), rays: rays.iter().map(ray_of).collect() }),
        }
    }
}

fn ends(rays: &[Ray32]) -> Vec<f32> {
    rays.iter().map(|ray| ray.t_max).collect()
}

struct Closest<'a> {
    group: &'a Group,
    ends: Vec<f32>,
    rays: Vec<RtcRayHit>,
}

impl Pass for Closest<'_> {
    fn reset(&mut self) {
        for (ray, end) in self.rays.iter_mut().zip(&self.ends) {
            ray.ray.t_far = *end;
            ray.hit.geometry = INVALID;
        }
    }

    fn run(&mut self) {
        let (intersect, scene) = (self.group.device.api.intersect1, self.group.handle);
        let _flushing = FlushToZero::begin();
        for ray in &mut self.rays {
            // SAFETY: the scene is committed, and the ray has the layout and alignment of an `RTCRayHit`.
            unsafe { intersect(scene, ray, std::ptr::null()) };
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        let answer = |ray: &RtcRayHit| (ray.hit.geometry != INVALID).then_some(f64::from(ray.ray.t_far));
        self.rays.iter().map(answer).collect()
    }
}

struct Any<'a> {
    group: &'a Group,
    ends: Vec<f32>,
    rays: Vec<RtcRay>,
}

impl Pass for Any<'_> {
    fn reset(&mut self) {
        for (ray, end) in self.rays.iter_mut().zip(&self.ends) {
            ray.t_far = *end;
        }
    }

    fn run(&mut self) {
        let (occluded, scene) = (self.group.device.api.occluded1, self.group.handle);
        let _flushing = FlushToZero::begin();
        for ray in &mut self.rays {
            // SAFETY: the scene is committed, and the ray has the layout and alignment of an `RTCRay`.
            unsafe { occluded(scene, ray, std::ptr::null()) };
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        self.rays.iter().map(|ray| (ray.t_far == f32::NEG_INFINITY).then_some(0.0)).collect()
    }
}

struct Packets<'a> {
    group: &'a Group,
    query: Query,
    ends: Vec<f32>,
    packets: Vec<RtcRayHit16>,
}

/// Up to sixteen rays; lanes without one have an empty range.
fn packet(rays: &[Ray32]) -> RtcRayHit16 {
    let mut packet = RtcRayHit16 {
        origin: [[0.0; 16]; 3],
        t_near: [0.0; 16],
        direction: [[1.0; 16]; 3],
        time: [0.0; 16],
        t_far: [-1.0; 16],
        mask: [c_uint::MAX; 16],
        id: [0; 16],
        flags: [0; 16],
        normal: [[0.0; 16]; 3],
        uv: [[0.0; 16]; 2],
        primitive: [INVALID; 16],
        geometry: [INVALID; 16],
        instance: [INVALID; 16],
        instance_primitive: [INVALID; 16],
    };
    for (lane, ray) in rays.iter().enumerate() {
        for axis in 0..3 {
            packet.origin[axis][lane] = ray.origin[axis];
            packet.direction[axis][lane] = ray.direction[axis];
        }
        packet.t_far[lane] = ray.t_max;
    }
    packet
}

impl Pass for Packets<'_> {
    fn reset(&mut self) {
        for (packet, ends) in self.packets.iter_mut().zip(self.ends.chunks(16)) {
            packet.t_far[..ends.len()].copy_from_slice(ends);
            packet.geometry = [INVALID; 16];
        }
    }

    fn run(&mut self) {
        let (api, scene) = (&*self.group.device.api, self.group.handle);
        let trace = match self.query {
            Query::Closest => api.intersect16,
            Query::Any => api.occluded16,
        };
        let _flushing = FlushToZero::begin();
        for packet in &mut self.packets {
            // SAFETY: the scene is committed, and a packet has the layout and alignment of an `RTCRayHit16`, which
            // begins with an `RTCRay16`.
            unsafe { trace(ALL_LANES.0.as_ptr(), scene, packet, &Arguments::COHERENT) };
        }
    }

    fn answers(&self) -> Vec<Option<f64>> {
        let answer = |i: usize| {
            let (packet, lane) = (&self.packets[i / 16], i % 16);
            match self.query {
                Query::Closest => (packet.geometry[lane] != INVALID).then_some(f64::from(packet.t_far[lane])),
                Query::Any => (packet.t_far[lane] == f32::NEG_INFINITY).then_some(0.0),
            }
        };
        (0..self.ends.len()).map(answer).collect()
    }
}

/// While it lives, this thread takes denormals for zero, as Embree's manual recommends.
struct FlushToZero {
    #[cfg(target_arch = "x86_64")]
    before: u32,
}

impl FlushToZero {
    #[cfg(target_arch = "x86_64")]
    fn begin() -> Self {
        let mut before = 0_u32;
        // SAFETY: it stores the control register into four bytes that are ours.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut before, options(nostack)) };
        // Bits 15 and 6: flush to zero, and denormals are zero.
        Self::set(before | 0x8040);
        Self { before }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn begin() -> Self {
        Self {}
    }

    #[cfg(target_arch = "x86_64")]
    fn set(control: u32) {
        // SAFETY: only the two bits above ever differ from what was there. Rust's own code between does no arithmetic
        // on denormals whose result counts, and `drop` restores them.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const control, options(nostack, readonly)) };
    }
}

impl Drop for FlushToZero {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        Self::set(self.before);
    }
}
