//! Files of a formula, written here, read back; and the same ones damaged.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use lumbre_math::DVec3;
use lumbre_math::glam::IVec3;
use lumbre_math::random::RandomStream;

use super::*;
use crate::Limits;

const FIRST: IVec3 = IVec3::new(-2, 3, 5);
const LAST: IVec3 = IVec3::new(9, 12, 20);
const BACKGROUND: f32 = 0.125;

/// A value that depends on the voxel, and has few bits.
fn formula(voxel: IVec3) -> f32 {
    0.5 + voxel.dot(IVec3::new(1, 2, 3)).rem_euclid(5) as f32 / 2.0
}

fn voxel(v: IVec3) -> f32 {
    if v.cmpge(FIRST).all() && v.cmple(LAST).all() { formula(v) } else { BACKGROUND }
}

/// A buffer that is filled by place.
struct Out(Vec<u8>);

impl Out {
    fn put(&mut self, at: usize, bytes: impl AsRef<[u8]>) {
        let bytes = bytes.as_ref();
        self.0[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn ints(&mut self, at: usize, v: IVec3) {
        self.put(at, v.to_array().map(i32::to_le_bytes).as_flattened());
    }

    fn set_bit(&mut self, at: usize, n: usize) {
        self.0[at + n / 8] |= 1 << (n % 8);
    }
}

/// The grid of the formula, of single precision, double precision (2) or 8 bits a voxel (14).
fn grid(name: &str, kind: u32) -> Vec<u8> {
    let (root_size, leaf_size) = match kind {
        2 => (96, 4224),
        14 => (64, 608),
        _ => (64, 2144),
    };
    let mut leaves = vec![];
    for x in FIRST.x >> 3..=LAST.x >> 3 {
        for y in FIRST.y >> 3..=LAST.y >> 3 {
            leaves.extend((FIRST.z >> 3..=LAST.z >> 3).map(|z| IVec3::new(x, y, z)));
        }
    }
    let mut lowers: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
    let mut uppers: BTreeMap<[i32; 3], Vec<usize>> = BTreeMap::new();
    for (i, leaf) in leaves.iter().enumerate() {
        lowers.entry((*leaf >> 4_i32).to_array()).or_default().push(i);
    }
    for (i, lower) in lowers.keys().enumerate() {
        uppers.entry((IVec3::from(*lower) >> 5_i32).to_array()).or_default().push(i);
    }
    let tree = 672;
    let root = tree + 64;
    let upper_at = root + root_size + 32 * uppers.len();
    let lower_at = upper_at + 270_400 * uppers.len();
    let leaf_at = lower_at + 33_856 * lowers.len();
    let size = leaf_at + leaf_size * leaves.len();
    let mut out = Out(vec![0; size]);
    let number = |out: &mut Out, at: usize, value: f32| match kind {
        2 => out.put(at, f64::from(value).to_le_bytes()),
        _ => out.put(at, value.to_le_bytes()),
    };
    out.put(0, b"NanoVDB0");
    out.put(16, (32_u32 << 21 | 6 << 10).to_le_bytes());
    out.put(32, (size as u64).to_le_bytes());
    out.put(40, name);
    for (i, value) in [0.5, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 2.0_f64].into_iter().enumerate() {
        out.put(296 + 88 + 8 * i, value.to_le_bytes());
    }
    for (i, value) in [3.0, -1.0, 7.0_f64].into_iter().enumerate() {
        out.put(296 + 232 + 8 * i, value.to_le_bytes());
    }
    out.put(632, 2_u32.to_le_bytes());
    out.put(636, kind.to_le_bytes());
    for (i, at) in [leaf_at, lower_at, upper_at, root].into_iter().enumerate() {
        out.put(tree + 8 * i, (at as u64 - tree as u64).to_le_bytes());
    }
    for (i, count) in [leaves.len(), lowers.len(), uppers.len()].into_iter().enumerate() {
        out.put(tree + 32 + 4 * i, (count as u32).to_le_bytes());
    }
    out.ints(root, FIRST);
    out.ints(root + 12, LAST);
    out.put(root + 24, (uppers.len() as u32).to_le_bytes());
    number(&mut out, root + if kind == 2 { 32 } else { 28 }, BACKGROUND);
    for (i, (place, children)) in uppers.iter().enumerate() {
        let origin = IVec3::from(*place) << 12_i32;
        let [x, y, z] = origin.to_array().map(|x| u64::from(x as u32 >> 12));
        let tile = root + root_size + 32 * i;
        let node = upper_at + 270_400 * i;
        out.put(tile, (z | y << 21 | x << 42).to_le_bytes());
        out.put(tile + 8, (node as u64 - root as u64).to_le_bytes());
        out.ints(node, origin + 1);
        out.ints(node + 12, origin + 4000);
        for n in 0..32_768 {
            number(&mut out, node + 8256 + 8 * n, BACKGROUND);
        }
        for &child in children {
            let place = IVec3::from(*lowers.keys().nth(child).unwrap()) & 31;
            let n = (place.x << 10 | place.y << 5 | place.z) as usize;
            out.set_bit(node + 4128, n);
            out.put(node + 8256 + 8 * n, ((lower_at + 33_856 * child - node) as u64).to_le_bytes());
        }
    }
    for (i, (place, children)) in lowers.iter().enumerate() {
        let node = lower_at + 33_856 * i;
        out.ints(node, (IVec3::from(*place) << 7_i32) + 1);
        out.ints(node + 12, (IVec3::from(*place) << 7_i32) + 100);
        for n in 0..4096 {
            number(&mut out, node + 1088 + 8 * n, BACKGROUND);
        }
        for &child in children {
            let place = leaves[child] & 15;
            let n = (place.x << 8 | place.y << 4 | place.z) as usize;
            out.set_bit(node + 544, n);
            out.put(node + 1088 + 8 * n, ((leaf_at + leaf_size * child - node) as u64).to_le_bytes());
        }
    }
    for (i, leaf) in leaves.iter().enumerate() {
        let node = leaf_at + leaf_size * i;
        out.ints(node, (*leaf << 3_i32).max(FIRST));
        out.put(node + 80, BACKGROUND.to_le_bytes());
        out.put(node + 84, 0.125_f32.to_le_bytes());
        for n in 0..512 {
            let value = voxel((*leaf << 3_i32) + IVec3::new(n >> 6, n >> 3 & 7, n & 7));
            let n = n as usize;
            match kind {
                2 => number(&mut out, node + 128 + 8 * n, value),
                14 => out.put(node + 96 + n, [((value - BACKGROUND) / 0.125) as u8]),
                _ => number(&mut out, node + 96 + 4 * n, value),
            }
        }
    }
    out.0
}

/// A frame of Blosc: shuffled, blocks of 4 KiB and a short last one, split into streams of the bytes of each place.
fn blosc(raw: &[u8]) -> Vec<u8> {
    const BLOCK: usize = 4096;
    let blocks: Vec<&[u8]> = raw.chunks(BLOCK).collect();
    let mut body = vec![];
    let mut starts = vec![];
    for block in &blocks {
        starts.extend((16 + 4 * blocks.len() as u32 + body.len() as u32).to_le_bytes());
        let elements = block.len() / 4;
        let mut shuffled: Vec<u8> = (0..4)
            .flat_map(|byte| (0..elements).map(move |i| (i, byte)))
            .map(|(i, b)| block[4 * i + b])
            .collect();
        shuffled.extend(&block[4 * elements..]);
        for stream in shuffled.chunks(if block.len() == BLOCK { BLOCK / 4 } else { block.len() }) {
            let packed = lz4_flex::block::compress(stream);
            let stored = if packed.len() < stream.len() { &packed[..] } else { stream };
            body.extend((stored.len() as i32).to_le_bytes());
            body.extend(stored);
        }
    }
    let size = 16 + starts.len() + body.len();
    let numbers = [raw.len() as u32, BLOCK as u32, size as u32].map(u32::to_le_bytes);
    [&[2, 1, 1 | 32, 4][..], numbers.as_flattened(), &starts, &body].concat()
}

fn stored(raw: &[u8]) -> Vec<u8> {
    let numbers = [raw.len() as u32, raw.len() as u32, raw.len() as u32 + 16].map(u32::to_le_bytes);
    [&[2, 1, 2 | 32, 4][..], numbers.as_flattened(), raw].concat()
}

/// A file of one segment with these grids.
fn file(grids: &[(&str, Vec<u8>)], codec: u16, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut head = b"NanoVDB2".to_vec();
    head.extend((32_u32 << 21 | 7 << 10).to_le_bytes());
    head.extend((grids.len() as u16).to_le_bytes());
    head.extend(codec.to_le_bytes());
    let mut body = vec![];
    for (name, grid) in grids {
        let packed = pack(grid);
        let packed =
            if codec == 0 { packed } else { [&(packed.len() as u64).to_le_bytes()[..], &packed].concat() };
        let mut metadata = Out(vec![0; 176]);
        metadata.put(0, (grid.len() as u64).to_le_bytes());
        metadata.put(8, (packed.len() as u64).to_le_bytes());
        metadata.put(136, (name.len() as u32 + 1).to_le_bytes());
        metadata.put(168, codec.to_le_bytes());
        head.extend(metadata.0);
        head.extend(name.as_bytes());
        head.push(0);
        body.extend(packed);
    }
    head.extend(body);
    head
}

fn zip(raw: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(vec![], Compression::default());
    encoder.write_all(raw).unwrap();
    encoder.finish().unwrap()
}

fn read_density(bytes: &[u8]) -> Result<Option<NanoGrid>, FormatError> {
    let budget = Budget::new(Limits { memory: 64 << 20, ..Limits::default() });
    let read = read(bytes, &"a.nvdb".into(), "density", Values::NotNegative, &budget);
    assert!(budget.memory_peak() <= 64 << 20);
    read
}

fn error(bytes: &[u8]) -> String {
    read_density(bytes).unwrap_err().to_string()
}

fn assert_holds_the_formula(read: &NanoGrid) {
    assert_eq!(read.grid.bounds(), [FIRST, LAST]);
    for i in 0..18 * 16 * 22 {
        let v = FIRST + IVec3::new(i / (16 * 22), i / 22 % 16, i % 22) - 3;
        assert_eq!(read.grid.voxel(v), voxel(v), "{v}");
    }
    // World = (0.5, 0.25, 2) index + (3, -1, 7).
    assert_eq!(read.world_bounds, [DVec3::new(2.0, -0.25, 17.0), DVec3::new(8.0, 2.25, 49.0)]);
    assert_eq!(read.grid.at(DVec3::new(3.0, 0.0, 21.0)), formula(IVec3::new(0, 4, 7)));
}

#[test]
fn grids_are_read_however_they_are_packed() {
    let plain = grid("density", 1);
    let other = grid("heat", 1);
    let grids = [("heat", other), ("density", plain.clone())];
    let mut raw = grids[0].1.clone();
    raw.extend(&plain);
    let mut newer = plain.clone();
    newer[..8].copy_from_slice(b"NanoVDB1");
    let files = [
        file(&grids, 0, <[u8]>::to_vec),
        file(&grids, 1, zip),
        file(&grids, 2, blosc),
        file(&grids, 2, stored),
        plain,
        newer,
        raw,
    ];
    for (i, bytes) in files.iter().enumerate() {
        let read = read_density(bytes).unwrap_or_else(|error| panic!("{i}: {error}"));
        assert_holds_the_formula(&read.unwrap());
    }
    let names = |bytes| grid_names(bytes, &"a.nvdb".into(), &Budget::default()).unwrap();
    assert_eq!(names(&files[1]), ["heat", "density"]);
    assert_eq!(names(&files[6]), ["heat", "density"]);
    let none = read(&files[1], &"a.nvdb".into(), "flames", Values::Finite, &Budget::default());
    assert!(none.unwrap().is_none());
}

#[test]
fn grids_of_other_numbers_are_read() {
    for kind in [2, 14] {
        assert_holds_the_formula(&read_density(&grid("density", kind)).unwrap().unwrap());
    }
}

#[test]
fn constant_blocks_stay_constant() {
    let mut bytes = Out(grid("density", 1));
    let root = 672 + 64;
    let tiles = u32::from_le_bytes(bytes.0[root + 24..root + 28].try_into().unwrap()) as usize;
    // The box reaches into blocks of the upper node and of the lower one that are of one value.
    bytes.ints(root + 12, LAST + IVec3::new(1000, 10, 0));
    let upper = root + 64 + 32 * tiles + 270_400;
    bytes.put(upper + 8256 + 8 * (3 << 10), 5.0_f32.to_le_bytes());
    let lower = root + 64 + 32 * tiles + 270_400 * tiles + 33_856;
    bytes.put(lower + 1088 + 8 * (1 << 8 | 2 << 4), 7.0_f32.to_le_bytes());
    let read = read_density(&bytes.0).unwrap().unwrap().grid;
    assert_eq!(read.voxel(IVec3::new(3 * 128 + 50, 100, 3)), 5.0);
    assert_eq!(read.voxel(IVec3::new(9, 17, 6)), 7.0);
    assert_eq!(read.voxel(IVec3::new(600, 17, 6)), BACKGROUND);
}

#[test]
fn what_is_wrong_is_said_with_its_byte() {
    let plain = grid("density", 1);
    let changed = |at: usize, with: &[u8]| {
        let mut out = Out(plain.clone());
        out.put(at, with);
        error(&out.0)
    };
    let root = 672 + 64;
    let cases = [
        (error(b" BDV\0\0\0\0 and so on"), "a.nvdb:byte 0: this is an OpenVDB file"),
        (error(b"0BDVonaN"), "big-endian"),
        (error(b"PNG and more"), "a.nvdb:byte 0: not a NanoVDB file"),
        (error(b"Nano"), "a.nvdb:byte 0: the file ends in a NanoVDB file"),
        (error(&file(&[("density", plain.clone())], 3, <[u8]>::to_vec)), "byte 184: unknown codec"),
        (changed(632, &[1]), "a.nvdb:byte 632: a grid that is a surface"),
        (changed(636, &[4]), "a.nvdb:byte 636: a grid of values that are not read (found type 4"),
        (changed(296 + 88, &0_f64.to_le_bytes()), "a.nvdb:byte 384: the map of a grid cannot be undone"),
        (changed(672, &7_u64.to_le_bytes()), "a.nvdb:byte 672: the tree's leaves are not in the grid"),
        (changed(672 + 32, &[200]), "a.nvdb:byte 672: the tree's leaves are not in the grid"),
        (
            changed(root + 28, &(-1_f32).to_le_bytes()),
            "byte 764: wrong value in a grid (found -1; expected a finite",
        ),
        (changed(root + 28, &f32::NAN.to_le_bytes()), "byte 764: wrong value in a grid (found NaN"),
        (changed(root + 12, [[0, 0, 0, 32]; 3].as_flattened()), "voxels of a grid: needs"),
        (
            changed(root + 64 + 8, &24_i64.to_le_bytes()),
            "byte 808: a node that is none of the tree's upper nodes",
        ),
        (changed(plain.len() - 2144, &[77]), "a leaf stands in another place"),
    ];
    for (found, expected) in cases {
        assert!(found.contains(expected), "{found}");
    }
    // A byte of a packed grid is one of the unpacked grid.
    let mut surface = Out(plain.clone());
    surface.put(632, [1]);
    let found = error(&file(&[("density", surface.0)], 1, zip));
    assert!(
        found.contains("a.nvdb:byte 632 of the unpacked grid \"density\": a grid that is a surface"),
        "{found}"
    );
    // Fifty GiB from a few bytes.
    let mut bomb = Out(file(&[("density", plain)], 1, zip));
    bomb.put(16, (50_u64 << 30).to_le_bytes());
    assert!(error(&bomb.0).contains("--max-expansion"));
    // Negative numbers are refused of densities alone.
    let mut cold = Out(grid("density", 1));
    cold.put(root + 28, (-1_f32).to_le_bytes());
    assert!(read(&cold.0, &"a.nvdb".into(), "density", Values::Finite, &Budget::default()).is_ok());
}

#[test]
fn damaged_files_end_in_an_error_or_an_answer() {
    let plain = grid("density", 1);
    let mut random = RandomStream::new(11);
    let mut pick = |below: usize| (random.next_f64() * below as f64) as usize;
    let (mut answers, mut errors) = (0, 0);
    let mut count = |bytes: &[u8]| match read_density(bytes) {
        Ok(_) => answers += 1,
        Err(_) => errors += 1,
    };
    for bytes in [file(&[("density", plain.clone())], 1, zip), file(&[("density", plain.clone())], 2, blosc)]
    {
        for end in (0..bytes.len()).filter(|end| *end < 1200 || end % 37 == 0) {
            assert!(read_density(&bytes[..end]).is_err() || end == 0, "{end}");
        }
        for at in 0..300 {
            let mut damaged = bytes.clone();
            let at = if at < 220 { at } else { pick(bytes.len()) };
            damaged[at] ^= 1 << pick(8);
            count(&damaged);
        }
    }
    for end in (0..plain.len()).step_by(131) {
        assert!(read_density(&plain[..end]).is_err() || end == 0, "{end}");
    }
    for _ in 0..400 {
        let mut damaged = plain.clone();
        for _ in 0..1 + pick(3) {
            // Most of the file is tables; what matters more is before and after.
            let at = [pick(900), pick(plain.len()), plain.len() - 1 - pick(36_000)][pick(3)];
            damaged[at] = [damaged[at] ^ 1 << pick(8), 0, 255][pick(3)];
        }
        count(&damaged);
    }
    assert!(answers > 50 && errors > 50, "{answers} answers, {errors} errors");
}

#[test]
fn files_of_another_writer_are_read() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases/pbrt-rest");
    for name in ["fog-zip.nvdb", "fog-blosc.nvdb"] {
        let Ok(bytes) = std::fs::read(folder.join(name)) else { continue };
        let read = read_density(&bytes).unwrap().unwrap().grid;
        let origin = IVec3::new(-5, -4, -3);
        assert_eq!(read.bounds(), [origin, origin + IVec3::new(11, 9, 7)]);
        for i in 0..12 * 10 * 8 {
            let v = origin + IVec3::new(i / 80, i / 8 % 10, i % 8);
            assert_eq!(read.voxel(v), formula(v), "{name} {v}");
        }
        assert_eq!(read.voxel(origin - 1), 0.0);
    }
}
