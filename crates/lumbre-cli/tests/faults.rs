//! Disks that fail: whatever call does not work, every file is the old one or the new one, and a render goes on to the
//! same bytes.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::files::{Folder, answer};
use crate::parts::{bytes, done, folder};

const RENDER: &str = "render scene.pbrt --size 20x14 --spp 40 --threads 1 -q --progress none -o out.exr --checkpoint ck \
                      --checkpoint-every 5ms";

/// What the system does with a call. (Short writes are tried where the calls are made, in the crate that reads and
/// writes.)
const FAULTS: [&str; 9] = [
    // Of libraries, of the scene, and of what is written: there are many.
    "openat:error=ENOSPC",
    "write:error=ENOSPC",
    "write:error=EIO",
    "write:error=EINTR",
    "write:signal=KILL",
    "fsync:error=EIO",
    "fsync:signal=KILL",
    "/^rename:error=EIO",
    "/^rename:signal=KILL",
];

/// Whether strace is there and may trace.
fn can_trace() -> bool {
    let tried = Command::new("strace").args(["-o", "/dev/null", "true"]).stderr(Stdio::null()).status();
    tried.is_ok_and(|status| status.success())
}

/// The render with the `k`-th of such calls failing in each thread, that of the picture and those that write
/// checkpoints, and how many the thread with the most of them had.
fn with_fault(folder: &Folder, fault: &str, k: u32) -> (i32, String, u32) {
    let calls = fault.split(':').next().unwrap();
    let program = env!("CARGO_BIN_EXE_lumbre");
    let mut command = Command::new("strace");
    command.args(["-f", "-qq", "-o", "trace", "-e", &format!("trace={calls}")]);
    command.args(["-e", &format!("inject={fault}:when={k}"), program]).args(RENDER.split_whitespace());
    command.current_dir(folder.path(".")).stdin(Stdio::null());
    let (status, said) = answer(command.output().unwrap());
    let name = calls.trim_start_matches("/^");
    let trace = fs::read_to_string(folder.path("trace")).unwrap();
    let mut counts = std::collections::BTreeMap::new();
    for line in trace.lines() {
        let mut words = line.split_whitespace();
        if let (Some(thread), Some(true)) = (words.next(), words.next().map(|call| call.starts_with(name))) {
            *counts.entry(thread).or_insert(0) += 1;
        }
    }
    (status, said, counts.into_values().max().unwrap_or(0))
}

/// Every call of a render that writes, syncs or renames fails once: a render with a checkpoint, and with a picture to
/// replace.
#[test]
fn a_failed_call_leaves_the_old_or_the_new_file() {
    if !can_trace() {
        println!("skipped: strace is not here, or may not trace");
        return;
    }
    let folder = folder();
    done(
        &folder,
        &RENDER.replace("--spp 40", "--spp 2").replace("--checkpoint ck --checkpoint-every 5ms", ""),
    );
    let old = bytes(&folder, "out.exr");
    done(&folder, RENDER);
    let new = bytes(&folder, "out.exr");
    assert_ne!(old, new);
    let (mut failed, mut ended_well) = (0, 0);
    let long = std::env::var_os("LUMBRE_LONG_TESTS").is_some();
    for fault in FAULTS.iter().filter(|fault| long || !fault.starts_with("openat")) {
        let (mut k, mut calls) = (1, 1);
        while k <= calls {
            fs::write(folder.path("out.exr"), &old).unwrap();
            let _ = fs::remove_file(folder.path("ck"));
            let (status, said, count) = with_fault(&folder, fault, k);
            let what = format!("{fault}, call {k} of {count}: {status}, {said}");
            assert!(!said.contains("panicked"), "{what}");
            calls = calls.max(count);
            let found = bytes(&folder, "out.exr");
            assert!(found == new || (status != 0 && found == old), "{what}");
            // What is refused is said; what the disk swallowed, or was tried again, is no failure. Where its libraries
            // do not open, the system ends it.
            let is_said = said.contains("error: ") || (status == 127 && said.contains("shared libraries"));
            assert!(
                [0, 3, 4, 127, 137].contains(&status) && ([0, 137].contains(&status) || is_said),
                "{what}"
            );
            if status == 0 {
                ended_well += 1
            } else {
                failed += 1
            }
            done(&folder, &format!("{RENDER} --resume"));
            assert_eq!(bytes(&folder, "out.exr"), new, "{what}");
            let left = folder.names().into_iter().filter(|name| name.contains(".lumbre.part")).count();
            assert_eq!(left, 0, "{what}: {:?}", folder.names());
            for name in folder.names().into_iter().filter(|name| name.contains(".rescued.")) {
                fs::remove_file(folder.path(&name)).unwrap();
            }
            k += 1;
        }
    }
    println!("{failed} renders failed, {ended_well} ended well all the same");
    assert!(failed > 5 && ended_well > 5, "{failed} {ended_well}");
}

/// A file system of its own, where the system grants one.
struct Mount(std::path::PathBuf);

impl Mount {
    fn new(at: &Path, options: &str) -> Option<Self> {
        fs::create_dir_all(at).unwrap();
        let mount =
            Command::new("mount").args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(at).output().ok()?;
        mount.status.success().then(|| Self(at.to_owned()))
    }

    fn remount(&self, options: &str) {
        let mount = Command::new("mount").args(["-o", &format!("remount,{options}")]).arg(&self.0).status();
        assert!(mount.unwrap().success());
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_keeps_the_old_picture_and_the_pixels() {
    let folder = folder();
    let Some(_mount) = Mount::new(&folder.path("full"), "size=16k") else {
        println!("skipped: no file system may be mounted");
        return;
    };
    done(&folder, "render scene.pbrt --size 8x6 --spp 1 -q -o full/a.pfm");
    let old = bytes(&folder, "full/a.pfm");
    // 36 KB into what is left of 16.
    let (status, said) =
        folder.lumbre(&["render", "scene.pbrt", "--size", "64x48", "--spp", "2", "-o", "full/a.pfm"]);
    assert!(status == 4 && said.contains("full/a.pfm") && said.contains("No space left"), "{status} {said}");
    assert_eq!(bytes(&folder, "full/a.pfm"), old);
    assert_eq!(fs::read_dir(folder.path("full")).unwrap().count(), 1, "nothing else is left there");
    if said.contains("are saved in") {
        done(&folder, "merge a.pfm.rescued.0.part -o b.pfm");
        done(&folder, "render scene.pbrt --size 64x48 --spp 2 -q -o c.pfm");
        assert_eq!(bytes(&folder, "b.pfm"), bytes(&folder, "c.pfm"));
    }
}

#[test]
fn a_full_disk_is_a_failure_of_files_for_whatever_is_written() {
    let folder = folder();
    done(&folder, "render scene.pbrt --size 64x48 --samples 0..2 -q -o a.part");
    done(&folder, "render scene.pbrt --size 64x48 --spp 2 -q -o b.exr");
    let rays: String = (0..2000).map(|i| format!("0,-6,{},0,1,0\n", f64::from(i) / 1000.0)).collect();
    folder.write("rays.csv", &format!("ox,oy,oz,dx,dy,dz\n{rays}"));
    let Some(_mount) = Mount::new(&folder.path("full"), "size=8k") else {
        println!("skipped: no file system may be mounted");
        return;
    };
    for command in [
        "merge a.part -o full/a.pfm",
        "merge a.part -o full/a.part",
        "view scene.pbrt --size 64x48 --spp 2 --export full/page",
        "cast scene.pbrt --rays rays.csv -o full/hits.csv",
        "diff b.exr b.exr -o full/d.pfm",
        "render scene.pbrt --size 64x48 --spp 2 -o full/a.pfm --no-checkpoint",
        "render scene.pbrt --size 64x48 --spp 2 -o c.pfm --stats /dev/full",
        "info scene.pbrt",
    ] {
        let arguments: Vec<&str> = command.split_whitespace().collect();
        let mut command_line = folder.command(&arguments);
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let (status, said) = answer(command_line.stdout(full).output().unwrap());
        assert!(status == 4 && said.contains("No space left"), "{command}: {status} {said}");
    }
}

#[test]
fn a_disk_that_takes_nothing_is_found_out_before_rendering() {
    let folder = folder();
    let Some(mount) = Mount::new(&folder.path("fixed"), "size=1m") else {
        println!("skipped: no file system may be mounted");
        return;
    };
    fs::write(folder.path("fixed/a.exr"), "someone's").unwrap();
    mount.remount("ro");
    for output in ["fixed/a.exr", "fixed/b.png"] {
        // This many samples take hours.
        let (status, said) = folder.lumbre(&["render", "scene.pbrt", "--spp", "1000000000", "-o", output]);
        assert!(status == 4 && said.contains(output) && said.contains("Read-only"), "{status} {said}");
    }
    assert_eq!(bytes(&folder, "fixed/a.exr"), b"someone's");
}
