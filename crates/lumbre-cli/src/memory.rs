//! Estimates of memory, before work begins.

use std::fs;
use std::path::Path;

use lumbre::RenderOptions;
use lumbre::formats::{FormatError, LimitKind, Limits};

use crate::failure::Failure;

/// The memory that the program may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Memory {
    /// Bytes.
    most: u64,
    bound: Bound,
}

/// What sets the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bound {
    /// `--max-memory`, for all that is held.
    Flag,
    /// The memory that is free, from now on.
    Machine,
    /// That of a control group, such as a container, from now on.
    Group,
    /// `ulimit -v`, from now on.
    AddressSpace,
}

/// What is not accounted for: threads and their stacks, and the program itself.
const RESERVE: u64 = 64 << 20;

impl Memory {
    /// As much as `--max-memory` lets it take, or by default what is free, in the machine and in its control groups;
    /// but no more than the system grants (`ulimit -v`).
    pub(crate) fn new(flag: Option<u64>) -> Self {
        let memory = match flag {
            Some(most) => Self { most, bound: Bound::Flag },
            None => {
                let of_machine = available_memory().map(|most| Self { most, bound: Bound::Machine });
                let of_groups =
                    group_memory_left(Path::new("/")).map(|most| Self { most, bound: Bound::Group });
                let least = of_machine.into_iter().chain(of_groups).min_by_key(|memory| memory.most);
                least.unwrap_or(Self { most: Limits::default().memory, bound: Bound::Flag })
            }
        };
        match address_space_left() {
            Some(most) if most < memory.most => Self { most, bound: Bound::AddressSpace },
            _ => memory,
        }
    }

    /// The bytes that reading may account for: by default [`Limits::memory`], as files may be anyone's.
    pub(crate) fn for_reading(self) -> u64 {
        match self.bound {
            Bound::Flag => self.most,
            Bound::Machine | Bound::Group | Bound::AddressSpace => {
                self.usable().min(Limits::default().memory)
            }
        }
    }

    /// The bytes that a part in a file of this size may take: by default no more than an honest one of that size does.
    pub(crate) fn for_part(self, file_bytes: u64) -> u64 {
        match self.bound {
            Bound::Flag => self.most,
            _ => self.for_reading().min(lumbre::Part::fair_memory(file_bytes)),
        }
    }

    /// Allocators take more of the address space than they are asked for.
    fn usable(self) -> u64 {
        match self.bound {
            Bound::AddressSpace => self.most.saturating_sub(RESERVE) / 4 * 3,
            Bound::Flag | Bound::Machine | Bound::Group => self.most,
        }
    }

    /// The failure of a reader, with what else there is to know of the limit on memory where it met that, and what the
    /// system grants is what set it.
    pub(crate) fn explain(self, error: lumbre::Error) -> Failure {
        let is_of_memory = match &error {
            lumbre::Error::Format(FormatError::Limit { source, .. }) => source.kind == LimitKind::Memory,
            _ => false,
        };
        match Failure::from(error) {
            Failure::Limit(message) if is_of_memory && self.usable() == self.for_reading() => {
                Failure::Limit(message + self.remark())
            }
            failure => failure,
        }
    }

    fn remark(self) -> &'static str {
        match self.bound {
            Bound::AddressSpace => " (but the system grants no more: see ulimit -v)",
            Bound::Group => " (but the control group has no more: see its memory.max)",
            Bound::Flag | Bound::Machine => "",
        }
    }

    /// Refuses more memory than is left next to `held` bytes.
    ///
    /// # Errors
    /// [`Failure::Limit`] with the prediction.
    pub(crate) fn check(self, what: &str, needed: u64, held: u64) -> Result<(), Failure> {
        let left = match self.bound {
            Bound::Flag => self.most.saturating_sub(held),
            // What is held is not counted any more.
            Bound::Machine | Bound::Group | Bound::AddressSpace => self.usable(),
        };
        if needed <= left {
            return Ok(());
        }
        let raise = format!("raise it with --max-memory{}", self.remark());
        Err(Failure::Limit(format!("{what}: needs {needed} bytes of memory, {left} are left; {raise}")))
    }

    /// Refuses a picture that would not fit next to `held` bytes, while it is rendered, saved or shown.
    ///
    /// # Errors
    /// [`Failure::Limit`] with the prediction, and [`Failure::Usage`] for options that make no picture.
    pub(crate) fn check_picture(self, options: &RenderOptions, held: u64) -> Result<(), Failure> {
        let what = format!("a picture of {} by {} pixels", options.width, options.height);
        self.check(&what, picture_bytes(options)?, held)
    }
}

/// Bytes that a picture takes besides its scene, while it is rendered, denoised and saved.
///
/// # Errors
/// [`lumbre::Error::Render`] for options that make no picture.
pub(crate) fn picture_bytes(options: &RenderOptions) -> Result<u64, lumbre::Error> {
    // The picture, one over its background, and what encoders make of it; each layer as numbers and as their encoding.
    const SAVED: u64 = 100;
    const LAYERS: u64 = 170;
    let each = if options.features { SAVED + LAYERS } else { SAVED };
    // Each channel of the film as numbers and as their encoding, while its sums are held.
    const CHANNEL: u64 = 16;
    let pixels = options.bounds()?.area();
    let channels = pixels.saturating_mul(CHANNEL * options.film_channels() as u64);
    Ok(options.memory_bytes()?.max(pixels.saturating_mul(each)).saturating_add(channels))
}

/// Bytes that are left for what is asked for next: in the machine, in its control groups, and by what the system grants
/// (`ulimit -v`).
pub fn memory_left() -> u64 {
    let memory = Memory::new(None);
    if memory.bound == Bound::AddressSpace { memory.usable() } else { memory.most }
}

/// Refuses a picture that would not fit into the memory that is free, while it is rendered, saved or shown. `held`
/// bytes are held already.
///
/// # Errors
/// [`Failure::Limit`] with the prediction, and [`Failure::Usage`] for options that make no picture.
pub fn check_picture(options: &RenderOptions, held: u64) -> Result<(), Failure> {
    Memory::new(None).check_picture(options, held)
}

/// Bytes of memory that are free, or can be made so; `None` if the system does not report it.
fn available_memory() -> Option<u64> {
    let memory = fs::read_to_string("/proc/meminfo").ok()?;
    let kibibytes = |name: &str| {
        let value = memory.lines().find_map(|line| line.strip_prefix(name))?;
        value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    };
    let swap = kibibytes("SwapFree:").unwrap_or(0);
    Some(kibibytes("MemAvailable:")?.saturating_add(swap).saturating_mul(1024))
}

/// Bytes that are left in the control groups of the process and in those around them; `None` if none has a limit.
/// `root` is the folder of the system's files.
fn group_memory_left(root: &Path) -> Option<u64> {
    let groups = fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    let left = groups.lines().flat_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next().unwrap_or(""), parts.next().unwrap_or(""));
        let mounts: &[&str] = match controllers {
            // Version 2, also if version 1 is mounted too.
            "" => &["sys/fs/cgroup", "sys/fs/cgroup/unified"],
            _ if controllers.split(',').any(|name| name == "memory") => &["sys/fs/cgroup/memory"],
            _ => &[],
        };
        // In a container, the path may be one outside, and the root here is the container's own group.
        let folders = Path::new(path.trim_start_matches('/')).ancestors();
        folders.flat_map(|inner| mounts.iter().map(move |mount| root.join(mount).join(inner)))
    });
    left.filter_map(|folder| left_in(&folder)).min()
}

/// Bytes that are left in the control group of this folder; `None` if it has no limit.
fn left_in(folder: &Path) -> Option<u64> {
    let number = |file: &str| fs::read_to_string(folder.join(file)).ok()?.trim().parse::<u64>().ok();
    let limit = number("memory.max").or_else(|| number("memory.limit_in_bytes"))?;
    // Version 1 writes about 2^63 for none.
    if limit > i64::MAX as u64 / 2 {
        return None;
    }
    let used = number("memory.current").or_else(|| number("memory.usage_in_bytes")).unwrap_or(0);
    // Files in the cache count, and are dropped when memory is asked for.
    let stat = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let cached = ["total_inactive_file ", "inactive_file "]
        .into_iter()
        .find_map(|name| stat.lines().find_map(|line| line.strip_prefix(name)?.trim().parse::<u64>().ok()));
    Some(limit.saturating_sub(used.saturating_sub(cached.unwrap_or(0))))
}

/// Bytes of address space that the system still grants the process; `None` if it sets no limit or does not report it.
pub(crate) fn address_space_left() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let soft = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let soft: u64 = soft.split_whitespace().next()?.parse().ok()?;
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let size = status.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
    let size: u64 = size.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(soft.saturating_sub(size * 1024))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_large_pictures_are_refused_with_a_prediction() {
        let memory = Memory { most: 1000, bound: Bound::Flag };
        assert!(memory.check("the picture", 700, 300).is_ok());
        let message = memory.check("the picture", 701, 300).unwrap_err().to_string();
        assert_eq!(
            message,
            "the picture: needs 701 bytes of memory, 700 are left; raise it with --max-memory"
        );
        // The system counts what is held itself.
        let memory = Memory { most: 1000, bound: Bound::Machine };
        assert!(memory.check("the tree", 1000, 5000).is_ok() && memory.check("the tree", 1001, 0).is_err());
        let memory = Memory { most: 1000, bound: Bound::Group };
        let message = memory.check("the tree", 1001, 0).unwrap_err().to_string();
        assert!(message.contains("--max-memory (but the control group"), "{message}");
        let memory = Memory { most: RESERVE + 1000, bound: Bound::AddressSpace };
        assert!(memory.check("the tree", 750, 5000).is_ok());
        let message = memory.check("the tree", 751, 0).unwrap_err().to_string();
        assert!(message.contains("ulimit -v"), "{message}");
    }

    #[test]
    fn the_system_limit_is_named_only_if_it_is_the_cause() {
        let explained = |memory: Memory, kind: LimitKind| {
            let limit = lumbre::formats::LimitError { what: "a.ply".to_owned(), kind, needed: 9, limit: 5 };
            memory.explain(lumbre::Error::Format(limit.into())).to_string()
        };
        let tight = Memory { most: RESERVE + 1000, bound: Bound::AddressSpace };
        assert!(
            explained(tight, LimitKind::Memory)
                .ends_with("--max-memory (but the system grants no more: see ulimit -v)")
        );
        assert!(explained(tight, LimitKind::Elements).ends_with("--max-elements"));
        // So much that what reading takes by default is less.
        let wide = Memory { most: 64 << 30, bound: Bound::AddressSpace };
        assert!(explained(wide, LimitKind::Memory).ends_with("--max-memory"));
        let group = Memory { most: 1000, bound: Bound::Group };
        assert!(explained(group, LimitKind::Memory).contains("memory.max"));
        assert!(explained(group, LimitKind::Nesting).ends_with("--max-nesting"));
    }

    #[test]
    fn the_tightest_of_the_control_groups_counts() {
        let root = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| {
            let path = root.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let left = || group_memory_left(root.path());
        assert_eq!(left(), None);
        write("proc/self/cgroup", "0::/outer/inner\n");
        assert_eq!(left(), None);
        // Version 2: the limit of the parent group, where cached files count as free.
        write("sys/fs/cgroup/outer/inner/memory.max", "max\n");
        write("sys/fs/cgroup/outer/memory.max", "5000\n");
        write("sys/fs/cgroup/outer/memory.current", "3000\n");
        write("sys/fs/cgroup/outer/memory.stat", "anon 7\ninactive_file 400\n");
        assert_eq!(left(), Some(2400));
        write("sys/fs/cgroup/outer/inner/memory.max", "900\n");
        assert_eq!(left(), Some(900));
        // A container whose path is one outside.
        write("proc/self/cgroup", "0::/elsewhere\n");
        assert_eq!(left(), None);
        write("sys/fs/cgroup/memory.max", "70\n");
        assert_eq!(left(), Some(70));
        // Version 1.
        write("proc/self/cgroup", "7:cpu:/a\n4:cpuset,memory:/pod/x\n");
        assert_eq!(left(), None);
        write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
        write("sys/fs/cgroup/memory/pod/x/memory.limit_in_bytes", "8000\n");
        write("sys/fs/cgroup/memory/pod/x/memory.usage_in_bytes", "6000\n");
        write("sys/fs/cgroup/memory/pod/x/memory.stat", "inactive_file 1\ntotal_inactive_file 500\n");
        assert_eq!(left(), Some(2500));
    }
}
